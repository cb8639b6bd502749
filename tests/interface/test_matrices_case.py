"""The case of the page on matrices, and bodies of nodes alone.

Truth: the same case with klack's own matrices; every level must give the same impact.
"""

import re
import shutil
import warnings
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.impact.run import run_impact
from klack.assembling.assembled_bodies import assembled_body, assembled_from_matrices
from klack.assembling.bodies import build_bodies, mesh_body
from klack.case import load_case
from klack.cli.main import main
from klack.elasticity.body import elastic_body
from klack.errors import AccuracyWarning, InputError
from klack.materials import Material
from klack.mesh.families import FAMILIES
from klack.mesh.mesh import FaceTable, Mesh
from klack.progress import silent
from klack.unit_systems import unit_system
from klack.verification.exchange_files import write_matrices
from klack.verification.lattice import lattice_mesh

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "bring-matrices.md"
STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
UNITS = unit_system("mm t s")
MATERIAL = "materials: {steel: {young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}}\n"


def block(low: float, high: float, crown: bool) -> Mesh:
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
    body = elastic_body("body", mesh, {"solid": STEEL})
    order = np.random.default_rng(4).permutation(body.dof_count)
    K = (body.K / UNITS.stiffness).tocsr()[order][:, order]
    M = (body.M / UNITS.mass).tocsr()[order][:, order]
    return write_matrices(form, folder, K, M, first + 2 * (order // 3), order % 3 + 1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """The files that the case of the page names."""
    folder = tmp_path_factory.mktemp("matrices")
    needle, seat = block(0.0, 2e-3, True), block(-1e-3, 0.0, False)
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
    assert "with units: mm t s it would be 7854 kg/m^3" in str(error.value)


@pytest.mark.slow
def test_nodes_alone_make_a_body_with_sets(folder):
    mesh = block(0.0, 2e-3, True)
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
    own = elastic_body("needle", mesh, {"solid": STEEL})
    assert body.mass == pytest.approx(own.mass, rel=1e-9)
    assert abs(body.K - own.K).max() < 1e-9 * abs(own.K).max()
    assert mesh_body(case.bodies["needle"], "needle", ()).node_sets.keys() == {"tip", "head"}

    study = run_impact(case, levels=("reduced",), certify=False)

    history = study.levels["reduced"].history
    assert history.mass_a == pytest.approx(own.mass, rel=1e-9)
    momentum = history.mass_a * 0.5 * (1 + study.levels["reduced"].measures.restitution)
    assert history.force.sum() * history.step == pytest.approx(momentum, rel=1e-6)
