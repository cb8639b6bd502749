r"""The guide of a needle: a bore with clearance that holds its shaft at a few heights.

At each height the shaft may move freely inside a disc of the radial clearance *c*; beyond it the
bore pushes it back towards the axis,

.. math:: N \ge 0, \qquad |x| - c \le k^{-1} N, \qquad x = x_0 + T q,

with the lateral displacement *x* of the shaft section (mean over a ring of nodes with the weights
of the force) and the compliance :math:`k^{-1}` that the modes lack: of the bore, and, for the
consistent law, of the shaft (static flexibility less that of the kept modes).  Coulomb friction
acts on the rim of the shaft, along the axis and around it (:mod:`klack.transient.guide_step`), so
it also turns and tilts the shaft.  Viscous drag brakes it along the axis.

A body may also slide with its bore on the shaft of another one that moves: the same of the
difference of both motions.  It touches on the side towards which it is pushed: its radius counts
below zero.

Limits: a fixed bore does not move; drag acts along the axis only; no fluid film in the guide.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.ring_points import RingSections
from klack.bodies.elasticity.statics import Flexibility
from klack.errors import refuse_if, require_nonnegative, require_positive
from klack.mesh.mesh import Mesh
from klack.transient.interface_arrays import Guide
from klack.transient.interface_model import InterfaceModel
from klack.transient.revolved_model import RevolvedPoints

__all__ = [
    "ShaftSection",
    "guide_at_sections",
    "guide_of_shaft",
    "shaft_sections",
    "solid_sections",
    "turned_sections",
]


_ROUND = 1e-2
"""Largest deviation of a guided surface from a round one, over its width."""

_AT_HEIGHT = 1e-7
"""Distance [m] within which nodes are at the height itself."""


def guide_of_shaft(
    model: InterfaceModel,
    body: ElasticBody,
    shapes: NDArray[np.float64],
    flexibility: Flexibility,
    *,
    surface: str,
    heights: Sequence[float],
    clearance: float,
    stiffness: float | None = None,
    consistent: bool = True,
    friction: float = 0.0,
    viscous: float = 0.0,
) -> Guide:
    """Sections of the shaft as guide contacts.

    Parameters
    ----------
    body
        The moving one, a solid.
    shapes (n_dof, m) [1/sqrt(kg)]
        Its kept modes, rigid ones first, as in the model.
    flexibility
        Of the moving body.
    surface
        Cylindrical.
    heights [m]
        z at the placement; each takes the ring of nodes of the surface that is there, or the two
        around it (on an unstructured mesh as many near it as surround the axis).
    clearance [m]
        Radial.
    stiffness [N/m]
        Of the bore at each height; by default rigid.
    consistent
        Add the compliance of the shaft that the kept modes miss.
    friction, viscous [-], [N s/m]
        The heights share the drag equally.

    Raises
    ------
    InputError
        For a height without nodes, a surface that is not round, a body of revolution, or a contact
        without any compliance.
    """
    refuse_if(
        body.dimension != 3,
        f"guide of body '{body.name}'",
        got="a body of revolution in its motion along the axis",
        expected="a solid body",
        hint="model the bodies as swept or solid.",
    )
    return guide_at_sections(
        model,
        body.name,
        solid_sections(body, shapes, flexibility if consistent else None, surface, heights),
        clearance=clearance,
        stiffness=stiffness,
        friction=friction,
        viscous=viscous,
    )


class ShaftSection(NamedTuple):
    """A section of the shaft in its guide.

    Parameters
    ----------
    motion (6, m) [1/sqrt(kg)], [1/(m sqrt(kg))]
        Displacement and rotation vector per modal coordinate of the shaft.
    centre (3,) [m]
        The axis there.
    radius [m] compliance (2, 2) [m/N]
        Static, across the axis, of a free body with inertia relief; None: no more than that of the
        modes.
    """

    motion: NDArray[np.float64]
    centre: NDArray[np.float64]
    radius: float
    compliance: NDArray[np.float64] | None


def solid_sections(
    body: ElasticBody,
    shapes: NDArray[np.float64],
    flexibility: Flexibility | None,
    surface: str,
    heights: Sequence[float],
) -> list[ShaftSection]:
    """Sections of a solid, with their whole compliance if its flexibility is given."""
    found = []
    for height in heights:
        section = _section(body, surface, height)
        across = section.load[:, :2]
        found.append(
            ShaftSection(
                motion=np.vstack([section.load.T @ shapes, section.moment.T @ shapes]),
                centre=section.centre,
                radius=section.radius,
                compliance=None
                if flexibility is None
                else across.T @ flexibility.deflections(across),
            )
        )
    return found


def guide_at_sections(
    model: InterfaceModel,
    name: str,
    sections: Sequence[ShaftSection],
    *,
    on: tuple[str, Sequence[ShaftSection]] | None = None,
    clearance: float,
    stiffness: float | None,
    friction: float,
    viscous: float,
) -> Guide:
    """Guide of sections that are known on the modes of the body ``name``.

    Others are as in :func:`guide_of_shaft`.

    Parameters
    ----------
    on
        A body that moves, inside this one, and its sections at these heights.  What moves in the
        clearance is then this body seen from there.
    """
    require_positive("guide: clearance", clearance, "m")
    require_nonnegative("guide: friction", friction, "-")
    require_nonnegative("guide: viscous", viscous, "N s/m")
    count, own = len(sections), _coordinates(model, name, sections[0])
    motion = np.zeros((count, 6, model.mode_count))
    compliance = np.zeros((count, 2, 2))
    for k, section in enumerate(sections):
        motion[k][:, own] = section.motion
        if stiffness is not None:
            compliance[k] = np.eye(2) / stiffness
        if section.compliance is not None:
            compliance[k] += _missing(model.omega[own], section.motion[:2], section.compliance)
    centre = np.array([section.centre for section in sections])
    radius = np.array([section.radius for section in sections])
    offset = centre[:, :2].copy()
    if on is not None:
        inside = _coordinates(model, on[0], on[1][0])
        for k, section in enumerate(on[1]):
            motion[k][:, inside] -= section.motion
            offset[k] -= section.centre[:2]
            radius[k] = -section.radius  # it touches on the side towards which it is pushed
            if section.compliance is not None:
                compliance[k] += _missing(
                    model.omega[inside], section.motion[:2], section.compliance
                )
    for k, section in enumerate(sections):
        refuse_if(
            not np.linalg.eigvalsh(compliance[k])[0] > 0,
            f"guide of body '{name}' at z = {section.centre[2] * 1e3:.4g} mm",
            got="a contact without compliance",
            expected="a stiffness of the bore, or the consistent law",
            hint="give law: {kind: linear, stiffness: 1e8 N/m}.",
        )
    return Guide(
        heights=np.ascontiguousarray(centre[:, 2]),
        clearance=np.full(count, clearance),
        offset=offset,
        traces=np.ascontiguousarray(motion[:, :2]),
        slide=np.ascontiguousarray(motion[:, 2]),
        turn=np.ascontiguousarray(motion[:, 3:]),
        radius=radius,
        compliance=compliance,
        friction=np.full(count, friction),
        viscous=np.full(count, viscous / count),
    )


def _coordinates(model: InterfaceModel, name: str, section: ShaftSection) -> NDArray[np.int64]:
    """Modal coordinates of a body; of the first one for a name that the model does not have."""
    number = model.bodies.index(name) if name in model.bodies else 0
    return np.flatnonzero(model.owner == number)[: section.motion.shape[1]]


def require_within(body: str, surface: str, height: float, z: NDArray[np.float64]) -> None:
    """Reject a height where a surface with these nodes is not."""
    refuse_if(
        not z.min() - 1e-6 <= height <= z.max() + 1e-6,
        f"guide of body '{body}': heights",
        got=f"z = {height * 1e3:.4g} mm",
        expected=f"between {z.min() * 1e3:.4g} and {z.max() * 1e3:.4g} mm, where surface "
        f"'{surface}' is",
        hint="give heights in the placed body.",
    )


class _Section(NamedTuple):
    load: NDArray[np.float64]  # (n_dof, 3) weights of the mean displacement
    moment: NDArray[np.float64]  # (n_dof, 3) [1/m] of the mean rotation
    centre: NDArray[np.float64]  # (3,) [m] the axis there
    radius: float  # [m]


def _section(body: ElasticBody, surface: str, height: float) -> _Section:
    """Weights of nodes around a height.

    They are the ring of nodes at the height, or those next above and below.  The weights are as
    equal as can be while their mean place is the axis there: any rigid motion moves the section as
    it moves the axis, on unstructured meshes as well.  Its rotation is that of the rigid motion
    nearest to the displacement of the nodes with the same weights.
    """
    nodes = body.mesh.surface(surface).nodes
    z = body.mesh.points[nodes, 2]
    require_within(body.name, surface, height, z)
    at = min(max(height, float(z.min())), float(z.max()))
    places = body.mesh.points[nodes] - [0.0, 0.0, at]
    centre = _axis(f"guide of body '{body.name}': surface '{surface}'", places)
    places[:, :2] -= centre
    size = float(np.ptp(places[:, :2]))
    along = places[:, 2]
    low = float(np.max(along[along <= _AT_HEIGHT]))
    high = float(np.min(along[along >= -_AT_HEIGHT]))
    width = max(1e-6, 0.02 * size)
    near = (along >= low - width) & (along <= high + width)
    while not _supports(places[near], size) and width < 0.5 * size:
        width *= 1.3
        near = (along >= low - width) & (along <= high + width)
    weights = _weights(places[near], size)
    load = np.zeros((body.dof_count, 3))
    for c in range(3):
        load[3 * nodes[near] + c, c] = weights
    x, y, height_above = places[near].T
    # displacement of the nodes by a unit rotation about each axis
    none = np.zeros(len(x))
    spins = np.array([[none, -height_above, y], [height_above, none, -x], [-y, x, none]])
    spins = spins.transpose(0, 2, 1)
    inertia = np.einsum("i,aic,bic->ab", weights, spins, spins)
    fitted = np.linalg.solve(inertia, (weights[:, None] * spins).reshape(3, -1))
    moment = np.zeros((body.dof_count, 3))
    moment[(3 * nodes[near][:, None] + np.arange(3)).ravel()] = fitted.T
    return _Section(load, moment, np.append(centre, at), float(weights @ np.hypot(x, y)))


def _axis(where: str, places: NDArray[np.float64]) -> NDArray[np.float64]:
    r"""Centre at z = 0 of the round surface through some points, shape (2,) [m].

    .. math:: x^2 + y^2 = 2 (x_c + s_x z) x + 2 (y_c + s_y z) y + c_0 + c_1 z + c_2 z^2

    in the mean: cylinders and slender cones that may lean a little.
    """
    middle = places[:, :2].mean(axis=0)
    size = float(np.ptp(places[:, :2]))
    x, y = (places[:, :2] - middle).T / size
    z = places[:, 2] / max(float(np.max(np.abs(places[:, 2]))), size)
    terms = np.column_stack([2 * x, 2 * y, 2 * x * z, 2 * y * z, np.ones(len(x)), z, z**2])
    solution, *_ = np.linalg.lstsq(terms, x**2 + y**2, rcond=1e-10)
    miss = float(np.max(np.abs(terms @ solution - x**2 - y**2)))
    refuse_if(
        len(x) < 5 or not miss < _ROUND,
        where,
        got=f"a surface that deviates from the nearest round one by {miss * size * 1e6:.3g} um",
        expected="a cylinder around the axis of the body",
        hint="name only the cylindrical part of the shaft, or refine the mesh around it.",
    )
    return np.asarray(middle + size * solution[:2])


def _weights(places: NDArray[np.float64], size: float) -> NDArray[np.float64]:
    """Weights nearest to equal ones whose sum is 1 and whose mean place is the origin."""
    conditions = np.vstack([np.ones(len(places)), places.T / size])
    missing = np.array([1.0, 0.0, 0.0, 0.0]) - conditions.mean(axis=1)
    return np.asarray(1.0 / len(places) + np.linalg.pinv(conditions, rcond=1e-9) @ missing)


def _supports(places: NDArray[np.float64], size: float) -> bool:
    """Whether points support the axis from all sides: no negative weight, no free sector."""
    if len(places) < 4:
        return False
    angle = np.sort(np.arctan2(places[:, 1], places[:, 0]))
    widest = np.max(np.diff(angle, append=angle[0] + 2.0 * np.pi))
    return bool(widest < 0.6 * np.pi and np.min(_weights(places, size)) >= 0.0)


def _missing(
    omega: NDArray[np.float64], own: NDArray[np.float64], whole: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Static compliance of a section less that of the kept modes, shape (2, 2) [m/N]."""
    elastic = omega > 0
    modal = (own[:, elastic] / omega[elastic]) @ (own[:, elastic] / omega[elastic]).T
    rest = whole - modal
    return np.asarray(0.5 * (rest + rest.T))


def turned_sections(body: str, mesh: Mesh, surface: str, heights: Sequence[float]) -> RingSections:
    """Sections of a shaft of revolution at some heights.

    Each takes the ring of nodes there, or the next one below and the next one above.

    Parameters
    ----------
    body
        Its name, for messages.
    mesh
        Half section.
    surface
        Cylindrical.
    heights [m]

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
    size = 2.0 * float(r.max())
    place = (z - z.mean()) / max(float(np.ptp(z)), 1e-3 * size)
    terms = np.vander(place, 3)
    solution, *_ = np.linalg.lstsq(terms, (r / size) ** 2, rcond=1e-10)
    miss = float(np.max(np.abs(terms @ solution - (r / size) ** 2)))
    refuse_if(
        len(np.unique(np.round(z / size, 6))) < 2 or not miss < _ROUND or not r.min() > 0.0,
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
