r"""What is wrong with measured mobilities: signs, quantities, units, reciprocity, resolution.

A passive body takes up power under a force at any point, :math:`\mathrm{Re}\,Y_{ii} \ge 0`: phase
within 90 degrees.  Values that are accelerances (phase 0 to 180 degrees) or receptances break that
at about half of the lines, and keep it once they are read as what they are.  Reciprocity is
:math:`Y_{ij} = Y_{ji}`.  What is certainly wrong is an error, what is doubtful a warning.
"""

import warnings

import numpy as np

from klack.acoustics.interface import Complexes, Freedom
from klack.arrays import Vector
from klack.errors import AccuracyWarning, refuse_if

__all__ = ["check_places", "check_reciprocity", "check_resolution", "check_taken_power"]

_NOISE = 0.05  # share of the magnitude by which a real part may be below 0
_WRONG, _DOUBTFUL, _RIGHT = 0.2, 0.02, 0.05  # shares of the lines with a real part below 0
_RECIPROCITY = 0.1
_COARSE = 0.05
_SOFT = 10.0  # [m/(N s)], more than any part that carries a valve
_FAR = 100.0  # [m]


def check_taken_power(
    name: str, frequency: Vector, freedoms: tuple[Freedom, ...], Y: Complexes
) -> None:
    """Refuse driving-point mobilities that are no mobilities, and doubt others.

    Parameters
    ----------
    name
        File, for messages.
    frequency (k,) [Hz]
    freedoms
        n of them.
    Y (k, n, n)

    Raises
    ------
    InputError
        If the real part is below 0 at more than a fifth of the lines.
    """
    omega = 2.0 * np.pi * frequency
    for i, freedom in enumerate(freedoms):
        own = Y[:, i, i]
        share = _below(own)
        others = {
            "an accelerance": own / (1j * omega),
            "a receptance": own * 1j * omega,
            "a mobility of reversed sign": -own,
        }
        like = [what for what, values in others.items() if _below(values) < min(_RIGHT, share / 4)]
        refuse_if(
            share > _WRONG,
            f"{name}: {freedom} / {freedom}",
            got=f"a real part below 0 at {100 * share:.0f} % of the lines"
            + (f", as of {like[0]} read as a mobility" if like else ""),
            expected="a real part of 0 or more at a driving point: the receiver takes up power",
            hint="check the quantity, and the sign and direction of sensor and hammer."
            if like
            else "check that sensor and hammer are at one point in one direction.",
        )
        if share > _DOUBTFUL:
            warnings.warn(
                f"{name}: the real part of {freedom} / {freedom} is below 0 at "
                f"{100 * share:.0f} % of the lines: noise, sensor and hammer apart"
                + (f", or {like[0]} read as a mobility" if like else "")
                + ". There the receiver would supply power.",
                AccuracyWarning,
                stacklevel=3,
            )
        if not freedom.is_rotation and float(np.median(np.abs(own))) > _SOFT:
            warnings.warn(
                f"{name}: {freedom} / {freedom} is {np.median(np.abs(own)):.3g} m/(N s) in the "
                "median, a thousand times the value of a metal sheet: mm instead of m?",
                AccuracyWarning,
                stacklevel=3,
            )


def _below(own: Complexes) -> float:
    """Share of the lines with a real part clearly below 0."""
    return float(np.mean(own.real < -_NOISE * np.abs(own)))


def check_reciprocity(
    name: str, freedoms: tuple[Freedom, ...], Y: Complexes, measured: np.ndarray
) -> None:
    """Doubt pairs that differ by more than a tenth; refuse those of opposite sign.

    Parameters
    ----------
    Y (k, n, n)
    measured (n, n)
        False where a response was taken from its reciprocal one.
    """
    worst, pair = 0.0, ("", "")
    for i in range(len(freedoms)):
        for j in range(i):
            if not (measured[i, j] and measured[j, i]):
                continue
            one, other = Y[:, i, j], Y[:, j, i]
            size = np.linalg.norm(one) + np.linalg.norm(other)
            apart = 2.0 * float(np.linalg.norm(one - other) / max(size, np.finfo(float).tiny))
            names = str(freedoms[i]), str(freedoms[j])
            refuse_if(
                np.linalg.norm(one + other) < 0.5 * np.linalg.norm(one - other),
                f"{name}: {names[0]} / {names[1]}",
                got=f"the opposite of {names[1]} / {names[0]}",
                expected="the same, by reciprocity",
                hint="the sign of one direction is wrong, in a sensor or in a hammer blow.",
            )
            if apart > worst:
                worst, pair = apart, names
    if worst > _RECIPROCITY:
        warnings.warn(
            f"{name}: {pair[0]} / {pair[1]} and {pair[1]} / {pair[0]} differ by "
            f"{100 * worst:.0f} % (reciprocity): check directions, positions and calibration. "
            "The coupling is no more accurate than that.",
            AccuracyWarning,
            stacklevel=3,
        )


def check_resolution(name: str, frequency: Vector, Y: Complexes) -> None:
    """Doubt lines too far apart: a quarter of what every second line alone would miss."""
    if frequency.size < 5:
        return
    middle = frequency[1:-1:2]
    left, right = frequency[:-2:2][: middle.size], frequency[2::2][: middle.size]
    share = ((middle - left) / (right - left))[:, None, None]
    guess = (1.0 - share) * Y[:-2:2][: middle.size] + share * Y[2::2][: middle.size]
    known = Y[1:-1:2]
    size = np.sqrt(np.sum(np.abs(known) ** 2, axis=0))
    apart = np.sqrt(np.sum(np.abs(guess - known) ** 2, axis=0))
    worst = 0.25 * float(np.max(apart / np.maximum(size, np.finfo(float).tiny)))
    if worst > _COARSE:
        warnings.warn(
            f"{name}: lines are too far apart for its resonances; between lines mobilities are "
            f"wrong by about {100 * worst:.0f} % of their rms. At the lines themselves they are "
            "exact.",
            AccuracyWarning,
            stacklevel=3,
        )


def check_places(name: str, places: np.ndarray) -> None:
    """Doubt nodes that are farther apart than a machine is long.

    Parameters
    ----------
    places (n, 3) [m]
    """
    span = float(np.ptp(places, axis=0).max()) if places.size else 0.0
    if span > _FAR:
        warnings.warn(
            f"{name}: nodes are {span:.4g} m apart: mm instead of m?", AccuracyWarning, stacklevel=3
        )
