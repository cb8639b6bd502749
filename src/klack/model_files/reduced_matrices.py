"""Reduced stiffness and mass (Craig and Bampton 1968) from a file, as they were written."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.model_files.matrices import read_matrix
from klack.model_files.named_arrays import read_named_arrays

__all__ = ["FileReducedMatrices", "read_reduced_matrices"]

_NASTRAN = ".op4"
_MOST_ROWS = 5000


@dataclass(frozen=True, kw_only=True, eq=False)
class FileReducedMatrices:
    """Second-order model ``M u'' + K u = f`` in the units of its file.

    Parameters
    ----------
    path : Path
    K, M : array, shape (n, n)
        Rows are boundary displacements and modal coordinates in any order.
    names : tuple of str
        Of the rows; empty where the file gives none.
    """

    path: Path
    K: NDArray[np.float64]
    M: NDArray[np.float64]
    names: tuple[str, ...] = ()


def read_reduced_matrices(path: Path) -> FileReducedMatrices:
    """Read K and M (``K``/``M``, ``Kr``/``Mr``, ``KAA``/``MAA``, ``stiffness``/``mass``).

    Parameters
    ----------
    path : Path
        ``.mat``, ``.npz``, text with the blocks K and M, or Nastran ``.op4``.

    Raises
    ------
    InputError
        If one is missing, or they are not square, of one size and finite.
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
    """KAA and MAA of a superelement; such files number their rows and do not name them."""
    K, M = (read_matrix(path, role=role) for role in ("stiffness", "mass"))
    rows = K.matrix.shape[0]
    if rows > _MOST_ROWS or M.matrix.shape != K.matrix.shape:
        raise InputError(
            str(path),
            got=f"{rows} rows of stiffness and {M.matrix.shape[0]} of mass",
            expected=f"as many of both, {_MOST_ROWS} at most",
            hint="full matrices go into 'matrices'; this is for reduced ones.",
        )
    return FileReducedMatrices(path=path, K=K.matrix.toarray(), M=M.matrix.toarray())
