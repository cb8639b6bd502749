"""Random valves: each ends in an operating point that is right, in a visible doubt, or in an error.

Truth: forces and flows of the point from formulas written here, which know nothing of klack's step
functions: Hooke, a linear stop, one magnetic gap, pressure times area, orifices and a flat seat.
"""

from dataclasses import dataclass
from math import pi, sqrt, tanh

import numpy as np
import pytest
from scipy.linalg import expm

from klack.analyses.operating_point.run import searched
from klack.errors import ConvergenceError, InputError
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.flow_source import FlowSource
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.hydraulics.seat import Seat
from klack.magnetics.constant_drive import driven
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.solenoid_parts import PoleGap
from klack.magnetics.voltage_step import VoltageStep
from klack.mechanics.end_stop import EndStop
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.component import Component
from klack.network.network import Network
from klack.simulation.linear_network import linear_network
from klack.simulation.modal_step import ROW, ROW_V
from klack.simulation.network_compile import compile_network
from klack.simulation.network_run import saved_state, simulate_network
from klack.simulation.operating_point import (
    OperatingPoint,
    compiled_at,
    far_ends,
    operating_point,
    steady_rows,
)
from klack.simulation.static_start import begin_steady
from klack.simulation.step_sizes import step_sizes

pytestmark = pytest.mark.slow

KICK = 1e-6  # [m/s]
FLUID = library_fluid("n-heptane").at(293.15)
AMBIENT, MU0 = 101325.0, 4e-7 * pi
MU = float(FLUID.viscosity(AMBIENT))
RHO = float(FLUID.density(AMBIENT))


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """Numbers of a valve, each over the range that a designer might choose from."""

    rate: float
    preload: float
    stiffness: float
    lift: float
    turns: float
    pole: float
    residual: float
    current: float
    rail: float
    pump: float | None
    seat: float
    holes: tuple[float, ...]
    guesses: tuple[float | None, ...]
    volumes: tuple[float, ...]
    faces: bool

    @classmethod
    def of(cls, seed: int) -> "Drawn":
        r = np.random.default_rng(seed)

        def spread(low: float, high: float) -> float:
            return float(np.exp(r.uniform(np.log(low), np.log(high))))

        holes = tuple(spread(0.1e-3, 3e-3) for _ in range(3))
        most = 0.7 * pi / 4 * holes[1] ** 2 * sqrt(2.0 * 300e5 / RHO)  # the nozzle at 300 bar
        turns, lift, seat = float(r.integers(20, 500)), spread(20e-6, 1e-3), spread(0.5e-3, 10e-3)
        pole, residual = spread(2e-3, 8e-3), spread(20e-6, 200e-6)
        # 1 to 300 N over the closed gap
        ampere_turns = residual * sqrt(2.0 * spread(1.0, 300.0) / (MU0 * pi * pole**2))
        return cls(
            rate=spread(1e3, 1e5),
            preload=float(r.uniform(-5.0, 60.0)),
            stiffness=spread(1e7, 1e10),
            lift=lift,
            turns=turns,
            pole=pole,
            residual=residual,
            current=float(r.choice([0.0, 1.0, 1.0, 1.0])) * ampere_turns / turns,
            rail=spread(1.5e5, 500e5),
            pump=spread(1e-4, 1.0) * most if r.random() < 0.3 else None,
            seat=seat,
            holes=holes,
            guesses=tuple(spread(1e5, 500e5) if r.random() < 0.5 else None for _ in range(3)),
            volumes=tuple(2.0 * seat**2 * lift + spread(1e-9, 1e-5) for _ in range(3)),
            faces=bool(r.random() < 0.7),
        )

    def network(self) -> Network:
        """Supply, inlet, seat, sac, outlet; a room above the needle behind an orifice."""
        law = {"kind": "linear", "stiffness": self.stiffness}
        rooms = zip(("inlet", "sac", "above"), self.volumes, self.guesses, strict=True)
        parts: dict[str, Component] = {
            "needle": RigidMass(mass=4e-3, points=("tip",)),
            "spring": Spring(stiffness=self.rate, preload=self.preload),
            "closing": EndStop.model_validate({"gap": 0.0, "law": law}),
            "opening": EndStop.model_validate({"gap": self.lift, "law": law}),
            "coil": Solenoid(
                turns=self.turns,
                resistance=1.0,
                gap=self.lift,
                residual_gap=self.residual,
                poles=(PoleGap(outer_radius=self.pole, fringing="none"),),
            ),
            "driver": VoltageStep(voltage=12.0),
            **{name: Chamber(volume=V, pressure=p) for name, V, p in rooms},
            "seat": Seat(shape="flat", diameter=self.seat, cavitation=None),
            "nozzle": Orifice(diameter=self.holes[1], cavitation=None),
            "bypass": Orifice(diameter=self.holes[2], cavitation=None),
        }
        joints = [
            ["needle.tip", "spring.end", "closing.upper", "opening.lower", "coil.armature"],
            ["ground", "closing.lower"],
            ["ground", "opening.upper"],
            ["driver.terminals", "coil.terminals"],
            ["inlet.fluid", "seat.a", "bypass.a"],
            ["seat.b", "sac.fluid", "nozzle.a"],
            ["nozzle.b", "ambient"],
            ["bypass.b", "above.fluid"],
        ]
        joints[0].append("seat.needle")
        if self.pump is None:
            parts |= {
                "rail": PressureSource(pressure=self.rail),
                "feed": Orifice(diameter=self.holes[0], cavitation=None),
            }
            joints[4].append("feed.b")
            joints.append(["rail.fluid", "feed.a"])
        else:
            parts["pump"] = FlowSource(flow=self.pump)
            joints[4].append("pump.b")
        if self.faces:
            parts |= {
                "tip": PressureFace(direction="opening", outer_diameter=self.seat),
                "back": PressureFace(direction="closing", outer_diameter=self.seat),
            }
            joints[4].append("tip.fluid")
            joints[7].append("back.fluid")
            joints[0] += ["tip.body", "back.body"]
        return Network(parts, joints, fluid=FLUID)


def hole(up: float, down: float, size: float) -> float:
    """Mass flow of an orifice."""
    if up < down:
        return -hole(down, up, size)
    root = sqrt(2.0 * float(FLUID.density(up)) * (up - down))
    return 0.7 * pi / 4 * size**2 * root * tanh(2.0 * size / (MU * 1000.0) * root)


def edge(up: float, down: float, size: float, lift: float) -> float:
    """Mass flow of a flat seat whose area ends at that of its bore."""
    if up < down:
        return -edge(down, up, size, lift)
    if lift <= 1e-12:
        return 0.0
    rho, conductance = float(FLUID.density(up)), 0.7 * min(pi * size * lift, pi / 4 * size**2)
    a = 100.0 * MU / 8.0 / (conductance * lift)
    b = rho / (2.0 * conductance**2)
    return rho * 2.0 * (up - down) / (a + sqrt(a * a + 4.0 * b * (up - down)))


def balances(drawn: Drawn, point: OperatingPoint) -> dict[str, tuple[float, float]]:
    """What is left of each balance, and the sum of what it is made of."""
    y = point.start.displacement["needle.tip"]
    p = point.start.pressure
    gap = drawn.lift + drawn.residual - y
    forces = [
        -drawn.preload - drawn.rate * y,
        drawn.stiffness * max(0.0, -y),
        -drawn.stiffness * max(0.0, y - drawn.lift),
        MU0 * pi * drawn.pole**2 * (drawn.turns * drawn.current / gap) ** 2 / 2.0,
    ]
    if drawn.faces:
        area = pi / 4 * drawn.seat**2
        forces += [area * (p["inlet"] - AMBIENT), -area * (p["above"] - AMBIENT)]
    supply = (
        hole(drawn.rail, p["inlet"], drawn.holes[0]) if drawn.pump is None else drawn.pump * RHO
    )
    through = edge(p["inlet"], p["sac"], drawn.seat, y)
    out = hole(p["sac"], AMBIENT, drawn.holes[1])
    up = hole(p["inlet"], p["above"], drawn.holes[2])
    # an opening that the needle barely leaves is as well known as the needle's place
    blurred = abs(through) * 1e-15 / max(abs(y), 1e-15) * 1e9 if y > 0.0 else 0.0
    flows = {
        "inlet": [supply, -through, -up],
        "sac": [through, -out],
        "above": [up],
    }
    # pressures are known to 1e-16 of themselves, and orifices at rest answer that
    floor = 1e-2 * max(hole(max(drawn.rail, 2e5), AMBIENT, size) for size in drawn.holes)
    sizes = {name: sum(map(abs, terms)) + blurred + floor for name, terms in flows.items()}
    # elastic stops carry differences of displacements that are known to 1e-16 of the lift
    stop = 1e9 * 1e-16 * drawn.stiffness * max(abs(y), drawn.lift)
    return {
        "force": (sum(forces), sum(map(abs, forces)) + stop),
        **{name: (sum(terms), sizes[name]) for name, terms in flows.items()},
    }


def answer(seed: int) -> str:
    """Kind of the answer; a point that is wrong fails."""
    drawn = Drawn.of(seed)
    try:
        rows = driven(drawn.network(), {"coil": drawn.current}).rows()
        point = operating_point(rows)
    except (InputError, ConvergenceError) as error:
        # every valve here has two stops and an outlet: only a pump against a shut seat has no end
        known = drawn.pump is not None or "magnet of 'coil'" in str(error)
        if not known or "Try:" not in str(error):
            raise
        return "error" if isinstance(error, InputError) else "not found"
    # klack stops at 1e-14 of forces and flows, or at 1e-9 where round-off leaves no less
    for name, (left, size) in balances(drawn, point).items():
        assert abs(left) <= 1e-8 * size, (seed, name, left, size)
    for first in far_ends(rows):
        try:
            other = operating_point(rows, first=first)
        except (InputError, ConvergenceError):
            continue
        for name, (left, size) in balances(drawn, other).items():
            assert abs(left) <= 1e-8 * size, (seed, "far", name, left, size)
    if seed % 10 == 0 and point.stable:
        run = simulate_network(steady_rows(rows), duration=20e-6, record=1e-6, state=point.state)
        lift = run.channels["needle.tip displacement"].values
        assert np.max(np.abs(lift - lift[0])) < 1e-8 * drawn.lift, seed
    if point.enclosed:
        return "enclosed"
    return "point" if point.stable else "does not hold"


def tally(seeds: range) -> dict[str, int]:
    kinds = [answer(seed) for seed in seeds]
    return {kind: kinds.count(kind) for kind in sorted(set(kinds))}


def test_random_valves_end_in_a_right_point_or_in_words():
    found = tally(range(12))

    assert found.get("point", 0) >= 6, found
    assert found.get("not found", 0) <= 1, found


def test_pressures_guessed_so_high_that_the_search_fails_are_left_with_a_word():
    """400 bar in a chamber at 2 bar push the needle beyond its magnet, before they drain."""
    drawn = Drawn.of(1004)
    rows = driven(drawn.network(), {"coil": drawn.current}).rows()
    with pytest.raises(ConvergenceError, match="magnet of 'coil'"):
        operating_point(rows)

    point, others, told = searched(rows, [{}], set())

    assert others == []
    assert "ambient pressure in all volumes" in told[0]
    for name, (left, size) in balances(drawn, point).items():
        assert abs(left) <= 1e-8 * size, name


def test_many_random_valves_end_in_a_right_point_or_in_words():
    found = tally(range(1000, 1150))

    assert found.get("point", 0) >= 75, found
    assert found.get("not found", 0) <= 3, found


@pytest.mark.parametrize("seed", [12, 31, 49, 66, 93])
def test_a_kicked_valve_moves_as_its_linear_model(seed):
    drawn = Drawn.of(seed)
    rows = driven(drawn.network(), {"coil": drawn.current}).at_start().rows()
    point, _, _ = searched(rows, [{}, *far_ends(rows)], set())
    system = linear_network(compiled_at(rows, point)[0], 20e-9).system

    free = steady_rows(rows)
    sizes = step_sizes(free, "normal", step=10e-9, coarse=1)
    network = compile_network(free, sizes)
    begin_steady(network, sizes.step, first={"needle": point.start.displacement["needle.tip"]})
    clock = np.zeros(8, dtype=np.int64)
    clock[1] = -1
    state = saved_state(network, clock)
    lifts = []
    for kick in (0.0, KICK):
        begun = {name: array.copy() for name, array in state.items()}
        begun["bodies.fine"][ROW * ROW_V] += kick * np.sqrt(rows.bodies[0].body.mass)
        result = simulate_network(
            rows, duration=100e-6, record=1e-6, step=10e-9, coarse=1, state=begun
        )
        lifts.append(result.channels["needle.tip displacement"].values)

    step = expm(system.A * float(result.time[1] - result.time[0]))
    names = [x.name for x in system.states]
    x = np.zeros(len(names))
    x[names.index("needle.velocity")] = KICK
    expected = []
    for _ in result.time:
        expected.append(x[names.index("needle.displacement")])
        x = step @ x
    moved = lifts[1] - lifts[0]
    error = np.sqrt(np.mean((moved - expected) ** 2) / np.mean(np.square(expected)))
    assert error < 0.02  # phase of the contact over up to twenty periods
