"""Ways into a case, and solvers without MKL.

Ways into a case other than one profile: CAD, several materials, a position as drawn.

Truth: the mass of the drawing (Pappus), the same impact from another description of the same bodies
(tolerances say how coarse the CAD mesh is), momentum.

The whole impact without MKL: the same numbers from the solvers that take over.
"""

import sys
from pathlib import Path

import pytest

from klack.analyses.impact.run import run_impact
from klack.assembling.bodies import build_bodies
from klack.bodies.elasticity.factorization import available_backends
from klack.case import load_case, read_case, shipped_cases
from klack.errors import InputError
from klack.machine.progress import silent
from klack.mesh.solid import write_step_revolved

STEP = """
klack: 1
title: The demo valve from CAD
materials:
  steel: {young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}
bodies:
  needle:
    geometry: {step: {file: needle.step}}
    material: steel
    mesh: {size: 2.5 mm, grading: 0.5, contact: {size: 0.05 mm, extent: 0.05 mm}}
  housing:
    geometry: {step: {file: housing.step}}
    material: steel
    mesh: {size: 2.5 mm, grading: 0.5, contact: {size: 0.05 mm, extent: 0.05 mm}}
    fixed: [{surface: rim}]
contact: {between: [needle.tip, housing.seat], gap: 0 um}
motion: {speed: 0.3 m/s}
reduction: {modes: {needle: {count: 20}, housing: {count: 40}}}
run: {duration: 55 us, levels: [reduced]}
"""

WELDED = """
klack: 1
title: Armature welded to a needle
materials:
  steel: {young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}
  light: {young: 70 GPa, poisson: 0.33, density: 2700 kg/m^3}
bodies:
  needle:
    geometry:
      model: axisymmetric
      profile:
        unit: mm
        parts:
          stem:
            start: [0, 1]
            edges:
              - {arc: [2, 3], centre: [0, 3], name: tip}
              - {line: [2, 12], name: shaft}
              - {line: [0, 12], name: weld}
              - {close: true, name: axis}
          disc:
            start: [0, 12]
            edges:
              - {line: [2, 12], name: weld}
              - {line: [4, 12], name: under}
              - {line: [4, 15], name: side}
              - {line: [0, 15], name: top}
              - {close: true, name: axis}
    material: {stem: steel, disc: light}
    mesh: {size: 1 mm, contact: {size: 0.02 mm, extent: 0.15 mm}}
  block:
    geometry:
      model: axisymmetric
      profile:
        unit: mm
        parts:
          block:
            start: [0, -6]
            edges:
              - {line: [6, -6], name: foot}
              - {line: [6, 0], name: wall}
              - {line: [0, 0], name: face}
              - {close: true, name: axis}
    material: steel
    mesh: {size: 1 mm, contact: {size: 0.02 mm, extent: 0.15 mm}}
    fixed: [{surface: foot}]
contact: {between: [needle.tip, block.face], gap: 0 um}
motion: {speed: 0.4 m/s}
reduction: {modes: {needle: {count: 15}, block: {count: 20}}}
run: {duration: 60 us, full_step: 100 ns, levels: [reduced]}
"""


@pytest.mark.slow
def test_step_files_give_the_impact_of_the_profiles(tmp_path: Path):
    drawn = load_case(shipped_cases()["demo-valve-axisymmetric"])
    for name, body in drawn.bodies.items():
        profile = body.geometry.profile
        assert profile is not None
        write_step_revolved(profile.profiles(), tmp_path / f"{name}.step")
    path = tmp_path / "case.yaml"
    path.write_text(STEP)
    from_cad = (
        run_impact(load_case(path), levels=("reduced",), certify=False).levels["reduced"].measures
    )
    expected = run_impact(drawn, levels=("reduced",), certify=False).levels["reduced"].measures
    # elements of two half widths of the contact: some per cent
    assert from_cad.peak_force == pytest.approx(expected.peak_force, rel=0.04)
    assert from_cad.contact_time == pytest.approx(expected.contact_time, rel=0.04)
    assert from_cad.restitution == pytest.approx(expected.restitution, abs=0.01)


@pytest.mark.slow
def test_welded_armature_has_the_mass_of_both_materials():
    case = read_case(WELDED, Path("welded.yaml"))
    profile = case.bodies["needle"].geometry.profile
    assert profile is not None
    volumes = {name: part.volume for name, part in profile.profiles().items()}
    study = run_impact(case, levels=("reduced",), certify=False)
    needle, measures = study.bodies[0], study.levels["reduced"].measures
    # quadratic arcs: a few 1e-6
    assert needle.mass == pytest.approx(7850 * volumes["stem"] + 2700 * volumes["disc"], rel=1e-5)
    rebound = measures.restitution * study.speed
    assert measures.impulse == pytest.approx(needle.mass * (study.speed + rebound), rel=1e-3)


def test_bodies_as_drawn_keep_their_distance():
    pair = build_bodies(read_case(WELDED.replace(", gap: 0 um", ""), Path("drawn.yaml")), silent)
    assert pair.shift == 0.0
    assert pair.upper.mesh.points[:, 1].min() == pytest.approx(1e-3, rel=1e-9)


def test_bodies_that_overlap_as_drawn_are_refused():
    text = WELDED.replace(", gap: 0 um", "").replace("start: [0, 1]", "start: [0, -1]")
    text = text.replace("arc: [2, 3], centre: [0, 3]", "arc: [2, 1], centre: [0, 1]")
    case = read_case(text, Path("drawn.yaml"))
    with pytest.raises(InputError, match=r"overlap by 1000 um as drawn"):
        build_bodies(case, silent)


def test_run_that_ends_before_the_touch_is_refused():
    case = read_case(WELDED.replace("gap: 0 um", "gap: 40 um"), Path("late.yaml"))
    with pytest.raises(InputError, match="first touch at 100 us"):
        run_impact(case, levels=("reduced",))


@pytest.mark.slow
@pytest.mark.parametrize("missing", [("pypardiso",), ("pypardiso", "ngsolve")])
def test_impact_without_mkl(missing: tuple[str, ...], monkeypatch: pytest.MonkeyPatch):
    case = load_case(shipped_cases()["demo-valve-axisymmetric"])
    levels = ("reduced", "full")
    expected = run_impact(case, levels=levels, certify=False)
    for module in missing:
        monkeypatch.setitem(sys.modules, module, None)
    assert "pardiso" not in available_backends()
    study = run_impact(case, levels=levels, certify=False)
    for level in levels:
        a, b = study.levels[level].measures, expected.levels[level].measures
        # round-off of another factorisation, grown over the iterations of the modes
        assert a.peak_force == pytest.approx(b.peak_force, rel=1e-6)
        assert a.restitution == pytest.approx(b.restitution, abs=1e-6)
