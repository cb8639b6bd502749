r"""Fluid from a file: properties on a grid of temperatures and pressures, checked and interpolated.

A text file with one row per temperature and pressure, its columns in any order::

    temperature [K], pressure [Pa], density [kg/m^3], bulk modulus [Pa], dynamic viscosity [Pa*s]
    293.15, 1e5, 749.7, 1.27e9, 1.49e-3
    293.15, 500e5, 779.2, 1.88e9, 2.7e-3

``sound speed`` may replace or join ``bulk modulus``; ``vapour pressure`` is optional.

Over pressure the *compressibility* ``1/K`` is a monotone cubic, and the density its exact integral
from the lowest pressure on:

.. math:: \ln\frac{\rho(p)}{\rho(p_1)} = \int_{p_1}^{p} \frac{dp}{K}

With an isentropic ``K`` (from the speed of sound) that is the isentrope from the lowest pressure,
as for all fluids of the library; the densities at higher pressures, of constant temperature, are
then a check.  Over temperature monotone cubics run through density, compressibility and the
logarithms of viscosity and vapour pressure.
"""

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import ArrayLike

from klack.arrays import Floats
from klack.errors import AccuracyWarning, InputError, refuse_if
from klack.hydraulics.fluid_definition import FluidDefinition, FluidState
from klack.hydraulics.liquid import (
    ATMOSPHERE,
    HIGHEST_PRESSURE,
    LiquidLaw,
    PressureRange,
    TabulatedLiquid,
)
from klack.units import (
    DENSITY,
    DYNAMIC_VISCOSITY,
    MODULUS,
    PRESSURE,
    SPEED,
    TEMPERATURE,
    QuantityError,
    parse_quantity,
)

__all__ = ["CompressedLiquid", "PropertyTable", "read_property_table"]

_COLUMNS = {
    "temperature": TEMPERATURE,
    "pressure": PRESSURE,
    "density": DENSITY,
    "bulk modulus": MODULUS,
    "sound speed": SPEED,
    "dynamic viscosity": DYNAMIC_VISCOSITY,
    "vapour pressure": PRESSURE,
}
_CELSIUS = ("degC", "°C")
_ZERO_CELSIUS = 273.15
_REQUIRED = ("temperature", "pressure", "density", "dynamic viscosity")
_LARGEST = 5_000_000  # bytes
_SAME = 0.01  # largest deviation of K from rho c^2
_STIFFER = (0.98, 1.4)  # isentropic over isothermal bulk modulus, of liquids 1.0 to 1.35
_EXPONENTIAL = 0.05  # deviation of the viscosity from one exponential that is not worth a word
_DEFAULT_VAPOUR = 10.0  # [Pa]
_BEYOND, _FAR = 1e-3, 1e-2  # of the bulk modulus, where its own rise is 1 % and 10 %
_MOLAR = 0.1 / 8.314462618  # [kg K/J]


@dataclass(frozen=True, slots=True, init=False, eq=False)
class CompressedLiquid:
    """Liquid from its density at one pressure and its bulk modulus over pressure.

    Parameters
    ----------
    name
        Of the file, for its range.
    pressure (n,) [Pa]
        Absolute, increasing; at least two.
    density [kg/m^3]
        At the lowest of these pressures.
    compressibility (n,) [1/Pa]
        Above zero.
    """

    name: str
    pressure: Floats
    density_at_lowest: float
    _fall: "scipy.interpolate.PchipInterpolator"
    _area: "scipy.interpolate.PchipInterpolator"

    def __init__(
        self, name: str, pressure: ArrayLike, density: float, compressibility: ArrayLike
    ) -> None:
        p = np.asarray(pressure, dtype=float)
        fall = scipy.interpolate.PchipInterpolator(p, np.asarray(compressibility, dtype=float))
        for key, value in (
            ("name", name), ("pressure", p), ("density_at_lowest", density), ("_fall", fall),
            ("_area", fall.antiderivative()),
        ):  # fmt: skip
            object.__setattr__(self, key, value)

    @property
    def kinks(self) -> tuple[float, ...]:
        """The pressures of the table [Pa]."""
        return tuple(float(p) for p in self.pressure)

    @property
    def pressure_range(self) -> PressureRange:
        """The table, and beyond as far as the missing rise of the bulk modulus is small."""
        low, high = float(self.pressure[0]), float(self.pressure[-1])
        first, last = (float(K) for K in self.bulk_modulus(self.pressure[[0, -1]]))
        return PressureRange(
            lowest=max(low - _BEYOND * first, 0.0),
            highest=min(high + _BEYOND * last, HIGHEST_PRESSURE),
            usable=min(high + 10.0 * _FAR * last, HIGHEST_PRESSURE),
            source=f"'{self.name}' covers {low / 1e5:.4g} to {high / 1e5:.4g} bar",
        )

    def bulk_modulus(self, pressure: ArrayLike) -> Floats:
        """``rho dp/drho`` [Pa] at the absolute pressure [Pa]; constant beyond the table."""
        p = np.clip(np.asarray(pressure, dtype=float), self.pressure[0], self.pressure[-1])
        return np.asarray(1.0 / self._fall(p))

    def density(self, pressure: ArrayLike) -> Floats:
        """Density [kg/m^3] at the absolute pressure [Pa]."""
        at = np.asarray(pressure, dtype=float)
        p = np.clip(at, self.pressure[0], self.pressure[-1])
        return np.asarray(self.density_at_lowest * np.exp(self._area(p) + self._fall(p) * (at - p)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PropertyTable:
    """Properties on a grid of temperatures and pressures.

    Parameters
    ----------
    name
    temperature (m,) [K]
        Increasing.
    pressure (n,) [Pa]
        Absolute, increasing.
    density, viscosity (m, n) [kg/m^3], [Pa s]
    bulk_modulus (m, n) [Pa]
        Isentropic; without it the slope of the density is the stiffness.
    vapour_pressure (m,) [Pa]
    """

    name: str
    temperature: Floats
    pressure: Floats
    density: Floats
    viscosity: Floats
    bulk_modulus: Floats | None = None
    vapour_pressure: Floats | None = None

    def at(self, temperature: float) -> FluidState:
        """Properties at a temperature [K]; the viscosity as one exponential over pressure.

        Warns if that is off by more than 5 % anywhere in the table.
        """
        viscosity = np.exp(self._between(np.log(self.viscosity), temperature))
        base, slope, error = _exponential(self.pressure, viscosity)
        if error > _EXPONENTIAL:
            warnings.warn(
                f"fluid table '{self.name}': its viscosity at {temperature - 273.15:.4g} degC is "
                f"up to {100.0 * error:.2g} % off the exponential that represents it from "
                f"{self.pressure[0] / 1e5:.4g} to {self.pressure[-1] / 1e5:.4g} bar.\n"
                "Try: a table that ends at the highest pressure of the valve.",
                AccuracyWarning,
                stacklevel=2,
            )
        boiling = _DEFAULT_VAPOUR
        if self.vapour_pressure is not None:
            columns = np.log(self.vapour_pressure)[:, None]
            boiling = float(np.exp(self._between(columns, temperature))[0])
        return FluidState(
            liquid=self._liquid(temperature),
            viscosity=base,
            pressure_viscosity=slope,
            vapour_pressure=boiling,
            vapour_density=boiling * _MOLAR / temperature,
        )

    def definition(self, name: str) -> FluidDefinition:
        """Fluid over the temperatures of the table."""
        return FluidDefinition(
            name=name,
            properties=self,
            lowest_temperature=float(self.temperature[0]),
            highest_temperature=float(self.temperature[-1]),
        )

    def _liquid(self, temperature: float) -> LiquidLaw:
        density = self._between(self.density, temperature)
        if self.bulk_modulus is None:
            return TabulatedLiquid(self.pressure, density)
        fall = self._between(1.0 / self.bulk_modulus, temperature)
        return CompressedLiquid(self.name, self.pressure, float(density[0]), fall)

    def _between(self, columns: Floats, temperature: float) -> Floats:
        if self.temperature.size == 1:
            return columns[0]
        inside = np.clip(temperature, self.temperature[0], self.temperature[-1])
        return np.asarray(
            scipy.interpolate.PchipInterpolator(self.temperature, columns, axis=0)(inside)
        )


def _exponential(pressure: Floats, viscosity: Floats) -> tuple[float, float, float]:
    """Viscosity at one atmosphere, its relative slope, and the largest deviation of both."""
    x, y = pressure - ATMOSPHERE, np.log(viscosity)
    slope, base = (float(c) for c in np.polyfit(x, y, 1))
    return float(np.exp(base)), slope, float(np.max(np.abs(np.expm1(base + slope * x - y))))


def read_property_table(path: Path) -> PropertyTable:
    """Read a table of properties, and reject what cannot be those of one liquid."""
    head, numbers = _read(path)
    value = dict(zip(head, numbers.T, strict=True))
    T, p = (np.unique(value[name]) for name in ("temperature", "pressure"))
    where = f"fluid table '{path.name}'"
    order = np.lexsort((value["pressure"], value["temperature"]))
    grid = np.stack([np.repeat(T, p.size), np.tile(p, T.size)])
    found = np.stack([value["temperature"][order], value["pressure"][order]])
    refuse_if(
        p.size < 2 or grid.shape != found.shape or not np.array_equal(grid, found),
        where,
        got=f"{len(numbers)} rows with {T.size} temperatures and {p.size} pressures",
        expected="every pressure once at every temperature, and at least two pressures",
        hint="add the missing rows and remove repeated ones.",
    )
    columns = {name: v[order].reshape(T.size, p.size) for name, v in value.items()}
    for name, column in columns.items():
        refuse_if(
            not np.all(column > 0.0),
            where,
            got=f"a {name} of {column.min():g} {_COLUMNS[name].unit}",
            expected="values above 0; pressures are absolute",
            hint="check the column and its unit.",
        )
    boiling = columns.get("vapour pressure")
    refuse_if(
        boiling is not None and np.any(np.ptp(boiling, axis=1) > 1e-3 * boiling[:, 0]),
        where,
        got="a vapour pressure that changes with pressure",
        expected="one value per temperature, repeated in its rows",
        hint="correct the column, or leave it out: 10 Pa is then assumed.",
    )
    rho = columns["density"]
    _require_rising(where, T, p, rho)
    return PropertyTable(
        name=path.name,
        temperature=T,
        pressure=p,
        density=rho,
        viscosity=columns["dynamic viscosity"],
        bulk_modulus=_stiffness(where, T, p, columns),
        vapour_pressure=None if boiling is None else boiling[:, 0],
    )


def _require_rising(where: str, T: Floats, p: Floats, rho: Floats) -> None:
    falls = np.argwhere(np.diff(rho, axis=1) <= 0.0)
    if falls.size:
        i, k = falls[0]
        raise InputError(
            where,
            got=f"a density of {rho[i, k + 1]:g} kg/m^3 at {p[k + 1] / 1e5:g} bar after "
            f"{rho[i, k]:g} kg/m^3 at {p[k] / 1e5:g} bar ({T[i] - 273.15:g} degC)",
            expected="densities that increase with pressure",
            hint="correct the row, or give the densities with more digits.",
        )


def _stiffness(where: str, T: Floats, p: Floats, columns: dict[str, Floats]) -> Floats | None:
    """Bulk modulus of the table, checked against sound speed and density."""
    K, rho = columns.get("bulk modulus"), columns["density"]
    if "sound speed" in columns:
        by_sound = rho * columns["sound speed"] ** 2
        if K is not None and np.max(np.abs(K / by_sound - 1.0)) > _SAME:
            raise InputError(
                where,
                got=f"a bulk modulus up to {100 * np.max(np.abs(K / by_sound - 1.0)):.2g} % off "
                "density times the square of the sound speed",
                expected=f"K = rho c^2 to {100 * _SAME:g} %",
                hint="give the isentropic bulk modulus, or leave that column out.",
            )
        K = by_sound
    if K is None:
        return None
    strain = scipy.interpolate.PchipInterpolator(p, 1.0 / K, axis=1).integrate(p[0], p[-1])
    ratio = np.log(rho[:, -1] / rho[:, 0]) / strain
    low, high = _STIFFER
    if not np.all((ratio > low) & (ratio < high)):
        i = int(np.argmax(np.abs(ratio - 1.0)))
        raise InputError(
            where,
            got=f"densities that rise {ratio[i]:.3g} times as much from {p[0] / 1e5:g} to "
            f"{p[-1] / 1e5:g} bar at {T[i] - 273.15:g} degC as the bulk modulus implies",
            expected=f"{low:g} to {high:g} times: the ratio of the specific heats of liquids",
            hint="check the units of the columns; densities refer to constant temperature.",
        )
    return np.asarray(K)


def _read(path: Path) -> tuple[list[str], Floats]:
    """Names of the columns and their numbers in SI, shape (rows, columns)."""
    where = f"fluid table '{path.name}'"
    size = path.stat().st_size
    refuse_if(
        size > _LARGEST,
        where,
        got=f"{size / 1e6:.3g} MB",
        expected=f"at most {_LARGEST / 1e6:g} MB",
        hint="about ten temperatures and pressures are enough; smooth curves are drawn "
        "through them.",
    )
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(
            where, got="bytes that are not text", expected="a text file (UTF-8)",
            hint="export the table as CSV.",
        ) from None  # fmt: skip
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if len(lines) < 2:
        raise InputError(
            where, got="no rows", expected="a header with units, and rows of numbers",
            hint="begin with e.g. temperature [degC], pressure [bar], density [kg/m^3], ...",
        )  # fmt: skip
    separator = ";" if ";" in lines[0][1] else ","
    names, factors = _head(where, lines[0][1].split(separator))
    rows = [_numbers(f"{where}:{n}", line.split(separator), names) for n, line in lines[1:]]
    offset, factor = np.array(factors).T
    values = offset + factor * np.array(rows)
    place = names.index("temperature")
    values[:, place] = np.round(values[:, place], 6)  # sums of degrees Celsius and 273.15
    return names, values


def _head(where: str, cells: list[str]) -> tuple[list[str], list[tuple[float, float]]]:
    """Names of the columns, and offset and factor of their units."""
    names, factors = [], []
    for cell in cells:
        name, _, unit = (part.strip(" ]\t\"'") for part in cell.partition("["))
        name = " ".join(name.lower().replace("_", " ").split())
        refuse_if(
            name not in _COLUMNS or name in names,
            where,
            got=f"the column '{cell.strip()}'" + (" twice" if name in names else ""),
            expected=f"each of: {', '.join(f'{c} [unit]' for c in _COLUMNS)}",
            hint=f"required are {', '.join(_REQUIRED)}; remove or rename others.",
        )
        names.append(name)
        if name == "temperature" and unit in _CELSIUS:
            factors.append((_ZERO_CELSIUS, 1.0))
            continue
        try:
            factors.append((0.0, parse_quantity(f"1 {unit}", _COLUMNS[name])))
        except QuantityError as error:
            raise InputError(
                where, got=f"the unit '{unit}' of {name}", expected=error.expected, hint=error.hint
            ) from None
    missing = [name for name in _REQUIRED if name not in names]
    if missing:
        raise InputError(
            where,
            got=f"no column {', '.join(missing)}",
            expected=f"the columns {', '.join(_REQUIRED)}",
            hint=f"add it to the header with its unit, e.g. '{missing[0]} "
            f"[{_COLUMNS[missing[0]].unit}]'.",
        )
    return names, factors


def _numbers(where: str, cells: list[str], names: list[str]) -> list[float]:
    try:
        row = [float(cell) for cell in cells]
    except ValueError:
        row = []
    refuse_if(
        len(row) != len(names) or not np.all(np.isfinite(row)),
        where,
        got=f"'{','.join(cells)[:60]}'",
        expected=f"{len(names)} finite numbers, one per column of the header",
        hint="use a decimal point; begin comments with #.",
    )
    return row
