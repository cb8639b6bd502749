"""A contact law with memory of two faces with friction.

Truth: the rigid needle on a frictional cone in closed form (``friction_cone_seat.csv``), a bed of
many springs that is known to lose the same share at every power of the force, and the energy that
no closed path can gain.
"""

import csv
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from draws import each

from klack.contact.rubbing_law import RubbingLaw
from klack.errors import InputError
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.simulation.impact import simulate_impact
from klack.simulation.lasting_laws import rubbing_mean, rubbing_store, slide, slider_places
from klack.simulation.system import ContactPair, ReducedSystem

TABLE = Path(__file__).parents[1] / "data" / "friction_cone_seat.csv"
KN = 1e9  # [N/m] along the normal of the ring


def cones():
    lines = [line for line in TABLE.read_text().splitlines() if not line.startswith("#")]
    return [{k: float(v) for k, v in row.items()} for row in csv.DictReader(lines)]


def cone_law(half_angle, friction, kt_over_kn):
    """The rigid needle on springs kn and kt at its ring: one spring with one slider."""
    sine, cosine = np.sin(half_angle), np.cos(half_angle)
    return RubbingLaw(
        onset=[0.0],
        normal=[KN * sine**2],
        strength=[friction * KN * sine * cosine],
        ratio=kt_over_kn * cosine / sine / friction,
    )


def bed(power, friction=0.2, ratio=3.0, depth=1e-6, count=400):
    """Springs of all depths whose sum rises with a power of the indentation."""
    at = depth * np.arange(count + 1) / count
    slope = np.diff(KN * at**power) / np.diff(at)
    stiffness = np.diff(slope, prepend=0.0)
    return RubbingLaw(
        onset=at[:-1],
        normal=stiffness * (1.0 - friction),
        strength=stiffness * friction,
        ratio=ratio,
    )


def work_along(law, path):
    """Work taken, energy stored at the end, loss: exactly, from corner to corner."""
    numbers = law.flat().parameters
    work, lost = 0.0, []
    for d0, d1 in pairwise(path):
        mean, _ = rubbing_mean(numbers, 0, d0, d1)
        work += mean * (d1 - d0)
        lost.append(slide(numbers, 0, d0, d1))
    stored = law.stored(path[-1], slider_places(numbers, 0))
    assert rubbing_store(numbers, 0, path[-1]) == pytest.approx(stored, rel=1e-12)
    return work, stored, np.array(lost)


@each("row", cones())
def test_a_needle_on_a_frictional_cone(row):
    alpha, mu = np.radians(row["half_angle_deg"]), row["mu"]
    law = cone_law(alpha, mu, row["kt_over_kn"])
    depth = 3e-6
    work, stored, lost = work_along(law, [0.0, depth, 0.0])
    taken = float(law.potential(depth))
    assert law.ratio == pytest.approx(row["R"], rel=1e-7)
    assert np.sqrt(1.0 - work / taken) == pytest.approx(row["e_linear_local_law"], abs=1e-7)
    assert stored == 0.0
    assert lost.sum() == pytest.approx(work, abs=1e-14 * taken)
    if law.ratio > 1:
        e2 = 1 - 2 * mu * np.cos(alpha) / (np.sin(alpha) + mu * np.cos(alpha)) * (law.ratio - 1) / (
            law.ratio + 1
        )
        assert 1.0 - work / taken == pytest.approx(e2, abs=1e-12)
        normal = KN * np.sin(alpha) * depth
        assert law.force(depth) == pytest.approx(normal * row["P_load_over_N"], rel=1e-7)
        back = normal * row["P_unload_over_N"]
        assert law.returning(depth) == pytest.approx(back, rel=1e-7)


@pytest.mark.parametrize("power", [1.2, 1.5, 2.0])
def test_springs_of_all_depths_lose_the_same_share(power):
    law = bed(power)
    work, _, lost = work_along(law, [0.0, 0.9e-6, 0.0])
    taken = float(law.potential(0.9e-6))
    assert taken == pytest.approx(KN * 0.9e-6 ** (power + 1) / (power + 1), rel=1e-4)
    share = 2 * 0.2 * (law.ratio - 1) / (law.ratio + 1)
    assert lost.sum() == pytest.approx(share * taken, rel=1e-12)
    assert work == pytest.approx(lost.sum(), rel=1e-12)


def test_forces_along_a_path_are_those_of_the_steps():
    law, path = bed(1.5, count=30), np.array([0.0, 0.7, 0.5, 0.6, 0.2, 0.9, 0.0, 0.3]) * 1e-6
    forces, numbers = law.along(path), law.flat().parameters
    for d0, d1, force in zip(path[:-1], path[1:], forces[1:], strict=True):
        slide(numbers, 0, d0, d1)
        still, _ = rubbing_mean(numbers, 0, d1, d1)
        assert still == pytest.approx(force, rel=1e-12, abs=1e-12)


@each("seed", range(5))
def test_no_path_gains_energy(seed):
    """Work is what is stored and what each stretch loses; no stretch loses less than 0."""
    rng = np.random.default_rng(seed)
    law = bed(rng.uniform(1, 2), rng.uniform(0, 0.49), rng.uniform(0.5, 10), count=20)
    path = np.append(0.0, 1e-6 * rng.uniform(-0.2, 1.2, 300))
    work, stored, lost = work_along(law, path)
    scale = float(law.potential(1e-6))
    assert lost.min() >= 0.0
    assert work == pytest.approx(stored + lost.sum(), abs=1e-12 * scale)
    assert np.all(law.along(path) >= 0.0)


def test_slope_of_a_step_is_that_of_its_force():
    numbers = bed(1.5, count=7).flat().parameters
    slide(numbers, 0, 0.0, 0.8e-6)
    for d0, d1 in ((0.8e-6, 0.85e-6), (0.8e-6, 0.74e-6), (0.8e-6, 0.21e-6), (0.8e-6, -0.1e-6)):
        h = 1e-12
        up, down = (rubbing_mean(numbers, 0, d0, d1 + s * h)[0] for s in (1, -1))
        _, slope = rubbing_mean(numbers, 0, d0, d1)
        assert slope == pytest.approx((up - down) / (2 * h), rel=1e-4)


def impact(law, *, step, speed=0.3, duration=60e-6, force=0.0):
    pair = ContactPair(
        body_a="a", port_a="contact", body_b="b", port_b="contact", law=law, gap=0.1e-6
    )
    system = ReducedSystem(bodies=(rigid_mass_body("a", 1e-3), fixed_body("b")), contacts=(pair,))
    return simulate_impact(system, speed=speed, duration=duration, step=step)


@pytest.mark.parametrize("step", [2e-8, 1e-7, 1e-6])
def test_restitution_of_an_impact(step):
    law = cone_law(np.radians(45), 0.1, 0.8235)
    history = impact(law, step=step)
    e2 = 1 - 0.2 / 1.1 * (law.ratio - 1) / (law.ratio + 1)
    assert abs(history.ledger.residual) < 1e-12
    # the loss belongs to the deepest end of a step: second order, 42 steps of 0.1 us in contact
    error = 1.2e-4 * (step / 1e-7) ** 2
    assert history.velocity_a[-1] == pytest.approx(0.3 * np.sqrt(e2), rel=error)
    share = history.ledger.friction / history.ledger.initial
    assert share == pytest.approx(1 - e2, abs=2 * error)
    assert history.ledger.contact == 0.0


def test_a_contact_that_sticks_gives_all_back():
    history = impact(cone_law(np.radians(45), 0.9, 0.8235), step=1e-7)
    assert history.velocity_a[-1] == pytest.approx(0.3, rel=1e-12)
    assert history.ledger.friction == 0.0


def test_a_contact_that_jams_is_refused():
    with pytest.raises(InputError, match="self-locking"):
        cone_law(np.radians(20), 0.4, 0.8235)
