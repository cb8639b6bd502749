"""The assembled matrices of ANSYS, ``.full``: K and M with the node and direction of each row.

A chain of records ``[length, flags, data, length]`` of 4-byte words (fdfull.inc). The second holds
the numbers of equations and entries and the places of all others. K and M are stored row by row,
upper triangle with the diagonal entry last. Degrees of freedom with a negative mark are
constrained and taken out. Checked against the package ansys-mapdl-reader, which believes every
count of a file.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.bodies.model_files.system_matrix import (
    Role,
    RowPlaces,
    SystemMatrix,
    choose_matrix,
    symmetric_matrix,
)
from klack.errors import InputError, refuse_if

__all__ = ["read_ansys_full"]

_STANDARD_HEADER = 100
_FULL_FILE = -4
_INTEGER, _SINGLE, _ZLIB, _SPARSE = 0x80000000, 0x40000000, 0x20000000, 0x08000000
# places in the header of the file
_EQUATIONS, _LUMPED, _UNSYMMETRIC, _NODES, _DOFS = 1, 10, 13, 32, 7
_STIFFNESS, _MASS, _MARKS = (18, 19), (26, 27), (35, 36)
_K_ENTRIES, _M_ENTRIES = (8, 9), (33, 21)


@dataclass(frozen=True, slots=True)
class _Records:
    path: Path
    words: NDArray[np.int32]

    def integers(self, at: int) -> tuple[NDArray[np.int32], int]:
        """Integers of the record at word ``at``, and the next record."""
        data, flags, behind = self._record(at)
        _damaged_if(
            not flags & _INTEGER, self.path, f"numbers instead of integers at byte {4 * at}"
        )
        return data, behind

    def numbers(self, at: int) -> tuple[NDArray[np.float64], int]:
        """Doubles of the record at word ``at``, and the next record."""
        data, flags, behind = self._record(at)
        _damaged_if(
            flags & (_INTEGER | _SINGLE) or len(data) % 2,
            self.path,
            f"integers instead of numbers at byte {4 * at}",
        )
        return data.view(data.dtype.newbyteorder("=")).view(np.float64), behind

    def _record(self, at: int) -> tuple[NDArray[np.int32], int, int]:
        words = self.words
        count = int(words[at]) if 0 <= at < len(words) - 2 else 0
        behind = at + count + 3
        _damaged_if(
            count <= 0 or behind > len(words) or words[behind - 1] != count,
            self.path,
            f"no complete record at byte {4 * at}",
        )
        flags = int(words[at + 1]) & 0xFFFFFFFF
        refuse_if(
            flags & (_ZLIB | _SPARSE),
            str(self.path),
            got="compressed records",
            expected="records that are not compressed",
            hint="write the matrices with HBMAT in ASCII form (see the page on matrices).",
        )
        return words[at + 2 : behind - 1], flags, behind


def read_ansys_full(path: Path, name: str | None, role: Role | None) -> SystemMatrix:
    """Read K or M, by its name or its role.

    Rejects unsymmetric matrices, lumped mass, nodes with unlike degrees of freedom, compressed and
    damaged files.
    """
    words = np.fromfile(path, dtype="<i4")
    if len(words) < 206 or words[0] not in (_STANDARD_HEADER, 4 * _STANDARD_HEADER):
        big = len(words) and words[:1].byteswap()[0] == _STANDARD_HEADER
        raise _damaged(path, "big-endian words" if big else "another kind of file")
    file = _Records(path, words)
    _, at = file.integers(0)
    head, at = file.integers(at)
    _damaged_if(len(head) < 40 or head[0] != _FULL_FILE, path, f"a file of kind {head[0]}")
    _check_kind(path, head)
    chosen = choose_matrix(str(path), ("K", "M"), name, role)
    start, entries = (_STIFFNESS, _K_ENTRIES) if chosen == "K" else (_MASS, _M_ENTRIES)
    refuse_if(
        not _long(head, entries) or not _long(head, start),
        str(path),
        got=f"no matrix {chosen}",
        expected="stiffness and mass",
        hint="write the file in a modal analysis (ANTYPE,MODAL and WRFULL).",
    )
    rows, held = _places(file, head, at)
    row, column, value = _entries(file, head, _long(head, start), _long(head, entries))
    free = np.flatnonzero(~held)
    number = np.full(len(held), -1, dtype=np.int64)
    number[free] = np.arange(len(free))
    kept = ~(held[row] | held[column])
    matrix, notes = symmetric_matrix(
        str(path), number[row[kept]], number[column[kept]], value[kept], len(free)
    )
    return SystemMatrix(
        path=path,
        name=chosen,
        matrix=matrix,
        rows=RowPlaces(rows.node[free], rows.direction[free]),
        held=RowPlaces(rows.node[held], rows.direction[held]) if np.any(held) else None,
        notes=notes,
    )


def _long(head: NDArray[np.int32], places: tuple[int, int]) -> int:
    low, high = (int(head[k]) & 0xFFFFFFFF for k in places)
    return low | (high << 32)


def _check_kind(path: Path, head: NDArray[np.int32]) -> None:
    for place, what in ((_LUMPED, "a lumped mass matrix"), (_UNSYMMETRIC, "unsymmetric matrices")):
        if head[place]:
            raise InputError(
                str(path),
                got=what,
                expected="symmetric matrices with consistent mass",
                hint="use LUMPM,OFF and NROPT,FULL or AUTO in the solution, without friction.",
            )


def _places(
    file: _Records, head: NDArray[np.int32], at: int
) -> tuple[RowPlaces, NDArray[np.bool_]]:
    labels, at = file.integers(at)
    nodes, _ = file.integers(at)
    counts, at = file.integers(_long(head, _MARKS))
    marks, _ = file.integers(at)
    equations, directions = int(head[_EQUATIONS]), int(head[_DOFS])
    uniform = len(counts) == len(nodes) and bool(np.all(counts == len(labels)))
    refuse_if(
        not uniform or directions != len(labels) or equations != len(nodes) * len(labels),
        str(file.path),
        got=f"{equations} equations of {len(nodes)} nodes with {len(labels)} directions",
        expected="nodes that all have the same degrees of freedom",
        hint="export a model of solid elements only, without mass, contact or beam elements.",
    )
    _damaged_if(
        len(marks) != equations or np.any(nodes < 1) or np.any((labels < 1) | (labels > 6)),
        file.path,
        "inconsistent nodes, directions or marks",
    )
    rows = RowPlaces(
        np.repeat(nodes, len(labels)).astype(np.int64),
        np.tile(labels, len(nodes)).astype(np.int64),
    )
    return rows, marks < 0


def _entries(
    file: _Records, head: NDArray[np.int32], at: int, expected: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Entries of one matrix; the last column of a row is the row itself."""
    equations = int(head[_EQUATIONS])
    columns, values, lengths, read = [], [], [], 0
    for _ in range(equations):
        part, at = file.integers(at)
        value, at = file.numbers(at)
        _damaged_if(
            len(part) != len(value), file.path, f"{len(part)} columns with {len(value)} values"
        )
        columns.append(part)
        values.append(value)
        lengths.append(len(part))
        read += len(part)
        if read >= expected:
            break
    column: NDArray[np.int64] = np.concatenate(columns).astype(np.int64) - 1
    _damaged_if(
        read != expected or column.min() < 0 or column.max() >= equations,
        file.path,
        f"{read} entries instead of {expected}, or columns out of range",
    )
    row = np.repeat(column[np.cumsum(lengths) - 1], lengths)
    return row, column, np.concatenate(values)


def _damaged(path: Path, got: str) -> InputError:
    return InputError(
        str(path),
        got=got,
        expected="a .full file of ANSYS with assembled matrices",
        hint="write it with WRFULL,1 in a modal analysis; copy it in binary mode.",
    )


def _damaged_if(wrong: object, path: Path, got: str) -> None:
    if wrong:
        raise _damaged(path, got)
