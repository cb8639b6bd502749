"""Truth: energy and momentum. The scheme balances them to round-off at every step size."""

from math import pi

import numpy as np
import pytest

from klack.contact.laws import HertzLaw, HuntCrossley, LinearLaw, TableLaw
from klack.contact.restitution import measure_impact
from klack.simulation.bodies import fixed_body, rigid_mass_body, rod_body
from klack.simulation.impact import simulate, simulate_impact
from klack.simulation.system import AxialForce, ContactPair, ReducedSystem, ReturnSpring

STEEL = {"young": 2.1e11, "density": 7850.0}
DEPTH = 6e-6 * np.linspace(0.0, 1.0, 30)[1:] ** 1.3  # [m]
LAWS = [LinearLaw(1e9), HertzLaw(2e11), TableLaw(DEPTH, 2e11 * DEPTH**1.5)]
IDS = ["linear", "hertz", "table"]


def needle(modes=19, damping=0.0, area=pi * 4e-6):
    return rod_body("needle", length=0.04, area=area, elastic_modes=modes, damping=damping, **STEEL)


def seat(modes=40, damping=0.0, name="seat", support="bottom"):
    return rod_body(
        name,
        length=0.1,
        area=pi * 25e-6,
        elastic_modes=modes,
        support=support,
        damping=damping,
        **STEEL,
    )


def contact(law, gap=1e-6, a=("needle", "bottom"), b=("seat", "top"), series=0.0):
    return ContactPair(
        body_a=a[0],
        port_a=a[1],
        body_b=b[0],
        port_b=b[1],
        law=law,
        gap=gap,
        series_compliance=series,
    )


@pytest.mark.parametrize("step", [20e-9, 100e-9, 1e-6])
@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_energy_of_thousands_of_impacts(law, step):
    """20 ms under 200 N without damping: drift below 1e-10 even where a step skips a contact."""
    system = ReducedSystem(
        bodies=(needle(), seat()),
        contacts=(contact(law),),
        forces=(AxialForce(body="needle", force=-200.0),),
    )
    history = simulate_impact(system, speed=1.0, step=step, duration=20e-3)

    closed = history.force > 0.0

    assert abs(history.ledger.residual) < 1e-10
    touches = np.count_nonzero(closed[1:] & ~closed[:-1])  # chaotic: about 900, 5000, 900
    assert touches > (200 if step > 5e-7 else 3000 if isinstance(law, LinearLaw) else 500)


@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_modal_damping_is_booked(law):
    system = ReducedSystem(
        bodies=(needle(damping=0.02), seat(damping=0.005)),
        contacts=(contact(law),),
        forces=(AxialForce(body="needle", force=-50.0),),
    )
    ledger = simulate_impact(system, speed=1.0, step=20e-9, duration=2e-3).ledger

    assert ledger.damping > 0.05 * ledger.initial
    assert abs(ledger.residual) < 1e-11


@pytest.mark.parametrize("exponent", [1.0, 1.5])
def test_hunt_crossley_loss_is_booked_and_never_negative(exponent):
    law = HuntCrossley(HertzLaw({1.0: 1e9, 1.5: 2e11}[exponent], exponent=exponent), 0.3)
    system = ReducedSystem(
        bodies=(rigid_mass_body("needle", 3e-3), fixed_body("seat")),
        contacts=(contact(law, a=("needle", "contact"), b=("seat", "contact")),),
        forces=(AxialForce(body="needle", force=-100.0),),
    )
    lost = [
        simulate_impact(system, speed=0.5, step=20e-9, duration=t).ledger
        for t in np.linspace(2e-6, 300e-6, 30)
    ]

    assert np.all(np.diff([ledger.contact_dissipation for ledger in lost]) >= 0.0)
    assert lost[-1].contact_dissipation > 0.2 * lost[-1].initial
    assert max(abs(ledger.residual) for ledger in lost) < 1e-12


def test_clipped_damping_work_is_booked():
    """Strong damping on a body that is pulled away by its own ringing: the law must not pull."""
    system = ReducedSystem(
        bodies=(needle(), seat()), contacts=(contact(HuntCrossley(LinearLaw(1e9), 5.0)),)
    )
    history = simulate_impact(system, speed=1.0, step=20e-9, duration=100e-6)

    assert np.all(history.force >= 0.0)
    assert abs(history.ledger.residual) < 1e-11


@pytest.mark.slow
def test_two_contacts_at_once_conserve_energy_and_momentum():
    """A needle between two free rods, both contacts closed together much of the time."""
    low, high = seat(name="low", support="free"), seat(name="high", support="free")
    system = ReducedSystem(
        bodies=(needle(), low, high),
        contacts=(
            contact(LinearLaw(1e9), b=("low", "top")),
            contact(
                TableLaw(DEPTH, 2e11 * DEPTH**1.5),
                a=("high", "bottom"),
                b=("needle", "top"),
                gap=2e-6,
            ),
        ),
    )
    record = simulate(
        system, velocities={"high": -0.8, "needle": -0.2}, step=20e-9, duration=400e-6
    )
    mass = np.array([body.mass for body in system.bodies])
    momentum = record.velocity @ mass
    assert np.count_nonzero(np.all(record.force > 0.0, axis=1)) > 50
    assert abs(record.ledger.residual) < 1e-11
    np.testing.assert_allclose(momentum, momentum[0], rtol=1e-12)
    # each body gains what its contacts push
    gained = mass[0] * np.diff(record.velocity[:, 0])
    np.testing.assert_allclose(
        gained,
        (record.force[:, 0] - record.force[:, 1]) * record.step,
        atol=1e-12 * abs(momentum[0]),
    )


@pytest.mark.slow
def test_two_parallel_contacts_share_the_force():
    """Two contacts at one place are one of the sum of the stiffnesses (stiff against the step)."""
    wall = fixed_body("seat", port="top")
    one = ReducedSystem(bodies=(needle(), wall), contacts=(contact(LinearLaw(5e9)),))
    two = ReducedSystem(
        bodies=(needle(), wall), contacts=(contact(LinearLaw(4e9)), contact(LinearLaw(1e9)))
    )
    single, double = (
        simulate(system, velocities={"needle": -1.0}, step=50e-9, duration=60e-6)
        for system in (one, two)
    )

    np.testing.assert_allclose(
        double.force.sum(axis=1), single.force[:, 0], rtol=1e-6, atol=1e-6 * single.force.max()
    )
    np.testing.assert_allclose(double.force[:, 0], 4.0 * double.force[:, 1], rtol=1e-6, atol=1e-6)
    assert abs(double.ledger.residual) < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("damping", [0.0, 0.01])
@pytest.mark.parametrize("law", [*LAWS, HuntCrossley(LAWS[1], 0.2)], ids=[*IDS, "lossy"])
def test_loops_for_one_and_for_several_contacts_agree(law, damping):
    """A second contact that stays open changes nothing (100 modes: more than one chunk)."""
    bodies = needle(modes=29, damping=damping), seat(modes=70, damping=damping)
    press = (AxialForce(body="needle", force=-30.0),)
    one = contact(law, series=0.0 if isinstance(law, HuntCrossley) else 1e-10)
    far = contact(LinearLaw(1e9), gap=1.0, a=("needle", "top"))
    single, several = (
        simulate(
            ReducedSystem(bodies=bodies, contacts=contacts, forces=press),
            velocities={"needle": -0.7},
            step=20e-9,
            duration=100e-6,
            steps_per_record=4,
        )
        for contacts in ((one,), (one, far))
    )

    scale = single.force.max()
    np.testing.assert_allclose(several.force[:, 0], single.force[:, 0], atol=1e-7 * scale)
    np.testing.assert_allclose(several.velocity, single.velocity, atol=1e-9)
    np.testing.assert_allclose(several.displacement[:, 0], single.displacement[:, 0], atol=1e-14)
    assert several.ledger.damping == pytest.approx(single.ledger.damping, rel=1e-7)
    assert several.ledger.contact_dissipation == pytest.approx(
        single.ledger.contact_dissipation, rel=1e-6, abs=1e-15
    )


@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_series_compliance_loses_next_to_nothing(law):
    """The state of the series spring at release is the only loss: booked, and of second order."""
    system = ReducedSystem(bodies=(needle(), seat()), contacts=(contact(law, series=1e-9),))
    ledger = simulate_impact(system, speed=0.5, step=20e-9, duration=100e-6).ledger

    assert abs(ledger.residual) < 1e-12
    assert 0.0 <= ledger.contact_dissipation < 1e-5 * ledger.initial


def test_spring_to_ground_keeps_the_books():
    system = ReducedSystem(
        bodies=(needle(damping=0.01), seat()),
        contacts=(contact(LinearLaw(1e9), gap=30e-6),),
        springs=(ReturnSpring(body="needle", port="top", stiffness=2e4, preload=15.0),),
    )
    ledger = simulate_impact(system, speed=0.3, step=50e-9, duration=3e-3).ledger

    assert ledger.spring != 0.0
    assert abs(ledger.residual) < 1e-9  # the spring is folded into modes up to 1.2 MHz


def test_impulse_is_the_change_of_momentum():
    low = seat(support="free")
    system = ReducedSystem(
        bodies=(needle(), low),
        contacts=(contact(LinearLaw(1e9)),),
        forces=(AxialForce(body="needle", force=-40.0),),
    )
    m = measure_impact(simulate_impact(system, speed=0.7, step=20e-9, duration=80e-6))

    assert m.impulse_residual == pytest.approx(0.0, abs=1e-12)
    assert m.restitution_from_impulse == pytest.approx(m.restitution, rel=1e-9)
