"""From the forces on held bodies to the source at its mounts, and its files."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import scipy

from klack.acoustics.at_mounts import source_at_mounts, spectra_of_means
from klack.acoustics.interface import Complexes, InterfacePoint, SourceAtMounts
from klack.acoustics.source_levels import exposure
from klack.analyses.noise.reactions import HeldForces
from klack.analyses.noise.record import MountFreedom, MountSource, NoiseStudy
from klack.arrays import Vector
from klack.bodies.reduction.structure import Structure

__all__ = ["mount_source", "source_of", "write_sources"]

_HIGHEST = 20e3  # [Hz]
_APART, _PER_RECORD = 10.0, 8.0  # [Hz] between lines at most, and lines per inverse record
_MOST = 8000  # lines


def source_of(
    structures: Sequence[Structure], held: HeldForces
) -> Callable[[Vector, float], SourceAtMounts]:
    """The source at frequencies (k,) [Hz] at even distances, and a shift [1/s]."""
    used = [item for item in structures if item.at_mounts]
    parts = [part for item in used for part in item.at_mounts]
    places = {
        mount: place
        for part in parts
        for mount, place in zip(part.mounts, part.references, strict=True)
    }
    points = tuple(InterfacePoint(name=name, position=place) for name, place in places.items())

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
    return MountSource(
        frequency=frequency,
        freedoms=tuple(
            MountFreedom(
                name=str(freedom),
                position=position[freedom.point],
                free_velocity=source.free_velocity[:, i].copy(),
                blocked_force=source.blocked_force[:, i].copy(),
                velocity_bands=exposure(frequency, source.free_velocity[:, i], low=_lowest(apart)),
                force_bands=exposure(frequency, source.blocked_force[:, i], low=_lowest(apart)),
            )
            for i, freedom in enumerate(source.freedoms)
        ),
        mobility=source.mobility,
        mass=float(sum(item.mass for item in structures)),
        balance=held.unbalanced / max(held.largest, 1e-300),
    )


def _lowest(apart: float) -> float:
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


def write_netcdf(path: Path, source: SourceAtMounts, title: str) -> None:
    """Write a source as netCDF 3, complex numbers as two variables."""
    with scipy.io.netcdf_file(path, "w") as file:
        for key, text in (
            ("title", title),
            ("convention", "exp(+i omega t); amplitudes of the spectrum of one click"),
            ("freedoms", ", ".join(map(str, source.freedoms))),
            ("points", ", ".join(point.name for point in source.points)),
        ):
            setattr(file, key, text)
        for name, size in (
            ("frequency", source.frequency.size),
            ("freedom", len(source.freedoms)),
            ("point", len(source.points)),
            ("axis", 3),
        ):
            file.createDimension(name, size)
        out, across = ("frequency", "freedom"), ("frequency", "freedom", "freedom")
        arrays: list[tuple[str, np.ndarray, tuple[str, ...], str]] = [
            ("frequency", source.frequency, ("frequency",), "Hz"),
            (
                "position",
                np.array([point.position for point in source.points]),
                ("point", "axis"),
                "m",
            ),
        ]
        curves: tuple[tuple[str, Complexes, tuple[str, ...], str], ...] = (
            ("free_velocity", source.free_velocity, out, "m/s/Hz, rotations 1/Hz"),
            ("blocked_force", source.blocked_force, out, "N/Hz, moments N m/Hz"),
            ("mobility", source.mobility, across, "m/(N s), 1/(N s), 1/(N m s)"),
        )
        for what, values, dimensions, unit in curves:
            arrays += [
                (f"{what}_real", values.real, dimensions, unit),
                (f"{what}_imag", values.imag, dimensions, unit),
            ]
        for name, numbers, along, unit in arrays:
            variable = file.createVariable(name, "d", along)
            variable[:] = numbers
            setattr(variable, "units", unit)  # noqa: B010 - a netCDF attribute


_VELOCITY, _FORCE = (11, 0), (13, 0)  # kind of data of a universal file, exponent of length
_SPECTRUM, _RESPONSE = 12, 4


def write_uff(path: Path, source: SourceAtMounts, title: str) -> None:
    """Write a source as universal file: units (164), nodes (15), and functions (58)."""
    node = {point.name: k + 1 for k, point in enumerate(source.points)}
    text = [
        *("    -1", "   164", f"{1:10d}{'SI: m, N, kg, s':<20}{2:10d}"),
        *("  1.0000000000000000D+00  1.0000000000000000D+00  1.0000000000000000D+00",),
        *("  2.7314999999999998D+02", "    -1", "    -1", "    15"),
        *(
            f"{node[point.name]:10d}{0:10d}{0:10d}{0:10d}"
            + "".join(f"{x:13.5E}" for x in point.position)
            for point in source.points
        ),
        "    -1",
    ]
    places = [(node[freedom.point], freedom.direction) for freedom in source.freedoms]
    for i, place in enumerate(places):
        label = f"{title}: {source.freedoms[i]}"
        text += _function(
            label, _SPECTRUM, place, (0, 0), source.frequency, source.free_velocity[:, i]
        )
        text += _function(
            label,
            _SPECTRUM,
            place,
            (0, 0),
            source.frequency,
            source.blocked_force[:, i],
            force=True,
        )
        for j, other in enumerate(places):
            text += _function(
                label, _RESPONSE, place, other, source.frequency, source.mobility[:, i, j]
            )
    path.write_text("\n".join(text) + "\n", encoding="ascii", errors="replace")


def _function(
    label: str,
    kind: int,
    output: tuple[int, int],
    reference: tuple[int, int],
    frequency: Vector,
    values: Complexes,
    *,
    force: bool = False,
) -> list[str]:
    """Lines of a set 58, complex and double, at even distances."""
    what = "blocked force" if force else "free velocity" if kind == _SPECTRUM else "mobility"
    ordinate = _FORCE if force else _VELOCITY
    below = _FORCE if kind == _RESPONSE else (0, 0)
    apart = float(frequency[1] - frequency[0])
    numbers = np.stack([values.real, values.imag], axis=1).ravel()
    rows = ["".join(f"{x:20.11E}" for x in numbers[k : k + 4]) for k in range(0, numbers.size, 4)]
    words = {11: ("Velocity", "m/s"), 13: ("Force", "N"), 0: ("NONE", "NONE")}
    return [
        "    -1",
        "    58",
        f"{what} {label}"[:80],
        "NONE",
        "NONE",
        "NONE",
        "NONE",
        f"{kind:5d}{0:10d}{1:5d}{0:10d} {'NONE':<10}{output[0]:10d}{output[1]:4d}"
        f" {'NONE':<10}{reference[0]:10d}{reference[1]:4d}",
        f"{6:10d}{frequency.size:10d}{1:10d}{frequency[0]:13.5E}{apart:13.5E}{0.0:13.5E}",
        f"{18:10d}{0:5d}{0:5d}{0:5d} {'Frequency':<20} {'Hz':<20}",
        *(
            f"{code:10d}{0:5d}{0:5d}{0:5d} {words[code][0]:<20} {words[code][1]:<20}"
            for code, _ in (ordinate, below, (0, 0))
        ),
        *rows,
        "    -1",
    ]
