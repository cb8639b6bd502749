"""Air gaps of magnets, on their axis and off it.

Edge fields: conformal maps against a finite-difference field, limits, derivatives.

Air gaps off-axis and tilted; truth: fields, integrals, co-energy by differences, limits.
"""

import itertools
from math import asin, atan, cos, log, pi, sqrt

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve

from klack.errors import InputError
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
from klack.magnetics.off_axis_gap import (
    eccentric_ring,
    guide_ring,
    tilted_ring_face,
)


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


INNER, OUTER, LENGTH = 4e-3, 4.02e-3, 5e-3
CLEARANCE = OUTER - INNER


def difference(law, at, step):
    return (law(at + step) - law(at - step)) / (2.0 * step)


@pytest.mark.parametrize("outer", [4.002e-3, 4.02e-3, 6e-3])
def test_centred_ring_is_the_present_one(outer):
    centred = ring_permeance(INNER, outer, LENGTH)

    assert eccentric_ring(INNER, outer, LENGTH, 0.0) == pytest.approx((centred, 0.0), rel=1e-12)
    permeance, slopes = guide_ring(INNER, outer, LENGTH, np.zeros(4))
    assert permeance == pytest.approx(centred, rel=1e-12)
    assert not slopes.any()


def field_of_eccentric_cylinders(inner, outer, e, orders=40):
    """Flux over mu0 per length and mmf: harmonics about both axes, fitted on both walls."""
    phi = 2.0 * pi / (8 * orders) * np.arange(8 * orders)
    walls = [inner * np.exp(1j * phi), e + outer * np.exp(1j * phi)]
    rows, wanted = [], []
    for value, z in zip((1.0, 0.0), walls, strict=True):
        rise = ((z - e) / outer)[:, None] ** np.arange(1, orders)
        fall = (inner / z)[:, None] ** np.arange(1, orders)
        rows.append(
            np.hstack((np.ones((z.size, 1)), np.log(np.abs(z))[:, None], rise.real, fall.real))
        )
        wanted.append(np.full(z.size, value))
    return -2.0 * pi * np.linalg.lstsq(np.vstack(rows), np.concatenate(wanted), rcond=None)[0][1]


@pytest.mark.parametrize("e", [0.1, 0.3, 0.5])
def test_eccentric_ring_is_the_flux_of_the_field(e):
    flux = field_of_eccentric_cylinders(1.0, 2.0, e)

    assert eccentric_ring(1.0, 2.0, 1.0, e)[0] / MU0 == pytest.approx(flux, rel=1e-12)


@pytest.mark.parametrize("e", [1e-6, 10e-6, 19e-6])
def test_side_force_is_the_slope_of_the_coenergy(e):
    def coenergy(at):
        return 0.5 * 300.0**2 * eccentric_ring(INNER, OUTER, LENGTH, at)[0]

    force = 0.5 * 300.0**2 * eccentric_ring(INNER, OUTER, LENGTH, e)[1]

    assert force == pytest.approx(difference(coenergy, e, 3e-9), rel=1e-5)
    assert force > 0.0  # away from the middle


def test_thin_ring():
    r = sqrt(INNER * OUTER)
    for e in (0.0, 5e-6, 18e-6):
        P, slope = eccentric_ring(INNER, OUTER, LENGTH, e)
        s = sqrt(CLEARANCE**2 - e**2)

        # (c/r)^2/24
        assert pytest.approx(2 * pi * MU0 * r * LENGTH / s, rel=2e-6) == P
        assert slope == pytest.approx(2 * pi * MU0 * r * LENGTH * e / s**3, rel=2e-6, abs=0.0)


def in_parallel(areas, gaps, mmf):
    """Permeances of sectors, and the pull that closes each."""
    P = face_permeance(1.0, gaps) * areas
    return P, 0.5 * mmf**2 * P / gaps


def test_sectors_in_parallel_become_the_ring():
    e, mmf = 10e-6, 100.0
    exact, slope = eccentric_ring(INNER, OUTER, LENGTH, e)
    for sectors, tolerance in ((8, 2e-3), (36, 1e-6)):  # then the (c^2 - e^2)/(24 r^2) of the ring
        phi = 2.0 * pi / sectors * np.arange(sectors)
        gaps = CLEARANCE - e * np.cos(phi)
        P, pull = in_parallel(2.0 * pi * sqrt(INNER * OUTER) * LENGTH / sectors, gaps, mmf)

        assert P.sum() == pytest.approx(exact, rel=tolerance)
        assert pull @ np.cos(phi) == pytest.approx(0.5 * mmf**2 * slope, rel=tolerance)
    left = P.sum() / exact - 1.0
    assert left == pytest.approx(-(CLEARANCE**2 - e**2) / (24.0 * INNER * OUTER), rel=1e-2)


def test_tilted_guide_ring_is_the_integral_along_the_axis():
    tilt = 0.8 * CLEARANCE / (0.5 * LENGTH)
    permeance, _ = guide_ring(INNER, OUTER, LENGTH, [0.0, 0.0, tilt, 0.0])
    thin = 2.0 * pi * MU0 * sqrt(INNER * OUTER) * LENGTH * asin(0.8) / (0.8 * CLEARANCE)

    assert permeance == pytest.approx(thin, rel=1e-6)  # (c/r)^2/24

    place = np.array([8e-6, -3e-6, 8e-4, 1.2e-3])
    permeance, _ = guide_ring(INNER, OUTER, LENGTH, place)

    def section(z):
        e = np.hypot(place[0] - place[2] * z, place[1] - place[3] * z)
        return eccentric_ring(INNER, OUTER, 1.0, e)[0]

    along = quad(section, -0.5 * LENGTH, 0.5 * LENGTH, epsrel=1e-12)[0]
    assert permeance == pytest.approx(along, rel=1e-11)


def test_forces_and_moments_of_the_guide_ring_are_slopes_of_the_coenergy():
    place = np.array([8e-6, -3e-6, 8e-4, 1.2e-3])
    _, slopes = guide_ring(INNER, OUTER, LENGTH, place)
    for k, step in enumerate((1e-9, 1e-9, 1e-6, 1e-6)):
        way = np.eye(4)[k]

        def along(x, way=way):
            return guide_ring(INNER, OUTER, LENGTH, place + x * way)[0]

        assert slopes[k] == pytest.approx(difference(along, 0.0, step), rel=1e-6)


def test_parallel_faces_are_the_present_ones():
    disc = tilted_ring_face(1e-3, 3e-3, 50e-6, 0.0)
    plain = face_permeance(pi * (9e-6 - 1e-6), 50e-6)

    assert disc == pytest.approx((plain, -plain / 50e-6, 0.0), rel=1e-12)


@pytest.mark.parametrize("share", [0.02, 0.5, 0.95, -0.5])
def test_tilted_faces_are_their_integrals(share):
    gap, inner, outer = 50e-6, 1e-3, 3e-3
    tilt = share * gap / outer

    def ring(r):
        return quad(lambda phi: 2.0 * r / (gap + tilt * r * cos(phi)), 0.0, pi, epsrel=1e-12)[0]

    face = MU0 * quad(ring, inner, outer, epsrel=1e-12)[0]

    assert tilted_ring_face(inner, outer, gap, tilt)[0] == pytest.approx(face, rel=1e-11)


@pytest.mark.parametrize("share", [1e-5, 3e-3, 0.02, 0.5, 0.95])
def test_pull_and_moment_of_tilted_faces_are_slopes_of_the_coenergy(share):
    def law(gap, tilt):
        return tilted_ring_face(0.0, 3e-3, gap, tilt)

    gap = 50e-6
    tilt = share * gap / 3e-3
    _, pull, moment = law(gap, tilt)

    assert pull == pytest.approx(difference(lambda g: law(g, tilt)[0], gap, 1e-10), rel=1e-6)
    slope = difference(lambda t: law(gap, t)[0], tilt, 1e-3 * (1.0 - share) * gap / 3e-3)
    # third derivative times (1e-3)^2; round-off at the smallest tilt
    assert moment == pytest.approx(slope, rel=1e-5)
    assert moment > 0.0  # tilts further


def test_sectors_of_a_tilted_disc_have_its_pull_and_moment():
    gap, outer, mmf = 50e-6, 3e-3, 200.0
    tilt = 0.5 * gap / outer
    x, w = np.polynomial.legendre.leggauss(12)
    r, dr = 0.5 * outer * (1.0 + x), 0.5 * outer * w
    phi = 2.0 * pi / 36 * np.arange(36)
    areas = np.outer(np.full(36, 2.0 * pi / 36), r * dr).ravel()
    arm = np.outer(np.cos(phi), r).ravel()
    P, pull = in_parallel(areas, gap + tilt * arm, mmf)
    exact, along, around = tilted_ring_face(0.0, outer, gap, tilt)

    assert P.sum() == pytest.approx(exact, rel=1e-9)
    assert -pull.sum() == pytest.approx(0.5 * mmf**2 * along, rel=1e-9)
    assert -pull @ arm == pytest.approx(0.5 * mmf**2 * around, rel=1e-8)


def test_parallel_at_every_point_costs_a_third_of_the_squared_angle():
    """Between planes at an angle the field is circular: mu0 b/alpha ln(r2/r1)."""
    angle, length = 0.1, 6e-3
    gap = 1.0 * length
    t = np.tan(angle)
    near = (gap - 0.5 * t * length) / np.sin(angle)  # along the tilted plane
    exact = MU0 * 2e-3 / angle * np.log((near + length / cos(angle)) / near)
    # the same lengths on both planes: r2/r1 is the ratio of the gaps
    half = 0.5 * t * length
    permeance = MU0 * 2e-3 / t * np.log((gap + half) / (gap - half))

    assert atan(t) == pytest.approx(angle)
    assert exact / permeance - 1.0 == pytest.approx(angle**2 / 3.0, rel=0.02)


@pytest.mark.parametrize(
    ("law", "where"),
    [
        (lambda: eccentric_ring(INNER, OUTER, LENGTH, [0.0, 20.1e-6]), "eccentricity"),
        (lambda: eccentric_ring(INNER, OUTER, LENGTH, -1e-6), "eccentricity"),
        (lambda: eccentric_ring(INNER, OUTER, LENGTH, float("nan")), "eccentricity"),
        (lambda: eccentric_ring(OUTER, INNER, LENGTH, 0.0), "eccentricity"),
        (lambda: guide_ring(INNER, OUTER, LENGTH, [15e-6, 0.0, 3e-3, 0.0]), "place"),
        (lambda: tilted_ring_face(0.0, 3e-3, [50e-6, 20e-6], 0.01), "tilt"),
        (lambda: tilted_ring_face(0.0, 3e-3, 0.0, 0.0), "tilt"),
    ],
)
def test_faces_that_touch_are_rejected(law, where):
    with pytest.raises(InputError, match=where):
        law()
