"""The charts of the report as inline SVG, drawn by matplotlib without a display.

Each chart is drawn twice, for a wide page and for a telephone, and the style sheet shows one of them: text keeps its
size where a single drawing would shrink it. Every colour is a name that the page's style sheet defines, so that one
drawing serves light and dark; text stays text. It knows numbers and labels, not where they come from.
"""

from __future__ import annotations

import io
import re
import textwrap
from contextlib import contextmanager
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Any

from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

COLOURS = {
    "#000001": "var(--ink)",
    "#000002": "var(--faint)",
    "#000003": "var(--line)",
    "#000004": "var(--panel)",
    **{f"#0000{n:02x}": f"var(--s{n - 15})" for n in range(16, 24)},
}
"""What matplotlib is told to draw with, and what the style sheet calls it."""

INK, FAINT, LINE, PANEL = "#000001", "#000002", "#000003", "#000004"
SERIES = [f"#0000{n:02x}" for n in range(16, 24)]
"""Eight colours for eight series."""
MARKERS = "oD^s"
"""A shape for each eight series: of the first eight, of the next, and so on."""

STYLE: Any = {
    "svg.fonttype": "none",
    "svg.hashsalt": "strips-lm",
    "font.family": "sans-serif",
    "font.size": 10,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": LINE,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "grid.color": LINE,
    "grid.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
}


WIDE, NARROW = 8.2, 3.45
"""Widths in inches: 787 and 331 pixels of the page."""


@dataclass(frozen=True, slots=True)
class Share:
    """A share in per cent with its interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Curve:
    """A named line; `dashed` for what is measured on other data than the solid one."""

    name: str
    """What the legend calls it; empty for a line that needs no entry of its own."""
    x: Sequence[float]
    y: Sequence[float]
    colour: int
    dashed: bool = False
    low: Sequence[float] | None = None
    """Lower ends of the intervals around `y`, where there are such."""
    high: Sequence[float] | None = None


def shares(groups: Sequence[str], series: dict[str, list[Share | None]], label: str, title: str) -> str:
    """A dot with its interval for each series in each group: one band a group, one look a series."""

    def draw(width: float) -> str:
        step = 0.72 / max(len(series), 1)
        with _figure(width, 0.75 + len(groups) * (0.17 * len(series) + 0.14)) as (figure, axes):
            for group in range(0, len(groups), 2):
                axes.axhspan(group - 0.5, group + 0.5, color=PANEL, lw=0, zorder=0)
            for index, (name, values) in enumerate(series.items()):
                look = SERIES[index % len(SERIES)], MARKERS[index // len(SERIES) % len(MARKERS)]
                _dots(axes, (index - (len(series) - 1) / 2) * step, look, name, values)
            _group_names(axes, groups, width)
            axes.set(xlim=(-2, 102), xlabel=label)
            _legend(figure, axes, width)
            return _svg(figure, title, width)

    return _both(draw)


def _dots(axes: Any, offset: float, look: tuple[str, str], name: str, values: list[Share | None]) -> None:
    found = [(group + offset, share) for group, share in enumerate(values) if share is not None]
    at, middles = [y for y, _ in found], [share.value for _, share in found]
    errors = [
        [max(0.0, share.value - share.low) for _, share in found],
        [max(0.0, share.high - share.value) for _, share in found],
    ]
    colour, marker = look
    style = {"fmt": marker, "ms": 5, "capsize": 0, "elinewidth": 1.8, "zorder": 3}
    axes.errorbar(middles, at, xerr=errors, color=colour, ecolor=colour, label=name, **style)


def curves(
    lines: Sequence[Curve],
    xlabel: str,
    ylabel: str,
    *,
    log: bool = False,
    percent: bool = False,
    integer: bool = False,
    floors: Sequence[float] = (),
) -> str:
    """Lines over a common axis; a dotted line at each floor."""

    def draw(width: float) -> str:
        with _figure(width, 3.4 if width == WIDE else 3.1) as (figure, axes):
            for line in lines:
                _line(axes, line)
            for number, floor in enumerate(floors):
                axes.axhline(floor, color=FAINT, ls=":", lw=1.4, label="" if number else "floor", zorder=1)
            axes.set(xlabel=xlabel, ylabel=ylabel)
            if log:
                axes.set_yscale("log")
                axes.yaxis.set_major_formatter("{x:g}")
                axes.yaxis.set_minor_formatter(NullFormatter())
            if percent:
                axes.set_ylim(-3, 103)
            if percent or integer:
                axes.xaxis.get_major_locator().set_params(integer=True)
            axes.grid()
            _legend(figure, axes, width)
            return _svg(figure, f"{ylabel} over {xlabel}", width)

    return _both(draw)


def _line(axes: Any, line: Curve) -> None:
    marker = "o" if len(line.x) < 30 else ""
    colour = SERIES[line.colour % len(SERIES)]
    style = {"lw": 1.8, "marker": marker, "ms": 3.5}
    axes.plot(line.x, line.y, "--" if line.dashed else "-", color=colour, label=line.name, **style)
    if line.low is not None and line.high is not None:
        axes.fill_between(line.x, line.low, line.high, color=colour, alpha=0.14, lw=0)


def stacks(groups: Sequence[str], parts: dict[str, list[float]], label: str, title: str) -> str:
    """Horizontal bars of parts that add up: one bar a group, one colour a part."""

    def draw(width: float) -> str:
        lines = max((name.count("\n") + 1 for name in _names(groups, width)), default=1)
        with _figure(width, 0.9 + (0.12 + 0.15 * lines) * len(groups)) as (figure, axes):
            left = [0.0] * len(groups)
            for index, (name, widths) in enumerate(parts.items()):
                colour = SERIES[index % len(SERIES)]
                axes.barh(range(len(groups)), widths, left=left, color=colour, label=name, height=0.7, zorder=2)
                left = [a + b for a, b in zip(left, widths, strict=True)]
            _group_names(axes, groups, width)
            axes.set(xlabel=label)
            _legend(figure, axes, width)
            return _svg(figure, title, width)

    return _both(draw)


def _names(groups: Sequence[str], width: float) -> list[str]:
    """The groups' names, on several lines where there is little room."""
    if width == WIDE:
        return list(groups)
    return ["\n".join(textwrap.wrap(name, 13, break_on_hyphens=True)) for name in groups]


def _group_names(axes: Any, groups: Sequence[str], width: float) -> None:
    axes.set_yticks(range(len(groups)), _names(groups, width))
    axes.tick_params(axis="y", length=0, labelcolor=INK)
    axes.set_ylim(len(groups) - 0.5, -0.5)
    axes.grid(axis="x")
    axes.set_axisbelow(True)


def _both(draw: Callable[[float], str]) -> str:
    return f'<div class="only-wide">{draw(WIDE)}</div><div class="only-narrow">{draw(NARROW)}</div>'


@contextmanager
def _figure(width: float, height: float) -> Iterator[tuple[Figure, Any]]:
    """A figure in the page's style and its axes; sizes in inches."""
    with rc_context(STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        yield figure, figure.subplots()


def _legend(figure: Figure, axes: Any, width: float) -> None:
    """The names above the drawing, in as many columns as fit."""
    handles, labels = axes.get_legend_handles_labels()
    room = int(width * 13)
    columns = max(1, min(len(labels), room // (max(map(len, labels), default=1) + 6)))
    figure.legend(handles, labels, loc="outside upper left", ncols=columns, handlelength=1.2, columnspacing=1.4)


def _svg(figure: Figure, title: str, width: float) -> str:
    """The figure as an SVG element that scales with the page and takes its colours from it."""
    out = io.StringIO()
    figure.savefig(out, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    text = out.getvalue()
    text = text[text.index("<svg") :]
    for colour, name in COLOURS.items():
        text = text.replace(colour, name)
    for name in ("height", "width"):
        text = re.sub(rf'(<svg[^>]*?) {name}="[^"]*"', r"\1", text, count=1)
    text = _unique_ids(text, f"{title}-{'wide' if width == WIDE else 'narrow'}")
    return text.replace("<svg ", f'<svg role="img" aria-label="{escape(title)}" class="chart" ', 1)


def _unique_ids(text: str, title: str) -> str:
    """Ids made the drawing's own, as a page holds several."""
    mark = re.sub(r"\W+", "-", title)
    text = re.sub(r'\bid="', f'id="{mark}-', text)
    return re.sub(r'(href="#|url\(#)', rf"\1{mark}-", text)
