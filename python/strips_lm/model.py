"""The three models as transformers models: made from a configuration, loaded from a folder, exported.

`double-head` is `GPT2DoubleHeadsModel`, `lm-head` is `GPT2LMHeadModel`, `lstm` is ours; their checkpoints load with
plain `from_pretrained`. Nothing here trains or generates.
"""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from transformers import AutoConfig, GPT2Config, GPT2DoubleHeadsModel, GPT2LMHeadModel, PreTrainedModel
from transformers.utils import logging

from strips_lm._native import DataError
from strips_lm.initialisation import start_from_looking_back, start_from_sinusoids
from strips_lm.lstm import LstmConfig, LstmLMHeadModel

if TYPE_CHECKING:
    from strips_lm.config import ModelConfig
    from strips_lm.tokenizer import PlanTokenizer

logging.disable_progress_bar()  # type: ignore[no-untyped-call]  # a bar for each file that is read or written would tear ours apart

CLASSES: dict[str, type[PreTrainedModel]] = {
    "double-head": GPT2DoubleHeadsModel,
    "lm-head": GPT2LMHeadModel,
    "lstm": LstmLMHeadModel,
}
"""The class of each kind of model."""


class ModelError(DataError):
    """A folder or a name that holds no model of ours."""


def make_model(config: ModelConfig, tokenizer: PlanTokenizer, seed: int) -> PreTrainedModel:
    """A model with random weights, or from `config.initial`, for a tokenizer's vocabulary.

    Raises:
        ModelError: `config.initial` cannot be loaded.
    """
    torch.manual_seed(seed)
    if config.kind == "lstm":
        return LstmLMHeadModel(_lstm_config(config, tokenizer))
    if config.initial:
        return _pretrained(config, tokenizer)
    model = CLASSES[config.kind](_gpt2_config(config, tokenizer))
    if config.positions == "sinusoid":
        start_from_sinusoids(model)
        start_from_looking_back(model, config.previous_token_heads)
    return model


def load_model(folder: str | Path) -> PreTrainedModel:
    """The model of a checkpoint's folder, or of a run's folder (its best checkpoint), in evaluation mode.

    Raises:
        ModelError: the folder holds no checkpoint.
    """
    folder = checkpoint_folder(folder)
    config = AutoConfig.from_pretrained(folder)
    kind = LstmLMHeadModel if isinstance(config, LstmConfig) else _gpt2_class(config)
    model: PreTrainedModel = kind.from_pretrained(folder)
    model.train(False)
    return model


def checkpoint_folder(folder: str | Path) -> Path:
    """The folder with the weights: the one given, or `best` or `last` in it.

    Raises:
        ModelError: there is none.
    """
    for candidate in (Path(folder), Path(folder) / "best", Path(folder) / "last", Path(folder) / "last.old"):
        if (candidate / "config.json").is_file():
            return candidate
    raise ModelError(f"{folder}: no checkpoint\nhint: give a folder that `strips-lm train` wrote")


_NOT_COPIED = {"config.json", "model.safetensors", "generation_config.json", "optimizer.safetensors", "trainer.json"}


def export_lm(folder: str | Path, out: str | Path) -> None:
    """Writes the language model of a checkpoint alone, which `AutoModelForCausalLM` loads without a warning."""
    folder = checkpoint_folder(folder)
    model = load_model(folder)
    if isinstance(model, GPT2DoubleHeadsModel):
        model = _without_choice_head(model)
    model.save_pretrained(out)
    for path in folder.iterdir():
        if path.name not in _NOT_COPIED and path.is_file():
            shutil.copy(path, Path(out) / path.name)


def _without_choice_head(model: GPT2DoubleHeadsModel) -> GPT2LMHeadModel:
    config = GPT2Config.from_dict({**model.config.to_dict(), "architectures": ["GPT2LMHeadModel"]})
    lm = GPT2LMHeadModel(config)
    lm.load_state_dict({k: v for k, v in model.state_dict().items() if not k.startswith("multiple_choice_head")})
    return lm


def _gpt2_class(config: Any) -> type[PreTrainedModel]:
    named = (config.architectures or [""])[0]
    return GPT2DoubleHeadsModel if named == "GPT2DoubleHeadsModel" else GPT2LMHeadModel


def _pretrained(config: ModelConfig, tokenizer: PlanTokenizer) -> PreTrainedModel:
    """Pre-trained weights with rows for our tokens; they start at the mean of the others, as transformers has it."""
    drops: dict[str, Any] = dict.fromkeys(("resid_pdrop", "embd_pdrop", "attn_pdrop"), config.dropout)
    try:
        model: PreTrainedModel = CLASSES[config.kind].from_pretrained(config.initial, **drops)
    except OSError as error:
        raise ModelError(f"no weights `{config.initial}`: {str(error).splitlines()[0]}") from None
    model.resize_token_embeddings(tokenizer.vocab_size)
    model.config.bos_token_id, model.config.eos_token_id = tokenizer.start_id, tokenizer.end_id
    model.config.pad_token_id = tokenizer.end_id
    return model


def _gpt2_config(config: ModelConfig, tokenizer: PlanTokenizer) -> GPT2Config:
    return GPT2Config(
        vocab_size=tokenizer.vocab_size,
        n_positions=config.context,
        n_embd=config.width,
        n_layer=config.layers,
        n_head=config.heads,
        n_inner=config.inner or None,
        activation_function=config.activation,
        resid_pdrop=config.dropout,
        embd_pdrop=config.dropout,
        attn_pdrop=config.dropout,
        summary_first_dropout=config.dropout,
        tie_word_embeddings=config.tied,
        bos_token_id=tokenizer.start_id,
        eos_token_id=tokenizer.end_id,
        pad_token_id=tokenizer.end_id,
    )


def _lstm_config(config: ModelConfig, tokenizer: PlanTokenizer) -> LstmConfig:
    return LstmConfig(
        vocab_size=tokenizer.vocab_size,
        embedding_size=config.width,
        hidden_size=config.inner or 2 * config.width,
        num_hidden_layers=config.layers,
        dropout=config.dropout,
        max_position_embeddings=config.context,
        bos_token_id=tokenizer.start_id,
        eos_token_id=tokenizer.end_id,
        pad_token_id=tokenizer.end_id,
    )
