"""Cases whose bodies have no surfaces, or nodes alone.

Cases whose bodies have no surfaces: what runs, what is refused, and in which words.

Truth: the same bodies taken directly; texts of the refusals.

The case of the page on matrices, and bodies of nodes alone.

Truth: the same case with klack's own matrices; every level must give the same impact.
"""

import re
import shutil
import warnings
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from klack.analyses.impact.analysis import IMPACT
from klack.analyses.impact.content import report_content
from klack.analyses.impact.run import run_impact
from klack.analyses.noise.run import run_noise
from klack.analyses.noise.source import impact_sources
from klack.analyses.reduction.analysis import REDUCTION
from klack.analyses.reduction.run import run_reduce
from klack.assembling.assembled_bodies import assembled_body, assembled_from_matrices
from klack.assembling.bodies import build_bodies, mesh_body
from klack.assembling.given_pair import build_given_pair
from klack.bodies.elasticity.body import elastic_body
from klack.bodies.reduction.damping import LossFactor
from klack.bodies.reduction.ports import Port
from klack.bodies.reduction.reduce import reduce_body
from klack.bodies.reduction.selection import ByCount
from klack.case import load_case, shipped_cases
from klack.case.any_case import load_any_case
from klack.case.schema import Case
from klack.cli.main import main
from klack.contact.laws import HertzLaw, LinearLaw
from klack.errors import AccuracyWarning, InputError
from klack.exchange.case_models import case_models
from klack.input.unit_systems import unit_system
from klack.machine.progress import silent
from klack.materials.material import Material
from klack.mesh.families import FAMILIES
from klack.mesh.mesh import FaceTable, Mesh
from klack.mesh.profile import Line, Profile
from klack.mesh.sizing import MeshSizing
from klack.mesh.solid import mesh_revolved
from klack.simulation.bodies import rod_body
from klack.simulation.impact import simulate_impact
from klack.simulation.system import ContactPair, ReducedSystem
from klack.verification.exchange_files import write_matrices
from klack.verification.lattice import lattice_mesh

STEEL = {"area": 1e-5, "young": 2.1e11, "density": 7850.0}
NEEDLE = rod_body("rod", length=0.02, elastic_modes=10, **STEEL)
SEAT = rod_body("base", length=0.03, elastic_modes=10, support="bottom", **STEEL)

TEXT = """
klack: 1
title: Two reduced bodies
bodies:
  needle:
    reduced: {kind: klack, file: needle.npz, units: m kg s, ports: {tip: {input: bottom}}}
  seat:
    reduced: {kind: klack, file: seat.npz, units: m kg s, ports: {face: {input: top}}}
contact:
  between: [needle.tip, seat.face]
  gap: 0 um
  local_law: {kind: linear, stiffness: 1e9 N/m}
motion: {speed: 0.4 m/s}
run: {levels: [lumped, reduced], duration: 40 us, reduced_step: 10 ns}
lumped: {stiffness: 1e9 N/m}
"""


def case_of(folder: Path, text: str = TEXT) -> Case:
    NEEDLE.save(folder / "needle.npz")
    SEAT.save(folder / "seat.npz")
    (folder / "case.yaml").write_text(text)
    return load_case(folder / "case.yaml")


def refusal(folder: Path, old: str, new: str) -> str:
    assert old in TEXT
    with pytest.raises(InputError) as caught:
        case_of(folder, TEXT.replace(old, new))
    return str(caught.value)


# --------------------------------------------------------------------------- what runs


def test_study_of_two_reduced_bodies(tmp_path):
    case = case_of(tmp_path)
    study = run_impact(case, levels=case.run.levels)
    needle, seat = study.bodies
    assert needle.mass == pytest.approx(NEEDLE.mass)
    assert needle.source == "reduced body in needle.npz"
    assert (needle.support, seat.support) == ("free", "held")
    assert needle.compliance_share == pytest.approx(NEEDLE.compliance_share[0])
    contact = ContactPair(
        body_a="rod",
        port_a="bottom",
        body_b="base",
        port_b="top",
        law=LinearLaw(1e9),
        gap=0.0,
        series_compliance=float(NEEDLE.residual_compliance[0, 0] + SEAT.residual_compliance[1, 1]),
    )
    system = ReducedSystem(bodies=(NEEDLE, SEAT), contacts=(contact,))
    force = simulate_impact(system, speed=0.4, duration=40e-6, step=10e-9).force
    np.testing.assert_allclose(
        study.levels["reduced"].history.force, force, atol=1e-9 * force.max()
    )
    # at the same force the approach is that of all springs in a row
    whole = 1e-9 + NEEDLE.static_compliance[0, 0] + SEAT.static_compliance[1, 1]
    assert study.contact.approach == pytest.approx(whole * study.contact.force, rel=1e-9)
    assert study.contact.points == 0
    assert study.law.kind == "linear"
    assert study.law.linear_stiffness == pytest.approx(1 / (1e-9 + contact.series_compliance))


def test_study_is_stored_reported_and_exported(tmp_path):
    case = case_of(tmp_path)
    study = run_impact(case, levels=["reduced"])
    IMPACT.save(study, tmp_path / "out")
    again = IMPACT.load(tmp_path / "out")
    np.testing.assert_array_equal(again.contact.approach, study.contact.approach)
    numbers = IMPACT.to_json(study)
    assert numbers["levels"]["reduced"]["peak_force_N"] > 50
    assert numbers["estimated_error"] == {}
    facts = str(report_content(study))
    assert "reduced body in needle.npz" in facts
    assert "without contact points" in facts
    assert "are nan" not in facts
    models = case_models(case)
    assert models.pair.contacts[0].series_compliance > 0
    assert [model.name for model in models.body_models()] == ["needle", "seat"]
    reduced = run_reduce(case)
    assert [body.name for body in reduced.bodies] == ["needle", "seat"]
    numbers = REDUCTION.to_json(reduced)
    assert numbers["bodies"]["needle"]["mass_kg"] == pytest.approx(NEEDLE.mass)
    (table,) = REDUCTION.told(reduced)
    assert len(table.rows) == 2


def test_hertz_law_by_its_modulus(tmp_path):
    law = "{kind: hertz, radius: 1 mm, modulus: 115 GPa}"
    case = case_of(tmp_path, TEXT.replace("{kind: linear, stiffness: 1e9 N/m}", law))
    pair = build_given_pair(case, silent)
    assert isinstance(pair.law, HertzLaw)
    assert pair.law.coefficient == pytest.approx(4 / 3 * 115e9 * np.sqrt(1e-3))
    study = run_impact(case, levels=["reduced"])
    assert study.law.kind == "hertz"
    assert study.levels["reduced"].measures.peak_force > 50


MESHED = """{model: axisymmetric, profile: {unit: mm, parts: {seat: {start: [0, -8], edges: [
        {line: [4, -8], name: foot}, {line: [4, 0]}, {line: [0, 0], name: face}, {close: true}]}}}}
    material: steel
    mesh: {size: 1 mm}
    fixed: [{surface: foot}]"""


def test_reduced_model_on_a_meshed_body(tmp_path):
    """The port of the mesh is a uniform pressure; what 40 modes miss of it is in series."""
    old = "reduced: {kind: klack, file: seat.npz, units: m kg s, ports: {face: {input: top}}}"
    text = TEXT.replace(old, f"geometry: {MESHED}")
    text = text.replace(
        "bodies:",
        "materials: {steel: {young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}}\nbodies:",
    )
    case = case_of(tmp_path, text)
    pair = build_given_pair(case, silent)
    missed = pair.lower.residual_compliance[0, 0] + NEEDLE.residual_compliance[0, 0]
    assert pair.series_compliance == pytest.approx(missed)
    # 8 mm of steel under the whole face: about L / (E A), a little stiffer as it cannot widen below
    assert pair.lower.static_compliance[0, 0] == pytest.approx(
        0.008 / (210e9 * np.pi * 0.004**2), rel=0.1
    )
    study = run_impact(case, levels=["reduced"])
    assert "profile" in study.bodies[1].source
    assert abs(study.levels["reduced"].energy_residual) < 1e-10


def block() -> tuple[object, np.ndarray]:
    """Small solid cylinder, held at its foot, and the nodes of its top."""
    edges = (
        Line((0.002, 0.0), "foot"),
        Line((0.002, 0.003), "side"),
        Line((0.0, 0.003), "top"),
        Line((0.0, 0.0), "axis"),
    )
    mesh = mesh_revolved({"block": Profile((0.0, 0.0), edges)}, MeshSizing(size=1.5e-3))
    steel = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
    foot = np.flatnonzero(mesh.points[:, 2] < 1e-9)
    return elastic_body("seat", mesh, {"block": steel}, fixed_nodes=foot), foot


@pytest.mark.slow
def test_matrices_with_nodes_alone(tmp_path):
    """Matrix Market in mm, t, s and a table of nodes against the body that they came from."""
    body, foot = block()
    scipy.io.mmwrite(tmp_path / "k.mtx", body.K / 1e3, precision=17)
    scipy.io.mmwrite(tmp_path / "m.mtx", body.M / 1e3, precision=17)
    rows = [
        f"{100 + i},{1e3 * x:.17g},{1e3 * y:.17g},{1e3 * z:.17g}"
        for i, (x, y, z) in enumerate(body.mesh.points)
    ]
    (tmp_path / "nodes.csv").write_text("node,x,y,z\n" + "\n".join(rows) + "\n")
    top = np.flatnonzero(body.mesh.points[:, 2] > 0.003 - 1e-9)
    given = f"""geometry:
      nodes:
        file: nodes.csv
        unit: mm
        sets: {{top: {[int(i) + 100 for i in top]}, foot: {[int(i) + 100 for i in foot]}}}
    matrices: {{stiffness: k.mtx, mass: m.mtx, units: mm t s}}
    fixed: [{{surface: foot}}]"""
    old = "reduced: {kind: klack, file: seat.npz, units: m kg s, ports: {face: {input: top}}}"
    text = TEXT.replace(old, given).replace("seat.face", "seat.top")
    text += "reduction: {modes: {seat: {count: 12}}}\n"
    case = case_of(tmp_path, text)
    pair = build_given_pair(case, silent)
    pattern = np.zeros((body.mesh.node_count, 3))
    pattern[top, 2] = 1.0 / len(top)
    truth = reduce_body(
        body,
        [Port("top", pattern.ravel())],
        modes=ByCount(12),
        correction="consistent",
        damping=LossFactor(eta=0.0),
    )
    assert pair.lower.omega == pytest.approx(truth.omega, rel=1e-8)
    # axially driven modes only: bending pairs of the round block mix at will
    assert pair.lower.modal_compliance == pytest.approx(truth.modal_compliance, rel=1e-6)
    assert pair.lower.static_compliance == pytest.approx(truth.static_compliance, rel=1e-8)
    study = run_impact(case, levels=["lumped", "reduced"])
    summary = study.bodies[1]
    assert (summary.model, summary.elements, summary.support) == ("matrices", 0, "held")
    assert summary.nodes == body.mesh.node_count
    assert abs(study.levels["reduced"].energy_residual) < 1e-10


# --------------------------------------------------------------------------- what is refused


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("needle.tip", "needle.tap", "unknown port 'tap' of needle"),
        ("levels: [lumped, reduced]", "levels: [reduced, full]", "level 'full'"),
        ("levels: [lumped, reduced]", "levels: [interface]", "level 'interface'"),
        ("levels: [lumped, reduced], ", "", "level 'full'"),
        ("{kind: linear, stiffness: 1e9 N/m}", "{kind: consistent}", "linear or hertz"),
        ("{kind: linear, stiffness: 1e9 N/m}", "{kind: submodel, size: 1 mm}", "linear or hertz"),
        ("  local_law: {kind: linear, stiffness: 1e9 N/m}\n", "", "linear or hertz"),
        ("{kind: linear, stiffness: 1e9 N/m}", "{kind: hertz, radius: 1 mm}", "modulus"),
        ("  local_law:", "  friction: 0.1\n  local_law:", "friction with"),
        ("  local_law:", "  crown: 1 um\n  local_law:", "bodies with surfaces"),
        (
            "motion: {speed: 0.4 m/s}",
            "motion: {speed: 0.4 m/s, placement: {tilt: 1 mrad}}",
            "centred",
        ),
        ("lumped:", "shots: {count: 3, seed: 1}\nlumped:", "surfaces"),
        ("lumped:", "reduction: {correction: attachment}\nlumped:", "in series with the law"),
        ("lumped:", "reduction: {shifts: {needle: [-1 kHz]}}\nlumped:", "shifts of attachment"),
        (
            "reduced_step: 10 ns",
            "reduced_step: 10 ns, transfer: {from: 1 kHz, to: 9 kHz}",
            "transfer",
        ),
    ],
)
def test_what_needs_surfaces_is_refused_at_the_door(tmp_path, old, new, words):
    assert words in refusal(tmp_path, old, new)


def test_levels_asked_for_later_are_refused(tmp_path):
    with pytest.raises(InputError, match="levels among: lumped, reduced"):
        run_impact(case_of(tmp_path), levels=["reduced", "full"])


def test_held_body_cannot_fly(tmp_path):
    text = TEXT.replace("needle.npz", "seat.npz").replace("{input: bottom}", "{input: top}")
    with pytest.raises(InputError, match="it is supported"):
        run_impact(case_of(tmp_path, text), levels=["reduced"])


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("{input: bottom}", "{input: middle}", "got 'middle', expected one of: bottom, top"),
        ("{input: bottom}", "{input: 3}", "got number 3, expected 1 to 2"),
        ("{input: bottom}", "{input: bottom, output: top}", "one port of the stored body"),
        ("{tip: {input: bottom}}", "{tip: {input: bottom}}, mass: 5 g", "mass"),
    ],
)
def test_ports_and_mass_that_the_file_does_not_have(tmp_path, old, new, words):
    case = case_of(tmp_path, TEXT.replace(old, new))
    with pytest.raises(InputError, match=words):
        run_impact(case, levels=["reduced"])


def test_damping_is_given_once(tmp_path):
    text = TEXT.replace("  seat:\n", "    damping: {modal: 1 %}\n  seat:\n")
    pair = build_given_pair(case_of(tmp_path, text), silent)
    assert pair.upper.damping[1:] == pytest.approx(0.01)
    damped = rod_body("rod", length=0.02, elastic_modes=10, damping=0.002, **STEEL)
    case = case_of(tmp_path, text)
    damped.save(tmp_path / "needle.npz")
    with pytest.raises(InputError, match="has its own"):
        build_given_pair(case, silent)


def test_problem_of_a_port_names_its_line(tmp_path):
    with pytest.raises(InputError) as caught:
        case_of(tmp_path, TEXT.replace("seat.face", "seat.fase"))
    assert "face" in caught.value.hint
    assert "case.yaml" in caught.value.where


def test_whole_valve_needs_surfaces(tmp_path):
    text = shipped_cases()["demo-stroke"].read_text()
    begin, end = text.index("\n  needle:") + 1, text.index("\n  housing:") + 1
    model = "{kind: klack, file: needle.npz, units: m kg s, ports: {tip: {input: bottom}}}"
    NEEDLE.save(tmp_path / "needle.npz")
    (tmp_path / "case.yaml").write_text(
        f"{text[:begin]}  needle:\n    reduced: {model}\n{text[end:]}"
    )
    with pytest.raises(
        InputError, match="a reduced model or nodes without elements in a whole valve"
    ):
        load_any_case(tmp_path / "case.yaml")


PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "bring-matrices.md"
STEEL_CASE = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
UNITS = unit_system("mm t s")
MATERIAL = "materials: {steel: {young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}}\n"


def block_case(low: float, high: float, crown: bool) -> Mesh:
    """Bar of 1 mm x 1 mm, its bottom crowned like a sphere of 40 mm if asked."""

    def shape(x: np.ndarray) -> np.ndarray:
        y = x.copy()
        y[:, 2] += crown * (high - x[:, 2]) / (high - low) * (x[:, 0] ** 2 + x[:, 1] ** 2) / 40e-3
        return y

    line = np.linspace(-0.5e-3, 0.5e-3, 4)
    return lattice_mesh("hex20", [line, line, np.linspace(low, high, 4)], shape)


def write_deck(path: Path, mesh: Mesh, surfaces: dict[str, str], first: int) -> None:
    """Abaqus input in mm; node numbers from ``first`` in steps of two, listed backwards."""
    lines = ["*NODE"]
    for i in range(mesh.node_count - 1, -1, -1):
        x, y, z = (mesh.points[i] * 1e3).tolist()
        lines.append(f"{first + 2 * i}, {x:.15e}, {y:.15e}, {z:.15e}")
    lines.append("*ELEMENT, TYPE=C3D20, ELSET=body")
    for k, nodes in enumerate((first + 2 * mesh.blocks[0].connectivity).tolist(), start=1):
        lines += [", ".join(map(str, [k, *nodes[:10]])) + ",", ", ".join(map(str, nodes[10:]))]
    table = FaceTable.of(mesh.blocks)
    for name, side in surfaces.items():
        lines.append(f"*SURFACE, NAME={name}, TYPE=ELEMENT")
        for faces in mesh.surface(side).blocks:
            for row in table.find(faces.connectivity[:, : FAMILIES[faces.family].corners]).tolist():
                lines.append(f"{table.element[row] + 1}, S{table.side[row] + 1}")
    path.write_text("\n".join(lines) + "\n")


def write_body(folder: Path, form: str, mesh: Mesh, first: int):
    body = elastic_body("body", mesh, {"solid": STEEL_CASE})
    order = np.random.default_rng(4).permutation(body.dof_count)
    K = (body.K / UNITS.stiffness).tocsr()[order][:, order]
    M = (body.M / UNITS.mass).tocsr()[order][:, order]
    return write_matrices(form, folder, K, M, first + 2 * (order // 3), order % 3 + 1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """The files that the case of the page names."""
    folder = tmp_path_factory.mktemp("matrices")
    needle, seat = block_case(0.0, 2e-3, True), block_case(-1e-3, 0.0, False)
    write_deck(folder / "needle.inp", needle, {"tip": "bottom", "head": "top"}, 11)
    write_deck(folder / "seat.inp", seat, {"top": "top", "bottom": "bottom"}, 300)
    write_body(folder, "CalculiX", needle, 11)
    for ending in ("sti", "mas", "dof"):
        shutil.move(folder / f"model.{ending}", folder / f"needle.{ending}")
    write_body(folder, "OUTPUT4, binary, sparse", seat, 300)
    shutil.move(folder / "model.op4", folder / "seat.op4")
    shutil.move(folder / "rows.csv", folder / "seat_rows.csv")
    return folder


def page_case() -> str:
    return re.findall(r"```yaml\n(klack: 1.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[0]


def own_case() -> str:
    """The same case with klack's own matrices."""
    text = re.sub(r"    matrices: \{.*\}\n", "    material: steel\n", page_case())
    text = re.sub(r"    matrices:\n(      .*\n)+", "    material: steel\n", text)
    return text.replace("bodies:", MATERIAL + "bodies:")


def load(folder: Path, text: str, name: str = "case.yaml"):
    (folder / name).write_text(text)
    return load_case(folder / name)


@pytest.mark.slow
def test_the_case_of_the_page_gives_the_impact_of_klacks_own_matrices(folder):
    levels = ("reduced", "interface", "full")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AccuracyWarning)
        given = run_impact(load(folder, page_case()), levels=levels, certify=False)
        own = run_impact(load(folder, own_case(), "own.yaml"), levels=levels, certify=False)

    for name in levels:
        ours, theirs = own.levels[name], given.levels[name]
        peak = ours.history.force.max()
        # 14 digits in the files of the needle
        np.testing.assert_allclose(theirs.history.force, ours.history.force, atol=1e-6 * peak)
        assert theirs.measures.restitution == pytest.approx(ours.measures.restitution, abs=1e-6)
    needle = given.bodies[0]
    assert "needle.sti" in needle.material
    assert "7854 kg/m^3" in needle.material  # straight edges


@pytest.mark.slow
def test_given_matrices_at_mounts_are_the_source_of_klacks_own(folder):
    """Six freedoms of the seat: free velocity, blocked force and mobility alike."""
    mounts = "noise: {mounts: {foot: {surface: seat.bottom}}}\n"
    found = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AccuracyWarning)
        for name, text in (("at.yaml", page_case()), ("own_at.yaml", own_case())):
            impact = run_impact(load(folder, text + mounts, name), levels=("reduced",))
            found.append(run_noise(impact_sources(impact)).reference.at_mounts.source())
    given, own = found
    assert len(own.freedoms) == 6
    for name in ("free_velocity", "blocked_force", "mobility"):
        ours = getattr(own, name)
        size = np.abs(ours).max()
        np.testing.assert_allclose(getattr(given, name), ours, atol=1e-5 * size, err_msg=name)


@pytest.mark.slow
def test_inspecting_the_case_shows_what_the_checks_found(folder, capsys):
    load(folder, page_case())

    assert main(["inspect", str(folder / "case.yaml")]) == 0

    shown = " ".join(capsys.readouterr().out.split())
    assert "rigid" in shown
    assert "kg/m^3" in shown


@pytest.mark.slow
def test_a_leaning_body_takes_its_matrices_along(folder):
    lean = "motion: {speed: 0.5 m/s, placement: {tilt: 0.5 deg, eccentricity: 20 um}}"
    texts = [text.replace("motion: {speed: 0.5 m/s}", lean) for text in (page_case(), own_case())]

    given, own = (
        build_bodies(load(folder, text, f"lean{k}.yaml"), silent).upper
        for k, text in enumerate(texts)
    )

    assert abs(given.K - own.K).max() < 1e-10 * abs(own.K).max()
    assert abs(given.M - own.M).max() < 1e-10 * abs(own.M).max()
    np.testing.assert_allclose(given.inertia, own.inertia, rtol=1e-9, atol=1e-18)


def test_the_report_names_mass_material_and_first_frequency(folder):
    made = assembled_body(load(folder, page_case()), "seat")

    text = "\n".join(" ".join(row) for row in made.rows())

    held = 3 * len(made.body.mesh.surface("bottom").nodes)
    for words in ("7850 kg/m^3", "282.7 GPa", "first eigenfrequency", f"{held} of them held"):
        assert words in text
    assert made.report.rigid == 0


def test_wrong_units_stop_the_case_with_those_that_fit(folder):
    case = load(folder, page_case().replace("units: mm t s", "units: m kg s"), "wrong.yaml")

    with pytest.raises(InputError) as error:
        build_bodies(case, silent)

    assert "bodies.needle.matrices" in str(error.value)
    assert "with units: mm t s they would be 7854 kg/m^3" in str(error.value)


@pytest.mark.slow
def test_nodes_alone_make_a_body_with_sets(folder):
    mesh = block_case(0.0, 2e-3, True)
    rows = [
        f"{11 + 2 * i}, {x:.15e}, {y:.15e}, {z:.15e}"
        for i, (x, y, z) in enumerate((1e3 * mesh.points).tolist())
    ]
    (folder / "nodes.csv").write_text("\n".join(["node, x, y, z", *rows]) + "\n")
    tip, head = (11 + 2 * mesh.surface(name).nodes for name in ("bottom", "top"))
    (folder / "head.txt").write_text("\n".join(map(str, head)))
    nodes = f"nodes: {{file: nodes.csv, unit: mm, sets: {{tip: {tip.tolist()}, head: head.txt}}}}"
    text = page_case().replace("mesh: {file: needle.inp, unit: mm}", nodes)
    text = text.replace("gap: 0 um", "local_law: {kind: linear, stiffness: 1e9 N/m}")
    text = text.replace("full_step: 200 ns", "levels: [reduced]")
    case = load(folder, text, "nodes.yaml")

    body = assembled_from_matrices(case, "needle", None)

    np.testing.assert_array_equal(body.mesh.node_sets["tip"], mesh.surface("bottom").nodes)
    np.testing.assert_array_equal(body.mesh.node_sets["head"], mesh.surface("top").nodes)
    own = elastic_body("needle", mesh, {"solid": STEEL_CASE})
    assert body.mass == pytest.approx(own.mass, rel=1e-9)
    assert abs(body.K - own.K).max() < 1e-9 * abs(own.K).max()
    assert mesh_body(case.bodies["needle"], "needle", ()).node_sets.keys() == {"tip", "head"}

    study = run_impact(case, levels=("reduced",), certify=False)

    history = study.levels["reduced"].history
    assert history.mass_a == pytest.approx(own.mass, rel=1e-9)
    momentum = history.mass_a * 0.5 * (1 + study.levels["reduced"].measures.restitution)
    assert history.force.sum() * history.step == pytest.approx(momentum, rel=1e-6)
