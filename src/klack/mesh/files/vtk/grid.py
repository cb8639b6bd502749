"""An unstructured grid of VTK as its files hold it, and numbers in their text."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.input.plain_numbers import plain_numbers

__all__ = ["VtkGrid", "numbers_in_text", "refuse"]


@dataclass(frozen=True, slots=True, kw_only=True)
class VtkGrid:
    """Points, cells and their data.

    Parameters
    ----------
    points : array, shape (n_points, 3)
    connectivity : int array, shape (n,)
        Points of all cells, one cell after the other, counted from 0.
    offsets : int array, shape (n_cells + 1,)
        Where the points of every cell begin.
    types : int array, shape (n_cells,)
    point_data, cell_data : mappings of name to array
        Those of one integer per point or cell.
    """

    points: NDArray[np.float64]
    connectivity: NDArray[np.int64]
    offsets: NDArray[np.int64]
    types: NDArray[np.int64]
    point_data: Mapping[str, NDArray[np.int64]]
    cell_data: Mapping[str, NDArray[np.int64]]


def refuse(where: str, got: str, expected: str, hint: str = "") -> NoReturn:
    """Raise for a truncated file or damaged."""
    raise InputError(
        where,
        got=got,
        expected=expected,
        hint=hint or "the file may be truncated: save it again as an unstructured grid.",
    )


def numbers_in_text(where: str, text: bytes, kind: np.dtype) -> np.ndarray:
    """Numbers between blanks; raise for anything else."""
    values = plain_numbers(text, float if kind.kind == "f" else int)
    if values is None:
        refuse(where, "a value that is not a number", f"numbers of type {kind.name}")
    return values
