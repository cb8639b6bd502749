"""Hysteretic iron and permanent magnets in a solenoid: sticking after hold, energy, errors."""

import numpy as np
import pytest

from klack.errors import InputError
from klack.magnetics.circuit import MagneticBranch, MagneticCircuit
from klack.magnetics.hysteresis import falling_width
from klack.magnetics.iron import VACUUM_PERMEABILITY, froehlich
from klack.magnetics.reluctance import GapReluctance, LinearReluctance
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.solenoid_parts import PermanentMagnet
from klack.magnetics.static import static_state
from klack.magnetics.voltage_step import VoltageStep
from klack.magnetics.voltage_table import VoltageTable
from klack.mechanics.end_stop import EndStop
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.simulation.network_run import simulate_network
from klack.verification.drivers import run_coil

CURVE = {"froehlich": {"saturation": 1.9, "permeability": 20000.0}}
LOOP = {"coercivity": 400.0, "initial_permeability": 300.0}
IRON = {"material": CURVE, "length": 60e-3, "area": 28e-6}
MAGNET = {"remanence": 1.2, "recoil_permeability": 1.05, "length": 0.1e-3, "area": 28e-6}


def coil(**more):
    return Solenoid(
        **{
            "turns": 60,
            "resistance": 0.8,
            "gap": 80e-6,
            "residual_gap": 10e-6,
            "poles": [{"outer_radius": 3e-3, "fringing": "none"}] * 2,
            "iron": [IRON],
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
    sticks = hold_and_release(coil(iron=[{**IRON, "hysteresis": LOOP}]), 2.0)
    stronger = hold_and_release(coil(iron=[{**IRON, "hysteresis": LOOP}]), 10.0)
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
    solenoid = coil(iron=[{**IRON, "hysteresis": LOOP}])
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
        coil(iron=[{**IRON, "material": material, "hysteresis": hysteresis}])


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
        coil(iron=[{**IRON, "material": {"loop": loop}}])


def test_residual_flux_beside_hysteresis_is_refused():
    with pytest.raises((InputError, ValueError), match="residual_flux"):
        coil(iron=[{**IRON, "hysteresis": LOOP}], residual_flux=1e-6)


def test_too_many_hysteretic_parts_are_refused():
    solenoid = coil(iron=[{**IRON, "hysteresis": LOOP}] * 9)
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
