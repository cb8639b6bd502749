"""Faces as running-in has left them, written as a case and read again."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.impact.command import run_case
from klack.analyses.impact.run import run_impact
from klack.analyses.impact.running_in import worn_text
from klack.assembling.problem import build_problem
from klack.case.reader import load_case, read_case
from klack.contact.worn_faces import WornFaces, opened_by
from klack.errors import InputError
from klack.terminal.options import WantedResult

CASES = Path(__file__).parents[2] / "cases" / "demo-valve-axisymmetric"
STEEL = "density: 7850 kg/m^3}"
SOFT = "density: 7850 kg/m^3, yield: 600 MPa, hardening: {isotropic: 1 GPa}}"
ELEMENT, FINE = "size: 0.004 mm", "size: 0.002 mm"


def _changed(text, *changes):
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return text


@cache
def _run_in():
    text = _changed(
        (CASES / "case.yaml").read_text("utf-8"),
        (STEEL, SOFT),
        ("run:\n", "run:\n  run_in: true\n"),
    )
    study = run_impact(read_case(text, CASES / "case.yaml"), levels=("reduced",), certify=False)
    assert study.running_in is not None
    assert study.running_in.run_in
    found = study.running_in
    return found, worn_text(text, CASES / "case.yaml", found, CASES, "1")


def _impact(text, *levels):
    return run_impact(read_case(text, CASES / "worn.yaml"), levels=levels, certify=False)


@pytest.mark.parametrize("level", ["reduced", "interface"])
@pytest.mark.slow
def test_an_elastic_impact_on_the_written_case_is_the_run_in_one(level):
    """Exact but for the smooth start of an elastic law: the same contact problem; 0.5 %."""
    found, text = _run_in()
    study = _impact(text, level)
    measures = study.levels[level].measures

    assert measures.peak_force == pytest.approx(found.peak_force[-1], rel=5e-3)
    assert measures.contact_time == pytest.approx(found.contact_time[-1], rel=5e-3)
    assert measures.restitution == pytest.approx(found.restitution[-1], abs=5e-4)
    assert study.levels[level].energies.get("plastic", 0.0) == 0.0
    assert not any("yields" in warning for warning in study.warnings)


@pytest.mark.slow
def test_a_mesh_twice_as_fine_reads_the_same_faces():
    """Convergence: the set between the contact points is a straight line; 2 %."""
    found, text = _run_in()
    measures = _impact(_changed(text, (ELEMENT, FINE)), "reduced").levels["reduced"].measures

    assert measures.peak_force == pytest.approx(found.peak_force[-1], rel=0.02)
    assert measures.restitution == pytest.approx(found.restitution[-1], abs=1e-3)


@pytest.mark.slow
def test_a_faster_impact_than_those_that_have_worn_the_faces_is_told():
    _, text = _run_in()
    study = _impact(_changed(text, ("speed: 0.3 m/s", "speed: 0.5 m/s")), "reduced")

    assert any("is worn up to 126.9 N and yields again" in told for told in study.warnings)


def test_a_set_that_is_a_shift_along_the_axis_changes_nothing():
    """Exact: faces touch where they did, and only the shape of the gap matters."""
    case = read_case((CASES / "case.yaml").read_text("utf-8"), CASES / "case.yaml")
    space = build_problem(case, lambda *_: None).space
    order = np.argsort(space.points[:, 0])
    lower = WornFaces(radius=space.points[order, 0], opening=3e-7 * space.axial[order])
    start = min(space.clearance, space.touch)
    found = opened_by(space, lower)

    assert opened_by(space, None) is space
    touching = space.gap + (start - space.touch) * space.axial
    np.testing.assert_allclose(found.gap, touching, rtol=0, atol=1e-18)
    assert found.clearance == start


@pytest.mark.parametrize(
    ("worn", "message"),
    [
        ("{force: 100 N, radius: [0.5 mm], opening: [0 um]}", "contact.worn.radius"),
        ("{force: 100 N, radius: [0.5 mm, 0.6 mm], opening: [0 um, 1 um, 0 um]}", "3 values for 2"),
        ("{force: 100 N, radius: [0.6 mm, 0.5 mm], opening: [0 um, 1 um]}", "radii that rise"),
        ("{force: 100 N, radius: [0.5 mm, 0.6 mm], opening: [0 um, 1 mm]}", "check the units"),
        ("{force: 0 N, radius: [0.5 mm, 0.6 mm], opening: [0 um, 1 um]}", "contact.worn.force"),
        ("{force: 100 N, radius: [0.5 mm, .nan], opening: [0 um, 1 um]}", "contact.worn.radius"),
        ("worn.csv", "contact.worn"),
    ],
)
def test_a_profile_that_is_none_is_refused(worn, message):
    """Bad input: one clear error."""
    text = (CASES / "case.yaml").read_text("utf-8")
    text = _changed(text, ("  gap: 0 um", f"  gap: 0 um\n  worn: {worn}"))
    with pytest.raises(InputError, match=message):
        read_case(text, CASES / "case.yaml")


@pytest.mark.slow
def test_the_command_writes_a_case_that_it_reads_again(tmp_path):
    """Exact: the file of one command is that of the next; nothing is written without running-in."""
    spheres = Path(__file__).parents[1] / "data" / "case" / "yielding_spheres.yaml"
    text = spheres.read_text("utf-8")
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "case.yaml").write_text(
        _changed(text, ("run: {", "run: {impacts: 2, "), ("size: 0.004 mm", "size: 0.01 mm")),
        "utf-8",
    )
    wanted = WantedResult(out=tmp_path / "b", report=False, quiet=True)
    run_case(tmp_path / "a" / "case.yaml", [], wanted, certify=False)
    worn = load_case(tmp_path / "b" / "worn.yaml")
    wanted = WantedResult(out=tmp_path / "c", report=False, quiet=True)
    run_case(tmp_path / "b" / "worn.yaml", [], wanted, certify=False)

    assert worn.contact.worn is not None
    assert worn.run.impacts == 1
    assert not (tmp_path / "c" / "worn.yaml").exists()


@pytest.mark.slow
def test_the_written_case_says_where_it_comes_from():
    found, text = _run_in()

    assert text.startswith("# klack 1, klack impact: faces of case.yaml after ")
    case = read_case(text, CASES / "worn.yaml")
    assert case.contact.worn is not None
    assert case.contact.worn.force == pytest.approx(found.worn_by, rel=1e-4)
    assert not case.run.run_in
    np.testing.assert_allclose(case.contact.worn.opening, found.opening, atol=1e-13)
    assert "not yet run in" in worn_text(
        (CASES / "case.yaml").read_text("utf-8"),
        CASES / "case.yaml",
        replace(found, run_in=False),
        CASES,
        "1",
    )
