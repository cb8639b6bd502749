"""Element sizes: global, on surfaces, and around points or rings."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, refuse_if, require_nonnegative, require_positive
from klack.machine.memory import available_memory, require_memory
from klack.units import format_si

__all__ = [
    "MeshSizing",
    "Refinement",
    "element_count",
    "element_memory",
    "mesh_nodes",
    "require_meshable",
    "run_time",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Refinement:
    """Element size within a distance of a point or ring.

    Parameters
    ----------
    position : (r, z) or (x, y, z) [m]
        Two numbers are a ring around the axis, three a point.
    size [m]
    radius [m]
        Beyond it elements grow by the grading.
    """

    position: tuple[float, ...]
    size: float
    radius: float = 0.0

    def __post_init__(self) -> None:
        refuse_if(
            len(self.position) not in (2, 3),
            "Refinement.position",
            got=f"{len(self.position)} numbers",
            expected="two (r, z) for a ring or three (x, y, z) for a point [m]",
            hint="give (r, z) of the contact ring.",
        )
        require_positive("Refinement.size", self.size, "m")
        require_nonnegative("Refinement.radius", self.radius, "m")

    @property
    def is_ring(self) -> bool:
        """True for a position (r, z)."""
        return len(self.position) == 2


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshSizing:
    """Wanted edge lengths.

    Parameters
    ----------
    size [m]
        Largest anywhere.
    surfaces [m]
        Largest on a named surface.
    refinements
        Typically the contact ring.
    grading [-]
        Growth per distance from a fine zone, above 0 up to 1: 0.3 is usual, 0.15 smooth, 0.5
        coarse.

    Examples
    --------
    Elements of 0.02 mm within 0.1 mm of a contact ring, 1.5 mm far away:

    >>> ring = Refinement(position=(1.5e-3, 0.8e-3), size=0.02e-3, radius=0.1e-3)
    >>> MeshSizing(size=1.5e-3, refinements=(ring,)).smallest
    2e-05
    """

    size: float
    surfaces: Mapping[str, float] = field(default_factory=dict)
    refinements: tuple[Refinement, ...] = ()
    grading: float = 0.3

    def __post_init__(self) -> None:
        require_positive("MeshSizing.size", self.size, "m")
        for name, size in self.surfaces.items():
            require_positive(f"MeshSizing.surfaces['{name}']", size, "m")
        refuse_if(
            not 0 < self.grading <= 1,
            "MeshSizing.grading",
            got=f"{self.grading:g}",
            expected="a number above 0 and up to 1",
            hint="0.3 is usual; smaller values grow more slowly.",
        )

    @property
    def smallest(self) -> float:
        """Smallest requested edge length [m]."""
        sizes = [self.size, *self.surfaces.values(), *(r.size for r in self.refinements)]
        return min(sizes)

    def require_surfaces(self, known: tuple[str, ...]) -> None:
        """Reject a sized surface that is not among ``known``."""
        for name in self.surfaces:
            if name not in known:
                raise InputError(
                    f"MeshSizing.surfaces['{name}']",
                    got="a name that is not in the geometry",
                    expected=f"one of: {', '.join(sorted(set(known))) or 'none'}",
                    hint="check the spelling, or name the face in the CAD file.",
                )


# Spacing of the points at which netgen is told the size, per size: at 1 its octree leaves cells
# out, and boundary edges of a ring vary by 30 %; at 0.5 by less than 1 %.
_SPACING = 0.5


def _steps(refinement: Refinement) -> NDArray[np.float64]:
    h = _SPACING * refinement.size
    count = int(np.ceil(refinement.radius / h))
    return np.linspace(-count * h, count * h, 2 * count + 1)


def disc_points(refinement: Refinement) -> NDArray[np.float64]:
    """Lattice over the disc of a ring in the meridian, shape (n, 2) [m]."""
    radius = refinement.radius
    steps = _steps(refinement)
    offsets = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
    offsets = offsets[np.hypot(*offsets.T) <= radius * (1 + 1e-12)]
    return np.asarray(refinement.position) + offsets


def ball_points(refinement: Refinement) -> NDArray[np.float64]:
    """Lattice over the ball (point) or torus (ring), shape (n, 3) [m]."""
    h, radius = _SPACING * refinement.size, refinement.radius
    if refinement.is_ring:
        disc = disc_points(refinement)
        rows = []
        for r, z in disc[disc[:, 0] >= 0]:
            angle = np.linspace(0, 2 * np.pi, max(1, int(np.ceil(2 * np.pi * r / h))), False)
            rows.append(np.column_stack([r * np.cos(angle), r * np.sin(angle), 0 * angle + z]))
        return np.concatenate(rows)
    steps = _steps(refinement)
    offsets = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    offsets = offsets[np.linalg.norm(offsets, axis=1) <= radius * (1 + 1e-12)]
    return np.asarray(refinement.position) + offsets


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
    """Elements that each wanted size causes, by ``"size"``, ``"surfaces.tip"``, ``"contact.size"``.

    The estimate is 0.5 to 1.5 of what netgen makes at a single size; the grading between sizes is
    left out.

    Parameters
    ----------
    dimension
        3 for tetrahedra, 2 for triangles of the half section.
    measure [m^3] or [m^2]
        Volume of the body, area of its half section.
    surfaces [m^2] or [m]
        Area of each surface, length of each edge.

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
    """Nodes of a mesh, roughly; arguments as :func:`element_count`."""
    count = sum(element_count(sizing, dimension, measure, {}).values())
    return _NODES[dimension] * _GROWN[dimension] * count


def run_time(nodes: float, dimension: int) -> float:
    """Time [s] of a first impact on two cores, roughly, by the nodes of all bodies."""
    least, each = _SECONDS[dimension]
    return least + each * nodes


def element_memory(dimension: int, count: float) -> float:
    """Memory [byte] of elements with their stiffness and mass."""
    return _BYTES[dimension] * count


def require_meshable(
    where: str,
    sizing: MeshSizing,
    dimension: int,
    measure: float,
    surfaces: Mapping[str, float],
) -> None:
    """Reject sizes whose elements do not fit into memory; names one that would fit."""
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
        what=f"{format_si(size, 'm', 3)}, which gives about {total:.1g} elements, a mesh",
        hint=f"a 'mesh: {worst}' of {format_si(fitting, 'm', 2)} or more; check its unit.",
    )


def _region(refinement: Refinement, dimension: int) -> float:
    """Volume [m^3] or area [m^2] where a refined size holds."""
    radius = refinement.radius + refinement.size
    if dimension == 2:
        return pi * radius**2
    if refinement.is_ring:
        return max(2 * pi * refinement.position[0], radius) * pi * radius**2
    return 4.0 / 3.0 * pi * radius**3
