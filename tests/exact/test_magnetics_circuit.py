"""Magnetic circuits at rest against closed formulas, and the flat tables against the callables."""

from math import pi

import numpy as np
import pytest
from numpy.testing import assert_allclose

from klack.magnetics.circuit import MagneticBranch, MagneticCircuit
from klack.magnetics.iron import VACUUM_PERMEABILITY as MU0
from klack.magnetics.iron import brauer, froehlich, measured, tanh_curve
from klack.magnetics.iron_library import IRON_LIBRARY, iron_curve
from klack.magnetics.lifting_magnet import lifting_magnet
from klack.magnetics.reluctance import GapReluctance, LinearReluctance
from klack.magnetics.static import static_state
from klack.magnetics.tabulation import hermite_grid


def pair_of_poles(area=12e-6, core=None, leakage=5e-9, turns=60.0, remanence=0.0):
    """Two equal poles in series, perhaps with an iron core, and a leakage around the coil."""
    slope = 2.0 / (MU0 * area)
    gap = GapReluctance([1e-6, 1e-3], [slope * 1e-6, slope * 1e-3], [slope, slope])
    branches = [MagneticBranch(name="gap", law=gap, turns=turns, remanence=remanence)]
    if core is not None:
        branches.append(MagneticBranch(name="core", law=core.law(60e-3, area)))
    loops = [[1, 0] for _ in branches] + [[0, 1]]
    branches.append(MagneticBranch(name="leak", law=LinearReluctance(1 / leakage), turns=turns))
    return MagneticCircuit(branches=tuple(branches), loops=np.array(loops), main="gap")


@pytest.mark.parametrize(
    ("area", "turns", "current", "gap"),
    [(1.0, 1.0, 1.0, 1e-4), (12e-6, 60.0, 8.0, 80e-6)],  # [m^2], [-], [A], [m]
    ids=["unit scale", "valve scale"],
)
def test_two_poles_without_iron(area, turns, current, gap):
    state = static_state(pair_of_poles(area, turns=turns), current=current, gap=gap)

    flux = turns * current * MU0 * area / (2.0 * gap)
    assert state.branch_fluxes[0] == pytest.approx(flux, rel=1e-12)
    assert state.force == pytest.approx(-(flux**2) / (MU0 * area), rel=1e-12)
    assert state.linkage == pytest.approx(turns * flux + turns**2 * current * 5e-9, rel=1e-12)
    assert state.energy == pytest.approx(state.coenergy, rel=1e-12)  # linear
    assert state.inductance == pytest.approx(state.linkage / current, rel=1e-15)


@pytest.mark.parametrize("current", [0.5, 5.0, 40.0])  # [A]: linear, knee, deep saturation
def test_force_is_the_slope_of_energy_and_of_coenergy(current):
    circuit, gap, step = pair_of_poles(core=froehlich(1.5, 1500.0)), 80e-6, 2e-8

    state = static_state(circuit, current=current, gap=gap)
    near = [static_state(circuit, current=current, gap=gap + s) for s in (-step, step)]
    coenergy_slope = (near[1].coenergy - near[0].coenergy) / (2 * step)
    fluxes = state.branch_fluxes
    energy_slope = (circuit.energy(fluxes, gap + step) - circuit.energy(fluxes, gap - step)) / (
        2 * step
    )

    # central differences of 20 nm over 80 um: their own error is below 1e-6
    assert state.force == pytest.approx(coenergy_slope, rel=1e-6)
    assert state.force == pytest.approx(-energy_slope, rel=1e-6)
    assert state.energy + state.coenergy == pytest.approx(state.linkage * current, rel=1e-14)


def test_inductance_is_reciprocal_to_the_slope_of_coenergy():
    circuit, gap, step = pair_of_poles(core=froehlich(1.5, 1500.0)), 80e-6, 1e-4

    states = [static_state(circuit, current=8.0 + s, gap=gap) for s in (-step, 0.0, step)]

    slope = (states[2].coenergy - states[0].coenergy) / (2 * step)
    assert states[1].linkage == pytest.approx(slope, rel=1e-8)


def test_current_reversed_reverses_the_flux_and_keeps_the_force():
    circuit = pair_of_poles(core=tanh_curve(1.6, 2000.0))

    plus, minus = (static_state(circuit, current=i, gap=50e-6) for i in (9.0, -9.0))

    assert_allclose(minus.branch_fluxes, -plus.branch_fluxes, rtol=1e-12)
    assert minus.force == pytest.approx(plus.force, rel=1e-12)


def test_remanence_holds_without_current():
    circuit = pair_of_poles(remanence=20.0)

    state = static_state(circuit, current=0.0, gap=50e-6)

    flux = 20.0 * MU0 * 12e-6 / (2 * 50e-6)
    assert state.branch_fluxes[0] == pytest.approx(flux, rel=1e-12)
    assert state.force == pytest.approx(-(flux**2) / (MU0 * 12e-6), rel=1e-12)
    assert np.isnan(state.inductance)


def read_rows(table, x):
    """Value, slope and integral as a compiled loop reads them from the flat numbers."""
    rows = table[1:].reshape(int(table[0]), 6)
    i = max(int(np.searchsorted(rows[:, 0], x, side="right")) - 1, 0)
    start, y, a, b, c, w = rows[i]
    s = x - start
    value = y + s * (a + s * (b + s * c))
    integral = w + s * (y + s * (a / 2 + s * (b / 3 + s * c / 4)))
    return value, a + s * (2 * b + s * 3 * c), integral


@pytest.mark.parametrize("flux", [0.0, 1e-7, 7e-6, 19e-6, 90e-6])  # [Wb]
def test_iron_table_is_the_callable(flux):
    law = iron_curve("X6Cr17").law(20e-3, 12e-6)

    value, slope, energy = read_rows(law.table(), flux)

    assert value == pytest.approx(float(law.mmf(-flux, 0.0)) * -1.0, rel=1e-14)
    assert slope == pytest.approx(float(law.slope(-flux, 0.0)), rel=1e-14)
    assert energy == pytest.approx(float(law.energy(-flux, 0.0)), rel=1e-14)


@pytest.mark.parametrize("gap", [-5e-6, 0.0, 33e-6, 2e-3])  # [m]
def test_gap_table_is_the_callable(gap):
    law = GapReluctance.of(
        lambda x: (1e6 + 1e12 * x + 1e15 * x * x, 1e12 + 2e15 * x), np.linspace(0, 1e-3, 9)
    )

    value, slope, _ = read_rows(law.table(), gap)

    assert value == pytest.approx(float(law.reluctance_at(gap)), rel=1e-14)
    assert slope == pytest.approx(float(law.reluctance_slope_at(gap)), rel=1e-14)
    assert float(law.energy_slope(2e-6, gap)) == pytest.approx(2e-12 * slope, rel=1e-14)
    if gap < 0.0:
        assert value == pytest.approx(1e6 + 1e12 * gap, rel=1e-12)  # straight below the table


@pytest.mark.parametrize("name", sorted(IRON_LIBRARY))
def test_library_curves_rise_and_end_in_vacuum(name):
    curve = iron_curve(name)
    B = np.linspace(0.0, 5.0, 20001)

    H = curve.field(B)

    assert H[0] == 0.0
    assert np.all(np.diff(H) > 0)
    assert float(curve.field_slope(5.0)) * MU0 == pytest.approx(1.0, rel=1e-9)
    # the slope is continuous at every point of the table
    at = curve.flux_density[1:]
    assert_allclose(curve.field_slope(at * (1 - 1e-12)), curve.field_slope(at), rtol=1e-8)


def test_tanh_and_brauer_follow_their_formulas():
    H = np.array([3.0, 120.0, 900.0, 2e4, 1e6])
    B = MU0 * H + 1.6 * np.tanh(MU0 * 1999.0 * H / 1.6)
    flux_density = np.array([0.1, 0.8, 1.3, 1.6])

    assert_allclose(tanh_curve(1.6, 2000.0).field(B), H, rtol=1e-6)
    assert_allclose(
        brauer(0.5, 2.9, 160.0).field(flux_density),
        (0.5 * np.exp(2.9 * flux_density**2) + 160.0) * flux_density,
        rtol=1e-6,
    )


def test_initial_permeability_is_that_of_the_formula():
    for curve in (froehlich(2.0, 3000.0), tanh_curve(2.0, 3000.0)):
        assert float(curve.field_slope(0.0)) == pytest.approx(1.0 / (MU0 * 3000.0), rel=1e-12)


def test_measured_curve_passes_its_points_and_saturates():
    B, H = [0.5, 1.0, 1.4, 1.5], [80.0, 190.0, 900.0, 2500.0]

    curve = measured(B, H)

    assert_allclose(curve.field(B), H, rtol=1e-13)
    assert float(curve.field_slope(3.0)) == pytest.approx(1.0 / MU0, rel=1e-12)
    assert curve.flux_density_at(900.0) == pytest.approx(1.4, rel=1e-12)


def test_energy_density_is_the_integral_of_the_field():
    curve = iron_curve("AISI 1008")
    nodes, weights = np.polynomial.legendre.leggauss(200)
    B = 0.9 * (1.0 + nodes)

    assert float(curve.energy_density(1.8)) == pytest.approx(
        float(0.9 * weights @ curve.field(B)),
        rel=1e-5,  # quadrature across the knee
    )


def test_grid_keeps_its_promise():
    def curve(x):
        return np.exp(5.0 * x), 5.0 * np.exp(5.0 * x)

    x = hermite_grid(curve, 0.0, 1.0, tolerance=1e-8)
    law = GapReluctance.of(curve, x)
    dense = np.linspace(0.0, 1.0, 5001)

    assert np.max(np.abs(law.reluctance_at(dense) / np.exp(5.0 * dense) - 1.0)) < 1.1e-8
    assert np.all(np.diff(x) > 0)


def test_lifting_magnet_force_is_the_slope_of_its_coenergy():
    circuit, step = lifting_magnet(), 1e-7
    for gap in (0.3e-3, 1.1e-3, 4.2e-3):
        near = [static_state(circuit, current=1.2, gap=gap + s).coenergy for s in (-step, step)]
        force = static_state(circuit, current=1.2, gap=gap).force

        assert force == pytest.approx((near[1] - near[0]) / (2 * step), rel=1e-5)


def test_one_pole_area():
    # B = 1 T over 1 cm^2 pulls with 39.8 N: the number that every designer knows
    area = 1e-4
    R = 1.0 / (MU0 * area)
    circuit = MagneticCircuit(
        branches=(
            MagneticBranch(
                name="gap", law=GapReluctance([1e-5, 1e-3], [R * 1e-5, R * 1e-3], [R, R]), turns=1.0
            ),
        ),
        loops=np.array([[1]]),
        main="gap",
    )

    assert circuit.force(np.array([1e-4]), 1e-4) == pytest.approx(-39.789, rel=1e-5)
    assert 1.0 / (8e-7 * pi) * 1e-4 == pytest.approx(39.789, rel=1e-5)
