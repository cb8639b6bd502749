"""A pulse of front, plateau and end, as in a struck bar, read off one record.

The plateau is the mean over the middle half of the time above half of itself, by iteration.  Front
and end cross shares of the plateau, on straight lines between samples.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import NoReturn

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.errors import InputError

__all__ = ["Pulse", "PulseFit", "fit_pulse", "measure_pulse"]


Floats = NDArray[np.float64]

_ROUNDS = 20
_SETTLED = 1e-9
_MIDDLE = (0.25, 0.75)
_HIGH, _FLAT = 0.85, 0.7  # so high for so long: half a sine is for 0.58 of its length
_TOP, _FOOT = 0.8, 0.2  # noise on front and end crosses their half more than once
_QUIET = 0.3  # of the length, before the front, is left out of the level at rest
_FEWEST = 20  # samples of a pulse
_RIPPLE = 0.01  # of the plateau: what counts as a crest
_BELL = 1.0 / 6.0
_NEXT = 2.0  # rises: farther off it is no crest of the same ripple


@dataclass(frozen=True, slots=True, kw_only=True)
class Pulse:
    """Numbers of one pulse.

    Parameters
    ----------
    sign
        -1 where the plateau is below zero; all levels are those of the pulse turned upwards.
    rest
        Before the front, as recorded.
    plateau
        Above rest.
    front [s]
        At half of the plateau.
    length [s]
        From there to the end.
    rise, fall [s]
        From 10 to 90 % of the plateau, and back.
    peak [-]
        Over the plateau.
    ripple [-]
        RMS of the plateau about its mean, over that.
    ripple_period [s]
        Between two crests behind the front; nan without a second.
    """

    sign: float
    rest: float
    plateau: float
    front: float
    length: float
    rise: float
    fall: float
    peak: float
    ripple: float
    ripple_period: float

    @property
    def end(self) -> float:
        """End at half of the plateau [s]."""
        return self.front + self.length


def measure_pulse(time: Floats, values: Floats, where: str) -> Pulse:
    """Read the first pulse off a record; rejects one without front, end or plateau."""
    if len(values) < _FEWEST:
        _refuse(where, f"no pulse: {len(values)} samples")
    size = np.abs(values - np.median(values[: max(3, len(values) // 50)]))
    if not float(size.max()) > 0.0:
        _refuse(where, "no pulse: the record is constant")
    first = int(np.argmax(size > 0.5 * size.max()))
    rest = float(np.mean(values[: max(1, first // 2)]))
    sign = 1.0 if values[first] >= rest else -1.0
    if first < 2:
        _refuse(where, "no front: the record begins within the pulse")
    rest, plateau, front, end = _plateau(time, values, sign, rest, where)
    x = (values - rest) * sign / plateau
    _require_plateau(time, x, front, end, where)
    inside = (time >= front) & (time <= end)
    middle = _between(time, front, end)
    begin, stop = int(np.argmax(time >= front)), int(np.argmax(time >= end))
    half = int(np.argmax(time >= 0.5 * (front + end)))
    k10 = int(_crossing(x, 0.1, 0, begin + 1, where)[-1])
    k90 = int(_crossing(x, 0.9, k10, half, where)[0])
    m90 = int(_crossing(-x, -0.9, half, stop + 1, where)[-1])
    m10 = int(_crossing(-x, -0.1, stop - 1, len(x), where)[0])
    rise = _instant(time, x, 0.9, k90) - _instant(time, x, 0.1, k10)
    return Pulse(
        sign=sign,
        rest=rest,
        plateau=plateau,
        front=front,
        length=end - front,
        rise=rise,
        fall=_instant(time, x, 0.1, m10) - _instant(time, x, 0.9, m90),
        peak=float(x[inside].max()),
        ripple=float(np.std(x[middle])),
        ripple_period=_period(time[inside], x[inside], rise),
    )


def _plateau(
    time: Floats, values: Floats, sign: float, rest: float, where: str
) -> tuple[float, float, float, float]:
    """Rest, plateau above it, and where its half is crossed twice."""
    plateau = 0.5 * float(np.max(sign * (values - rest)))
    front = end = 0.0
    for _ in range(_ROUNDS):
        x = sign * (values - rest) / plateau
        top = int(_crossing(x, _TOP, 0, len(x), where)[0])
        first = int(_crossing(x, 0.5, 0, top + 2, where)[-1])
        foot = int(_crossing(-x, -_FOOT, top, len(x), where)[0])
        last = int(_crossing(-x, -0.5, top, foot + 2, where)[-1])
        front, end = _instant(time, x, 0.5, first), _instant(time, x, 0.5, last)
        before = time < front - _QUIET * (end - front)
        if np.count_nonzero(before) >= 3:
            rest = float(np.mean(values[before]))
        middle = _between(time, front, end)
        if np.count_nonzero(middle) < _FEWEST // 2:
            _refuse(where, f"a pulse of {np.count_nonzero(middle)} samples in its middle half")
        new = float(np.mean(sign * (values[middle] - rest)))
        settled = abs(new - plateau) <= _SETTLED * abs(new)
        plateau = new
        if settled:
            break
    return rest, plateau, front, end


def _between(time: Floats, front: float, end: float) -> NDArray[np.bool_]:
    low, high = (front + share * (end - front) for share in _MIDDLE)
    return np.asarray((time >= low) & (time <= high))


def _require_plateau(time: Floats, x: Floats, front: float, end: float, where: str) -> None:
    inside = x[(time >= front) & (time <= end)]
    share = float(np.mean(inside >= _HIGH))
    if share < _FLAT:
        _refuse(
            where,
            f"no plateau: the pulse is above {100 * _HIGH:.0f} % of its middle for "
            f"{100 * share:.0f} % of its length",
        )


def _crossing(x: Floats, level: float, first: int, last: int, where: str) -> NDArray[np.int64]:
    """Samples before which x rises through a level."""
    above = x[first:last] >= level
    found = first + np.flatnonzero(~above[:-1] & above[1:])
    if len(found):
        return np.asarray(found)
    share = f"{100 * abs(level):.0f} % of the plateau"
    if level < 0.0:
        _refuse(where, f"no end: the record does not fall through {share}")
    _refuse(where, f"no front: the record does not rise through {share}")


def _instant(time: Floats, x: Floats, level: float, k: int) -> float:
    """Where x is at a level after sample k, straight [s]."""
    return float(time[k] + (level - x[k]) / (x[k + 1] - x[k]) * (time[k + 1] - time[k]))


def _period(time: Floats, x: Floats, rise: float) -> float:
    """Time between the first two crests; nan without.

    A bell of a sixth of the rise takes off noise: nothing faster belongs to the pulse.
    """
    step = float(np.median(np.diff(time)))
    smooth = scipy.ndimage.gaussian_filter1d(x, max(_BELL * rise / step, 0.5))
    crests, _ = scipy.signal.find_peaks(smooth, prominence=_RIPPLE)
    if len(crests) < 2:
        return float("nan")
    a, b = (_vertex(smooth, int(k)) for k in crests[:2])
    return step * (b - a) if step * (b - a) < _NEXT * rise else float("nan")


def _vertex(x: Floats, k: int) -> float:
    """Top of the parabola through a crest, in samples."""
    left, top, right = x[k - 1], x[k], x[k + 1]
    bend = left - 2.0 * top + right
    return k + 0.5 * float((left - right) / bend) if bend < 0.0 else float(k)


def _refuse(where: str, got: str) -> NoReturn:
    raise InputError(
        where,
        got=got,
        expected="one pulse with quiet time before it, a front, a plateau, and an end",
        hint="cut the record so that it begins before the front and ends after the pulse; "
        "smooth noise above a twentieth of the plateau.",
    )


_BEFORE, _BEHIND = 0.2, 0.2  # of the length
_REACH = 0.1  # of the length: how far from front on front the best shift may be
_TRIES = 9
_FIT_SETTLED = 1e-6  # of the length


@dataclass(frozen=True, slots=True, kw_only=True)
class PulseFit:
    r"""Best shift and factor.

    .. math:: \min_{\tau, a} \sum_k \left[ a\, y(t_k + \tau) - x(t_k) \right]^2, \qquad
        a(\tau) = \frac{\sum x y}{\sum y^2}

    from a little before the front to a little behind the end. In a linear bar the factor is that
    of the speed.

    Parameters
    ----------
    shift [s]
        Computed minus measured time.
    factor [-]
        Measured over computed.
    rms [-]
        RMS of the rest over the measured plateau.
    """

    shift: float
    factor: float
    rms: float


def fit_pulse(
    time: Floats,
    measured: Floats,
    pulse: Pulse,
    computed_time: Floats,
    computed: Floats,
    computed_pulse: Pulse,
    *,
    factor: float | None = None,
) -> PulseFit:
    """Align a computed pulse with a measured one, with a given or a fitted factor."""
    first = pulse.front - _BEFORE * pulse.length
    last = pulse.end + _BEHIND * pulse.length
    seen = (time >= first) & (time <= last)
    t = time[seen]
    x = pulse.sign * (measured[seen] - pulse.rest)
    y_all = computed_pulse.sign * (computed - computed_pulse.rest)

    def at(shift: float) -> tuple[float, float]:
        y = np.interp(t + shift, computed_time, y_all)
        a = float(x @ y / (y @ y)) if factor is None else factor
        return float(np.sqrt(np.mean((a * y - x) ** 2))) / pulse.plateau, a

    middle, length = computed_pulse.front - pulse.front, pulse.length
    edges = np.linspace(-_REACH, _REACH, _TRIES)
    best = min(
        (
            scipy.optimize.minimize_scalar(
                lambda part: at(middle + part * length)[0],
                bounds=(a, b),
                method="bounded",
                options={"xatol": _FIT_SETTLED},
            )
            for a, b in pairwise(edges)
        ),
        key=lambda found: float(found.fun),
    )
    shift = middle + float(best.x) * length
    rms, found = at(shift)
    return PulseFit(shift=shift, factor=found, rms=rms)
