"""Nodes without elements: a table of numbers and coordinates, and lists of node numbers.

One node per line: number, x, y, z (or r, z); comments start with ``#``, ``%``, ``!`` or ``$``, a
heading of words may come first.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.bodies.model_files.number_lines import number_rows, numbers_in, whole_numbers
from klack.errors import InputError, refuse_if
from klack.mesh.files.catalogue import MESH_FORMATS
from klack.mesh.files.mesh_file import read_mesh_file

__all__ = ["read_node_numbers", "read_node_table"]

_COMMENTS = b"#%!$"
_LONGEST = 10_000


def read_node_table(
    path: Path, unit_length: float, dimension: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Read numbers and points [m] of nodes in the order of the file; numbers must differ.

    Parameters
    ----------
    path
        A table, or a mesh file whose nodes are taken.
    unit_length [m]
    dimension
        3 for x, y, z; 2 for r, z.
    """
    if path.suffix.lower() in MESH_FORMATS and not _is_table(path, dimension):
        model = read_mesh_file(path, unit_length)
        _wrong_if(
            model.mesh.dimension != dimension,
            str(path),
            f"nodes of dimension {model.mesh.dimension}",
            dimension,
        )
        return model.node_numbers, model.mesh.points
    table = _rows(path, dimension + 1)
    _wrong_if(not len(table), str(path), "no nodes", dimension)
    numbers = whole_numbers(str(path), table[:, 0], "a node number")
    _wrong_if(len(np.unique(numbers)) < len(numbers), str(path), "a node number twice", dimension)
    points = table[:, 1:] * unit_length
    _wrong_if(
        not np.all(np.isfinite(points)), str(path), "coordinates that are not finite", dimension
    )
    _wrong_if(
        dimension == 2 and points[:, 0].min() < 0,
        str(path),
        f"r = {points[:, 0].min():g} m",
        dimension,
    )
    return numbers, points


def read_node_numbers(path: Path) -> NDArray[np.int64]:
    """Read node numbers with blanks, commas or lines between them."""
    lines = [line for line in path.read_bytes().splitlines() if line.strip()[:1] not in _signs()]
    values = numbers_in(b"\n".join(lines))
    if values is None or not len(values):
        raise InputError(
            str(path),
            got="no list of numbers",
            expected="node numbers, with blanks, commas or lines between them",
            hint="one number per line; comments start with #.",
        )
    return np.unique(whole_numbers(str(path), values, "a node number"))


def _signs() -> tuple[bytes, ...]:
    return tuple(bytes([sign]) for sign in _COMMENTS)


def _is_table(path: Path, dimension: int) -> bool:
    """True if the first line is a row of numbers, whatever the ending of the file."""
    with path.open("rb") as stream:
        values = numbers_in(stream.readline(_LONGEST))
    return values is not None and len(values) == dimension + 1


def _rows(path: Path, columns: int) -> NDArray[np.float64]:
    with path.open("rb") as stream:
        if stream.read(3) != b"\xef\xbb\xbf":
            stream.seek(0)
        start, line = stream.tell(), 1
        # a heading of words
        while first := stream.readline(_LONGEST):
            if numbers_in(first) is not None or first.strip()[:1] in _signs():
                break
            if line > 1 or not first.strip()[:1].isalpha():
                break
            start, line = stream.tell(), line + 1
        stream.seek(start)
        return number_rows(stream, columns, where=str(path), line=line, comments=_COMMENTS)


def _wrong_if(wrong: object, where: str, got: str, dimension: int) -> None:
    refuse_if(
        wrong,
        where,
        got=got,
        expected="number, x, y, z of each node" if dimension == 3 else "number, r, z of each node",
        hint="one node per line; an axisymmetric body needs 'model: axisymmetric'.",
    )
