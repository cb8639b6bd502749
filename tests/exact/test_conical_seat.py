"""Seats of cones, on their axis and off it.

A needle edge on a cone; truth: a search of random contours, and the page of the double seat.

Off-axis seat; truth: shortest lines by search, mantles of triangles, integrals.
"""

import itertools
import re
from math import acos, cos, hypot, pi, radians, sin, tan

import numpy as np
import pytest
from pages import HOW_TO, numbers, printed, require_parts, run_of
from scipy.integrate import quad
from scipy.optimize import minimize

from klack.errors import InputError
from klack.hydraulics.conical_seat import ConicalSeat
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.off_axis_seat import (
    SeatFace,
    edge_gap,
    flow_area,
    flow_area_slopes,
    pressure_load,
    ring_opening,
)
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.hydraulics.seat import Seat, ball_opening, cone_opening, flat_opening
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.network.rows import Ambient

PAGE = (HOW_TO / "double-seat.md").read_text(encoding="utf-8")
OIL = library_fluid("ISO VG 46").at(313.15)
EDGE = {
    "half_angle": radians(30),
    "lower_diameter": 1e-3,
    "upper_diameter": 2.4e-3,
    "edge_diameter": 2e-3,
    "tip_half_angle": radians(40),
}


def random_part(rng, kind):
    seat = rng.uniform(15, 70)
    tip, shank = rng.uniform(seat + 0.5, 90), rng.choice([0.0, rng.uniform(0, seat - 0.5)])
    lower = rng.uniform(0.4e-3, 1.6e-3)
    keys = {
        "sharp": {},
        "rounded": {"edge_radius": rng.uniform(10e-6, 60e-6)},
        "chamfered": {
            "chamfer_half_angle": radians(rng.uniform(shank, tip)),
            "chamfer_width": 50e-6,
        },
        "blunt": {"tip_diameter": 0.8 * lower},
    }[kind]
    return ConicalSeat(
        half_angle=radians(seat),
        lower_diameter=lower,
        upper_diameter=lower + 1.5e-3,
        edge_diameter=lower + rng.uniform(0.4e-3, 1.3e-3),
        tip_half_angle=radians(tip),
        shank_half_angle=radians(shank),
        **keys,
    )


def sampled(part, count=601):
    """Points of needle and seat, closed."""
    contour, seat = part.contour, part.half_angle
    lines = []
    for p, q in zip(contour.points, contour.points[1:], strict=False):
        share = np.linspace(0.0, 1.0, count)[:, None]
        reach = min(1.0, 5e-3 / max(hypot(q[0] - p[0], q[1] - p[1]), 1e-9))
        lines.append(np.array(p) + reach * share * (np.array(q) - np.array(p)))
    r, z, size, first, last = contour.arc
    if size:
        phi = np.linspace(first, last, count)
        lines.append(np.stack([r + size * np.cos(phi), z - size * np.sin(phi)], axis=1))
    points = np.concatenate(lines)
    r_low, r_up = 0.5 * part.lower_diameter, 0.5 * part.upper_diameter
    # the smallest vertical distance between both is zero when closed
    r = np.linspace(r_low, r_up, count)
    touch = np.min(points[:, 1] - (points[:, 0] - r_low) / tan(seat))
    points[:, 1] -= touch
    return points, np.stack([r, (r - r_low) / tan(seat)], axis=1)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["sharp", "rounded", "chamfered", "blunt"])
def test_no_pair_of_points_has_a_smaller_mantle(kind):
    rng = np.random.default_rng(3)
    for _ in range(5):
        part = random_part(rng, kind)
        needle, seat = sampled(part)
        for lift in (50e-6, 200e-6, 700e-6):
            rise = needle[:, None, 1] + lift - seat[None, :, 1]
            both = needle[:, None, 0] + seat[None, :, 0]
            mantles = pi * both * np.hypot(needle[:, None, 0] - seat[None, :, 0], rise)
            known = min(float(mantles.min()), pi / 4 * part.lower_diameter**2)
            area, _ = part.opening(lift)
            assert area <= known * (1 + 1e-4)  # the samples touch the seat to 1e-8 m
            assert area == pytest.approx(known, rel=1e-2)  # the samples are up to 8 um apart


@pytest.mark.slow
@pytest.mark.parametrize("radius", [5e-6, 60e-6])
def test_a_rounded_edge_opens_along_the_normal_from_nothing(radius):
    part = ConicalSeat(**EDGE, edge_radius=radius)
    for lift in (1e-9, 1e-7, 1e-6):
        h = lift * sin(part.half_angle)
        # the smallest frustum is tilted by h/(2 d) or less
        assert part.opening(lift)[0] == pytest.approx(pi * h * part.sealing_diameter, rel=1e-3)
    assert part.opening(0.0) == (pytest.approx(0.0, abs=1e-17), part.sealing_diameter)
    assert part.opening(-1e-6) == part.opening(0.0)


@pytest.mark.slow
def test_a_wide_open_seat_is_its_bore():
    assert ConicalSeat(**EDGE).opening(1.0) == (pytest.approx(pi / 4 * 1e-6, rel=1e-15), 0.0)


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({"tip_half_angle": radians(30)}, "more than the 30 deg of the seat"),
        ({"shank_half_angle": radians(30)}, "less than the 30 deg of the seat"),
        ({"edge_diameter": 0.9e-3}, "between the ends of the seat, 1 and 2.4 mm"),
        ({"edge_diameter": 2.41e-3}, "between the ends of the seat, 1 and 2.4 mm"),
        ({"lower_diameter": 3e-3}, "between the ends of the seat, 3 and 2.4 mm"),
        ({"tip_diameter": 2e-3}, "a tip of some length"),
        ({"edge_radius": 5e-3}, "Try: make edge_radius smaller"),
        ({"edge_radius": 1e-5, "chamfer_width": 1e-5, "chamfer_half_angle": 0.6}, "no chamfer"),
        ({"chamfer_width": 1e-5}, "chamfer_width without chamfer_half_angle"),
        ({"chamfer_half_angle": 0.6}, "chamfer_half_angle without chamfer_width"),
        ({"chamfer_width": 1e-5, "chamfer_half_angle": 0.8}, "those of shank and tip, 0 and 40"),
        ({"chamfer_width": 1e-5, "chamfer_half_angle": radians(30)}, "parallel to the seat"),
        ({"chamfer_width": 1e-2, "chamfer_half_angle": 0.6}, "make chamfer_width smaller"),
        ({"half_angle": pi / 2}, "less than 90 deg"),
    ],
)
def test_geometry_that_cannot_seal_is_refused_in_words(keys, text):
    with pytest.raises(InputError, match=r"(?s)Try: ") as caught:
        ConicalSeat(**EDGE | keys)

    assert text in str(caught.value)


def floating(seat, **faces):
    seal = seat.sealing_diameter
    inner, outer = faces.get("inner", seal), faces.get("outer", seal)
    parts = {
        "needle": RigidMass(mass=2e-3),
        "spring": Spring(stiffness=4e5, preload=20.0),
        "rail": PressureSource(pressure=60e5),
        "sac": PressureSource(pressure=20e5),
        "seat": seat,
        "outside": PressureFace(direction="opening", outer_diameter=4e-3, inner_diameter=inner),
        "inside": PressureFace(direction="opening", outer_diameter=outer),
    }
    joints = [
        ["needle.body", "spring.end", "seat.needle", "outside.body", "inside.body"],
        ["rail.fluid", "seat.a", "outside.fluid"],
        ["sac.fluid", "seat.b", "inside.fluid"],
    ]
    return Network(parts, joints, Ambient(), OIL).rows()


@pytest.mark.parametrize(
    ("side", "faces", "text"),
    [
        ("b", {"outer": 1.02}, "outer_diameter"),
        ("b", {"inner": 0.99}, "inner_diameter"),
        ("a", {}, "at port a"),
    ],
)
def test_faces_that_do_not_meet_at_the_seal_are_refused(side, faces, text):
    seat = ConicalSeat(**EDGE, tip_side=side)
    sizes = {name: share * seat.sealing_diameter for name, share in faces.items()}

    with pytest.raises(InputError, match=r"(?s)sealing diameter.*Try: ") as caught:
        floating(seat, **sizes)

    assert text in str(caught.value)
    floating(ConicalSeat(**EDGE), **sizes)  # without tip_side faces keep their diameters


@pytest.mark.slow
@pytest.mark.parametrize("keys", [{}, {"edge_radius": 30e-6}, {"tip_half_angle": 0.53}])
def test_the_acting_area_falls_from_the_seal_to_nothing(keys):
    seat = ConicalSeat(**EDGE | keys)
    lifts = np.linspace(0.0, 5e-3, 5001)
    area = np.array([seat.acting_area(x) for x in lifts])

    assert area[0] == pytest.approx(pi / 4 * seat.sealing_diameter**2, rel=1e-14, abs=0.0)
    assert np.all(np.diff(area) < 0.0)
    assert np.max(-np.diff(area)) < 0.05 * area[0]  # no step: 4.5 % per um, almost parallel
    assert area[-1] < 0.02 * area[0]


@pytest.mark.slow
def test_the_page_shows_parts_of_its_case_and_its_python_prints_what_it_tells():
    require_parts(PAGE, "double_seat.yaml")
    code, shown = re.search(r"```python\n(.*?)```\n\n```\n(.*?)```", PAGE, re.DOTALL).groups()
    assert printed(code, "page") == shown


@pytest.mark.slow
def test_the_double_seat_does_what_its_page_tells():
    result = run_of("double_seat.yaml")
    channels = result.channels
    seal = numbers(PAGE, r"in Python: ([\d.]+) mm here")[0]
    assert channels["upper acting diameter"].values[0] * 1e3 == pytest.approx(seal, abs=5e-5)
    gap = numbers(PAGE, r"([\d.]+) um for a tip of 31")[0]
    assert 350 * (1 / tan(radians(30)) - 1 / tan(radians(31))) == pytest.approx(gap, abs=0.05)
    opened, closed = result.events[0], next(e for e in result.events if e.stop == "closed")
    for event, pattern in (
        (opened, r"meets the stop at ([\d.]+) ms with ([\d.]+) m/s"),
        (closed, r"lands at ([\d.]+) ms with ([\d.]+) m/s"),
    ):
        time, speed = numbers(PAGE, pattern)
        assert event.time * 1e3 == pytest.approx(time, abs=6e-4)
        assert event.approach_speed == pytest.approx(speed, abs=6e-3)
    groove, sac, flow = numbers(
        PAGE, r"groove has ([\d.]+) bar and the sac ([\d.]+) bar at ([\d.]+) g/s"
    )
    at = 200  # 1 ms
    assert channels["groove pressure"].values[at] / 1e5 == pytest.approx(groove, abs=0.06)
    assert channels["sac pressure"].values[at] / 1e5 == pytest.approx(sac, abs=0.06)
    assert channels["upper mass flow"].values[at] * 1e3 == pytest.approx(flow, abs=0.06)
    low, up = numbers(PAGE, r"narrower one \(([\d.]+) against ([\d.]+) mm²\)")
    assert channels["lower area"].values[at] * 1e6 == pytest.approx(low, abs=6e-4)
    assert channels["upper area"].values[at] * 1e6 == pytest.approx(up, abs=6e-4)
    highest = channels["groove pressure"].values.max() / 1e5
    assert highest == pytest.approx(numbers(PAGE, r"groove to ([\d.]+) bar")[0], abs=0.3)
    assert result.books.relative_residual <= 1e-11


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
