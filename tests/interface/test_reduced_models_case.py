"""Cases whose bodies have no surfaces: what runs, what is refused, and in which words.

Truth: the same bodies taken directly; texts of the refusals.
"""

from pathlib import Path

import numpy as np
import pytest
import scipy.io

from klack.analyses.impact.analysis import IMPACT
from klack.analyses.impact.content import report_content
from klack.analyses.impact.run import run_impact
from klack.analyses.reduction.analysis import REDUCTION
from klack.analyses.reduction.run import run_reduce
from klack.assembling.given_pair import build_given_pair
from klack.case import load_case, shipped_cases
from klack.case.any_case import load_any_case
from klack.case.schema import Case
from klack.contact.laws import HertzLaw, LinearLaw
from klack.elasticity.body import elastic_body
from klack.errors import InputError
from klack.exchange.case_models import case_models
from klack.materials import Material
from klack.mesh.profile import Line, Profile
from klack.mesh.sizing import MeshSizing
from klack.mesh.solid import mesh_revolved
from klack.progress import silent
from klack.reduction.damping import LossFactor
from klack.reduction.ports import Port
from klack.reduction.reduce import reduce_body
from klack.reduction.selection import ByCount
from klack.simulation.bodies import rod_body
from klack.simulation.impact import simulate_impact
from klack.simulation.system import ContactPair, ReducedSystem

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
