"""Gases by name: every constant with its source."""

from klack.hydraulics.gas.gas import Gas
from klack.materials.sourced import Constant, require_entry

__all__ = ["AIR", "GASES", "library_gas"]

_PRESSURES = tuple(
    bar * 1e5 for bar in (1.0, 10.0, 20.0, 30.0, 50.0, 70.0, 100.0, 150.0, 200.0, 250.0, 350.0)
)
_MOLAR = 8.31446261815324  # [J/(mol K)] 2019 SI


def _gas(
    name: str,
    source: str,
    molar_mass: float,
    kappa: float,
    viscosity: float,
    highest: float,
    temperatures: tuple[float, float],
    compressibility: tuple[float, ...],
) -> Gas:
    read = f"CoolProp 8.0.0: {source}"
    labels: dict[str, tuple[float | tuple[float, ...], str]] = {
        "molar mass": (molar_mass, "kg/mol"),
        "ratio of heat capacities at 20 degC, as an ideal gas": (kappa, "-"),
        "dynamic viscosity at 20 degC and 1 bar": (viscosity, "Pa s"),
        "compressibility factor at 20 degC over pressure": (compressibility, "-"),
    }
    return Gas(
        name=name,
        gas_constant=_MOLAR / molar_mass,
        kappa=kappa,
        viscosity=viscosity,
        highest_pressure=highest,
        temperatures=temperatures,
        pressures=_PRESSURES,
        compressibility=compressibility,
        source=read,
        constants=tuple(
            Constant(label=label, value=value, unit=unit, source=read, verified=True)
            for label, (value, unit) in labels.items()
        ),
    )


AIR = _gas(
    "air",
    "Lemmon et al., J. Phys. Chem. Ref. Data 29 (2000) 331; viscosity Lemmon and Jacobsen, Int. J. "
    "Thermophys. 25 (2004) 21",
    0.02896546,
    1.40012,
    1.82055e-5,
    235e5,
    (100.0, 590.0),
    (0.9996, 0.9965, 0.9936, 0.9912, 0.9879, 0.9865, 0.9881, 1.0010, 1.0260, 1.0612, 1.1530),
)

NITROGEN = _gas(
    "nitrogen",
    "Span et al., J. Phys. Chem. Ref. Data 29 (2000) 1361; viscosity Lemmon and Jacobsen 2004",
    0.02801348,
    1.39957,
    1.75728e-5,
    197e5,
    (100.0, 590.0),
    (0.9998, 0.9978, 0.9961, 0.9949, 0.9940, 0.9951, 1.0008, 1.0205, 1.0518, 1.0924, 1.1927),
)

HYDROGEN = _gas(
    "hydrogen",
    "Leachman et al., J. Phys. Chem. Ref. Data 38 (2009) 721; viscosity Muzny et al., J. Chem. "
    "Eng. Data 58 (2013) 969",
    0.00201588,
    1.40594,
    8.79676e-6,
    82e5,
    (210.0, 590.0),
    (1.0006, 1.0059, 1.0119, 1.0179, 1.0300, 1.0422, 1.0608, 1.0924, 1.1247, 1.1575, 1.2240),
)

METHANE = _gas(
    "methane",
    "Setzmann and Wagner, J. Phys. Chem. Ref. Data 20 (1991) 1061; viscosity Quinones-Cisneros "
    "and Deiters 2011. It stands for CNG, which holds 80 to 99 % of it",
    0.0160428,
    1.30554,
    1.10369e-5,
    27e5,
    (180.0, 350.0),
    (0.9982, 0.9817, 0.9636, 0.9459, 0.9117, 0.8801, 0.8404, 0.8045, 0.8114, 0.8500, 0.9713),
)

HELIUM = _gas(
    "helium",
    "Ortiz-Vega et al., J. Phys. Chem. Ref. Data 49 (2020); viscosity Arp et al., NIST TN 1334",
    0.004002602,
    1.66667,
    1.96175e-5,
    103e5,
    (20.0, 600.0),
    (1.0005, 1.0049, 1.0097, 1.0146, 1.0242, 1.0338, 1.0481, 1.0718, 1.0952, 1.1183, 1.1640),
)

GASES = {gas.name: gas for gas in (AIR, NITROGEN, HYDROGEN, METHANE, HELIUM)} | {"CNG": METHANE}
"""By name."""


def library_gas(name: str) -> Gas:
    """Gas of this name."""
    return require_entry(
        "network.gas", name, GASES, "give gas_constant, kappa and viscosity of your own gas."
    )
