"""What a user reads when two surfaces cannot be in contact, and what is warned of."""

import re

import numpy as np
import pytest

from klack.contact.mortar import contact_space, touching_shift
from klack.contact.statics import COARSE, size_over_half_width, static_contact
from klack.contact.submodel import local_stiffness
from klack.errors import InputError
from klack.mesh.mesh import Surface
from klack.verification.contact import half_spaces, parabola, sphere_on_cone

RADIUS, WIDTH = 40e-3, 100e-6


def sphere(cells=(6, 5), reach_in_widths=1.6):
    return half_spaces(
        parabola(RADIUS, 4 * WIDTH),
        contact=WIDTH,
        cells=cells,
        far=100,
        reach=(reach_in_widths * WIDTH) ** 2 / (2 * RADIUS),
    )


@pytest.fixture(scope="module")
def shells():
    return sphere_on_cone("hex20", (14, 12))[:2]


@pytest.mark.parametrize("sides", [("top", "top"), ("bottom", "bottom"), ("right", "left")])
def test_surfaces_that_do_not_face_each_other(shells, sides):
    a, b = shells
    with pytest.raises(InputError, match="face each other"):
        contact_space(a, a.surface(sides[0]), b, b.surface(sides[1]), reach=1e-6)


def test_placing_surfaces_that_miss_each_other(shells):
    a, b = shells
    aside = a.moved(np.array([5e-3, 0, 0]))
    with pytest.raises(InputError, match="face each other"):
        touching_shift(aside, aside.surface("bottom"), b, b.surface("top"))


def test_solid_against_axisymmetric(shells):
    a, _ = shells
    b = sphere().body_b.mesh
    with pytest.raises(InputError, match="dimension 3 against one of 2"):
        contact_space(a, a.surface("bottom"), b, b.surface("top"))


def test_empty_surface_and_negative_reach(shells):
    a, b = shells
    with pytest.raises(InputError, match="'nothing' without faces"):
        contact_space(a, Surface("nothing", ()), b, b.surface("top"))
    with pytest.raises(InputError, match="reach"):
        contact_space(a, a.surface("bottom"), b, b.surface("top"), reach=-1e-6)


def test_contact_that_grows_to_the_rim():
    problem = sphere(reach_in_widths=0.6)

    with pytest.raises(InputError, match=r"edge of the candidate points above .* N") as caught:
        problem.solve(4.0)
    hint = re.search(r"'reach: (\S+) um', under contact", str(caught.value))
    assert hint
    wider = half_spaces(
        parabola(RADIUS, 4 * WIDTH),
        contact=WIDTH,
        cells=(6, 5),
        far=100,
        reach=1e-6 * float(hint[1]),
    )
    assert wider.solve(4.0).max_force == pytest.approx(4.0, rel=0.02)  # what is advised suffices


def test_automatic_reach_holds_the_contact():
    problem = sphere()
    a, b = problem.body_a.mesh, problem.body_b.mesh

    space = contact_space(a, a.surface("bottom"), b, b.surface("top"))

    assert problem.space.count < space.count <= 400


def test_elements_over_half_width_tell_a_coarse_contact():
    problem = sphere(cells=(3, 2))
    C = problem.compliance()

    assert size_over_half_width(static_contact(problem.space, C, 3.8)) < 1.0
    assert size_over_half_width(static_contact(problem.space, C, 0.05)) > COARSE


def test_restricted_space_gives_the_same_contact():
    problem = sphere()
    C = problem.compliance()
    full = static_contact(problem.space, C, 2.0)
    keep = (full.pressures[-1] > 0) | (problem.space.points[:, 0] < 1.2 * WIDTH)

    part = static_contact(problem.space.restricted(keep), C[np.ix_(keep, keep)], 2.0)

    assert 0 < keep.sum() < problem.space.count
    np.testing.assert_allclose(part.force, full.force, rtol=1e-9)
    carrying = full.pressures[-1] > 0
    cut, C = problem.space.restricted(carrying), C[np.ix_(carrying, carrying)]
    with pytest.raises(InputError, match="edge of the candidate"):
        static_contact(cut, C, 2.5)


def test_pattern_has_a_resultant_of_one_newton():
    problem = sphere()
    static = problem.solve(2.0)

    on_a, on_b = static.load_patterns(1.3)

    assert on_a[1::2].sum() == pytest.approx(1.0, rel=1e-12)
    assert on_b[1::2].sum() == pytest.approx(-1.0, rel=1e-12)
    with pytest.raises(InputError, match="end of the ladder"):
        static.pattern_at(3.0)


def test_submodel_is_stiffer_than_the_bodies_and_softens_with_its_size():
    problem = sphere()
    static = problem.solve(2.0)
    upper = static.force > 0.5 * static.max_force
    whole = np.polyfit(static.approach[upper], static.force[upper], 1)[0]

    small, large = (
        local_stiffness(static, problem.body_a, problem.body_b, size=n * WIDTH) for n in (4, 16)
    )

    assert small.stiffness > large.stiffness > whole
    # the far field of a point load yields like 1/size
    assert large.stiffness == pytest.approx(whole, rel=0.1)
    assert small.fit_range == (0.5 * static.max_force, static.max_force)
    with pytest.raises(InputError, match="size"):
        local_stiffness(static, problem.body_a, problem.body_b, size=1.0)
