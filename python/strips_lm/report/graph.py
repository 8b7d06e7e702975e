"""A problem's state graph as inline SVG (Figure 1): layers by distance from the initial state, plans as paths in it.

States of a layer are ordered by where their predecessors stand (the barycentre rule of Sugiyama et al. 1981), which
keeps edges short. The model's states bear the numbers of its steps. Hovering over a state shows its atoms.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

WIDTH, LAYER = 480, 66
"""Width of the drawing, and the distance between two layers."""


@dataclass(frozen=True, slots=True)
class StateGraph:
    """States numbered from 0 (the initial one), each with its atoms and depth, and edges (from, to, operator)."""

    states: Sequence[Sequence[str]]
    depths: Sequence[int]
    goals: Sequence[bool]
    edges: Sequence[tuple[int, int, str]]


def walk(graph: StateGraph, plan: Sequence[str]) -> list[int]:
    """The states that a plan passes, as far as its operators apply."""
    step = {(source, operator): target for source, target, operator in graph.edges}
    path = [0]
    for operator in plan:
        after = step.get((path[-1], operator))
        if after is None:
            break
        path.append(after)
    return path


def draw(graph: StateGraph, plan: Sequence[str], oracle: Sequence[str] = ()) -> str:
    """The drawing, with the states of a model's plan marked and numbered, and the oracle's plan beneath it.

    Where the model's next operator leads out of the graph, because it cannot be applied or because the goal is then too
    far away, its path ends in a cross.
    """
    path, other = walk(graph, plan), walk(graph, oracle)
    places = _places(graph, path)
    lost = len(path) - 1 < len(plan)
    height = (max(graph.depths) + (1.7 if lost else 1)) * LAYER
    parts = [f'<svg class="graph" role="img" aria-label="state graph" viewBox="0 0 {WIDTH} {height:.0f}">']
    parts += [_edge(places, source, target) for source, target, _ in graph.edges]
    parts += [_edge(places, source, target, "oracle") for source, target in itertools.pairwise(other)]
    parts += [_edge(places, source, target, "path") for source, target in itertools.pairwise(path)]
    parts += [_node(graph, places, state) for state in range(len(graph.states)) if state not in path]
    parts += [_cross(*places[path[-1]])] if lost else []
    parts += [_numbered(graph, places, state, path) for state in dict.fromkeys(path)]
    return "".join([*parts, "</svg>"])


def _places(graph: StateGraph, path: Sequence[int]) -> list[tuple[float, float]]:
    """Where each state stands; the plan's run down the middle of their layers as far as they can."""
    before: dict[int, list[int]] = {}
    for source, target, _ in graph.edges:
        if graph.depths[source] < graph.depths[target]:
            before.setdefault(target, []).append(source)
    x = [0.5] * len(graph.states)
    for depth in range(max(graph.depths) + 1):
        layer = [state for state, d in enumerate(graph.depths) if d == depth]
        layer.sort(key=lambda s: (sum(x[p] for p in before.get(s, [s])) / len(before.get(s, [s])), s))
        for rank, state in enumerate(_middle(layer, set(path))):
            x[state] = (rank + 0.5) / len(layer)
    return [(20 + x[s] * (WIDTH - 40), LAYER * (graph.depths[s] + 0.5)) for s in range(len(graph.states))]


def _middle(layer: list[int], path: set[int]) -> list[int]:
    """The layer with its state of the plan, if it has one, moved to the middle."""
    chosen = next((state for state in layer if state in path), None)
    if chosen is None:
        return layer
    rest = [state for state in layer if state != chosen]
    return [*rest[: len(layer) // 2], chosen, *rest[len(layer) // 2 :]]


def _edge(places: list[tuple[float, float]], source: int, target: int, kind: str = "edge") -> str:
    (x1, y1), (x2, y2) = places[source], places[target]
    leave, arrive = (y1 + (y2 - y1) / 2, y2 - (y2 - y1) / 2) if y1 != y2 else (y1 - LAYER / 3, y2 - LAYER / 3)
    curve = f"M{x1:.1f} {y1:.1f}C{x1:.1f} {leave:.1f} {x2:.1f} {arrive:.1f} {x2:.1f} {y2:.1f}"
    return f'<path class="{kind}" d="{curve}"/>'


def _node(graph: StateGraph, places: list[tuple[float, float]], state: int) -> str:
    layer = sum(1 for depth in graph.depths if depth == graph.depths[state])
    size = 6.0 if graph.goals[state] else max(1.2, min(3.5, 0.36 * (WIDTH - 40) / layer))
    x, y = places[state]
    kind = "goal" if graph.goals[state] else "state"
    return f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="{size:.1f}">{_title(graph, state)}</circle>'


def _numbered(graph: StateGraph, places: list[tuple[float, float]], state: int, path: Sequence[int]) -> str:
    """A state of the plan with the last step that led to it."""
    x, y = places[state]
    number = len(path) - 1 - list(reversed(path)).index(state)
    kind = "goal" if graph.goals[state] else "init" if state == 0 else "step"
    return (
        f'<g class="{kind}"><circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="11">{_title(graph, state)}</circle>'
        f'<text x="{x:.1f}" y="{y + 4.5:.1f}">{number}</text></g>'
    )


def _cross(x: float, y: float) -> str:
    """A way out that leads nowhere."""
    below = y + LAYER
    return (
        f'<path class="lost" d="M{x:.1f} {y:.1f}V{below - 8:.1f}"/>'
        f'<path class="cross" d="M{x - 7:.1f} {below - 7:.1f}l14 14m0 -14l-14 14"/>'
    )


def _title(graph: StateGraph, state: int) -> str:
    return f"<title>{escape(', '.join(graph.states[state]))}</title>"
