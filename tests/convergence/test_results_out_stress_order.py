"""Truth: Lame's thick cylinder under inner pressure, in plane strain.

sigma_r = A - B / r^2, sigma_theta = A + B / r^2, sigma_z = 2 nu A with A = p a^2 / (b^2 - a^2),
B = A b^2.  The finite elements are solved, so the error of the displacements is inside.
"""

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from klack.elasticity.assembly import assemble
from klack.elasticity.loads import traction_load
from klack.elasticity.stress import StressField
from klack.materials import Material
from klack.verification.lattice import lattice_mesh

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
INNER, OUTER, PRESSURE = 2e-3, 4e-3, 100e6


def largest_error(family: str, cells: int) -> float:
    """Largest error of any stress at any node, over the pressure."""
    lines = [np.linspace(0.0, 1.0, cells + 1), np.linspace(0.0, 1.0, 3)]
    mesh = lattice_mesh(
        family, lines, lambda x: x * [OUTER - INNER, 2 / cells * (OUTER - INNER)] + [INNER, 0.0]
    )
    K, _ = assemble(mesh, {"solid": STEEL})
    bore = traction_load(
        mesh,
        mesh.surface("inner"),
        lambda x, n: -PRESSURE * n,
    )
    radial = 2 * np.arange(mesh.node_count)
    u = np.zeros(mesh.dof_count)
    u[radial] = spsolve(K.tocsc()[np.ix_(radial, radial)], bore[radial])

    stress = StressField(mesh, {"solid": STEEL})(u)

    r = mesh.points[:, 0]
    A = PRESSURE * INNER**2 / (OUTER**2 - INNER**2)
    B = A * OUTER**2
    exact = np.column_stack([A - B / r**2, A + B / r**2, 2 * STEEL.poisson * A + 0 * r])
    return float(np.abs(stress[:, :3] - exact).max() / PRESSURE)


@pytest.mark.parametrize(
    ("family", "order", "finest"),
    [("tri3", 1, 0.1), ("quad4", 1, 0.1), ("tri6", 2, 4e-3), ("quad8", 2, 4e-3)],
)
def test_stresses_of_a_thick_cylinder_converge(family: str, order: int, finest: float):
    """The largest error is at the bore; the order comes up from below as 1/r gets smooth."""
    error = [largest_error(family, cells) for cells in (8, 16)]

    assert np.log2(error[0] / error[1]) == pytest.approx(order, abs=0.15)
    assert error[1] < finest
