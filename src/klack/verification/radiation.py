"""Sound of closed surfaces by boundary elements: spheres, cylinders, small bodies, triangles."""

from collections.abc import Iterator
from functools import cache, partial
from math import log10, pi

import numpy as np
import scipy

from klack.acoustics.boundary.revolved import Meridian
from klack.acoustics.boundary.solution import Radiation, radiation
from klack.acoustics.boundary.triangles import Triangles
from klack.arrays import Vector
from klack.verification.check import Check
from klack.verification.check import check as plain_check

__all__ = ["checks", "sphere_efficiency", "sphere_meridian", "sphere_pressure", "sphere_triangles"]

_SERIES = "sphere in P_n: spherical Hankel functions (Morse & Ingard 1968, ch. 7.2)"
_CAP = "piston in a sphere: its series in P_n, 0 to 39"
_DIPOLE = "dipole of a small rigid body: force of its added mass and its own volume of air"
_TABLE = "an independent solution with boundary elements (50 elements, 0.02 dB against 100)"

check = partial(
    plain_check, reason="constant elements: as wide for every motion and frequency, to tell levels"
)

_CYLINDER = (  # radius 1, length 3: k, motion, efficiency
    (0.3, "end piston", 0.021728),
    (0.3, "axial shake", 0.0057383),
    (0.3, "ring breathing", 0.096338),
    (0.3, "transverse shake", 0.0057353),
    (1.0, "end piston", 0.2548),
    (1.0, "axial shake", 0.30373),
    (1.0, "ring breathing", 0.57559),
    (1.0, "transverse shake", 0.45919),
    (3.0, "end piston", 1.1167),
    (3.0, "axial shake", 1.1108),
    (3.0, "ring breathing", 1.0195),
    (3.0, "transverse shake", 0.95434),
    (8.0, "end piston", 0.98729),
    (8.0, "axial shake", 0.98325),
    (8.0, "ring breathing", 1.0026),
    (8.0, "transverse shake", 1.0042),
)


def checks() -> list[Check]:
    """All checks of the group."""
    return [*_spheres(), *_caps(), *_cylinders(), *_small(), *_triangles()]


def sphere_pressure(n: int, ka: float, kr: float | None = None) -> complex:
    """Pressure over density and speed of sound [-] per ``v_n = P_n``, on a sphere or at kr."""
    slope = _hankel(n, ka, derivative=True)
    return complex(-1j * _hankel(n, ka if kr is None else kr) / slope)


def sphere_efficiency(n: int, ka: float) -> float:
    """Radiation efficiency [-] of a sphere in P_n."""
    return float(1.0 / (ka**2 * abs(_hankel(n, ka, derivative=True)) ** 2))


def sphere_meridian(count: int, order: int = 0) -> Meridian:
    """Of radius 1 m."""
    angle = np.linspace(pi, 0.0, count + 1)
    return Meridian(nodes=np.column_stack([np.abs(np.sin(angle)), np.cos(angle)]), order=order)


def _hankel(n: int, x: float, derivative: bool = False) -> complex:
    real = scipy.special.spherical_jn(n, x, derivative)
    return complex(real - 1j * scipy.special.spherical_yn(n, x, derivative))


def _decibels(found: float, known: float) -> float:
    return 10.0 * log10(found / known)


def _cosine(mesh: Meridian) -> Vector:
    return np.asarray(mesh.centres[:, 1] / np.hypot(*mesh.centres.T))


def _spheres() -> Iterator[Check]:
    mesh, across = sphere_meridian(60), sphere_meridian(60, order=1)
    cosine = _cosine(mesh)
    modes = np.column_stack([scipy.special.eval_legendre(n, cosine) for n in range(4)])
    places = ("0.3", "1", "pi", "4.4934", "10")
    for words, ka in zip(places, (0.3, 1.0, pi, 4.493409458, 10.0), strict=True):
        found = radiation(mesh, ka, modes)
        for n in range(4 if ka >= 1.0 else 3):
            known = sphere_efficiency(n, ka)
            level = _decibels(found.efficiency[n], known)
            yield check(f"sphere in P_{n}, ka {words}: power [dB]", 0.0, level, 0.05, _SERIES)
        for n in range(3):
            exact = sphere_pressure(n, ka) * modes[:, n]
            error = _distance(found, n, exact)
            yield check(f"sphere in P_{n}, ka {words}: pressure [-]", 0.0, error, 0.01, _SERIES)
        away = found.pressure_at(np.array([[3.0, 4.0]]))[0, 1]
        exact_away = sphere_pressure(1, ka, 5.0 * ka) * 0.8
        yield check(
            f"sphere in P_1, ka {words}: pressure with phase, 5 radii off [-]",
            *(0.0, abs(away / exact_away - 1.0), 0.01, _SERIES),
        )
        moved = radiation(across, ka, across.rigid[:, :1])
        level = _decibels(moved.efficiency[0], sphere_efficiency(1, ka))
        yield check(f"sphere shaken across, ka {words}: power [dB]", 0.0, level, 0.05, _SERIES)


def _distance(found: Radiation, column: int, exact: np.ndarray) -> float:
    """Root mean square over the surface, relative."""
    areas = found.mesh.areas
    rest = np.abs(found.pressure[:, column] - exact) ** 2 @ areas
    return float(np.sqrt(rest / (np.abs(exact) ** 2 @ areas)))


def _caps() -> Iterator[Check]:
    mesh = sphere_meridian(60)  # an edge at 30 degrees
    cap = (_cosine(mesh) > np.cos(pi / 6))[:, None].astype(float)
    for ka, known in ((1.0, 0.0709877222), (5.0, 0.911612118), (10.0, 0.97389693)):
        level = _decibels(radiation(mesh, ka, cap).efficiency[0], known)
        yield check(f"cap of 30 degrees of a sphere, ka {ka:g}: power [dB]", 0, level, 0.05, _CAP)


def _cylinder(order: int, size: float = 0.1, length: float = 3.0) -> Meridian:
    across, along = round(1.0 / size), round(length / size)
    up = np.linspace(-length / 2, length / 2, along + 1)
    out = np.linspace(0.0, 1.0, across + 1)
    lower = np.column_stack([out[:-1], np.full(across, up[0])])
    upper = np.column_stack([out[::-1], np.full(across + 1, up[-1])])
    side = np.column_stack([np.ones(along), up[:-1]])
    return Meridian(nodes=np.vstack([lower, side, upper]), order=order)


@cache
def _cylinder_efficiencies(k: float) -> dict[str, float]:
    mesh, across = _cylinder(0), _cylinder(1)
    nr, nz = mesh.normals.T
    motions = np.column_stack([nz > 0.5, nz, nr * np.cos(pi * mesh.centres[:, 1] / 3.0)])
    axial = radiation(mesh, k, motions).efficiency
    names = ("end piston", "axial shake", "ring breathing")
    moved = radiation(across, k, across.rigid[:, :1]).efficiency[0]
    return {**dict(zip(names, axial.tolist(), strict=True)), "transverse shake": float(moved)}


def _cylinders() -> Iterator[Check]:
    for k, motion, known in _CYLINDER:
        level = _decibels(_cylinder_efficiencies(k)[motion], known)
        yield check(f"cylinder, {motion}, kR {k:g}: power [dB]", 0.0, level, 0.1, _TABLE)


def sphere_triangles(level: int) -> Triangles:
    """Icosahedron divided over and over, with the area of a sphere of radius 1 m."""
    hull = scipy.spatial.ConvexHull(_icosahedron())
    points = hull.points
    for _ in range(level):
        a, b = points[hull.simplices], points[np.roll(hull.simplices, 1, axis=1)]
        middles = np.unique(np.round((a + b).reshape(-1, 3), 9), axis=0)
        points = np.vstack([points, middles / np.linalg.norm(middles, axis=1)[:, None]])
        hull = scipy.spatial.ConvexHull(points)
    a, b, c = np.moveaxis(points[hull.simplices], 1, 0)
    inwards = (np.cross(b - a, c - a) * a).sum(axis=1) < 0.0
    corners = np.where(inwards[:, None], hull.simplices[:, ::-1], hull.simplices)
    mesh = Triangles(points=points, corners=corners)
    return Triangles(points=points * np.sqrt(4.0 * pi / mesh.areas.sum()), corners=corners)


def _icosahedron() -> np.ndarray:
    golden = (1.0 + 5.0**0.5) / 2.0
    flat = [(0.0, a, b * golden) for a in (-1.0, 1.0) for b in (-1.0, 1.0)]
    points = np.array([np.roll(point, turn) for point in flat for turn in range(3)])
    return np.asarray(points / np.linalg.norm(points, axis=1)[:, None])


def _triangles() -> Iterator[Check]:
    mesh = sphere_triangles(2)
    cosine = mesh.centres[:, 2] / np.linalg.norm(mesh.centres, axis=1)
    modes = np.column_stack([scipy.special.eval_legendre(n, cosine) for n in range(4)])
    for words, ka in (("0.3", 0.3), ("1", 1.0), ("pi", pi), ("5", 5.0)):
        found = radiation(mesh, ka, modes)
        for n in range(4):
            known = 4.0 * pi / (2 * n + 1) * sphere_efficiency(n, ka)
            level = _decibels(float(found.matrix[n, n]), known)
            name = f"sphere of 320 triangles in P_{n}, ka {words}: power [dB]"
            yield check(name, 0.0, level, 0.1, _SERIES)
            error = _distance(found, n, sphere_pressure(n, ka) * modes[:, n])
            name = f"sphere of 320 triangles in P_{n}, ka {words}: pressure [-]"
            yield check(name, 0.0, error, 0.025, _SERIES)


def _small() -> Iterator[Check]:
    k = 0.05
    for order, words in ((0, "along"), (1, "across")):
        mesh = _cylinder(order)
        motion = mesh.rigid[:, :1]
        found = radiation(mesh, k, motion)
        moved = float(found.added_mass(motion[:, 0])[0]) + mesh.volume
        dipole = (k * moved) ** 2 * k**2 / (12.0 * pi)
        level = _decibels(float(found.matrix[0, 0]), dipole)
        yield check(f"small cylinder {words} its axis: power [dB]", 0.0, level, 0.05, _DIPOLE)
