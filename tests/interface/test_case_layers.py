"""Layers in a case: what is refused, what is doubted, every level, where they are shown.

Truth: one clear error or doubt for each mistake; all levels see one body; the glued
body for a stiff layer. The equations are in ``tests/exact/test_layers.py``.
"""

import numpy as np
import pytest
from draws import each
from pages import HOW_TO, blocks, changed_case, numbers
from ruamel.yaml import YAML

from klack.analyses.impact.analysis import IMPACT
from klack.analyses.impact.content import report_content
from klack.analyses.impact.run import run_impact
from klack.analyses.inspection import inspect_case
from klack.assembling.bodies import mesh_body
from klack.case import load_case
from klack.errors import InputError
from klack.exchange.calculix_case import calculix_impact
from klack.machine.progress import silent
from klack.mesh.solid import write_step_revolved

NEEDLE = ("bodies", "needle")
LAYERS = (*NEEDLE, "layers")
JOINT = (*LAYERS, "joint")
STIFF = {"normal": "2 kN/mm^3", "tangential": "1 kN/mm^3", "loss_factor": 0.3}


def changed(folder, *changes):
    return changed_case(folder, "bonded_armature.yaml", *changes)


def rows(*numbers, **more):
    keys = ("frequency", "normal", "tangential", "loss_factor")
    units = ("Hz", "N/m^3", "N/m^3", "")
    table = [
        {key: f"{x:g} {unit}".strip() for key, x, unit in zip(keys, row, units, strict=True)}
        for row in numbers
    ]
    return {"table": table, **more}


@each(
    ("changes", "message"),
    [
        ([(*JOINT, {"normal": "2 N/mm^3"})],
         r"joint: got normal with no thickness, expected thickness, modulus and shear_modulus, or"),
        ([(*JOINT, {"modulus": "2 GPa", "shear_modulus": "1 GPa"})],
         r"joint: got modulus and shear_modulus with no thickness"),
        ([(*JOINT, {"thickness": "1 mm"})], r"joint: got no stiffness with a thickness"),
        ([(*JOINT, {"thickness": "1 mm", **STIFF})],
         r"joint: got normal and tangential with a thickness"),
        ([(*JOINT, {**STIFF, "normal": "0 N/mm^3"})], r"joint\.normal: got .*0 N/mm\^3"),
        ([(*JOINT, {**STIFF, "normal": "2 N/mm"})], r"joint\.normal: got '2 N/mm'.*stiffness per"),
        ([(*JOINT, {**STIFF, "loss_factor": 1.2})], r"joint\.loss_factor: got 1\.2"),
        ([(*JOINT, {**STIFF, "frequency": "1 kHz"})],
         r"joint\.frequency: got frequency together with a single stiffness"),
        ([(*JOINT, "frequency", None)], r"joint: got a table without 'frequency', expected .*100"),
        ([(*JOINT, "frequency", "2 MHz")], r"joint\.frequency: got 2 MHz, expected .*to 1 MHz"),
        ([(*JOINT, "loss_factor", 0.1)],
         r"joint\.loss_factor: got loss_factor together with a table"),
        ([(*JOINT, "modulus", "1 GPa")], r"joint\.modulus: got modulus together with a table"),
        ([(*JOINT, "table", 1, "modulus", None)],
         r"joint\.table\[1\]: got shear_modulus with a thickness"),
        ([(*JOINT, "table", 1, "frequency", "100 Hz")],
         r"joint\.table: got frequencies 100 Hz, 100 Hz, 1 MHz, expected rising"),
        ([(*LAYERS, {"joints": STIFF})], r"joints: .*of no part.*two parts share \(here: joint\)"),
        ([(*LAYERS, {"shaft": STIFF})], r"shaft: .*of 'needle'"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_layer_is_one_error_with_its_place(tmp_path, changes, message):
    with pytest.raises(InputError, match=r"case\.yaml:\d+: bodies\.needle\.layers\." + message):
        changed(tmp_path, *changes)


def test_bodies_without_parts_and_with_fits_have_no_layers(tmp_path):
    with pytest.raises(
        InputError, match=r"\d: bodies\.needle\.layers: got a layer together with a press fit"
    ):
        changed_case(tmp_path, "pressed_armature.yaml", (*LAYERS, {"joint": STIFF}))
    given = {
        "reduced": {
            "kind": "klack",
            "file": "a.npz",
            "units": "m kg s",
            "ports": {"tip": {"input": "tip", "output": "tip"}},
        },
        "layers": {"joint": STIFF},
    }
    (tmp_path / "a.npz").write_text("")
    with pytest.raises(
        InputError, match=r"needle\.layers: got a layer in a body given by its matr"
    ):
        changed(tmp_path, (*NEEDLE, given))


def test_doubts_of_a_layer_are_told(tmp_path):
    """Stiffness far from that taken, a table that is too short, and a large loss."""

    def doubts(given):
        return [
            content
            for what, _, content in dict(inspect_case(changed(tmp_path, (*JOINT, given))))["needle"]
            if what == "doubt"
        ]

    assert not doubts(STIFF)
    (said,) = doubts(rows((1e3, 1e12, 1e12, 0), (1e6, 4e12, 4e12, 0), frequency="500 kHz"))
    assert "its stiffness was taken at 500 kHz; the stiffness at 36" in said
    assert "would shift the mode there by about -18 %" in said
    (said,) = doubts(rows((10, 2e12, 1e12, 0), (1e3, 2e12, 1e12, 0), frequency="100 Hz"))
    assert (
        "modes that strain it are beyond its table, such as the mode at 28.1 kHz with 94 %" in said
    )
    (said,) = doubts({**STIFF, "loss_factor": 0.5})
    assert "it gives a mode a loss factor of 0.47" in said


def test_a_layer_stands_in_the_inspection():
    told = [
        content
        for what, name, content in dict(inspect_case(load_case(HOW_TO / "bonded_armature.yaml")))[
            "needle"
        ]
        if (what, name) == ("layer", "joint")
    ]
    assert told[0] == "between: needle and armature, 19.63 mm^2"
    assert told[1].startswith("stiffness at 60 kHz, normal, tangential: 1.5 GN/m, 461 MN/m")
    assert told[2].startswith("mode that strains it most: 92")


def test_the_page_shows_what_the_case_has():
    page = (HOW_TO / "layers.md").read_text(encoding="utf-8")
    (block,) = blocks(page, "yaml-part")
    yaml = YAML(typ="safe")
    shown, case = yaml.load(block), yaml.load(HOW_TO / "bonded_armature.yaml")
    assert shown["layers"] == case["bodies"]["needle"]["layers"]


@pytest.mark.slow
def test_the_table_of_the_page_is_computed(tmp_path):
    """Truth: the page, from the same version; 0.5 % for versions of the mesher."""
    page = (HOW_TO / "layers.md").read_text(encoding="utf-8")
    for row, change in (
        ("glued", (*LAYERS, None)),
        ("adhesive of the case", (*JOINT, "frequency", "60 kHz")),
        ("soft: .*?", (*JOINT, {**STIFF, "loss_factor": 0.0})),
        ("the same with .*?", (*JOINT, STIFF)),
    ):
        case = changed(tmp_path, change)
        found = run_impact(case, levels=("reduced",), certify=False).levels["reduced"].measures
        shown = numbers(page, rf"\| {row} \| ([\d.]+) N \| ([\d.]+) us \| ([\d.]+) \|")
        assert found.peak_force == pytest.approx(shown[0], rel=5e-3)
        assert 1e6 * found.contact_time == pytest.approx(shown[1], rel=5e-3)
        assert found.restitution == pytest.approx(shown[2], abs=2e-3)


def test_the_shared_face_of_a_step_file_can_be_a_layer(tmp_path):
    """Two solids of one file: the face between them, by its name; another name is one error."""
    drawn = load_case(HOW_TO / "bonded_armature.yaml").bodies["needle"].geometry.profile
    write_step_revolved(drawn.profiles(), tmp_path / "needle.step")
    step = (*NEEDLE, "geometry", {"step": {"file": "needle.step"}})
    coarse = [
        (*NEEDLE, "mesh", {"size": "1.5 mm", "grading": 0.3}),
        ("bodies", "housing", "geometry", "model", "solid"),
    ]
    case = changed(tmp_path, step, *coarse)
    mesh = mesh_body(case.bodies["needle"], "needle")
    pair = mesh.pairs["joint"]
    assert set(pair.solids) == {"needle", "armature"}
    at = mesh.points[pair.first[0].connectivity]
    assert np.array_equal(at, mesh.points[pair.second[0].connectivity])
    assert np.ptp(at[..., 2]) < 1e-9
    shown = [row for row in dict(inspect_case(case))["needle"] if row[0] == "layer"]
    assert len(shown) == 5
    assert shown[0] == ("layer", "joint", "between: needle and armature, 19.63 mm^2")
    other = changed(tmp_path, step, *coarse, (*LAYERS, {"seam": STIFF}))
    with pytest.raises(InputError, match=r"layers\.seam: got a name of no face between two solids"):
        mesh_body(other.bodies["needle"], "needle")
    with pytest.raises(InputError, match=r"case\.yaml:\d+: bodies\.needle\.layers\.seam: got"):
        list(inspect_case(other))


@pytest.mark.slow
def test_all_levels_see_one_layer_and_show_it(tmp_path):
    """Peak within the steps of the full order (0.3 %), restitution to 2e-4; more without loss.

    A layer as stiff as steel of a micrometre is glue (peak force to 1e-3).
    """
    size = [
        (("bodies", body, "mesh", "contact", "size", "0.006 mm")) for body in ("needle", "housing")
    ]
    lossy = (*JOINT, STIFF)
    study = run_impact(
        changed(tmp_path, lossy, *size), levels=("reduced", "interface", "full"), certify=False
    )
    peaks, restitution = (
        [getattr(one.measures, name) for one in study.levels.values()]
        for name in ("peak_force", "restitution")
    )
    assert peaks == pytest.approx([peaks[0]] * 3, rel=3e-3)
    assert restitution == pytest.approx([restitution[0]] * 3, abs=2e-4)

    def reduced(given):
        case = changed(tmp_path, (*JOINT, given), *size)
        return run_impact(case, levels=("reduced",), certify=False).levels["reduced"].measures

    lossless = reduced({**STIFF, "loss_factor": 0.0})
    assert lossless.restitution > restitution[0] + 0.02
    glue = {"normal": "2e17 N/m^3", "tangential": "1e17 N/m^3"}
    glued = run_impact(
        changed(tmp_path, (*LAYERS, None), *size), levels=("reduced",), certify=False
    ).levels["reduced"]
    assert reduced(glue).peak_force == pytest.approx(glued.measures.peak_force, rel=1e-3)

    (told,) = IMPACT.to_json(study)["layers"]
    assert (told["body"], told["layer"], told["stiffness_at_Hz"]) == ("needle", "joint", None)
    assert max(told["energy_share"]) == pytest.approx(0.94, abs=0.01)
    heads = [table.columns for part in report_content(study).sections for table in part.tables]
    assert ("layer", "needle.joint") in heads


def test_a_deck_of_calculix_has_no_layers(tmp_path):
    swept = [
        ("bodies", body, "geometry", key, value)
        for body in ("needle", "housing")
        for key, value in (("model", "swept"), ("layers", 12))
    ]
    with pytest.raises(InputError, match=r"bodies\.needle\.layers: got a layer between two parts"):
        calculix_impact(changed(tmp_path, *swept), silent)
