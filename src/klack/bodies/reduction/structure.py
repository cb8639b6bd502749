"""A held body as a source of sound: modes, ports, and the normal motion of its surface."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.reduction.craig_bampton import CRAIG_BAMPTON_UNITS, CraigBampton
from klack.bodies.reduction.damping import Damping, damping_ratios
from klack.bodies.reduction.ports import Port, face_samples
from klack.bodies.reduction.reduce import at_ports
from klack.bodies.reduction.reduced_body import port_among
from klack.errors import refuse_if
from klack.mesh.families import FAMILIES
from klack.mesh.mesh import FaceBlock, Surface

__all__ = ["STRUCTURE_UNITS", "Structure", "StructurePort", "build_structure"]


STRUCTURE_UNITS: Mapping[str, str] = {
    **CRAIG_BAMPTON_UNITS,
    "omega": "rad/s",
    "damping": "1",
    "port_signs": "1",
    "port_shapes": "kg^-0.5",
    "static_compliance": "m/N",
    "participation": "kg^0.5",
    "group_area": "m^2",
    "face_area": "m^2",
    "face_shapes": "kg^-0.5",
    "face_residual": "m/N",
    "axial_normals": "1",
}
"""Units of the arrays of a stored :class:`Structure`."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Structure:
    r"""Modes of a supported body at its ports, its support and its surface.

    .. math:: \ddot q_i + 2 \zeta_i \omega_i \dot q_i + \omega_i^2 q_i = \sum_p \varphi_{ip} F_p,
              \qquad u_n(x) = \sum_i n \cdot \phi_i(x)\, q_i + \sum_p r_p(x) F_p

    ``m`` modes, ``p`` ports, ``g`` groups of the surface, ``f`` faces, ``k`` points. Surface
    integrals have ``b = m + p + 1`` fields in this order: modes, static rests ``r_p`` of the
    ports, and a unit axial motion of the whole body.

    Parameters
    ----------
    mass [kg]
    dimension
        2: axisymmetric; areas are those of full rings.
    omega (m,) [rad/s]
    damping (m,) [-]
    port_stops
        Stop that acts at each port; empty for ports of other components.
    port_signs (p,) [-]
        As :class:`StructurePort`.
    port_shapes (m, p) [1/sqrt(kg)]
    static_compliance (p, p) [m/N]
        Of the full body.
    participation (m,) [sqrt(kg)]
        ``R_z^T M phi``: axial momentum per modal velocity.
    group_names
        Named surfaces that meet the air.
    group_area (g,) [m^2]
    group_gram (g, b, b) [m^2/kg for two modes]
        ``int (n . u_i)(n . u_j) dA`` over each group, by the quadrature of the elements.
    group_volume (g, b) [m^2/sqrt(kg) for a mode]
        ``int n . u_i dA``: volume per displacement of a field.
    points (k, dimension) [m]
        Corners of the faces; (r, z) or (x, y, z).
    faces (f, 2), (f, 3) or (f, 4)
        By corners; a triangle repeats its last one among quadrangles.
    face_group (f,)
    face_area (f,) [m^2]
    face_shapes (f, m) [1/sqrt(kg)]
        Mean of ``n . phi_i``, n outwards.
    face_residual (f, p) [m/N]
        Static normal displacement per force at each port, less the share of the modes.
    axial_normals (f,) [-]
        Mean axial component of the outward normal.
    at_mounts
        The body at its mounts, in parts that do not couple (Fourier orders); empty without.
    has_own_damping
        False: what there is in ``damping`` is the loss of layers.
    """

    name: str
    mass: float
    dimension: int
    omega: NDArray[np.float64]
    damping: NDArray[np.float64]
    port_names: tuple[str, ...]
    port_stops: tuple[str, ...]
    port_signs: NDArray[np.float64]
    port_shapes: NDArray[np.float64]
    static_compliance: NDArray[np.float64]
    participation: NDArray[np.float64]
    group_names: tuple[str, ...]
    group_area: NDArray[np.float64]
    group_gram: NDArray[np.float64]
    group_volume: NDArray[np.float64]
    points: NDArray[np.float64]
    faces: NDArray[np.int64]
    face_group: NDArray[np.int64]
    face_area: NDArray[np.float64]
    face_shapes: NDArray[np.float32]
    face_residual: NDArray[np.float32]
    axial_normals: NDArray[np.float64]
    at_mounts: tuple[CraigBampton, ...] = ()
    has_own_damping: bool = True

    @property
    def highest_frequency(self) -> float:
        """Highest kept mode [Hz]; above it only the static rest responds."""
        return float(self.omega.max() / (2.0 * np.pi)) if self.omega.size else 0.0

    @property
    def residual_compliance(self) -> NDArray[np.float64]:
        """Residual compliance of the modes [m/N], shape (p, p)."""
        scaled = self.port_shapes / self.omega[:, None]
        return self.static_compliance - scaled.T @ scaled

    def port_index(self, name: str) -> int:
        """Column of a port."""
        hint = "a contact port has the name of its surface; in klack impact its name is 'contact'."
        return port_among(self.port_names, name, f"body '{self.name}'", "the body", hint)

    @property
    def area(self) -> float:
        """Radiating area [m^2]."""
        return float(self.group_area.sum())


_CHUNK = 4096  # faces at once: bounds the memory
_NO_AREA = 1e-11  # of the square of the length of the body: faces on an axis


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StructurePort:
    """A port of a structure, and which stop pushes it.

    Parameters
    ----------
    port
        Resultant 1 N along +z.
    stop
        Empty for a port of another component.
    sign [-]
        Force at the port, along +z, for a force above zero of its stop: +1 on the upper body of
        the stop, -1 on the lower one.
    """

    port: Port
    stop: str = ""
    sign: float = 1.0


def build_structure(
    body: ElasticBody,
    *,
    modes: Modes,
    damping: Damping,
    ports: Sequence[StructurePort],
    deflections: NDArray[np.float64],
    surfaces: Sequence[str],
    left_out: Sequence[str] = (),
) -> Structure:
    r"""Gather what the modes of a held body do at its ports, its support and its surface.

    .. math:: r_p = K^{-1} b_p - \sum_i \frac{\varphi_i\,\varphi_i^T b_p}{\omega_i^2}

    is the static rest that the modes miss (Craig & Kurdila 2006, ch. 17). Surface integrals are
    exact for the elements' fields on plane faces; a face in several surfaces counts in the first.

    Rejects a free body, whose modes do not tell how it moves as a whole.

    Parameters
    ----------
    deflections (n_dof, p) [m/N]
        ``K^-1 b`` of the ports.
    surfaces
        That meet the air; those without area (an axis) are dropped.
    left_out
        Whose faces never count, whatever other surface they are in.
    """
    refuse_if(
        not body.is_fixed,
        f"structure of body '{body.name}'",
        got="an unsupported body",
        expected="a held body",
        hint="name a support in bodies." + body.name + ".fixed.",
    )
    patterns = np.column_stack([np.empty((body.dof_count, 0)), *(p.port.pattern for p in ports)])
    shapes = at_ports(modes.shapes, patterns)
    rest = deflections - modes.shapes @ (shapes / modes.omega[:, None] ** 2)
    axial = _axial_field(body)
    static = patterns.T @ deflections
    fields = np.hstack([modes.shapes, rest, axial[:, None]])
    fields = fields.reshape(body.mesh.node_count, body.dimension, -1)  # node, component, field
    groups = _groups(body, surfaces, left_out, fields)
    m, count = len(modes.omega), len(ports)
    faces, points = _faces([part for group in groups for part in group.parts], body)
    face_fields = _stacked([part.mean for group in groups for part in group.parts], m + count + 1)
    return Structure(
        name=body.name,
        mass=float(body.mass),
        dimension=body.dimension,
        omega=modes.omega,
        damping=damping_ratios(damping, body, modes.omega, modes.shapes),
        has_own_damping=bool(damping.ratios([1.0])[0] > 0.0),
        port_names=tuple(p.port.name for p in ports),
        port_stops=tuple(p.stop for p in ports),
        port_signs=np.array([p.sign for p in ports], dtype=float),
        port_shapes=shapes,
        static_compliance=(static + static.T) / 2.0,
        participation=modes.shapes.T @ body.axial_momentum,
        group_names=tuple(group.name for group in groups),
        group_area=np.array([group.area for group in groups]),
        group_gram=_stacked([g.gram[None] for g in groups], m + count + 1, m + count + 1),
        group_volume=_stacked([g.volume[None] for g in groups], m + count + 1),
        points=points,
        faces=faces,
        face_group=np.repeat(np.arange(len(groups)), [group.face_count for group in groups]),
        face_area=_stacked([part.area for group in groups for part in group.parts]),
        face_shapes=face_fields[:, :m].astype(np.float32),
        face_residual=face_fields[:, m:-1].astype(np.float32),
        axial_normals=face_fields[:, -1].copy(),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Part:
    """Faces of one family: corners, areas (f,), mean normal motion (f, b)."""

    corners: NDArray[np.int64]
    area: NDArray[np.float64]
    mean: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Group:
    name: str
    parts: tuple[_Part, ...]
    gram: NDArray[np.float64]
    volume: NDArray[np.float64]

    @property
    def area(self) -> float:
        return float(sum(part.area.sum() for part in self.parts))

    @property
    def face_count(self) -> int:
        return sum(len(part.area) for part in self.parts)


def _axial_field(body: ElasticBody) -> NDArray[np.float64]:
    field = np.zeros((body.mesh.node_count, body.dimension))
    field[:, -1] = 1.0
    return field.ravel()


def _groups(
    body: ElasticBody, surfaces: Sequence[str], left_out: Sequence[str], fields: NDArray[np.float64]
) -> list[_Group]:
    seen: set[tuple[int, ...]] = set()
    for name in left_out:
        for block in body.mesh.surface(name).blocks:
            seen.update(_keys(block))
    groups = []
    for name in dict.fromkeys(surfaces):
        group = _group(body, body.mesh.surface(name), fields, seen)
        if group.parts:
            groups.append(group)
    return groups


def _group(
    body: ElasticBody, surface: Surface, fields: NDArray[np.float64], seen: set[tuple[int, ...]]
) -> _Group:
    count = fields.shape[2]
    gram, volume = np.zeros((count, count)), np.zeros(count)
    parts = []
    for block in surface.blocks:
        new = [i for i, key in enumerate(_keys(block)) if key not in seen]
        seen.update(_keys(block))
        for at in range(0, len(new), _CHUNK):
            chosen = FaceBlock(block.family, block.connectivity[new[at : at + _CHUNK]])
            part, normal, weight = _sampled(body, chosen, fields)
            if not len(part.area):
                continue
            gram += (normal * weight[:, None]).T @ normal
            volume += weight @ normal
            parts.append(part)
    return _Group(name=surface.name, parts=tuple(parts), gram=(gram + gram.T) / 2, volume=volume)


def _keys(block: FaceBlock) -> Iterable[tuple[int, ...]]:
    corners = np.sort(block.connectivity[:, : FAMILIES[block.family].corners], axis=1)
    return map(tuple, corners.tolist())


def _sampled(
    body: ElasticBody, block: FaceBlock, fields: NDArray[np.float64]
) -> tuple[_Part, NDArray[np.float64], NDArray[np.float64]]:
    """Normal motion of all fields (f q, b) and its weights (f q,) on some faces."""
    at = face_samples(body.mesh, block)
    area = at.area.sum(axis=1)
    kept = area > _NO_AREA * float(np.max(np.ptp(body.mesh.points, axis=0))) ** 2
    connectivity, area = block.connectivity[kept], area[kept]
    weights, normal = at.area[kept], at.normal[kept]
    f, q, d = normal.shape
    along = np.einsum("qn,fqd->fqnd", at.values, normal).reshape(f, q, d * at.values.shape[1])
    moved = along @ fields[connectivity].reshape(f, along.shape[2], fields.shape[2])
    mean = np.einsum("fq,fqb->fb", weights, moved) / area[:, None]
    corners = connectivity[:, : FAMILIES[block.family].corners]
    part = _Part(corners=corners, area=area, mean=mean)
    return part, moved.reshape(f * q, fields.shape[2]), weights.ravel()


def _faces(
    parts: Sequence[_Part], body: ElasticBody
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Faces by corners, all of one width, and the points that they use."""
    width = max((part.corners.shape[1] for part in parts), default=body.dimension)
    padded = [
        np.pad(part.corners, ((0, 0), (0, width - part.corners.shape[1])), mode="edge")
        for part in parts
    ]
    corners = np.concatenate([np.empty((0, width), dtype=np.int64), *padded])
    used, faces = np.unique(corners, return_inverse=True)
    return faces.reshape(corners.shape).astype(np.int64), body.mesh.points[used]


def _stacked(rows: Sequence[NDArray[np.float64]], *width: int) -> NDArray[np.float64]:
    return np.concatenate([np.empty((0, *width)), *rows])
