"""Meshes that klack generates, from the cache where they are there."""

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Literal

from numpy.typing import NDArray

from klack.case.geometry import StepFile
from klack.errors import InputError
from klack.machine.cache.entry import Entry
from klack.machine.cache.remember import remembered
from klack.machine.cache.result_cache import result_cache
from klack.mesh.meridian import mesh_meridian
from klack.mesh.mesh import ElementBlock, FaceBlock, Mesh, Surface
from klack.mesh.profile import Profile
from klack.mesh.quality import PoorElementError
from klack.mesh.sizing import MeshSizing
from klack.mesh.solid import mesh_revolved, mesh_step
from klack.mesh.swept import sweep
from klack.units import format_si

__all__ = [
    "coarsest_sound",
    "entry_of_mesh",
    "mesh_of_entry",
    "meshed_for_case",
    "meshed_profiles",
    "meshed_step",
]


_FINER = (0.7, 0.5, 0.35, 0.25, 0.12, 0.06)
"""Shares of a size that are tried when it gives poor elements."""
_MOST_TRIED = 50_000
"""Elements after which no finer size is tried."""


def coarsest_sound(sizing: MeshSizing, mesher: Callable[[MeshSizing], Mesh]) -> Mesh:
    """Mesh of a sizing, or with a finer size where its elements are poor: a mesh to look at.

    Raises
    ------
    PoorElementError
        If no size does.
    """
    for share in (1.0, *_FINER):
        try:
            return mesher(replace(sizing, size=share * sizing.size))
        except PoorElementError as error:
            if share == _FINER[-1] or error.elements > _MOST_TRIED:
                raise
    raise AssertionError  # the last share returns or raises


def meshed_for_case(
    body: str,
    sizing: MeshSizing,
    mesher: Callable[[MeshSizing], Mesh],
    at_size: Callable[[float], MeshSizing] | None = None,
) -> Mesh:
    """Mesh a body of a case; an error names the key of the case.

    Parameters
    ----------
    mesher
        Makes the mesh of a sizing.
    at_size
        All that the case would ask for with another general size [m], its refinements where the
        bodies would be found to touch then; without, only that size changes.

    Raises
    ------
    InputError
        For poor elements with a finer size that was tried and does, if one does.
    """
    key = f"bodies.{body}.mesh"
    try:
        return mesher(sizing)
    except PoorElementError as error:
        raise InputError(
            f"{key}.size: {error.where}",
            got=f"{format_si(sizing.size, 'm')}, which gives {error.got}",
            expected=error.expected,
            hint=_finer(key, sizing, mesher, at_size, error),
        ) from error
    except InputError as error:
        setting = error.where.rsplit(": ", 1)[-1]
        if setting not in ("size", "contact.size") and not setting.startswith("surfaces."):
            raise
        hint = error.hint.replace(f"'mesh: {setting}'", f"{key}.{setting}")
        raise InputError(
            f"{key}.{setting}", got=error.got, expected=error.expected, hint=hint
        ) from error


def _finer(
    key: str,
    sizing: MeshSizing,
    mesher: Callable[[MeshSizing], Mesh],
    at_size: Callable[[float], MeshSizing] | None,
    error: PoorElementError,
) -> str:
    elements = error.elements
    for share in _FINER:
        if elements > _MOST_TRIED:
            break
        size = float(f"{share * sizing.size:.2g}")
        try:
            mesher(replace(sizing, size=size) if at_size is None else at_size(size))
        except PoorElementError as still:
            elements = still.elements
            continue
        except InputError:
            break
        return f"{key}.size: {format_si(size, 'm')} (tried, it does)."
    return (
        f"a {key}.size below the radius of the smallest round face, or a {key}.grading below "
        f"{sizing.grading:g}."
    )


def entry_of_mesh(mesh: Mesh) -> Entry:
    """Arrays and names of a mesh."""
    arrays: dict[str, NDArray[Any]] = {"points": mesh.points}
    for i, block in enumerate(mesh.blocks):
        arrays[f"block {i}"] = block.connectivity
    for i, surface in enumerate(mesh.surfaces.values()):
        for k, faces in enumerate(surface.blocks):
            arrays[f"surface {i} {k}"] = faces.connectivity
    for i, nodes in enumerate(mesh.node_sets.values()):
        arrays[f"set {i}"] = nodes
    names = {
        "blocks": [[block.family, block.solid] for block in mesh.blocks],
        "surfaces": [
            [key, surface.name, [faces.family for faces in surface.blocks]]
            for key, surface in mesh.surfaces.items()
        ],
        "sets": list(mesh.node_sets),
    }
    return Entry(arrays=arrays, text=json.dumps(names))


def mesh_of_entry(entry: Entry) -> Mesh:
    """Inverse of :func:`entry_of_mesh`."""
    names, arrays = json.loads(entry.text), entry.arrays
    return Mesh(
        points=arrays["points"],
        blocks=tuple(
            ElementBlock(family, arrays[f"block {i}"], solid)
            for i, (family, solid) in enumerate(names["blocks"])
        ),
        surfaces={
            key: Surface(
                name,
                tuple(
                    FaceBlock(family, arrays[f"surface {i} {k}"])
                    for k, family in enumerate(families)
                ),
            )
            for i, (key, name, families) in enumerate(names["surfaces"])
        },
        node_sets={name: arrays[f"set {i}"] for i, name in enumerate(names["sets"])},
    )


Model = Literal["axisymmetric", "swept", "solid"]


def meshed_profiles(
    profiles: Mapping[str, Profile], sizing: MeshSizing, model: Model, layers: int | None
) -> Mesh:
    """Mesh drawn bodies of revolution: their half section, its sweep in layers, or freely."""

    def generate() -> Mesh:
        if model == "solid":
            return mesh_revolved(profiles, sizing)
        meridian = mesh_meridian(profiles, sizing)
        return meridian if layers is None else sweep(meridian, layers)

    return remembered(
        result_cache(),
        "mesh",
        ("profiles", profiles, sizing, model, layers),
        generate,
        pack=entry_of_mesh,
        unpack=mesh_of_entry,
    )


def meshed_step(step: StepFile, sizing: MeshSizing) -> Mesh:
    """Mesh a STEP file; what is in it counts, not its name or its date.

    Raises
    ------
    InputError
        If the file changes meanwhile.
    """
    cache = result_cache()
    if cache is None or not step.file.is_file():
        return mesh_step(step.file, sizing)
    content = step.file.read_bytes()

    def generate() -> Mesh:
        mesh = mesh_step(step.file, sizing)
        if step.file.read_bytes() != content:
            raise InputError(
                str(step.file),
                got="a file that changed while it was meshed",
                expected="the same file to the end",
                hint="run the command again.",
            )
        return mesh

    return remembered(
        cache,
        "mesh",
        ("STEP", content, sizing),
        generate,
        pack=entry_of_mesh,
        unpack=mesh_of_entry,
    )
