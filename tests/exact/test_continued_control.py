"""Runs with controllers continue from a stored state; truth: the run of the whole time."""

import re
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.stroke.analysis import STROKE
from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import load_valve_case
from klack.control.hysteresis import HysteresisController
from klack.control.pid import PidController, Setpoint
from klack.control.sensor import Sensor
from klack.control.state_machine import MachineState, StateMachine, Transition
from klack.errors import InputError
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.controlled_pressure import ControlledPressure
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.orifice import Orifice
from klack.mechanics.controlled_force import ControlledForce
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.simulation.network_run import simulate_network

CASE = Path(__file__).parents[2] / "docs" / "how-to" / "controlled_valve.yaml"
SAMPLE = 10e-6
NOISY = Sensor(
    channel="mass.body displacement", unit="um", delay=23e-6, noise=0.4, quantisation=0.1, seed=5
)
PID = PidController(
    kind="pid",
    sensor="x",
    setpoint=Setpoint(time=(0.0, 0.3e-3), value=(0.0, 60.0)),
    gain=0.05,
    integral_time=0.2e-3,
    derivative_time=20e-6,
    derivative_filter=15e-6,
    lower=-20.0,
    upper=20.0,
)
LAWS = {
    "pid": PID,
    "hysteresis": HysteresisController(
        kind="hysteresis", sensor="x", lower=10.0, upper=30.0, low=8.0, high=-8.0
    ),
    "state-machine": StateMachine(
        kind="state-machine",
        states=(
            MachineState(
                name="push", output=9.0, transitions=(Transition(to="brake", after=0.13e-3),)
            ),
            MachineState(
                name="brake", output=-7.0, transitions=(Transition(to="push", after=0.07e-3),)
            ),
        ),
    ),
}


def rows(force: ControlledForce):
    parts = {
        "mass": RigidMass(mass=3e-3),
        "spring": Spring(stiffness=1e4, preload=0.0),
        "force": force,
    }
    return Network(parts, [["mass.body", "force.end", "spring.end"]]).rows()


def split(made, whole: float, parts: list[float], **keys):
    """The run of the whole time, and the channels of its parts joined."""
    one = simulate_network(made, duration=whole, **keys)
    state, joined = None, {name: [] for name in one.channels}
    for part in parts:
        run = simulate_network(made, duration=part, state=state, **keys)
        for name, channel in run.channels.items():
            joined[name].append(channel.values if state is None else channel.values[1:])
        state = run.state
    return one, {name: np.concatenate(values) for name, values in joined.items()}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("record", [2e-6, 6e-6])
@pytest.mark.parametrize("parts", [(0.3, 0.3), (0.1008, 0.0192, 0.48), (0.006, 0.594)])
def test_a_run_in_parts_is_the_run_of_the_whole_time(law, record, parts):
    made = rows(ControlledForce(sample_time=SAMPLE, sensors={"x": NOISY}, controller=LAWS[law]))

    whole, joined = split(
        made, 0.6e-3, [1e-3 * part for part in parts], coarse=10, step=20e-9, record=record
    )

    assert np.ptp(whole.channels["mass.body displacement"].values) > 1e-6
    for name, channel in whole.channels.items():
        size = channel.values.size
        np.testing.assert_array_equal(joined[name][:size], channel.values, err_msg=name)


def test_a_controlled_pressure_keeps_its_output():
    source = ControlledPressure(
        start=5e5,
        sample_time=SAMPLE,
        sensors={"p": Sensor(channel="room pressure", unit="bar")},
        controller=PidController(
            kind="pid", sensor="p", setpoint=4.0, gain=2e5, integral_time=1e-4, lower=1e5, upper=9e5
        ),
    )
    made = Network(
        {
            "source": source,
            "bore": Orifice(diameter=0.5e-3),
            "room": Chamber(volume=5e-7),
            "needle": RigidMass(mass=3e-3),
            "spring": Spring(stiffness=1e4, preload=0.0),
        },
        [["source.fluid", "bore.a"], ["bore.b", "room.fluid"], ["needle.body", "spring.end"]],
        fluid=library_fluid("n-heptane").at(293.15),
    ).rows()

    whole, joined = split(made, 0.4e-3, [0.15e-3, 0.25e-3], coarse=10, step=20e-9, record=10e-6)

    for name, channel in whole.channels.items():
        np.testing.assert_array_equal(joined[name], channel.values, err_msg=name)


@pytest.mark.slow
def test_a_stored_stroke_continues_from_its_folder(tmp_path):
    case = load_valve_case(CASE)
    part = case.model_copy(update={"run": case.run.model_copy(update={"duration": 0.5e-3})})
    rest = case.model_copy(update={"run": case.run.model_copy(update={"duration": 2.0e-3})})
    whole = run_stroke(case).variants["dry"].result
    first = run_stroke(part)
    STROKE.save(first, tmp_path / "first")

    second = run_stroke(rest, after=STROKE.load(tmp_path / "first")).variants["dry"].result

    one = first.variants["dry"].result
    for name, channel in whole.channels.items():
        joined = np.concatenate((one.channels[name].values, second.channels[name].values[1:]))
        size = min(joined.size, channel.values.size)
        assert size > 1900
        np.testing.assert_array_equal(joined[:size], channel.values[:size], err_msg=name)


class Counting:
    """A controller of the user with a memory of its own."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, time, signals):
        self.calls += 1
        return 0.1 * self.calls

    def memory(self):
        return {"calls": np.array([self.calls])}

    def recall(self, memory):
        self.calls = int(memory["calls"][0])


def test_a_function_that_can_be_stored_continues():
    def made():
        return rows(ControlledForce(sample_time=SAMPLE, sensors={"x": NOISY}).by(Counting()))

    keys = {"coarse": 10, "step": 20e-9, "record": 2e-6}
    whole = simulate_network(made(), duration=0.4e-3, **keys)
    first = simulate_network(made(), duration=0.2e-3, **keys)
    second = simulate_network(made(), duration=0.2e-3, state=first.state, **keys)

    np.testing.assert_array_equal(
        second.channels["mass.body displacement"].values[1:],
        whole.channels["mass.body displacement"].values[101:],
    )


def test_a_function_without_a_memory_is_refused():
    made = rows(ControlledForce(sample_time=SAMPLE).by(lambda time, signals: 1.0))
    run = simulate_network(made, duration=0.1e-3)

    with pytest.raises(InputError, match="memory of this controller is not stored") as caught:
        simulate_network(made, duration=0.1e-3, state=run.state)
    assert "memory() and recall()" in str(caught.value)


def changed(name, sensor=NOISY):
    return rows(ControlledForce(sample_time=SAMPLE, sensors={"x": sensor}, controller=LAWS[name]))


def without_controllers(state):
    return {key: value for key, value in state.items() if not key.startswith("controllers.")}


@pytest.mark.parametrize(
    ("law", "kept", "words"),
    [
        ("pid", lambda state: state, "law.hysteresis|hysteresis"),
        ("hysteresis", without_controllers, "without its output"),
    ],
)
def test_the_memory_of_another_controller_is_refused(law, kept, words):
    state = simulate_network(changed(law), duration=0.1e-3).state

    with pytest.raises(InputError, match="force: controller") as caught:
        simulate_network(changed("hysteresis"), duration=0.1e-3, state=kept(state))
    assert re.search(words, str(caught.value))
    assert "same controller and sensors" in str(caught.value)
