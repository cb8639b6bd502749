"""Linear models of valves against closed forms, delay theory, and small motions in time."""

from collections.abc import Callable, Iterator, Mapping
from math import pi, sin, sqrt, tan
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np
from scipy.optimize import brentq, newton

from klack.analyses.linearisation.loops import loop_margins, return_ratio
from klack.hydraulics.line import Line
from klack.hydraulics.line_friction import KAGAWA, laminar_resistance
from klack.magnetics.constant_drive import driven
from klack.magnetics.iron import VACUUM_PERMEABILITY
from klack.magnetics.solenoid_parts import PoleGap
from klack.mechanics.end_stop import EndStop
from klack.mechanics.stop_law import LinearStopLaw
from klack.network.checks import LooseBodyWarning
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import Rows
from klack.simulation.linear_network import LinearNetwork, linear_network
from klack.simulation.linear_system import LinearSystem, modes, rational, transfer
from klack.simulation.modal_step import ROW, ROW_V
from klack.simulation.network_run import simulate_network
from klack.simulation.operating_point import OperatingPoint, compiled_at, operating_point
from klack.verification.benches import AMBIENT, HEPTANE, RHO_HEPTANE, component
from klack.verification.check import Check, check
from klack.verification.gas_linearisation import gain, gas_linearisation, place

__all__ = ["checks"]

STEP = 20e-9  # [s]
RESIDUAL = 50e-6  # [m]
MASS, RATE, DAMPING = 3e-3, 1e4, 0.5  # of needle and spring [kg], [N/m], [N s/m]

_POLES = 8  # of a record in time
ROUND_OFF = "both are the same to round-off"


def checks() -> list[Check]:
    """Return the checks."""
    return [
        *_oscillator(),
        *_coil(),
        *_enclosed(),
        *_contact(),
        *_relief_valve(),
        *_pipe(),
        *_pipe_friction(),
        *_valve_on_pipe(),
        *_passive(),
        *_sine(),
        *gas_linearisation(),
    ]


def _network(parts: Mapping[str, Component], joints: list[list[str]]) -> Network:
    return Network(dict(parts), joints, fluid=HEPTANE)


def _rows(network: Network) -> Rows:
    with catch_warnings():
        simplefilter("ignore", LooseBodyWarning)
        return network.at_start().rows()


def _about(network: Network, **drives: Network) -> tuple[LinearNetwork, OperatingPoint, Rows]:
    """Linear network about its operating point; drives one volt more by input."""
    rows = _rows(network)
    point = operating_point(rows)
    compiled, _ = compiled_at(rows, point)
    more = {f"{name}.voltage": ("V", _rows(other)) for name, other in drives.items()}
    return linear_network(compiled, STEP, drives=more), point, rows


def _near(system: LinearSystem, root: complex, band: float = 1e4) -> complex:
    """Nearest eigenvalue."""
    return min([mode.root for mode in modes(system, band)[0]], key=lambda x: abs(x - root))


def _root(equation: Callable[[complex], complex], start: complex) -> complex:
    """By the secant method of SciPy."""
    find: Any = newton  # its types know real numbers alone
    return complex(find(equation, start, tol=1e-11 * abs(start), maxiter=200))


def _needle() -> dict[str, Component]:
    return {
        "needle": component("rigid-mass", mass=MASS, points=("tip",)),
        "spring": component("spring", stiffness=RATE, preload=-3.0, damping=DAMPING),
    }


def _oscillator() -> list[Check]:
    linear, point, _ = _about(_network(_needle(), [["needle.tip", "spring.end"]]))
    root = modes(linear.system, 1e4)[0][0].root
    decay, omega = DAMPING / (2.0 * MASS), sqrt(RATE / MASS)
    G = gain(linear.system, "needle.tip.force", "needle.tip.velocity", omega / (2.0 * pi))
    static = gain(linear.system, "needle.tip.force", "needle.tip.displacement", 0.0)
    source = "m s^2 + c s + k = 0"
    return [
        check("mass on a spring, frequency [rad/s]", omega, abs(root), 1e-13, source),
        check("mass on a spring, decay [1/s]", -decay, root.real, 1e-13, source),
        check(
            "mass on a spring, mobility at resonance [m/(N s)]",
            1.0 / DAMPING,
            abs(G),
            1e-13,
            "1/c",
        ),
        check(
            "mass on a spring, displacement per constant force [m/N]",
            point.compliance["needle"],
            static.real,
            1e-10,
            "the operating point, whose slopes are differences",
        ),
    ]


def _coil() -> list[Check]:
    """A coil with leakage, armature on a stiff spring, at constant voltage."""
    turns, radius, gap, current, leak = 100.0, 3e-3, 150e-6, 1.0, 2e-8
    R, stiffness, preload = 2.0, 1e6, 3.0
    parts: dict[str, Component] = {
        "needle": component("rigid-mass", mass=MASS, points=("tip",)),
        "spring": component("spring", stiffness=stiffness, preload=preload, damping=DAMPING),
        "coil": component(
            "solenoid",
            turns=turns,
            resistance=R,
            gap=gap - RESIDUAL,
            residual_gap=RESIDUAL,
            poles=(PoleGap(outer_radius=radius, fringing="none"),),
            leakage=leak,
        ),
        "driver": component("voltage-step", voltage=12.0),
    }
    joints = [["needle.tip", "spring.end", "coil.armature"], ["driver.terminals", "coil.terminals"]]
    networks = [driven(_network(parts, joints), {"coil": i}) for i in (current, current + 1.0 / R)]
    linear, _, _ = _about(networks[0], coil=networks[1])
    pull = VACUUM_PERMEABILITY * pi * radius**2 * turns**2  # F = pull i^2/(2 x^2)

    def left(y: float) -> float:
        return pull * current**2 / (2.0 * (gap - y) ** 2) - preload - stiffness * y

    x = gap - brentq(left, -1e-5, 1e-5, xtol=1e-20)
    L = pull / x + leak * turns**2
    # states y, v, i: u = R i + L i' + (pull i/x^2) v,  F = pull i^2/(2 x^2)
    motion = pull * current / x**2
    A = np.array(
        [
            [0.0, 1.0, 0.0],
            [(pull * current**2 / x**3 - stiffness) / MASS, -DAMPING / MASS, motion / MASS],
            [0.0, -motion / L, -R / L],
        ]
    )
    expected = np.linalg.eigvals(A)
    slow = float(expected[np.argmin(np.abs(expected))].real)
    fast = complex(expected[np.argmax(expected.imag)])
    found = _near(linear.system, fast, 1e6)
    f = 200.0
    G = gain(linear.system, "coil.voltage", "coil.current", f)
    known = np.linalg.solve(2j * pi * f * np.eye(3) - A, np.array([0.0, 0.0, 1.0 / L]))[2]
    words = "u = R i + d(L(x) i)/dt, F = i^2 L'(x)/2"
    return [
        check(
            "coil with a moving armature, decay [1/s]",
            slow,
            _near(linear.system, slow).real,
            1e-9,
            words,
        ),
        check(
            "coil with a moving armature, frequency of the armature [rad/s]",
            abs(fast),
            abs(found),
            5e-13,
            words,
        ),
        check(
            "coil with a moving armature, decay of the armature [1/s]",
            fast.real,
            found.real,
            1e-9,
            words,
        ),
        check(
            "coil with a moving armature, admittance at 200 Hz [A/V]",
            abs(known),
            abs(G),
            2e-10,
            words,
        ),
        check(
            "coil with a moving armature, phase of its admittance at 200 Hz [rad]",
            float(np.angle(known)),
            float(np.angle(G)),
            5e-10,
            words,
        ),
    ]


def _slope(p: float) -> tuple[float, float]:
    """Density and its slope with the pressure."""
    step = 1e-4 * p
    rho = [float(HEPTANE.density(q)) for q in (p - step, p, p + step)]
    return rho[1], (rho[2] - rho[0]) / (2.0 * step)


def _enclosed() -> list[Check]:
    """A needle on enclosed fluid."""
    volume, area = 50e-9, 5e-6
    linear, point, _ = _about(
        _network(
            {
                **_needle(),
                "face": component("pressure-face", direction="opening", area=area),
                "sac": component("chamber", volume=volume, pressure=20e5),
            },
            [["needle.tip", "spring.end", "face.body"], ["sac.fluid", "face.fluid"]],
        )
    )
    p, y = point.start.pressure["sac"], point.start.displacement["needle.tip"]
    rho, slope = _slope(p)
    stiffness = RATE + area**2 * rho / slope / (volume + area * y)
    omega = sqrt(stiffness / MASS)
    found = modes(linear.system, 1e5)[0]
    tone = max(found, key=lambda mode: mode.root.imag)
    return [
        check(
            "needle on enclosed fluid, frequency [rad/s]",
            omega,
            abs(tone.root),
            5e-9,
            "m w^2 = k + K A^2/V",
        ),
        check(
            "needle on enclosed fluid, damping ratio [-]",
            DAMPING / (2.0 * MASS * omega),
            tone.damping,
            5e-9,
            "c/(2 m w)",
        ),
        check(
            "needle on enclosed fluid, motions that neither decay nor grow [-]",
            1.0,
            float(len([mode for mode in found if mode.verdict == 0])),
            0.0,
            "conservation of mass: s = 0",
        ),
    ]


def _seated(seat: EndStop, preload: float) -> tuple[LinearNetwork, OperatingPoint, Rows]:
    """The needle on its spring over a seat."""
    return _about(
        _network(
            {
                "needle": component("rigid-mass", mass=MASS, points=("tip",)),
                "spring": component("spring", stiffness=RATE, preload=preload),
                "seat": seat,
            },
            [["needle.tip", "spring.end", "seat.upper"], ["ground", "seat.lower"]],
        )
    )


def _contact() -> list[Check]:
    """A needle that rests on its seat."""
    stiffness = 1e8
    linear, _, rows = _seated(
        EndStop(gap=0.0, law=LinearStopLaw(kind="linear", stiffness=stiffness), restitution=0.6),
        20.0,
    )
    root = modes(linear.system, 1e6)[0][0]
    law_found = rows.interfaces[0].law
    assert law_found is not None
    alpha = law_found.flat().dissipation
    return [
        check(
            "needle on its seat, frequency [rad/s]",
            sqrt((RATE + stiffness) / MASS),
            abs(root.root),
            1e-13,
            "m w^2 = k",
        ),
        check(
            "needle on its seat, damping ratio over alpha/2 [-]",
            1.0,
            root.damping / (0.5 * alpha),
            1e-3,
            "alpha/2 of the contact alone",
            reason="the spring of 1e-4 of the contact and its indentation take part",
        ),
        *_in_series(stiffness, alpha),
        *_open_film(),
    ]


def _in_series(stiffness: float, alpha: float) -> list[Check]:
    """The same contact behind a massless compliance."""
    series = 2e-8
    seat = EndStop(
        gap=0.0,
        law=LinearStopLaw(kind="linear", stiffness=stiffness),
        restitution=0.6,
        series_compliance=series,
    )
    linear, _, _ = _seated(seat, 20.0)
    damping = alpha * sqrt(stiffness * MASS)  # chi F_0 of a contact at rest
    # (m s^2 + K)(1 + S (k + c s)) + k + c s = 0
    one = np.polymul([MASS, 0.0, RATE], [series * damping, 1.0 + series * stiffness])
    expected = np.roots(np.polyadd(one, [damping, stiffness]))
    tone = complex(expected[np.argmax(expected.imag)])
    found = _near(linear.system, tone, 1e6)
    words = "(m s^2 + K)(1 + S (k + c s)) + k + c s = 0"
    return [
        check(
            "needle on its seat, compliance in series, frequency [rad/s]",
            abs(tone),
            abs(found),
            1e-13,
            words,
        ),
        check(
            "needle on its seat, compliance in series, decay [1/s]",
            tone.real,
            found.real,
            1e-13,
            words,
        ),
    ]


def _open_film() -> list[Check]:
    """A needle that floats over a narrow ring."""
    inner, outer, height, cut_off = 1.95e-3, 2e-3, 20e-6, 1e-6
    film = {"shape": "ring", "inner_radius": inner, "outer_radius": outer, "cut_off": cut_off}
    linear, _, _ = _seated(EndStop.model_validate({"gap": height, "film": film}), 0.0)
    length, width = pi * (inner + outer), outer - inner
    damping = (
        float(HEPTANE.viscosity(AMBIENT.pressure)) * length * width**3 / (height + cut_off) ** 3
    )
    found = modes(linear.system, 1e5)[0][0].root
    return [
        check(
            "needle over a film, decay [1/s]",
            -damping / (2.0 * MASS),
            found.real,
            1e-3,
            "narrow strip, F = mu L b^3 v/h^3 (Reynolds)",
        )
    ]


# --------------------------------------------------------------------------- relief valves

POPPET, POPPET_RATE, SEAT, SET = 20e-3, 20e3, 20e-6, 90.0  # [kg], [N/m], [m^2], [N]
WIDTH, DISCHARGE = 12e-3, 0.7  # of the opening [m], [-]
FLOW = 10.0 / 60e3  # [m^3/s]
VOLUME = 20e-6  # [m^3]


def _valve_parts(damping: float) -> dict[str, Component]:
    return {
        "poppet": component("rigid-mass", mass=POPPET, points=("face",)),
        "spring": component("spring", stiffness=POPPET_RATE, preload=SET, damping=damping),
        "area": component("pressure-face", direction="opening", area=SEAT),
        "edge": component(
            "variable-orifice",
            lift=(0.0, 1e-3),
            area=(0.0, WIDTH * 1e-3),
            discharge=DISCHARGE,
            cavitation=None,
        ),
        "inlet": component("chamber", volume=VOLUME, pressure=50e5),
    }


VALVE_JOINTS = [
    ["poppet.face", "spring.end", "area.body", "edge.needle"],
    ["edge.b", "ambient"],
]


class _Valve:
    """The same valve with formulas of its own, at rest under a flow or a pressure."""

    def __init__(self, pressure: float | None = None) -> None:
        def lift_at(p: float) -> float:
            return (SEAT * (p - AMBIENT.pressure) - SET) / POPPET_RATE

        def flow(x: float, p: float) -> float:
            return (
                DISCHARGE
                * WIDTH
                * x
                * sqrt(2.0 * float(HEPTANE.density(p)) * (p - AMBIENT.pressure))
            )

        def left(p: float) -> float:
            return flow(lift_at(p), p) - RHO_HEPTANE * FLOW

        closed = AMBIENT.pressure + SET / SEAT
        self.p = brentq(left, closed, 2.0 * closed, xtol=1e-6) if pressure is None else pressure
        self.x = lift_at(self.p)
        self.rho, self.slope = _slope(self.p)
        mdot, drop = flow(self.x, self.p), self.p - AMBIENT.pressure
        self.by_lift = mdot / self.x
        self.by_pressure = 0.5 * mdot / drop + 0.5 * mdot * self.slope / self.rho
        self.capacity = (VOLUME + SEAT * self.x) * self.slope

    def cubic(self, damping: float) -> list[float]:
        """Characteristic polynomial, from s^3 on."""
        C, G = self.capacity, self.by_pressure
        return [
            POPPET * C,
            POPPET * G + damping * C,
            damping * G + POPPET_RATE * C + self.rho * SEAT**2,
            POPPET_RATE * G + SEAT * self.by_lift,
        ]

    def boundary(self) -> float:
        """Damping of Routh's boundary [N s/m]."""

        def left(damping: float) -> float:
            a3, a2, a1, a0 = self.cubic(damping)
            return a2 * a1 - a3 * a0

        return float(brentq(left, 0.0, 1e3))

    def on_pipe(self, s: complex, damping: float, impedance: float, delay: float) -> complex:
        """Characteristic equation with a pipe from a constant pressure, without friction."""
        line = RHO_HEPTANE**2 / self.rho / (impedance * np.tanh(s * delay))
        mass = self.capacity * s + self.by_pressure + line
        poppet = POPPET * s * s + damping * s + POPPET_RATE
        return complex(poppet * mass + SEAT * (self.rho * SEAT * s + self.by_lift))


def _fed(damping: float) -> Network:
    return _network(
        {**_valve_parts(damping), "pump": component("flow-source", flow=FLOW)},
        [*VALVE_JOINTS, ["pump.b", "inlet.fluid", "area.fluid", "edge.a"]],
    )


def _relief_valve() -> list[Check]:
    """A poppet before a volume with a constant flow into it."""
    valve = _Valve()
    limit = valve.boundary()
    linear, point, _ = _about(_fed(limit))
    expected = np.roots(valve.cubic(limit))
    tone = complex(expected[np.argmax(expected.imag)])
    found = _near(linear.system, tone)
    words = "cubic of poppet and volume, Routh 1877"
    output = place(linear.system.outputs, "edge.mass_flow")
    margins = loop_margins(
        "edge",
        return_ratio(linear.system, output, *linear.adds[output]),
        np.geomspace(20.0, 2e4, 300),
    )
    return [
        check(
            "relief valve before a volume, inlet pressure [Pa]",
            valve.p,
            point.start.pressure["inlet"],
            1e-13,
            "balance of forces and flows",
        ),
        check(
            "relief valve at Routh's boundary, frequency [rad/s]",
            abs(tone),
            abs(found),
            5e-9,
            words,
        ),
        check(
            "relief valve at Routh's boundary, damping ratio [-]",
            0.0,
            -found.real / abs(found),
            5e-11,
            words,
        ),
        check(
            "relief valve with 1.2 times that damping, decay [1/s]",
            *_decay(valve, 1.2 * limit),
            1e-8,
            words,
        ),
        check(
            "relief valve at Routh's boundary, gain margin [-]",
            1.0,
            margins.gain_margin,
            2e-9,
            "the closed loop is at its limit",
        ),
        *_grown(limit),
    ]


def _decay(valve: _Valve, damping: float) -> tuple[float, float]:
    expected = np.roots(valve.cubic(damping))
    tone = complex(expected[np.argmax(expected.imag)])
    return tone.real, _near(_about(_fed(damping))[0].system, tone).real


def _kicked(network: Network, speed: float, duration: float) -> tuple[np.ndarray, np.ndarray]:
    """First body about its operating point after a small kick."""
    rows = _rows(network)
    point = operating_point(rows)
    state = {name: array.copy() for name, array in point.state.items()}
    state["bodies.fine"][ROW * ROW_V] += speed * sqrt(rows.bodies[0].body.mass)
    result = simulate_network(rows, duration=duration, record=2e-6, state=state)
    body = rows.bodies[0]
    channel = result.channels[f"{body.component}.{body.names[0]} displacement"]
    rest = next(iter(point.start.displacement.values()))
    return np.asarray(result.time), np.asarray(channel.values) - rest


def _rate(time: np.ndarray, values: np.ndarray, near: complex) -> complex:
    """Nearest pole of a record to a number: matrix pencil, Hua & Sarkar 1990."""
    every = max(1, round(2.0 * pi / near.imag / 24.0 / (time[1] - time[0])))
    y = values[::every]
    hankel = np.lib.stride_tricks.sliding_window_view(y, len(y) // 2)
    U, _, _ = np.linalg.svd(hankel.T, full_matrices=False)
    kept = U[:, :_POLES]
    poles = np.linalg.eigvals(np.linalg.lstsq(kept[:-1], kept[1:], rcond=None)[0])
    found = np.log(poles.astype(complex)) / (every * (time[1] - time[0]))
    return complex(found[np.argmin(np.abs(found - near))])


def _grown(limit: float) -> Iterator[Check]:
    """Runs in time just inside and outside of the boundary."""
    for share, word in ((1.1, "inside"), (0.9, "outside")):
        network = _fed(share * limit)
        expected = max(
            (mode.root for mode in modes(_about(network)[0].system, 1e4)[0]), key=lambda s: s.imag
        )
        run = _rate(*_kicked(network, 1e-4, 15.0 * 2.0 * pi / expected.imag), expected)
        yield check(
            f"relief valve 10 % {word} of the boundary, growth in time [1/s]",
            expected.real,
            run.real,
            2e-3,
            "eigenvalue against a run after a kick of 0.1 mm/s",
        )
        yield check(
            f"relief valve 10 % {word} of the boundary, frequency in time [rad/s]",
            expected.imag,
            run.imag,
            5e-6,
            "eigenvalue against a run after a kick of 0.1 mm/s",
        )


# --------------------------------------------------------------------------- pipes

BORE, PIPE_PRESSURE = 6e-3, 50e5


def _line(length: float, friction: str = "none") -> Line:
    return Line.model_validate(
        {"length": length, "diameter": BORE, "pressure": PIPE_PRESSURE, "friction": friction}
    )


def _impedance(line: Line) -> tuple[float, float]:
    """Impedance in network variables [Pa s/m^3], and delay [s]."""
    a, rho = line.wave_speed(HEPTANE), float(HEPTANE.density(PIPE_PRESSURE))
    return rho * a / (0.25 * pi * BORE**2) * (RHO_HEPTANE / rho) ** 2, line.length / a


def _blocked(line: Line, volume: float) -> LinearSystem:
    """A pipe between a constant pressure and a volume."""
    return _about(
        _network(
            {
                **_needle(),
                "end": component("chamber", volume=volume, pressure=PIPE_PRESSURE),
                "source": component("pressure-source", pressure=PIPE_PRESSURE),
                "pipe": line,
            },
            [
                ["needle.tip", "spring.end"],
                ["end.fluid", "pipe.a"],
                ["pipe.b", "source.fluid"],
            ],
        )
    )[0].system


def _pipe() -> list[Check]:
    """Resonances of a pipe closed by a volume, and its drive at any frequency."""
    line, volume = _line(1.2), 1e-6
    Z, T = _impedance(line)
    rho, slope = _slope(PIPE_PRESSURE)
    C = volume * slope * rho / RHO_HEPTANE**2  # [m^3/Pa] in the variables of the network
    system = _blocked(line, volume)
    found = sorted(m.root.imag for m in modes(system, 3000.0)[0] if m.root.imag > 0.0)
    quarter = []

    def closed(w: float) -> float:
        return 1.0 - w * C * Z * tan(w * T)

    for n in (1, 2, 3):
        low, high = (n - 1.0) * pi / T, (n - 0.5) * pi / T
        quarter.append(brentq(closed, low, high * (1 - 1e-12)))
    f = 777.0
    w = 2.0 * pi * f
    model = rational(system, 3000.0)
    both = [gain(x, "end.mass_flow", "end.pressure", 0.9 * 3000.0) for x in (system, model)]
    near = [found[int(np.argmin(np.abs(np.array(found) - q)))] for q in quarter]
    return [
        *(
            check(
                f"pipe closed by a volume, resonance {n} [rad/s]",
                q,
                x,
                5e-10,
                "w C Z tan(w T) = 1; slope of the density by differences",
            )
            for n, (q, x) in enumerate(zip(quarter, near, strict=True), start=1)
        ),
        check(
            "pipe closed by a volume, pressure per flow at 777 Hz [Pa s/kg]",
            abs(rho / RHO_HEPTANE**2 / (1j * w * C + 1.0 / (1j * Z * tan(w * T)))),
            abs(gain(system, "end.mass_flow", "end.pressure", f)),
            5e-9,
            "1/(i w C + 1/(i Z tan(w T)))",
        ),
        check(
            "pipe closed by a volume, matrices against delays at 0.9 of the band [-]",
            0.0,
            abs(both[1] / both[0] - 1.0),
            1e-3,
            "Padé's fractions for e^-sT",
        ),
    ]


def _pipe_friction() -> list[Check]:
    """First resonance with friction: lumps in a chain of two-ports."""
    line, volume = _line(1.2, "kagawa"), 1e-6
    Z, T = _impedance(line)
    rho, slope = _slope(PIPE_PRESSURE)
    C = volume * slope * rho / RHO_HEPTANE**2
    scale, viscosity = (RHO_HEPTANE / rho) ** 2, float(HEPTANE.viscosity(PIPE_PRESSURE))
    R = scale * laminar_resistance(line.length, BORE, viscosity)
    rate = 4.0 * viscosity / rho / BORE**2
    gains, rates = 0.5 * R * np.array(KAGAWA.factors), rate * np.array(KAGAWA.rates)
    parts = line.parts

    def chain(s: complex) -> complex:
        lump = (R + np.sum(gains * s / (s + rates))) / parts
        half = np.array([[1.0, -0.5 * lump], [0.0, 1.0]])
        x = s * T / parts
        wave = np.array([[np.cosh(x), -Z * np.sinh(x)], [-np.sinh(x) / Z, np.cosh(x)]])
        total = np.eye(2, dtype=complex)
        for _ in range(parts):
            total = half @ wave @ half @ total
        # p_b = 0 = t11 p_a + t12 q_a with q_a = -s C p_a out of the volume
        return complex(total[0, 0] - total[0, 1] * s * C)

    found = _near(_blocked(line, volume), 1j * 0.9 * pi / (2.0 * T))
    root = _root(chain, found * (1.0 + 1e-3))
    words = "chain of two-ports with Kagawa's terms, root by SciPy"
    return [
        check("pipe with friction, frequency [rad/s]", root.imag, found.imag, 5e-10, words),
        check("pipe with friction, decay [1/s]", root.real, found.real, 3e-10, words),
    ]


def _on_pipe(length: float, damping: float) -> Network:
    return _network(
        {
            **_valve_parts(damping),
            "source": component("pressure-source", pressure=PIPE_PRESSURE),
            "pipe": _line(length),
        },
        [
            *VALVE_JOINTS,
            ["pipe.a", "inlet.fluid", "area.fluid", "edge.a"],
            ["pipe.b", "source.fluid"],
        ],
    )


def _valve_on_pipe() -> Iterator[Check]:
    """Relief valve at the end of a pipe: delay theory, and runs about its boundary."""
    valve, damping = _Valve(PIPE_PRESSURE), 1.5
    Z, T = _impedance(_line(1.0))

    def root(length: float, c: float, start: complex) -> complex:
        return _root(lambda s: valve.on_pipe(s, c, Z, T * length), start)

    words = "(m s^2 + c s + k)(C s + G + 1/(Z tanh sT)) + A (A s + Kq) = 0, root by SciPy"
    for length in (0.3, 1.0, 3.0):
        found = _fastest(_on_pipe(length, damping))
        known = root(length, damping, found * (1.0 + 1e-4))
        yield from [
            check(
                f"relief valve on {length:g} m of pipe, frequency [rad/s]",
                known.imag,
                found.imag,
                4e-9,
                words,
            ),
            check(
                f"relief valve on {length:g} m of pipe, growth over frequency [-]",
                known.real / known.imag,
                found.real / found.imag,
                8e-9,
                words,
            ),
        ]
    tone = _fastest(_on_pipe(1.0, damping))
    limit = float(brentq(lambda c: root(1.0, c, tone).real, damping, 200.0, xtol=1e-12))
    there = _fastest(_on_pipe(1.0, limit))
    yield check(
        "relief valve on 1 m of pipe at the boundary, growth over frequency [-]",
        0.0,
        there.real / there.imag,
        1e-10,
        words,
    )
    for share, word in ((1.1, "inside"), (0.9, "outside")):
        network = _on_pipe(1.0, share * limit)
        expected = _near(_about(network)[0].system, there, 2e3)
        run = _rate(*_kicked(network, 1e-4, 30.0 * 2.0 * pi / expected.imag), expected)
        yield check(
            f"relief valve on 1 m of pipe, 10 % {word} of the boundary, growth in time [1/s]",
            expected.real,
            run.real,
            5e-3,
            "eigenvalue against a run after a kick of 0.1 mm/s",
        )


def _fastest(network: Network) -> complex:
    """Oscillation below 2 kHz that grows fastest."""
    found = modes(_about(network)[0].system, 2e3)[0]
    return max((m.root for m in found if m.root.imag > 0.0), key=lambda s: s.real)


def _passive() -> list[Check]:
    """Reciprocity and passivity of needle, volume and pipe."""
    system = _about(
        _network(
            {
                **_needle(),
                "other": component("rigid-mass", mass=5e-3, points=("end",)),
                "between": component("spring", stiffness=3e4, preload=1.0),
                "face": component("pressure-face", direction="opening", area=5e-6),
                "sac": component("chamber", volume=50e-9, pressure=PIPE_PRESSURE),
                "source": component("pressure-source", pressure=PIPE_PRESSURE),
                "pipe": _line(0.4, "kagawa"),
            },
            [
                ["needle.tip", "spring.end", "between.end", "face.body"],
                ["other.end", "between.base"],
                ["sac.fluid", "face.fluid", "pipe.a"],
                ["pipe.b", "source.fluid"],
            ],
        )
    )[0].system
    axis = np.geomspace(10.0, 2e4, 400)
    ports = ["needle.tip", "other.end"]
    into = [place(system.inputs, f"{name}.force") for name in ports]
    out = [place(system.outputs, f"{name}.velocity") for name in ports]
    found = np.array([G[np.ix_(out, into)] for G in transfer(system, axis)])
    least = np.min(
        np.linalg.eigvalsh(0.5 * (found + np.conj(np.transpose(found, (0, 2, 1)))))[:, 0]
        / np.max(np.abs(found), axis=(1, 2))
    )
    return [
        check(
            "two masses on a spring and a pipe, lack of reciprocity [-]",
            0.0,
            float(np.max(np.abs(found[:, 0, 1] - found[:, 1, 0]) / np.abs(found[:, 0, 1]))),
            2e-12,
            "Rayleigh: v_i/F_j = v_j/F_i",
        ),
        check(
            "lack of passivity of their mobility [-]",
            0.0,
            max(0.0, -float(least)),
            5e-14,
            "Re(F* Y F) >= 0 at all frequencies",
        ),
    ]


def _sine() -> Iterator[Check]:
    """A small swinging force: frequency response against a run in time."""
    f, force = 150.0, 0.02
    linear, _, _ = _about(_fed(3.0 * _Valve().boundary()))
    periods, per = 14, 200
    time = np.arange(periods * per + 1) / (f * per)
    joints = [
        [*VALVE_JOINTS[0], "shaker.end"],
        VALVE_JOINTS[1],
        ["pump.b", "inlet.fluid", "area.fluid", "edge.a"],
    ]
    result = simulate_network(
        _network(
            {
                **_valve_parts(3.0 * _Valve().boundary()),
                "pump": component("flow-source", flow=FLOW),
                "shaker": component(
                    "force-over-time",
                    time=tuple(time),
                    force=tuple(force * np.sin(2.0 * pi * f * time)),
                ),
            },
            joints,
        ).rows(),
        duration=periods / f,
        record=10e-6,
    )
    straight = (sin(pi / per) / (pi / per)) ** 2  # of a sine drawn with straight lines
    for channel, response, unit in (
        (
            "poppet.face displacement",
            gain(linear.system, "poppet.face.force", "poppet.face.displacement", f),
            "m/N",
        ),
        ("inlet pressure", gain(linear.system, "poppet.face.force", "inlet.pressure", f), "Pa/N"),
    ):
        data = result.channels[channel]
        late = result.time > (periods - 4) / f
        t, y = result.time[late], data.values[late]
        angle = 2.0 * pi * f * t
        a, b = np.linalg.lstsq(
            np.column_stack([np.sin(angle), np.cos(angle), np.ones_like(t), t]), y, rcond=None
        )[0][:2]
        run = complex(a, b) / (force * straight)
        name = f"relief valve, {channel.partition(' ')[2]}"
        yield from [
            check(
                f"{name} per force at 150 Hz, magnitude [{unit}]",
                abs(response),
                abs(run),
                1e-4,
                "a run in time with a force of 20 mN",
            ),
            check(
                f"{name} per force at 150 Hz, phase [rad]",
                float(np.angle(response)),
                float(np.angle(run)),
                2e-4,
                "a run in time with a force of 20 mN",
            ),
        ]
