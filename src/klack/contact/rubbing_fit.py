r"""Law with memory of a reduced contact from its static loops.

Closing is the local law, point for point. Opening, the full bodies slip back at a share *r* of the
force of closing at the same approach, at every depth where slip is self-similar (Spence, J.
Elasticity 5 (1975) 297); what the kept modes yield is taken off,

.. math:: d_{back} = \delta - c\, r P(\delta) .

Half of the distance of the two curves is the strength of the sliders at each depth; their
stiffness follows from the energy of the largest loop. *r* is the one that suits all openings with
a stiffness of its own, before anything is taken off.

Limits: the modes carry the same share in either direction of slip, though friction turns its
radial part round; loops of other depths have errors, see :class:`RubbingFit`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from klack.arrays import Vector
from klack.contact.laws import TableLaw
from klack.contact.local_law import LocalLaw
from klack.contact.rubbing_law import RubbingLaw

__all__ = ["Loop", "RubbingFit", "rubbing_fit"]


_SPRINGS = 64
_NO_LOSS = 1e-4  # share of the work below which a loop is that of round-off and increments
_STIFFEST = 0.995  # (R - 1) / (R + 1) of sliders that hold hardly at all


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loop:
    """Full bodies close up to an approach and open again.

    Parameters
    ----------
    approach (m,) [m]
        Opening, falling to first touch.
    force (m,) [N]
    loss [J]
        Of the whole loop.
    """

    approach: Vector
    force: Vector
    loss: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RubbingFit:
    """Law with memory, and how far its loops are from the given ones.

    Parameters
    ----------
    law : RubbingLaw or TableLaw
        Without memory where nothing is lost.
    reverse [-]
        r.
    loss [-]
        Lost share of the work of the largest loop.
    error [-]
        Largest error of the loss of a loop, over the work taken.
    """

    law: RubbingLaw | TableLaw
    reverse: float
    loss: float
    error: float


def rubbing_fit(local: LocalLaw, loops: Sequence[Loop]) -> RubbingFit:
    """Fit a law with memory; rejects faces that lock.

    Parameters
    ----------
    local
        Of bodies that close with friction.
    loops
        The last one from the end of ``local``.
    """
    closing = TableLaw(local.approach, local.force)
    taken = [float(closing.potential(loop.approach[0])) for loop in loops]
    shares = [loop.loss / work for loop, work in zip(loops, taken, strict=True)]
    if shares[-1] < _NO_LOSS:
        return RubbingFit(law=local.law, reverse=1.0, loss=0.0, error=max(map(abs, shares)))
    reverse = _reverse(closing, loops)
    depth = float(local.law.indentation[-1])
    knots = depth * (np.arange(_SPRINGS + 1) / _SPRINGS) ** 2
    up = local.law.force(knots)
    strength = _under(knots, (up - _back(closing, local, reverse, knots)) / 2.0)
    law = _bed(knots, up, strength, ratio=2.0)
    # all loops of a bed lose (R - 1) / (R + 1) of the same integral
    most = float(law.strength @ (depth - law.onset) ** 2)
    held = min(loops[-1].loss / most, _STIFFEST) if most > 0.0 else 0.0
    law = _bed(knots, up, strength, ratio=(1.0 + held) / (1.0 - held))
    errors = [
        abs(held * float(law.strength @ np.maximum(at - law.onset, 0.0) ** 2) - loop.loss) / work
        for loop, work in zip(loops, taken, strict=True)
        for at in [loop.approach[0] - local.modal_compliance * loop.force[0]]
    ]
    return RubbingFit(law=law, reverse=reverse, loss=shares[-1], error=max(errors))


def _bed(knots: Vector, up: Vector, strength: Vector, *, ratio: float) -> RubbingLaw:
    """Springs whose forces are straight between the knots."""

    def stiffness(force: Vector) -> Vector:
        return np.diff(np.diff(force) / np.diff(knots), prepend=0.0)

    return RubbingLaw(
        onset=knots[:-1],
        normal=stiffness(up - strength),
        strength=np.maximum(stiffness(strength), 0.0),
        ratio=ratio,
    )


def _reverse(closing: TableLaw, loops: Sequence[Loop]) -> float:
    """Find r by least squares over all openings."""
    knots = float(closing.indentation[-1]) * (np.arange(_SPRINGS + 1) / _SPRINGS) ** 2
    up = closing.force(knots)
    size = float(up[-1])

    def apart(numbers: Vector) -> Vector:
        share, held = numbers
        law = _bed(knots, up, _under(knots, (1 - share) / 2 * up), ratio=(1 + held) / (1 - held))
        found = [law.along(np.append(0.0, loop.approach))[1:] - loop.force for loop in loops]
        return np.concatenate(found) / size

    fitted = scipy.optimize.least_squares(
        apart, (0.8, 0.5), bounds=((1e-3, 1e-3), (1.0, _STIFFEST))
    )
    return float(fitted.x[0])


def _back(closing: TableLaw, local: LocalLaw, reverse: float, knots: Vector) -> Vector:
    """Force of slipping back at local indentations."""
    # a little beyond the end: it slips back there at more indentation than it closes
    end = float(closing.indentation[-1])
    approach = np.append(closing.indentation, end * np.linspace(1.02, 1.5, 25))
    force = reverse * closing.force(approach)
    return np.interp(knots, approach - local.modal_compliance * force, force)


def _under(x: Vector, y: Vector) -> Vector:
    """Largest convex, rising curve from the origin that is nowhere above y."""
    y = np.minimum.accumulate(np.maximum(y, 0.0)[::-1])[::-1]
    kept: list[int] = []
    for i in range(len(x)):
        while len(kept) > 1:
            a, b = kept[-2], kept[-1]
            if (y[b] - y[a]) * (x[i] - x[a]) <= (y[i] - y[a]) * (x[b] - x[a]):
                break
            kept.pop()
        kept.append(i)
    return np.interp(x, x[kept], y[kept])
