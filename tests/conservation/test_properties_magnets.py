"""Truth: energy and reciprocity. What holds for every iron, gap, circuit, map and driver.

Iron from 0.5 to 3 T and a permeability from 2 to 1e5, poles from 0.1 mm to 0.1 m, currents to
100 A, gaps from shut to far open.
"""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, reject
from hypothesis import strategies as st
from property_profiles import examples, log_range

from klack.errors import ConvergenceError, InputError
from klack.magnetics.air_gap import edge_on_plane, edges_beside_wall, equal_edges, slot_loss
from klack.magnetics.eddy import cylinder_ladder, sheet_ladder
from klack.magnetics.flux_map import FluxMap
from klack.magnetics.iron import (
    VACUUM_PERMEABILITY,
    IronCurve,
    brauer,
    froehlich,
    measured,
    tanh_curve,
)
from klack.magnetics.peak_hold import PeakHold
from klack.magnetics.pwm import PulseWidth
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.static import static_state
from klack.magnetics.two_point import TwoPoint
from klack.magnetics.voltage_step import VoltageStep
from klack.magnetics.voltage_table import VoltageTable
from klack.verification.drivers import run_coil


@st.composite
def measured_curves(draw) -> IronCurve:
    """Points of any rising curve."""
    density = np.cumsum(draw(st.lists(st.floats(0.05, 0.5), min_size=1, max_size=12)))
    field = np.cumsum(draw(st.lists(log_range(1.0, 3e4), min_size=12, max_size=12)))
    return measured(density, field[: density.size])


SATURATION, PERMEABILITY = st.floats(0.5, 3.0), log_range(2.0, 1e5)
IRONS = st.one_of(
    st.builds(froehlich, SATURATION, PERMEABILITY),
    st.builds(tanh_curve, SATURATION, PERMEABILITY),
    st.builds(brauer, log_range(1e-2, 100.0), st.floats(0.5, 4.0), log_range(1.0, 1e4)),
    measured_curves(),
)


@examples(40)
@given(IRONS, st.lists(st.floats(-4.0, 4.0), min_size=2, max_size=20).map(sorted))
def test_iron_is_odd_rises_and_stores(iron, densities):
    B = np.array(densities)
    H, slope, energy = iron.field(B), iron.field_slope(B), iron.energy_density(B)

    assert np.array_equal(iron.field(-B), -H)
    assert np.array_equal(iron.energy_density(-B), energy)
    assert iron.field(0.0) == 0.0
    assert np.all(slope > 0.0)
    rises = np.diff(B) > 1e-9
    assert np.all(np.diff(H)[rises] > 0.0)
    # never worse than the vacuum, and a convex energy: W + W* = H B
    assert np.all(slope <= (1.0 + 1e-6) / VACUUM_PERMEABILITY)
    assert np.all(energy >= 0.0)
    assert np.all(H * B - energy >= -1e-12 * np.abs(H * B))
    for b, h in zip(densities, H, strict=True):
        assert iron.flux_density_at(float(h)) == pytest.approx(b, rel=1e-9, abs=1e-12)


@examples(60)
@given(log_range(1e-7, 1e-2), log_range(1e-7, 1e-1), log_range(1.001, 100.0))
def test_edges_of_gaps_are_slopes_of_themselves(gap, size, more):
    """Edge flux above zero; less from edge to edge the wider the gap."""
    for edges in (equal_edges, edge_on_plane, edges_beside_wall, slot_loss):
        c, slope = edges(gap, size)
        d = 1e-5 * gap
        up, down = edges(gap + d, size)[0], edges(gap - d, size)[0]
        # round-off of the difference, 1e-16/1e-5 of the value
        scale = 1e-10 * abs(c) / gap
        assert slope == pytest.approx((up - down) / (2.0 * d), rel=1e-6, abs=scale)
        assert c > 0.0
        if edges in (equal_edges, edge_on_plane):
            assert edges(more * gap, size)[0] < c


@st.composite
def solenoids(draw) -> Solenoid:
    """Coils of every size with one or two poles, iron and eddy currents."""
    size = draw(log_range(1e-4, 0.1))
    gap = draw(log_range(1e-3, 0.3)) * size
    edge = draw(st.sampled_from(["none", "equal", "plane"]))
    around = {"fringing": edge} if edge == "none" else {"fringing": edge, "shoulder": size}
    poles = [{"inner_radius": 0.3 * size, "outer_radius": size, **around}]
    if draw(st.booleans()):
        poles.append({"inner_radius": 1.5 * size, "outer_radius": 1.8 * size, "fringing": "none"})
    iron = [
        {
            "material": draw(st.sampled_from(["X6Cr17", "VACOFLUX 50", "Mu-metal"])),
            "length": draw(log_range(0.5, 10.0)) * size,
            "area": draw(log_range(0.5, 5.0)) * size**2,
        }
        for _ in range(draw(st.integers(0, 2)))
    ]
    return Solenoid(
        turns=float(draw(st.integers(1, 500))),
        resistance=draw(log_range(0.05, 50.0)),
        gap=gap,
        residual_gap=draw(log_range(0.05, 1.0)) * gap,
        poles=poles,
        iron=iron,
        leakage_share=draw(st.floats(0.01, 0.5)),
        eddy=[{"conductivity": 2e6, "length": 3 * size, "radius": size, "terms": 1}]
        if draw(st.booleans())
        else [],
        residual_flux=draw(st.sampled_from([0.0, 0.05])) * size**2,
    )


@examples(20)
@given(solenoids(), st.floats(0.0, 1.0), log_range(1e-3, 100.0))
def test_a_magnet_pulls_with_the_slope_of_its_coenergy(magnet, open_share, current):
    circuit = magnet.circuit()
    x = open_share * magnet.gap
    d = 1e-5 * magnet.residual_gap
    state, less, more = (static_state(circuit, current=current, gap=z) for z in (x, x - d, x + d))

    assert state.energy + state.coenergy == pytest.approx(state.linkage * current, rel=1e-12)
    assert state.force < 0.0
    force = (more.coenergy - less.coenergy) / (2.0 * d)
    # round-off: 1e-13 of the energy over 1e-5 of the gap
    noise = 1e-14 * (abs(state.coenergy) + abs(state.energy)) / d * 10.0
    assert state.force == pytest.approx(force, rel=1e-4, abs=noise)
    # reciprocity: dpsi/dx at constant current = dF/di at constant gap
    e = 1e-4 * current
    left, right = (static_state(circuit, current=current + z, gap=x) for z in (-e, e))
    pull = (right.force - left.force) / (2.0 * e)
    change = (more.linkage - less.linkage) / (2.0 * d)
    # the differences see the second derivatives of the tables, which jump
    scale = abs(state.linkage) / magnet.residual_gap
    assert pull == pytest.approx(change, rel=1e-3, abs=1e-4 * scale)
    assert right.linkage > left.linkage


FINE = np.linspace(0.0, 1.0, 60)


@st.composite
def flux_maps(draw) -> FluxMap:
    """Tables of a saturating coil, psi = N B A tanh(i / i_s(x)) + L i, sampled anyhow.

    One in a hundred saturates so much between two gaps that it is refused.
    """
    gaps = np.cumsum(draw(st.lists(st.floats(0.3, 1.0), min_size=3, max_size=12))) * 1e-5
    currents = np.cumsum([0.0, *draw(st.lists(st.floats(0.2, 1.0), min_size=2, max_size=12))])
    scale, soft = draw(log_range(1e-5, 1.0)), draw(log_range(0.5, 50.0))
    rest = draw(log_range(1e-6, 1e-4))
    bend = soft * (gaps + rest) / rest
    linkage = scale * (np.tanh(currents[:, None] / bend) + 0.02 * currents[:, None])
    try:
        return FluxMap.of(current=currents, gap=gaps, linkage=linkage, force=None)
    except InputError:
        reject()


@st.composite
def rough_maps(draw) -> FluxMap | None:
    """Any table that increases with the current; None where it is refused."""
    count, gaps = draw(st.integers(2, 6)), draw(st.integers(3, 6))
    rises = st.lists(log_range(0.1, 1.0), min_size=gaps, max_size=gaps)
    table = np.cumsum([draw(rises) for _ in range(count)], axis=0)
    try:
        return FluxMap.of(
            current=np.cumsum(draw(st.lists(log_range(0.1, 1.0), min_size=count, max_size=count))),
            gap=1e-5 * np.cumsum(draw(rises)),
            linkage=draw(log_range(1e-5, 1.0)) * table,
            force=None,
        )
    except InputError:
        return None


@pytest.mark.slow
@examples(12)
@given(rough_maps(), st.floats(0.0, 1.0))
def test_current_rises_on_every_map_that_is_not_refused(plant, place):
    assume(plant is not None)
    gap = float(plant.gap[0] + place * np.ptp(plant.gap))
    current = [plant.current_at(psi, gap) for psi in 1.2 * plant.linkage[-1] * FINE]
    # round-off of one evaluation, where a current hardly rises
    assert np.all(np.diff(current) > -1e-13 * current[-1])


@pytest.mark.slow
@examples(40)
@given(flux_maps(), st.floats(-1.5, 1.5), st.floats(-0.2, 1.3))
def test_a_map_is_one_energy(plant, share, place):
    psi = share * float(plant.linkage[-1])
    x = float(plant.gap[0] + place * np.ptp(plant.gap))
    h, d = 1e-5 * float(plant.linkage[1]), 1e-5 * float(np.diff(plant.gap).min())
    # a patch is C1: keep both sides of a difference in one patch
    assume(abs(psi) % plant.linkage[1] > 2 * h)
    assume(np.abs(plant.gap - x).min() > 2 * d)
    W, i = plant.energy_at(psi, x), plant.current_at(psi, x)

    noise = 1e-15 * np.abs(plant.energy).max()
    slope = (plant.energy_at(psi + h, x) - plant.energy_at(psi - h, x)) / (2.0 * h)
    assert i == pytest.approx(slope, rel=1e-6, abs=10.0 * noise / h)
    pull = -(plant.energy_at(psi, x + d) - plant.energy_at(psi, x - d)) / (2.0 * d)
    assert plant.force_at(psi, x) == pytest.approx(pull, rel=1e-4, abs=10.0 * noise / d)
    assert plant.current_at(-psi, x) == -i
    assert plant.energy_at(-psi, x) == W
    if 0.0 <= place <= 1.0:
        assert W >= -noise
        assert i * psi >= 0.0
    # reciprocity: di/dx = -dF/dpsi, both are the mixed slope of one energy
    across = (plant.current_at(psi, x + d) - plant.current_at(psi, x - d)) / (2.0 * d)
    along = -(plant.force_at(psi + h, x) - plant.force_at(psi - h, x)) / (2.0 * h)
    tiny = 1e-14 * (np.abs(plant.current).max() / d + np.abs(plant.slope).max() / h)
    assert across == pytest.approx(along, rel=1e-4, abs=10.0 * tiny)


@examples(60)
@given(
    st.sampled_from(["cylinder", "sheet"]),
    st.integers(1, 4),
    log_range(1e3, 1e8),
    log_range(1e-4, 0.1),
    log_range(1e-5, 0.1),
    log_range(1.0, 1e5),
    log_range(1e-3, 1e9),
)
def test_a_ladder_of_eddy_currents_is_passive(shape, terms, sigma, length, size, mu, omega):
    """Real part zero or more on the right half plane; opposition only, and none at rest."""
    common = {"conductivity": sigma, "length": length, "permeability": mu, "terms": terms}
    if shape == "cylinder":
        ladder = cylinder_ladder(radius=size, **common)
    else:
        ladder = sheet_ladder(thickness=size, width=2.0 * size, **common)

    assert ladder.mmf_per_flux(0.0) == 0.0
    for s in (1j * omega, omega * (1 + 1j)):
        value = ladder.mmf_per_flux(s)
        assert np.isfinite(value)
        assert value.real >= -1e-12 * abs(value)
        assert value.imag > 0.0
        # a lossy part turns energy of a rising flux into heat: the resistance Z/s is passive too
        assert (value / s).real > 0.0
        assert ladder.mmf_per_flux(np.conj(s)) == pytest.approx(np.conj(value), rel=1e-12)


VOLTS, AMPERES = st.floats(1.0, 100.0), st.floats(0.5, 20.0)
TIMING = {
    "start": st.floats(0.0, 50e-6),
    "end": st.none() | st.floats(60e-6, 400e-6),
    "freewheel": st.floats(0.0, 20.0),
    "decay": st.none() | st.floats(0.0, 100.0),
}
DRIVERS = st.one_of(
    st.builds(VoltageStep, voltage=VOLTS, **TIMING),
    st.builds(
        lambda upper, band, **more: TwoPoint(upper=upper, lower=upper * (1.0 - band), **more),
        upper=AMPERES,
        band=st.floats(0.05, 0.8),
        voltage=VOLTS,
        **TIMING,
    ),
    st.builds(
        lambda hold, band, peak, **more: PeakHold(
            hold_current=hold, hold_band=band * hold, peak_current=peak * hold, **more
        ),
        hold=AMPERES,
        band=st.floats(0.05, 0.9),
        peak=st.floats(1.5, 5.0),
        boost_voltage=VOLTS,
        supply_voltage=VOLTS,
        peak_until=st.none() | st.floats(51e-6, 59e-6),
        fall=st.sampled_from(["freewheel", "decay"]),
        **TIMING,
    ),
    st.builds(
        PulseWidth,
        voltage=VOLTS,
        period=st.floats(5e-6, 100e-6),
        duty=st.floats(0.05, 0.95),
        **TIMING,
    ),
    # to 1 nV: the energy of 1e-152 V is a number without digits
    st.lists(
        st.tuples(
            st.floats(0.0, 400e-6), st.floats(-50.0, 50.0).map(lambda volts: round(volts, 9))
        ),
        min_size=1,
        max_size=8,
    ).map(
        lambda points: VoltageTable(
            time=tuple(t for t, _ in sorted(points)), voltage=tuple(u for _, u in sorted(points))
        )
    ),
)


@pytest.mark.slow
@examples(30)
@given(st.one_of(solenoids(), flux_maps()), DRIVERS, log_range(5e-8, 5e-6), st.floats(-1.0, 1.0))
def test_any_driver_on_any_coil_keeps_the_books(plant, driver, step, way):
    """Supply = heat + stored + work, heat is never below zero, and a diode holds the current."""
    if isinstance(plant, Solenoid):
        coil, gap, resistance = plant.circuit(), plant.gap, plant.resistance
        fluxes = static_state(coil, current=0.0, gap=gap).loop_fluxes
    else:
        coil, gap, resistance = plant, float(plant.gap[-1]), 1.0
        fluxes = ()
    steps = 200
    lift = way * 0.8 * gap * np.linspace(0.0, 1.0, steps + 1) ** 2
    lift = np.clip(lift, -0.5 * gap, 0.8 * gap)
    try:
        run = run_coil(
            coil,
            driver.program(),
            resistance=resistance,
            gap=gap,
            step=step,
            lift=lift,
            fluxes=fluxes,
        )
    except ConvergenceError as error:
        # a coil faster than its step is refused, and told why
        assume("switches more than 30 times" not in str(error))
        raise

    for values in (run.current, run.flux, run.voltage, run.force):
        assert np.all(np.isfinite(values))
    assert run.ohmic >= 0.0
    assert run.eddy >= 0.0
    assert run.residual < 1e-11
    if not isinstance(driver, VoltageTable):
        assert run.current.min() >= -1e-9 * max(float(run.current.max()), 1e-9)


@examples(30)
@given(DRIVERS)
def test_a_program_leads_from_state_to_state(driver):
    program = driver.program()
    names = [state.name for state in program.states]
    for state in program.states:
        assert all(switch.to in names for switch in state.switches)
    numbers = program.numbers()
    assert np.all(np.isfinite(numbers))
    ends = [*numbers[1 : 1 + len(names)], numbers.size]
    assert all(a < b for a, b in pairwise(ends))


@examples(40)
@given(st.floats(max_value=1.0) | st.just(np.nan), st.sampled_from(["permeability", "saturation"]))
def test_impossible_iron_is_refused(value, name):
    given_numbers = {"saturation": 2.0, "permeability": 1000.0, name: value}
    for law in (froehlich, tanh_curve):
        if name == "permeability" or not value > 0.0:
            with pytest.raises(InputError, match="above"):
                law(**given_numbers)


def test_a_switch_at_the_end_of_a_step_leaves_no_round_off():
    """Smallest example of a former fault: pieces of 1e-12 of a step told a linear coil its rates.

    The books then missed 9e-9 of what flowed.
    """
    gap = 0.0024787521766663585
    pole = {"outer_radius": 0.01831563888873418, "inner_radius": 0.005494691666620253}
    coil = Solenoid(
        turns=1.0,
        resistance=1.0,
        gap=gap,
        residual_gap=gap,
        poles=[{**pole, "fringing": "none"}],
        leakage_share=0.5,
    ).circuit()
    run = run_coil(
        coil,
        TwoPoint(voltage=1.0, upper=0.5, lower=0.375, freewheel=0.0).program(),
        resistance=1.0,
        gap=gap,
        step=5.000000000000005e-08,
        lift=0.4 * gap * np.linspace(0.0, 1.0, 201) ** 2,
    )
    assert run.residual < 1e-13
