"""Reduced stiffness and mass (Craig and Bampton 1968) from a file, as they were written."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.model_files.named_arrays import read_named_arrays

__all__ = ["FileReducedMatrices", "read_reduced_matrices"]


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
        ``.mat``, ``.npz`` or text with the blocks K and M.

    Raises
    ------
    InputError
        If one is missing, or they are not square, of one size and finite.
    """
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
