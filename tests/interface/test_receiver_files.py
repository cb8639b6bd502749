"""Receivers from files: every format, what is checked in them, virtual points."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from klack.acoustics.coupled_signal import measured_signal
from klack.acoustics.coupling import couple
from klack.acoustics.interface import (
    InterfacePoint,
    SourceAtMounts,
    freedoms_of,
    laplace,
)
from klack.acoustics.receivers.measured import (
    VirtualPoint,
    heard_receiver,
    measured_receiver,
)
from klack.acoustics.receivers.modal import ModalReceiver, body_receiver
from klack.acoustics.receivers.opening import read_responses
from klack.acoustics.receivers.responses import FrequencyResponses, channel_of, gathered, response
from klack.acoustics.receivers.tables import read_isolator
from klack.bodies.reduction.damping import ModalDamping
from klack.bodies.reduction.from_modal_data import body_of_craig_bampton
from klack.errors import AccuracyWarning, InputError

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
F = np.linspace(50.0, 1000.0, 381)
S = laplace(F)
FREEDOMS = (*freedoms_of("front"), *freedoms_of("rear", ("x", "z")))
NODES = {"front": 101, "rear": 102}
POINTS = (
    InterfacePoint(name="front"),
    InterfacePoint(name="rear", position=np.array([0.1, 0.0, 0.0])),
)


@pytest.fixture(scope="module")
def model() -> tuple[np.ndarray, np.ndarray]:
    """Mobility (k, 8, 8) and pressure per force (k, 2, 8) of a body of 12 modes and two ears."""
    draw = np.random.default_rng(3)
    scale = np.array([20.0 if freedom.is_rotation else 1.0 for freedom in FREEDOMS])
    body = ModalReceiver(
        points=POINTS,
        freedoms=FREEDOMS,
        omega=np.concatenate([np.zeros(3), 2 * np.pi * np.linspace(120.0, 1500.0, 9)]),
        damping=np.full(12, 0.05),
        shapes=0.5 * draw.normal(size=(12, 8)) * scale,
        residual=1e-9 * np.diag(scale**2),
    )
    shapes = draw.normal(size=(2, 12))
    H = 1.0 / (body.omega**2 + 2 * body.damping * body.omega * S[:, None] + S[:, None] ** 2)
    ears = 1e3 * S[:, None, None] ** 2 * np.einsum("em,km,mn->ken", shapes, H, body.shapes)
    return body.at(S).mobility, ears


@pytest.fixture(scope="module")
def source() -> SourceAtMounts:
    """A free rigid block with a push, at the same freedoms."""
    draw = np.random.default_rng(4)
    scale = np.array([50.0 if freedom.is_rotation else 1.0 for freedom in FREEDOMS])
    R = draw.normal(size=(10, 8)) * scale
    Y = np.einsum("mp,mq->pq", R, R) / S[:, None, None]
    vf = np.einsum("mp,m->p", R, draw.normal(size=10)) / S[:, None]
    return SourceAtMounts(
        frequency=F,
        points=POINTS,
        freedoms=FREEDOMS,
        free_velocity=vf,
        blocked_force=np.linalg.solve(Y, vf[..., None])[..., 0],
        mobility=Y,
    )


class Known:
    """The exact receiver."""

    points, freedoms, ears = POINTS, FREEDOMS, ("left", "right")

    def __init__(self, model: tuple[np.ndarray, np.ndarray]) -> None:
        self.model = model

    def at(self, s: np.ndarray):
        from klack.acoustics.interface import ReceiverResponse

        return ReceiverResponse(mobility=self.model[0], transfers=self.model[1])


def write_uff(path: Path, model, *, binary: int = 0, units: int | None = None) -> None:
    """Accelerances in the units of the file; a rear sensor against x, a rear blow against z."""
    pyuff = pytest.importorskip("pyuff")
    file = pyuff.UFF(str(path))
    length, force = {None: (1.0, 1.0), 5: (1e-3, 1e-3), 9: (0.01, 10.0)}[units]
    if units is not None:
        file.write_sets(
            pyuff.prepare_164(
                units_code=units,
                units_description="units",
                temp_mode=1,
                length=1.0 / length,
                force=1.0 / force,
                temp=1.0,
                temp_offset=0.0,
            ),
            "add",
        )
    file.write_sets(
        pyuff.prepare_15(
            node_nums=[101, 102],
            def_cs=[0, 0],
            disp_cs=[0, 0],
            color=[1, 1],
            x=[0.0, 0.1 / length],
            y=[0.0, 0.0],
            z=[0.0, 0.0],
        ),
        "add",
    )
    sets = []
    for i, out in enumerate(FREEDOMS):
        for j, hit in enumerate(FREEDOMS):
            turned = (-1.0 if (i == 6) else 1.0) * (-1.0 if j == 7 else 1.0)
            unit = (1.0 if out.is_rotation else length) / (
                force * length if hit.is_rotation else force
            )
            values = turned * model[0][:, i, j] * S / unit
            direction = out.direction * (-1 if i == 6 else 1)
            blow = hit.direction * (-1 if j == 7 else 1)
            sets.append((NODES[out.point], direction, NODES[hit.point], blow, values, 12))
    for e in (0, 1):
        for j, hit in enumerate(FREEDOMS):
            unit = force / length**2 / (force * length if hit.is_rotation else force)
            sets.append(
                (9001 + e, 0, NODES[hit.point], hit.direction, model[1][:, e, j] / unit, 15)
            )
    for rsp, rsp_dir, ref, ref_dir, values, kind in sets:
        file.write_sets(
            pyuff.prepare_58(
                func_type=4,
                rsp_node=rsp,
                rsp_dir=rsp_dir,
                ref_node=ref,
                ref_dir=ref_dir,
                data=values,
                x=F,
                binary=binary,
                spec_data_type=0,
                ordinate_spec_data_type=kind,
                orddenom_spec_data_type=13,
                abscissa_spec_data_type=18,
                num_pts=F.size,
                abscissa_spacing=1,
                abscissa_min=F[0],
                abscissa_inc=2.5,
                ord_data_type=6,
                id1="FRF",
                rsp_ent_name="CAB",
                ref_ent_name="CAB",
            ),
            "add",
        )


def write_csv(path: Path, model) -> None:
    """Semicolons with decimal commas; mobilities, ears as magnitude and phase."""
    names, columns = ["frequency [Hz]"], [F]
    for i, out in enumerate(FREEDOMS):
        for j, hit in enumerate(FREEDOMS):
            unit = ("rad/s" if out.is_rotation else "mm/s") + (
                "/(N m)" if hit.is_rotation else "/N"
            )
            factor = 1.0 if out.is_rotation else 1e3
            names += [f"{out}/{hit} {part} [{unit}]" for part in ("re", "im")]
            columns += [factor * model[0][:, i, j].real, factor * model[0][:, i, j].imag]
    for e, ear in enumerate(("9001", "9002")):
        for j, hit in enumerate(FREEDOMS):
            names += [f"{ear}/{hit} mag [Pa/N]", f"{ear}/{hit} phase [deg]"]
            columns += [np.abs(model[1][:, e, j]), np.rad2deg(np.angle(model[1][:, e, j]))]
    rows = [";".join(f"{x:.15e}" for x in row).replace(".", ",") for row in np.array(columns).T]
    path.write_text("\n".join([";".join(names), *rows]))


def array_content(model, *, split: bool) -> dict:
    """Arrays and names; real and imaginary parts apart where complex numbers cannot be stored."""
    names = [str(freedom) for freedom in FREEDOMS]
    held = {"frequency": F, "outputs": names, "inputs": names, "ears": ["9001", "9002"]}
    for key, values in (("receptance", model[0] / S[:, None, None]), ("pressure", model[1])):
        if split:
            held |= {f"{key}_real": values.real, f"{key}_imag": values.imag}
        else:
            held[key] = values
    return held


def write_mat(path: Path, model) -> None:
    """MATLAB 5 with cells of names."""
    from scipy.io import savemat

    held = array_content(model, split=False)
    savemat(
        path, {k: np.array(v, dtype=object) if isinstance(v, list) else v for k, v in held.items()}
    )


def write_npz(path: Path, model) -> None:
    """NumPy."""
    np.savez(path, **array_content(model, split=False))


def write_h5(path: Path, model) -> None:
    """HDF5, which stores complex numbers as pairs."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for key, value in array_content(model, split=False).items():
            file[key] = value


def write_nc(path: Path, model) -> None:
    """Netcdf of xarray, real and imaginary parts apart."""
    xarray = pytest.importorskip("xarray")
    held = array_content(model, split=True)
    sizes = {"frequency": F.size, "outputs": 8, "inputs": 8, "ears": 2}
    variables = {
        key: (("frequency", "ears" if key[0] == "p" else "outputs", "inputs"), value)
        for key, value in held.items()
        if key not in sizes
    }
    dataset = xarray.Dataset(variables, coords={key: held[key] for key in sizes})
    dataset.to_netcdf(path, engine="h5netcdf")


WRITERS: dict[str, Callable] = {
    "text.uff": write_uff,
    "binary.uff": lambda path, model: write_uff(path, model, binary=1),
    "millimetres.unv": lambda path, model: write_uff(path, model, units=5),
    "own_units.unv": lambda path, model: write_uff(path, model, units=9),
    "table.csv": write_csv,
    "arrays.mat": write_mat,
    "arrays.npz": write_npz,
    "arrays.h5": write_h5,
    "arrays.nc": write_nc,
}


SLOW = ("table.csv", "arrays.nc")


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] if n in SLOW else []) for n in WRITERS]
)
def test_a_receiver_that_was_written_couples_as_the_model(name, tmp_path, model, source) -> None:
    """Six freedoms and two, signed directions, rotations, ears: forces and pressures agree."""
    WRITERS[name](tmp_path / name, model)
    points = (
        {"front": "101", "rear": 102}
        if "u" in Path(name).suffix
        else {"front": "front", "rear": "rear"}
    )
    receiver = measured_receiver(
        read_responses(tmp_path / name), points, ears={"left": "9001", "right": 9002}
    )
    assert [str(freedom) for freedom in receiver.freedoms] == [str(freedom) for freedom in FREEDOMS]
    digits = 1e-9 if name != "text.uff" else 1e-8  # twelve decimals, and the coupling
    expected, found = couple(source, Known(model)), couple(source, receiver)
    for what in ("force", "velocity", "pressure"):
        known = getattr(expected, what)
        assert np.abs(getattr(found, what) / known - 1.0).max() < digits
    assert found.ears == ("left", "right")


def responses(model, *, change: Callable | None = None) -> FrequencyResponses:
    """As read, after a change of the matrix of mobilities."""
    Y = model[0].copy()
    if change is not None:
        Y = change(Y)
    found = [
        response(
            "machine",
            (channel_of(str(out)), channel_of(str(hit))),
            "velocity",
            F,
            Y[:, i, j],
        )
        for i, out in enumerate(FREEDOMS)
        for j, hit in enumerate(FREEDOMS)
        if not np.any(np.isnan(Y[:, i, j]))
    ]
    found += [
        response("machine", (channel_of("ear"), channel_of(str(hit))), "pressure", F, H)
        for hit, H in zip(FREEDOMS, model[1][:, 0].T, strict=True)
    ]
    return gathered("machine", found)


BOTH = {"front": "front", "rear": "rear"}


def test_one_of_two_reciprocal_responses_stands_for_both(model, source) -> None:
    """The upper triangle alone; what was taken is told."""

    def lower_lost(Y: np.ndarray) -> np.ndarray:
        Y[:, *np.tril_indices(8, -1)] = np.nan
        return Y

    receiver = measured_receiver(responses(model, change=lower_lost), BOTH)
    assert receiver.mobility == pytest.approx(model[0], rel=1e-12, abs=0.0)
    assert "reciprocal" in receiver.notes[0]


def test_missing_transfers_are_listed(model) -> None:
    """Only the driving points of both mounts."""

    def apart(Y: np.ndarray) -> np.ndarray:
        Y[:, :6, 6:], Y[:, 6:, :6] = np.nan, np.nan
        return Y

    with pytest.raises(InputError, match=r"rear\.x / front\.x"):
        measured_receiver(responses(model, change=apart), BOTH)


WRONG = {
    "an accelerance": lambda Y: Y * S[:, None, None],
    "a receptance": lambda Y: Y / S[:, None, None],
    "reversed sign": lambda Y: -Y,
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_read_as_a_mobility_and_is_none(name, model) -> None:
    """Every driving point tells it by the sign of its real part."""
    with pytest.raises(InputError, match=name):
        measured_receiver(responses(model, change=WRONG[name]), BOTH)


def test_one_direction_reversed_in_the_sensors_alone(model) -> None:
    """The opposite of its reciprocal; the driving point shows it as well."""

    def turned(Y: np.ndarray) -> np.ndarray:
        Y[:, 2, :2], Y[:, 2, 3:] = -Y[:, 2, :2], -Y[:, 2, 3:]
        return Y

    with pytest.raises(InputError, match="opposite"):
        measured_receiver(responses(model, change=turned), BOTH)


@pytest.mark.filterwarnings("ignore:.*too far apart", "ignore:.*reciprocity")
def test_doubts_are_told(model) -> None:
    """Reciprocity 20 %, mobilities of mm, real parts below 0 at some lines."""

    def scaled(Y: np.ndarray) -> np.ndarray:
        Y[:, 0, 7] *= 1.25
        return Y

    with pytest.warns(AccuracyWarning, match="22 % \\(reciprocity\\)"):
        measured_receiver(responses(model, change=scaled), BOTH)
    with pytest.warns(AccuracyWarning, match="mm instead of m"):
        measured_receiver(responses(model, change=lambda Y: 1e5 * Y), BOTH)

    def noisy(Y: np.ndarray) -> np.ndarray:
        Y[::10, 0, 0] = -Y[::10, 0, 0].conj()
        return Y

    with pytest.warns(AccuracyWarning, match="real part of front"):
        measured_receiver(responses(model, change=noisy), BOTH)


def test_an_accelerance_that_is_nearly_a_mass_is_doubted() -> None:
    """One weak resonance in the band: below a fifth of the lines tell it."""
    Y = 1.0 / (2.0 * S) + S / (2.0 * (S**2 + 60.0 * S + 3000.0**2))
    pair = channel_of("a.z"), channel_of("a.z")
    for factor, match in ((S, "or an accelerance read as"), (1.0, None)):
        found = gathered("file", [response("file", pair, "velocity", F, Y * factor)])
        if match is None:
            measured_receiver(found, {"a": "a"})
        else:
            with pytest.warns(AccuracyWarning, match=match):
                measured_receiver(found, {"a": "a"})


def test_coarse_lines_are_told(model) -> None:
    """Resonances of 5 Hz half width with lines 50 Hz apart."""
    found = responses(model)
    coarse = FrequencyResponses(
        name="coarse",
        frequency=found.frequency[::20],
        outputs=found.outputs,
        sources=found.sources,
        values=found.values[::20],
    )
    with pytest.warns(AccuracyWarning, match="too far apart"):
        measured_receiver(coarse, BOTH)


def test_nothing_is_extrapolated(model, source) -> None:
    """Outside the lines: an error that states the measured range."""
    receiver = measured_receiver(responses(model), BOTH, ears={"left": "ear"})
    with pytest.raises(InputError, match="extrapolated"):
        receiver.at(laplace(np.array([20.0])))
    with pytest.raises(InputError, match="model"):
        receiver.at(laplace(F, 10.0))
    between = receiver.at(laplace(np.array([51.25])))
    assert between.mobility[0] == pytest.approx(0.5 * (model[0][0] + model[0][1]), rel=1e-12)
    with pytest.raises(InputError, match="evenly spaced"):
        measured_signal(lambda f, shift: source, lambda s: couple(s, receiver), F**1.1, step=1e-4)


def test_points_and_ears_that_are_not_there(model) -> None:
    """The names that are."""
    found = responses(model)
    with pytest.raises(InputError, match="one of: front, rear"):
        measured_receiver(found, {"front": "middle"})
    with pytest.raises(InputError, match="one of: ear"):
        measured_receiver(found, BOTH, ears={"left": "nose"})


def test_pressures_of_another_file_on_other_lines(model) -> None:
    """Taken on the lines of the mobilities, in the range of both."""
    found = responses(model)
    other = F[10::2]
    pressures = gathered(
        "room",
        [
            response("room", (channel_of("ear"), channel_of(str(hit))), "pressure", other, H)
            for hit, H in zip(FREEDOMS, model[1][10::2, 0].T, strict=True)
        ],
    )
    receiver = measured_receiver(found, BOTH, ears={"left": "ear"}, pressures=pressures)
    assert receiver.frequency[0] == other[0]
    assert receiver.transfers[::2, 0] == pytest.approx(model[1][10::2, 0], rel=1e-12, abs=0.0)
    assert "room" in receiver.notes[-1]


def test_a_model_gets_ears_from_a_file(model, source) -> None:
    """Force and pressure as of the receiver whose ears it has; moments without a blow are told."""
    found = responses(model)
    alone = measured_receiver(found, BOTH)
    with_ears = heard_receiver(alone, found, {"driver": "ear"})
    expected = couple(source, measured_receiver(found, BOTH, ears={"driver": "ear"}))
    heard = couple(source, with_ears)
    assert heard.force == pytest.approx(expected.force, rel=1e-12, abs=0.0)
    assert heard.pressure == pytest.approx(expected.pressure, rel=1e-12, abs=0.0)
    assert heard.ears == ("driver",)
    with pytest.raises(InputError, match="no pressure per force at front"):
        heard_receiver(alone, found, {"driver": "ear"}, nodes={"front": "elsewhere"})


def test_responses_on_different_lines_are_brought_together() -> None:
    """Linear functions of frequency stay what they are; without a common range it is an error."""
    pair = channel_of("a.z"), channel_of("a.z")
    fine, coarse = np.linspace(10.0, 100.0, 91), np.linspace(20.0, 120.0, 11)
    found = gathered(
        "file",
        [
            response("file", pair, "velocity", fine, (2.0 + 1j) * fine),
            response("file", (channel_of("b.z"), pair[1]), "velocity", coarse, 3.0 * coarse),
        ],
    )
    assert found.frequency.tolist() == coarse[:9].tolist()
    assert found.values[:, 0, 0] == pytest.approx((2.0 + 1j) * coarse[:9], rel=1e-12)
    assert "coarsest" in found.notes[0]
    with pytest.raises(InputError, match="common frequency range"):
        gathered(
            "file",
            [
                response("file", pair, "velocity", fine, fine + 0j),
                response("file", (channel_of("b.z"), pair[1]), "velocity", 1e3 * fine, fine + 0j),
            ],
        )
    with pytest.raises(InputError, match="two responses"):
        gathered("file", 2 * [response("file", pair, "velocity", fine, fine + 0j)])


# --------------------------------------------------------------------------- virtual points

CORNERS = {
    "1": np.array([0.02, 0.01, 0.0]),
    "2": np.array([-0.02, 0.015, 0.0]),
    "3": np.array([0.0, -0.02, 0.005]),
}
CENTRE = np.array([0.003, 0.002, 0.001])


def face(model, *, flip: str = "", freedoms: int = 3, nodes: dict | None = None):
    """Nine sensors and blows on a rigid face that moves with the six freedoms of ``front``."""
    rows, names = [], []
    for node, place in (nodes or CORNERS).items():
        for axis in range(freedoms):
            e = np.eye(3)[axis]
            rows.append(np.concatenate([e, np.cross(place - CENTRE, e)]))
            names.append(f"{node}.{'xyz'[axis]}")
    R = np.array(rows)
    R_u = R * np.where(np.array(names) == flip, -1.0, 1.0)[:, None]
    Y = R_u @ model[0][:, :6, :6] @ R.T
    found = [
        response("face", (channel_of(out), channel_of(hit)), "velocity", F, Y[:, i, j])
        for i, out in enumerate(names)
        for j, hit in enumerate(names)
    ]
    found += [
        response("face", (channel_of("ear"), channel_of(hit)), "pressure", F, H)
        for hit, H in zip(names, (model[1][:, 0, :6] @ R.T).T, strict=True)
    ]
    return gathered("face", found, nodes or CORNERS)


def test_a_virtual_point_of_a_rigid_face_is_exact(model) -> None:
    """Mobility and ear of the centre; every channel is consistent."""
    receiver = measured_receiver(
        face(model), {"front": VirtualPoint(position=CENTRE, nodes=[1, 2, 3])}, ears={"left": "ear"}
    )
    assert receiver.mobility == pytest.approx(model[0][:, :6, :6], rel=1e-9, abs=0.0)
    assert receiver.transfers[:, 0] == pytest.approx(model[1][:, 0, :6], rel=1e-9, abs=0.0)
    assert len(receiver.consistency) == 9
    assert min(receiver.consistency.values()) > 1.0 - 1e-12


def test_a_virtual_point_of_a_small_foot(model) -> None:
    """Rotations are scaled by the distance of the channels: 0.2 mm are as good as 20 mm."""
    near = {node: CENTRE + 0.01 * (place - CENTRE) for node, place in CORNERS.items()}
    point = VirtualPoint(position=CENTRE, nodes=["1", "2", "3"])
    found = measured_receiver(face(model, nodes=near), {"front": point}).mobility
    assert found == pytest.approx(model[0][:, :6, :6], rel=1e-7, abs=0.0)


def test_a_virtual_point_with_a_reversed_freedom(model) -> None:
    """Reversed as asked."""
    names = ("x", "y", "-z", "rx", "ry", "rz")
    point = VirtualPoint(position=CENTRE, nodes=["1", "2", "3"], freedoms=names)
    found = measured_receiver(face(model), {"front": point}).mobility
    sign = np.array([1, 1, -1, 1, 1, 1])
    assert found == pytest.approx(model[0][:, :6, :6] * sign * sign[:, None], rel=1e-9, abs=0.0)


@pytest.mark.filterwarnings("ignore:.*reciprocity")
def test_a_channel_with_a_wrong_sign_is_named(model) -> None:
    """Its consistency is the lowest."""
    with pytest.warns(AccuracyWarning, match=r"channel 2\.x"):
        measured_receiver(
            face(model, flip="2.x"), {"front": VirtualPoint(position=CENTRE, nodes=[1, 2, 3])}
        )


def test_channels_that_do_not_tell_a_rotation(model) -> None:
    """Three nodes in one line: no rotation about it.  Two directions: not all six."""
    line = {str(i): CENTRE + np.array([0.01 * i, 0.0, 0.0]) for i in (1, 2, 3)}
    with pytest.raises(InputError, match=r"front\.rx") as error:
        measured_receiver(
            face(model, nodes=line), {"front": VirtualPoint(position=CENTRE, nodes=["1", "2", "3"])}
        )
    assert "rank 6" in str(error.value)
    with pytest.raises(InputError, match="no position of node 7"):
        measured_receiver(face(model), {"front": VirtualPoint(position=CENTRE, nodes=[1, 7])})


# --------------------------------------------------------------------------- bodies, elements


def test_a_body_of_craig_bampton_matrices_as_a_receiver() -> None:
    """Two masses and a spring to the ground: its mobility by the dynamic stiffness."""
    K = np.array([[3e5, -2e5], [-2e5, 2e5]])
    M = np.diag([0.3, 0.1])
    body = body_of_craig_bampton(
        "cab",
        K,
        M,
        port_names=("a", "b"),
        rows=(0, 1),
        damping=ModalDamping(ratio=0.0),
        where="test",
    )
    points = (InterfacePoint(name="p"), InterfacePoint(name="q"))
    receiver = body_receiver(
        body, {"a": freedoms_of("p", ("z",))[0], "b": freedoms_of("q", ("-z",))[0]}, points
    )
    assert [str(freedom) for freedom in receiver.freedoms] == ["p.z", "q.-z"]
    s = laplace(np.array([30.0, 170.0, 2e3]), 50.0)
    exact = s[:, None, None] * np.linalg.inv(M * s[:, None, None] ** 2 + K)
    assert receiver.at(s).mobility == pytest.approx(exact, rel=1e-9, abs=0.0)
    with pytest.raises(InputError, match="one of: p"):
        body_receiver(body, {"a": freedoms_of("r", ("z",))[0]}, points[:1])


ELEMENT = """# clip
frequency [Hz], k21.z re [N/um], k21.z im [N/um], k11.z re [N/um], k11.z im [N/um], \
k22.z re [N/um], k22.z im [N/um], k21.rx re [N m/rad], k21.rx im [N m/rad]
10, -4, -0.4, 4, 0.4, 4, 0.4, 30, 3
1000, -5, -0.6, 3, 0.5, 3, 0.5, 31, 3
"""


def test_an_element_from_a_table(tmp_path) -> None:
    """Units, and the sign that k21 has in the standard or in a matrix."""
    file = tmp_path / "clip.csv"
    file.write_text(ELEMENT)
    element = read_isolator(file)
    assert element.directions == (3, 4)
    k = element.stiffness(3, laplace(np.array([10.0])))
    assert (k.transfer[0], k.driving[0]) == (4e6 + 4e5j, 4e6 + 4e5j)
    assert element.stiffness(4, laplace(np.array([10.0]))).transfer[0] == 30 + 3j


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("-0.4, 4", "0.4, 4", "loses energy"),
        ("k22.z re", "k33.z re", "column 'k33.z re"),
        ("k22.z im", "k22.z mag", "re and im"),
        ("k11.z", "k21.y", "only k21"),
        ("[N m/rad]", "[N/m]", "rotations"),
        ("1000, -5", "1000, x", "line 4"),
        ("1000, -5, ", "1000, ", "line 4 of 8 columns"),
        ("1000", "5", "do not rise"),
    ],
)
def test_tables_of_elements_that_cannot_be_used(old, new, says, tmp_path) -> None:
    """One clear error each."""
    file = tmp_path / "clip.csv"
    file.write_text(ELEMENT.replace(old, new))
    with pytest.raises(InputError, match=says):
        read_isolator(file)


# --------------------------------------------------------------------------- bad files


def damaged(data: bytes, draw: np.random.Generator) -> bytes:
    """Truncated, bytes changed, or a piece missing."""
    kind, at = draw.integers(3), int(draw.integers(1, len(data) - 300))
    if kind == 0:
        return data[:at]
    if kind == 1:
        return data[:at] + data[at + int(draw.integers(1, 200)) :]
    changed = bytearray(data)
    for place in draw.integers(0, len(data), 8):
        changed[place] = int(draw.integers(256))
    return bytes(changed)


@pytest.mark.parametrize("name", ["bracket.csv", "bracket.uff", "bracket.npz", "bracket.mat"])
@pytest.mark.filterwarnings("ignore::klack.errors.AccuracyWarning")
def test_damaged_files_are_read_or_refused(name: str, tmp_path: Path) -> None:
    """Thirty of each: values within the file, or one error of klack."""
    whole = read_responses(HOW_TO / "bracket.csv")
    file = tmp_path / name
    if name.endswith(".csv"):
        file.write_bytes((HOW_TO / "bracket.csv").read_bytes())
    elif name.endswith(".uff"):
        pyuff = pytest.importorskip("pyuff")
        for node, values in ((1, whole.values[:, 0, 0]), (2, whole.values[:, 1, 0])):
            pyuff.UFF(str(file)).write_sets(
                pyuff.prepare_58(
                    **{"func_type": 4, "rsp_node": node, "rsp_dir": 3, "ref_node": 1},
                    **{"ref_dir": 3, "data": values, "x": whole.frequency, "binary": node - 1},
                    **{"ordinate_spec_data_type": 11, "orddenom_spec_data_type": 13},
                    **{"abscissa_spec_data_type": 18, "num_pts": whole.frequency.size},
                    **{"abscissa_spacing": 1, "abscissa_min": 100.0, "abscissa_inc": 10.0},
                    **{"ord_data_type": 6, "id1": "FRF"},
                ),
                "add",
            )
    else:
        from scipy.io import savemat

        names = [str(channel) for channel in whole.sources]
        held = {"frequency": whole.frequency, "mobility": whole.values[:, :2], "outputs": names}
        held["inputs"] = names
        savemat(file, held) if name.endswith(".mat") else np.savez(file, **held)
    data, draw = file.read_bytes(), np.random.default_rng(7)
    refused = 0
    for _ in range(30):
        file.write_bytes(damaged(data, draw))
        try:
            assert np.all(np.isfinite(read_responses(file).frequency))
        except InputError:
            refused += 1
    assert refused > 5


def test_kilohertz_and_phases_in_radians(tmp_path: Path) -> None:
    """By the head of the table."""
    file = tmp_path / "a.txt"
    file.write_text("Freq. [kHz]\ta.z/a.z mag [mm/s/N]\ta.z/a.z phase [rad]\n1\t2\t0\n2\t2\t1\n")
    found = read_responses(file)
    assert found.frequency.tolist() == [1e3, 2e3]
    assert found.values[:, 0, 0] == pytest.approx(2e-3 * np.exp([0.0, 1j]), rel=1e-12)


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.csv", "f [Hz], a.z/a.z re, a.z/a.z im\n1,1,1\n2,1,1", "no unit"),
        ("a.csv", "f [Hz], a.z/a.z re [V/N], a.z/a.z im [V/N]\n1,1,1\n2,1,1", "'V/N'"),
        (
            "a.csv",
            "f [Hz], a.z/a re [m/s/N], a.z/a im [m/s/N]\n1,1,1\n2,1,1",
            "without a direction",
        ),
        ("a.csv", "f [Hz], a/a.z re [m/s/N], a/a.z im [m/s/N]\n1,1,1\n2,1,1", "a velocity at 'a'"),
        ("a.csv", "f [Hz], a.z/a.z mag [m/s/N], x [1]\n1,1,1\n2,1,1", "column 'x"),
        ("a.csv", "nothing", "no line of column names"),
        ("a.uff", "nothing", "no frequency response"),
        ("a.h5", "nothing", "HDF5"),
        ("a.mat", "nothing", "MATLAB"),
        ("a.npz", "nothing", "NumPy"),
    ],
)
def test_files_that_are_no_responses(name, text, says, tmp_path) -> None:
    """One clear error each."""
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=says):
        read_responses(tmp_path / name)


def test_a_universal_file_that_does_not_say_what_it_holds(tmp_path) -> None:
    """Quantity 0 needs the caller; a unit on the axis counts before set 164."""
    pyuff = pytest.importorskip("pyuff")

    def write(name: str, kind: int, unit: str) -> Path:
        path = tmp_path / name
        data = pyuff.prepare_58(
            func_type=4,
            rsp_node=1,
            rsp_dir=3,
            ref_node=1,
            ref_dir=-3,
            data=-(1.0 + 0.1j) * F,
            x=F,
            binary=0,
            ordinate_spec_data_type=kind,
            ordinate_axis_units_lab=unit,
            orddenom_spec_data_type=13,
            abscissa_spec_data_type=18,
            num_pts=F.size,
            abscissa_spacing=0,
            abscissa_min=F[0],
            abscissa_inc=0.0,
            ord_data_type=6,
            id1="FRF",
        )
        pyuff.UFF(str(path)).write_sets(data, "add")
        return path

    with pytest.raises(InputError, match="quantity 0"):
        read_responses(write("a.uff", 0, "NONE"))
    found = read_responses(tmp_path / "a.uff", quantity="velocity")
    assert found.values[:, 0, 0] == pytest.approx((1.0 + 0.1j) * F, rel=1e-5)
    found = read_responses(write("b.uff", 12, "g"))
    assert found.values[:, 0, 0] == pytest.approx((1.0 + 0.1j) * 9.80665 * F / S, rel=1e-5)
    with pytest.warns(AccuracyWarning, match="the unit 'V'"):
        found = read_responses(write("c.uff", 11, "V"))
    assert found.values[:, 0, 0] == pytest.approx((1.0 + 0.1j) * F, rel=1e-5)
