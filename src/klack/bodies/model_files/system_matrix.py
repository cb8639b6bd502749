"""One stiffness or mass matrix as its file has it, and what its rows mean."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from klack.errors import InputError, refuse_if

__all__ = [
    "Role",
    "RowPlaces",
    "SystemMatrix",
    "WhichMatrixError",
    "choose_matrix",
    "read_row_places",
    "symmetric_matrix",
]


Role = Literal["stiffness", "mass"]

_LARGEST_ASYMMETRY = 1e-6
_SEEN_ASYMMETRY = 1e-12
_USUAL_NAMES: dict[Role, frozenset[str]] = {
    "stiffness": frozenset(
        "k stiffness stiff stif kmat kaa kaax kgg kggx kjj kjjx kll kff kxx kbb k2gg".split()
    ),
    "mass": frozenset("m mass mas mmat maa maax mgg mggx mjj mjjx mll mff mxx mbb m2gg".split()),
}


@dataclass(frozen=True, slots=True, eq=False)
class RowPlaces:
    """Node and direction of every row of a matrix.

    Parameters
    ----------
    node (n,)
        Number in its program.
    direction (n,)
        1, 2, 3 for x, y, z (1, 2 for r, z of a body of revolution); 4 to 6 for rotations.
    """

    node: NDArray[np.int64]
    direction: NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SystemMatrix:
    """A symmetric matrix in the units of its file, both triangles.

    Parameters
    ----------
    name
        Empty where the file holds one matrix without name.
    rows
        None where the file does not say.
    held
        Constrained degrees of freedom that the program has taken out.
    notes
        What was found while reading.
    """

    path: Path
    name: str
    matrix: csr_array
    rows: RowPlaces | None = None
    held: RowPlaces | None = None
    notes: tuple[str, ...] = ()


class WhichMatrixError(InputError):
    """A file holds several matrices, or not the wanted one; ``names`` are those it has."""

    def __init__(
        self, names: tuple[str, ...], where: str, *, got: str, expected: str, hint: str
    ) -> None:
        super().__init__(where, got=got, expected=expected, hint=hint)
        self.names = names


def choose_matrix(where: str, names: Iterable[str], wanted: str | None, role: Role | None) -> str:
    """Name of the matrix: the wanted one, the only one, or the one of the usual name."""
    known = list(dict.fromkeys(names))
    if wanted is not None:
        found = [name for name in known if name == wanted] or [
            name for name in known if name.lower() == wanted.lower()
        ]
    elif len(known) == 1:
        found = known
    else:
        usual = _USUAL_NAMES.get(role, frozenset()) if role else frozenset()
        found = [name for name in known if name.lower() in usual]
    if len(found) == 1:
        return found[0]
    listed = ", ".join(repr(name) for name in known[:12]) + (", ..." if len(known) > 12 else "")
    key = f"{role or 'stiffness'}_name"
    raise WhichMatrixError(
        tuple(known),
        where,
        got=f"no matrix '{wanted}'" if wanted else f"{len(known)} matrices",
        expected=f"one of: {listed}" if known else "a matrix",
        hint=f"select one with {key} (klack inspect: --matrix)."
        if known
        else "check what was written to this file.",
    )


def symmetric_matrix(
    where: str,
    row: NDArray[np.int64],
    column: NDArray[np.int64],
    value: NDArray[np.float64],
    size: int,
) -> tuple[csr_array, tuple[str, ...]]:
    """Symmetric matrix from entries (from zero) of a lower, an upper or both triangles, and notes.

    Rejects entries outside, twice or not finite, fewer entries than rows, and a matrix that is not
    symmetric (with its asymmetry).
    """
    _check_entries(where, row, column, value, size)
    A = coo_array((value, (row, column)), shape=(size, size)).tocsr()
    refuse_if(
        A.nnz < len(value),
        where,
        got=f"{len(value) - A.nnz} duplicate entries",
        expected="each entry once",
        hint="write the matrix again; do not join files of several steps.",
    )
    below, above = bool(np.any(row > column)), bool(np.any(row < column))
    if not (below or above):
        return A, ("it is diagonal",)
    if below and above:
        turned = A.T.tocsr()
        if bool(
            np.array_equal(A.indptr, turned.indptr) and np.array_equal(A.indices, turned.indices)
        ):
            difference = A.data - turned.data
            del turned
            notes = _asymmetry_notes(where, A, difference)
            A.data -= 0.5 * difference
            return A, notes
        if _has_both(A):
            odd = csr_array(A - turned)
            notes = _asymmetry_notes(where, A, np.asarray(odd.data))
            return csr_array(A - 0.5 * odd), notes
    # also a triangle in the order of another program, which is none in ours
    A = csr_array(A + A.T.tocsr())
    A.setdiag(A.diagonal() / 2)
    return A, ("one triangle was stored",)


def _has_both(A: csr_array) -> bool:
    """True if any (i, j) is stored together with (j, i)."""
    stored = csr_array((np.ones(A.nnz, dtype=np.int8), A.indices, A.indptr), shape=A.shape)
    return int(stored.multiply(stored.T.tocsr()).nnz) > int(np.count_nonzero(stored.diagonal()))


def _asymmetry_notes(where: str, A: csr_array, difference: NDArray[np.float64]) -> tuple[str, ...]:
    """Notes on asymmetry; reject a clear one."""
    size = float(np.linalg.norm(A.data))
    asymmetry = float(np.linalg.norm(difference)) / size if size else 0.0
    refuse_if(
        not asymmetry <= _LARGEST_ASYMMETRY,
        where,
        got=f"a matrix that is not symmetric: |A - A^T| / |A| = {asymmetry:.2g}",
        expected=f"at most {_LARGEST_ASYMMETRY:g}",
        hint="write K and M of a linear elastic model without friction, "
        "follower loads, rotating frame or dampers.",
    )
    if asymmetry <= _SEEN_ASYMMETRY:
        return ()
    return (f"asymmetry {asymmetry:.1g}, made symmetric",)


def _check_entries(
    where: str,
    row: NDArray[np.int64],
    column: NDArray[np.int64],
    value: NDArray[np.float64],
    size: int,
) -> None:
    refuse_if(
        size < 1 or len(value) < size,
        where,
        got=f"{size} rows with {len(value)} entries",
        expected="one entry or more in every row",
        hint="the file is truncated, or its mass matrix has nodes without mass.",
    )
    for index in (row, column):
        low, high = int(index.min()), int(index.max())
        if low < 0 or high >= size:
            raise InputError(
                where,
                got=f"an entry in row or column {(low if low < 0 else high) + 1}",
                expected=f"1 to {size}",
                hint="the file is damaged; write it again.",
            )
    if not np.all(np.isfinite(value)):
        raise InputError(
            where,
            got=f"{np.count_nonzero(~np.isfinite(value))} entries that are not finite numbers",
            expected="finite numbers",
            hint="the run that wrote the matrix has failed; check its log.",
        )


_LARGEST = 1 << 30
_SPLIT = re.compile(r"[\s,;]+")
_POINTED = re.compile(r"^(\d{1,15})\.([1-6])$")
_DIRECTION = {
    **{str(k): k for k in range(1, 7)},
    **{f"{k}.": k for k in range(1, 7)},
    **{"x": 1, "y": 2, "z": 3, "ux": 1, "uy": 2, "uz": 3, "u1": 1, "u2": 2, "u3": 3},
    **{"rotx": 4, "roty": 5, "rotz": 6, "ur1": 4, "ur2": 5, "ur3": 6},
}
_TURNED = {"r": 1, "ur": 1}


def read_row_places(path: Path) -> RowPlaces:
    """Read the table.

    Rows are ``node.direction`` (CalculiX ``.dof``), ``node, direction`` or ``row, node,
    direction`` (mapping of ANSYS HBMAT). A direction is 1 to 6, x, y, z, UX, UY, UZ, R, Z, or ROTX
    ... for rotations.
    """
    if path.stat().st_size > _LARGEST:
        hint = "give only the table of node and direction."
        raise InputError(str(path), got="more than 1 GB", expected="a table", hint=hint)
    node: list[int] = []
    direction: list[int] = []
    turned = False
    # undecodable letters cannot be part of a table
    lines = path.read_bytes().decode("utf-8-sig", "replace").splitlines()
    for number, line in enumerate(lines, start=1):
        words = [word for word in _SPLIT.split(line.strip().lower()) if word]
        if not words or words[0][0] in "#%!*$":
            continue
        pointed = _POINTED.match(words[0]) if len(words) == 1 else None
        if pointed:
            words = [pointed[1], pointed[2]]
        turned = turned or words[-1] in _TURNED
        place = _place(words, turned)
        if place is None:
            if not node and not any(word[0].isdigit() for word in words):
                continue  # a heading
            raise _wrong(f"{path}:{number}", f"'{line.strip()[:40]}'")
        if len(words) == 3 and int(words[0]) != len(node) + 1:
            raise _wrong(f"{path}:{number}", f"row {words[0]} after row {len(node)}")
        node.append(place[0])
        direction.append(place[1])
    places = RowPlaces(np.array(node, dtype=np.int64), np.array(direction, dtype=np.int64))
    if not node:
        raise _wrong(str(path), "no rows")
    if len(np.unique(8 * places.node + places.direction)) < len(node):
        raise _wrong(str(path), "the same node and direction twice")
    return places


def _place(words: list[str], turned: bool) -> tuple[int, int] | None:
    if len(words) not in (2, 3) or not all(word.isascii() for word in words):
        return None
    if not all(word.isdigit() and len(word) < 16 for word in words[:-1]) or words[-2] == "0":
        return None
    known = _DIRECTION | _TURNED
    way = known.get(words[-1])
    if way is None:
        return None
    return int(words[-2]), 2 if turned and words[-1] in ("z", "uz") else way


def _wrong(where: str, got: str) -> InputError:
    return InputError(
        where,
        got=got,
        expected="node and direction of one row (1 to 3, or x, y, z), in the order of the matrix",
        hint="one line per row, such as '17, x'; CalculiX writes 17.1, HBMAT a mapping file.",
    )
