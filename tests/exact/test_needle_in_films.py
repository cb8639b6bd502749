"""A rigid needle that lands in a film, eccentric; truth: energy, convergence, the axial stroke."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from klack.magnetics.solenoid_parts import ArmatureBore
from klack.magnetics.voltage_step import VoltageStep
from klack.transient.gap_course import gap_course
from klack.transient.spatial_run import SpatialValve
from klack.transient.tilting_film import BearingFilm
from klack.verification.interface_bodies import lateral_guide
from klack.verification.off_axis import (
    FACE,
    INERTIA,
    MASS,
    film_of,
    fly_in_films,
    fly_in_network,
    guide_of,
    held_coil,
    needle_on_cone,
    needle_on_ring,
)

pytestmark = pytest.mark.slow

ROW = FACE.film_row(4e-4, 3.0)
BULK = 4e-9  # [m/N] of the 1e-8 of the springs
STEP = 20e-9


def coordinates(*rigid):
    return np.array(rigid) * np.sqrt([MASS] * 3 + list(INERTIA))


def land(*, lean, step=STEP, series=BULK, sectors=36, speed=1.0, duration=26e-6):
    model = needle_on_ring(4e-6)
    q = coordinates(0.0, 0.0, 0.0, lean, 0.5 * lean, 0.0)
    v = coordinates(0.0, 0.0, -speed, 0.0, 0.0, 0.0)
    options = {"step": step, "steps": round(duration / step), "series": series}
    return v, fly_in_films(model, ROW, q, v, sectors=sectors, **options)


@pytest.mark.parametrize("series", [0.0, BULK])
@pytest.mark.parametrize("lean", [0.0, 2e-4, 8e-4])
@pytest.mark.parametrize("duration", [8e-6, 12e-6, 26e-6])
def test_energy_of_a_landing(lean, series, duration):
    """Conservation: before, in and after the contact, with the bulk that both share."""
    v, ended = land(lean=lean, series=series, duration=duration)
    before = 0.5 * v @ v
    after = 0.5 * ended.v @ ended.v + ended.lost + ended.held - ended.owed
    assert after == pytest.approx(before, rel=1e-11)
    assert abs(ended.owed) < 1e-4 * before
    assert ended.lost > 0.1 * before
    assert np.any(ended.force > 0.0) or duration < 10e-6


@pytest.mark.parametrize(("series", "bound"), [(0.0, 2e-5), (BULK, 5e-3)])
def test_a_landing_converges_with_the_step(series, bound):
    """Convergence: order 1, since film and contact change places within a step.

    With a bulk some sectors close again at the release while others open: what is left is jitter.
    """
    _, finest = land(lean=4e-4, step=STEP / 16, series=series)
    errors = [
        np.abs(land(lean=4e-4, step=STEP / n, series=series)[1].v - finest.v).max()
        / np.abs(finest.v).max()
        for n in (1, 4)
    ]
    assert max(errors) < bound
    assert series > 0.0 or errors[1] < 0.4 * errors[0]


def test_sectors_converge():
    """Convergence: 36 sectors within 0.5 % of 144, as the table of the issue of lands says."""
    _, many = land(lean=8e-4, sectors=144)
    _, some = land(lean=8e-4, sectors=36)
    np.testing.assert_allclose(some.v, many.v, atol=5e-3 * np.abs(many.v).max())


def test_a_film_rights_a_needle_that_leans():
    """Symmetry: two leans that mirror each other end mirrored, and the film turns them back."""
    model = needle_on_ring(8e-6)
    v = coordinates(0.0, 0.0, -1.0, 0.0, 0.0, 0.0)
    ends = [
        fly_in_films(
            model, ROW, coordinates(0.0, 0.0, 0.0, lean, 0.0, 0.0), v, step=STEP, steps=300
        )
        for lean in (5e-4, -5e-4)
    ]
    np.testing.assert_allclose(ends[0].v[3], -ends[1].v[3], rtol=1e-9)
    np.testing.assert_allclose(ends[0].v[2], ends[1].v[2], rtol=1e-12)
    assert ends[0].v[3] < 0.0  # against the lean


def valve(*, placement=None, guide=False, curved=0.0):
    """Needle over its stop; the gaps grow with the square of its shift, times ``curved`` [1/m]."""
    model = needle_on_ring(20e-6)

    def gaps(at):
        return model.gap + model.traces @ coordinates(*at) + curved * at[0] ** 2

    return SpatialValve(
        model=model,
        components=("needle",),
        stops=("contact",),
        films=(film_of(model),),
        gaps=gaps if curved else None,
        guide=guide_of(model, friction=0.1) if guide else None,
        placement=np.zeros(6) if placement is None else placement,
        arms=np.array([[0.0, 0.0, -6e-3]]),
    )


def test_points_without_a_face_do_not_tilt_a_film():
    """Exact: where nothing faces a point its gap is some millimetres, which is no height of a film.

    The needle moves aside, a point at the edge has no face any more; it would never touch.
    """
    kind = {"gap": 20e-6, "speed": -0.5, "duration": 34e-6, "wet": True}
    needle = valve(placement=np.array([1e-6, 0.0, 0.0, 0.0, 0.0, 0.0]), curved=1e-9)

    def lost(at):
        gaps = needle.gaps(at)
        gaps[3] = 5e-3
        return gaps

    results = [fly_in_network(each, {}, **kind) for each in (needle, replace(needle, gaps=lost))]

    for name in ("needle tilt x", "needle tilt y"):
        np.testing.assert_allclose(results[1].channels[name].values, 0.0, atol=1e-9)
    forces = [each.channels["contact film force"].values for each in results]
    assert np.max(forces[0]) > 1.0
    np.testing.assert_allclose(forces[1], forces[0], rtol=1e-6)


def test_gaps_follow_the_placement_along_their_slopes():
    """Exact: lines that meet an inclined face; the needle drifts aside, 0.05 and 0.5 m/s."""
    needle = valve(placement=np.zeros(6), curved=1e-9)

    def inclined(at):
        return needle.gaps(at) + 0.05 * at[0]

    drifting = replace(
        needle, films=(), gaps=inclined, velocity=np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.0])
    )
    found = fly_in_network(drifting, {}, gap=20e-6, speed=-0.5, duration=60e-6)

    # gaps are as of the last record: by 0.04 um, 0.08 us
    assert found.events[0].time == pytest.approx(20e-6 / (0.5 - 0.05 * 0.2), abs=0.08e-6)


def test_slopes_of_gaps_are_those_of_the_function():
    """Exact: quadratic gaps; a gap that jumps has none."""
    random = np.random.default_rng(0)
    scale = np.repeat([1.0, 0.01], 3)
    slopes, bends = (
        random.normal(size=(4, 6)) * scale,
        1e3 * random.uniform(0.5, 1.0, (4, 6)) * scale**2,
    )

    def gaps(at):
        told = 1e-5 + slopes @ at + 0.5 * bends @ at**2
        told[3] = 1e-2 if at[1] > 0.0 else 1e-5
        return told

    course = gap_course(gaps, 0.01)

    np.testing.assert_allclose(course.slopes[:3], slopes[:3], rtol=1e-6)
    np.testing.assert_allclose(course.bends[:3], bends[:3], rtol=1e-3)
    np.testing.assert_array_equal(course.slopes[3], 0.0)
    moved = np.array([3e-6, 0.0, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(course.left(moved)[:3], 9e-12 * bends[:3, 0], rtol=1e-3)


def test_centred_and_wet_as_along_the_axis():
    """Reference: the loop along the axis, with the film of parallel faces."""
    kind = {"gap": 20e-6, "speed": -0.5, "duration": 120e-6, "wet": True}
    axial = fly_in_network(None, {}, **kind)
    space = fly_in_network(valve(), {}, **kind)
    pushed = []
    for result in (axial, space):
        record = result.interfaces["contact"]
        lost = result.books.losses["contact film"]
        pushed.append((np.sum(record.contact_force * record.step), lost))
    assert pushed[1][0] == pytest.approx(pushed[0][0], rel=1e-7)
    assert pushed[1][1] == pytest.approx(pushed[0][1], rel=2e-5)
    # the film alone presses until the end of the step in which the faces touch
    assert space.events[0].restitution == pytest.approx(axial.events[0].restitution, abs=4e-3)
    assert space.events[0].time == pytest.approx(axial.events[0].time, abs=0.02e-6)
    assert abs(space.books.relative_residual) < 1e-11


@pytest.mark.parametrize("half_angle", [0.5 * pi, 0.25 * pi])
def test_recorded_gaps_before_the_touch_are_those_of_the_bodies(half_angle):
    """Exact: the gap of the axial network, also where no point is looked at yet, and on a cone."""
    model = needle_on_cone(half_angle, 0.1, stiffer=0.8, gap=20e-6)
    film = replace(film_of(model), slope=np.sin(half_angle))
    needle = replace(valve(), model=model, films=(film,))
    run = fly_in_network(needle, {}, gap=20e-6, speed=-0.5, duration=50e-6, wet=True)
    record, touch = run.interfaces["contact"], run.events[0].time
    falling = record.time + record.step < touch
    assert np.count_nonzero(falling) > 20
    end = record.time[falling] + record.step[falling]
    gap = np.interp(end, run.time, run.channels["contact gap"].values)
    assert gap.max() > 2e-6
    np.testing.assert_allclose(record.gap[falling], gap, atol=15e-9)  # of 20 ns


def test_energy_of_a_wet_eccentric_run():
    """Conservation: film, guide with friction and many contacts."""
    placement = np.array([0.5e-6, 0.0, 0.0, 0.0, 3e-4, 0.0])
    found = fly_in_network(
        valve(placement=placement, guide=True), {}, gap=20e-6, speed=-0.5, duration=300e-6, wet=True
    )
    assert abs(found.books.relative_residual) < 1e-10
    assert found.books.losses["contact film"] > 1e-5
    assert found.events


@pytest.mark.parametrize("first", [30e-6, 46e-6, 100e-6])
def test_a_wet_run_in_two_parts_is_the_same(first):
    """Exact: cut in flight, in the contact and after it."""
    placement = np.array([0.5e-6, 0.0, 0.0, 0.0, 3e-4, 0.0])
    kind = {"gap": 20e-6, "speed": -0.5, "wet": True}
    needle = valve(placement=placement, curved=1e5)
    whole = fly_in_network(needle, {}, duration=160e-6, **kind)
    begun = fly_in_network(needle, {}, duration=first, **kind)
    rest = fly_in_network(needle, {}, duration=160e-6 - first, state=begun.state, **kind)
    both = np.isin(np.round(rest.time * 1e9), np.round(whole.time * 1e9))
    again = np.isin(np.round(whole.time * 1e9), np.round(rest.time * 1e9))
    assert np.sum(both) > 20
    for name in ("needle x", "needle tilt x", "needle.tip displacement"):
        true, same = whole.channels[name].values, rest.channels[name].values
        moved = np.abs(true - true[0]).max()
        np.testing.assert_allclose(same[both], true[again], rtol=0.0, atol=1e-9 * moved)


def test_a_shaft_that_is_pressed_into_the_wall_keeps_the_film_of_its_guide():
    """A magnet presses harder than the roughness: the film is squeezed along the wall alone.

    A search with the slopes of a shaft that goes on outwards found no forces at 10 us.
    """
    model, current = needle_on_ring(1e-2), 60.0
    bore = ArmatureBore(height=5e-3, eccentricity=40e-6, direction=pi)
    coil = held_coil(bore, current=current)
    guide = lateral_guide(
        model,
        clearance=4e-6,
        stiffness=1e7,
        heights=(-2e-3, 5e-3),
        offset=((0.0, 0.0), (0.0, 0.0)),
        friction=0.0,
        radius=1.5e-3,
    )
    valve = SpatialValve(
        model=model,
        components=("needle",),
        stops=("contact",),
        arms=np.array([[0.0, 0.0, -6e-3]]),
        placement=np.array([3e-6, 0.0, 0.0, 0.0, 0.0, 0.0]),
        guide=guide,
        bearing=BearingFilm(length=1.5e-3, cut_off=0.3e-6),
    )

    run = fly_in_network(
        valve,
        {"coil": coil, "driver": VoltageStep(voltage=coil.resistance * current, end=1.0)},
        joints=(("coil.armature", "ground"), ("coil.terminals", "driver.terminals")),
        gap=1e-2,
        wet=True,
        film=False,
        duration=15e-6,
    )

    aside = run.channels["guide 2 x"].values[-1]
    assert aside > 4.3e-6  # clearance and roughness
    assert run.channels["guide 2 force"].values[-1] == pytest.approx(1e7 * (aside - 4e-6), rel=0.02)
    assert abs(run.books.relative_residual) < 1e-12
