"""Write plunger.inp, the mesh of the tutorial on Abaqus files: ``python make_plunger.py``.

It stands in for a pre-processor: a plunger with a crowned land and the ring that it hits, as
axisymmetric elements CAX6 in millimetres, with element sets, surfaces and a material.
"""

from pathlib import Path

import numpy as np

from klack.mesh.meridian import mesh_meridian
from klack.mesh.mesh import Mesh
from klack.mesh.profile import Arc, Line, Profile
from klack.mesh.sizing import MeshSizing, Refinement

MM = 1e-3


def profile(start: tuple[float, float], *edges: Line | Arc) -> Profile:
    """Outline in millimetres."""

    def metres(point: tuple[float, float]) -> tuple[float, float]:
        return point[0] * MM, point[1] * MM

    scaled = tuple(
        Arc(metres(e.end), metres(e.centre), e.name)
        if isinstance(e, Arc)
        else Line(metres(e.end), e.name)
        for e in edges
    )
    return Profile(metres(start), scaled)


PLUNGER = profile(
    (1.5, 0.5),
    Line((1.7, 0.0022501)),
    Arc((2.3, 0.0022501), (2.0, 20.0), "LAND"),  # crowned, 0.6 mm wide, lowest at r = 2 mm, z = 0
    Line((2.5, 0.5)),
    Line((4.0, 0.5), "FACE"),
    Line((4.0, 7.0), "SIDE"),
    Line((2.0, 7.0)),
    Line((2.0, 12.0)),
    Line((0.0, 12.0), "TOP"),
    Line((0.0, 0.5)),
    Line((1.5, 0.5)),
)
RING = profile(
    (1.0, -4.0),
    Line((5.0, -4.0), "FOOT"),
    Line((5.0, 0.0)),
    Line((1.0, 0.0), "STOP"),
    Line((1.0, -4.0)),
)


def main() -> None:
    """Mesh both parts and write them into one file."""
    near = Refinement(position=(2.0 * MM, 0.0), size=0.012 * MM, radius=0.06 * MM)
    sizing = MeshSizing(size=1.2 * MM, grading=0.4, refinements=(near,))
    lines = ["*HEADING", "Plunger and stop ring, mm, t, s, N"]
    nodes = elements = 0
    for part, outline in (("PLUNGER", PLUNGER), ("RING", RING)):
        mesh = mesh_meridian({part: outline}, sizing)
        lines += part_lines(part, mesh, nodes, elements)
        nodes += len(mesh.points)
        elements += sum(len(block.connectivity) for block in mesh.blocks)
    lines += ["*MATERIAL, NAME=STEEL", "*DENSITY", "7.85e-9", "*ELASTIC", "210000., 0.3"]
    lines += ["*SOLID SECTION, ELSET=PLUNGER, MATERIAL=STEEL", ""]
    lines += ["*SOLID SECTION, ELSET=RING, MATERIAL=STEEL", ""]
    Path("plunger.inp").write_text("\n".join(lines) + "\n", encoding="ascii")


def part_lines(part: str, mesh: Mesh, first_node: int, first_element: int) -> list[str]:
    """Nodes, elements and surfaces of one part, numbered on from the one before."""
    (block,) = mesh.blocks
    lines = [f"*NODE, NSET=N{part}"]
    for i, (r, z) in enumerate(mesh.points, first_node + 1):
        lines.append(f"{i}, {r / MM:.9g}, {z / MM:.9g}")
    lines.append(f"*ELEMENT, TYPE=CAX6, ELSET={part}")
    for i, nodes in enumerate(block.connectivity, first_element + 1):
        lines.append(", ".join(str(n) for n in [i, *(nodes + first_node + 1)]))
    for name, surface in mesh.surfaces.items():
        if not name.isupper():
            continue
        lines.append(f"*SURFACE, NAME={name}, TYPE=ELEMENT")
        edges = np.sort(np.concatenate([b.connectivity[:, :2] for b in surface.blocks]), axis=1)
        wanted = {(int(a), int(b)) for a, b in edges}
        for i, nodes in enumerate(block.connectivity, first_element + 1):
            for side, (a, b) in enumerate(((0, 1), (1, 2), (2, 0)), start=1):
                if tuple(sorted((int(nodes[a]), int(nodes[b])))) in wanted:
                    lines.append(f"{i}, S{side}")
    return lines


if __name__ == "__main__":
    main()
