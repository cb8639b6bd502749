r"""Stress of a metal that yields: von Mises plasticity by the return along the radius.

With the deviator of the stress tried elastically, :math:`\xi = s^{tr} - \alpha`, and
:math:`q = \sqrt{3/2}\,|\xi|`, a point yields where :math:`q > Y + H_i \bar\varepsilon`,

.. math::
    \Delta\bar\varepsilon = \frac{q - Y - H_i \bar\varepsilon}{3 G + H_i + H_k}, \qquad
    \Delta\varepsilon_p = \sqrt{3/2}\,\Delta\bar\varepsilon\, n, \quad n = \xi/|\xi|, \qquad
    \Delta\alpha = \tfrac23 H_k \Delta\varepsilon_p .

The step is implicit (backward Euler). What yielding consistently takes off the elastic stiffness,

.. math::
    D - D_{ep} = 2 G\,[(1 - \theta)\, P + \bar\theta\, n \otimes n], \quad
    \theta = 1 - \frac{3 G \Delta\bar\varepsilon}{q}, \quad
    \bar\theta = \frac{3 G}{3 G + H_i + H_k} - (1 - \theta) ,

with the deviatoric projection P (Simo & Hughes, Computational Inelasticity, 1998, sections 3.3 and
3.4), is symmetric and positive semi-definite.

Tensors of a body of revolution are rows (rr, zz, tt, rz) with the *tensor* shear: their product
counts rz twice. A stiffness maps strains with the *engineering* shear to such rows.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from klack.arrays import Floats, Ints
from klack.materials.hardening import Hardening

__all__ = ["PlasticState", "Returned", "radial_return", "von_mises_of_strain"]


_ON_SURFACE = 1e-6  # of the yield stress
_TWICE = np.array([1.0, 1.0, 1.0, 2.0])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlasticState:
    """What has yielded, at n points.

    Parameters
    ----------
    strain (n, 4) [-]
        (rr, zz, tt, rz), without change of volume.
    equivalent (n,) [-]
        Never falls.
    """

    strain: Floats
    equivalent: Floats

    @classmethod
    def none(cls, count: int) -> Self:
        """Points that have never yielded."""
        return cls(strain=np.zeros((count, 4)), equivalent=np.zeros(count))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Returned:
    """Points after a step of strain.

    Parameters
    ----------
    taken (m, 4, 4) [Pa]
        Elastic less elastic-plastic stiffness of the yielding points.
    yielding (m,)
    work (n,) [J/m^3]
        Plastic work of the step, without what kinematic hardening stores; never negative.
    """

    state: PlasticState
    taken: Floats
    yielding: Ints
    work: Floats


def _deviator(strain: Floats) -> Floats:
    change = strain[:, :3].sum(axis=1, keepdims=True) / 3.0
    return np.asarray(strain - np.array([1.0, 1.0, 1.0, 0.0]) * change)


def von_mises_of_strain(strain: Floats, shear_modulus: float) -> Floats:
    """Von Mises stress [Pa] of an elastic strain, shape (n,) of (n, 4)."""
    return np.asarray(np.sqrt(6.0) * shear_modulus * np.sqrt(_deviator(strain) ** 2 @ _TWICE))


def radial_return(
    strain: Floats,
    before: PlasticState,
    hardening: Hardening,
    shear_modulus: float,
    *,
    loading: bool = False,
) -> Returned:
    """Plastic strain after a step.

    Parameters
    ----------
    strain (n, 4) [-]
        Whole strain at the end.
    before
        At the beginning.
    shear_modulus [Pa]
    loading
        Points on the yield surface count as yielding: the tangent of a step of further loading,
        before anything of it is known.
    """
    G, H_i, H_k = shear_modulus, hardening.isotropic, hardening.kinematic
    xi = 2.0 * G * _deviator(strain - before.strain) - (2.0 / 3.0) * H_k * before.strain
    size = np.sqrt(xi**2 @ _TWICE)
    q = np.sqrt(1.5) * size
    limit = hardening.yield_stress + H_i * before.equivalent
    beyond = q - limit
    tolerance = _ON_SURFACE * hardening.yield_stress if loading else 0.0
    yielding = np.flatnonzero(beyond > -tolerance)
    more = np.maximum(beyond[yielding], 0.0) / (3.0 * G + hardening.slope)
    n = xi[yielding] / size[yielding, None]
    added = np.sqrt(1.5) * more[:, None] * n
    plastic, equivalent = before.strain.copy(), before.equivalent.copy()
    plastic[yielding] += added
    equivalent[yielding] += more
    shrunk = 3.0 * G * more / q[yielding]
    along = 3.0 * G / (3.0 * G + hardening.slope) - shrunk
    projection = np.diag([1.0, 1.0, 1.0, 0.5])
    projection[:3, :3] -= 1.0 / 3.0
    taken = (
        2.0
        * G
        * (
            shrunk[:, None, None] * projection
            + along[:, None, None] * n[:, :, None] * n[:, None, :]
        )
    )
    work = np.zeros(len(strain))
    work[yielding] = (limit[yielding] + 0.5 * H_i * more) * more
    return Returned(
        state=PlasticState(strain=plastic, equivalent=equivalent),
        taken=taken,
        yielding=yielding,
        work=work,
    )
