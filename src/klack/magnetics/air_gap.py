r"""Permeances of air gaps: faces, edges (fringing), guides, and the coil window.

A permeance is ``flux / mmf`` [H].  Edge fields are given per length of edge, as a number ``c`` in
:math:`P = \mu_0\, c \times` (length of the edge), and most follow exactly from a conformal map of
the corner:

- *two equal poles*, from side face to side face, with shoulders of length ``t``
  (:func:`equal_edges`): :math:`c = \tfrac1\pi\bigl[1 - \ln 2 + \ln\tfrac\pi2(1 + 2t/g)\bigr]`,
- *a pole on a plane* (:func:`edge_on_plane`): twice that with ``t/g`` in place of ``2 t/g``,
- *two equal poles beside a wall* at a distance ``D`` at the mean potential, as in a coil window
  inside a yoke (:func:`edges_beside_wall`), in excess of the flux without the edges,
- *a step of a duct* from height ``g`` to ``D`` (:func:`step_excess`), Marcuvitz 1951, 5.34.

Roters (1941, ch. 5) estimates the first two by arcs: 0.26 + (1/pi) ln(1 + 2t/g) and
0.52 + (2/pi) ln(1 + t/g); the maps give 0.241 and 0.483 for the constants.

Limits: edge radius large against the gap; the shoulder long against it (``t > g/2``); no saturation
at the corner.
"""

from functools import cache
from math import pi

import numpy as np
import scipy
from numpy.typing import ArrayLike

from klack.arrays import Vector
from klack.magnetics.iron import VACUUM_PERMEABILITY

__all__ = [
    "cylinder_wall",
    "edge_on_plane",
    "edges_beside_wall",
    "equal_edges",
    "face_permeance",
    "outer_ring",
    "ring_permeance",
    "round_excess",
    "slot_loss",
    "step_excess",
]


def face_permeance(area: float, gap: ArrayLike) -> Vector:
    """Permeance [H] between parallel faces of an area [m^2] at a distance [m], without edges."""
    return VACUUM_PERMEABILITY * area / np.asarray(gap, dtype=float)


def ring_permeance(inner: float, outer: float, length: float) -> float:
    r"""Permeance [H] of a radial gap between cylinders: :math:`2\pi\mu_0 l/\ln(r_o/r_i)`."""
    return float(2.0 * pi * VACUUM_PERMEABILITY * length / np.log(outer / inner))


def cylinder_wall(inner: float, outer: float) -> float:
    """Distance [m] of a flat wall that takes the flux of a round one, per surface of the core."""
    return float(inner * np.log(outer / inner))


def equal_edges(gap: ArrayLike, shoulder: float) -> tuple[Vector, Vector]:
    """Edge number ``c`` of two equal poles and its derivative by the gap [1/m].

    Parameters
    ----------
    shoulder [m]
        Length ``t`` of the side faces behind the edges.

    Examples
    --------
    >>> c, _ = equal_edges(1e-4, 2e-3)  # Roters: 0.26 + ln(41)/pi = 1.442
    >>> round(float(c), 3)
    1.423
    """
    g = np.asarray(gap, dtype=float)
    ratio = 2.0 * shoulder / g
    c = (1.0 - np.log(2.0) + np.log(0.5 * pi * (1.0 + ratio))) / pi
    return c, -ratio / (1.0 + ratio) / (pi * g)


def edge_on_plane(gap: ArrayLike, shoulder: float) -> tuple[Vector, Vector]:
    """Edge number ``c`` of a pole on a larger plane and its derivative by the gap [1/m].

    The plane is the mirror of a pole at twice the distance, with half the mmf.
    """
    c, dc = equal_edges(2.0 * np.asarray(gap, dtype=float), shoulder)
    return 2.0 * c, 4.0 * dc


def edges_beside_wall(gap: ArrayLike, wall: float) -> tuple[Vector, Vector]:
    r"""Edge number of two equal poles beside a wall, and its derivative by the gap [1/m].

    The wall, parallel to the side faces at a distance ``D``, has the mean potential.  The number
    counts what exceeds the uniform field between side face and wall:

    .. math::

        c = \tfrac{1}{2\pi}\Bigl[2\ln(1 + a) - \ln 16 a
            + \tfrac{2}{\sqrt a}\arctan\sqrt a + 2\sqrt a\,\arctan\tfrac{1}{\sqrt a}\Bigr],
            \qquad a = (2D/g)^2

    from the Schwarz-Christoffel map :math:`\mathrm dz/\mathrm dw = (D/\pi)\,w^{-1}
    \sqrt{(w-1)/(w+a)}`; for :math:`g \ll D`, :math:`c = [1 - \ln 2 + \ln(D/g)]/\pi`.
    """
    g = np.asarray(gap, dtype=float)
    q = 2.0 * wall / g  # sqrt(a)
    a = q * q
    c = 2.0 * np.log1p(a) - np.log(16.0 * a) + 2.0 * np.arctan(q) / q + 2.0 * q * np.arctan(1.0 / q)
    dq = (
        4.0 * q / (1.0 + a)
        - 2.0 / q
        + 2.0 / (q * (1.0 + a))
        - 2.0 * np.arctan(q) / a
        + 2.0 * np.arctan(1.0 / q)
        - 2.0 * q / (1.0 + a)
    )
    return c / (2.0 * pi), dq * (-q / g) / (2.0 * pi)


def slot_loss(gap: ArrayLike, wall: float) -> tuple[Vector, Vector]:
    r"""Width [m] that a slot takes from the flux to a wall, and its derivative by the width.

    .. math:: \tfrac{2 g}{\pi}\Bigl[\arctan u - \tfrac{\ln(1 + u^2)}{2u}\Bigr], \quad u = g/(2D)

    (Carter 1901) for a width ``g`` and a wall at the distance ``D``.
    """
    g = np.asarray(gap, dtype=float)
    u = g / (2.0 * wall)
    loss = 2.0 * g / pi * (np.arctan(u) - np.log1p(u * u) / (2.0 * u))
    return loss, 2.0 / pi * np.arctan(u)


def step_excess(low: float, high: float) -> float:
    r"""Edge number of a step in the distance of two plates, from ``low`` to ``high`` [m].

    .. math:: c = \tfrac1\pi\Bigl[\tfrac{1 + \alpha^2}{\alpha}\ln\tfrac{1 + \alpha}{1 - \alpha}
        - 2\ln\tfrac{4\alpha}{1 - \alpha^2}\Bigr], \qquad \alpha = g/D

    in excess of the uniform fields on both sides (Marcuvitz 1951, 5.34; static limit).
    """
    r = low / high
    bulk = (1.0 + r * r) / r * np.log((1.0 + r) / (1.0 - r))
    return float((bulk - 2.0 * np.log(4.0 * r / (1.0 - r * r))) / pi)


def outer_ring(gap: float, reach: ArrayLike, radius: float) -> tuple[Vector, Vector]:
    r"""Edge number of a rod that leaves a hole in a plate, and its derivative by the reach [1/m].

    :func:`edge_on_plane` up to arcs of radius ``reach``, and the wider circle of the outer ones: a
    quarter arc of radius ``s`` has the mean distance ``radius + 2 s/pi`` from the axis (Roters'
    mean path), which adds :math:`(2/\pi)^2\, s/r`.
    """
    s = np.asarray(reach, dtype=float)
    c = edge_on_plane(gap, 1.0)[0] + 2.0 / pi * np.log((1.0 + s / gap) / (1.0 + 1.0 / gap))
    more = (2.0 / pi) ** 2 / radius
    return c + more * s, 2.0 / (pi * (gap + s)) + more


def round_excess(gap: ArrayLike, inner: float, outer: float) -> tuple[Vector, Vector]:
    r"""Edge number that roundness adds to :func:`edges_beside_wall`; its derivative by the gap.

    A core in a tube; along the core the potential is a ramp across the gap:

    .. math::

        c = \frac1\pi \int_0^\infty \frac{y(k) - k \coth kD}{k^2}\,
            \frac{\sin(kg/2)}{kg/2}\,\mathrm dk, \qquad
        y = k\,\frac{I_1(k r_i) K_0(k r_o) + K_1(k r_i) I_0(k r_o)}
                     {K_0(k r_i) I_0(k r_o) - I_0(k r_i) K_0(k r_o)}

    with the flux ``y`` of a harmonic potential on the core (modified Bessel functions) and the flat
    wall ``D`` of :func:`cylinder_wall`.

    Parameters
    ----------
    inner, outer [m]
        Radii of core and tube.
    """
    k, weight = _round_spectrum(outer / inner)
    g = np.asarray(gap, dtype=float)[..., None] / inner
    phase = 0.5 * k * g
    ramp = np.sinc(phase / pi)
    return ramp @ weight, ((np.cos(phase) - ramp) / g) @ weight / inner


@cache
def _round_spectrum(q: float) -> tuple[Vector, Vector]:
    """Wave numbers (core radius 1) and weights in the integral over ``k``."""
    wall = cylinder_wall(1.0, q)
    nodes, weights = np.polynomial.legendre.leggauss(12)
    edges = np.linspace(np.log(1e-4), np.log(1e4), 161)
    half = 0.5 * np.diff(edges)[:, None]
    k = np.exp(edges[:-1, None] + half * (1.0 + nodes)).ravel()
    # scaled functions: I(x) = e^x ive(x), K(x) = e^-x kve(x); common factor e^(k (q - 1))
    fade = np.exp(-2.0 * k * (q - 1.0))
    top = scipy.special.kve(1, k) * scipy.special.ive(0, k * q) + fade * scipy.special.ive(
        1, k
    ) * scipy.special.kve(0, k * q)
    bottom = scipy.special.kve(0, k) * scipy.special.ive(0, k * q) - fade * scipy.special.ive(
        0, k
    ) * scipy.special.kve(0, k * q)
    density = (top / bottom - 1.0 / np.tanh(k * wall)) / k
    return k, density * k * (half * weights).ravel() / pi
