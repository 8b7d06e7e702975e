"""The decoder of small GPT-2 models on a CPU: the calls of `gpt2.Gpt2Decoder`, over the native forward pass.

PyTorch spends most of a small model's step between its operations; here a step is one call that takes one core and
gives up the interpreter's lock. Logits of a row do not depend on what is beside it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import torch

from strips_lm._native import Gpt2Rows, Gpt2Weights

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from torch import Tensor, nn

ACTIVATIONS: dict[str, Literal["gelu_new", "relu", "relu2"]] = {
    "gelu_new": "gelu_new",
    "gelu_pytorch_tanh": "gelu_new",
    "relu": "relu",
    "relu2": "relu2",
}
"""Of transformers' names of activations those that there are, and what they are called."""

WIDEST = 512
"""Wider models are left to PyTorch: their matrix products are what a step consists of."""

ROWS = 32
"""Rows that are best given a token each at a time: the keys and values of more do not stay in a processor's caches."""


def fits(model: Any) -> bool:
    """Whether a GPT-2 is small, on a CPU, in float32, and of parts that there are."""
    config = model.config
    plain = model.device.type == "cpu" and model.dtype == torch.float32 and config.n_embd <= WIDEST
    return plain and config.activation_function in ACTIVATIONS and getattr(model.lm_head, "bias", None) is None


def pack(model: Any) -> Gpt2Weights:
    """The weights of a model that fits, packed for this processor; later changes of the model do not reach them."""
    body, config = model.transformer, model.config
    scale = (config.n_embd // config.n_head) ** -0.5 if config.scale_attn_weights else 1.0
    inverse = config.scale_attn_by_inverse_layer_idx
    return Gpt2Weights(
        [_block(block) for block in body.h],
        _floats(body.wte.weight),
        _floats(body.wpe.weight),
        (_floats(body.ln_f.weight), _floats(body.ln_f.bias)),
        _floats(model.lm_head.weight),
        heads=config.n_head,
        scales=[scale / (i + 1) if inverse else scale for i in range(len(body.h))],
        activation=ACTIVATIONS[config.activation_function],
        epsilon=config.layer_norm_epsilon,
    )


def _block(block: Any) -> list[NDArray[np.float32]]:
    """The arrays of one block, in the order that `Gpt2Weights` names."""
    layers: list[nn.Module] = [
        block.ln_1,
        block.attn.c_attn,
        block.attn.c_proj,
        block.ln_2,
        block.mlp.c_fc,
        block.mlp.c_proj,
    ]
    return [_floats(part) for layer in layers for part in (layer.weight, layer.bias)]


def _floats(weight: Any) -> NDArray[np.float32]:
    found: NDArray[np.float32] = weight.detach().contiguous().numpy()
    return found


class Gpt2CpuDecoder:
    """Next-token logits of a packed GPT-2 over rows of text."""

    def __init__(self, weights: Gpt2Weights, rows: int) -> None:
        """A decoder whose `rows` rows have read nothing."""
        self.rows = Gpt2Rows(weights, rows)
        self.context = weights.context
        self.lengths = torch.zeros(rows, dtype=torch.long)

    def feed(self, first: int, ids: Tensor, counts: Tensor) -> Tensor:
        """Append tokens (n, m), padded to the right, `counts` of them real; logits (n, vocabulary) after the last."""
        found = torch.from_numpy(self.rows.feed(first, ids.numpy(), counts.numpy()))
        self.lengths[first : first + len(ids)] += counts
        return found

    def move(self, sources: Tensor, targets: Tensor) -> None:
        """Copy the rows `sources` over the rows `targets`."""
        self.rows.move(sources.tolist(), targets.tolist())
        self.lengths[targets] = self.lengths[sources]

    def clear(self, first: int, count: int) -> None:
        """Forget the tokens of the rows `first` to `first + count`."""
        for row in range(first, first + count):
            self.rewind(row, 0)

    def rewind(self, row: int, count: int) -> int:
        """Forget the tokens of a row but the first `count`; how many are left."""
        self.rows.rewind(row, count)
        self.lengths[row] = count
        return count
