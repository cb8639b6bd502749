"""Modal damping: a small viscous ratio for each mode, and what layers add to it.

Mode by mode, ``q'' + 2 zeta omega q' + omega^2 q = phi^T F``. Rigid modes (``omega = 0``) are
never damped: drag belongs to the fluid.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.bodies.elasticity.body import VibratingBody
from klack.bodies.elasticity.layer import layer_damping
from klack.errors import refuse_if, require_nonnegative

__all__ = ["Damping", "LossFactor", "ModalDamping", "RayleighDamping", "damping_ratios"]


@dataclass(frozen=True, kw_only=True, eq=False)
class ModalDamping:
    """Given damping ratios.

    Parameters
    ----------
    ratio, one or (m,) [-]
        Share of critical damping, for all elastic modes or for each.

    Examples
    --------
    >>> ModalDamping(ratio=0.001).ratios([0.0, 1e5, 2e5])
    array([0.   , 0.001, 0.001])
    """

    ratio: ArrayLike

    def __post_init__(self) -> None:
        lowest = np.min(np.asarray(self.ratio, dtype=float), initial=np.inf)
        require_nonnegative("ModalDamping.ratio", float(lowest), "-")

    def ratios(self, omega: ArrayLike) -> NDArray[np.float64]:
        """Damping ratios [-] of modes with ``omega`` (m,) [rad/s]."""
        omega = np.asarray(omega, dtype=float)
        ratio = np.asarray(self.ratio, dtype=float)
        elastic = omega > 0
        refuse_if(
            ratio.ndim and ratio.shape != (int(elastic.sum()),),
            "ModalDamping.ratio",
            got=f"{ratio.size} ratios",
            expected=f"one ratio, or one for each of the {int(elastic.sum())} elastic modes",
            hint="give a single number, or reduce again with that many modes.",
        )
        result = np.zeros(omega.shape)
        result[elastic] = ratio
        return result


@dataclass(frozen=True, kw_only=True)
class RayleighDamping:
    """Damping matrix ``alpha M + beta K``, hence ``zeta = alpha / (2 omega) + beta omega / 2``.

    High modes are damped in proportion to their frequency (``beta``), which measurements rarely
    show; prefer :class:`LossFactor` for a metal part.

    Parameters
    ----------
    alpha [1/s]
    beta [s]
    """

    alpha: float
    beta: float

    def __post_init__(self) -> None:
        require_nonnegative("RayleighDamping.alpha", self.alpha, "1/s")
        require_nonnegative("RayleighDamping.beta", self.beta, "s")

    def ratios(self, omega: ArrayLike) -> NDArray[np.float64]:
        """Damping ratios [-] of modes with ``omega`` (m,) [rad/s]."""
        omega = np.asarray(omega, dtype=float)
        safe = np.where(omega > 0, omega, 1.0)
        return np.where(omega > 0, self.alpha / (2 * safe) + self.beta * omega / 2, 0.0)


@dataclass(frozen=True, kw_only=True)
class LossFactor:
    """Loss factor of material and mounting, ``zeta = eta / 2``.

    Equal to the structural damping ``K (1 + i eta)`` at resonance.  Steel alone has 2e-5 to 3e-4
    (Cremer, Heckl, Petersson 2005); mounted parts 1e-3 to 1e-2, which is an assumption to declare.

    Parameters
    ----------
    eta [-]

    Examples
    --------
    >>> LossFactor(eta=0.002).ratios([0.0, 1e5])
    array([0.   , 0.001])
    """

    eta: float

    def __post_init__(self) -> None:
        require_nonnegative("LossFactor.eta", self.eta, "-")

    def ratios(self, omega: ArrayLike) -> NDArray[np.float64]:
        """Damping ratios [-] of modes with ``omega`` (m,) [rad/s]."""
        return np.where(np.asarray(omega, dtype=float) > 0, self.eta / 2, 0.0)


Damping = ModalDamping | RayleighDamping | LossFactor


def damping_ratios(
    damping: Damping, body: VibratingBody, omega: NDArray[np.float64], *shapes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Damping ratios [-] of modes of a body, those by its layers included.

    Parameters
    ----------
    omega (m,) [rad/s]
    shapes (n_dof, k)
        Of unit modal mass, m columns in all.
    """
    ratios = damping.ratios(omega)
    if not body.layers:
        return ratios
    ends = np.cumsum([0, *(part.shape[1] for part in shapes)])
    own = [
        layer_damping(body.layers, omega[a:b], part)
        for a, b, part in zip(ends, ends[1:], shapes, strict=False)
    ]
    return ratios + np.concatenate(own)
