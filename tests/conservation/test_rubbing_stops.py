"""End stops of a network whose faces rub or yield.

End stops of a network whose faces have friction: a law with memory in the time loop of a valve.

Truth: a rigid mass on a spring with a slider in closed form, the same impact in the loop of one
contact, the energy of every step, and a mass at rest that stays where it is.

End stops of a network whose faces yield: the set stays, and films and gaps know it.

Truth: a rigid mass on two straight lines in closed form (Walton & Braun, J. Rheol. 30 (1986) 949),
the same impact in the loop of one contact, and the energy of every step.
"""

from math import sqrt

import numpy as np
import pytest

from klack.assembling.stops import bulk_compliance, without_bulk
from klack.contact.laws import TableLaw
from klack.contact.local_law import LocalLaw
from klack.contact.rubbing_fit import Loop, rubbing_fit
from klack.contact.rubbing_law import RubbingLaw
from klack.contact.step_constants import LAW_RUBBING, LAW_YIELDING
from klack.contact.yielding_law import YieldingLaw
from klack.errors import InputError
from klack.hydraulics.fluid_library import library_fluid
from klack.mechanics.end_stop import EndStop
from klack.mechanics.force import ConstantForce, ForceOverTime
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.network.rows import Rows
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.simulation.impact import simulate
from klack.simulation.interface_step import interface_store, solve_interface
from klack.simulation.lasting_laws import press, settle, slide
from klack.simulation.network_run import simulate_network
from klack.simulation.system import ContactPair, ReducedSystem

pytestmark = pytest.mark.filterwarnings("ignore::klack.network.checks.LooseBodyWarning")


MASS, SPEED, GAP = 3e-3, 0.8, 5e-6
CONE = RubbingLaw(onset=[0.0], normal=[5e8], strength=[5e7], ratio=8.0)
FILM = {"shape": "ring", "inner_radius": 1e-3, "outer_radius": 1.4e-3, "cut_off": 1e-6}


def bed(power=1.5, friction=0.1, ratio=4.0, depth=8e-6, count=40, stiffness=4e11):
    """Springs of all depths whose sum rises with a power of the indentation."""
    at = depth * np.arange(count + 1) / count
    springs = np.diff(np.diff(stiffness * at**power) / np.diff(at), prepend=0.0)
    return RubbingLaw(onset=at[:-1], normal=springs, strength=friction * springs, ratio=ratio)


def returned(friction, ratio):
    """Restitution of a rigid mass: see :mod:`klack.contact.rubbing_law`."""
    return sqrt(1.0 - 2.0 * friction / (1.0 + friction) * (ratio - 1.0) / (ratio + 1.0))


def rows(
    law, *, series=0.0, film=None, force=None, speed=-SPEED, gap=GAP, blow=0.0, spring=0.0
) -> Rows:
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
    if blow:  # [m/s], within 0.2 us after 5 N have been taken off
        parts["blow"] = ForceOverTime(
            time=[0.0, 200e-6, 200.1e-6, 200.2e-6],
            force=[0.0, 5.0, 5.0 + MASS * blow / 0.1e-6, 5.0],
        )
        joints[0].append("blow.end")
    fluid = library_fluid("n-heptane").at(293.15) if film else None
    return Network(parts, joints, fluid=fluid).rows()


def fall(built, *, duration=60e-6, step=20e-9, **given):
    return simulate_network(
        built, duration=duration, step=step, **{"record": 1e-6, "start": "free", **given}
    )


@pytest.mark.parametrize(("law", "friction", "ratio"), [(CONE, 0.1, 8.0), (bed(), 0.1, 4.0)])
def test_a_mass_rebounds_as_the_closed_form_says(law, friction, ratio):
    result = fall(rows(law))

    (event,) = result.events
    assert event.restitution == pytest.approx(returned(friction, ratio), rel=1e-3)
    assert result.books.relative_residual < 1e-11
    loss = 0.5 * MASS * SPEED**2 * (1.0 - event.restitution**2)
    assert result.books.losses["stop contact"] == pytest.approx(loss, rel=1e-6)
    assert result.books.stores_after["stop contact"] == 0.0


def test_the_loop_of_one_contact_has_the_same_impact():
    pair = ContactPair(
        body_a="a", port_a="contact", body_b="b", port_b="contact", law=bed(), gap=GAP
    )
    system = ReducedSystem(bodies=(rigid_mass_body("a", MASS), fixed_body("b")), contacts=(pair,))
    record = simulate(system, velocities={"a": -SPEED}, step=20e-9, duration=60e-6)

    (event,) = fall(rows(bed())).events

    assert event.peak_force == pytest.approx(float(record.peak_force.max()), rel=1e-4)
    assert event.impulse == pytest.approx(20e-9 * float(record.force.sum()), rel=1e-4)


@pytest.mark.parametrize("film", [None, FILM], ids=["dry", "film"])
def test_macro_steps_are_taken_back_with_their_sliders(film):
    """Truth: the same bounces with all steps fine.  A spring drives the mass back to the stop.

    It is stiff enough that macro steps are repeated while the faces rub.
    """
    built = rows(bed(), series=2e-10, film=film, spring=2e6)

    one = fall(built, duration=400e-6, coarse=1)
    many = fall(built, duration=400e-6)

    assert one.steps.flight == 0 < many.steps.flight
    assert many.steps.repeats > 0
    for fine, coarse in zip(one.events[:4], many.events[:4], strict=True):
        assert coarse.peak_force == pytest.approx(fine.peak_force, rel=2e-4)
        assert coarse.time == pytest.approx(fine.time, abs=0.1e-6)
    assert one.events[3].peak_force < 0.9 * one.events[0].peak_force
    for result in (one, many):
        assert result.books.relative_residual < 1e-9
        assert result.books.losses["stop contact"] > 0.0


@pytest.mark.parametrize("name", ["bed", "sticks", "hardly holds"])
def test_any_steps_from_any_state_close_their_books(name):
    """Work is what is stored and lost in each of 2000 steps, and no loss is negative.

    With films or without, with bulk behind, and slips of all kinds.
    """
    law = {
        "bed": bed(count=12),
        "sticks": bed(count=12, ratio=0.7),
        "hardly holds": bed(count=12, ratio=399.0),
    }[name]
    data, rng = law.flat().parameters, np.random.default_rng(5)
    series, g, e, slipped = 2e-10, 1e-6, 0.0, 0.0
    for _ in range(2000):
        film = 10.0 ** rng.uniform(-18.0, -15.0) * rng.integers(2)
        far = 10.0 ** rng.uniform(-15.0, -6.0)
        before = interface_store(LAW_RUBBING, data, 0, series, g, e)
        contact, pull, g1, e1, _, lost, loss = solve_interface(
            LAW_RUBBING,
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
            min(g + rng.choice([-1.0, 1.0]) * far, 2e-6) if g > -6e-6 else g + far,
            e,
            rng.uniform(-10.0, 300.0),
            0,
            0.0,
        )
        rubbed = slide(data, 0, -(g + e), -(g1 + e1))
        after = interface_store(LAW_RUBBING, data, 0, series, g1, e1)
        taken = -(contact + pull) * (g1 - g)
        scale = abs(taken) + before + after + lost + loss
        accepted = 1e-12 * scale + 2e-9 * abs(g1 + e1 - g - e) + 1e-40
        assert taken == pytest.approx(after - before + lost + loss + rubbed, rel=0, abs=accepted)
        assert rubbed >= 0.0
        assert min(lost, loss) > -accepted
        assert contact >= 0.0
        g, e, slipped = g1, e1, slipped + rubbed
    assert (slipped > 0.0) == (law.ratio > 1.0)


@pytest.mark.parametrize("coarse", [1, None], ids=["fine", "macro"])
def test_a_mass_at_rest_holds_still(coarse):
    """Static equilibrium on the closing curve; nothing creeps and nothing is lost in 1 ms."""
    law, force = bed(), 30.0
    result = fall(
        rows(law, force=-force, speed=0.0, gap=0.0),
        duration=1e-3,
        step=100e-9,
        coarse=coarse,
        start="rest",
    )

    depth = -result.channels["stop gap"].values
    assert float(law.force(depth[0])) == pytest.approx(force, rel=1e-9)
    assert depth == pytest.approx(depth[0], rel=1e-9)
    sliders = result.state["laws.stop"]
    pressed = np.maximum(depth[0] - law.onset, 0.0)
    assert sliders == pytest.approx(pressed * (1.0 - 1.0 / law.ratio), rel=1e-8, abs=1e-18)
    assert result.books.losses["stop contact"] < 1e-12 * force * depth[0]


def test_a_mass_that_swings_on_its_seat_loses_nothing_while_the_faces_hold():
    """Truth: a harmonic motion on springs whose sliders all hold.

    A spring and a slider under 30 N, unloaded to 25 N (it slips back at 19 N), then a blow that
    makes it swing by 1 N.
    """
    force, held = 30.0, 5e8 + 8.0 * 5e7
    w = sqrt(held / MASS)
    blow = 1.0 / held * w
    result = fall(
        rows(CONE, force=-force, speed=0.0, gap=0.0, blow=blow),
        duration=250e-6,
        coarse=1,
        record=0.2e-6,
        start="rest",
    )

    assert result.books.losses["stop contact"] == 0.0
    after = result.time >= 201e-6
    t, v = result.time[after], result.channels["mass velocity"].values[after]
    waves = np.stack([np.cos(w * t), np.sin(w * t)], axis=1)
    share, left, *_ = np.linalg.lstsq(waves, v)
    unloading = 5.0 / 200e-6 / held  # [m/s], which ends at once
    assert np.hypot(*share) == pytest.approx(blow, abs=2.0 * unloading)
    assert left[0] < 1e-5 * np.sum(v**2)


def test_a_continued_run_has_the_bits_of_one_in_one_go():
    """The sliders are part of the state: cut while they hold or slip back, at 10.24 us."""
    built, record = rows(bed(), force=-200.0), 1.28e-6
    whole = fall(built, duration=60 * record, record=record)
    first = fall(built, duration=8 * record, record=record)
    assert np.any(first.state["laws.stop"] > 0.0)
    second = fall(built, duration=52 * record, record=record, state=first.state)

    assert len(whole.events) > 1
    for name in ("mass velocity", "stop gap"):
        assert np.array_equal(second.channels[name].values, whole.channels[name].values[8:])
    assert np.array_equal(second.state["laws.stop"], whole.state["laws.stop"])


@pytest.mark.slow
def test_the_bulk_behind_the_faces_takes_nothing_from_a_loop():
    """Faces and bulk in series: the closing curve of the whole, and the loss of its loop."""
    ratio, friction, modal = 4.0, 0.15, 1e-9
    whole = bed(friction=friction, ratio=ratio, count=400)
    depth = np.linspace(0.0, 6e-6, 61)[1:]
    force = whole.force(depth)
    approach = depth + modal * force
    local = LocalLaw(
        law=TableLaw(depth, force),
        force=force,
        approach=approach,
        share=depth / approach,
        tangent_share=np.diff(depth, prepend=0.0) / np.diff(approach, prepend=0.0),
        modal_compliance=modal,
        resolved_force=0.0,
        exponent=1.5,
    )

    def loop(top):
        back = np.linspace(top, 0.0, 401)
        down = whole.along(np.append(0.0, back))[1:]
        up = float(whole.potential(top))
        loss = up + float(np.trapezoid(down, back))
        return Loop(approach=back + modal * down, force=down, loss=loss)

    loops = [loop(share * depth[-1]) for share in (0.5, 0.75, 1.0)]
    D = bulk_compliance(local, rubbing_fit(local, loops).law)
    beside = rubbing_fit(without_bulk(local, D), loops)

    assert D > 0.0
    assert isinstance(beside.law, RubbingLaw)
    for share in (0.3, 0.6, 1.0):
        at = share * depth[-1]
        pressed = float(whole.force(at))
        # springs are straight between their onsets
        assert float(beside.law.force(at - D * pressed)) == pytest.approx(pressed, rel=5e-3)
    for item in loops:
        top = item.approach[0] - (modal + D) * item.force[0]
        path = np.append(np.linspace(0.0, top, 2001), np.linspace(top, 0.0, 2001)[1:])
        lost = float(np.trapezoid(beside.law.along(path), path))
        taken = float(beside.law.potential(top))
        assert lost == pytest.approx(item.loss, abs=0.02 * taken)
    assert lost == pytest.approx(loops[-1].loss, rel=1e-3)


def test_a_restitution_beside_friction_is_refused():
    stop = EndStop(gap=0.0, law={"kind": "consistent"}, restitution=0.9).with_law(bed())
    with pytest.raises(InputError, match="one of them"):
        stop.contact_law()


MASS_STOPS, SPEED_STOPS, GAP_STOPS = 3e-3, 0.8, 5e-6
LOADING, ELASTIC = 1e8, 2.5e8
RATIO = LOADING / ELASTIC


def two_lines(end=20e-6, states=400):
    """Loading along one line and opening along a steeper one."""
    largest = np.linspace(1e-10, end, states)
    return YieldingLaw(
        largest=largest,
        set=largest * (1 - RATIO),
        closing=LOADING * largest,
        shape=np.tile((np.arange(17) / 16) ** 2, (states, 1)),
    )


def rows_stops(
    law, *, series=0.0, film=None, force=None, speed=-SPEED_STOPS, gap=GAP_STOPS, spring=0.0
) -> Rows:
    """A mass above a stop on the ground."""
    stop = EndStop(gap=gap, law={"kind": "linear", "stiffness": 1e9}, film=film)
    parts = {"mass": RigidMass(mass=MASS_STOPS, speed=speed), "stop": stop.with_law(law, series)}
    joints = [["mass.body", "stop.upper"], ["stop.lower", "ground"]]
    if force is not None:
        parts["push"] = ConstantForce(force=force)
        joints[0].append("push.end")
    if spring:
        parts["spring"] = Spring(stiffness=spring, preload=40.0)
        joints[0].append("spring.end")
    fluid = library_fluid("n-heptane").at(293.15) if film else None
    return Network(parts, joints, fluid=fluid).rows()


def fall_stops(built, *, duration=80e-6, step=20e-9, **given):
    return simulate_network(
        built, duration=duration, step=step, **{"record": 1e-6, "start": "free", **given}
    )


def test_a_mass_rebounds_as_the_closed_form_says_stops():
    """Exact: e = sqrt(k1/k2), F = v sqrt(m k1), and what is lost is the rest of the energy."""
    result = fall_stops(rows_stops(two_lines()))

    (event,) = result.events
    assert event.restitution == pytest.approx(sqrt(RATIO), rel=1e-4)
    assert event.peak_force == pytest.approx(SPEED_STOPS * sqrt(MASS_STOPS * LOADING), rel=1e-4)
    assert result.books.relative_residual < 1e-11
    loss = 0.5 * MASS_STOPS * SPEED_STOPS**2 * (1.0 - event.restitution**2)
    assert result.books.losses["stop contact"] == pytest.approx(loss, rel=1e-6)
    assert result.books.stores_after["stop contact"] == 0.0


@pytest.mark.parametrize("film", [None, FILM], ids=["dry", "film"])
def test_macro_steps_are_taken_back_with_their_faces(film):
    """Truth: the same bounces with all steps fine; a spring drives the mass back to the stop."""
    built = rows_stops(two_lines(), series=2e-10, film=film, spring=2e6)

    one = fall_stops(built, duration=400e-6, coarse=1)
    many = fall_stops(built, duration=400e-6)

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
    pressed = fall_stops(
        rows_stops(two_lines(), force=-force, speed=0.0, gap=0.0),
        duration=200e-6,
        coarse=1,
        start="rest",
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

    used = fall_stops(
        rows_stops(elastic, film=FILM, speed=-0.3, gap=GAP_STOPS - set_before), step=10e-9
    )
    new = fall_stops(rows_stops(same, film=FILM, speed=-0.3, gap=GAP_STOPS), step=10e-9)

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


def test_a_continued_run_has_the_bits_of_one_in_one_go_stops():
    """The faces are part of the state: cut after the first impact and within the second."""
    built, record = rows_stops(two_lines(), force=-200.0), 1.28e-6
    whole = fall_stops(built, duration=100 * record, record=record)
    for cut in (8, 40, 61):
        first = fall_stops(built, duration=cut * record, record=record)
        assert first.state["faces.stop"][0] > 1e-6
        second = fall_stops(built, duration=(100 - cut) * record, record=record, state=first.state)
        for name in ("mass velocity", "stop gap"):
            assert np.array_equal(second.channels[name].values, whole.channels[name].values[cut:])
        assert np.array_equal(second.state["faces.stop"], whole.state["faces.stop"])
    assert len(whole.events) > 1


def test_a_restitution_beside_yield_is_refused():
    stop = EndStop(gap=0.0, law={"kind": "consistent"}, restitution=0.9).with_law(two_lines())
    with pytest.raises(InputError, match="together with yield"):
        stop.contact_law()
