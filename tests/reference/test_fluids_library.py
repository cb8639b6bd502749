"""Fluids against equations of state.

Truth: Helmholtz equations of state, and the equations of a published oil model.

tests/data/fluids_coolprop.csv (n-heptane, n-decane, n-dodecane, water; 0 to 100 degC, 1 to 350
bar) and tests/data/oil_isovg46_openhydraulics.csv; their heads name the sources.

Pressures up to which a library fluid is described, against equations of state.

Truth: CoolProp 8.0.0 (Span and Wagner 2003; Lemmon and Span 2006; Lemmon and Huber 2004; IAPWS-95),
density and bulk modulus on the isentrope that starts at the temperature and 5 bar.
"""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from klack.hydraulics.fluid_library import FLUIDS, library_fluid

DATA = Path(__file__).parents[1] / "data"
ATMOSPHERE = 101_325.0


def rows(name: str) -> list[dict[str, str]]:
    with (DATA / name).open() as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def column(table: list[dict[str, str]], name: str) -> np.ndarray:
    return np.array([float(row[name]) for row in table])


@pytest.mark.parametrize("name", ["n-heptane", "n-decane", "n-dodecane", "water"])
@pytest.mark.parametrize("highest", [1e6, 350e5])
def test_pure_fluids_follow_their_equations_of_state(name, highest):
    """Near the operating pressure to 3e-4, 1.5e-3 and 2e-3; to 350 bar K(p) is one straight line.

    The density leaves the table of constant temperature because the library follows an isentrope,
    which warms by compression: up to 1.2 % at 350 bar, by theory (1/K_s against 1/K_T).
    """
    table = [r for r in rows("fluids_coolprop.csv") if r["fluid"].lower() == name]
    table = [r for r in table if float(r["p_Pa"]) <= highest]
    assert len(table) >= 20
    fluids = [library_fluid(name).at(float(row["T_K"])) for row in table]
    p = column(table, "p_Pa")

    def worst(values: list[float], key: str) -> float:
        return float(np.max(np.abs(np.array(values) / column(table, key) - 1.0)))

    near = highest == 1e6
    density = [float(f.liquid.density(x)) for f, x in zip(fluids, p, strict=True)]
    stiffness = [float(f.liquid.bulk_modulus(x)) for f, x in zip(fluids, p, strict=True)]
    viscosity = [float(f.viscosity(x)) for f, x in zip(fluids, p, strict=True)]
    assert worst(density, "density_kg_m3") < (3e-4 if near else 1.25e-2)
    assert worst(stiffness, "K_isentropic_Pa") < (1.5e-3 if near else 1.25e-2)
    assert worst(viscosity, "dyn_viscosity_Pa_s") < (2e-3 if near else 1.9e-2)
    boiling = [f.vapour_pressure for f in fluids]
    assert worst(boiling, "vapour_pressure_Pa") < 1e-5


def test_a_column_that_is_left_out_is_found_again():
    """The curves over temperature: drop 40 degC and interpolate it from its neighbours."""
    properties = library_fluid("n-heptane").properties
    names = [n for n in properties.__dataclass_fields__ if n not in ("pressure", "molar_mass")]
    fewer = replace(
        properties, **{n: (*getattr(properties, n)[:2], *getattr(properties, n)[3:]) for n in names}
    )

    found, known = fewer.at(313.15), properties.at(313.15)

    assert found.liquid.density(6e5) == pytest.approx(known.liquid.density(6e5), rel=1e-4)
    assert found.liquid.bulk_modulus(6e5) == pytest.approx(known.liquid.bulk_modulus(6e5), rel=2e-3)
    assert found.viscosity == pytest.approx(known.viscosity, rel=2e-3)
    assert found.vapour_pressure == pytest.approx(known.vapour_pressure, rel=2e-3)


def test_generic_oil_is_the_published_one():
    table = rows("oil_isovg46_openhydraulics.csv")
    assert len(table) == 24
    for row in table:
        fluid = library_fluid("generic mineral oil").at(float(row["T_K"]))
        p = float(row["p_Pa"])
        nu = float(fluid.viscosity(p) / fluid.density(ATMOSPHERE))
        assert float(fluid.density(p)) == pytest.approx(float(row["density_kg_m3"]), rel=1e-6)
        assert float(fluid.bulk_modulus(p)) == pytest.approx(
            float(row["bulk_modulus_isothermal_Pa"]), rel=1e-4
        )
        assert nu == pytest.approx(float(row["kinematic_viscosity_m2_s"]), rel=5e-5)


@pytest.mark.parametrize(
    ("name", "celsius", "low", "high"),
    [
        ("ISO VG 32", 40, 28.8, 35.2),  # ISO 3448: grade +- 10 %
        ("ISO VG 46", 40, 41.4, 50.6),
        ("ISO VG 46", 100, 6.5, 7.1),
        ("ISO 4113", 40, 2.45, 2.75),  # ISO 4113:2010
        ("diesel", 40, 2.0, 4.5),  # EN 590
        ("DOT 4", 100, 1.5, np.inf),  # FMVSS 116
        ("DOT 4", -40, 0.0, 1800.0),
        ("water-glycol", 40, 41.4, 50.6),  # ISO 3448
        ("ATF", 100, 5.5, 6.4),  # DEXRON-VI: 6.4 at most, fresh
        ("ATF", -40, 0.0, 15000.0 / 0.889),  # DEXRON-VI: 15 Pa s at most
    ],
)
def test_oils_lie_in_the_band_of_their_standard(name, celsius, low, high):
    fluid = library_fluid(name).at(273.15 + celsius)
    assert low <= 1e6 * float(fluid.viscosity(ATMOSPHERE) / fluid.density(ATMOSPHERE)) <= high


def test_densities_lie_in_the_band_of_their_standard():
    assert 820.0 <= library_fluid("ISO 4113").at(288.15).density(ATMOSPHERE) <= 830.0
    assert 820.0 <= library_fluid("diesel").at(288.15).density(ATMOSPHERE) <= 845.0
    assert 720.0 <= library_fluid("petrol").at(288.15).density(ATMOSPHERE) <= 775.0  # EN 228


def test_every_constant_has_a_source_and_a_flag():
    assert len(FLUIDS) == 13
    for fluid in FLUIDS.values():
        assert len(fluid.constants) >= 7
        assert all(len(c.source) > 10 and c.label and c.unit for c in fluid.constants)
    verified = {name for name, fluid in FLUIDS.items() if fluid.verified}
    assert verified == {"n-heptane", "n-decane", "n-dodecane", "water"}


def test_volatile_fluids_boil_later_when_cold():
    """EN 228, class A: 45 to 60 kPa at 37.8 degC; water: IAPWS-95, 2339.3 and 12352 Pa."""
    assert 45e3 <= library_fluid("petrol").at(310.95).vapour_pressure <= 60e3
    mixture = library_fluid("water-glycol")
    ratio = mixture.at(323.15).vapour_pressure / mixture.at(293.15).vapour_pressure
    assert ratio == pytest.approx(12352.0 / 2339.3, rel=1e-2)  # one heat of vaporisation
    assert library_fluid("diesel").at(353.15).vapour_pressure == 50.0  # held


# fluid, temperature [K], pressure [Pa], density [kg/m^3], bulk modulus [Pa]
ISENTROPES = (
    ("n-heptane", 233.15, 1050e5, 774.16, 2.5062e09),
    ("n-heptane", 273.15, 860e5, 743.04, 1.9132e09),
    ("n-heptane", 313.15, 710e5, 712.20, 1.4538e09),
    ("n-heptane", 373.15, 510e5, 663.09, 9.1826e08),
    ("n-heptane", 413.15, 400e5, 627.56, 6.4705e08),
    ("n-decane", 253.15, 1140e5, 804.25, 2.7293e09),
    ("n-decane", 313.15, 950e5, 764.08, 1.9508e09),
    ("n-decane", 413.15, 630e5, 693.73, 1.0501e09),
    ("n-dodecane", 263.65, 1060e5, 811.62, 2.6692e09),
    ("n-dodecane", 313.15, 950e5, 781.16, 2.0657e09),
    ("n-dodecane", 413.15, 690e5, 717.65, 1.1877e09),
    ("water", 273.15, 2500e5, 1096.30, 3.7638e09),
    ("water", 313.15, 2500e5, 1075.98, 4.0263e09),
    ("water", 413.15, 2500e5, 1011.06, 3.7798e09),
)


@pytest.mark.parametrize(("name", "temperature", "pressure", "density", "modulus"), ISENTROPES)
def test_fluids_hold_what_they_say_up_to_the_end_of_their_range(
    name, temperature, pressure, density, modulus
):
    fluid = library_fluid(name).at(temperature)

    assert fluid.pressure_range.highest == pytest.approx(pressure, rel=1e-12)
    assert float(fluid.bulk_modulus(pressure)) == pytest.approx(modulus, rel=0.105)
    assert float(fluid.density(pressure)) == pytest.approx(density, rel=5e-3)


def test_every_library_fluid_states_its_range_and_where_it_comes_from():
    for definition in FLUIDS.values():
        known = definition.at(293.15).pressure_range

        assert 500e5 <= known.highest <= 2500e5
        assert known.source
