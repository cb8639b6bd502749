r"""Free flight between two impacts, fitted to lift as the sensor shows it.

Nearly constant forces, a spring, and friction, which turns with the velocity, accelerate the
needle:

.. math:: p(t) = c_0 + c_1 s + c_2 \left(s^2 - \tfrac{1}{12} \kappa s^4 + \beta\, s |s|\right),
          \quad s = t - t_0,

``t_0`` the turning point, ``2 c_2`` the mean acceleration there, ``kappa`` the stiffness over the
mass (two terms of the cosine), ``beta`` friction over the mean force.  The coefficients of
``s^4`` and ``s |s|`` are fitted as such.  A flight that does not turn is a polynomial.

A low pass ``1 / D`` maps polynomials to polynomials: what the sensor shows of each term is known
exactly (of ``s |s|``: late by the delay) after its transient. The fit is Huber's (Huber 1981, ch.
7): least squares inside 2.5 standard deviations, absolute values outside. Standard errors use the
long-run variance of the residuals (Newey & West 1987, eq. 5), since neighbouring samples may share
noise.
"""

from dataclasses import dataclass, replace
from math import factorial

import numpy as np
from numpy.typing import NDArray

__all__ = ["Crossing", "Flight", "correlation_factor", "fit_flight"]

_HUBER = 2.5
_ROUNDS = 6
_TURNING = (0, 1, 2, 4)  # powers of a flight that turns; s |s| follows
_TRUST = 30.0  # samples that the noise of the other flights counts for


@dataclass(frozen=True, kw_only=True)
class Crossing:
    """Where a flight meets the level of a stop; positive in the direction of lift.

    Parameters
    ----------
    time, time_se [s]
    velocity, velocity_se [m/s]
    acceleration [m/s^2]
    """

    time: float
    time_se: float
    velocity: float
    velocity_se: float
    acceleration: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Flight:
    """Fitted motion: a polynomial, or the five terms of a flight that turns.

    Parameters
    ----------
    reference [s]
        Turning point, or the middle.
    turns
        Whether the terms are ``1, s, s^2, s^4, s |s|``; else ``1, s, s^2, ...``
    coefficients (m,)
        Of the motion, not of the sensor output [SI].
    covariance (m, m)
    residuals (n,) [m]
        About what the sensor shows of the motion.
    scale [m]
        Standard deviation of a sample in the covariance.
    first, last [s]
        Of the fitted samples.
    """

    reference: float
    turns: bool
    coefficients: NDArray[np.float64]
    covariance: NDArray[np.float64]
    residuals: NDArray[np.float64]
    scale: float
    first: float
    last: float

    @property
    def powers(self) -> tuple[int, ...]:
        """Powers of ``s`` of the polynomial terms."""
        return _TURNING if self.turns else tuple(range(self.coefficients.size))

    @property
    def acceleration(self) -> float:
        """Mean of rise and fall at the reference [m/s^2], in the direction of lift."""
        return 2.0 * float(self.coefficients[2])

    def derivative(self, time: float, order: int) -> tuple[float, NDArray[np.float64]]:
        """Derivative of the motion, and its gradient by the coefficients."""
        s = time - self.reference
        gradient = [
            _falling(k, order) * s ** (k - order) if k >= order else 0.0 for k in self.powers
        ]
        if self.turns:
            gradient.append((s * abs(s), 2.0 * abs(s), 2.0 * float(np.sign(s)))[order])
        row = np.array(gradient)
        return float(row @ self.coefficients), row

    def crossing(self, level: float, level_se: float, near: float) -> Crossing | None:
        """Where the flight meets a level next to a time; None if never.

        Parameters
        ----------
        level, level_se [m]
        near [s]
            An end of the flight.
        """
        time = self._meets(level, near)
        if time is None:
            return None
        v, by_v = self.derivative(time, 1)
        a, _ = self.derivative(time, 2)
        if v == 0.0:
            return None
        _, by_x = self.derivative(time, 0)
        total = by_v - a / v * by_x  # the time of the crossing moves with the coefficients
        spread = float(total @ self.covariance @ total) + (a / v * level_se) ** 2
        return Crossing(
            time=time,
            time_se=float(np.sqrt(max(float(by_x @ self.covariance @ by_x), 0.0) + level_se**2))
            / abs(v),
            velocity=v,
            velocity_se=float(np.sqrt(max(spread, 0.0))),
            acceleration=a,
        )

    def top(self) -> tuple[float, float]:
        """Lift [m] at the turning point, and its standard error."""
        x, by_x = self.derivative(self.reference, 0)
        v, _ = self.derivative(self.reference, 1)
        a = self.acceleration
        shift = -0.5 * v**2 / a if a else 0.0  # the reference is within a sample of it
        return x + shift, float(np.sqrt(by_x @ self.covariance @ by_x))

    def told(self, index: int, mean: float, variance: float) -> "Flight":
        """The same flight, one coefficient observed as ``mean`` with a variance (Kalman 1960)."""
        seen = self.covariance[:, index]
        gain = seen / (seen[index] + variance)
        covariance = self.covariance - np.outer(gain, seen)
        return replace(
            self,
            coefficients=self.coefficients + gain * (mean - self.coefficients[index]),
            covariance=0.5 * (covariance + covariance.T),
        )

    def _meets(self, level: float, near: float) -> float | None:
        """Time of a level, by Newton steps from the end."""
        time, length = near, self.last - self.first
        for _ in range(30):
            x, _ = self.derivative(time, 0)
            v, _ = self.derivative(time, 1)
            if v == 0.0:
                return None
            change = (level - x) / v
            time += max(-0.3 * length, min(0.3 * length, change))
            if abs(time - near) > length:
                return None
            if abs(change) < 1e-9 * length:
                return time
        return None


def fit_flight(
    time: NDArray[np.float64],
    lift: NDArray[np.float64],
    degree: int,
    *,
    sensor: NDArray[np.float64],
    turning_point: float | None = None,
    correlation: float = 1.0,
    floor: float = 0.0,
    noise: float | None = None,
) -> Flight:
    """Fit the motion to samples of one flight.

    Parameters
    ----------
    time, lift (n,) [s], [m]
        More samples than terms.
    degree
        Of the polynomial without turn.
    sensor [s^i]
        See :func:`klack.measurement.lift_sensor.sensor_polynomial`.
    turning_point [s]
    correlation [-]
        See :func:`correlation_factor`.
    floor [m]
        Least standard deviation of a sample.
    noise [m]
        Standard deviation about other flights, for few samples.
    """
    turns = turning_point is not None
    reference = 0.5 * float(time[0] + time[-1]) if turning_point is None else turning_point
    length = max(float(time[-1] - time[0]), np.finfo(float).tiny)
    powers = _TURNING if turns else tuple(range(degree + 1))
    A = _shown(time - reference, powers, turns, sensor, length)
    weight = np.ones(time.size)
    free = time.size - A.shape[1]
    for _ in range(_ROUNDS):
        normal = A.T @ (weight[:, None] * A)
        c = np.linalg.solve(normal, A.T @ (weight * lift))
        residuals = lift - A @ c
        spread = 1.4826 * float(np.median(np.abs(residuals))) * np.sqrt(time.size / free)
        if spread <= floor:
            break
        size = np.abs(residuals) / spread
        new = np.minimum(1.0, _HUBER / np.maximum(size, 1e-300))
        if np.max(np.abs(new - weight)) < 1e-3:
            break
        weight = new
    variance = float(weight @ residuals**2) / free
    if noise is not None:
        variance = (variance * free + noise**2 * _TRUST) / (free + _TRUST)
    variance = max(variance, floor**2, np.finfo(float).tiny) * correlation
    to_si = length ** -np.array([*powers, *([2] if turns else [])], dtype=float)
    return Flight(
        reference=reference,
        turns=turns,
        coefficients=c * to_si,
        covariance=variance * np.linalg.inv(normal) * np.outer(to_si, to_si),
        residuals=residuals,
        scale=float(np.sqrt(variance)),
        first=float(time[0]),
        last=float(time[-1]),
    )


def correlation_factor(residuals: tuple[NDArray[np.float64], ...]) -> float:
    """Variance of long means of residuals over white noise [-], at least 1.

    Parameters
    ----------
    residuals
        Of several flights, one sampling step.
    """
    sizes = [r.size for r in residuals]
    if not sizes or max(sizes) < 16:
        return 1.0
    longest = max(2, max(sizes) // 6)
    lags = np.zeros(longest)
    for r in residuals:
        full = np.correlate(r, r, mode="full")[r.size - 1 :]
        lags[: min(longest, r.size)] += full[:longest]
    if lags[0] <= 0.0:
        return 1.0
    weights = 2.0 * (1.0 - np.arange(1, longest) / longest)
    return max(1.0, 1.0 + float(weights @ lags[1:]) / float(lags[0]))


def _falling(k: int, order: int) -> float:
    return factorial(k) / factorial(k - order) if k >= order else 0.0


def _shown(
    s: NDArray[np.float64],
    powers: tuple[int, ...],
    turns: bool,
    sensor: NDArray[np.float64],
    length: float,
) -> NDArray[np.float64]:
    """Sensor output for each term, in scaled time ``s / length``."""
    u = s / length
    most = powers[-1]
    undo = np.zeros((most + 1, most + 1))  # coefficients of D q from those of q
    for i, d in enumerate(sensor[: most + 1]):
        for k in range(i, most + 1):
            undo[k - i, k] += d / length**i * _falling(k, i)
    A = u[:, None] ** np.arange(most + 1) @ np.linalg.inv(undo)[:, list(powers)]
    if not turns:
        return np.asarray(A)
    late = u - (sensor[1] / length if sensor.size > 1 else 0.0)
    return np.column_stack([A, late * np.abs(late)])
