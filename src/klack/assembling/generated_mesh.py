"""Meshes that klack generates, from the cache where they are there."""

from collections.abc import Mapping
from typing import Literal

from klack.cache.remember import remembered
from klack.cache.setting import result_cache
from klack.case.geometry import StepFile
from klack.errors import InputError
from klack.mesh.meridian import mesh_meridian
from klack.mesh.mesh import Mesh
from klack.mesh.mesh_entry import entry_of_mesh, mesh_of_entry
from klack.mesh.profile import Profile
from klack.mesh.sizing import MeshSizing
from klack.mesh.solid import mesh_revolved, mesh_step
from klack.mesh.swept import sweep

__all__ = ["meshed_profiles", "meshed_step"]

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
