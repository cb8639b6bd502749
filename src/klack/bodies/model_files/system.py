"""Stiffness and mass of one body from files, and their rows put onto the nodes of a mesh."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from klack.bodies.model_files.matrices import read_matrix
from klack.bodies.model_files.system_matrix import RowPlaces, SystemMatrix, read_row_places
from klack.errors import InputError, refuse_if

__all__ = ["FileSystem", "NodeSystem", "on_nodes", "read_system"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FileSystem:
    """K and M with the same rows, in the units of the files.

    Parameters
    ----------
    rows
        Node and direction of each; None where no file says it.
    held
        Degrees of freedom that the program has taken out.
    """

    where: str
    K: csr_array
    M: csr_array
    rows: RowPlaces | None
    held: RowPlaces | None
    notes: tuple[str, ...]

    @property
    def node(self) -> NDArray[np.int64] | None:
        """Node of each row, where known."""
        return None if self.rows is None else self.rows.node

    @property
    def direction(self) -> NDArray[np.int64] | None:
        """Direction (1, 2, 3) of each row, where known."""
        return None if self.rows is None else self.rows.direction


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NodeSystem:
    """K and M of all degrees of freedom of a mesh, in the units of the files.

    Row ``dimension * i + d`` belongs to node i and direction d.

    Parameters
    ----------
    absent
        Sorted degrees of freedom that the files leave out: their program holds them at zero.
    """

    K: csr_array
    M: csr_array
    absent: NDArray[np.int64]
    notes: tuple[str, ...]


def read_system(
    stiffness: Path,
    mass: Path,
    *,
    stiffness_name: str | None = None,
    mass_name: str | None = None,
    dofs: Path | None = None,
) -> FileSystem:
    """Read both matrices, which may be in one file, and what their rows are.

    Parameters
    ----------
    stiffness_name, mass_name
        In files of several matrices.
    dofs
        Table of node and direction; overrides what the files say.
    """
    K = read_matrix(stiffness, name=stiffness_name, role="stiffness")
    M = read_matrix(mass, name=mass_name, role="mass")
    where = str(stiffness) if stiffness == mass else f"{stiffness}, {mass.name}"
    refuse_if(
        stiffness == mass and K.name == M.name,
        where,
        got=f"the matrix '{K.name}' as stiffness and as mass",
        expected="two matrices",
        hint="name them with stiffness_name and mass_name, or give the file of the other one.",
    )
    notes = (*(f"K: {note}" for note in K.notes), *(f"M: {note}" for note in M.notes))
    rows, m_rows = K.rows, M.rows
    if dofs is not None:
        rows, m_rows = read_row_places(dofs), None
    elif rows is None or m_rows is None:
        rows, m_rows = rows or m_rows, None
    _check_rows(where, K, M, rows, m_rows, dofs)
    return FileSystem(
        where=where,
        K=K.matrix,
        M=M.matrix if m_rows is None or rows is None else _in_order(where, M, rows, m_rows),
        rows=rows,
        held=K.held,
        notes=notes,
    )


def _check_rows(
    where: str,
    K: SystemMatrix,
    M: SystemMatrix,
    rows: RowPlaces | None,
    m_rows: RowPlaces | None,
    dofs: Path | None,
) -> None:
    n = K.matrix.shape[0]
    # matrices by node and direction may leave out places without entries
    refuse_if(
        M.matrix.shape[0] != n and m_rows is None,
        where,
        got=f"K with {n} rows and M with {M.matrix.shape[0]}",
        expected="the same rows",
        hint="write both in one run, with the same boundary conditions.",
    )
    if rows is not None and len(rows.node) != n:
        raise InputError(
            str(dofs or where),
            got=f"{len(rows.node)} places for {n} rows",
            expected="node and direction of every row",
            hint="the table must come from the same run as the matrices.",
        )


def _in_order(where: str, M: SystemMatrix, rows: RowPlaces, m_rows: RowPlaces) -> csr_array:
    """Mass with the rows of the stiffness."""
    key, m_key = 8 * rows.node + rows.direction, 8 * m_rows.node + m_rows.direction
    if np.array_equal(key, m_key):
        return M.matrix
    order = np.argsort(key)
    place = np.searchsorted(key[order], m_key)
    place[place == len(key)] = 0
    at = order[place]
    lost = key[at] != m_key
    if np.any(lost):
        raise InputError(
            where,
            got=f"mass at node {m_rows.node[lost][0]}, which has no stiffness",
            expected="K and M of the same degrees of freedom",
            hint="remove point masses from the model, or write both in one run.",
        )
    return _moved(M.matrix, at, len(key))


def _moved(A: csr_array, place: NDArray[np.int64], size: int) -> csr_array:
    """Matrix whose row i comes to stand in row ``place[i]``."""
    moved: NDArray[Any] = place.astype(np.int32 if size < 2**31 else np.int64)
    row: NDArray[Any] = np.repeat(moved, np.diff(A.indptr))
    column: NDArray[Any] = moved[A.indices]
    return coo_array((A.data, (row, column)), shape=(size, size)).tocsr()


def on_nodes(system: FileSystem, numbers: NDArray[np.int64], dimension: int) -> NodeSystem:
    """Put the rows onto nodes; rejects rotations and a number of rows that does not fit.

    Parameters
    ----------
    numbers (n,)
        Of every node in its program.
    """
    n, size = len(numbers), dimension * len(numbers)
    rows = system.rows
    if rows is None:
        _require_full(system, n, dimension)
        notes = system.notes
        if np.any(np.diff(numbers) < 0):
            notes = (*notes, "rows in the order of the nodes in the file, not by number")
        return NodeSystem(K=system.K, M=system.M, absent=np.empty(0, np.int64), notes=notes)
    _require_translations(system.where, rows, dimension)
    order = np.argsort(numbers)
    place = np.minimum(np.searchsorted(numbers[order], rows.node), n - 1)
    node = order[place]
    other = numbers[node] != rows.node
    if np.any(other):
        strange = np.unique(rows.node[other])
        raise InputError(
            system.where,
            got=f"{len(strange)} nodes that the mesh does not have, the first is {strange[0]}",
            expected=f"the nodes of the mesh ({numbers.min()} to {numbers.max()})",
            hint="give the mesh of the same model, all of its solids; no point masses, pilot or "
            "reference nodes.",
        )
    at = dimension * node + rows.direction - 1
    absent = np.setdiff1d(np.arange(size), at)
    return NodeSystem(
        K=_moved(system.K, at, size),
        M=_moved(system.M, at, size),
        absent=absent,
        notes=system.notes,
    )


def _require_full(system: FileSystem, nodes: int, dimension: int) -> None:
    rows = system.K.shape[0]
    if rows == dimension * nodes:
        return
    hint = (
        "give the node and direction of each row with 'dofs'; constrained degrees of freedom "
        "may be missing."
    )
    if rows % nodes == 0:
        hint = (
            f"the matrices have {rows // nodes} degrees of freedom per node: use solid elements "
            "without rotations, and 'model: axisymmetric' if there are only r and z."
        )
    raise InputError(
        system.where,
        got=f"{rows} rows for {nodes} nodes",
        expected=f"{dimension * nodes} rows ({dimension} per node)",
        hint=hint,
    )


def _require_translations(where: str, rows: RowPlaces, dimension: int) -> None:
    turned = rows.direction > dimension
    if np.any(turned):
        letters = "xyz" if dimension == 3 else "rz"
        raise InputError(
            where,
            got=f"direction {rows.direction[turned][0]} at node {rows.node[turned][0]} and "
            f"{np.count_nonzero(turned)} rows of that kind",
            expected=f"the directions {', '.join(letters)}",
            hint="use only solid elements: no shells, beams, couplings or rotary inertia.",
        )
