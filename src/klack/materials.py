"""Isotropic linear elastic materials."""

from dataclasses import dataclass
from math import sqrt

from klack.errors import InputError, require_positive

__all__ = ["Material"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """Isotropic linear elastic material.

    Parameters
    ----------
    name : str
    young : float [Pa]
        Young's modulus.
    poisson : float [-]
        Poisson's ratio, above -1 and below 0.5.
    density : float [kg/m^3]
    """

    name: str
    young: float
    poisson: float
    density: float

    def __post_init__(self) -> None:
        require_positive(f"material '{self.name}': young", self.young, "Pa")
        require_positive(f"material '{self.name}': density", self.density, "kg/m^3")
        if not -1.0 < self.poisson < 0.5:
            raise InputError(
                f"material '{self.name}': poisson",
                got=f"{self.poisson:g}",
                expected="a value between -1 and 0.5 (both excluded)",
                hint="metals lie between 0.25 and 0.35; 0.5 would be incompressible.",
            )

    @property
    def shear_modulus(self) -> float:
        """G = E / (2 (1 + nu)) [Pa]."""
        return self.young / (2.0 * (1.0 + self.poisson))

    @property
    def lame_lambda(self) -> float:
        """First Lame constant, E nu / ((1 + nu)(1 - 2 nu)) [Pa]."""
        nu = self.poisson
        return self.young * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))

    @property
    def bar_wave_speed(self) -> float:
        """Speed of longitudinal waves in a thin bar, sqrt(E / rho) [m/s]."""
        return sqrt(self.young / self.density)

    @property
    def plane_strain_modulus(self) -> float:
        """E / (1 - nu^2) [Pa]; two bodies in contact have 1/E* = sum of its inverses."""
        return self.young / (1.0 - self.poisson**2)
