"""Stiffness and mass matrices from files of other programs, by suffix."""

from collections.abc import Callable, Mapping
from pathlib import Path

from klack.bodies.model_files.ansys_full import read_ansys_full
from klack.bodies.model_files.coordinate_files import (
    is_matrix_market,
    read_abaqus_mtx,
    read_calculix_storage,
    read_matrix_market,
)
from klack.bodies.model_files.harwell_boeing import read_harwell_boeing
from klack.bodies.model_files.nastran_op4 import read_nastran_op4
from klack.bodies.model_files.nastran_pch import read_nastran_pch
from klack.bodies.model_files.stored_matrices import read_matlab_matrix, read_numpy_matrix
from klack.bodies.model_files.system_matrix import Role, SystemMatrix
from klack.errors import InputError
from klack.input.section import refuse_lfs_pointer

__all__ = ["MATRIX_FORMATS", "read_matrix"]

Reader = Callable[[Path, str | None, Role | None], SystemMatrix]

_LARGEST = 16 << 30


def _mtx(path: Path, name: str | None, role: Role | None) -> SystemMatrix:
    read = read_matrix_market if is_matrix_market(path) else read_abaqus_mtx
    return read(path, name, role)


MATRIX_FORMATS: Mapping[str, tuple[str, Reader]] = {
    ".full": ("ANSYS", read_ansys_full),
    ".sti": ("CalculiX, stiffness", read_calculix_storage),
    ".mas": ("CalculiX, mass", read_calculix_storage),
    ".mtx": ("Matrix Market or Abaqus", _mtx),
    ".mm": ("Matrix Market", read_matrix_market),
    ".hb": ("Harwell-Boeing", read_harwell_boeing),
    ".rb": ("Rutherford-Boeing", read_harwell_boeing),
    ".rsa": ("Harwell-Boeing", read_harwell_boeing),
    ".matrix": ("ANSYS HBMAT", read_harwell_boeing),
    ".op4": ("Nastran OUTPUT4", read_nastran_op4),
    ".pch": ("Nastran DMIG", read_nastran_pch),
    ".dmig": ("Nastran DMIG", read_nastran_pch),
    ".mat": ("MATLAB", read_matlab_matrix),
    ".npz": ("NumPy", read_numpy_matrix),
}
"""Ending of the file name: program, and its reader."""


def read_matrix(
    path: str | Path, *, name: str | None = None, role: Role | None = None
) -> SystemMatrix:
    """Read one matrix of a file, in the units of that file.

    Rejects complex, rectangular and unsymmetric ones (with the asymmetry).

    Parameters
    ----------
    path
        With one of the endings of :data:`MATRIX_FORMATS`.
    name
        In a file of several.
    role
        Finds the usual names (K, KAA, ...) without ``name``.

    Examples
    --------
    >>> read_matrix("needle.cdb")
    Traceback (most recent call last):
      ...
    klack.errors.InputError: ...
    """
    path = Path(path)
    if path.suffix.lower() not in MATRIX_FORMATS:
        known = ", ".join(f"{ending} ({words})" for ending, (words, _) in MATRIX_FORMATS.items())
        raise InputError(
            str(path),
            got=f"a file that ends in '{path.suffix}'",
            expected=f"one of: {known}",
            hint="see the page 'Bring your matrices' for how each program writes them.",
        )
    if not path.is_file():
        hint = "check the spelling and the folder."
        raise InputError(str(path), got="no such file", expected="a file of a matrix", hint=hint)
    refuse_lfs_pointer(path)
    if path.stat().st_size > _LARGEST:
        hint = "write the matrices in a binary or sparse form."
        size = f"{path.stat().st_size / 2**30:.0f} GB"
        raise InputError(str(path), got=size, expected="at most 16 GB", hint=hint)
    _, read = MATRIX_FORMATS[path.suffix.lower()]
    return read(path, name, role)
