r"""The consistent local law: exactly the compliance that the retained modes miss.

The static contact of the full bodies gives the approach :math:`\delta(P)`. The retained elastic
modes yield by :math:`P\,c`, with :math:`c = \sum_a \varphi_i^2/\omega_i^2 + \sum_b
\varphi_j^2/\omega_j^2` and their amplitudes under the contact's pressure pattern. The rest,

.. math:: \delta_{loc}(P) = \delta(P) - P\,c ,

is the local law of the reduced model: massless, monotone, with a potential. Nothing is counted
twice or missing, for any number of modes. A constant local stiffness with residual attachment
modes, the usual recipe, freezes one contact area; a bare Hertz law counts the compliance of the
modes near the contact twice.

Limit: *c* belongs to one pressure pattern (take it near the expected peak force) while the contact
grows with the load. With very many modes the rest can then fall with rising force; such a law is
rejected.
"""

import warnings
from dataclasses import dataclass
from math import floor

import numpy as np
from numpy.typing import NDArray

from klack.contact.laws import TableLaw
from klack.contact.statics import StaticContact
from klack.errors import AccuracyWarning, InputError, require_nonnegative

__all__ = ["LocalLaw", "OverfullModesError", "consistent_law"]

_FAIR_SHARE = 0.2
"""Share of the compliance below which the law is a small difference of large numbers."""

_POWERS = (1.0, 2.0)
"""Exponents F ~ delta^n of the beginning of a smooth contact."""


class OverfullModesError(InputError):
    """The kept modes carry more than the static compliance of a contact: none is left."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LocalLaw:
    """Local law of a reduced model and how much of the compliance it carries.

    Parameters
    ----------
    law
        Over the local indentation; beyond the table the last tangent continues.
    force (n,) [N]
        Of the static ladder.
    approach (n,) [m]
        Of the full bodies at these forces.
    share (n,) [-]
        Local indentation over approach.
    tangent_share (n,) [-]
        The same of the slopes; the law is monotone while it is above zero.
    modal_compliance [m/N]
        Subtracted.
    resolved_force [N]
        Below it the contact is narrower than the elements and a power law continues the curve.
    exponent [-]
        Of that law.
    """

    law: TableLaw
    force: NDArray[np.float64]
    approach: NDArray[np.float64]
    share: NDArray[np.float64]
    tangent_share: NDArray[np.float64]
    modal_compliance: float
    resolved_force: float
    exponent: float

    @property
    def max_force(self) -> float:
        """End of the table [N]; an impact should stay below."""
        return float(self.force[-1])

    @property
    def force_indentation(self) -> NDArray[np.float64]:
        """Local indentation [m] at ``force``."""
        return self.share * self.approach


def consistent_law(static: StaticContact, modal_compliance: float) -> LocalLaw:
    """Local law that carries what the retained modes miss.

    A contact narrower than one element is that of single hats. Below the first state whose full
    width exceeds the element size, the ladder is therefore replaced by the power law that
    continues the curve with equal value and slope.

    Parameters
    ----------
    static
        Up to above the highest force of the impact.
    modal_compliance [m/N]
        c of the module text; 0 for rigid bodies, whose law is the whole approach.

    Raises
    ------
    OverfullModesError
        If the rest is not monotone.
    """
    require_nonnegative("consistent law: modal compliance", modal_compliance, "m/N")
    force, approach, first, exponent = _smooth_start(static)
    indentation = approach - force * modal_compliance
    rest = np.diff(indentation, prepend=0.0)
    tangent_share = rest / np.diff(approach, prepend=0.0)
    share = indentation / approach
    if np.any(tangent_share <= 0):
        worst = int(np.argmax(tangent_share <= 0))
        raise OverfullModesError(
            "consistent law",
            got=f"modes whose compliance exceeds the static one above {force[worst]:.4g} N "
            f"({modal_compliance:.4g} m/N against {approach[-1] / force[-1]:.4g} m/N at the end)",
            expected="a remaining indentation that increases with the force",
            hint="keep fewer modes, or use the port pattern at a higher force.",
        )
    lowest = float(min(share.min(), tangent_share.min()))
    if lowest < _FAIR_SHARE:
        warnings.warn(
            f"contact: only {floor(1000 * lowest) / 10:g} % of the static compliance is left to "
            f"the local law at its lowest point ({100 * _FAIR_SHARE:.0f} % or more is safe). "
            "Keep fewer modes; if another doubt requires more of them, use level interface.",
            AccuracyWarning,
            stacklevel=2,
        )
    return LocalLaw(
        law=TableLaw(indentation, force),
        force=force,
        approach=approach,
        share=share,
        tangent_share=tangent_share,
        modal_compliance=modal_compliance,
        resolved_force=float(force[first]),
        exponent=exponent,
    )


def _smooth_start(
    static: StaticContact,
) -> tuple[NDArray[np.float64], NDArray[np.float64], int, float]:
    """Ladder whose unresolved beginning is a power law, and where that ends."""
    force, approach = static.force, static.approach
    size = float(np.average(static.space.size, weights=static.pressures[-1]))
    resolved = 2.0 * static.half_width >= size
    first = int(np.argmax(resolved)) if np.any(resolved) else len(force) - 1
    if first == 0 or len(force) < 4:
        return force, approach, 0, float("nan")
    # slope over the neighbours of the first resolved state
    around = slice(first - 1, min(first + 3, len(force)))
    slope = np.polyfit(np.log(approach[around]), np.log(force[around]), 1)[0]
    exponent = float(np.clip(slope, *_POWERS))
    start = np.linspace(0.0, 1.0, max(first, 8) + 1)[1:-1] * approach[first]
    forces = force[first] * (start / approach[first]) ** exponent
    return (
        np.append(forces, force[first:]),
        np.append(start, approach[first:]),
        len(start),
        exponent,
    )
