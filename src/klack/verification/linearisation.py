"""Linear models of valves against closed forms, delay theory, and small motions in time."""

from collections.abc import Callable, Mapping
from functools import partial
from math import pi, sin, sqrt, tan
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, newton

from klack.analyses.linearisation.loops import loop_margins, return_ratio
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.flow_source import FlowSource
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.line import Line
from klack.hydraulics.line_friction import KAGAWA, laminar_resistance
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.hydraulics.variable_orifice import VariableOrifice
from klack.magnetics.constant_drive import driven
from klack.magnetics.iron import VACUUM_PERMEABILITY
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.solenoid_parts import PoleGap
from klack.magnetics.voltage_step import VoltageStep
from klack.mechanics.end_stop import EndStop
from klack.mechanics.force import ForceOverTime
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.mechanics.stop_law import LinearStopLaw
from klack.network.checks import LooseBodyWarning
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import Ambient, Rows
from klack.simulation.linear_network import LinearNetwork, linear_network
from klack.simulation.linear_system import LinearSystem, modes, rational, transfer
from klack.simulation.modal_step import ROW, ROW_V
from klack.simulation.network_run import simulate_network
from klack.simulation.operating_point import OperatingPoint, compiled_at, operating_point
from klack.verification.check import Check, compare
from klack.verification.gas_linearisation import gas_linearisation

__all__ = ["checks"]

GROUP = "linearisation"
AMBIENT = Ambient()
HEPTANE = library_fluid("n-heptane").at(AMBIENT.temperature)
RHO_AMBIENT = float(HEPTANE.density(AMBIENT.pressure))
STEP = 20e-9  # [s]
RESIDUAL = 50e-6  # [m]
MASS, RATE, DAMPING = 3e-3, 1e4, 0.5  # of needle and spring [kg], [N/m], [N s/m]

_POLES = 8  # of a record in time
ROUND_OFF = "both are the same to round-off"

Vector = NDArray[np.float64]

_check = partial(compare, GROUP)


def checks() -> list[Check]:
    """Single masses, coils, needles on fluid, relief valves with a volume and with a pipe."""
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
    """Linear network about its operating point; drives by input, one volt more."""
    rows = _rows(network)
    point = operating_point(rows)
    compiled, _ = compiled_at(rows, point)
    more = {f"{name}.voltage": ("V", _rows(other)) for name, other in drives.items()}
    return linear_network(compiled, STEP, drives=more), point, rows


def _names(signals: tuple[Any, ...], name: str) -> int:
    return [x.name for x in signals].index(name)


def _response(system: LinearSystem, source: str, target: str, frequency: float) -> complex:
    G = next(transfer(system, np.array([frequency])))
    return complex(G[_names(system.outputs, target), _names(system.inputs, source)])


def _near(system: LinearSystem, root: complex, band: float = 1e4) -> complex:
    """Eigenvalue that is the nearest to a number."""
    found = [mode.root for mode in modes(system, band)[0]]
    return min(found, key=lambda x: abs(x - root))


def _root(equation: Callable[[complex], complex], start: complex) -> complex:
    """Root of an equation by the secant method of SciPy."""
    find: Any = newton  # its types know real numbers alone
    return complex(find(equation, start, tol=1e-11 * abs(start), maxiter=200))


def _needle() -> dict[str, Component]:
    return {
        "needle": RigidMass(mass=MASS, points=("tip",)),
        "spring": Spring(stiffness=RATE, preload=-3.0, damping=DAMPING),
    }


def _oscillator() -> list[Check]:
    """Mass, spring and dashpot."""
    linear, point, _ = _about(_network(_needle(), [["needle.tip", "spring.end"]]))
    root = modes(linear.system, 1e4)[0][0].root
    decay, omega = DAMPING / (2.0 * MASS), sqrt(RATE / MASS)
    f = omega / (2.0 * pi)
    G = _response(linear.system, "needle.tip.force", "needle.tip.velocity", f)
    static = _response(linear.system, "needle.tip.force", "needle.tip.displacement", 0.0)
    source = "m s^2 + c s + k = 0"
    return [
        _check("mass on a spring, frequency [rad/s]", omega, abs(root), 1e-13, source),
        _check("mass on a spring, decay [1/s]", -decay, root.real, 1e-13, source),
        _check(
            "mass on a spring, mobility at resonance [m/(N s)]",
            1.0 / DAMPING,
            abs(G),
            1e-13,
            "1/c",
        ),
        _check(
            "mass on a spring, displacement per constant force [m/N]",
            point.compliance["needle"],
            static.real,
            1e-10,
            "the operating point, whose slopes are differences",
        ),
    ]


def _coil() -> list[Check]:
    """A coil with leakage, its armature on a stiff spring, at constant voltage."""
    turns, radius, gap, current, leak = 100.0, 3e-3, 150e-6, 1.0, 2e-8
    R, stiffness, preload = 2.0, 1e6, 3.0
    parts: dict[str, Component] = {
        "needle": RigidMass(mass=MASS, points=("tip",)),
        "spring": Spring(stiffness=stiffness, preload=preload, damping=DAMPING),
        "coil": Solenoid(
            turns=turns,
            resistance=R,
            gap=gap - RESIDUAL,
            residual_gap=RESIDUAL,
            poles=(PoleGap(outer_radius=radius, fringing="none"),),
            leakage=leak,
        ),
        "driver": VoltageStep(voltage=12.0),
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
    G = _response(linear.system, "coil.voltage", "coil.current", f)
    b = np.array([0.0, 0.0, 1.0 / L])
    known = np.linalg.solve(2j * pi * f * np.eye(3) - A, b)[2]
    words = "u = R i + d(L(x) i)/dt, F = i^2 L'(x)/2"
    return [
        _check("coil with a moving armature, decay [1/s]", slow, _near(linear.system, slow).real,
               1e-9, words),
        _check("coil with a moving armature, frequency of the armature [rad/s]", abs(fast),
               abs(found), 5e-13, words),
        _check("coil with a moving armature, decay of the armature [1/s]", fast.real, found.real,
               1e-9, words),
        _check("coil with a moving armature, admittance at 200 Hz [A/V]", abs(known), abs(G),
               2e-10, words),
        _check("coil with a moving armature, phase of its admittance at 200 Hz [rad]",
               float(np.angle(known)), float(np.angle(G)), 5e-10, words),
    ]  # fmt: skip


def _slope(p: float) -> tuple[float, float]:
    """Density and its slope with the pressure."""
    step = 1e-4 * p
    rho = [float(HEPTANE.density(q)) for q in (p - step, p, p + step)]
    return rho[1], (rho[2] - rho[0]) / (2.0 * step)


def _enclosed() -> list[Check]:
    """A needle on enclosed fluid."""
    volume, area = 50e-9, 5e-6
    parts: dict[str, Component] = {
        **_needle(),
        "face": PressureFace(direction="opening", area=area),
        "sac": Chamber(volume=volume, pressure=20e5),
    }
    linear, point, _ = _about(
        _network(parts, [["needle.tip", "spring.end", "face.body"], ["sac.fluid", "face.fluid"]])
    )
    p, y = point.start.pressure["sac"], point.start.displacement["needle.tip"]
    rho, slope = _slope(p)
    stiffness = RATE + area**2 * rho / slope / (volume + area * y)
    omega = sqrt(stiffness / MASS)
    found = modes(linear.system, 1e5)[0]
    tone = max(found, key=lambda mode: mode.root.imag)
    neutral = [mode for mode in found if mode.verdict == 0]
    return [
        _check("needle on enclosed fluid, frequency [rad/s]", omega, abs(tone.root), 5e-9,
               "m w^2 = k + K A^2/V"),
        _check("needle on enclosed fluid, damping ratio [-]", DAMPING / (2.0 * MASS * omega),
               tone.damping, 5e-9,
               "c/(2 m w)"),
        _check("needle on enclosed fluid, motions that neither decay nor grow [-]", 1.0,
               float(len(neutral)), 0.0, "conservation of mass: s = 0"),
    ]  # fmt: skip


def _contact() -> list[Check]:
    """A needle that rests on its seat."""
    stiffness, restitution = 1e8, 0.6
    law = LinearStopLaw(kind="linear", stiffness=stiffness)
    parts: dict[str, Component] = {
        "needle": RigidMass(mass=MASS, points=("tip",)),
        "spring": Spring(stiffness=RATE, preload=20.0),
        "seat": EndStop(gap=0.0, law=law, restitution=restitution),
    }
    linear, _, rows = _about(
        _network(parts, [["needle.tip", "spring.end", "seat.upper"], ["ground", "seat.lower"]])
    )
    root = modes(linear.system, 1e6)[0][0]
    law_found = rows.interfaces[0].law
    assert law_found is not None
    alpha = law_found.flat().dissipation
    omega = sqrt((RATE + stiffness) / MASS)
    return [
        _check("needle on its seat, frequency [rad/s]", omega, abs(root.root), 1e-13, "m w^2 = k"),
        _check("needle on its seat, damping ratio over alpha/2 [-]", 1.0,
               root.damping / (0.5 * alpha), 1e-3, "alpha/2 of the contact alone",
               reason="the spring of 1e-4 of the contact and its indentation take part"),
        *_in_series(stiffness, alpha),
        *_open_film(),
    ]  # fmt: skip


def _in_series(stiffness: float, alpha: float) -> list[Check]:
    """The same contact behind a massless compliance."""
    series = 2e-8
    seat = EndStop(
        gap=0.0,
        law=LinearStopLaw(kind="linear", stiffness=stiffness),
        restitution=0.6,
        series_compliance=series,
    )
    parts: dict[str, Component] = {
        "needle": RigidMass(mass=MASS, points=("tip",)),
        "spring": Spring(stiffness=RATE, preload=20.0),
        "seat": seat,
    }
    linear, _, _ = _about(
        _network(parts, [["needle.tip", "spring.end", "seat.upper"], ["ground", "seat.lower"]])
    )
    damping = alpha * sqrt(stiffness * MASS)  # chi F_0 of a contact at rest
    # (m s^2 + K)(1 + S (k + c s)) + k + c s = 0
    one = np.polymul([MASS, 0.0, RATE], [series * damping, 1.0 + series * stiffness])
    expected = np.roots(np.polyadd(one, [damping, stiffness]))
    tone = complex(expected[np.argmax(expected.imag)])
    found = _near(linear.system, tone, 1e6)
    words = "(m s^2 + K)(1 + S (k + c s)) + k + c s = 0"
    return [
        _check("needle on its seat, compliance in series, frequency [rad/s]", abs(tone), abs(found),
               1e-13, words),
        _check("needle on its seat, compliance in series, decay [1/s]", tone.real, found.real,
               1e-13, words),
    ]  # fmt: skip


def _open_film() -> list[Check]:
    """A needle that floats over a narrow ring."""
    inner, outer, height, cut_off = 1.95e-3, 2e-3, 20e-6, 1e-6
    film = {"shape": "ring", "inner_radius": inner, "outer_radius": outer, "cut_off": cut_off}
    stop = {"gap": height, "film": film}
    parts: dict[str, Component] = {
        "needle": RigidMass(mass=MASS, points=("tip",)),
        "spring": Spring(stiffness=RATE, preload=0.0),
        "seat": EndStop.model_validate(stop),
    }
    linear, _, _ = _about(
        _network(parts, [["needle.tip", "spring.end", "seat.upper"], ["ground", "seat.lower"]])
    )
    viscosity = float(HEPTANE.viscosity(AMBIENT.pressure))
    length, width = pi * (inner + outer), outer - inner
    damping = viscosity * length * width**3 / (height + cut_off) ** 3
    found = modes(linear.system, 1e5)[0][0].root
    return [
        _check("needle over a film, decay [1/s]", -damping / (2.0 * MASS), found.real, 1e-3,
               "narrow strip, F = mu L b^3 v/h^3 (Reynolds)")
    ]  # fmt: skip


# --------------------------------------------------------------------------- relief valves

POPPET, POPPET_RATE, SEAT, SET = 20e-3, 20e3, 20e-6, 90.0  # [kg], [N/m], [m^2], [N]
WIDTH, DISCHARGE = 12e-3, 0.7  # of the opening [m], [-]
FLOW = 10.0 / 60e3  # [m^3/s]
VOLUME = 20e-6  # [m^3]


def _valve_parts(damping: float) -> dict[str, Component]:
    return {
        "poppet": RigidMass(mass=POPPET, points=("face",)),
        "spring": Spring(stiffness=POPPET_RATE, preload=SET, damping=damping),
        "area": PressureFace(direction="opening", area=SEAT),
        "edge": VariableOrifice(
            lift=(0.0, 1e-3), area=(0.0, WIDTH * 1e-3), discharge=DISCHARGE, cavitation=None
        ),
        "inlet": Chamber(volume=VOLUME, pressure=50e5),
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
            rho = float(HEPTANE.density(p))
            return DISCHARGE * WIDTH * x * sqrt(2.0 * rho * (p - AMBIENT.pressure))

        def left(p: float) -> float:
            return flow(lift_at(p), p) - RHO_AMBIENT * FLOW

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
        line = RHO_AMBIENT**2 / self.rho / (impedance * np.tanh(s * delay))
        mass = self.capacity * s + self.by_pressure + line
        poppet = POPPET * s * s + damping * s + POPPET_RATE
        return complex(poppet * mass + SEAT * (self.rho * SEAT * s + self.by_lift))


def _fed(damping: float) -> Network:
    parts = {**_valve_parts(damping), "pump": FlowSource(flow=FLOW)}
    return _network(parts, [*VALVE_JOINTS, ["pump.b", "inlet.fluid", "area.fluid", "edge.a"]])


def _relief_valve() -> list[Check]:
    """A poppet before a volume with a constant flow into it."""
    valve = _Valve()
    limit = valve.boundary()
    linear, point, _ = _about(_fed(limit))
    expected = np.roots(valve.cubic(limit))
    tone = complex(expected[np.argmax(expected.imag)])
    found = _near(linear.system, tone)
    words = "cubic of poppet and volume, Routh 1877"
    output = _names(linear.system.outputs, "edge.mass_flow")
    margins = loop_margins(
        "edge",
        return_ratio(linear.system, output, *linear.adds[output]),
        np.geomspace(20.0, 2e4, 300),
    )
    return [
        _check("relief valve before a volume, inlet pressure [Pa]", valve.p,
               point.start.pressure["inlet"], 1e-13, "balance of forces and flows"),
        _check("relief valve at Routh's boundary, frequency [rad/s]", abs(tone), abs(found), 5e-9,
               words),
        _check("relief valve at Routh's boundary, damping ratio [-]", 0.0,
               -found.real / abs(found), 5e-11, words),
        _check("relief valve with 1.2 times that damping, decay [1/s]",
               *_decay(valve, 1.2 * limit), 1e-8,
               words),
        _check("relief valve at Routh's boundary, gain margin [-]", 1.0, margins.gain_margin, 2e-9,
               "the closed loop is at its limit"),
        *_grown(limit),
    ]  # fmt: skip


def _decay(valve: _Valve, damping: float) -> tuple[float, float]:
    expected = np.roots(valve.cubic(damping))
    tone = complex(expected[np.argmax(expected.imag)])
    return tone.real, _near(_about(_fed(damping))[0].system, tone).real


def _kicked(network: Network, speed: float, duration: float) -> tuple[Vector, Vector]:
    """Displacement of the first body from its operating point after a small kick."""
    rows = _rows(network)
    point = operating_point(rows)
    state = {name: array.copy() for name, array in point.state.items()}
    state["bodies.fine"][ROW * ROW_V] += speed * sqrt(rows.bodies[0].body.mass)
    result = simulate_network(rows, duration=duration, record=2e-6, state=state)
    body = rows.bodies[0]
    channel = result.channels[f"{body.component}.{body.names[0]} displacement"]
    rest = next(iter(point.start.displacement.values()))
    return np.asarray(result.time), np.asarray(channel.values) - rest


def _rate(time: Vector, values: Vector, near: complex) -> complex:
    """Pole of a record that is the nearest to a number: matrix pencil, Hua & Sarkar 1990."""
    every = max(1, round(2.0 * pi / near.imag / 24.0 / (time[1] - time[0])))
    y = values[::every]
    rows = len(y) // 2
    hankel = np.lib.stride_tricks.sliding_window_view(y, rows)
    U, _, _ = np.linalg.svd(hankel.T, full_matrices=False)
    kept = U[:, :_POLES]
    poles = np.linalg.eigvals(np.linalg.lstsq(kept[:-1], kept[1:], rcond=None)[0])
    found = np.log(poles.astype(complex)) / (every * (time[1] - time[0]))
    return complex(found[np.argmin(np.abs(found - near))])


def _grown(limit: float) -> list[Check]:
    """Runs in time just inside and outside of the boundary."""
    found = []
    for share, word in ((1.1, "inside"), (0.9, "outside")):
        network = _fed(share * limit)
        expected = max(
            (mode.root for mode in modes(_about(network)[0].system, 1e4)[0]), key=lambda s: s.imag
        )
        run = _rate(*_kicked(network, 1e-4, 15.0 * 2.0 * pi / expected.imag), expected)
        found.append(
            _check(
                f"relief valve 10 % {word} of the boundary, growth in time [1/s]",
                expected.real,
                run.real,
                2e-3,
                "eigenvalue against a run after a kick of 0.1 mm/s",
            )
        )
        found.append(
            _check(
                f"relief valve 10 % {word} of the boundary, frequency in time [rad/s]",
                expected.imag,
                run.imag,
                5e-6,
                "eigenvalue against a run after a kick of 0.1 mm/s",
            )
        )
    return found


# --------------------------------------------------------------------------- pipes

BORE, PIPE_PRESSURE = 6e-3, 50e5


def _line(length: float, friction: str = "none") -> Line:
    return Line.model_validate(
        {"length": length, "diameter": BORE, "pressure": PIPE_PRESSURE, "friction": friction}
    )


def _impedance(line: Line) -> tuple[float, float]:
    """Impedance in the variables of the network [Pa s/m^3], and delay [s]."""
    a, rho = line.wave_speed(HEPTANE), float(HEPTANE.density(PIPE_PRESSURE))
    Z = rho * a / (0.25 * pi * BORE**2) * (RHO_AMBIENT / rho) ** 2
    return Z, line.length / a


def _blocked(line: Line, volume: float) -> LinearSystem:
    """A pipe between a constant pressure and a volume."""
    parts: dict[str, Component] = {
        **_needle(),
        "end": Chamber(volume=volume, pressure=PIPE_PRESSURE),
        "source": PressureSource(pressure=PIPE_PRESSURE),
        "pipe": line,
    }
    joints = [
        ["needle.tip", "spring.end"], ["end.fluid", "pipe.a"], ["pipe.b", "source.fluid"],
    ]  # fmt: skip
    return _about(_network(parts, joints))[0].system


def _pipe() -> list[Check]:
    """Resonances of a pipe that is closed by a volume, and what drives it at any frequency."""
    line, volume = _line(1.2), 1e-6
    Z, T = _impedance(line)
    rho, slope = _slope(PIPE_PRESSURE)
    C = volume * slope * rho / RHO_AMBIENT**2  # [m^3/Pa] in the variables of the network
    system = _blocked(line, volume)
    found = sorted(m.root.imag for m in modes(system, 3000.0)[0] if m.root.imag > 0.0)
    quarter = []

    def closed(w: float) -> float:
        return 1.0 - w * C * Z * tan(w * T)

    for n in (1, 2, 3):
        low, high = (n - 1.0) * pi / T, (n - 0.5) * pi / T
        quarter.append(brentq(closed, low, high * (1 - 1e-12)))
    f = 777.0
    G = _response(system, "end.mass_flow", "end.pressure", f)
    w = 2.0 * pi * f
    known = rho / RHO_AMBIENT**2 / (1j * w * C + 1.0 / (1j * Z * tan(w * T)))
    model = rational(system, 3000.0)
    both = [_response(x, "end.mass_flow", "end.pressure", 0.9 * 3000.0) for x in (system, model)]
    near = [found[int(np.argmin(np.abs(np.array(found) - q)))] for q in quarter]
    return [
        *(
            _check(f"pipe closed by a volume, resonance {n} [rad/s]", q, x, 5e-10,
                   "w C Z tan(w T) = 1; slope of the density by differences")
            for n, (q, x) in enumerate(zip(quarter, near, strict=True), start=1)
        ),
        _check("pipe closed by a volume, pressure per flow at 777 Hz [Pa s/kg]", abs(known), abs(G),
               5e-9,
               "1/(i w C + 1/(i Z tan(w T)))"),
        _check("pipe closed by a volume, matrices against delays at 0.9 of the band [-]", 0.0,
               abs(both[1] / both[0] - 1.0), 1e-3, "Padé's fractions for e^-sT"),
    ]  # fmt: skip


def _pipe_friction() -> list[Check]:
    """The first resonance with friction: lumps of the line in a chain of two-ports."""
    line, volume = _line(1.2, "kagawa"), 1e-6
    Z, T = _impedance(line)
    rho, slope = _slope(PIPE_PRESSURE)
    C = volume * slope * rho / RHO_AMBIENT**2
    scale, viscosity = (RHO_AMBIENT / rho) ** 2, float(HEPTANE.viscosity(PIPE_PRESSURE))
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
        _check("pipe with friction, frequency [rad/s]", root.imag, found.imag, 5e-10, words),
        _check("pipe with friction, decay [1/s]", root.real, found.real, 3e-10, words),
    ]


def _on_pipe(length: float, damping: float) -> Network:
    parts = {
        **_valve_parts(damping),
        "source": PressureSource(pressure=PIPE_PRESSURE),
        "pipe": _line(length),
    }
    return _network(
        parts,
        [
            *VALVE_JOINTS,
            ["pipe.a", "inlet.fluid", "area.fluid", "edge.a"],
            ["pipe.b", "source.fluid"],
        ],
    )


def _valve_on_pipe() -> list[Check]:
    """A relief valve at the end of a pipe: delay theory, and runs about its boundary."""
    valve, damping = _Valve(PIPE_PRESSURE), 1.5
    Z, T = _impedance(_line(1.0))

    def root(length: float, c: float, start: complex) -> complex:
        return _root(lambda s: valve.on_pipe(s, c, Z, T * length), start)

    words = "(m s^2 + c s + k)(C s + G + 1/(Z tanh sT)) + A (A s + Kq) = 0, root by SciPy"
    made = []
    for length in (0.3, 1.0, 3.0):
        found = _fastest(_on_pipe(length, damping))
        known = root(length, damping, found * (1.0 + 1e-4))
        made += [
            _check(f"relief valve on {length:g} m of pipe, frequency [rad/s]", known.imag,
                   found.imag, 4e-9, words),
            _check(f"relief valve on {length:g} m of pipe, growth over frequency [-]",
                   known.real / known.imag, found.real / found.imag, 8e-9, words),
        ]  # fmt: skip
    tone = _fastest(_on_pipe(1.0, damping))
    limit = float(brentq(lambda c: root(1.0, c, tone).real, damping, 200.0, xtol=1e-12))
    there = _fastest(_on_pipe(1.0, limit))
    made.append(
        _check("relief valve on 1 m of pipe at the boundary, growth over frequency [-]", 0.0,
               there.real / there.imag, 1e-10, words)
    )  # fmt: skip
    for share, word in ((1.1, "inside"), (0.9, "outside")):
        network = _on_pipe(1.0, share * limit)
        expected = _near(_about(network)[0].system, there, 2e3)
        run = _rate(*_kicked(network, 1e-4, 30.0 * 2.0 * pi / expected.imag), expected)
        made.append(
            _check(
                f"relief valve on 1 m of pipe, 10 % {word} of the boundary, growth in time [1/s]",
                expected.real,
                run.real,
                5e-3,
                "eigenvalue against a run after a kick of 0.1 mm/s",
            )
        )
    return made


def _fastest(network: Network) -> complex:
    """Oscillation below 2 kHz that grows the fastest, or decays the slowest."""
    found = modes(_about(network)[0].system, 2e3)[0]
    return max((m.root for m in found if m.root.imag > 0.0), key=lambda s: s.real)


def _passive() -> list[Check]:
    """Reciprocity and passivity of needle, volume and pipe."""
    parts: dict[str, Component] = {
        **_needle(),
        "other": RigidMass(mass=5e-3, points=("end",)),
        "between": Spring(stiffness=3e4, preload=1.0),
        "face": PressureFace(direction="opening", area=5e-6),
        "sac": Chamber(volume=50e-9, pressure=PIPE_PRESSURE),
        "source": PressureSource(pressure=PIPE_PRESSURE),
        "pipe": _line(0.4, "kagawa"),
    }
    joints = [
        ["needle.tip", "spring.end", "between.end", "face.body"],
        ["other.end", "between.base"],
        ["sac.fluid", "face.fluid", "pipe.a"],
        ["pipe.b", "source.fluid"],
    ]
    system = _about(_network(parts, joints))[0].system
    axis = np.geomspace(10.0, 2e4, 400)
    ports = ["needle.tip", "other.end"]
    into = [_names(system.inputs, f"{name}.force") for name in ports]
    out = [_names(system.outputs, f"{name}.velocity") for name in ports]
    found = np.array([G[np.ix_(out, into)] for G in transfer(system, axis)])
    lack = np.max(np.abs(found[:, 0, 1] - found[:, 1, 0]) / np.abs(found[:, 0, 1]))
    hermitian = 0.5 * (found + np.conj(np.transpose(found, (0, 2, 1))))
    least = np.min(np.linalg.eigvalsh(hermitian)[:, 0] / np.max(np.abs(found), axis=(1, 2)))
    return [
        _check("two masses on a spring and a pipe, lack of reciprocity [-]", 0.0, 
               float(lack), 2e-12, "Rayleigh: v_i/F_j = v_j/F_i"),
        _check("lack of passivity of their mobility [-]", 0.0, max(0.0, -float(least)), 5e-14,
               "Re(F* Y F) >= 0 at all frequencies"),
    ]  # fmt: skip


def _sine() -> list[Check]:
    """A small force that swings: frequency response against a run in time."""
    f, force = 150.0, 0.02
    linear, _, _ = _about(_fed(3.0 * _Valve().boundary()))
    G = _response(linear.system, "poppet.face.force", "poppet.face.displacement", f)
    H = _response(linear.system, "poppet.face.force", "inlet.pressure", f)
    periods, per = 14, 200
    time = np.arange(periods * per + 1) / (f * per)
    parts = {
        **_valve_parts(3.0 * _Valve().boundary()),
        "pump": FlowSource(flow=FLOW),
        "shaker": ForceOverTime(time=tuple(time), force=tuple(force * np.sin(2.0 * pi * f * time))),
    }
    joints = [
        [*VALVE_JOINTS[0], "shaker.end"],
        VALVE_JOINTS[1],
        ["pump.b", "inlet.fluid", "area.fluid", "edge.a"],
    ]
    result = simulate_network(_network(parts, joints).rows(), duration=periods / f, record=10e-6)
    straight = (sin(pi / per) / (pi / per)) ** 2  # of a sine drawn with straight lines
    found = []
    for channel, response, unit in (
        ("poppet.face displacement", G, "m/N"),
        ("inlet pressure", H, "Pa/N"),
    ):
        data = result.channels[channel]
        late = result.time > (periods - 4) / f
        t, y = result.time[late], data.values[late]
        angle = 2.0 * pi * f * t
        basis = np.column_stack([np.sin(angle), np.cos(angle), np.ones_like(t), t])
        a, b = np.linalg.lstsq(basis, y, rcond=None)[0][:2]
        run = complex(a, b) / (force * straight)
        name = f"relief valve, {channel.partition(' ')[2]}"
        found += [
            _check(f"{name} per force at 150 Hz, magnitude [{unit}]", abs(response), abs(run), 1e-4,
                   "a run in time with a force of 20 mN"),
            _check(f"{name} per force at 150 Hz, phase [rad]", float(np.angle(response)),
                   float(np.angle(run)), 2e-4, "a run in time with a force of 20 mN"),
        ]  # fmt: skip
    return found
