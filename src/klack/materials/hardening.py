"""When a metal yields, and how it hardens: von Mises with linear hardening."""

from dataclasses import dataclass

import numpy as np

from klack.errors import refuse_if, require_positive

__all__ = [
    "HARDNESS_SPREAD",
    "LARGEST_YIELD",
    "Hardening",
    "vickers_of_rockwell",
    "yield_of_hardness",
]

LARGEST_YIELD = 1.0 / 50.0
"""Yield stress over Young's modulus up to which strains are small."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Hardening:
    """Yield stress, and how it rises with plastic strain.

    Rejects softening.

    Parameters
    ----------
    yield_stress [Pa]
        Y, in a tensile test.
    isotropic [Pa]
        Rise of the yield stress per equivalent plastic strain.
    kinematic [Pa]
        Shift of the yield surface per equivalent plastic strain (Prager): the same tensile test,
        an earlier yield when the load reverses (Bauschinger).
    """

    yield_stress: float
    isotropic: float = 0.0
    kinematic: float = 0.0

    def __post_init__(self) -> None:
        require_positive("yield stress", self.yield_stress, "Pa")
        for name in ("isotropic", "kinematic"):
            refuse_if(
                not getattr(self, name) >= 0.0,
                f"{name} hardening",
                got=f"{getattr(self, name):g} Pa",
                expected="0 Pa or more",
                hint="a metal that softens has no unique answer; 0 is perfectly plastic.",
            )

    @property
    def slope(self) -> float:
        """Rise of the tensile stress per plastic strain [Pa]."""
        return self.isotropic + self.kinematic


HARDNESS_SPREAD = (0.5, 1.15)
"""Lowest and highest yield stress over its estimate from a hardness.

Half: soft annealed steel, which hardens at once. 15 %: steel that hardens little (10 %) and scale
conversion (5 %).
"""

_ROCKWELL = np.array([20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 50.0, 55.0, 60.0, 65.0, 68.0])
_VICKERS = np.array([238.0, 266.0, 302.0, 345.0, 392.0, 446.0, 513.0, 595.0, 697.0, 832.0, 940.0])
_GRAVITY = 9.80665


def vickers_of_rockwell(hrc: float) -> float:
    """Vickers hardness of a Rockwell C hardness (ASTM E140, non-austenitic steels, 20 to 68).

    Conversions scatter by 5 % between steels.

    >>> vickers_of_rockwell(60.0)
    697.0
    """
    refuse_if(
        not _ROCKWELL[0] <= hrc <= _ROCKWELL[-1],
        "hardness: HRC",
        got=f"{hrc:g}",
        expected="20 to 68, where Rockwell C is defined",
        hint="give the hardness as HV.",
    )
    return float(np.interp(hrc, _ROCKWELL, _VICKERS))


def yield_of_hardness(vickers: float) -> float:
    """Yield stress [Pa] from a Vickers hardness: a third of it (Tabor 1951).

    Within 10 % for steels that harden little; of soft annealed ones the flow stress at 8 % strain,
    up to twice the yield stress.

    >>> round(yield_of_hardness(180.0) / 1e6)
    588
    """
    return _GRAVITY * 1e6 * vickers / 3.0
