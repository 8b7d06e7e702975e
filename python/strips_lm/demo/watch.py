"""A planner that tells what it writes while it writes it.

It looks over the decoder's shoulder: what a loop feeds is what the text holds so far, whatever the way of decoding.
Only a single row is followed; several samples at once are not. An exception from the listener ends the decoding.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from strips_lm.generate import Planner

if TYPE_CHECKING:
    from collections.abc import Callable

    from torch import Tensor

    from strips_lm.decode import Decoder


class WatchedDecoder:
    """A `Decoder` that reports the tokens of its first row as long as that is the only one."""

    def __init__(self, inner: Decoder, listen: Callable[[list[int]], None]) -> None:
        """`listen` gets prompt and text so far after each call of the model; an empty list where rows are many."""
        self.inner, self.listen, self.held = inner, listen, list[int]()
        self.context, self.lengths = inner.context, inner.lengths

    def feed(self, first: int, ids: Tensor, counts: Tensor) -> Tensor:
        """Append tokens to the rows from `first` on; the logits after the last of each."""
        logits = self.inner.feed(first, ids, counts)
        alone = first == 0 and len(ids) == 1
        if alone:
            self.held += ids[0, : int(counts[0])].tolist()
        self.listen(self.held if alone else [])
        return logits

    def move(self, sources: Tensor, targets: Tensor) -> None:
        """Copy rows over rows."""
        self.inner.move(sources, targets)

    def clear(self, first: int, count: int) -> None:
        """Empty rows."""
        self.held = [] if first == 0 else self.held
        self.inner.clear(first, count)

    def rewind(self, row: int, count: int) -> int:
        """Forget a row's tokens but the first `count`, or all where that cannot be; how many are left."""
        left = self.inner.rewind(row, count)
        self.held = self.held[:left] if row == 0 else self.held
        return left


class WatchedPlanner(Planner):
    """A `Planner` whose decoders report to `listen`."""

    listen: Callable[[list[int]], None] = staticmethod(lambda _: None)

    def _decoder(self, rows: int) -> Decoder:
        return WatchedDecoder(super()._decoder(rows), self.listen)
