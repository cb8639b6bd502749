"""Check that meshes and named surfaces resolve the contact, and whether the bodies yield there.

The numbers of one mesh cannot tell: a contact on one row of elements is as wide as that row, all
levels agree on it, and the energy is kept.  So the shape of the two surfaces is asked: how wide
the contact should be (:mod:`klack.contact.hertz`), whether it lies on a sharp corner, and whether
it reaches the edge of a named surface (:mod:`klack.contact.surface_edges`).

A ring on a cone is a line contact and yields below its surface at a pressure of 1.79 Y, a contact
around one point at 1.295 exp(0.736 nu) Y (von Mises; Johnson, Contact Mechanics, 1985, section 6.2;
Jackson & Green, J. Tribol. 127 (2005) 343).  Stress of the body itself is not part of it, and
sharp corners yield at any load.
"""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import exp, floor, inf, isfinite, log10, nan, pi, sqrt

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.analyses.impact.record import LevelResult, PressureRecord
from klack.assembling.bodies import BodyPair
from klack.bodies.elasticity.body import ElasticBody
from klack.case.bodies import CaseFile
from klack.contact.hertz import line_half_width, point_radius
from klack.contact.mortar import ContactSpace
from klack.contact.statics import (
    COARSE,
    StaticContact,
    highest_load,
    points_across,
    ring_radius,
    size_over_half_width,
)
from klack.contact.surface_edges import SurfaceEdges
from klack.contact.touch_shape import relative_curvatures
from klack.errors import AccuracyWarning
from klack.machine.stages import warnings_of
from klack.mesh.mesh import Surface
from klack.units import format_si

__all__ = [
    "FEWEST_POINTS",
    "ContactCheck",
    "YieldCheck",
    "check_contact",
    "check_yield",
    "ends_reached",
    "expected_half_width",
    "force_all_round",
]


_LINE = 1.79
"""Highest pressure over the yield stress at first yield of a line contact (nu = 0.3)."""


@dataclass(frozen=True, kw_only=True)
class YieldCheck:
    """Where the bodies yield.

    ``pressure`` [Pa] is the highest at the given force, nan if unknown; up to ``needed`` [Pa], the
    yield stress, both bodies stay elastic there.
    """

    pressure: float = nan
    needed: float = nan


def check_yield(
    case: CaseFile,
    pair: BodyPair,
    static: StaticContact,
    force: float,
    surfaces: str,
    *,
    computed: bool = False,
) -> YieldCheck:
    """Compare the pressure at the peak force [N] with the yield stress of both bodies.

    ``static`` is of elastic bodies; ``computed`` if the law of the contact has the yield.  Warns
    where a body yields, though levels compute it as elastic, and where an estimated yield stress
    decides that.
    """
    if not 0.0 < force <= static.max_force:
        return YieldCheck()
    pressure, is_line = _pressure(static, force)
    needed, told = nan, []
    doubtful: dict[str, str] = {}
    for body, solid in zip((pair.upper, pair.lower), pair.solids, strict=True):
        if case.bodies[body.name].material is None:
            continue
        material = case.materials_of(body.name, body.mesh.solids)[solid]
        factor = _LINE if is_line else 1.295 * exp(0.736 * material.poisson)
        needed = float(np.fmax(needed, pressure / factor))
        if material.hardening is None:
            continue
        limit = material.hardening.yield_stress
        basis = case.materials[material.name].doubtful_yield
        if basis is not None and basis[0] < pressure / factor:
            doubtful[material.name] = (
                f"'{material.name}', {format_si(limit, 'Pa', 3)}, is {basis[1]}"
            )
        first = _first_yield(static, force, factor * limit)
        if first < force:
            told.append(
                f"'{body.name}' ({material.name}, {format_si(limit, 'Pa', 3)}) from about "
                f"{format_si(first, 'N', 2)}, at {100 * _speed(static, first, force):.2g} % of "
                "the speed of this impact"
            )
    if told and not computed:
        warnings.warn(
            f"contact {surfaces} yields before the {format_si(force, 'N', 3)} of this impact: "
            f"{' and '.join(told)}. Elastic levels are too hard there: the first impact on new "
            "faces is softer and rebounds less. Yield is included in the levels reduced (in the "
            "meridian plane) and interface of klack impact, in klack shots, and at the stops of "
            "klack stroke along the axis; three-dimensional bodies have to be drawn as profiles.",
            AccuracyWarning,
            stacklevel=2,
        )
    for words in doubtful.values():
        warnings.warn(
            f"contact {surfaces}: the yield stress of {words}. The amount of yielding depends on "
            "it. Try: 'yield' from a tensile test, or both ends of its range (klack study).",
            AccuracyWarning,
            stacklevel=2,
        )
    return YieldCheck(pressure=pressure, needed=needed)


def _pressure(static: StaticContact, force: float) -> tuple[float, bool]:
    """Highest Hertzian pressure [Pa] for this width, and whether it is a line."""
    lam = static.pattern_at(force) * force
    width, radius = static.half_width_at(force), ring_radius(static.space, lam)
    if radius is not None:
        return 2.0 * highest_load(static.space, lam) / (2.0 * pi * radius) / (pi * width), True
    return 1.5 * float(lam.sum()) / (pi * width**2), False


def _speed(static: StaticContact, force: float, highest: float) -> float:
    """Speed for a force over that for the highest."""
    approach, load = np.append(0.0, static.approach), np.append(0.0, static.force)
    stored = np.append(0.0, np.cumsum(np.diff(approach) * (load[1:] + load[:-1]) / 2.0))
    return sqrt(np.interp(force, load, stored) / np.interp(highest, load, stored))


def _first_yield(static: StaticContact, force: float, limit: float) -> float:
    """Lowest force [N] up to ``force`` that reaches the limit [Pa]; else inf."""
    loads = force * (np.arange(1, 41) / 40.0) ** 2
    pressures = np.maximum.accumulate([_pressure(static, float(load))[0] for load in loads])
    if pressures[-1] < limit:
        return inf
    return float(np.interp(limit, np.append(0.0, pressures), np.append(0.0, loads)))


FEWEST_POINTS = 5
"""Contact points across a contact below which no error is judged."""

_SIZE = 0.5
"""Advised element size over the expected half width: nine contact points across.

A mesh that is far too coarse is too stiff, and so overrates the force by up to 2.5 and the width by
up to 1.4."""

_EXTENT = 3.0
"""Half widths around the first touch that deserve small elements."""

_MARGIN = 0.3
"""Distance from an edge, over the element size, that counts as at it."""

_HALF = 0.6
"""The same for an edge within a surface, which lies between two contact points."""

_CARRIES = 1e-6
"""Share of the largest contact force above which a point carries."""

_OVER_THE_END = "it reaches the edge of a named surface"

_BEYOND = 0.98
"""Share of the force: worn by less, the faces yield again."""


@dataclass(frozen=True, kw_only=True)
class ContactCheck:
    """Findings on a contact; see :class:`klack.analyses.impact.record.ContactSummary`.

    ``expected`` [m] is the half width of smooth bodies of this shape (Hertz); nan where no law
    fits.
    """

    half_width: float
    size_ratio: float
    points_across: int
    expected: float
    needed_yield: float = nan
    doubts: tuple[str, ...] = ()


def check_contact(
    case: CaseFile,
    pair: BodyPair,
    static: StaticContact,
    force: float,
    surfaces: str,
    *,
    has_yield: bool = False,
    worn_by: float = 0.0,
) -> ContactCheck:
    """Judge a static contact, placed in touch, at the peak force [N], and warn of doubts.

    ``surfaces`` are named in messages; ``has_yield`` if the law of the contact has it; ``worn_by``
    [N] is the highest force of the impacts that have worn the faces.
    """
    space, lam = static.space, static.pattern_at(force)
    ratio = size_over_half_width(static, force)
    edges = _edges(pair)
    if 0.0 < worn_by < _BEYOND * force:
        _warn(
            f"contact {surfaces} is worn up to {format_si(worn_by, 'N', 4)} and yields again "
            f"at the {format_si(force, 'N', 4)} of this impact, which is computed as elastic. "
            "Try: the case with faces as made, at this speed with run.run_in."
        )
    across = points_across(static, force)
    expected = expected_half_width(case, pair, static, force)
    doubts = []
    corner = _corner(pair, edges, space, lam)
    if corner is not None:
        doubts.append("it lies on a sharp edge")
        _warn(corner)
    elif ratio > COARSE:
        doubts.append("its mesh is too coarse")
        _warn(_coarse(case, pair, static, force, ratio, expected))
    if across < FEWEST_POINTS:
        few = "1 contact point across is" if across == 1 else f"{across} contact points across are"
        doubts.append(f"{few} too few")
    if _tell_ends(edges, space.points, space.size, lam, surfaces):
        doubts.append(_OVER_THE_END)
    blunt = None if corner is not None else _blunt(edges, space, lam)
    if blunt is not None:
        _warn(blunt)
    needed = nan
    if corner is None and not 0.0 < worn_by:
        needed = check_yield(case, pair, static, force, surfaces, computed=has_yield).needed
    return ContactCheck(
        half_width=static.half_width_at(force),
        size_ratio=ratio,
        points_across=across,
        expected=nan if corner is not None else expected,
        needed_yield=nan if blunt is not None else needed,
        doubts=tuple(doubts),
    )


def ends_reached(
    check: ContactCheck,
    pair: BodyPair,
    space: ContactSpace,
    levels: Mapping[str, LevelResult],
    surfaces: str,
) -> ContactCheck:
    """Add a doubt and warn where contact points of levels ran over the end of a named surface.

    One body may lean or hit harder than in the static contact, which ``check`` is of.
    """
    if _OVER_THE_END in check.doubts:
        return check
    for name, result in levels.items():
        if result.pressure is None:
            continue
        record = result.pressure
        points = _as_drawn(record.points, space.dimension)
        _, nearest = scipy.spatial.cKDTree(space.points).query(points)
        force = np.max(record.point_force, axis=0)
        with warnings_of(f"level '{name}'"):
            if _tell_ends(_edges(pair), points, space.size[nearest], force, surfaces):
                return replace(check, doubts=(*check.doubts, _OVER_THE_END))
    return check


def _as_drawn(points: NDArray[np.float64], dimension: int) -> NDArray[np.float64]:
    """Points on rings as (r, z) in the half section."""
    if points.shape[1] == dimension:
        return points
    return np.column_stack([np.hypot(points[:, 0], points[:, 1]), points[:, 2]])


def force_all_round(record: PressureRecord, peak: float) -> float:
    """Axial force [N] of a centred contact as heavily loaded as the worst part of this ring.

    ``record`` has points at equal angles; ``peak`` [N] is the peak axial force of its impact.
    """
    turn = np.round(np.arctan2(record.points[:, 1], record.points[:, 0]), 9) + 0.0
    angles, number = np.unique(turn, return_inverse=True)
    force = record.point_force.astype(float)
    load = np.zeros((len(force), len(angles)))
    np.add.at(load.T, number, force.T)
    total = load.sum(axis=1).max()
    steps = np.diff(angles, append=angles[0] + 2.0 * pi)
    count = round(2.0 * pi / float(steps.min()))
    return peak * count * float(load.max()) / total if total > 0.0 else peak


def expected_half_width(
    case: CaseFile, pair: BodyPair, static: StaticContact, force: float
) -> float:
    """Half width of the contact by Hertz's laws [m]; nan where they do not fit.

    A ring is a line contact under its highest load per length, anything else a point contact; of an
    ellipse the short half axis counts.
    """
    space, lam = static.space, static.pattern_at(force) * force
    modulus = _modulus(case, pair)
    upper, lower = pair.faces
    sides = (
        (pair.upper.mesh, pair.upper_surface, upper),
        (pair.lower.mesh, pair.lower_surface, lower),
    )
    curvature = relative_curvatures(space, lam, sides)
    if not (isfinite(modulus) and curvature[0] > 0.0):
        return nan
    radius = ring_radius(space, lam)
    if radius is not None:
        load = highest_load(space, lam) / (2.0 * pi * radius)
        return _within(pair, line_half_width(load, float(curvature[0]), modulus))
    if not curvature[-1] > 0.0:
        return nan
    mean = sqrt(float(curvature[0] * curvature[-1]))
    circle = point_radius(float(lam.sum()), mean, modulus)
    # Johnson 1985, eq. 4.28: b / a is about (B / A)^(-2/3)
    return _within(pair, circle * float((curvature[-1] / curvature[0]) ** (1.0 / 3.0)))


def _within(pair: BodyPair, width: float) -> float:
    """Not a number for a width as large as the surfaces: they fit closely."""
    room = min(
        float(np.max(np.ptp(mesh.points[surface.nodes], axis=0)))
        for mesh, surface in (
            (pair.upper.mesh, pair.upper_surface),
            (pair.lower.mesh, pair.lower_surface),
        )
    )
    return width if width < 0.5 * room else nan


def _modulus(case: CaseFile, pair: BodyPair) -> float:
    """E* of the two materials [Pa]; nan where a body has none."""
    inverse = 0.0
    for body, solid in zip((pair.upper, pair.lower), pair.solids, strict=True):
        if case.bodies[body.name].material is None:
            return nan
        materials = case.materials_of(body.name, body.mesh.solids)
        inverse += 1.0 / materials[solid].plane_strain_modulus
    return 1.0 / inverse


# --------------------------------------------------------------------------- edges


_Side = tuple[ElasticBody, Surface, SurfaceEdges]


def _edges(pair: BodyPair) -> tuple[_Side, _Side]:
    upper, lower = pair.edges
    return (pair.upper, pair.upper_surface, upper), (pair.lower, pair.lower_surface, lower)


def _corner(
    pair: BodyPair, sides: tuple[_Side, _Side], space: ContactSpace, lam: NDArray[np.float64]
) -> str | None:
    """Text for a corner that carries most of the force on one row of elements."""
    for (body, surface, edges), facing in zip(sides, pair.sharp_edges, strict=True):
        sharp = np.flatnonzero(facing)
        if not len(sharp):
            continue
        near = (edges.distance(space.points, sharp) <= space.size).any(axis=0)
        if lam[near].sum() < 0.5 * lam.sum():
            continue
        loaded = space.points[[np.argmax(lam)]]
        nearest = sharp[np.argmin(edges.distance(loaded, sharp))]
        angle = 180.0 - np.degrees(float(edges.angle[nearest]))
        return (
            f"contact: more than half of the force acts on a sharp edge of '{body.name}' "
            f"({body.name}.{surface.name}, at {_at(edges, nearest)}, {angle:.0f} deg). Such a "
            "contact is as narrow as its elements: its width and pressure depend on the mesh, "
            "its force and time may be wrong by 7 %. Try: give the edge its real radius (an arc "
            "or fillet; 10 to 100 um for most turned or ground parts), with five elements along "
            "it."
        )
    return None


def _blunt(sides: tuple[_Side, _Side], space: ContactSpace, lam: NDArray[np.float64]) -> str | None:
    """Text for an edge between two faces that is pressed, but does not carry alone."""
    carries = lam > _CARRIES * float(np.max(lam))
    for body, surface, edges in sides:
        inner = np.array([name is None for name in edges.neighbour], dtype=bool)
        chosen = np.flatnonzero(inner & (edges.angle > 0.0))
        near = edges.distance(space.points[carries], chosen) <= _HALF * space.size[carries]
        pressed = chosen[near.any(axis=1)]
        if not len(pressed):
            continue
        most = pressed[np.argmax(edges.angle[pressed])]
        return (
            f"contact: an edge of '{body.name}' lies in it ({body.name}.{surface.name}, at "
            f"{_at(edges, most)}, {180.0 - np.degrees(edges.angle[most]):.4g} deg). Force, time "
            "and width converge with smaller elements, but pressure and stress at the edge do "
            "not: they rise with every refinement, and the yield stress needed to stay elastic "
            "is left out. Try: the real radius of the edge (an arc or fillet), with five "
            "elements along it, if pressure, yield or wear matter."
        )
    return None


def _tell_ends(
    sides: tuple[_Side, _Side],
    points: NDArray[np.float64],
    size: NDArray[np.float64],
    lam: NDArray[np.floating],
    surfaces: str,
) -> bool:
    """Warn of every end of a named surface at which contact points carry."""
    carries = lam > _CARRIES * float(np.max(lam))
    told = False
    for body, surface, edges in sides:
        ends = np.flatnonzero(edges.ends)
        if not len(ends) or not np.any(carries):
            continue
        distance = edges.distance(points[carries], ends)
        reached = ends[(distance <= _MARGIN * size[carries]).any(axis=1)]
        names = [edges.neighbour[k] or "" for k in reached]
        for name in dict.fromkeys(names):
            first = reached[names.index(name)]
            _warn(_end(body, surface, name, _at(edges, first), surfaces))
            told = True
    return told


def _end(body: ElasticBody, surface: Surface, name: str, at: str, surfaces: str) -> str:
    where = f"in '{name}'" if name else "in a face without a name"
    what = f"'{body.name}.{name}'" if name else "that face"
    return (
        f"contact {surfaces}: it reaches the edge of '{body.name}.{surface.name}' at {at}, but "
        f"the body continues there {where}, which is not included: the force is too low. Try: "
        f"add {what} to '{surface.name}' (profile: give both edges the same name; STEP: give "
        "both faces the same name in the CAD program; mesh: one set with both)."
    )


def _at(edges: SurfaceEdges, number: int) -> str:
    return f"({', '.join(f'{x * 1e3:.4g}' for x in edges.line[number, 1])}) mm"


# --------------------------------------------------------------------------- words


def _coarse(
    case: CaseFile,
    pair: BodyPair,
    static: StaticContact,
    force: float,
    ratio: float,
    expected: float,
) -> str:
    width = static.half_width_at(force)
    size = ratio * width
    text = (
        f"contact: elements of {size * 1e6:.3g} um across a contact of {width * 1e6:.3g} um half "
        f"width on this mesh, at {force:.4g} N (ratio {ratio:.2g}, good up to 1, doubtful above "
        f"{COARSE:g})."
    )
    advised = _rounded_down(_SIZE * expected)
    if not advised < size:
        return text + " Try: 'klack advise', which measures the effect of finer elements."
    return text + (
        f" Its shape and load give {expected * 1e6:.2g} um: refine both contact surfaces to "
        f"{format_si(advised, 'm', 2)}{_extent(case, pair, expected)}."
    )


def _extent(case: CaseFile, pair: BodyPair, expected: float) -> str:
    """Advised extent of small elements, where it is set and too little."""
    extents = [
        mesh.contact.extent
        for name in (pair.upper.name, pair.lower.name)
        if (mesh := case.bodies[name].mesh) is not None and mesh.contact is not None
    ]
    wanted = _EXTENT * expected
    if not extents:
        return ""
    return f" within {format_si(max(wanted, min(extents)), 'm', 2)} of the first touch" * (
        min(extents) < wanted
    )


def _rounded_down(value: float) -> float:
    if not (isfinite(value) and value > 0.0):
        return inf
    unit = 10.0 ** (floor(log10(value)) - 1)
    return floor(value / unit * (1.0 + 1e-12)) * unit


def _warn(text: str) -> None:
    warnings.warn(text, AccuracyWarning, stacklevel=3)
