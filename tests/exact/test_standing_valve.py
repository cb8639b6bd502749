"""A valve on its machine as one body in time, against coupling over frequency and integration."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import scipy

from klack.acoustics.at_mounts import freedoms_of_bodies, points_of, source_at_mounts
from klack.acoustics.coupling import Placement, axes_of, couple
from klack.acoustics.force_response import port_forces
from klack.acoustics.interface import Freedom, InterfacePoint, Receiver, laplace
from klack.acoustics.isolator import Spring
from klack.acoustics.plate import Plate
from klack.acoustics.receivers.measured import HeardReceiver
from klack.acoustics.receivers.modal import (
    ModalReceiver,
    grounded,
    matrix_receiver,
    rigid_receiver,
)
from klack.acoustics.receivers.plates import InfinitePlate
from klack.acoustics.standing import StandingValve, standing_valve
from klack.analyses.noise.body import Transfers
from klack.analyses.noise.in_machine import in_machine, installed
from klack.analyses.noise.machine import Machine, machine_of
from klack.analyses.noise.run import noise_design
from klack.analyses.noise.source import stroke_sources
from klack.analyses.stroke.record import StrokeStudy
from klack.analyses.stroke.run import run_stroke, variant_network
from klack.assembling.valve import build_valve
from klack.bodies.reduction.craig_bampton import CraigBampton
from klack.case.any_case import read_valve_case
from klack.case.noise import CaseNoise
from klack.errors import InputError
from klack.materials.material import Material
from klack.mechanics.end_stop import EndStop
from klack.mechanics.flexible_body import FlexibleBody
from klack.mechanics.friction import GuideFriction
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring as ReturnSpring
from klack.network.network import Network
from klack.simulation.network_compile import compile_network
from klack.simulation.network_run import simulate_network
from klack.simulation.step_sizes import step_sizes
from klack.simulation.tangent_numbers import numbers_at_rest

F = np.geomspace(200.0, 15e3, 9)
STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
SHEET = Plate(thickness=1.5e-3, area=0.2, material=STEEL)
FLANGE, CLIP = (InterfacePoint(name=name) for name in ("flange", "clip"))


def body(seed: int, mounts: tuple[tuple[str, int], ...], zeta: float = 0.0) -> CraigBampton:
    """A random body whose modes carry part of its mass at the mounts."""
    draw, m, n = np.random.default_rng(seed), 4, len(mounts)
    P = draw.normal(scale=0.1, size=(m, n))
    A, B = draw.normal(size=(2, n, n))
    omega = 2e4 * np.arange(1.0, m + 1.0)
    return CraigBampton(
        omega=omega,
        damping=np.full(m, zeta),
        mounts=tuple(name for name, _ in mounts),
        directions=tuple(direction for _, direction in mounts),
        references=np.zeros((n, 3)),
        participation=P,
        mass=P.T @ P + 0.01 * A @ A.T + 0.02 * np.eye(n),
        stiffness=1e6 * B @ B.T,
        loss=np.zeros((n, n)),
        port_names=("seat", "pole"),
        port_shapes=draw.normal(scale=5.0, size=(m, 2)),
        port_motion=draw.normal(size=(n, 2)),
    )


def modal(freedoms: tuple[Freedom, ...], residual: float, zeta: float = 0.0) -> ModalReceiver:
    """A random machine; with a residual in its first direction alone."""
    draw = np.random.default_rng(5)
    return ModalReceiver(
        points=(FLANGE, CLIP),
        freedoms=freedoms,
        omega=2.0 * np.pi * np.array([90.0, 700.0, 1900.0, 5200.0, 11e3]),
        damping=np.full(5, zeta),
        shapes=draw.normal(scale=2.0, size=(5, len(freedoms))),
        residual=residual * np.diag(np.arange(len(freedoms)) == 0.0),
    )


Z, X = Freedom("flange", 3), Freedom("flange", 1)
BOTH = (("flange", 1), ("flange", 3), ("clip", 3))
ALL = (X, Z, Freedom("clip", 3))
TURNED = Placement(axes=axes_of([0.0, 0.0, 1.0], [0.0, 1.0, 0.0]))
SPRINGS = {"flange": Spring(values={3: 2e6}, damping={3: 150.0}), "clip": Spring(values={3: 4e5})}
MACHINES: dict[str, tuple[tuple[tuple[str, int], ...], Receiver, Mapping, Mapping, Mapping]] = {
    "modes": (BOTH, modal(ALL, 0.0), {}, {}, {}),
    "modes with a residual": (BOTH, modal(ALL, 3e-8), {}, {}, {}),
    "elements with dampers": (BOTH, modal(ALL, 0.0), {}, SPRINGS, {}),
    "turned": (BOTH, modal(ALL, 0.0), {"flange": TURNED}, {}, {}),
    "blocked and free": (
        BOTH,
        modal((Z,), 0.0),
        {},
        {},
        {"flange.x": "blocked", "clip": "free"},
    ),
    "springs": (BOTH, grounded({1: 1e6, 3: 3e6}, (FLANGE, CLIP)), {}, {}, {}),
    "infinite plate": (
        BOTH[1:2],
        InfinitePlate(plate=SHEET, points=(FLANGE,)),
        {},
        {},
        {},
    ),
    "rigid body": (
        BOTH[1:2],
        rigid_receiver(0.3, None, np.zeros(3), (FLANGE,)),
        {},
        {},
        {},
    ),
}


def answer(found: StandingValve, force: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Velocities of the mounts under forces at the ports."""
    D = np.zeros((s.size, found.omega.size, found.omega.size), dtype=complex)
    D += s[:, None, None] * 2.0 * np.diag(found.damping * found.omega) + np.diag(found.omega**2)
    D += (s**2)[:, None, None] * np.eye(found.omega.size)
    for shape, c in found.dampers.values():
        D += s[:, None, None] * c * np.outer(shape, shape)
    q = np.linalg.solve(D, (force @ found.shapes.T)[..., None])
    return s[:, None] * (found.mounts.T @ q)[..., 0]


def both(machine: str, zeta: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Velocities of the mounts: of the standing valve, and by coupling."""
    mounts, receiver, placements, isolators, missing = MACHINES[machine]
    if zeta and isinstance(receiver, ModalReceiver):
        receiver = modal(receiver.freedoms, float(receiver.residual[0, 0]), zeta)
    bodies = [body(1, mounts, zeta), body(2, mounts[-1:], zeta)]
    points = points_of(bodies)
    force = np.random.default_rng(3).normal(size=(F.size, 4)) + 0j
    found = standing_valve(
        bodies, points, receiver, placements=placements, isolators=isolators, missing=missing
    )
    source = source_at_mounts(bodies, [force[:, :2], force[:, 2:]], points, F)
    joined = couple(source, receiver, placements=placements, isolators=isolators, missing=missing)
    here = [freedoms_of_bodies(bodies, points).index(freedom) for freedom in joined.freedoms]
    return answer(found, force, laplace(F))[:, here], joined.source_velocity


@pytest.mark.parametrize("machine", MACHINES)
def test_as_coupled_over_frequency(machine: str) -> None:
    """Undamped bodies, dampers as they are; what is free hangs at 0.1 Hz: (0.1/200)^2."""
    found, exact = both(machine)
    assert np.abs(found - exact).max() <= 1e-6 * np.abs(exact).max()


def test_light_damping_by_mode_is_right_to_first_order() -> None:
    """The deviation falls with the damping ratio."""
    errors = []
    for zeta in (0.02, 0.01, 0.005):
        found, exact = both("modes", zeta)
        errors.append(np.abs(found - exact).max() / np.abs(exact).max())
    assert errors[0] < 0.1
    assert errors[2] < 0.6 * errors[1] < 0.36 * errors[0]


def test_what_has_no_law_in_time_is_refused() -> None:
    bodies = [body(1, BOTH[1:2])]
    plate = InfinitePlate(plate=SHEET, points=(FLANGE,))
    cases: list[tuple[Receiver, dict, str]] = [
        (plate, {"flange": Spring(values={3: 1e6})}, "an element on an infinite plate"),
        (plate, {"flange": Spring(values={3: 1e6}, loss_factor=0.1)}, "a loss factor"),
        (InfinitePlate(plate=SHEET, points=(FLANGE,), radius=5e-3), {}, "feet that rotate it"),
    ]
    for receiver, isolators, says in cases:
        missing = {"flange.rx": "free", "flange.ry": "free"}
        with pytest.raises(InputError, match=says):
            standing_valve(
                bodies,
                points_of(bodies),
                receiver,
                placements={},
                isolators=isolators,
                missing=missing,
            )


def test_the_matrices_of_a_body_are_that_body_as_a_receiver(tmp_path: Path) -> None:
    """In mm, t, s with a rotation, by the key of a case, against the mobility of its own mounts.

    Undamped, of all modes: round-off.
    """
    own = body(4, (("flange", 3), ("flange", 5)))
    M, K = own.matrices()
    names = [*(f"q{i}" for i in range(4)), "z", "ry"]
    scale = np.array([1.0, 1.0, 1.0, 1.0, 1e3, 1.0])  # displacements in mm, angles in radians
    file = tmp_path / "cabin.npz"
    to_file = np.outer(1.0 / scale, 1.0 / scale) * 1e3  # energies in mJ
    np.savez(file, K=K * to_file, M=M * to_file, names=np.array(names))
    rows = {"flange.z": "z", "flange.ry": 6}
    given = {"file": str(file), "units": "mm t s", "rows": rows, "damping": 0.0}
    data = {"mounts": {"flange": {"surface": "a.b"}}, "receiver": {"matrices": given}}
    noise = CaseNoise.model_validate(data, context={})
    machine = machine_of(noise, {}, (FLANGE,))
    exact = source_at_mounts([own], [np.zeros((F.size, 2)) + 0j], (FLANGE,), F).mobility
    found = machine.receiver.at(laplace(F)).mobility
    assert machine.causal
    assert np.abs(found - exact).max() <= 1e-9 * np.abs(exact).max()
    given["rows"] = {"flange.z": "z", "flange.ry": 5}
    with pytest.raises(InputError, match="the row 5, which belongs to another degree of freedom"):
        machine_of(CaseNoise.model_validate(data, context={}), {}, (FLANGE,))
    given["rows"] = {"flange.z": "x"}
    with pytest.raises(InputError, match="a number from 1 to 6, or one of: q0"):
        machine_of(CaseNoise.model_validate(data, context={}), {}, (FLANGE,))


def test_next_to_massless_rows_do_not_stiffen_or_free_a_machine() -> None:
    """Four masses on springs; a light one at the end changes nothing, as it only follows."""

    def mobility(light: float) -> np.ndarray:
        n = 5 if light else 4
        K = 1e6 * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
        K[0, 0] = K[-1, -1] = 1e6
        M = np.diag([1.0, 1.0, 1.0, 1.0, light][:n])
        receiver = matrix_receiver(K, M, {Z: 0}, (FLANGE,), damping=0.01)
        return receiver.at(laplace(np.array([50.0, 200.0]))).mobility

    assert np.abs(mobility(1e-12) / mobility(0.0) - 1.0).max() < 1e-4
    with pytest.raises(InputError, match="lost in round-off"):
        mobility(1e-18)
    A = np.array([[1.0, 1.0], [1.0, 1.0 + 4e-16]])
    with pytest.raises(InputError, match="a mass that is not above 0"):
        matrix_receiver(np.eye(2), A, {Z: 0}, (FLANGE,), damping=0.01)


def test_what_hangs_is_stable() -> None:
    found = standing_valve(
        [body(1, BOTH[1:2])],
        (FLANGE,),
        rigid_receiver(0.3, None, np.zeros(3), (FLANGE,)),
        placements={},
        isolators={},
        missing={},
    )
    hangs = found.omega <= 2.0 * np.pi * 0.1
    assert hangs.any()
    assert np.all(found.damping[hangs] > 0.0)


def test_points_of_a_study_do_not_take_each_others_machine() -> None:
    """Another thread stores its own between what this one stores and returns."""

    class Interrupted(Transfers):
        def __setattr__(self, name: str, value: object) -> None:
            super().__setattr__(name, value)
            if name == "_machine" and value is not None:
                self.__dict__[name] = ("other",), machines[1]

    def machine(stiffness: float) -> Machine:
        return Machine(
            receiver=grounded({3: stiffness}, (FLANGE,)),
            placements={},
            isolators={},
            missing={},
            words=("", ""),
            known=None,
            causal=True,
        )

    machines = [machine(1e6), machine(2e6)]
    transfers = Interrupted()
    found = transfers.machine(("this",), lambda: machines[0])
    s, others = laplace(F), laplace(2.0 * F)

    class Hasty(type(found.receiver)):  # type: ignore[misc]
        def __setattr__(self, name: str, value: object) -> None:
            super().__setattr__(name, value)
            if name == "_last" and value is not None:
                self.__dict__[name] = others, machines[0].receiver.at(others)

    answered = Hasty(found.receiver).at(s).mobility
    assert np.array_equal(answered, machines[0].receiver.at(s).mobility)


# --------------------------------------------------------------------------- in time

MASS, HOUSING, RATE, CONTACT, PUSH, GAP = 3e-3, 25e-3, 1e4, 5e7, 15.0, 50e-6


def falling(impedance: float, end: float) -> tuple[float, ...]:
    """Touch, closing speeds, peak force, impulse, last displacement, by expm and bisection.

    A spring pushes a mass and its housing together; the housing stands on a damper.
    """
    A = np.zeros((6, 6))  # gap, speed of the mass, displacement and speed of the housing, impulse
    A[0, 1], A[0, 3], A[2, 3] = 1.0, -1.0, 1.0
    A[1, 0], A[1, 5] = -RATE / MASS, -(PUSH - RATE * GAP) / MASS
    A[3, 0], A[3, 3], A[3, 5] = -A[1, 0] * MASS, -impedance, -A[1, 5] * MASS
    A[3] /= HOUSING
    closed = A.copy()
    closed[1, 0] -= CONTACT / MASS
    closed[3, 0] += CONTACT / HOUSING
    closed[4, 0] = -CONTACT
    begin = np.array([GAP, 0.0, 0.0, 0.0, 0.0, 1.0])

    def until(
        B: np.ndarray, x: np.ndarray, row: np.ndarray, first: float, last: float
    ) -> tuple[float, np.ndarray]:
        def value(t: float) -> float:
            return float(row @ scipy.linalg.expm(B * t) @ x)

        t = float(scipy.optimize.brentq(value, first, last, xtol=1e-14))
        return t, scipy.linalg.expm(B * t) @ x

    gap, closing = np.eye(6)[0], A[0]
    touch, met = until(A, begin, gap, 1e-5, 2e-4)
    deepest, pressed = until(closed, met, closing, 1e-6, 3e-5)
    contact, left = until(closed, met, gap, deepest, 3.0 * deepest)
    last = scipy.linalg.expm(A * (end - touch - contact)) @ left
    speeds = -float(closing @ met), float(closing @ left)
    return touch, *speeds, -CONTACT * float(pressed[0]), float(left[4]), float(last[2])


@pytest.mark.parametrize("thickness", [1.5e-3, 20e-3])
def test_impact_of_a_mass_on_a_mass_on_a_plate(thickness: float) -> None:
    """Piecewise linear, solved by matrix exponentials: force 1e-4, speeds 1e-3, of the step."""
    plate = Plate(thickness=thickness, area=0.2, material=STEEL)
    one = np.ones((1, 1))
    block = CraigBampton(
        omega=np.zeros(0),
        damping=np.zeros(0),
        mounts=("flange",),
        directions=(3,),
        references=np.zeros((1, 3)),
        participation=np.zeros((0, 1)),
        mass=HOUSING * one,
        stiffness=0.0 * one,
        loss=0.0 * one,
        port_names=("seat",),
        port_shapes=np.zeros((0, 1)),
        port_motion=one,
    )
    receiver = InfinitePlate(plate=plate, points=(FLANGE,))
    heard = HeardReceiver(
        receiver=receiver,
        name="hall",
        ears=("a",),
        frequency=np.array([100.0, 200.0]),
        transfers=np.ones((2, 1, 1), dtype=complex),
    )  # ears of a file change nothing
    found = standing_valve([block], (FLANGE,), heard, placements={}, isolators={}, missing={})
    ((_, impedance),) = found.dampers.values()
    assert impedance == pytest.approx(8.0 * np.sqrt(plate.bending_stiffness * plate.mass_per_area))
    housing = found.reduced("housing", ("seat",), HOUSING)
    network = Network(
        {
            "mass": RigidMass(mass=MASS),
            "housing": FlexibleBody.of(housing),
            "seat": EndStop(gap=GAP, law={"kind": "linear", "stiffness": CONTACT}),
            "spring": ReturnSpring(stiffness=RATE, preload=PUSH),
            "plate": GuideFriction(coulomb=0.0, viscous=impedance),
        },
        [
            ["mass.body", "seat.upper", "spring.end"],
            ["housing.seat", "seat.lower", "spring.base"],
            ["housing.flange-z", "plate.body"],
        ],
    )
    result = simulate_network(network.rows(), duration=3e-4, step=10e-9, record=1e-7, start="free")
    touch, before, after, force, impulse, moved = falling(impedance, float(result.time[-1]))
    (event,) = result.events
    assert event.time == pytest.approx(touch, rel=1e-5)
    assert event.approach_speed == pytest.approx(before, rel=1e-4)
    assert event.restitution == pytest.approx(after / before, rel=1e-3)
    assert event.peak_force == pytest.approx(force, rel=1e-4)
    assert event.impulse == pytest.approx(impulse, rel=1e-4)
    last = result.channels["housing.seat displacement"].values[-1]
    assert last == pytest.approx(moved, rel=1e-3)


# --------------------------------------------------------------------------- whole strokes

CASE = Path(__file__).parent.parent / "data" / "structure_borne" / "rod_on_a_plate.yaml"


def stroke(thickness: str, variants: tuple[str, ...] = ("dry", "dry-mounted")) -> StrokeStudy:
    text = CASE.read_text().replace("1.5 mm, material", f"{thickness}, material")
    return run_stroke(read_valve_case(text, CASE), variants=variants, threads=1)


@pytest.fixture(scope="module")
def sheet() -> StrokeStudy:
    return stroke("1.5 mm")


def test_on_a_thick_plate_nothing_changes() -> None:
    """Concrete-like stiffness: first impact within 0.1 %, which is what the plate gives way."""
    study = stroke("100 mm")
    held, moving = (study.variants[name].impacts("opening")[0] for name in study.variants)
    assert moving.peak_force == pytest.approx(held.peak_force, rel=1e-3)
    assert moving.time == pytest.approx(held.time, rel=1e-4)


def test_on_a_sheet_the_impact_is_softer(sheet: StrokeStudy) -> None:
    """What the note of the held run calls off by 19 % is 8 % of the peak, 10 % of the impulse."""
    held, moving = (variant.impacts("opening")[0] for variant in sheet.variants.values())
    assert 0.88 < moving.peak_force / held.peak_force < 0.96
    assert 0.85 < moving.impulse / held.impulse < 0.94
    for variant in sheet.variants.values():
        assert variant.result.books.relative_residual < 1e-9


def test_lift_counts_from_the_valve_that_drifts(sheet: StrokeStudy) -> None:
    """The plate gives way by 26 um of the gap of 50 um, for good; compression of both is less."""
    variant = sheet.variants["dry-mounted"]
    lift = variant.result.channels[sheet.channels.lift].values
    drift = variant.result.channels["mounted.base-seat displacement"].values
    closing = variant.needle_times.closing
    assert drift[-1] > 20e-6
    assert abs(lift[-1]) < 1e-6
    assert 50e-6 < lift.max() < 60e-6
    assert closing.at_50 < closing.at_10 < closing.touch
    (note,) = [word for word in sheet.warnings if "the valve itself moves by up to" in word]
    assert note.startswith("'dry-mounted'")


def test_a_component_with_the_name_of_the_whole_is_none_elsewhere() -> None:
    text = CASE.read_text().replace("guide", "mounted").replace("type: mounted-", "type: guide-")
    case = read_valve_case(text.replace("duration: 8 ms", "duration: 0.1 ms"), CASE)
    study = run_stroke(case, variants=("dry",), threads=1)
    assert "machine" not in study.variants["dry"].label
    with pytest.raises(InputError, match="the name 'mounted'"):
        run_stroke(case, variants=("dry-mounted",), threads=1)
    text = CASE.read_text().replace("base", "flange").replace("name: seat", "name: z")
    text = text.replace("points: [seat]", "points: [z]").replace("flange.seat", "flange.z")
    with pytest.raises(InputError, match="'flange-z' of a mount, which is also flange and z"):
        run_stroke(read_valve_case(text, CASE), variants=("dry-mounted",), threads=1)


def test_force_on_the_plate_in_the_run_and_by_coupling(sheet: StrokeStudy) -> None:
    """The forces of the coupled run, through blocked force and coupling, give its own joint force.

    Records of 1 us: 1e-5 at 1 kHz, growing as the square of the frequency.
    """
    (source,) = stroke_sources(sheet, ("dry-mounted",))
    assert source.held is not None
    assert source.held.unbalanced < 1e-9 * source.held.largest
    found = installed(source)
    assert found is not None
    record, _ = in_machine(found, source.speed)
    assert record.balance < 1e-9
    assert any("valid only on this machine" in note for note in record.notes)
    result = sheet.variants["dry-mounted"].result
    means = -result.channels["mounted-flange-z.body force"].values[1:]
    step = float(result.time[1] - result.time[0])
    (joint,) = (item for item in record.freedoms if item.name == "flange.z")
    for f, tolerance in ((200.0, 1e-5), (1e3, 2e-5), (4e3, 2e-4)):
        k = int(np.argmin(np.abs(record.frequency - f)))
        w = 2.0 * np.pi * record.frequency[k]
        turn = np.exp(-1j * w * (result.time[1:] - 0.5 * step))
        direct = np.sum(means * turn) * step * np.sinc(record.frequency[k] * step)
        assert abs(joint.force[k] - direct) < tolerance * abs(direct)


def test_numbers_of_the_whole_change_smoothly_with_its_steps() -> None:
    """Truth: they are sines and cosines of modes in a step; an extremum of one is no jump."""
    valve = build_valve(read_valve_case(CASE.read_text(), CASE))
    rows = variant_network(valve, "dry-mounted").rows()
    for step in (40e-9, 50e-9, 60e-9):
        sizes = step_sizes(rows, "normal", step=step)
        found = numbers_at_rest(compile_network(rows, sizes), None, [], sizes)
        assert any(np.any(slope) for *_, slope in found.by_step)


def test_stops_that_are_joined_by_a_law_push_their_bodies(sheet: StrokeStudy) -> None:
    """Truth: their force is that of the records at the port, and leaves its work in the modes."""
    (source,) = stroke_sources(sheet, ("dry",))
    assert source.held is not None
    forces = {stop.name: stop.force for stop in source.stops}
    for structure, port in zip(source.structures, ("seat", "stop"), strict=True):
        fine = port_forces(structure, forces)[port].values
        known = source.held.forces[structure.name][:, structure.port_names.index(port)]
        means = fine.reshape(known.size, -1).mean(axis=1)
        assert np.abs(known).max() > 100.0
        assert np.abs(known - means).max() < 1e-12 * np.abs(known).max()
    found = noise_design(source)
    assert [body.name for body in found.bodies] == ["base", "pole"]
    for body in found.bodies:
        assert body.injected.sum() > 0.0
        assert abs(body.residual) < 1e-9


def test_a_variant_without_what_it_needs_is_refused() -> None:
    text = CASE.read_text()
    broken = {
        "no surface for the reaction of spring": ("spring: pole.top, ", ""),
        "'magnet', which has no second end": ("magnet: outside", "magnet: pole.top"),
        "'dry-mounted' without a machine": (text[text.index("  receiver:") :], ""),
    }
    for says, (old, new) in broken.items():
        case = read_valve_case(text.replace(old, new), CASE)
        with pytest.raises(InputError, match=says):
            run_stroke(case, variants=("dry-mounted",), threads=1)
