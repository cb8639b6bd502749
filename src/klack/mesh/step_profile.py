"""Half section of a turned part from its STEP file.

The solid is cut with the half plane y = 0, x >= 0. It is a body of revolution if the cut is one
outline of straight edges and arcs whose full turn has its volume and surface (Pappus), and a
second half plane cuts the same area.
"""

from pathlib import Path
from typing import Any

import numpy as np

from klack.arrays import Floats
from klack.errors import InputError
from klack.mesh.occ import MM, box_mm
from klack.mesh.profile import Arc, Curve, Line, Profile, on_axis
from klack.mesh.solid import face_names, read_step, solid_names

__all__ = ["NotTurnedError", "profiles_of_shape", "profiles_of_step"]


_SAME = 1e-5  # of volume, surface or area of the cut; OpenCASCADE integrates to 1e-6 or better
_TURN = 37.3  # [deg] of the second half plane: no divisor of a usual pattern of holes
_STRAIGHT = 1e-7  # of the size of the part: a curve within this of a line or an arc is one
_DIGITS = 10  # after the point, of coordinates in mm


class NotTurnedError(InputError):
    """A solid that is no body of revolution around z; ``got`` says why."""


def profiles_of_step(path: str | Path) -> dict[str, Profile]:
    """Half section of every solid of a STEP file, [m].

    Edges are named as the faces that they sweep (:func:`~klack.mesh.solid.mesh_step`), or the part
    of a face that lies in the plane.

    Raises
    ------
    NotTurnedError
        For a solid that is no body of revolution around z.
    """
    return profiles_of_shape(str(path), read_step(Path(path)))


def profiles_of_shape(where: str, shape: Any) -> dict[str, Profile]:
    """Half section of every solid of an OpenCASCADE shape [m]."""
    faces = list(zip(face_names(shape), shape.faces, strict=True))
    names = solid_names(shape)
    return {
        name: _profile(f"{where}: solid '{name}'", solid, faces)
        for name, solid in zip(names, shape.solids, strict=True)
    }


def _profile(where: str, solid: Any, faces: list[tuple[str, Any]]) -> Profile:
    low, high = box_mm(solid)
    size = float(np.max(high - low))
    cut = _cut(solid, low, high)
    if len(cut.faces) != 1 or len(cut.faces[0].wires) != 1:
        outlines = sum(len(face.wires) for face in cut.faces)
        raise _not_turned(where, f"{outlines} outlines next to the z axis")
    curves = _chained(where, [_curve(where, edge, size) for edge in cut.edges], size)
    named = [_edge(curve, "" if on_axis(curve) else _name_at(curve, faces)) for curve in curves]
    profile = Profile(curves[0].start, tuple(named))
    swept = sum(_swept(curve) for curve in curves) * MM**2
    other = _cut(solid.Rotate(_z_axis(), _TURN), low, high)
    for found, expected, what in (
        (profile.volume * MM**3, solid.mass, "volume"),
        (swept, sum(face.mass for face in solid.faces), "surface"),
        (profile.area * MM**2, sum(face.mass for face in other.faces), "half section"),
    ):
        if abs(found - expected) > _SAME * abs(expected):
            share = 100.0 * (expected / found - 1.0)
            raise _not_turned(
                where, f"a {what} that differs by {share:.2g} % from a body of revolution"
            )
    return profile


def _z_axis() -> Any:
    from netgen.occ import Axis, Z

    return Axis((0, 0, 0), Z)


def _cut(solid: Any, low: Floats, high: Floats) -> Any:
    """Faces that the half plane shares with a solid."""
    from netgen.occ import Axes, WorkPlane

    width = 2.0 * float(np.max(np.abs([low[:2], high[:2]])))
    height = float(high[2] - low[2])
    axes = Axes((0, 0, low[2] - 0.5 * height), n=(0, -1, 0), h=(1, 0, 0))
    return WorkPlane(axes).Rectangle(width, 2.0 * height).Face() * solid


def _curve(where: str, edge: Any, size: float) -> Curve:
    """Edge of the cut as a line or arc [m]."""
    first, last = edge.parameter_interval
    points = np.array([_rounded(edge.Value(s)) for s in np.linspace(first, last, 9)])
    start, end, middle = points[0], points[-1], points[4]
    chord = end - start
    length = float(np.hypot(*chord))
    if length > 0.0:
        off = np.abs(chord[0] * (points[:, 1] - start[1]) - chord[1] * (points[:, 0] - start[0]))
        if np.max(off) <= _STRAIGHT * size * length:
            return Curve(_metres(start), _metres(end), "")
        centre = _centre(start, middle, end)
        radius = np.hypot(*(points - centre).T)
        if np.ptp(radius) <= _STRAIGHT * max(size, float(radius[0])):
            before, after = middle - start, end - middle
            turn = before[0] * after[1] - before[1] * after[0]
            spread = 2.0 * np.arcsin(min(length / (2.0 * float(radius[0])), 1.0))
            if (middle - centre) @ (0.5 * (start + end) - centre) < 0.0:
                spread = 2.0 * np.pi - spread
            centre = np.round(centre, _DIGITS) + 0.0
            return Curve(
                _metres(start), _metres(end), "", _metres(centre), float(np.sign(turn) * spread)
            )
    raise _not_turned(where, "a section with a curve that is neither straight nor an arc")


def _rounded(point: Any) -> tuple[float, float]:
    return round(point.x, _DIGITS) + 0.0, round(point.z, _DIGITS) + 0.0


def _metres(point: Floats) -> tuple[float, float]:
    # 15 digits: 0.3 mm must be the same number here as 0.0003 m elsewhere
    r, z = (float(f"{x / MM:.15g}") for x in point)
    return r, z


def _centre(a: Floats, b: Floats, c: Floats) -> Floats:
    """Centre of the circle through three points."""
    rows = 2.0 * np.array([b - a, c - a])
    right = np.array([b @ b - a @ a, c @ c - a @ a])
    return np.linalg.solve(rows, right)


def _chained(where: str, curves: list[Curve], size: float) -> list[Curve]:
    """Curves in the order of a walk."""
    rest = list(curves)
    walk = [rest.pop(0)]
    near = 1e-6 * size / MM
    while rest:
        here = np.array(walk[-1].end)
        for curve in rest:
            onward = next(
                (c for c in (curve, curve.reversed) if np.hypot(*(here - c.start)) <= near), None
            )
            if onward is not None:
                rest.remove(curve)
                walk.append(onward)
                break
        else:
            raise _not_turned(where, "an outline that is not closed")
    return [
        Curve(walk[i - 1].end, curve.end, "", curve.centre, curve.angle)
        for i, curve in enumerate(walk)
    ]


def _name_at(curve: Curve, faces: list[tuple[str, Any]]) -> str:
    """Face on which the middle of an edge lies."""
    from netgen.occ import Pnt, Vertex

    r, z = (float(x) * MM for x in curve.at(0.5))
    place = Vertex(Pnt(r, 0.0, z))
    return min(faces, key=lambda item: item[1].Distance(place))[0]


def _edge(curve: Curve, name: str) -> Line | Arc:
    if curve.centre is None:
        return Line(curve.end, name)
    return Arc(curve.end, curve.centre, name, curve.angle < 0.0)


def _swept(curve: Curve) -> float:
    """Area of the turned edge [m^2]: length times way of its centroid."""
    points = curve.at(np.linspace(0.0, 1.0, 2001))[:, 0]
    mean = (points[0] + points[-1] + 4 * points[1::2].sum() + 2 * points[2:-1:2].sum()) / 6000.0
    return float(2.0 * np.pi * mean * curve.length)


def _not_turned(where: str, got: str) -> NotTurnedError:
    return NotTurnedError(
        where,
        got=got,
        expected="a body of revolution around the z axis",
        hint="compute it as a solid.",
    )
