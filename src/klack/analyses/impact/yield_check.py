"""Whether the bodies of a contact yield where they touch, from the pressure of elastic bodies.

A ring on a cone is a line contact and yields below its surface at a pressure of 1.79 Y, a contact
around one point at 1.295 exp(0.736 nu) Y (von Mises; Johnson, Contact Mechanics, 1985, section 6.2;
Jackson & Green, J. Tribol. 127 (2005) 343).  Stress of the body itself is not part of it, and
sharp corners yield at any load.
"""

import warnings
from dataclasses import dataclass
from math import exp, inf, nan, pi, sqrt

import numpy as np

from klack.assembling.bodies import BodyPair
from klack.case.bodies import CaseFile
from klack.contact.statics import StaticContact, highest_load, ring_radius
from klack.errors import AccuracyWarning
from klack.units import format_si

__all__ = ["YieldCheck", "check_yield"]

_LINE = 1.79
"""Highest pressure over the yield stress at first yield, of a line contact (nu = 0.3)."""


@dataclass(frozen=True, kw_only=True)
class YieldCheck:
    """Where the bodies yield.

    Parameters
    ----------
    pressure : float [Pa]
        Highest pressure at the force that was asked for; nan where it is not known.
    needed : float [Pa]
        Yield stress from which on both bodies stay elastic up to there.
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
    """Compare the pressure with the yield stress of both bodies.

    Parameters
    ----------
    case : CaseFile
        For the materials.
    pair : BodyPair
    static : StaticContact
        Of elastic bodies.
    force : float [N]
        Peak force of the impact.
    surfaces : str
        The two surfaces, for the message.
    computed : bool
        Whether the law of the contact has the yield.

    Warns
    -----
    AccuracyWarning
        Where a body with a yield stress yields, though levels compute it as elastic, and where
        that yield stress is an estimate that decides whether it does.
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
                f"{format_si(first, 'N', 2)} on, at {100 * _speed(static, first, force):.2g} % of "
                "the speed of this impact"
            )
    if told and not computed:
        warnings.warn(
            f"contact {surfaces} yields before the {format_si(force, 'N', 3)} of this impact: "
            f"{' and '.join(told)}. Elastic levels are too hard there: the first impact on new "
            "faces is softer and returns less. What has yield: the levels reduced, in the meridian "
            "plane, and interface of klack impact, klack shots, and the stops of klack stroke; "
            "bodies of three dimensions have to be drawn as profiles.",
            AccuracyWarning,
            stacklevel=2,
        )
    for words in doubtful.values():
        warnings.warn(
            f"contact {surfaces}: the yield stress of {words}. What yields goes with it. Try: "
            "'yield' from a tensile test, or both ends of its range (klack study).",
            AccuracyWarning,
            stacklevel=2,
        )
    return YieldCheck(pressure=pressure, needed=needed)


def _pressure(static: StaticContact, force: float) -> tuple[float, bool]:
    """Highest Hertzian pressure [Pa] of a contact of this width, and whether it is a line."""
    lam = static.pattern_at(force) * force
    width, radius = static.half_width_at(force), ring_radius(static.space, lam)
    if radius is not None:
        return 2.0 * highest_load(static.space, lam) / (2.0 * pi * radius) / (pi * width), True
    return 1.5 * float(lam.sum()) / (pi * width**2), False


def _speed(static: StaticContact, force: float, highest: float) -> float:
    """Speed of an impact that reaches a force over that of one that reaches the highest."""
    approach, load = np.append(0.0, static.approach), np.append(0.0, static.force)
    stored = np.append(0.0, np.cumsum(np.diff(approach) * (load[1:] + load[:-1]) / 2.0))
    return sqrt(np.interp(force, load, stored) / np.interp(highest, load, stored))


def _first_yield(static: StaticContact, force: float, limit: float) -> float:
    """Lowest force [N] up to ``force`` whose highest pressure reaches the limit [Pa]; else inf."""
    loads = force * (np.arange(1, 41) / 40.0) ** 2
    pressures = np.maximum.accumulate([_pressure(static, float(load))[0] for load in loads])
    if pressures[-1] < limit:
        return inf
    return float(np.interp(limit, np.append(0.0, pressures), np.append(0.0, loads)))
