"""Two bodies that lie on each other: since when, and how much their contact damps.

``bodies`` are the upper and the lower one; None is the ground.
"""

from collections.abc import Sequence

import numpy as np

from klack.network.protocols import InterfaceLaw
from klack.network.rows import BodyRow, InterfaceRow

__all__ = [
    "bounce_time",
    "effective_mass",
    "longest_period",
    "mobility",
    "port_mobility",
    "rest_time",
    "resting_dissipation",
]

_PERIODS = 3.0
_BOUNCES = 4.0
_SPEED = 1.0  # [m/s] of the bounce
_DEPTHS = 2.0 ** np.arange(-80, 21)  # [m]


def rest_time(row: InterfaceRow, bodies: Sequence[BodyRow | None]) -> float:
    r"""Time closed after which two bodies are at rest on each other [s]; 0 without a law.

    Three of the longest periods of the moving bodies or four bounces of their masses on the law,
    whichever is longer: properties of the bodies, not of the steps.  A bounce at the speed :math:`v
    = 1` m/s, to the depth :math:`d` where the law holds :math:`m v^2 / 2`, takes :math:`3 d / v`
    (linear law: :math:`\pi`, law of Hertz: 2.94) beside :math:`\pi \sqrt{m c}` of the series
    compliance; faster ones are as long or shorter.
    """
    if row.law is None:
        return 0.0
    bounce = bounce_time(row, bodies) if np.isfinite(effective_mass(row, bodies)) else 0.0
    return float(max(_PERIODS * longest_period(bodies), _BOUNCES * bounce))


def bounce_time(row: InterfaceRow, bodies: Sequence[BodyRow | None]) -> float:
    """Time of contact in a bounce at 1 m/s [s], infinite where neither body can fly.

    See :func:`rest_time`; the row has a law.
    """
    mass = effective_mass(row, bodies)
    if row.law is None or not np.isfinite(mass):
        return np.inf
    depth = _depth(row.law, 0.5 * mass * _SPEED**2)
    return float(np.hypot(3.0 * depth / _SPEED, np.pi * np.sqrt(mass * row.series_compliance)))


def resting_dissipation(
    row: InterfaceRow, bodies: Sequence[BodyRow | None], indentation: float
) -> float:
    r"""Dissipation factor [s/m] of a contact that a load holds closed to an ``indentation`` [m].

    Impact laws damp by :math:`\chi = \alpha / v` with the speed of approach :math:`v`.  A contact
    closed from the start takes that of the impact that reaches as deep, :math:`m v^2 / 2 = V(d)`.
    On a linear law small motions then have a damping ratio of :math:`\alpha / 2`, whatever load,
    mass and stiffness.  0 without dissipation, while open, and where neither body can fly.
    """
    alpha = 0.0 if row.law is None else row.law.flat().dissipation
    mass = effective_mass(row, bodies)
    if row.law is None or alpha == 0.0 or indentation <= 0.0 or not np.isfinite(mass):
        return 0.0
    return float(alpha / np.sqrt(2.0 * row.law.potential(indentation) / mass))


def longest_period(bodies: Sequence[BodyRow | None]) -> float:
    """Longest elastic period of the moving bodies [s]; 0 for rigid ones."""
    longest = 0.0
    for body in bodies:
        if body is not None and body.body.rigid_count > 0:
            elastic = body.body.omega[body.body.rigid_count :]
            if len(elastic):
                longest = max(longest, 2.0 * np.pi / float(elastic[0]))
    return longest


def effective_mass(row: InterfaceRow, bodies: Sequence[BodyRow | None]) -> float:
    """Mass of the relative motion of the faces [kg]; infinite if neither body moves.

    Elastic bodies count as a whole; a lever as the mass that has its inertia at the arm there.
    """
    sides = zip((row.upper, row.lower), bodies, strict=True)
    inverse = sum(
        owner.face_ratio(handle) ** 2 / owner.body.mass
        for handle, owner in sides
        if owner is not None and owner.body.moves
    )
    return float(1.0 / inverse) if inverse > 0.0 else np.inf


def mobility(row: InterfaceRow, bodies: Sequence[BodyRow | None]) -> float:
    """Speed at which the gap opens, per impulse of the interface [1/kg].

    0 where neither body can fly, or a given motion drives it.
    """
    sides = zip((row.upper, row.lower), bodies, strict=True)
    return sum(port_mobility(handle, handle, owner) for handle, owner in sides)


def port_mobility(face: int, pushed: int, owner: BodyRow | None) -> float:
    """Speed of the ``face`` per impulse at the port ``pushed`` of a body [1/kg].

    See :meth:`BodyRow.face_ratio` and :func:`mobility`.
    """
    if owner is None or owner.course is not None:
        return 0.0
    body, port = owner.body, owner.ports.index(pushed)
    if body.momentum is not None:
        return float(body.momentum @ body.port_shapes[:, port]) / body.mass
    whole = float(body.rigid_axial @ body.port_shapes[: body.rigid_count, port]) / body.mass
    return owner.face_ratio(face) * whole


def _depth(law: InterfaceLaw, energy: float) -> float:
    """Indentation that stores this energy [m], to some per cent."""
    stored = law.potential(_DEPTHS)
    held = stored > 0.0
    return float(np.exp(np.interp(np.log(energy), np.log(stored[held]), np.log(_DEPTHS[held]))))
