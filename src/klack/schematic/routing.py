"""Wires between two columns: each node has one upright trunk, and level stubs to its ports.

Trunks that pass each other lie on tracks of their own, in the order with fewer crossings.  Wires of
different nodes never run along each other: stubs of one side are at different heights, and those
that meet head on were kept apart (:mod:`klack.schematic.placing`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from klack.schematic.shapes import Point

__all__ = ["Lines", "Run", "channel_width", "crossings", "routed", "runs_between", "tracks_of"]

Lines = tuple[tuple[tuple[Point, Point], ...], tuple[Point, ...]]
"""Lines of a node, and its branches."""

_TRACK, _MARGIN, _NEAR = 10.0, 12.0, 5.0


@dataclass(frozen=True, slots=True)
class Run:
    """Wires of one node between two columns.

    Parameters
    ----------
    left, right
        Heights of its ports in these columns.
    low, high
        Ends of its trunk.
    """

    node: int
    left: tuple[float, ...]
    right: tuple[float, ...]
    low: float = field(init=False)
    high: float = field(init=False)

    def __post_init__(self) -> None:
        ends = (*self.left, *self.right)
        object.__setattr__(self, "low", min(ends))
        object.__setattr__(self, "high", max(ends))

    @property
    def is_straight(self) -> bool:
        """Whether it needs no trunk."""
        return self.low == self.high


def runs_between(
    before: Sequence[tuple[int, float]], after: Sequence[tuple[int, float]]
) -> tuple[Run, ...]:
    """Runs between the right of one column and the left of the next."""
    left: dict[int, list[float]] = {}
    right: dict[int, list[float]] = {}
    for ends, pins in ((left, before), (right, after)):
        for node, y in pins:
            ends.setdefault(node, []).append(y)
    return tuple(
        Run(node, tuple(left.get(node, ())), tuple(right.get(node, ())))
        for node in dict.fromkeys((*left, *right))
    )


def crossings(runs: Sequence[Run]) -> int:
    """Crossings of wires of different nodes, with tracks in order."""
    straight = [run.low for run in runs if run.is_straight]
    order = _trunks(runs)
    over = sum(run.low < y < run.high for run in order for y in straight)
    pairs = ((a, b) for k, a in enumerate(order) for b in order[k + 1 :])
    return over + sum(_crossings(a, b) for a, b in pairs)


def _trunks(runs: Sequence[Run]) -> list[Run]:
    bent = [run for run in runs if not run.is_straight]
    return _ordered(sorted(bent, key=lambda run: (run.low + run.high, run.node)))


def channel_width(tracks: int) -> float:
    """Room between columns for some tracks."""
    return 2 * _MARGIN + _TRACK * max(tracks - 1, 0)


def tracks_of(runs: Sequence[Run]) -> Mapping[int, int]:
    """Tracks by node, from the left."""
    order = _trunks(runs)
    tracks: dict[int, int] = {}
    for k, run in enumerate(order):
        before = [
            tracks[other.node]
            for other in order[:k]
            if other.low - _NEAR < run.high and run.low - _NEAR < other.high
        ]
        tracks[run.node] = max(before, default=-1) + 1
    return tracks


def _ordered(runs: Sequence[Run]) -> list[Run]:
    """Order with few crossings: neighbours change places while that helps."""
    order = list(runs)
    for _ in range(len(order)):
        changed = False
        for k in range(len(order) - 1):
            first, second = order[k], order[k + 1]
            if _crossings(second, first) < _crossings(first, second):
                order[k], order[k + 1] = second, first
                changed = True
        if not changed:
            break
    return order


def _crossings(first: Run, second: Run) -> int:
    over = sum(second.low < y < second.high for y in first.right)
    return over + sum(first.low < y < first.high for y in second.left)


def routed(runs: Sequence[Run], left: float, width: float) -> dict[int, Lines]:
    """Lines and branches by node in a channel from ``left``."""
    tracks = tracks_of(runs)
    used = _TRACK * max(tracks.values(), default=0)
    first = left + 0.5 * (width - used)
    found: dict[int, Lines] = {}
    for run in runs:
        if run.is_straight:
            y = run.low
            begin = left if run.left else left + 0.5 * width
            end = left + width if run.right else left + 0.5 * width
            found[run.node] = ((((begin, y), (end, y)),), ())
            continue
        x = first + _TRACK * tracks[run.node]
        lines: list[tuple[Point, Point]] = [((x, run.low), (x, run.high))]
        lines += [((left, y), (x, y)) for y in run.left]
        lines += [((x, y), (left + width, y)) for y in run.right]
        meet = [*run.left, *run.right]
        branches = tuple(
            (x, y) for y in sorted(set(meet)) if run.low < y < run.high or meet.count(y) > 1
        )
        found[run.node] = (tuple(lines), branches)
    return found
