"""What restrictions pass in a stroke, and the stairs after its impacts.

Truth: closed sums of prescribed flows, the mass that volumes hold before and after, the balance of
a piston, an integration by SciPy's LSODA that shares the law of the liquid alone, mirror images.
"""

from dataclasses import replace
from itertools import pairwise
from math import pi, sqrt, tanh
from types import SimpleNamespace

import numpy as np
import pytest
from pages import HOW_TO
from scipy.integrate import solve_ivp

from klack.analyses.stroke.delivery import (
    Restriction,
    deliveries,
    restrictions_of,
    starts_of,
    unfinished,
)
from klack.analyses.stroke.stairs import LineEnd, stairs
from klack.case.any_case import load_valve_case
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.gas.gas_chamber import GasChamber
from klack.hydraulics.gas.gas_library import library_gas
from klack.hydraulics.gas.gas_orifice import GasOrifice
from klack.hydraulics.gas.gas_source import GasSource
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.hydraulics.variable_orifice import VariableOrifice
from klack.magnetics.boost_driver import BoostDriver, Shot
from klack.mechanics.force import ForceOverTime
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.simulation.network_result import ChannelData, ImpactEvent
from klack.simulation.network_run import simulate_network

HEPTANE = library_fluid("n-heptane").at(293.15, gas_fraction=0.0)
HIGH, LOW = 6e5, 1.01325e5
RHO = float(HEPTANE.density(LOW))
STILL = {"needle": RigidMass(mass=3e-3), "spring": Spring(stiffness=1e4, preload=0.0)}


def run(parts, connections, duration, *, fluid=HEPTANE, record=1e-5, step=1e-7, **numbers):
    """Deliveries by name, and the result; a needle at rest makes it a valve."""
    if "needle" not in parts:
        parts = {**STILL, **parts}
        connections = [["needle.body", "spring.end"], *connections]
    network = Network(parts, connections, fluid=fluid, **numbers)
    rows = network.rows()
    result = simulate_network(rows, duration=duration, step=step, record=record)
    found = restrictions_of(rows, network, float(result.time[-1]))
    return {item.name: item for item in deliveries(found, result)}, result


def orifice(p_a, p_b, density, area, discharge=0.7, critical=1000.0):
    """Mass flow of an orifice, written once more."""
    drop, viscosity = abs(p_a - p_b), float(HEPTANE.viscosity(LOW))
    size = sqrt(4.0 * area / pi)
    number = 2.0 * size / (viscosity * critical) * sqrt(2.0 * density * drop)
    flow = discharge * area * sqrt(2.0 * density * drop) * tanh(number)
    return flow if p_a >= p_b else -flow


def test_a_constant_pressure_passes_the_steady_flow_times_the_time():
    hole = Orifice(diameter=4e-4, cavitation=None)
    parts = {"supply": PressureSource(pressure=HIGH), "hole": hole}
    found, result = run(parts, [["supply.fluid", "hole.a"], ["hole.b", "ambient"]], 1e-3)

    flow = orifice(HIGH, LOW, float(HEPTANE.density(HIGH)), hole.hole_area)
    item = found["hole"]
    assert item.mass == pytest.approx(flow * result.time[-1], rel=1e-12)
    assert item.volume == pytest.approx(item.mass / RHO, rel=1e-12)
    assert item.steady_flow == pytest.approx(flow, rel=1e-12)
    assert item.back_mass == pytest.approx(0.0, abs=1e-15 * item.mass)
    assert item.first_flow is None  # it flows from the start
    assert item.left == item.mass  # from one given pressure to another


@pytest.mark.parametrize("record", [1e-5, 3.7e-5])
def test_what_leaves_is_what_the_chamber_loses(record):
    """Mass is conserved by the solver: the sum over records must not lose any of it, 1e-9."""
    parts = {"tank": Chamber(volume=2e-6, pressure=HIGH), "hole": Orifice(diameter=2e-4)}
    ways = [["tank.fluid", "hole.a"], ["hole.b", "ambient"]]
    held, passed = [], []
    for duration in (2e-4, 6e-4):
        found, result = run(parts, ways, duration, record=record)
        held.append(float(np.sum(result.state["nodes.mass"])))
        passed.append(found["hole"].mass)
    assert held[0] - held[1] == pytest.approx(passed[1] - passed[0], rel=1e-9)
    assert passed[0] > 1e-9


def test_an_emptying_tank_against_lsoda():
    parts = {
        "tank": Chamber(volume=2e-6, pressure=HIGH),
        "hole": Orifice(diameter=2e-4, cavitation=None),
    }
    found, result = run(parts, [["tank.fluid", "hole.a"], ["hole.b", "ambient"]], 1e-3)

    def rates(_, y):
        density = float(HEPTANE.density(y[0]))
        flow = orifice(y[0], LOW, density, pi / 4 * 4e-8)
        stored = 2e-6 * density / float(HEPTANE.bulk_modulus(y[0]))
        return [-flow / stored, flow]

    end = solve_ivp(
        rates,
        [0.0, float(result.time[-1])],
        [HIGH, 0.0],
        method="LSODA",
        rtol=1e-9,
        atol=[1e-3, 1e-15],
    ).y[1, -1]
    # error of the steps, 3e-6; the rest is LSODA's
    assert found["hole"].mass == pytest.approx(end, rel=1e-5)


@pytest.mark.filterwarnings("ignore:'needle' displaces liquid")  # its inertia is not asked for
def test_a_piston_delivers_what_it_displaces():
    """``rho A y`` less what stays compressed; with ports exchanged all is mirrored."""
    found = []
    for a, b in (("a", "b"), ("b", "a")):
        parts = {
            "needle": RigidMass(mass=3e-3),
            "spring": Spring(stiffness=1e4, preload=0.0),
            "push": ForceOverTime(time=(1e-5, 2e-4), force=(0.0, 5.0)),
            "room": Chamber(volume=2e-7),
            "hole": Orifice(diameter=5e-4),
            "face": PressureFace(direction="closing", outer_diameter=5e-3),
        }
        mechanics = ["needle.body", "spring.end", "push.end", "face.body"]
        ways = [mechanics, ["room.fluid", f"hole.{a}", "face.fluid"], [f"hole.{b}", "ambient"]]
        numbers, result = run(parts, ways, 1e-3, record=2e-5)
        found.append(numbers["hole"])
    way = result.channels["needle.body displacement"].values[-1]
    left = 2e-7 - pi / 4 * 25e-6 * way
    density = float(HEPTANE.density(result.channels["room pressure"].values[-1]))
    out = RHO * 2e-7 - density * left
    assert way > 5e-5
    assert found[0].mass == pytest.approx(out, rel=1e-10)
    assert [item.ends for item in found] == [(False, True), (True, False)]
    assert found[1].left == pytest.approx(found[0].left, rel=1e-9)
    for key in ("mass", "peak_flow", "final_flow", "volume"):
        assert getattr(found[1], key) == pytest.approx(-getattr(found[0], key), rel=1e-9)
    assert found[1].first_flow == pytest.approx(found[0].first_flow, rel=1e-9)


STIFFNESS, MASS, PRELOAD, PULL = 1e4, 3e-3, 12.0, 22.0


def test_a_ballistic_pulse_against_lsoda():
    """Needle, sac and nozzle by LSODA; only density and modulus of the liquid are shared."""
    pulse = 3e-4
    parts = {
        "needle": RigidMass(mass=MASS),
        "spring": Spring(stiffness=STIFFNESS, preload=PRELOAD),
        "magnet": ForceOverTime(
            time=(1e-9, 2e-9, pulse, pulse + 1e-9), force=(PRELOAD, PULL, PULL, 0.0)
        ),
        "supply": PressureSource(pressure=HIGH),
        "edge": VariableOrifice(lift=(0.0, 1e-3), area=(0.0, 4e-6), cavitation=None),
        "sac": Chamber(volume=2e-9, pressure=LOW),
        "nozzle": Orifice(diameter=4e-4, cavitation=None),
    }
    mechanics = ["needle.body", "spring.end", "magnet.end", "edge.needle"]
    ways = [
        ["supply.fluid", "edge.a"],
        ["edge.b", "sac.fluid", "nozzle.a"],
        ["nozzle.b", "ambient"],
    ]
    end = 4.2e-4  # still open
    found, result = run(parts, [mechanics, *ways], end, record=2e-6, step=2e-8)

    def rates(t, s):
        y, v, p, _ = s
        pull = PULL if t < pulse else 0.0
        density = float(HEPTANE.density(p))
        through = orifice(HIGH, p, float(HEPTANE.density(HIGH)), max(4e-3 * y, 1e-30))
        out = orifice(p, LOW, density, pi / 4 * 16e-8)
        stored = 2e-9 * density / float(HEPTANE.bulk_modulus(p))
        return [v, (pull - PRELOAD - STIFFNESS * y) / MASS, (through - out) / stored, out]

    state, parts_of = np.array([0.0, 0.0, LOW, 0.0]), (0.0, pulse, float(result.time[-1]))
    for begin, until in pairwise(parts_of):
        run_on = solve_ivp(
            rates, [begin, until], state, method="LSODA", rtol=1e-9, atol=[1e-12, 1e-9, 1e-2, 1e-15]
        )
        state = run_on.y[:, -1]
    item = found["nozzle"]
    assert item.flows_on  # it is told that the pulse is not over
    assert item.mass == pytest.approx(float(state[3]), rel=3e-5)  # error of the steps, 8e-6
    assert item.first_flow < 1e-4


def test_gas_passes_what_its_chamber_gains():
    """Records of a hundred steps: what has passed is counted in each step, 1e-9."""
    parts = {
        "supply": GasSource(pressure=HIGH),
        "inlet": GasOrifice(diameter=4e-4),
        "room": GasChamber(volume=2e-6, pressure=LOW),
        "outlet": GasOrifice(diameter=2e-4),
    }
    ways = [["supply.gas", "inlet.a"], ["inlet.b", "room.gas", "outlet.a"], ["outlet.b", "ambient"]]
    found, result = run(
        parts, ways, 4e-3, record=2e-4, step=1e-6, fluid=None, gas=library_gas("air")
    )
    gained = np.ptp(result.channels["room mass"].values[[0, -1]])
    assert found["inlet"].mass - found["outlet"].mass == pytest.approx(gained, rel=1e-9)
    assert found["outlet"].volume > 2e-9
    assert found["inlet"].ends == (True, False)
    assert found["inlet"].left == 0.0


def test_gas_between_given_pressures_alone_is_not_computed():
    parts = {"supply": GasSource(pressure=HIGH), "hole": GasOrifice(diameter=4e-4)}
    ways = [["supply.gas", "hole.a"], ["hole.b", "ambient"]]
    found, _ = run(parts, ways, 1e-4, fluid=None, gas=library_gas("air"))
    assert found == {}


# ---- numbers of one flow, given as records ------------------------------------------------------


def flow_of(values, step, starts=(), component="nozzle", begin=0.0):
    """Deliveries of a given flow [kg/s], constant in each record."""
    time = begin + step * np.arange(len(values) + 1)
    channel = ChannelData(unit="kg/s", values=np.concatenate([[0.0], values]))
    pressure = ChannelData(unit="Pa", values=1e5 + 1e9 * time)
    result = SimpleNamespace(
        time=time, channels={f"{component} mass flow": channel, "sac pressure": pressure}
    )
    item = Restriction(
        component=component,
        flows=(f"{component} mass flow",),
        passed="",
        pressures=("sac pressure", ""),
        ambient=1e5,
        ends=(False, True),
        density=700.0,
        starts=starts,
        until=float(time[-1]),
    )
    return {x.name: x for x in deliveries([item], result)}


def trapezoid(step=1e-6, top=2e-3):
    """Rises over 0.1 ms from 0.2 ms on, falls from 0.7 to 0.8 ms."""
    middle = step * (np.arange(1000) + 0.5)
    return np.interp(middle, [2e-4, 3e-4, 7e-4, 8e-4], [0.0, top, top, 0.0])


def test_numbers_of_a_trapezoid():
    found = flow_of(trapezoid(), 1e-6, starts=(5e-5,))["nozzle"]
    assert found.mass == pytest.approx(2e-3 * 5e-4, rel=1e-12)
    assert found.steady_flow == pytest.approx(2e-3)
    assert found.first_flow == pytest.approx(2.01e-4, rel=1e-9)  # 1 % of the rise
    assert found.last_flow == pytest.approx(7.99e-4, rel=1e-9)
    assert found.flow_delay == pytest.approx(1.51e-4, rel=1e-9)
    # the pressure rises by 1 bar in 0.1 ms
    assert found.opening_pressure == pytest.approx(2.01e5)
    assert found.hysteresis == pytest.approx(-5.98e5)
    assert not found.flows_on


def test_a_leak_is_no_injection():
    """What flowed before and after is not the injection: times do not move, the mass does."""
    leak = 1e-4
    found = flow_of(leak + trapezoid(), 1e-6)["nozzle"]
    assert found.first_flow == pytest.approx(2.01e-4, rel=1e-9)
    assert found.initial_flow == pytest.approx(leak)
    assert found.mass == pytest.approx(2e-3 * 5e-4 + leak * 1e-3, rel=1e-12)
    alone = flow_of(np.full(1000, leak), 1e-6)["nozzle"]
    assert (alone.first_flow, alone.flow_delay, alone.opening_pressure) == (None, None, None)
    assert alone.steady_flow == pytest.approx(leak)


def test_nothing_flows():
    found = flow_of(np.zeros(1000), 1e-6, starts=(1e-4,))["nozzle"]
    assert (found.mass, found.back_mass, found.peak_flow) == (0.0, 0.0, 0.0)
    assert (found.steady_flow, found.first_flow, found.flow_delay) == (None, None, None)


def test_a_flow_that_turns_round_and_one_that_goes_on():
    values = np.concatenate([np.full(500, 1e-3), np.full(250, -1e-3), np.full(250, 1e-3)])
    found = flow_of(values, 1e-6)["nozzle"]
    assert found.mass == pytest.approx(5e-7, rel=1e-12)
    assert found.back_mass == pytest.approx(2.5e-7, rel=1e-12)
    back = flow_of(-values, 1e-6)["nozzle"]
    assert back.mass == pytest.approx(-5e-7, rel=1e-12)
    assert back.back_mass == pytest.approx(2.5e-7, rel=1e-12)
    rising = flow_of(np.linspace(0.0, 1e-3, 1000), 1e-6)["nozzle"]
    assert rising.flows_on
    assert rising.last_flow is None
    assert rising.steady_flow is None  # nowhere steady


def test_a_flow_under_way_has_an_end_but_no_beginning():
    """A valve that starts open; a command that comes while the pulse before it still flows."""
    open_first = flow_of(trapezoid()[400:], 1e-6, starts=(5e-5,))["nozzle"]
    assert (open_first.first_flow, open_first.flow_delay) == (None, None)
    assert open_first.last_flow == pytest.approx(3.99e-4, rel=1e-9)
    assert not open_first.flows_on
    found = flow_of(trapezoid(), 1e-6, starts=(5e-5, 2.8e-4, 5e-4))
    first, second, third = (found[f"nozzle.{k}"] for k in (1, 2, 3))
    assert first.flows_on
    assert next(unfinished([first])).startswith("'nozzle.1' still passes mass at 280 us")
    assert not list(unfinished([found["nozzle"], third]))
    assert (second.first_flow, second.last_flow, second.flows_on) == (None, None, True)
    assert (third.first_flow, third.flows_on) == (None, False)
    assert third.last_flow == pytest.approx(7.99e-4, rel=1e-9)
    assert found["nozzle"].last_flow == pytest.approx(7.99e-4, rel=1e-9)


@pytest.mark.parametrize("late", [0.0, 9e-7, 4.5e-6])  # the last after several runs
def test_a_run_that_goes_on_has_the_command_at_its_seam(late):
    """A run lasts up to a record longer than asked: both parts together have each command once."""
    pulse = np.interp(1e-6 * (np.arange(1000) + 0.5), [1e-4, 2e-4, 6e-4, 7e-4], [0, 1e-3, 1e-3, 0])
    starts = (0.0, 1e-3 - late, 2e-3 - late)
    first = flow_of(pulse, 1e-6, starts=starts)
    second = flow_of(pulse, 1e-6, starts=starts, begin=1e-3)

    assert list(first) == ["nozzle", "nozzle.1"]
    assert list(second) == ["nozzle", "nozzle.2"]
    for found in (second["nozzle"], second["nozzle.2"]):
        assert found.mass == pytest.approx(first["nozzle.1"].mass, rel=1e-9)
        assert found.flow_delay == pytest.approx(1.01e-4 + late, rel=1e-9)


def test_mirrored_ports_mirror_every_number():
    one, other = flow_of(trapezoid(), 1e-6)["nozzle"], flow_of(-trapezoid(), 1e-6)["nozzle"]
    signed = ("mass", "volume", "peak_flow", "steady_flow", "initial_flow", "final_flow")
    signed += ("opening_pressure", "closing_pressure")
    turned = {key: -getattr(one, key) for key in signed}
    assert other == replace(one, **turned)


def test_commands_share_the_mass_wherever_records_lie():
    """From command to command, between records too: the parts add up to the whole."""
    values = np.concatenate([trapezoid(), 0.5 * trapezoid()])
    found = flow_of(values, 1e-6, starts=(1.234e-4, 1.1e-3 + 1e-19))
    assert found["nozzle.1"].mass == pytest.approx(1e-6, rel=1e-12)
    assert found["nozzle.2"].mass == pytest.approx(0.5e-6, rel=1e-12)
    assert found["nozzle.1"].mass + found["nozzle.2"].mass == pytest.approx(found["nozzle"].mass)
    assert found["nozzle.2"].flow_delay == pytest.approx(1.01e-4, rel=1e-6)
    assert "nozzle.3" not in found
    many = flow_of(values, 1e-6, starts=tuple(1e-5 * np.arange(101)))
    assert (len(many), many["nozzle.100"].end) == (101, pytest.approx(1e-3))


# ---- stairs ------------------------------------------------------------------------------------


def staircase(pressures, echo=1e-4, area=2e-5, mass=5e-3, ripple=0.0, **sensor):
    """Stairs of a body whose force changes after each echo time."""
    impact = ImpactEvent(
        stop="seat",
        time=1e-3,
        approach_speed=0.5,
        peak_force=100.0,
        peak_time=1e-3,
        contact_time=1e-5,
        separation_time=1.01e-3,
        impulse=1e-3,
        restitution=0.9,
        energy_loss=0.0,
    )
    time = np.linspace(0.0, 2e-3, 20001)
    middle = impact.time + 0.5 * impact.contact_time
    k = np.clip(np.floor((time - middle) / echo).astype(int), 0, len(pressures) - 1)
    pressure = np.asarray(pressures)[k]
    force = area * pressure - 20.0
    speed = 0.5 + np.cumsum(force / mass) * (time[1] - time[0])
    speed += ripple * np.cos(2 * pi * 1e5 * time)
    result = SimpleNamespace(
        time=time,
        events=(impact,),
        channels={
            "mouth pressure": ChannelData(unit="Pa", values=pressure),
            "needle velocity": ChannelData(unit="m/s", values=speed),
        },
    )
    end = LineEnd(
        line="feed",
        echo_time=echo,
        pressure="mouth pressure",
        body="needle",
        velocity="needle velocity",
        area=area,
        mass=mass,
        stops=("seat",),
        **sensor,
    )
    return list(stairs([end], result))


def test_stairs_of_given_steps():
    """Height A dp 2L/(a m), time and sign of each; the lift leaves its parabola by a T^2/8."""
    found = staircase([6e5, 9e5, 5e5, 5e5])
    assert [x.number for x in found] == [1, 2, 3, 4, 5, 6]
    middle = 1.005e-3
    for stair, step in zip(found, (3e5, -4e5, 0.0), strict=False):
        slope = 2e-5 * step / 5e-3
        assert stair.pressure_step == pytest.approx(step, abs=1e-6)
        assert stair.force == pytest.approx(2e-5 * step, abs=1e-9)
        assert stair.seen_force == pytest.approx(2e-5 * step, abs=1e-6)
        assert stair.velocity_step == pytest.approx(slope * 1e-4, abs=1e-8)
        assert stair.lift == pytest.approx(abs(slope) * 1e-8 / 8.0, abs=1e-14)
        assert stair.expected_time == pytest.approx(middle + stair.number * 1e-4)
        assert stair.hidden_by == ("" if step else "vibration")
    assert found[0].time == pytest.approx(middle + 1e-4, abs=2e-7)  # two records


def test_stairs_below_the_vibration_are_said_to_be_so():
    """An amplitude r scatters by r/sqrt(2); a step of 0.12 m/s is lost in 0.1 m/s, not in 0.01."""
    lost, seen = (staircase([6e5, 9e5, 9e5], ripple=r)[0] for r in (0.1, 0.01))
    assert lost.scatter == pytest.approx(0.1 / sqrt(2.0), rel=0.05)
    assert (lost.hidden_by, seen.hidden_by) == ("vibration", "")


@pytest.mark.parametrize(
    ("sensor", "hidden"),
    [
        ({"resolution": 1.4e-6}, ""),  # the lift leaves its parabola by 1.5 um
        ({"resolution": 1.6e-6}, "sensor"),
        ({"bandwidth": 4e3}, ""),  # rises in 88 us, stairs of 100 us
        ({"bandwidth": 3e3}, "sensor"),
    ],
)
def test_stairs_that_the_sensor_does_not_show(sensor, hidden):
    assert staircase([6e5, 9e5, 9e5], **sensor)[0].hidden_by == hidden


def test_no_stairs_before_the_next_contact_or_without_records():
    """An echo that is as short as the impact leaves no stair to measure."""
    assert staircase([6e5, 9e5], echo=1.2e-5) == []


# ---- whose command it is -----------------------------------------------------------------------


def test_every_injector_has_the_commands_of_its_own_driver():
    """Four of them on one rail, a quarter of a cycle apart; the pump has none of its own."""
    case = load_valve_case(HOW_TO / "common_rail.yaml")
    network = case.network.network()
    found = {item.component: item for item in restrictions_of(network.rows(), network, 60e-3)}
    for number, start in ((1, 1.0), (2, 19.75), (3, 7.25), (4, 13.5)):
        starts = found[f"injector{number}_holes"].starts
        assert starts == pytest.approx(1e-3 * np.arange(start, 60.0, 25.0))
        assert found[f"injector{number}_holes"].ends == (False, True)
        assert found[f"injector{number}_nozzle"].ends == (False, False)
    assert "feed" not in found  # a line


def test_every_shot_of_a_driver_is_a_command():
    shots = [Shot(start=1e-3, end=2e-3), Shot(start=3e-3, end=4e-3)]
    driver = BoostDriver.model_construct(shots=tuple(shots), repeat_every=10e-3)
    parts = {"hole": Orifice(diameter=1e-3), "driver": driver}
    network = SimpleNamespace(components=parts, connections=(("hole.a", "driver.terminals"),))
    assert starts_of(network, "hole", 12e-3) == pytest.approx([1e-3, 3e-3, 11e-3])
