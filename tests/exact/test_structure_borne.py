"""A source on a receiver: against tables, against bodies assembled directly, and by definition."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from klack.acoustics.coupled_signal import measured_signal, model_signal
from klack.acoustics.coupling import Placement, axes_of, couple, junction
from klack.acoustics.in_situ import blocked_force_in_situ, virtual_test
from klack.acoustics.interface import (
    Freedom,
    InterfacePoint,
    SourceAtMounts,
    freedoms_of,
    laplace,
)
from klack.acoustics.isolator import DynamicStiffness, MeasuredIsolator, Spring
from klack.acoustics.plate import Plate
from klack.acoustics.receivers.plates import InfinitePlate, finite_plate
from klack.acoustics.source_levels import drive_lines, exposure, single_equivalents
from klack.errors import AccuracyWarning, InputError
from klack.verification.structure_borne import (
    DAMPED_MASS,
    PLATE_STEEL,
    THIN_PLATE,
    KnownReceiver,
    beam_source,
    joined_rods,
    two_masses,
    two_masses_exact,
)

TABLES = Path(__file__).parents[1] / "data" / "structure_borne"
POINT = (InterfacePoint(name="a"),)


def table(name: str) -> dict[str, np.ndarray]:
    """Columns of a table by name."""
    text = (TABLES / f"{name}.csv").read_text().splitlines()
    names = text[1].removeprefix("# ").split(",")
    return dict(zip(names, np.loadtxt(TABLES / f"{name}.csv", delimiter=",").T, strict=True))


def test_rods_joined_rigidly_and_by_a_spring() -> None:
    """Magnitudes of the table, 11 digits."""
    known = table("rods")
    f = known["f_Hz"]
    rigid, soft = joined_rods(f), joined_rods(f, Spring(values={3: 5e6}, loss_factor=0.05))
    assert np.abs(rigid.free_velocity[:, 0]) == pytest.approx(known["v_free"], rel=1e-9, abs=0.0)
    assert np.abs(rigid.force[:, 0]) == pytest.approx(known["g_rigid"], rel=1e-9, abs=0.0)
    assert np.abs(rigid.pressure[:, 0]) == pytest.approx(known["v3_rigid"], rel=1e-9, abs=0.0)
    assert np.abs(soft.force[:, 0]) == pytest.approx(known["g_spring"], rel=1e-9, abs=0.0)


def test_beam_on_a_plate() -> None:
    """Powers of the feet, and the two wrong ways: blocked force as a force, feet one by one."""
    known = table("beam_on_plate")
    source = beam_source(known["f_Hz"])
    plate = InfinitePlate(plate=THIN_PLATE, points=source.points)
    power = couple(source, plate).power
    for foot in (0, 1):
        assert power[:, foot] == pytest.approx(known[f"P_foot{foot + 1}"], rel=1e-8, abs=0.0)
    Y = plate.at(source.s).mobility
    F = source.blocked_force
    wrong = 0.5 * np.real(np.einsum("ki,kij,kj->k", F.conj(), Y, F))
    assert wrong == pytest.approx(known["P_if_F_blocked_acted_on_plate"], rel=1e-8, abs=0.0)


def test_single_equivalents_of_two_reception_plates() -> None:
    """The table has six digits."""
    known = table("en15657_equivalents")
    found = single_equivalents(beam_source(known["f_Hz"]))
    for name, values in (
        ("F_b_eq", found.force),
        ("v_f_eq", found.velocity),
        ("Y_S_eq", found.mobility),
    ):
        assert values == pytest.approx(known[name], rel=1e-6, abs=0.0)


def test_reception_plates_with_point_contacts_leave_rotations_free() -> None:
    """A beam with its tilts at the feet gives the same numbers; feet with a size give others."""
    f = np.array([500.0, 4000.0])
    plain, tilted = single_equivalents(beam_source(f)), beam_source(f, slopes=True)
    assert single_equivalents(tilted).force == pytest.approx(plain.force, rel=1e-9, abs=0.0)
    wide = single_equivalents(tilted, radius=5e-3).force
    assert (np.abs(wide / plain.force - 1.0) > 1e-4).all()


def test_reception_plates_below_a_source_that_is_drawn_in_another_frame() -> None:
    """The beam drawn along y, pushing along -x: the same numbers once its axes are given."""
    f = np.array([500.0, 4000.0])
    plain = beam_source(f)
    drawn = replace(
        plain,
        points=tuple(
            InterfacePoint(name=point.name, position=np.array([0.0, point.position[0], 0.3]))
            for point in plain.points
        ),
        freedoms=tuple(Freedom(freedom.point, -1) for freedom in plain.freedoms),
    )
    axes = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # x, y, z of the drawing
    found = single_equivalents(drawn, axes=axes)
    assert found.force == pytest.approx(single_equivalents(plain).force, rel=1e-9, abs=0.0)
    with pytest.raises(InputError, match="one plane"):
        single_equivalents(drawn, axes=axes[[1, 0, 2]] * [[1], [-1], [1]])


def test_velocity_of_a_joint_over_time() -> None:
    """On the shifted contour 5e-7 of the peak; the table has every twentieth value."""
    known = table("coupled_time_signal")["v_m_s"]
    signal = model_signal(
        two_masses, lambda source: couple(source, DAMPED_MASS), step=5e-6, duration=20e-3
    )
    found = signal.velocity[: 20 * known.size : 20, 0]
    assert np.abs(found - known).max() < 1e-6 * np.abs(known).max()


def test_a_record_that_rings_longer_than_it_lasts_is_refused() -> None:
    """The same at lines of frequency: at 50 Hz it is folded in; at 0.5 Hz it is right."""

    def signal(apart: float):
        f = apart * np.arange(1, round(20e3 / apart) + 1)
        return measured_signal(two_masses, lambda source: couple(source, DAMPED_MASS), f, step=5e-6)

    with pytest.raises(InputError, match="energy in the last tenth"):
        signal(50.0)
    found = signal(0.5)
    assert found.step == pytest.approx(5e-6, rel=1e-12)
    exact = two_masses_exact(4000)
    # a free source keeps its momentum: the mass on its spring swings, so only the band counts
    assert np.abs(found.velocity[:4000, 0] - exact).max() < 0.02 * np.abs(exact).max()
    assert "Faded out" in found.notes[0]


def test_the_ends_of_a_measured_band_are_faded() -> None:
    """Lines from 400 to 4000 Hz: half cosines over a third octave at both ends, and notes."""
    f = np.arange(400.0, 4000.5, 1.0)
    receiver = KnownReceiver(
        points=two_masses(f, 0.0).points,
        freedoms=two_masses(f, 0.0).freedoms,
        mobility=lambda s: (1e-3 + 0.0 * s)[:, None, None],
    )
    found = measured_signal(two_masses, lambda source: couple(source, receiver), f, step=1e-4)
    joined = couple(two_masses(f, 0.0), receiver)
    fade = np.ones_like(f)
    for low, high in ((400.0, 400.0 * 2 ** (1 / 3)), (4000.0, 4000.0 / 2 ** (1 / 3))):
        inside = (f - low) * (f - high) <= 0
        fade[inside] = 0.5 - 0.5 * np.cos(np.pi * (f[inside] - low) / (high - low))
    whole = np.zeros(5001, dtype=complex)
    whole[400:4001] = joined.velocity[:, 0] * fade
    expected = np.roll(np.fft.irfft(whole, 10000) * 1e4, 75)[:9500]
    assert found.start == pytest.approx(-3 / 400.0, rel=1e-12)
    assert found.velocity[:, 0] == pytest.approx(expected, rel=1e-9, abs=1e-12 * expected.max())
    assert [note.split()[0] for note in found.notes] == ["Faded", "Nothing"]


# --------------------------------------------------------------------------- bodies


def network(draw: np.random.Generator, size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mass, damping and stiffness of a random body."""
    A, B, C = (draw.normal(size=(size, size)) for _ in range(3))
    return 0.01 * (A @ A.T + size * np.eye(size)), 10.0 * C @ C.T, 1e6 * B @ B.T


def dynamic(body: tuple[np.ndarray, ...], s: np.ndarray) -> np.ndarray:
    """Force per velocity, (k, n, n)."""
    M, C, K = body
    return s[:, None, None] * M + C + K / s[:, None, None]


class Pair:
    """Nine freedoms with three internal forces on a receiver of eight, joined at six."""

    def __init__(self, shift: float = 0.0) -> None:
        draw = np.random.default_rng(1)
        self.f = np.array([20.0, 300.0, 4000.0])
        self.s = laplace(self.f, shift)
        self.Z_S, self.Z_R = (dynamic(network(draw, size), self.s) for size in (9, 8))
        self.push = draw.normal(size=3)
        Y = np.linalg.inv(self.Z_S)
        self.source = SourceAtMounts(
            frequency=self.f,
            shift=shift,
            points=POINT,
            freedoms=freedoms_of("a"),
            free_velocity=Y[:, :6, 6:] @ self.push,
            blocked_force=np.linalg.solve(Y[:, :6, :6], Y[:, :6, 6:] @ self.push[:, None])[..., 0],
            mobility=Y[:, :6, :6],
        )
        self.Y_R = np.linalg.inv(self.Z_R)
        self.receiver = self.of(self.Y_R)

    def of(self, Y: np.ndarray, freedoms=None, points=POINT) -> KnownReceiver:
        """Receiver of six (or other) freedoms; the last freedom is an ear."""
        chosen = freedoms_of("a") if freedoms is None else freedoms
        n = len(chosen)
        return KnownReceiver(
            points=points,
            freedoms=chosen,
            mobility=lambda s: Y[:, :n, :n],
            transfers=lambda s: Y[:, 7:, :n],
            ears=("ear",),
        )

    def direct(self, springs=(), blocks=(), rigid=range(6)) -> np.ndarray:
        """Velocities of all 17 freedoms with both bodies assembled and joined by constraints."""
        found = []
        for k, s in enumerate(self.s):
            Z = np.zeros((17, 17), complex)
            Z[:9, :9], Z[9:, 9:] = self.Z_S[k], self.Z_R[k]
            for i, stiffness in springs:
                Z[np.ix_([i, 9 + i], [i, 9 + i])] += stiffness / s * np.array([[1, -1], [-1, 1]])
            for i, block in blocks:
                Z[np.ix_([i, 9 + i], [i, 9 + i])] += block[k] / s
            B = np.zeros((len(rigid), 17))
            for row, i in enumerate(rigid):
                B[row, i], B[row, 9 + i] = 1.0, -1.0
            whole = np.block([[Z, B.T], [B, np.zeros((len(rigid),) * 2)]])
            force = np.zeros(17 + len(rigid))
            force[6:9] = self.push
            found.append(np.linalg.solve(whole, force)[:17])
        return np.array(found)


def same(found, direct: np.ndarray) -> None:
    """Velocities of both sides and at the ear are those of the assembled bodies."""
    size = np.abs(direct).max()
    assert np.abs(found.source_velocity - direct[:, :6]).max() < 1e-12 * size
    assert np.abs(found.velocity - direct[:, 9:15]).max() < 1e-12 * size
    assert np.abs(found.pressure[:, 0] - direct[:, 16]).max() < 1e-12 * size


def test_joined_rigidly_as_assembled() -> None:
    """Six freedoms."""
    pair = Pair()
    same(couple(pair.source, pair.receiver), pair.direct())


def test_springs_in_two_directions_as_assembled() -> None:
    """The other four are rigid; what the springs lose is missing from the receiver's power."""
    pair = Pair()
    spring = Spring(values={1: 1e5, 4: 30.0}, loss_factor=0.1)
    found = couple(pair.source, pair.receiver, isolators={"a": spring})
    same(found, pair.direct([(0, 1e5 * (1 + 0.1j)), (3, 30 * (1 + 0.1j))], rigid=[1, 2, 4, 5]))
    lost = found.power_from_source.sum(axis=1) - found.power.sum(axis=1)
    stretched = (
        np.abs(found.source_velocity - found.velocity)[:, [0, 3]] / (2 * np.pi * pair.f)[:, None]
    )
    by_hand = 0.5 * (2 * np.pi * pair.f) * (stretched**2 @ np.array([1e4, 3.0]))
    assert lost == pytest.approx(by_hand, rel=1e-9, abs=0.0)


def test_damped_springs_beside_the_axis_as_assembled() -> None:
    """At ``s`` with a real part of 900 1/s, as time signals need it."""
    pair = Pair(shift=900.0)
    spring = Spring(values={2: 3e5}, damping={2: 40.0})
    found = couple(pair.source, pair.receiver, isolators={"a": spring})
    across = np.array([[[k, -k], [-k, k]] for k in 3e5 + 40.0 * pair.s])
    same(found, pair.direct(blocks=[(1, across)], rigid=[0, 2, 3, 4, 5]))


def test_an_element_with_inertia_as_assembled() -> None:
    """50 g between two springs in z, a spring in x, the rest rigid."""
    pair = Pair()
    k, m, c = 1e6, 0.05, 5.0
    middle = 2 * k + m * pair.s**2 + c * pair.s
    block = np.array([[[k - k * k / d, -k * k / d], [-k * k / d, k - k * k / d]] for d in middle])
    soft = np.full(3, 1e5 * (1 + 0.1j))
    element = MeasuredIsolator(
        name="element",
        frequency=pair.f,
        values={
            3: DynamicStiffness(
                driving=block[:, 0, 0], transfer=-block[:, 0, 1], receiving=block[:, 1, 1]
            ),
            1: DynamicStiffness(transfer=soft),
        },
    )
    found = couple(pair.source, pair.receiver, isolators={"a": element})
    same(found, pair.direct([(0, soft[0])], [(2, block)], rigid=[1, 3, 4, 5]))


def test_a_source_that_is_turned_and_stands_beside_the_point() -> None:
    """Rotated by hand: v_S = R (v + w x d), w_S = R w; the ear and the total power stay."""
    pair = Pair()
    d = np.array([0.01, -0.02, 0.005])
    R = axes_of([1.0, 2.0, 0.5], [-2.0, 1.0, 0.0])
    cross = np.array([[0, d[2], -d[1]], [-d[2], 0, d[0]], [d[1], -d[0], 0]])  # w x d
    T = np.block([[R, R @ cross], [np.zeros((3, 3)), R]])
    Y = pair.Y_R.copy()
    Y[:, :6, :6] = T @ pair.Y_R[:, :6, :6] @ T.T
    Y[:, 7:, :6] = pair.Y_R[:, 7:, :6] @ T.T
    placed = couple(pair.source, pair.receiver, placements={"a": Placement(axes=R, offset=d)})
    by_hand = couple(pair.source, pair.of(Y))
    size = np.abs(by_hand.force).max()
    assert np.abs(placed.force - by_hand.force).max() < 1e-12 * size
    assert placed.pressure == pytest.approx(by_hand.pressure, rel=1e-12, abs=0.0)


def test_directions_that_are_reversed_and_points_with_axes_of_their_own() -> None:
    """The receiver measured along -z, and in its own axes: the same powers."""
    pair = Pair()
    sign = np.array([1, 1, -1, 1, 1, 1])
    Y = pair.Y_R.copy()
    Y[:, :6, :6] *= sign[:, None] * sign
    Y[:, 7:, :6] *= sign
    freedoms = freedoms_of("a", ("x", "y", "-z", "rx", "ry", "rz"))
    reversed_ = couple(pair.source, pair.of(Y, freedoms))
    plain = couple(pair.source, pair.receiver)
    assert reversed_.power == pytest.approx(plain.power, rel=1e-9, abs=0.0)
    axes = axes_of([0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
    T = np.kron(np.eye(2), axes)
    Y = pair.Y_R.copy()
    Y[:, :6, :6] = T @ pair.Y_R[:, :6, :6] @ T.T
    Y[:, 7:, :6] = pair.Y_R[:, 7:, :6] @ T.T
    own = couple(pair.source, pair.of(Y, points=(InterfacePoint(name="a", axes=axes),)))
    assert own.power == pytest.approx(plain.power, rel=1e-9, abs=0.0)


def test_a_source_with_a_reversed_direction() -> None:
    """Its force along -z is minus that along z; powers stay."""
    pair = Pair()
    sign = np.array([1, 1, -1, 1, -1, 1])
    source = SourceAtMounts(
        frequency=pair.f,
        points=POINT,
        freedoms=freedoms_of("a", ("x", "y", "-z", "rx", "-ry", "rz")),
        free_velocity=pair.source.free_velocity * sign,
        blocked_force=pair.source.blocked_force * sign,
        mobility=pair.source.mobility * sign * sign[:, None],
    )
    reversed_, plain = couple(source, pair.receiver), couple(pair.source, pair.receiver)
    assert reversed_.force == pytest.approx(plain.force * sign, rel=1e-9, abs=0.0)
    assert reversed_.pressure == pytest.approx(plain.pressure, rel=1e-9, abs=0.0)


def test_missing_freedoms_are_listed_and_blocked_or_freed_on_demand() -> None:
    """Without rotations: blocked is a receiver of zero mobility, free a source without them."""
    pair = Pair()
    receiver = pair.of(pair.Y_R, freedoms_of("a", ("x", "y", "z")))
    with pytest.raises(InputError, match=r"a\.rx, a\.ry, a\.rz") as error:
        couple(pair.source, receiver)
    assert "blocked" in error.value.hint
    blocked = couple(
        pair.source, receiver, missing={"a.rx": "blocked", "a.ry": "blocked", "a.rz": "blocked"}
    )
    Y = pair.Y_R.copy()
    Y[:, 3:6], Y[:, :, 3:6] = 0.0, 0.0
    assert blocked.force == pytest.approx(couple(pair.source, pair.of(Y)).force, rel=1e-9, abs=0)
    assert len(blocked.notes) == 1
    assert blocked.notes[0].startswith("a.rx, a.ry, a.rz: ")
    freed = couple(pair.source, receiver, missing={"a": "free"})
    assert [str(f) for f in freed.freedoms] == ["a.x", "a.y", "a.z"]
    Y_S = pair.source.mobility[:, :3, :3]
    g = np.linalg.solve(Y_S + pair.Y_R[:, :3, :3], pair.source.free_velocity[:, :3, None])
    assert freed.force == pytest.approx(g[..., 0], rel=1e-9, abs=0)


def test_what_a_known_receiver_does_is_not_assumed() -> None:
    """A note, and nothing changes; what is taken has its own note."""
    pair = Pair()
    found = couple(pair.source, pair.receiver, missing={"a": "free", "a.z": "free"})
    (note,) = found.notes
    assert note == "missing: no effect at a, a.z: the receiver is known there."
    assert np.array_equal(found.force, couple(pair.source, pair.receiver).force)
    receiver = pair.of(pair.Y_R, freedoms_of("a", ("x", "y", "z")))
    taken, idle = couple(pair.source, receiver, missing={"a": "free", "a.x": "free"}).notes
    assert taken.startswith("a.rx, a.ry, a.rz: ")
    assert idle.startswith("missing: no effect at a.x: ")


def test_blocked_force_in_situ_through_isolators() -> None:
    """The interface is that of the source: what is below it, isolator and receiver, has no say."""
    pair = Pair()
    for isolators in ({}, {"a": Spring(values={1: 1e5, 3: 2e5}, loss_factor=0.1)}):
        test = virtual_test(junction(pair.source, pair.receiver, isolators=isolators), length=0.03)
        assert test.deviation.max() < 1e-9
        assert test.exact == pytest.approx(pair.source.blocked_force, rel=1e-9, abs=0.0)
    scaled = test.assembly * np.array([1, 1, 1, 0.03, 0.03, 0.03])
    assert test.condition == pytest.approx(np.linalg.cond(scaled), rel=1e-6)
    with pytest.raises(InputError, match="2 indicators for 6"):
        virtual_test(junction(pair.source, pair.receiver), length=0.03, indicators=["a.x", "a.y"])


def test_noise_spoils_components_and_not_the_prediction() -> None:
    """1 % on responses and velocities at 6 kHz, 8 indicators: 15 % and 2.4 % in the median."""
    source = beam_source(np.array([6e3]), slopes=True)
    draw = np.random.default_rng(5)
    Y_S, vf, scale = source.mobility[0], source.free_velocity[0], np.array([1, 1, 0.04, 0.04])
    exact = np.linalg.solve(Y_S, vf)

    def complex_draws(*shape: int) -> np.ndarray:
        return draw.normal(size=shape) + 1j * draw.normal(size=shape)

    apart, predicted = [], []
    for _ in range(400):
        R = complex_draws(4, 4)
        Y_R = 0.012 * np.abs(Y_S).max() * (R @ R.T) / scale / scale[:, None]
        T = complex_draws(9, 4) / scale
        assembly, moved = T @ np.linalg.solve(Y_S + Y_R, Y_S), T @ np.linalg.solve(Y_S + Y_R, vf)
        noisy, heard = (
            a * (1 + 0.01 * complex_draws(*a.shape) / 2**0.5) for a in (assembly, moved)
        )
        force = blocked_force_in_situ(
            noisy[None, :8], heard[None, :8], source.freedoms, length=0.04
        )
        apart.append(np.linalg.norm((force[0] - exact) / scale) / np.linalg.norm(exact / scale))
        predicted.append(abs(noisy[8] @ force[0] / heard[8] - 1))
    assert np.median(apart) == pytest.approx(0.146, rel=0.2)
    assert np.median(predicted) == pytest.approx(0.024, rel=0.2)


# --------------------------------------------------------------------------- levels


def test_exposure_lines_and_power_of_a_drive() -> None:
    """White spectrum: 2 x^2 per hertz; as many lines as the band holds give the same power."""
    f = np.linspace(20.0, 2e4, 4001)
    x = np.full(f.size, 3e-6 + 4e-6j)
    bands = exposure(f, x)
    assert bands.energy == pytest.approx(2 * 25e-12 * (bands.high - bands.low), rel=1e-9, abs=0.0)
    assert bands.low[0] >= 20.0
    assert bands.high[-1] <= 2e4
    lines, rms = drive_lines(f, x, 7.0)
    assert lines[0] == 21.0
    assert lines[-1] <= 2e4
    assert rms == pytest.approx(2**0.5 * 7.0 * 5e-6, rel=1e-9, abs=0.0)
    inside = (lines > bands.low[20]) & (lines <= bands.high[20])
    assert np.sum(rms[inside] ** 2) == pytest.approx(7.0 * bands.energy[20], rel=0.02)


def test_levels_of_the_standard_by_hand() -> None:
    """L_Fb = L_W - 10 lg Y and L_v = L_W + 10 lg Y + 60; 1e-9 m/s and 1e-6 N."""
    f = np.geomspace(400.0, 8e3, 300)
    found = single_equivalents(beam_source(f))
    levels = found.levels(20.0)
    bands, force = levels["blocked force"]
    assert force == pytest.approx(10 * np.log10(20.0 * bands.energy / 1e-12), rel=1e-9)
    installed = levels["installed power"][1]
    assert installed - force == pytest.approx(10 * np.log10(5e-6), rel=1e-9)
    bands, velocity = levels["free velocity"]
    assert velocity == pytest.approx(10 * np.log10(20.0 * bands.energy / 1e-18), rel=1e-9)


# --------------------------------------------------------------------------- plates


def test_plates_are_reciprocal_and_take_power() -> None:
    """Forces and moments at three feet, on the axis and beside it."""
    feet = tuple(
        InterfacePoint(name=name, position=np.array([x, y, 0.0]))
        for name, x, y in (("a", 0.2, 0.3), ("b", 0.25, 0.3), ("c", 0.22, 0.36))
    )
    f = np.geomspace(10.0, 9e3, 40)
    models = (
        InfinitePlate(plate=THIN_PLATE, points=feet, radius=5e-3),
        finite_plate(THIN_PLATE, (0.5, 0.6), feet, highest=1e4, radius=5e-3),
    )
    scale = np.array([1.0, 0.02, 0.02] * 3)
    for model in models:
        for shift in (0.0, 400.0):
            Y = model.at(laplace(f, shift)).mobility / scale / scale[:, None]
            size = np.abs(Y).max(axis=(1, 2))
            assert (np.abs(Y - Y.transpose(0, 2, 1)).max(axis=(1, 2)) < 1e-12 * size).all()
            lowest = np.linalg.eigvalsh(0.5 * (Y + Y.conj().transpose(0, 2, 1)))[:, 0]
            assert (lowest > -1e-12 * size).all()


def test_a_plate_at_its_first_resonance() -> None:
    """``phi^2 / (2 zeta omega)``, 4 / (m S eta omega) in the middle."""
    plate = Plate(thickness=1.5e-3, area=1.0, material=PLATE_STEEL, loss_factor=0.002)
    middle = (InterfacePoint(name="a", position=np.array([0.25, 0.3, 0.0])),)
    model = finite_plate(plate, (0.5, 0.6), middle, highest=2e3)
    own = np.sqrt(plate.bending_stiffness / plate.mass_per_area) * np.pi**2 * (4 + 1 / 0.36)
    Y = model.at(np.array([1j * own])).mobility[0, 0, 0]
    expected = 4.0 / (plate.mass_per_area * 0.3 * 0.002 * own)
    assert Y.real == pytest.approx(expected, rel=1e-4)


def test_limits_of_plates_are_told() -> None:
    """Thick for the waves, feet that overlap or are outside, axes of their own."""
    point = (InterfacePoint(name="a", position=np.array([0.1, 0.1, 0.0])),)
    with pytest.warns(AccuracyWarning, match="six"):
        InfinitePlate(plate=Plate(thickness=0.02, area=1.0, material=PLATE_STEEL), points=point).at(
            laplace(np.array([2e4]))
        )
    near = InterfacePoint(name="b", position=np.array([0.105, 0.1, 0.0]))
    with pytest.raises(InputError, match="overlap"):
        InfinitePlate(plate=THIN_PLATE, points=(*point, near), radius=5e-3)
    with pytest.raises(InputError, match="inside"):
        finite_plate(THIN_PLATE, (0.1, 0.2), point, highest=1e3)
    turned = InterfacePoint(name="a", axes=axes_of([0, 1, 0], [-1, 0, 0]))
    with pytest.raises(InputError, match="its own axes"):
        _ = InfinitePlate(plate=THIN_PLATE, points=(turned,)).freedoms


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Freedom("a", 0), "direction 0"),
        (lambda: Freedom("a", 7), "direction 7"),
        (lambda: freedoms_of("a", ("z", "w")), "'w'"),
        (lambda: InterfacePoint(name="a", axes=np.diag([1.0, 1.0, -1.0])), "left-handed"),
        (lambda: InterfacePoint(name="a", axes=2 * np.eye(3)), "right angles"),
        (lambda: axes_of([1, 0, 0], [1, 0.1, 0]), "right angles"),
        (lambda: Spring(values={3: -1.0}), "-1"),
        (lambda: Spring(values={3: 1.0}, loss_factor=-0.1), "below 0"),
        (
            lambda: Spring(values={3: 1.0}, loss_factor=0.1).stiffness(3, laplace(np.ones(1), 5.0)),
            "causal",
        ),
    ],
)
def test_input_that_cannot_be_used(make, says: str) -> None:
    """One clear error."""
    with pytest.raises(InputError, match=says):
        make()


def test_an_element_with_internal_resonances_known_by_its_transfer_alone() -> None:
    """A stiffness that doubles is told with the frequency."""
    f = np.array([100.0, 400.0, 800.0])
    k = DynamicStiffness(transfer=np.array([1e5, 1.5e5, 4e5], dtype=complex))
    with pytest.warns(AccuracyWarning, match="800 Hz"):
        element = MeasuredIsolator(name="clip.csv", frequency=f, values={3: k})
    with pytest.raises(InputError, match="extrapolated"):
        element.stiffness(3, laplace(np.array([50.0])))
    with pytest.raises(InputError, match="model"):
        element.stiffness(3, laplace(f, 1.0))
