"""Magnet and seat act across the axis of a needle that moves in three dimensions.

Truth: the closed permeances and areas of an eccentric or tilted part, at the very placement of a
running needle; the energy of a constant flux; the same needle without these keys where it is
centred.
"""

from math import acos, hypot

import numpy as np
import pytest

from klack.hydraulics.off_axis_seat import SeatFace, flow_area, pressure_load
from klack.magnetics.off_axis_gap import eccentric_ring, guide_ring, tilted_ring_face
from klack.magnetics.solenoid_parts import ArmatureBore
from klack.simulation.network_result import IncompleteRunError
from klack.verification.off_axis import (
    INERTIA,
    MASS,
    held_coil,
    pulled_needle,
    seat_off_axis,
)

pytestmark = pytest.mark.slow

CENTRED = (0.0,) * 6
MIDDLE = ArmatureBore(height=0.0)
RADIUS, OUTER, LENGTH = 5e-3, 5.1e-3, 3.5e-3
FACE = SeatFace(shape="ball", radius=0.884e-3, angle=acos(0.884 / 1.25))


def values(run, name):
    return run.channels[name].values


def test_an_eccentric_needle_gains_the_energy_of_the_ring_at_constant_flux():
    run = pulled_needle(held_coil(MIDDLE), (4e-6, -3e-6, 0, 0, 0, 0), 200e-6)

    flux = values(run, "coil flux")[1:]  # the first one is that of a short step before
    np.testing.assert_allclose(flux, flux[-1], rtol=1e-12)
    e = np.hypot(*run.path.position[:, :2].T)
    P, slope = eccentric_ring(RADIUS, OUTER, LENGTH, e)
    gained = 0.5 * flux[-1] ** 2 * (1.0 / P[0] - 1.0 / P)
    speed = np.hypot(*run.path.velocity[:, :2].T)
    assert e[-1] > 1.5 * e[0]
    # the force of a step is that of its middle: second order in 1.28 us
    np.testing.assert_allclose(0.5 * MASS * speed[1:] ** 2, gained[1:], rtol=3e-5)
    across = np.array([values(run, f"coil side force {a}")[1:] for a in "xy"])
    force = np.hypot(*across)
    np.testing.assert_allclose(force, 0.5 * flux**2 / P[1:] ** 2 * slope[1:], rtol=1e-12)
    # to the nearer side, and along the offset
    np.testing.assert_allclose(across[0] / force, 0.8, rtol=1e-9)
    np.testing.assert_allclose(across[1] / force, -0.6, rtol=1e-9)
    work = run.books.supplies["coil side force"]
    assert work == pytest.approx(0.5 * MASS * speed[-1] ** 2, rel=1e-12)
    assert abs(run.books.relative_residual) < 1e-12


def test_a_tilting_gap_turns_and_does_not_push():
    run = pulled_needle(held_coil(None, tilts=True), (0, 0, 0, 0, 1e-3, 0), 200e-6)

    flux = values(run, "coil flux")[-1]
    tilt = run.path.position[:, 4]
    P, _, slope = tilted_ring_face(2e-3, 3.3e-3, 150e-6, tilt)
    gained = 0.5 * flux**2 * (1.0 / P[0] - 1.0 / P[1:])
    rate = run.path.velocity[1:, 4]
    assert tilt[-1] > 1.2e-3
    np.testing.assert_allclose(0.5 * INERTIA[1] * rate**2, gained, rtol=1e-5)
    moment = values(run, "coil side moment x")
    np.testing.assert_allclose(moment, 0.5 * flux**2 / P**2 * slope, rtol=1e-12)
    for name in ("force x", "force y", "moment y"):
        assert not np.any(values(run, f"coil side {name}"))


@pytest.mark.parametrize("height", [4e-3, -2e-3])
def test_a_ring_beside_the_centre_of_mass_pushes_and_turns(height):
    """Force and moment of a tilted ring, at every record of the run."""
    coil = held_coil(ArmatureBore(height=height))
    run = pulled_needle(coil, (2e-6, 1e-6, 0, 1e-3, 5e-4, 0), 100e-6)

    flux = values(run, "coil flux")[-1]
    for k in (0, 40, -1):
        x, y, _, turn_x, turn_y, _ = run.path.position[k]
        axis = np.array([turn_y, -turn_x])
        place = np.array([x, y]) + height * axis
        P, slopes = guide_ring(RADIUS, OUTER, LENGTH, [*place, *-axis])
        pull = 0.5 * flux**2 / P**2 * slopes
        moment = height * pull[:2] - pull[2:]
        for i, name in enumerate("xy"):
            assert values(run, f"coil side force {name}")[k] == pytest.approx(pull[i], rel=1e-11)
            assert values(run, f"coil side moment {name}")[k] == pytest.approx(moment[i], rel=1e-11)
    # work of the force on the whole motion, translation and rotation
    v = run.path.velocity[-1]
    kinetic = 0.5 * MASS * v[:3] @ v[:3] + 0.5 * INERTIA[0] * v[3:5] @ v[3:5]
    assert run.books.supplies["coil side force"] == pytest.approx(kinetic, rel=1e-10)


def test_a_centred_needle_feels_nothing():
    run = pulled_needle(held_coil(MIDDLE, tilts=True), CENTRED, 50e-6)
    plain = pulled_needle(held_coil(None), CENTRED, 50e-6)

    assert "coil side force x" not in plain.channels
    for name in ("force x", "force y", "moment x", "moment y"):
        assert not np.any(values(run, f"coil side {name}"))
    for name, channel in plain.channels.items():
        np.testing.assert_allclose(values(run, name), channel.values, rtol=1e-12, atol=1e-30)


def test_an_eccentric_bore_pulls_a_centred_needle_to_its_nearer_wall():
    """The wall is nearer on the other side than the axis of the bore."""
    bore = ArmatureBore(height=0.0, eccentricity=20e-6, direction=0.5 * np.pi)
    run = pulled_needle(held_coil(bore), CENTRED, 20e-6)

    flux = values(run, "coil flux")[-1]
    P, slope = eccentric_ring(RADIUS, OUTER, LENGTH, 20e-6)
    assert values(run, "coil side force y")[0] == pytest.approx(
        float(-0.5 * flux**2 / P**2 * slope), rel=1e-12
    )
    assert abs(values(run, "coil side force x")[0]) < 1e-12
    # and the circuit has the permeance of that bore: more flux than with a centred one
    assert flux > 1.002 * values(pulled_needle(held_coil(MIDDLE), CENTRED, 20e-6), "coil flux")[-1]


def test_a_guided_needle_goes_to_the_wall_that_it_is_nearer_to():
    """A negative stiffness against a film, that only slows it: one side, ever further."""
    coil = held_coil(ArmatureBore(height=1.5e-3), current=20.0)  # in the middle of the guide
    run = pulled_needle(coil, (0.8e-6, 0.6e-6, 0, 0, 0, 0), 0.4e-3, guided=True)

    for k in (1, 2):
        x, y = (values(run, f"guide {k} {a}") for a in "xy")
        aside = np.hypot(x, y)
        assert np.all(np.diff(aside) > 0.0)
        assert aside[-1] > 3.6e-6  # of 4 um
        np.testing.assert_allclose(x / aside, 0.8, rtol=1e-3)
    energy = run.books
    v = run.path.velocity[-1]
    kinetic = 0.5 * MASS * v[:2] @ v[:2]  # the film has nearly all of it
    work = energy.supplies["coil side force"]
    assert work == pytest.approx(energy.losses["guide film"] + kinetic, rel=1e-6)
    assert abs(energy.relative_residual) < 1e-12


def test_the_balance_closes_where_the_coil_pulls_along_the_axis_too():
    """Guessed forces are repaired then, and the side force works on that as well."""
    coil = held_coil(ArmatureBore(height=2e-3, eccentricity=20e-6), tilts=True, current=10.0)
    run = pulled_needle(coil, (0, 0, 0, 0, 1e-3, 0), 40e-6, held=False)

    assert values(run, "needle.tip displacement")[-1] > 10e-6
    assert abs(run.books.supplies["coil side force"]) > 1e-6 * run.books.scale
    assert abs(run.books.relative_residual) < 1e-13


def test_an_armature_that_reaches_the_iron_ends_the_run():
    coil = held_coil(MIDDLE)
    with (
        pytest.warns(UserWarning, match="less reluctance"),
        pytest.raises(IncompleteRunError, match="coil: the needle is so far off-axis") as caught,
    ):
        pulled_needle(coil, (90e-6, 0, 0, 0, 0, 0), 400e-6)
    assert caught.value.result.time[-1] > 5e-6


def test_reluctance_that_is_left_out_is_told():
    with pytest.warns(UserWarning, match=r"'coil'.* less reluctance"):
        pulled_needle(held_coil(MIDDLE), (40e-6, 0, 0, 0, 0, 0), 20e-6)


# ---------------------------------------------------------------------- seat


def test_a_seat_in_a_run_has_the_area_and_the_force_of_its_placement():
    run = seat_off_axis((20e-6, -10e-6, 0, 2e-3, 1e-3, 0))

    x, y, rise, turn_x, turn_y, _ = run.path.position[-1]
    at = [60e-6 + rise, x - 6e-3 * turn_y, y + 6e-3 * turn_x, -turn_y, turn_x]
    area = values(run, "restriction area")
    # that of the middle of the last step
    assert area[-1] == pytest.approx(flow_area(FACE, at), rel=1e-7)
    placed = [60e-6, 20e-6 - 6e-6, -10e-6 + 12e-6, -1e-3, 2e-3]
    assert area[0] == pytest.approx(flow_area(FACE, placed), rel=1e-12)
    centred = flow_area(FACE, [60e-6, 0, 0, 0, 0])
    assert abs(area[0] / centred - 1.0) > 1e-4  # so these digits are those of the placement
    push, moment = pressure_load(FACE, at)
    turn = moment - np.cross([at[1], at[2], at[0]], push)
    drop = 101_325.0 - 6.013e5
    for i, name in enumerate("xy"):
        assert values(run, f"restriction side force {name}")[-1] == pytest.approx(
            drop * push[i], rel=1e-9
        )
    about_centre = drop * (-6e-3 * push[:2] + np.array([turn[1], -turn[0]]))
    for i, name in enumerate("xy"):
        assert values(run, f"restriction side moment {name}")[-1] == pytest.approx(
            about_centre[i], rel=1e-9
        )
    # pressure from outside centres
    assert values(run, "restriction side force x")[-1] * at[1] < 0.0
    work = run.books.supplies["restriction side force"]
    v = run.path.velocity[-1]
    across = 0.5 * MASS * v[:2] @ v[:2] + 0.5 * INERTIA[0] * v[3:5] @ v[3:5]
    assert work == pytest.approx(across, rel=1e-9)


def test_a_seat_opens_where_the_needle_is_in_the_middle_of_a_step():
    """A needle that passes at 0.3 m/s: 0.2 um in half a step change these digits."""
    speed = 0.3
    run = seat_off_axis((20e-6, 0, 0, 0, 0, 0), velocity=(speed, 0, 0, 0, 0, 0))

    half = 0.5 * speed * run.sizes.step * run.sizes.coarse
    x = run.path.position[-1, 0] - half
    area = values(run, "restriction area")[-1]
    assert area == pytest.approx(flow_area(FACE, [60e-6, x, 0, 0, 0]), rel=1e-7)
    assert area != pytest.approx(flow_area(FACE, [60e-6, x - half, 0, 0, 0]), rel=1e-6)


def test_a_centred_seat_has_the_flow_of_the_lift_alone():
    ours, plain = seat_off_axis(CENTRED), seat_off_axis(CENTRED, follows=False)

    for name in ("restriction mass flow", "restriction area", "restriction jet force"):
        np.testing.assert_allclose(values(ours, name), values(plain, name), rtol=1e-12)


def test_a_seat_goes_on_from_a_stored_state():
    place = (20e-6, -10e-6, 0, 2e-3, 1e-3, 0)
    whole, first = seat_off_axis(place, duration=20e-6), seat_off_axis(place, duration=10e-6)
    rest = seat_off_axis(place, duration=10e-6, state=first.state)

    np.testing.assert_allclose(
        values(rest, "restriction area")[1:],
        values(whole, "restriction area")[len(first.time) :],
        rtol=1e-12,
    )


def test_the_middle_of_a_seat_lies_on_the_axis_of_the_guide():
    """An offset of the whole placement moves area and force alike, whatever its direction."""
    runs = [seat_off_axis((*offset, 0, 0, 0, 0)) for offset in ((10e-6, 0), (0, -10e-6))]

    areas = [values(run, "restriction area") for run in runs]
    np.testing.assert_allclose(areas[0], areas[1], rtol=1e-12)
    forces = [
        [hypot(*(values(run, f"restriction side force {a}")[k] for a in "xy")) for k in (0, -1)]
        for run in runs
    ]
    np.testing.assert_allclose(forces[0], forces[1], rtol=1e-9)
