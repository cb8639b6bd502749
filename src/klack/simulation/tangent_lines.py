"""Delay lines while the steps of a run stretch: what their memory holds belongs to other times.

A line keeps its waves as means over fine steps.  Where these are longer by a share ``c``, a wave
that was sent ``a`` steps ago is one of an earlier time, ``- a c h`` of its slope.
"""

from typing import Any

import numpy as np

from klack.arrays import Vector
from klack.simulation.delay_line import Lines, LineState, start_lines

__all__ = [
    "begin_stretch",
    "delay_slopes",
    "end_stretch",
    "later_delays",
    "steady_waves",
    "waves_under_way",
]


def delay_slopes(lines: Lines) -> Vector:
    """Change of :attr:`Lines.fraction` with the logarithm of the step: the delays stay.

    Only the last segment of a line has a fraction of a step, and takes the change of all.
    """
    delays = lines.depth - 1.0 + lines.fraction
    found = np.zeros(len(delays))
    for begin, end in zip(lines.first_segment[:-1], lines.first_segment[1:], strict=True):
        found[end - 1] = -float(delays[begin:end].sum())
    return found


def later_delays(base: Lines, other: Lines) -> Vector:
    """How much longer the delays of other lines are, in steps of segments as those of the base.

    As in :func:`delay_slopes` the last segment of a line takes the change of all.
    """
    longer = (other.depth + other.fraction) - (base.depth + base.fraction)
    found = np.zeros(len(longer))
    for begin, end in zip(base.first_segment[:-1], base.first_segment[1:], strict=True):
        found[end - 1] = float(longer[begin:end].sum())
    return found


def steady_waves(base: Any, other: Any, flow: Vector) -> Vector:
    """Waves of lines with a steady flow, in a memory as that of the base.

    Parameters
    ----------
    base, other : NetworkArrays
        With segments of equal numbers; the delays may differ.
    flow : array [m^3/s]
        In each line of the other network, which is at rest.
    """
    lines = other.lines._replace(
        first_segment=base.lines.first_segment,
        depth=base.lines.depth,
        fraction=base.lines.fraction + later_delays(base.lines, other.lines),
        start=base.lines.start,
    )
    own = other.line_state
    state = own._replace(
        samples=np.zeros(len(base.line_state.samples)),
        head=own.head.copy(),
        memory=own.memory.copy(),
        cavity=own.cavity.copy(),
    )
    if len(lines.node):
        pressure = other.nodes.density * other.node_state.g[other.nodes.end_node]
        start_lines(lines, state, pressure, flow)
    return state.samples


def waves_under_way(lines: Any, state: Any) -> list[Any]:
    """Samples of all waves that have not arrived, where they lie now; the others mean nothing."""
    return [window for window, _ in _memory(lines, state)]


def begin_stretch(lines: Any, state: Any, lane: int) -> None:
    """Let the waves in memory be those of steps that have been longer all the time."""
    for window, sent in _memory(lines, state):
        window[:, lane] = -sent * _change(window[:, 0])


def end_stretch(lines: Any, state: Any, lane: int) -> None:
    """Let the waves in memory be those of steps that are no longer, whatever they were."""
    for window, sent in _memory(lines, state):
        window[:, lane] += sent * _change(window[:, 0])


def _change(waves: Vector) -> Vector:
    """Change of the waves from one fine step to the next."""
    return np.asarray(np.gradient(waves)) if len(waves) > 1 else np.zeros(len(waves))


def _memory(lines: Lines, state: LineState) -> list[tuple[Any, Vector]]:
    """Samples under way of each wave, and how many steps ago each was sent into the line."""
    found = []
    delays = lines.depth - 1.0 + lines.fraction[..., 0]
    for begin, end in zip(lines.first_segment[:-1], lines.first_segment[1:], strict=True):
        for s in range(begin, end):
            depth = int(lines.depth[s])
            age = depth - 0.5 - np.arange(depth)
            for wave, before in ((0, delays[begin:s].sum()), (1, delays[s + 1 : end].sum())):
                first = lines.start[s, wave] + state.head[s]
                found.append((state.samples[first : first + depth], age + before))
    return found
