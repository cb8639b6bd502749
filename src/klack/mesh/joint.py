"""What two solids share: a cylinder of a press fit, a flat face under bolts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.mesh.profile import SAME, Curve, Profile

__all__ = [
    "FlatJoint",
    "Joint",
    "JointError",
    "across",
    "cylinder_joint",
    "edges_of_two",
    "flat_joint",
    "refuse_joint_if",
]


class JointError(InputError):
    """Something wrong with what two solids share; ``name`` is that of the edge or face."""

    def __init__(self, name: str, *, got: str, expected: str, hint: str) -> None:
        self.name = name
        super().__init__(f"joint '{name}'", got=got, expected=expected, hint=hint)


def refuse_joint_if(wrong: object, name: str, *, got: str, expected: str, hint: str) -> None:
    """Raise :class:`JointError` where an edge or a face cannot be a joint."""
    if wrong:
        raise JointError(name, got=got, expected=expected, hint=hint)


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """A cylinder that is the edge or the face of two solids.

    Parameters
    ----------
    inner, outer
        Names of the solids: of the shaft and of the hub.
    radius, length [m]
    axis (3,) [m], (3,)
        Point and direction, of a solid body; None: that of a half section.
    """

    name: str
    inner: str
    outer: str
    radius: float
    length: float
    axis: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    @property
    def solids(self) -> tuple[str, str]:
        """Both, the inner one first."""
        return self.inner, self.outer

    def height(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height of points (n, d) along the axis, shape (n,) [m]."""
        return points[:, 1] if self.axis is None else np.asarray(points @ self.axis[1])

    def outwards(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Unit vectors from the axis to points, shape (n, d)."""
        if self.axis is None:
            return np.tile([1.0, 0.0], (len(points), 1))
        away = across(points, *self.axis)
        return np.asarray(away / np.linalg.norm(away, axis=1)[:, None])


@dataclass(frozen=True, slots=True, kw_only=True)
class FlatJoint:
    """A flat face that two solids share, and where bolts press them.

    Parameters
    ----------
    lower, upper
        Names of the solids.
    length [m]
        Of the edge along the radius.
    ends
        Names of the two edges or faces, of one solid each.
    normal (d,)
        From the lower to the upper solid.
    across (d - 1 | 0, d)
        Directions in the face in which a solid may tilt; none of a half section.
    """

    name: str
    lower: str
    upper: str
    length: float
    ends: tuple[str, str]
    normal: NDArray[np.float64]
    across: NDArray[np.float64]

    @property
    def solids(self) -> tuple[str, str]:
        """Both, the lower one first."""
        return self.lower, self.upper


def cylinder_joint(profiles: Mapping[str, Profile], name: str) -> Joint:
    """Joint of all edges of one name; rejects what is no cylinder of exactly two solids."""
    (one, own), (two, others) = edges_of_two(profiles, name).items()
    size = max(abs(x) for c in (*own, *others) for x in (*c.start, *c.end))
    radii = [r for curve in (*own, *others) for r, _ in (curve.start, curve.end)]
    refuse_joint_if(
        min(radii) <= SAME * size,
        name,
        got="an edge on the axis, or one that ends there",
        expected="a cylinder around the axis",
        hint="name the edge where the outer part meets the inner one.",
    )
    refuse_joint_if(
        max(radii) - min(radii) > SAME * size or any(c.centre is not None for c in own),
        name,
        got="an edge that is not parallel to the axis, or edges of several radii",
        expected="a cylinder: straight edges of one radius",
        hint="press fits on cones and flat faces are not supported; draw and name the cylinder.",
    )
    _require_same_ends(name, one, own, two, others)
    upwards = own[0].end[1] > own[0].start[1]  # the material is on the left: inside
    return Joint(
        name=name,
        inner=one if upwards else two,
        outer=two if upwards else one,
        radius=own[0].start[0],
        length=float(sum(curve.length for curve in own)),
    )


def across(
    points: NDArray[np.float64], middle: NDArray[np.float64], axis: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Vectors from an axis to points."""
    from_middle = points - middle
    return np.asarray(from_middle - np.outer(from_middle @ axis, axis))


def flat_joint(profiles: Mapping[str, Profile], name: str, ends: tuple[str, str]) -> FlatJoint:
    """Joint of all edges of one name; rejects what is no flat face of exactly two solids.

    ``ends`` are edges of one solid each, straight and not on the axis.
    """
    (one, own), (two, others) = edges_of_two(profiles, name).items()
    size = max(abs(x) for c in (*own, *others) for x in (*c.start, *c.end))
    heights = [z for curve in (*own, *others) for _, z in (curve.start, curve.end)]
    refuse_joint_if(
        max(heights) - min(heights) > SAME * size or any(c.centre is not None for c in own),
        name,
        got="an edge that is not perpendicular to the axis, or edges at several heights",
        expected="a flat face: straight edges of one z",
        hint="bolts press along the axis; draw and name the flat face (cones are not supported).",
    )
    _require_same_ends(name, one, own, two, others)
    for end in ends:
        curves = [(solid, c) for solid, p in profiles.items() for c in p.curves if c.name == end]
        straight = all(c.centre is None and c.start[0] + c.end[0] > SAME * size for _, c in curves)
        if len({solid for solid, _ in curves}) != 1 or not straight:
            raise JointError(
                name,
                got=f"bolts between {ends[0]} and {ends[1]}, where '{end}' is not a straight "
                f"edge of "
                "one part, or lies on the axis",
                expected="two edges: one under the head, one at the thread",
                hint="name these edges in the parts; a nut presses like a head.",
            )
    upper = own[0].end[0] > own[0].start[0]  # the material is on the left: above
    return FlatJoint(
        name=name,
        lower=two if upper else one,
        upper=one if upper else two,
        length=float(sum(curve.length for curve in own)),
        ends=ends,
        normal=np.array([0.0, 1.0]),
        across=np.empty((0, 2)),
    )


def _require_same_ends(
    name: str, one: str, own: Sequence[Curve], two: str, others: Sequence[Curve]
) -> None:
    size = max(abs(x) for c in (*own, *others) for x in (*c.start, *c.end))
    refuse_joint_if(
        len(own) != len(others)
        or not all(any(_same(curve, other, size) for other in others) for curve in own),
        name,
        got=f"edges of '{one}' and '{two}' with different ends",
        expected="the same two ends in both parts",
        hint="end the edges of both parts at the same points, as for glued parts.",
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
        raise JointError(
            name,
            got=f"a name of edges of {_listed(edges) or 'no part'}",
            expected="the name of the edge that two parts share "
            f"(here: {', '.join(shared) or 'none, no two parts have a name in common'})",
            hint="give the shared edge this name in both parts.",
        )
    return edges


def _same(a: Curve, b: Curve, size: float) -> bool:
    """Whether two straight edges are one, walked in opposite senses."""
    ends = np.subtract((a.start, a.end), (b.end, b.start))
    return b.centre is None and bool(np.abs(ends).max() <= SAME * size)


def _listed(names: Mapping[str, object]) -> str:
    return ", ".join(f"'{name}'" for name in names)
