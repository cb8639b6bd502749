"""An FMU as a controller; truth: the same law as a function in Python.

The FMU is that of a spring and damper, F = -k x - c v, whose displacement and velocity are sensors
here; it fails when a step is forgotten or done twice.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import klack
from klack.analyses.stroke.controllers import controller_files
from klack.control.sensor import Sensor
from klack.errors import InputError
from klack.mechanics.controlled_force import ControlledForce
from klack.mechanics.fmu_controller import controlled_by_fmu
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.simulation.network_result import IncompleteRunError
from klack.simulation.network_run import simulate_network

Build = Callable[..., Path]
SENSORS = {
    "x": Sensor(channel="mass.body displacement", unit="um"),
    "v": Sensor(channel="mass.body velocity", unit="m/s"),
}
NUMBERS = {"k": 8e3, "c": 1.5}
CASE = """
klack: 1
title: A mass that a controller damps
network:
  components:
    mass: {type: rigid-mass, mass: 3 g}
    stop: {type: end-stop, gap: 80 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.5}
    seat: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.5}
    spring: {type: spring, stiffness: 10 N/mm, preload: 0 N}
    push: {type: force-over-time, time: [0 us, 10 us], force: [0 N, 5 N]}
    brake:
      type: controlled-force
      sample_time: 10 us
      sensors:
        x: {channel: mass.body displacement, unit: um}
        v: {channel: mass.body velocity, unit: m/s}
  connections:
    - [mass.body, spring.end, push.end, brake.end, seat.upper, stop.lower]
    - [seat.lower, ground]
    - [stop.upper, ground]
run: {duration: 0.4 ms, variants: [dry]}
"""


def force(**keys) -> ControlledForce:
    return ControlledForce(sample_time=10e-6, sensors=SENSORS, **keys)


def rows(part: ControlledForce):
    parts = {
        "mass": RigidMass(mass=3e-3, speed=0.3),
        "spring": Spring(stiffness=1e4, preload=0.0),
        "force": part,
    }
    return Network(parts, [["mass.body", "force.end", "spring.end"]]).rows()


def run(part: ControlledForce, **keys):
    return simulate_network(rows(part), duration=1e-3, start="free", record=10e-6, **keys)


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("length", ["m", "mm"])
def test_it_acts_as_the_same_law_in_python(version, length, spring_damper_fmu: Build):
    per_metre = {"m": 1.0, "mm": 1e3}[length]
    numbers = {"k": NUMBERS["k"] / per_metre, "c": NUMBERS["c"]}
    file = spring_damper_fmu(version, length=length)

    found = run(controlled_by_fmu(force(), file, parameters=numbers))
    known = run(force().by(lambda t, s: -NUMBERS["k"] * 1e-6 * s["x"] - NUMBERS["c"] * s["v"]))

    name = "mass.body displacement"
    assert np.ptp(known.channels[name].values) > 50e-6
    np.testing.assert_allclose(
        found.channels[name].values, known.channels[name].values, rtol=0, atol=1e-15
    )


def test_each_run_has_an_instance_of_its_own(spring_damper_fmu: Build):
    made = rows(controlled_by_fmu(force(), spring_damper_fmu(), parameters=NUMBERS))

    first, second = (
        simulate_network(made, duration=0.3e-3, start="free").channels for _ in range(2)
    )

    for name, channel in first.items():
        np.testing.assert_array_equal(channel.values, second[name].values)


def test_sensors_may_have_other_names(spring_damper_fmu: Build):
    part = ControlledForce(sample_time=10e-6, sensors={"lift": SENSORS["x"], "speed": SENSORS["v"]})
    joined = {"lift": "x", "speed": "v"}

    found = run(controlled_by_fmu(part, spring_damper_fmu(), inputs=joined, parameters=NUMBERS))
    known = run(controlled_by_fmu(force(), spring_damper_fmu(), parameters=NUMBERS))

    name = "mass.body displacement"
    np.testing.assert_array_equal(found.channels[name].values, known.channels[name].values)


@pytest.mark.parametrize(
    ("keys", "sensors", "words"),
    [
        ({"inputs": {"y": "x"}}, ("x", "v"), "the sensor 'y'"),
        ({"inputs": {"x": "xx", "v": "v"}}, ("x", "v"), "'xx', expected a real variable"),
        ({}, ("x",), "the input 'v' without a sensor"),
        ({"output": "G"}, ("x", "v"), "output: got 'G'"),
        ({"parameters": {"kk": 1.0}}, ("x", "v"), "parameters: got 'kk'"),
    ],
)
def test_mistakes_are_named(keys, sensors, words, spring_damper_fmu: Build):
    part = ControlledForce(sample_time=10e-6, sensors={name: SENSORS[name] for name in sensors})

    with pytest.raises(InputError, match=words):
        controlled_by_fmu(part, spring_damper_fmu(), **keys)


def test_units_of_another_kind_are_refused(spring_damper_fmu: Build):
    with pytest.raises(InputError, match="'kg' for a signal in 'um'"):
        controlled_by_fmu(force(), spring_damper_fmu(length="kg"))
    with pytest.raises(InputError, match="a file that does not exist"):
        controlled_by_fmu(force(), "no.fmu")


def test_a_crash_keeps_what_was_computed(spring_damper_fmu: Build):
    part = controlled_by_fmu(force(), spring_damper_fmu(fault="abort()"), parameters=NUMBERS)

    with pytest.raises(IncompleteRunError, match=r"crashed.*SIGABRT") as caught:
        run(part)

    assert "in its step from 10 us to 20 us" in str(caught.value)
    assert caught.value.result.time[-1] == pytest.approx(20e-6, abs=1e-9)


def test_a_run_cannot_continue(spring_damper_fmu: Build):
    made = rows(controlled_by_fmu(force(), spring_damper_fmu(), parameters=NUMBERS))
    state = simulate_network(made, duration=0.1e-3, start="free").state

    with pytest.raises(InputError, match="memory of this controller is not stored"):
        simulate_network(made, duration=0.1e-3, state=state)


# --------------------------------------------------------------------------- the command, Python


@pytest.fixture
def case(tmp_path):
    path = tmp_path / "damped.yaml"
    path.write_text(CASE, encoding="utf-8")
    return path


def test_a_case_without_a_controller_says_what_is_missing(case):
    with pytest.raises(InputError, match="got no controller") as caught:
        klack.run_stroke(case)
    assert "--controller" in str(caught.value)


@pytest.mark.slow
def test_the_command_takes_it_and_the_record_names_it(case, spring_damper_fmu: Build, capsys):
    from klack.cli.main import main

    file = spring_damper_fmu()
    command = ["stroke", str(case), "--controller", f"brake={file}"]

    assert main([*command, "--out", str(case.parent / "out")]) == 0
    assert f"the controller of 'brake' is the FMU {file.name} (SHA-256" in " ".join(
        "".join(capsys.readouterr()).split()
    )
    result = klack.run_stroke(case, controllers={"brake": file})
    assert any(file.name in note for note in result.record.warnings)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("brake", "expected NAME=FILE.fmu"),
        ("=x.fmu", "expected NAME=FILE.fmu"),
        ("brak=x.fmu", "did you mean 'brake'"),
        ("mass=x.fmu", "'mass', a rigid-mass"),
        ("brake=x.fmu", "a file that does not exist"),
    ],
)
def test_the_command_names_mistakes(given, words, case, capsys):
    from klack.cli.main import main

    assert main(["stroke", str(case), "--controller", given]) == 2
    assert words in " ".join(capsys.readouterr().err.split())


def test_a_component_is_given_once():
    with pytest.raises(InputError, match="the second controller of that component"):
        controller_files(["a=x.fmu", "a=y.fmu"])


def test_a_case_cannot_name_a_program(case):
    text = CASE.replace("sample_time: 10 us", "sample_time: 10 us\n      controller: {kind: fmu}")
    case.write_text(text, encoding="utf-8")

    with pytest.raises(InputError, match="controller"):
        klack.load_case(case)
