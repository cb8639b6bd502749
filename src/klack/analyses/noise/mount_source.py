"""From the forces on held bodies to the source at its mounts, and its files."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from klack.acoustics.at_mounts import points_of, source_at_mounts, spectra_of_means
from klack.acoustics.interface import Complexes, SourceAtMounts
from klack.acoustics.source_files import write_netcdf, write_uff
from klack.acoustics.source_levels import exposure, single_equivalents
from klack.analyses.noise.reactions import HeldForces
from klack.analyses.noise.record import MountFreedom, MountSource, NoiseStudy
from klack.arrays import Vector
from klack.bodies.reduction.structure import Structure
from klack.errors import InputError

__all__ = ["lowest_band", "mount_source", "source_of", "write_sources"]

_HIGHEST = 20e3  # [Hz]
_APART, _PER_RECORD = 10.0, 8.0  # [Hz] between lines at most, and lines per inverse record
_MOST = 8000  # lines


def source_of(
    structures: Sequence[Structure], held: HeldForces
) -> Callable[[Vector, float], SourceAtMounts]:
    """The source at frequencies (k,) [Hz] at even distances, and a shift [1/s]."""
    used = [item for item in structures if item.at_mounts]
    parts = [part for item in used for part in item.at_mounts]
    points = points_of(parts)

    def at(frequency: Vector, shift: float = 0.0) -> SourceAtMounts:
        forces: list[Complexes] = []
        for item in used:
            values, ends = held.forces[item.name], held.ends[item.name]
            forces.append(spectra_of_means(held.step, values, ends, frequency, shift))
            forces += [np.zeros((frequency.size, 0), dtype=complex)] * (len(item.at_mounts) - 1)
        return source_at_mounts(parts, forces, points, frequency, shift=shift)

    return at


def mount_source(structures: Sequence[Structure], held: HeldForces) -> MountSource:
    """Source up to 20 kHz, or a tenth of the rate of records."""
    length = held.step * next(iter(held.forces.values())).shape[0]
    top = min(_HIGHEST, 0.1 / held.step)
    apart = max(min(_APART, 1.0 / (_PER_RECORD * length)), top / _MOST)
    frequency = apart * np.arange(1, int(top / apart + 1e-9) + 1)
    source = source_of(structures, held)(frequency, 0.0)
    position = {point.name: point.position for point in source.points}
    lowest = max(apart, 15.0)
    try:
        plates = single_equivalents(source)
        numbers = [
            float(exposure(frequency, values, low=lowest).energy.sum())
            for values in (plates.force, plates.velocity)
        ]
    except InputError:
        numbers = [float("nan")] * 2
    return MountSource(
        frequency=frequency,
        freedoms=tuple(
            MountFreedom(
                name=str(freedom),
                position=position[freedom.point],
                free_velocity=source.free_velocity[:, i].copy(),
                blocked_force=source.blocked_force[:, i].copy(),
                velocity_bands=exposure(
                    frequency, source.free_velocity[:, i], low=lowest_band(apart)
                ),
                force_bands=exposure(frequency, source.blocked_force[:, i], low=lowest_band(apart)),
            )
            for i, freedom in enumerate(source.freedoms)
        ),
        mobility=source.mobility,
        mass=float(sum(item.mass for item in structures)),
        balance=held.unbalanced / max(held.largest, 1e-300),
        repaid=held.repaid / max(held.largest, 1e-300),
        entering=held.entering,
        equivalent_force=numbers[0],
        equivalent_velocity=numbers[1],
    )


def lowest_band(apart: float) -> float:
    """Where third octaves begin [Hz]."""
    return max(apart, 15.0)


# --------------------------------------------------------------------------- files


def write_sources(study: NoiseStudy, folder: Path) -> tuple[str, ...]:
    """Write ``source.nc`` and ``source.uff`` of each design that has mounts; return the names."""
    found = [design for design in study.designs if design.at_mounts is not None]
    names = []
    for k, design in enumerate(found):
        assert design.at_mounts is not None
        word = "source" if len(found) == 1 else f"source-{k + 1}"
        write_netcdf(folder / f"{word}.nc", design.at_mounts.source(), design.label)
        write_uff(folder / f"{word}.uff", design.at_mounts.source(), design.label)
        names += [f"{word}.nc", f"{word}.uff"]
    return tuple(names)
