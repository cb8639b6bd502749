"""Strokes of different recordings on one time axis."""

from collections.abc import Mapping, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.errors import InputError
from klack.measurement.cutting import Piece

__all__ = ["between_samples", "common_axis", "covers", "onto_axis"]

Vector = NDArray[np.float64]

_ON_AXIS = 1e-6  # of a step


def common_axis(pieces: Sequence[Piece], first: float, last: float) -> Vector:
    """Uniform time with a sample at zero, of the finest step, that most pieces cover [s].

    Parameters
    ----------
    pieces : sequence of Piece
        At least one.
    first, last : float [s]
        What is wanted; less where at least half of the pieces have less.
    """
    step = min(piece.step for piece in pieces)
    begin = max(first, float(np.median([piece.start for piece in pieces])))
    end = min(last, float(np.median([piece.end for piece in pieces])))
    a, b = int(np.ceil(begin / step - 1e-6)), int(np.floor(end / step + 1e-6))
    if b - a < 2:
        raise InputError(
            "strokes",
            got=f"{len(pieces)} pieces with no common time around their trigger",
            expected="strokes with samples before and after it",
            hint="check the trigger: channel, level, 'before' and 'after'.",
        )
    return np.asarray(step * np.arange(a, b + 1), dtype=np.float64)


def covers(piece: Piece, axis: Vector) -> bool:
    """Whether a piece has samples over the whole axis, to a step."""
    return piece.start <= axis[0] + piece.step and piece.end >= axis[-1] - piece.step


def onto_axis(piece: Piece, axis: Vector) -> Mapping[str, Vector]:
    """Channels of a piece at the times of an axis, by cubic splines held within their samples.

    Samples that fall on the axis stay as they are.  Half-way between samples white noise keeps
    about 0.7 of its variance; a straight line would keep half, and blur a touch as well.  The
    spline alone would leave a step by 11 % of its height on either side.
    """
    count = len(next(iter(piece.values.values())))
    time = piece.start + piece.step * np.arange(count)
    inside = np.clip(axis, time[0], time[-1])
    left = np.clip(((inside - time[0]) / piece.step).astype(np.int64), 0, count - 2)
    found: dict[str, Vector] = {}
    for role, values in piece.values.items():
        low, high = _bounds(values)
        curve = scipy.interpolate.CubicSpline(time, values)(inside)
        found[role] = np.clip(curve, low[left], high[left])
    return found


def between_samples(piece: Piece, axis: Vector) -> bool:
    """True if the samples of a piece do not fall onto the axis."""
    shift = (piece.start - axis[0]) / piece.step
    same = abs(piece.step / (axis[1] - axis[0]) - 1.0) * axis.size < _ON_AXIS
    return not (same and abs(shift - round(shift)) < _ON_AXIS)


def _bounds(x: Vector) -> tuple[Vector, Vector]:
    """Lowest and highest value between each sample and the next.

    Those of the two, and beyond them the crest of the flatter parabola through either three samples
    where the record turns there: ``|x[k-1] - 2 x[k] + x[k+1]| / 8`` at most.
    """
    low, high = np.minimum(x[:-1], x[1:]), np.maximum(x[:-1], x[1:])
    if x.size > 3:
        slope, bend = np.diff(x), np.diff(x, 2)
        flatter = np.minimum(np.abs(bend[:-1]), np.abs(bend[1:])) / 8.0
        turns = (slope[:-2] * slope[2:] < 0.0) & (bend[:-1] * bend[1:] > 0.0)
        low[1:-1] -= np.where(turns & (bend[1:] > 0.0), flatter, 0.0)
        high[1:-1] += np.where(turns & (bend[1:] < 0.0), flatter, 0.0)
    return low, high
