"""Controllers, and runs with them that go on.

Controllers: known motions, sampling instants, wrong channels and units, own functions.

Runs with controllers continue from a stored state; truth: the run of the whole time.
"""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from klack.analyses.stroke.analysis import STROKE
from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import load_valve_case, read_valve_case
from klack.control.hysteresis import HysteresisController
from klack.control.pid import PidController, Setpoint
from klack.control.sensor import Sensor
from klack.control.state_machine import MachineState, StateMachine, Transition
from klack.errors import InputError
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.controlled_pressure import ControlledPressure
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.orifice import Orifice
from klack.magnetics.controlled_voltage import ControlledVoltage
from klack.mechanics.controlled_force import ControlledForce
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.catalogue import component_class
from klack.network.network import Network
from klack.network.rows import Ambient
from klack.simulation.network_run import simulate_network

DOCS = Path(__file__).parents[2] / "docs"
CASE = DOCS / "how-to" / "controlled_valve.yaml"
LIFT = Sensor(channel="mass.body displacement", unit="um")


def rows(force: ControlledForce):
    parts = {
        "mass": RigidMass(mass=3e-3),
        "spring": Spring(stiffness=1e4, preload=0.0),
        "force": force,
    }
    return Network(parts, [["mass.body", "force.end", "spring.end"]]).rows()


def by(function, sensor: Sensor = LIFT, sample: float = 10e-6) -> ControlledForce:
    return ControlledForce(sample_time=sample, sensors={"x": sensor}).by(function)


@pytest.mark.parametrize("keys", [{}, {"coarse": 1}, {"step": 10e-9}, {"record": 3e-6}])
@pytest.mark.parametrize("sample", [1e-6, 7e-6, 50e-6])
def test_it_acts_at_every_instant_whatever_the_steps(keys, sample):
    called, signals = [], []

    def act(time, values):
        called.append(time)
        signals.append(values["x"])
        return 5.0

    run = simulate_network(rows(by(act, sample=sample)), duration=210e-6, start="free", **keys)

    count = round(float(run.time[-1]) / sample * (1 + 1e-12) - 0.5) + 1
    assert called == pytest.approx(sample * np.arange(count), rel=1e-12, abs=1e-15)
    omega = np.sqrt(1e4 / 3e-3)
    exact = 5.0 / 1e4 * (1.0 - np.cos(omega * np.array(called))) * 1e6
    assert signals == pytest.approx(exact, rel=1e-5, abs=1e-9)
    assert run.books.relative_residual == pytest.approx(0.0, abs=1e-11)


def test_a_sample_time_between_steps_is_refused():
    with pytest.raises(InputError, match="whole number of steps"):
        simulate_network(rows(by(lambda t, s: 0.0, sample=10.013e-6)), duration=1e-4, start="free")


def test_an_unknown_channel_names_the_nearest():
    wrong = Sensor(channel="mass.body displacment", unit="um")

    with pytest.raises(InputError, match=r"(?s)sensors\.x\.channel.*mass.body displacement"):
        simulate_network(rows(by(lambda t, s: 0.0, wrong)), duration=1e-4, start="free")


@pytest.mark.parametrize("unit", ["bar", "mmm", ""])
def test_a_unit_of_another_kind_is_refused(unit):
    wrong = Sensor(channel="mass.body displacement", unit=unit)

    with pytest.raises(InputError, match=r"a unit of 'mass\.body displacement', which is in m"):
        simulate_network(rows(by(lambda t, s: 0.0, wrong)), duration=1e-4, start="free")


@pytest.mark.parametrize("found", [float("nan"), float("inf"), None, "5 N"])
def test_an_output_that_is_not_a_number_is_refused(found):
    with pytest.raises(InputError, match="force: controller: got the output"):
        simulate_network(
            rows(by(lambda t, s: found if t > 5e-5 else 0.0)), duration=1e-4, start="free"
        )


def test_an_error_of_the_function_is_raised():
    def fails(time, signals):
        return 1.0 / signals["y"]

    with pytest.raises(KeyError, match="y"):
        simulate_network(rows(by(fails)), duration=1e-4, start="free")


def test_a_run_with_a_controller_does_not_continue():
    network = rows(by(lambda t, s: 1.0))
    run = simulate_network(network, duration=5e-5, start="free")

    with pytest.raises(InputError, match="memory of this controller"):
        simulate_network(network, duration=5e-5, state=run.state)


def test_a_component_without_a_controller_is_refused():
    with pytest.raises(InputError, match="got no controller"):
        rows(ControlledForce(sample_time=1e-5))


def test_a_second_run_of_the_same_rows_is_the_same():
    law = PidController(
        kind="pid", sensor="x", setpoint=30.0, gain=0.1, integral_time=1e-4, lower=-5, upper=5
    )
    noisy = LIFT.model_copy(update={"noise": 1.0, "seed": 7})
    force = ControlledForce(sample_time=1e-5, sensors={"x": noisy}, controller=law)
    network = rows(force)

    first, second = (
        simulate_network(network, duration=1e-3, start="free").channels for _ in range(2)
    )

    assert np.array_equal(
        first["mass.body displacement"].values, second["mass.body displacement"].values
    )


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (
            lambda: PidController(
                kind="pid", sensor="x", setpoint=1.0, gain=1.0, lower=2.0, upper=1.0
            ),
            "below the upper limit",
        ),
        (
            lambda: HysteresisController(
                kind="hysteresis", sensor="x", lower=2.0, upper=2.0, low=0.0, high=1.0
            ),
            "below the upper one",
        ),
        (lambda: Setpoint(time=(1.0, 0.0), value=(1.0, 2.0)), "times that fall"),
        (lambda: Transition(to="b", above=1.0), "no sensor"),
        (lambda: Transition(to="b", sensor="x", above=1.0, below=2.0), "2 conditions"),
        (lambda: Transition(to="b", sensor="x", after=1.0), "only 'after'"),
        (
            lambda: StateMachine(
                kind="state-machine",
                states=(
                    MachineState(name="a", output=1.0, transitions=(Transition(to="c", after=1),)),
                    MachineState(name="b", output=2.0),
                ),
            ),
            "another state: b",
        ),
        (
            lambda: ControlledVoltage(
                sample_time=1e-5,
                sensors={"lift": LIFT},
                controller=HysteresisController(
                    kind="hysteresis", sensor="lft", lower=1.0, upper=2.0, low=0.0, high=1.0
                ),
            ),
            "the sensor 'lft'",
        ),
    ],
)
def test_a_wrong_law_is_one_clear_error(law, words):
    with pytest.raises(ValueError, match=words):
        law()


def test_the_example_brakes_its_needle():
    text = CASE.read_text(encoding="utf-8")
    unbraked = text.replace("name: brake, output: -40", "name: brake, output: 14")
    found = []
    for case in (load_valve_case(CASE), read_valve_case(unbraked, CASE)):
        (variant,) = run_stroke(case).variants.values()
        channels, time = variant.result.channels, variant.result.time
        lift = channels["needle.tip displacement"].values
        opened = float(time[np.argmax(lift > 99e-6)])
        found.append((float(channels["opening peak force"].values.max()), opened))
        assert abs(variant.result.books.relative_residual) <= 1e-12

    assert found[0] == (pytest.approx(573.0, rel=2e-2), pytest.approx(440e-6, abs=2e-6))
    assert found[1] == (pytest.approx(2941.0, rel=2e-2), pytest.approx(299e-6, abs=2e-6))


def test_components_shown_on_the_page_are_valid():
    page = DOCS / "theory" / "control.md"
    shown = re.findall(r"```yaml-part\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)

    assert shown
    for block in shown:
        for keys in yaml.safe_load(block).values():
            component_class(keys.pop("type")).model_validate(keys, context={"path": page})


@pytest.mark.slow
def test_a_controlled_pressure_fills_a_chamber_through_an_orifice():
    ambient, fluid = (
        Ambient(pressure=1e5, temperature=293.15),
        library_fluid("n-heptane").at(293.15),
    )
    law = HysteresisController(
        kind="hysteresis", sensor="p", lower=4.0, upper=5.0, low=8e5, high=1e5
    )
    parts = {
        "needle": RigidMass(mass=3e-3),
        "spring": Spring(stiffness=1e4, preload=0.0),
        "rail": ControlledPressure(
            start=1e5,
            sample_time=10e-6,
            sensors={"p": Sensor(channel="room pressure", unit="bar")},
            controller=law,
        ),
        "room": Chamber(volume=2e-6, pressure=1e5),
        "hole": Orifice(diameter=0.3e-3),
    }
    ends = [["needle.body", "spring.end"], ["rail.fluid", "hole.a"], ["hole.b", "room.fluid"]]
    rows = Network(parts, ends, ambient=ambient, fluid=fluid).rows()
    run = simulate_network(rows, duration=10e-3)

    rail, room = (run.channels[f"{name} pressure"].values for name in ("rail", "room"))
    assert set(np.unique(rail[1:])) == {1e5, 8e5}
    late = run.time > 5e-3
    assert 3.5e5 < room[late].min() < 4.0e5
    assert 5.0e5 < room[late].max() < 5.5e5
    assert abs(run.books.residual) <= 1e-9 * run.books.scale


def test_a_pressure_below_zero_is_refused():
    ambient, fluid = Ambient(), library_fluid("n-heptane").at(293.15)
    parts = {
        "needle": RigidMass(mass=3e-3),
        "spring": Spring(stiffness=1e4, preload=0.0),
        "rail": ControlledPressure(start=1e5, sample_time=10e-6).by(lambda t, s: -1.0),
        "room": Chamber(volume=2e-6, pressure=1e5),
        "hole": Orifice(diameter=0.3e-3),
    }
    ends = [["needle.body", "spring.end"], ["rail.fluid", "hole.a"], ["hole.b", "room.fluid"]]

    with pytest.raises(InputError, match="above 0 Pa"):
        simulate_network(Network(parts, ends, ambient=ambient, fluid=fluid).rows(), duration=1e-4)


CASE_CONTINUED = Path(__file__).parents[2] / "docs" / "how-to" / "controlled_valve.yaml"
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
    """In the steps of the case: each run that checks its steps may choose others."""
    read = load_valve_case(CASE_CONTINUED)

    def lasting(duration):
        run = read.run.model_copy(update={"duration": duration, "check_steps": False})
        return read.model_copy(update={"run": run})

    case, part, rest = (lasting(duration) for duration in (2.5e-3, 0.5e-3, 2.0e-3))
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
