"""Runs of networks keep their balances.

Truth: energy, mass, momentum, reciprocity and repetition of runs of a whole valve.

A small valve as a network: the energy balance of its run, and variants against hand-made networks.

Truth: conservation. A run in pieces, with its state handed on, has the impacts of the whole run.

And what does not fit into the record of fine steps costs no impact.

Truth: conservation. Every run of the suite is judged; a run out of balance tells its user.
"""

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from time import sleep

import energy_ledger
import numpy as np
import pytest

from klack.contact.laws import LinearLaw
from klack.errors import AccuracyWarning, ConvergenceError
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_choice import FluidChoice
from klack.hydraulics.fluid_table import fluid_at, fluid_table
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.magnetics.voltage_step import VoltageStep
from klack.mechanics.end_stop import EndStop
from klack.mechanics.flexible_body import FlexibleBody
from klack.mechanics.force import ForceOverTime
from klack.mechanics.friction import GuideFriction
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.network.rows import Rows
from klack.simulation import energy_balance, impact, network_recorder, network_run
from klack.simulation.bodies import fixed_body, rigid_mass_body, rod_body
from klack.simulation.network_arrays import EXCESS
from klack.simulation.network_result import EnergyBooks, ImpactEvent, NetworkResult
from klack.simulation.network_run import simulate_network
from klack.simulation.system import ContactPair, ReducedSystem
from klack.verification.network import LIFT, peak_and_hold, whole_valve

MODES = (8, 12, 8)
STEP = 20e-9


def run(network: Network, duration: float, *, coarse: int = 16, **more) -> NetworkResult:
    return simulate_network(
        network.rows(), duration=duration, step=STEP, coarse=coarse, record=1.28e-6, **more
    )


@pytest.fixture(scope="module")
def valves() -> Mapping[str, Network]:
    """Undamped: nothing but the ledger can say where the energy went."""
    wet = whole_valve(modes=MODES, damping=0.0, driver=peak_and_hold(end=0.6e-3))
    return {"wet": wet, "dry": wet.dry()}


@pytest.fixture(scope="module")
def strokes(valves) -> Mapping[str, NetworkResult]:
    """Opening, impact, bounces, closing, impact on the seat."""
    return {name: run(valve, 1.6e-3) for name, valve in valves.items()}


@pytest.mark.parametrize("name", ["wet", "dry"])
def test_the_ledger_of_all_domains_closes(strokes, name):
    stroke = strokes[name]
    books = stroke.books

    assert {event.stop for event in stroke.events} == {"seat", "opening"}
    assert books.throughput > 0.02  # [J]
    # displacements settle to 1e-15 m in a step: 400 N times that, over 80 000 steps, over 0.02 J
    assert books.relative_residual < 1e-9
    for label, loss in books.losses.items():
        assert loss >= -1e-12 * books.throughput, label
    passed = {"coil ohmic", "coil eddy"}
    if name == "wet":
        passed |= {"feed friction", "restriction flow", "nozzle flow", "seat film", "opening film"}
    for label in passed:
        assert books.losses[label] > 1e-9, label
    assert not any("damping" in label and value for label, value in books.losses.items())


@pytest.mark.parametrize("duration", [0.18e-3, 0.23e-3, 0.26e-3])
def test_what_bodies_owe_at_the_end_is_no_loss_of_their_damping(duration):
    """Truth: conservation.  Elements see the bodies a step late; the next one takes that back."""
    valve = whole_valve(modes=MODES, damping=0.01, driver=peak_and_hold(end=0.6e-3)).dry()
    result = run(valve, duration, coarse=64)

    owed = abs(result.state["bodies.at"][EXCESS]) / result.books.scale
    assert owed > 1e-11
    assert abs(result.books.relative_residual) < 1e-13  # round-off; as a loss it was all of it


def test_electric_energy_heats_magnetises_and_moves(strokes):
    stroke = strokes["dry"]
    channels, books = stroke.channels, stroke.books
    heat = 0.6 * np.trapezoid(channels["coil current"].values ** 2, stroke.time)
    gap = channels["needle.top displacement"].values - channels["pole.top displacement"].values
    work = np.sum(channels["coil.armature force"].values[1:] * np.diff(gap))
    eddy = books.losses["coil eddy"]
    stored = sum(
        books.stores_after[name] - books.stores_before[name]
        for name in books.stores_after
        if "coil" in name
    )

    supplied = sum(books.supplies.values())
    assert work > 1e-3  # [J]
    # means of force over records of 1.28 us, while the pole rings
    assert supplied == pytest.approx(heat + eddy + work + stored, rel=1e-3)


def test_the_sac_holds_what_flowed_in(valves, strokes):
    stroke = strokes["wet"]
    table = fluid_table(valves["wet"].fluid, 101_325.0)
    channels = stroke.channels
    area = np.pi / 4 * 1.768e-3**2
    density = np.array([fluid_at(table, p, 0)[0] for p in channels["sac pressure"].values])
    mass = density * (2e-9 + area * channels["needle.bottom displacement"].values)
    flow = channels["restriction mass flow"].values - channels["nozzle mass flow"].values
    moved = np.cumsum(flow[1:]) * (stroke.time[1] - stroke.time[0])

    assert np.ptp(mass) > 1e-3 * mass[0]
    # the mass is exact; pressure follows it to 1e-7 where the sac boils, else to round-off
    apart = np.abs(mass[1:] - mass[0] - moved) / mass[0]
    assert apart.max() < 1e-7
    assert np.median(apart) < 1e-8


def test_momentum_of_the_needle_is_the_impulse_of_all_forces(strokes):
    stroke = strokes["dry"]
    channels = stroke.channels
    force = sum(
        sign * channels[name].values
        for name, sign in (
            ("spring.end force", 1.0),
            ("coil.armature force", 1.0),
            ("seat contact force", 1.0),
            ("opening contact force", -1.0),
        )
    )
    impulse = np.cumsum(force[1:]) * (stroke.time[1] - stroke.time[0])
    velocity = channels["needle velocity"].values

    assert np.abs(velocity).max() > 1.0
    # the force that repays energy is in no channel: 2e-7 of the momentum here
    largest = 3e-3 * np.abs(velocity).max()
    assert np.allclose(3e-3 * (velocity[1:] - velocity[0]), impulse, rtol=0.0, atol=1e-6 * largest)


def test_base_of_the_coil_feels_the_opposite_force(strokes):
    channels = strokes["wet"].channels

    assert np.array_equal(
        channels["coil.base force"].values, -channels["coil.armature force"].values
    )


def test_answers_to_a_pulse_are_reciprocal():
    rod = rod_body(
        "rod", length=0.04, area=1e-5, young=2.1e11, density=7850.0, elastic_modes=19, damping=0.01
    )
    names = ("bottom", "top")

    def answer(push: str, watch: str) -> np.ndarray:
        pulse = ForceOverTime(time=(0.0, 1e-6, 2e-6), force=(0.0, 10.0, 0.0))
        network = Network(
            {"rod": FlexibleBody.of(rod), "pulse": pulse}, [[f"rod.{push}", "pulse.end"]]
        )
        with pytest.warns(match="nothing holds"):
            result = run(network, 50e-6, coarse=1, start="free")
        return result.channels[f"rod.{watch} displacement"].values

    there, back = answer(*names), answer(*names[::-1])
    assert np.abs(there).max() > 1e-8
    assert np.abs(there - back).max() < 1e-12 * np.abs(there).max()


@pytest.mark.parametrize("name", ["wet", "dry"])
def test_coarse_steps_find_the_same_first_impact(valves, strokes, name):
    fine = run(valves[name], 0.25e-3, coarse=1)
    coarse = strokes[name]

    assert fine.coarse_steps == 0
    assert coarse.coarse_steps > 1000
    a, b = fine.events[0], coarse.events[0]
    assert a.stop == b.stop == "opening"
    assert b.time == pytest.approx(a.time, abs=0.05e-6)
    assert b.peak_force == pytest.approx(a.peak_force, rel=1e-3)
    assert b.approach_speed == pytest.approx(a.approach_speed, rel=1e-3)


@pytest.mark.parametrize("name", ["wet", "dry"])
@pytest.mark.parametrize("instant", [100, 147, 600], ids=["flight", "impact", "hold"])
def test_a_stored_state_goes_on_to_the_same_bits(valves, tmp_path: Path, name, instant):
    valve = valves[name]
    record = 1.28e-6
    whole = run(valve, (instant + 200) * record)
    first = run(valve, instant * record)
    np.savez(tmp_path / "state.npz", **first.state)
    with np.load(tmp_path / "state.npz") as stored:
        # little energy is turned over by a needle that is held
        with energy_ledger.allowed("simulate_network", 1e-8):
            rest = run(valve, 200 * record, state=dict(stored))

    assert rest.time[0] == first.time[-1] == whole.time[instant]
    for label, channel in rest.channels.items():
        expected = whole.channels[label].values[instant + 1 :]
        assert np.array_equal(channel.values[1:], expected), label
    for key, value in whole.state.items():
        assert np.array_equal(rest.state[key], value), key


def test_the_same_case_gives_the_same_bits(valves, strokes):
    again = run(valves["wet"], 1.6e-3)

    assert repr(again.events) == repr(strokes["wet"].events)  # nan is not equal to itself
    for label, channel in again.channels.items():
        assert np.array_equal(channel.values, strokes["wet"].channels[label].values), label


@pytest.mark.parametrize("wet", [True, False])
def test_a_closed_valve_stays_at_rest(wet):
    valve = whole_valve(modes=MODES, damping=0.0, driver=VoltageStep(voltage=12.0, start=1.0))
    result = run(valve if wet else valve.dry(), 1e-3)

    channels = result.channels
    seat = channels["seat contact force"].values
    # the sac lies behind the closed seat, at ambient pressure
    pressure = np.pi / 4 * 1.768e-3**2 * (6.013e5 - 101_325.0) if wet else 0.0
    press = pressure - channels["spring.end force"].values[1]
    assert press == pytest.approx(12.0 + pressure, rel=1e-3)
    assert seat[1] == pytest.approx(press, rel=1e-6)
    assert np.ptp(seat) < 1e-4 * press
    for port in ("needle.bottom", "needle.top", "housing.top", "pole.top"):
        assert np.ptp(channels[f"{port} displacement"].values) < 1e-12, port  # [m]
    assert result.events == ()
    assert result.fine_steps < 0.1 * (result.fine_steps + 16 * result.coarse_steps)


def test_a_body_without_elastic_modes_is_a_rigid_mass(valves):
    dry = whole_valve(modes=(1, 0, 0), damping=0.0).dry()
    lumped = dry.with_components({"needle": RigidMass(mass=3e-3, points=("bottom", "top"))})

    a, b = run(dry, 0.4e-3), run(lumped, 0.4e-3)

    for label, channel in a.channels.items():
        if label in b.channels:
            scale = np.abs(channel.values).max()
            assert np.allclose(b.channels[label].values, channel.values, atol=1e-9 * scale), label
    lift = a.channels["needle.top displacement"].values
    assert lift.max() > LIFT


LAW = {"kind": "linear", "stiffness": 1e9}
MECHANICS = {
    "needle": RigidMass(mass=3e-3),
    "spring": Spring(stiffness=5e3, preload=20.0),
    "magnet": ForceOverTime(time=(0.0, 0.1e-3, 0.5e-3, 0.6e-3), force=(0.0, 60.0, 60.0, 0.0)),
    "guide": GuideFriction(coulomb=0.2, breakaway=0.4),
    "seat": EndStop(gap=0.0, law=LAW, restitution=0.4),
    "stop": EndStop(gap=80e-6, law=LAW, restitution=0.4),
}
HYDRAULICS = {
    "sac": Chamber(volume=2e-9),
    "face": PressureFace(direction="opening", area=1e-6),
    "hole": Orifice(diameter=0.2e-3),
}
AT_THE_NEEDLE = [
    f"{part}.{port}"
    for part, port in (
        ("needle", "body"),
        ("spring", "end"),
        ("magnet", "end"),
        ("guide", "body"),
        ("seat", "upper"),
        ("stop", "lower"),
    )
]
GROUNDED = [["seat.lower", "ground"], ["stop.upper", "ground"]]
DRY = Network(MECHANICS, [AT_THE_NEEDLE, *GROUNDED])
WET = Network(
    {**HYDRAULICS, **MECHANICS},
    [
        [*AT_THE_NEEDLE, "face.body"],
        *GROUNDED,
        ["sac.fluid", "face.fluid", "hole.a"],
        ["hole.b", "ambient"],
    ],
    fluid=FluidChoice(name="n-heptane", gas_fraction=1e-3).at(293.15),
)


def run_valve(network: Network) -> NetworkResult:
    return simulate_network(network.rows(), duration=2e-3, step=20e-9, coarse=16, record=1e-6)


@pytest.fixture(scope="module")
def wet_valve() -> NetworkResult:
    return run_valve(WET)


def test_the_needle_opens_and_closes(wet_valve):
    lift = wet_valve.channels["needle.body displacement"].values

    assert lift.max() == pytest.approx(80e-6, rel=0.05)  # plus the indentation of the stop
    assert abs(lift[-1]) < 0.1e-6
    assert {event.stop for event in wet_valve.events} >= {"stop", "seat"}


def test_books_of_the_run_balance(wet_valve):
    assert wet_valve.books.relative_residual < 1e-9  # of all steps; what the forces did not settle
    assert wet_valve.books.supplies["magnet work"] > 1e-3
    for name, loss in wet_valve.books.losses.items():
        assert loss >= -1e-12 * wet_valve.books.throughput, name
    assert wet_valve.books.losses["hole flow"] > 0.0


def test_dry_is_the_valve_built_without_hydraulics():
    derived, built = run_valve(WET.dry()), run_valve(DRY)

    assert derived.channels.keys() == built.channels.keys()
    for name, channel in built.channels.items():
        assert np.array_equal(derived.channels[name].values, channel.values), name


def test_lumped_is_the_valve_built_with_other_stops():
    law = {"kind": "linear", "stiffness": 5e8}
    stops = {
        "seat": EndStop(gap=0.0, law=law, restitution=0.3),
        "stop": EndStop(gap=80e-6, law=law, restitution=0.3),
    }

    derived, built = run_valve(DRY.lumped(5e8, 0.3)), run_valve(DRY.with_components(stops))

    lift = "needle.body displacement"
    assert np.array_equal(derived.channels[lift].values, built.channels[lift].values)


def test_the_order_of_components_does_not_matter(wet_valve):
    turned = Network(
        dict(reversed(WET.components.items())), WET.connections[::-1], WET.ambient, WET.fluid
    )

    again = run_valve(turned)

    lift = "needle.body displacement"
    before_first_touch = (
        wet_valve.time < 0.17e-3
    )  # afterwards round-off grows from bounce to bounce
    assert again.channels[lift].values[before_first_touch] == pytest.approx(
        wet_valve.channels[lift].values[before_first_touch], rel=1e-9, abs=1e-16
    )


PERIOD, CYCLES = 1.5e-3, 4
RECORD = 6.4e-6  # whole macro steps of both valves


def switched_valve() -> Rows:
    """3 g between two stops 40 um apart, opened and closed again and again; it bounces."""
    time, force = [0.0], [0.0]
    for cycle in range(CYCLES):
        begin = cycle * PERIOD + 50e-6
        time += [begin, begin + 1e-6, begin + 0.6e-3, begin + 0.601e-3]
        force += [0.0, 30.0, 30.0, 0.0]
    law = {"kind": "linear", "stiffness": 1e8}
    parts = {
        "needle": RigidMass(mass=3e-3, points=("tip",)),
        "seat": EndStop(gap=0.0, law=law, restitution=0.6),
        "stop": EndStop(gap=40e-6, law=law, restitution=0.6),
        "spring": Spring(stiffness=1e4, preload=12.0),
        "magnet": ForceOverTime(time=tuple(time), force=tuple(force)),
    }
    joints = [
        ["needle.tip", "seat.upper", "stop.lower", "spring.end", "magnet.end"],
        ["seat.lower", "ground"],
        ["stop.upper", "ground"],
    ]
    return Network(parts, joints).rows()


def flexible_valve() -> Rows:
    """A wet valve with films on both stops and elastic bodies that part and touch again."""
    return whole_valve(modes=(4, 6, 4), damping=0.0, driver=peak_and_hold(end=0.6e-3)).rows()


VALVES = {"rigid": (switched_valve, 50e-9, CYCLES * PERIOD), "wet": (flexible_valve, 20e-9, 1.4e-3)}


def in_pieces(rows: Rows, cuts: Sequence[int], step: float) -> list[NetworkResult]:
    state, pieces = None, []
    for records in np.diff([0, *cuts]):
        piece = simulate_network(
            rows, duration=float(records) * RECORD, step=step, record=RECORD, state=state
        )
        state = piece.state
        pieces.append(piece)
    return pieces


def told(pieces: Sequence[NetworkResult]) -> dict[tuple[str, float], ImpactEvent]:
    """The last word on every impact."""
    return {(event.stop, event.time): event for piece in pieces for event in piece.events}


@pytest.mark.parametrize("kind", list(VALVES))
def test_a_run_in_pieces_has_the_impacts_of_the_whole(kind):
    build, step, duration = VALVES[kind]
    rows = build()
    whole = simulate_network(rows, duration=duration, step=step, record=RECORD)
    records = len(whole.time) - 1
    hits = [round(event.peak_time / RECORD) for event in whole.events]
    # somewhere, and in the middle of three contacts
    cuts = sorted({*(records * k // 7 for k in range(1, 8)), *hits[2:5]})
    # a piece in which the needle hardly moves turns little energy over
    with energy_ledger.allowed("simulate_network", 1e-6):
        pieces = in_pieces(rows, cuts, step)

    found = sorted(told(pieces).values(), key=lambda event: event.time)
    assert len(whole.events) >= 5
    assert repr(found) == repr(list(whole.events))  # the same bits; nan is not equal to itself
    assert any(piece.events and np.isnan(piece.events[-1].separation_time) for piece in pieces)
    # an impact is reported again only where more is known of it
    assert sum(len(piece.events) for piece in pieces) <= len(whole.events) + 2 * len(cuts)


def test_impacts_do_not_depend_on_chunks_and_room(monkeypatch: pytest.MonkeyPatch):
    rows = switched_valve()
    usual = simulate_network(rows, duration=3e-3, step=50e-9, record=RECORD)
    assert all(record.complete for record in usual.interfaces.values())
    monkeypatch.setattr(network_recorder, "_MOST_FINE", 300)
    monkeypatch.setattr(network_run, "_CHUNK", 7_777)
    narrow = simulate_network(rows, duration=3e-3, step=50e-9, record=RECORD)

    assert repr(narrow.events) == repr(usual.events)
    for stop, record in narrow.interfaces.items():
        whole = usual.interfaces[stop]
        assert not record.complete
        assert np.array_equal(record.contact_force, whole.contact_force[:300])
        # these would be missing
        assert sum(e.time > record.time[-1] for e in usual.events if e.stop == stop) >= 3
    for name, channel in usual.channels.items():
        assert np.array_equal(narrow.channels[name].values, channel.values), name


def test_impacts_do_not_depend_on_the_spacing_of_records():
    """Bounces of 20 us are no single impact because the channels are 80 us apart."""
    rows = switched_valve()
    close, wide = (
        simulate_network(rows, duration=3.2e-3, step=50e-9, record=record)
        for record in (0.8e-6, 80e-6)
    )

    assert repr(wide.events) == repr(close.events)
    for name, channel in wide.channels.items():
        values = close.channels[name].values
        expected = values[::100]
        if name.endswith("peak force"):
            expected = values[1:].reshape(-1, 100).max(axis=1)
        elif name.endswith("force"):
            expected = values[1:].reshape(-1, 100).mean(axis=1)
        scale = np.abs(expected).max()
        assert np.allclose(channel.values[-len(expected) :], expected, atol=1e-12 * scale), name


def test_memory_of_the_records_is_asked_for_before_the_run(monkeypatch: pytest.MonkeyPatch):
    from klack.errors import InputError
    from klack.machine import memory

    small = memory.AvailableMemory(size=100e6, bound="as in this test")
    monkeypatch.setattr(memory, "available_memory", lambda: small)
    with pytest.raises(
        InputError, match=r"record: got \d+ records of \d+ channels needing about 9 GB"
    ):
        simulate_network(switched_valve(), duration=60.0, step=50e-9, record=0.8e-6)


@pytest.mark.slow
def test_compiling_is_no_part_of_the_wall_time(monkeypatch):
    """Truth: the first call of the loop, which compiles, advances nothing and is not timed."""
    calls, kernel = [], network_run.run_network

    def slow_at_first(macros, *rest):
        calls.append(macros)
        if len(calls) == 1:
            sleep(0.5)
        return kernel(macros, *rest)

    monkeypatch.setattr(network_run, "run_network", slow_at_first)
    result = simulate_network(switched_valve(), duration=2e-5, step=50e-9, record=RECORD)
    assert calls[0] == 0
    assert sum(calls) > 0
    assert result.wall_time < 0.5


SOLVERS = {
    "simulate": "simulation/impact.py",
    "simulate_network": "simulation/network_run.py",
    "simulate_full_order": "transient/full_order.py",
    "simulate_interface": "transient/interface_run.py",
}


def bounce() -> None:
    pair = ContactPair(
        body_a="a", port_a="contact", body_b="b", port_b="contact", law=LinearLaw(1e9), gap=1e-6
    )
    system = ReducedSystem(bodies=(rigid_mass_body("a", 1e-3), fixed_body("b")), contacts=(pair,))
    impact.simulate_impact(system, speed=0.5, duration=20e-6)


@pytest.fixture
def leaking(monkeypatch: pytest.MonkeyPatch) -> None:
    """A kernel that loses a millionth of the speed in its last step."""
    run = impact.run_one_contact

    def spoiled(*arguments):
        status = run(*arguments)
        arguments[2][:] *= 1.0 - 1e-6
        return status

    monkeypatch.setattr(impact, "run_one_contact", spoiled)


def swing(periods: float) -> EnergyBooks:
    """Let 3 g swing on 5 kN/mm for some periods of 154 us."""
    parts = {"mass": RigidMass(mass=3e-3, speed=0.5), "part": Spring(stiffness=5e6, preload=0.0)}
    duration = periods * 2.0 * np.pi * np.sqrt(3e-3 / 5e6)
    rows = Network(parts, [["mass.body", "part.end"]]).rows()
    return simulate_network(
        rows, duration=duration, step=100e-9, coarse=1, record=1e-6, start="free"
    ).books


@pytest.mark.parametrize("periods", [2.0, 2.25])
def test_whole_periods_turn_their_energy_over(periods):
    """The stores at both ends of whole periods are alike, yet all energy went to and fro."""
    books = swing(periods)
    energy = 0.5 * 3e-3 * 0.5**2

    assert books.scale == pytest.approx(energy, rel=1e-9)
    assert books.relative_residual == abs(books.residual) / books.scale
    # round-off of a record: the run ends up to 1 us late
    share = np.sin(2.0 * np.pi * periods) ** 2
    assert books.throughput == pytest.approx(share * energy, abs=2e-2 * energy)


def test_a_leak_of_a_millionth_fails_the_test_that_ran_it(leaking):
    with pytest.raises(AssertionError, match=r"a_leak_of_a_millionth.*a run of simulate leaves"):
        bounce()


def test_a_leak_can_be_allowed(leaking):
    with energy_ledger.allowed("simulate", 1e-5):
        bounce()
    with pytest.raises(AssertionError):
        bounce()


@pytest.mark.usefixtures("as_for_a_user")
def test_a_user_is_warned_of_a_leak(leaking):
    with pytest.warns(AccuracyWarning, match=r"simulate: the energy balance does not close by 2"):
        bounce()


@pytest.mark.usefixtures("as_for_a_user")
def test_a_user_is_not_warned_without_a_leak():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bounce()


@pytest.mark.usefixtures("as_for_a_user")
@pytest.mark.parametrize(
    ("residual", "least_loss", "words"),
    [
        (0.0, -1e-3, r"has a loss that returned 1\.0e-03 of it"),
        (-2e-9, 0.0, r"does not close by 2\.0e-09 of the energy throughput, more than the 1e-09"),
    ],
)
def test_what_a_user_is_told(residual, least_loss, words):
    with pytest.warns(AccuracyWarning, match=words):
        energy_balance.check_energy_balance("run", residual, least_loss, limit=1e-9, advice="x")


@pytest.mark.usefixtures("as_for_a_user")
@pytest.mark.parametrize("numbers", [(float("nan"), 0.0), (0.0, float("nan")), (float("inf"), 0.0)])
def test_energy_that_is_no_number_is_a_failure(numbers):
    with pytest.raises(ConvergenceError, match="energy of this run is not a finite number"):
        energy_balance.check_energy_balance("run", *numbers, limit=1e-9, advice="x")


def test_every_solver_is_judged():
    """Each reports its energy balance, and the suite knows a limit for each."""
    folder = Path(energy_balance.__file__).parents[1]
    for name, file in SOLVERS.items():
        assert f'check_energy_balance(\n        "{name}"' in (folder / file).read_text(), name
    assert set(energy_ledger.LIMITS) == set(SOLVERS)
    calls = [path for path in folder.rglob("*.py") if "check_energy_balance(" in path.read_text()]
    assert len(calls) == len(SOLVERS) + 1


def test_worker_processes_judge_as_well():
    """A run in a process of a pool fails in the same words."""
    with energy_ledger.workers.WorkerPool(1, None) as pool:
        found = dict(pool.completed(energy_ledger.name_of_the_judge, ["a run"]))
    assert found == {"a run": "judge"}
