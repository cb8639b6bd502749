"""Two bodies that move in three dimensions, and stops between any two of them.

Truth: momentum and its moment of both bodies; the loop along the axis where they are centred; an
independent integrator of the rigid bodies on their springs; the energy balance.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from spatial_needle import move
from two_masses import (
    APART,
    COUNT,
    INERTIAS,
    MASSES,
    STIFFNESS,
    bores,
    model,
    rows,
    sleeve,
    valve,
)

from klack.assembling.spatial import _check_bore
from klack.case.bodies import BodySurface
from klack.case.guide import BodyGuide
from klack.contact.gap_update import Pairing
from klack.errors import AccuracyWarning, InputError
from klack.mechanics.force import ForceOverTime
from klack.mechanics.spring import Spring
from klack.mesh.rigid import rotation_matrix
from klack.transient.guide import ShaftSection

DRIVEN = {
    "needle.top": Spring(stiffness=10e3, preload=12.0),
    "armature.pole": ForceOverTime(time=(0.0, 1e-6, 250e-6, 251e-6), force=(0.0, 45.0, 45.0, 0.0)),
}


def momenta(velocity):
    """Momentum and its moment about the centre of mass of the needle, of each body."""
    v, spin = velocity[:, :3], velocity[:, 3:]
    p = MASSES[:, None] * v
    places = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, APART]])
    return p, INERTIAS * spin + np.cross(places, p)


def test_a_hit_of_one_on_the_other_keeps_momentum_and_its_moment():
    """A tilted needle strikes the armature with its collar; nothing else acts."""
    placed = np.array([0.0, 0.0, 0.0, 2e-4, -4e-4, 0.0])
    speeds = np.array([[0.01, -0.02, -0.5, 1.0, 2.0, 0.5], [0.0, 0.015, 0.1, -1.0, 0.5, 0.0]])
    given = speeds.copy()
    given[:, 2] = 0.0  # the network has it
    run, moving = moved(
        rows({}, speeds=(-0.5, 0.1), apart=1e-3),
        valve(apart=1e-3, placement=placed, velocity=given.ravel()),
        80e-6,
    )
    assert {event.stop for event in run.events} == {"driver"}
    after = np.array([path.velocity[-1] for path in moving.paths])
    change = [
        after_ - before for after_, before in zip(momenta(after), momenta(speeds), strict=True)
    ]
    for part, before in zip(change, momenta(after), strict=True):
        exchanged = np.abs(part).max()
        assert exchanged > 1e-7
        assert np.abs(part.sum(axis=0)).max() < 1e-10 * np.abs(before).max()


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_body_that_slides_on_another_gives_it_what_it_takes(friction):
    """Nothing else touches: the armature rattles on its needle, turns it and brakes it."""
    made = model()
    speeds = np.array([[0.0, 0.0, 0.2, 0.0, 0.0, 0.0], [0.15, -0.1, 0.0, 8.0, 4.0, 2.0]])
    given = speeds.copy()
    given[:, 2] = 0.0
    run, moving = moved(
        rows({}, speeds=(0.2, 0.0), apart=1e-3),
        valve(
            apart=1e-3,
            guide=sleeve(made, friction=friction),
            guided=(1, 1),
            carried=(-1, 0),
            velocity=given.ravel(),
        ),
        100e-6,
        start="free",
    )
    assert not run.events
    assert run.channels["armature guide 1 force"].values.max() > 1.0
    after = np.array([path.velocity[-1] for path in moving.paths])
    for now, before in zip(momenta(after), momenta(speeds), strict=True):
        assert np.abs(now - before).max() > 1e-8
        assert np.abs((now - before).sum(axis=0)).max() < 1e-10 * np.abs(before).max()
    if friction:
        assert after[0, 2] < 0.2  # the armature is dragged along
        assert after[1, 2] > 0.0
        assert run.books.losses["guide friction"] > 1e-3 * run.books.scale
    assert abs(run.books.residual) < 1e-11 * run.books.scale


@pytest.mark.parametrize(("spin", "turns"), [(0.0, False), (60.0, True)])
def test_a_needle_that_turns_has_no_restitution_of_its_centre(spin, turns):
    """Conservation: points are springs, so what the centre gains is what the rotation loses.

    Upright it leaves as fast as it came, but for the steps.  Where it turns it leaves 6.1 times as
    fast as it came.
    """
    speeds = np.array([[0.0, 0.0, -0.02, 0.0, spin, 0.0], np.zeros(6)])
    given = speeds.copy()
    given[:, 2] = 0.0
    run, moving = moved(
        rows({}, speeds=(-0.02, 0.0), apart=1e-6),
        valve(apart=1e-6, velocity=given.ravel()),
        90e-6,
        start="free",
    )

    def energies(velocity):
        v, turn = velocity[:3], velocity[3:]
        return 0.5 * MASSES[0] * v @ v, 0.5 * INERTIAS[0] @ turn**2

    before, after = energies(speeds[0]), energies(moving.paths[0].velocity[-1])
    assert sum(after) == pytest.approx(sum(before), rel=1e-6)
    event = run.events[0]
    assert event.stop == "seat"
    assert event.is_over
    assert (event.besides, np.isnan(event.restitution)) == (
        ("rotation", True) if turns else ("", False)
    )
    if turns:
        assert after[0] == pytest.approx(6.1**2 * before[0], rel=2e-2)
        assert np.isnan(event.energy_loss)
    else:
        assert event.restitution == pytest.approx(1.0, abs=2e-3)


def test_a_run_in_pieces_knows_what_went_into_rotation_before():
    """Cut at 0.9 of the contact: what rotation gives after that would not blank the impact."""
    velocity = np.zeros((2, 6))
    velocity[0, 4] = 4.0

    def run(duration, **more):
        network = rows({}, speeds=(-0.02, 0.0), apart=1e-6)
        return move(network, valve(apart=1e-6, velocity=velocity.ravel()), duration, **more)

    (whole,) = run(90e-6, start="free").events
    cut = 1e-6 * round(1e6 * (0.1 * whole.time + 0.9 * whole.separation_time))
    (found,) = run(90e-6 - cut, state=run(cut, start="free").state).events
    assert (found.time, found.besides, whole.besides) == (whole.time, "rotation", "rotation")
    assert np.isnan(found.restitution)


def sections(radius):
    return [ShaftSection(np.zeros((6, 1)), np.array([0.0, 0.0, 2e-3]), radius, None)]


def bore(on, clearance=10e-6):
    """Compare a guide with its drawing, a shaft of 1.5 mm in a bore that is wider by ``on``."""
    guide = BodyGuide(
        surface="bore",
        heights=(1e-3, 2e-3),
        clearance=clearance,
        on=BodySurface(body="needle", surface="shaft"),
    )
    _check_bore("armature", guide, sections(1.5e-3 + on), ("needle", sections(1.5e-3)))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("on", [10e-6, 10.9e-6, 0.0, 1e-7, -1e-7])
def test_a_bore_may_be_drawn_as_wide_as_it_is_or_as_its_shaft(on):
    """To a tenth of the gap, or a ten thousandth of the radius, which meshes are off by."""
    bore(on)


def test_a_bore_that_is_narrower_than_its_shaft_is_refused():
    with pytest.raises(InputError, match=r"1\.4 mm and 1\.5 mm, as drawn"):
        bore(-0.1e-3)


@pytest.mark.parametrize("on", [5e-6, 0.1e-3])
def test_a_clearance_that_is_not_the_drawn_gap_is_told(on):
    with pytest.warns(
        AccuracyWarning, match=r"clearance is 10 um in the run, but .* as .* are drawn"
    ):
        bore(on)


def moved(network, spatial, duration, **more):
    """The run, and its bodies."""
    kept = []

    class Told:
        def of(self, *args):
            kept.append(spatial.of(*args))
            return kept[-1]

    run = move(network, Told(), duration, **more)
    return run, kept[0]


def test_what_moves_as_one_does_not_move_against_each_other():
    """One rigid motion of both bodies leaves none between them; small ones have these slopes."""
    lever = np.array([1e-3, -2e-3, 4e-3])
    pair = Pairing(1, 0, lever)
    turn = np.array([1e-2, -2e-2, 5e-3])
    shift = np.array([1e-4, 2e-4, -3e-4])
    moved_on = shift + rotation_matrix(turn) @ lever - lever
    both = np.array([[*shift, *turn], [*moved_on, *turn]])
    np.testing.assert_allclose(pair.relative(both), 0.0, atol=1e-17)

    slopes = pair.slopes(2)
    for k, way in enumerate(1e-6 * np.eye(12)):
        ends = [pair.relative(sign * way.reshape(2, 6)) for sign in (1.0, -1.0)]
        np.testing.assert_allclose((ends[0] - ends[1]) / 2e-6, slopes[:, k], atol=1e-9)


@pytest.mark.slow
def test_a_centred_stroke_is_the_axial_one():
    """Equal springs under rings: the law along the axis is their sum."""
    runs = [move(rows(DRIVEN), v, 900e-6, step=5e-9) for v in (None, valve(guide=bores(model())))]

    axial, spatial = (run.events for run in runs)
    assert [event.stop for event in axial[:4]] == [event.stop for event in spatial[:4]]
    assert {event.stop for event in axial} == {"seat", "driver", "stop"}
    for one, other in zip(axial[:3], spatial[:3], strict=True):
        assert other.time == pytest.approx(one.time, abs=50e-9)
        assert other.peak_force == pytest.approx(one.peak_force, rel=1e-3)
        assert other.restitution == pytest.approx(one.restitution, abs=1e-3)
    for name in ("needle x", "armature x", "needle tilt y", "armature tilt y"):
        assert np.abs(runs[1].channels[name].values).max() < 1e-11, name


def test_a_tilted_chain_is_that_of_another_integrator():
    """Driver and stop carry at the same time, both bodies off their axes, by DOP853.

    Second order in the step: 20 times less at 2.5 than at 10 ns.
    """
    made = model(apart=20e-6)
    placed = np.array([[0, 0, 0, 1e-4, -2e-4, 0], [0, 0, 0, -2e-4, 1e-4, 0.0]])
    speeds = np.array([[0, 0, 0.3, 0, 0, 0], [0, 0, 0.9, 0, 0, 0]])
    run, moving = moved(
        rows({}, speeds=(0.3, 0.9), apart=20e-6),
        valve(apart=20e-6, placement=placed.ravel()),
        150e-6,
        step=5e-9,
        start="free",
    )
    q0, v0 = (
        np.concatenate(
            [
                np.linalg.solve(body.rigid[:, made.rigid_of(body.number)], here)
                for body, here in zip(made.moving, given, strict=True)
            ]
        )
        for given in (placed, speeds)
    )

    def rates(_, y):
        force = STIFFNESS * np.maximum(-(made.gap + made.traces @ y[:12]), 0.0)
        return np.concatenate([y[12:], made.traces.T @ force])

    end = moving.path.time[-1]
    truth = solve_ivp(
        rates, (0, end), np.concatenate([q0, v0]), "DOP853", rtol=1e-11, atol=1e-16,
        max_step=20e-9, dense_output=True,
    )  # fmt: skip
    at = truth.sol(np.linspace(0, end, 30001))
    force = STIFFNESS * np.maximum(-(made.gap[:, None] + made.traces @ at[:12]), 0.0)
    assert [event.stop for event in run.events] == ["driver", "stop"]
    for k, stop in enumerate(("driver", "stop")):
        peak = force[(k + 1) * COUNT : (k + 2) * COUNT].sum(axis=0).max()
        assert run.interfaces[stop].contact_force.max() == pytest.approx(peak, rel=1e-5), stop
    for body, path in zip(made.moving, moving.paths, strict=True):
        off = path.position[-1] - body.rigid @ truth.y[:12, -1]
        assert np.abs(off[:3]).max() < 2e-11
        assert np.abs(off[3:]).max() < 1e-9
    assert abs(run.books.residual) < 1e-11 * run.books.scale


@pytest.mark.slow
@pytest.mark.parametrize("coarse", [1, None])
def test_energy_of_a_leaning_stroke_closes(coarse):
    made = model()
    placed = np.array([[1e-7, -5e-8, 0, 2e-5, 3e-5, 0], [1e-7, 1e-7, 0, -1e-4, 1e-4, 0.0]])
    run = move(
        rows(DRIVEN, arms=(1e-4, 2e-4)),
        valve(placement=placed.ravel(), guide=bores(made, friction=0.1), guided=(0, 0, 1, 1)),
        1200e-6,
        coarse=coarse,
    )
    assert {event.stop for event in run.events} == {"seat", "driver", "stop"}
    assert run.channels["armature guide 1 force"].values.max() > 0.1
    assert abs(run.books.residual) < 1e-10 * run.books.scale
