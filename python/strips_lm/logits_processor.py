"""The oracle's mask as a `LogitsProcessor` of transformers, for `model.generate` with any of its strategies.

    ids, legends = tokenizer.encode_prompts(prompts)
    processor = OracleLogitsProcessor(oracle_guide(tokenizer, legends, tasks))
    model.generate(padded, attention_mask=mask, logits_processor=[processor], max_new_tokens=300)

Rows may be sampled, repeated (`num_return_sequences`) and reordered (`num_beams`): what follows a prompt is looked up
by its tokens, not by its row. Our own loop (`--decode masked`) is faster, as it feeds what is forced in one go, and can
do more: with `generate.backtrack=false`, `generate.renew_steps=0` and `generate.shorten=false` it gives the same texts.
Price: an automaton's copy for each token that was chosen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch
from transformers import LogitsProcessor

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from strips_lm.guide import OracleGuide

_Text = tuple[int, tuple[int, ...]]
"""A prompt's number and the tokens after it."""

_Place = tuple[int, tuple[int, ...]] | None
"""A guide's row, and the tokens that are still forced after what it has taken; none for a text that is not allowed, as
beam search keeps some where it has no others."""


class OracleLogitsProcessor(LogitsProcessor):
    """Lets through what begins an executable plan through states not yet visited; serves one call of `generate`.

    A text that has ended goes on with its end token. One that is stuck (nothing may come, and the goal does not hold)
    goes on with `<ACTION>`, so that whatever ends is a valid plan.
    """

    def __init__(self, guide: OracleGuide) -> None:
        """The guide knows the prompts, in the order of the batch's rows."""
        self.guide, self.prompts = guide, len(guide.legends)
        self.start: int | None = None
        self.places: dict[_Text, _Place] = {}

    def __call__(self, input_ids: torch.LongTensor, scores: torch.FloatTensor) -> torch.FloatTensor:
        """The scores with minus infinity for all that may not come.

        Raises:
            ValueError: there are not as many rows as prompts, or a multiple of them.
        """
        if self.start is None:
            self._begin(input_ids)
        repeats, rest = divmod(len(input_ids), self.prompts)
        if rest:
            raise ValueError(f"{len(input_ids)} rows for {self.prompts} prompts")
        texts = [tuple(row) for row in input_ids[:, self.start :].tolist()]
        keys = [(row // repeats, text) for row, text in enumerate(texts)]
        self._follow(keys)
        allowed = torch.from_numpy(self._flags([self.places[key] for key in keys], scores.shape[-1]))
        return scores.masked_fill(~allowed.to(scores.device), -torch.inf)  # type: ignore[return-value]

    def _begin(self, input_ids: torch.Tensor) -> None:
        self.start = input_ids.shape[1]
        rows, forced = self.guide.add(range(self.prompts))
        for prompt, (row, tokens) in enumerate(zip(rows, forced, strict=True)):
            self.places[prompt, ()] = row, tuple(tokens)

    def _follow(self, keys: Sequence[_Text]) -> None:
        """Find the place of each text from that of the text one token shorter; forget all others."""
        found: dict[_Text, _Place] = {}
        for prompt, text in keys:
            known = (prompt, text) in self.places
            found[prompt, text] = (
                self.places[prompt, text] if known else self._advance(self.places[prompt, text[:-1]], text[-1])
            )
        kept = {place[0] for place in found.values() if place}
        self.guide.remove(sorted({place[0] for place in self.places.values() if place} - kept))
        self.places = found

    def _advance(self, place: _Place, token: int) -> _Place:
        if place is None or not self._allowed(place)[token]:
            return None
        row, forced = place
        if forced:
            return row, forced[1:]
        if not self.guide.is_open([row])[0]:
            return place
        row = self.guide.fork(row)
        return row, tuple(self.guide.advance([row], [token])[0])

    def _allowed(self, place: _Place) -> NDArray[np.bool_]:
        """Flags over the tokenizer's vocabulary."""
        row, forced = place or (-1, (self.guide.step,))
        if not forced:
            flags: NDArray[np.bool_] = self.guide.mask([row])[0]
            if flags.any():
                return flags
            forced = (self.guide.end if self.guide.has_ended(row) else self.guide.step,)
        only = np.zeros(len(self.guide.words), dtype=np.bool_)
        only[forced[0]] = True
        return only

    def _flags(self, places: Sequence[_Place], width: int) -> NDArray[np.bool_]:
        """Flags (rows, `width`): a model's vocabulary may be padded beyond the tokenizer's."""
        flags = np.zeros((len(places), width), dtype=np.bool_)
        for index, place in enumerate(places):
            flags[index, : len(self.guide.words)] = self._allowed(place)
        return flags
