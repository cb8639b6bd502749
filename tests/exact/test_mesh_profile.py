"""Profiles against closed formulas of bodies of revolution (Pappus, Archimedes).

Truth: exact.  Tolerance 1e-12 relative: Gauss rule of order 24 per edge, round-off only.
"""

import numpy as np
import pytest

from klack.mesh.profile import Arc, Line, Profile

EXACT = 1e-12


def sphere(radius: float, height: float = 0.0) -> Profile:
    half = Arc((0, height + radius), (0, height), "ball")
    return Profile((0, height - radius), (half, Line((0, height - radius), "axis")))


@pytest.mark.parametrize("radius", [1.0, 2e-3])  # [m]
def test_sphere_volume_and_area(radius):
    ball = sphere(radius, height=3 * radius)

    assert ball.volume == pytest.approx(4 / 3 * np.pi * radius**3, rel=EXACT)
    assert ball.surface_area("ball") == pytest.approx(4 * np.pi * radius**2, rel=EXACT)


def test_ring_of_circular_section_follows_pappus():
    """Torus of two explicit half circles: 2 pi^2 R a^2 and 4 pi^2 R a."""
    big, small = 5e-3, 1e-3
    ring = Profile(
        (big - small, 0),
        (
            Arc((big + small, 0), (big, 0), "under", clockwise=False),
            Arc((big - small, 0), (big, 0), "over", clockwise=False),
        ),
    )

    assert ring.volume == pytest.approx(2 * np.pi**2 * big * small**2, rel=EXACT)
    area = ring.surface_area("under") + ring.surface_area("over")
    assert area == pytest.approx(4 * np.pi**2 * big * small, rel=EXACT)


def test_truncated_cone():
    r0, r1, h = 1e-3, 3e-3, 4e-3
    cone = Profile(
        (0, 0), (Line((r0, 0)), Line((r1, h), "seat"), Line((0, h), "top"), Line((0, 0)))
    )

    assert cone.volume == pytest.approx(np.pi * h / 3 * (r0**2 + r0 * r1 + r1**2), rel=EXACT)
    slant = np.hypot(r1 - r0, h)
    assert cone.surface_area("seat") == pytest.approx(np.pi * (r0 + r1) * slant, rel=EXACT)
    assert cone.names == ("seat", "top")


def test_either_sense_gives_the_same_anticlockwise_profile():
    forward = Profile((0, 0), (Line((1, 0), "a"), Arc((0, 1), (0, 0), "b"), Line((0, 0), "c")))
    back = Profile((0, 0), (Line((0, 1), "c"), Arc((1, 0), (0, 0), "b"), Line((0, 0), "a")))

    assert back.area == pytest.approx(np.pi / 4, rel=EXACT)
    assert [c.name for c in back.curves] == [c.name for c in forward.curves] == ["a", "b", "c"]
    for one, other in zip(forward.curves, back.curves, strict=True):
        np.testing.assert_allclose(one.at(0.3), other.at(0.3), rtol=0, atol=1e-15)


def test_arc_takes_the_shorter_way_unless_told():
    """Three quarters of a circle of radius 1 around (2, 0), closed by its chord."""
    start, end, centre = (3.0, 0.0), (2.0, -1.0), (2.0, 0.0)
    short = Profile(start, (Arc(end, centre), Line(start)))
    long = Profile(start, (Arc(end, centre, clockwise=False), Line(start)))

    assert short.area == pytest.approx(np.pi / 4 - 0.5, rel=EXACT)
    assert long.area == pytest.approx(3 * np.pi / 4 + 0.5, rel=EXACT)


def test_nearest_points_on_an_arc_beyond_half_a_turn():
    curve = Profile(
        (3.0, 0.0), (Arc((2.0, -1.0), (2.0, 0.0), clockwise=False), Line((3.0, 0.0)))
    ).curves[0]

    s = np.linspace(0, 1, 13)
    np.testing.assert_allclose(curve.fraction(curve.at(s)), s, rtol=0, atol=1e-12)
    np.testing.assert_allclose(curve.distance(np.array([[2.0, 0.0], [0.5, 0.0]])), [1.0, 0.5])
