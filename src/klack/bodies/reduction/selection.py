r"""Which elastic modes to keep.

A needle of D4 x L30 mm has 22 elastic modes below 300 kHz, only three of them longitudinal: the
lowest modes are seldom those that the contact feels. :class:`ByParticipation` ranks a pool by the
static compliance that each mode carries at the ports,

.. math:: p_i = \sum_p \frac{(\varphi_i^T b_p)^2}{\omega_i^2} \Big/
                \sum_j \frac{(\varphi_j^T b_p)^2}{\omega_j^2}

and keeps the largest. The effective mass of earthquake engineering, of a shaken base, has no
``1/omega^2``.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.errors import refuse_if, require_positive

__all__ = ["ByCount", "ByFrequency", "ByParticipation", "ModeSelection", "participation", "select"]


@dataclass(frozen=True, slots=True)
class ByCount:
    """The ``count`` lowest elastic modes."""

    count: int

    def __post_init__(self) -> None:
        _require_count("ByCount.count", self.count)


@dataclass(frozen=True, slots=True)
class ByFrequency:
    """All elastic modes up to ``maximum`` [Hz]."""

    maximum: float

    def __post_init__(self) -> None:
        require_positive("ByFrequency.maximum", self.maximum, "Hz")


@dataclass(frozen=True, slots=True)
class ByParticipation:
    """The ``count`` modes with most of the static compliance, of the ``pool`` lowest."""

    count: int
    pool: int

    def __post_init__(self) -> None:
        _require_count("ByParticipation.count", self.count)
        refuse_if(
            self.pool < self.count,
            "ByParticipation.pool",
            got=f"a pool of {self.pool} modes",
            expected=f"at least the {self.count} modes to keep",
            hint="a pool of three to five times the count is a good choice.",
        )


ModeSelection = ByCount | ByFrequency | ByParticipation


def participation(
    omega: NDArray[np.float64], port_shapes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Share of the pool's static compliance in each mode, summed over the ports, shape (m,).

    Parameters
    ----------
    omega (m,) [rad/s]
        Elastic only, above zero.
    port_shapes (m, n_ports) [1/sqrt(kg)]
        ``phi^T b`` of mass-normalised modes.

    Examples
    --------
    >>> participation(np.array([1.0, 2.0]), np.array([[1.0], [2.0]]))
    array([0.5, 0.5])
    """
    compliance = (port_shapes / omega[:, None]) ** 2
    total = compliance.sum(axis=0)
    return np.sum(compliance / np.where(total > 0, total, 1.0), axis=1)


def select(
    selection: ModeSelection, omega: NDArray[np.float64], port_shapes: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Numbers of the kept modes, ascending in frequency.

    Parameters
    ----------
    omega (m,) [rad/s]
        Ascending.
    port_shapes (m, n_ports) [1/sqrt(kg)]
    """
    if isinstance(selection, ByFrequency):
        return np.flatnonzero(omega <= 2.0 * np.pi * selection.maximum)
    needed = selection.pool if isinstance(selection, ByParticipation) else selection.count
    refuse_if(
        len(omega) < needed,
        f"mode selection {selection}",
        got=f"a pool of {len(omega)} computed modes",
        expected=f"at least {needed}",
        hint="compute more modes, or request fewer.",
    )
    if isinstance(selection, ByCount):
        return np.arange(selection.count)
    share = participation(omega[:needed], port_shapes[:needed])
    return np.sort(np.argsort(-share, kind="stable")[: selection.count])


def _require_count(where: str, count: int) -> None:
    refuse_if(
        count < 0, where, got=f"{count}", expected="0 or more modes", hint="give a whole number."
    )
