"""Pressures up to which a library fluid is described, against equations of state.

Truth: CoolProp 8.0.0 (Span and Wagner 2003; Lemmon and Span 2006; Lemmon and Huber 2004; IAPWS-95),
density and bulk modulus on the isentrope that starts at the temperature and 5 bar.
"""

import pytest

from klack.hydraulics.fluid_library import FLUIDS, library_fluid

# fluid, temperature [K], pressure [Pa], density [kg/m^3], bulk modulus [Pa]
ISENTROPES = (
    ("n-heptane", 273.15, 5e07, 727.82, 1.5737e09),
    ("n-heptane", 313.15, 5e07, 701.24, 1.2589e09),
    ("n-heptane", 373.15, 5e07, 662.36, 9.0922e08),
    ("n-decane", 273.15, 7.5e07, 779.55, 2.1200e09),
    ("n-decane", 313.15, 7.5e07, 755.88, 1.7585e09),
    ("n-decane", 373.15, 7.5e07, 722.50, 1.3590e09),
    ("n-dodecane", 273.15, 8e07, 797.78, 2.3087e09),
    ("n-dodecane", 313.15, 8e07, 775.31, 1.9233e09),
    ("n-dodecane", 373.15, 8e07, 743.91, 1.4998e09),
    ("water", 273.15, 2.5e08, 1096.30, 3.7638e09),
    ("water", 313.15, 2.5e08, 1075.98, 4.0263e09),
    ("water", 373.15, 2.5e08, 1039.65, 3.9913e09),
)


@pytest.mark.parametrize(("name", "temperature", "pressure", "density", "modulus"), ISENTROPES)
def test_fluids_hold_what_they_say_up_to_the_end_of_their_range(
    name, temperature, pressure, density, modulus
):
    fluid = library_fluid(name).at(temperature)

    assert fluid.pressure_range.highest == pressure
    assert float(fluid.bulk_modulus(pressure)) == pytest.approx(modulus, rel=0.105)
    assert float(fluid.density(pressure)) == pytest.approx(density, rel=5e-3)


def test_every_library_fluid_states_its_range_and_where_it_comes_from():
    for definition in FLUIDS.values():
        known = definition.at(293.15).pressure_range

        assert 500e5 <= known.highest <= 2500e5
        assert known.source
