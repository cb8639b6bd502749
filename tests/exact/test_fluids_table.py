"""Truth: the fluid itself, and quadrature of its specific volume."""

import numpy as np
import pytest
from draws import each
from scipy.integrate import quad

from klack.hydraulics.fluid_choice import FluidChoice
from klack.hydraulics.fluid_library import FLUIDS, library_fluid
from klack.hydraulics.fluid_table import fluid_at, fluid_table, pressure_at
from klack.hydraulics.liquid import HIGHEST_PRESSURE

AMBIENT = 101_325.0
USER = FluidChoice(
    name="user's",
    table={"pressure": [1e5, 1e6, 5e6, 2e7], "density": [684.0, 684.7, 687.8, 698.4]},
    viscosity=4e-4,
).at(293.15)
HEPTANE = library_fluid("n-heptane").at(293.15, gas_fraction=1e-3)


def look_up(table, pressures) -> np.ndarray:
    """Columns density, slope, energy; the hint runs along."""
    hint, rows = 0, []
    for p in pressures:
        rho, slope, g, hint = fluid_at(table, p, hint)
        rows.append((rho, slope, g))
    return np.array(rows).T


@pytest.mark.slow
@each(
    "fluid", [*(f.at(293.15, gas_fraction=a) for f in FLUIDS.values() for a in (0.0, 2e-3)), USER]
)
def test_table_is_the_fluid(fluid):
    table = fluid_table(fluid, AMBIENT)
    p = 10.0 ** np.random.default_rng(3).uniform(0.0, np.log10(3e8), 4000)

    rho, slope, _ = look_up(table, p)

    v, tangent = fluid.specific_volume(p)
    np.testing.assert_allclose(rho, 1.0 / v, rtol=1e-9)
    np.testing.assert_allclose(slope, -tangent / v**2, rtol=1e-5)
    assert np.all(slope > 0.0)
    assert table[0] < 1000  # pieces


def test_energy_is_the_integral_of_the_specific_volume():
    table = fluid_table(HEPTANE, AMBIENT)
    for low, high in [(AMBIENT, 101_425.0), (AMBIENT, 6e5), (AMBIENT, 3e8), (7e3, AMBIENT)]:
        exact, _ = quad(lambda x: float(HEPTANE.specific_volume(x)[0]), low, high, epsrel=1e-13)
        ours = fluid_at(table, high, 0)[2] - fluid_at(table, low, 0)[2]
        assert ours == pytest.approx(exact, rel=1e-9)
    assert fluid_at(table, AMBIENT, 0)[2] == 0.0
    # near the ambient pressure no digits are lost
    tiny = fluid_at(table, AMBIENT + 1e-6, 0)[2]
    assert tiny == pytest.approx(((AMBIENT + 1e-6) - AMBIENT) / HEPTANE.density(AMBIENT), rel=1e-9)


def test_pieces_join_with_equal_value_slope_and_energy():
    table = fluid_table(HEPTANE, AMBIENT)
    ends = table[16:-8:8]
    rho, slope, g = look_up(table, ends)
    below = look_up(table, np.nextafter(ends, 0.0))
    np.testing.assert_allclose(below[0], rho, rtol=1e-12)
    np.testing.assert_allclose(below[1], slope, rtol=1e-9)
    np.testing.assert_allclose(below[2], g, rtol=1e-11, atol=1e-11)


def test_the_hint_does_not_matter():
    table = fluid_table(HEPTANE, AMBIENT)
    hints = [fluid_at(table, p, 0)[3] for p in (0.5, 1e3, 1e5, 1e7, 1e9)]
    for p in (-5.0, 0.5, 1.0, 2e3, AMBIENT, 6e5, 3e8, 1e9):
        found = {fluid_at(table, p, hint) for hint in (0, *hints)}
        assert len(found) == 1


def test_beyond_its_ends_it_goes_on_rising():
    table = fluid_table(HEPTANE, AMBIENT)
    p = np.concatenate((np.linspace(-1e6, 3.0, 201), np.linspace(3.9e8, 2e9, 201)))
    rho, slope, g = look_up(table, p)
    assert np.all(rho > 0.0)
    assert np.all(np.diff(rho) > 0.0)
    assert np.all(slope > 0.0)
    assert np.all(np.diff(g) > 0.0)
    top = look_up(table, [HIGHEST_PRESSURE, HIGHEST_PRESSURE + 1e8, HIGHEST_PRESSURE + 2e8])
    assert top[0, 1] - top[0, 0] == pytest.approx(top[0, 2] - top[0, 1], rel=1e-12)  # a line
    exact, _ = quad(lambda x: 1.0 / fluid_at(table, x, 0)[0], HIGHEST_PRESSURE, 6e8, epsrel=1e-13)
    assert fluid_at(table, 6e8, 0)[2] - top[2, 0] == pytest.approx(exact, rel=1e-11)
    exact, _ = quad(lambda x: 1.0 / fluid_at(table, x, 0)[0], -3.0, 1.0, epsrel=1e-13)
    below = fluid_at(table, 1.0, 0)[2] - fluid_at(table, -3.0, 0)[2]
    assert below == pytest.approx(exact, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("fluid", [HEPTANE, USER], ids=lambda fluid: fluid.name)
def test_the_pressure_is_found_again(fluid):
    """Digits of the density limit it: dp/p = (K/p) 2e-16, so compare densities, and p if soft."""
    table = fluid_table(fluid, AMBIENT)
    ends = np.concatenate((table[8::8], np.nextafter(table[8::8], 0.0), [-4.0, 0.1, 4.1e8, 2e9]))
    p = np.concatenate((10.0 ** np.random.default_rng(5).uniform(0.0, 8.6, 4000), ends))
    hint = 0
    for x in np.random.default_rng(6).permutation(p):
        rho, slope, _, _ = fluid_at(table, x, 0)
        found, hint = pressure_at(table, rho, hint)
        assert fluid_at(table, found, hint)[0] == pytest.approx(rho, rel=1e-14)
        assert abs(found - x) <= 1e-14 * (abs(x) + 10.0 * rho / slope)
        assert pressure_at(table, rho, 0)[0] == found


def test_no_density_is_too_small_or_too_large():
    table = fluid_table(HEPTANE, AMBIENT)
    found = [pressure_at(table, rho, 0)[0] for rho in (-1.0, 0.0, 1e-6, 1.0, 684.0, 5e3)]
    assert np.all(np.isfinite(found))
    assert np.all(np.diff(found) >= 0.0)


def test_steps_in_density_find_the_pressure_of_a_volume_that_starts_or_stops_to_boil():
    """``V rho(p) + k (p - p_out) = m``, from where the volume was before its wall moved.

    Newton's steps in pressure fail in one case of eight here, even held above a tenth of the last
    pressure: they cycle between both sides of the boiling band.
    """
    table = fluid_table(library_fluid("n-heptane").at(293.15, gas_fraction=1e-4), AMBIENT)
    random = np.random.default_rng(0)
    most = 0
    for _ in range(2000):
        p, hint = 10.0 ** random.uniform(0.5, 7.3), 0
        mass = fluid_at(table, p, 0)[0]  # of 1 m^3
        volume = 1.0 + 10.0 ** random.uniform(-6.0, -1.5) * random.choice([-1.0, 1.0])
        outflow = random.choice([0.0, 7e-7]) * 10.0 ** random.uniform(-3.0, 2.0)
        count = 0
        while count < 60:
            count += 1
            rho, slope, _, hint = fluid_at(table, p, hint)
            missing = mass - volume * rho - outflow * (p - 5e5)
            before = p
            p, hint = pressure_at(table, rho + slope * missing / (volume * slope + outflow), hint)
            if abs(p - before) <= 1e-7 * max(p, AMBIENT):
                break
        most = max(most, count)
    assert most <= 7
