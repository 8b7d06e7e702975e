"""The report's weak baseline: an embedding, two LSTM layers and a dense layer, as a transformers model.

`LstmConfig` and `LstmLMHeadModel` are registered with the Auto classes when this module is imported, so that
`AutoModelForCausalLM.from_pretrained` finds a checkpoint of this kind.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F
from transformers import AutoConfig, AutoModelForCausalLM, PretrainedConfig, PreTrainedModel
from transformers.utils.generic import ModelOutput


class LstmConfig(PretrainedConfig):  # type: ignore[no-untyped-call]
    """Sizes of the LSTM language model."""

    model_type = "strips-lstm"

    def __init__(
        self,
        *,
        vocab_size: int = 256,
        embedding_size: int = 128,
        hidden_size: int = 256,
        num_hidden_layers: int = 2,
        dropout: float = 0.0,
        max_position_embeddings: int = 1024,
        **kwargs: Any,
    ) -> None:
        """Keep the sizes; `max_position_embeddings` bounds the records that the model is shown, not the model."""
        self.vocab_size = vocab_size
        self.embedding_size = embedding_size
        self.hidden_size = hidden_size
        self.num_hidden_layers = num_hidden_layers
        self.dropout = dropout
        self.max_position_embeddings = max_position_embeddings
        super().__init__(**kwargs)


@dataclass
class LstmOutput(ModelOutput):
    """Logits (rows, length, vocabulary), the state to go on from, and the mean loss where labels were given."""

    loss: Tensor | None = None
    logits: Tensor | None = None
    state: tuple[Tensor, Tensor] | None = None


class LstmLMHeadModel(PreTrainedModel):  # type: ignore[no-untyped-call]
    """Embedding → LSTM layers → dense."""

    config_class = LstmConfig
    base_model_prefix = "lstm"

    def __init__(self, config: LstmConfig) -> None:
        """Build the layers, with the initial weights of PyTorch's own LSTM and a forget gate that starts open."""
        super().__init__(config)
        self.embedding = nn.Embedding(config.vocab_size, config.embedding_size)
        self.lstm = nn.LSTM(
            config.embedding_size,
            config.hidden_size,
            config.num_hidden_layers,
            batch_first=True,
            dropout=config.dropout if config.num_hidden_layers > 1 else 0.0,
        )
        self.lm_head = nn.Linear(config.hidden_size, config.vocab_size)
        self.post_init()  # type: ignore[no-untyped-call]

    @torch.no_grad()
    def _init_weights(self, module: nn.Module) -> None:
        if isinstance(module, nn.Embedding):
            nn.init.normal_(module.weight, std=0.1)
        elif isinstance(module, nn.LSTM):
            _open_forget_gates(module)

    def hidden_at(self, input_ids: Tensor, at: Tensor) -> Tensor:
        """Hidden states (len(at), hidden size) of the flattened positions `at`."""
        hidden, _ = self.lstm(self.embedding(input_ids))
        flat: Tensor = hidden.reshape(-1, hidden.shape[-1])
        return flat[at]

    def forward(
        self,
        input_ids: Tensor,
        state: tuple[Tensor, Tensor] | None = None,
        labels: Tensor | None = None,
        **_: Any,
    ) -> LstmOutput:
        """Logits of every position; `state` continues an earlier call, `labels` are shifted as transformers does."""
        hidden, state = self.lstm(self.embedding(input_ids), state)
        logits = self.lm_head(hidden)
        loss = None if labels is None else F.cross_entropy(logits[:, :-1].flatten(0, 1), labels[:, 1:].flatten())
        return LstmOutput(loss=loss, logits=logits, state=state)


def _open_forget_gates(lstm: nn.LSTM) -> None:
    """Uniform weights of scale 1/sqrt(hidden); the forget gate's bias starts at one (Jozefowicz et al. 2015)."""
    scale = lstm.hidden_size**-0.5
    for name, parameter in lstm.named_parameters():
        nn.init.uniform_(parameter, -scale, scale)
        if name.startswith("bias_ih"):
            parameter[lstm.hidden_size : 2 * lstm.hidden_size].fill_(1.0)


AutoConfig.register(LstmConfig.model_type, LstmConfig, exist_ok=True)
AutoModelForCausalLM.register(LstmConfig, LstmLMHeadModel, exist_ok=True)
