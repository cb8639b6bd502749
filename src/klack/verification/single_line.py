"""Lines between prescribed pressures or flows: in the smallest set-up of a delay line."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.compiling.jit import njit
from klack.hydraulics.line_friction import ExponentialWeights
from klack.network.rows import LineRow
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
    "End",
    "LineRun",
    "exponential_decay",
    "laminar_decay",
    "plain_line",
    "ringing",
    "run_line",
]

Vector = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class End:
    """Condition at one end: ``pressure`` [Pa, about ambient] or ``flow`` into the line [m^3/s].

    Means over the steps, or one number for all of them.
    """

    pressure: ArrayLike | None = None
    flow: ArrayLike | None = None

    def values(self, steps: int) -> tuple[bool, Vector]:
        """Whether a flow is given, and its values."""
        given = self.pressure if self.flow is None else self.flow
        return self.flow is not None, np.broadcast_to(np.asarray(given, float), (steps,)).copy()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LineRun:
    """A run of one line.

    Parameters
    ----------
    time : array, shape (n,) [s]
        Start of each step.
    pressure, flow : array, shape (n, 2) [Pa], [m^3/s]
        At both ends, means over each step; flow into the line.
    cavity : array, shape (n,) [m^3]
        Vapour in the line after each step.
    losses : array, shape (3,) [J]
        See ``LINE_LOSSES``.
    work, throughput : float [J]
        What came in through the ends, and the sum of its magnitudes.
    store_change : float [J]
    inflow, volume_throughput : float [m^3]
        What came in through the ends, and the sum of its magnitudes.
    volume_change : float [m^3]
        Of the compressed fluid.
    """

    time: Vector
    pressure: Vector
    flow: Vector
    cavity: Vector
    losses: Vector
    work: float
    throughput: float
    store_change: float
    inflow: float
    volume_throughput: float
    volume_change: float

    @property
    def energy_residual(self) -> float:
        """Energy that does not balance, over what passed the ends [-]."""
        return (self.work - self.store_change - float(self.losses.sum())) / self.throughput

    @property
    def volume_residual(self) -> float:
        """Volume that does not balance, over what passed the ends [-]."""
        opened = self.cavity[-1]
        return (self.inflow + opened - self.volume_change) / self.volume_throughput


def plain_line(
    *,
    delay: float,
    impedance: float = 1.6e11,
    segments: int = 1,
    resistance: float = 0.0,
    unsteady: tuple[ArrayLike, ArrayLike] = ((), ()),
    vapour_pressure: float = -1e12,
) -> LineRow:
    """Line with the numbers of a 60 x 2.5 mm bore in heptane; its vapour is out of reach."""
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
    lengths : array of int, shape (n,)
        Fine steps of each step: 1, or one greater number.
    pressure : array, shape (2,) [Pa]
        At both ends at the start.
    flow : float [m^3/s]
        From a to b at the start.
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
    return LineRun(
        time=np.asarray(step * (np.cumsum(m) - m), dtype=np.float64),
        pressure=P,
        flow=q,
        cavity=cavity,
        losses=books[0],
        work=float(work.sum()),
        throughput=float(np.abs(work).sum()),
        store_change=line_store(lines, state, 0) - store,
        inflow=float(inflow.sum()),
        volume_throughput=float(np.abs(inflow).sum()),
        volume_change=line_volume(lines, state, 0) - volume,
    )


@njit(error_model="numpy")
def _march(
    lines: Lines,
    state: LineState,
    m: Vector,
    flow_a: bool,
    value_a: Vector,
    flow_b: bool,
    value_b: Vector,
    P: Vector,
    q: Vector,
    cavity: Vector,
    books: Vector,
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
    """Give the root of :func:`laminar_decay` for friction by ``weights`` spread along the line."""
    unit = kinematic_viscosity / radius**2
    factors, rates = np.array(weights.factors), unit * np.array(weights.rates)
    s = complex(-1.0, np.pi / (2.0 * delay))
    for _ in range(200):
        friction = 8.0 * unit * (1.0 + 0.5 * np.sum(factors * s / (s + rates)))
        s = 0.5j * np.pi / delay / np.sqrt(1.0 + friction / s)
    return complex(s)


def ringing(time: Vector, values: Vector, frequency: float, *, apart: float) -> complex:
    """Decay [1/s] and angular frequency [rad/s] of one tone, from two windows of 16 periods.

    Parameters
    ----------
    time, values : array, shape (n,)
        Evenly spaced.
    frequency : float [Hz]
        About that of the tone; others are suppressed by the window.
    apart : float [s]
        Distance of the windows; the later one ends with the record.
    """
    step = time[1] - time[0]
    size, shift = round(16 / frequency / step), round(apart / step)
    tone = np.blackman(size) * np.exp(-2j * np.pi * frequency * step * np.arange(size))
    first = len(values) - size - shift
    early, late = (tone @ values[i : i + size] for i in (first, first + shift))
    turned = np.log(late / early * np.exp(-2j * np.pi * frequency * shift * step))
    return complex(turned / (shift * step) + 2j * np.pi * frequency)
