"""Massless nonlinear spring."""

from itertools import pairwise
from typing import Any, ClassVar, Self

import numpy as np
import scipy
from numpy.typing import NDArray
from pydantic import Field, model_validator

from klack.input.problem import refuse_key_if
from klack.input.section import Number
from klack.machine.compiling.jit import inner
from klack.network.component import Component
from klack.network.port import ELEMENT, Port
from klack.network.rows import Book, LimitRow, Rows
from klack.network.step_function import step_function
from klack.units import DampingCoefficient, Force, Length, Stiffness, format_si

__all__ = [
    "HIGHEST_POWER",
    "NonlinearSpring",
    "curve_mean",
    "curve_numbers",
    "curve_slope",
    "curve_value",
    "curve_work",
    "table_curve",
]

HIGHEST_POWER = 7
"""Power of the deflection that four points of Gauss integrate exactly."""

_GAUSS = np.polynomial.legendre.leggauss(4)
_X0, _X1 = (float(x) for x in _GAUSS[0][2:])
_W0, _W1 = (float(w) / 2.0 for w in _GAUSS[1][2:])


@inner(error_model="numpy")
def _piece(par: Any, at: int, s: float) -> int:
    low, high = 0, int(par[at]) - 1
    while low < high:
        middle = (low + high) // 2
        if par[at + 2 + middle] > s:
            high = middle
        else:
            low = middle + 1
    return low


@inner(error_model="numpy")
def _value_of(par: Any, at: int, k: int, s: float) -> float:
    pieces, terms = int(par[at]), int(par[at + 1])
    t = s - par[at + 1 + pieces + k]
    first = at + 1 + 3 * pieces + k * terms
    value = 0.0
    for j in range(terms - 1, -1, -1):
        value = value * t + par[first + j]
    return value


@inner(error_model="numpy")
def curve_value(par: Any, at: int, s: float) -> float:
    """Force of a curve at the deflection ``s`` [N]."""
    return _value_of(par, at, _piece(par, at, s), s)


@inner(error_model="numpy")
def curve_slope(par: Any, at: int, s: float) -> float:
    """Stiffness of a curve at the deflection ``s`` [N/m]."""
    pieces, terms = int(par[at]), int(par[at + 1])
    k = _piece(par, at, s)
    t = s - par[at + 1 + pieces + k]
    first = at + 1 + 3 * pieces + k * terms
    value = 0.0
    for j in range(terms - 1, 0, -1):
        value = value * t + j * par[first + j]
    return value


@inner(error_model="numpy")
def curve_work(par: Any, at: int, s: float) -> float:
    """Work of a curve from its zero to the deflection ``s`` [J]; layout: :func:`curve_numbers`."""
    pieces, terms = int(par[at]), int(par[at + 1])
    k = _piece(par, at, s)
    t = s - par[at + 1 + pieces + k]
    first = at + 1 + 3 * pieces + k * terms
    value = 0.0
    for j in range(terms - 1, -1, -1):
        value = (value + par[first + j] / (j + 1)) * t
    return par[at + 1 + 2 * pieces + k] + value


@inner(error_model="numpy")
def curve_mean(par: Any, at: int, s0: float, s1: float) -> float:
    """Mean force of a curve from ``s0`` to ``s1`` [N], without cancellation."""
    low, high = min(s0, s1), max(s0, s1)
    k = _piece(par, at, low)
    if high == low:
        return _value_of(par, at, k, low)
    last = _piece(par, at, high)
    mean, left = 0.0, low
    while k <= last:
        right = high if k == last else par[at + 2 + k]
        middle, half = 0.5 * (left + right), 0.5 * (right - left)
        part = _W0 * (
            _value_of(par, at, k, middle - _X0 * half) + _value_of(par, at, k, middle + _X0 * half)
        )
        part += _W1 * (
            _value_of(par, at, k, middle - _X1 * half) + _value_of(par, at, k, middle + _X1 * half)
        )
        mean += part * ((right - left) / (high - low))
        left = right
        k += 1
    return mean


def curve_numbers(
    breaks: NDArray[np.float64], coefficients: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Flat curve of polynomials for the compiled step.

    ``pieces, terms | bounds (pieces - 1) | origins | work at the origins | coefficients``

    Parameters
    ----------
    breaks (n,) [m]
        Deflections between which the pieces lie; none for a single polynomial about zero.
    coefficients (n + 1, terms) [N/m^j]
        Rising powers of the deflection from the origin of the piece: the break below it, for the
        first piece the first break.
    """
    pieces, terms = coefficients.shape
    origins = np.concatenate((breaks[:1], breaks)) if breaks.size else np.zeros(1)
    powers = np.arange(1, terms + 1)
    widths = np.diff(origins)
    gained = [
        float(np.sum(coefficients[k] * width**powers / powers)) for k, width in enumerate(widths)
    ]
    work = np.concatenate(([0.0], np.cumsum(gained)))
    return np.concatenate(([pieces, terms], breaks, origins, work, coefficients.ravel()))


@step_function
def nonlinear_spring_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Nonlinear spring between two ports; par: damping, deflection at the start, curve."""
    h, start, end = inp[1], inp[2] - inp[4], inp[3] - inp[5]
    force = curve_mean(par, 2, par[1] + start, par[1] + end)
    loss = 0.0
    if par[0] > 0.0 and h > 0.0:
        drag = par[0] * ((end - start) / h)
        force += drag
        loss = drag * (end - start)
    out[0] = -force
    out[1] = force
    out[2] = curve_work(par, 2, par[1] + end)
    out[3] = loss
    return 0


class NonlinearSpring(Component):
    r"""Spring whose force is any function of its deflection; pushes ``end`` down, in -z.

    .. math:: F_\text{end} = -f(s) - c\,\dot s, \qquad
              s = s_0 + y_\text{end} - y_\text{base}, \qquad
              f(s) = k\,s\,\Bigl[1 + \sum_{i \ge 1} a_i\,(s/s_r)^i\Bigr]

    or ``f`` through the points of a table, by the monotone cubics of Fritsch and Carlson (SIAM J.
    Numer. Anal. 17 (1980) 238), which never overshoot.  Disc, wave and conical springs, elastomers.
    The force of a step is the exact mean: the energy is kept to round-off at any step.

    ``force-over-stroke`` instead gives a force along +z with straight lines and constant ends: a
    latch, not a spring.

    Limits: no mass, no hysteresis (for friction between discs put a friction beside it).  Beyond
    the table the force continues in a straight line, with a warning.
    """

    type: ClassVar[str] = "nonlinear-spring"
    ports: ClassVar = {
        "end": ELEMENT,
        "base": Port("mechanical", ELEMENT.role, optional=True),
    }

    stiffness: Stiffness | None = Field(
        default=None, gt=0, description="Spring rate k at zero deflection; or give a table."
    )
    higher: tuple[Number, ...] = Field(
        default=(),
        max_length=HIGHEST_POWER - 1,
        description="Terms a1, a2, ... of the polynomial; [0, 1] is the cubic spring of Duffing.",
    )
    reference: Length | None = Field(
        default=None, gt=0, description="Deflection s_r at which a term has its value."
    )
    deflection: tuple[Length, ...] = Field(
        default=(),
        description="Deflections of a table, increasing; the largest is the most compressed one.",
    )
    force: tuple[Force, ...] = Field(
        default=(), description="Force at each of them, positive in -z on 'end' (closing)."
    )
    start: Length = Field(default=0.0, description="Deflection s_0 at the start: the preload.")
    damping: DampingCoefficient = Field(
        default=0.0, ge=0, description="Viscous damping c between the ends."
    )

    @model_validator(mode="after")
    def _one_curve(self) -> Self:
        refuse_key_if(
            (self.stiffness is None) == (not self.deflection),
            ("stiffness",),
            got="a stiffness and a table" if self.deflection else "neither stiffness nor table",
            expected="either 'stiffness' (with 'higher') or 'deflection' with 'force'",
            hint="give one of the two curves.",
        )
        refuse_key_if(
            bool(self.higher) != (self.reference is not None) or (self.higher and self.deflection),
            ("higher",),
            got=f"{len(self.higher)} terms"
            + ("" if self.reference is None else " and a reference")
            + (" together with a table" if self.deflection else ""),
            expected="terms of the polynomial together with 'reference', or neither",
            hint="reference: 1 mm makes higher: [0.2] add 20 % at a deflection of 1 mm.",
        )
        refuse_key_if(
            len(self.deflection) != len(self.force) or len(self.deflection) == 1,
            ("force",),
            got=f"{len(self.force)} forces for {len(self.deflection)} deflections",
            expected="one force for each deflection, at least two",
            hint="add or remove values.",
        )
        refuse_key_if(
            any(not after > before for before, after in pairwise(self.deflection)),
            ("deflection",),
            got="deflections that do not increase",
            expected="each larger than the previous one",
            hint="sort them.",
        )
        return self

    def curve(self) -> NDArray[np.float64]:
        """Flat curve: see :func:`curve_numbers`."""
        if self.stiffness is not None:
            scale = self.reference or 1.0
            terms = [1.0, *self.higher]
            powers = [self.stiffness * a / scale**i for i, a in enumerate(terms)]
            return curve_numbers(np.zeros(0), np.array([[0.0, *powers]]))
        return table_curve(self.deflection, self.force)

    def add_rows(self, rows: Rows) -> None:
        """Add one element; without ``base`` the spring acts against the ground."""
        end, base = rows.port("end"), rows.port("base")
        rows.element(
            nonlinear_spring_step,
            ports=(end, base),
            parameters=(self.damping, self.start, *self.curve()),
            books=(Book("energy", "store"), Book("damping", "loss")),
        )
        if self.deflection:
            first, last = self.deflection[0], self.deflection[-1]
            rows.limits.append(
                LimitRow(
                    component=rows.component,
                    quantity="deflection",
                    unit="m",
                    valid=(first, last),
                    law=f"the table of '{rows.component}'",
                    effect=lambda value: "Its force continues with the slope at that end.",
                    advice=f"extend the table components.{rows.component}.deflection, which ends "
                    f"at {format_si(first, 'm')} and {format_si(last, 'm')}.",
                    key="start",
                    start=self.start,
                    ports=((end, 1.0), (base, -1.0)),
                )
            )


def table_curve(deflection: tuple[float, ...], force: tuple[float, ...]) -> NDArray[np.float64]:
    """Flat curve through points, straight beyond the first and the last one."""
    s, f = np.array(deflection), np.array(force)
    if len(s) == 2:
        slope = float((f[1] - f[0]) / (s[1] - s[0]))
        inside = np.array([[f[0], slope, 0.0, 0.0]])
        ends = (slope, slope)
    else:
        cubics = scipy.interpolate.PchipInterpolator(s, f)
        inside = cubics.c[::-1].T
        first, last = cubics.derivative()(s[[0, -1]])
        ends = (float(first), float(last))
    below, above = [f[0], ends[0], 0.0, 0.0], [f[-1], ends[1], 0.0, 0.0]
    return curve_numbers(s, np.vstack((below, inside, above)))
