"""Patch test: two cubes that do not match transmit a uniform pressure; truth: p = E d / (2 L).

The pressure of single hats oscillates by a few percent on quadratic faces that do not match, since
quadratic displacements cannot follow linear hats exactly; the resultant is good to 1e-5.
"""

import numpy as np
import pytest

from klack.verification.contact import STEEL, uniform_compression

PAIRS = [
    ("tet10", "tet10", (4, 3), 0.0),
    ("tet10", "tet10", (3, 4), 0.03),
    ("hex20", "hex20", (4, 3), 0.0),
    ("hex20", "tet10", (4, 3), 0.03),
    ("wedge15", "hex20", (4, 3), 0.0),
    ("hex8", "hex8", (4, 3), 0.0),
    ("tet4", "tet4", (4, 3), 0.0),
]


@pytest.mark.parametrize(("family_a", "family_b", "cells", "skew"), PAIRS)
def test_uniform_pressure_passes_between_meshes_that_do_not_match(family_a, family_b, cells, skew):
    problem = uniform_compression(family_a, family_b, cells, skew=skew)

    static = problem.solve(1e9, count=2)

    exact = STEEL.young * static.approach[-1] / 2.0
    pressure = static.pressures[-1] / problem.space.area
    assert static.active_count[-1] == problem.space.count
    assert static.force[-1] == pytest.approx(exact, rel=1e-4)
    assert np.abs(pressure / exact - 1.0).max() < 0.08
    assert np.average((pressure / exact - 1.0) ** 2, weights=problem.space.area) < 0.02**2


@pytest.mark.parametrize("family", ["tet10", "hex20"])
def test_matching_meshes_are_exact(family):
    problem = uniform_compression(family, family, (3, 3))

    static = problem.solve(1e9, count=2)

    pressure = static.pressures[-1] / problem.space.area
    np.testing.assert_allclose(pressure, STEEL.young * static.approach[-1] / 2.0, rtol=1e-9)


def test_the_finer_side_carries_the_hats():
    assert uniform_compression("tet10", "tet10", (4, 3)).space.slave == "a"
    assert uniform_compression("tet10", "tet10", (3, 4)).space.slave == "b"
    assert uniform_compression("hex20", "tet10", (3, 3)).space.slave == "a"
