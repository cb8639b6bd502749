"""Springs, rubber, friction with presliding and levers in the time loop against known motions."""

from collections.abc import Callable, Iterator
from math import cos, log, pi, radians, sin, sqrt, tan
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq
from scipy.special import ellipj, ellipk

from klack.hydraulics.fluid_library import library_fluid
from klack.mechanics.force import ConstantForce, ForceOverTime
from klack.mechanics.gravity import STANDARD_GRAVITY, Gravity
from klack.mechanics.lugre_friction import LuGreFriction
from klack.mechanics.rubber_stop import MaxwellElement, RubberStop
from klack.mechanics.surging_spring import SurgingSpring
from klack.network.network import Network
from klack.network.rows import Ambient
from klack.network.step_function import evaluate
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.verification.benches import component, crossings
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.mechanics import alone, place, run_parts

__all__ = ["checks"]

MASS = 3e-3  # [kg]
DUFFING = "Duffing's equation, closed solution in elliptic functions"
ROD = "longitudinal waves in a rod, closed form (Wahl, Mechanical Springs, 1963, ch. 25)"
CANUDAS = "equations of Canudas de Wit et al. (1995), integrated by SciPy (Radau)"
MAXWELL = "complex modulus of the generalised Maxwell model, closed form"


def checks() -> list[Check]:
    """Return the checks."""
    return [
        *_nonlinear(),
        *_surging(),
        *_rubber(),
        *_presliding(),
        *_breakaway(),
        *_sliding(),
        *_stick_slip(),
        *_elasto_plastic(),
        *_levers(),
        *_prescribed(),
        *_balances(),
    ]


def _period(time: np.ndarray, values: np.ndarray) -> float:
    """Mean, by rising crossings of zero."""
    at = crossings(time, values)
    return float((at[-1] - at[0]) / (len(at) - 1))


def _nonlinear() -> Iterator[Check]:
    k, reference = 5e6, 50e-6
    for name, a, v, wide in (
        ("hardening", 1.5, 2.0, 5e-9),
        ("softening", -0.4, 1.2, 5e-7),
    ):  # peaks lie between records
        b = k * a / reference**2
        square = (-k + sqrt(k * k + 2.0 * b * MASS * v * v)) / b  # of the amplitude
        if a > 0:
            omega = sqrt((k + b * square) / MASS)
            parameter = b * square / (2.0 * (k + b * square))
        else:
            omega = sqrt((k + 0.5 * b * square) / MASS)
            parameter = -b * square / (2.0 * k + b * square)
        period = 4.0 * float(ellipk(parameter)) / omega
        part = component("nonlinear-spring", stiffness=k, higher=(0.0, a), reference=reference)
        run = alone(part, speed=v, duration=2e-3, step=20e-9)
        x = ellipj(omega * run.time - (ellipk(parameter) if a > 0 else 0.0), parameter)
        exact = np.array(sqrt(square) * (x[1] if a > 0 else x[0]), dtype=float)
        yield from [
            check(
                f"{name} Duffing spring, period [s]",
                period,
                _period(run.time, place(run)),
                2e-6,
                DUFFING,
                ComparedCurve(
                    x_label="time [ms]",
                    y_label="displacement [um]",
                    expected=(run.time * 1e3, exact * 1e6),
                    computed=(run.time * 1e3, place(run) * 1e6),
                ),
            ),
            check(
                f"{name} Duffing spring, amplitude [m]",
                sqrt(square),
                float(np.abs(place(run)).max()),
                wide,
                DUFFING,
            ),
        ]
        if a > 0:
            errors = [
                _period(run.time, place(run)) / period - 1.0
                for run in (
                    alone(part, speed=v, duration=2e-3, step=step) for step in (200e-9, 100e-9)
                )
            ]
            yield check(
                "hardening Duffing spring, order of the error of its period [-]",
                2.0,
                log(errors[0] / errors[1]) / log(2.0),
                2e-2,
                "discrete gradient: second order",
            )
    s = (-0.4e-3, 0.0, 0.3e-3, 0.6e-3, 0.9e-3)
    f = (-30.0, 0.0, 14.0, 12.0, 25.0)
    run = alone(
        component("nonlinear-spring", deflection=s, force=f, start=0.2e-3),
        speed=2.5,
        duration=1.1e-3,
    )
    table = PchipInterpolator(np.array(s), np.array(f))
    other = solve_ivp(
        lambda t, y: [y[1], -float(table(0.2e-3 + y[0])) / MASS],
        (0.0, float(run.time[-1])),
        [0.0, 2.5],
        method="DOP853",
        rtol=1e-11,
        atol=1e-14,
    )
    yield check(
        "disc spring from a table, displacement after 1.1 ms [m]",
        float(other.y[0, -1]),
        float(place(run)[-1]),
        5e-6,
        "the same table in SciPy (PCHIP and DOP853)",
    )


def _rod_motion(time: np.ndarray, k: float, m: float, tip: float, speed: float) -> np.ndarray:
    """Tip mass thrown on a rod held at its other end: sum of exact modes."""
    motion = np.zeros_like(time)
    for j in range(300):
        beta = brentq(
            lambda b: b * tan(b) - m / tip, j * pi + 1e-12, j * pi + 0.5 * pi - 1e-12, xtol=1e-14
        )
        omega = beta * sqrt(k / m)
        modal = m * (0.5 - sin(2 * beta) / (4 * beta)) + tip * sin(beta) ** 2
        motion += tip * speed * sin(beta) ** 2 / (modal * omega) * np.sin(omega * time)
    return motion


def _surging() -> list[Check]:
    k, m = 2e4, 2e-3
    spring = SurgingSpring(stiffness=k, preload=0.0, mass=m, modes=6)
    table = spring.oscillators()

    def stiffness(beta: float, sign: float) -> float:
        # of an end, or from one end to the other: k b cot b, -k b / sin b
        omega2 = beta**2 * k / m
        own = table[:, 0] / table[:, 2]
        sides = np.ones(len(table)) if sign > 0 else table[:, 3]
        return float(sign * k - np.sum(sides * table[:, 0] * omega2 / (own - omega2)))

    run = run_parts(
        {
            "mass": component("rigid-mass", mass=MASS, speed=0.5),
            "spring": SurgingSpring(stiffness=k, preload=0.0, mass=m, modes=20),
        },
        [["mass.body", "spring.end"]],
        3e-3,
    )
    exact = _rod_motion(run.time, k, m, MASS, 0.5)
    light = run_parts(
        {
            "mass": component("rigid-mass", mass=MASS, speed=0.5),
            "spring": SurgingSpring(stiffness=k, preload=0.0, mass=0.2e-3, modes=4),
        },
        [["mass.body", "spring.end"]],
        40e-3,
        400e-9,
    )
    beta = brentq(lambda b: b * tan(b) - 0.2e-3 / MASS, 1e-9, 1.5, xtol=1e-15)
    held = run_parts(
        {
            "mass": component("rigid-mass", mass=MASS),
            "spring": SurgingSpring(stiffness=k, preload=12.0, mass=m),
            "pull": ConstantForce(force=32.0),
            "stop": component("spring", stiffness=k, preload=0.0),
        },
        [["mass.body", "spring.end", "pull.end", "stop.end"]],
        1e-5,
        start="rest",
    )
    ringing = _ringing(SurgingSpring(stiffness=k, preload=0.0, mass=m, modes=3, damping=0.02), 2)
    omega = 3.0 * pi * sqrt(k / m)
    return [
        check(
            "coil spring with mass, dynamic stiffness of an end below its first mode [N/m]",
            k * 2.0 / tan(2.0),
            stiffness(2.0, 1.0),
            2e-6,
            ROD,
        ),
        check(
            "coil spring with mass, dynamic stiffness between its ends above its first mode [N/m]",
            -k * 4.0 / sin(4.0),
            stiffness(4.0, -1.0),
            1e-4,
            ROD,
        ),
        check(
            "needle on a spring with two thirds of its mass, error over amplitude [-]",
            0.0,
            float(np.abs(place(run) - exact).max()) / float(np.abs(exact).max()),
            2e-4,
            ROD,
            ComparedCurve(
                x_label="time [ms]",
                y_label="displacement [um]",
                expected=(run.time * 1e3, exact * 1e6),
                computed=(run.time * 1e3, place(run) * 1e6),
            ),
        ),
        check(
            "needle on a light spring, period [s]",
            2.0 * pi / (beta * sqrt(k / 0.2e-3)),
            _period(light.time, place(light)),
            1e-5,
            "frequency equation b tan b = m/M of a rod with a mass",
        ),
        check(
            "coil spring with mass, displacement at rest [m]",
            20.0 / (2.0 * k),
            float(place(held)[0]),
            1e-13,
            "static stiffness",
        ),
        check(
            "third surge mode between fixed ends, frequency [Hz]",
            omega * sqrt(1.0 - 0.02**2) / (2.0 * pi),
            ringing[0],
            1e-8,
            ROD,
        ),
        check(
            "third surge mode, decay per radian [-]",
            0.02 / sqrt(1.0 - 0.02**2),
            ringing[1],
            2e-5,
            "damping ratio, closed form",
        ),
    ]


def _ringing(spring: SurgingSpring, mode: int) -> tuple[float, float]:
    """Frequency [Hz] and decay per radian of one mode, ends held, by zeros and peaks."""
    row = (
        Network(
            {"mass": component("rigid-mass", mass=1.0), "spring": spring},
            [["mass.body", "spring.end"]],
        )
        .rows()
        .elements[0]
    )
    state, h, x = row.state.copy(), 1e-7, []
    state[2 * mode] = 1e-5
    outputs = 2 + state.size + 2
    for step in range(6000):
        _, out = evaluate(row.step, row.parameters, state, [step * h, h, 0, 0, 0, 0], outputs)
        state = out[2 : 2 + state.size]
        x.append(state[2 * mode])
    place, time = np.array(x), np.linspace(h, h * len(x), len(x))
    tops = np.flatnonzero((place[1:-1] > place[:-2]) & (place[1:-1] > place[2:])) + 1
    return 1.0 / _period(time, place), log(place[tops[0]] / place[tops[-1]]) / (
        2.0 * pi * (len(tops) - 1)
    )


_MAXWELL = (
    MaxwellElement(stiffness=2e5, time=1e-3),
    MaxwellElement(stiffness=5e5, time=1e-5),
)


def _rubber() -> Iterator[Check]:
    rubber = RubberStop(gap=-100e-6, stiffness=1e5, maxwell=_MAXWELL)
    # the shorter the relaxation against the step, the more of the sine's bend in it is missed
    for frequency, *wide in ((20.0, 5e-8, 2e-5), (500.0, 2e-6, 2e-6), (15e3, 5e-8, 4e-8)):
        found = _complex_stiffness(rubber, frequency)
        known = complex(rubber.modulus(frequency))
        for name, part, tolerance in (("storage", "real", wide[0]), ("loss", "imag", wide[1])):
            yield check(
                f"rubber at {frequency:g} Hz, {name} stiffness [N/m]",
                getattr(known, part),
                getattr(found, part),
                tolerance,
                MAXWELL,
            )
    stop = RubberStop(
        gap=50e-6, stiffness=1e6, higher=(0.0, 2.0), reference=100e-6, maxwell=_MAXWELL
    )
    run = run_parts(
        {"mass": component("rigid-mass", mass=MASS, speed=-1.0), "stop": stop},
        [["mass.body", "stop.upper"]],
        1.2e-3,
        20e-9,
    )
    back, peak = _dropped(stop, 1.0)
    velocity = run.channels["mass velocity"].values
    yield from [
        check(
            "mass on nonlinear rubber, restitution [-]",
            back,
            float(velocity[-1]),
            1e-6,
            "the same equations in SciPy (DOP853)",
        ),
        check(
            "mass on nonlinear rubber, deepest point [m]",
            -50e-6 - peak,
            float(place(run).min()),
            1e-6,
            "the same equations in SciPy (DOP853)",
        ),
    ]


def _complex_stiffness(rubber: RubberStop, frequency: float) -> complex:
    """Complex stiffness [N/m] of the compiled step under a steady sine."""
    row = (
        Network(
            {"mass": component("rigid-mass", mass=1.0), "stop": rubber},
            [["mass.body", "stop.upper"]],
        )
        .rows()
        .elements[0]
    )
    of_period, state = 400, row.state.copy()
    periods = 2 + int(np.ceil(12.0 * max(part.time for part in rubber.maxwell) * frequency))
    h = 1.0 / frequency / of_period
    place = -1e-6 * np.sin(2.0 * pi * np.arange(periods * of_period + 1) / of_period)
    force = np.zeros(periods * of_period)
    for i in range(force.size):
        _, out = evaluate(
            row.step,
            row.parameters,
            state,
            [i * h, h, place[i], place[i + 1], 0.0, 0.0],
            2 + state.size + 2,
        )
        force[i], state = out[0], out[2 : 2 + state.size]
    turn = np.exp(-2j * pi * (np.arange(of_period) + 0.5) / of_period)
    middle = -0.5 * (place[:-1] + place[1:])[-of_period:]
    return complex(np.sum(force[-of_period:] * turn) / np.sum(middle * turn))


def _dropped(stop: RubberStop, speed: float) -> tuple[float, float]:
    """Restitution and deepest indentation [m] of a mass on rubber, by SciPy."""

    def elastic(s: float) -> float:
        a = stop.higher[1] / (stop.reference or 1.0) ** 2
        return stop.stiffness * s * (1.0 + a * s * s)

    def rates(t: float, y: np.ndarray) -> list[float]:
        slips = [p.stiffness * y[1] - f / p.time for p, f in zip(stop.maxwell, y[2:], strict=True)]
        return [y[1], -(elastic(y[0]) + sum(y[2:])) / MASS, *slips]

    def parts(t: float, y: np.ndarray) -> float:
        return elastic(y[0]) + float(sum(y[2:])) + (1.0 if t < 1e-6 else 0.0)

    parts.terminal = True  # type: ignore[attr-defined]
    found: Any = solve_ivp(
        rates,
        (0.0, 5e-3),
        [0.0, speed, 0.0, 0.0],
        method="DOP853",
        rtol=1e-11,
        atol=1e-16,
        max_step=2e-6,
        events=(parts, lambda t, y: float(y[1])),
    )
    return -float(found.y_events[0][0][1]) / speed, float(found.y_events[1][0][0])


_PAPER = LuGreFriction(
    coulomb=1.0,
    breakaway=1.5,
    stribeck_speed=1e-3,
    viscous=0.4,
    bristle_stiffness=1e5,
    bristle_damping=sqrt(1e5),
)
"""Table I of Canudas de Wit et al. (1995); their mass is 1 kg."""


def _bristles(v: float, z: float, part: LuGreFriction = _PAPER) -> tuple[float, float]:
    """Rate of the deflection [m/s] and friction [N] of the paper."""
    excess = (part.breakaway or part.coulomb) - part.coulomb
    g = part.coulomb + excess * np.exp(-((v / part.stribeck_speed) ** 2))
    rate = v - part.bristle_stiffness * abs(v) / g * z
    return float(rate), float(
        part.bristle_stiffness * z + part.bristle_damping * rate + part.viscous * v
    )


def _rubbed(
    push: Callable[[float, float], float],
    at: np.ndarray,
    *,
    tolerance: float = 1e-9,
    longest: float = np.inf,
    part: LuGreFriction = _PAPER,
) -> np.ndarray:
    """Displacement, speed, deflection of 1 kg under a force over time and place, by SciPy."""

    def rates(t: float, y: np.ndarray) -> list[float]:
        rate, friction = _bristles(y[1], y[2], part)
        return [y[1], push(t, y[0]) - friction, rate]

    with np.errstate(over="ignore"):  # in its search for increments of a numerical Jacobian
        found = solve_ivp(
            rates,
            (0.0, float(at[-1])),
            [0.0] * 3,
            method="Radau",
            rtol=tolerance,
            atol=1e-4 * tolerance,
            t_eval=at,
            max_step=longest,
        )
    return np.asarray(found.y)


def _pushed(time: tuple[float, ...], force: tuple[float, ...], at: np.ndarray) -> np.ndarray:
    """The same under a force of straight lines over time."""
    return _rubbed(lambda t, _: float(np.interp(t, time, force)), at, longest=0.02)


def _paper_run(push: ForceOverTime, duration: float, part: LuGreFriction) -> NetworkResult:
    return run_parts(
        {"mass": component("rigid-mass", mass=1.0), "push": push, "guide": part},
        [["mass.body", "push.end", "guide.body"]],
        duration,
        50e-6,
    )


def _presliding() -> list[Check]:
    # Fig. 2: up to 95 % of the breakaway force and down to as much the other way, slowly
    time, force = (0.0, 1.0, 3.0, 5.0), (0.0, 1.425, -1.425, 1.425)
    run = _paper_run(ForceOverTime(time=time, force=force), 5.0, _PAPER)
    own = _pushed(time, force, run.time)
    loop = run.time >= 1.0
    area = float(np.trapezoid(np.interp(run.time[loop], time, force), place(run)[loop]))
    at = int(np.searchsorted(run.time, 1.0))
    return [
        check(
            "LuGre presliding, displacement at 95 % of breakaway [m]",
            float(own[0][at]),
            float(place(run)[at]),
            4e-7,
            CANUDAS,
            ComparedCurve(
                x_label="displacement [um]",
                y_label="force [N]",
                expected=(own[0] * 1e6, np.interp(run.time, time, force)),
                computed=(place(run) * 1e6, np.interp(run.time, time, force)),
            ),
        ),
        check(
            "LuGre presliding, energy of the hysteresis loop [J]",
            float(np.trapezoid(np.interp(run.time[loop], time, force), own[0][loop])),
            area,
            5e-5,
            CANUDAS,
        ),
    ]


def _breakaway() -> list[Check]:
    # Fig. 4: the faster the force rises, the lower it is at the breakaway
    found: list[float] = []
    known: list[float] = []
    for rate in (1.0, 10.0):
        time, force = (0.0, 4.0 / rate), (0.0, 4.0)
        run = _paper_run(ForceOverTime(time=time, force=force), 2.0 / rate, _PAPER)
        found.append(float(-run.channels["guide.body force"].values.min()))
        y = _pushed(time, force, run.time)
        known.append(max(_bristles(v, z)[1] for v, z in zip(y[1], y[2], strict=True)))
    return [
        check("LuGre, breakaway force at 1 N/s [N]", known[0], found[0], 1e-4, CANUDAS),
        check(
            "LuGre, breakaway force at 10 N/s over that at 1 N/s [-]",
            known[1] / known[0],
            found[1] / found[0],
            1e-4,
            CANUDAS,
        ),
    ]


def _sliding() -> list[Check]:
    run = run_parts(
        {"mass": component("rigid-mass", mass=1e13, speed=1e-3), "guide": _PAPER},
        [["mass.body", "guide.body"]],
        0.5,
        100e-6,
    )
    steady = 1.0 + 0.5 * np.exp(-1.0) + 0.4e-3
    return [
        check(
            "LuGre, force at steady sliding with the Stribeck speed [N]",
            float(-steady),
            float(run.channels["guide.body force"].values[-1]),
            1e-9,
            "Stribeck curve, closed form",
        )
    ]


def _stick_slip() -> list[Check]:
    # Fig. 5: 1 kg drawn by 2 N/m at 0.1 m/s
    parts = {
        "mass": component("rigid-mass", mass=1.0),
        "guide": _PAPER,
        "spring": component("spring", stiffness=2.0, preload=0.0),
        "pulled": component("rigid-mass", mass=1e9, speed=0.1),
    }
    run = run_parts(
        parts,
        [["mass.body", "spring.end", "guide.body"], ["pulled.body", "spring.base"]],
        20.0,
        100e-6,
    )

    own = _rubbed(lambda t, y: 2.0 * (0.1 * t - y), run.time)
    speed, known = run.channels["mass velocity"].values, own[1]
    return [
        check(
            "LuGre stick-slip, largest speed of a slip [m/s]",
            float(known.max()),
            float(speed.max()),
            2e-5,
            CANUDAS,
            ComparedCurve(
                x_label="time [s]",
                y_label="displacement [m]",
                expected=(run.time, own[0]),
                computed=(run.time, place(run)),
            ),
        ),
        check(
            "LuGre stick-slip, displacement after 20 s [m]",
            float(own[0][-1]),
            float(place(run)[-1]),
            2e-5,
            CANUDAS,
        ),
    ]


def _elasto_plastic() -> list[Check]:
    drift = []
    for share in (0.0, 0.7):
        part = LuGreFriction(
            coulomb=1.0, bristle_stiffness=1e5, bristle_damping=300.0, elastic_share=share
        )
        t = np.arange(0.0, 2.0, 1e-3)
        wave = 0.3 + 0.25 * np.sin(2.0 * pi * 10.0 * t)
        run = _paper_run(
            ForceOverTime(time=tuple(t.tolist()), force=tuple(wave.tolist())), 1.8, part
        )
        early, late = (int(np.searchsorted(run.time, at)) for at in (0.8, 1.8 - 1e-9))
        drift.append(float(place(run)[late] - place(run)[early]))
    return [
        check(
            "elasto-plastic friction, drift under a vibrating force below breakaway [m]",
            0.0,
            drift[1],
            1e-13,
            "Dupont et al. (2002): none below its elastic share",
        ),
        check(
            "the same force with LuGre, drift in 1 s [m]",
            _lugre_drift(),
            drift[0],
            2e-3,
            CANUDAS,
        ),
    ]


def _lugre_drift() -> float:
    part = LuGreFriction(coulomb=1.0, bristle_stiffness=1e5, bristle_damping=300.0)

    place = _rubbed(
        lambda t, _: 0.3 + 0.25 * sin(2.0 * pi * 10.0 * t),
        np.array([0.8, 1.8]),
        tolerance=1e-10,
        part=part,
    )[0]
    return float(place[1] - place[0])


def _levers() -> list[Check]:
    weight = alone(Gravity(inclination=radians(60.0)), speed=0.0, duration=5e-3)
    lever = component(
        "lever", effective_mass=2e-3, arms={"a": 10e-3, "b": -25e-3}, carried={"b": 1e-3}
    )
    moment = 2e-3 * 0.01**2 + 1e-3 * 0.025**2
    omega = sqrt((4e5 * 0.01**2 + 1e5 * 0.025**2) / moment)
    run = run_parts(
        {
            "lever": lever.model_copy(update={"speed": 0.2}),
            "one": component("spring", stiffness=4e5, preload=0.0),
            "other": component("spring", stiffness=1e5, preload=0.0),
        },
        [["lever.a", "one.end"], ["lever.b", "other.end"]],
        10e-3,
    )
    a, b = (run.channels[f"lever.{name} displacement"].values for name in "ab")
    pulled = run_parts(
        {
            "lever": lever,
            "one": component("spring", stiffness=4e5, preload=0.0),
            "force": ConstantForce(force=2.0),
        },
        [["lever.a", "one.end"], ["lever.b", "force.end"]],
        1e-5,
        start="rest",
    )
    return [
        check(
            "lever between two springs, period [s]",
            2.0 * pi / omega,
            _period(run.time, a),
            1e-5,
            "moment of inertia and stiffness about the pivot",
        ),
        check(
            "lever, error of the ratio of its ends [-]",
            0.0,
            float(np.abs(b / 2.5 + a).max() / np.abs(a).max()),
            1e-14,
            "kinematics",
        ),
        check(
            "lever, displacement of one arm by a force on the other [m]",
            -2.0 * 2.5 / 4e5,
            float(pulled.channels["lever.a displacement"].values[0]),
            1e-13,
            "law of the lever",
        ),
        check(
            "weight with the axis at 60 degrees, displacement after 5 ms [m]",
            -0.5 * STANDARD_GRAVITY * cos(radians(60.0)) * float(weight.time[-1]) ** 2,
            float(place(weight)[-1]),
            1e-11,
            "Newton's second law, closed form",
        ),
    ]


def _prescribed() -> list[Check]:
    # a lift curve that stretches a damped spring, and opens a seat between two pressures
    t = np.array([0.0, 0.2e-3, 0.5e-3, 1.2e-3, 1.6e-3])
    y = np.array([0.0, 30e-6, 80e-6, 80e-6, 0.0])
    curve = PchipInterpolator(t, y)
    lift = component("prescribed-motion", time=tuple(t.tolist()), displacement=tuple(y.tolist()))
    k, c = 2e5, 20.0
    run = run_parts(
        {"lift": lift, "spring": component("spring", stiffness=k, preload=0.0, damping=c)},
        [["lift.body", "spring.end"]],
        1.6e-3,
    )
    time = run.time
    middle = time[1:] - 50e-9  # of the last step before a record
    known = k * curve(middle) + c * curve(middle, 1)
    force = run.channels["lift drive force"].values[1:]
    fine = np.linspace(0.0, 1.6e-3, 400_001)
    fluid = library_fluid("n-heptane").at(293.15)
    rows = Network(
        {
            "lift": lift,
            "rail": component("pressure-source", pressure=6e5),
            "seat": component(
                "seat", shape="flat", diameter=1.5e-3, critical_flow_number=1e-3, cavitation=None
            ),
        },
        [["lift.body", "seat.needle"], ["rail.fluid", "seat.a"], ["seat.b", "ambient"]],
        ambient=Ambient(pressure=1e5, temperature=293.15),
        fluid=fluid,
    ).rows()
    flown = simulate_network(rows, duration=1.6e-3, record=1e-6)
    mass = float(np.sum(flown.channels["seat mass flow"].values[1:])) * float(flown.time[1])
    per_lift = 0.7 * pi * 1.5e-3 * sqrt(2.0 * float(fluid.density(6e5)) * 5e5)
    return [
        check(
            "prescribed motion, largest error of its displacement over the lift [-]",
            0.0,
            float(
                np.abs(run.channels["lift.body displacement"].values - curve(time)).max() / y.max()
            ),
            5e-14,
            "its curve in SciPy (PCHIP)",
            ComparedCurve(
                x_label="time [ms]",
                y_label="displacement [um]",
                expected=(time * 1e3, curve(time) * 1e6),
                computed=(time * 1e3, run.channels["lift.body displacement"].values * 1e6),
            ),
        ),
        check(
            "prescribed motion of a damped spring, largest error of its force [N]",
            0.0,
            float(np.abs(force - known).max()),
            5e-5,
            "k y + c y' in the middle of the last step",
        ),
        check(
            "prescribed motion there and back, its work [J]",
            c * float(np.trapezoid(curve(fine, 1) ** 2, fine)),
            run.books.supplies["lift motion"],
            1e-6,
            "heat of the damper, integral of c y'^2",
        ),
        check(
            "seat driven by a lift curve, mass that flows through [kg]",
            per_lift * float(curve.integrate(0.0, 1.6e-3)),
            mass,
            5e-5,
            "turbulent flow through the mantle at every lift, integrated by SciPy",
        ),
    ]


def _balances() -> list[Check]:
    ports = ["spring.end", "disc.end", "guide.body", "stop.upper", "magnet.end"]
    run = run_parts(
        {
            "mass": component("rigid-mass", mass=MASS, speed=0.8),
            "spring": SurgingSpring(stiffness=2e4, preload=10.0, mass=1e-3, damping=0.01),
            "disc": component(
                "nonlinear-spring", stiffness=5e4, higher=(0.2, 0.4), reference=0.2e-3, damping=0.1
            ),
            "guide": LuGreFriction(coulomb=0.5, breakaway=0.7, bristle_stiffness=1e6),
            "stop": RubberStop(gap=30e-6, stiffness=1e6, maxwell=_MAXWELL),
            "magnet": ForceOverTime(time=(0.0, 1e-3, 3e-3), force=(0.0, 60.0, 5.0)),
        },
        [["mass.body", *ports]],
        4e-3,
    )
    return [
        check(
            "all of them at one mass, energy residual over throughput [-]",
            0.0,
            run.books.relative_residual,
            1e-12,
            "energy balance: every element balances to round-off",
        )
    ]
