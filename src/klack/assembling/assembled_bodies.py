"""Bodies whose stiffness and mass another program has assembled."""

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csr_array

from klack.assembling.held_nodes import held_nodes
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.given_matrices import MatrixReport, checked_body
from klack.bodies.model_files.node_table import read_node_numbers, read_node_table
from klack.bodies.model_files.system import NodeSystem, on_nodes, read_system
from klack.case.bodies import CaseBody, CaseFile
from klack.case.foreign import Matrices
from klack.case.geometry import NodeTable
from klack.errors import AccuracyWarning, InputError
from klack.mesh.files.mesh_file import read_mesh_file
from klack.mesh.mesh import Mesh

__all__ = ["AssembledBody", "assembled_body", "assembled_from_matrices", "node_mesh"]

_ROUNDED = 1e-8
_TURNED = 1e-12


@dataclass(frozen=True, kw_only=True, eq=False)
class AssembledBody:
    """A body of given matrices, and what was found about them.

    Parameters
    ----------
    notes
        Which triangle was stored, where the rows are named, ...
    """

    body: ElasticBody
    report: MatrixReport
    notes: tuple[str, ...]

    def rows(self) -> tuple[tuple[str, str, str], ...]:
        """Table lines: kind, name, value as text."""
        lines = [("matrices", what, value) for what, value in self.report.rows]
        return (*lines, *(("matrices", "note", note) for note in self.notes))


def assembled_from_matrices(case: CaseFile, name: str, mesh: Mesh | None) -> ElasticBody:
    """Make a body from its matrices; see :func:`assembled_body`.

    Warns
    -----
    AccuracyWarning
        Of visible rounding in the files.
    """
    made = assembled_body(case, name, mesh)
    if made.report.strain > _ROUNDED:
        warnings.warn(
            f"the matrices of '{name}' are rounded: under a rigid motion "
            f"{made.report.strain:.1g} of the forces remain, which should cancel. Try: write "
            "them with more digits, in binary form or in double precision.",
            AccuracyWarning,
            stacklevel=2,
        )
    return made.body


def assembled_body(case: CaseFile, name: str, mesh: Mesh | None = None) -> AssembledBody:
    """Read, place and check the matrices of a body.

    Parameters
    ----------
    name
        Of a body with the key ``matrices``.
    mesh
        As placed by the case; default: as drawn.
    """
    given = case.bodies[name]
    where = f"{case.path or 'case'}: bodies.{name}.matrices"
    if given.matrices is None:
        hint = "name the files of stiffness and mass there."
        raise InputError(where, got="no matrices", expected="the key 'matrices'", hint=hint)
    drawn, numbers = _drawn(given, where)
    matrices = given.matrices
    system = read_system(
        matrices.stiffness,
        matrices.mass,
        stiffness_name=matrices.stiffness_name,
        mass_name=matrices.mass_name,
        dofs=matrices.dofs,
    )
    placed = on_nodes(system, numbers, drawn.dimension)
    mesh = drawn if mesh is None else mesh
    K, M = _in_si(placed, matrices)
    K, M = _turned(where, drawn, mesh, K, M, placed.absent)
    body, report = checked_body(
        name,
        mesh,
        K,
        M,
        fixed_nodes=held_nodes(given, mesh),
        absent=placed.absent,
        where=where,
        numbers=numbers,
        units=matrices.units,
    )
    return AssembledBody(body=body, report=report, notes=placed.notes)


def node_mesh(table: NodeTable, dimension: int, where: str) -> tuple[Mesh, NDArray[np.int64]]:
    """Mesh of nodes alone with the sets of a case, and the number of each node."""
    numbers, points = read_node_table(table.file, table.unit, dimension)
    order = np.argsort(numbers)
    sets = {}
    for name, members in table.sets.items():
        listed = (
            np.unique(np.array(members, dtype=np.int64))
            if isinstance(members, tuple)
            else read_node_numbers(members)
        )
        place = np.minimum(np.searchsorted(numbers[order], listed), len(numbers) - 1)
        unknown = numbers[order][place] != listed
        if np.any(unknown) or not len(listed):
            raise InputError(
                f"{where}.sets.{name}",
                got=f"node {listed[unknown][0]}" if len(listed) else "no nodes",
                expected=f"nodes of {table.file.name} ({numbers.min()} to {numbers.max()})",
                hint="give the numbers that the nodes have in that file.",
            )
        sets[name] = np.sort(order[place])
    return Mesh(points=points, blocks=(), node_sets=sets), numbers


def _drawn(given: CaseBody, where: str) -> tuple[Mesh, NDArray[np.int64]]:
    """Mesh where its program has it, and the number of each node."""
    geometry = given.geometry
    if geometry.mesh is not None:
        mesh = geometry.mesh
        model = read_mesh_file(mesh.file, mesh.unit, solids_only=mesh.solids_only)
        return model.mesh, model.node_numbers
    if geometry.nodes is not None:
        nodes = where.removesuffix(".matrices") + ".geometry.nodes"
        return node_mesh(geometry.nodes, geometry.dimension, nodes)
    raise InputError(
        where,
        got="matrices with a shape that klack meshes",
        expected="geometry.mesh or geometry.nodes of the program that wrote them",
        hint="give the mesh file of these matrices.",
    )


def _in_si(placed: NodeSystem, matrices: Matrices) -> tuple[csr_array, csr_array]:
    K, M = placed.K.copy(), placed.M.copy()
    K.data *= matrices.units.stiffness
    M.data *= matrices.units.mass
    return K, M


def _turned(
    where: str,
    drawn: Mesh,
    mesh: Mesh,
    K: csr_array,
    M: csr_array,
    absent: NDArray[np.int64],
) -> tuple[csr_array, csr_array]:
    """Rotate matrices with a tilted body: u' = T u, K' = T K T^T."""
    if mesh.points.shape != drawn.points.shape:
        raise InputError(
            where,
            got=f"a mesh of {mesh.node_count} nodes",
            expected=f"the {drawn.node_count} nodes of its file",
            hint="use the mesh of the file unchanged.",
        )
    if mesh.dimension == 2:
        return K, M
    # Kabsch (1976): the rotation that carries one set of points into the other
    old = drawn.points - drawn.points.mean(axis=0)
    new = mesh.points - mesh.points.mean(axis=0)
    left, _, right = np.linalg.svd(new.T @ old)
    turn = left @ right
    if np.abs(turn - np.eye(3)).max() <= _TURNED:
        return K, M
    if len(absent):
        raise InputError(
            where,
            got="a tilted body whose matrices are constrained",
            expected="a free body",
            hint="write its matrices without boundary conditions.",
        )
    T = csr_array(block_diag([turn] * mesh.node_count, format="csr"))
    K, M = (csr_array(T @ A @ T.T.tocsr()) for A in (K, M))
    return (csr_array((K + K.T.tocsr()) * 0.5), csr_array((M + M.T.tocsr()) * 0.5))
