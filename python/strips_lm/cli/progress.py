"""Progress on stderr: a bar on a terminal, a line for each finished thing elsewhere."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    Tell = Callable[[str], None]
    Tick = Callable[[str, int, int], None]


@contextmanager
def progress() -> Iterator[tuple[Tell, Tick]]:
    """Two functions: `tell(line)`, and `tick(what, done, total)` which moves the bar of `what`."""
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn  # noqa: PLC0415

    console = Console(file=sys.stderr, highlight=False)
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=None)

        def tick(what: str, done: int, total: int) -> None:
            bar.update(task, description=what, completed=done, total=total)

        def tell(line: str) -> None:
            console.print(line, markup=False, soft_wrap=True)

        yield tell, tick
