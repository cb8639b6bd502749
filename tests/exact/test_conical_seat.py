"""A needle edge on a cone; truth: a search of random contours, and the page of the double seat."""

import re
from math import hypot, pi, radians, sin, tan

import numpy as np
import pytest
from pages import HOW_TO, numbers, printed, require_parts, run_of

from klack.errors import InputError
from klack.hydraulics.conical_seat import ConicalSeat
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
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
