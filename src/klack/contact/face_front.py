r"""Force with which faces meet all at once: the pressure of plane waves on the area that closes.

A face that meets another at the speed v sends a plane wave into either body,

.. math:: p = \frac{v}{1/z_a + 1/z_b}, \qquad z = \rho\, c_p = \sqrt{\rho\, M},

with the density and the modulus M of uniaxial strain (Graff, Wave Motion in Elastic Solids, 1975,
section 6.1), until waves from its edges arrive.  Points whose gaps differ by less than
:math:`v \tau` have all met within the time :math:`\tau`.  So the force rises by p times their area
in that time, whatever the bodies do elsewhere.
"""

from math import sqrt

import numpy as np

from klack.contact.mortar import ContactSpace
from klack.materials import Material

__all__ = ["area_at_once", "front_pressure"]


def area_at_once(space: ContactSpace, travel: float) -> float:
    """Area [m^2] that has met after a rigid travel [m] from first touch.

    Parameters
    ----------
    space : ContactSpace
    travel : float [m]
    """
    facing = space.axial > 1e-6
    height = space.gap[facing] / space.axial[facing]
    return float(space.area[facing][height <= np.min(height, initial=np.inf) + travel].sum())


def front_pressure(speed: float, material_a: Material, material_b: Material) -> float:
    """Pressure [Pa] of faces of these materials that meet at a speed [m/s].

    Examples
    --------
    >>> steel = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
    >>> f"{1e-6 * front_pressure(1.0, steel, steel):.1f} MPa"
    '23.6 MPa'
    """
    return speed / sum(1.0 / _impedance(one) for one in (material_a, material_b))


def _impedance(material: Material) -> float:
    """Pressure over speed of a plane wave [Pa s/m]."""
    return sqrt(material.density * (material.lame_lambda + 2.0 * material.shear_modulus))
