r"""Density, modulus and wave speed of a body, read off its matrices.

Under the uniform strain :math:`u = x\,e_x` a body of volume V stores
:math:`u^T K u = V (\lambda + 2\mu)`; the mass is :math:`\rho V`. Where only nodes are known, the
box around them bounds V from above, so density and modulus are lower bounds; the wave speed
:math:`c = \sqrt{u^T K u / m}` needs no volume.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from klack.errors import InputError
from klack.input.unit_systems import UNIT_SYSTEMS, UnitSystem
from klack.mesh.mesh import Mesh
from klack.mesh.quality import corner_volume

__all__ = ["MaterialEstimate", "estimate_material", "require_plausible_material"]

DENSITY = (100.0, 25e3)
"""Density of engineering materials [kg/m^3], from cork to iridium."""
MODULUS = (1e6, 1.5e12)
"""Modulus lambda + 2 mu [Pa], from foam to diamond."""
WAVE_SPEED = (50.0, 20e3)
"""Speed of pressure waves [m/s]."""
_LEAST_FILLING = 1e-3
_TYPICAL_DENSITY, _TYPICAL_SPEED = 5e3, 4e3


@dataclass(frozen=True, slots=True, kw_only=True)
class MaterialEstimate:
    """Mean material of a body.

    Parameters
    ----------
    density [kg/m^3]
    modulus [Pa]
        lambda + 2 mu.
    wave_speed [m/s]
    exact_volume
        False where the box around the nodes makes density and modulus lower bounds.
    """

    density: float
    modulus: float
    wave_speed: float
    exact_volume: bool

    @property
    def density_in_words(self) -> str:
        """Density with unit."""
        return f"{self._least}{self.density:.4g} kg/m^3"

    @property
    def modulus_in_words(self) -> str:
        """Modulus with unit."""
        return f"{self._least}{self.modulus / 1e9:.4g} GPa"

    @property
    def _least(self) -> str:
        return "" if self.exact_volume else "at least "

    @property
    def faults(self) -> tuple[str, ...]:
        """Properties outside those of any material, as text."""
        least = 1.0 if self.exact_volume else _LEAST_FILLING
        checks = (
            (self.density, DENSITY, least, f"a density of {self.density_in_words}", "kg/m^3"),
            (self.modulus, MODULUS, least, f"a modulus of {self.modulus_in_words}", "Pa"),
            (self.wave_speed, WAVE_SPEED, 1.0, f"a wave speed of {self.wave_speed:.4g} m/s", "m/s"),
        )
        return tuple(
            f"{words} (materials: {low:g} to {high:g} {unit})"
            for value, (low, high), share, words, unit in checks
            if not low * share <= value <= high
        )


def estimate_material(K: csr_array, mesh: Mesh, mass: float) -> MaterialEstimate:
    """Estimate the mean material of a body.

    Parameters
    ----------
    mesh
        Without blocks, the box around the nodes is taken for the volume.
    """
    d, x = mesh.dimension, mesh.points - mesh.points.mean(axis=0)
    energies = []
    for way in range(d) if d == 3 else (1,):
        u = np.zeros(mesh.dof_count)
        u[way::d] = x[:, way]
        energies.append(abs(float(u @ (K @ u))))
    energy = float(np.mean(energies))
    volume = abs(corner_volume(mesh)) if mesh.blocks else _box(mesh)
    return MaterialEstimate(
        density=mass / volume,
        modulus=energy / volume,
        wave_speed=float(np.sqrt(energy / abs(mass))) if mass else np.inf,
        exact_volume=bool(mesh.blocks),
    )


def _box(mesh: Mesh) -> float:
    """Volume of the box (or of the cylinder) around the nodes [m^3]."""
    size = np.ptp(mesh.points, axis=0)
    if mesh.dimension == 2:
        low, high = mesh.points[:, 0].min(), mesh.points[:, 0].max()
        return float(np.pi * (high**2 - low**2) * size[1])
    return float(np.prod(np.maximum(size, 1e-3 * size.max())))


def require_plausible_material(
    where: str, material: MaterialEstimate, units: UnitSystem | None
) -> None:
    """Reject matrices of no material, and name the units in which they would be of one."""
    faults = material.faults
    if not faults:
        return
    fitting = [] if units is None else _fitting(material, units)
    hint = (
        "check the units of the matrices, and the unit of the coordinates given with the "
        "mesh or the nodes."
    )
    if fitting:
        name, other = fitting[0]
        hint = (
            f"with units: {name} they would be {other.density_in_words} and "
            f"{other.modulus_in_words}."
        )
    used = f" in {units.name}" if units is not None else ""
    raise InputError(
        where,
        got=f"{' and '.join(faults)}{used}",
        expected="matrices of an engineering material",
        hint=hint,
    )


def _fitting(material: MaterialEstimate, units: UnitSystem) -> list[tuple[str, MaterialEstimate]]:
    """Unit systems in which the numbers belong to a material, the most usual one first.

    Only mass and stiffness scale: the coordinates have a unit of their own.
    """
    result = []
    for system in UNIT_SYSTEMS.values():
        mass, stiffness = system.mass / units.mass, system.stiffness / units.stiffness
        other = MaterialEstimate(
            density=material.density * mass,
            modulus=material.modulus * stiffness,
            wave_speed=material.wave_speed * float(np.sqrt(stiffness / mass)),
            exact_volume=material.exact_volume,
        )
        if not other.faults and system.name != units.name:
            off = abs(np.log(other.density / _TYPICAL_DENSITY))
            result.append(
                (off + abs(np.log(other.wave_speed / _TYPICAL_SPEED)), system.name, other)
            )
    return [(name, other) for _, name, other in sorted(result, key=lambda item: item[0])]
