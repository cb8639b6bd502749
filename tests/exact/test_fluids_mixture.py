"""Truth: closed formulas of one liquid, of bubbles (Wood 1930) and of boiling at equilibrium."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

from klack.hydraulics.fluid import Fluid
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.liquid import (
    Murnaghan,
    TabulatedLiquid,
    Tait,
    barus_viscosity,
    walther_viscosity,
)
from klack.hydraulics.mixture import EntrainedGas, Vapour

FUEL = Murnaghan(density_at_reference=684.0, bulk_modulus_at_reference=9.08e8, slope=12.0)
OIL = Tait(density_at_zero=856.8, bulk_modulus_at_zero=1.5e9, slope=10.9)
TABLE = TabulatedLiquid([1e5, 1e6, 5e6, 2e7], [684.0, 684.7, 687.8, 698.4])


def mixture(gas: EntrainedGas, vapour: Vapour | None = None, liquid=FUEL) -> Fluid:
    return Fluid(
        name="mixture",
        temperature=293.15,
        liquid=liquid,
        base_viscosity=4e-4,
        vapour=vapour or Vapour(pressure=10.0, density=4e-4, half_width=5.0),
        gas=gas,
    )


@pytest.mark.parametrize("liquid", [FUEL, OIL, TABLE], ids=["Murnaghan", "Tait", "table"])
def test_liquid_stiffness_belongs_to_its_density(liquid):
    p = np.array([2e5, 3e6, 1.1e7, 3e7])
    h = 2e-4 * p  # central difference: error (h/p)^2, round-off 1e-16 K/h
    slope = (liquid.density(p + h) - liquid.density(p - h)) / (2.0 * h)
    np.testing.assert_allclose(liquid.density(p) / slope, liquid.bulk_modulus(p), rtol=1e-6)


def test_murnaghan_stiffens_linearly():
    assert float(FUEL.bulk_modulus(101_325.0 + 1e7)) == pytest.approx(9.08e8 + 12e7, rel=1e-15)
    assert float(FUEL.density(101_325.0)) == 684.0
    near = 101_325.0 + 1.0
    assert float(FUEL.density(near)) / 684.0 - 1.0 == pytest.approx(1.0 / 9.08e8, rel=1e-6)


def test_table_runs_through_its_points_and_on_as_a_line():
    np.testing.assert_allclose(TABLE.density(TABLE.pressure), TABLE.density_points, rtol=1e-15)
    inside = np.linspace(1e5, 2e7, 50)
    exact = PchipInterpolator(TABLE.pressure, TABLE.density_points)(inside)
    np.testing.assert_allclose(TABLE.density(inside), exact, rtol=1e-14)
    step = np.diff(TABLE.density([2e7, 3e7, 4e7]))
    assert step[0] == pytest.approx(step[1], rel=1e-12)
    assert np.all(TABLE.bulk_modulus([1.0, 1e5, 2e7, 3e8]) > 0.0)


def test_viscosity_laws():
    T = 313.15
    assert float(walther_viscosity(T, 9.32, 3.65)) * 1e6 == pytest.approx(
        10.0**10.0 ** (9.32 - 3.65 * np.log10(T)) - 0.7, rel=1e-9
    )
    assert float(barus_viscosity(4e-4, 1e-8, 1e8 + 1e5, 1e5)) == pytest.approx(4e-4 * np.e)


@pytest.mark.parametrize("nu", [0.3, 0.6, 1.0, 1.9, 3.0])
def test_thin_liquids_follow_the_full_standard(nu):
    """ASTM D341 gives Z(nu) and, separately fitted, nu(Z): they agree within 0.5 %."""
    Z = nu + 0.7 + np.exp(-1.47 - 1.84 * nu - 0.51 * nu**2)
    b = 3.7
    a = np.log10(np.log10(Z)) + b * np.log10(300.0)
    assert float(walther_viscosity(300.0, a, b)) * 1e6 == pytest.approx(nu, rel=5e-3)


@pytest.mark.parametrize("fraction", [1e-4, 1e-3, 1e-2])
@pytest.mark.parametrize("exponent", [1.0, 1.4])
def test_bubbles_follow_wood(fraction, exponent):
    fluid = mixture(EntrainedGas(fraction=fraction, exponent=exponent))
    for p in (2e4, 101_325.0, 6e5, 1e7):
        gas = fraction * (101_325.0 / p) ** (1.0 / exponent)
        liquid = (1.0 - fraction) * 684.0 / float(FUEL.density(p))
        share = gas / (gas + liquid)
        K = 1.0 / (share / (exponent * p) + (1.0 - share) / float(FUEL.bulk_modulus(p)))
        rho = ((1.0 - fraction) * 684.0 + fraction * 1.204) / (gas + liquid)
        assert float(fluid.bulk_modulus(p)) == pytest.approx(K, rel=1e-12)
        assert float(fluid.density(p)) == pytest.approx(rho, rel=1e-12)
        assert float(fluid.sound_speed(p)) == pytest.approx(np.sqrt(K / rho), rel=1e-12)


def test_dissolved_gas_leaves_the_pure_liquid():
    gas = EntrainedGas(fraction=1e-2, release_pressure=2e5, saturation_pressure=8e5)
    fluid, free = mixture(gas), mixture(EntrainedGas(fraction=1e-2))
    assert float(fluid.bulk_modulus(9e5)) == pytest.approx(float(FUEL.bulk_modulus(9e5)), rel=1e-13)
    assert float(fluid.density(1e5)) == pytest.approx(float(free.density(1e5)), rel=1e-14)
    assert float(fluid.bulk_modulus(5e5)) < float(free.bulk_modulus(5e5))


def test_boiling_is_half_done_at_the_vapour_pressure_and_leaves_ideal_vapour():
    vapour = Vapour(pressure=4722.0, density=0.194, half_width=1500.0)
    fluid = mixture(EntrainedGas(), vapour)
    rho_l = float(FUEL.density(4722.0))
    assert fluid.kinks == (3222.0, 6222.0)
    assert float(fluid.density(4722.0)) == pytest.approx(0.5 * (rho_l + 0.194), rel=1e-13)
    assert float(fluid.density(1000.0)) == pytest.approx(0.194 * 1000.0 / 4722.0, rel=1e-12)
    assert float(fluid.bulk_modulus(1000.0)) == pytest.approx(1000.0, rel=1e-12)
    assert float(fluid.bulk_modulus(6223.0)) == pytest.approx(
        float(FUEL.bulk_modulus(6223.0)), rel=1e-12
    )


def test_a_narrower_band_comes_nearer_to_the_plateau():
    """A tenth of vapour: its pressure falls to the vapour pressure in proportion to the width."""
    excess = []
    for half_width in (2000.0, 1000.0, 500.0, 250.0):
        fluid = mixture(
            EntrainedGas(), Vapour(pressure=4722.0, density=0.194, half_width=half_width)
        )

        def missing(p, fluid=fluid):
            return float(fluid.density(p)) - 0.9 * 684.0

        excess.append(brentq(missing, *fluid.kinks, xtol=1e-9) - 4722.0)

    order = np.polyfit(np.log([2000.0, 1000.0, 500.0, 250.0]), np.log(excess), 1)[0]
    assert order == pytest.approx(1.0, abs=1e-3)


@settings(max_examples=60, deadline=None)
@given(
    boiling=st.floats(2.0, 2e5),
    width=st.floats(10.0, 2e4),
    fraction=st.sampled_from([0.0, 1e-5, 1e-3, 0.05]),
    saturation=st.sampled_from([None, 3e5, 5e6]),
)
def test_density_rises_everywhere_and_stiffness_belongs_to_it(boiling, width, fraction, saturation):
    gas = EntrainedGas(
        fraction=fraction,
        release_pressure=saturation and 0.3 * saturation,
        saturation_pressure=saturation,
    )
    fluid = mixture(gas, Vapour(pressure=boiling, density=4e-5 * boiling, half_width=width))
    p = np.geomspace(1.0, 3e8, 5000)
    rho = fluid.density(p)

    assert np.all(np.diff(rho) > 0.0)
    assert np.all(fluid.bulk_modulus(p) > 0.0)
    at = p[1:][np.all(np.abs(p[1:, None] / np.array(fluid.kinks) - 1.0) > 1e-2, axis=1)]
    h = 1e-4 * np.minimum(at, width)
    slope = (fluid.density(at + h) - fluid.density(at - h)) / (2.0 * h)
    # a difference of densities keeps digits only where the fluid is soft against h
    soft = fluid.bulk_modulus(at) < 1e7 * h
    assert np.count_nonzero(soft) > 300
    np.testing.assert_allclose(
        (fluid.density(at) / slope)[soft], fluid.bulk_modulus(at)[soft], 1e-3
    )


def test_every_fluid_of_the_library_passes_to_vapour_and_3000_bar():
    for name in ("n-heptane", "water", "ISO 4113", "diesel", "ISO VG 32", "ISO VG 46", "DOT 4"):
        fluid = library_fluid(name).at(293.15, gas_fraction=1e-3)
        p = np.geomspace(1.0, 3e8, 3000)
        assert np.all(np.diff(fluid.density(p)) > 0.0)
        assert float(fluid.density(1.0)) < 1.0
