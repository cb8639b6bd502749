"""Off-axis seat; truth: shortest lines by search, mantles of triangles, integrals."""

import itertools
from math import acos, cos, pi, sin, tan

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import minimize

from klack.errors import InputError
from klack.hydraulics.off_axis_seat import (
    SeatFace,
    edge_gap,
    flow_area,
    flow_area_slopes,
    pressure_load,
    ring_opening,
)
from klack.hydraulics.seat import Seat, ball_opening, cone_opening, flat_opening

RADIUS, ANGLE = 0.75e-3, 0.8
FACES = {
    "flat": SeatFace(shape="flat", radius=RADIUS),
    "cone": SeatFace(shape="cone", radius=RADIUS, angle=ANGLE),
    "ball": SeatFace(shape="ball", radius=RADIUS, angle=ANGLE),
}
PLACE = np.array([60e-6, 8e-6, -3e-6, 2e-3, 1e-2])
BALL, HEIGHT = RADIUS / cos(ANGLE), RADIUS * tan(ANGLE)

every_face = pytest.mark.parametrize("face", FACES.values(), ids=FACES)


def centred(face, lift):
    if face.shape == "flat":
        return flat_opening(lift, RADIUS)
    if face.shape == "cone":
        return cone_opening(lift, RADIUS, sin(ANGLE), cos(ANGLE))
    return ball_opening(lift, RADIUS, BALL, HEIGHT)


def axes(place):
    """Point of the needle's axis, and three directions with the axis last."""
    axis = np.array([-place[3], -place[4], 1.0])
    axis /= np.linalg.norm(axis)
    across = np.cross(axis, [0.3, 0.7, 0.1])
    across /= np.linalg.norm(across)
    return np.array([place[1], place[2], place[0]]), across, np.cross(axis, across), axis


def on_face(face, place, a, b):
    """Point of the needle's face with two coordinates, in edge radii or radians."""
    point, u, v, axis = axes(place)
    if face.shape == "flat":
        return point + RADIUS * (a * u + b * v)
    if face.shape == "ball":
        sphere = np.array([a, b, -np.sqrt(1.0 - a * a - b * b)])
        return point + HEIGHT * axis + BALL * (sphere @ np.array([u, v, axis]))
    rho = np.hypot(a, b)  # the cone over its own plane
    return point + RADIUS * (a * u + b * v) + RADIUS * (rho - 1.0) / tan(ANGLE) * axis


def edge(phi):
    return RADIUS * np.stack((np.cos(phi), np.sin(phi), 0.0 * phi), axis=-1)


@pytest.mark.parametrize("lift", [1e-9, 1e-6, 60e-6, 300e-6])
@every_face
def test_centred_seat_is_the_present_one(face, lift):
    area, gap = centred(face, lift)
    place = [lift, 0.0, 0.0, 0.0, 0.0]

    assert flow_area(face, place) == pytest.approx(area, rel=1e-12, abs=0.0)
    assert edge_gap(face, place, [0.3, 2.0]) == pytest.approx([gap, gap], rel=1e-12, abs=0.0)


@every_face
def test_gap_is_the_shortest_distance(face):
    for phi in (0.0, 1.0, 2.5, 4.0):
        start = edge(np.array(phi))
        u, v = axes(PLACE)[1:3]
        scale = cos(ANGLE) if face.shape == "ball" else 1.0

        def distance(at, start=start):
            return np.sum((on_face(face, PLACE, *at) - start) ** 2) / RADIUS**2

        found = minimize(
            distance, scale * np.array([u @ start, v @ start]) / RADIUS, tol=1e-14, method="BFGS"
        )

        gap = edge_gap(face, PLACE, [phi])[0]

        assert gap == pytest.approx(RADIUS * np.sqrt(found.fun), rel=1e-11, abs=0.0)


def feet(face, place, phi):
    """Ends of the shortest lines: gap times its gradient with a motion of the edge."""
    small, lines = 1e-8, np.empty((phi.size, 3))
    for k, way in enumerate(np.eye(3)):
        move = small * np.array([way[2], way[0], way[1], 0.0, 0.0])
        lines[:, k] = edge_gap(face, place + move, phi) - edge_gap(face, place - move, phi)
    lines /= 2.0 * small
    return edge(phi) + edge_gap(face, place, phi)[:, None] * lines


@pytest.mark.parametrize("place", [PLACE, np.array([300e-6, 40e-6, 20e-6, 0.1, -0.05])])
@every_face
def test_area_is_that_of_the_mantle_of_triangles(face, place):
    phi = 2.0 * pi / 4000 * np.arange(4000)
    start, end = edge(phi), feet(face, place, phi)
    rings = [start + s * (end - start) for s in np.linspace(0.0, 1.0, 21)]
    mantle = 0.0
    for low, high in itertools.pairwise(rings):
        next_low, next_high = np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)
        lower = np.cross(next_low - low, high - low)
        upper = np.cross(next_low - next_high, high - next_high)
        mantle += 0.5 * np.linalg.norm(lower, axis=1).sum()
        mantle += 0.5 * np.linalg.norm(upper, axis=1).sum()

    # chords of 4000 angles: 4e-7
    assert flow_area(face, place) == pytest.approx(mantle, rel=1e-6, abs=0.0)
    assert flow_area(face, place) == pytest.approx(flow_area(face, place, angles=720), rel=1e-12)


@pytest.mark.parametrize("place", [PLACE, np.array([1e-6, 2e-6, 1e-7, 0.0, 0.0])])
@every_face
def test_slopes_of_the_area(face, place):
    slopes = flow_area_slopes(face, place)
    for k, step in enumerate((1e-9, 1e-9, 1e-9, 1e-6, 1e-6)):
        move = step * np.eye(5)[k]
        rise = flow_area(face, place + move) - flow_area(face, place - move)

        # round-off of the difference; an open flat face has no area from a small offset
        least = 1e-8 * RADIUS * (1.0 if k < 3 else RADIUS)
        assert slopes[k] == pytest.approx(rise / (2.0 * step), rel=1e-6, abs=least)


@pytest.mark.parametrize("shape", ["cone", "ball"])
def test_offset_changes_the_area_in_second_order_only(shape):
    change = [
        flow_area(FACES[shape], [60e-6, e, 0.0, 0.0, 0.0]) - centred(FACES[shape], 60e-6)[0]
        for e in (2e-6, 4e-6)
    ]

    assert change[1] / change[0] == pytest.approx(4.0, rel=1e-4)
    # pi e^2 / R is the size of it
    assert abs(change[1]) < pi * (4e-6) ** 2


@pytest.mark.parametrize("lift", [0.3e-6, 1.0e-6, 1.5e-6])
@pytest.mark.parametrize("shape", ["cone", "ball"])
def test_overlap_on_one_side_follows_the_closed_form(shape, lift):
    e, t = 1e-6, 2e-4
    swing = RADIUS * t * sin(ANGLE) - e * cos(ANGLE)
    closed = ring_opening(lift * sin(ANGLE), swing, RADIUS)
    place = [lift, e, 0.0, t, 0.0]

    # what is left is of the second order, gap over radius: 1e-3
    assert flow_area(FACES[shape], place, angles=1440) == pytest.approx(closed, rel=2e-3)
    exact = flow_area(FACES[shape], place, angles=20160)
    errors = [flow_area(FACES[shape], place, angles=n) / exact - 1.0 for n in (72, 1440)]
    assert abs(errors[0]) < 1e-3
    assert abs(errors[1]) < 5e-6


@pytest.mark.parametrize("mean", [-2.0, -0.9, -0.2, 0.0, 0.6, 1.0, 3.0])
def test_ring_opening_is_the_integral_of_the_positive_gap(mean):
    last = acos(min(max(-mean, -1.0), 1.0))
    integral = 2.0 * quad(lambda phi: 2.0 * (mean + cos(phi)), 0.0, last)[0]

    assert ring_opening(mean, 1.0, 2.0) == pytest.approx(integral, rel=1e-12, abs=1e-14)
    assert ring_opening(mean, -1.0, 2.0) == ring_opening(mean, 1.0, 2.0)
    assert ring_opening(mean, 0.0, 2.0) == pytest.approx(4.0 * pi * max(mean, 0.0), abs=1e-15)


@every_face
def test_pressure_of_the_centred_seat_acts_along_the_axis(face):
    lift = 60e-6
    area, gap = centred(face, lift)
    foot = area / (pi * gap) - RADIUS  # mantle of mean radius (r + foot)/2

    force, moment = pressure_load(face, [lift, 0.0, 0.0, 0.0, 0.0])

    assert force[2] == pytest.approx(pi * foot**2, rel=1e-12)
    assert force[:2] == pytest.approx([0.0, 0.0], abs=1e-15 * RADIUS**2)
    assert moment == pytest.approx([0.0, 0.0, 0.0], abs=1e-15 * RADIUS**3)


@every_face
def test_pressure_presses_normal_to_the_face(face):
    """Pressure on a plane has no force along it, on a ball no moment about its centre."""
    force, moment = pressure_load(face, PLACE)
    point, *_, axis = axes(PLACE)

    assert moment @ axis == pytest.approx((np.cross(point, force)) @ axis, abs=1e-14 * RADIUS**3)
    if face.shape == "flat":
        assert np.cross(force, axis) == pytest.approx(np.zeros(3), abs=1e-14 * RADIUS**2)
    if face.shape == "ball":
        centre = point + HEIGHT * axis
        assert moment == pytest.approx(np.cross(centre, force), rel=1e-9, abs=1e-14 * RADIUS**3)


@pytest.mark.slow
@every_face
def test_pressure_is_the_integral_over_the_face(face):
    """The part of the face within the feet, in strips from the middle of the needle outwards."""
    phi = 2.0 * pi / 90 * np.arange(90)
    point, u, v, axis = axes(PLACE)
    rim = feet(face, PLACE, phi) - point
    if face.shape == "ball":
        rim = (rim - HEIGHT * axis) / BALL
    else:
        rim = rim / RADIUS
    a, b = rim @ u, rim @ v
    nodes, weights = np.polynomial.legendre.leggauss(12)
    force = np.zeros(3)
    turn = 1j * np.fft.rfftfreq(90, 1 / 90)
    da, db = (np.fft.irfft(turn * np.fft.rfft(x), 90) for x in (a, b))
    for s, w in zip(0.5 * (1.0 + nodes), 0.5 * weights, strict=True):
        small = 1e-6
        for k in range(90):
            at = np.array([s * a[k], s * b[k]])
            slope_a, slope_b = (
                (on_face(face, PLACE, *(at + d)) - on_face(face, PLACE, *(at - d))) / (2 * small)
                for d in small * np.eye(2)
            )
            jacobian = s * (a[k] * db[k] - b[k] * da[k])
            force += w * 2.0 * pi / 90 * jacobian * np.cross(slope_a, slope_b)

    # numerical feet and tangents
    assert pressure_load(face, PLACE)[0] == pytest.approx(force, rel=1e-6, abs=1e-8 * RADIUS**2)


@every_face
def test_pressure_from_outside_centres_an_offset_needle(face):
    e, t, angle = 1e-9, 1e-6, face.angle
    offset = pressure_load(face, [1e-6, e, 0.0, 0.0, 0.0])[0][0]
    tilted = pressure_load(face, [1e-6, 0.0, 0.0, 0.0, t])[0][1]

    # next order: the gap over the radius, 1e-3
    expected = pi * RADIUS * e * cos(angle) * sin(angle) if face.shape != "flat" else 0.0
    assert offset == pytest.approx(expected, rel=3e-3, abs=1e-20)
    assert tilted == pytest.approx(-pi * RADIUS**2 * t * sin(angle) ** 2, rel=3e-3)


def test_face_of_a_seat_of_a_case():
    ball = SeatFace.of(Seat(shape="ball", diameter=2 * RADIUS, ball_diameter=2 * BALL))

    assert ball.angle == pytest.approx(ANGLE)
    assert ball.radius == RADIUS
    assert SeatFace.of(Seat(shape="flat", diameter=1e-3)) == SeatFace(shape="flat", radius=0.5e-3)


@pytest.mark.parametrize(
    ("face", "name"),
    [
        ({"shape": "flat", "radius": RADIUS, "angle": 0.5}, "angle"),
        ({"shape": "cone", "radius": RADIUS}, "angle"),
        ({"shape": "ball", "radius": RADIUS, "angle": float("nan")}, "angle"),
        ({"shape": "ball", "radius": 0.0, "angle": 0.5}, "radius"),
    ],
)
def test_bad_faces(face, name):
    with pytest.raises(InputError, match=name):
        SeatFace(**face)


def test_too_few_angles():
    with pytest.raises(InputError, match="at least 8"):
        flow_area(FACES["cone"], PLACE, angles=4)


@pytest.mark.parametrize("place", [[1e-6, 0.0], [float("nan"), 0.0, 0.0, 0.0, 0.0], [[0.0] * 5]])
def test_bad_placements(place):
    for law in (flow_area, flow_area_slopes, pressure_load):
        with pytest.raises(InputError, match="five numbers"):
            law(FACES["flat"], place)
