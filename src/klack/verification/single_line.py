"""Lines between prescribed pressures or flows, as delays and in cells."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from klack.hydraulics.fluid_table import fluid_at
from klack.hydraulics.line_cells import (
    SCALARS,
    TERMS,
    line_cells_step,
    look_up_cells,
    rates_of_cells,
)
from klack.hydraulics.line_friction import ExponentialWeights
from klack.machine.compiling.jit import njit
from klack.network.rows import WAVE_BEGIN, WAVE_END, WAVE_STORE, LineRow
from klack.network.step_function import address_of, call, first
from klack.simulation.delay_line import (
    Lines,
    LineState,
    compile_lines,
    line_cavity,
    line_store,
    line_volume,
    lines_commit,
    lines_incoming,
    start_lines,
)

__all__ = [
    "CellRun",
    "End",
    "LineRun",
    "cell_rates",
    "cell_state",
    "exponential_decay",
    "laminar_decay",
    "plain_line",
    "ringing",
    "run_cells",
    "run_line",
]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class End:
    """Condition at one end: a level, or the ``flow`` into the line.

    For delays a ``pressure`` [Pa, about ambient] or flow [m^3/s]; for cells ``total``, ``g +
    u^2/2`` [J/kg], or flow [kg/s]. Means over the steps, or one number.
    """

    pressure: ArrayLike | None = None
    total: ArrayLike | None = None
    flow: ArrayLike | None = None

    def values(self, steps: int) -> tuple[bool, np.ndarray]:
        """Whether a flow is given, and its values."""
        level = self.pressure if self.total is None else self.total
        return self.flow is not None, np.broadcast_to(
            np.asarray(level if self.flow is None else self.flow, float), (steps,)
        ).copy()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LineRun:
    """A run of one line.

    Parameters
    ----------
    time (n,) [s]
        Starts of steps.
    pressure, flow (n, 2) [Pa], [m^3/s]
        At both ends, means; flow into the line.
    cavity (n,) [m^3]
        After each step.
    losses (3,) [J]
        See ``LINE_LOSSES``.
    energy_residual, volume_residual [-]
        Over what passed the ends.
    """

    time: np.ndarray
    pressure: np.ndarray
    flow: np.ndarray
    cavity: np.ndarray
    losses: np.ndarray
    energy_residual: float
    volume_residual: float


def plain_line(
    *,
    delay: float,
    impedance: float = 1.6e11,
    segments: int = 1,
    resistance: float = 0.0,
    unsteady: tuple[ArrayLike, ArrayLike] = ((), ()),
    vapour_pressure: float = -1e12,
) -> LineRow:
    """Bore of 60 x 2.5 mm in heptane; vapour is out of reach."""
    gain, rate = (np.array(values, dtype=float) for values in unsteady)
    return LineRow(
        component="line",
        a=0,
        b=1,
        delay=delay,
        impedance=impedance,
        segments=segments,
        resistance=resistance,
        unsteady_gain=gain,
        unsteady_rate=rate,
        vapour_pressure=vapour_pressure,
    )


def run_line(
    row: LineRow,
    a: End,
    b: End,
    *,
    step: float,
    lengths: ArrayLike,
    pressure: ArrayLike = 0.0,
    flow: float = 0.0,
) -> LineRun:
    """Run one line about an ambient pressure of 0.

    Parameters
    ----------
    lengths (n,)
        Of each step in fine ones: 1, or one greater number.
    pressure (2,) [Pa]
        At the start.
    flow [m^3/s]
        At the start, from a to b.
    """
    m = np.asarray(lengths, dtype=np.int64)
    lines, state = compile_lines([row], step=step, coarse=int(m.max()), ambient_pressure=0.0)
    start_lines(lines, state, pressure, flow)
    store, volume = line_store(lines, state, 0), line_volume(lines, state, 0)
    (flow_a, value_a), (flow_b, value_b) = a.values(len(m)), b.values(len(m))
    P, q, books = np.zeros((len(m), 2)), np.zeros((len(m), 2)), np.zeros((1, 3))
    cavity = np.zeros(len(m))
    _march(lines, state, m, flow_a, value_a, flow_b, value_b, P, q, cavity, books)
    work, inflow = P * q * (m * step)[:, None], q * (m * step)[:, None]
    stored = line_store(lines, state, 0) - store
    opened = float(inflow.sum()) + cavity[-1]
    return LineRun(
        time=np.asarray(step * (np.cumsum(m) - m), dtype=np.float64),
        pressure=P,
        flow=q,
        cavity=cavity,
        losses=books[0],
        energy_residual=_share(
            float(work.sum()) - stored - float(books[0].sum()), float(np.abs(work).sum())
        ),
        volume_residual=_share(
            opened - (line_volume(lines, state, 0) - volume), float(np.abs(inflow).sum())
        ),
    )


def _share(missing: float, passed: float) -> float:
    return missing / passed if passed else 0.0


@njit(error_model="numpy")
def _march(
    lines: Lines,
    state: LineState,
    m: np.ndarray,
    flow_a: bool,
    value_a: np.ndarray,
    flow_b: bool,
    value_b: np.ndarray,
    P: np.ndarray,
    q: np.ndarray,
    cavity: np.ndarray,
    books: np.ndarray,
) -> None:
    c, Z, into = np.zeros(2), np.zeros(2), np.zeros(2)
    for n in range(m.size):
        lines_incoming(lines, state, m[n], c, Z)
        into[0] = value_a[n] if flow_a else (value_a[n] - c[0]) / Z[0]
        into[1] = value_b[n] if flow_b else (value_b[n] - c[1]) / Z[1]
        for end in range(2):
            q[n, end] = into[end]
            P[n, end] = c[end] + Z[end] * into[end]
        lines_commit(lines, state, m[n], into, books)
        cavity[n] = line_cavity(lines, state, 0)


def laminar_decay(*, delay: float, radius: float, kinematic_viscosity: float) -> complex:
    r"""Root [1/s] of the first mode of a line, open at one end and closed at the other.

    .. math:: \cosh\Gamma = 0, \quad \Gamma = s T \sqrt{I_0(z) / I_2(z)}, \quad
              z = R \sqrt{s / \nu}

    Zielke, J. Basic Eng. 90 (1968) 109; real part: decay, imaginary part: angular frequency.
    """
    from scipy.special import ive

    s = complex(-1.0, np.pi / (2.0 * delay))
    for _ in range(200):
        z = radius * np.sqrt(s / kinematic_viscosity)
        s = 0.5j * np.pi / delay * np.sqrt(ive(2, z) / ive(0, z))
    return complex(s)


def exponential_decay(
    weights: ExponentialWeights, *, delay: float, radius: float, kinematic_viscosity: float
) -> complex:
    """The same for friction by ``weights`` spread along the line."""
    unit = kinematic_viscosity / radius**2
    factors, rates = np.array(weights.factors), unit * np.array(weights.rates)
    s = complex(-1.0, np.pi / (2.0 * delay))
    for _ in range(200):
        friction = 8.0 * unit * (1.0 + 0.5 * np.sum(factors * s / (s + rates)))
        s = 0.5j * np.pi / delay / np.sqrt(1.0 + friction / s)
    return complex(s)


def ringing(time: np.ndarray, values: np.ndarray, frequency: float, *, apart: float) -> complex:
    """Decay [1/s] and angular frequency [rad/s] of one tone, from two windows of 16 periods.

    Parameters
    ----------
    time, values (n,)
        Evenly spaced.
    frequency [Hz]
        About that of the tone.
    apart [s]
        Of the windows; the later one ends with the record.
    """
    step = time[1] - time[0]
    size, shift = round(16 / frequency / step), round(apart / step)
    tone = np.blackman(size) * np.exp(-2j * np.pi * frequency * step * np.arange(size))
    first = len(values) - size - shift
    early, late = (tone @ values[i : i + size] for i in (first, first + shift))
    turned = np.log(late / early * np.exp(-2j * np.pi * frequency * shift * step))
    return complex(turned / (shift * step) + 2j * np.pi * frequency)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellRun:
    """A run of one line.

    Parameters
    ----------
    time (n,) [s]
        Middles of steps.
    total, flow (n, 2) [J/kg], [kg/s]
        At both ends, means; flow into the line.
    losses (n, 3) [J]
        Friction, waves, outflow.
    pressure, velocity (cells,) [Pa], [m/s]
        At the end.
    energy_residual, mass_residual [-]
        Over what passed the ends and what is held.
    """

    time: np.ndarray
    total: np.ndarray
    flow: np.ndarray
    losses: np.ndarray
    pressure: np.ndarray
    velocity: np.ndarray
    energy_residual: float
    mass_residual: float


def cell_state(
    parameters: np.ndarray, pressure: ArrayLike, velocity: ArrayLike = 0.0
) -> np.ndarray:
    """State of cells with pressures [Pa] and velocities [m/s]."""
    n, area, stretch, ambient, place = (float(parameters[k]) for k in (0, 2, 3, 4, 9))
    count = int(n)
    p = np.broadcast_to(np.asarray(pressure, float), (count,))
    u = np.broadcast_to(np.asarray(velocity, float), (count,))
    table = parameters[int(place) :]
    mass = np.array([fluid_at(table, x, 0)[0] for x in p])
    mass *= area * (1.0 + stretch * (p - ambient))
    head, scratch = np.zeros(SCALARS), np.zeros(8 * count)
    return np.concatenate(
        [head, mass, mass * u, p, np.zeros(count), np.repeat(np.sqrt(mass) * u, TERMS), scratch]
    )


def run_cells(
    parameters: np.ndarray, state: np.ndarray, a: End, b: End, h: float, steps: int
) -> CellRun:
    """Run one line from a state, which is left as it ends."""
    (flow_a, value_a), (flow_b, value_b) = a.values(steps), b.values(steps)
    total, flow, losses = np.zeros((steps, 2)), np.zeros((steps, 2)), np.zeros((steps, 3))
    held = np.zeros((2, 2))
    status = _run(
        address_of(line_cells_step), parameters, state, h, flow_a, value_a, flow_b, value_b,
        total, flow, losses, held,
    )  # fmt: skip
    assert status == 0
    n = int(parameters[0])
    cells = state[SCALARS : SCALARS + 3 * n].reshape(3, n)
    power = h * total * flow
    change = held[1] - held[0]
    return CellRun(
        time=np.asarray(h * (np.arange(steps) + 0.5), dtype=np.float64),
        total=total,
        flow=flow,
        losses=losses,
        pressure=cells[2].copy(),
        velocity=cells[1] / cells[0],
        energy_residual=float((change[0] + losses.sum() - power.sum()) / np.abs(power).sum()),
        mass_residual=float((change[1] - h * flow.sum()) / held[0, 1]),
    )


def cell_rates(parameters: np.ndarray, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Wave speed [m/s] and mass rate [kg/(m s)] of each cell, ends closed."""
    n = int(parameters[0])
    cells = state[SCALARS : SCALARS + 4 * n].copy()
    speed, rate = np.zeros(n), np.zeros(n)
    assert _rates(parameters, cells, speed, rate)
    return speed, rate


@njit
def _rates(par: np.ndarray, cells: np.ndarray, speed: np.ndarray, rate: np.ndarray) -> bool:
    n = speed.size
    M, J, p, hint = cells[:n], cells[n : 2 * n], cells[2 * n : 3 * n], cells[3 * n :]
    work, ends, force = np.zeros(8 * n), np.zeros(4), np.zeros(n)
    at = first(par)
    if not look_up_cells(at, first(M), first(J), first(p), first(hint), first(work)):
        return False
    speed[:] = work[3 * n : 4 * n]
    rates_of_cells(n, par[1], first(M), first(work), first(ends), first(rate), first(force))
    return True


@njit
def _run(
    function: int,
    par: np.ndarray,
    state: np.ndarray,
    h: float,
    flow_a: bool,
    value_a: np.ndarray,
    flow_b: bool,
    value_b: np.ndarray,
    total: np.ndarray,
    flow: np.ndarray,
    losses: np.ndarray,
    held: np.ndarray,
) -> int:
    inp, out = np.zeros(6), np.zeros(6)
    numbers, cells, into, back = first(par), first(state), first(inp), first(out)
    for step in range(total.shape[0] + 1):
        if step in (0, total.shape[0]):
            inp[0] = WAVE_STORE
            status = call(function, numbers, cells, into, back)
            held[min(step, 1)] = out[:2]
            if status != 0 or step == total.shape[0]:
                return int(status)
        inp[0], inp[1] = WAVE_BEGIN, h
        status = call(function, numbers, cells, into, back)
        for side in range(2):
            B, m, slope = out[3 * side], out[3 * side + 1], out[3 * side + 2]
            given = value_a[step] if side == 0 else value_b[step]
            if flow_a if side == 0 else flow_b:
                total[step, side], flow[step, side] = B + (given - m) / slope, given
            else:
                total[step, side], flow[step, side] = given, m + slope * (given - B)
            inp[2 + 2 * side], inp[3 + 2 * side] = total[step, side], flow[step, side]
        inp[0] = WAVE_END
        status = max(status, call(function, numbers, cells, into, back))
        if status != 0:
            return int(status)
        losses[step] = out[:3]
    return 0
