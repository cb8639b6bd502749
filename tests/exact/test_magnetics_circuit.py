"""Magnetic circuits: at rest, eddy currents, solid iron, maps.

Magnetic circuits at rest against closed formulas, and the flat tables against the callables.

Eddy ladders against the exact diffusion of flux into a cylinder and a sheet.

Shells of solid iron: the ladder written from the other end, and what a case may say of them.

Solenoid maps: exact for a linear coil, consistent everywhere, honest about a wrong force.
"""

from itertools import pairwise
from math import pi

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import iv

from klack.errors import AccuracyWarning, InputError
from klack.magnetics.circuit import MagneticBranch, MagneticCircuit
from klack.magnetics.eddy import cylinder_ladder, sheet_ladder
from klack.magnetics.flux_map import FluxMap
from klack.magnetics.iron import VACUUM_PERMEABILITY, brauer, froehlich, measured, tanh_curve
from klack.magnetics.iron import VACUUM_PERMEABILITY as MU0
from klack.magnetics.iron_library import IRON_LIBRARY, iron_curve
from klack.magnetics.lifting_magnet import lifting_magnet
from klack.magnetics.reluctance import GapReluctance, LinearReluctance
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.solenoid_parts import IronPart
from klack.magnetics.solid_iron import shells
from klack.magnetics.static import static_state
from klack.magnetics.tabulation import hermite_grid
from klack.magnetics.voltage_step import VoltageStep
from klack.verification.drivers import run_coil


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


SIGMA, LENGTH, A, MU_R, WIDTH = 1.6e6, 20e-3, 2e-3, 600.0, 9e-3
TAU = MU0 * MU_R * SIGMA * A**2


def cylinder(terms):
    R = LENGTH / (MU0 * MU_R * pi * A**2)
    ladder = cylinder_ladder(
        conductivity=SIGMA, length=LENGTH, radius=A, permeability=MU_R, terms=terms
    )
    return R, ladder, lambda z: z * iv(0, z) / (2 * iv(1, z))


def sheet(terms):
    R = LENGTH / (MU0 * MU_R * A * WIDTH)
    ladder = sheet_ladder(
        conductivity=SIGMA, length=LENGTH, thickness=A, width=WIDTH, permeability=MU_R, terms=terms
    )
    return R, ladder, lambda z: 0.5 * z / np.tanh(0.5 * z)


@pytest.mark.parametrize("body", [cylinder, sheet])
def test_more_terms_are_better_and_four_reach_omega_tau_30(body):
    frequency = 30.0
    exact = body(1)[2](np.sqrt(1j * frequency))

    errors = []
    for terms in (1, 2, 3, 4):
        R, ladder, _ = body(terms)
        errors.append(abs(1 + ladder.mmf_per_flux(1j * frequency / TAU) / R - exact) / abs(exact))

    assert all(later < 0.4 * earlier for earlier, later in pairwise(errors))
    assert errors[-1] < 2e-3


@pytest.mark.parametrize("body", [cylinder, sheet])
def test_first_terms_of_the_power_series(body):
    # a ladder of n terms is exact to order 2n - 1 in s tau
    for terms in (1, 2, 3):
        R, ladder, exact = body(terms)
        errors = [
            abs(1 + ladder.mmf_per_flux(1j * w / TAU) / R - exact(np.sqrt(1j * w)))
            for w in (0.5, 1.0)
        ]

        assert np.log2(errors[1] / errors[0]) == pytest.approx(2 * terms, abs=0.1)


@pytest.mark.parametrize("body", [cylinder, sheet])
@pytest.mark.parametrize("frequency", [0.1, 10.0, 1e4])
def test_ladder_is_passive(body, frequency):
    _, ladder, _ = body(4)

    impedance = ladder.mmf_per_flux(1j * frequency / TAU)

    assert impedance.imag > 0  # loses power
    assert impedance.real >= 0  # stores energy


def test_static_flux_passes():
    assert cylinder(3)[1].mmf_per_flux(0.0) == 0.0


@pytest.mark.parametrize("terms", [1, 2, 4])
def test_loops_of_a_solenoid_are_the_ladder(terms):
    solenoid = Solenoid(
        turns=1,
        resistance=1.0,
        gap=1e-4,
        residual_gap=5e-5,
        poles=[{"outer_radius": 3e-3, "fringing": "none"}],
        leakage=1e-9,
        eddy=[
            {
                "conductivity": SIGMA,
                "length": LENGTH,
                "radius": A,
                "terms": terms,
                "permeability": MU_R,
            }
        ],
    )
    circuit, s = solenoid.circuit(), 2j * pi * 3e3
    slope = np.array(
        [
            b.law.reluctance if isinstance(b.law, LinearReluctance) else float(b.law.slope(0, 1e-4))
            for b in circuit.branches
        ]
    )
    C = circuit.loops

    impedance = C.T @ ((slope + s * circuit.eddy)[:, None] * C)
    fluxes = np.linalg.solve(impedance, circuit.loop_turns)

    gap = 1.5e-4 / (MU0 * pi * 9e-6)
    ladder = cylinder_ladder(
        conductivity=SIGMA, length=LENGTH, radius=A, permeability=MU_R, terms=terms
    )
    assert 1.0 / fluxes[0] == pytest.approx(gap + ladder.mmf_per_flux(s), rel=1e-9)
    assert fluxes[1] == pytest.approx(1e-9, rel=1e-12)
    assert C.shape[1] == 1 + terms


def test_too_many_terms():
    with pytest.raises(InputError, match="expected 1 to 4"):
        cylinder(5)


MAGNET = {
    "turns": 60,
    "resistance": 0.8,
    "gap": 1e-4,
    "residual_gap": 3e-5,
    "poles": [{"outer_radius": 3e-3, "fringing": "none"}],
    "leakage": 2e-8,
}
IRON = {"material": "X6Cr17", "length": 2e-2, "area": 3e-5}


@pytest.mark.parametrize("terms", [1, 2, 3, 4])
@pytest.mark.parametrize("shape", ["cylinder", "sheet"])
def test_they_are_the_ladder_and_its_core(shape, terms):
    core = {"conductivity": 2e6, "length": 1e-2, "permeability": 700.0, "terms": terms}
    if shape == "cylinder":
        ladder = cylinder_ladder(**core, radius=2e-3)
        R, size = 1e-2 / (VACUUM_PERMEABILITY * 700.0 * np.pi * 4e-6), 2e6 * 1e-2 / np.pi
    else:
        ladder = sheet_ladder(**core, thickness=2e-3, width=5e-3)
        R, size = 1e-2 / (VACUUM_PERMEABILITY * 700.0 * 1e-5), 2e6 * 1e-2 * 2e-3 / 5e-3
    parts = shells(shape, terms)

    for s in (1e2, 1e4j, 1e6 * (1 + 1j)):
        value = 0.0
        for w, q in zip(parts.shares[::-1], parts.turns[::-1], strict=True):
            admittance = w / R + (1.0 / value if value else 0.0)
            value = s * q * size + 1.0 / admittance
        assert value == pytest.approx(R + ladder.mmf_per_flux(s), rel=1e-12)
    assert sum(parts.shares) == pytest.approx(1.0, rel=1e-14)
    assert min(*parts.shares, *parts.turns) > 0.0


def test_at_rest_they_are_the_iron():
    plain = Solenoid(**MAGNET, iron=[IRON])
    solid = Solenoid(**MAGNET, iron=[{**IRON, "eddy": {"conductivity": 2e6, "terms": 4}}])

    for current in (0.5, 5.0, 20.0):
        states = [static_state(s.circuit(), current=current, gap=5e-5) for s in (plain, solid)]
        assert states[1].force == pytest.approx(states[0].force, rel=1e-7)
        assert states[1].linkage == pytest.approx(states[0].linkage, rel=1e-7)


@pytest.mark.parametrize("hysteresis", [None, {"coercivity": 300.0, "initial_permeability": 150}])
def test_a_stroke_keeps_its_energy(hysteresis):
    solid = Solenoid(
        **MAGNET,
        iron=[{**IRON, "hysteresis": hysteresis, "eddy": {"conductivity": 2e6, "terms": 3}}],
    )

    run = run_coil(
        solid.circuit(),
        VoltageStep(voltage=24.0, end=3e-4, decay=48.0).program(),
        resistance=0.8,
        gap=1e-4,
        step=1e-6,
        lift=9e-5 * np.sin(np.linspace(0.0, np.pi, 801)) ** 2,
    )

    assert run.residual < 1e-13
    assert run.eddy > 0.0
    assert (run.hysteresis > 0.0) == (hysteresis is not None)


def test_one_shell_is_one_turn():
    ladder = Solenoid(**MAGNET, iron=[IRON], eddy=[
        {"conductivity": 2e6, "length": 2e-2, "radius": float(np.sqrt(3e-5 / np.pi))}])  # fmt: skip
    shell = Solenoid(**MAGNET, iron=[{**IRON, "eddy": {"conductivity": 2e6, "terms": 1}}])

    drive, lift = VoltageStep(voltage=24.0).program(), np.zeros(301)
    runs = [
        run_coil(s.circuit(), drive, resistance=0.8, gap=1e-4, step=1e-6, lift=lift)
        for s in (ladder, shell)
    ]

    np.testing.assert_allclose(runs[1].current, runs[0].current, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    ("eddy", "words"),
    [
        ({"conductivity": 2e6, "thickness": 1e-3}, "thickness together with shape: cylinder"),
        ({"conductivity": 2e6, "shape": "sheet"}, "no key 'thickness'"),
        ({"conductivity": 2e6, "terms": 5}, "less than or equal to 4"),
        ({"conductivity": 0.0}, "greater than 0"),
    ],
)
def test_errors_say_what_to_do(eddy, words):
    with pytest.raises(ValueError, match=words):
        IronPart(**IRON, eddy=eddy)


def test_too_many_terms_are_one_clear_error():
    solid = {**IRON, "eddy": {"conductivity": 2e6, "terms": 4}}
    with pytest.raises(ValueError, match=r"4 \+ 4 terms"):
        Solenoid(**MAGNET, iron=[solid, solid])


CURRENT = np.linspace(0.0, 10.0, 21)
GAP = np.linspace(20e-6, 120e-6, 21)


def inductance(x):
    return 1e-8 / (x + 50e-6)  # [H], 60 turns on some mm^2


def linear_map():
    return FluxMap.of(
        current=CURRENT, gap=GAP, linkage=CURRENT[:, None] * inductance(GAP), force=None
    )


def saturating_map():
    linkage = np.tanh(CURRENT[:, None] * inductance(GAP) / 8e-4) * 8e-4 + 1e-5 * CURRENT[:, None]
    return FluxMap.of(current=CURRENT, gap=GAP, linkage=linkage, force=None)


@pytest.mark.parametrize(("current", "gap"), [(3.3, 33e-6), (9.9, 101e-6)])
def test_linear_coil(current, gap):
    made = linear_map()
    psi = current * inductance(gap)

    # splines over 21 gaps: 4th order, 5 um against a scale of 70 um
    assert made.current_at(psi, gap) == pytest.approx(current, rel=1e-5)
    assert made.energy_at(psi, gap) == pytest.approx(0.5 * psi * current, rel=1e-5)
    force = -0.5 * current**2 * 1e-8 / (gap + 50e-6) ** 2
    assert made.force_at(psi, gap) == pytest.approx(force, rel=1e-3)


@pytest.mark.parametrize("linkage", [1e-5, 3e-4, 8.1e-4, 1.4e-3])
@pytest.mark.parametrize("gap", [10e-6, 20e-6, 47e-6, 140e-6])
def test_current_and_force_are_slopes_of_one_energy(linkage, gap):
    made = saturating_map()
    d, e = 1e-5 * linkage, 1e-9

    current = (made.energy_at(linkage + d, gap) - made.energy_at(linkage - d, gap)) / (2 * d)
    force = -(made.energy_at(linkage, gap + e) - made.energy_at(linkage, gap - e)) / (2 * e)

    assert made.current_at(linkage, gap) == pytest.approx(current, rel=1e-6)
    assert made.force_at(linkage, gap) == pytest.approx(force, rel=1e-4, abs=1e-6)


def test_map_is_even_in_force_and_odd_in_current():
    made = saturating_map()

    assert made.current_at(-3e-4, 5e-5) == -made.current_at(3e-4, 5e-5)
    assert made.force_at(-3e-4, 5e-5) == made.force_at(3e-4, 5e-5)


@pytest.mark.parametrize(("k", "u", "j", "v"), [(0, 0.3, 0, 0.7), (57, 0.5, 13, 0.25)])
def test_flat_table_is_the_surface(k, u, j, v):
    made = saturating_map()
    table = made.table()
    m, n, step = int(table[0]), int(table[1]), table[2]
    gaps = table[3 : 3 + n]
    cells = table[3 + n :].reshape(m - 1, n - 1, 4, 4)

    energy = u ** np.arange(4) @ cells[k, j] @ v ** np.arange(4)

    psi, gap = (k + u) * step, gaps[j] + v * (gaps[j + 1] - gaps[j])
    assert energy == pytest.approx(made.energy_at(psi, gap), rel=1e-12)


def test_contradicting_force_is_reported_and_not_used():
    linkage = CURRENT[:, None] * inductance(GAP)
    force = 0.5 * np.array([[-(i**2) * 1e-8 / (x + 50e-6) ** 2 for x in GAP] for i in CURRENT])

    with pytest.warns(AccuracyWarning, match="only it conserves energy"):
        made = FluxMap.of(current=CURRENT, gap=GAP, linkage=linkage, force=1.3 * force)

    assert made.force_at(10 * inductance(60e-6), 60e-6) == pytest.approx(
        -0.5 * 100 * 1e-8 / (110e-6) ** 2, rel=1e-3
    )


def test_agreeing_force_is_accepted(recwarn):
    linkage = CURRENT[:, None] * inductance(GAP)
    force = 0.5 * np.array([[-(i**2) * 1e-8 / (x + 50e-6) ** 2 for x in GAP] for i in CURRENT])

    FluxMap.of(current=CURRENT, gap=GAP, linkage=linkage, force=force)

    assert not [w for w in recwarn if issubclass(w.category, AccuracyWarning)]


@pytest.mark.parametrize(
    ("current", "linkage", "words"),
    [
        ([0.0, 1.0], np.ones((2, 2)), "a linkage for each"),
        ([0.0, 1.0], np.ones((2, 21)), "not increasing"),
        ([1.0, 0.5], np.ones((2, 21)), "not increasing"),
    ],
    ids=["shape", "remanence", "falling"],
)
def test_bad_tables(current, linkage, words):
    with pytest.raises(InputError, match=words):
        FluxMap.of(current=current, gap=GAP, linkage=linkage, force=None)


def small_coil(scale, soft, current):
    """Linkage of a coil that saturates sooner the smaller ``soft`` is."""
    gap = np.linspace(10e-6, 30e-6, 4)
    i = np.array(current)[:, None]
    linkage = scale * (np.tanh(i / (soft * (gap + 20e-6) / 20e-6)) + 0.02 * i)
    return FluxMap.of(current=current, gap=gap, linkage=linkage, force=None)


def test_current_rises_everywhere_on_a_map_that_saturates_within_its_first_row():
    """Energy like psi^4 within one cell: the plain cubic through it would bend downwards."""
    made = small_coil(0.14, 0.1, [0.0, 0.9, 3.2])

    for gap in np.linspace(made.gap[0], made.gap[-1], 7):
        current = [made.current_at(psi, gap) for psi in np.geomspace(1e-9, 0.15, 200)]
        assert np.all(np.diff(current) > 0.0)


def test_a_table_that_jumps_between_two_gaps_is_refused():
    """Splines over such gaps swing, and somewhere the current falls with rising linkage."""
    current, gap = [1.0, 2.0, 3.0], [1e-5, 2e-5, 3e-5, 4e-5, 5e-5]
    rise = np.array([[1.0, 1.0, 1.0, 1.0, 1.0], [5e-3, 5e-3, 1.0, 5e-3, 5e-3], [1.0] * 5])

    with pytest.raises(InputError, match="too abruptly between the gaps 10 um and 20 um"):
        FluxMap.of(current=current, gap=gap, linkage=1e-3 * np.cumsum(rise, axis=0), force=None)


@pytest.mark.parametrize("volts", [5.0, 45.0])
def test_a_coil_far_beyond_its_map_takes_its_ohmic_current(volts):
    """Fifty times the current of the map: the iteration ends at the last digits of the linkage."""
    made = small_coil(5e-7, 1.0, np.linspace(0.0, 1.0, 5))
    lift = np.linspace(0.0, -1e-6, 101)
    run = run_coil(
        made,
        VoltageStep(voltage=volts).program(),
        resistance=1.0,
        gap=30e-6,
        step=1e-6,
        lift=lift,
    )

    assert run.current[-1] == pytest.approx(volts, rel=1e-3)  # the moving armature induces a little
    assert run.residual < 1e-14


def test_a_coil_without_slope_at_rest_starts():
    """Its first row rose like psi^3, without slope at zero, and no flux was found."""
    run = run_coil(
        small_coil(0.14, 0.1, [0.0, 0.9, 3.2]),
        VoltageStep(voltage=13.0).program(),
        resistance=1.0,
        gap=30e-6,
        step=0.3e-6,
        lift=np.zeros(101),
    )

    # almost all of the voltage becomes flux
    assert run.flux[-1] == pytest.approx(13.0 * 30e-6, rel=1e-3)
    assert run.residual < 1e-14
