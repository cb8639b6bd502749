"""Content of a STEP file before meshing: solids and faces with positions."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.mesh.moments import Moments
from klack.mesh.occ import MM, box_mm
from klack.mesh.solid import face_names, read_step, solid_names

__all__ = ["StepContent", "StepPart", "step_content"]

_BOX_MARGIN = 1e-6  # [mm] by which OpenCASCADE draws some boxes too large


@dataclass(frozen=True, kw_only=True)
class StepPart:
    """A solid, or all faces of one name.

    Parameters
    ----------
    name
        As of :func:`~klack.mesh.solid.mesh_step`.
    named
        In the file; else it is a number of the list.
    count
        Solids or faces of this name.
    size [m^3] or [m^2]
        Total.
    low, high (3,) [m]
        Corners of the box around all.
    moments
        Second moments [m^5] or [m^4] about the centre.
    """

    name: str
    named: bool
    count: int
    size: float
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    moments: Moments


@dataclass(frozen=True, kw_only=True)
class StepContent:
    """Solids and faces of a STEP file, in its order."""

    solids: tuple[StepPart, ...]
    faces: tuple[StepPart, ...]


def step_content(path: str | Path) -> StepContent:
    """Solids and faces of a STEP file under the names that a case uses."""
    shape = read_step(Path(path))
    return StepContent(
        solids=_parts(list(shape.solids), solid_names(shape), MM**3),
        faces=_parts(list(shape.faces), face_names(shape), MM**2),
    )


def _parts(shapes: list, names: tuple[str, ...], unit: float) -> tuple[StepPart, ...]:
    """One entry per name; ``unit`` is a cubic or square metre in millimetres."""
    parts = []
    for name in dict.fromkeys(names):
        here = [shape for shape, other in zip(shapes, names, strict=True) if other == name]
        boxes = [box_mm(shape) for shape in here]
        low, high = np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)
        parts.append(
            StepPart(
                name=name,
                named=bool(here[0].name),
                count=len(here),
                size=sum(shape.mass for shape in here) / unit,
                low=np.round(low / _BOX_MARGIN) * _BOX_MARGIN / MM,
                high=np.round(high / _BOX_MARGIN) * _BOX_MARGIN / MM,
                moments=_moments(here, unit),
            )
        )
    return tuple(parts)


def _moments(shapes: list, unit: float) -> Moments:
    """OpenCASCADE's tensor of inertia is about the centre."""
    parts = []
    for shape in shapes:
        tensor, centre = shape.inertia, shape.center
        inertia = np.array([[tensor[i, j] for j in range(3)] for i in range(3)]) / (unit * MM**2)
        second = 0.5 * np.trace(inertia) * np.eye(3) - inertia
        at = np.array([centre.x, centre.y, centre.z]) / MM
        parts.append((1.0, Moments(volume=shape.mass / unit, centre=at, second=second)))
    return Moments.together(parts)
