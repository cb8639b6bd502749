"""The air that a valve radiates into."""

from dataclasses import dataclass

from klack.errors import require_positive

__all__ = ["Air"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Air:
    """Still air; the numbers given are those at 20 degC and 1013 hPa.

    Parameters
    ----------
    density : float [kg/m^3]
    sound_speed : float [m/s]
    """

    density: float = 1.204
    sound_speed: float = 343.2

    def __post_init__(self) -> None:
        require_positive("Air.density", self.density, "kg/m^3")
        require_positive("Air.sound_speed", self.sound_speed, "m/s")

    @property
    def impedance(self) -> float:
        """Characteristic impedance ``rho c`` [Pa s/m]."""
        return self.density * self.sound_speed
