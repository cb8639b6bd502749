"""Fluids by name: every constant with its source, and whether that source was read.

They are no certificates: standards for test oils, diesel and brake fluids allow bands, and two
barrels of one name differ by more than the digits given here.
"""

from collections.abc import Callable, Mapping
from typing import Any

from klack.hydraulics.fluid_definition import (
    FluidDefinition,
    MeasuredProperties,
    MineralOil,
    TaitOil,
)
from klack.hydraulics.liquid import PressureRange
from klack.materials.sourced import Constant, entry_named, require_entry

__all__ = ["FLUIDS", "find_fluid", "library_fluid"]

_STEP = 20.0  # [K] between the columns of the pure fluids
_READ_AT = 5e5  # [Pa]

_GENERIC_OIL = "OpenHydraulics (Modelica), GenericOil.mo: 'approximately an ISO VG 46 oil'"
_GUIDE = "usual value of this class of fluids, not traced to a measurement"
_ISENTROPE = "bulk modulus within 10 % of the equation of state along the isentrope"
_LIKE_ALKANES = "n-decane and n-dodecane at the same share of the bulk modulus, within 10 %"
_BARUS = "above it the viscosity of Barus is too steep"
_FITTED = "Walther line through the two viscosities of the grade"

_FUEL_PRESSURES = PressureRange(highest=2000e5, source=_LIKE_ALKANES)
_PETROL_PRESSURES = PressureRange(highest=500e5, source="n-heptane, along isentropes")
_OIL_PRESSURES = PressureRange(highest=1000e5, source=_BARUS)

# column of MeasuredProperties: label, unit
_COLUMNS = {
    "density": ("density at 5 bar over temperature", "kg/m^3"),
    "bulk_modulus": ("bulk modulus, isentropic, at 5 bar over temperature", "Pa"),
    "bulk_modulus_slope": ("its slope over pressure, least squares from 5 to 350 bar", "-"),
    "viscosity": ("dynamic viscosity at 5 bar over temperature", "Pa s"),
    "pressure_viscosity": ("slope of ln viscosity, least squares from 5 to 350 bar", "1/Pa"),
    "vapour_pressure": ("vapour pressure over temperature", "Pa"),
}

# field of MineralOil and TaitOil: label, unit
_OIL = {
    "density": ("density at 15 degC", "kg/m^3"),
    "expansion": ("thermal expansion", "1/K"),
    "bulk_modulus": ("bulk modulus, isentropic, at 20 degC and 1 atm", "Pa"),
    "bulk_modulus_slope": ("its slope over pressure", "-"),
    "softening": ("its relative fall with temperature", "1/K"),
    "walther_a": ("Walther's A", "-"),
    "walther_b": ("Walther's B", "-"),
    "pressure_viscosity": ("slope of ln viscosity over pressure", "1/Pa"),
    "vapour_pressure": ("vapour pressure", "Pa"),
    "molar_mass": ("mean molar mass", "kg/mol"),
}

_VOLATILE = {
    **_OIL,
    "vapour_pressure": ("vapour pressure at 20 degC", "Pa"),
    "boiling": ("heat of vaporisation over the gas constant", "K"),
}

_TAIT = {
    **_OIL,
    "density": ("density at 0 degC and zero pressure", "kg/m^3"),
    "bulk_modulus": ("bulk modulus, ISOTHERMAL, at zero pressure and 0 K", "Pa"),
}

Source = tuple[float, str, bool]  # value, source, verified


def _measured(
    name: str,
    source: str,
    molar_mass: float,
    temperature: tuple[float, ...],
    highest_pressure: tuple[float, ...],
    **columns: tuple[float, ...],
) -> FluidDefinition:
    constants = [
        Constant(label=label, value=columns[key], unit=unit, source=source, verified=True)
        for key, (label, unit) in _COLUMNS.items()
    ]
    mass = Constant(
        label="molar mass",
        value=molar_mass,
        unit="kg/mol",
        source="sum of the standard atomic weights (IUPAC 2021)",
        verified=True,
    )
    return FluidDefinition(
        name=name,
        properties=MeasuredProperties(
            pressure=_READ_AT,
            molar_mass=molar_mass,
            temperature=temperature,
            highest_pressure=highest_pressure,
            range_source=_ISENTROPE,
            **columns,
        ),
        constants=(*constants, mass),
        lowest_temperature=temperature[0],
        highest_temperature=temperature[-1],
    )


def _every_step(lowest: float, *, first: float | None = None) -> tuple[float, ...]:
    """Temperatures [K] up to 140 degC, from a freezing point on where it is off the steps."""
    steps = range(round((413.15 - lowest) / _STEP) + 1)
    return (*(() if first is None else (first,)), *(lowest + _STEP * k for k in steps))


def _bar(*pressures: float) -> tuple[float, ...]:
    return tuple(1e5 * pressure for pressure in pressures)


def _from_constants(
    name: str,
    build: Callable[..., Any],
    labels: Mapping[str, tuple[str, str]],
    lowest: float,
    highest: float,
    pressures: PressureRange,
    **constants: Source,
) -> FluidDefinition:
    return FluidDefinition(
        name=name,
        properties=build(**{key: value for key, (value, _, _) in constants.items()}),
        constants=tuple(
            Constant(label=label, value=value, unit=unit, source=source, verified=verified)
            for key, (label, unit) in labels.items()
            for value, source, verified in [constants[key]]
        ),
        lowest_temperature=lowest,
        highest_temperature=highest,
        pressure_range=pressures,
    )


HEPTANE = _measured(
    "n-heptane",
    "CoolProp 8.0.0: Span and Wagner, Int. J. Thermophys. 24 (2003) 41; viscosity Michailidou "
    "et al., J. Phys. Chem. Ref. Data 43 (2014)",
    0.100202,
    _every_step(233.15),
    _bar(1050, 950, 860, 780, 710, 640, 570, 510, 450, 400),
    density=(
        733.877,
        717.383,
        700.862,
        684.196,
        667.261,
        649.925,
        632.032,
        613.385,
        593.725,
        572.679,
    ),
    bulk_modulus=(
        1.4723e9,
        1.2592e9,
        1.0725e9,
        9.0843e8,
        7.6385e8,
        6.3631e8,
        5.2372e8,
        4.2431e8,
        3.366e8,
        2.5936e8,
    ),
    bulk_modulus_slope=(
        12.285,
        12.165,
        12.055,
        11.945,
        11.844,
        11.752,
        11.665,
        11.583,
        11.505,
        11.429,
    ),
    viscosity=(
        0.00096246,
        0.00069153,
        0.00052504,
        0.00041392,
        0.0003352,
        0.00027683,
        0.00023192,
        0.00019629,
        0.00016726,
        0.00014299,
    ),
    pressure_viscosity=(
        9.743e-9,
        9.498e-9,
        9.482e-9,
        9.638e-9,
        9.941e-9,
        1.038e-8,
        1.098e-8,
        1.174e-8,
        1.27e-8,
        1.392e-8,
    ),
    vapour_pressure=(
        77.0049,
        394.204,
        1522.26,
        4722.16,
        12326.4,
        28039.2,
        57090.1,
        106229.0,
        183605.0,
        298607.0,
    ),
)

DECANE = _measured(
    "n-decane",
    "CoolProp 8.0.0: Lemmon and Span, J. Chem. Eng. Data 51 (2006); viscosity Huber et al., Fluid "
    "Phase Equilib. 224 (2004)",
    0.142282,
    _every_step(253.15),
    _bar(1140, 1080, 1010, 950, 880, 810, 750, 690, 630),
    density=(761.905, 746.254, 730.724, 715.222, 699.659, 683.947, 667.995, 651.699, 634.940),
    bulk_modulus=(
        1.5509e9,
        1.3377e9,
        1.1527e9,
        9.9123e8,
        8.4955e8,
        7.2475e8,
        6.1446e8,
        5.1678e8,
        4.3013e8,
    ),
    bulk_modulus_slope=(12.779, 12.572, 12.386, 12.218, 12.068, 11.931, 11.810, 11.696, 11.592),
    viscosity=(
        0.0019314,
        0.0012809,
        0.00091791,
        0.00069394,
        0.00054548,
        0.00044151,
        0.0003654,
        0.00030759,
        0.00026226,
    ),
    pressure_viscosity=(
        1.221e-8,
        1.135e-8,
        1.095e-8,
        1.078e-8,
        1.077e-8,
        1.087e-8,
        1.109e-8,
        1.141e-8,
        1.184e-8,
    ),
    vapour_pressure=(
        3.98962,
        26.319,
        127.801,
        486.708,
        1524.76,
        4076.32,
        9570.06,
        20184.0,
        38943.7,
    ),
)

DODECANE = _measured(
    "n-dodecane",
    "CoolProp 8.0.0: Lemmon and Huber, Energy Fuels 18 (2004); viscosity Huber et al., Energy "
    "Fuels 18 (2004)",
    0.170335,
    _every_step(273.15, first=263.65),
    _bar(1060, 1040, 990, 950, 900, 850, 800, 740, 690),
    density=(771.738, 764.601, 749.724, 734.964, 720.227, 705.423, 690.464, 675.261, 659.719),
    bulk_modulus=(
        1.5776e9,
        1.4725e9,
        1.2741e9,
        1.102e9,
        9.5166e8,
        8.1959e8,
        7.0307e8,
        5.9991e8,
        5.084e8,
    ),
    bulk_modulus_slope=(12.873, 12.767, 12.563, 12.378, 12.208, 12.053, 11.907, 11.767, 11.632),
    viscosity=(
        0.0029089,
        0.0022815,
        0.0014961,
        0.0010663,
        0.00080431,
        0.00063173,
        0.00051108,
        0.00042257,
        0.00035498,
    ),
    pressure_viscosity=(
        1.339e-8,
        1.258e-8,
        1.166e-8,
        1.127e-8,
        1.115e-8,
        1.122e-8,
        1.142e-8,
        1.176e-8,
        1.224e-8,
    ),
    vapour_pressure=(
        0.629749,
        1.75532,
        11.6841,
        57.9455,
        226.939,
        733.712,
        2026.88,
        4916.1,
        10699.5,
    ),
)

WATER = _measured(
    "water",
    "CoolProp 8.0.0: IAPWS-95, Wagner and Pruss, J. Phys. Chem. Ref. Data 31 (2002); viscosity "
    "Huber et al., J. Phys. Chem. Ref. Data 38 (2009)",
    0.018015,
    _every_step(273.15),
    _bar(*8 * (2500,)),
    density=(1000.046, 998.390, 992.391, 983.370, 971.969, 958.536, 943.258, 926.210),
    bulk_modulus=(1.9686e9, 2.1958e9, 2.3219e9, 2.3678e9, 2.3509e9, 2.2851e9, 2.181e9, 2.0468e9),
    bulk_modulus_slope=(5.723, 6.030, 6.373, 6.707, 7.046, 7.390, 7.751, 8.133),
    viscosity=(
        0.0017909,
        0.0010015,
        0.00065278,
        0.00046613,
        0.00035416,
        0.00028169,
        0.00023211,
        0.00019668,
    ),
    pressure_viscosity=(
        -1.097e-9,
        -2.394e-10,
        2.206e-10,
        5.21e-10,
        7.469e-10,
        9.338e-10,
        1.101e-9,
        1.257e-9,
    ),
    vapour_pressure=(611.21, 2339.32, 7384.94, 19946.4, 47414.5, 101418.0, 198674.0, 361539.0),
)

ISO_4113 = _from_constants(
    "ISO 4113",
    MineralOil,
    _OIL,
    253.15,
    413.15,
    _FUEL_PRESSURES,
    density=(
        825.0,
        "middle of the band of ISO 4113:2010 (read as KS R ISO 4113:2012), 820 to 830 kg/m^3",
        True,
    ),
    expansion=(8.3e-4, _GUIDE, False),
    bulk_modulus=(1.53e9, f"{_GUIDE}; compare Bazile, Boned and Daridon, 19th ECTP", False),
    bulk_modulus_slope=(10.9, f"{_GENERIC_OIL}, adopted for a lighter oil", False),
    softening=(0.0058, f"{_GENERIC_OIL}, adopted for a lighter oil", False),
    walther_a=(8.9963, f"{_FITTED}: 3.9 mm^2/s at 20, 2.6 at 40 degC (band 2.45 to 2.75)", False),
    walther_b=(3.7189, f"{_FITTED}: 3.9 mm^2/s at 20, 2.6 at 40 degC (band 2.45 to 2.75)", False),
    pressure_viscosity=(1.1e-8, _GUIDE, False),
    vapour_pressure=(50.0, f"{_GUIDE}: below 200 Pa", False),
    molar_mass=(0.19, _GUIDE, False),
)

DIESEL = _from_constants(
    "diesel",
    MineralOil,
    _OIL,
    253.15,
    413.15,
    _FUEL_PRESSURES,
    density=(835.0, "within the band of EN 590, 820 to 845 kg/m^3", False),
    expansion=(8.3e-4, _GUIDE, False),
    bulk_modulus=(1.58e9, f"{_GUIDE}; compare Tat and Van Gerpen, JAOCS 80 (2003) 1127", False),
    bulk_modulus_slope=(10.9, f"{_GENERIC_OIL}, adopted for a lighter oil", False),
    softening=(0.0058, f"{_GENERIC_OIL}, adopted for a lighter oil", False),
    walther_a=(9.2097, f"{_FITTED}: 4.3 mm^2/s at 20, 2.8 at 40 degC", False),
    walther_b=(3.7961, f"{_FITTED}: 4.3 mm^2/s at 20, 2.8 at 40 degC", False),
    pressure_viscosity=(1.1e-8, _GUIDE, False),
    vapour_pressure=(50.0, f"{_GUIDE}: below 100 Pa", False),
    molar_mass=(0.20, _GUIDE, False),
)

VG_32 = _from_constants(
    "ISO VG 32",
    MineralOil,
    _OIL,
    253.15,
    413.15,
    _OIL_PRESSURES,
    density=(870.0, _GUIDE, False),
    expansion=(7.0e-4, _GUIDE, False),
    bulk_modulus=(1.62e9, _GUIDE, False),
    bulk_modulus_slope=(10.9, f"{_GENERIC_OIL}, adopted for a lighter grade", False),
    softening=(0.0058, f"{_GENERIC_OIL}, adopted for a lighter grade", False),
    walther_a=(9.5308, f"{_FITTED}: 32 mm^2/s at 40 (ISO 3448), 5.4 at 100 degC", False),
    walther_b=(3.7466, f"{_FITTED}: 32 mm^2/s at 40 (ISO 3448), 5.4 at 100 degC", False),
    pressure_viscosity=(1.8e-8, _GUIDE, False),
    vapour_pressure=(1.0, f"{_GUIDE}: practically none", False),
    molar_mass=(0.4, _GUIDE, False),
)

VG_46 = _from_constants(
    "ISO VG 46",
    MineralOil,
    _OIL,
    253.15,
    413.15,
    _OIL_PRESSURES,
    density=(875.0, _GUIDE, False),
    expansion=(7.0e-4, _GUIDE, False),
    bulk_modulus=(1.65e9, _GUIDE, False),
    bulk_modulus_slope=(10.9, _GENERIC_OIL, True),
    softening=(0.0058, _GENERIC_OIL, True),
    walther_a=(9.4180, f"{_FITTED}: 46 mm^2/s at 40 (ISO 3448), 6.8 at 100 degC", False),
    walther_b=(3.6844, f"{_FITTED}: 46 mm^2/s at 40 (ISO 3448), 6.8 at 100 degC", False),
    pressure_viscosity=(1.8e-8, _GUIDE, False),
    vapour_pressure=(1.0, f"{_GUIDE}: practically none", False),
    molar_mass=(0.45, _GUIDE, False),
)

GENERIC_OIL = _from_constants(
    "generic mineral oil",
    TaitOil,
    _TAIT,
    273.15,
    373.15,
    _OIL_PRESSURES,
    density=(870.0, _GENERIC_OIL, True),
    expansion=(7.7e-4, _GENERIC_OIL, True),
    bulk_modulus=(8.4e9, _GENERIC_OIL, True),
    bulk_modulus_slope=(10.9, _GENERIC_OIL, True),
    softening=(0.0058, _GENERIC_OIL, True),
    walther_a=(9.32, _GENERIC_OIL, True),
    walther_b=(3.65, _GENERIC_OIL, True),
    pressure_viscosity=(0.0, f"{_GENERIC_OIL}: none", True),
    vapour_pressure=(1.0, f"{_GUIDE}: practically none", False),
    molar_mass=(0.45, _GUIDE, False),
)

DOT_4 = _from_constants(
    "DOT 4",
    MineralOil,
    _OIL,
    233.15,
    413.15,
    _OIL_PRESSURES,
    density=(1064.0, "middle of a data sheet's band 1.05 to 1.10 at 20 degC", False),
    expansion=(8.0e-4, _GUIDE, False),
    bulk_modulus=(2.2e9, f"{_GUIDE}, uncertain by 15 %", False),
    bulk_modulus_slope=(10.0, _GUIDE, False),
    softening=(0.005, _GUIDE, False),
    walther_a=(9.5887, f"{_FITTED}: 1200 mm^2/s at -40, 2.5 at 100 degC (data sheet)", False),
    walther_b=(3.8436, f"{_FITTED}: 1200 mm^2/s at -40, 2.5 at 100 degC (data sheet)", False),
    pressure_viscosity=(1.2e-8, _GUIDE, False),
    vapour_pressure=(10.0, f"{_GUIDE}: practically none when dry", False),
    molar_mass=(0.22, _GUIDE, False),
)

PETROL = _from_constants(
    "petrol",
    MineralOil,
    _VOLATILE,
    233.15,
    413.15,
    _PETROL_PRESSURES,
    density=(745.0, "within the band of EN 228, 720 to 775 kg/m^3", False),
    expansion=(1.2e-3, f"{_GUIDE}; 1.1e-3 to 1.3e-3", False),
    bulk_modulus=(1.05e9, f"{_GUIDE}, uncertain by 10 %; n-heptane 0.91, aromatics 1.5 GPa", False),
    bulk_modulus_slope=(11.9, "n-heptane, taken over", False),
    softening=(0.0087, "adopted from n-heptane, 20 to 40 degC", False),
    walther_a=(8.0829, f"{_FITTED}: 0.62 mm^2/s at 20, 0.43 at 60 degC, +- 15 %", False),
    walther_b=(3.6224, f"{_FITTED}: 0.62 mm^2/s at 20, 0.43 at 60 degC, +- 15 %", False),
    pressure_viscosity=(9.6e-9, "n-heptane, taken over", False),
    vapour_pressure=(29e3, f"{_GUIDE}: 55 kPa at 37.8 degC (EN 228 class A 45 to 60 kPa)", False),
    molar_mass=(0.068, f"{_GUIDE}: of its vapour, 0.062 to 0.072 kg/mol", False),
    boiling=(3300.0, f"{_GUIDE}: 27 kJ/mol, +- 10 %", False),
)

ATF = _from_constants(
    "ATF",
    MineralOil,
    _OIL,
    233.15,
    413.15,
    _OIL_PRESSURES,
    density=(848.0, f"{_GUIDE}; 830 to 870 kg/m^3", False),
    expansion=(7.5e-4, f"{_GUIDE}; 7e-4 to 8e-4", False),
    bulk_modulus=(1.55e9, f"{_GUIDE}, uncertain by 10 %", False),
    bulk_modulus_slope=(10.9, f"{_GENERIC_OIL}, adopted for a lighter grade", False),
    softening=(0.0058, f"{_GENERIC_OIL}, adopted for a lighter grade", False),
    walther_a=(8.4722, f"{_FITTED}: 29.5 mm^2/s at 40, 6.0 at 100 degC, of DEXRON-VI", False),
    walther_b=(3.3264, f"{_FITTED}: 29.5 mm^2/s at 40, 6.0 at 100 degC, of DEXRON-VI", False),
    pressure_viscosity=(1.6e-8, f"{_GUIDE}; 1.4e-8 to 2e-8", False),
    vapour_pressure=(1.0, f"{_GUIDE}: practically none", False),
    molar_mass=(0.4, _GUIDE, False),
)

WATER_GLYCOL = _from_constants(
    "water-glycol",
    MineralOil,
    _VOLATILE,
    253.15,
    338.15,
    _OIL_PRESSURES,
    density=(1085.0, f"{_GUIDE}, class HFC of ISO 6743-4; 1040 to 1090 kg/m^3", False),
    expansion=(6.5e-4, f"{_GUIDE}; 6e-4 to 7e-4", False),
    bulk_modulus=(3.1e9, f"{_GUIDE}, uncertain by 15 %", False),
    bulk_modulus_slope=(7.0, f"{_GUIDE}: between water (6) and oils (11)", False),
    softening=(0.002, f"{_GUIDE}; 0 to 0.004", False),
    walther_a=(6.5589, f"{_FITTED}: 46 mm^2/s at 40 (ISO 3448), 26 at 60 degC, +- 20 %", False),
    walther_b=(2.5389, f"{_FITTED}: 46 mm^2/s at 40 (ISO 3448), 26 at 60 degC, +- 20 %", False),
    pressure_viscosity=(4e-9, f"{_GUIDE}; 2e-9 to 6e-9", False),
    vapour_pressure=(1.9e3, f"{_GUIDE}: 0.8 of that of water, +- 15 %", False),
    molar_mass=(0.018, "of its vapour: water", False),
    boiling=(5280.0, "water from 20 to 50 degC, IAPWS-95", False),
)

FLUIDS: Mapping[str, FluidDefinition] = {
    fluid.name: fluid
    for fluid in (
        HEPTANE,
        DECANE,
        DODECANE,
        WATER,
        ISO_4113,
        DIESEL,
        VG_32,
        VG_46,
        GENERIC_OIL,
        DOT_4,
        PETROL,
        ATF,
        WATER_GLYCOL,
    )
}
"""All library fluids by name."""


def find_fluid(name: str) -> FluidDefinition | None:
    """Library fluid of this name, or None; case, blanks and hyphens do not matter."""
    return entry_named(name, FLUIDS)


def library_fluid(name: str) -> FluidDefinition:
    """Library fluid of this name.

    Examples
    --------
    >>> oil = library_fluid("iso-vg-46")
    >>> oil.name, oil.verified
    ('ISO VG 46', False)
    """
    return require_entry(
        "library_fluid: name",
        name,
        FLUIDS,
        "describe your own fluid with FluidChoice or FluidDefinition.",
    )
