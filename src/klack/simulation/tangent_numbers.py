"""The numbers of a network with their derivatives, before the first step.

While the steps of a run stretch, the memory of delay lines belongs to other times: a line keeps its
waves as means over fine steps.  Where these are longer by a share ``c``, a wave sent ``a`` steps
ago is one of an earlier time, ``- a c h`` of its slope.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Vector
from klack.errors import InputError
from klack.network.rows import Rows
from klack.simulation.delay_line import Lines, LineState, start_lines
from klack.simulation.modal_step import ROW, ROW_V
from klack.simulation.network_arrays import NetworkArrays
from klack.simulation.network_compile import CompiledNetwork, compile_network
from klack.simulation.static_start import RestState, begin_at_rest
from klack.simulation.step_sizes import StepSizes
from klack.simulation.tangent_loop import lanes_of, tangent_address

__all__ = [
    "STRETCH",
    "Direction",
    "TangentNumbers",
    "arrays_of",
    "begin_stretch",
    "end_stretch",
    "lifted",
    "mode_places",
    "numbers_at_rest",
    "set_stretch",
    "slopes_at_rest",
    "state_arrays",
    "waves_under_way",
]


def delay_slopes(lines: Lines) -> Vector:
    """Change of :attr:`Lines.fraction` with the logarithm of the step, at constant delays.

    Only the last segment of a line has a fraction of a step, and takes the change of all.
    """
    delays = lines.depth - 1.0 + lines.fraction
    found = np.zeros(len(delays))
    for begin, end in zip(lines.first_segment[:-1], lines.first_segment[1:], strict=True):
        found[end - 1] = -float(delays[begin:end].sum())
    return found


def later_delays(base: Lines, other: Lines) -> Vector:
    """Excess of the delays of other lines, in steps of segments as those of the base.

    The last segment of a line takes the change of all, as in :func:`delay_slopes`.
    """
    longer = (other.depth + other.fraction) - (base.depth + base.fraction)
    found = np.zeros(len(longer))
    for begin, end in zip(base.first_segment[:-1], base.first_segment[1:], strict=True):
        found[end - 1] = float(longer[begin:end].sum())
    return found


def steady_waves(base: Any, other: Any, flow: Vector) -> Vector:
    """Waves of the ``other`` lines at rest with a steady flow [m^3/s], in a memory like the base.

    Segments are of equal numbers; the delays may differ.
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
    """Samples of all waves that have not arrived, in place; the others mean nothing."""
    return [window for window, _ in _memory(lines, state)]


def begin_stretch(lines: Any, state: Any, lane: int) -> None:
    """Change the waves in memory to those of steps that have been longer all the time."""
    for window, sent in _memory(lines, state):
        window[:, lane] = -sent * _change(window[:, 0])


def end_stretch(lines: Any, state: Any, lane: int) -> None:
    """Change the waves in memory to those of steps that are no longer."""
    for window, sent in _memory(lines, state):
        window[:, lane] += sent * _change(window[:, 0])


def _change(waves: Vector) -> Vector:
    return np.asarray(np.gradient(waves)) if len(waves) > 1 else np.zeros(len(waves))


def _memory(lines: Lines, state: LineState) -> list[tuple[Any, Vector]]:
    """Samples under way of each wave, and how many steps ago each was sent."""
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


STRETCH = 1
"""Lane of the derivatives with the logarithm of the step; those of the directions follow."""

_LONGER = 1e-4  # of the step, to either side: what a longer one changes
_BENT = 0.1  # of a small change: more than this to one side only is a jump
_ROUND_OFF = 1e-10  # of the largest number of a bundle: a change that tells nothing
_WAVED = 1e-5  # the same with the step: modes that swing ten times in it turn over by chance
_LEAST = {"at": 1.0, "g": 1.0, "force": 1.0, "force_before": 1.0}
"""Scale of bundles that may hold nothing but round-off, forces [N] and energies [J/kg]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Direction:
    """A direction in which a network changes, from ``minus`` to ``plus``, ``distance`` apart."""

    name: str
    plus: Rows
    minus: Rows
    distance: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TangentNumbers:
    """Numbers of a network with their derivatives.

    Parameters
    ----------
    by_step
        Of each array the places that stay but depend on the step, and their change with its
        logarithm.
    """

    arrays: NetworkArrays
    by_step: list[tuple[Any, Any, Any]]


def numbers_at_rest(
    network: CompiledNetwork,
    rest: RestState | None,
    directions: Sequence[Direction],
    sizes: StepSizes,
) -> TangentNumbers:
    """Numbers of a network with their derivatives in each direction, none with the step.

    Central differences through all that a component makes of its parameters, and through the
    static equilibrium ``rest``, None for an undeformed start.

    Raises
    ------
    InputError
        For a direction in which a number of the network jumps, or a table changes its length.
    """
    slopes = [slopes_at_rest(network, rest, item, sizes) for item in directions]
    arrays = _with_functions(lifted(network.arrays, slopes), network.rows)
    by_step = zip(_floats(arrays), _floats(_slopes_by_step(network, sizes)), strict=True)
    return TangentNumbers(
        arrays=arrays,
        by_step=[(found, slope != 0.0, slope[slope != 0.0]) for found, slope in by_step],
    )


def slopes_at_rest(
    network: CompiledNetwork, rest: RestState | None, direction: Direction, sizes: StepSizes
) -> NetworkArrays:
    """Change of all numbers of a network at rest per unit of a direction."""
    base, distance = network.arrays, direction.distance
    plus, minus = (_at_rest(rows, rest, sizes) for rows in (direction.plus, direction.minus))
    further, before = _in_place(plus.arrays, base), _in_place(minus.arrays, base)
    found: NetworkArrays = _difference(base, further, before, distance, direction.name)
    return found._replace(
        lines=found.lines._replace(
            fraction=(_later(plus.arrays, base) - _later(minus.arrays, base)) / distance
        ),
        line_state=found.line_state._replace(
            samples=(steady_waves(base, *plus) - steady_waves(base, *minus)) / distance
        ),
    )


class _Resting(NamedTuple):
    """Numbers of a network at rest, and the flow in its lines [m^3/s]."""

    arrays: NetworkArrays
    flow: NDArray[np.float64]


def _at_rest(rows: Rows, rest: RestState | None, sizes: StepSizes) -> _Resting:
    network = compile_network(rows, sizes)
    flow = dict[str, float]()
    if rest is not None:
        flow = dict(begin_at_rest(network, sizes.step, rest)[0].flow)
    mass_flow = np.array([flow.get(line.component, 0.0) for line in rows.lines])
    return _Resting(network.arrays, mass_flow / network.nodes.density)


def _later(numbers: NetworkArrays, base: NetworkArrays) -> NDArray[np.float64]:
    return later_delays(base.lines, numbers.lines)


def _in_place(numbers: NetworkArrays, base: NetworkArrays) -> NetworkArrays:
    """The same but for what each step writes before it reads it, and for waves in lines.

    Waves are kept in steps: another delay keeps another number of them.
    """
    found = numbers._replace(
        lines=numbers.lines._replace(fraction=base.lines.fraction),
        line_state=numbers.line_state._replace(samples=base.line_state.samples),
    )
    for name in ("elements", "branches"):
        given = getattr(base, name)
        rows = getattr(found, name)._replace(inputs=given.inputs, outputs=given.outputs)
        found = found._replace(**{name: rows})
    return found


def _slopes_by_step(network: CompiledNetwork, sizes: StepSizes) -> NetworkArrays:
    """Change with the length of the steps, of what stays; states do not yet."""
    base, *ends = (
        compile_network(network.rows, replace(sizes, step=sizes.step * factor)).arrays
        for factor in (1.0, 1.0 + _LONGER, 1.0 - _LONGER)
    )
    longer, shorter = (_in_place(end, base) for end in ends)
    found = _difference(base, longer, shorter, 2.0 * _LONGER, "length of the steps", told=_WAVED)
    found = found._replace(lines=found.lines._replace(fraction=delay_slopes(base.lines)))
    for array in state_arrays(found):
        array[...] = 0.0
    return found


def _difference(
    base: Any,
    plus: Any,
    minus: Any,
    distance: float,
    name: str,
    *,
    least: float = 0.0,
    told: float = _ROUND_OFF,
) -> Any:
    if isinstance(base, tuple):
        sizes = [_LEAST.get(field, 0.0) for field in getattr(base, "_fields", [""] * len(base))]
        parts = zip(base, plus, minus, sizes, strict=True)
        return type(base)(
            *(_difference(*part[:3], distance, name, least=part[3], told=told) for part in parts)
        )
    if isinstance(base, np.ndarray):
        if base.dtype != np.float64:
            return base
        if base.shape != plus.shape or base.shape != minus.shape:
            raise _jumps(name)
        with np.errstate(invalid="ignore"):
            found, bend = plus - minus, plus + minus - 2.0 * base
        known = np.isfinite(found)
        found, bend = np.where(known, found, 0.0), np.where(known, bend, 0.0)
        size = np.max(np.abs(base), initial=least, where=np.isfinite(base))
        if np.any(np.abs(bend) > _BENT * np.abs(found) + told * size):
            raise _jumps(name)
        return found / distance
    return (plus - minus) / distance if isinstance(base, float) else base


def _jumps(name: str) -> InputError:
    return InputError(
        name,
        got="a parameter on which numbers of the valve depend with a jump or a kink: table "
        "points change, a table has a corner there, or the start of the valve changes",
        expected="a parameter on which they depend smoothly",
        hint="klack study with a few values of it computes the valve at each of them.",
    )


def lifted(base: Any, slopes: Sequence[Any]) -> Any:
    """Numbers of a bundle with these derivatives."""
    if isinstance(base, tuple):
        return type(base)(*(lifted(value, [s[i] for s in slopes]) for i, value in enumerate(base)))
    if isinstance(base, np.ndarray) and base.dtype == np.float64:
        found = lanes_of(base.shape)
        found[..., 0] = base
        for lane, slope in enumerate(slopes, STRETCH + 1):
            found[..., lane] = slope
        return found
    if isinstance(base, float):
        number = lanes_of(())
        number[0] = base
        for lane, slope in enumerate(slopes, STRETCH + 1):
            number[lane] = slope
        return number
    return base


def _with_functions(numbers: NetworkArrays, rows: Rows) -> NetworkArrays:
    return numbers._replace(
        elements=numbers.elements._replace(
            function=np.array([tangent_address(row.step) for row in rows.elements], np.int64)
        ),
        branches=numbers.branches._replace(
            function=np.array([tangent_address(row.step) for row in rows.branches], np.int64)
        ),
    )


def arrays_of(bundle: Any) -> list[Any]:
    """All arrays of a bundle and of those in it."""
    if isinstance(bundle, tuple):
        return [array for part in bundle for array in arrays_of(part)]
    return [bundle] if isinstance(bundle, np.ndarray) else []


def set_stretch(numbers: TangentNumbers, on: bool) -> None:
    """Let the steps change from here on, or not, in all numbers that stay."""
    for array, places, slopes in numbers.by_step:
        array[places, STRETCH] = slopes if on else 0.0


def _floats(bundle: Any) -> list[Any]:
    """Arrays of floats, and floats as arrays of one."""
    if isinstance(bundle, tuple):
        return [array for part in bundle for array in _floats(part)]
    if isinstance(bundle, float):
        return [np.array(bundle)]
    is_array = isinstance(bundle, np.ndarray) and bundle.dtype == np.float64
    return [bundle] if is_array else []


def state_arrays(numbers: NetworkArrays) -> list[Any]:
    """Arrays that a step changes, but for the modes."""
    # a law with the places of its sliders, or how far its faces were pressed: their gap shifts
    found = [numbers.bodies.at, numbers.interfaces.law, numbers.interfaces.gap0]
    for rows in (numbers.elements, numbers.branches):
        found += [rows.state, rows.inputs, rows.outputs]
    groups = (
        numbers.node_state,
        numbers.line_state,
        numbers.interface_state,
        numbers.slider_state,
        numbers.accounts,
    )
    return found + arrays_of(groups)


def mode_places(numbers: NetworkArrays) -> tuple[Any, Any]:
    """All numbers of the modes, and places of their displacements and velocities."""
    rows = (ROW_V + 1) * ROW
    places = [np.arange(start, start + rows) for start in numbers.bodies.start[:-1]]
    return numbers.bodies.laid_out, np.concatenate(places)
