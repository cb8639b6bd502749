"""Drivers as components: keys of a case file, errors, and a valve that they open."""

from pathlib import Path

import numpy as np
import pytest
from draws import each
from pydantic import ValidationError

from klack.errors import InputError
from klack.magnetics.boost_driver import BoostDriver
from klack.magnetics.circuit import MagneticBranch, MagneticCircuit
from klack.magnetics.drive_profile import DriveProfile
from klack.magnetics.driver import (
    DriveCourse,
    DriveProgram,
    Driver,
    DriveState,
    Switch,
    When,
    driver_of,
)
from klack.magnetics.flux_table import circuit_numbers, current_weights
from klack.magnetics.peak_hold import PeakHold
from klack.magnetics.pwm import PulseWidth
from klack.magnetics.reluctance import LinearReluctance
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.two_point import TwoPoint
from klack.magnetics.voltage_step import VoltageStep
from klack.magnetics.voltage_table import VoltageTable
from klack.mechanics.end_stop import EndStop
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.catalogue import component_class
from klack.network.network import Network
from klack.network.rows import Ambient, Rows
from klack.simulation.network_run import simulate_network

PEAK_HOLD = {
    "boost_voltage": 65.0,
    "peak_current": 12.0,
    "supply_voltage": 14.0,
    "hold_current": 6.0,
    "hold_band": 1.0,
    "start": 20e-6,
    "end": 1.2e-3,
    "decay": 50.0,
}


@each(
    ("make", "words"),
    [
        (
            lambda: VoltageStep(voltage=12.0, start=2e-3, end=1e-3),
            "a time after the start at 2 ms",
        ),
        (lambda: VoltageStep(voltage=-3.0), "greater than 0"),
        (lambda: VoltageStep(voltage=3.0, end=2e-3, repeat_every=1e-3), "not shorter"),
        (lambda: VoltageStep(voltage=3.0, repeat_every=1e-3), "an end"),
        (lambda: TwoPoint(voltage=12.0, upper=2.0, lower=2.5), "below the upper one, 2 A"),
        (lambda: PulseWidth(voltage=12.0, period=1e-3, duty=1.2), "less than 1"),
        (lambda: PeakHold(**{**PEAK_HOLD, "peak_current": 6.2}), "above the band of the hold"),
        (lambda: PeakHold(**{**PEAK_HOLD, "hold_band": 12.0}), "less than twice the hold current"),
        (
            lambda: PeakHold(**PEAK_HOLD, peak_until=2e-3),
            "2 ms, expected a time after the start at 20 us and before the end at 1.2",
        ),
        (lambda: VoltageTable(time=(0.0, 1e-3), voltage=(1.0,)), "2 times for 1 voltages"),
        (lambda: VoltageTable(time=(1e-3, 0.0), voltage=(1.0, 2.0)), "decreasing times"),
        (lambda: DriveProfile(time=(0.0, 1e-3)), "neither current nor voltage"),
        (lambda: DriveProfile(time=(0.0, 1e-3), current=(1.0, 1.0)), "that raises the current"),
        (
            lambda: DriveProfile(time=(0.0, 1e-3), current=(1.0, -1.0), supply_voltage=14.0),
            "not negative, one of them above zero",
        ),
        (lambda: DriveProfile(time=(0.0, 1e-3), voltage=(1.0,)), "2 times for 1 values"),
        (lambda: DriveProfile(time=(1e-3, 0.0), voltage=(1.0, 2.0)), "0 s after 1 ms"),
        (lambda: DriveProfile(time=(1e-3, 1e-3), voltage=(1.0, 2.0)), "the last one after"),
        (lambda: DriveProfile(time=(0.0, 1e-3), voltage=(1.0, 2.0), band=0.1), "'band' with a vol"),
        (
            lambda: DriveProfile(time=(0.0, 2e-3), voltage=(1.0, 2.0), repeat_every=1e-3),
            "not shorter",
        ),
        (lambda: DriveCourse([0.0, -1.0], [0.0, 0.0]), "decreasing times"),
        (lambda: DriveProgram(()), "at least one state"),
        (
            lambda: DriveProgram((DriveState("on", 1.0, (Switch(When.TIME, 1.0, "of"),)),)),
            "a switch to 'of'",
        ),
        (
            lambda: DriveProgram(
                (DriveState("on", 1.0, (Switch(When.CURRENT_ABOVE, 1.0, "on", True),)),)
            ),
            "When.TIME with a period",
        ),
    ],
)
def test_contradictions_have_one_clear_error(make, words):
    with pytest.raises(InputError, match=words):
        make()


@pytest.mark.parametrize(
    "word", ["voltage-step", "voltage-table", "drive-profile", "two-point", "peak-hold", "pwm"]
)
def test_case_files_know_the_drivers_by_their_words(word):
    made = component_class(word)

    assert issubclass(made, Driver)
    assert made.type == word


def test_numbers_of_a_case_file_need_their_units():
    given = {"voltage": "12 V", "upper": "2.5 A", "lower": "1.8 A", "end": "3 ms"}

    driver = TwoPoint.model_validate(given, context={"path": Path("case.yaml")})

    assert (driver.voltage, driver.upper, driver.end) == (12.0, 2.5, 3e-3)
    with pytest.raises(ValidationError, match="with its unit"):
        TwoPoint.model_validate({**given, "voltage": 12}, context={"path": Path("case.yaml")})


def test_coil_without_a_driver_says_what_to_join():
    rows = Rows(ambient=Ambient(), component="coil")

    with pytest.raises(InputError, match="one driver at the terminals"):
        driver_of(rows)


def test_eddy_currents_in_every_loop_are_refused():
    """The current would jump with the voltage and a two-point driver would never stop."""
    law = LinearReluctance(1e7)
    circuit = MagneticCircuit(
        branches=(
            MagneticBranch(name="core", law=law, turns=60.0, eddy=1000.0),
            MagneticBranch(name="gap", law=law),
            MagneticBranch(name="leakage", law=law),
        ),
        loops=np.array([[1, 1], [1, 0], [0, 1]]),
        main="gap",
    )

    with pytest.raises(InputError, match="leakage path around the coil without an eddy term"):
        circuit_numbers(circuit)


def test_current_follows_from_the_leakage_alone():
    law = LinearReluctance(1e7)
    circuit = MagneticCircuit(
        branches=(
            MagneticBranch(name="gap", law=law, turns=60.0, eddy=1000.0),
            MagneticBranch(name="yoke", law=law),
            MagneticBranch(name="leakage", law=law, turns=-60.0),
        ),
        loops=np.array([[1, 0], [1, 0], [0, -1]]),
        main="gap",
    )

    assert current_weights(circuit) == pytest.approx([0.0, 0.0, -1.0 / 60.0])


def valve(driver):
    law = {"kind": "linear", "stiffness": 1e9}
    parts = {
        "needle": RigidMass(mass=3e-3),
        "spring": Spring(stiffness=5e3, preload=20.0),
        "seat": EndStop(gap=0.0, law=law, restitution=0.4),
        "stop": EndStop(gap=80e-6, law=law, restitution=0.4),
        "driver": driver,
        "coil": Solenoid(
            turns=60,
            resistance=0.8,
            gap=100e-6,
            residual_gap=20e-6,
            poles=[
                {"outer_radius": 3e-3, "fringing": "equal", "shoulder": 1e-3},
                {
                    "outer_radius": 5e-3,
                    "inner_radius": 4e-3,
                    "fringing": "equal",
                    "shoulder": 1e-3,
                },
            ],
            iron=[{"material": "X6Cr17", "length": 50e-3, "area": 28e-6}],
            eddy=[{"conductivity": 1.6e6, "length": 20e-3, "radius": 2e-3}],
        ),
    }
    at_the_needle = ["spring.end", "coil.armature", "seat.upper", "stop.lower"]
    return Network(
        parts,
        [
            ["needle.body", *at_the_needle],
            ["seat.lower", "ground"],
            ["stop.upper", "ground"],
            ["coil.terminals", "driver.terminals"],
        ],
    )


def test_peak_and_hold_opens_a_valve_and_lets_it_close():
    result = simulate_network(
        valve(PeakHold(**PEAK_HOLD)).rows(), duration=3e-3, step=20e-9, coarse=16, record=1e-6
    )

    lift = result.channels["needle.body displacement"].values
    current = result.channels["coil current"].values
    assert lift.max() == pytest.approx(80e-6, rel=0.02)  # plus the indentation of the stop
    assert abs(lift[-1]) < 0.2e-6
    assert current.max() == pytest.approx(12.0, rel=0.05)  # the peak lies between records
    assert current.min() >= 0.0
    assert current[-1] == 0.0
    assert {event.stop for event in result.events} == {"stop", "seat"}
    assert result.books.relative_residual < 1e-9
    assert result.books.supplies["coil electric"] > 0.0
    assert result.books.losses["coil eddy"] > 0.0
    heat = result.books.losses["coil ohmic"]
    assert heat == pytest.approx(0.8 * np.trapezoid(current**2, result.time), rel=1e-3)


BOOST = {
    "battery": 14.0,
    "capacitance": 1e-4,
    "boost_voltage": 65.0,
    "recharge_power": 10.0,
    "peak_current": 12.0,
    "hold_current": 6.0,
    "hold_band": 1.0,
    "shots": [{"start": 1e-4, "end": 5e-4}, {"start": 7e-4, "end": 15e-4}],
}


@pytest.mark.parametrize(
    ("driver", "commands", "switching"),
    [
        (VoltageStep(voltage=12.0, start=1e-3, end=2e-3), ((1e-3, 2e-3),), False),
        (VoltageStep(voltage=12.0, end=2e-3, repeat_every=5e-3), ((0.0, 2e-3),), False),
        (TwoPoint(voltage=12.0, upper=3.0, lower=2.5), ((0.0, None),), True),
        (PulseWidth(voltage=12.0, period=1e-4, duty=0.5), ((0.0, None),), True),
        (PeakHold(**PEAK_HOLD), ((20e-6, 1.2e-3),), True),
        (BoostDriver(**BOOST), ((1e-4, 5e-4), (7e-4, 15e-4)), True),
        (DriveProfile(time=(0.0, 1e-3), voltage=(12.0, 12.0)), (), False),
        (DriveProfile(time=(0.0, 1e-3), current=(3.0, 3.0), supply_voltage=14.0), (), True),
        (VoltageTable(time=(0.0,), voltage=(12.0,)), (), False),
    ],
)
def test_a_driver_says_its_commands_and_whether_it_switches(driver, commands, switching):
    assert driver.commands() == commands
    assert driver.program().switching is switching
