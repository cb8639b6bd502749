"""Shapes that a case names, looked into before anything is meshed: their surfaces and their size.

What a STEP file or a mesh does not have is told at once, and a length in the wrong unit is asked
about here: a STEP file in metres is a needle of 19 m, which only the memory of the machine would
notice.  The numerics themselves know no scale.
"""

import json
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from klack.cache.entry import Entry
from klack.cache.remember import remembered
from klack.cache.setting import result_cache
from klack.case.bodies import CaseBody, CaseFile
from klack.case.surface_names import place_of, require_surface_names
from klack.errors import InputError
from klack.mesh.mesh import Mesh
from klack.mesh.profile import Profile
from klack.mesh.step_content import step_content
from klack.units import format_si

__all__ = ["require_given_shapes", "require_usual_sizes"]

_LARGEST, _SMALLEST = 1.0, 1e-4  # [m]; of the largest body of a valve
_MOST_APART = 100.0
_ALIKE = 0.1  # relative; how exactly a size is confirmed


class _Shape(NamedTuple):
    """Names of the surfaces, and the longest side of the box around the shape [m]."""

    surfaces: tuple[str, ...]
    extent: float


def require_given_shapes(case: CaseFile, read: Callable[[str], Mesh]) -> None:
    """Check the surfaces that a case names in files, and the sizes of all its bodies.

    Parameters
    ----------
    case : CaseFile
    read : callable
        Reads the finished mesh, or the nodes, of a body by its name.

    Raises
    ------
    InputError
        For a surface that a file does not have, with its key in the case; for a size that asks
        for a confirmation, see :func:`require_usual_sizes`.
    """
    known, extents = {}, {}
    for name, body in case.bodies.items():
        shape = _shape(body, partial(read, name))
        if shape is not None:
            extents[name] = shape.extent
            if body.geometry.profile is None:
                known[name] = shape.surfaces
    require_surface_names(case, known)
    require_usual_sizes(case, extents)


def require_usual_sizes(case: CaseFile, extents: Mapping[str, float]) -> None:
    """Require confirmation of sizes that suggest another unit of length.

    Parameters
    ----------
    case : CaseFile
    extents : mapping of str to float [m]
        Longest side of the box around each body.

    Raises
    ------
    InputError
        If the largest body is above 1 m or below 0.1 mm, or two of them differ 100-fold, and the
        case does not confirm it by ``geometry.extent``; or if that is not what the shape has.
    """
    for name, extent in extents.items():
        said = case.bodies[name].geometry.extent
        if said is not None and abs(said - extent) > _ALIKE * extent:
            raise InputError(
                place_of(case, ("bodies", name, "geometry", "extent"), on_key=False),
                got=f"an extent of {format_si(said, 'm')}",
                expected=f"{format_si(extent, 'm')}, the longest side of the shape",
                hint="check the unit of the shape, or correct the extent.",
            )
    asked = {name: size for name, size in extents.items() if not _is_confirmed(case, name)}
    if not asked:
        return
    name, largest = max(extents.items(), key=lambda item: item[1])
    other, smallest = min(extents.items(), key=lambda item: item[1])
    if name in asked and not _SMALLEST <= largest <= _LARGEST:
        raise _question(case, name, largest, "a largest body of 0.1 mm to 1 m")
    if largest > _MOST_APART * smallest:
        far = other if other in asked else name
        expected = f"bodies of similar size ('{name}' has {format_si(largest, 'm')})"
        if far == name:
            expected = f"bodies of similar size ('{other}' has {format_si(smallest, 'm')})"
        raise _question(case, far, extents[far], expected)


def _is_confirmed(case: CaseFile, name: str) -> bool:
    return case.bodies[name].geometry.extent is not None


def _question(case: CaseFile, name: str, extent: float, expected: str) -> InputError:
    size = format_si(extent, "m")
    return InputError(
        place_of(case, ("bodies", name, "geometry"), on_key=True),
        got=f"a body '{name}' of {size} (longest side)",
        expected=expected,
        hint=f"is the unit of its shape right? If it is, confirm it: geometry: {{extent: {size}}}.",
    )


def _shape(body: CaseBody, read: Callable[[], Mesh]) -> _Shape | None:
    geometry = body.geometry
    if geometry.profile is not None:
        return _Shape(geometry.profile.surfaces, _extent_of(geometry.profile.profiles()))
    if geometry.step is not None:
        return _step_shape(geometry.step.file)
    if geometry.mesh is None:
        return None  # a reduced model has no shape; a table of nodes says its unit
    mesh = read()
    names = (*mesh.surfaces, *mesh.node_sets)
    return _Shape(names, _longest(mesh.points, mesh.dimension))


def _extent_of(profiles: Mapping[str, Profile]) -> float:
    places = np.linspace(0.0, 1.0, 9)
    points = [curve.at(places) for profile in profiles.values() for curve in profile.curves]
    return _longest(np.concatenate(points), 2)


def _longest(points: np.ndarray, dimension: int) -> float:
    """Longest side of a box around points; a half section is turned to its diameter."""
    if dimension == 2:
        return float(max(2.0 * np.max(np.abs(points[:, 0])), np.ptp(points[:, 1])))
    return float(np.max(np.ptp(points, axis=0)))


def _step_shape(path: Path) -> _Shape:
    """Faces and size of a STEP file; what is in it counts, not its name or its date."""
    return remembered(
        result_cache() if path.is_file() else None,
        "shape",
        ("STEP", path.read_bytes() if path.is_file() else b""),
        lambda: _read_step_shape(path),
        pack=lambda shape: Entry(arrays={}, text=json.dumps(shape)),
        unpack=lambda entry: _Shape(tuple(json.loads(entry.text)[0]), json.loads(entry.text)[1]),
    )


def _read_step_shape(path: Path) -> _Shape:
    content = step_content(path)
    sides = np.max([solid.high for solid in content.solids], axis=0) - np.min(
        [solid.low for solid in content.solids], axis=0
    )
    return _Shape(tuple(face.name for face in content.faces), float(np.max(sides)))
