"""Faces that meet all at once.

Truth: the pressure of plane waves, rho c v / 2 (exact), at the full order (reference), and that no
level of modes answers for them without a word.
"""

from pathlib import Path

import numpy as np
import pytest

from klack.analyses.impact.run import run_impact
from klack.assembling.problem import build_problem
from klack.case import find_case, load_case
from klack.contact.face_front import area_at_once, front_pressure
from klack.materials import Material
from klack.progress import silent

STEEL = Material(name="steel", young=210e9, poisson=0.0, density=7850.0)
SAID = "of the faces meet all at once"


def rods(tmp_path: Path, *keys: str, speed: str = "1 m/s", levels: str = "[reduced, full]"):
    """The two rods that are shipped, 4 mm thick, with keys of their contact."""
    text = find_case("two-rods").read_text()
    lines = "".join(f"  {key}\n" for key in keys)
    text = text.replace("  gap: 0 um\n", f"  gap: 0 um\n{lines}")
    text = text.replace("speed: 1 m/s", f"speed: {speed}").replace("[reduced, full]", levels)
    path = tmp_path / "case.yaml"
    path.write_text(text)
    return load_case(path)


def said(study):
    return [note for note in study.warnings if SAID in note]


@pytest.fixture(scope="module")
def flat(tmp_path_factory):
    """The case of flat rods and its impact at levels with modes and without."""
    case = rods(tmp_path_factory.mktemp("flat"))
    return case, run_impact(case, levels=("reduced", "interface", "full"), certify=False)


def test_unequal_bodies_share_the_speed():
    """Aluminium on steel: p = v z_a z_b / (z_a + z_b)."""
    soft = Material(name="aluminium", young=70e9, poisson=0.0, density=2700.0)
    z = [np.sqrt(one.young * one.density) for one in (STEEL, soft)]

    assert front_pressure(3.0, STEEL, soft) == pytest.approx(3.0 * z[0] * z[1] / sum(z), rel=1e-12)


@pytest.mark.slow
def test_the_front_is_the_force_of_the_full_order(flat):
    """Poisson's ratio 0: the plateau of the rods is the front, rho c A v / 2 = 255 N."""
    case, study = flat
    area = area_at_once(build_problem(case, silent).space, 1e-9)
    history = study.levels["full"].history

    plateau = history.force[(history.time > 4e-6) & (history.time < 12e-6)].mean()

    assert area == pytest.approx(np.pi * 2e-3**2, rel=1e-6)
    assert area * front_pressure(1.0, STEEL, STEEL) == pytest.approx(plateau, rel=0.005)


@pytest.mark.slow
def test_flat_faces_are_told_of_at_levels_of_modes(flat):
    """One note, with the keys of a real face; the full order is not meant."""
    _, study = flat

    (note,) = said(study)
    assert "'reduced', 'interface'" in note
    assert "contact.crown" in note
    assert not any(SAID in doubt for doubt in study.levels["full"].doubts)


@pytest.mark.slow
def test_the_error_estimate_does_not_hide_them(tmp_path):
    study = run_impact(rods(tmp_path), levels=("reduced",))
    assert study.estimate_doubt
    assert study.reference == "reduced"  # not the run behind the estimate
    assert said(study)


@pytest.mark.slow
def test_a_form_that_the_modes_follow_is_not_told_of(tmp_path):
    """6 um close in 30 us at 0.2 m/s, forty shortest periods; 0.05 um in 0.25 us, a third."""
    deep = run_impact(
        rods(tmp_path, "crown: 6 um", speed="0.2 m/s"), levels=("interface",), certify=False
    )
    shallow = run_impact(
        rods(tmp_path, "crown: 0.05 um", speed="0.2 m/s"), levels=("interface",), certify=False
    )
    assert not said(deep)
    assert said(shallow)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["demo-valve-axisymmetric", "sphere-on-rod"])
def test_curved_faces_are_not_flat(name):
    assert not said(run_impact(load_case(find_case(name)), levels=("reduced",), certify=False))
