"""What a face of a part is called by its shape and place: seen from z, the axis of motion.

==================  =================================================================
bottom, top         flat across the axis, at the lowest or highest point of the part
shoulder            flat across the axis, in between
outside             flat or cylinder along the axis; nothing of the part lies beyond
bore, shaft         other cylinder along the axis: hollow, or around material
cross bore          hollow cylinder of another direction
cone, ball          also hollow cone, hollow ball
flat                plane of another direction
round               piece of these that turns by less than half, and a cylinder across
curved              any other, such as a torus
==================  =================================================================

A half section states its curves.  On a solid, points and normals of the triangles with which
OpenCASCADE draws a face are exact to single precision: with the outward normals n of a plane are
equal, those of a cylinder or cone have one component along its axis; p - R n is one point on a
ball and lies on the axis of a cylinder, and (p - a) n = 0 for the apex a of a cone.
"""

from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

from klack.arrays import Floats
from klack.mesh.profile import Curve, Profile, on_axis
from klack.mesh.solid import face_names

__all__ = ["EVEN", "profile_places", "solid_places"]

EVEN = 1e-3
"""Of the size of a part: heights and distances that differ less are one."""
_SAME = 1e-4  # of normals, and of the size of a face; single precision is 1e-7
_FAR = 1e-6  # of the distance of a face from the origin, by single precision
_HALF = np.radians(170)  # a turn from here on goes half round, between corners of triangles
_MOST = 64  # corners of triangles of a face that are compared with all others


def profile_places(profiles: Mapping[str, Profile]) -> dict[str, str]:
    """Words of each name of half sections."""
    curves = [c for profile in profiles.values() for c in profile.curves]
    points = np.concatenate([c.at(np.linspace(0, 1, 33)) for c in curves])
    low, high = points.min(axis=0), points.max(axis=0)
    found: dict[str, set[str]] = {}
    for curve in curves:
        if curve.name and not on_axis(curve):
            found.setdefault(curve.name, set()).add(_of_curve(curve, low, high))
    return {name: _together(words) for name, words in found.items()}


def _of_curve(curve: Curve, low: Floats, high: Floats) -> str:
    """Material is to the left of a curve."""
    least = EVEN * float(np.max(high - low))
    if curve.centre is not None:
        is_ball = abs(curve.centre[0]) < _SAME * curve.radius
        return _hollow("ball", curve.angle < 0.0) if is_ball else "curved"
    r, z = (b - a for a, b in zip(curve.start, curve.end, strict=True))
    if abs(z) <= _SAME * abs(r):
        return _level(curve.start[1], low[1], high[1], least)
    if abs(r) > _SAME * abs(z):
        return _hollow("cone", z < 0.0)
    if z < 0.0:
        return "bore"
    return "outside" if high[0] - curve.start[0] < least else "shaft"


def solid_places(shape: Any) -> dict[str, str]:
    """Words of each name of a shape, whose boxes are of its triangles from here on."""
    from netgen.occ import OCCGeometry

    drawn = OCCGeometry(shape)._visualizationData()  # as it draws itself
    owners = drawn["indices"]
    points, normals = (
        drawn[key].reshape(-1, 3, 3).astype(float) for key in ("vertices", "normals")
    )
    every = np.unique(points.reshape(-1, 3), axis=0)
    # at a pole OpenCASCADE may draw the opposite of the normal, or none
    is_normal = np.abs(np.linalg.norm(normals, axis=2) - 1.0) < _SAME
    is_normal &= np.einsum("tki,tli->tk", normals, normals) > 0.0

    def place(numbers: list[int], sign: float) -> str:
        own = np.isin(owners, numbers)[:, None] & is_normal
        return _of_points(points[own], sign * normals[own], every)

    names, faces = face_names(shape), list(shape.faces)
    counts = Counter(faces)  # one between two solids is there twice, and drawn once
    drawn_as = {face: number for number, face in enumerate(counts)}
    found = {}
    for name in dict.fromkeys(names):
        named = [face for face, other in zip(faces, names, strict=True) if other == name]
        own = sorted({drawn_as[face] for face in named})
        inner = sorted({drawn_as[face] for face in named if counts[face] > 1})
        words = {"curved" if inner else place(own, 1.0)}
        if words == {"curved"}:  # no single shape
            words = {place([number], 1.0) for number in own}
            words |= {place([number], -1.0) for number in inner}
        found[name] = _together(words)
    return found


def _of_points(p: Floats, n: Floats, every: Floats) -> str:
    """Words of a face from points (k, 3) on it and its normals there."""
    if not len(p):
        return "curved"
    low, high = every.min(axis=0), every.max(axis=0)
    least = EVEN * float(np.max(high - low))
    near = _SAME * float(np.max(np.ptp(p, axis=0))) + _FAR * float(np.abs(p).max())
    if np.abs(n - n[0]).max() < _SAME:
        if np.ptp(p @ n[0]) > near:
            return "curved"
        if np.hypot(n[0, 0], n[0, 1]) < _SAME:
            return _level(float(p[0, 2]), low[2], high[2], least)
        return "outside" if _is_outside(p, n, every, least) else "flat"
    radius, rest = _offset(p, n)
    if rest < near:
        is_ball = any(_turn(n, axis) > _HALF for axis in np.eye(3))
        return _hollow("ball" if is_ball else "round", radius < 0.0)
    axis = _least(n)
    if np.abs(n @ axis).max() < _SAME:
        across = np.eye(3) - np.outer(axis, axis)
        radius, rest = _offset(p @ across, n)
        if rest > near:
            return "curved"
        is_along = np.hypot(axis[0], axis[1]) < _SAME
        if radius > 0.0:
            if is_along and _is_outside(p, n, every, least):
                return "outside"
            return "shaft" if is_along and _turn(n, axis) > _HALF else "round"
        if _turn(n, axis) < _HALF:
            return "hollow round"
        return "bore" if is_along else "cross bore"
    away = p - np.linalg.lstsq(n, np.einsum("ij,ij->i", p, n), rcond=None)[0]
    some = np.linalg.norm(away, axis=1) > near  # at the apex any normal is one
    away, n = away[some], n[some]
    axis = _least(n - n.mean(axis=0))
    if np.ptp(n @ axis) > _SAME or np.abs(np.einsum("ij,ij->i", away, n)).max() > near:
        return "curved"
    away -= np.outer(away @ axis, axis)
    is_hollow = np.einsum("ij,ij->", away, n) < 0.0
    return _hollow("cone" if _turn(n, axis) > _HALF else "round", is_hollow)


def _offset(p: Floats, n: Floats) -> tuple[float, float]:
    """Radius R [mm] with which p - R n are one point, and the largest distance from it.

    Of normals that are not all one.
    """
    normal, place = n - n.mean(axis=0), p - p.mean(axis=0)
    radius = float(np.sum(normal * place) / np.sum(normal**2))
    return radius, float(np.linalg.norm(place - radius * normal, axis=1).max())


def _least(n: Floats) -> Floats:
    """Direction of the smallest components of vectors (k, 3)."""
    return np.asarray(np.linalg.eigh(n.T @ n)[1][:, 0])


def _turn(n: Floats, axis: Floats) -> float:
    """Angle [rad] about an axis that the normals cover: a full turn less their largest gap."""
    a, b = np.linalg.svd(axis[None])[2][1:]
    some = np.hypot(n @ a, n @ b) > _SAME
    angles = np.sort(np.arctan2(n[some] @ b, n[some] @ a))
    return float(2.0 * np.pi - np.max(np.diff([*angles, angles[0] + 2.0 * np.pi])))


def _is_outside(p: Floats, n: Floats, every: Floats, least: float) -> bool:
    """Whether, along one of the normals across z, nothing of the part lies beyond the face."""
    if np.abs(n[:, 2]).max() > _SAME:
        return False
    some = np.linspace(0, len(p) - 1, min(len(p), _MOST)).astype(int)
    beyond = (every @ n[some].T).max(axis=0) - np.einsum("ij,ij->i", p[some], n[some])
    return bool(beyond.min() < least)


def _level(z: float, low: float, high: float, least: float) -> str:
    return "bottom" if z - low < least else "top" if high - z < least else "shoulder"


def _hollow(word: str, is_hollow: bool) -> str:
    return f"hollow {word}" if is_hollow else word


def _together(words: set[str]) -> str:
    return " and ".join(sorted(words)) if len(words) < 3 else "several places"
