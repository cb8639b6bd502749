r"""Measures of a set of strokes: distributions, and the centric reference.

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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.errors import refuse_if
from klack.measurement.channels import LiftSensor
from klack.measurement.impacts import fit_flights, read_flights
from klack.measurement.stroke_measures import (
    FlightShape,
    MeasuredImpact,
    Stop,
    StrokeMeasures,
    StrokeSet,
)

__all__ = [
    "Column",
    "HighestRebound",
    "SetMeasures",
    "expected_maximum",
    "first_impact_column",
    "highest_rebound",
    "measure_set",
]

Vector = NDArray[np.float64]

QUANTITIES: Mapping[str, str] = {
    "time": "s",
    "approach_speed": "m/s",
    "rebound_speed": "m/s",
    "restitution": "1",
    "rebound_height": "m",
    "period": "s",
}
"""Columns of a set and their units."""

_SE = {
    "time": "time_se",
    "approach_speed": "approach_se",
    "rebound_speed": "rebound_se",
    "restitution": "restitution_se",
    "rebound_height": "rebound_height_se",
    "period": "period_se",
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Column:
    """One quantity of first impacts on one stop, over the strokes.

    Parameters
    ----------
    quantity, unit
        Among :data:`QUANTITIES`.
    values, errors (strokes,)
        nan where missing; standard errors.
    """

    stop: Stop
    quantity: str
    unit: str
    values: Vector
    errors: Vector

    @property
    def known(self) -> Vector:
        """Values of the strokes that have it."""
        return self.values[np.isfinite(self.values)]

    @property
    def median(self) -> float:
        """Median; nan without values."""
        return self.quantile(0.5)

    @property
    def band(self) -> tuple[float, float]:
        """5 and 95 % quantile."""
        return self.quantile(0.05), self.quantile(0.95)

    @property
    def scatter(self) -> float:
        """Measured standard deviation from stroke to stroke."""
        return float(np.std(self.known, ddof=1)) if self.known.size > 1 else float("nan")

    @property
    def error(self) -> float:
        """RMS standard error of one value."""
        used = self.errors[np.isfinite(self.values) & np.isfinite(self.errors)]
        return float(np.sqrt(np.mean(used**2))) if used.size else float("nan")

    def quantile(self, share: float) -> float:
        """Quantile of the strokes; nan without values."""
        return float(np.quantile(self.known, share)) if self.known.size else float("nan")


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
    scatter, own_scatter
        s and sigma.
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
    scatter: float
    own_scatter: float
    normal_excess: float
    expected: float
    above_median: float


@dataclass(frozen=True, kw_only=True, eq=False)
class SetMeasures:
    """All strokes of a set, read."""

    names: tuple[str, ...]
    strokes: tuple[StrokeMeasures, ...]

    def column(self, stop: Stop, quantity: str) -> Column:
        """One of :data:`QUANTITIES` of the first impact on a stop."""
        refuse_if(
            quantity not in QUANTITIES,
            "quantity",
            got=f"'{quantity}'",
            expected=f"one of: {', '.join(QUANTITIES)}",
            hint="speeds, restitution, height, time and period of the first impact.",
        )
        return first_impact_column(stop, quantity, [stroke.first(stop) for stroke in self.strokes])

    def bounces(self, stop: Stop) -> NDArray[np.int64]:
        """Bounces on a stop, per stroke."""
        return np.array([stroke.bounces(stop) for stroke in self.strokes])

    def centric(self, stop: Stop, quantile: float | None = None) -> float:
        """Restitution of the highest rebound, or a quantile of all."""
        column = self.column(stop, "restitution")
        if quantile is not None:
            return column.quantile(quantile)
        return float(column.values[highest_rebound(self.column(stop, "rebound_height")).index])


def first_impact_column(
    stop: Stop, quantity: str, firsts: Sequence[MeasuredImpact | None]
) -> Column:
    """The same of several strokes; nan without impact."""
    return Column(
        stop=stop,
        quantity=quantity,
        unit=QUANTITIES[quantity],
        values=np.array([_value(first, quantity) for first in firsts]),
        errors=np.array([_value(first, _SE[quantity]) for first in firsts]),
    )


def measure_set(
    strokes: StrokeSet,
    *,
    seat: float | None = None,
    opening: float | None = None,
    sensor: LiftSensor | None = None,
) -> SetMeasures:
    """Read every stroke of a set, which has the channel ``lift``.

    ``seat`` [m], ``opening`` [m] and ``sensor`` as of
    :func:`klack.measurement.impacts.measure_stroke`.
    """
    refuse_if(
        "lift" not in strokes.roles,
        strokes.source,
        got=f"channels {', '.join(strokes.roles) or 'of no kind'}",
        expected="a lift",
        hint="name its channel in measurement.channels.lift.",
    )
    lifts = strokes.matrix("lift")

    fitted = [
        fit_flights(strokes.time, lift, seat=seat, opening=opening, sensor=sensor) for lift in lifts
    ]
    read = [read_flights(one, {}) for one in fitted]
    if len(read) > 2:
        read = [read_flights(one, _others(read, k)) for k, one in enumerate(fitted)]
    return SetMeasures(names=tuple(stroke.name for stroke in strokes.strokes), strokes=tuple(read))


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


def highest_rebound(column: Column) -> HighestRebound:
    """Highest rebound (height or restitution) of a set, and its bias."""
    known = column.known
    refuse_if(
        not known.size,
        f"{column.quantity} on the {column.stop}",
        got="no stroke with this number",
        expected="at least one measured rebound",
        hint="check the notes of the strokes.",
    )
    index = int(np.nanargmax(column.values))
    n = known.size
    s = column.scatter if n > 1 else 0.0
    u = column.error if np.isfinite(column.error) else 0.0
    sigma = sqrt(max(s**2 - u**2, 0.0))
    shrunk = known.mean() + (sigma / s if s > 0.0 else 0.0) * (np.sort(known) - known.mean())
    weights = np.diff((np.arange(n + 1) / n) ** n)
    expected = float(weights @ shrunk)
    return HighestRebound(
        index=index,
        value=float(column.values[index]),
        error=float(column.errors[index]),
        count=n,
        scatter=s,
        own_scatter=sigma,
        normal_excess=(s - sigma) * expected_maximum(n),
        expected=expected,
        above_median=expected - column.median,
    )


def _value(impact: MeasuredImpact | None, name: str) -> float:
    return float("nan") if impact is None else float(getattr(impact, name))


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
