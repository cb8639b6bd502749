r"""Eddy currents in solid iron as a ladder of flux paths with shorted turns.

A change of flux enters a solid core from its surface.  With ``tau = mu sigma a^2`` and ``z^2 = s
tau`` the mmf per flux of a core of static reluctance ``R`` is

.. math::

    \frac{\Theta}{R\varphi} = \frac{z\,I_0(z)}{2\,I_1(z)}
      = 1 + \cfrac{1}{\cfrac{8}{s\tau} + \cfrac{1}{3 + \cfrac{1}{\cfrac{16}{s\tau}
        + \cfrac{1}{5 + \dots}}}} \quad\text{(cylinder of radius a)}, \qquad
    \frac{\Theta}{R\varphi} = \frac z2 \coth\frac z2 \quad\text{(sheet of thickness a)} .

As continued fractions (Gauss) both are Cauer ladders: a shorted turn ``S_1``, beside it a
reluctance ``R_1`` in series with the next shorted turn ``S_2``, and so on:

========  =======================  ======================
core      ``S_k``                  ``R_k`` (k = 1, 2, ..)
========  =======================  ======================
cylinder  ``R tau/(8 k)``          ``(2 k + 1) R``
sheet     ``R tau/(4 (4 k - 1))``  ``(4 k + 1) R``
========  =======================  ======================

``R tau = sigma l/pi`` for the cylinder: the shorted turns do not depend on the permeability, so one
term needs none.  Error of ``|Theta/phi|`` of a cylinder at ``omega tau`` = 1, 10, 100: 1 term -0.5,
-7, +142 %; 2 terms 0.0, -0.2, -4.6 %; 3 terms 0.0, 0.0, -5.6 %; 4 terms 0.0, 0.0, 0.3 %.  The
ladder passes on the static flux exactly and dissipates ``S_k (dphi_k/dt)^2`` in each turn.

Limits: one differential permeability; iron that saturates from the surface inwards is followed in
its mean only.  Sources: Stoll, The Analysis of Eddy Currents, 1974; the coefficients were
rederived, and are checked against the exact step response.
"""

from dataclasses import dataclass
from math import pi
from typing import Literal

from klack.errors import refuse_if, require_positive
from klack.magnetics.iron import VACUUM_PERMEABILITY

__all__ = ["MOST_TERMS", "EddyLadder", "EddyShape", "cylinder_ladder", "sheet_ladder"]

MOST_TERMS = 4
"""Most terms of a ladder; each after the first is one more flux state."""

EddyShape = Literal["cylinder", "sheet"]


@dataclass(frozen=True, slots=True)
class EddyLadder:
    """Shorted turns and the reluctances between them.

    Parameters
    ----------
    conductances [S]
        ``S_1 .. S_n``, from the surface inwards.
    reluctances [A/Wb]
        ``R_1 .. R_{n-1}``.
    """

    conductances: tuple[float, ...]
    reluctances: tuple[float, ...]

    def mmf_per_flux(self, s: complex) -> complex:
        """Mmf per flux [A/Wb] at the complex frequency ``s`` [1/s], besides the static one."""
        value = s * self.conductances[-1]
        pairs = zip(self.conductances[-2::-1], self.reluctances[::-1], strict=True)
        for conductance, reluctance in pairs:
            inner = reluctance + value
            turn = s * conductance
            value = turn * inner / (turn + inner) if s else 0j
        return value


def cylinder_ladder(
    *, conductivity: float, length: float, radius: float, permeability: float, terms: int
) -> EddyLadder:
    """Ladder of a solid round core.

    Parameters
    ----------
    conductivity [S/m]
    length, radius [m]
    permeability [-]
        Relative, differential; only for more than one term.
    terms
        1 to 4.

    Examples
    --------
    One term is a shorted turn of 8 pi/(sigma l); 20 mm of ferritic steel:

    >>> core = dict(conductivity=1.6e6, length=20e-3, radius=2e-3)
    >>> ladder = cylinder_ladder(**core, permeability=1000.0, terms=1)
    >>> round(1e3 / ladder.conductances[0], 3)  # milliohm
    0.785
    """
    _check(conductivity, length, radius, permeability, terms)
    turn = conductivity * length / (8.0 * pi)
    R = length / (VACUUM_PERMEABILITY * permeability * pi * radius**2)
    return EddyLadder(
        tuple(turn / k for k in range(1, terms + 1)),
        tuple((2 * k + 1) * R for k in range(1, terms)),
    )


def sheet_ladder(
    *,
    conductivity: float,
    length: float,
    thickness: float,
    width: float,
    permeability: float,
    terms: int,
) -> EddyLadder:
    """Ladder of a sheet or a thin-walled tube, flux along it, entering from both faces.

    Parameters
    ----------
    conductivity [S/m]
    length, thickness, width [m]
        Along the flux, across, and along the face (circumference).
    permeability [-]
        Relative, differential; only for more than one term.
    terms
        1 to 4.
    """
    _check(conductivity, length, thickness, permeability, terms)
    require_positive("eddy ladder: width", width, "m")
    R = length / (VACUUM_PERMEABILITY * permeability * thickness * width)
    R_tau = conductivity * length * thickness / width
    return EddyLadder(
        tuple(R_tau / (4 * (4 * k - 1)) for k in range(1, terms + 1)),
        tuple((4 * k + 1) * R for k in range(1, terms)),
    )


def _check(
    conductivity: float, length: float, across: float, permeability: float, terms: int
) -> None:
    require_positive("eddy ladder: conductivity", conductivity, "S/m")
    require_positive("eddy ladder: length", length, "m")
    require_positive("eddy ladder: radius or thickness", across, "m")
    require_positive("eddy ladder: permeability", permeability, "-")
    refuse_if(
        terms not in range(1, MOST_TERMS + 1),
        "eddy ladder: terms",
        got=f"{terms}",
        expected=f"1 to {MOST_TERMS}",
        hint="use 1 for lift and timing, 3 or 4 for the first 50 us.",
    )
