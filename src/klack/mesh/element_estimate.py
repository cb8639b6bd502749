"""Estimated number of elements of a mesh, before it is made.

A size of 1 um instead of 1 mm makes a thousand million times as many tetrahedra.  The
estimate is 0.5 to 1.5 of what netgen makes at a single size; the grading between two sizes is left
out.  Compared with the memory is what mesh, stiffness and mass of so many elements take.
"""

from collections.abc import Mapping
from math import pi

from klack.memory import available_memory, require_memory
from klack.mesh.sizing import MeshSizing, Refinement
from klack.units import format_si

__all__ = ["element_count", "element_memory", "mesh_nodes", "require_meshable", "run_time"]

# netgen: elements per h^3 (3.7 in a slim rod, 5 to 7 in bulky bodies) or h^2
_DENSITY = {3: 3.5, 2: 2.2}
# bytes of one element with its share of the matrices: ten-node tetrahedron, six-node triangle
_BYTES = {3: 6000.0, 2: 1200.0}
# share of a refined ball or ring that lies inside of the body; its middle lies on a surface
_INSIDE = 0.4
# six-node triangles and ten-node tetrahedra: nodes per element, and elements in all over those of
# the wanted sizes: the growth between
_NODES = {2: 2.1, 3: 1.5}
_GROWN = {2: 2.0, 3: 2.5}
# [s] of a first run on two cores: at least, and for each node
_SECONDS = {2: (8.0, 1.0e-3), 3: (20.0, 1.4e-3)}


def element_count(
    sizing: MeshSizing, dimension: int, measure: float, surfaces: Mapping[str, float]
) -> dict[str, float]:
    """Elements that each wanted size causes.

    Parameters
    ----------
    sizing : MeshSizing
    dimension : int
        3 for tetrahedra, 2 for triangles of the half section.
    measure : float [m^3] or [m^2]
        Volume of the body, area of its half section.
    surfaces : mapping of str to float [m^2] or [m]
        Area of each named surface, length of each named edge.

    Returns
    -------
    dict of str to float
        By the words for the size: ``"size"``, ``"surfaces.tip"``, ``"contact.size"``.

    Examples
    --------
    >>> sizing = MeshSizing(size=1e-3)
    >>> element_count(sizing, 3, 1e-6, {})
    {'size': 3500.0}
    """
    density = _DENSITY[dimension]
    counts = {"size": float(f"{density * measure / sizing.size**dimension:.12g}")}
    for name, size in sizing.surfaces.items():
        extent = surfaces.get(name, 0.0)
        counts[f"surfaces.{name}"] = density * extent / size ** (dimension - 1)
    for refinement in sizing.refinements:
        volume = min(_INSIDE * _region(refinement, dimension), measure)
        counts["contact.size"] = counts.get("contact.size", 0.0) + (
            density * volume / refinement.size**dimension
        )
    return counts


def mesh_nodes(sizing: MeshSizing, dimension: int, measure: float) -> float:
    """Nodes of a mesh, roughly; see :func:`element_count` for the parameters."""
    count = sum(element_count(sizing, dimension, measure, {}).values())
    return _NODES[dimension] * _GROWN[dimension] * count


def run_time(nodes: float, dimension: int) -> float:
    """Time [s] of a first run of an impact on two cores, roughly, from the nodes of all bodies."""
    least, each = _SECONDS[dimension]
    return least + each * nodes


def element_memory(dimension: int, count: float) -> float:
    """Memory [byte] of a number of elements with their stiffness and mass matrix."""
    return _BYTES[dimension] * count


def require_meshable(
    where: str,
    sizing: MeshSizing,
    dimension: int,
    measure: float,
    surfaces: Mapping[str, float],
) -> None:
    """Refuse sizes that make more elements than fit into the memory.

    Raises
    ------
    InputError
        It names the size that is to blame, and one that would fit.
    """
    counts = element_count(sizing, dimension, measure, surfaces)
    total = sum(counts.values())
    needed = element_memory(dimension, total)
    worst = max(counts, key=lambda name: counts[name])
    size = {
        "size": sizing.size,
        "contact.size": min((item.size for item in sizing.refinements), default=sizing.size),
    }.get(worst)
    if size is None:
        size = sizing.surfaces[worst.removeprefix("surfaces.")]
    power = dimension - (1 if worst.startswith("surfaces.") else 0)
    fitting = 1.1 * size * (needed / max(0.5 * available_memory().size, 1e6)) ** (1.0 / power)
    require_memory(
        f"{where}: {worst}",
        needed,
        what=f"{format_si(size, 'm', 3)}, which gives some {total:.1g} elements, a mesh",
        hint=f"a 'mesh: {worst}' of {format_si(fitting, 'm', 2)} or more; check its unit.",
    )


def _region(refinement: Refinement, dimension: int) -> float:
    """Volume [m^3] or area [m^2] where a refined size holds; it grows from there on."""
    radius = refinement.radius + refinement.size
    if dimension == 2:
        return pi * radius**2
    if refinement.is_ring:
        return max(2 * pi * refinement.position[0], radius) * pi * radius**2
    return 4.0 / 3.0 * pi * radius**3
