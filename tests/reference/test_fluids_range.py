"""Pressures up to which a library fluid is described, against equations of state.

Truth: CoolProp 8.0.0 (Span and Wagner 2003; Lemmon and Span 2006; Lemmon and Huber 2004; IAPWS-95),
density and bulk modulus on the isentrope that starts at the temperature and 5 bar.
"""

import pytest

from klack.hydraulics.fluid_library import FLUIDS, library_fluid

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
