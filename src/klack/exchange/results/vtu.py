"""Unstructured grids of VTK (``.vtu``) and series (``.pvd``), for ParaView.

All element families have VTK's node order. Numbers are binary, by zlib and base64: valid XML.
"""

import zlib
from base64 import b64encode
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from klack.mesh.mesh import Mesh

__all__ = ["SeriesFile", "VtuGrid", "grid_piece", "write_grid", "write_pvd"]

_CELLS = {
    **{"tri3": 5, "quad4": 9, "tet4": 10, "hex8": 12, "wedge6": 13},
    **{"tri6": 22, "quad8": 23, "tet10": 24, "hex20": 25, "wedge15": 26},
}
_TYPES = {"f4": "Float32", "f8": "Float64", "i8": "Int64", "u1": "UInt8"}
_PIECE = 2**20  # bytes that are compressed at once


class VtuGrid:
    """One mesh, for any number of fields.

    An axisymmetric mesh is in the plane y = 0, x the radius, as for solids; ParaView's *Rotational
    Extrusion* turns it.
    """

    def __init__(self, mesh: Mesh) -> None:
        points = mesh.points
        if mesh.dimension == 2:
            points = np.column_stack([points[:, 0], np.zeros(len(points)), points[:, 1]])
        cells = [block.connectivity for block in mesh.blocks]
        sizes = np.concatenate([np.full(len(c), c.shape[1]) for c in cells])
        types = np.concatenate(
            [np.full(len(b.connectivity), _CELLS[b.family], dtype="u1") for b in mesh.blocks]
        )
        solids = list(mesh.solids)
        solid = np.concatenate(
            [np.full(len(b.connectivity), solids.index(b.solid)) for b in mesh.blocks]
        )
        self._points = len(points)
        nodes = np.concatenate([c.ravel() for c in cells])
        self._piece = grid_piece(points, nodes, sizes, types, {"solid": solid.astype("i8")})

    def write(self, path: Path, fields: Mapping[str, NDArray[Any]], time: float) -> None:
        """Write the grid with fields (n_points,) or (n_points, components) in single precision.

        Two components are those along x and z; ``time`` in [s].
        """
        three = {name: self._three(values) for name, values in fields.items()}
        write_grid(path, self._piece, three, time)

    def _three(self, values: NDArray[Any]) -> NDArray[np.float32]:
        plain = np.asarray(values, dtype=np.float32).reshape(self._points, -1)
        if plain.shape[1] == 2:
            plain = np.column_stack([plain[:, 0], np.zeros_like(plain[:, 0]), plain[:, 1]])
        return plain[:, 0] if plain.shape[1] == 1 else plain


def grid_piece(
    points: NDArray[np.float64],
    nodes: NDArray[Any],
    sizes: NDArray[Any],
    types: NDArray[np.uint8],
    of_cells: Mapping[str, NDArray[Any]],
) -> str:
    """Points and cells as text; ``sizes`` are node counts."""
    return (
        f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(sizes)}">\n'
        f"<Points>\n{data_array('Points', points.astype('f8'))}</Points>\n"
        f"<Cells>\n{data_array('connectivity', nodes.astype('i8'))}"
        f"{data_array('offsets', np.cumsum(sizes).astype('i8'))}"
        f"{data_array('types', types)}</Cells>\n"
        f"<CellData>\n{_arrays(of_cells)}</CellData>\n"
    )


def write_grid(path: Path, piece: str, of_points: Mapping[str, NDArray[Any]], time: float) -> None:
    """Write a grid with its time [s]."""
    stamp = data_array("TimeValue", np.array([time]), tuples=True)
    path.write_text(
        '<?xml version="1.0"?>\n'
        '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" '
        'header_type="UInt64" compressor="vtkZLibDataCompressor">\n<UnstructuredGrid>\n'
        f"<FieldData>\n{stamp}</FieldData>\n{piece}"
        f"<PointData>\n{_arrays(of_points)}</PointData>\n"
        "</Piece>\n</UnstructuredGrid>\n</VTKFile>\n",
        encoding="ascii",
    )


def _arrays(fields: Mapping[str, NDArray[Any]]) -> str:
    return "".join(data_array(name, values) for name, values in fields.items())


@dataclass(frozen=True, slots=True, kw_only=True)
class SeriesFile:
    """File of a series: time [s], part, relative path."""

    time: float
    part: int
    name: str
    file: str


def write_pvd(path: Path, files: Iterable[SeriesFile]) -> None:
    """Write the list of a series of grids."""
    lines = [
        f'<DataSet timestep="{item.time!r}" part="{item.part}" name={quoteattr(item.name)} '
        f"file={quoteattr(item.file)}/>\n"
        for item in files
    ]
    text = (
        '<?xml version="1.0" encoding="UTF-8"?>\n<VTKFile type="Collection" version="1.0" '
        'byte_order="LittleEndian">\n<Collection>\n'
        f"{''.join(lines)}</Collection>\n</VTKFile>\n"
    )
    path.write_text(text, encoding="utf-8")


def data_array(name: str, values: NDArray[Any], *, tuples: bool = False) -> str:
    """Array with head: number of pieces, size of a piece, of the last, compressed sizes."""
    raw = np.ascontiguousarray(values).astype(values.dtype.newbyteorder("<")).tobytes()
    pieces = [zlib.compress(raw[i : i + _PIECE], 4) for i in range(0, len(raw), _PIECE)]
    rest = len(raw) % _PIECE
    head = np.array([len(pieces), _PIECE, rest, *map(len, pieces)], dtype="<u8").tobytes()
    components = values.shape[1] if values.ndim == 2 else 1
    count = f' NumberOfTuples="{len(values)}"' if tuples else ""
    names = ""
    if components == 6:
        names = "".join(
            f' ComponentName{i}="{word}"' for i, word in enumerate(("XX", "YY", "ZZ", "XY", "YZ",
                                                                     "XZ"))
        )  # fmt: skip
    return (
        f'<DataArray type="{_TYPES[values.dtype.str[1:]]}" Name={quoteattr(name)} '
        f'NumberOfComponents="{components}"{names}{count} format="binary">'
        f"{(b64encode(head) + b64encode(b''.join(pieces))).decode()}</DataArray>\n"
    )
