"""A ring of lines with values, as an unstructured grid of VTK."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.exchange.results.vtu import data_array

__all__ = ["write_ring"]

_LINE = 3  # VTK_LINE


def write_ring(
    path: Path,
    radius: float,
    height: float,
    fields: Mapping[str, NDArray[np.float64]],
    time: float,
) -> None:
    """Write as many lines round the axis z as there are values in each field.

    Parameters
    ----------
    path : Path
    radius, height : float [m]
    fields : mapping of str to array, shape (S,)
        Values of the sectors, the first of which begins at +x; in single precision.
    time : float [s]
    """
    count = len(next(iter(fields.values())))
    angle = 2.0 * np.pi / count * np.arange(count)
    points = np.column_stack(
        [radius * np.cos(angle), radius * np.sin(angle), np.full(count, height)]
    )
    ends = np.column_stack([np.arange(count), (np.arange(count) + 1) % count])
    data = "".join(data_array(name, v.astype("f4")) for name, v in fields.items())
    stamp = data_array("TimeValue", np.array([time]), tuples=True)
    path.write_text(
        '<?xml version="1.0"?>\n'
        '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" '
        'header_type="UInt64" compressor="vtkZLibDataCompressor">\n<UnstructuredGrid>\n'
        f"<FieldData>\n{stamp}</FieldData>\n"
        f'<Piece NumberOfPoints="{count}" NumberOfCells="{count}">\n'
        f"<Points>\n{data_array('Points', points)}</Points>\n"
        f"<Cells>\n{data_array('connectivity', ends.ravel().astype('i8'))}"
        f"{data_array('offsets', 2 * np.arange(1, count + 1).astype('i8'))}"
        f"{data_array('types', np.full(count, _LINE, dtype='u1'))}</Cells>\n"
        f"<CellData>\n{data}</CellData>\n<PointData>\n</PointData>\n"
        "</Piece>\n</UnstructuredGrid>\n</VTKFile>\n",
        encoding="ascii",
    )
