"""All flights on one stop, estimated together.

Each flight is fitted alone first (:mod:`klack.measurement.flight`); its coefficients and their
covariance hold all that its samples say. Together the flights of one stop say more:

* their force is nearly the same: accelerations scatter about a mean, by as much as they are found
  to (random effects, DerSimonian & Laird 1986, eq. 7), at least 1 %;
* spring and friction are the same: ``c_4 = -kappa c_2 / 12`` and ``c_f = -beta c_2``, each up to
  1 % of the force;
* they meet one level, and each contact lasts about as long as the others: release minus touch is
  ``T_c`` up to 10 % and 0.2 us.

These are further observations in one least-squares problem, solved by Gauss-Newton steps; its
inverse normal matrix is the covariance (Gelman et al. 2013, ch. 5).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from klack.measurement.flight import Crossing, Flight
from klack.measurement.stroke_measures import FlightShape

__all__ = ["FlightTrain", "join_flights"]

_USUAL_FRICTION = 0.05  # spread of friction and drag over the mean force
_USUAL_SPRING = 0.05  # of the change of force over the highest rebound, over that force
_ALIKE = 0.01  # of the force: spring and friction are the same from flight to flight
_CONTACT = 0.1  # relative scatter of contact times
_CONTACT_TIME = 0.2e-6  # [s] and a smallest one
_UNLIKE = 0.05  # relative: acceleration of the first approach against that of the bounces
_SCATTERS = (0.1, 0.01)  # relative scatter of accelerations: first guess, smallest
_STEPS = 4
_COMMON = 5  # level, contact time, acceleration, kappa, beta


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightTrain:
    """Joint estimate of the flights on one stop.

    Parameters
    ----------
    level, level_se [m]
    flights
        The approach first, with joint coefficients.
    touches, releases
        Touch of impact k, and release after it.
    restitution_se
        Per impact; nan without touch or release.
    shape
        None without a bounce.
    """

    level: float
    level_se: float
    flights: tuple[Flight | None, ...]
    touches: tuple[Crossing | None, ...]
    releases: tuple[Crossing | None, ...]
    restitution_se: tuple[float, ...]
    shape: FlightShape | None


@dataclass(frozen=True, kw_only=True, eq=False)
class _End:
    """Crossing with its gradients by all unknowns."""

    crossing: Crossing
    by_time: NDArray[np.float64]
    by_velocity: NDArray[np.float64]


def join_flights(
    flights: tuple[Flight | None, ...],
    level: float,
    level_se: float,
    away: float,
    known: FlightShape | None = None,
) -> FlightTrain:
    """Estimate approach and bounces on one stop together.

    Parameters
    ----------
    flights
        Approach, then the bounce after each impact; None where there is no fit.
    level, level_se [m]
        Of the stop.
    away
        1 for bounces towards larger lift, else -1.
    known
        From other strokes of the same valve.
    """
    problem = _Problem(flights, level, level_se, away, known)
    problem.solve()
    return problem.result()


class _Problem:
    def __init__(
        self,
        flights: tuple[Flight | None, ...],
        level: float,
        level_se: float,
        away: float,
        known: FlightShape | None,
    ) -> None:
        self.flights, self.known = flights, known
        self.level, self.level_se, self.away = level, level_se, away
        self.bounces = [k for k, f in enumerate(flights) if f is not None and f.turns]
        sizes = [0 if f is None else f.coefficients.size for f in flights]
        ends = _COMMON + np.concatenate(([0], np.cumsum(sizes))).astype(int)
        self.part = [slice(a, b) for a, b in pairwise(ends.tolist())]
        self.size = int(ends[-1])
        self.whiten = [None if f is None else _whitener(f.covariance) for f in flights]
        c2 = [f.coefficients[2] for k in self.bounces if (f := flights[k]) is not None]
        mean = float(np.median(c2)) if c2 else 0.0
        self.force = abs(mean)
        lengths = [f.last - f.first for k in self.bounces if (f := flights[k]) is not None]
        self.half = 0.5 * max(lengths, default=1e-4)
        self.unknown = np.zeros(self.size)
        self.unknown[0], self.unknown[2] = level, mean
        for f, part in zip(flights, self.part, strict=True):
            if f is not None:
                self.unknown[part] = f.coefficients
        self.scatter = _SCATTERS[0]
        self.unknown[1] = self._contact_time()
        self.covariance = np.zeros((self.size, self.size))

    def solve(self) -> None:
        for step in range(2 * _STEPS):
            if step == _STEPS:
                self._learn_scatter()
            J, r = self._rows()
            scale = np.linalg.norm(J, axis=0)
            scale[scale == 0.0] = 1.0
            normal = (J / scale).T @ (J / scale) + 1e-13 * np.eye(self.size)
            inverse = np.linalg.inv(normal)
            self.covariance = inverse / np.outer(scale, scale)
            self.unknown = self.unknown - (inverse @ ((J / scale).T @ r)) / scale

    def result(self) -> FlightTrain:
        flights = tuple(
            None
            if f is None
            else replace(
                f, coefficients=self.unknown[part].copy(), covariance=self.covariance[part, part]
            )
            for f, part in zip(self.flights, self.part, strict=True)
        )
        touches = [self._end(k, last=True) for k in range(len(flights))]
        releases = [self._end(k + 1, last=False) for k in range(len(flights) - 1)]
        releases.append(None)
        return FlightTrain(
            level=float(self.unknown[0]),
            level_se=float(np.sqrt(self.covariance[0, 0])),
            flights=flights,
            touches=tuple(self._measured(end) for end in touches),
            releases=tuple(self._measured(end) for end in releases),
            shape=self._shape(),
            restitution_se=tuple(
                self._restitution_se(a, b) for a, b in zip(touches, releases, strict=True)
            ),
        )

    def _shape(self) -> FlightShape | None:
        if not self.bounces:
            return None
        spread = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        return FlightShape(
            acceleration=-2.0 * self.away * float(self.unknown[2]),
            acceleration_se=2.0 * float(np.hypot(spread[2], self.scatter * self.force)),
            stiffness=float(self.unknown[3]),
            stiffness_se=float(spread[3]),
            friction=float(self.unknown[4]),
            friction_se=float(spread[4]),
        )

    def _flight(self, k: int) -> Flight | None:
        f = self.flights[k]
        return None if f is None else replace(f, coefficients=self.unknown[self.part[k]])

    def _end(self, k: int, *, last: bool) -> _End | None:
        """Where flight k meets the level at either end."""
        f = self._flight(k)
        if f is None or (not last and not f.turns):
            return None
        level = float(self.unknown[0])
        crossing = f.crossing(level, 0.0, f.last if last else f.first)
        if crossing is None or (crossing.velocity * self.away > 0.0) == last:
            return None
        _, by_x = f.derivative(crossing.time, 0)
        _, by_v = f.derivative(crossing.time, 1)
        v, a = crossing.velocity, crossing.acceleration
        by_time, by_velocity = np.zeros(self.size), np.zeros(self.size)
        by_time[self.part[k]] = -by_x / v
        by_time[0] = 1.0 / v
        by_velocity[self.part[k]] = by_v - a / v * by_x
        by_velocity[0] = a / v
        return _End(crossing=crossing, by_time=by_time, by_velocity=by_velocity)

    def _contact_time(self) -> float:
        times = []
        for k in range(len(self.flights) - 1):
            a, b = self._end(k, last=True), self._end(k + 1, last=False)
            if a is not None and b is not None:
                times.append(b.crossing.time - a.crossing.time)
        return float(np.median(times)) if times else 0.0

    def _rows(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        J: list[NDArray[np.float64]] = []
        r: list[float] = []

        def observe(gradient: dict[int, float], residual: float, spread: float) -> None:
            row = np.zeros(self.size)
            for index, value in gradient.items():
                row[index] = value / spread
            J.append(row)
            r.append(residual / spread)

        u = self.unknown
        observe({0: 1.0}, float(u[0]) - self.level, max(self.level_se, 1e-12))
        observe({3: 1.0}, float(u[3]), 2.0 * _USUAL_SPRING / self.half**2)
        observe({4: 1.0}, float(u[4]), _USUAL_FRICTION)
        if (known := self.known) is not None:
            mean = -0.5 * self.away * known.acceleration
            observe({2: 1.0}, float(u[2]) - mean, 0.5 * known.acceleration_se)
            observe({3: 1.0}, float(u[3]) - known.stiffness, known.stiffness_se)
            observe({4: 1.0}, float(u[4]) - known.friction, known.friction_se)
        for k, (f, part, W) in enumerate(zip(self.flights, self.part, self.whiten, strict=True)):
            if f is None or W is None:
                continue
            block = np.zeros((W.shape[0], self.size))
            block[:, part] = W
            J.extend(block)
            r.extend((W @ (u[part] - f.coefficients)).tolist())
            i = part.start
            c2 = float(u[i + 2])
            if f.turns:
                kappa, beta = float(u[3]), float(u[4])
                observe(
                    {i + 3: 1.0, i + 2: kappa / 12.0, 3: c2 / 12.0},
                    float(u[i + 3]) + kappa * c2 / 12.0,
                    _ALIKE * self.force / (6.0 * self.half**2),
                )
                observe(
                    {i + 4: 1.0, i + 2: beta, 4: c2},
                    float(u[i + 4]) + beta * c2,
                    _ALIKE * self.force,
                )
                observe({i + 2: 1.0, 2: -1.0}, c2 - float(u[2]), self.scatter * self.force)
            elif self.bounces:
                self._observe_approach(observe, k)
        for k in range(len(self.flights) - 1):
            a, b = self._end(k, last=True), self._end(k + 1, last=False)
            if a is None or b is None:
                continue
            spread = float(np.hypot(_CONTACT * u[1], _CONTACT_TIME))
            row = b.by_time - a.by_time
            row[1] -= 1.0
            J.append(row / spread)
            r.append((b.crossing.time - a.crossing.time - float(u[1])) / spread)
        return np.array(J), np.array(r)

    def _observe_approach(
        self, observe: Callable[[dict[int, float], float, float], None], k: int
    ) -> None:
        """Acceleration at the end of the approach against the bounces."""
        f, own = self._flight(k), self.flights[k]
        if f is None or own is None:
            return
        found, _ = own.derivative(own.last, 2)
        a, gradient = f.derivative(f.last, 2)
        told = 2.0 * float(self.unknown[2])
        spread = 2.0 * self.force * float(np.hypot(_UNLIKE, self.scatter))
        error = float(np.sqrt(max(float(gradient @ own.covariance @ gradient), 0.0)))
        if abs(found - told) > 3.0 * np.hypot(spread, error):
            return  # another force acts on the way there
        i = self.part[k].start
        by = {i + j: float(g) for j, g in enumerate(gradient)}
        observe({**by, 2: -2.0}, a - told, spread)

    def _learn_scatter(self) -> None:
        """Scatter of the accelerations beyond their errors, by moments."""
        if len(self.bounces) < 2 or self.force == 0.0:
            return
        values, variances = [], []
        for k in self.bounces:
            i = self.part[k].start + 2
            told = (self.scatter * self.force) ** 2  # taken out again
            own = 1.0 / max(1.0 / self.covariance[i, i] - 1.0 / told, 1e-6 / told)
            difference = self.unknown[i] - self.unknown[2]
            values.append(own * difference / self.covariance[i, i])
            variances.append(own)
        learnt = float(np.sqrt(_scatter(np.array(values), np.array(variances)))) / self.force
        self.scatter = min(max(learnt, _SCATTERS[1]), 1.0)

    def _measured(self, end: _End | None) -> Crossing | None:
        if end is None:
            return None
        return replace(
            end.crossing,
            time_se=self._se(end.by_time),
            velocity_se=self._se(end.by_velocity),
        )

    def _restitution_se(self, touch: _End | None, release: _End | None) -> float:
        if touch is None or release is None:
            return float("nan")
        v, w = touch.crossing.velocity, release.crossing.velocity
        return self._se(release.by_velocity / v - w / v**2 * touch.by_velocity)

    def _se(self, gradient: NDArray[np.float64]) -> float:
        return float(np.sqrt(max(float(gradient @ self.covariance @ gradient), 0.0)))


def _whitener(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """``W`` with ``W.T W`` the inverse of a badly scaled covariance."""
    scale = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    values = np.maximum(values, 1e-12 * values[-1])
    return np.asarray((vectors / np.sqrt(values)).T / scale)


def _scatter(values: NDArray[np.float64], variances: NDArray[np.float64]) -> float:
    """Variance of values beyond their own (DerSimonian & Laird 1986)."""
    w = 1.0 / variances
    mean = w @ values / w.sum()
    excess = float(w @ (values - mean) ** 2) - (values.size - 1)
    return max(0.0, excess / float(w.sum() - w @ w / w.sum()))
