"""First touch of two bodies along the axis, and its distance.

Both surfaces are sampled as heights; the clearance is least where they touch.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from math import cos, pi, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from klack.case.guide import CaseGuide
from klack.contact.pairing import face_geometry, face_lattice, project_to_surface
from klack.errors import InputError
from klack.mesh.mesh import Mesh, Surface
from klack.mesh.profile import Curve, Profile

__all__ = ["Touch", "axis_through", "first_touch_of_meshes", "first_touch_of_profiles", "in_disc"]


_SAMPLES = 4001
_SECTORS = 48
_LATTICE = 8
# Radii whose clearance exceeds the least one by less than this share of the common range belong to
# the same touch: flat on flat gives a whole zone, curved on curved a ring.
_FLAT = 1e-8


@dataclass(frozen=True, slots=True)
class Touch:
    """First touch, as drawn, on both bodies.

    Parameters
    ----------
    upper, lower : tuple of (r, z) rings or (x, y, z) points [m]
        Empty for a flat zone that touches all at once.
    clearance [m]
        Travel to first touch, negative for overlap.
    """

    upper: tuple[tuple[float, ...], ...]
    lower: tuple[tuple[float, ...], ...]
    clearance: float


def first_touch_of_profiles(
    upper: Iterable[Profile], surface_a: str, lower: Iterable[Profile], surface_b: str
) -> Touch:
    """Ring where ``surface_a`` of the upper body first meets ``surface_b``."""
    curves_a = _curves_of(upper, surface_a)
    curves_b = _curves_of(lower, surface_b)
    r_a, r_b = _radial_range(curves_a), _radial_range(curves_b)
    low, high = max(r_a[0], r_b[0]), min(r_a[1], r_b[1])
    if not low <= high:
        raise InputError(
            f"contact of '{surface_a}' on '{surface_b}'",
            got=f"radii {r_a[0] * 1e3:.4g} to {r_a[1] * 1e3:.4g} mm over "
            f"{r_b[0] * 1e3:.4g} to {r_b[1] * 1e3:.4g} mm",
            expected="surfaces that face each other along the axis",
            hint="check which edges are named in contact.between.",
        )
    r = np.linspace(low, high, _SAMPLES)
    z_a = _heights(curves_a, r, lowest=True)
    z_b = _heights(curves_b, r, lowest=False)
    clearance = z_a - z_b
    least = float(np.min(clearance))
    flat = clearance - least <= _FLAT * (high - low)
    zone = r[flat]
    if zone[-1] - zone[0] > 20 * (r[1] - r[0]):
        return Touch((), (), least)
    i = int(np.argmin(clearance))
    radius = float(r[i])
    return Touch(((radius, float(z_a[i])),), ((radius, float(z_b[i])),), least)


def _curves_of(profiles: Iterable[Profile], name: str) -> list[Curve]:
    profiles = list(profiles)
    curves = [c for profile in profiles for c in profile.curves if c.name == name]
    if not curves:
        known = ", ".join(dict.fromkeys(n for p in profiles for n in p.names)) or "none"
        raise InputError(
            f"surface '{name}'",
            got="a name of no edge of the profile",
            expected=f"one of: {known}",
            hint="check the spelling in contact.between, or name the edge.",
        )
    return curves


def _radial_range(curves: list[Curve]) -> tuple[float, float]:
    r = np.concatenate([c.at(np.linspace(0, 1, _SAMPLES))[:, 0] for c in curves])
    return float(r.min()), float(r.max())


def _heights(curves: list[Curve], r: NDArray[np.float64], *, lowest: bool) -> NDArray[np.float64]:
    """Lowest (highest) height of the curves over radii."""
    worst = np.inf if lowest else -np.inf
    z = np.full_like(r, worst)
    for curve in curves:
        points = curve.at(np.linspace(0, 1, 4 * _SAMPLES))
        order = np.argsort(points[:, 0])
        inside = (r >= points[:, 0].min()) & (r <= points[:, 0].max())
        here = np.interp(r, points[order, 0], points[order, 1], left=worst, right=worst)
        here = np.where(inside, here, worst)
        z = np.minimum(z, here) if lowest else np.maximum(z, here)
    return z


def first_touch_of_meshes(
    upper: Mesh, surface_a: Surface, lower: Mesh, surface_b: Surface, *, tolerance: float
) -> Touch:
    """Points where coarse meshes of two solids first meet.

    The upper surface is sampled on its curved faces; of every sector around the axis the lowest
    sample counts.

    Parameters
    ----------
    tolerance [m]
        Sectors whose clearance exceeds the least one by more do not touch.
    """
    samples = np.concatenate(
        [
            face_geometry(
                upper.points, block, face_lattice(block.family, _LATTICE)
            ).position.reshape(-1, 3)
            for block in surface_a.blocks
        ]
    )
    down = np.tile([0.0, 0.0, -1.0], (len(samples), 1))
    met = project_to_surface(samples, down, lower, surface_b, deepest=np.inf)
    if not np.any(met.met):
        raise InputError(
            f"contact of '{surface_a.name}' on '{surface_b.name}'",
            got="no line along z that meets both surfaces",
            expected="surfaces that face each other along the axis",
            hint="check which faces are named in contact.between; the axis of motion is z.",
        )
    samples, gap = samples[met.met], met.gap[met.met]
    sector = np.floor(np.arctan2(samples[:, 1], samples[:, 0]) / (2 * np.pi) * _SECTORS)
    order = np.lexsort((gap, sector))
    lowest = order[np.unique(sector[order], return_index=True)[1]]
    lowest = lowest[gap[lowest] <= gap.min() + tolerance]
    below = samples[lowest] - np.column_stack([0 * gap[lowest], 0 * gap[lowest], gap[lowest]])
    return Touch(_points(samples[lowest]), _points(below), float(gap.min()))


def _points(array: NDArray[np.float64]) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(x) for x in row) for row in array)


Vector = NDArray[np.float64]


def axis_through(
    guide: CaseGuide, height: float, low: Vector, high: Vector
) -> tuple[Vector, Vector]:
    """Position at a height and slope of the axis through points at the outer heights."""
    slope = (high - low) / (guide.heights[-1] - guide.heights[0])
    return low + slope * (height - guide.heights[0]), slope


def in_disc(shares: Vector, radius: float) -> Vector:
    """Point of a disc, uniform, from two numbers between 0 and 1."""
    distance, angle = radius * sqrt(shares[0]), 2.0 * pi * shares[1]
    return distance * np.array([cos(angle), sin(angle)])
