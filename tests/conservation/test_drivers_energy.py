"""Electric energy in = heat + stored + work, to round-off, for circuits nobody would build."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from klack.magnetics.circuit import MagneticBranch, MagneticCircuit
from klack.magnetics.flux_map import FluxMap
from klack.magnetics.flux_step import flux_numbers, flux_state, magnet_step
from klack.magnetics.flux_table import HEADER
from klack.magnetics.iron import froehlich
from klack.magnetics.lifting_magnet import lifting_magnet
from klack.magnetics.peak_hold import PeakHold
from klack.magnetics.reluctance import GapReluctance, LinearReluctance
from klack.magnetics.static import static_state
from klack.magnetics.voltage_step import VoltageStep
from klack.network.step_function import evaluate
from klack.verification.drivers import injector, opening, run_coil

DRIVER = PeakHold(
    boost_voltage=65.0,
    peak_current=8.0,
    supply_voltage=14.0,
    hold_current=2.5,
    hold_band=0.7,
    start=5e-6,
    end=300e-6,
    decay=50.0,
).program()


def three_loops(eddies, remanence, seed):
    """Two gaps of different laws, three irons, shared and opposed branches, a leakage."""
    rng = np.random.default_rng(seed)
    x = np.linspace(-30e-6, 200e-6, 24)
    gaps = [
        GapReluctance(x, (x + rest) * slope, np.full(24, slope))
        for rest, slope in ((40e-6, 8e10), (60e-6, 5e10))
    ]
    iron = [froehlich(b, 800.0).law(30e-3, 12e-6) for b in rng.uniform(1.2, 2.0, 3)]
    names = ("gap", "side gap", "core", "pole", "yoke", "bridge", "leakage")
    laws = (gaps[0], gaps[1], *iron, LinearReluctance(3e8), LinearReluctance(4e8))
    eddy = (eddies[0], 0.0, eddies[1], 0.0, eddies[2], 0.0, 0.0)
    turns = (30.0, 0.0, 30.0, 0.0, 0.0, 0.0, 60.0)
    branches = tuple(
        MagneticBranch(
            name=name,
            law=law,
            eddy=e,
            turns=n,
            remanence=remanence if name == "yoke" else 0.0,
        )
        for name, law, e, n in zip(names, laws, eddy, turns, strict=True)
    )
    loops = [[1, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0], [-1, -1, 0], [1, -1, 0], [0, 0, 1]]
    return MagneticCircuit(branches=branches, loops=np.array(loops), main="gap")


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(
    eddies=st.tuples(*[st.floats(0.0, 3000.0)] * 3),
    # to 1 pA: the flux of 1e-308 A is a number without digits
    remanence=st.floats(-50.0, 50.0).map(lambda mmf: round(mmf, 12)),
    step=st.floats(20e-9, 1e-6),  # beyond, loops without any eddy current alternate
    seed=st.integers(0, 100),
)
def test_books_of_any_circuit_balance(eddies, remanence, step, seed):
    circuit = three_loops(eddies, remanence, seed)
    rest = static_state(circuit, current=0.0, gap=100e-6)
    r = run_coil(
        circuit,
        DRIVER,
        resistance=0.8,
        gap=100e-6,
        step=step,
        lift=opening(400e-6, step),
        fluxes=rest.loop_fluxes,
    )

    assert r.residual < 1e-12  # thousands of steps, each to round-off of what flows
    assert r.ohmic >= 0.0
    assert r.eddy >= 0.0
    assert r.electric > 0.0


@pytest.mark.parametrize("step", [20e-9, 320e-9, 5e-6])
@pytest.mark.parametrize("eddy", [0.0, 1250.0])
def test_books_balance_when_the_gap_runs_through_many_table_rows_in_a_step(step, eddy):
    r = run_coil(
        injector(eddy),
        DRIVER,
        resistance=0.8,
        gap=100e-6,
        step=step,
        lift=opening(60e-6, step),
    )

    assert r.residual < 1e-13


def test_books_of_the_lifting_magnet_balance():
    """Six loops without any eddy current: five balances without a time derivative."""
    r = run_coil(
        lifting_magnet(),
        VoltageStep(voltage=12.0, end=60e-3, decay=40.0).program(),
        resistance=10.0,
        gap=5e-3,
        step=50e-6,
        lift=4.5e-3 * np.linspace(0.0, 1.0, 1801) ** 2,
    )

    assert r.residual < 1e-12
    assert r.current.max() == pytest.approx(1.2, rel=0.05)
    assert r.current[-1] == 0.0


def test_books_of_a_map_balance_across_its_edges():
    circuit = injector(0.0)
    current, gap = np.linspace(0.0, 6.0, 13), np.linspace(40e-6, 90e-6, 6)  # all of it is left
    linkage = [[static_state(circuit, current=i, gap=x).linkage for x in gap] for i in current]
    table = FluxMap.of(current=current, gap=gap, linkage=linkage, force=None)
    r = run_coil(table, DRIVER, resistance=0.8, gap=100e-6, step=1e-6, lift=opening(400e-6, 1e-6))

    assert r.residual < 1e-13
    assert r.work != 0.0


@pytest.mark.slow
def test_quick_and_general_step_are_the_same():
    """The general step, with the quick one forbidden, on the states of a run."""
    circuit = injector()
    par = flux_numbers(circuit, resistance=0.8, driver=DRIVER, gap=100e-6)
    general = par.copy()
    general[8 + 6] = 0.0
    assert par[8 + 6] == 1.0
    assert HEADER > 6
    lift, h = opening(400e-6, 0.1e-6), 0.1e-6
    state = flux_state(par)
    count = 2 + state.size + 4
    for k in range(0, 4000):
        inputs = [k * h, h, lift[k], lift[k + 1], 0.0, 1e-9]
        status, out = evaluate(magnet_step, par, state, inputs, count)
        if k % 20 == 0:
            _, other = evaluate(magnet_step, general, state, inputs, count)
            scale = np.maximum(np.abs(out), np.abs(other)) + 1e-300
            # the second differences in the state are rates of rates: rounding over h^2
            sound = np.r_[0:2, 2:14, count - 4 : count]
            np.testing.assert_allclose((out - other)[sound] / scale[sound], 0.0, atol=1e-8)
        assert status == 0
        state = out[2 : 2 + state.size]


def test_armature_and_base_feel_opposite_forces():
    par = flux_numbers(injector(), resistance=0.8, driver=DRIVER, gap=100e-6)
    state = flux_state(par, [1e-5, 1e-6])

    _, out = evaluate(magnet_step, par, state, [0, 1e-7, 0.0, 1e-8, 0.0, -2e-8], 40)

    assert out[0] == -out[1] > 0.0  # the gap closes upwards
