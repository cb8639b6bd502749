"""Static contact of bodies.

Static contact of half-spaces; truth: Hertz, Sneddon and the line contact (Johnson 1985).

The bodies are 1000 contact widths large (their far ends change the approach by 0.05 %) and the
slopes of the gap are small, as the closed solutions assume.

The static contact reaches as far as an impact can press it, on any mesh.
"""

from math import sqrt
from pathlib import Path

import numpy as np
import pytest

from klack.assembling.ladder import effective_mass
from klack.assembling.problem import build_problem
from klack.case import load_case
from klack.contact.statics import ReachError, size_over_half_width
from klack.verification.contact import STEEL, half_spaces, parabola

pytestmark = pytest.mark.slow


MODULUS = STEEL.plane_strain_modulus / 2.0  # 1/E* = 2 (1 - nu^2)/E
WIDTH = 100e-6


def sphere(cells, family="quad8", radius=40e-3):
    problem = half_spaces(
        parabola(radius, 4 * WIDTH),
        contact=WIDTH,
        cells=cells,
        family=family,
        reach=(1.45 * WIDTH) ** 2 / (2 * radius),
    )
    stiffness = 4.0 / 3.0 * MODULUS * np.sqrt(radius)
    return problem.solve(stiffness * (WIDTH**2 / radius) ** 1.5), stiffness, radius


@pytest.mark.parametrize(
    ("cells", "family"),
    [((16, 12), "quad8"), ((12, 16), "quad8"), ((16, 12), "tri6")],
    ids=["hats above", "hats below", "triangles"],
)
def test_sphere_on_half_space(cells, family):
    """Measured: coefficient +0.04 %, exponent 1.5000, radius -0.1 %, pressure 1.7 % of p0."""
    static, stiffness, radius = sphere(cells, family)

    resolved = static.half_width > 0.25 * WIDTH
    exponent = np.polyfit(np.log(static.approach[resolved]), np.log(static.force[resolved]), 1)[0]
    a = np.cbrt(3 * static.force * radius / (4 * MODULUS))
    p0 = 1.5 * static.force[-1] / (np.pi * a[-1] ** 2)
    r = static.space.points[:, 0]
    inside = r < 0.9 * a[-1]
    pressure = (static.pressures[-1] / static.space.area)[inside]
    assert resolved.sum() > 10
    assert exponent == pytest.approx(1.5, abs=5e-3)
    np.testing.assert_allclose(
        static.force[resolved], stiffness * static.approach[resolved] ** 1.5, rtol=5e-3
    )
    np.testing.assert_allclose(static.half_width[resolved], a[resolved], rtol=1.5e-2)
    np.testing.assert_allclose(pressure / p0, np.sqrt(1 - (r[inside] / a[-1]) ** 2), atol=0.02)


def test_area_converges_from_below():
    """Only whole hats count: the error falls with the size of the elements."""
    error = []
    for cells in ((8, 6), (16, 12), (32, 24)):
        static, _, radius = sphere(cells)
        a = np.cbrt(3 * static.force[-1] * radius / (4 * MODULUS))
        error.append(static.area[-1] / (np.pi * a**2) - 1)

    assert np.all(np.array(error) < 0)
    assert abs(error[2]) < abs(error[1]) < abs(error[0]) < 0.08


def test_cone_on_half_space():
    """Sneddon 1965: P = 2 E* d^2/(pi m) for a cone of small slope m; contact radius 2 d/(pi m).

    A sharp tip is the hard case: the means over the hats cannot see the kink, so the first touch
    is off by a tenth of an element times the slope (2.3 % of the force here, half on half size).
    """
    slope = 0.005
    problem = half_spaces(
        lambda r: slope * r, contact=WIDTH, cells=(32, 24), reach=1.45 * slope * WIDTH
    )
    approach = 0.5 * np.pi * slope * WIDTH
    static = problem.solve(2 * MODULUS * approach**2 / (np.pi * slope))

    resolved = static.approach > 0.3 * static.approach[-1]
    exact = 2 * MODULUS * static.approach**2 / (np.pi * slope)
    edge = static.space.points[static.pressures[-1] > 0, 0].max()
    assert resolved.sum() > 8
    np.testing.assert_allclose(static.force[resolved], exact[resolved], rtol=0.015)
    assert edge == pytest.approx(2 * static.approach[-1] / (np.pi * slope), rel=0.05)


def test_torus_on_half_space_is_a_line_contact():
    """Half width b = sqrt(4 P' R/(pi E*)), P' = P/(2 pi r); b/r = 1/50 leaves about a percent."""
    radius, ring = 2e-3, 50 * WIDTH / 4
    width = WIDTH / 4
    line_load = np.pi * MODULUS * width**2 / (4 * radius)
    problem = half_spaces(
        parabola(radius, 5 * width),
        contact=width,
        cells=(12, 9),
        ring=ring,
        reach=(2.5 * width) ** 2 / (2 * radius),
    )
    static = problem.solve(2 * np.pi * ring * line_load)

    b = np.sqrt(4 * static.force * radius / (2 * np.pi * ring * np.pi * MODULUS))
    resolved = b > 0.4 * width
    assert resolved.sum() > 8
    np.testing.assert_allclose(static.half_width[resolved], b[resolved], rtol=0.02)
    assert size_over_half_width(static) == pytest.approx(width / 12 / b[-1], rel=0.02)


RADIUS, YOUNG, POISSON = 20e-3, 210e9, 0.3
CROWN = Path(__file__).parents[1] / "data" / "case" / "crown.yaml"


def _problem(speed, reach=None):
    case = load_case(CROWN)
    given = {
        "motion": case.motion.model_copy(update={"speed": speed}),
        "contact": case.contact.model_copy(update={"reach": reach}),
    }
    case = case.model_copy(update=given)
    return build_problem(case, lambda *_: None)


def _hertz(energy):
    """Force [N] at which a sphere on a flat stores an energy: E = 2/5 P d, P = k d^(3/2)."""
    k = 4.0 / 3.0 * YOUNG / (2.0 * (1.0 - POISSON**2)) * sqrt(RADIUS)
    return k**0.4 * (2.5 * energy) ** 0.6


@pytest.mark.parametrize("speed", [0.05, 0.25, 1.0])
def test_reach_is_found_on_faces_as_wide_as_the_contact(speed):
    """Reference: Hertz (Johnson 1985, 4.2); 15 % for faces as wide as the contact, and the bulk.

    The first guess of the force is up to nine times too high here: its load covers the whole face.
    """
    problem = _problem(speed)

    static = problem.static
    energy = 0.5 * effective_mass(problem.pair) * speed**2
    assert static.max_force == pytest.approx(1.15 * _hertz(energy), rel=0.15)


def test_given_reach_is_judged_by_the_force_that_is_needed():
    """Reference: the reach found for the case does (1 %: where a ladder ends); a tenth does not."""
    found = _problem(0.25).static

    again = _problem(0.25, found.space.reach).static
    assert again.max_force == pytest.approx(found.max_force, rel=0.01)
    with pytest.raises(ReachError, match="edge of the candidate points"):
        _problem(0.25, 0.1 * found.space.reach)
