"""Lines that meet without a volume: scattering, dead ends, cavities, and the chamber that vanishes.

The other side knows two delays per line and nothing else: ring buffers of waves, whose junctions
are solved by the formula of parallel impedances (a method of characteristics written apart).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import pi, sqrt
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.fluid_table import fluid_at, fluid_table
from klack.hydraulics.junction import Junction
from klack.hydraulics.line import Line
from klack.hydraulics.pressure_loss import PressureLoss
from klack.hydraulics.pressure_source import PressureSource, PressureStep
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import Ambient, Rows
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.verification.check import Check, ComparedCurve, compare

__all__ = ["line_junctions"]

BAR = 1e5
AMBIENT = Ambient()
HEPTANE = library_fluid("n-heptane").at(293.15)
BEFORE, AFTER = 10 * BAR, 12 * BAR
STEP = 100e-9
_TABLE = fluid_table(HEPTANE, AMBIENT.pressure)
RHO = float(HEPTANE.density(AMBIENT.pressure))
SPEED = Line(length=1.0, diameter=1e-3, friction="none").wave_speed(HEPTANE, BEFORE)

Vector = NDArray[np.float64]
_check = partial(compare, "lines")
SCATTERING = "shares 2 Y/sum Y of the pressure, Y = A/(rho a); Wylie & Streeter 1993, ch. 3"
APART = "method of characteristics written apart: delays and parallel impedances"


def line_junctions() -> list[Check]:
    """Scattering, a network of lines, equal networks, an orifice, a cavity, a vanishing chamber."""
    return [
        *_scattering(),
        *_network(),
        *_equal_networks(),
        *_orifice(),
        *_cavity(),
        *_vanishing_chamber(),
    ]


def wave_pressure(p: float) -> float:
    """``P = rho_ref g(p)`` [Pa], in which the waves of a line are linear."""
    return RHO * float(fluid_at(_TABLE, p, 0)[2])


def bore(steps: int, diameter: float) -> Line:
    """Line without friction that a wave crosses in so many steps."""
    return Line(length=SPEED * steps * STEP, diameter=diameter, pressure=BEFORE, friction="none")


def _run(
    parts: Mapping[str, Component],
    connections: Sequence[Sequence[str]],
    steps: int,
    *,
    start: Literal["rest", "free"] = "free",
    coarse: int = 1,
) -> NetworkResult:
    held = {"needle": RigidMass(mass=1e-3), "spring": Spring(stiffness=1e4, preload=0.0)}
    network = Network(
        {**held, **parts}, [["needle.body", "spring.end"], *connections], AMBIENT, HEPTANE
    )
    rows: Rows = network.rows()
    duration = steps * STEP
    return simulate_network(
        rows, duration=duration, step=STEP, coarse=coarse, record=coarse * STEP, start=start
    )


def _at(result: NetworkResult, name: str) -> Vector:
    """Wave pressure of a node over time [Pa], from its start."""
    p = result.channels[f"{name} pressure"].values
    return np.array([wave_pressure(x) for x in p]) - wave_pressure(BEFORE)


def _microseconds(count: int) -> Vector:
    return np.asarray(np.arange(count) * (STEP * 1e6), dtype=np.float64)


def _source() -> PressureSource:
    return PressureSource(pressure=BEFORE, step=PressureStep(to=AFTER, at=1e-6, rise=1e-9))


def _closed(*names: str) -> dict[str, Junction]:
    return {name: Junction(pressure=BEFORE) for name in names}


JUMP = wave_pressure(AFTER) - wave_pressure(BEFORE)
_BORES = {2: (2e-3, 3e-3), 3: (2e-3, 1.2e-3, 3e-3), 5: (1e-3,) * 5}


def _scattering() -> list[Check]:
    """A jump of the pressure runs through the first of several lines into the others."""
    checks = []
    for count, bores in _BORES.items():
        lines: dict[str, Component] = {f"l{k}": bore(200, d) for k, d in enumerate(bores)}
        ends = [f"e{k}" for k in range(1, count)]
        tee = ["tee.fluid", "l0.b", *(f"l{k}.a" for k in range(1, count))]
        connections = [["source.fluid", "l0.a"], tee]
        connections += [[f"l{k}.b", f"e{k}.fluid"] for k in range(1, count)]
        parts = {"source": _source(), **lines, **_closed("tee", *ends)}
        result = _run(parts, connections, 550)
        admittance = np.square(bores)
        share = 2.0 * admittance[0] / admittance.sum()
        checks += [
            _check(
                f"{count} lines of {' '.join(f'{1e3 * d:g}' for d in bores)} mm, pressure passed "
                "on [-]",
                expected=share,
                computed=float(_at(result, "tee")[300]) / JUMP,
                tolerance=5e-14,
                source=SCATTERING,
            ),
            _check(
                f"{count} lines, pressure at a closed end [-]",
                expected=2.0 * share,
                computed=float(_at(result, "e1")[500]) / JUMP,
                tolerance=5e-14,
                source="a closed end doubles a wave",
            ),
        ]
    return checks


@dataclass
class _Bore:
    """Two delays: waves under way to b and to a."""

    a: str
    b: str
    impedance: float
    steps: int
    to_b: list[float] = field(default_factory=list)
    to_a: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.to_b, self.to_a = [0.0] * self.steps, [0.0] * self.steps


def _characteristics(bores: Sequence[_Bore], given: str, pressure: Vector) -> dict[str, Vector]:
    """Pressure of every node over the steps; ``given`` has the prescribed one."""
    nodes = {node for line in bores for node in (line.a, line.b)}
    found = {node: np.zeros(pressure.size) for node in nodes}
    for n in range(pressure.size):
        arriving: dict[str, list[tuple[float, float]]] = {node: [] for node in nodes}
        for line in bores:
            arriving[line.a].append((line.to_a.pop(0), line.impedance))
            arriving[line.b].append((line.to_b.pop(0), line.impedance))
        for node, waves in arriving.items():
            total = sum(c / Z for c, Z in waves) / sum(1.0 / Z for _, Z in waves)
            found[node][n] = pressure[n] if node == given else total
        taken = dict.fromkeys(nodes, 0)
        for line in bores:
            for node, sent in ((line.a, line.to_b), (line.b, line.to_a)):
                c = arriving[node][taken[node]][0]
                taken[node] += 1
                sent.append(2.0 * found[node][n] - c)
    return found


def _network() -> list[Check]:
    """Five lines, a ring among them, two tees and two dead ends."""
    plan = {
        "l0": ("source", "tee", 150, 2e-3),
        "l1": ("tee", "fork", 210, 1.5e-3),
        "l2": ("tee", "fork", 333, 1e-3),
        "l3": ("fork", "far", 97, 3e-3),
        "l4": ("tee", "near", 61, 0.8e-3),
    }
    lines: dict[str, Component] = {name: bore(n, d) for name, (_, _, n, d) in plan.items()}
    joined: dict[str, list[str]] = {}
    for name, (a, b, _, _) in plan.items():
        joined.setdefault(a, []).append(f"{name}.a")
        joined.setdefault(b, []).append(f"{name}.b")
    connections = [[f"{node}.fluid", *ports] for node, ports in joined.items()]
    parts = {"source": _source(), **lines, **_closed("tee", "fork", "far", "near")}
    steps = 6000
    result = _run(parts, connections, steps)
    bores = [_Bore(a, b, 1.0 / d**2, n) for a, b, n, d in plan.values()]
    apart = _characteristics(bores, "source", _at(result, "source")[1:])
    off = [np.max(np.abs(_at(result, node)[1:] - apart[node])) for node in ("tee", "fork", "far")]
    far = _at(result, "far")[1:]
    time = _microseconds(far.size)
    shown = slice(0, 3000, 10)
    losses = result.books.losses
    leak = sum(abs(losses[f"{node} implicit step"]) for node in ("tee", "fork", "far", "near"))
    return [
        _check(
            "network with a ring and dead ends over 40 passes, largest difference [-]",
            expected=0.0,
            computed=float(max(off)) / JUMP,
            tolerance=2e-11,
            source=APART,
            curve=ComparedCurve(
                x_label="time [us]",
                y_label="pressure at the far dead end [bar]",
                expected=(time[shown], apart["far"][shown] / BAR),
                computed=(time[shown], far[shown] / BAR),
            ),
        ),
        _check(
            "network with a ring and dead ends, energy that does not balance [-]",
            expected=0.0,
            computed=result.books.relative_residual,
            tolerance=2e-13,
            source="conservation of energy",
        ),
        _check(
            "network with a ring and dead ends, energy of the mass left at junctions [-]",
            expected=0.0,
            computed=leak / result.books.scale,
            tolerance=5e-14,
            source="the flows of a junction add up to nothing",
        ),
    ]


def _equal_networks() -> list[Check]:
    """A line in two pieces, and two lines side by side, are one line."""
    ends = _closed("middle", "end")
    whole = _run(
        {"source": _source(), "l": bore(300, 2e-3), **_closed("end")},
        [["source.fluid", "l.a"], ["l.b", "end.fluid"]],
        4000,
    )
    pieces = _run(
        {"source": _source(), "l": bore(130, 2e-3), "m": bore(170, 2e-3), **ends},
        [["source.fluid", "l.a"], ["l.b", "m.a", "middle.fluid"], ["m.b", "end.fluid"]],
        4000,
    )
    half = 2e-3 / sqrt(2.0)
    beside = _run(
        {"source": _source(), "l": bore(300, half), "m": bore(300, half), **_closed("end")},
        [["source.fluid", "l.a", "m.a"], ["l.b", "m.b", "end.fluid"]],
        4000,
    )
    one = _at(whole, "end")
    return [
        _check(
            f"{words}, largest difference from one line [-]",
            expected=0.0,
            computed=float(np.max(np.abs(_at(result, "end") - one))) / JUMP,
            tolerance=5e-14,
            source="identity",
        )
        for words, result in (("line in two pieces", pieces), ("two lines side by side", beside))
    ]


def _orifice() -> list[Check]:
    """A jump runs into a throttle at the end of a line, without a chamber between."""
    hole = PressureLoss(diameter=0.8e-3, coefficient=2.0, laminar_coefficient=1e-6)
    parts = {"source": _source(), "l": bore(200, 2e-3), "hole": hole, "end": Junction()}
    connections = [["source.fluid", "l.a"], ["l.b", "end.fluid", "hole.a"], ["hole.b", "ambient"]]
    result = _run(parts, connections, 350, start="rest")
    p = float(result.channels["end pressure"].values[300])
    p0 = float(result.channels["end pressure"].values[0])
    flow = result.channels["hole mass flow"].values
    m = float(flow[300])
    Z = SPEED * (RHO**2 / float(HEPTANE.density(BEFORE))) / (pi / 4 * 2e-3**2)

    def through(x: float) -> float:
        drop = x - AMBIENT.pressure
        return pi / 4 * 0.8e-3**2 * sqrt(2.0 * float(HEPTANE.density(x)) * drop / 2.0)

    def left(x: float) -> float:
        return wave_pressure(x) + Z * through(x) / RHO - arriving

    # the wave that arrives had Z times the first flow, and brings twice the jump
    arriving = wave_pressure(p0) + Z * through(p0) / RHO + 2.0 * JUMP
    expected = float(brentq(left, BEFORE, 2.0 * AFTER, xtol=1e-3, rtol=1e-14))
    return [
        _check(
            "throttle at the end of a line, pressure after a jump [bar]",
            expected=expected / BAR,
            computed=p / BAR,
            tolerance=1e-12,
            source="one equation, c = p + Z q(p), by Brent's method",
        ),
        _check(
            "throttle at the end of a line, flow after a jump [kg/s]",
            expected=(arriving - wave_pressure(p)) * RHO / Z,
            computed=m,
            tolerance=2e-10,
            source="q = (c - p)/Z",
        ),
    ]


def _cavity() -> list[Check]:
    """A pressure that falls pulls a column off the closed end of a line; it comes back."""
    fall = PressureSource(pressure=BEFORE, step=PressureStep(to=2 * BAR, at=1e-6, rise=1e-9))
    n, steps = 200, 3000
    result = _run(
        {"source": fall, "l": bore(n, 2e-3), **_closed("end")},
        [["source.fluid", "l.a"], ["l.b", "end.fluid"]],
        steps,
    )
    source = _at(result, "source")[1:]
    vapour = wave_pressure(HEPTANE.all_liquid_from) - wave_pressure(BEFORE)
    to_b, to_a, empty = [0.0] * n, [0.0] * n, 0.0
    expected = np.zeros(steps)
    for k in range(steps):
        c_b, c_a = to_b.pop(0), to_a.pop(0)
        p = c_b  # closed; the flow out of the line into the cavity is (c - p)/Z
        if p < vapour or empty > 0.0:
            grown = empty - (c_b - vapour)
            p, empty = (vapour, grown) if grown > 0.0 else (c_b - empty, 0.0)
        expected[k] = p
        to_b.append(2.0 * source[k] - c_a)
        to_a.append(2.0 * p - c_b)
    computed = _at(result, "end")[1:]
    time = _microseconds(steps)
    open_for = float(np.count_nonzero(expected <= vapour * (1.0 - 1e-12)))
    return [
        _check(
            "cavity at a closed end, largest difference of the pressure [-]",
            expected=0.0,
            computed=float(np.max(np.abs(computed - expected))) / JUMP,
            tolerance=3e-9,
            source="discrete vapour cavity of the method of characteristics, written apart",
            curve=ComparedCurve(
                x_label="time [us]",
                y_label="pressure [bar]",
                expected=(time, expected / BAR),
                computed=(time, computed / BAR),
            ),
        ),
        _check(
            "cavity at a closed end, steps for which it is open [-]",
            expected=open_for,
            computed=float(np.count_nonzero(computed <= vapour * (1.0 - 1e-9))),
            tolerance=5e-14,
            source="discrete vapour cavity of the method of characteristics, written apart",
        ),
        _check(
            "cavity at a closed end, energy that does not balance [-]",
            expected=0.0,
            computed=result.books.relative_residual,
            tolerance=2e-13,
            source="conservation of energy; the collapse is a loss",
        ),
    ]


def _vanishing_chamber() -> list[Check]:
    """The pressure at a tee with a chamber tends to that without one as its volume does."""
    sums = []
    for tee in (*(Chamber(volume=v, pressure=BEFORE) for v in (40e-9, 20e-9, 10e-9)), None):
        parts = {
            "source": _source(),
            **{f"l{k}": bore(200, d) for k, d in enumerate(_BORES[3])},
            **_closed("e1", "e2", *(["tee"] if tee is None else [])),
            **({} if tee is None else {"tee": tee}),
        }
        ends = [["source.fluid", "l0.a"], ["l1.b", "e1.fluid"], ["l2.b", "e2.fluid"]]
        result = _run(parts, [*ends, ["tee.fluid", "l0.b", "l1.a", "l2.a"]], 550)
        sums.append(float(np.sum(_at(result, "tee")[:550])) * STEP)
    squares = np.square(_BORES[3])
    passed = float(JUMP * 2.0 * squares[0] / squares.sum())
    lag = (sums[3] - np.array(sums[:3])) / passed  # of second order in the step, beside V/(K Y)
    admittance = pi / 4 * squares.sum() / (SPEED * float(HEPTANE.density(BEFORE)))
    return [
        _check(
            "chambers of 40, 20 and 10 mm^3 at a tee: lags behind a junction, differences [-]",
            expected=2.0,
            computed=float((lag[0] - lag[1]) / (lag[1] - lag[2])),
            tolerance=1e-3,
            source="time constant V/(K sum Y): proportional to the volume",
        ),
        _check(
            "chamber of 20 instead of 10 mm^3 at a tee, lag [us]",
            expected=1e6 * 10e-9 / float(HEPTANE.bulk_modulus(BEFORE)) / float(admittance),
            computed=1e6 * float(lag[1] - lag[2]),
            tolerance=3e-3,
            source="V/(K sum Y)",
            reason="the bulk modulus rises by 1 % over the jump",
        ),
    ]
