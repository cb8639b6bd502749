"""Linear models: delays, margins, participation, and what is said where a point is not smooth.

Truth: closed forms of small systems, exp(-s T), and runs in time.  The larger truths (Routh, pipes
by delay theory, runs about the boundary) are `klack verify --group linearisation`.
"""

from math import pi, sqrt

import numpy as np
import pytest

from klack.analyses.linearisation.loops import loop_margins, return_ratio
from klack.errors import InputError
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.gas.gas_chamber import GasChamber
from klack.hydraulics.gas.gas_library import AIR
from klack.hydraulics.gas.gas_orifice import GasOrifice
from klack.hydraulics.gas.gas_source import GasSource
from klack.hydraulics.junction import Junction
from klack.hydraulics.line import Line
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.hydraulics.relief_valve import ReliefValve
from klack.mechanics.end_stop import EndStop
from klack.mechanics.force import ConstantForce
from klack.mechanics.friction import GuideFriction
from klack.mechanics.lugre_friction import LuGreFriction
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.mechanics.stop_law import LinearStopLaw
from klack.mechanics.surging_spring import SurgingSpring
from klack.network.component import Component
from klack.network.network import Network
from klack.network.port import ELEMENT
from klack.network.rows import Rows
from klack.network.step_function import python_step
from klack.simulation.linear_network import LinearNetwork, linear_network
from klack.simulation.linear_system import LinearSystem, Signal, modes, rational, transfer
from klack.simulation.operating_point import compiled_at, operating_point

FLUID = library_fluid("n-heptane").at(293.15)
MASS, RATE = 3e-3, 1e4


def linear(parts: dict[str, Component], joints: list[list[str]], **options) -> LinearNetwork:
    rows = Network(parts, joints, fluid=FLUID).at_start().rows()
    network, _ = compiled_at(rows, operating_point(rows))
    return linear_network(network, 20e-9, **options)


def needle(**more: Component) -> dict[str, Component]:
    mass = RigidMass(mass=MASS, points=("tip",))
    return {"needle": mass, "spring": Spring(stiffness=RATE, preload=-3.0), **more}


def stop(gap: float) -> EndStop:
    return EndStop(gap=gap, law=LinearStopLaw(kind="linear", stiffness=1e8))


def plain(A, B, C, *, delays=(), Cz=None, Dz=None, Bw=None) -> LinearSystem:
    n, d = len(A), len(delays)
    B, C = np.array(B, float).reshape(n, 1), np.array(C, float).reshape(1, n)
    return LinearSystem(
        A=np.array(A, float).reshape(n, n),
        B=B,
        C=C,
        D=np.zeros((1, 1)),
        Bw=np.zeros((n, d)) if Bw is None else np.array(Bw, float).reshape(n, d),
        Dw=np.zeros((1, d)),
        Cz=np.zeros((d, n)) if Cz is None else np.array(Cz, float).reshape(d, n),
        Dz=np.zeros((d, 1)) if Dz is None else np.array(Dz, float).reshape(d, 1),
        Dzw=np.zeros((d, d)),
        delays=np.array(delays, float),
        waves=("line",) * d,
        states=tuple(Signal("part", f"state {k}", "") for k in range(n)),
        inputs=(Signal("part", "in", "N"),),
        outputs=(Signal("part", "out", "N"),),
    )


def test_roots_of_a_delayed_feedback_are_those_of_its_equation():
    """The equation x' = -x(t - T) has the roots s = W(-T)/T of Lambert's function."""
    from scipy.special import lambertw

    T = 1.0
    system = plain([[0.0]], [1.0], [1.0], delays=[T], Cz=[[1.0]], Bw=[[-1.0]])

    found, lost = modes(system, 3.0)

    expected = [complex(lambertw(-T, k)) / T for k in range(6)]
    known = [s for s in expected if abs(s) <= 2.0 * pi * 3.0]
    roots = sorted((mode.root for mode in found), key=lambda s: s.imag)
    assert lost == 0
    assert len(roots) == len(known)
    for root, s in zip(roots, sorted(known, key=lambda s: abs(s.imag)), strict=True):
        assert abs(root - complex(s.real, abs(s.imag))) < 1e-11 * abs(s)


def test_equal_real_roots_are_no_slow_oscillation():
    """Four equal coils: round-off makes pairs of their decays, at 1e-13 Hz."""
    known = np.array([-47.0, -47.0, -47.0, -47.0, -3480.0, -3480.0])
    turned, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(6, 6)))
    system = plain(turned @ np.diag(known) @ turned.T, np.ones(6), np.ones(6))
    assert np.any(np.linalg.eigvals(system.A).imag != 0.0)  # what is to be told apart

    found, _ = modes(system, 3.0)

    assert [mode.frequency for mode in found] == [0.0] * 6
    assert sorted(mode.root.real for mode in found) == pytest.approx(sorted(known), rel=1e-12)


def test_the_rational_delay_is_the_delay_within_the_band():
    band, T = 5.0, 1.0
    system = plain([[-1.0]], [0.0], [1.0], delays=[T], Dz=[[1.0]], Bw=[[1.0]])
    axis = np.linspace(0.1, band, 50)

    both = [
        np.array([G[0, 0] for G in transfer(x, axis)]) for x in (system, rational(system, band))
    ]

    exact = np.exp(-2j * pi * axis * T) / (1.0 + 2j * pi * axis)
    assert np.max(np.abs(both[0] / exact - 1.0)) < 1e-13
    assert 1e-6 < np.max(np.abs(both[1] / exact - 1.0)) < 2e-3
    beyond = next(transfer(rational(system, band), np.array([50.0 * band])))
    assert abs(beyond[0, 0] * (1.0 + 2j * pi * 50.0 * band)) <= 1.0


def test_too_long_a_band_is_refused_with_one_that_fits():
    system = plain([[-1.0]], [0.0], [1.0], delays=[10.0], Dz=[[1.0]], Bw=[[1.0]])

    with pytest.raises(InputError, match=r"--band.*at most about"):
        rational(system, 1e4)


def test_margins_of_a_loop_of_three_lags():
    """L = k/(s + 1)^3: gain margin 8/k at sqrt(3) rad/s."""
    k = 2.0
    A = [[-1.0, 0.0, -k], [1.0, -1.0, 0.0], [0.0, 1.0, -1.0]]  # closed: input less k times output
    system = plain(A, [1.0, 0.0, 0.0], [0.0, 0.0, -k])

    opened = return_ratio(system, 0, 0, 1.0)

    found = loop_margins("three lags", opened, np.geomspace(0.01, 10.0, 200))

    assert found.gain_margin == pytest.approx(8.0 / k, rel=1e-9)
    assert found.gain_frequency == pytest.approx(sqrt(3.0) / (2.0 * pi), rel=1e-9)
    at = sqrt(k ** (2.0 / 3.0) - 1.0)
    assert found.phase_margin == pytest.approx(180.0 - 3.0 * np.degrees(np.arctan(at)), rel=1e-9)


def test_participation_adds_up_and_names_who_moves():
    parts = needle(other=RigidMass(mass=1.0, points=("end",)))
    parts["soft"] = Spring(stiffness=10.0, preload=0.1)
    found, _ = modes(
        linear(parts, [["needle.tip", "spring.end"], ["other.end", "soft.end"]]).system, 1e4
    )

    assert [next(iter(mode.participation)) for mode in found] == ["other", "needle"]
    for mode in found:
        assert sum(mode.participation.values()) == pytest.approx(1.0, abs=1e-12)


def test_a_free_body_is_neither_stable_nor_unstable():
    parts: dict[str, Component] = {"needle": RigidMass(mass=MASS, points=("tip",))}
    parts["push"] = ConstantForce(force=0.0)
    found, _ = modes(linear(parts, [["needle.tip", "push.end"]]).system, 1e4)

    assert [mode.verdict for mode in found] == [0] * len(found)


def test_a_contact_that_just_touches_has_no_linear_law():
    parts = {
        "needle": RigidMass(mass=MASS, points=("tip",)),
        "spring": Spring(stiffness=RATE, preload=0.0),
        "seat": stop(0.0),
    }
    joints = [["needle.tip", "spring.end", "seat.upper"], ["ground", "seat.lower"]]

    with pytest.raises(InputError, match=r"(?s)components\.seat.*just touch.*--lift"):
        linear(parts, joints)


@pytest.mark.slow
def test_doubts_name_friction_weak_contacts_and_hysteresis():
    friction = linear(
        needle(guide=GuideFriction(coulomb=0.5)), [["needle.tip", "spring.end", "guide.body"]]
    )
    parts = needle(seat=stop(0.0))
    parts["spring"] = Spring(stiffness=RATE, preload=1e-4)
    weak = linear(parts, [["needle.tip", "spring.end", "seat.upper"], ["ground", "seat.lower"]])
    play = linear(
        needle(
            source=PressureSource(pressure=60e5),
            feed=Orifice(diameter=1e-3),
            inlet=Chamber(volume=1e-6),
            relief=ReliefValve(
                set_pressure=40e5,
                rated_pressure=60e5,
                rated_flow=1e-4,
                hysteresis=1e5,
                diameter=4e-3,
            ),
        ),
        [
            ["needle.tip", "spring.end"],
            ["source.fluid", "feed.a"],
            ["feed.b", "inlet.fluid", "relief.a"],
            ["relief.b", "ambient"],
        ],
    )

    assert any("'guide' has dry friction" in text for text in friction.doubts)
    assert any("'seat' is about to open" in text for text in weak.doubts)
    assert any("'relief' is not smooth" in text for text in play.doubts)


@pytest.mark.slow
def test_bristles_are_a_spring_about_rest():
    """LuGre sticks as a spring of sigma_0, elasto-plastic or not."""
    sigma = 2e6
    for share in (0.0, 0.5):
        bristles = LuGreFriction(coulomb=1.0, bristle_stiffness=sigma, elastic_share=share)
        found = linear(needle(guide=bristles), [["needle.tip", "spring.end", "guide.body"]])
        root = modes(found.system, 1e5)[0][-1].root

        assert abs(root) == pytest.approx(sqrt((RATE + sigma) / MASS), rel=1e-9)
        assert not found.doubts


def test_a_spring_with_mass_surges_at_its_frequencies():
    """A mass on a rod: k m w^2 = cot of its phase; first root of z tan z = m/M."""
    from scipy.optimize import brentq

    spring_mass = 1e-3
    parts = needle()
    parts["spring"] = SurgingSpring(stiffness=RATE, preload=-3.0, mass=spring_mass, modes=12)
    found = linear(parts, [["needle.tip", "spring.end"]])

    z = brentq(lambda x: x * np.tan(x) - spring_mass / MASS, 1e-6, pi / 2 - 1e-9)
    first = min(mode.root.imag for mode in modes(found.system, 1e5)[0] if mode.root.imag > 0.0)
    assert first == pytest.approx(z * sqrt(RATE / spring_mass), rel=1e-6)


def test_two_lines_at_a_junction_are_one_line():
    """Pipe closed by a junction: its resonances are those of a pipe of the whole length.

    Truth: omega = pi a (2 k + 1)/(2 L) of a pipe open at one end, closed at the other.
    """
    parts = needle(
        rail=PressureSource(pressure=5e6),
        one=Line(length=0.3, diameter=3e-3, pressure=5e6, friction="none"),
        tee=Junction(),
        two=Line(length=0.2, diameter=3e-3, pressure=5e6, friction="none"),
        end=Junction(),
    )
    joints = [
        ["needle.tip", "spring.end"],
        ["rail.fluid", "one.a"],
        ["one.b", "tee.fluid", "two.a"],
        ["two.b", "end.fluid"],
    ]

    found = linear(parts, joints)

    assert not any(signal.owner in ("tee", "end") for signal in found.system.states)
    speed = sqrt(float(FLUID.bulk_modulus(5e6)) / float(FLUID.density(5e6)))
    listed = [mode for mode in modes(found.system, 4e3)[0] if mode.root.imag > 0.0]
    waves = sorted(mode.root.imag for mode in listed if "needle" != next(iter(mode.participation)))
    truth = [pi * speed * (2 * k + 1) / (2 * 0.5) for k in range(3)]
    assert waves[:3] == pytest.approx(truth, rel=1e-6)


class Magnet(Component):
    """A force in plain Python."""

    type = "plain-magnet"
    ports = {"body": ELEMENT}  # noqa: RUF012

    def add_rows(self, rows: Rows) -> None:
        def push(par, state, inp, out):
            out[0] = 1.0

        step = python_step(push, parameters=0, states=0, inputs=4, outputs=1)
        rows.element(step, ports=(rows.port("body"),), parameters=())


def test_a_component_in_python_is_one_clear_error():
    with pytest.raises(InputError, match=r"components\.pull.*outside compiled code"):
        linear(needle(pull=Magnet()), [["needle.tip", "spring.end", "pull.body"]])


def test_a_held_body_stays_and_its_fluid_moves_alone():
    parts = needle(
        face=PressureFace(direction="opening", area=5e-6),
        sac=Chamber(volume=50e-9),
        hole=Orifice(diameter=0.2e-3),
    )
    joints = [["needle.tip", "spring.end", "face.body"], ["sac.fluid", "face.fluid", "hole.a"]]
    joints.append(["hole.b", "ambient"])

    found = linear(parts, joints, held=("needle",))

    assert [x.name for x in found.system.states] == ["sac.pressure"]
    assert "needle.force" not in [x.name for x in found.system.inputs]


@pytest.mark.slow
def test_each_gas_chamber_has_states_outputs_and_modes_of_its_own() -> None:
    """Two chambers that share nothing, one with twice the volume: twice the time constant."""
    parts: dict[str, Component] = needle(supply=GasSource(pressure=6e5))
    joints = [["needle.tip", "spring.end"]]
    for name, volume in (("small", 1e-6), ("large", 2e-6)):
        parts |= {
            name: GasChamber(volume=volume, isothermal=True),
            f"{name}_in": GasOrifice(diameter=2e-4),
            f"{name}_out": GasOrifice(diameter=3e-4),
        }
        joints.append([f"{name}.gas", f"{name}_in.b", f"{name}_out.a"])
    joints.append(["supply.gas", "small_in.a", "large_in.a"])
    joints.append(["small_out.b", "large_out.b", "ambient"])
    rows = Network(parts, joints, gas=AIR).at_start().rows()
    network, _ = compiled_at(rows, operating_point(rows))

    system = linear_network(network, 1e-6).system
    found = {
        max(mode.participation, key=lambda name: mode.participation[name]): mode
        for mode in modes(system, 1e4)[0]
    }

    # mass and energy of a gas as warm as its wall are one state
    assert [x.owner for x in system.states[2:]] == ["small", "large"]
    assert system.states[2].quantity in ("mass", "internal energy")
    names = {signal.name for signal in system.outputs}
    for name in ("small", "large"):
        assert {f"{name}.{what}" for what in ("mass", "pressure", "temperature")} <= names
        assert {f"{name}_in.mass_flow", f"{name}_out.mass_flow"} <= names
        assert found[name].participation[name] == pytest.approx(1.0, abs=1e-9)
    # isothermal, equal orifices: equal pressures, so the rates are as 1 / V
    ratio = found["small"].root.real / found["large"].root.real
    assert ratio == pytest.approx(2.0, rel=1e-6)
