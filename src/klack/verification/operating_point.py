"""Operating points against solutions by hand, by SciPy, and runs in time."""

from collections.abc import Mapping
from math import cos, pi, sin, sqrt, tanh
from warnings import catch_warnings, simplefilter

import numpy as np
from scipy.optimize import brentq, fsolve

from klack.analyses.operating_point.conditions import Conditions
from klack.magnetics.constant_drive import driven
from klack.magnetics.iron import VACUUM_PERMEABILITY
from klack.magnetics.solenoid_parts import PoleGap
from klack.mechanics.end_stop import EndStop
from klack.mechanics.stop_law import LinearStopLaw
from klack.network.checks import LooseBodyWarning
from klack.network.component import Component
from klack.network.network import Network
from klack.simulation.network_run import simulate_network
from klack.simulation.operating_point import OperatingPoint, operating_point
from klack.verification.benches import AMBIENT, HEPTANE, MU_HEPTANE, RHO_HEPTANE, component
from klack.verification.check import Check, check
from klack.verification.network import whole_valve

__all__ = ["checks"]

RAIL = 50e5
STIFFNESS = 1e9  # [N/m] of linear stops
TURNS, RADIUS, GAP, RESIDUAL = 100.0, 3e-3, 100e-6, 50e-6  # of the magnet: [-], [m]
PULL = VACUUM_PERMEABILITY * pi * RADIUS**2 * TURNS**2  # [N m^2/A^2]
MASS_BALANCE = "network of orifices in SciPy, root of the mass balances"
MAGNET = "flux of one gap: F = mu0 A (N i)^2/(2 x^2)"


def checks() -> list[Check]:
    """Return the checks."""
    return [
        *_springs(),
        *_magnet(),
        *_held_magnet(),
        _warm_coil(),
        *_divider(),
        *_bridge(),
        *_relief_valve(),
        *_columns(),
        _leakage(),
        _shared_mass(),
        *_runs(),
    ]


def _found(
    parts: Mapping[str, Component],
    joints: list[list[str]],
    *,
    currents: Mapping[str, float] | None = None,
    **search: object,
) -> OperatingPoint:
    network = _network(parts, joints)
    if currents:
        network = driven(network, currents)
    with catch_warnings():
        simplefilter("ignore", LooseBodyWarning)
        rows = network.at_start().rows()
    return operating_point(rows, **search)  # type: ignore[arg-type]


def _network(parts: Mapping[str, Component], joints: list[list[str]]) -> Network:
    return Network(dict(parts), joints, fluid=HEPTANE)


def _needle() -> dict[str, Component]:
    return {"needle": component("rigid-mass", mass=3e-3, points=("tip",))}


def _stop(gap: float) -> EndStop:
    return EndStop(gap=gap, law=LinearStopLaw(kind="linear", stiffness=STIFFNESS), restitution=0.5)


def _springs() -> list[Check]:
    """A spring alone, then pressed into a stop after Hertz."""
    rate, preload = 1e4, -3.0
    free = _found(
        {**_needle(), "spring": component("spring", stiffness=rate, preload=preload)},
        [["needle.tip", "spring.end"]],
    )
    hertz = {"kind": "hertz", "radius": 5e-3, "modulus": 115e9}
    pressed = _found(
        {
            **_needle(),
            "spring": component("spring", stiffness=rate, preload=20.0),
            "seat": EndStop.model_validate({"gap": 0.0, "law": hertz}),
        },
        [["needle.tip", "spring.end", "seat.upper"], ["ground", "seat.lower"]],
    )
    radius, modulus = 5e-3, 115e9

    def left(depth: float) -> float:
        return 4.0 / 3.0 * modulus * sqrt(radius) * depth**1.5 - 20.0 + rate * depth

    depth = brentq(left, 0.0, 1e-4, xtol=1e-20)
    local = 2.0 * modulus * sqrt(radius * depth)
    return [
        check(
            "needle on a spring that opens, displacement [m]",
            -preload / rate,
            free.start.displacement["needle.tip"],
            1e-13,
            "Hooke",
        ),
        check(
            "needle on a spring, static stiffness [N/m]",
            rate,
            1.0 / free.compliance["needle"],
            1e-9,
            "Hooke",
        ),
        check(
            "ball pressed on its seat by a spring, depth [m]",
            depth,
            -pressed.start.displacement["needle.tip"],
            1e-13,
            "Hertz 1882: F = 4/3 E sqrt(R) d^1.5",
        ),
        check(
            "ball pressed on its seat, static stiffness [N/m]",
            local + rate,
            1.0 / pressed.compliance["needle"],
            5e-12,
            "Hertz 1882: dF/dd = 2 E sqrt(R d)",
        ),
    ]


def _valve(rate: float, preload: float) -> tuple[dict[str, Component], list[list[str]]]:
    parts = {
        **_needle(),
        "coil": component(
            "solenoid",
            turns=TURNS,
            resistance=1.0,
            gap=GAP,
            residual_gap=RESIDUAL,
            poles=(PoleGap(outer_radius=RADIUS, fringing="none"),),
        ),
        "driver": component("voltage-step", voltage=12.0),
        "spring": component("spring", stiffness=rate, preload=preload),
        "seat": _stop(0.0),
        "stop": _stop(GAP),
    }
    joints = [
        ["needle.tip", "spring.end", "seat.upper", "stop.lower", "coil.armature"],
        ["ground", "seat.lower"],
        ["ground", "stop.upper"],
        ["driver.terminals", "coil.terminals"],
    ]
    return parts, joints


def _pull(current: float, lift: float) -> float:
    return PULL * current**2 / (2.0 * (GAP + RESIDUAL - lift) ** 2)


def _magnet() -> list[Check]:
    """An armature that a stiff spring holds between the stops."""
    rate, preload, current = 1e6, 2.0, 1.4
    parts, joints = _valve(rate, preload)
    point = _found(parts, joints, currents={"coil": current})
    lift = brentq(lambda y: _pull(current, y) - preload - rate * y, 0.0, 0.5 * GAP, xtol=1e-20)
    gap = GAP + RESIDUAL - lift
    return [
        check(
            "armature on a spring at 1.4 A, lift [m]",
            lift,
            point.start.displacement["needle.tip"],
            1e-13,
            f"root of k y + F0 = F; {MAGNET}",
        ),
        check(
            "armature on a spring at 1.4 A, static stiffness [N/m]",
            rate - PULL * current**2 / gap**3,
            1.0 / point.compliance["needle"],
            1e-4,
            "k - dF/dy at constant current",
        ),
        check(
            "armature on a spring at 1.4 A, flux [Wb]",
            VACUUM_PERMEABILITY * pi * RADIUS**2 * TURNS * current / gap,
            point.value("coil flux"),
            5e-14,
            "mu0 A N i/x",
        ),
        check(
            "coil at 1.4 A, voltage at rest [V]",
            current * 1.0,
            point.value("coil voltage"),
            1e-13,
            "u = R i",
        ),
    ]


def _held_magnet() -> list[Check]:
    """One current, two points: armature on its seat, and held open."""
    rate, preload, current = 1e4, 25.0, 1.6
    parts, joints = _valve(rate, preload)
    closed = _found(parts, joints, currents={"coil": current})
    opened = _found(parts, joints, currents={"coil": current}, first={"needle": GAP})

    def left(y: float, stop: float) -> float:
        return _pull(current, y) - preload - rate * y - STIFFNESS * (y - stop)

    low = brentq(lambda y: left(y, 0.0), -1e-6, 0.0, xtol=1e-20)
    high = brentq(lambda y: left(y, GAP), GAP, GAP + 1e-6, xtol=1e-20)
    held = _found(
        parts, joints, currents={"coil": current}, first={"needle": 0.5 * GAP}, held=("needle",)
    )
    return [
        check(
            "armature at 1.6 A from its seat, force on the seat [N]",
            -STIFFNESS * low,
            closed.value("seat contact force"),
            4e-12,
            MAGNET,
        ),
        check(
            "armature at 1.6 A from its stop, force on the stop [N]",
            STIFFNESS * (high - GAP),
            opened.value("stop contact force"),
            1e-11,
            MAGNET,
        ),
        check(
            "armature held halfway at 1.6 A, holding force [N]",
            preload + rate * 0.5 * GAP - _pull(current, 0.5 * GAP),
            -held.start.residual["needle"],
            1e-13,
            MAGNET,
        ),
    ]


def _warm_coil() -> Check:
    """A warm coil on a voltage: current, and the voltage that a run would see."""
    parts, joints = _valve(1e6, 2.0)
    parts["coil"] = parts["coil"].model_copy(
        update={"resistance": 4.0, "winding_temperature": 393.15}
    )
    currents = Conditions(voltage={"coil": 12.0}).currents(_network(parts, joints), {"coil": 0.0})
    return check(
        "coil of 4 ohm at 120 degC on 12 V, current [A]",
        12.0 / (4.0 * 1.393),
        _found(parts, joints, currents=currents).value("coil current"),
        1e-13,
        "IEC 60028: copper, 0.393 % per kelvin",
    )


def _through(up: float, down: float, size: float) -> float:
    """Mass flow of an orifice without cavitation."""
    if up < down:
        return -_through(down, up, size)
    root = sqrt(2.0 * float(HEPTANE.density(up)) * (up - down))
    return 0.7 * pi / 4.0 * size**2 * root * tanh(2.0 * size / (MU_HEPTANE * 1000.0) * root)


def _divider() -> list[Check]:
    """Two orifices in series, and a piston between them."""
    area, rate = 1e-6, 1e4
    parts = {
        "rail": component("pressure-source", pressure=RAIL),
        "first": component("orifice", diameter=0.4e-3, cavitation=None),
        "middle": component("chamber", volume=1e-7, pressure=2e5),  # a guess
        "second": component("orifice", diameter=0.5e-3, cavitation=None),
        "face": component("pressure-face", direction="opening", area=area),
        **_needle(),
        "spring": component("spring", stiffness=rate, preload=0.0),
    }
    point = _found(
        parts,
        [
            ["rail.fluid", "first.a"],
            ["first.b", "middle.fluid", "second.a", "face.fluid"],
            ["second.b", "ambient"],
            ["needle.tip", "face.body", "spring.end"],
        ],
    )
    p = brentq(
        lambda x: _through(RAIL, x, 0.4e-3) - _through(x, AMBIENT.pressure, 0.5e-3),
        AMBIENT.pressure,
        RAIL,
        xtol=1e-8,
    )
    return [
        check(
            "two orifices in series, pressure between them [Pa]",
            p,
            point.start.pressure["middle"],
            2e-13,
            MASS_BALANCE,
        ),
        check(
            "piston between two orifices, displacement [m]",
            area * (p - AMBIENT.pressure) / rate,
            point.start.displacement["needle.tip"],
            2e-13,
            "A (p - p0)/k",
        ),
    ]


def _bridge() -> list[Check]:
    """A bridge of five orifices: two pressures."""
    sizes = {"a": 0.3e-3, "b": 0.5e-3, "c": 0.4e-3, "d": 0.45e-3, "e": 0.35e-3}
    parts: dict[str, Component] = {
        name: component("orifice", diameter=size, cavitation=None) for name, size in sizes.items()
    }
    parts |= {
        "rail": component("pressure-source", pressure=RAIL),
        "left": component("chamber", volume=1e-7),
        "right": component("chamber", volume=2e-9, pressure=RAIL),
        **_needle(),
        "spring": component("spring", stiffness=1e4, preload=0.0),
    }
    point = _found(
        parts,
        [
            ["rail.fluid", "a.a", "b.a"],
            ["a.b", "left.fluid", "c.a", "e.a"],
            ["b.b", "right.fluid", "d.a", "e.b"],
            ["c.b", "d.b", "ambient"],
            ["needle.tip", "spring.end"],
        ],
    )

    low = AMBIENT.pressure

    def left(p: np.ndarray) -> list[float]:
        p1, p2 = (1e5 * float(x) for x in p)
        across = _through(p1, p2, sizes["e"])
        return [
            1e3 * (_through(RAIL, p1, sizes["a"]) - _through(p1, low, sizes["c"]) - across),
            1e3 * (_through(RAIL, p2, sizes["b"]) - _through(p2, low, sizes["d"]) + across),
        ]

    p1, p2 = 1e5 * fsolve(left, [20.0, 30.0], xtol=1e-13)
    across = _through(float(p1), float(p2), sizes["e"])
    return [
        check(
            f"bridge of five orifices, pressure on the {name} [Pa]",
            float(p),
            point.start.pressure[name],
            1e-13,
            MASS_BALANCE,
        )
        for name, p in (("left", p1), ("right", p2))
    ] + [
        check(
            "bridge of five orifices, mass flow across [kg/s]",
            across,
            point.start.flow["e"],
            5e-13,
            MASS_BALANCE,
        )
    ]


def _relief_valve() -> list[Check]:
    """A pump on a spring-loaded cone: lift, pressure, stiffness from two equations."""
    size, angle, rate, preload, flow = 10e-3, pi / 4, 2e4, 157.0, 5e-3 / 60.0
    point = _found(
        {
            "pump": component("flow-source", flow=flow),
            "inlet": component("chamber", volume=5e-7, pressure=15e5),
            "cone": component(
                "seat", shape="cone", diameter=size, half_angle=angle, cavitation=None
            ),
            "face": component("pressure-face", direction="opening", outer_diameter=size),
            **_needle(),
            "spring": component("spring", stiffness=rate, preload=preload),
            "seat": _stop(0.0),
        },
        [
            ["pump.b", "inlet.fluid", "cone.a", "face.fluid"],
            ["cone.b", "ambient"],
            ["needle.tip", "face.body", "spring.end", "seat.upper", "cone.needle"],
            ["ground", "seat.lower"],
        ],
    )
    face, mass_flow = pi / 4.0 * size**2, flow * RHO_HEPTANE

    def passed(lift: float, p: float) -> float:
        gap = lift * sin(angle)
        area = pi * gap * (size - gap * cos(angle))
        density = float(HEPTANE.density(p))
        a = 100.0 * MU_HEPTANE / (8.0 * 0.7 * area * gap)
        b = density / (2.0 * (0.7 * area) ** 2)
        drop = p - AMBIENT.pressure
        return density * 2.0 * drop / (a + sqrt(a * a + 4.0 * b * drop))

    def pressure(lift: float, push: float = 0.0) -> float:
        return AMBIENT.pressure + (preload + rate * lift - push) / face

    def lift_with(push: float) -> float:

        return float(
            brentq(
                lambda y: passed(y, pressure(y, push)) - mass_flow,
                1e-9,
                1e-3,
                xtol=1e-20,
                rtol=1e-15,
            )
        )

    lift, push = lift_with(0.0), 0.05
    two = "SciPy: flow through the mantle of a cone, and p A = F0 + k y (Merritt 1967, ch. 3)"
    return [
        check(
            "relief valve at 5 l/min, lift [m]",
            lift,
            point.start.displacement["needle.tip"],
            1e-13,
            two,
        ),
        check(
            "relief valve at 5 l/min, pressure [Pa]",
            pressure(lift),
            point.start.pressure["inlet"],
            1e-13,
            two,
        ),
        check(
            "relief valve at 5 l/min, static stiffness with its fluid [N/m]",
            2.0 * push / (lift_with(push) - lift_with(-push)),
            1.0 / point.compliance["needle"],
            1e-5,
            "the same two equations with a push of 0.05 N, either way",
        ),
    ]


def _columns() -> list[Check]:
    """Flow forced through a laminar line and gap."""
    flow, length, size = 2e-6, 0.5, 1.5e-3
    point = _found(
        {
            "pump": component("flow-source", flow=flow),
            "inlet": component("chamber", volume=1e-7),
            "pipe": component("line", length=length, diameter=size, friction="steady"),
            **_needle(),
            "spring": component("spring", stiffness=1e4, preload=0.0),
        },
        [
            ["pump.b", "inlet.fluid", "pipe.a"],
            ["pipe.b", "ambient"],
            ["needle.tip", "spring.end"],
        ],
    )
    # energies per mass, not pressures, drive a column of fluid: liquid of constant modulus here
    drop = 128.0 * MU_HEPTANE * length * flow / (pi * size**4)
    return [
        check(
            "flow forced through a line, pressure before it above ambient [Pa]",
            drop,
            point.start.pressure["inlet"] - AMBIENT.pressure,
            1e-4,
            "Hagen-Poiseuille: 128 mu l Q/(pi d^4)",
        ),
        check(
            "flow forced through a line, mass flow [kg/s]",
            flow * RHO_HEPTANE,
            point.start.flow["pipe"],
            1e-13,
            "conservation of mass",
        ),
    ]


def _leakage() -> Check:
    drop, size, length, clearance = 2e6, 4e-3, 15e-3, 4e-6
    point = _found(
        {
            "rail": component("pressure-source", pressure=AMBIENT.pressure + drop),
            "guide": component("annulus", diameter=size, length=length, clearance=clearance),
            **_needle(),
            "spring": component("spring", stiffness=1e4, preload=0.0),
        },
        [
            ["rail.fluid", "guide.a"],
            ["guide.b", "ambient"],
            ["needle.tip", "spring.end", "guide.needle"],
        ],
    )
    density = float(HEPTANE.density(AMBIENT.pressure + drop))
    return check(
        "leakage of a guide at 20 bar, mass flow [kg/s]",
        density * pi * size * clearance**3 * drop / (12.0 * MU_HEPTANE * length),
        point.start.flow["guide"],
        1e-13,
        "Merritt 1967, sec. 3-3: pi d c^3 dp/(12 mu l)",
    )


def _shared_mass() -> Check:
    """Two chambers that only an orifice joins share what they hold."""
    small, large, high = 1e-8, 3e-8, 40e5
    point = _found(
        {
            "small": component("chamber", volume=small, pressure=high),
            "large": component("chamber", volume=large),
            "hole": component("orifice", diameter=0.2e-3),
            **_needle(),
            "spring": component("spring", stiffness=1e4, preload=0.0),
        },
        [["small.fluid", "hole.a"], ["hole.b", "large.fluid"], ["needle.tip", "spring.end"]],
    )
    mass = small * float(HEPTANE.density(high)) + large * RHO_HEPTANE

    def left(p: float) -> float:
        return (small + large) * float(HEPTANE.density(p)) / mass - 1.0

    return check(
        "two enclosed chambers and an orifice, common pressure [Pa]",
        brentq(left, 1e5, high, xtol=1e-6),
        point.start.pressure["small"],
        1e-11,
        "conservation of mass",
    )


def _runs() -> list[Check]:
    """A whole valve, closed and held open, run for half a millisecond."""
    current, found = 2.0, []
    network = driven(whole_valve(), {"coil": current}).at_start()
    rows = network.rows()
    for name, first, tolerance in (("closed", 0.0, 1e-13), ("held open", 100e-6, 2e-13)):
        point = operating_point(rows, first={"needle": first})
        result = simulate_network(rows, duration=0.5e-3, record=5e-6, state=point.state)
        lift = result.channels["needle.bottom displacement"].values
        found.append(
            check(
                f"whole valve at 2 A, {name}, way of the needle in 0.5 ms over its lift [-]",
                0.0,
                float(np.max(np.abs(lift - point.start.displacement["needle.bottom"]))) / 100e-6,
                tolerance,
                "what rests does not move",
            )
        )
    return found
