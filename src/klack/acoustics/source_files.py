"""A source at its mounts as files for other programs, and read again.

``source.nc`` is netCDF 3, for klack, xarray, MATLAB and ``ncdump`` alike; complex numbers are two
variables.  Names stand in variables of characters: ``outputs`` and ``inputs`` are the freedoms of
the mobility, as in any file of responses, ``nodes`` the mounts of ``positions``.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import scipy

from klack.acoustics.interface import (
    Complexes,
    InterfacePoint,
    SourceAtMounts,
    freedoms_of,
)
from klack.acoustics.receivers.tables import netcdf3_arrays
from klack.arrays import Vector
from klack.errors import refuse_if

__all__ = ["read_source", "write_netcdf", "write_uff"]

_SPECTRA = ("free_velocity", "blocked_force", "mobility")


def read_source(path: Path) -> SourceAtMounts:
    """Read the ``source.nc`` of ``klack noise``.

    Raises
    ------
    InputError
        For another file.
    """
    held = netcdf3_arrays(path)
    wanted = {"frequency", "positions", "outputs", "nodes"}
    wanted |= {f"{name}_{part}" for name in _SPECTRA for part in ("real", "imag")}
    refuse_if(
        not wanted <= set(held),
        str(path),
        got=f"no {', '.join(sorted(wanted - set(held)))}",
        expected="a source written by klack noise",
        hint="give the source.nc of a case with noise.mounts.",
    )
    spectra = {name: held[f"{name}_real"] + 1j * held[f"{name}_imag"] for name in _SPECTRA}
    names = [str(name).rpartition(".") for name in held["outputs"]]
    return SourceAtMounts(
        frequency=held["frequency"],
        points=tuple(
            InterfacePoint(name=str(name), position=place)
            for name, place in zip(held["nodes"], held["positions"], strict=True)
        ),
        freedoms=tuple(freedoms_of(point, [direction])[0] for point, _, direction in names),
        **spectra,
    )


def write_netcdf(path: Path, source: SourceAtMounts, title: str) -> None:
    """Write a source as netCDF 3."""
    freedoms = [str(freedom) for freedom in source.freedoms]
    one, two = ("frequency", "output"), ("frequency", "output", "input")
    units = {
        "free_velocity": (one, "m/s/Hz, rotations 1/Hz"),
        "blocked_force": (one, "N/Hz, moments N m/Hz"),
        "mobility": (two, "m/(N s), 1/(N s), 1/(N m s)"),
    }
    with scipy.io.netcdf_file(path, "w") as file:
        setattr(file, "title", title)  # noqa: B010 - a netCDF attribute
        convention = "exp(+i omega t); amplitudes of the spectrum of one click"
        setattr(file, "convention", convention)  # noqa: B010
        file.createDimension("axis", 3)
        _names(file, "outputs", "output", freedoms)
        _names(file, "inputs", "input", freedoms)
        _names(file, "nodes", "point", [point.name for point in source.points])
        file.createDimension("frequency", source.frequency.size)

        def write(name: str, along: tuple[str, ...], values: np.ndarray, unit: str) -> None:
            variable = file.createVariable(name, "d", along)
            variable[:] = values
            setattr(variable, "units", unit)  # noqa: B010 - a netCDF attribute

        write("frequency", ("frequency",), source.frequency, "Hz")
        places = np.array([point.position for point in source.points])
        write("positions", ("point", "axis"), places, "m")
        for name, (along, unit) in units.items():
            values = getattr(source, name)
            write(f"{name}_real", along, values.real, unit)
            write(f"{name}_imag", along, values.imag, unit)


def _names(file: scipy.io.netcdf_file, name: str, dimension: str, words: Sequence[str]) -> None:
    """Write texts as a variable of characters, which xarray joins."""
    texts = np.array([word.encode() for word in words])
    letters = f"letters_{texts.dtype.itemsize}"
    for key, size in ((dimension, len(words)), (letters, texts.dtype.itemsize)):
        if key not in file.dimensions:
            file.createDimension(key, size)
    variable = file.createVariable(name, "c", (dimension, letters))
    variable[:] = texts.view("S1").reshape(len(words), -1)


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
