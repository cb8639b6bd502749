r"""Strokes of one valve, read together, and the highest rebound among them.

Every stroke is read alone first, then with the shape of the flights
(:class:`klack.measurement.stroke_measures.FlightShape`) from the others.

**The highest rebound.** Off-axis a needle loses more to vibration, so the highest rebound is the
nearest to a centric one; but the largest of n measured values is also large by scatter. With
measured scatter ``s`` and measurement error ``u`` (RMS standard error) the shots scatter by
``sigma = sqrt(max(s^2 - u^2, 0))``; for normal shots the expected largest true value of n is
``mean + sigma E_n``, the largest measured one ``mean + s E_n``, and the true value of the shot
that measured highest ``mean + sigma^2 / s E_n``, with

.. math:: E_n = \int_{-\infty}^{\infty} x \, n \, \varphi(x) \, \Phi(x)^{n - 1} \, \mathrm dx

(David & Nagaraja 2003, eq. 3.1.1). Without the normal law: the expected maximum of n draws from
the measured shots, shrunk towards their mean by ``sigma / s``, ``sum_i x_(i) ((i/n)^n -
((i-1)/n)^n)``.
"""

from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from math import sqrt

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.measurement.impacts import FittedStroke, read_flights
from klack.measurement.stroke_measures import FlightShape, Stop, StrokeMeasures

__all__ = ["HighestRebound", "expected_maximum", "highest_rebound", "measure_strokes"]

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

_NUMBERS = tuple(field.name for field in fields(FlightShape))  # each with its error
_FEWEST = 2  # others whose median is used
_ALIKE = 3.0  # standard errors within which a stroke flies like the others


@dataclass(frozen=True, kw_only=True)
class HighestRebound:
    """The shot of highest rebound, and the bias of a maximum over n shots.

    Parameters
    ----------
    index
        Of the stroke.
    value, error
        Measured, with standard error.
    count
        n.
    normal_excess
        ``(s - sigma) E_n``: how much too high the highest reading is by measurement error, for
        normal scatter.
    expected
        Expected true maximum, from the shrunk shots.
    above_median
        ``expected`` minus the median.
    """

    index: int
    value: float
    error: float
    count: int
    normal_excess: float
    expected: float
    above_median: float


def highest_rebound(values: Vector, errors: Vector) -> HighestRebound:
    """Highest rebound (height or restitution) of strokes, and its bias.

    Parameters
    ----------
    values, errors (strokes,)
        nan where missing, but not everywhere; standard errors.
    """
    known = values[np.isfinite(values)]
    index, n = int(np.nanargmax(values)), known.size
    s = float(np.std(known, ddof=1)) if n > 1 else 0.0
    stated = errors[np.isfinite(values) & np.isfinite(errors)]
    u = float(np.sqrt(np.mean(stated**2))) if stated.size else 0.0
    sigma = sqrt(max(s**2 - u**2, 0.0))
    shrunk = known.mean() + (sigma / s if s > 0.0 else 0.0) * (np.sort(known) - known.mean())
    weights = np.diff((np.arange(n + 1) / n) ** n)
    expected = float(weights @ shrunk)
    return HighestRebound(
        index=index,
        value=float(values[index]),
        error=float(errors[index]),
        count=n,
        normal_excess=(s - sigma) * expected_maximum(n),
        expected=expected,
        above_median=expected - float(np.quantile(known, 0.5)),
    )


def measure_strokes(fitted: Sequence[FittedStroke]) -> list[StrokeMeasures]:
    """Read fitted strokes of one valve, each with the shape of the flights from the others.

    A stroke whose own shape differs from that of the others keeps its own.
    """
    read = [read_flights(one) for one in fitted]
    shapes = _shapes_of_others(read)
    return [
        read_flights(one, others) if others else alone
        for one, alone, others in zip(fitted, read, shapes, strict=True)
    ]


def expected_maximum(count: int) -> float:
    """Expected largest of n standard normal draws, ``E_n``.

    Examples
    --------
    >>> round(expected_maximum(2), 6), round(expected_maximum(50), 4)  # 1/sqrt(pi); tables
    (0.56419, 2.2491)
    """
    x = np.linspace(-9.0, 9.0, 4001)
    density = np.exp(
        np.log(count)
        - 0.5 * x**2
        - 0.5 * np.log(2.0 * np.pi)
        + (count - 1) * scipy.special.log_ndtr(x)
    )
    return float(np.trapezoid(x * density, x))


def _shapes_of_others(strokes: Sequence[StrokeMeasures]) -> list[dict[Stop, FlightShape]]:
    """Shape of the flights on each stop, for each stroke from all the others."""
    out: list[dict[Stop, FlightShape]] = [{} for _ in strokes]
    stops: tuple[Stop, ...] = ("opening", "seat")
    for stop in stops:
        having = [k for k, one in enumerate(strokes) if stop in one.shapes]
        shapes = np.array([astuple(strokes[k].shapes[stop]) for k in having])
        for i, k in enumerate(having if len(having) > _FEWEST else ()):
            others = _common(np.delete(shapes, i, axis=0))
            if _alike(strokes[k].shapes[stop], others):
                out[k][stop] = others
    return out


def _common(shapes: Matrix) -> FlightShape:
    """Medians over strokes; errors: scatter of strokes that differ indeed, and of the median."""
    values, own = shapes[:, ::2], np.median(shapes[:, 1::2], axis=0)
    middle = np.median(values, axis=0)
    spread = 1.4826 * np.median(np.abs(values - middle), axis=0)
    beyond = np.sqrt(np.maximum(spread**2 - own**2, 0.0))
    error = 1.2533 * np.maximum(spread, own) / np.sqrt(len(shapes))
    numbers = np.stack([middle, np.hypot(beyond, error)], axis=1).ravel().tolist()
    return FlightShape(**dict(zip(_NUMBERS, numbers, strict=True)))


def _alike(own: FlightShape, others: FlightShape) -> bool:
    """Whether a stroke flies like the others, within the errors of both."""
    a, b = np.array(astuple(own)), np.array(astuple(others))
    return bool(np.all(np.abs(a - b)[::2] <= _ALIKE * np.hypot(a, b)[1::2]))
