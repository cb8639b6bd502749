"""What two solids of a STEP file share in their mesh: a cylinder, a flat face."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from klack.arrays import Floats
from klack.mesh.joint import FlatJoint, Joint, JointError, across, refuse_joint_if
from klack.mesh.mesh import Mesh
from klack.mesh.parting import parted

__all__ = ["flat_solid_joint", "solid_joint"]


_EVEN = 1e-5  # of radius or extent: how far nodes are from a cylinder or a plane
_FLAT = 1e-2  # turn of the normals, from which a face is round: 20 deg


def solid_joint(mesh: Mesh, name: str) -> Joint:
    """Joint of all faces of one name; rejects what is no cylinder between exactly two solids."""
    faces = _Faces.of(mesh, name)
    points, sizes, ways = faces.points, faces.sizes, faces.ways
    centre, extent = points.mean(axis=0), faces.extent
    _no_cylinder_if(
        sizes[1] < _FLAT * sizes[2], name, "a flat face, or one with very little curvature"
    )

    def cylinder(x: Floats) -> tuple[Floats, Floats]:
        axis = ways[:, 0] + ways[:, 1:] @ x[:2]
        return centre + extent * (ways[:, 1:] @ x[2:4]), axis / np.linalg.norm(axis)

    def off(x: Floats) -> Floats:
        return np.asarray(np.linalg.norm(across(points, *cylinder(x)), axis=1) / extent - x[4])

    found = least_squares(off, [0.0, 0.0, 0.0, 0.0, 0.5], xtol=1e-15, ftol=1e-15, gtol=1e-15)
    middle, axis = cylinder(found.x)
    radius = extent * float(found.x[4])
    out = np.einsum("fi,fi->f", faces.normal, across(faces.middle, middle, axis))
    _no_cylinder_if(
        np.abs(found.fun).max() * extent > _EVEN * radius or out.min() * out.max() <= 0.0,
        name,
        "faces that do not form one cylinder",
    )
    one, two = faces.solids
    return Joint(
        name=name,
        inner=one if out[0] > 0.0 else two,
        outer=two if out[0] > 0.0 else one,
        radius=radius,
        length=float(np.ptp(points @ axis)),
        axis=(middle, axis),
    )


def flat_solid_joint(mesh: Mesh, name: str, ends: tuple[str, str]) -> FlatJoint:
    """Joint of all faces of one name; rejects what is no plane between exactly two solids.

    Its length is twice its area over its rim: the width of a ring, the radius of a disc.

    Parameters
    ----------
    ends
        Names of outer faces.
    """
    faces = _Faces.of(mesh, name)
    axis = faces.ways[:, 2] * np.sign(faces.ways[np.abs(faces.ways[:, 2]).argmax(), 2])
    up = faces.normal @ axis
    refuse_joint_if(
        np.ptp(faces.points @ axis) > _EVEN * faces.extent or up.min() * up.max() <= 0.0,
        name,
        got="faces that are not one plane",
        expected="a flat face: bolts press at a right angle to it",
        hint="name the flat face in the CAD file; a cone or a step is not computed.",
    )
    for end in ends:
        if end not in mesh.surfaces:
            raise JointError(
                name,
                got=f"bolts between {ends[0]} and {ends[1]}, where '{end}' is no outer face",
                expected="two faces: one under the head, one where the thread carries "
                f"(here: {', '.join(known for known in mesh.surfaces if known not in ends)})",
                hint="name these faces in the CAD file; 'klack inspect' lists the names.",
            )
    one, two = faces.solids
    return FlatJoint(
        name=name,
        lower=one if up[0] > 0.0 else two,
        upper=two if up[0] > 0.0 else one,
        length=float(np.abs(up).sum() / faces.rim),
        ends=ends,
        normal=axis,
        across=faces.ways[:, :2].T,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Faces:
    """Faces that exactly two solids share.

    Parameters
    ----------
    solids
        Names of both.
    points (n, 3) [m]
        Of all nodes.
    middle, normal (f, 3) [m], [m^2]
        Of each face; outwards from the first solid, as long as twice the area.
    sizes, ways (3,), (3, 3)
        Squares of the normals along each way, ascending.
    rim [m]
        Length of the outline.
    """

    solids: tuple[str, str]
    points: Floats
    middle: Floats
    normal: Floats
    sizes: Floats
    ways: Floats
    rim: float

    @classmethod
    def of(cls, mesh: Mesh, name: str) -> "_Faces":
        apart, _ = parted(mesh, [name])
        pair = apart.pairs[name]
        (faces,) = pair.first  # of one family: tri6
        corners = apart.points[faces.connectivity[:, :3]]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        sizes, ways = np.linalg.eigh(normal.T @ normal)
        along = np.diff(apart.points[faces.rim[:, [0, 2, 1]]], axis=1)
        return cls(
            solids=pair.solids,
            points=apart.points[np.unique(faces.connectivity)],
            middle=corners.mean(axis=1),
            normal=normal,
            sizes=sizes,
            ways=ways,
            rim=float(np.linalg.norm(along, axis=-1).sum()),
        )

    @property
    def extent(self) -> float:
        return float(np.ptp(self.points, axis=0).max())


def _no_cylinder_if(wrong: object, name: str, got: str) -> None:
    refuse_joint_if(
        wrong,
        name,
        got=got,
        expected="a cylinder: faces of one radius round one axis",
        hint="press fits on cones and flat faces are not supported; name the cylinder in the CAD "
        "file.",
    )
