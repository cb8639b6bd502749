"""State space A, B, C, D from a file, as it was written: no units, no conversion."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.model_files.named_arrays import read_named_arrays

__all__ = ["FileStateSpace", "read_state_space"]


@dataclass(frozen=True, kw_only=True, eq=False)
class FileStateSpace:
    """First-order model ``x' = A x + B F``, ``y = C x + D F`` in the units of its file.

    Parameters
    ----------
    path : Path
    A, B, C, D : array, shapes (n, n), (n, n_inputs), (n_outputs, n), (n_outputs, n_inputs)
    input_names, output_names : tuple of str
        Empty where the file gives none.
    """

    path: Path
    A: NDArray[np.float64]
    B: NDArray[np.float64]
    C: NDArray[np.float64]
    D: NDArray[np.float64]
    input_names: tuple[str, ...] = ()
    output_names: tuple[str, ...] = ()


def read_state_space(path: Path) -> FileStateSpace:
    """Read A, B, C and D; a D that is not there is zero.

    Parameters
    ----------
    path : Path
        ``.mat`` (plain arrays, or one structure such as ``sys``), ``.npz``, or text with named
        blocks: CSV and ANSYS ``SPMWRITE``.

    Raises
    ------
    InputError
        If a matrix is missing, not finite, or of the wrong shape.
    """
    held = read_named_arrays(path)
    group = held.group_with(("A",), ("B",), ("C",))
    A, B, C, D = (held.find(name, group=group) for name in "ABCD")
    if A is None or B is None or C is None:  # found above
        raise AssertionError
    if D is None or D.size == 0:
        D = np.zeros((len(C), B.shape[1]))
    if D.shape == (1, 1) and D[0, 0] == 0.0:
        D = np.zeros((len(C), B.shape[1]))
    n = len(A)
    shapes = {"A": (n, n), "B": (n, B.shape[1]), "C": (len(C), n), "D": (len(C), B.shape[1])}
    for name, matrix in (("A", A), ("B", B), ("C", C), ("D", D)):
        if matrix.shape != shapes[name] or 0 in matrix.shape or not np.all(np.isfinite(matrix)):
            finite = "" if np.all(np.isfinite(matrix)) else ", not all finite"
            raise InputError(
                f"{path}: {name}",
                got=f"{matrix.shape[0]} x {matrix.shape[1]} numbers{finite}",
                expected=f"{shapes[name][0]} x {shapes[name][1]} finite numbers",
                hint="x' = A x + B F, y = C x + D F: rows of B as of A, columns of C as of A.",
            )
    return FileStateSpace(
        path=path,
        A=A,
        B=B,
        C=C,
        D=D,
        input_names=_names(held.find_text(*_INPUTS, group=group), B.shape[1]),
        output_names=_names(held.find_text(*_OUTPUTS, group=group), len(C)),
    )


_INPUTS = ("input_names", "inputs", "InputName", "inname", "u_names", "input_name")
_OUTPUTS = ("output_names", "outputs", "OutputName", "outname", "y_names", "output_name")


def _names(found: tuple[str, ...], count: int) -> tuple[str, ...]:
    return found if len(found) == count else ()
