"""A needle between seat and stop above, at the interface level.

Truth: conservation of energy and momentum; flight that is jumped over must not change anything;
a crowned face is no flat one (geometry).
"""

import dataclasses
import itertools
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.impact.interface_level import build_interface
from klack.assembling.bodies import find_touch
from klack.assembling.modes import mode_pools
from klack.assembling.problem import ContactProblem, build_problem
from klack.case import load_case, shipped_cases
from klack.case.schema import Case
from klack.contact.restitution import measure_impact
from klack.errors import InputError
from klack.progress import silent
from klack.transient.interface_model import InterfaceModel
from klack.transient.interface_run import simulate_interface

_POLE = """
  pole:
    geometry:
      model: axisymmetric
      profile:
        unit: mm
        parts:
          pole:
            start: [2, 20]
            edges:
              - {arc: [4, 20], centre: [3, 40], name: stop}  # crowned
              - {line: [4, 26], name: outside}
              - {line: [2, 26], name: rim}
              - {close: true, name: bore}
    material: steel
    mesh:
      size: 1 mm
      contact: {size: 0.02 mm, extent: 0.15 mm}
    fixed:
      - surface: rim
contact:
"""
_OPPOSITE = "  gap: 2 um\nopposite: {between: [pole.stop, needle.top], gap: 30 um}\n"


def case_text() -> str:
    text = shipped_cases()["demo-valve-axisymmetric"].read_text(encoding="utf-8")
    text = text.replace("contact:\n  between", _POLE.strip("\n") + "\n  between")
    return text.replace("  gap: 0 um\n", _OPPOSITE)


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Case:
    file = tmp_path_factory.mktemp("opposite") / "case.yaml"
    file.write_text(case_text(), encoding="utf-8")
    return load_case(file)


@pytest.fixture(scope="module")
def problem(case: Case) -> ContactProblem:
    return build_problem(case, silent)


@pytest.fixture(scope="module")
def model(problem: ContactProblem) -> InterfaceModel:
    return build_interface(problem, mode_pools(problem, at_least=1, progress=silent))


def test_bounces_between_both_ends_keep_the_energy(model: InterfaceModel):
    run = simulate_interface(model, speed=0.3, duration=800e-6, flight=True, points=False)
    assert [segment.contact for segment in run.impacts[:4]] == [
        "contact",
        "opposite",
        "contact",
        "opposite",
    ]
    # some 1000 closings and openings of points; each pays its debt within a step or two
    assert abs(run.energy.residual) < 1e-6
    for segment in run.impacts[:4]:
        change = segment.history.velocity_a[-1] - segment.history.velocity_a[0]
        # seen with the stop below, whichever it is
        assert segment.side == (1.0 if segment.contact == "contact" else -1.0)
        assert model.mass * change == pytest.approx(segment.history.impulse, rel=1e-9)
    first = measure_impact(run.impacts[0].history)
    assert 0.98 < first.restitution < 1.0  # 0.997 on this seat without the stop above


def test_the_stop_above_is_where_the_case_says(model: InterfaceModel):
    """30 um up from the start until the centre of mass has gone as far."""
    run = simulate_interface(
        model, speed=0.0, velocity=np.array([0, 0, 0.3, 0, 0, 0]), duration=150e-6
    )
    first = np.argmax(run.history.force > 0)
    # weighted gaps close up to a hat's curvature later, some tens of nanometres on 20 um elements
    assert run.history.time[first] * 0.3 == pytest.approx(30e-6, abs=0.1e-6)


def test_jumping_over_flight_changes_nothing(model: InterfaceModel):
    """The exact propagator: a segment starts within a step, so forces agree to their slope."""
    jumped = simulate_interface(model, speed=0.3, duration=300e-6, flight=True, points=False)
    stepped = simulate_interface(model, speed=0.3, duration=300e-6, points=False)
    assert jumped.steps < 0.9 * stepped.steps
    assert jumped.motion.position[-1][2] == pytest.approx(stepped.motion.position[-1][2], rel=1e-3)


def test_points_of_both_ends_answer_each_other_reciprocally(model: InterfaceModel):
    (_, _, seat), (_, stop, _) = model.contacts
    cross = model.compliance[:seat, stop:]
    assert np.max(np.abs(cross)) > 0.0
    assert model.checks.reciprocity < 1e-12
    assert model.checks.static_limit < 1e-10
    assert model.checks.lowest_pivot > 0.0


def test_crowned_face_is_refined_where_it_touches(case: Case):
    """A crown of 20 mm radius rises by 25 nm over 1 um: a ring, not a flat zone."""
    assert case.opposite is not None
    touch = find_touch(case.bodies, case.opposite.stop, case.opposite.moving)
    assert touch is not None
    assert touch.upper[0][0] == pytest.approx(3e-3, abs=2e-6)


def test_surfaces_of_coarse_faces_find_each_other(case: Case):
    """Both sides far coarser than the crown: whatever is chosen as slave has a contact point."""
    bodies = dict(case.bodies)
    for name in ("needle", "pole"):
        bodies[name] = bodies[name].model_copy(
            update={"mesh": bodies[name].mesh.model_copy(update={"contact": None})}
        )
    coarse = case.model_copy(update={"bodies": bodies})
    problem = build_problem(coarse, silent)
    assert problem.opposite is not None
    assert problem.opposite.space.count >= 1


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("pole.stop, needle.top", "needle.top, pole.stop", "which moves"),
        ("pole.stop, needle.top", "housing.top, needle.top", "third body"),
        ("gap: 30 um", "gap: -30 um", "above 0"),
        ("needle.top]", "needle.lid]", "top"),
    ],
)
def test_mistakes_are_explained(tmp_path: Path, old: str, new: str, words: str):
    file = tmp_path / "case.yaml"
    file.write_text(case_text().replace(old, new), encoding="utf-8")
    with pytest.raises(InputError, match="opposite") as error:
        load_case(file)
    assert words in str(error.value)


def test_result_is_plain(model: InterfaceModel):
    """What goes to worker processes holds arrays, numbers and words only."""
    for field in dataclasses.fields(model):
        value = getattr(model, field.name)
        assert isinstance(value, np.ndarray | tuple | float | None) or field.name == "checks"


def test_hits_on_both_stops_in_quick_succession_are_two_impacts(model: InterfaceModel):
    """4 um between the stops: 13 us of flight, less than what ends an impact on one stop alone."""
    above = np.arange(model.count) >= model.contacts[1][1]
    near = dataclasses.replace(model, gap=model.gap - np.where(above, 26e-6, 0.0))
    run = simulate_interface(near, speed=0.3, duration=250e-6, flight=True, points=False)
    names = [segment.contact for segment in run.impacts]
    assert names[:4] == ["contact", "opposite", "contact", "opposite"]
    first = measure_impact(run.impacts[0].history)
    assert first.sub_contacts == 1
    assert 0.9 < first.restitution < 1.0
    # nothing is lost or done twice where one impact ends and the next begins
    for before, after in itertools.pairwise(run.impacts[:4]):
        gone = before.history.velocity_a[-1]  # seen from the stop below, then from that above
        assert after.history.velocity_a[0] == pytest.approx(-gone, rel=1e-9)
    assert abs(run.energy.residual) < 1e-6
