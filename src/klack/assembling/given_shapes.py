"""Shapes that a case names, checked before meshing: surfaces, size, mass, effort.

A STEP file in the wrong unit is a needle of 19 m, which only the memory of the machine would
notice: the numerics have no scale.
"""

import json
import warnings
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from klack.case.bodies import CaseBody, CaseFile
from klack.case.plausible import MOVING_MASS, SIZE
from klack.case.schema import Case
from klack.case.surface_names import place_of, require_surface_names
from klack.errors import AccuracyWarning, InputError
from klack.machine.cache.entry import Entry
from klack.machine.cache.remember import remembered
from klack.machine.cache.result_cache import result_cache
from klack.machine.memory import in_words
from klack.machine.progress import Progress, remark, silent
from klack.mesh.mesh import Mesh
from klack.mesh.profile import Profile
from klack.mesh.quality import corner_volume
from klack.mesh.sizing import MeshSizing, element_memory, mesh_nodes, run_time
from klack.mesh.step_content import step_content
from klack.units import format_si

__all__ = ["GivenShape", "require_given_shapes", "require_usual_sizes", "tell_effort"]

_LONG = 900.0  # [s] of a run that is worth a word before it begins; the estimate is a rough one
_MOST_APART = 100.0
_ALIKE = 0.1  # relative; how exactly a size is confirmed


class GivenShape(NamedTuple):
    """Surfaces, longest side of the box [m], and volume [m^3]."""

    surfaces: tuple[str, ...]
    extent: float
    volume: float


def require_given_shapes(
    case: CaseFile, read: Callable[[str], Mesh], progress: Progress = silent
) -> dict[str, GivenShape]:
    """Check surfaces, sizes and masses of the bodies that a case names in files.

    As :func:`require_usual_sizes`; ``progress`` is told doubts at once.

    Parameters
    ----------
    read
        Finished mesh, or nodes, of a body by name.

    Warns
    -----
    AccuracyWarning
        Of unusual sizes and masses.
    """
    shapes: dict[str, GivenShape] = {}
    for name, body in case.bodies.items():
        shape = _shape(body, partial(read, name))
        if shape is not None:
            shapes[name] = shape
    files = {n: s.surfaces for n, s in shapes.items() if case.bodies[n].geometry.profile is None}
    require_surface_names(case, files)
    require_usual_sizes(case, {name: shape.extent for name, shape in shapes.items()})
    for doubt in case.doubts:
        remark(progress, f"note: {doubt}")
    for doubt in (*_size_doubts(case, shapes), *_mass_doubts(case, shapes)):
        _tell(doubt, progress)
    return shapes


def _tell(doubt: str, progress: Progress) -> None:
    """Say it before long work, and with the result."""
    remark(progress, f"note: {doubt}")
    warnings.warn(doubt, AccuracyWarning, stacklevel=3)


def _size_doubts(case: CaseFile, shapes: Mapping[str, GivenShape]) -> Iterator[str]:
    if not shapes:
        return
    name = max(shapes, key=lambda name: shapes[name].extent)
    extent = shapes[name].extent
    if not SIZE.is_usual(extent) and not _is_confirmed(case, name):
        size = format_si(extent, "m")
        yield (
            f"bodies.{name}: {size} is an unusual size (longest side; {SIZE.reason}). Try: check "
            f"the unit of its shape, or confirm it: geometry: {{extent: {size}}}."
        )


def _mass_doubts(case: CaseFile, shapes: Mapping[str, GivenShape]) -> Iterator[str]:
    """Of the moving body, by the mean density of its solids."""
    name = case.contact.moving.body if isinstance(case, Case) else ""
    given = case.bodies[name].material if name in shapes else None
    if given is None:
        return
    names = {given} if isinstance(given, str) else set(given.values())
    mass = shapes[name].volume * float(np.mean([case.materials[one].density for one in names]))
    if not MOVING_MASS.is_usual(mass):
        yield (
            f"bodies.{name}: a mass of {MOVING_MASS.shown(mass)} is unusual (usual: "
            f"{MOVING_MASS.in_words}; "
            f"{MOVING_MASS.reason}). Try: check the unit of its shape and its density."
        )


def tell_effort(
    case: CaseFile,
    shapes: Mapping[str, GivenShape],
    sizings: Mapping[str, MeshSizing],
    progress: Progress,
) -> None:
    """Say before meshing what a large mesh takes.

    Warns
    -----
    AccuracyWarning
        With nodes, time and memory, of a run longer than a quarter of an hour.
    """
    nodes = {
        name: _nodes(case.bodies[name], shapes[name], sizing) for name, sizing in sizings.items()
    }
    if not nodes:
        return
    dimension = max(case.bodies[name].geometry.dimension for name in nodes)
    total = sum(nodes.values())
    seconds = run_time(total, dimension)
    if seconds > _LONG:
        worst = max(nodes, key=lambda name: nodes[name])
        size = format_si(sizings[worst].smallest, "m", 2)
        time = f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.2g} h"
        _tell(
            f"bodies.{worst}.mesh: elements of {size} to "
            f"{format_si(sizings[worst].size, 'm', 2)} make a mesh of about {total:.1g} nodes in "
            f"all; a first run takes about {time} on two cores and at least "
            f"{in_words(element_memory(dimension, total / 2))} of memory. Try: larger sizes, or "
            "a smaller extent of the refinement.",
            progress,
        )


def _nodes(body: CaseBody, shape: GivenShape, sizing: MeshSizing) -> float:
    geometry = body.geometry
    if geometry.profile is None or geometry.model == "solid":
        return mesh_nodes(sizing, 3, shape.volume)
    area = sum(profile.area for profile in geometry.profile.profiles().values())
    return mesh_nodes(sizing, 2, area) * (geometry.layers or 1)


def require_usual_sizes(case: CaseFile, extents: Mapping[str, float]) -> None:
    """Require confirmation of sizes that suggest another unit of length.

    The largest body is above 1 m or below 0.1 mm, or two of them differ 100-fold;
    ``geometry.extent``, which must then be true, or ``unusual`` confirm it.

    Parameters
    ----------
    extents [m]
        Longest side of the box around each body.
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
    if not asked or case.unusual:
        return
    name, largest = max(extents.items(), key=lambda item: item[1])
    other, smallest = min(extents.items(), key=lambda item: item[1])
    if name in asked and not SIZE.is_possible(largest):
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
        hint="check the unit of its shape; if it is right, confirm it: geometry: {extent: "
        f"{size}}}.",
    )


def _shape(body: CaseBody, read: Callable[[], Mesh]) -> GivenShape | None:
    geometry = body.geometry
    if geometry.profile is not None:
        profiles = geometry.profile.profiles()
        volume = sum(profile.volume for profile in profiles.values())
        return GivenShape(geometry.profile.surfaces, _extent_of(profiles), volume)
    if geometry.step is not None:
        return _step_shape(geometry.step.file)
    if geometry.mesh is None:
        return None  # a reduced model has no shape; a table of nodes says its unit
    mesh = read()
    names = (*mesh.surfaces, *mesh.node_sets)
    volume = corner_volume(mesh) if mesh.blocks else 0.0
    return GivenShape(names, _longest(mesh.points, mesh.dimension), volume)


def _extent_of(profiles: Mapping[str, Profile]) -> float:
    places = np.linspace(0.0, 1.0, 9)
    points = [curve.at(places) for profile in profiles.values() for curve in profile.curves]
    return _longest(np.concatenate(points), 2)


def _longest(points: np.ndarray, dimension: int) -> float:
    """Longest side of a box around points; a half section is turned."""
    if dimension == 2:
        return float(max(2.0 * np.max(np.abs(points[:, 0])), np.ptp(points[:, 1])))
    return float(np.max(np.ptp(points, axis=0)))


def _step_shape(path: Path) -> GivenShape:
    """Faces and size of a STEP file, cached by content."""
    return remembered(
        result_cache() if path.is_file() else None,
        "shape",
        ("STEP with volume", path.read_bytes() if path.is_file() else b""),
        lambda: _read_step_shape(path),
        pack=lambda shape: Entry(arrays={}, text=json.dumps(shape)),
        unpack=lambda entry: GivenShape(*json.loads(entry.text)),
    )


def _read_step_shape(path: Path) -> GivenShape:
    content = step_content(path)
    sides = np.max([solid.high for solid in content.solids], axis=0) - np.min(
        [solid.low for solid in content.solids], axis=0
    )
    volume = sum(solid.size for solid in content.solids)
    return GivenShape(tuple(face.name for face in content.faces), float(np.max(sides)), volume)
