"""Gas that leaves and enters oil with time constants, against the same equations written apart.

The other side integrates the masses of fluid and of free gas of every chamber with SciPy, from the
densities of liquid and gas; the pressure follows from both by bisection.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import pairwise
from math import exp, log, pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid import Fluid
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.mechanics.prescribed_motion import PrescribedMotion
from klack.network.component import Component
from klack.network.network import Network
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.verification.check import Check, ComparedCurve, compare

__all__ = ["gas_release"]

BAR = 1e5
FRACTION, EXPONENT, REFERENCE, AIR = 1e-2, 1.2, 101325.0, 1.204
LOW, HIGH = 2 * BAR, 8 * BAR
RELEASE, ABSORPTION = 1e-3, 5e-3
VOLUME, AREA, HOLE = 1e-6, 1e-5, pi / 4 * 0.4e-3**2
TIME = (0.0, 1e-3, 4e-3, 5e-3, 12e-3)
PLACE = (0.0, 1e-3, 1e-3, -0.2e-3, -0.2e-3)
APART = "the same equations integrated apart by SciPy (LSODA, 1e-8)"

Vector = NDArray[np.float64]
_check = partial(compare, "hydraulic-parts")


def _oil(times: tuple[float, float] | None, band: tuple[float, float] | None) -> Fluid:
    low, high = band or (None, None)
    release, absorption = times or (None, None)
    return library_fluid("ISO VG 46").at(
        313.15,
        gas_fraction=FRACTION,
        gas_exponent=EXPONENT,
        release_pressure=low,
        saturation_pressure=high,
        release_time=release,
        absorption_time=absorption,
    )


LIQUID = library_fluid("ISO VG 46").at(313.15)
CONDENSED = (1.0 - FRACTION) * float(LIQUID.liquid.density(REFERENCE))


def gas_release() -> list[Check]:
    """One chamber whose piston draws and presses, two with openings, and the limits."""
    return [*_one_chamber(), *_two_chambers(), *_limits()]


def _run(
    parts: Mapping[str, Component],
    connections: Sequence[Sequence[str]],
    fluid: Fluid,
    step: float = 100e-9,
) -> NetworkResult:
    piston = {
        "piston": PrescribedMotion(time=TIME, displacement=PLACE, between="straight"),
        "face": PressureFace(direction="opening", area=AREA),
    }
    network = Network(
        {**piston, **parts}, [["piston.body", "face.body"], *connections], fluid=fluid
    )
    return simulate_network(
        network.rows(), duration=TIME[-1], step=step, coarse=1, record=40e-6, start="free"
    )


def _room(fluid: Fluid, pressure: float, step: float = 100e-9) -> NetworkResult:
    parts = {"room": Chamber(volume=VOLUME, pressure=pressure)}
    return _run(parts, [["room.fluid", "face.fluid"]], fluid, step)


def _share(p: float) -> float:
    t = min(max((p - LOW) / (HIGH - LOW), 0.0), 1.0)
    return 1.0 - t * t * (3.0 - 2.0 * t)


def _volume(p: float, share: float) -> float:
    """Volume per mass of fluid."""
    liquid = CONDENSED / float(LIQUID.vapour.density_with(LIQUID.liquid, p)[0])
    gas = FRACTION * share * (REFERENCE / p) ** (1.0 / EXPONENT)
    return (liquid + gas) / (CONDENSED + FRACTION * AIR)


def _pressure(volume: float, share: float) -> float:
    """Pressure at a volume per mass of fluid."""
    ends = log(1e2), log(1e8)
    return exp(brentq(lambda x: _volume(exp(x), share) - volume, *ends, xtol=1e-13))


def _apart(
    rates: Callable[[float, Vector], list[float]], start: Sequence[float], time: Vector
) -> Vector:
    """States at the times of records, from one corner of the course of the piston to the next."""
    found, state = [np.array(start)[:, None]], np.array(start)
    for a, b in pairwise(TIME):
        here = np.append(time[(time > a + 1e-9) & (time < b - 1e-9)], b)
        run = solve_ivp(rates, (a, b), state, "LSODA", here, rtol=1e-8, atol=1e-13)
        found.append(run.y)
        state = run.y[:, -1]
    return np.concatenate(found, axis=1)


def _released(p: float, mass: float, free: float) -> float:
    """Rate of the mass of fluid whose gas is free."""
    missing = _share(p) * mass - free
    return missing / (RELEASE if missing > 0.0 else ABSORPTION)


def _one_chamber() -> list[Check]:
    result = _room(_oil((RELEASE, ABSORPTION), (LOW, HIGH)), 10 * BAR)
    time = result.time
    mass = VOLUME / _volume(10 * BAR, 0.0)

    def pressure(t: float, free: float) -> float:
        held = VOLUME + AREA * float(np.interp(t, TIME, PLACE))
        return _pressure(held / mass, free / mass)

    free = _apart(lambda t, y: [_released(pressure(t, y[0]), mass, y[0])], [0.0], time)[0]
    known = np.array([pressure(t, y) for t, y in zip(time, free, strict=True)])
    return _compared(
        "piston draws and presses oil with 1 % gas", "room", result, known, free / mass
    )


def _two_chambers() -> list[Check]:
    hole = Orifice(area=HOLE, critical_flow_number=1.0, cavitation=None, discharge=0.7)
    result = _run(
        {
            "room": Chamber(volume=VOLUME, pressure=10 * BAR),
            "next": Chamber(volume=0.3 * VOLUME, pressure=10 * BAR),
            "supply": PressureSource(pressure=10 * BAR),
            "inner": hole,
            "outer": hole,
        },
        [
            ["room.fluid", "face.fluid", "inner.a"],
            ["inner.b", "next.fluid", "outer.a"],
            ["outer.b", "supply.fluid"],
        ],
        _oil((RELEASE, ABSORPTION), (LOW, HIGH)),
    )
    time = result.time

    def flow(p: float, q: float, y: float, z: float) -> float:
        upstream = 1.0 / (_volume(p, y) if p > q else _volume(q, z))
        return 0.7 * HOLE * sqrt(2.0 * upstream * abs(p - q)) * float(np.sign(p - q))

    def pressures(t: float, s: Vector) -> tuple[float, float]:
        held = VOLUME + AREA * float(np.interp(t, TIME, PLACE))
        a = _pressure(held / s[0], s[1] / s[0])
        return a, _pressure(0.3 * VOLUME / s[2], s[3] / s[2])

    def rates(t: float, s: Vector) -> list[float]:
        y, z = s[1] / s[0], s[3] / s[2]
        a, b = pressures(t, s)
        inner, outer = flow(a, b, y, z), flow(b, 10 * BAR, z, 0.0)
        carried = inner * (y if inner > 0.0 else z)
        left = outer * (z if outer > 0.0 else 0.0)
        return [
            -inner,
            _released(a, s[0], s[1]) - carried,
            inner - outer,
            _released(b, s[2], s[3]) + carried - left,
        ]

    mass = VOLUME / _volume(10 * BAR, 0.0)
    states = _apart(rates, [mass, 0.0, 0.3 * mass, 0.0], time)
    known = np.array([pressures(t, s) for t, s in zip(time, states.T, strict=True)]).T
    name = "the same with a chamber and a supply behind openings"
    return [
        *_compared(f"{name}, piston", "room", result, known[0], states[1] / states[0]),
        *_compared(f"{name}, between", "next", result, known[1], states[3] / states[2]),
    ]


def _compared(
    name: str, room: str, result: NetworkResult, known: Vector, share: Vector
) -> list[Check]:
    p, free = (result.channels[f"{room} {what}"].values for what in ("pressure", "free gas"))
    curve = ComparedCurve(
        x_label="time [ms]",
        y_label="share of free gas [-]",
        expected=(result.time * 1e3, share),
        computed=(result.time * 1e3, free),
    )
    source = APART + "; steps of 0.1 us, first order"
    return [
        _check(
            f"{name}: largest error of the share of free gas [-]",
            0.0,
            float(np.max(np.abs(free - share))),
            8e-5,
            source,
            curve,
        ),
        _check(
            f"{name}: largest error of the pressure, of it [-]",
            0.0,
            float(np.max(np.abs(p / known - 1.0))),
            1e-3,
            source,
        ),
        _check(
            f"{name}: energy residual [-]",
            0.0,
            result.books.relative_residual,
            5e-13,
            "conservation of energy",
        ),
    ]


def _limits() -> list[Check]:
    def pressures(
        times: tuple[float, float] | None, band: tuple[float, float] | None, start: float
    ) -> Vector:
        return _room(_oil(times, band), start).channels["room pressure"].values

    never = pressures((1e12, 1e12), (LOW, HIGH), 1.5 * BAR)
    frozen = pressures(None, None, 1.5 * BAR)
    once = pressures((1e-12, 1e-12), (LOW, HIGH), 10 * BAR)
    settled = pressures(None, (LOW, HIGH), 10 * BAR)
    return [
        _check(
            "release and absorption in 1e12 s: error of the pressure, of it [-]",
            0.0,
            float(np.max(np.abs(never / frozen - 1.0))),
            5e-14,
            "all gas free",
        ),
        _check(
            "release and absorption in 1e-12 s: error of the pressure, of it [-]",
            0.0,
            float(np.max(np.abs(once / settled - 1.0))),
            1e-7,
            "gas in equilibrium with the pressure",
            reason="the last Newton step of the pressure is 1e-5 of it, and its square is left",
        ),
    ]
