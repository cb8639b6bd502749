"""Turbulent friction inside a line: its steady drop, and water hammer on a grid written apart."""

from functools import partial
from math import log10, pi, sqrt
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import NDArray

from klack.errors import AccuracyWarning
from klack.hydraulics.junction import Junction
from klack.hydraulics.line import Line
from klack.hydraulics.line_friction import KAGAWA
from klack.hydraulics.pressure_source import PressureSource
from klack.hydraulics.variable_orifice import VariableOrifice
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.verification.check import Check, ComparedCurve, compare
from klack.verification.line_junctions import AMBIENT, BAR, HEPTANE, RHO, wave_pressure

__all__ = ["turbulent_line"]

SUPPLY = 40 * BAR
LENGTH, BORE, ROUGH = 1.0, 2e-3, 10e-6  # [m]
AREA = pi / 4 * BORE**2
VISCOSITY = float(HEPTANE.viscosity(SUPPLY))
DENSITY = float(HEPTANE.density(SUPPLY))

Vector = NDArray[np.float64]
_check = partial(compare, "lines")


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
    valve = VariableOrifice(time=(0.0, 50e-6, 50e-6 + closes), area=(area, area, 0.0))
    parts = {
        "needle": RigidMass(mass=1e-3),
        "spring": Spring(stiffness=1e4, preload=0.0),
        "source": PressureSource(pressure=SUPPLY),
        "line": _line(friction, segments),
        "end": Junction(),
        "valve": valve,
    }
    connections = [
        ["needle.body", "spring.end"],
        ["source.fluid", "line.a"],
        ["line.b", "end.fluid", "valve.a"],
        ["valve.b", "ambient"],
    ]
    rows = Network(parts, connections, AMBIENT, HEPTANE).rows()
    return simulate_network(rows, duration=duration, step=step, coarse=1, record=10 * step)


def darcy(reynolds: float) -> float:
    """Factor of Hagen-Poiseuille below Re = 2300, of Colebrook (by iteration) above 4000 [-]."""
    if reynolds <= 2300.0:
        return 64.0 / reynolds
    root = 8.0  # 1/sqrt(f)
    for _ in range(100):
        before, root = root, -2.0 * log10(ROUGH / (3.7 * BORE) + 2.51 / reynolds * root)
        if abs(root - before) <= 1e-15 * root:  # a tenth of the distance is left at each time
            break
    return root**-2


def _steady() -> list[Check]:
    checks = []
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
        checks.append(
            _check(
                f"turbulent line, steady pressure drop at Re = {reynolds:.3g} [bar]",
                expected=drop / BAR,
                computed=(SUPPLY - start.pressure["end"]) / BAR,
                tolerance=5e-13,
                source="Hagen-Poiseuille; Colebrook by iteration, density of the fluid upstream",
                reason="the static equilibrium is found to 1e-13 of each pressure",
            )
        )
    return checks


def _grid(time: Vector, flow: Vector, reaches: int) -> Vector:
    """Wave pressure at the end over time: characteristics with friction in every reach.

    ``flow`` [kg/s] leaves at the end; explicit first-order friction (Wylie & Streeter 1993, 3.6).
    """
    speed = _line("none", 1).wave_speed(HEPTANE)
    h = LENGTH / speed / reaches
    scale = (RHO / DENSITY) ** 2
    Z = scale * DENSITY * speed / AREA
    laminar = scale * 128.0 * VISCOSITY * LENGTH / reaches / (pi * BORE**4)
    rate = 4.0 * VISCOSITY / DENSITY / BORE**2 * np.array(KAGAWA.rates)
    gain = 0.5 * laminar * np.array(KAGAWA.factors)[:, None]
    decay = np.exp(-rate * h)[:, None]

    def steady(q: Vector) -> Vector:
        reynolds = np.maximum(4.0 * RHO * np.abs(q) / (pi * BORE * VISCOSITY), 1e-9)
        factor = np.array([_any_darcy(x) for x in reynolds])
        part = LENGTH / reaches / BORE
        return np.asarray(scale * factor * part * DENSITY / 2 * np.abs(q) * q / AREA**2)

    q = np.full(reaches + 1, flow[0] / RHO)
    P = wave_pressure(SUPPLY) - np.arange(reaches + 1) * steady(q[:1])[0]
    memory = np.repeat(q[None, :], rate.size, axis=0)
    steps = int(time[-1] / h)
    leaving = np.interp((np.arange(steps) + 1.0) * h, time, flow) / RHO
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
    """Factor with the straight line in ``Re sqrt(f)`` from Re = 2300 to 4000 [-]."""
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
    flow = result.channels["valve mass flow"].values
    apart = _grid(time, flow, 200)
    off = {}
    for n, run in runs.items():
        p = run.channels["end pressure"].values
        off[n] = np.array([wave_pressure(x) for x in p]) - apart
    jump = float(np.max(apart) - apart[0])
    with catch_warnings():
        simplefilter("ignore", AccuracyWarning)  # laminar at Re = 1.1e4, to show the difference
        laminar = _closing(area, "kagawa", 8, duration=duration, step=1e-6, closes=2e-4)
    shown = slice(0, None, 4)
    return [
        _check(
            "turbulent line of 8 parts, closing valve, rms difference from a grid [-]",
            expected=0.0,
            computed=float(np.sqrt(np.mean(off[8] ** 2))) / jump,
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
        _check(
            "turbulent line of 8 parts, energy that does not balance [-]",
            expected=0.0,
            computed=result.books.relative_residual,
            tolerance=5e-13,
            source="conservation of energy",
        ),
        _check(
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
