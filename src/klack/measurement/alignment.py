"""Strokes of different recordings on one time axis."""

from collections.abc import Mapping, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.errors import InputError
from klack.measurement.cutting import Piece

__all__ = ["common_axis", "covers", "onto_axis"]

Vector = NDArray[np.float64]


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
    """Channels of a piece at the times of an axis, by cubic splines.

    Samples that fall on the axis stay as they are.  Half-way between samples white noise keeps
    about 0.8 of its variance; a straight line would keep half, and blur a touch as well.
    """
    count = len(next(iter(piece.values.values())))
    time = piece.start + piece.step * np.arange(count)
    inside = np.clip(axis, time[0], time[-1])
    return {
        role: scipy.interpolate.CubicSpline(time, values)(inside)
        for role, values in piece.values.items()
    }
