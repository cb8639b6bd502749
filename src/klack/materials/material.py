"""Isotropic materials: linear elastic, and when they yield."""

from dataclasses import dataclass
from math import sqrt

from klack.errors import InputError, refuse_if, require_positive
from klack.materials.hardening import LARGEST_YIELD, Hardening

__all__ = ["Material"]

_SLOWEST, _FASTEST = 800.0, 20e3  # [m/s]: lead has 1190, diamond 17 300
_DENSE = 3000.0  # [kg/m^3]; lighter solids, rubber and polymers, may be slower


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """Isotropic linear elastic material; whether it yields is up to the analysis.

    Parameters
    ----------
    poisson [-]
        Above -1 and below 0.5.
    density [kg/m^3]
    hardening
        Without it elastic at any stress.
    """

    name: str
    young: float
    poisson: float
    density: float
    hardening: Hardening | None = None

    def __post_init__(self) -> None:
        require_positive(f"material '{self.name}': young", self.young, "Pa")
        require_positive(f"material '{self.name}': density", self.density, "kg/m^3")
        refuse_if(
            not -1.0 < self.poisson < 0.5,
            f"material '{self.name}': poisson",
            got=f"{self.poisson:g}",
            expected="a value between -1 and 0.5 (both excluded)",
            hint="metals lie between 0.25 and 0.35; 0.5 would be incompressible.",
        )

        limit = LARGEST_YIELD * self.young
        if self.hardening is not None and self.hardening.yield_stress > limit:
            raise InputError(
                f"material '{self.name}': yield",
                got=f"{self.hardening.yield_stress / 1e6:.4g} MPa",
                expected=f"at most a fiftieth of Young's modulus, {limit / 1e6:.4g} MPa",
                hint="check the unit; hardened steel has 2000 MPa.",
            )

    @property
    def shear_modulus(self) -> float:
        """G = E / (2 (1 + nu)) [Pa]."""
        return self.young / (2.0 * (1.0 + self.poisson))

    @property
    def lame_lambda(self) -> float:
        """E nu / ((1 + nu)(1 - 2 nu)) [Pa]."""
        nu = self.poisson
        return self.young * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))

    @property
    def bar_wave_speed(self) -> float:
        """Longitudinal waves in a thin bar, sqrt(E / rho) [m/s]."""
        return sqrt(self.young / self.density)

    @property
    def question(self) -> str | None:
        """Question about a combination that no solid has; else ``None``.

        Bar waves run at 5170 m/s in steel, 1190 in lead, 17 300 in diamond; a modulus in MPa
        instead of GPa makes them 30 times slower. Solids below 3000 kg/m^3 may be rubber.

        >>> Material(name="steel", young=2.1e11, poisson=0.3, density=7850.0).question
        >>> Material(name="steel", young=2.1e8, poisson=0.3, density=7850.0).question[:57]
        "material 'steel': a Young's modulus of 0.21 GPa at 7850 k"
        """
        speed = self.bar_wave_speed
        if speed <= _FASTEST and (speed >= _SLOWEST or self.density < _DENSE):
            return None
        return (
            f"material '{self.name}': a Young's modulus of {self.young / 1e9:.4g} GPa at "
            f"{self.density:.4g} kg/m^3 would carry waves at {speed:.3g} m/s (steel 5170, lead "
            "1190, diamond 17300). Try: check both units; steel has 210 GPa and 7850 kg/m^3."
        )

    @property
    def plane_strain_modulus(self) -> float:
        """E / (1 - nu^2) [Pa]; in a contact 1/E* is the sum of both inverses."""
        return self.young / (1.0 - self.poisson**2)
