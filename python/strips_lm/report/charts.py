"""The charts of the report as inline SVG, drawn by matplotlib without a display.

Every colour is a name that the page's style sheet defines, so that one drawing serves light and dark; text stays text.
It knows numbers and labels, not where they come from.
"""

from __future__ import annotations

import io
import re
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from matplotlib import rc_context
from matplotlib.figure import Figure

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

COLOURS = {
    "#000001": "var(--ink)",
    "#000002": "var(--faint)",
    "#000003": "var(--line)",
    **{f"#0000{n:02x}": f"var(--s{n - 15})" for n in range(16, 24)},
}
"""What matplotlib is told to draw with, and what the style sheet calls it."""

INK, FAINT, LINE = "#000001", "#000002", "#000003"
SERIES = [f"#0000{n:02x}" for n in range(16, 24)]
"""Eight colours for eight series."""

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


@dataclass(frozen=True, slots=True)
class Bar:
    """A share in per cent with its interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Curve:
    """A named line; `dashed` for what is measured on other data than the solid one."""

    name: str
    x: Sequence[float]
    y: Sequence[float]
    colour: int
    dashed: bool = False


def bars(groups: Sequence[str], series: dict[str, list[Bar | None]], label: str) -> str:
    """Horizontal bars with intervals: one group a suite, one colour a series."""
    height = 0.2 + 0.17 * len(groups) * (len(series) + 0.8)
    with _figure(height + 0.6) as (figure, axes):
        step = 1 / (len(series) + 0.8)
        for index, (name, values) in enumerate(series.items()):
            _one_series(axes, index, step, name, values)
        middle = step * (len(series) - 1) / 2
        axes.set_yticks([g + middle for g in range(len(groups))], groups)
        axes.tick_params(axis="y", length=0, labelcolor=INK)
        axes.set(xlim=(0, 100), ylim=(len(groups) - 1 + 1 - step, -step), xlabel=label)
        axes.grid(axis="x")
        _legend(figure, axes)
        return _svg(figure, f"{label} by suite")


def _one_series(axes: Any, index: int, step: float, name: str, values: list[Bar | None]) -> None:
    found = [(group, bar) for group, bar in enumerate(values) if bar is not None]
    at = [group + index * step for group, _ in found]
    colour = SERIES[index % len(SERIES)]
    axes.barh(at, [bar.value for _, bar in found], height=step * 0.85, color=colour, label=name, zorder=2)
    errors = [[bar.value - bar.low for _, bar in found], [bar.high - bar.value for _, bar in found]]
    middles = [bar.value for _, bar in found]
    axes.errorbar(middles, at, xerr=errors, fmt="none", ecolor=INK, elinewidth=1, capsize=1.5, zorder=3)


def curves(lines: Sequence[Curve], xlabel: str, ylabel: str, *, log: bool = False, percent: bool = False) -> str:
    """Lines over a common axis."""
    with _figure(3.1) as (figure, axes):
        for line in lines:
            style = "--" if line.dashed else "-"
            marker = "o" if len(line.x) < 30 else ""
            colour = SERIES[line.colour % len(SERIES)]
            axes.plot(line.x, line.y, style, color=colour, label=line.name, lw=1.6, marker=marker, ms=3)
        axes.set(xlabel=xlabel, ylabel=ylabel)
        if log:
            axes.set_yscale("log")
        if percent:
            axes.set_ylim(-2, 102)
        axes.grid()
        _legend(figure, axes)
        return _svg(figure, f"{ylabel} over {xlabel}")


def stacks(groups: Sequence[str], parts: dict[str, list[float]], label: str) -> str:
    """Horizontal bars of parts that add up: one bar a group, one colour a part."""
    with _figure(0.9 + 0.24 * len(groups)) as (figure, axes):
        left = [0.0] * len(groups)
        for index, (name, widths) in enumerate(parts.items()):
            axes.barh(range(len(groups)), widths, left=left, color=SERIES[index % len(SERIES)], label=name, height=0.75)
            left = [a + b for a, b in zip(left, widths, strict=True)]
        axes.set_yticks(range(len(groups)), groups)
        axes.tick_params(axis="y", length=0, labelcolor=INK)
        axes.set(xlabel=label, ylim=(len(groups) - 0.5, -0.5))
        axes.grid(axis="x")
        axes.set_axisbelow(True)
        _legend(figure, axes)
        return _svg(figure, label)


@contextmanager
def _figure(height: float) -> Iterator[tuple[Figure, Any]]:
    """A figure in the page's style, 7 inches wide, and its axes."""
    with rc_context(STYLE):
        figure = Figure(figsize=(7, height), layout="constrained")
        yield figure, figure.subplots()


def _legend(figure: Figure, axes: Any) -> None:
    """The names above the drawing, in as many columns as fit."""
    handles, labels = axes.get_legend_handles_labels()
    columns = max(1, min(len(labels), 95 // (max(map(len, labels), default=1) + 6)))
    figure.legend(handles, labels, loc="outside upper left", ncols=columns, fontsize=9, handlelength=1.2)


def _svg(figure: Figure, title: str) -> str:
    """The figure as an SVG element that scales with the page and takes its colours from it."""
    out = io.StringIO()
    figure.savefig(out, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    text = out.getvalue()
    text = text[text.index("<svg") :]
    for colour, name in COLOURS.items():
        text = text.replace(colour, name)
    text = re.sub(
        r'(<svg[^>]*?) width="[^"]*"', r"\1", re.sub(r'(<svg[^>]*?) height="[^"]*"', r"\1", text, count=1), count=1
    )
    text = _unique_ids(text, title)
    return text.replace("<svg ", f'<svg role="img" aria-label="{title}" class="chart" ', 1)


def _unique_ids(text: str, title: str) -> str:
    """Ids made the drawing's own, as a page holds several."""
    mark = re.sub(r"\W+", "-", title)
    text = re.sub(r'\bid="', f'id="{mark}-', text)
    return re.sub(r'(href="#|url\(#)', rf"\1{mark}-", text)
