"""Gaps between curved faces; truth: distance of a sphere to a cone, in closed form."""

import numpy as np
import pytest

from klack.contact.mortar import contact_space, touching_shift
from klack.contact.pairing import face_geometry, project_to_surface
from klack.verification.contact import sphere_on_cone


def pointwise(family, layers, xi, **size):
    sphere, cone, exact = sphere_on_cone(family, layers, **size)
    at = face_geometry(sphere.points, sphere.surface("bottom").blocks[0], xi)
    position, normal = at.position.reshape(-1, 3), at.normal.reshape(-1, 3)
    met = project_to_surface(position, normal, cone, cone.surface("top"))
    assert met.met.mean() > 0.7
    return (met.gap - exact(position))[met.met]


def test_serendipity_faces_of_60_um_give_gaps_to_a_quarter_nanometre():
    xi = np.array([(x, y) for x in (-0.9, -0.3, 0.4, 0.8) for y in (-0.8, 0.1, 0.7)])

    error = pointwise("hex20", (26, 24), xi)

    assert np.abs(error).max() < 0.3e-9


def test_six_node_faces_of_60_um_are_right_on_average():
    """They lack the mixed cubic term: some nanometres up and down, which the hats average out."""
    xi = np.array([(0.2, 0.2), (0.6, 0.2), (0.2, 0.6), (1 / 3, 1 / 3), (0.05, 0.5), (0.5, 0.05)])

    error = pointwise("tet10", (26, 24), xi)

    assert np.abs(error).max() < 15e-9
    assert abs(error.mean()) < 0.5e-9


def test_gap_error_falls_with_the_third_power_of_the_element_size():
    xi = np.array([(0.2, 0.2), (0.6, 0.2), (0.2, 0.6)])
    layers = np.array([13, 26, 52])

    error = [np.abs(pointwise("tet10", (n, n - 2), xi, h=1.56e-3 / n)).max() for n in layers]

    order = -np.polyfit(np.log(layers), np.log(error), 1)[0]
    assert order == pytest.approx(3.0, abs=0.35)


@pytest.mark.parametrize("start", [-0.3e-3, 0.0, 5e-3], ids=["overlap", "touching", "far"])
def test_touching_shift_from_anywhere(start):
    """The sphere touches at height 0; the weighted gap of 60 um elements closes 0.1 um later."""
    sphere, cone, _ = sphere_on_cone("hex20", (26, 24))
    moved = sphere.moved(np.array([0, 0, start]))

    shift = touching_shift(moved, moved.surface("bottom"), cone, cone.surface("top"))

    placed = moved.moved(np.array([0, 0, shift]))
    space = contact_space(placed, placed.surface("bottom"), cone, cone.surface("top"))
    assert start + shift == pytest.approx(0.0, abs=0.12e-6)
    assert space.gap.min() == pytest.approx(0.0, abs=1e-12)


def test_reach_marks_its_border_as_rim():
    sphere, cone, exact = sphere_on_cone("hex20", (26, 24))

    space = contact_space(sphere, sphere.surface("bottom"), cone, cone.surface("top"), reach=4e-6)

    assert 0 < space.rim.sum() < space.count
    assert space.gap.max() <= 4.01e-6
    assert exact(space.points)[~space.rim].max() < exact(space.points)[space.rim].max()
    # rows across the ring: the rim is its inner and outer border only
    r = np.hypot(space.points[:, 0], space.points[:, 1])
    assert r[space.rim].min() == r.min()
    assert r[space.rim].max() == r.max()


@pytest.mark.parametrize("lift", [0.0, 0.1e-6])
def test_clearance_is_that_of_the_surfaces(lift):
    """The weighted gap of 60 um elements closes 0.1 um later; measured to 1 nm."""
    sphere, cone, _ = sphere_on_cone("hex20", (26, 24))
    lifted = sphere.moved(np.array([0, 0, lift]))

    space = contact_space(lifted, lifted.surface("bottom"), cone, cone.surface("top"), reach=4e-6)

    assert space.clearance == pytest.approx(lift, abs=3e-9)
    assert space.touch - space.clearance > 50e-9
    assert space.shifted(1e-6).clearance == pytest.approx(space.clearance + 1e-6, rel=1e-9)
