r"""Force over time of an elastic Hertz impact, in closed form.

Energy gives the time at a depth :math:`\delta` below first touch (Johnson 1985, section 11.4):

.. math:: t = \frac{2 \delta_m}{5 v} B_u(2/5, 1/2), \qquad u = (\delta/\delta_m)^{5/2},

with the incomplete beta function, whose inverse gives :math:`F = F_m u^{3/5}`.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import betaincinv

__all__ = ["hertz_force"]


def hertz_force(time: ArrayLike, *, duration: float, peak: float) -> NDArray[np.float64]:
    """Force [N] at times [s] after first touch; zero before it and after ``duration`` [s]."""
    t = np.asarray(time, dtype=float)
    share = np.clip(np.minimum(t, duration - t) / (0.5 * duration), 0.0, 1.0)
    return np.asarray(peak * betaincinv(0.4, 0.5, share) ** 0.6)
