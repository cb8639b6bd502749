"""Energy of drivers, iron and magnets.

Electric energy in = heat + stored + work, to round-off, for circuits nobody would build.

Loops without eddy currents balance at every instant: no ringing of their fluxes, no chatter.

Hysteretic iron and permanent magnets in a solenoid: sticking after hold, energy, errors.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from klack.errors import InputError
from klack.magnetics.circuit import MagneticBranch, MagneticCircuit
from klack.magnetics.flux_map import FluxMap
from klack.magnetics.flux_step import flux_numbers, flux_state, magnet_step
from klack.magnetics.flux_table import HEADER
from klack.magnetics.hysteresis import falling_width
from klack.magnetics.iron import VACUUM_PERMEABILITY, froehlich
from klack.magnetics.lifting_magnet import lifting_magnet
from klack.magnetics.magnetic_network import MagneticNetwork
from klack.magnetics.peak_hold import PeakHold
from klack.magnetics.reluctance import GapReluctance, LinearReluctance
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.solenoid_parts import PermanentMagnet
from klack.magnetics.static import static_state
from klack.magnetics.two_point import TwoPoint
from klack.magnetics.voltage_step import VoltageStep
from klack.magnetics.voltage_table import VoltageTable
from klack.mechanics.end_stop import EndStop
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.network.step_function import evaluate
from klack.simulation.network_run import simulate_network
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


POLE = {"outer_radius": 6e-3, "fringing": "none"}
IRON = {"material": "X6Cr17", "length": 30e-3, "area": 60e-6}


def remanent_circuit():
    """Gap with remanence in one loop, leakage in the other, linear, no eddy currents."""
    area = 20e-6 * 4e-7 * np.pi
    gap = GapReluctance([0.0, 2e-4], [30e-6 / area, 230e-6 / area], [1.0 / area] * 2)
    return MagneticCircuit(
        branches=(
            MagneticBranch(name="gap", law=gap, turns=60.0, remanence=80.0),
            MagneticBranch(name="leakage", law=LinearReluctance(1e8), turns=60.0),
        ),
        loops=np.array([[1, 0], [0, 1]]),
        main="gap",
    )


def test_the_flux_of_an_open_coil_is_that_at_rest_at_every_step():
    circuit = remanent_circuit()
    rng = np.random.default_rng(2)
    lift = np.concatenate(([0.0], 1e-4 * rng.random(200)))  # jerks as no needle makes them
    start = static_state(circuit, current=0.0, gap=1e-4).loop_fluxes

    run = run_coil(
        circuit,
        VoltageStep(voltage=12.0, start=1.0, freewheel=1e6).program(),
        resistance=1.0,
        gap=1e-4,
        step=1e-6,
        lift=lift,
        fluxes=start,
    )

    exact = [static_state(circuit, current=0.0, gap=1e-4 - y).branch_fluxes[0] for y in lift]
    assert np.all(run.current == 0.0)
    np.testing.assert_allclose(run.flux[1:], exact[1:], rtol=1e-9)
    assert run.residual < 1e-13


def test_the_released_energy_is_a_small_loss():
    """In a smooth motion in few steps; never a gain."""
    lift = 0.5e-4 * (1.0 - np.cos(np.linspace(0.0, np.pi, 101)))
    circuit = remanent_circuit()
    run = run_coil(
        circuit,
        VoltageStep(voltage=12.0, start=1.0, freewheel=1e6).program(),
        resistance=1.0,
        gap=1e-4,
        step=1e-5,
        lift=lift,
        fluxes=static_state(circuit, current=0.0, gap=1e-4).loop_fluxes,
    )

    assert 0.0 < run.eddy < 1e-6 * abs(run.work)
    assert run.residual < 1e-13


@pytest.mark.parametrize(
    ("coil", "decay", "preload"),
    [
        ({"turns": 232, "resistance": 1.06, "residual_gap": 34.8e-6}, 80.0, 5.8),
        ({"turns": 122, "resistance": 2.38, "residual_gap": 41.5e-6}, 80.0, 4.9),
        ({"turns": 170, "resistance": 4.18, "residual_gap": 22.4e-6, "residual_flux": 1.2e-6}, 12.0,
         2.9),
    ],
)  # fmt: skip
def test_a_solenoid_without_eddy_currents_is_switched_off(coil, decay, preload):
    """These stopped with "the driver switches more than 30 times in one step"."""
    parts = {
        "needle": RigidMass(mass=3e-3, points=("tip",)),
        "spring": Spring(stiffness=1e4, preload=preload),
        "seat": EndStop(gap=0.0, law={"kind": "linear", "stiffness": 1e9}, restitution=0.5),
        "stop": EndStop(gap=1e-4, law={"kind": "linear", "stiffness": 1e9}, restitution=0.5),
        "coil": Solenoid(gap=110e-6, poles=[POLE], iron=[IRON], leakage_share=0.03, **coil),
        "driver": VoltageStep(voltage=12.0, end=2e-3, decay=decay),
    }
    nodes = [
        ["needle.tip", "spring.end", "seat.upper", "stop.lower", "coil.armature"],
        ["ground", "seat.lower"],
        ["ground", "stop.upper"],
        ["driver.terminals", "coil.terminals"],
    ]

    run = simulate_network(Network(parts, nodes).rows(), duration=6e-3)

    assert np.all(run.channels["coil current"].values[-100:] == 0.0)
    assert abs(run.books.relative_residual) < 1e-12
    assert 0.0 <= run.books.losses["coil eddy"] < 1e-6 * run.books.losses["coil ohmic"]


def test_two_gaps_in_parallel_share_a_flux_without_ringing():
    """A network whose loops have no eddy term: the flux of each gap follows its reluctance."""
    face = {"kind": "face", "area": 2e-5, "residual_gap": 3e-5}
    magnet = MagneticNetwork.model_validate(
        {
            "resistance": 1.0,
            "gap": 1e-4,
            "elements": {
                "coil": {"kind": "coil", "between": ["a", "b"], "turns": 50},
                "closing": {**face, "between": ["b", "a"]},
                "opening": {**face, "between": ["b", "a"], "opens_from": 2e-5},
                "leakage": {"kind": "leakage", "between": ["b", "a"], "permeance": 1e-8},
            },
        }
    )
    circuit = magnet.circuit()
    lift = 9e-5 * np.abs(np.sin(np.arange(301) / 7.0))

    run = run_coil(
        circuit, VoltageStep(voltage=12.0).program(), resistance=1.0, gap=1e-4, step=2e-6, lift=lift
    )

    mmf = 50.0 * run.current[1:]
    gap = 1e-4 - lift[1:] + 3e-5
    np.testing.assert_allclose(run.flux[1:], mmf * 4e-7 * np.pi * 2e-5 / gap, rtol=1e-9)
    assert run.residual < 1e-13


def test_a_band_too_narrow_for_a_macro_step_is_held_in_fine_steps():
    """0.06 A/us within 1 mA: some 80 switchings in a macro step of 1.28 us, 1 in one of 20 ns."""
    parts = {
        "needle": RigidMass(mass=3e-3, points=("tip",)),
        "spring": Spring(stiffness=1e4, preload=50.0),
        "seat": EndStop(gap=0.0, law={"kind": "linear", "stiffness": 1e9}, restitution=0.5),
        "coil": Solenoid(gap=110e-6, poles=[POLE], turns=20, resistance=1.0, residual_gap=35e-6),
        "driver": TwoPoint(voltage=24.0, upper=2.0005, lower=1.9995, freewheel=24.0),
    }
    nodes = [
        ["needle.tip", "spring.end", "seat.upper", "coil.armature"],
        ["ground", "seat.lower"],
        ["driver.terminals", "coil.terminals"],
    ]

    run = simulate_network(Network(parts, nodes).rows(), duration=60e-6)

    held = run.channels["coil current"].values[run.time > 40e-6]
    assert np.all((1.9995 - 1e-9 <= held) & (held <= 2.0005 + 1e-9))
    assert run.steps.flight > 0
    assert abs(run.books.relative_residual) < 1e-12


CURVE = {"froehlich": {"saturation": 1.9, "permeability": 20000.0}}
LOOP = {"coercivity": 400.0, "initial_permeability": 300.0}
IRON_PARTS = {"material": CURVE, "length": 60e-3, "area": 28e-6}
MAGNET = {"remanence": 1.2, "recoil_permeability": 1.05, "length": 0.1e-3, "area": 28e-6}


def coil(**more):
    return Solenoid(
        **{
            "turns": 60,
            "resistance": 0.8,
            "gap": 80e-6,
            "residual_gap": 10e-6,
            "poles": [{"outer_radius": 3e-3, "fringing": "none"}] * 2,
            "iron": [IRON_PARTS],
            "leakage": 5e-9,
            "eddy": [{"conductivity": 1.5e6, "length": 20e-3, "radius": 2e-3}],
            **more,
        }
    )


def hold_and_release(solenoid, preload, duration=6e-3):
    """A needle that is lifted, held for 3 ms, and let go; stroke of 60 um."""
    law = {"kind": "linear", "stiffness": 1e8}
    parts = {
        "needle": RigidMass(mass=3e-3),
        "spring": Spring(stiffness=1e3, preload=preload),
        "seat": EndStop(gap=0.0, law=law, restitution=0.4),
        "stop": EndStop(gap=60e-6, law=law, restitution=0.4),
        "driver": VoltageStep(voltage=12.0, end=3e-3, decay=24.0),
        "coil": solenoid,
    }
    network = Network(
        parts,
        [
            ["needle.body", "spring.end", "coil.armature", "seat.upper", "stop.lower"],
            ["seat.lower", "ground"],
            ["stop.upper", "ground"],
            ["coil.terminals", "driver.terminals"],
        ],
    )
    return simulate_network(network.rows(), duration=duration, step=1e-7, coarse=8, record=5e-6)


def closed_at(result):
    lift = result.channels["needle.body displacement"].values
    after = (result.time > 3e-3) & (lift < 5e-6)
    return result.time[after][0] if np.any(after) else np.inf


def test_armature_sticks_after_hold_and_closes_later_with_a_stronger_spring():
    soft = hold_and_release(coil(), 2.0)
    sticks = hold_and_release(coil(iron=[{**IRON_PARTS, "hysteresis": LOOP}]), 2.0)
    stronger = hold_and_release(coil(iron=[{**IRON_PARTS, "hysteresis": LOOP}]), 10.0)
    without = hold_and_release(coil(), 10.0)

    lift = sticks.channels["needle.body displacement"].values
    assert closed_at(soft) < 5e-3
    assert lift[-1] == pytest.approx(60e-6, abs=1e-6)
    assert sticks.channels["coil current"].values[-1] == 0.0
    assert closed_at(without) < closed_at(stronger) < 6e-3
    for result in (soft, sticks, stronger, without):
        assert result.books.relative_residual < 1e-9
    assert sticks.books.losses["coil hysteresis"] > 0.0
    assert "coil hysteresis" not in soft.books.losses


def test_remanent_flux_of_the_stuck_armature_is_on_the_load_line():
    solenoid = coil(iron=[{**IRON_PARTS, "hysteresis": LOOP}])
    result = hold_and_release(solenoid, 0.5, duration=20e-3)  # until the eddy currents are gone
    flux = result.channels["coil flux"].values[-1]
    gap = 80e-6 - result.channels["needle.body displacement"].values[-1]

    part, law = solenoid.iron[0], solenoid.circuit().branches[0].law
    field = part.material.curve().field(flux / 28e-6) - part.width().at(flux / 28e-6)
    # minor loops of the bounces are forgotten but for what is below the first yield
    assert float(field) * 60e-3 == pytest.approx(-float(law.mmf(flux, gap)), rel=1e-3)


def test_magnet_holds_the_armature_by_its_recoil_line():
    magnet = {**MAGNET, "polarity": "with-coil"}
    bare = coil(iron=[], magnets=[magnet])
    circuit = bare.circuit()

    state = static_state(circuit, current=0.0, gap=20e-6)

    part = PermanentMagnet(**magnet)
    outer = float(circuit.branches[0].law.reluctance_at(20e-6))
    assert state.branch_fluxes[0] == pytest.approx(part.mmf / (part.reluctance + outer), rel=1e-12)
    result = hold_and_release(bare, 0.5)
    assert result.books.relative_residual < 1e-9
    assert result.channels["needle.body displacement"].values[-1] > 59e-6


@pytest.mark.parametrize(
    ("hysteresis", "material", "told"),
    [
        ({"initial_permeability": 300.0}, CURVE, "coercivity"),
        ({**LOOP, "initial_permeability": 3e4}, CURVE, "initial_permeability"),
        ({**LOOP, "remanence": 1.8}, CURVE, "remanence"),
        ({**LOOP, "remanence": 0.01}, CURVE, r"remanence|initial_permeability"),
        (
            LOOP,
            {
                "loop": {
                    "flux_density": (1.0, 0.5, 0.0, -0.5, -1.0),
                    "field_strength": (500.0, 20.0, -50.0, -70.0, -500.0),
                }
            },
            "coercivity",
        ),
    ],
)
def test_impossible_loops_are_refused(hysteresis, material, told):
    with pytest.raises((InputError, ValueError), match=told):
        coil(iron=[{**IRON_PARTS, "material": material, "hysteresis": hysteresis}])


@pytest.mark.parametrize(
    ("flux_density", "field_strength"),
    [
        ((1.0, 0.5, 0.0, -0.5), (500.0, 20.0, -50.0, -70.0)),
        ((1.0, 0.5, 0.0, -0.5, -0.8), (500.0, 20.0, -50.0, -70.0, -500.0)),
        ((1.0, 0.5, 0.0, -0.5, -1.0), (500.0, 70.0, 50.0, -20.0, -500.0)),
        ((1.0, 0.5, 0.6, -0.5, -1.0), (500.0, 20.0, -50.0, -70.0, -500.0)),
    ],
    ids=["too few points", "uneven tips", "rising branch", "not sorted"],
)
def test_unusable_loops_are_refused(flux_density, field_strength):
    loop = {"flux_density": flux_density, "field_strength": field_strength}
    with pytest.raises((InputError, ValueError), match=r"loop|flux_density"):
        coil(iron=[{**IRON_PARTS, "material": {"loop": loop}}])


def test_residual_flux_beside_hysteresis_is_refused():
    with pytest.raises((InputError, ValueError), match="residual_flux"):
        coil(iron=[{**IRON_PARTS, "hysteresis": LOOP}], residual_flux=1e-6)


def test_too_many_hysteretic_parts_are_refused():
    solenoid = coil(iron=[{**IRON_PARTS, "hysteresis": LOOP}] * 9)
    with pytest.raises(InputError, match="at most 8"):
        hold_and_release(solenoid, 0.5)


@pytest.mark.parametrize("step", [1e-8, 1e-6, 2e-5], ids=["fine", "usual", "coarse"])
@pytest.mark.parametrize("closing", [1.0, 1e-5], ids=["with a gap", "closed core"])
def test_any_course_of_voltage_and_gap_balances_and_loses_energy(step, closing):
    rng = np.random.default_rng(3)
    width = falling_width(froehlich(1.9, 20000.0), 100.0, 0.9, 300.0)
    slope = closing * 2.0 / (VACUUM_PERMEABILITY * 12e-6)
    gap = GapReluctance([0.0, 1e-3], [closing * 1e3, closing * 1e3 + slope * 1e-3], [slope] * 2)
    circuit = MagneticCircuit(
        branches=(
            MagneticBranch(name="gap", law=gap, turns=60.0),
            MagneticBranch(
                name="iron",
                law=froehlich(1.9, 20000.0).law(60e-3, 12e-6),
                stops=width.stops(60e-3, 12e-6),
            ),
            MagneticBranch(name="leakage", law=LinearReluctance(2e8), turns=60.0),
        ),
        loops=np.array([[1, 0], [1, 0], [0, 1]]),
        main="gap",
    )
    driver = VoltageTable(
        time=tuple(np.sort(rng.uniform(0.0, 400 * step, 8))), voltage=tuple(rng.uniform(-40, 40, 8))
    ).program()
    lift = np.clip(np.cumsum(rng.normal(0.0, 1e-7, 401)), -20e-6, 60e-6)

    run = run_coil(circuit, driver, resistance=0.5, gap=80e-6, step=step, lift=lift - lift[0])

    assert run.residual < 1e-12
    assert run.hysteresis >= 0.0
