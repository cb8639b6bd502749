r"""Seat with an off-axis or tilted needle: gap round the edge, flow area, force of the pressure.

The edge of the seat is the circle :math:`P(\varphi) = r(\cos\varphi, \sin\varphi, 0)`.  The face of
the needle, a plane, cone or ball, is placed by five numbers

.. math:: (x,\; e_x,\; e_y,\; t_x,\; t_y)

lift and offset of the point of its axis that is in the middle of the edge when seated, and slopes
of the plane across its axis, :math:`z = t_x x + t_y y` as of :mod:`~klack.hydraulics.tilted_film`.
The shortest lines from the edge to the face are the gap :math:`h(\varphi)`, and together the
surface that the flow passes:

.. math:: A = \int_0^{2\pi}\!\int_0^{h} |(P' + s\,n') \times n|\, ds\, d\varphi

with the unit vector ``n`` along the line, the mantle of :class:`~klack.hydraulics.seat.Seat` for
any placement.  Nothing flows where faces overlap.

To first order in offset and tilt, with :math:`\beta` between axis and face at the edge,

.. math:: h = x \sin\beta + a \cos(\varphi - \varphi_0), \qquad
    a = |r\,t \sin\beta - e \cos\beta|

so an offset changes no area until one side touches (:func:`ring_opening` continues from there).

Limits: rigid faces, a sharp edge.  In a conical seat the gap of a ball is the same to first order
(the second order, :math:`e^2/2R`, differs).  The area is not limited by that of the bore.
Source: elementary geometry.
"""

from dataclasses import dataclass
from math import cos, pi, sin
from typing import Any, Literal, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from klack.arrays import Vector
from klack.errors import refuse_if, require_positive

__all__ = [
    "SeatFace",
    "SeatShape",
    "edge_gap",
    "flow_area",
    "flow_area_slopes",
    "pressure_load",
    "ring_opening",
]

SeatShape = Literal["flat", "cone", "ball"]

_FEWEST_ANGLES = 8
_COMPLEX_STEP = 1e-30  # of the placement: exact slopes, nothing is subtracted


class _Seat(Protocol):
    """What a face takes of a :class:`~klack.hydraulics.seat.Seat`."""

    @property
    def shape(self) -> SeatShape: ...
    @property
    def diameter(self) -> float: ...
    @property
    def surface_angle(self) -> float: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class SeatFace:
    """Face of a needle in the sharp edge of its seat.

    Parameters
    ----------
    shape
    radius [m]
        Of the edge.
    angle [rad]
        Between axis and face at the edge, above 0 and below pi/2; of a flat face pi/2.
    """

    shape: SeatShape
    radius: float
    angle: float = 0.5 * pi

    def __post_init__(self) -> None:
        require_positive("SeatFace.radius", self.radius, "m")
        flat = self.shape == "flat"
        refuse_if(
            flat != (self.angle == 0.5 * pi) or not 0.0 < self.angle <= 0.5 * pi,
            "SeatFace.angle",
            got=f"{self.angle:g} rad for the shape {self.shape}",
            expected="above 0 and below pi/2 for cone and ball, pi/2 for a flat face",
            hint="acos(r/R) for a ball of radius R, half of the angle in the drawing for a cone.",
        )

    @classmethod
    def of(cls, seat: _Seat) -> Self:
        """Shape, edge and angle of a seat."""
        return cls(shape=seat.shape, radius=0.5 * seat.diameter, angle=seat.surface_angle)


def edge_gap(face: SeatFace, placement: ArrayLike, angles: ArrayLike) -> Vector:
    """Shortest distance [m] from the edge to the face, shape (S,); below 0 where they overlap.

    Parameters
    ----------
    placement (5,) [m], [m], [m], [-], [-]
        Lift, offset, tilt.
    angles (S,) [rad]
        Round the edge.
    """
    return _gap(face, _placed(placement), np.asarray(angles, dtype=float))[0]


def flow_area(face: SeatFace, placement: ArrayLike, *, angles: int = 72) -> float:
    """Flow area [m^2] between edge and face.

    Parameters
    ----------
    placement (5,) [m], [m], [m], [-], [-]
        Lift, offset, tilt.
    angles
        Points round the edge, at least 8.  Exact to round-off with 72 while nothing overlaps; where
        one side does, the error falls with their square.
    """
    return float(_area(face, _placed(placement), angles))


def flow_area_slopes(face: SeatFace, placement: ArrayLike, *, angles: int = 72) -> Vector:
    """Slopes of :func:`flow_area` with the placement, shape (5,) [m], [m], [m], [m^2], [m^2]."""
    place = _placed(placement)
    ways = 1j * _COMPLEX_STEP * np.eye(5)
    return np.array([np.imag(_area(face, place + way, angles)) / _COMPLEX_STEP for way in ways])


def ring_opening(mean: ArrayLike, swing: ArrayLike, radius: float) -> Vector:
    r"""Area [m^2] of a gap :math:`h + a\cos\varphi` round an edge, zero where it is below zero.

    .. math:: A = 2 r (h\,\varphi_c + a \sin\varphi_c), \qquad \cos\varphi_c = -h/a

    and :math:`2\pi r h` for ``h > a``; none below ``h = -a``.

    Parameters
    ----------
    mean, swing [m]
        ``h`` and ``a``.
    radius [m]

    Examples
    --------
    An edge of 0.5 mm, 45 degrees, a needle 1 um off-axis that touches on one side:

    >>> area = ring_opening(0.707e-6, 0.707e-6, 0.5e-3)
    >>> print(f"{area * 1e12:.0f} um^2")
    2221 um^2
    """
    h, a = np.asarray(mean, dtype=float), np.abs(np.asarray(swing, dtype=float))
    ratio = np.divide(-h, a, out=np.where(h > 0.0, -1.0, 1.0), where=a > 0.0)
    last = np.arccos(np.clip(ratio, -1.0, 1.0))
    return np.asarray(2.0 * radius * (h * last + a * np.sin(last)))


def pressure_load(
    face: SeatFace, placement: ArrayLike, *, angles: int = 72
) -> tuple[Vector, Vector]:
    r"""Force [m^2] and moment [m^3] on the needle per pressure inside above that outside.

    The pressure steps from one to the other at the feet ``F`` of the shortest lines, so by Stokes

    .. math:: \frac{F}{\Delta p} = \tfrac12 \oint F \times dF, \qquad
        \frac{M}{\Delta p} = -\tfrac12 \oint |F|^2\, dF

    with the moment about the middle of the edge.  Across the axis the force is, to first order,
    :math:`\pi r\,(e \cos\beta - r\,t \sin\beta) \sin\beta`: pressure from outside centres an offset
    needle.

    Limits: pressure at rest.  The fall of pressure along the face within a gap's length, and jets
    that differ round the edge, change the force across the axis by terms of the same order,
    :math:`\Delta p\, r\, e`, so it is right for a gap that is small against its land (creeping
    flow, a needle that nearly closes) and an order of magnitude otherwise.
    """
    place = _placed(placement)
    phi = _angles(angles)
    h, n = _gap(face, place, phi)[:2]
    feet = _edge(face.radius, phi) + np.maximum(h, 0.0)[:, None] * n
    along = _derivative(feet)
    share = 2.0 * pi / angles
    force = 0.5 * share * np.cross(feet, along).sum(axis=0)
    moment = -0.5 * share * ((feet * feet).sum(axis=1)[:, None] * along).sum(axis=0)
    return force, moment


def _placed(placement: ArrayLike) -> Vector:
    place = np.asarray(placement, dtype=float)
    refuse_if(
        place.shape != (5,) or not np.all(np.isfinite(place)),
        "seat off-axis: placement",
        got=f"{placement!r}",
        expected="five numbers: lift, offset_x, offset_y [m], tilt_x, tilt_y [-]",
        hint="[60e-6, 1e-6, 0, 0, 0] is 60 um open and 1 um off-axis.",
    )
    return place


def _angles(number: int) -> Vector:
    refuse_if(
        number < _FEWEST_ANGLES,
        "seat off-axis: angles",
        got=f"{number}",
        expected=f"at least {_FEWEST_ANGLES}",
        hint="72 without overlap, a few hundred where one side overlaps.",
    )
    return 2.0 * pi / number * np.arange(number, dtype=np.float64)


def _edge(radius: float, phi: Vector) -> Vector:
    return radius * np.column_stack((np.cos(phi), np.sin(phi), np.zeros_like(phi)))


def _derivative(closed: Vector) -> Vector:
    """Derivative over the angle along a closed curve, exact for its harmonics."""
    number = len(closed)
    order = np.fft.rfftfreq(number, 1.0 / number)
    order[2 * order == number] = 0.0
    found = np.fft.irfft(1j * order[:, None] * np.fft.rfft(closed, axis=0), number, axis=0)
    return np.asarray(found)


def _gap(face: SeatFace, place: Any, phi: Vector) -> tuple[Any, Any, Any, Any]:
    """Gap, unit vector along it, and the turning of that vector over the angle.

    Analytic in ``place`` (no absolute values), so that complex placements give slopes.  Returned
    are gap (S,), ``n`` (S, 3), squares of the edge's speed along the face's meridian and across it,
    stacked (2, S), and the convergence of the lines across the meridian, 1/m, (S,).
    """
    r, s, c = face.radius, sin(face.angle), cos(face.angle)
    lift, offset, tilt = place[0], place[1:3], place[3:5]
    radial = np.column_stack((np.cos(phi), np.sin(phi)))
    way = r * np.column_stack((-np.sin(phi), np.cos(phi), np.zeros_like(phi)))
    axis = np.array([-tilt[0], -tilt[1], 1.0 + 0.0 * tilt[0]]) / np.sqrt(1.0 + tilt @ tilt)
    D = _edge(r, phi) - np.array([offset[0], offset[1], lift])
    u = D @ axis
    # |D|^2 - r^2, without the cancellation
    excess = lift * lift + offset @ offset - 2.0 * r * (radial @ offset)
    if face.shape == "flat":
        n = np.broadcast_to(axis, D.shape)
        along = (way @ axis) ** 2
        return -u, n, np.array([0.0 * along, r * r - along]), 0.0 * u
    if face.shape == "ball":
        R, x0 = r / c, r * s / c
        rise = excess - 2.0 * x0 * u  # |P - centre|^2 - R^2
        distance = np.sqrt(R * R + rise)
        n = (x0 * axis - D) / distance[:, None]
        along = (way * n).sum(axis=1) ** 2
        return rise / (distance + R), n, np.array([0.0 * along, r * r - along]), 1.0 / distance
    beyond = excess - u * u  # rho^2 - r^2
    rho = np.sqrt(r * r + beyond)
    out = (D - u[:, None] * axis) / rho[:, None]
    n = -c * out + s * axis
    meridian = (way @ axis) * c + (way * out).sum(axis=1) * s
    across = r * r - (way * n).sum(axis=1) ** 2 - meridian**2
    return beyond / (rho + r) * c - u * s, n, np.array([meridian**2, across]), c / rho


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)


def _area(face: SeatFace, place: Any, angles: int) -> Any:
    h, _, (meridian, across), turn = _gap(face, place, _angles(angles))
    h = np.where(h.real > 0.0, h, 0.0)
    if face.shape == "ball":  # all lines run to the centre
        strips = np.sqrt(across) * h * (1.0 - 0.5 * h * turn)
    else:
        h = np.where((h * turn).real > 1.0, 1.0 / np.where(turn == 0.0, 1.0, turn), h)
        at = 0.5 * h[:, None] * (1.0 + _NODES)
        width = 1.0 - at * turn[:, None]
        speed = np.sqrt(meridian[:, None] + across[:, None] * width**2)
        strips = 0.5 * h * (speed @ _WEIGHTS)
    return 2.0 * pi / angles * strips.sum()
