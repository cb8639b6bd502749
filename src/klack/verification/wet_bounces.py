"""Spheres that bounce on a wall in a liquid, against the fit of several experiments."""

from functools import partial

import numpy as np

from klack.verification.check import Check, ComparedCurve, compare
from klack.verification.sphere_in_liquid import (
    GLASS,
    NYLON,
    STEEL,
    STOKES_NUMBERS,
    Sphere,
    measured_ratio,
    restitution,
)

__all__ = ["bounces_in_liquid"]

_check = partial(compare, "measured")

_LEGENDRE = (
    "e/e_dry = exp(-35/St), Legendre, Daniel & Guiraud 2005, Phys. Fluids 17:097105: their fit of "
    "several experiments"
)
_FREE = "roughness 0.1 um for all, steady drag over half a radius, no history force"
_STEEP = 30.0  # below it the restitution rises from 0 to 0.3


def bounces_in_liquid() -> list[Check]:
    """Steel, glass and nylon over Stokes numbers of 5 to 3000: film, Hertz contact, drag."""
    return [check for sphere in (STEEL, GLASS, NYLON) for check in _sphere(sphere)]


def _sphere(sphere: Sphere) -> list[Check]:
    stokes = np.array(STOKES_NUMBERS)
    computed = np.array([restitution(sphere, x, drag=True) for x in stokes])
    measured = np.array([measured_ratio(x) for x in stokes])
    fine = np.geomspace(stokes[0], stokes[-1], 60)
    off = np.abs(computed - measured)
    curve = ComparedCurve(
        x_label="Stokes number [-]",
        y_label="restitution, wet over dry [-]",
        expected=(fine, np.array([measured_ratio(x) for x in fine])),
        computed=(stokes, computed),
        x_log=True,
    )
    return [
        _check(
            f"{sphere.name} on a wall in a liquid, St 30 to 3000: restitution, worst deviation [-]",
            expected=0.0,
            computed=float(off[stokes >= _STEEP].max()),
            tolerance=0.12,
            source=_LEGENDRE,
            reason=_FREE,
            curve=curve,
        ),
        _check(
            f"{sphere.name} on a wall in a liquid, St 5 to 20: restitution, worst deviation [-]",
            expected=0.0,
            computed=float(off[stokes < _STEEP].max()),
            tolerance=0.2,
            source=_LEGENDRE,
            reason=f"{_FREE}; the restitution is steepest there",
        ),
    ]
