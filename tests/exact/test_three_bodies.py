"""Three bodies in a row: needle, insert, housing.

Truth: waves in three equal rods (the middle one passes the blow on), two masses on springs in
closed form, one rod in place of two that a preload holds together, the energy and the momentum of
random rows, and the same bodies in the loop of a stroke.
"""

from math import pi, sqrt

import numpy as np
import pytest
from draws import each
from scipy.linalg import expm

from klack.contact.laws import HertzLaw, LinearLaw
from klack.errors import InputError
from klack.simulation.bodies import fixed_body, rigid_mass_body, rod_body
from klack.simulation.impact import simulate
from klack.simulation.system import AxialForce, ContactPair, ReducedSystem, ReturnSpring

UNIT = {"area": 1.0, "young": 1.0, "density": 1.0}  # wave speed and impedance 1


def on(a, b, law, gap=0.0, preload=0.0):
    ports = [body.port_names for body in (a, b)]
    return ContactPair(
        body_a=a.name,
        port_a="bottom" if "bottom" in ports[0] else "contact",
        body_b=b.name,
        port_b="top" if "top" in ports[1] else "contact",
        law=law,
        gap=gap,
        preload=preload,
    )


def rods(count, modes=200):
    return [rod_body(f"rod {i}", elastic_modes=modes, length=1.0, **UNIT) for i in range(count)]


def between(a, b, stiffness=np.inf):
    """Linear law of the compliance that the modes of two rods miss, in series with a spring."""
    missing = sum(body.residual_compliance[0, 0] for body in (a, b))
    return LinearLaw(1.0 / (missing + 1.0 / stiffness))


def test_the_middle_one_of_three_rods_passes_the_blow_on():
    # d'Alembert: both contacts press with Z v / 2 for two passages of a rod, the second one a
    # passage later; then the last rod has all momentum and no vibration
    bodies = rods(3)
    first, second = between(*bodies[:2]), between(*bodies[1:])
    system = ReducedSystem(
        bodies=tuple(bodies),
        contacts=(on(bodies[0], bodies[1], first), on(bodies[1], bodies[2], second)),
    )
    record = simulate(system, velocities={"rod 0": -1.0}, step=5e-4, duration=4.0)
    time = (np.arange(len(record.force)) + 0.5) * record.step
    for contact, begin in ((0, 0.0), (1, 1.0)):
        inside = (time > begin + 0.1) & (time < begin + 1.9)
        outside = (time < begin - 0.1) | (time > begin + 2.1)
        # 200 modes ring about the plateau; found 2.1e-4, 8e-4 and 1.1e-3
        assert np.mean(record.force[inside, contact]) == pytest.approx(0.5, rel=1e-3)
        assert np.max(np.abs(record.force[outside, contact])) < 2e-3
    assert record.velocity[-1] == pytest.approx([0.0, 0.0, -1.0], abs=3e-3)
    assert record.ledger.residual == pytest.approx(0.0, abs=1e-12)


M1, M2, K1, K2, CLAMP = 2e-3, 1e-3, 3e8, 8e8, 2e7  # [kg], [N/m]


SPRINGS = (LinearLaw(K1), LinearLaw(K2))


def row_of_masses(preload, clamp=CLAMP, laws=SPRINGS):
    needle, insert = rigid_mass_body("needle", M1), rigid_mass_body("insert", M2)
    housing = fixed_body("housing")
    pressed = ReturnSpring(body="insert", port="contact", stiffness=clamp, preload=preload)
    return ReducedSystem(
        bodies=(needle, insert, housing),
        contacts=(
            on(needle, insert, laws[0]),
            on(insert, housing, laws[1], preload=preload),
        ),
        springs=(pressed,) if preload or clamp else (),
    )


def test_two_masses_on_springs_while_the_preload_holds_the_insert():
    v, preload, step = 0.5, 2000.0, 1e-9
    record = simulate(row_of_masses(preload), velocities={"needle": -v}, step=step, duration=6e-6)
    K = np.array([[K1, -K1], [-K1, K1 + K2 + CLAMP]])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-K / [[M1], [M2]], np.zeros((2, 2))]])
    one = expm(A * step)
    state = np.array([0.0, 0.0, -v, 0.0])
    states = [state]
    for _ in range(len(record.force)):
        states.append(one @ states[-1])
    y = np.array(states)
    expected = np.column_stack([K1 * (y[:, 1] - y[:, 0]), preload - K2 * y[:, 1]])
    mean = 0.5 * (expected[1:] + expected[:-1])
    # the mean of a step by the trapezoidal rule and by the scheme: (omega h)^2 / 12 = 9.7e-8
    assert record.force == pytest.approx(mean, abs=3e-7 * mean.max())
    assert record.displacement[:, 1, 0] == pytest.approx(y[:, 1], abs=1e-6 * np.abs(y).max())
    assert abs(record.ledger.residual) < 1e-12


@each("clamp", [0.0, CLAMP])
def test_a_clamped_insert_stays_at_rest_until_the_needle_arrives(clamp):
    hertz = HertzLaw(2e12)
    system = row_of_masses(300.0, clamp, laws=(hertz, hertz))
    record = simulate(system, velocities={"needle": 1e-3}, step=20e-9, duration=20e-6)  # away
    assert record.force[:, 0] == pytest.approx(0.0)
    # rounding of the gap: 1e-16 of 3e-7 m
    assert record.force[:, 1] == pytest.approx(300.0, rel=1e-12)
    assert record.displacement[:, 1] == pytest.approx(0.0, abs=1e-18)


def test_a_constant_force_clamps_elastic_rods_as_well():
    upper, lower = rods(2, modes=20)
    system = ReducedSystem(
        bodies=(rigid_mass_body("needle", 1.0), upper, lower),
        contacts=(
            on(rigid_mass_body("needle", 1.0), upper, LinearLaw(1.0), gap=1.0),
            on(upper, lower, LinearLaw(5.0), preload=2.0),
        ),
        forces=(
            AxialForce(body="rod 0", force=-2.0, port="top"),
            AxialForce(body="rod 1", force=2.0, port="bottom"),
        ),
    )
    record = simulate(system, velocities={"needle": -1e-6}, step=1e-3, duration=1.0)
    assert record.force[:, 1] == pytest.approx(2.0, rel=1e-12)
    assert record.velocity[:, 1:] == pytest.approx(0.0, abs=1e-12)


def test_a_stiff_contact_under_a_large_preload_is_one_rod():
    speed, soft, modes = 1.0, LinearLaw(0.3), 200
    needle = rigid_mass_body("needle", 0.5)
    upper, lower = rods(2, modes)
    whole = rod_body("whole", length=2.0, elastic_modes=2 * modes, **UNIT)
    glued = ReducedSystem(bodies=(needle, whole), contacts=(on(needle, whole, soft),))
    held = ReducedSystem(
        bodies=(needle, upper, lower),
        contacts=(on(needle, upper, soft), on(upper, lower, between(upper, lower), preload=50.0)),
        forces=(
            AxialForce(body="rod 0", force=-50.0, port="top"),
            AxialForce(body="rod 1", force=50.0, port="bottom"),
        ),
    )
    first, second = (
        simulate(system, velocities={"needle": -speed}, step=2e-3, duration=8.0).impact(0)
        for system in (glued, held)
    )
    # 200 modes of each half leave 1.5e-6 of the peak, a quarter of what 100 leave
    assert second.force == pytest.approx(first.force, abs=3e-6 * first.force.max())


@each("seed", range(40))
def test_random_rows_keep_energy_and_momentum(seed):
    """Preload or gap, laws, masses; truth: energy, momentum of the needle, forces that push."""
    rng = np.random.default_rng(seed)
    masses = 10 ** rng.uniform(-4, -1, 3)
    stiff = 10 ** rng.uniform(7, 10, 2)
    preload = 10 ** rng.uniform(0, 4) if rng.random() < 0.5 else 0.0
    gap = 0.0 if preload else rng.choice([0.0, 10 ** rng.uniform(-8, -5)])
    clamp = rng.choice([0.0, 10 ** rng.uniform(5, 8)]) if preload else 0.0
    laws = [
        LinearLaw(k) if rng.random() < 0.5 else HertzLaw(k * 10 ** rng.uniform(2, 3)) for k in stiff
    ]
    bodies = [rigid_mass_body(name, m) for name, m in zip("abc", masses, strict=True)]
    if preload or rng.random() < 0.5:
        bodies[2] = fixed_body("c")
    system = ReducedSystem(
        bodies=tuple(bodies),
        contacts=(
            on(*bodies[:2], laws[0], gap=1e-7),
            on(*bodies[1:], laws[1], gap=gap, preload=preload),
        ),
        springs=(ReturnSpring(body="b", port="contact", stiffness=clamp, preload=preload),)
        if preload
        else (),
    )
    v = 10 ** rng.uniform(-2, 1)
    period = 2 * pi * sqrt(masses[:2].min() / max(law.tangent_stiffness(1e-5) for law in laws))
    record = simulate(system, velocities={"a": -v}, step=period / 200, duration=10 * period)
    assert abs(record.ledger.residual) < 1e-12
    assert record.force.min() >= 0.0
    impulse = record.force[:, 0].sum() * record.step
    assert impulse == pytest.approx(masses[0] * (record.velocity[-1, 0] + v), rel=1e-9, abs=1e-12)


def test_a_preload_that_nothing_balances_is_refused():
    system = row_of_masses(300.0)
    loose = ReducedSystem(bodies=system.bodies, contacts=system.contacts)
    with pytest.raises(InputError, match="is not balanced"):
        simulate(loose, velocities={"needle": -1.0}, step=1e-8, duration=1e-6)
    with pytest.raises(InputError, match="together with a gap"):
        on(*loose.bodies[:2], LinearLaw(1e8), gap=1e-6, preload=1.0)
