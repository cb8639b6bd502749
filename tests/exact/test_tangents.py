"""Derivatives of a run; truth: motions that are known in closed form, differences of the program.

A flight under a constant force and impacts on a linear stop, a mass on a spring, two elastic balls.
"""

from collections.abc import Callable
from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from numba import types
from numba.core.registry import cpu_target

from klack.contact.rubbing_law import RubbingLaw
from klack.contact.yielding_law import YieldingLaw
from klack.hydraulics.accumulator import Accumulator
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.check_valve import CheckValve
from klack.hydraulics.conical_seat import ConicalSeat
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pipe_friction import PipeFriction
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_loss import PressureLoss
from klack.hydraulics.pulsating_flow import PulsatingFlow
from klack.hydraulics.pump import Pump
from klack.hydraulics.relief_valve import ReliefValve
from klack.hydraulics.spool_edge import SpoolEdge
from klack.hydraulics.variable_orifice import VariableOrifice
from klack.hydraulics.wall_compliance import Wall
from klack.machine.compiling.jit import inner, njit
from klack.machine.compiling.tangent_number import tangent_number, with_tangents
from klack.mechanics.end_stop import EndStop
from klack.mechanics.force import ConstantForce
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.mechanics.stop_law import LinearStopLaw
from klack.network.network import Network
from klack.network.rows import Rows
from klack.simulation import tangent_run
from klack.simulation.network_run import simulate_network
from klack.simulation.tangent_loop import LANES, lanes_of
from klack.simulation.tangent_numbers import Direction
from klack.simulation.tangent_run import TangentRun, run_tangents

pytestmark = [
    pytest.mark.filterwarnings("ignore::klack.network.checks.LooseBodyWarning"),
    pytest.mark.slow,  # the loop with derivatives compiles for a minute
]

SMALL = 3e-5  # of a parameter: its numbers are differentiated by that
MASS, FORCE, GAP, STIFFNESS = 3e-3, 30.0, 100e-6, 1e9


def tangents(rows: Callable[..., Rows], given: dict[str, float], **run) -> TangentRun:
    """A run with its derivatives with each of the arguments of ``rows``."""
    directions = []
    for name, value in given.items():
        shift = SMALL * (abs(value) or 1.0)
        ends = [rows(**given | {name: value + way * shift}) for way in (1, -1)]
        directions.append(Direction(name=name, plus=ends[0], minus=ends[1], distance=2 * shift))
    return run_tangents(rows(**given), directions, **run)


def slopes(run: TangentRun, given: dict[str, float], read) -> dict[str, float]:
    """Derivatives of what is read from a run, each times the size of its parameter."""
    found = {}
    for k, (name, value) in enumerate(given.items()):
        size = abs(value) or 1.0
        ahead = 1e-6 * size
        ends = [read(run.moved(k, way * ahead)) for way in (1, -1)]
        found[name] = (ends[0] - ends[1]) / 2e-6
    return found


# --------------------------------------------------------------------------- numbers


def _polynomial(x, y):
    return 3.0 * x * y - y**3 + x / (1.0 + y) - 2.0 / x + x**1.5 - (1 - x)


def _functions(x, y):
    return sqrt(x) * cos(y) + sin(x * y) + abs(-y) + max(x, y, 0.1) - min(x, 2.0)


def _branches(x, y):
    total = 0.0
    for k in range(3):
        if x > y:
            total += k * x
        else:
            total -= y
    return total if not x < 0.0 else y


@pytest.mark.parametrize("formula", [_polynomial, _functions, _branches])
def test_numbers_follow_the_rules_of_calculus(formula):
    compiled = njit(formula)

    @njit
    def both(values):
        of = with_tangents(LANES, values)
        of[2] = compiled(of[0], of[1])

    values = lanes_of((3,))
    x, y = 1.3, 0.4
    values[0, :2], values[1, 0], values[1, 2] = (x, 1.0), y, 1.0
    both(values)

    h = 1e-6
    assert values[2, 0] == formula(x, y)
    by_x = (formula(x + h, y) - formula(x - h, y)) / (2 * h)
    by_y = (formula(x, y + h) - formula(x, y - h)) / (2 * h)
    assert values[2, 1] == pytest.approx(by_x, rel=1e-9, abs=1e-9)
    assert values[2, 2] == pytest.approx(by_y, rel=1e-9, abs=1e-9)
    assert not values[2, 3:].any()


# --------------------------------------------------------------------------- a bouncing ball


def ball(mass: float, force: float, gap: float, stiffness: float) -> Rows:
    """A mass that a constant force drives against an elastic stop."""
    parts = {
        "ball": RigidMass(mass=mass),
        "push": ConstantForce(force=force),
        "stop": EndStop(gap=gap, law=LinearStopLaw(kind="linear", stiffness=stiffness)),
    }
    joints = [["ball.body", "push.end", "stop.lower"], ["stop.upper", "ground"]]
    return Network(parts, joints).rows()


BALL = {"mass": MASS, "force": FORCE, "gap": GAP, "stiffness": STIFFNESS}


def closed(mass: float, force: float, gap: float, stiffness: float) -> float:
    """Time of contact: more than half a swing about the rest position on the stop."""
    speed, w = sqrt(2 * force * gap / mass), sqrt(stiffness / mass)
    return 2 * (pi - float(np.arctan2(speed / w, force / stiffness))) / w


FORMULAS = {
    "first touch": lambda mass, force, gap, stiffness: sqrt(2 * mass * gap / force),
    "approach_speed": lambda mass, force, gap, stiffness: sqrt(2 * force * gap / mass),
    "contact_time": closed,
    "peak_force": lambda mass, force, gap, stiffness: (
        force + sqrt(force**2 + 2 * stiffness * force * gap)
    ),
    "impulse": lambda mass, force, gap, stiffness: (
        2 * sqrt(2 * force * gap * mass) + force * closed(mass, force, gap, stiffness)
    ),
    "second touch": lambda mass, force, gap, stiffness: (
        3 * sqrt(2 * mass * gap / force) + closed(mass, force, gap, stiffness)
    ),
}
LEFT = {  # over the largest derivative: of steps of 5 ns
    "first touch": 1e-9,
    "approach_speed": 3e-5,  # it is that of the start of a step
    "contact_time": 1e-4,
    "peak_force": 1e-5,
    "impulse": 5e-6,
    "second touch": 1e-7,
}


def by_formula(read: Callable[..., float]) -> dict[str, float]:
    """Derivatives of a formula of the ball, each times its parameter."""
    found = {}
    for name, value in BALL.items():
        ends = [read(**BALL | {name: value * (1 + way * 1e-5)}) for way in (1, -1)]
        found[name] = (ends[0] - ends[1]) / 2e-5
    return found


@pytest.fixture(scope="module")
def ball_run():
    return tangents(ball, BALL, duration=480e-6, step=5e-9, coarse=1, start="free")


def test_plain_numbers_stay_plain_where_the_same_function_has_taken_tangents():
    """Truth: exact; what is compiled first must not decide what the other calls."""

    @inner
    def scaled(x, by):
        return x * by

    number, plain = tangent_number(LANES), types.float64
    scaled.get_call_template((number, plain), {})
    for args in ((plain, plain), (number, plain)):
        template, *_ = scaled.get_call_template(args, {})
        assert template(cpu_target.typing_context).apply(args, {}).args == args


@pytest.mark.parametrize("name", FORMULAS)
def test_impacts_of_a_ball_have_the_derivatives_of_their_formulas(ball_run, name):
    def read(result):
        if name.endswith("touch"):
            return result.events[0 if name.startswith("first") else 1].time
        return getattr(result.events[0], name)

    found = slopes(ball_run, BALL, read)

    exact = by_formula(FORMULAS[name])
    largest = max(abs(value) for value in exact.values())
    for key, value in exact.items():
        assert abs(found[key] - value) < LEFT[name] * largest, key


def test_touches_at_fixed_steps_would_have_other_derivatives(ball_run, monkeypatch):
    """Why steps follow the touches: the force of the program at fixed steps is a saw-tooth."""
    monkeypatch.setattr(tangent_run._Running, "_touch", lambda self, part: None)
    fixed = tangents(ball, BALL, duration=200e-6, step=5e-9, coarse=1, start="free")

    exact, kept, lost = (
        by_formula(FORMULAS["peak_force"])["gap"],
        slopes(ball_run, BALL, lambda result: result.events[0].peak_force)["gap"],
        slopes(fixed, BALL, lambda result: result.events[0].approach_speed)["gap"],
    )

    assert kept == pytest.approx(exact, rel=1e-5)
    assert lost == pytest.approx(0.0, abs=1e-6)  # at a given time the ball has its speed


# --------------------------------------------------------------------------- faces with friction


def rubbed(mass: float, speed: float, stiffness: float, friction: float) -> Rows:
    """A mass that flies against a stop of one spring and one slider."""
    law = RubbingLaw(
        onset=[0.0], normal=[stiffness], strength=[friction * stiffness], ratio=SLOPE / friction
    )
    stop = EndStop(gap=20e-6, law=LinearStopLaw(kind="linear", stiffness=stiffness)).with_law(law)
    parts = {"ball": RigidMass(mass=mass, speed=speed), "stop": stop}
    return Network(parts, [["ball.body", "stop.lower"], ["stop.upper", "ground"]]).rows()


SLOPE = 0.8  # of the held sliders over that of the pressure
RUBBED = {"mass": MASS, "speed": 1.0, "stiffness": STIFFNESS, "friction": 0.1}


def rebound(mass: float, speed: float, stiffness: float, friction: float) -> float:
    """Speed after the impact: see :mod:`klack.contact.rubbing_law`."""
    ratio = SLOPE / friction
    return speed * sqrt(1.0 - 2 * friction / (1 + friction) * (ratio - 1) / (ratio + 1))


def pressed(mass: float, speed: float, stiffness: float, friction: float) -> float:
    """Peak force: all sliders slip up."""
    return speed * sqrt(mass * stiffness * (1.0 + friction))


def test_sliders_carry_their_derivatives():
    run = tangents(rubbed, RUBBED, duration=60e-6, step=5e-9, coarse=1, start="free")

    reads = {
        rebound: lambda result: -result.channels["ball velocity"].values[-1],
        pressed: lambda result: result.events[0].peak_force,
    }
    for formula, read in reads.items():
        found, exact = slopes(run, RUBBED, read), {}
        for name, value in RUBBED.items():
            ends = [formula(**RUBBED | {name: value * (1 + way * 1e-5)}) for way in (1, -1)]
            exact[name] = (ends[0] - ends[1]) / 2e-5
        largest = max(abs(value) for value in exact.values())
        for name, value in exact.items():
            assert abs(found[name] - value) < 1e-3 * largest, (formula.__name__, name)


# --------------------------------------------------------------------------- faces that yield

YIELDING = {"mass": MASS, "speed": 1.0, "stiffness": STIFFNESS, "share": 0.6}


def yielding(mass: float, speed: float, stiffness: float, share: float) -> Rows:
    """A mass that flies against faces that close with a share of the stiffness they open with."""
    largest = np.linspace(1e-10, 60e-6, 3)
    law = YieldingLaw(
        largest=largest,
        set=largest * (1 - share),
        closing=share * stiffness * largest,
        shape=np.tile((np.arange(17) / 16) ** 2, (3, 1)),
    )
    stop = EndStop(gap=20e-6, law=LinearStopLaw(kind="linear", stiffness=stiffness)).with_law(law)
    parts = {
        "ball": RigidMass(mass=mass, speed=speed),
        "stop": stop,
        "push": ConstantForce(force=AGAIN),
    }
    joints = [["ball.body", "stop.lower", "push.end"], ["stop.upper", "ground"]]
    return Network(parts, joints).rows()


AGAIN = 60.0  # [N] that press the ball against the stop a second time


def test_faces_that_yield_carry_their_derivatives():
    """Truth: differences of runs; the first peak by its energy."""
    given = {"duration": 300e-6, "step": 5e-9, "coarse": 1, "start": "free"}
    run = tangents(yielding, YIELDING, **given)

    reads = {
        "first force": lambda result: result.events[0].peak_force,
        "second force": lambda result: result.events[1].peak_force,
        "second touch": lambda result: result.events[1].time,
    }
    for what, read in reads.items():
        found, differences = slopes(run, YIELDING, read), {}
        for name, value in YIELDING.items():
            ends = [
                read(simulate_network(yielding(**YIELDING | {name: value * (1 + way)}), **given))
                for way in (1e-3, -1e-3)
            ]
            differences[name] = (ends[0] - ends[1]) / 2e-3
        largest = max(abs(value) for value in differences.values())
        for name, value in differences.items():
            # runs know their touches to a step
            accepted = 5e-9 / 2e-3 if what == "second touch" else 2e-3 * largest
            assert abs(found[name] - value) < accepted, (what, name, found, differences)
    first = simulate_network(yielding(**YIELDING), **given).events[0]
    energy = 0.5 * MASS * YIELDING["speed"] ** 2 + AGAIN * 20e-6
    force = AGAIN + sqrt(AGAIN**2 + 2 * STIFFNESS * YIELDING["share"] * energy)
    assert first.peak_force == pytest.approx(force, rel=1e-4)


# --------------------------------------------------------------------------- two elastic balls


def balls(upper: float, lower: float) -> Rows:
    """Two equal masses that fly freely; only their speeds differ."""
    parts = {
        "upper": RigidMass(mass=MASS, speed=upper),
        "lower": RigidMass(mass=MASS, speed=lower),
        "stop": EndStop(gap=20e-6, law=LinearStopLaw(kind="linear", stiffness=STIFFNESS)),
    }
    return Network(parts, [["upper.body", "stop.upper"], ["lower.body", "stop.lower"]]).rows()


def test_equal_elastic_balls_exchange_their_speeds():
    given = {"upper": -0.2, "lower": 0.5}
    run = tangents(balls, given, duration=60e-6, start="free")

    for body, exact in (("upper", (0.0, 1.0)), ("lower", (1.0, 0.0))):
        channel = f"{body} velocity"
        found = slopes(run, given, lambda result, c=channel: result.channels[c].values[-1])
        shares = [found[name] / abs(value) for name, value in given.items()]
        assert shares == pytest.approx(exact, abs=1e-9)


# --------------------------------------------------------------------------- a mass on a spring


def swing(mass: float, stiffness: float, preload: float) -> Rows:
    parts = {
        "mass": RigidMass(mass=mass),
        "spring": Spring(stiffness=stiffness, preload=preload),
    }
    return Network(parts, [["mass.body", "spring.end"]]).rows()


def test_mass_on_a_spring_follows_its_formula():
    given = {"mass": 3e-3, "stiffness": 5e6, "preload": 20.0}
    run = tangents(swing, given, duration=100e-6, step=20e-9, coarse=1, start="free")

    def exact(mass, stiffness, preload):
        return -preload / stiffness * (1 - cos(sqrt(stiffness / mass) * 100e-6))

    found = slopes(run, given, lambda r: r.channels["mass.body displacement"].values[-1])

    for name, value in given.items():
        ends = [exact(**given | {name: value * (1 + way * 1e-5)}) for way in (1, -1)]
        assert found[name] == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-5), name


@pytest.mark.parametrize("coarse", [1, None])
def test_program_itself_is_differentiated(coarse):
    """Central differences of the program, whose decisions are the same so close to each other."""
    given = {"mass": 3e-3, "stiffness": 5e6, "preload": 20.0}
    steps = {"duration": 100e-6, "coarse": coarse, "start": "free"}
    run = tangents(swing, given, **steps)

    for name, value in given.items():
        h = 1e-5
        ends = [
            simulate_network(swing(**given | {name: value * (1 + way * h)}), **steps)
            for way in (1, -1)
        ]
        for channel in ("mass.body displacement", "mass.body velocity"):
            found = slopes(run, given, lambda r, c=channel: r.channels[c].values[1:])[name]
            plus, minus = (end.channels[channel].values[1:] for end in ends)
            np.testing.assert_allclose(
                found, (plus - minus) / (2 * h), rtol=1e-6, atol=1e-8 * np.abs(found).max()
            )


# --------------------------------------------------------------------------- hydraulic parts

OIL = library_fluid("ISO VG 46").at(313.15)
SUPPLY = {
    "displacement": 10e-6,
    "setting": 50e5,  # open from the start on: differences across a corner blur it
    "precharge": 40e5,
    "bore": 3e-3,
    "overlap": -40e-6,
    "wall": 1e9,
}


def supply(displacement, setting, precharge, bore, overlap, wall):
    start = {"pressure": 55e5}
    tip = ConicalSeat(
        half_angle=0.6,
        lower_diameter=2e-3,
        upper_diameter=4e-3,
        edge_diameter=bore,
        tip_half_angle=0.8,
        edge_radius=20e-6,
        lift=50e-6,
        tip_side="a",
    )
    parts = {
        "pump": Pump(
            displacement=displacement,
            speed=25.0,
            pistons=7,
            volumetric_efficiency=0.9,
            rated_pressure=200e5,
        ),
        "ripple": PulsatingFlow(mean=0.0, harmonics=[{"frequency": 3e3, "amplitude": 2e-5}]),
        "outlet": Chamber(volume=5e-6, wall=Wall(bulk_modulus=wall), pressure=56e5),
        "check": CheckValve(cracking_pressure=2e4, open_pressure=2e5, diameter=bore),
        "rail": Chamber(volume=5e-6, **start),
        "relief": ReliefValve(
            set_pressure=setting,
            rated_pressure=1.1 * setting,
            rated_flow=4e-4,
            diameter=5e-3,
            time_constant=1e-4,
        ),
        "gas": Accumulator(volume=1e-5, precharge=precharge, inlet_diameter=bore),
        "pipe": PipeFriction(length=0.3, diameter=bore, roughness=1e-5),
        "bend": Chamber(volume=1e-6, **start),
        "loss": PressureLoss(diameter=bore, coefficient=0.7),
        "room": Chamber(volume=2e-6, **start),
        "edge": SpoolEdge(
            diameter=6e-3,
            radial_clearance=5e-6,
            overlap=overlap,
            direction="opening",
            flow_force={"velocity_coefficient": 0.98},
            notches=[
                {"shape": "rectangular", "count": 1, "width": 8e-5, "length": 1e-4, "depth": 1e-4},
                {"shape": "triangular", "count": 2, "width": 1e-4, "length": 3e-4, "depth": 1e-4},
                {"shape": "round", "count": 1, "width": 8e-5, "length": 2e-4, "depth": 1e-4},
                {"shape": "hole", "count": 1, "width": 1e-4, "length": 4e-4},
            ],
        ),
        "far": Chamber(volume=1e-6, pressure=20e5),
        "bypass": VariableOrifice(lift=[-1e-3, 1e-3], area=[0.0, 2e-7]),
        "switch": VariableOrifice(time=[0.0, 1e-3], area=[0.0, 5e-7]),
        "drain": Orifice(diameter=2e-3),
        "return": Orifice(diameter=3e-4),  # closes a ring of four volumes
        "tip": tip,
        "under": PressureFace(direction="opening", outer_diameter=tip.sealing_diameter),
        "face": PressureFace(direction="opening", outer_diameter=6e-3),
        "spool": RigidMass(mass=20e-3),
        "spring": Spring(stiffness=2e6, preload=150.0, damping=20.0),
    }
    joints = [
        ["pump.b", "ripple.b", "outlet.fluid", "check.a", "return.b"],
        ["check.b", "rail.fluid", "relief.a", "gas.fluid", "pipe.a"],
        ["relief.b", "ambient"],
        ["pipe.b", "bend.fluid", "loss.a"],
        ["loss.b", "room.fluid", "edge.a", "bypass.a", "switch.a", "face.fluid", "return.a"],
        ["edge.b", "far.fluid", "bypass.b", "switch.b", "drain.a", "tip.a", "under.fluid"],
        ["drain.b", "tip.b", "ambient"],
        [
            "spool.body",
            "spring.end",
            "face.body",
            "edge.spool",
            "bypass.needle",
            "tip.needle",
            "under.body",
        ],
    ]
    return Network(parts, joints, fluid=OIL).rows()


def test_a_supply_of_all_parts_carries_its_derivatives():
    steps = {"duration": 1e-3, "step": 0.5e-6, "coarse": 1, "record": 5e-6, "start": "free"}
    run = tangents(supply, SUPPLY, **steps)

    for name, value in SUPPLY.items():
        h = 1e-5
        ends = [
            simulate_network(supply(**SUPPLY | {name: value * (1 + way * h)}), **steps)
            for way in (1, -1)
        ]
        for channel in ("rail pressure", "far pressure", "gas gas volume"):
            found = slopes(run, SUPPLY, lambda r, c=channel: r.channels[c].values[1:])[name]
            plus, minus = (end.channels[channel].values[1:] for end in ends)
            error = np.abs(found - np.sign(value) * (plus - minus) / (2 * h))
            scale = np.abs(found).max()
            assert np.quantile(error, 0.95) <= 3e-4 * scale, name
            # differences are blurred where the corner of a valve lies between both runs
            assert error.max() <= 1e-2 * scale, name
