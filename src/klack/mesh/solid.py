"""Solid meshes of ten-node tetrahedra from CAD: STEP files and revolved profiles.

Netgen (with OpenCASCADE) makes the mesh, in millimetres, which stay inside this package. Mid nodes
lie on the true geometry. Named faces become surfaces; one between two solids of a body becomes a
node set of its name.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, refuse_if
from klack.mesh.families import FAMILIES
from klack.mesh.mesh import ElementBlock, FaceTable, Mesh, Surface
from klack.mesh.occ import MM, box_mm, glue, revolved_solids
from klack.mesh.profile import Profile
from klack.mesh.quality import require_connected, require_positive_jacobians
from klack.mesh.sizing import MeshSizing, Refinement, ball_points, require_meshable
from klack.mesh.step_trial import require_readable_step

__all__ = [
    "face_names",
    "mesh_revolved",
    "mesh_step",
    "read_step",
    "solid_names",
    "write_step_revolved",
]

# Elements per radius of curvature.  Netgen's default of 2 leaves flat elements with four nodes on a
# cylinder (scaled Jacobian down to -0.01 on a needle), 2.5 none (0.15 or more).
_PER_RADIUS = 2.5
_NO_AREA = 1e-9  # mm^2


def mesh_step(path: str | Path, sizing: MeshSizing) -> Mesh:
    """Mesh all solids of a STEP file as one body of ``tet10``.

    Rejects files without solids, a solid inside out, solids that do not touch, and what netgen
    cannot mesh.

    Parameters
    ----------
    path
        AP203, AP214 or AP242; its unit of length is respected.  Solids and faces without names are
        called ``solid1``, ``face1`` and so on.
    sizing
        Refinements are points (x, y, z) or rings (r, z) around the z axis.
    """
    shape = read_step(Path(path))
    return _mesh_shape(f"mesh_step: {path}", shape, sizing)


def mesh_revolved(profiles: Mapping[str, Profile], sizing: MeshSizing) -> Mesh:
    """Mesh the full turn of profiles, one per solid, as one body of ``tet10``.

    Surfaces are called like the edges of the profiles; ``sizing`` as :func:`mesh_step`.
    """
    shape = _glued("mesh_revolved", revolved_solids(profiles))
    return _mesh_shape("mesh_revolved", shape, sizing)


def write_step_revolved(profiles: Mapping[str, Profile], path: str | Path) -> None:
    """Write the full turn of profiles as a STEP file with named faces, in mm."""
    from netgen.occ import Compound

    solids = revolved_solids(profiles)
    shape = solids[0] if len(solids) == 1 else Compound(solids)
    path = Path(path)
    shape.WriteStep(str(path))
    # the writer puts the date and a running number in; the same profiles shall give the same file
    text = path.read_text(encoding="latin-1")
    text = re.sub(r"'\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d'", "'1970-01-01T00:00:00'", text, count=1)
    text = re.sub(r"'Open CASCADE STEP translator [\d. ]+'", "'klack'", text)
    path.write_text(text, encoding="latin-1")


def read_step(path: Path) -> Any:
    """Shape of a STEP file: one solid, or several that share their common faces.

    Rejects files without solids, and overlapping ones.
    """
    from netgen.occ import OCCGeometry

    refuse_if(
        not path.is_file(),
        str(path),
        got="no such file",
        expected="a STEP file (.step, .stp)",
        hint="check the path; it is relative to where you started the program.",
    )
    with path.open("rb") as file:
        start = file.read(2048).lstrip().decode("latin-1")
    refuse_if(
        not start.startswith("ISO-10303-21"),
        str(path),
        got=f"a file that starts with {start[:24]!r}" if start else "an empty file",
        expected="a STEP file, which starts with 'ISO-10303-21;'",
        hint="export the part as STEP (AP214 or AP242) from the CAD program.",
    )
    require_readable_step(path)
    try:
        shape = OCCGeometry(str(path)).shape
    except Exception as error:  # OpenCASCADE raises plain exceptions of several types
        raise InputError(
            str(path),
            got=f"a STEP file that OpenCASCADE cannot read ({error})",
            expected="at least one closed solid",
            hint="open it in a CAD program, repair it and export it again.",
        ) from error
    refuse_if(
        not shape.solids,
        str(path),
        got="no solid",
        expected="at least one closed solid",
        hint="export solids, not surfaces or a wire frame.",
    )
    _require_areas(str(path), shape)
    return _glued(str(path), list(shape.solids))


def _require_areas(where: str, shape: Any) -> None:
    for face, name in zip(shape.faces, face_names(shape), strict=True):
        if not face.mass > _NO_AREA:
            raise InputError(
                where,
                got=f"face '{name}' with zero area",
                expected="closed solids",
                hint="export it again; open it in a CAD program and repair it.",
            )


def _glued(where: str, solids: list[Any]) -> Any:
    """One shape of solids that share faces; rejects overlap."""
    shape = glue(solids)
    refuse_if(
        len(shape.solids) != len(solids),
        where,
        got=f"{len(shape.solids)} regions of space from {len(solids)} solids",
        expected="solids that touch at faces and do not overlap",
        hint="cut the common volume out of one of the solids in the CAD program.",
    )
    return shape


def solid_names(shape: Any) -> tuple[str, ...]:
    """Names of solids; solid1, solid2, ... where missing."""
    return _names(shape.solids, "solid")


def face_names(shape: Any) -> tuple[str, ...]:
    """Names of faces; face1, face2, ... where missing."""
    return _names(shape.faces, "face")


def _names(shapes: Any, kind: str) -> tuple[str, ...]:
    """Names, or positions in the list."""
    return tuple(shape.name or f"{kind}{k + 1}" for k, shape in enumerate(shapes))


def _mesh_shape(where: str, shape: Any, sizing: MeshSizing) -> Mesh:
    from netgen.meshing import MeshingParameters
    from netgen.occ import OCCGeometry

    solids, faces = solid_names(shape), face_names(shape)
    _require_upright(where, shape, solids)
    sizing.require_surfaces(faces)
    areas: dict[str, float] = {}
    for name, face in zip(faces, shape.faces, strict=True):
        areas[name] = areas.get(name, 0.0) + face.mass / MM**2
    require_meshable(where, sizing, 3, shape.mass / MM**3, areas)
    for k, solid in enumerate(shape.solids):
        solid.name = str(k)
    for k, face in enumerate(shape.faces):
        face.name = str(k)
        if faces[k] in sizing.surfaces:
            face.maxh = sizing.surfaces[faces[k]] * MM
    parameters = MeshingParameters(
        maxh=sizing.size * MM, grading=sizing.grading, curvaturesafety=_PER_RADIUS
    )
    for refinement in sizing.refinements:
        for x, y, z in _refined_points(refinement, shape):
            parameters.RestrictH(x, y, z, h=refinement.size * MM)
    try:
        netgen = OCCGeometry(shape).GenerateMesh(mp=parameters)
        netgen.SecondOrder()
    except Exception as error:  # netgen raises its own and plain exceptions
        raise InputError(
            where,
            got=f"a geometry that netgen cannot mesh ({error})",
            expected="closed solids without slivers or gaps",
            hint="repair the geometry in the CAD program, or choose a smaller size.",
        ) from error
    mesh = _read_netgen(netgen, solids, faces)
    require_connected(where, mesh)
    require_positive_jacobians(where, mesh)
    return mesh


def _require_upright(where: str, shape: Any, names: tuple[str, ...]) -> None:
    """Solids must have a positive volume."""
    for name, solid in zip(names, shape.solids, strict=True):
        if not solid.mass > 0:
            raise InputError(
                f"{where}: solid '{name}'",
                got=f"a volume of {solid.mass:.6g} mm^3",
                expected="a volume above 0 (normals that point outwards)",
                hint="the solid is inside out or not closed: reverse or heal it in the CAD "
                "program.",
            )


def _refined_points(refinement: Refinement, shape: Any) -> NDArray[np.float64]:
    """Points of constant size within the box of the shape, shape (n, 3) [mm]."""
    points = ball_points(refinement) * MM
    low, high = box_mm(shape)
    margin = refinement.size * MM
    return points[((points >= low - margin) & (points <= high + margin)).all(axis=1)]


def _read_netgen(netgen: Any, solids: tuple[str, ...], faces: tuple[str, ...]) -> Mesh:
    """Our mesh from netgen's, in our orientation and order."""
    points = np.asarray(netgen.Coordinates()) / MM
    elements = netgen.Elements3D().NumPy()
    nodes = elements["nodes"].astype(np.int64) - 1
    nodes = _abaqus_order(points, nodes)
    owner = np.array([int(netgen.GetMaterial(int(i))) for i in range(1, len(solids) + 1)])
    solid = owner[elements["index"] - 1]
    blocks = tuple(
        ElementBlock("tet10", nodes[solid == k], name)
        for k, name in enumerate(solids)
        if (solid == k).any()
    )
    surfaces, node_sets = _named_faces(netgen, blocks, faces)
    used = np.unique(nodes)
    if len(used) < len(points):  # leave out nodes that no element has
        raise InputError(
            "netgen mesh",
            got=f"{len(points) - len(used)} nodes without an element",
            expected="none",
            hint="mesh the solids one by one to find the faulty one.",
        )
    return Mesh(points=points, blocks=blocks, surfaces=surfaces, node_sets=node_sets)


def _abaqus_order(points: NDArray[np.float64], nodes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Ten-node tetrahedra with positive volume and mid nodes in our order.

    The mid node of an edge is that nearest, on average, to the middle of the chord.
    """
    corners = points[nodes[:, :4]]
    volume = np.linalg.det(corners[:, 1:] - corners[:, :1])
    flip = volume < 0
    edges = np.array(FAMILIES["tet10"].edges)
    middle = points[nodes[:, edges]].mean(axis=2)  # (n, 6, 3)
    gap = np.linalg.norm(points[nodes[:, 4:]][:, None, :, :] - middle[:, :, None, :], axis=-1)
    order = np.median(gap, axis=0).argmin(axis=1)
    refuse_if(
        len(set(order.tolist())) != 6,
        "netgen mesh",
        got="mid nodes that are not each near the middle of one edge",
        expected="one mid node per edge",
        hint="choose a smaller element size.",
    )
    nodes = np.hstack([nodes[:, :4], nodes[:, 4 + order]])
    # swapping corners 0 and 1 swaps edges (1,2)-(2,0) and (0,3)-(1,3)
    nodes[flip] = nodes[flip][:, [1, 0, 2, 3, 4, 6, 5, 8, 7, 9]]
    return nodes


def _named_faces(
    netgen: Any, blocks: tuple[ElementBlock, ...], names: tuple[str, ...]
) -> tuple[dict[str, Surface], dict[str, NDArray[np.int64]]]:
    """Surfaces of outer faces (normals from the elements), node sets of inner ones."""
    table = FaceTable.of(blocks)
    triangles = netgen.Elements2D().NumPy()
    rows = table.find(triangles["nodes"][:, :3].astype(np.int64) - 1)
    number = np.array([int(d.bcname) for d in netgen.FaceDescriptors()])
    face = number[triangles["index"] - 1]
    surfaces: dict[str, Surface] = {}
    node_sets: dict[str, NDArray[np.int64]] = {}
    for name in dict.fromkeys(names):
        here = rows[np.isin(face, [k for k, other in enumerate(names) if other == name])]
        inner = table.shared[here]
        if (~inner).any():
            surfaces[name] = table.surface(name, here[~inner])
        if inner.any():
            node_sets[name] = table.surface(name, here[inner]).nodes
    return surfaces, node_sets
