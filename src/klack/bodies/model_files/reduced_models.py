"""Reduced models by their matrices: state space, or reduced stiffness and mass."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.bodies.model_files.matrices import read_matrix
from klack.bodies.model_files.named_arrays import read_named_arrays
from klack.errors import InputError, refuse_if

__all__ = ["FileReducedMatrices", "FileStateSpace", "read_reduced_matrices", "read_state_space"]


@dataclass(frozen=True, kw_only=True, eq=False)
class FileStateSpace:
    """First-order model ``x' = A x + B F``, ``y = C x + D F`` in the units of its file.

    Parameters
    ----------
    A, B, C, D (n, n), (n, n_inputs), (n_outputs, n), (n_outputs, n_inputs)
    input_names, output_names
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
    """Read A, B, C and D; a missing D is zero.

    Parameters
    ----------
    path
        ``.mat`` (plain arrays, or one structure such as ``sys``), ``.npz``, or text with named
        blocks: CSV and ANSYS ``SPMWRITE``.
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


_NASTRAN = ".op4"
_MOST_ROWS = 5000


@dataclass(frozen=True, kw_only=True, eq=False)
class FileReducedMatrices:
    """Second-order model ``M u'' + K u = f`` in the units of its file.

    Parameters
    ----------
    K, M (n, n)
        Rows are boundary displacements and modal coordinates in any order.
    names
        Of the rows; empty where the file has none.
    """

    path: Path
    K: NDArray[np.float64]
    M: NDArray[np.float64]
    names: tuple[str, ...] = ()


def read_reduced_matrices(path: Path) -> FileReducedMatrices:
    """Read K and M (``K``/``M``, ``Kr``/``Mr``, ``KAA``/``MAA``, ``stiffness``/``mass``).

    Parameters
    ----------
    path
        ``.mat``, ``.npz``, text with the blocks K and M, or Nastran ``.op4``.
    """
    if path.suffix.lower() == _NASTRAN:
        return _of_nastran(path)
    held = read_named_arrays(path)
    stiffness = ("K", "Kr", "KAA", "Kcb", "K_red", "stiffness")
    mass = ("M", "Mr", "MAA", "Mcb", "M_red", "mass")
    group = held.group_with(stiffness, mass)
    K, M = held.find(*stiffness, group=group), held.find(*mass, group=group)
    if K is None or M is None:  # found above
        raise AssertionError
    good = K.shape == M.shape and K.shape[0] == K.shape[1] and K.size > 0
    if not (good and np.all(np.isfinite(K)) and np.all(np.isfinite(M))):
        raise InputError(
            str(path),
            got=f"K of {K.shape[0]} x {K.shape[1]} and M of {M.shape[0]} x {M.shape[1]} numbers",
            expected="two square matrices of one size, all numbers finite",
            hint="export the reduced stiffness and mass of the same coordinates.",
        )
    names = held.find_text("names", "dofs", "labels", "input_names", group=group)
    return FileReducedMatrices(path=path, K=K, M=M, names=names if len(names) == len(K) else ())


def _of_nastran(path: Path) -> FileReducedMatrices:
    """KAA and MAA of a superelement; their rows have no names."""
    K, M = (read_matrix(path, role=role) for role in ("stiffness", "mass"))
    rows = K.matrix.shape[0]
    refuse_if(
        rows > _MOST_ROWS or M.matrix.shape != K.matrix.shape,
        str(path),
        got=f"{rows} rows of stiffness and {M.matrix.shape[0]} of mass",
        expected=f"an equal number of both, at most {_MOST_ROWS}",
        hint="put full matrices into 'matrices'; this key is for reduced ones.",
    )
    return FileReducedMatrices(path=path, K=K.matrix.toarray(), M=M.matrix.toarray())
