"""A stroke that starts at remanence is the second stroke of a magnet that was demagnetised."""

from pathlib import Path

import numpy as np
import pytest

from klack.analyses.stroke.figures import loop_chart
from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import load_valve_case
from klack.magnetics.constant_drive import driven, hysteretic_coils
from klack.magnetics.magnetic_network import MagneticNetwork
from klack.magnetics.remanent_start import remanent_state
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.static import static_state
from klack.magnetics.voltage_step import VoltageStep
from klack.mechanics.end_stop import EndStop
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.simulation.network_run import simulate_network

DOCS = Path(__file__).parents[2] / "docs"
IRON = {
    "material": "X6Cr17",
    "length": 3e-2,
    "area": 6e-5,
    "hysteresis": {"coercivity": 300.0, "initial_permeability": 150},
}
LAW = {"kind": "linear", "stiffness": 1e9}
MAGNET = {
    "turns": 60,
    "resistance": 0.8,
    "gap": 110e-6,
    "residual_gap": 20e-6,
    "poles": [{"outer_radius": 6e-3, "fringing": "none"}],
    "leakage": 5e-8,
}


def stroke(driver, duration, **keys):
    parts = {
        "needle": RigidMass(mass=3e-3, points=("tip",)),
        "spring": Spring(stiffness=1e4, preload=40.0),
        "seat": EndStop(gap=0.0, law=LAW, restitution=0.5),
        "stop": EndStop(gap=1e-4, law=LAW, restitution=0.5),
        "coil": Solenoid(**MAGNET, iron=[IRON], **keys),
        "driver": driver,
    }
    nodes = [
        ["needle.tip", "spring.end", "seat.upper", "stop.lower", "coil.armature"],
        ["ground", "seat.lower"],
        ["ground", "stop.upper"],
        ["driver.terminals", "coil.terminals"],
    ]
    return simulate_network(Network(parts, nodes).rows(), duration=duration)


def test_it_is_the_second_stroke():
    pulse = {"voltage": 24.0, "decay": 48.0}
    twice = stroke(VoltageStep(**pulse, end=2e-3, repeat_every=8e-3), 10e-3)
    once = stroke(VoltageStep(**pulse, end=2e-3), 2e-3, start="remanent")
    new = stroke(VoltageStep(**pulse, end=2e-3), 2e-3)

    def opens(run, after):
        return next(e.time for e in run.events if e.stop == "stop" and e.time > after) - after

    assert opens(once, 0.0) == pytest.approx(opens(twice, 8e-3), rel=2e-3)
    assert opens(new, 0.0) > 1.005 * opens(once, 0.0)  # the remanence helps
    known = remanent_state(Solenoid(**MAGNET, iron=[IRON]).circuit(), current=0.0, gap=110e-6)[0][0]
    flux = once.channels["coil flux"].values[0]
    assert flux == pytest.approx(float(known), rel=1e-3)  # the needle rests some nm deeper
    assert abs(once.books.relative_residual) < 1e-12
    assert np.all(new.channels["coil flux"].values[:1] == 0.0)


def test_without_hysteresis_there_is_no_remanence():
    plain = {key: value for key, value in IRON.items() if key != "hysteresis"}
    with pytest.raises(ValueError, match="start: remanent without hysteresis"):
        Solenoid(**MAGNET, iron=[plain], start="remanent")
    with pytest.raises(ValueError, match="start: remanent without hysteresis"):
        MagneticNetwork(
            resistance=1.0,
            gap=1e-4,
            start="remanent",
            elements={
                "iron": {**plain, "kind": "iron", "between": ["a", "b"]},
                "coil": {"kind": "coil", "between": ["b", "c"], "turns": 60},
                "gap": {"kind": "face", "between": ["c", "a"], "area": 3e-5, "residual_gap": 2e-5},
            },
        )


@pytest.mark.parametrize(("start", "opens"), [("remanent", 1.283), ("demagnetised", 1.354)])
def test_the_example_of_the_theory_page(tmp_path, start, opens):
    text = (DOCS / "how-to" / "remanent_magnet.yaml").read_text(encoding="utf-8")
    (tmp_path / "case.yaml").write_text(text.replace("start: remanent", f"start: {start}"))

    study = run_stroke(load_valve_case(tmp_path / "case.yaml"))

    assert 1e3 * study.variants["dry"].opening_time == pytest.approx(opens, abs=5e-4)
    chart = loop_chart(study)
    assert chart is not None
    loop, point = chart.panels[0].curves
    assert float(point.y[0]) == pytest.approx(6.828 if start == "remanent" else 0.0, rel=1e-3)
    assert float(np.max(loop.y)) > 90.0


def test_a_network_has_operating_points_too():
    """On the falling branch after saturation, on the mean curve otherwise."""
    elements = {
        "iron": {**IRON, "kind": "iron", "between": ["a", "b"]},
        "coil": {"kind": "coil", "between": ["b", "c"], "turns": 60},
        "gap": {"kind": "face", "between": ["c", "a"], "area": 3e-5, "residual_gap": 2e-5},
        "leakage": {"kind": "leakage", "between": ["b", "c"], "permeance": 2e-8},
    }
    found = []
    for start in ("demagnetised", "remanent"):
        magnet = MagneticNetwork(resistance=1.0, gap=1e-4, start=start, elements=elements)
        parts = {
            "needle": RigidMass(mass=3e-3),
            "spring": Spring(stiffness=1e6, preload=0.0),
            "coil": magnet,
            "driver": VoltageStep(voltage=12.0),
        }
        nodes = [
            ["needle.body", "spring.end", "coil.armature"],
            ["driver.terminals", "coil.terminals"],
        ]
        network = Network(parts, nodes)
        assert hysteretic_coils(network) == ["coil"]
        held = driven(network, {"coil": 1.0})
        run = simulate_network(held.rows(), duration=2e-4)
        flux = run.channels["coil flux"].values
        assert flux == pytest.approx(flux[0], rel=1e-6)  # it stays there
        found.append(float(flux[0]))
        if start == "demagnetised":
            place = 1e-4 - float(run.channels["needle.body displacement"].values[0])
            state = static_state(magnet.circuit(), current=1.0, gap=place)
            assert flux[0] == pytest.approx(state.branch_fluxes[2], rel=1e-9)
    assert found[1] > 1.05 * found[0]
