"""Finite-element results of the lifting magnet, as published.

Source: Modelica Standard Library (BSD-3), commit b756f9d, Magnetic.FluxTubes, example
SolenoidActuator.ComparisonQuasiStatic: stationary finite elements at 12 V and 10 ohm (1.2 A); not a
measurement.  Only tests and checks read it.
"""

import numpy as np

__all__ = ["ARMATURE_FLUX", "CURRENT", "FORCE", "GAP", "INDUCTANCE"]

CURRENT = 1.2
"""[A]"""

_TABLE = np.array(
    [
        [0.25, -85.8619, 0.14821, 0.11954],
        [0.5, -59.9662, 0.13931, 0.11004],
        [0.75, -41.0806, 0.1277, 0.098942],
        [1.0, -28.88, 0.11587, 0.088425],
        [1.25, -21.4113, 0.10643, 0.08015],
        [1.5, -16.8003, 0.099406, 0.073992],
        [1.75, -13.6942, 0.093416, 0.068792],
        [2.0, -11.1188, 0.088564, 0.064492],
        [2.25, -9.6603, 0.084505, 0.060917],
        [2.5, -8.4835, 0.081215, 0.058017],
        [2.75, -7.4658, 0.077881, 0.055125],
        [3.0, -6.5591, 0.075197, 0.052733],
        [3.25, -5.9706, 0.072447, 0.05035],
        [3.5, -5.5013, 0.070342, 0.048525],
        [3.75, -5.0469, 0.068527, 0.046867],
        [4.0, -4.6573, 0.066526, 0.045158],
        [4.25, -4.2977, 0.064425, 0.043442],
        [4.5, -4.0912, 0.062747, 0.04205],
        [4.75, -3.7456, 0.061231, 0.040733],
        [5.0, -3.5869, 0.059691, 0.039467],
    ]
)

GAP = _TABLE[:, 0] * 1e-3
"""Working gap [m]."""

FORCE = _TABLE[:, 1]
"""Along the gap [N]."""

ARMATURE_FLUX = _TABLE[:, 2] * 1e-3
"""[Wb]"""

INDUCTANCE = _TABLE[:, 3]
"""Static, ``psi / i`` [H]."""
