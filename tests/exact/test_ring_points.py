"""Points on rings: sums over Fourier orders and the resultants of forces.

Truth: the sum written out, sines and cosines alone, trigonometric interpolation, rigid motions.
"""

import numpy as np
import pytest
from scipy.sparse import csr_array

from klack.elasticity.ring_points import RingPoints, RingRows, resolved_orders, share_of_order


def points_of(count, rows=(0, 1, 2), sine=(False, False, True)):
    """All angles of three rows, the last of which reads along the ring."""
    row, turn = (x.ravel() for x in np.meshgrid(rows, np.arange(count), indexing="ij"))
    return RingPoints(row=row, turn=turn, count=count, is_sine=np.array(sine))


def spectrum_of(count, rows=3):
    """Symmetric positive compliances that fall with the order."""
    A = np.random.default_rng(count).normal(size=(count // 2 + 1, rows, rows))
    spectrum = A @ A.transpose(0, 2, 1) / (1.0 + np.arange(count // 2 + 1))[:, None, None]
    # in order 0 what moves along the ring is torsion alone
    spectrum[0, :2, 2] = spectrum[0, 2, :2] = 0.0
    return spectrum


@pytest.mark.parametrize("count", [8, 9, 24, 25])
def test_compliance_is_the_sum_over_the_orders(count):
    """Force at j, motion bent towards it: u_r ~ cos n(t - t_j), u_theta ~ sin n(t - t_j)."""
    points, spectrum = points_of(count), spectrum_of(count)

    C = points.compliance(spectrum)

    for i, j in np.random.default_rng(1).integers(0, len(points.row), (60, 2)):
        apart = points.angle[i] - points.angle[j]
        own, other = points.is_sine[points.row[[i, j]]]
        total = 0.0
        for n in range(count // 2 + 1):
            share = 0.5 if 2 * n == count else 1.0
            # a force along the ring bends the body towards a quarter of a wave ahead of it
            wave = np.cos(n * apart) if own == other else np.sin(n * apart)
            sign = -1.0 if other and not own else 1.0
            total += share * sign * spectrum[n, points.row[i], points.row[j]] * wave
        assert C[i, j] == pytest.approx(total, rel=1e-12, abs=1e-13)
    np.testing.assert_allclose(C, C.T, atol=1e-13)
    assert np.linalg.eigvalsh(C)[0] > 0


@pytest.mark.parametrize("count", [8, 9, 24, 25])
def test_modes_and_forces_of_an_order_make_the_same_compliance(count):
    """Each order once more as two motions with their own factors, as modes are read."""
    points, spectrum = points_of(count), spectrum_of(count)
    again = np.zeros((len(points.row),) * 2)
    for n in resolved_orders(count):
        c = spectrum[n][np.ix_(points.row, points.row)]
        for factor in points.factors(n):
            again += share_of_order(n, count) * factor[:, None] * c * factor

    np.testing.assert_allclose(points.compliance(spectrum), again, atol=1e-12)


@pytest.mark.parametrize("count", [12, 13])
def test_a_wave_of_forces_answers_in_its_own_order(count):
    """A line load cos(n t) of unit amplitude: 2 pi / N per point, and pi c_n, n = N/2 included."""
    points = points_of(count, rows=(0,), sine=(False,))
    spectrum = np.arange(1.0, count // 2 + 2)[:, None, None]
    C = points.compliance(spectrum)
    for n in range(1, count // 2 + 1):
        load = 2.0 * np.pi / count * np.cos(n * points.angle)
        np.testing.assert_allclose(
            C @ load, np.pi * spectrum[n, 0, 0] * np.cos(n * points.angle), atol=1e-12
        )


@pytest.mark.parametrize("count", [12, 13])
def test_forces_give_the_resultants_of_a_rigid_body(count):
    """Order 1 sums forces along x and y, of radial and hoop forces alike."""
    points = points_of(count)
    loads = np.random.default_rng(2).normal(size=(len(points.row), 1))
    first, second = points.forces(1, loads)
    c, s = np.cos(points.angle), np.sin(points.angle)
    radial, hoop = points.row == 0, points.row == 2
    # a shift along x is u_r = cos t and u_theta = -sin t: V = -U
    x = (loads[:, 0] * c)[radial].sum() - (loads[:, 0] * s)[hoop].sum()
    y = (loads[:, 0] * s)[radial].sum() + (loads[:, 0] * c)[hoop].sum()
    assert first[0, 0] - first[2, 0] == pytest.approx(x, rel=1e-12)
    assert second[0, 0] - second[2, 0] == pytest.approx(y, rel=1e-12)


def test_rows_of_an_order_read_amplitudes():
    """Of one node with a, b, W: U = a + b in the plane, V = b - a along the ring."""
    rows = RingRows(
        along=csr_array([[2.0, 3.0]]), around=csr_array([[5.0]]), turned=csr_array([[7.0, 11.0]])
    )
    a, b, W = 0.3, 0.5, -0.2
    read = rows.of_order(4) @ np.array([a, b, W])
    expected = [2 * (a + b) + 3 * W, 5 * (b - a) + 4 * (7 * (a + b) + 11 * W)]
    np.testing.assert_allclose(read, expected, rtol=1e-14)
    assert list(rows.is_sine) == [False, True]
