"""Pump, relief valve, accumulator and throttle together.

The other side integrates one pressure per volume with SciPy to 1e-9, from density and formulas
alone.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from math import exp, log, pi, sqrt

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from klack.hydraulics.flow_source import FlowSource, FlowStep
from klack.hydraulics.fluid import Fluid
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.pulsating_flow import FlowHarmonic, PulsatingFlow
from klack.network.component import Component
from klack.simulation.network_result import NetworkResult
from klack.verification.benches import AMBIENT, BAR, OIL, RHO_OIL, component, run_network
from klack.verification.check import Check, ComparedCurve, check

__all__ = ["OIL", "gas_release", "supply_networks"]


APART = "the same equations integrated apart by SciPy (DOP853, 1e-10)"
BALANCE = "conservation of energy"


def supply_networks() -> list[Check]:
    """Return the checks."""
    return [*_filling(), *_pulsation(), *_one_way(), *_lagging_relief()]


def _apart(
    rates: Callable[[float, np.ndarray], np.ndarray],
    start: Sequence[float],
    time: np.ndarray,
    longest: float,
) -> np.ndarray:
    found = solve_ivp(
        rates,
        (0.0, time[-1]),
        start,
        method="DOP853",
        t_eval=time,
        rtol=1e-10,
        atol=1e-3,
        max_step=longest,
    )
    return np.asarray(found.y)


def _stiffness(p: float) -> float:
    """Slope of the density with pressure [kg/(m^3 Pa)]."""
    return float(OIL.density(p)) / float(OIL.bulk_modulus(p))


def _throttle(p: float, area: float) -> float:
    """Mass flow to the surroundings, turbulent."""
    return 0.7 * area * sqrt(2.0 * float(OIL.density(p)) * max(p - AMBIENT.pressure, 0.0))


_PLACES = ((10e-3, 2e-6), (28e-3, 2e-5), (60e-3, 2e-4))  # [s], accepted there
V_RAIL, V_GAS, PRECHARGE = 100e-6, 50e-6, 60 * BAR
SET, GAIN = 100 * BAR, 40 / 6e4 / (10 * BAR)


def _gas(p: float) -> float:
    """Slope of the mass in the accumulator with pressure [kg/Pa], n = 1.4."""
    if p <= PRECHARGE:
        return 0.0
    gas = V_GAS * (PRECHARGE / p) ** (1 / 1.4)
    return _stiffness(p) * (V_GAS - gas) + float(OIL.density(p)) * gas / (1.4 * p)


def _relief(p: float) -> float:
    """Mass flow of the relief valve, straight above its set pressure."""
    drop = p - AMBIENT.pressure
    # its area is that of ambient density
    return GAIN * max(drop - SET, 0.0) * sqrt(RHO_OIL * float(OIL.density(p)))


def _filling() -> Iterator[Check]:
    hole = pi / 4 * 1.5e-3**2
    flow = 20 / 6e4

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        p = float(y[0])
        into = RHO_OIL * flow * (1.0 + np.clip((t - 30e-3) / 1e-3, 0.0, 1.0))
        into -= _throttle(p, hole) + _relief(p)
        return np.array([into / (V_RAIL * _stiffness(p) + _gas(p))])

    result = run_network(
        {
            "pump": FlowSource(flow=flow, step=FlowStep(to=2 * flow, at=30e-3, rise=1e-3)),
            "rail": component("chamber", volume=V_RAIL, pressure=20 * BAR),
            "load": component("orifice", area=hole, critical_flow_number=1.0, cavitation=None),
            "relief": component(
                "relief-valve",
                set_pressure=SET,
                rated_pressure=110 * BAR,
                rated_flow=40 / 6e4,
                diameter=8e-3,
                critical_flow_number=1.0,
                cavitation=None,
            ),
            "accumulator": component("accumulator", volume=V_GAS, precharge=PRECHARGE),
        },
        [
            ["pump.b", "rail.fluid", "load.a", "relief.a", "accumulator.fluid"],
            ["load.b", "ambient"],
            ["relief.b", "ambient"],
        ],
        still=True,
        fluid=OIL,
        duration=60e-3,
        step=5e-6,
        record=100e-6,
    )
    time, p = result.time, result.channels["rail pressure"].values
    known = _apart(rates, [20 * BAR], time, 50e-6)[0]
    curve = ComparedCurve(
        x_label="time [ms]",
        y_label="pressure [bar]",
        expected=(time * 1e3, known / BAR),
        computed=(time * 1e3, p / BAR),
    )
    source = APART + "; steps of 5 us, first order where the accumulator holds the pressure"
    places = {int(np.argmin(np.abs(time - t))): tolerance for t, tolerance in _PLACES}
    yield from [
        check(
            f"pump, relief valve, accumulator, throttle: pressure after {1e3 * time[k]:.0f} ms "
            "[Pa]",
            float(known[k]),
            float(p[k]),
            tolerance,
            source,
            curve,
        )
        for k, tolerance in places.items()
    ]
    yield check(
        "pump, relief valve, accumulator, throttle: energy residual [-]",
        0.0,
        result.books.relative_residual,
        1e-13,
        BALANCE,
    )


def _pulsation() -> list[Check]:
    hole, frequency = pi / 4 * 1.2e-3**2, 400.0

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        p = float(y[0])
        into = RHO_OIL * (15 + 3 * np.sin(2 * pi * frequency * t)) / 6e4 - _throttle(p, hole)
        return np.array([into / (20e-6 * _stiffness(p))])

    result = run_network(
        {
            "pump": PulsatingFlow(
                mean=15 / 6e4, harmonics=(FlowHarmonic(frequency=frequency, amplitude=3 / 6e4),)
            ),
            "rail": component("chamber", volume=20e-6, pressure=60 * BAR),
            "load": component("orifice", area=hole, critical_flow_number=1.0, cavitation=None),
        },
        [["pump.b", "rail.fluid", "load.a"], ["load.b", "ambient"]],
        still=True,
        fluid=OIL,
        duration=20e-3,
        step=1e-6,
        record=20e-6,
    )
    time, p = result.time, result.channels["rail pressure"].values
    known = _apart(rates, [60 * BAR], time, 50e-6)[0]
    last = time > 15e-3
    return [
        check(
            "flow that pulsates by 20 % at 400 Hz, ripple of the pressure [Pa]",
            float(np.ptp(known[last])),
            float(np.ptp(p[last])),
            5e-5,
            APART,
            ComparedCurve(
                x_label="time [ms]",
                y_label="pressure [bar]",
                expected=(time * 1e3, known / BAR),
                computed=(time * 1e3, p / BAR),
            ),
        ),
        check(
            "flow that pulsates by 20 % at 400 Hz, mean pressure [Pa]",
            float(known[last].mean()),
            float(p[last].mean()),
            5e-6,
            APART,
        ),
    ]


def _one_way() -> list[Check]:
    """Pulsating flow between volumes with a check valve: a piston compressor of fluid."""
    size = pi / 4 * 3e-3**2
    frequency, hole = 200.0, pi / 4 * 0.8e-3**2

    def check_flow(p: float, q: float) -> float:
        s = min(max((p - q - 0.5 * BAR) / (1.5 * BAR), 0.0), 1.0)
        area = size * s
        return 0.7 * area * sqrt(2.0 * float(OIL.density(p)) * max(p - q, 0.0))

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        p, q = (float(x) for x in y)
        into = RHO_OIL * (5 + 12 * np.sin(2 * pi * frequency * t)) / 6e4
        through = check_flow(p, q)
        return np.array(
            [
                (into - through) / (200e-6 * _stiffness(p)),
                (through - _throttle(q, hole)) / (30e-6 * _stiffness(q)),
            ]
        )

    result = run_network(
        {
            "pump": PulsatingFlow(
                mean=5 / 6e4, harmonics=(FlowHarmonic(frequency=frequency, amplitude=12 / 6e4),)
            ),
            "rail": component("chamber", volume=200e-6, pressure=60 * BAR),
            "valve": component(
                "check-valve",
                cracking_pressure=0.5 * BAR,
                open_pressure=2 * BAR,
                diameter=3e-3,
                critical_flow_number=1.0,
                cavitation=None,
            ),
            "second": component("chamber", volume=30e-6, pressure=60 * BAR),
            "load": component("orifice", area=hole, critical_flow_number=1.0, cavitation=None),
        },
        [
            ["pump.b", "rail.fluid", "valve.a"],
            ["valve.b", "second.fluid", "load.a"],
            ["load.b", "ambient"],
        ],
        still=True,
        fluid=OIL,
        duration=20e-3,
        step=0.5e-6,
        record=20e-6,
    )
    time, p = result.time, result.channels["second pressure"].values
    known = _apart(rates, [60 * BAR, 60 * BAR], time, 20e-6)[1]
    return [
        check(
            "flow to and fro before a check valve, pressure behind it after 20 ms [Pa]",
            float(known[-1]),
            float(p[-1]),
            1e-6,
            APART,
            ComparedCurve(
                x_label="time [ms]",
                y_label="pressure [bar]",
                expected=(time * 1e3, known / BAR),
                computed=(time * 1e3, p / BAR),
            ),
        ),
        check(
            "flow to and fro before a check valve, ripple behind it [Pa]",
            float(np.ptp(known[time > 10e-3])),
            float(np.ptp(p[time > 10e-3])),
            1e-5,
            APART,
        ),
        check(
            "flow to and fro before a check valve, energy residual [-]",
            0.0,
            result.books.relative_residual,
            5e-14,
            BALANCE,
        ),
    ]


def _lagging_relief() -> list[Check]:
    """A chamber before a relief valve with a lag swings about its equilibrium."""
    volume, tau, above = 2e-3, 4e-3, 5 * BAR
    drop = SET + above
    p = AMBIENT.pressure + drop
    capacity = volume * _stiffness(p)
    # A = k (dp - p_s)/sqrt(dp) and C_q A sqrt(2 rho dp): slopes at constant area, and with the area
    mass_flow = GAIN * above * sqrt(RHO_OIL * float(OIL.density(p)))
    direct = 0.5 * mass_flow / drop
    by_area = mass_flow * (1.0 / above - 0.5 / drop)
    poles = np.roots([capacity * tau, capacity + direct * tau, direct + by_area])
    pole = poles[np.argmax(poles.imag)]
    result = run_network(
        {
            "pump": FlowSource(
                flow=mass_flow / RHO_OIL,
                step=FlowStep(to=mass_flow / RHO_OIL * 1.0002, at=1e-3, rise=1e-6),
            ),
            "rail": component("chamber", volume=volume, pressure=p),
            "relief": component(
                "relief-valve",
                set_pressure=SET,
                rated_pressure=110 * BAR,
                rated_flow=40 / 6e4,
                diameter=8e-3,
                critical_flow_number=1.0,
                cavitation=None,
                time_constant=tau,
            ),
        },
        [["pump.b", "rail.fluid", "relief.a"], ["relief.b", "ambient"]],
        still=True,
        fluid=OIL,
        duration=60e-3,
        step=10e-6,
        record=10e-6,
    )
    time = result.time - 1e-3
    swing = result.channels["rail pressure"].values - p
    final = mass_flow * 0.0002 / (direct + by_area)
    # answer of the second-order system to a step of the flow
    decay, omega = -pole.real, pole.imag
    slope = mass_flow * 0.0002 / capacity
    wave = np.exp(-decay * time) * (
        np.cos(omega * time) + (decay - slope / final) / omega * np.sin(omega * time)
    )
    known = np.where(time > 0, final * (1.0 - wave), 0.0)
    top = int(np.argmax(known))
    return [
        check(
            "relief valve with a lag of 4 ms on 2 l, first swing of the pressure [Pa]",
            float(known[top]),
            float(swing.max()),
            2e-3,
            "C tau s^2 + (C + G tau) s + G + G_A = 0",
            ComparedCurve(
                x_label="time [ms]",
                y_label="rise of pressure [Pa]",
                expected=(result.time * 1e3, known),
                computed=(result.time * 1e3, swing),
            ),
        ),
        check(
            "relief valve with a lag of 4 ms on 2 l, time of that swing [s]",
            float(time[top]),
            float(time[int(np.argmax(swing))]),
            1e-2,
            "the same; records of 10 us",
        ),
    ]


FRACTION, EXPONENT, REFERENCE, AIR = 1e-2, 1.2, 101325.0, 1.204
LOW, HIGH = 2 * BAR, 8 * BAR
RELEASE, ABSORPTION = 1e-3, 5e-3
VOLUME, AREA, HOLE = 1e-6, 1e-5, pi / 4 * 0.4e-3**2
TIME = (0.0, 1e-3, 4e-3, 5e-3, 12e-3)
PLACE = (0.0, 1e-3, 1e-3, -0.2e-3, -0.2e-3)
_APART_GAS = "the same equations integrated apart by SciPy (LSODA, 1e-8)"


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
    """One chamber whose piston draws and presses, two with openings, and the limits.

    Gas leaves and enters the oil with time constants. The other side integrates the masses of
    fluid and free gas with SciPy; the pressure follows by bisection.
    """
    return [*_one_chamber(), *_two_chambers(), *_limits()]


def _run(
    parts: Mapping[str, Component],
    connections: Sequence[Sequence[str]],
    fluid: Fluid,
    step: float = 100e-9,
) -> NetworkResult:
    piston = {
        "piston": component("prescribed-motion", time=TIME, displacement=PLACE, between="straight"),
        "face": component("pressure-face", direction="opening", area=AREA),
    }
    return run_network(
        {**piston, **parts},
        [["piston.body", "face.body"], *connections],
        fluid=fluid,
        duration=TIME[-1],
        step=step,
        record=40e-6,
    )


def _room(fluid: Fluid, pressure: float, step: float = 100e-9) -> NetworkResult:
    return _run(
        {"room": component("chamber", volume=VOLUME, pressure=pressure)},
        [["room.fluid", "face.fluid"]],
        fluid,
        step,
    )


def _share(p: float) -> float:
    t = min(max((p - LOW) / (HIGH - LOW), 0.0), 1.0)
    return 1.0 - t * t * (3.0 - 2.0 * t)


def _volume(p: float, share: float) -> float:
    """Per mass of fluid."""
    liquid = CONDENSED / float(LIQUID.vapour.density_with(LIQUID.liquid, p)[0])
    gas = FRACTION * share * (REFERENCE / p) ** (1.0 / EXPONENT)
    return (liquid + gas) / (CONDENSED + FRACTION * AIR)


def _pressure(volume: float, share: float) -> float:
    ends = log(1e2), log(1e8)
    return exp(brentq(lambda x: _volume(exp(x), share) - volume, *ends, xtol=1e-13))


def _apart_gas(
    rates: Callable[[float, np.ndarray], list[float]], start: Sequence[float], time: np.ndarray
) -> np.ndarray:
    """States at the records, from corner to corner of the course of the piston."""
    found, state = [np.array(start)[:, None]], np.array(start)
    for a, b in pairwise(TIME):
        run = solve_ivp(
            rates,
            (a, b),
            state,
            "LSODA",
            np.append(time[(time > a + 1e-9) & (time < b - 1e-9)], b),
            rtol=1e-8,
            atol=1e-13,
        )
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

    free = _apart_gas(lambda t, y: [_released(pressure(t, y[0]), mass, y[0])], [0.0], time)[0]
    known = np.array([pressure(t, y) for t, y in zip(time, free, strict=True)])
    return _compared(
        "piston draws and presses oil with 1 % gas", "room", result, known, free / mass
    )


def _two_chambers() -> list[Check]:
    hole = component("orifice", area=HOLE, critical_flow_number=1.0, cavitation=None, discharge=0.7)
    result = _run(
        {
            "room": component("chamber", volume=VOLUME, pressure=10 * BAR),
            "next": component("chamber", volume=0.3 * VOLUME, pressure=10 * BAR),
            "supply": component("pressure-source", pressure=10 * BAR),
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

    def pressures(t: float, s: np.ndarray) -> tuple[float, float]:
        held = VOLUME + AREA * float(np.interp(t, TIME, PLACE))
        return _pressure(held / s[0], s[1] / s[0]), _pressure(0.3 * VOLUME / s[2], s[3] / s[2])

    def rates(t: float, s: np.ndarray) -> list[float]:
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
    states = _apart_gas(rates, [mass, 0.0, 0.3 * mass, 0.0], time)
    known = np.array([pressures(t, s) for t, s in zip(time, states.T, strict=True)]).T
    name = "the same with a chamber and a supply behind openings"
    return [
        *_compared(f"{name}, piston", "room", result, known[0], states[1] / states[0]),
        *_compared(f"{name}, between", "next", result, known[1], states[3] / states[2]),
    ]


def _compared(
    name: str, room: str, result: NetworkResult, known: np.ndarray, share: np.ndarray
) -> list[Check]:
    p, free = (result.channels[f"{room} {what}"].values for what in ("pressure", "free gas"))
    source = _APART_GAS + "; steps of 0.1 us, first order"
    return [
        check(
            f"{name}: largest error of the share of free gas [-]",
            0.0,
            float(np.max(np.abs(free - share))),
            8e-5,
            source,
            ComparedCurve(
                x_label="time [ms]",
                y_label="share of free gas [-]",
                expected=(result.time * 1e3, share),
                computed=(result.time * 1e3, free),
            ),
        ),
        check(
            f"{name}: largest error of the pressure, of it [-]",
            0.0,
            float(np.max(np.abs(p / known - 1.0))),
            1e-3,
            source,
        ),
        check(
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
    ) -> np.ndarray:
        return _room(_oil(times, band), start).channels["room pressure"].values

    never = pressures((1e12, 1e12), (LOW, HIGH), 1.5 * BAR)
    once = pressures((1e-12, 1e-12), (LOW, HIGH), 10 * BAR)
    return [
        check(
            "release and absorption in 1e12 s: error of the pressure, of it [-]",
            0.0,
            float(np.max(np.abs(never / pressures(None, None, 1.5 * BAR) - 1.0))),
            5e-14,
            "all gas free",
        ),
        check(
            "release and absorption in 1e-12 s: error of the pressure, of it [-]",
            0.0,
            float(np.max(np.abs(once / pressures(None, (LOW, HIGH), 10 * BAR) - 1.0))),
            1e-7,
            "gas in equilibrium with the pressure",
            reason="the last Newton step of the pressure is 1e-5 of it, and its square is left",
        ),
    ]
