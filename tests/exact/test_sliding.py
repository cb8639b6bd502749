"""Friction in a guide, and its entry in the energy balance.

Friction in a guide that sticks, in the time loop of networks.

Friction as an entry of the energy balance (exact).
"""

from math import exp, pi, sqrt

import numpy as np
import pytest

from klack.contact.history import BodyEnergy, EnergyLedger
from klack.mechanics.end_stop import EndStop
from klack.mechanics.force import ForceOverTime
from klack.mechanics.friction import GuideFriction
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.simulation.network_sliders import largest_friction, slider_force
from klack.transient.interface_result import InterfaceEnergy

MASS = 2e-3
BALANCE = 1e-12


def run(
    parts: dict, *, duration: float, speed: float = 0.0, step: float = 1e-7, coarse: int = 16, **at
) -> NetworkResult:
    parts = {"mass": RigidMass(mass=MASS, speed=speed), **parts}
    ports = [f"{name}.{'body' if name == 'guide' else 'end'}" for name in parts if name != "mass"]
    network = Network(parts, [["mass.body", *ports]])
    return simulate_network(
        network.rows(), duration=duration, step=step, coarse=coarse, record=10e-6, **at
    )


def place(result: NetworkResult) -> np.ndarray:
    return result.channels["mass.body displacement"].values


def velocity(result: NetworkResult) -> np.ndarray:
    return result.channels["mass velocity"].values


@pytest.mark.parametrize("coarse", [1, 16, 64])
def test_a_sliding_mass_stops_where_its_energy_ends(coarse):
    """Truth, exact: way m v^2 / (2 F), and it stays there."""
    result = run({"guide": GuideFriction(coulomb=0.8)}, speed=0.5, duration=4e-3, coarse=coarse)

    way = MASS * 0.5**2 / (2.0 * 0.8)
    stopped = MASS * 0.5 / 0.8
    assert place(result)[-1] == pytest.approx(way, rel=1e-4 if coarse == 64 else 1e-5)
    still = result.time > stopped + 20e-6
    assert np.ptp(place(result)[still]) < 1e-15
    assert np.abs(velocity(result)[still]).max() < 1e-12
    assert result.books.losses["guide loss"] == pytest.approx(0.5 * MASS * 0.5**2, rel=1e-9)
    assert result.books.relative_residual < BALANCE


def test_a_held_mass_does_not_creep():
    """Truth, exact: a steady force below the breakaway friction moves nothing, however long."""
    parts = {
        "pull": ForceOverTime(time=(0.0, 1e-3), force=(0.0, 0.4999)),
        "guide": GuideFriction(coulomb=0.3, breakaway=0.5),
        "spring": Spring(stiffness=5e3, preload=10.0),
    }

    result = run(parts, duration=20e-3)

    # what the rise of the force within a macro step moves is held a step late: 1e-14 m, once
    growing = int(np.searchsorted(result.time, 1.1e-3))
    assert np.ptp(place(result)) < 1e-13
    assert np.ptp(place(result)[growing:]) < 1e-16
    np.testing.assert_allclose(
        result.channels["guide.body force"].values[growing:], -0.4999, rtol=1e-9
    )


def test_a_rising_force_breaks_away_where_it_reaches_the_breakaway_friction():
    """Truth, exact: at rest until 1.2 ms; then m a = F(t) - Fc with a step down to Fc.

    With a Stribeck speed near 0 friction falls to its sliding value at once.
    """
    ramp = ForceOverTime(time=(0.0, 4e-3), force=(0.0, 2.0))
    guide = GuideFriction(coulomb=0.3, breakaway=0.6, stribeck_speed=1e-6)

    result = run({"pull": ramp, "guide": guide}, duration=3e-3, coarse=1)

    before = result.time < 1.2e-3 - 1e-6
    assert np.abs(place(result)[before]).max() < 1e-16
    t = result.time - 1.2e-3
    exact = np.where(t > 0, (0.5 * (0.6 - 0.3) * t**2 + 500.0 * t**3 / 6.0) / MASS, 0.0)
    assert np.abs(place(result) - exact).max() < 1e-3 * exact[-1]


@pytest.mark.parametrize("coarse", [1, 16])
def test_an_oscillator_loses_four_friction_lengths_in_a_period_and_sticks(coarse):
    """Truth, exact: half-periods of pi/omega, amplitudes falling by 2 F/k, then it sticks."""
    k, friction = 5e3, 0.8
    parts = {"spring": Spring(stiffness=k, preload=0.0), "guide": GuideFriction(coulomb=friction)}

    result = run(parts, speed=1.8, duration=12e-3, coarse=coarse)

    omega, band = sqrt(k / MASS), friction / k
    reach = -band + sqrt(band**2 + (1.8 / omega) ** 2)  # 0.5 k y^2 + F y = 0.5 m v^2
    turns = [reach]
    while abs(turns[-1]) > band:
        turns.append(-np.sign(turns[-1]) * (abs(turns[-1]) - 2.0 * band))
    first = np.arctan2(1.8 / omega, band) / omega
    assert abs(turns[-1]) < band < abs(turns[-2])
    for n, turn in enumerate(turns):
        at = first + n * pi / omega
        assert np.interp(at, result.time, place(result)) == pytest.approx(turn, abs=2e-4 * reach)
    assert np.ptp(place(result)[result.time > at + 50e-6]) < 1e-15
    assert result.books.relative_residual < BALANCE


def test_stick_slip_on_a_moving_guide():
    """Truth, exact: a mass on a spring, carried until the spring pulls Fs, slips to Fc and back.

    Slip with Fc: y = Fc/k + (Fs - Fc)/k cos(omega t) + v/omega sin(omega t) until the speed is that
    of the guide again.
    """
    k, v = 5e3, 0.05
    parts = {
        "mass": RigidMass(mass=MASS, speed=v),
        "belt": RigidMass(mass=1e6, speed=v),
        "spring": Spring(stiffness=k, preload=0.0),
        "guide": GuideFriction(coulomb=0.5, breakaway=1.0, stribeck_speed=1e-6),
    }
    network = Network(
        parts, [["mass.body", "spring.end", "guide.body"], ["belt.body", "guide.guide"]]
    )

    result = simulate_network(network.rows(), duration=9e-3, step=1e-7, coarse=1, record=5e-6)

    y = result.channels["mass.body displacement"].values
    away = 1.0 / k / v  # 4 ms
    omega = sqrt(k / MASS)
    stuck = result.time < away - 5e-6
    np.testing.assert_allclose(y[stuck], v * result.time[stuck], atol=1e-9)
    t = result.time - away
    caught = 2.0 / omega * (pi - np.arctan(0.5 / k * omega / v))  # speed of the belt again
    slips = (t > 0) & (t < caught)
    exact = 0.5 / k + 0.5 / k * np.cos(omega * t) + v / omega * np.sin(omega * t)
    np.testing.assert_allclose(y[slips], exact[slips], atol=2e-3 / k)
    carried = (t > caught + 5e-6) & (t < caught + 1e-3)
    np.testing.assert_allclose(np.diff(y[carried]), v * 5e-6, rtol=1e-4)


def test_a_needle_breaks_away_from_a_stiff_seat():
    """Truth, conservation: friction that falls at once when it slips, on a contact that answers.

    Stick and slip are both possible in the step of breaking away; they must not take turns.
    """
    law = {"kind": "linear", "stiffness": 8e9}
    parts = {
        "needle": RigidMass(mass=0.66e-3),
        "spring": Spring(stiffness=3e3, preload=5.7),
        "magnet": ForceOverTime(time=(0.0, 1e-4, 5e-4, 6e-4), force=(0.0, 35.3, 35.3, 0.0)),
        "guide": GuideFriction(coulomb=6.6, breakaway=15.7, stribeck_speed=0.125e-3, viscous=0.5),
        "seat": EndStop(gap=0.0, law=law),
        "stop": EndStop(gap=34.5e-6, law=law, restitution=0.6),
    }
    at = ["spring.end", "magnet.end", "guide.body", "seat.upper", "stop.lower"]
    grounded = [["seat.lower", "ground"], ["stop.upper", "ground"]]
    network = Network(parts, [["needle.body", *at], *grounded])

    result = simulate_network(network.rows(), duration=1.5e-3, step=5e-8, coarse=16, record=2e-6)

    opened = result.channels["needle.body displacement"].values.max()
    assert opened == pytest.approx(34.5e-6, rel=2e-3)
    assert result.books.relative_residual < BALANCE


@pytest.mark.parametrize("step", [10e-9, 5e-9, 2.5e-9])
def test_friction_holds_a_needle_on_a_seat_without_preload(step):
    """Truth, exact: it stays; only round-off of the friction moves it, 1e-16 of 0.1 um in a step.

    Near the place where it started displacements have no round-off of their own.
    """
    parts = {
        "needle": RigidMass(mass=15e-3),
        "pull": ForceOverTime(time=(0.0, 1e-4, 1.2e-4), force=(0.0, 15e-3, 1.0)),
        "guide": GuideFriction(coulomb=20e-3),
        "seat": EndStop(gap=0.0, law={"kind": "hertz", "radius": 20e-3, "modulus": 115e9}),
    }
    joined = ["needle.body", "pull.end", "guide.body", "seat.upper"]
    network = Network(parts, [joined, ["seat.lower", "ground"]])

    result = simulate_network(network.rows(), duration=1.2e-4, step=step, coarse=1, record=1e-6)

    rising = slice(1, int(np.searchsorted(result.time, 1e-4)))
    assert np.abs(result.channels["needle.body displacement"].values[rising]).max() < 1e-24
    force = result.channels["guide.body force"].values[rising]
    np.testing.assert_allclose(force, -150.0 * (result.time[rising] - 0.5e-6), atol=1e-9)


def test_viscous_friction_alone_is_a_dashpot():
    """Truth, exact: v = v0 exp(-b t / m)."""
    result = run({"guide": GuideFriction(coulomb=0.0, viscous=0.5)}, speed=0.5, duration=6e-3)

    exact = 0.5 * exp(-0.5 * 6e-3 / MASS)
    assert velocity(result)[-1] == pytest.approx(exact, rel=1e-7)


@pytest.mark.parametrize("stribeck", [0.02, 0.2])
def test_stribeck_friction_slows_by_its_curve(stribeck):
    """Truth, reference: m dv/dt = -L(v), by a fine Runge-Kutta rule."""
    result = run(
        {"guide": GuideFriction(coulomb=0.4, breakaway=1.0, stribeck_speed=stribeck)},
        speed=0.5,
        duration=0.5e-3,
        coarse=1,
    )

    def slope(v: float) -> float:
        return -(0.4 + 0.6 * exp(-((v / stribeck) ** 2))) / MASS

    v, h = 0.5, 1e-7
    for _ in range(5000):
        a = slope(v)
        b = slope(v + 0.5 * h * a)
        c = slope(v + 0.5 * h * b)
        d = slope(v + h * c)
        v += h / 6.0 * (a + 2 * b + 2 * c + d)
    assert velocity(result)[-1] == pytest.approx(v, abs=1e-6)


def test_the_force_of_a_step_never_gives_energy():
    """Truth, conservation: 2000 random steps; the law holds in each."""
    rng = np.random.default_rng(5)
    for _ in range(2000):
        coulomb, excess, viscous = rng.uniform(0, 2, 3) * (rng.uniform(size=3) > 0.2)
        h, mass, stribeck = 10.0 ** rng.uniform([-8, -4, -3], [-5, -1, 0])
        G, D = h * h / (2 * mass), h / mass
        way = rng.normal() * 10.0 ** rng.uniform(-3, 3) * G
        speed = rng.normal() * 10.0 ** rng.uniform(-3, 3) * D

        largest = largest_friction(coulomb, excess, stribeck, viscous, h, G, way)
        force, slip = slider_force(largest, viscous, h, G, D, way, speed)

        assert force * slip <= 0.0
        assert slip == pytest.approx(way + G * force, rel=1e-9, abs=1e-12 * abs(way))
        dry = -force - viscous * slip / h
        u = abs(slip) / h
        most = coulomb + excess * exp(-min((u / stribeck) ** 2, 700.0))
        assert abs(dry) <= most * (1 + 1e-9) + 1e-12 * abs(force)
        if abs(dry) < most * (1 - 1e-9) - 1e-12 * abs(
            force
        ):  # it stops, or turns without the dry part
            after = speed + D * force
            turned = way * (speed - D * viscous / h * way / (1 + G * viscous / h)) <= 0.0
            still = min(abs(slip) / abs(way), abs(after) / (abs(speed) + D))
            assert turned or still < 1e-9


BODY = BodyEnergy(name="needle", translation=0.7, vibration=0.05, strain=0.01)


def test_friction_is_a_loss_like_the_others():
    ledger = EnergyLedger(
        initial=1.0, bodies=(BODY,), contact_dissipation=0.02, damping=0.03, friction=0.2
    )
    assert ledger.residual == pytest.approx(0.0, abs=1e-15)
    assert ledger.lost == pytest.approx(0.25)
    assert ledger.parts()["friction"] == 0.2
    assert ledger.least_loss == 0.02


def test_a_gain_by_friction_is_a_negative_loss():
    ledger = EnergyLedger(initial=1.0, bodies=(BODY,), damping=0.3, friction=-0.05)
    assert ledger.least_loss == pytest.approx(-0.05)


def test_so_it_is_at_the_interface_level():
    energy = InterfaceEnergy(
        initial=1.0, final=0.9, damping=0.1, guide=0.02, work=0.0, debt=0.0, friction=-0.02
    )
    assert energy.residual == pytest.approx(0.0, abs=1e-15)
    assert energy.least_loss == pytest.approx(-0.02)


def test_without_friction_there_is_no_entry_for_it():
    ledger = EnergyLedger(initial=1.0, bodies=(BODY,), contact_dissipation=0.02, damping=0.03)
    assert "friction" not in ledger.parts()
    assert ledger.least_loss == 0.02
