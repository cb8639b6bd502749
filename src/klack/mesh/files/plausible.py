"""What is rejected of any mesh file: size, unit, and extent of the body."""

from pathlib import Path

import numpy as np

from klack.errors import InputError, refuse_if
from klack.mesh.mesh import Mesh
from klack.units import format_si

__all__ = [
    "LARGEST_BODY",
    "LARGEST_BYTES",
    "SAY_UNIT",
    "SMALLEST_BODY",
    "read_bytes",
    "require_plausible_size",
    "require_unit",
]


SAY_UNIT = "add 'unit: mm' (or your unit) next to the file; for klack inspect, --unit mm."
"""Advice for a mesh file without a unit of length."""

LARGEST_BODY = 2.0
"""Largest extent [m] of a body read from a file."""

SMALLEST_BODY = 1e-5
"""Smallest one [m]."""

_UNITS = {"m": 1.0, "cm": 1e-2, "in": 0.0254, "mm": 1e-3, "um": 1e-6}


def require_plausible_size(where: str, mesh: Mesh, unit_length: float) -> None:
    """Reject a body of more than 2 m or less than 10 um; ``unit_length`` [m] is for the hint."""
    size = float(np.ptp(mesh.points, axis=0).max())
    if SMALLEST_BODY <= size <= LARGEST_BODY:
        return
    likely = _likely_unit(size / unit_length)
    hint = (
        f"the file is probably in {likely}: use 'unit: {likely}'."
        if likely
        else "check the coordinates and the unit of the file."
    )
    raise InputError(
        where,
        got=f"a body of {format_si(size, 'm')}, with {format_si(unit_length, 'm')} "
        "as unit of the coordinates",
        expected=f"an extent of {format_si(SMALLEST_BODY, 'm')} to {format_si(LARGEST_BODY, 'm')}",
        hint=hint,
    )


def _likely_unit(extent: float) -> str:
    """Unit by which a part of a valve has 1 mm to 0.5 m."""
    for name in ("mm", "m", "um", "cm", "in"):
        if 1e-3 <= extent * _UNITS[name] <= 0.5:
            return name
    return ""


def require_unit(path: Path, unit_length: float | None) -> float:
    """Given unit of length; rejected where the file names none either."""
    if unit_length is None:
        raise InputError(
            str(path),
            got="no unit of length",
            expected="the unit of its coordinates, which files of this kind do not state",
            hint=SAY_UNIT,
        )
    return unit_length


LARGEST_BYTES = 2_000_000_000
"""Largest size of the files of one model."""


def read_bytes(path: Path, kind: str) -> bytes:
    """Content of a mesh file; rejects it if missing, empty or too large."""
    refuse_if(
        not path.is_file(),
        str(path),
        got="no such file",
        expected=kind,
        hint="check the path; it is relative to where you started the program.",
    )
    size = path.stat().st_size
    refuse_if(
        not 0 < size <= LARGEST_BYTES,
        str(path),
        got="an empty file" if size == 0 else f"{size / 1e9:.3g} GB",
        expected=f"{kind}, at most {LARGEST_BYTES / 1e9:.3g} GB",
        hint="write the mesh only, without results or steps.",
    )
    return path.read_bytes()
