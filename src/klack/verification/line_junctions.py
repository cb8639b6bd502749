"""Lines that meet without a volume: scattering, dead ends, cavities, and the chamber that vanishes.

The other side is a method of characteristics: two delays per line, and junctions by the formula of
parallel impedances.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import log10, pi, sqrt
from typing import Literal
from warnings import catch_warnings, simplefilter

import numpy as np
from scipy.optimize import brentq

from klack.errors import AccuracyWarning
from klack.hydraulics.fluid_table import fluid_at, fluid_table
from klack.hydraulics.junction import Junction
from klack.hydraulics.line import Line
from klack.hydraulics.line_friction import KAGAWA
from klack.hydraulics.pressure_source import PressureSource, PressureStep
from klack.network.component import Component
from klack.simulation.network_result import NetworkResult
from klack.verification.benches import AMBIENT, BAR, HEPTANE, RHO_HEPTANE, component, run_network
from klack.verification.check import Check, ComparedCurve, check

__all__ = ["line_junctions", "turbulent_line"]


BEFORE, AFTER = 10 * BAR, 12 * BAR
STEP = 100e-9
_TABLE = fluid_table(HEPTANE, AMBIENT.pressure)
SPEED = Line(length=1.0, diameter=1e-3, friction="none").wave_speed(HEPTANE, BEFORE)

SCATTERING = "shares 2 Y/sum Y of the pressure, Y = A/(rho a); Wylie & Streeter 1993, ch. 3"
APART = "method of characteristics coded independently: delays and parallel impedances"


def line_junctions() -> list[Check]:
    """Return the checks."""
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
    return RHO_HEPTANE * float(fluid_at(_TABLE, p, 0)[2])


def bore(steps: int, diameter: float) -> Line:
    """Line without friction that a wave crosses in so many steps."""
    return Line(length=SPEED * steps * STEP, diameter=diameter, pressure=BEFORE, friction="none")


def _run(
    parts: Mapping[str, Component],
    connections: Sequence[Sequence[str]],
    steps: int,
    *,
    start: Literal["rest", "free"] = "free",
) -> NetworkResult:
    return run_network(
        parts,
        connections,
        still=True,
        fluid=HEPTANE,
        duration=steps * STEP,
        step=STEP,
        record=STEP,
        start=start,
    )


def _at(result: NetworkResult, name: str) -> np.ndarray:
    """Wave pressure of a node over time, from its start [Pa]."""
    p = result.channels[f"{name} pressure"].values
    return np.array([wave_pressure(x) for x in p]) - wave_pressure(BEFORE)


def _microseconds(count: int) -> np.ndarray:
    return np.asarray(np.arange(count) * (STEP * 1e6), dtype=np.float64)


def _source() -> PressureSource:
    return PressureSource(pressure=BEFORE, step=PressureStep(to=AFTER, at=1e-6, rise=1e-9))


def _closed(*names: str) -> dict[str, Junction]:
    return {name: Junction(pressure=BEFORE) for name in names}


JUMP = wave_pressure(AFTER) - wave_pressure(BEFORE)
_BORES = {2: (2e-3, 3e-3), 3: (2e-3, 1.2e-3, 3e-3), 5: (1e-3,) * 5}


def _scattering() -> Iterator[Check]:
    """A jump of the pressure runs through one line into others."""
    for count, bores in _BORES.items():
        lines: dict[str, Component] = {f"l{k}": bore(200, d) for k, d in enumerate(bores)}
        ends = [f"e{k}" for k in range(1, count)]
        tee = ["tee.fluid", "l0.b", *(f"l{k}.a" for k in range(1, count))]
        connections = [["source.fluid", "l0.a"], tee]
        connections += [[f"l{k}.b", f"e{k}.fluid"] for k in range(1, count)]
        result = _run({"source": _source(), **lines, **_closed("tee", *ends)}, connections, 550)
        admittance = np.square(bores)
        share = 2.0 * admittance[0] / admittance.sum()
        yield from [
            check(
                f"{count} lines of {' '.join(f'{1e3 * d:g}' for d in bores)} mm, pressure passed "
                "on [-]",
                expected=share,
                computed=float(_at(result, "tee")[300]) / JUMP,
                tolerance=5e-14,
                source=SCATTERING,
            ),
            check(
                f"{count} lines, pressure at a closed end [-]",
                expected=2.0 * share,
                computed=float(_at(result, "e1")[500]) / JUMP,
                tolerance=5e-14,
                source="a closed end doubles a wave",
            ),
        ]


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


def _characteristics(
    bores: Sequence[_Bore], given: str, pressure: np.ndarray
) -> dict[str, np.ndarray]:
    """Pressure of every node over the steps; ``given`` is prescribed."""
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
    result = _run(
        {"source": _source(), **lines, **_closed("tee", "fork", "far", "near")}, connections, 6000
    )
    bores = [_Bore(a, b, 1.0 / d**2, n) for a, b, n, d in plan.values()]
    apart = _characteristics(bores, "source", _at(result, "source")[1:])
    off = [np.max(np.abs(_at(result, node)[1:] - apart[node])) for node in ("tee", "fork", "far")]
    far = _at(result, "far")[1:]
    time = _microseconds(far.size)
    shown = slice(0, 3000, 10)
    losses = result.books.losses
    leak = sum(abs(losses[f"{node} implicit step"]) for node in ("tee", "fork", "far", "near"))
    return [
        check(
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
        check(
            "network with a ring and dead ends, energy that does not balance [-]",
            expected=0.0,
            computed=result.books.relative_residual,
            tolerance=2e-13,
            source="conservation of energy",
        ),
        check(
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
        check(
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
    hole = component("pressure-loss", diameter=0.8e-3, coefficient=2.0, laminar_coefficient=1e-6)
    result = _run(
        {"source": _source(), "l": bore(200, 2e-3), "hole": hole, "end": Junction()},
        [["source.fluid", "l.a"], ["l.b", "end.fluid", "hole.a"], ["hole.b", "ambient"]],
        350,
        start="rest",
    )
    p = float(result.channels["end pressure"].values[300])
    p0 = float(result.channels["end pressure"].values[0])
    flow = result.channels["hole mass flow"].values
    Z = SPEED * (RHO_HEPTANE**2 / float(HEPTANE.density(BEFORE))) / (pi / 4 * 2e-3**2)

    def through(x: float) -> float:
        drop = x - AMBIENT.pressure
        return pi / 4 * 0.8e-3**2 * sqrt(2.0 * float(HEPTANE.density(x)) * drop / 2.0)

    def left(x: float) -> float:
        return wave_pressure(x) + Z * through(x) / RHO_HEPTANE - arriving

    # the wave that arrives had Z times the first flow, and brings twice the jump
    arriving = wave_pressure(p0) + Z * through(p0) / RHO_HEPTANE + 2.0 * JUMP
    expected = float(brentq(left, BEFORE, 2.0 * AFTER, xtol=1e-3, rtol=1e-14))
    return [
        check(
            "throttle at the end of a line, pressure after a jump [bar]",
            expected=expected / BAR,
            computed=p / BAR,
            tolerance=1e-12,
            source="one equation, c = p + Z q(p), by Brent's method",
        ),
        check(
            "throttle at the end of a line, flow after a jump [kg/s]",
            expected=(arriving - wave_pressure(p)) * RHO_HEPTANE / Z,
            computed=float(flow[300]),
            tolerance=2e-10,
            source="q = (c - p)/Z",
        ),
    ]


def _cavity() -> list[Check]:
    """A falling pressure pulls a column off the closed end of a line; it comes back."""
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
    return [
        check(
            "cavity at a closed end, largest difference of the pressure [-]",
            expected=0.0,
            computed=float(np.max(np.abs(computed - expected))) / JUMP,
            tolerance=3e-9,
            source="discrete vapour cavity of the method of characteristics, coded independently",
            curve=ComparedCurve(
                x_label="time [us]",
                y_label="pressure [bar]",
                expected=(time, expected / BAR),
                computed=(time, computed / BAR),
            ),
        ),
        check(
            "cavity at a closed end, steps for which it is open [-]",
            expected=float(np.count_nonzero(expected <= vapour * (1.0 - 1e-12))),
            computed=float(np.count_nonzero(computed <= vapour * (1.0 - 1e-9))),
            tolerance=5e-14,
            source="discrete vapour cavity of the method of characteristics, coded independently",
        ),
        check(
            "cavity at a closed end, energy that does not balance [-]",
            expected=0.0,
            computed=result.books.relative_residual,
            tolerance=2e-13,
            source="conservation of energy; the collapse is a loss",
        ),
    ]


def _vanishing_chamber() -> list[Check]:
    """The pressure at a tee with a chamber tends to that without one."""
    sums = []
    for tee in (
        *(component("chamber", volume=v, pressure=BEFORE) for v in (40e-9, 20e-9, 10e-9)),
        None,
    ):
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
    return [
        check(
            "chambers of 40, 20 and 10 mm^3 at a tee: lags behind a junction, differences [-]",
            expected=2.0,
            computed=float((lag[0] - lag[1]) / (lag[1] - lag[2])),
            tolerance=1e-3,
            source="time constant V/(K sum Y): proportional to the volume",
        ),
        check(
            "chamber of 20 instead of 10 mm^3 at a tee, lag [us]",
            expected=1e6
            * 10e-9
            / float(HEPTANE.bulk_modulus(BEFORE))
            / float(pi / 4 * squares.sum() / (SPEED * float(HEPTANE.density(BEFORE)))),
            computed=1e6 * float(lag[1] - lag[2]),
            tolerance=3e-3,
            source="V/(K sum Y)",
            reason="the bulk modulus rises by 1 % over the jump",
        ),
    ]


SUPPLY = 40 * BAR
LENGTH, BORE, ROUGH = 1.0, 2e-3, 10e-6  # [m]
AREA = pi / 4 * BORE**2
VISCOSITY = float(HEPTANE.viscosity(SUPPLY))
DENSITY = float(HEPTANE.density(SUPPLY))


def turbulent_line() -> list[Check]:
    """Steady flows at three Reynolds numbers, and a valve that closes at the end."""
    return [*_steady(), *_hammer()]


def _line(friction: str, segments: int) -> Line:
    return Line.model_validate(
        {
            "length": LENGTH,
            "diameter": BORE,
            "pressure": SUPPLY,
            "friction": friction,
            "segments": segments,
            **({"roughness": ROUGH} if friction == "turbulent" else {}),
        }
    )


def _closing(
    area: float, friction: str, segments: int, *, duration: float, step: float, closes: float
) -> NetworkResult:
    """Line from a pressure to a valve that begins to close at 50 us."""
    return run_network(
        {
            "source": component("pressure-source", pressure=SUPPLY),
            "line": _line(friction, segments),
            "end": component("junction"),
            "valve": component(
                "variable-orifice", time=(0.0, 50e-6, 50e-6 + closes), area=(area, area, 0.0)
            ),
        },
        [
            ["source.fluid", "line.a"],
            ["line.b", "end.fluid", "valve.a"],
            ["valve.b", "ambient"],
        ],
        still=True,
        fluid=HEPTANE,
        duration=duration,
        step=step,
        record=10 * step,
        start="rest",
    )


def darcy(reynolds: float) -> float:
    """Hagen-Poiseuille below Re = 2300, Colebrook (by iteration) above 4000 [-]."""
    if reynolds <= 2300.0:
        return 64.0 / reynolds
    root = 8.0  # 1/sqrt(f)
    for _ in range(100):
        before, root = root, -2.0 * log10(ROUGH / (3.7 * BORE) + 2.51 / reynolds * root)
        if abs(root - before) <= 1e-15 * root:  # a tenth of the distance is left at each time
            break
    return root**-2


def _steady() -> Iterator[Check]:
    for area in (0.02e-6, 0.3e-6, 2e-6):
        result = _closing(area, "turbulent", 4, duration=20e-6, step=1e-6, closes=1e-3)
        start = result.start
        assert start is not None
        flow = start.flow["valve"]
        reynolds = 4.0 * flow / (pi * BORE * VISCOSITY)
        drop, p = 0.0, SUPPLY
        for _part in range(4):
            speed = flow / (float(HEPTANE.density(p)) * AREA)
            part = darcy(reynolds) * LENGTH / 4 / BORE * float(HEPTANE.density(p)) / 2 * speed**2
            drop, p = drop + part, p - part
        yield check(
            f"turbulent line, steady pressure drop at Re = {reynolds:.3g} [bar]",
            expected=drop / BAR,
            computed=(SUPPLY - start.pressure["end"]) / BAR,
            tolerance=5e-13,
            source="Hagen-Poiseuille; Colebrook by iteration, density of the fluid upstream",
            reason="the static equilibrium is found to 1e-13 of each pressure",
        )


def _grid(time: np.ndarray, flow: np.ndarray, reaches: int) -> np.ndarray:
    """Wave pressure at the end over time: characteristics with friction in every reach.

    ``flow`` [kg/s] leaves; explicit first-order friction (Wylie & Streeter 1993, 3.6).
    """
    speed = _line("none", 1).wave_speed(HEPTANE)
    h = LENGTH / speed / reaches
    scale = (RHO_HEPTANE / DENSITY) ** 2
    Z = scale * DENSITY * speed / AREA
    laminar = scale * 128.0 * VISCOSITY * LENGTH / reaches / (pi * BORE**4)
    rate = 4.0 * VISCOSITY / DENSITY / BORE**2 * np.array(KAGAWA.rates)
    gain = 0.5 * laminar * np.array(KAGAWA.factors)[:, None]
    decay = np.exp(-rate * h)[:, None]

    def steady(q: np.ndarray) -> np.ndarray:
        reynolds = np.maximum(4.0 * RHO_HEPTANE * np.abs(q) / (pi * BORE * VISCOSITY), 1e-9)
        factor = np.array([_any_darcy(x) for x in reynolds])
        part = LENGTH / reaches / BORE
        return np.asarray(scale * factor * part * DENSITY / 2 * np.abs(q) * q / AREA**2)

    q = np.full(reaches + 1, flow[0] / RHO_HEPTANE)
    P = wave_pressure(SUPPLY) - np.arange(reaches + 1) * steady(q[:1])[0]
    memory = np.repeat(q[None, :], rate.size, axis=0)
    steps = int(time[-1] / h)
    leaving = np.interp((np.arange(steps) + 1.0) * h, time, flow) / RHO_HEPTANE
    found = np.zeros(steps + 1)
    found[0] = P[-1]
    for n in range(steps):
        lost = steady(q) + np.sum(gain * (q - memory), axis=0)
        right = P + Z * q - lost  # travels to the end
        left = P - Z * q + lost
        new_P, new_q = P.copy(), q.copy()
        new_P[1:-1] = 0.5 * (right[:-2] + left[2:])
        new_q[1:-1] = 0.5 * (right[:-2] - left[2:]) / Z
        new_q[0] = (P[0] - left[1]) / Z
        new_q[-1] = leaving[n]
        new_P[-1] = right[-2] - Z * new_q[-1]
        memory = new_q - decay * (new_q - memory)
        P, q = new_P, new_q
        found[n + 1] = P[-1]
    return np.asarray(np.interp(time, np.arange(steps + 1) * h, found))


def _any_darcy(reynolds: float) -> float:
    """The same with the straight line in ``Re sqrt(f)`` between."""
    if reynolds <= 2300.0 or reynolds >= 4000.0:
        return darcy(reynolds)
    low, high = sqrt(64.0 * 2300.0), 4000.0 * sqrt(darcy(4000.0))
    x = low + (reynolds - 2300.0) / 1700.0 * (high - low)
    return (x / reynolds) ** 2


def _hammer() -> list[Check]:
    """A valve closes in 0.2 ms on a flow of Re = 1.1e4 in a line of 1 m."""
    duration, area = 8e-3, 0.17e-6
    runs = {
        n: _closing(area, "turbulent", n, duration=duration, step=1e-6, closes=2e-4) for n in (2, 8)
    }
    result = runs[8]
    time = result.time
    apart = _grid(time, result.channels["valve mass flow"].values, 200)
    off = {}
    for n, run in runs.items():
        p = run.channels["end pressure"].values
        off[n] = np.array([wave_pressure(x) for x in p]) - apart
    with catch_warnings():
        simplefilter("ignore", AccuracyWarning)  # laminar at Re = 1.1e4, to show the difference
        laminar = _closing(area, "kagawa", 8, duration=duration, step=1e-6, closes=2e-4)
    shown = slice(0, None, 4)
    return [
        check(
            "turbulent line of 8 parts, closing valve, rms difference from a grid [-]",
            expected=0.0,
            computed=float(np.sqrt(np.mean(off[8] ** 2))) / float(np.max(apart) - apart[0]),
            tolerance=1e-2,
            source="characteristics of 200 reaches with Colebrook and Kagawa's terms, apart",
            reason="the first-order friction of the grid, and one density of the line",
            curve=ComparedCurve(
                x_label="time [ms]",
                y_label="pressure at the valve [bar]",
                expected=(1e3 * time[shown], apart[shown] / BAR),
                computed=(1e3 * time[shown], (apart + off[8])[shown] / BAR),
            ),
        ),
        check(
            "turbulent line of 8 parts, energy that does not balance [-]",
            expected=0.0,
            computed=result.books.relative_residual,
            tolerance=5e-13,
            source="conservation of energy",
        ),
        check(
            "laminar instead of turbulent, pressure before the valve at the start [bar]",
            expected=(SUPPLY - float(laminar.channels["end pressure"].values[0])) / BAR,
            computed=128.0
            * VISCOSITY
            * LENGTH
            / (pi * BORE**4)
            * float(laminar.channels["valve mass flow"].values[0])
            / DENSITY
            / BAR,
            tolerance=2e-3,
            source="Hagen-Poiseuille",
            reason="one density in the line",
        ),
    ]
