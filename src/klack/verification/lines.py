"""Lines with water hammer: fronts, echoes, unsteady friction, cavities, volume and energy."""

from math import pi

import numpy as np
from scipy.special import jn_zeros

from klack.hydraulics.line_friction import (
    KAGAWA,
    ExponentialWeights,
    laminar_resistance,
    laminar_weight,
    unsteady_terms,
    zielke_weight,
)
from klack.network.rows import LineRow
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.line_junctions import line_junctions, turbulent_line
from klack.verification.local_lines import local_line_cells, local_lines
from klack.verification.single_line import (
    End,
    exponential_decay,
    laminar_decay,
    plain_line,
    ringing,
    run_line,
)

__all__ = ["checks"]

RHO, SPEED, VISCOSITY = 685.8, 1152.0, 4.05e-4  # n-heptane, 20 degC [kg/m^3], [m/s], [Pa s]
LENGTH, RADIUS = 0.06, 1.25e-3  # [m]
AREA = pi * RADIUS**2
IMPEDANCE = RHO * SPEED / AREA
DELAY = LENGTH / SPEED
STEPS = 500
STEP = DELAY / STEPS


def checks() -> list[Check]:
    """Return the checks."""
    return [
        *_closure(),
        *_slow_closure(),
        *_piston(),
        *_pulse(),
        *_weights(),
        *_first_mode(),
        *_start_up(),
        *_cavity(),
        *_books(),
        *line_junctions(),
        *local_line_cells(),
        *turbulent_line(),
        *local_lines(),
    ]


def heptane_line(segments: int, weights: ExponentialWeights | None = KAGAWA) -> LineRow:
    """Bore of 60 x 2.5 mm in n-heptane with laminar friction; steady without ``weights``."""
    resistance = laminar_resistance(LENGTH, 2.0 * RADIUS, VISCOSITY)
    terms: tuple[np.ndarray, np.ndarray] = (np.zeros(0), np.zeros(0))
    if weights is not None:
        terms = unsteady_terms(
            weights,
            resistance=resistance,
            diameter=2.0 * RADIUS,
            kinematic_viscosity=VISCOSITY / RHO,
        )
    return plain_line(
        delay=DELAY,
        impedance=IMPEDANCE,
        segments=segments,
        resistance=resistance,
        unsteady=terms,
    )


def _microseconds(count: int) -> np.ndarray:
    return np.asarray(np.arange(count) * (STEP * 1e6), dtype=np.float64)


def _closure() -> list[Check]:
    """Reservoir at a, valve at b that shuts at once; 50 periods."""
    speed, periods = 0.4, 50
    n = 4 * STEPS * periods
    run = run_line(
        plain_line(delay=DELAY, impedance=IMPEDANCE),
        End(pressure=0.0),
        End(flow=0.0),
        step=STEP,
        lengths=np.ones(n),
        flow=AREA * speed,
    )
    jump = RHO * SPEED * speed
    square = np.where((np.arange(n) // (2 * STEPS)) % 2 == 0, jump, -jump)
    first = slice(0, 16 * STEPS, 10)  # four periods
    time = _microseconds(n)[first]
    return [
        check(
            "instant closure, pressure rise [Pa]",
            expected=jump,
            computed=run.pressure[0, 1],
            tolerance=5e-14,
            source="Joukowsky: rho a v; Wylie & Streeter 1993, ch. 1",
        ),
        check(
            "50 periods of 4 L/a after it, largest difference from a square wave [-]",
            expected=0.0,
            computed=float(np.max(np.abs(run.pressure[:, 1] - square))) / jump,
            tolerance=5e-14,
            source="d'Alembert; no friction, no decay",
            curve=ComparedCurve(
                x_label="time since closure [us]",
                y_label="pressure [bar]",
                expected=(time, square[first] / 1e5),
                computed=(time, run.pressure[first, 1] / 1e5),
            ),
        ),
    ]


def _slow_closure() -> list[Check]:
    """Flow at b that falls linearly in 6 L/a: the exact sum of all echoes."""
    speed, closing, n = 0.4, 6 * STEPS, 12 * STEPS
    edges = np.clip(1.0 - np.arange(n + 1) / closing, 0.0, 1.0) * AREA * speed
    flow = 0.5 * (edges[:-1] + edges[1:])
    run = run_line(
        plain_line(delay=DELAY, impedance=IMPEDANCE),
        End(pressure=0.0),
        End(flow=-flow),
        step=STEP,
        lengths=np.ones(n),
        flow=AREA * speed,
    )
    missing = AREA * speed - flow
    exact = IMPEDANCE * missing
    for k in range(1, n // (2 * STEPS) + 1):
        late = 2 * STEPS * k
        exact[late:] += 2.0 * (-1) ** k * IMPEDANCE * missing[: n - late]
    bound = 2.0 * RHO * LENGTH * speed / (closing * STEP)
    time = _microseconds(n)
    curve = ComparedCurve(
        x_label="time [us]",
        y_label="pressure [bar]",
        expected=(time, exact / 1e5),
        computed=(time, run.pressure[:, 1] / 1e5),
    )
    return [
        check(
            "linear closure in 6 L/a, largest difference from the sum of echoes [-]",
            expected=0.0,
            computed=float(np.max(np.abs(run.pressure[:, 1] - exact))) / bound,
            tolerance=1e-13,
            source="Wylie & Streeter 1993, ch. 3: characteristics without friction",
            curve=curve,
        ),
        check(
            "linear closure in 6 L/a, peak of the pressure [Pa]",
            expected=bound,
            computed=float(np.max(run.pressure[:, 1])),
            tolerance=1.0 / (2 * STEPS),
            source="Michaud: 2 rho L v / t_c; records are means over a step",
            curve=curve,
        ),
    ]


def _piston() -> list[Check]:
    """Needle face of 1.5 mm that moves into a line of 2.5 mm."""
    face, speed = 0.25 * pi * 1.5e-3**2, 0.5
    run = run_line(
        plain_line(delay=DELAY, impedance=IMPEDANCE),
        End(pressure=0.0),
        End(flow=face * speed),
        step=STEP,
        lengths=np.ones(3 * STEPS),
    )
    force = face * run.pressure[:, 1]
    exact = RHO * SPEED * face**2 / AREA * speed
    until = int(np.argmax(np.abs(force - exact) > 1e-9 * exact))
    return [
        check(
            "moving face in front of a line, force until the echo [N]",
            expected=exact,
            computed=float(np.mean(force[: 2 * STEPS])),
            tolerance=5e-14,
            source="rho a A_n^2 / A v: a dashpot",
        ),
        check(
            "moving face in front of a line, time of the echo [s]",
            expected=2.0 * LENGTH / SPEED,
            computed=until * STEP,
            tolerance=5e-14,
            source="2 L / a",
        ),
    ]


def _pulse() -> list[Check]:
    """Flow pulse through a delay of 130.37 steps while fine and coarse steps alternate."""
    step, steps, coarse = 20e-9, 130.37, 16
    lengths = np.where((np.arange(400) // 8) % 2 == 0, 1, coarse)
    time = step * (np.cumsum(lengths) - lengths)
    flow = np.where(time < 0.1e-6, 1e-6, 0.0)
    run = run_line(
        plain_line(delay=steps * step, impedance=IMPEDANCE),
        End(flow=flow),
        End(pressure=0.0),
        step=step,
        lengths=lengths,
    )
    first = (time > 0.5 * steps * step) & (time < 2.5 * steps * step)
    # an open end doubles the flow of the wave
    arrived = -float(np.sum(run.flow[first, 1] * lengths[first] * step)) / 2.0
    weight = run.flow[first, 1] * lengths[first]
    centre = float(np.sum(weight * (time + 0.5 * step * lengths)[first]) / np.sum(weight))
    start = float(np.sum(flow * lengths * (time + 0.5 * step * lengths)) / np.sum(flow * lengths))
    return [
        check(
            "pulse through 130.37 steps of both lengths, volume that arrives [m^3]",
            expected=float(np.sum(flow * lengths * step)),
            computed=arrived,
            tolerance=5e-14,
            source="means with weights that add up to one",
        ),
        check(
            "pulse through 130.37 steps of both lengths, travel time [s]",
            expected=steps * step,
            computed=centre - start,
            tolerance=coarse / steps / 2,
            source="within half a coarse step",
        ),
    ]


def _weights() -> list[Check]:
    source = "sum exp(-j_2k^2 tau), zeros of J_2"
    zielke, kagawa = (np.logspace(np.log10(low), 0.0, 400) for low in (1e-6, 1e-5))
    curves = [
        ComparedCurve(
            x_label="nu t / R^2 [-]",
            y_label="weight [-]",
            expected=(tau, laminar_weight(tau)),
            computed=(tau, weight(tau)),
            x_log=True,
            y_log=True,
        )
        for tau, weight in ((zielke, zielke_weight), (kagawa, KAGAWA))
    ]
    return [
        check(
            "Zielke's weights from tau = 1e-6, largest relative error [-]",
            expected=0.0,
            computed=float(np.max(np.abs(zielke_weight(zielke) / laminar_weight(zielke) - 1.0))),
            tolerance=1e-3,
            source=source,
            curve=curves[0],
        ),
        check(
            "Kagawa's ten terms from tau = 1e-5, largest relative error [-]",
            expected=0.0,
            computed=float(np.max(np.abs(KAGAWA(kagawa) / laminar_weight(kagawa) - 1.0))),
            tolerance=3.5e-3,
            source=source,
            curve=curves[1],
        ),
    ]


def _first_mode() -> list[Check]:
    """Ring-down of a line, open at a and closed at b, from rest under a linear pressure."""
    nu = VISCOSITY / RHO
    viscous = laminar_decay(delay=DELAY, radius=RADIUS, kinematic_viscosity=nu)
    terms = exponential_decay(KAGAWA, delay=DELAY, radius=RADIUS, kinematic_viscosity=nu)
    step = DELAY / 520
    run = run_line(
        heptane_line(4),
        End(pressure=0.0),
        End(flow=0.0),
        step=step,
        lengths=np.ones(round(9e-3 / step)),
        pressure=[0.0, 1e5],
    )
    tone = ringing(run.time, run.pressure[:, 1], viscous.imag / (2.0 * pi), apart=5e-3)
    where = "first mode of 60 x 2.5 mm in heptane"
    return [
        check(
            f"{where}, decay [1/s]",
            expected=viscous.real,
            computed=tone.real,
            tolerance=0.02,
            source="Zielke 1968: root of cosh Gamma = 0; Kagawa's terms are 1.1 % off",
        ),
        check(
            f"{where}, frequency [Hz]",
            expected=viscous.imag / (2.0 * pi),
            computed=tone.imag / (2.0 * pi),
            tolerance=2e-3,
            source="Zielke 1968: root of cosh Gamma = 0",
        ),
        check(
            f"{where}, decay with Kagawa's terms spread along it [1/s]",
            expected=terms.real,
            computed=tone.real,
            tolerance=1e-3,
            source="same root with the terms; four segments instead of a spread",
        ),
    ]


def _start_up() -> list[Check]:
    """Oil at rest under a lasting pressure difference of 1 bar."""
    length, radius, rho, speed, viscosity = 0.06, 1.25e-3, 870.0, 1370.0, 0.04
    nu, area = viscosity / rho, pi * radius**2
    resistance = laminar_resistance(length, 2.0 * radius, viscosity)
    gain, rate = unsteady_terms(
        KAGAWA, resistance=resistance, diameter=2.0 * radius, kinematic_viscosity=nu
    )
    row = plain_line(
        delay=length / speed,
        impedance=rho * speed / area,
        segments=4,
        resistance=resistance,
        unsteady=(gain, rate),
    )
    step, drop = length / speed / 200, 1e5
    run = run_line(
        row,
        End(pressure=drop),
        End(pressure=0.0),
        step=step,
        lengths=np.ones(round(0.6 * radius**2 / nu / step)),
        pressure=[drop, 0.0],
    )
    tau = nu * (run.time + 0.5 * step) / radius**2
    zeros = jn_zeros(0, 40)
    exact = 1.0 - 32.0 * np.sum(np.exp(-np.outer(tau, zeros**2)) / zeros**4, axis=1)
    share = 0.5 * (run.flow[:, 0] - run.flow[:, 1]) * resistance / drop
    late = tau > 0.01
    return [
        check(
            "start of laminar flow, largest difference from tau = 0.01 [-]",
            expected=0.0,
            computed=float(np.max(np.abs(share - exact)[late])),
            tolerance=3e-3,
            source="Szymanski 1932, over the final flow; Kagawa's terms are 0.3 % off",
            curve=ComparedCurve(
                x_label="nu t / R^2 [-]",
                y_label="flow over the final flow [-]",
                expected=(tau, exact),
                computed=(tau, share),
            ),
        )
    ]


def _cavity() -> list[Check]:
    """Both ends pull, a cavity opens in the middle; they push, and it collapses."""
    Z, half, p, vapour = IMPEDANCE, 200, 5e5, -1e5
    out, into = 4e-6, 1e-6
    n = 7 * half
    flow = np.where(np.arange(n) < 2 * half, -out, into)
    row = plain_line(delay=2 * half * STEP, impedance=Z, segments=2, vapour_pressure=vapour)
    run = run_line(row, End(flow=flow), End(flow=flow), step=STEP, lengths=np.ones(n), pressure=p)
    growth = 2.0 * (vapour - p + 2.0 * Z * out) / Z
    seen = 4 * half + int(2 * half * growth / (growth + 4.0 * into)) + 2
    wave = 2.0 * vapour - p + 2.0 * Z * (out + into)
    return [
        check(
            "column separation, largest cavity [m^3]",
            expected=growth * 2 * half * STEP,
            computed=float(np.max(run.cavity)),
            tolerance=5e-13,
            source="characteristics: 2 (p_v - p + 2 Z q) / Z over L/a",
        ),
        check(
            "column separation, pressure after the collapse [Pa]",
            expected=wave + Z * into,
            computed=float(run.pressure[seen, 1]),
            tolerance=1e-12,
            source="characteristics: the columns meet, the wave returns as from a wall",
        ),
        check(
            "column separation, volume that does not balance [-]",
            expected=0.0,
            computed=run.volume_residual,
            tolerance=5e-14,
            source="inflow = compression - cavity",
        ),
    ]


def _books() -> list[Check]:
    """Random pressures at both ends, all losses at once, steps of both lengths."""
    rng = np.random.default_rng(7)
    lengths = np.where((np.arange(6000) // 50) % 2 == 0, 1, 8)
    row = LineRow(
        component="line",
        a=0,
        b=1,
        delay=130.37 * 20e-9,
        impedance=IMPEDANCE,
        segments=3,
        resistance=2e10,
        unsteady_gain=1e9 * np.arange(1.0, 6.0) ** 2,
        unsteady_rate=10.0 ** np.arange(4.0, 9.0),
        vapour_pressure=-1e5,
    )
    ends = 5e5 * rng.standard_normal((2, len(lengths)))
    run = run_line(row, End(pressure=ends[0]), End(pressure=ends[1]), step=20e-9, lengths=lengths)
    return [
        check(
            "energy residual, friction, interpolation and cavities [-]",
            expected=0.0,
            computed=run.energy_residual,
            tolerance=5e-14,
            source="work at both ends = change of store + losses",
        ),
        check(
            "smallest of the three losses is above zero [-]",
            expected=1.0,
            computed=float(np.min(run.losses) > 0.0),
            tolerance=0.0,
            source="second law",
        ),
        check(
            "volume that does not balance, the same run [-]",
            expected=0.0,
            computed=run.volume_residual,
            tolerance=5e-14,
            source="inflow = compression - cavities",
        ),
    ]
