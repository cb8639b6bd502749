"""Reduced bodies as objects and files; damping, selection, and errors that help."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.sparse import csr_array

from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction import attachment, dynamic_stiffness
from klack.bodies.reduction.attachment import shift_at
from klack.bodies.reduction.damping import LossFactor, ModalDamping, RayleighDamping
from klack.bodies.reduction.full_order import full_order_receptance
from klack.bodies.reduction.ports import Port, node_observer, pressure_port, surface_port
from klack.bodies.reduction.receptance import reduced_receptance
from klack.bodies.reduction.reduce import reduce_body
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.bodies.reduction.selection import ByCount, ByFrequency, ByParticipation, select
from klack.bodies.reduction.transfer import compare_receptances, mean_level_deviation
from klack.errors import ConvergenceError, InputError
from klack.machine.cache.result_cache import ResultCache
from klack.verification.lattice import lattice_mesh
from klack.verification.reduction import rod


@pytest.fixture(scope="module")
def parts():
    body, lower, upper = rod(elements=20, clamped=False)
    return body, [lower, upper], eigenmodes(body, count=8)


@pytest.fixture(scope="module")
def reduced(parts):
    body, ports, pool = parts
    return reduce_body(
        body,
        ports,
        modes=ByCount(5),
        correction="attachment",
        damping=ModalDamping(ratio=1e-3),
        observers=[node_observer(body.mesh, 0, "z", name="edge")],
        modes_pool=pool,
        recovery_surfaces=["outer"],
    )


def test_file_gives_the_same_body_back(reduced, tmp_path):
    reduced.save(tmp_path / "rod.npz")
    back = ReducedBody.load(tmp_path / "rod.npz")

    for key in ("omega", "damping", "port_shapes", "observer_shapes", "static_compliance"):
        assert_array_equal(getattr(back, key), getattr(reduced, key))
    for key in ("name", "mass", "port_names", "observer_names", "correction", "rigid_count"):
        assert getattr(back, key) == getattr(reduced, key)
    assert (back.dof_count, back.attachment_count) == (reduced.dof_count, 2)
    assert_array_equal(back.recovery.shapes, reduced.recovery.shapes)
    assert_array_equal(back.recovery.faces, reduced.recovery.faces)
    assert [path.name for path in tmp_path.iterdir()] == ["rod.npz"]  # no part file


def test_body_without_recovery_comes_back_without(parts, tmp_path):
    body, ports, pool = parts
    plain = reduce_body(
        body,
        ports,
        modes=ByCount(2),
        correction="none",
        damping=LossFactor(eta=0.0),
        modes_pool=pool,
    )
    plain.save(tmp_path / "plain.npz")

    assert ReducedBody.load(tmp_path / "plain.npz").recovery is None


def test_interrupted_save_leaves_the_old_file(reduced, tmp_path, monkeypatch):
    path = tmp_path / "rod.npz"
    reduced.save(path)
    before = path.read_bytes()

    def interrupt(*_args, **_kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(np, "savez", interrupt)
    with pytest.raises(KeyboardInterrupt):
        reduced.save(path)

    assert path.read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize(
    "damage", ["missing", "truncated", "flipped", "text", "npy", "foreign", "newer"]
)
def test_damaged_files_are_refused(reduced, tmp_path, damage):
    path = tmp_path / "rod.npz"
    reduced.save(path)
    content = path.read_bytes()
    if damage == "missing":
        path.unlink()
    elif damage == "truncated":
        path.write_bytes(content[: len(content) // 2])
    elif damage == "flipped":
        middle = len(content) // 2
        path.write_bytes(content[:middle] + bytes([content[middle] ^ 255]) + content[middle + 1 :])
    elif damage == "text":
        path.write_text("needle, 3 g")
    elif damage == "npy":
        with path.open("wb") as stream:
            np.save(stream, np.ones(3))
    elif damage == "foreign":
        np.savez(path, omega=np.ones(3))
    else:
        with np.load(path) as stored:
            arrays = dict(stored)
        np.savez(path, **(arrays | {"version": np.array(99)}))

    with pytest.raises(InputError, match=r"rod\.npz.*\nTry: "):
        ReducedBody.load(path)


def test_incomplete_file_names_what_is_missing(reduced, tmp_path):
    reduced.save(tmp_path / "rod.npz")
    with np.load(tmp_path / "rod.npz") as stored:
        arrays = {key: stored[key] for key in stored.files if key != "damping"}
    np.savez(tmp_path / "rod.npz", **arrays)

    with pytest.raises(InputError, match="damping"):
        ReducedBody.load(tmp_path / "rod.npz")


def test_recovery_covers_the_surface(parts, reduced):
    """Line segments through all nodes of the outer side, mid nodes too; rigid motion is uniform."""
    recovery = reduced.recovery
    assert len(recovery.faces) == 2 * 20
    assert_allclose(recovery.points[:, 0], recovery.points[0, 0])
    motion = recovery.shapes[:, 0] / reduced.rigid_axial * reduced.mass
    assert_allclose(motion[1::2], 1.0, rtol=1e-10)


def test_state_space_has_the_receptance(reduced):
    """C (iw - A)^-1 B + D is the receptance of the viscously damped modes."""
    axis = np.array([20e3, 100e3])
    system = reduced.state_space(with_residual=True)
    expected = reduced_receptance(reduced, axis, with_residual=True).values

    for frequency, value in zip(axis, expected, strict=True):
        resolvent = 2j * np.pi * frequency * np.eye(len(system.A)) - system.A
        gain = system.C @ np.linalg.solve(resolvent, system.B) + system.feedthrough
        assert_allclose(gain[:2], value, rtol=1e-9)
    assert system.output_names == ("bottom", "top", "edge")


@pytest.mark.parametrize(
    ("damping", "expected"),
    [
        (ModalDamping(ratio=0.02), [0, 0.02, 0.02]),
        (ModalDamping(ratio=[0.1, 0.2]), [0, 0.1, 0.2]),
        (RayleighDamping(alpha=2.0, beta=4e-4), [0, 0.03, 0.045]),
        (LossFactor(eta=0.01), [0, 0.005, 0.005]),
    ],
    ids=["one ratio", "each mode", "Rayleigh", "loss factor"],
)
def test_damping_ratios(damping, expected):
    """Zeta = alpha/(2w) + beta w/2 = 0.01 + 0.02 and 0.005 + 0.04; rigid modes undamped."""
    assert_allclose(damping.ratios([0.0, 100.0, 200.0]), expected, rtol=1e-12)


def test_selection():
    omega = 2 * np.pi * np.array([1.0, 2.0, 3.0, 4.0])
    shapes = omega[:, None] * np.sqrt([[0.1], [0.4], [0.3], [0.9]])  # compliance 0.1 0.4 0.3 0.9

    assert select(ByCount(2), omega, shapes).tolist() == [0, 1]
    assert select(ByFrequency(3.0), omega, shapes).tolist() == [0, 1, 2]
    assert select(ByParticipation(2, 4), omega, shapes).tolist() == [1, 3]
    assert select(ByParticipation(2, 3), omega, shapes).tolist() == [1, 2]


def test_pool_is_computed_when_none_is_given(parts):
    body, ports, pool = parts
    limit = float(pool.omega[3] + pool.omega[4]) / (4 * np.pi)

    reduced = reduce_body(
        body,
        ports,
        modes=ByFrequency(limit),
        correction="consistent",
        damping=LossFactor(eta=0.0),
    )

    assert_allclose(reduced.omega[1:], pool.omega[:4], rtol=1e-8)


def reduce_with(parts, **changes):
    body, ports, pool = parts
    arguments = {
        "modes": ByCount(2),
        "correction": "consistent",
        "damping": LossFactor(eta=0.0),
        "modes_pool": pool,
    }
    ports = changes.pop("ports", ports)
    return reduce_body(body, ports, **(arguments | changes))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"ports": []}, "at least one port"),
        ({"ports": [Port("tip", np.ones(7))]}, "7 weights"),
        ({"modes": ByCount(9)}, "pool of 8 computed modes"),
        ({"shifts": (-1e9,)}, 'correction="attachment"'),
        ({"damping": ModalDamping(ratio=[0.1])}, "each of the 2 elastic modes"),
        ({"recovery_surfaces": ["lid"]}, "surface 'lid'"),
    ],
)
def test_reduction_refuses_what_it_cannot_use(parts, changes, text):
    with pytest.raises(InputError, match=text):
        reduce_with(parts, **changes)


@pytest.mark.parametrize(
    ("shifts", "text"),
    [
        ([0.0], "its rigid motion"),
        ([-10.0], "its rigid motion"),  # nothing but round-off is elastic
        ([100.0], "its rigid motion"),
        ([float("nan")], "its rigid motion"),
        ([1.0005], "an eigenfrequency"),
        ([3.0], "an eigenfrequency"),  # not among the kept ones
        ([-20e3, -20e3], "is independent"),
        ([-20e3, 40e3, -20.01e3], "-20.01 kHz after -20 kHz, 40 kHz"),
    ],
)
def test_shifts_without_a_mode_of_their_own_are_refused(parts, shifts, text):
    """In Hz; 1 and 3 stand for the first and the third elastic eigenfrequency."""
    first = parts[2].frequency
    given = [shift_at(f * first[int(f) - 1] / int(f) if 1 <= f < 4 else f) for f in shifts]
    with pytest.raises(InputError, match=text) as caught:
        reduce_with(parts, shifts=given, correction="attachment")
    assert "body 'rod'" in str(caught.value)
    assert "\nTry: " in str(caught.value)


def test_without_pardiso_shifted_modes_are_the_same(parts, monkeypatch):
    shifts = [shift_at(130e3), shift_at(-20e3)]
    with_it = reduce_with(parts, shifts=shifts, correction="attachment")
    monkeypatch.setattr(dynamic_stiffness, "available_backends", lambda: ("superlu",))
    without = reduce_with(parts, shifts=shifts, correction="attachment")

    assert_allclose(without.omega, with_it.omega, rtol=1e-9)
    assert_allclose(abs(without.port_shapes), abs(with_it.port_shapes), rtol=1e-6)


def test_shifted_modes_of_a_kept_body_are_solved_for_once(parts, tmp_path, monkeypatch):
    """Exact: without a factor, the same bits for the same shifts, and nothing for another one."""
    flexibility = Flexibility(parts[0], cache=ResultCache(tmp_path, 10**9))
    given = {"flexibility": flexibility, "correction": "attachment"}
    shifts = [shift_at(130e3), shift_at(-20e3)]
    once = reduce_with(parts, shifts=shifts, **given)
    monkeypatch.setattr(Flexibility, "factorised", None)
    monkeypatch.setattr(attachment, "factorized_symmetric", None)
    again = reduce_with(parts, shifts=shifts, **given)

    assert_array_equal(again.omega, once.omega)
    assert_array_equal(again.port_shapes, once.port_shapes)
    for other in (-21e3, 131e3):
        with pytest.raises(TypeError, match="not callable"):
            reduce_with(parts, shifts=[shift_at(other)], **given)


def test_ports_refuse_what_they_cannot_use():
    mesh = lattice_mesh("quad8", [np.array([0.0, 1.0])] * 2)
    for build in (
        lambda: surface_port(mesh, "top", "r", name="p"),
        lambda: surface_port(mesh, "top", "x", name="p"),
        lambda: surface_port(mesh, "lid", "z", name="p"),
        lambda: pressure_port(mesh, "outer", name="p"),
        lambda: node_observer(mesh, 99, "z", name="p"),
        lambda: Port("p", np.zeros(4)),
        lambda: Port("p", np.array([1.0, np.nan])),
    ):
        with pytest.raises(InputError, match="\nTry: "):
            build()


def test_unknown_port_lists_the_known_ones(reduced):
    with pytest.raises(InputError, match="bottom, top"):
        reduced.port_index("seat")


def test_inconsistent_body_is_refused(reduced):
    with pytest.raises(InputError, match="rigid"):
        ReducedBody(
            name="x",
            mass=1.0,
            omega=np.array([1.0, 0.0]),
            damping=np.zeros(2),
            port_names=("p",),
            port_shapes=np.ones((2, 1)),
            observer_names=(),
            observer_shapes=np.empty((2, 0)),
            static_compliance=np.ones((1, 1)),
            rigid_count=1,
            rigid_axial=np.ones(1),
            dof_count=2,
        )


def test_krylov_basis_that_is_too_small_names_the_key_of_a_case(parts):
    body, ports, _ = parts
    with pytest.raises(ConvergenceError, match=r"in a case: run\.transfer\.to"):
        full_order_receptance(body, ports, [1e3, 3e6], loss_factor=1e-3, max_vectors=8)


def test_comparison_finds_where_a_curve_leaves(parts):
    """The bare modes leave first, then those with residual, then those with attachment modes."""
    body, ports, _ = parts
    axis = np.geomspace(1e3, 5e5, 500)
    full = full_order_receptance(body, ports, axis, loss_factor=1e-2, checks=1)
    candidates = [
        reduced_receptance(
            reduce_with(parts, modes=ByCount(5), correction=correction),
            axis,
            with_residual=correction == "consistent",
            loss_factor=1e-2,
        )
        for correction in ("none", "consistent", "attachment")
    ]

    comparison = compare_receptances(
        full.receptance,
        candidates,
        "bottom",
        body="rod",
        loss_factor=1e-2,
        reference_note=full.note,
    )

    reach = comparison.valid_up_to
    assert reach[0] == axis[-1]
    assert reach[1] < reach[2] < reach[3]
    assert comparison.labels[1:] == (
        "5 modes",
        "5 modes + residual compliance",
        "5 modes + 2 attachment",
    )
    assert comparison.curves.shape == comparison.mean_deviations.shape == (4, 500)
    assert "direct solutions at 1 of them" in comparison.reference_note


def test_comparison_refuses_another_axis(parts):
    reduced = reduce_with(parts)
    curves = [
        reduced_receptance(reduced, axis, with_residual=False) for axis in ([1e3, 2e3], [1e3, 3e3])
    ]
    with pytest.raises(InputError, match="one axis"):
        compare_receptances(
            curves[0], curves[1:], "bottom", body="rod", loss_factor=1e-2, reference_note=""
        )


@pytest.mark.parametrize("installed", [True, False], ids=["as installed", "without PARDISO"])
def test_indefinite_solution_without_pardiso(installed, monkeypatch):
    """Truth: numpy's dense solver, for 60 rows with eigenvalues of both signs."""
    if not installed:
        monkeypatch.setattr(dynamic_stiffness, "available_backends", lambda: ("superlu",))
    rng = np.random.default_rng(7)
    A = rng.standard_normal((60, 60))
    A = A + A.T
    B = rng.standard_normal((60, 2))

    X = dynamic_stiffness.solve_symmetric(csr_array(A), B)

    assert_allclose(X, np.linalg.solve(A, B), rtol=1e-8, atol=1e-10)


def test_mean_deviation_weights_by_share_of_the_band():
    """A notch of -100 dB over 1/100 of a third octave counts 1 dB, and only within its window."""
    axis = 1e3 * 2 ** (np.arange(0, 901) / 300)  # 100 points per third octave
    level = np.zeros(901)
    level[449:452] = [0.0, -100.0, 0.0]

    mean = mean_level_deviation(axis, level)

    assert mean[450] == pytest.approx(1.0, rel=1e-9)
    assert mean[450 - 40] == pytest.approx(1.0, rel=1e-9)
    assert mean[450 - 52] == pytest.approx(0.0, abs=1e-12)
