"""Truth: the fluid itself, and calculus: what holds for every fluid that klack accepts.

Densities from a gas to mercury, speeds of sound from 100 m/s to 3 km/s, up to 10 % of gas,
vapour pressures from 10 Pa to 5 bar; pressures from 1 Pa to 4000 bar.
"""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from property_profiles import examples, log_range
from scipy.integrate import quad

from klack.errors import InputError
from klack.hydraulics.fluid import Fluid
from klack.hydraulics.fluid_choice import FluidChoice
from klack.hydraulics.fluid_table import fluid_at, fluid_table, pressure_at
from klack.hydraulics.line import Line
from klack.hydraulics.line_friction import (
    KAGAWA,
    laminar_weight,
    vardy_brown_weight,
    zielke_weight,
)
from klack.hydraulics.liquid import Murnaghan, Tait

AMBIENT = 101_325.0


@st.composite
def fluids(draw) -> Fluid:
    """Fluids of a user's own; refused ones are left out."""
    density, speed = draw(log_range(200.0, 14000.0)), draw(log_range(100.0, 3000.0))
    release = draw(st.none() | log_range(2.0, 1e5))
    try:
        return FluidChoice(
            name="own",
            density=density,
            sound_speed=speed,
            bulk_modulus_slope=draw(st.floats(1.0, 15.0)),
            viscosity=draw(log_range(1e-5, 10.0)),
            viscosity_pressure=draw(st.none() | log_range(1e7, 1e9)),
            vapour_pressure=draw(log_range(10.0, 5e5)),
            gas_fraction=draw(st.sampled_from([0.0, 1e-6, 1e-4, 5e-3, 0.1])),
            gas_exponent=draw(st.floats(1.0, 5.0 / 3.0)),
            release_pressure=release,
            saturation_pressure=release and release * draw(log_range(1.5, 1000.0)),
            boiling_half_width=draw(log_range(100.0, 1e5)),
        ).at(293.15)
    except InputError:
        assume(False)
        raise


PRESSURES = st.lists(log_range(1.0, 4e8), min_size=2, max_size=30).map(sorted)


@examples(30)
@given(fluids(), PRESSURES)
def test_the_table_is_the_fluid_at_any_pressure(fluid, pressures):
    table = fluid_table(fluid, AMBIENT)
    v, slope = fluid.specific_volume(pressures)
    found = np.array([fluid_at(table, p, 0)[:3] for p in pressures])

    np.testing.assert_allclose(found[:, 0], 1.0 / v, rtol=1e-9)
    # slopes jump at the kinks, where either side is right
    near = np.array([[abs(p / k - 1.0) < 1e-6 for k in (*fluid.kinks, 1.0)] for p in pressures])
    plain = ~near.any(axis=1)
    np.testing.assert_allclose(found[plain, 1], (-slope / v**2)[plain], rtol=1e-5)
    assert np.all(found[:, 1] > 0.0)
    # whatever the pressure, the way back leads to it
    for p, (rho, rise, _) in zip(pressures, found, strict=True):
        back, _ = pressure_at(table, rho, 0)
        assert back == pytest.approx(p, rel=1e-9, abs=4e-15 * rho / rise)


@examples(30)
@given(fluids(), PRESSURES)
def test_a_fluid_is_denser_under_pressure_and_conducts_waves(fluid, pressures):
    density, modulus = fluid.density(pressures), fluid.bulk_modulus(pressures)
    speed = fluid.sound_speed(pressures)

    assert np.all(np.isfinite(density))
    assert np.all(modulus > 0.0)
    np.testing.assert_allclose(speed**2 * density, modulus, rtol=1e-12)
    rises = np.diff(pressures) > 1e-9 * np.array(pressures[1:])
    assert np.all(np.diff(density)[rises] > 0.0)
    assert np.all(fluid.viscosity(pressures) > 0.0)
    # bubbles and vapour only make it softer, where a gas (K = n p) is softer than the liquid
    liquid = fluid.liquid.bulk_modulus(pressures)
    usual = fluid.gas.exponent * np.array(pressures) < liquid
    assert np.all(modulus[usual] <= liquid[usual] * (1.0 + 1e-9))


@examples(15)
@given(fluids(), log_range(1.0, 4e8), log_range(1.0, 4e8))
def test_pressure_energy_is_the_integral_of_the_volume(fluid, first, second):
    low, high = sorted((first, second))
    table = fluid_table(fluid, AMBIENT)
    # over ln p, piece by piece between the kinks
    ends = [low, *(k for k in fluid.kinks if low < k < high), high]
    exact = sum(
        quad(
            lambda x: float(fluid.specific_volume(np.exp(x))[0]) * np.exp(x),
            np.log(a),
            np.log(b),
            epsrel=1e-12,
            limit=200,
        )[0]
        for a, b in pairwise(ends)
    )
    g_low, g_high = (fluid_at(table, p, 0)[2] for p in (low, high))
    scale = abs(g_low) + abs(g_high)
    assert g_high - g_low == pytest.approx(exact, rel=2e-9, abs=1e-12 * scale)


@examples(30)
@given(fluids(), st.floats(-1e9, 1e10), st.integers(0, 10**6))
def test_no_pressure_and_no_density_breaks_the_table(fluid, p, place):
    table = fluid_table(fluid, AMBIENT)
    hint = 8 * (1 + place % (int(table[0]) + 1))
    rho, slope, g, found = fluid_at(table, p, hint)

    assert rho > 0.0
    assert slope > 0.0
    assert np.isfinite(g)
    assert fluid_at(table, p, 0) == (rho, slope, g, found)
    for density in (rho, 0.0, -1.0, 1e-300, 1e5):
        assert np.isfinite(pressure_at(table, density, hint)[0])


LIQUIDS = st.one_of(
    st.builds(
        Murnaghan,
        density_at_reference=log_range(100.0, 2e4),
        bulk_modulus_at_reference=log_range(1e7, 1e11),
        slope=st.floats(0.1, 20.0),
    ),
    st.builds(
        Tait,
        density_at_zero=log_range(100.0, 2e4),
        bulk_modulus_at_zero=log_range(1e8, 1e11),
        slope=st.floats(0.0, 20.0),
    ),
)


@examples(60)
@given(LIQUIDS, log_range(1.0, 1e8))
def test_density_and_stiffness_of_a_liquid_belong_together(liquid, p):
    """K = rho dp/drho, by a central difference: (d/p)^2 and round-off of 1e-16 K/d."""
    K = float(liquid.bulk_modulus(p))
    d = 1e-5 * (K + p)
    assume(d < p or (isinstance(liquid, Murnaghan) and liquid.slope * d < 0.1 * K))
    up, down = np.log(liquid.density([p + d, p - d]))
    assert K == pytest.approx(2.0 * d / (up - down), rel=1e-7)


@pytest.mark.slow
@examples(60)
@given(log_range(1e-6, 1.0), log_range(2e3, 1e8))
def test_memory_of_friction_fades_and_never_turns(tau, reynolds):
    """Weights above zero and falling: every one of them is then passive.  Eddies forget sooner."""
    for weight in (laminar_weight, zielke_weight, KAGAWA):
        here, later = weight([tau, 1.1 * tau])
        assert here > later > 0.0
    assert zielke_weight(tau) == pytest.approx(laminar_weight(tau), rel=2e-3)
    if tau > 1e-5:
        assert KAGAWA(tau) == pytest.approx(laminar_weight(tau), rel=4e-3)
    if tau < 1e-4:
        assert vardy_brown_weight(tau, reynolds) <= 1.001 * laminar_weight(tau) + 1.25


@examples(30)
@given(fluids(), log_range(1e-5, 1.0), log_range(1e-3, 1.0), log_range(1e6, 1e13))
def test_an_elastic_wall_slows_waves(fluid, diameter, wall, modulus):
    size = {"length": 1.0, "diameter": diameter, "pressure": 1e6}
    rigid = Line(**size)
    soft = Line(**size, wall_thickness=wall * diameter, wall_modulus=modulus)

    assert rigid.wave_speed(fluid) == pytest.approx(float(fluid.sound_speed(1e6)), rel=1e-12)
    assert 0.0 < soft.wave_speed(fluid) <= rigid.wave_speed(fluid)
    assert soft.echo_time(fluid) == pytest.approx(2.0 / soft.wave_speed(fluid), rel=1e-12)
