"""Metering notches in the edge of a spool: their narrowest section over the displacement.

A notch runs from its tip, ``length`` ahead of the edge, to the edge.  With the edge open by ``x``
(covered: negative) the tip is uncovered by ``s = x + L``.  The smaller one counts of the *exit*,
the part of the outline beyond the edge of the sleeve, and the *throat*, the section below that edge
normal to the bottom of the notch.

===========  ==========================  ==========================  ============================
shape        exit                        throat, ``x <= 0``          throat, ``x > 0``
===========  ==========================  ==========================  ============================
rectangular  ``b s``                     ``b t``                     ``b sqrt(x^2 + t^2)``
triangular   ``b s^2/(2 L)``             ``b s^2 sin(be)/(2 L)``     sum over strips, see below
round        segment of the root, then   ``w(s) t``                  ``b sqrt(x^2 + t^2)``
             ``2 r`` per length
hole         segment of the circle       none                        none
===========  ==========================  ==========================  ============================

with the width ``b`` and the depth ``t`` at the edge, ``r = b/2``, the width ``w(s)`` of the outline
where it passes the edge of the sleeve, and ``tan(be) = t/L`` of a bottom that rises to the tip.
``b sin(be) s^2/(2 L)`` is the smallest of all plane sections through the edge of the sleeve.
Beyond the edge of the land, each strip of the triangular notch has the shortest distance to its
bottom: with ``q`` from 0 at a flank to 1 in the middle ``(x + L q) sin(be)``, and ``sqrt(x^2 + t^2
q^2)`` where ``q < x L/t^2``.

Limits: the surface of the spool is plane across a notch, ``b`` small against the diameter; sharp
edges; quasi-steady flow, through the smaller one of both areas only.
Sources: elementary geometry; Borghi, Milani & Paoluzzi, Int. J. Fluid Power 6 (2005) no. 2, on the
same subject, was not read.
"""

from math import atan, log, log1p, pi, sqrt
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from klack.input.problem import CaseProblem, refuse_key_if
from klack.input.section import Count, Section
from klack.machine.compiling.jit import inner, njit
from klack.units import Length

__all__ = ["NUMBERS", "Notch", "notch_opening"]

NUMBERS = 6
"""Numbers of a notch for :func:`notch_opening`, the count included."""

_RECTANGULAR, _TRIANGULAR, _ROUND, _HOLE = 0.0, 1.0, 2.0, 3.0
_KINDS = {"rectangular": _RECTANGULAR, "triangular": _TRIANGULAR, "round": _ROUND, "hole": _HOLE}


@inner(error_model="numpy")
def _segment(r: float, s: float) -> tuple[float, float, float]:
    """Area, half of the chord, half of the angle of a segment of height ``s <= 2 r``."""
    if s >= 2.0 * r:
        return pi * r * r + 0.0 * s, 0.0 * s, pi + 0.0 * s
    chord = sqrt(s * (2.0 * r - s))
    half = 2.0 * atan(sqrt(s / (2.0 * r - s)))
    return r * r * half - (r - s) * chord, chord, half


@inner(error_model="numpy")
def _arc_over_root(y: float, square: float) -> float:
    """``atan(k y)/k`` with ``k^2 = square``, of either sign."""
    z = square * y * y
    if abs(z) < 1e-4:
        return y * (1.0 - z * (1.0 / 3.0 - z * (0.2 - z / 7.0)))
    if square > 0.0:
        k = sqrt(square)
        return atan(k * y) / k
    k = sqrt(-square)
    return 0.5 * (log1p(k * y) - log1p(-k * y)) / k


@inner(error_model="numpy")
def _round_flank(r: float, end: float, s: float, more: float) -> float:
    """Covered part of a round root: integral of its width over the length to the sleeve's edge."""
    low = max(s, 0.0)
    if low >= end:
        return 0.0 * s
    t0, t1 = sqrt(low / (2.0 * r - low)), sqrt(end / (2.0 * r - end))
    far = r - s + more
    y = (t1 - t0) / (far - r + (far + r) * t0 * t1)
    arc = 2.0 * _arc_over_root(y, far * far - r * r)
    return 2.0 * (far * arc - 2.0 * (atan(t1) - atan(t0)))


@inner(error_model="numpy")
def _smaller(
    area: float, width: float, around: float, throat: float, along: float
) -> tuple[float, float, float]:
    """Smaller one of exit and throat, width, perimeter for the smaller hydraulic diameter."""
    least = min(area, throat)
    return least, width, least * max(around / area, along / throat)


@inner(error_model="numpy")
def _rectangular(
    b: float, t: float, L: float, x: float, c: float
) -> tuple[float, float, float, float]:
    s = x + L
    inside = min(max(s, 0.0), L)
    channel = t + c
    along = (L - inside) / (b * channel * channel * channel)
    beyond = max(x, 0.0)
    area, throat = b * max(s, 0.0), b * sqrt(beyond * beyond + t * t)
    if area <= 0.0:
        return 0.0 * x, b + 0.0 * x, 2.0 * b + 0.0 * x, along
    return *_smaller(area, b + 0.0 * x, 2.0 * (b + inside), throat, 2.0 * (b + t)), along


@inner(error_model="numpy")
def _triangular(b: float, t: float, L: float, x: float) -> tuple[float, float, float, float]:
    s, slope = x + L, t / sqrt(t * t + L * L)
    inside = min(s, L)
    width, high = b * inside / L, inside * slope
    perimeter = width + 2.0 * sqrt(high * high + 0.25 * width * width)
    if x <= 0.0:
        part = L / inside
        along = 4.0 / 3.0 * L / (b * t * t * t) * (part * part * part - 1.0)
        return 0.5 * width * high, width, perimeter, along
    q = min(x * L / (t * t), 1.0)
    end = sqrt(x * x + t * t * q * q)
    near = 0.5 * (q * end + x * x / t * log((t * q + end) / x))
    far = slope * (x * (1.0 - q) + 0.5 * L * (1.0 - q * q))
    return b * (near + far), width, perimeter, 0.0 * x


@inner(error_model="numpy")
def _round(
    b: float, t: float, L: float, land: float, x: float, c: float
) -> tuple[float, float, float, float]:
    r, s, channel = 0.5 * b, x + L, t + c
    inside = min(s, L)
    area, half, angle = _segment(r, min(inside, r))
    _, _, last = _segment(r, min(L, r))
    straight, beyond = max(inside - r, 0.0), max(x, 0.0)
    area += b * straight + land * beyond
    width = 2.0 * half
    along = 0.5 * (last - angle) + (L - max(inside, r)) / b if L > r else 0.5 * (last - angle)
    along /= channel * channel * channel
    throat = width * sqrt(beyond * beyond + t * t)
    around = width + 2.0 * (r * angle + straight)
    return *_smaller(area, width, around, throat, 2.0 * (width + t)), along


@njit(error_model="numpy")
def notch_opening(
    par: Any, base: int, x: float, c: float, more: float
) -> tuple[float, float, float, float, float, float]:
    r"""What one notch adds to an edge that is open by ``x`` in the clearance ``c``.

    .. math:: A_c = \sqrt{A^2 + (w c)^2}, \qquad g = 2 A_c/P, \qquad
              J = \int \frac{d\xi}{w\,(t + c)^3} , \qquad
              G = \int \frac{du}{l(u) + l_e}

    with the smaller one ``A`` of exit and throat, the width ``w`` at the edge of the sleeve and the
    smaller hydraulic diameter ``4 A/P`` of both, ``2 g`` at the edge itself.  ``J`` is the friction
    along the notch, a slot of the local width and depth; of the triangular one with the mean of the
    depth cubed, ``t^3/4``, and without the clearance.  ``G`` is the leakage through the covered
    flank of a triangular or round tip, strip by strip; a gap of length ``l_e`` resists as the edge
    does.

    Parameters
    ----------
    par
        From ``base`` on: kind, count, width [m], depth [m], length [m], width at the edge [m].
    x, c, more [m]
        Opening, clearance, ``l_e``.

    Returns
    -------
    area, narrow, gap : float [m^2], [m^2], [m]
        ``A_c``, ``A``, ``g``.
    along, covered, flank : float [1/m^3], [1/m], [-]
        ``J``; covered length over width of a rectangular tip; ``G``.
    """
    kind, b, t, L = par[base], par[base + 2], par[base + 3], par[base + 4]
    s = x + L
    none = 0.0 * x
    area, width, perimeter, along, covered, flank = none, none, 1.0 + none, none, none, none
    if kind == _RECTANGULAR:
        area, width, perimeter, along = _rectangular(b, t, L, x, c)
        covered = max(-s, 0.0) / b
    elif kind == _TRIANGULAR:
        if s > 0.0:
            area, width, perimeter, along = _triangular(b, t, L, x)
        flank = b / L * log((max(L - s, 0.0) + more) / (max(-s, 0.0) + more))
    elif kind == _ROUND:
        if s > 0.0:
            area, width, perimeter, along = _round(b, t, L, par[base + 5], x, c)
        flank = _round_flank(0.5 * b, min(0.5 * b, L), s, more)
    else:
        if s > 0.0:
            area, half, angle = _segment(0.5 * b, min(s, b))
            width, perimeter = 2.0 * half, 2.0 * half + b * angle
        flank = _round_flank(0.5 * b, 0.5 * b, s, more)
    clear = sqrt(area * area + width * width * c * c)
    return clear, area, 2.0 * clear / perimeter, along, covered, flank


class Notch(Section):
    """Notches of one shape in the edge of a spool."""

    shape: Literal["rectangular", "triangular", "round", "hole"] = Field(
        description="rectangular and round: constant depth, the tip straight or a half circle; "
        "triangular: a V in outline and section, its bottom rising to the tip; hole: a radial bore "
        "through the land or the sleeve."
    )
    count: Count = Field(description="Number of notches round the edge.")
    width: Length = Field(
        gt=0,
        examples=["1 mm"],
        description="Along the circumference: of a triangle at the edge, of a round notch or a "
        "hole the diameter.",
    )
    length: Length = Field(
        gt=0, examples=["0.8 mm"], description="From the edge to the tip, which opens first."
    )
    depth: Length | None = Field(
        default=None,
        gt=0,
        examples=["0.4 mm"],
        description="From the surface of the spool; of a triangle at the edge; a hole has none.",
    )

    @model_validator(mode="after")
    def _shape_has_its_sizes(self) -> Self:
        if self.shape == "hole":
            self._refuse_with(("depth",), "shape: hole", "it goes through")
            refuse_key_if(
                self.length < self.width,
                ("length",),
                got=f"{1e3 * self.length:g} mm for a hole of {1e3 * self.width:g} mm",
                expected="at least its diameter: the whole circle is ahead of the edge",
                hint="for a circle cut by the edge use a notch with shape: round.",
            )
        elif self.depth is None:
            raise CaseProblem(
                (),
                got=f"a {self.shape} notch without depth",
                expected="depth: from the surface of the spool",
                hint="add depth; for a bore through the land use shape: hole.",
            )
        return self

    @property
    def edge_width(self) -> float:
        """Width at the edge of the land [m]: there the edge itself is missing."""
        if self.shape == "hole":
            return 0.0
        if self.shape == "round" and self.length < 0.5 * self.width:
            return 2.0 * sqrt(self.length * (self.width - self.length))
        return self.width

    @property
    def numbers(self) -> tuple[float, ...]:
        """What :func:`notch_opening` takes."""
        depth = self.depth or 0.0
        kind, count = _KINDS[self.shape], float(self.count)
        return kind, count, self.width, depth, self.length, self.edge_width
