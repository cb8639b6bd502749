r"""Weights of a relaxation over a step in which its drive is constant.

For :math:`\dot f = k \dot s - f/\tau` with constant :math:`\dot s` and :math:`x = h/\tau`, exactly

.. math:: f_1 = f_0\,e^{-x} + k\,\Delta s\,\phi_1, \qquad
          \bar f = f_0\,\phi_1 + k\,\Delta s\,\phi_2, \qquad
          \phi_1 = (1 - e^{-x})/x, \quad \phi_2 = (1 - \phi_1)/x .

Stable at any step: for :math:`x \to \infty` the force follows its drive.
"""

from math import exp, expm1

from klack.machine.compiling.jit import inner

__all__ = ["relaxed"]

_FEW = 0.1  # below it 1 - phi_1 cancels: series


@inner(error_model="numpy")
def relaxed(x: float) -> tuple[float, float, float]:
    """Decay ``exp(-x)`` and the weights ``phi_1``, ``phi_2`` for ``x >= 0``."""
    if x < _FEW:
        phi2 = 1.0 / 2.0 - x / 6.0 * (
            1.0
            - x
            / 4.0
            * (
                1.0
                - x / 5.0 * (1.0 - x / 6.0 * (1.0 - x / 7.0 * (1.0 - x / 8.0 * (1.0 - x / 9.0))))
            )
        )
        phi1 = 1.0 - x * phi2
        return 1.0 - x * phi1, phi1, phi2
    phi1 = -expm1(-x) / x
    return exp(-x), phi1, (1.0 - phi1) / x
