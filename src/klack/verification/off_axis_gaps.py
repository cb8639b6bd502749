"""Seats and air gaps whose moving part is off-axis or tilted."""

from math import acos, cos, pi, sin, sqrt

import numpy as np
from scipy.integrate import quad

from klack.hydraulics.off_axis_seat import (
    SeatFace,
    flow_area,
    flow_area_slopes,
    pressure_load,
    ring_opening,
)
from klack.hydraulics.seat import ball_opening
from klack.magnetics.air_gap import face_permeance
from klack.magnetics.iron import VACUUM_PERMEABILITY
from klack.magnetics.off_axis_gap import eccentric_ring, guide_ring, tilted_ring_face
from klack.verification.check import Check, ComparedCurve, check

__all__ = ["off_axis_air_gaps", "off_axis_seats"]

_MU0 = VACUUM_PERMEABILITY
_RADIUS, _ANGLE = 0.75e-3, 0.8  # edge of the seat [m], [rad]
_INNER, _OUTER, _LENGTH = 4e-3, 4.02e-3, 5e-3  # guide of the armature [m]


def off_axis_seats() -> list[Check]:
    """Flow area, its slopes, a seat that touches on one side, force of the pressure."""
    face = SeatFace(shape="ball", radius=_RADIUS, angle=_ANGLE)
    R, x0 = _RADIUS / cos(_ANGLE), _RADIUS * np.tan(_ANGLE)
    lift, offset = 60e-6, 8e-6

    def strip(phi: float) -> float:
        """Cone between ball and edge of the seat, outside the ball."""
        far = np.array([_RADIUS * cos(phi) - offset, _RADIUS * sin(phi), -x0 - lift])
        whole = 0.5 * float(
            np.linalg.norm(np.cross(far, _RADIUS * np.array([-sin(phi), cos(phi), 0.0])))
        )
        return whole * (1.0 - R**2 / float(far @ far))

    place = np.array([lift, offset, -3e-6, 2e-3, 1e-2])
    steps = np.array([1e-8, 1e-8, 1e-8, 1e-5, 1e-5])
    numeric = np.array(
        [
            (flow_area(face, place + way) - flow_area(face, place - way)) / (2.0 * way.sum())
            for way in np.diag(steps)
        ]
    )
    touching = offset * cos(_ANGLE) / sin(_ANGLE)  # lift at which one side touches

    def seen(x: float) -> float:
        return flow_area(face, [x, offset, 0.0, 0.0, 0.0], angles=1440)

    def closed(x: float) -> float:
        return float(ring_opening(x * sin(_ANGLE), offset * cos(_ANGLE), _RADIUS))

    lifts = np.linspace(0.0, 3.0, 61) * touching
    force = pressure_load(face, [1e-6, 1e-9, 0.0, 0.0, 0.0])[0]
    return [
        check(
            "ball 8 um off-axis, 60 um open, area [m^2]",
            expected=quad(strip, 0.0, 2.0 * pi, epsrel=1e-12)[0],
            computed=flow_area(face, [lift, offset, 0.0, 0.0, 0.0]),
            tolerance=1e-13,
            source="mantle between the edge and the ball, lines to its centre; quadrature",
        ),
        check(
            "the same centred [m^2]",
            expected=ball_opening(lift, _RADIUS, R, x0)[0],
            computed=flow_area(face, [lift, 0.0, 0.0, 0.0, 0.0]),
            tolerance=1e-13,
            source="centred seat",
        ),
        check(
            "slopes of the area with lift, offset and tilt, largest deviation relative [-]",
            expected=0.0,
            computed=float(np.abs(flow_area_slopes(face, place) / numeric - 1.0).max()),
            tolerance=1e-8,
            source="central differences",
        ),
        check(
            "ball 8 um off-axis that touches on one side, area [m^2]",
            expected=closed(touching),
            computed=seen(touching),
            tolerance=0.01,
            source="2 r (h phi + a sin phi), cos phi = -h/a: gaps of first order in lift and "
            "offset; the second order is the offset over the radius",
            curve=ComparedCurve(
                x_label="lift [um]",
                y_label="area [mm^2]",
                expected=(lifts * 1e6, np.array([closed(x) for x in lifts]) * 1e6),
                computed=(lifts * 1e6, np.array([seen(x) for x in lifts]) * 1e6),
            ),
        ),
        check(
            "force of the pressure across the axis of an offset ball [m^2]",
            expected=pi * _RADIUS * 1e-9 * cos(_ANGLE) * sin(_ANGLE),
            computed=float(force[0]),
            tolerance=5e-3,
            source="pi r e cos(beta) sin(beta): first order; the next is the gap over the radius",
        ),
    ]


def off_axis_air_gaps() -> list[Check]:
    """Eccentric and tilted guides, tilted faces, sectors in parallel."""
    clearance, e, mmf = _OUTER - _INNER, 10e-6, 10.0

    def coenergy(at: float) -> float:
        return 0.5 * mmf**2 * float(eccentric_ring(_INNER, _OUTER, _LENGTH, at)[0])

    def thin(at: float) -> float:
        flat = 2.0 * pi * _MU0 * sqrt(_INNER * _OUTER) * _LENGTH
        return float(0.5 * mmf**2 * flat * at / (clearance**2 - at**2) ** 1.5)

    side = 0.5 * mmf**2 * float(eccentric_ring(_INNER, _OUTER, _LENGTH, e)[1])
    offsets = np.linspace(0.0, 18e-6, 37)
    phi = 2.0 * pi / 36 * np.arange(36)
    gaps, area = clearance - e * np.cos(phi), 2.0 * pi * np.sqrt(_INNER * _OUTER) * _LENGTH / 36
    pulls = 0.5 * mmf**2 * (face_permeance(1.0, gaps) * area) / gaps
    gap, radius = 50e-6, 3e-3
    face_tilt = 0.5 * gap / radius
    moment = float(tilted_ring_face(0.0, radius, gap, face_tilt)[2])

    def torque(r: float) -> float:
        """Moment of the pull on a circle, over half the squared mmf."""
        return quad(
            lambda p: -2.0 * _MU0 * r**2 * cos(p) / (gap + face_tilt * r * cos(p)) ** 2, 0.0, pi
        )[0]

    return [
        check(
            "guide 10 um off-axis in 20 um, side force at 10 A [N]",
            expected=(coenergy(e + 3e-9) - coenergy(e - 3e-9)) / 6e-9,
            computed=side,
            tolerance=1e-6,
            source="slope of the co-energy by central differences",
        ),
        check(
            "the same against a clearance that is small against the radius [N]",
            expected=thin(e),
            computed=side,
            tolerance=5e-6,
            source="V^2/2 2 pi mu0 r l e/(c^2 - e^2)^1.5",
            curve=ComparedCurve(
                x_label="eccentricity [um]",
                y_label="side force [N]",
                expected=(offsets * 1e6, np.array([thin(x) for x in offsets])),
                computed=(
                    offsets * 1e6,
                    0.5 * mmf**2 * eccentric_ring(_INNER, _OUTER, _LENGTH, offsets)[1],
                ),
            ),
        ),
        check(
            "the same from 36 air gaps in parallel [N]",
            expected=side,
            computed=float(pulls @ np.cos(phi)),
            tolerance=5e-6,
            source="closed form of eccentric cylinders (Smythe)",
        ),
        check(
            "cylinders of 1 and 2 with axes 0.5 apart, permeance over mu0 and length [-]",
            expected=2.0 * pi / float(np.arccosh((1.0 + 4.0 - 0.25) / 4.0)),
            computed=float(eccentric_ring(1.0, 2.0, 1.0, 0.5)[0]) / _MU0,
            tolerance=5e-14,
            source="2 pi/arcosh((a^2 + b^2 - e^2)/(2 a b)) (Smythe)",
        ),
        check(
            "guide tilted by 80 % of its clearance, permeance [H]",
            expected=2.0
            * pi
            * _MU0
            * sqrt(_INNER * _OUTER)
            * _LENGTH
            * (0.5 * pi - acos(0.8))
            / (0.8 * clearance),
            computed=guide_ring(
                _INNER, _OUTER, _LENGTH, [0.0, 0.0, 0.8 * clearance / (0.5 * _LENGTH), 0.0]
            )[0],
            tolerance=5e-6,
            source="arcsin(eps)/eps of a clearance that is small against the radius",
        ),
        check(
            "disc tilted by half of its gap, moment per squared mmf [N m/A^2]",
            expected=0.5 * quad(torque, 0.0, radius, epsrel=1e-12)[0],
            computed=0.5 * moment,
            tolerance=5e-14,
            source="pull of parallel faces at every point, double quadrature",
        ),
    ]
