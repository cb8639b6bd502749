"""Truth: frequencies of a free steel cylinder D4 x L30 mm from exact 3-D elasticity (Ritz).

The table is tests/data/free_cylinder_frequencies.csv, converged to 1e-7 or better.
"""

import csv
from pathlib import Path

import numpy as np
import pytest

from klack.bodies.elasticity.body import elastic_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.fourier_body import FourierBody, fourier_body
from klack.materials.material import Material
from klack.verification.lattice import lattice_mesh

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
RADIUS, LENGTH = 2e-3, 30e-3
TABLE = Path(__file__).parents[1] / "data" / "free_cylinder_frequencies.csv"


def exact(order: int) -> np.ndarray:
    """Frequencies of one circumferential order [Hz]."""
    with TABLE.open() as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        return np.array([float(row["f_Hz"]) for row in rows if int(row["n"]) == order])


def rounded(points: np.ndarray) -> np.ndarray:
    """Square bar onto a round one."""
    x, y, z = points.T
    disc = np.stack([x * np.sqrt(1 - y**2 / 2), y * np.sqrt(1 - x**2 / 2)], axis=1)
    return np.column_stack([RADIUS * disc, LENGTH * z])


@pytest.mark.parametrize(("family", "factor"), [("quad8", 1), ("tri6", 4)])
def test_axisymmetric_modes_match_the_exact_ones(family, factor):
    """Tolerance = mesh error, which grows with the fourth power of the wave number."""
    lines = [np.linspace(0.0, RADIUS, 7), np.linspace(0.0, LENGTH, 91)]
    body = elastic_body("cylinder", lattice_mesh(family, lines), {"solid": STEEL})
    table = exact(0)
    assert len(table) == 16
    deviation = eigenmodes(body, count=16).frequency / table - 1
    assert np.abs(deviation[:3]).max() < 3e-7
    assert np.abs(deviation[:8]).max() < 1e-5 * factor
    assert np.abs(deviation).max() < 1e-4 * factor
    assert (deviation > -1e-7).all()  # a conforming mesh is never softer (table: 1e-7)


def half_section(family: str, across: int, along: int, order: int) -> FourierBody:
    lines = [np.linspace(0.0, RADIUS, across + 1), np.linspace(0.0, LENGTH, along + 1)]
    return fourier_body("cylinder", lattice_mesh(family, lines), {"solid": STEEL}, order=order)


@pytest.mark.parametrize(("family", "factor"), [("quad8", 1), ("tri6", 3)])
def test_bending_modes_of_the_half_section_match_the_exact_ones(family, factor):
    """Fourier order 1; tolerance = mesh error, with its sign."""
    table = exact(1)
    assert len(table) == 16
    deviation = eigenmodes(half_section(family, 6, 90, 1), count=16).frequency / table - 1
    assert np.abs(deviation[:3]).max() < 2e-6 * factor
    assert np.abs(deviation).max() < 3e-5 * factor
    assert (deviation > -1e-7).all()


@pytest.mark.parametrize("family", ["quad8", "tri6"])
def test_modes_of_order_two_match_the_exact_ones(family):
    table = exact(2)
    assert len(table) == 8
    deviation = eigenmodes(half_section(family, 6, 90, 2), count=8).frequency / table - 1
    assert np.abs(deviation).max() < 1e-4
    assert (deviation > -2e-7).all()


@pytest.mark.parametrize("family", ["quad8", "tri6"])
def test_order_zero_has_the_axisymmetric_modes_and_the_torsion(family):
    """Torsion of a cylinder is exact: k sqrt(G / rho) / (2 L)."""
    frequency = eigenmodes(half_section(family, 6, 90, 0), count=6).frequency
    torsion = np.sqrt(STEEL.shear_modulus / STEEL.density) / (2 * LENGTH) * np.arange(1, 5)
    expected = np.sort(np.concatenate([exact(0)[:2], torsion]))
    np.testing.assert_allclose(frequency, expected, rtol=5e-6)  # error of the mesh


@pytest.mark.parametrize("family", ["quad8", "tri6"])
def test_bending_of_the_half_section_converges_with_order_four(family):
    """Quadratic elements: the error of a frequency falls with h^4."""
    meshes = ((2, 12), (4, 24))
    coarse, fine = (
        eigenmodes(half_section(family, *cells, 1), count=3).frequency / exact(1)[:3] - 1
        for cells in meshes
    )
    assert (fine > 0).all()
    assert fine.max() < 3e-4
    np.testing.assert_allclose(np.log2(coarse / fine), 4.0, atol=0.3)


@pytest.mark.parametrize(
    ("family", "cells", "tolerance"), [("hex20", (4, 16), 4e-4), ("wedge15", (4, 16), 8e-4)]
)
def test_bending_modes_of_solids_match_the_exact_ones(family, cells, tolerance):
    """First two pairs; tolerance = error of this coarse mesh, with its sign."""
    across = np.linspace(-1.0, 1.0, cells[0] + 1)
    lines = [across, across, np.linspace(0.0, 1.0, cells[1] + 1)]
    body = elastic_body("cylinder", lattice_mesh(family, lines, rounded), {"solid": STEEL})
    frequency = eigenmodes(body, count=5).frequency
    table = exact(1)[:2]
    pairs = frequency[[0, 1, 2, 3]].reshape(2, 2)
    deviation = pairs / table[:, None] - 1
    assert np.abs(deviation).max() < tolerance
    assert (deviation > 0).all()
    torsion = np.sqrt(STEEL.shear_modulus / STEEL.density) / (2 * LENGTH)
    assert frequency[4] == pytest.approx(torsion, rel=tolerance)


@pytest.mark.slow
def test_bending_frequency_converges_with_order_four():
    """tet10 on the curved bar: eigenvalue error h^4, so frequency too, here between 3 and 5."""
    errors = []
    for n in (2, 4):
        across, along = np.linspace(-1, 1, n + 1), np.linspace(0, 1, 4 * n + 1)
        mesh = lattice_mesh("tet10", [across, across, along], rounded)
        body = elastic_body("cylinder", mesh, {"solid": STEEL})
        errors.append(eigenmodes(body, count=1).frequency[0] / exact(1)[0] - 1)
    assert 0 < errors[1] < 1e-3
    assert 3 < np.log2(errors[0] / errors[1]) < 5
