"""Elastic rods with one degree of freedom per node: bodies whose impacts are known exactly."""

import numpy as np
from scipy.sparse import csr_array

from klack.contact.mortar import ContactSpace
from klack.elasticity.body import ElasticBody
from klack.materials import Material
from klack.mesh.mesh import Mesh

__all__ = ["rod_body", "rod_contact"]


def rod_body(
    name: str, material: Material, *, area: float, length: float, elements: int, bottom: float = 0.0
) -> ElasticBody:
    """Rod along z of two-node elements with consistent mass; node 0 is its lower end.

    Parameters
    ----------
    name : str
    material : Material
        Poisson's ratio plays no part.
    area : float [m^2]
    length : float [m]
    elements : int
    bottom : float [m]
        Height of node 0.
    """
    size = length / elements
    lower, upper = np.eye(elements, elements + 1), np.eye(elements, elements + 1, k=1)
    stretch, mean = csr_array(upper - lower), csr_array(upper + lower)
    K = stretch.T @ stretch * (material.young * area / size)
    # [[2, 1], [1, 2]] rho A h / 6 per element
    M = (3.0 * (mean.T @ mean) + stretch.T @ stretch) * (material.density * area * size / 12.0)
    return ElasticBody(
        name=name,
        mesh=Mesh(points=bottom + size * np.arange(elements + 1.0)[:, None], blocks=()),
        K=csr_array(K),
        M=csr_array(M),
        fixed=np.empty(0, dtype=np.int64),
    )


def rod_contact(a: ElasticBody, b: ElasticBody | None, *, area: float, gap: float) -> ContactSpace:
    """Lower end of rod a above the upper end of rod b, or above a rigid wall (``None``)."""
    count = 1 if b is None else b.dof_count
    return ContactSpace(
        G_a=csr_array(([1.0], ([0], [0])), shape=(1, a.dof_count)),
        G_b=csr_array(([-1.0], ([0], [count - 1])), shape=(1, count)),
        gap=np.array([gap]),
        area=np.array([area]),
        points=a.mesh.points[:1],
        axial=np.array([1.0]),
        rim=np.zeros(1, dtype=bool),
        size=np.array([np.sqrt(area)]),
        slave="a",
        nodes=np.zeros(1, dtype=np.int64),
        reach=gap,
        clearance=gap,
        entry=np.zeros(1),
    )
