r"""Highest pressure that faces bear before their set grows.

A contact point whose pressure reaches the limit yields, and its set *w* follows,

.. math:: 0 \le p \le p_\text{lim}(w), \qquad \dot w \ge 0, \qquad
    \dot w\, (p_\text{lim}(w) - p) = 0 ,

a bed of rigid-plastic springs that harden, in series with the elastic bodies. The limit is some
1.7 Y at first yield and rises to 2.3 to 3 Y where the plastic zone has reached the faces all over
(Johnson, Contact Mechanics, 1985, section 6.3): a constant one is right at one load only.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from klack.arrays import Floats
from klack.errors import refuse_if

__all__ = ["PressureLimit"]


@dataclass(frozen=True, kw_only=True, eq=False)
class PressureLimit:
    """Limit as straight lines between sets; the last line continues.

    Parameters
    ----------
    set (m,) [m]
        Increasing from 0, two at least.
    pressure (m,) [Pa]
        Increasing, above 0: else the set would not be unique.
    """

    set: Floats
    pressure: Floats

    def __post_init__(self) -> None:
        rises = np.all(np.diff(self.set) > 0.0) and np.all(np.diff(self.pressure) > 0.0)
        refuse_if(
            len(self.set) < 2 or self.set[0] != 0.0 or not rises or not self.pressure[0] > 0.0,
            "pressure limit",
            got=f"{len(self.set)} sets and pressures that do not both increase, from 0 and above 0",
            expected="at least two, both increasing",
            hint="give a hardening above 0.",
        )

    @property
    def deepest(self) -> float:
        """Set [m] up to which the limit is known."""
        return float(self.set[-1])

    @cached_property
    def softness(self) -> Floats:
        """Set per pressure [m/Pa] beyond each set, shape (m,)."""
        lines = np.diff(self.set) / np.diff(self.pressure)
        return np.append(lines, lines[-1])

    def loss(self, set: Floats) -> Floats:
        """Plastic work [J/m^2] up to a set [m], the integral of the limit."""
        between = np.diff(self.set) * (self.pressure[1:] + self.pressure[:-1]) / 2.0
        whole = np.concatenate([[0.0], np.cumsum(between)])
        line = np.clip(np.searchsorted(self.set, set, side="right") - 1, 0, len(self.set) - 1)
        beyond = set - self.set[line]
        rise = 0.5 * beyond / self.softness[line]
        return np.asarray(whole[line] + beyond * (self.pressure[line] + rise))
