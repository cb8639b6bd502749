"""The guide of a shaft of revolution: sections of its half section, moved by orders 0 and 1."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.elasticity.ring_points import RingSections
from klack.errors import InputError
from klack.mesh.mesh import Mesh
from klack.transient.guide import ShaftSection, require_within
from klack.transient.revolved_points import RevolvedPoints

__all__ = ["shaft_sections", "turned_sections"]

_ROUND = 1e-2
"""Largest deviation of a guided surface from a slender cone, over its diameter."""

_AT_HEIGHT = 1e-7
"""Nodes so near are at the height itself [m]."""


def turned_sections(body: str, mesh: Mesh, surface: str, heights: Sequence[float]) -> RingSections:
    """Sections of a shaft of revolution at some heights.

    Each takes the ring of nodes that is there, or the next one below and the next one above.

    Parameters
    ----------
    body : str
        Its name, for messages.
    mesh : Mesh
        Half section.
    surface : str
        Cylindrical surface of the shaft.
    heights : sequence of float [m]

    Raises
    ------
    InputError
        For a height without nodes, or a surface that is no shaft.
    """
    nodes = mesh.surface(surface).nodes
    r, z = mesh.points[nodes].T
    _require_shaft(body, surface, r, z)
    weights = np.zeros((len(heights), mesh.node_count))
    found = np.zeros(len(heights))
    for k, height in enumerate(heights):
        require_within(body, surface, height, z)
        at = found[k] = min(max(height, float(z.min())), float(z.max()))
        below = int(np.argmax(np.where(z <= at + _AT_HEIGHT, z, -np.inf)))
        above = int(np.argmin(np.where(z >= at - _AT_HEIGHT, z, np.inf)))
        span = float(z[above] - z[below])
        share = (at - float(z[below])) / span if span > _AT_HEIGHT else 0.0
        weights[k, nodes[below]] += 1.0 - share
        weights[k, nodes[above]] += share
    return RingSections(heights=found, weights=csr_array(weights), points=mesh.points)


def _require_shaft(body: str, surface: str, r: NDArray[np.float64], z: NDArray[np.float64]) -> None:
    """Raise :class:`InputError` for a surface that is not round a shaft."""
    size = 2.0 * float(r.max())
    place = (z - z.mean()) / max(float(np.ptp(z)), 1e-3 * size)
    terms = np.vander(place, 3)
    solution, *_ = np.linalg.lstsq(terms, (r / size) ** 2, rcond=1e-10)
    miss = float(np.max(np.abs(terms @ solution - (r / size) ** 2)))
    if len(np.unique(np.round(z / size, 6))) < 2 or not miss < _ROUND or not r.min() > 0.0:
        raise InputError(
            f"guide of body '{body}': surface '{surface}'",
            got=f"a surface whose radius is {r.min() * 1e3:.4g} to {r.max() * 1e3:.4g} mm",
            expected="a cylinder around the axis of the body",
            hint="name only the cylindrical part of the shaft.",
        )


def shaft_sections(sections: RingSections, shaft: RevolvedPoints) -> list[ShaftSection]:
    """Sections on the modes of a shaft that was reduced with them."""
    return [
        ShaftSection(
            motion=motion,
            centre=np.array([0.0, 0.0, height]),
            radius=float(radius),
            compliance=compliance * np.eye(2),
        )
        for motion, height, radius, compliance in zip(
            shaft.sections,
            sections.heights,
            sections.radius,
            shaft.section_compliance,
            strict=True,
        )
    ]
