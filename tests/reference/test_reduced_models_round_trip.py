"""A body reduced by klack leaves as files of other programs, comes back, and is the same.

Truth: the needle of a shipped valve as klack has it, its transfer function by python-control, and
the impact of the bodies that never left.
"""

import io
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from scipy.sparse import coo_array

from klack.analyses.impact.run import run_impact
from klack.assembling.given_bodies import reduced_from_file
from klack.bodies.elasticity.body import elastic_body
from klack.bodies.reduction.damping import ModalDamping
from klack.bodies.reduction.ports import surface_port
from klack.bodies.reduction.reduce import reduce_body
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.bodies.reduction.selection import ByCount
from klack.case import load_case
from klack.case.schema import Case
from klack.contact.laws import LinearLaw
from klack.errors import AccuracyWarning, InputError
from klack.input.unit_systems import unit_system
from klack.materials.material import Material
from klack.mesh.meridian import mesh_meridian
from klack.mesh.profile import Line, Profile
from klack.mesh.sizing import MeshSizing
from klack.simulation.bodies import rod_body
from klack.simulation.impact import simulate_impact
from klack.simulation.system import ContactPair, ReducedSystem

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
SEAT = rod_body(
    "seat", length=0.02, area=3e-5, young=2.1e11, density=7850.0, elastic_modes=12, support="bottom"
)


@pytest.fixture(scope="module")
def needle() -> ReducedBody:
    """Shank with a collar, ports at both ends, 15 modes and what they miss."""
    corners = [(2, 0), (2, 9), (4, 9), (4, 12), (0, 12)]
    names = ["tip", "side", "collar", "rim", "top"]
    edges = [Line((1e-3 * r, 1e-3 * z), n) for (r, z), n in zip(corners, names, strict=True)]
    profile = Profile((0.0, 0.0), (*edges, Line((0.0, 0.0), "axis")))
    mesh = mesh_meridian({"needle": profile}, MeshSizing(size=5e-4, refinements=(), grading=0.3))
    return reduce_body(
        elastic_body("needle", mesh, {"needle": STEEL}),
        [surface_port(mesh, name, "z", name=name) for name in ("tip", "top")],
        modes=ByCount(15),
        correction="consistent",
        damping=ModalDamping(ratio=0.0005),
    )


def case_text(reduced: str, tip: str = "tip", top: str = "top") -> str:
    return f"""
klack: 1
title: Needle of another program
bodies:
  needle:
    reduced:
      {reduced}
      ports: {{tip: {{input: {tip}}}, top: {{input: {top}}}}}
  seat:
    reduced: {{kind: klack, file: seat.npz, units: m kg s, ports: {{face: {{input: top}}}}}}
contact:
  between: [needle.tip, seat.face]
  gap: 0.5 um
  local_law: {{kind: linear, stiffness: 5e8 N/m}}
motion: {{speed: 0.3 m/s}}
run: {{levels: [reduced], duration: 30 us, reduced_step: 10 ns}}
"""


def case_of(folder: Path, text: str) -> Case:
    SEAT.save(folder / "seat.npz")
    (folder / "case.yaml").write_text(text)
    return load_case(folder / "case.yaml")


def written(folder: Path, form: str, needle: ReducedBody) -> str:
    """Write the needle in mm, t, s; return its lines of the case."""
    unit = unit_system("mm t s")
    model = needle.state_space(with_residual=True)
    arrays = {
        "A": model.A,
        "B": model.B,
        "C": model.C / unit.length,
        "D": model.feedthrough / unit.length,
    }
    if form == "mat":
        names = np.array(model.input_names, dtype=object)
        scipy.io.savemat(
            folder / "n.mat", {"needle": {**arrays, "InputName": names, "OutputName": names}}
        )
    elif form == "csv":
        lines = ["inputs,tip,top", "outputs,tip,top"]
        for name, matrix in arrays.items():
            lines += [name, *(",".join(f"{v:.17g}" for v in row) for row in matrix)]
        (folder / "n.csv").write_text("\n".join(lines) + "\n")
    elif form == "spm":
        text = "Input labels: tip top\nOutput labels: tip top\n"
        for name, matrix in arrays.items():
            stream = io.BytesIO()
            scipy.io.mmwrite(stream, coo_array(matrix), precision=17)
            text += f"% Matrix {name}\n{stream.getvalue().decode()}"
        (folder / "n.spm").write_text(text)
    return f"kind: state-space\n      file: n.{form}\n      units: mm t s"


def own_impact(needle: ReducedBody, residual: float) -> np.ndarray:
    contact = ContactPair(
        body_a="needle",
        port_a="tip",
        body_b="seat",
        port_b="top",
        law=LinearLaw(5e8),
        gap=0.5e-6,
        series_compliance=residual + float(SEAT.residual_compliance[1, 1]),
    )
    system = ReducedSystem(bodies=(needle, SEAT), contacts=(contact,))
    return simulate_impact(system, speed=0.3, duration=30e-6, step=10e-9).force


@pytest.mark.parametrize("form", ["mat", "csv", "spm"])
def test_state_space_and_back(tmp_path, needle, form):
    case = case_of(tmp_path, case_text(written(tmp_path, form, needle)))
    back = reduced_from_file(case, "needle")
    assert back.port_names == ("tip", "top")
    assert back.omega == pytest.approx(needle.omega, rel=1e-8)
    assert back.damping == pytest.approx(needle.damping, rel=1e-8, abs=1e-12)
    largest = np.abs(needle.port_shapes).max()
    for mine, given in zip(back.port_shapes, needle.port_shapes, strict=True):
        assert np.sign(mine @ given) * mine == pytest.approx(given, abs=1e-8 * largest)
    assert back.static_compliance == pytest.approx(needle.static_compliance, rel=1e-8)
    assert back.mass == pytest.approx(needle.mass, rel=1e-9)
    force = own_impact(needle, float(needle.residual_compliance[0, 0]))
    study = run_impact(case, levels=["reduced"])
    assert force.max() > 100.0
    assert np.abs(study.levels["reduced"].history.force - force).max() < 1e-6 * force.max()
    assert abs(study.levels["reduced"].energy_residual) < 1e-10


def test_python_control_sees_the_same_body(tmp_path, needle):
    control = pytest.importorskip("control")
    model = needle.state_space(with_residual=True)
    system = control.ss(model.A, model.B, model.C, model.feedthrough)
    case = case_of(tmp_path, case_text(written(tmp_path, "mat", needle)))
    back = reduced_from_file(case, "needle").state_space(with_residual=True)
    ours = control.ss(back.A, back.B, back.C, back.feedthrough)
    for frequency in np.geomspace(1e3, 2e6, 12):
        s = 2j * np.pi * frequency
        assert ours(s) == pytest.approx(system(s), rel=1e-7)


def test_another_realisation_of_python_control_is_the_same_body(tmp_path, needle):
    """Balanced states of the elastic part, joined with the rigid one in other states."""
    control = pytest.importorskip("control")
    model = needle.state_space(with_residual=True)
    T = np.diag(np.concatenate([np.full(needle.mode_count, 1e6), np.ones(needle.mode_count)]))
    T = np.linalg.qr(np.random.default_rng(5).normal(size=T.shape))[0] @ T
    moved = control.similarity_transform(
        control.ss(model.A, model.B, model.C, model.feedthrough), T
    )
    arrays = {"A": moved.A, "B": moved.B, "C": moved.C, "D": moved.D}
    scipy.io.savemat(tmp_path / "n.mat", arrays)
    text = case_text("kind: state-space\n      file: n.mat\n      units: m kg s", "1", "2")
    back = reduced_from_file(case_of(tmp_path, text), "needle")
    assert back.omega == pytest.approx(needle.omega, rel=1e-8)
    assert back.mass == pytest.approx(needle.mass, rel=1e-6)


def write_modes(path: Path, needle: ReducedBody) -> object:
    """Three nodes at the tip, whose mean is the port, one at the top; modal masses of 2 kg."""
    pyuff = pytest.importorskip("pyuff")
    file = pyuff.UFF(str(path))
    for i in range(needle.mode_count):
        tip, top = np.sqrt(2.0) * needle.port_shapes[i]
        file.write_sets(
            pyuff.prepare_55(
                model_type=1,
                id1="needle",
                id2="NONE",
                id3="NONE",
                id4="NONE",
                id5="NONE",
                analysis_type=2,
                data_ch=2,
                spec_data_type=8,
                data_type=2,
                load_case=1,
                mode_n=i + 1,
                freq=float(needle.frequencies[i]),
                modal_m=2.0,
                modal_damp_vis=float(needle.damping[i]),
                modal_damp_his=0.0,
                node_nums=np.array([11, 12, 13, 20]),
                r1=np.zeros(4),
                r2=np.zeros(4),
                r3=np.array([0.9 * tip, tip, 1.1 * tip, top]),
            ),
            "add",
        )
    return file


def receptance(body: ReducedBody, frequency: np.ndarray, a: int, b: int) -> np.ndarray:
    w = 2 * np.pi * frequency[:, None]
    own = body.omega**2 - w**2 + 2j * body.damping * body.omega * w
    modal = np.sum(body.port_shapes[:, a] * body.port_shapes[:, b] / own, axis=1)
    return modal + body.residual_compliance[a, b]


def write_response(file: object, nodes: tuple[int, int], x: np.ndarray, H: np.ndarray, kind: int):
    """Dataset 58 of a displacement (8) or an acceleration (12) over a force."""
    file.write_sets(
        pytest.importorskip("pyuff").prepare_58(
            binary=0,
            func_type=4,
            rsp_node=nodes[0],
            rsp_dir=3,
            ref_node=nodes[1],
            ref_dir=-3,  # pushed the other way
            data=-H,
            x=x,
            id1="response",
            rsp_ent_name="needle",
            ref_ent_name="needle",
            abscissa_spacing=1,
            abscissa_spec_data_type=18,
            ordinate_spec_data_type=kind,
            orddenom_spec_data_type=13,
        ),
        "add",
    )


def test_modal_analysis_in_a_universal_file(tmp_path, needle):
    """Five decimals in frequencies and shapes: the force within 1e-4 of its peak."""
    write_modes(tmp_path / "n.uff", needle)
    text = case_text("kind: modal\n      file: n.uff\n      units: m kg s", "11 12 13 z", "20")
    case = case_of(tmp_path, text)
    back = reduced_from_file(case, "needle")
    assert back.omega == pytest.approx(needle.omega, rel=1e-5)
    assert np.abs(back.port_shapes) == pytest.approx(np.abs(needle.port_shapes), rel=1e-4, abs=1e-3)
    force = own_impact(needle, 0.0)
    study = run_impact(case, levels=["reduced"])
    assert np.abs(study.levels["reduced"].history.force - force).max() < 1e-4 * force.max()
    assert any("no residual compliance" in note for note in study.warnings)


@pytest.mark.parametrize("kind", [8, 12])
def test_responses_of_a_universal_file_give_what_the_modes_miss(tmp_path, needle, kind):
    """Receptances or accelerances between the ports: the residual compliance within 1 %."""
    file = write_modes(tmp_path / "n.uff", needle)
    x = np.linspace(1e3, 1e6, 400)
    for nodes, (a, b) in (((12, 12), (0, 0)), ((20, 12), (1, 0)), ((20, 20), (1, 1))):
        H = receptance(needle, x, a, b) * (2j * np.pi * x) ** (2 if kind == 12 else 0)
        write_response(file, nodes, x, H, kind)
    text = case_text("kind: modal\n      file: n.uff\n      units: m kg s", "12 z", "20 z")
    back = reduced_from_file(case_of(tmp_path, text), "needle")
    assert np.diag(back.residual_compliance) == pytest.approx(
        np.diag(needle.residual_compliance), rel=0.01
    )
    text = case_text("kind: modal\n      file: n.uff\n      units: m kg s", "11 12 13", "20")
    case = case_of(tmp_path, text)
    with pytest.warns(AccuracyWarning, match="no response of '11 z'"):
        reduced_from_file(case, "needle")


def test_responses_of_another_body_are_refused(tmp_path, needle):
    file = write_modes(tmp_path / "n.uff", needle)
    x = np.linspace(1e3, 1e6, 400)
    write_response(file, (12, 12), x, 3 * receptance(needle, x, 0, 0), 8)
    text = case_text("kind: modal\n      file: n.uff\n      units: m kg s", "12 z", "20 z")
    with pytest.raises(InputError, match="with a median difference"):
        reduced_from_file(case_of(tmp_path, text), "needle")


def test_craig_bampton_matrices_of_the_needle(tmp_path, needle):
    """Modal coordinates turned so that two of them are the displacements of the ports."""
    m = needle.mode_count
    T = np.eye(m)
    T[:2] = needle.port_shapes[:, :].T
    back = np.linalg.inv(T)
    K, M = back.T @ np.diag(needle.omega**2) @ back, back.T @ back
    unit = unit_system("mm kg ms")
    names = np.array(["tip", "top", *(f"q{i}" for i in range(2, m))], dtype=object)
    scipy.io.savemat(
        tmp_path / "n.mat", {"K": K / unit.stiffness, "M": M / unit.mass, "names": names}
    )
    text = case_text("kind: craig-bampton\n      file: n.mat\n      units: mm kg ms")
    text = text.replace("  seat:\n", "    damping: {modal: 0.05 %}\n  seat:\n")
    case = case_of(tmp_path, text)
    found = reduced_from_file(case, "needle")
    assert found.omega == pytest.approx(needle.omega, rel=1e-8)
    assert found.damping[1:] == pytest.approx(0.0005)
    force = own_impact(needle, 0.0)
    study = run_impact(case, levels=["reduced"])
    assert np.abs(study.levels["reduced"].history.force - force).max() < 1e-6 * force.max()


def test_reduced_body_of_klack_comes_back_to_the_bit(tmp_path, needle):
    needle.save(tmp_path / "n.npz")
    case = case_of(
        tmp_path, case_text("kind: klack\n      file: n.npz\n      units: m kg s", "top", "tip")
    )
    back = reduced_from_file(case, "needle")
    assert back.port_names == ("tip", "top")  # as the case calls them
    np.testing.assert_array_equal(back.port_shapes, needle.port_shapes[:, ::-1])
    np.testing.assert_array_equal(back.omega, needle.omega)
