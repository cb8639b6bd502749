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
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.measurement.channels import LiftSensor
from klack.measurement.impacts import fit_flights, read_flights
from klack.measurement.stroke_measures import FlightShape, Stop, StrokeMeasures

__all__ = ["HighestRebound", "expected_maximum", "highest_rebound", "measure_strokes"]

Vector = NDArray[np.float64]


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


def measure_strokes(
    time: Vector,
    lifts: Sequence[Vector],
    *,
    seat: float | None = None,
    opening: float | None = None,
    sensor: LiftSensor | None = None,
) -> list[StrokeMeasures]:
    """Read strokes of one valve, each with the shape of the flights from the others.

    Parameters
    ----------
    time, lifts, seat, opening, sensor
        As of :func:`klack.measurement.impacts.measure_stroke`.
    """
    fitted = [fit_flights(time, lift, seat=seat, opening=opening, sensor=sensor) for lift in lifts]
    read = [read_flights(one) for one in fitted]
    if len(read) > 2:
        read = [read_flights(one, _others(read, k)) for k, one in enumerate(fitted)]
    return read


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


def _others(strokes: Sequence[StrokeMeasures], skip: int) -> dict[Stop, FlightShape]:
    """Shape of the flights on each stop, from all strokes but one."""
    out: dict[Stop, FlightShape] = {}
    stops: tuple[Stop, ...] = ("opening", "seat")
    for stop in stops:
        shapes = [m.shapes[stop] for k, m in enumerate(strokes) if k != skip and stop in m.shapes]
        if len(shapes) > 1:
            out[stop] = replace(
                shapes[0],
                **_mean(shapes, "acceleration"),
                **_mean(shapes, "stiffness"),
                **_mean(shapes, "friction"),
            )
    return out


def _mean(shapes: Sequence[FlightShape], name: str) -> dict[str, float]:
    """Median over the strokes; error: robust scatter of single strokes."""
    values = np.array([getattr(shape, name) for shape in shapes])
    own = np.array([getattr(shape, f"{name}_se") for shape in shapes])
    middle = float(np.median(values))
    spread = 1.4826 * float(np.median(np.abs(values - middle)))
    noise = float(np.median(own))
    beyond = sqrt(max(spread**2 - noise**2, 0.0))  # strokes that differ indeed
    error = 1.2533 * max(spread, noise) / sqrt(len(shapes))
    return {name: middle, f"{name}_se": sqrt(beyond**2 + error**2)}
