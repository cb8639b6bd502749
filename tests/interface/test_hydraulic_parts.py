"""Truth: what valves by characteristic, accumulators and pumps refuse and say."""

import re
import warnings

import pytest
from doubts import doubts
from draws import each

from klack.errors import AccuracyWarning, InputError
from klack.hydraulics.accumulator import Accumulator
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.check_valve import CheckValve
from klack.hydraulics.flow_source import FlowSource
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_source import PressureSource
from klack.hydraulics.pulsating_flow import PulsatingFlow
from klack.hydraulics.pump import Pump
from klack.hydraulics.relief_valve import ReliefValve
from klack.hydraulics.variable_orifice import VariableOrifice
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.simulation.network_run import simulate_network

OIL = library_fluid("ISO VG 46").at(313.15)
CHECK = {"cracking_pressure": 5e4, "open_pressure": 2e5, "diameter": 5e-3}
RELIEF = {"set_pressure": 1e7, "rated_pressure": 1.1e7, "rated_flow": 3e-4, "diameter": 5e-3}


@each(
    ("build", "text"),
    [
        (lambda: CheckValve(**{**CHECK, "open_pressure": 5e4}), "more than the cracking pressure"),
        (lambda: CheckValve(**CHECK, area=1e-6), "diameter and area together"),
        (lambda: CheckValve(**CHECK, leak_area=1e-3), "less than the area when open"),
        (lambda: ReliefValve(**{**RELIEF, "rated_pressure": 1e7}), "more than the set pressure"),
        (lambda: ReliefValve(**RELIEF, hysteresis=2e7), "less than the set pressure"),
        (lambda: ReliefValve(**{**RELIEF, "diameter": None}), "exactly one of diameter, area"),
        (lambda: Accumulator(volume=1e-3, precharge=1e6, exponent=0.9), "greater than or equal"),
        (lambda: Accumulator(volume=1e-3, precharge=1e6, full_at=1.0), "less than 1"),
        (lambda: Accumulator(volume=1e-3, precharge=0.0), "greater than 0"),
        (lambda: VariableOrifice(area=[0.0, 1e-6]), "exactly one of lift, time"),
        (lambda: VariableOrifice(lift=[0.0, 1e-4], area=[0.0]), "at least 2"),
        (lambda: VariableOrifice(lift=[0.0, 1e-4], area=[0.0, 1.0, 2.0]), "3 areas for 2 values"),
        (lambda: VariableOrifice(time=[1.0, 1.0], area=[0.0, 1e-6]), "values that rise"),
        (lambda: VariableOrifice(time=[0.0, 1.0], area=[0.0, -1e-6]), "0 or more"),
        (lambda: Pump(displacement=1e-5, speed=0.0), "greater than 0"),
        (lambda: Pump(displacement=1e-5, speed=25.0, pistons=0), "greater than or equal to 1"),
        (lambda: Pump(displacement=1e-5, speed=25.0, rated_pressure=1e7), "without"),
        (lambda: Pump(displacement=1e-5, speed=25.0, volumetric_efficiency=0.9), "without"),
        (lambda: PulsatingFlow(mean=1e-5, harmonics=[]), "at least 1"),
        (
            lambda: PulsatingFlow(mean=1e-5, harmonics=[{"frequency": 0.0, "amplitude": 1e-6}]),
            "greater than 0",
        ),
    ],
)
def test_wrong_numbers_are_refused_in_words(build, text):
    with pytest.raises(InputError, match=r"(?s)Try: ") as caught:
        build()

    assert text in str(caught.value)


def network(parts, joints):
    held = {"needle": RigidMass(mass=1e-3), "spring": Spring(stiffness=1e4, preload=0.0)}
    return Network({**held, **parts}, [["needle.body", "spring.end"], *joints], fluid=OIL)


def test_a_rated_point_that_the_open_valve_cannot_pass_is_refused():
    valve = ReliefValve(**{**RELIEF, "rated_flow": 5e-3})
    parts = {"rail": Chamber(volume=1e-6), "relief": valve}

    with pytest.raises(InputError, match=r"relief.rated_flow.*less than the area when fully open"):
        network(parts, [["rail.fluid", "relief.a"], ["relief.b", "ambient"]]).rows()


def test_an_accumulator_without_a_volume_beside_it_asks_for_a_chamber():
    parts = {"pump": FlowSource(flow=1e-5), "gas": Accumulator(volume=1e-5, precharge=5e6)}

    with pytest.raises(InputError, match="a chamber, a prescribed pressure"):
        network(parts, [["pump.b", "gas.fluid"]])


@pytest.mark.slow
def test_an_accumulator_at_a_prescribed_pressure_takes_what_it_holds():
    parts = {
        "rail": PressureSource(pressure=50e5, step={"to": 100e5, "at": 1e-4, "rise": 1e-4}),
        "gas": Accumulator(volume=1e-5, precharge=40e5),
    }
    result = simulate_network(
        network(parts, [["rail.fluid", "gas.fluid"]]).rows(), duration=5e-4, step=1e-7
    )

    end = result.channels["gas gas volume"].values[-1]
    assert end == pytest.approx(1e-5 * 0.4 ** (1 / 1.4), rel=1e-9)
    assert result.books.relative_residual <= 1e-12


def filled(flow, pressure, precharge=60e5, volume=2e-6):
    """Run a pump against an accumulator, with a leak."""
    parts = {
        "pump": FlowSource(flow=flow),
        "rail": Chamber(volume=5e-6, pressure=pressure),
        "gas": Accumulator(volume=volume, precharge=precharge, full_at=0.3),
        "leak": Orifice(diameter=0.5e-3),
    }
    joints = [["pump.b", "rail.fluid", "gas.fluid", "leak.a"], ["leak.b", "ambient"]]
    return simulate_network(network(parts, joints).rows(), duration=60e-3, step=1e-6, record=1e-4)


def test_a_full_accumulator_says_so_and_the_pressure_rises():
    with doubts() as told:
        result = filled(5e-5, 80e5)

    (text,) = told
    assert re.match(r"'gas': at .* ms the gas volume.*It is full", text)
    assert result.channels["gas gas volume"].values.min() == pytest.approx(0.3 * 2e-6, rel=1e-12)
    # full from 60 bar / 0.3^1.4 on
    assert result.channels["rail pressure"].values[-1] > 1.2 * 60e5 * 0.3**-1.4


def test_an_empty_accumulator_says_so_and_holds_nothing():
    with pytest.warns(AccuracyWarning, match=r"'gas': at .* ms the gas volume.*It is empty"):
        result = filled(0.0, 65e5)

    assert result.channels["gas gas volume"].values[-1] == 2e-6
    assert result.channels["rail pressure"].values[-1] < 10e5


def test_an_accumulator_that_fills_from_below_its_precharge_is_silent():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = filled(2e-5, 20e5)

    gas = result.channels["gas gas volume"].values
    assert gas[0] == 2e-6
    assert gas[-1] < 2e-6


def test_full_and_empty_are_told_of_apart():
    parts = {
        "rail": PressureSource(
            table={"time": [0.0, 1e-4, 2e-4, 3e-4], "pressure": [50e5, 500e5, 500e5, 30e5]}
        ),
        "gas": Accumulator(volume=1e-5, precharge=40e5, full_at=0.3),
    }
    with doubts() as texts:
        simulate_network(
            network(parts, [["rail.fluid", "gas.fluid"]]).rows(), duration=5e-4, step=1e-7
        )

    assert len(texts) == 2
    assert "It is full" in texts[0]
    assert "It is empty" in texts[1]
