r"""Solid iron in which flux spreads with the local permeability: shells of a ladder.

The rational function of the ladder of :mod:`klack.magnetics.eddy` beside a linear core of
reluctance ``R`` is also a string of shells, from the surface inwards, with shorted turns between:

.. math::

    \frac{\Theta}{R\varphi} = s\tau\,q_1 + \cfrac{1}{w_1 + \cfrac{1}{s\tau\,q_2
        + \cfrac{1}{w_2 + \dots}}} , \qquad \sum_k w_k = 1 .

A shell holds the share ``w_k`` of the section; a turn encloses all that lies further in, :math:`S_k
= q_k R\tau`, whatever the permeability.  Each shell has the magnetisation curve, :math:`\Theta_k =
l\,H(\varphi_k/w_kA)`.  Near any uniform state that is the ladder with the *differential*
permeability there, and iron saturates from its surface inwards shell by shell.  One term is the
whole section behind one turn.

Limits: the field within a shell is uniform, so that a sharp front passes in as many steps as there
are terms.  Sources: Stoll 1974 (diffusion); Stieltjes 1894 (strings); rederived.
"""

from dataclasses import dataclass
from fractions import Fraction

from klack.magnetics.eddy import EddyShape

__all__ = ["Shells", "shells"]

Polynomial = list[Fraction]  # factors of 1, s tau, (s tau)^2, ..


@dataclass(frozen=True, slots=True)
class Shells:
    """Shares of the section and shorted turns, from the surface inwards.

    Parameters
    ----------
    shares [-]
        ``w_k``; their sum is 1.
    turns [-]
        ``q_k = S_k/(R tau)``, the first one around all shells.
    """

    shares: tuple[float, ...]
    turns: tuple[float, ...]


def shells(shape: EddyShape, terms: int) -> Shells:
    """Shells of a cylinder or sheet.

    Examples
    --------
    >>> shells("cylinder", 1)
    Shells(shares=(1.0,), turns=(0.125,))
    >>> [round(w, 3) for w in shells("sheet", 3).shares]
    [0.14, 0.301, 0.559]
    """
    above, below = _ladder(shape, terms)
    shares, turns = [], []
    for _ in range(terms):
        turn = above[-1] / below[-1]  # the term that grows with s
        above = _trimmed([a - b for a, b in zip(above, [Fraction(0), *_times(below, turn)],
                                                strict=True)])  # fmt: skip
        share = below[-1] / above[-1]
        below = _trimmed([b - a for a, b in zip(_times(above, share), below, strict=True)])
        turns.append(float(turn))
        shares.append(float(share))
    return Shells(tuple(shares), tuple(turns))


def _ladder(shape: EddyShape, terms: int) -> tuple[Polynomial, Polynomial]:
    """``Theta/(R phi)`` of the ladder with so many turns, as a quotient of polynomials."""
    above, below = [Fraction(0)], [Fraction(1)]  # of what lies inside the last turn: nothing
    for k in range(terms, 0, -1):
        turn = Fraction(1, 8 * k) if shape == "cylinder" else Fraction(1, 4 * (4 * k - 1))
        plain = Fraction(2 * k + 1) if shape == "cylinder" else Fraction(4 * k + 1)
        if k == terms:
            above, below = [Fraction(0), turn], [Fraction(1)]
        else:  # the turn beside the reluctance in series with what is inside
            inner = _sum(_times(below, plain), above)
            above, below = (
                [Fraction(0), *_times(inner, turn)],
                _sum(inner, [Fraction(0), *_times(below, turn)]),
            )
    return _sum(below, above), below


def _times(p: Polynomial, factor: Fraction) -> Polynomial:
    return [factor * c for c in p]


def _sum(p: Polynomial, q: Polynomial) -> Polynomial:
    size = max(len(p), len(q))
    full = [[*r, *[Fraction(0)] * (size - len(r))] for r in (p, q)]
    return [a + b for a, b in zip(*full, strict=True)]


def _trimmed(p: Polynomial) -> Polynomial:
    while len(p) > 1 and p[-1] == 0:
        p = p[:-1]
    return p
