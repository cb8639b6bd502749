"""The cylinder that two drawn solids share: where one is pressed on the other."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from klack.errors import InputError
from klack.mesh.profile import SAME, Curve, Profile

__all__ = ["Joint", "cylinder_joint", "edges_of_two"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """A cylinder around the axis that is the edge of two solids.

    Parameters
    ----------
    inner, outer
        Names of the solids: of the shaft and of the hub.
    radius, length [m]
    """

    name: str
    inner: str
    outer: str
    radius: float
    length: float


def cylinder_joint(profiles: Mapping[str, Profile], name: str) -> Joint:
    """Joint of all edges of one name; rejects what is no cylinder of exactly two solids."""
    (one, own), (two, others) = edges_of_two(profiles, name).items()
    size = max(abs(x) for c in (*own, *others) for x in (*c.start, *c.end))
    radii = [r for curve in (*own, *others) for r, _ in (curve.start, curve.end)]
    if min(radii) <= SAME * size:
        raise _error(
            name,
            "an edge on the axis, or one that ends there",
            "a cylinder around the axis",
            "name the edge where the outer part meets the inner one.",
        )
    if max(radii) - min(radii) > SAME * size or any(c.centre is not None for c in own):
        raise _error(
            name,
            "an edge that is not parallel to the axis, or edges of several radii",
            "a cylinder: straight edges of one radius",
            "a cone or a flat face cannot be pressed on; draw and name the cylinder.",
        )
    if len(own) != len(others) or not all(
        any(_same(curve, other, size) for other in others) for curve in own
    ):
        raise _error(
            name,
            f"edges of '{one}' and '{two}' with different ends",
            "the same two ends in both parts",
            "end the edge of either part where the other one ends, as for parts that are glued.",
        )
    upwards = own[0].end[1] > own[0].start[1]  # the material is on the left: inside
    return Joint(
        name=name,
        inner=one if upwards else two,
        outer=two if upwards else one,
        radius=own[0].start[0],
        length=float(sum(curve.length for curve in own)),
    )


def edges_of_two(profiles: Mapping[str, Profile], name: str) -> dict[str, list[Curve]]:
    """Edges of this name, by solid; rejects what are not those of exactly two solids."""
    edges = {
        solid: found
        for solid, profile in profiles.items()
        if (found := [curve for curve in profile.curves if curve.name == name])
    }
    if len(edges) != 2:
        shared = [
            other
            for other in dict.fromkeys(c.name for p in profiles.values() for c in p.curves)
            if other and sum(any(c.name == other for c in p.curves) for p in profiles.values()) == 2
        ]
        raise _error(
            name,
            f"a name of edges of {_listed(edges) or 'no part'}",
            "the name of the edge that two parts share "
            f"(here: {', '.join(shared) or 'none, no two parts have a name in common'})",
            "give the shared edge this name in both parts.",
        )
    return edges


def _same(a: Curve, b: Curve, size: float) -> bool:
    """Whether two straight edges are one, walked in opposite senses."""
    ends = np.subtract((a.start, a.end), (b.end, b.start))
    return b.centre is None and bool(np.abs(ends).max() <= SAME * size)


def _listed(names: Mapping[str, object]) -> str:
    return ", ".join(f"'{name}'" for name in names)


def _error(name: str, got: str, expected: str, hint: str) -> InputError:
    return InputError(f"fits.{name}", got=got, expected=expected, hint=hint)
