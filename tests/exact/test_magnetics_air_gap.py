"""Edge fields: conformal maps against a finite-difference field, limits, derivatives."""

import itertools
from math import log, pi

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve

from klack.magnetics.air_gap import (
    cylinder_wall,
    edge_on_plane,
    edges_beside_wall,
    equal_edges,
    face_permeance,
    outer_ring,
    ring_permeance,
    round_excess,
    slot_loss,
    step_excess,
)
from klack.magnetics.iron import VACUUM_PERMEABILITY as MU0


def field_permeance(x, y, fixed, potential, radius=None):
    """Twice the field energy of unit mmf over mu0: five-point differences on an uneven grid.

    ``x`` along the gap, ``y`` away from the core; with ``radius`` the problem is round and ``y``
    is the distance from the core's surface (per 2 pi).
    """
    n, m = x.size, y.size
    index = np.arange(n * m).reshape(n, m)
    r = np.ones(m) if radius is None else radius + y
    widths = np.array([0.5 * (x[min(i + 1, n - 1)] - x[max(i - 1, 0)]) for i in range(n)])
    heights = np.array([0.5 * (y[min(j + 1, m - 1)] - y[max(j - 1, 0)]) for j in range(m)])
    gx = (heights * r)[None, :] / np.diff(x)[:, None]
    gy = widths[:, None] * (0.5 * (r[1:] + r[:-1]) / np.diff(y))[None, :]
    a = np.concatenate((index[:-1].ravel(), index[:, :-1].ravel()))
    b = np.concatenate((index[1:].ravel(), index[:, 1:].ravel()))
    g = np.concatenate((gx.ravel(), gy.ravel()))
    rows, columns = np.concatenate((a, b, a, b)), np.concatenate((a, b, b, a))
    K = coo_array((np.concatenate((g, g, -g, -g)), (rows, columns)), shape=(n * m,) * 2).tocsr()
    u = np.where(fixed, potential, 0.0).ravel()
    free = ~fixed.ravel()
    u[free] = spsolve(K[free][:, free].tocsc(), -(K @ u)[free])
    return float(u @ (K @ u))


def graded(points, finest, growth=1.15):
    """Grid lines from each point on, growing away from it."""
    lines = [points[0]]
    for start, end in itertools.pairwise(points):
        length, steps, size = 0.5 * (end - start), [], finest
        while sum(steps) < length:
            steps.append(size)
            size *= growth
        half = np.cumsum(steps) * length / sum(steps)
        lines += [*(start + half), *(end - half[-2::-1]), end]
    return np.array(lines)


def half_gap(gap, wall, finest, radius=None):
    """Edge number from the field of half a gap: ground at mid-gap and at the wall."""
    d, reach = 0.5 * gap, 4.0 * wall
    depth = 5.0 * d if radius is None else radius
    x = graded([0.0, d, d + reach], finest)
    y = graded([-depth, 0.0, wall], finest)
    X, Y = np.meshgrid(x, y, indexing="ij")
    pole = (X >= d) & (Y <= 0)
    ground = (X <= 0) | (Y >= wall)
    total = field_permeance(x, y, pole | ground, np.where(pole, 1.0, 0.0), radius)
    if radius is None:
        return 0.5 * (total - depth / d - reach / wall)
    # per 2 pi; half the mmf on each side of the mid-plane, so half the permeance
    uniform = 0.5 * radius**2 / d + reach / log(1.0 + wall / radius)
    return 0.5 * (total - uniform) / radius


@pytest.mark.parametrize("ratio", [0.1, 0.5, 1.2])  # gap over wall distance
def test_edges_beside_a_wall_are_those_of_the_field(ratio):
    wall = 1.0
    c = float(edges_beside_wall(ratio * wall, wall)[0])

    # the energy of a discrete field is too high, and falls towards the exact one
    errors = [half_gap(ratio, wall, finest) - c for finest in (4e-3 * ratio, 1e-3 * ratio)]

    assert 0.0 < errors[1] < errors[0]
    assert errors[1] < 0.01


@pytest.mark.parametrize("ratio", [0.1, 0.5, 1.0])  # gap over core radius
def test_round_edges_are_those_of_the_round_field(ratio):
    inner, outer = 1.0, 2.7
    flat = float(edges_beside_wall(ratio, cylinder_wall(inner, outer))[0])
    c = flat + float(round_excess(ratio, inner, outer)[0])

    computed = half_gap(ratio, outer - inner, 1e-3, radius=inner)

    # the ramp across the gap stands for the true potential there: 0.02 of about 0.5 to 1
    assert computed == pytest.approx(c, abs=0.025)
    assert abs(computed - c) < 0.25 * abs(computed - flat)


@pytest.mark.parametrize(
    "law",
    [
        lambda g: equal_edges(g, 2e-3),
        lambda g: edge_on_plane(g, 2e-3),
        lambda g: edges_beside_wall(g, 5e-3),
        lambda g: slot_loss(g, 5e-3),
        lambda g: round_excess(g, 5e-3, 13.5e-3),
        lambda g: outer_ring(0.65e-3, g, 5e-3),
    ],
    ids=["equal", "plane", "wall", "slot", "round", "ring"],
)
@pytest.mark.parametrize("gap", [3e-5, 1e-3])  # [m]
def test_derivatives(law, gap):
    step = 1e-5 * gap

    slope = (law(gap + step)[0] - law(gap - step)[0]) / (2 * step)

    assert float(law(gap)[1]) == pytest.approx(float(slope), rel=1e-6)


def test_a_wall_far_away_leaves_two_free_edges():
    # both grow with ln(1/gap)/pi and share their constant but for the length they reach
    gap = 1e-6
    wall = float(edges_beside_wall(gap, 1.0)[0])
    free = float(equal_edges(gap, 1.0)[0])

    assert wall == pytest.approx((1 - log(2) + log(1 / gap)) / pi, rel=1e-5)
    assert free - wall == pytest.approx(log(pi) / pi, rel=1e-4)  # shoulder 1 = wall pi


def test_a_plane_is_a_mirror():
    assert float(edge_on_plane(1e-4, 2e-3)[0]) == 2 * float(equal_edges(2e-4, 2e-3)[0])


@pytest.mark.parametrize("radius", [2e-3, 5e-3])
def test_outer_arcs_lie_on_wider_circles(radius):
    """Quarter arcs of radius s: mean circle ``2 pi (r + 2 s/pi)`` over length ``pi s/2``.

    Beyond the same arcs beside a straight edge, summed over all of them up to the reach.
    """
    gap, reach = 0.1e-3, 1.5e-3
    straight = float(outer_ring(gap, reach, 1e6)[0])
    arcs = 0.5 * reach * (1.0 + np.polynomial.legendre.leggauss(8)[0])
    weights = 0.5 * reach * np.polynomial.legendre.leggauss(8)[1]

    wider = weights @ ((radius + 2.0 * arcs / pi) / radius / (pi * arcs / 2.0))
    alike = weights @ (1.0 / (pi * arcs / 2.0))

    round_one = float(outer_ring(gap, reach, radius)[0])
    assert round_one - straight == pytest.approx(wider - alike, rel=1e-8)


def test_step_vanishes_without_a_step():
    assert step_excess(0.999999, 1.0) == pytest.approx(0.0, abs=2e-5)


def test_slot_limits():
    wide, _ = slot_loss(1e3, 1.0)
    narrow, _ = slot_loss(1e-3, 1.0)

    assert 1e3 - float(wide) < 10.0  # a wide slot loses nearly all of its width
    assert float(narrow) == pytest.approx(1e-6 / (2 * pi), rel=1e-5)  # g^2/(2 pi D)


def test_faces_and_rings():
    assert float(face_permeance(1e-4, 1e-3)) == pytest.approx(MU0 * 0.1, rel=1e-14)
    # a thin ring is a face
    assert ring_permeance(5e-3, 5.005e-3, 4e-3) == pytest.approx(
        MU0 * 2 * pi * 5.0025e-3 * 4e-3 / 5e-6, rel=1e-6
    )
