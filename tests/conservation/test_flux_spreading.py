"""Loops without eddy currents balance at every instant: no ringing of their fluxes, no chatter."""

import numpy as np
import pytest

from klack.magnetics.circuit import MagneticBranch, MagneticCircuit
from klack.magnetics.magnetic_network import MagneticNetwork
from klack.magnetics.reluctance import GapReluctance, LinearReluctance
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.static import static_state
from klack.magnetics.two_point import TwoPoint
from klack.magnetics.voltage_step import VoltageStep
from klack.mechanics.end_stop import EndStop
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.simulation.network_run import simulate_network
from klack.verification.drivers import run_coil

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
