"""Truth: the impact of reduced bodies has no length of its own (exact, bit for bit).

Everything ``s`` times as large, of the same materials and at the same speeds, takes ``s`` times as
long at ``s^2`` times the forces.  With ``s`` a power of four all factors are powers of two, also
those of the masses and of Hertz's law: a number in metres, seconds or newtons would show.
"""

import numpy as np
import pytest

from klack.contact.history import ImpactHistory
from klack.contact.laws import HertzLaw, HuntCrossley, gonthier_coefficient
from klack.contact.restitution import find_contacts, measure_impact
from klack.simulation.bodies import fixed_body, rigid_mass_body, rod_body
from klack.simulation.impact import simulate
from klack.simulation.system import AxialForce, ContactPair, ReducedSystem

SIZES = (4.0**-5, 4.0**5)
RESTITUTION = 0.6


def system(kind: str, s: float) -> ReducedSystem:
    """A needle that 1 N presses onto its seat: a mass on one or on two damped stops, or a rod."""
    law = HertzLaw(3e10 * s**0.5)
    needle = rigid_mass_body("needle", 1e-3 * s**3)
    contacts, port = 1, "contact"
    if kind == "rod":
        port = "bottom"
        needle = rod_body(
            "needle",
            length=0.02 * s,
            area=6e-6 * s**2,
            young=2.1e11,
            density=7850.0,
            elastic_modes=12,
        )
    else:
        law = HuntCrossley(law, gonthier_coefficient(RESTITUTION))
        contacts = {"one stop": 1, "two stops": 2}[kind]
    return ReducedSystem(
        bodies=(needle, *(fixed_body(f"seat {c}") for c in range(contacts))),
        contacts=tuple(
            ContactPair(
                body_a="needle",
                port_a=port,
                body_b=f"seat {c}",
                port_b="contact",
                law=law,
                gap=2e-6 * s,
                series_compliance=1e-9 / s,
            )
            for c in range(contacts)
        ),
        forces=(AxialForce(body="needle", force=-1.0 * s**2),),
    )


def impact(kind: str, s: float) -> ImpactHistory:
    record = simulate(
        system(kind, s), velocities={"needle": -0.5}, step=20e-9 * s, duration=1.2e-3 * s
    )
    return record.impact()


@pytest.mark.parametrize("s", SIZES)
@pytest.mark.parametrize(
    "kind", ["one stop", pytest.param("two stops", marks=pytest.mark.slow), "rod"]
)
def test_bounces_know_no_length(kind, s):
    """Several touches, each damped by its own speed; and the numbers of the first impact."""
    whole, scaled = impact(kind, 1.0), impact(kind, s)

    assert len(find_contacts(whole)) >= 2
    np.testing.assert_array_equal(scaled.force / s**2, whole.force, strict=True)
    np.testing.assert_array_equal(scaled.velocity_a, whole.velocity_a, strict=True)
    one, other = measure_impact(whole), measure_impact(scaled)
    assert other.impacts == one.impacts
    assert other.sub_contacts == one.sub_contacts
    for name, factor in (
        ("peak_force", s**2),
        ("contact_time", s),
        ("total_contact_time", s),
        ("restitution", 1.0),
        ("rebound_speed", 1.0),
        ("vibration_share", 1.0),
    ):
        # records are placed by roots of sums, where the last digits differ
        assert getattr(other, name) / factor == pytest.approx(
            getattr(one, name), rel=1e-12, abs=1e-12
        ), name


def test_every_bounce_of_a_small_mass_has_its_own_restitution():
    """A mass of 1 ug rises 45 nm, 16 nm and 6 nm.

    The damped law is exact without a force; during a contact of 20 ns it gives 20 mm/s, and adds
    to the speed before as much as it takes from the speed after.
    """
    s = SIZES[0]
    history = impact("one stop", s)
    contacts = find_contacts(history)

    assert len(contacts) >= 3
    for contact in contacts[:3]:
        before, after = history.velocity_a[[contact.first, contact.last]]
        assert -after / before == pytest.approx(RESTITUTION, abs=0.02 / -before)
