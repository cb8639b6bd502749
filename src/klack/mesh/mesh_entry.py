"""A mesh as an entry of the cache, and back."""

import json
from typing import Any

from numpy.typing import NDArray

from klack.cache.entry import Entry
from klack.mesh.mesh import ElementBlock, FaceBlock, Mesh, Surface

__all__ = ["entry_of_mesh", "mesh_of_entry"]


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
