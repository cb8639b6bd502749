"""End stops of a network whose faces yield: the set stays, and films and gaps know it.

Truth: a rigid mass on two straight lines in closed form (Walton & Braun, J. Rheol. 30 (1986) 949),
the same impact in the loop of one contact, and the energy of every step.
"""

from math import sqrt

import numpy as np
import pytest

from klack.contact.step_constants import LAW_YIELDING
from klack.contact.yielding_law import YieldingLaw
from klack.errors import InputError
from klack.hydraulics.fluid_library import library_fluid
from klack.mechanics.end_stop import EndStop
from klack.mechanics.force import ConstantForce
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.network.rows import Rows
from klack.simulation.interface_step import interface_store, solve_interface
from klack.simulation.network_run import simulate_network
from klack.simulation.yielding_step import press, settle

pytestmark = pytest.mark.filterwarnings("ignore::klack.network.checks.LooseBodyWarning")

MASS, SPEED, GAP = 3e-3, 0.8, 5e-6
LOADING, ELASTIC = 1e8, 2.5e8
RATIO = LOADING / ELASTIC
FILM = {"shape": "ring", "inner_radius": 1e-3, "outer_radius": 1.4e-3, "cut_off": 1e-6}


def two_lines(end=20e-6, states=400):
    """Loading along one line and opening along a steeper one."""
    largest = np.linspace(1e-10, end, states)
    return YieldingLaw(
        largest=largest,
        set=largest * (1 - RATIO),
        closing=LOADING * largest,
        shape=np.tile((np.arange(17) / 16) ** 2, (states, 1)),
    )


def rows(law, *, series=0.0, film=None, force=None, speed=-SPEED, gap=GAP, spring=0.0) -> Rows:
    """A mass above a stop on the ground."""
    stop = EndStop(gap=gap, law={"kind": "linear", "stiffness": 1e9}, film=film)
    parts = {"mass": RigidMass(mass=MASS, speed=speed), "stop": stop.with_law(law, series)}
    joints = [["mass.body", "stop.upper"], ["stop.lower", "ground"]]
    if force is not None:
        parts["push"] = ConstantForce(force=force)
        joints[0].append("push.end")
    if spring:
        parts["spring"] = Spring(stiffness=spring, preload=40.0)
        joints[0].append("spring.end")
    fluid = library_fluid("n-heptane").at(293.15) if film else None
    return Network(parts, joints, fluid=fluid).rows()


def fall(built, *, duration=80e-6, step=20e-9, **given):
    return simulate_network(
        built, duration=duration, step=step, **{"record": 1e-6, "start": "free", **given}
    )


def test_a_mass_rebounds_as_the_closed_form_says():
    """Exact: e = sqrt(k1/k2), F = v sqrt(m k1), and what is lost is the rest of the energy."""
    result = fall(rows(two_lines()))

    (event,) = result.events
    assert event.restitution == pytest.approx(sqrt(RATIO), rel=1e-4)
    assert event.peak_force == pytest.approx(SPEED * sqrt(MASS * LOADING), rel=1e-4)
    assert result.books.relative_residual < 1e-11
    loss = 0.5 * MASS * SPEED**2 * (1.0 - event.restitution**2)
    assert result.books.losses["stop contact"] == pytest.approx(loss, rel=1e-6)
    assert result.books.stores_after["stop contact"] == 0.0


@pytest.mark.parametrize("film", [None, FILM], ids=["dry", "film"])
def test_macro_steps_are_taken_back_with_their_faces(film):
    """Truth: the same bounces with all steps fine; a spring drives the mass back to the stop."""
    built = rows(two_lines(), series=2e-10, film=film, spring=2e6)

    one = fall(built, duration=400e-6, coarse=1)
    many = fall(built, duration=400e-6)

    assert one.steps.flight == 0 < many.steps.flight
    assert many.steps.repeats > 0
    for fine, coarse in zip(one.events[:4], many.events[:4], strict=True):
        assert coarse.peak_force == pytest.approx(fine.peak_force, rel=5e-4)
        assert coarse.time == pytest.approx(fine.time, abs=0.1e-6)
    # one set, left by the hardest impact
    assert many.state["faces.stop"] == pytest.approx(one.state["faces.stop"], rel=1e-3)
    for result in (one, many):
        assert result.books.relative_residual < 1e-9
        assert result.books.losses["stop contact"] > 0.0


def test_the_gap_is_that_of_the_faces_as_they_are():
    """Exact: pressed by 300 N and let go, a mass rests deeper by the set, its gap is elastic."""
    force = 300.0
    pressed = fall(
        rows(two_lines(), force=-force, speed=0.0, gap=0.0), duration=200e-6, coarse=1, start="rest"
    )
    deep, left = pressed.state["faces.stop"]
    assert deep == pytest.approx(force / LOADING, rel=1e-9)
    assert left == pytest.approx((1 - RATIO) * deep, rel=1e-6)
    assert pressed.channels["stop gap"].values[-1] == pytest.approx(-force / ELASTIC, rel=1e-6)
    assert pressed.channels["mass.body displacement"].values[-1] == pytest.approx(-deep, rel=1e-9)
    assert pressed.books.losses["stop contact"] == pytest.approx(0.0, abs=1e-12 * force * deep)


def test_a_film_lies_on_the_faces_as_they_are():
    """Symmetry: faces that are run in, with the stop moved up by the set, are like new ones.

    So the film of a stop that was pressed before acts at the same clearance of its faces.
    """
    set_before = 4e-6 * (1 - RATIO)
    elastic = two_lines().after(4e-6)
    same = YieldingLaw(
        largest=np.array([1e-10, 20e-6]),
        set=np.array([0.0, 1e-12]),
        closing=ELASTIC * np.array([1e-10, 20e-6 - 1e-12]),
        shape=np.tile((np.arange(17) / 16) ** 2, (2, 1)),
    )

    used = fall(rows(elastic, film=FILM, speed=-0.3, gap=GAP - set_before), step=10e-9)
    new = fall(rows(same, film=FILM, speed=-0.3, gap=GAP), step=10e-9)

    assert used.channels["stop gap"].values == pytest.approx(
        new.channels["stop gap"].values, rel=1e-3, abs=1e-10
    )
    assert used.events[0].peak_force == pytest.approx(new.events[0].peak_force, rel=1e-4)
    assert used.books.losses["stop film"] == pytest.approx(new.books.losses["stop film"], rel=1e-4)


def test_any_steps_from_any_state_close_their_balance():
    """Conservation: work is what is stored and lost in each of 2000 steps, no loss is negative."""
    law = two_lines(states=60)
    data, rng = law.flat().parameters, np.random.default_rng(5)
    series, g, e, lost_in_yield = 2e-10, 1e-6, 0.0, 0.0
    for i in range(2000):
        film = 10.0 ** rng.uniform(-18.0, -15.0) * rng.integers(2)
        far = 10.0 ** rng.uniform(-15.0, -6.0)
        deepest = -1e-6 - 14e-6 * i / 2000
        before = interface_store(LAW_YIELDING, data, 0, series, g, e)
        contact, pull, g1, e1, _, lost, loss = solve_interface(
            LAW_YIELDING,
            data,
            0,
            0.0,
            film,
            0.0,
            1e-6,
            1e9,
            20e-9,
            10.0 ** rng.uniform(-14.0, -10.0),
            series,
            g,
            min(g + rng.choice([-1.0, 1.0]) * far, 2e-6) if g > deepest else g + far,
            e,
            rng.uniform(-10.0, 300.0),
            0,
            0.0,
        )
        held = press(data, 0, -(g + e), -(g1 + e1), contact)
        after = interface_store(LAW_YIELDING, data, 0, series, g1, e1)
        settled = settle(data, 0)
        moved = interface_store(LAW_YIELDING, data, 0, series, g1 + settled, e1)
        assert moved == pytest.approx(after, rel=1e-9, abs=1e-20)
        taken = -(contact + pull) * (g1 - g)
        scale = abs(taken) + before + after + lost + loss
        accepted = 1e-12 * scale + 2e-9 * abs(g1 + e1 - g - e) + 1e-40
        assert taken == pytest.approx(after - before + lost + loss + held, rel=0, abs=accepted)
        assert held >= -accepted
        assert min(lost, loss) > -accepted
        assert settled >= 0.0
        g, e, lost_in_yield = g1 + settled, e1, lost_in_yield + held
    assert lost_in_yield > 0.0


def test_a_continued_run_has_the_bits_of_one_in_one_go():
    """The faces are part of the state: cut after the first impact and within the second."""
    built, record = rows(two_lines(), force=-200.0), 1.28e-6
    whole = fall(built, duration=100 * record, record=record)
    for cut in (8, 40, 61):
        first = fall(built, duration=cut * record, record=record)
        assert first.state["faces.stop"][0] > 1e-6
        second = fall(built, duration=(100 - cut) * record, record=record, state=first.state)
        for name in ("mass velocity", "stop gap"):
            assert np.array_equal(second.channels[name].values, whole.channels[name].values[cut:])
        assert np.array_equal(second.state["faces.stop"], whole.state["faces.stop"])
    assert len(whole.events) > 1


def test_a_restitution_beside_yield_is_refused():
    stop = EndStop(gap=0.0, law={"kind": "consistent"}, restitution=0.9).with_law(two_lines())
    with pytest.raises(InputError, match="beside yield"):
        stop.contact_law()
