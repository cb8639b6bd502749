"""Which level of a case is the answer, and what never stops a run; truth: the full order.

A ball on a damped block, on meshes that take seconds.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from klack.acoustics.comparison import compare_histories
from klack.analyses.impact import run as impact
from klack.analyses.impact.analysis import IMPACT, answer_line, estimate_lines
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.impact.run import run_impact
from klack.case import find_case, load_case, read_case
from klack.case.impact_sections import LinearLocalLaw, Spring, TransferSweep
from klack.case.schema import Case
from klack.errors import AccuracyWarning, ConvergenceError, InputError
from klack.machine.stages import for_comparison

CASE = Path(__file__).parents[1] / "data" / "small_ball.yaml"


def changed(**run: object) -> Case:
    case = load_case(CASE)
    return case.model_copy(update={"run": case.run.model_copy(update=run)})


def with_contact(**contact: object) -> Case:
    case = load_case(CASE)
    return case.model_copy(update={"contact": case.contact.model_copy(update=contact)})


@cache
def both() -> ImpactStudy:
    return run_impact(load_case(CASE), levels=("reduced", "interface", "full"))


class Terminal:
    """What a run shows, in its order: lines, and stages where they begin."""

    def __init__(self) -> None:
        self.shown: list[str] = []

    def __call__(self, stage: str, fraction: float) -> None:
        if not self.shown or self.shown[-1] != stage:
            self.shown.append(stage)

    def remark(self, line: str) -> None:
        self.shown.append(line)


@pytest.mark.slow
def test_the_answer_comes_before_what_only_adds_to_it():
    terminal = Terminal()
    transfer = TransferSweep.model_validate({"from": "2 kHz", "to": "20 kHz", "points": 3})

    study = run_impact(changed(transfer=transfer), levels=("reduced", "full"), progress=terminal)

    (at,) = (i for i, line in enumerate(terminal.shown) if line.startswith("Answer so far"))
    first = replace(study, levels={"reduced": study.levels["reduced"]}, reference="reduced")
    expected = answer_line(first).replace("Answer", "Answer so far"), *estimate_lines(study)
    assert tuple(terminal.shown[at : at + 3]) == expected
    assert "error estimate" in terminal.shown[:at]
    later = {"classical stiffness", "transfer functions", "picture", "full order"}
    assert later <= set(terminal.shown[at:])
    assert not later & set(terminal.shown[:at])
    assert len(study.transfer) == 2


@pytest.mark.slow
@pytest.mark.parametrize("levels", [("reduced",), ("full",)])
def test_an_answer_so_far_is_told_only_where_more_is_to_come(levels):
    terminal = Terminal()
    run_impact(load_case(CASE), levels=levels, certify=False, progress=terminal)
    assert not any(line.startswith("Answer") for line in terminal.shown)


@pytest.mark.slow
@pytest.mark.usefixtures("computes")
def test_the_number_of_threads_changes_no_bit():
    """Exact: bodies of few unknowns side by side or one after the other, with any BLAS threads."""
    case, levels, found = load_case(CASE), ("reduced", "interface", "full"), []
    for threads, blas in ((1, 1), (1, 2), (2, 1), (None, 2)):
        with threadpool_limits(blas, user_api="blas"):
            found.append(run_impact(case, levels=levels, threads=threads))

    for other in found[1:]:
        for level in levels:
            one, two = found[0].levels[level].history, other.levels[level].history
            assert np.array_equal(one.force, two.force), level
            assert np.array_equal(one.velocity_a, two.velocity_a), level
        assert other.estimates == found[0].estimates


@pytest.mark.slow
def test_damping_is_that_of_the_case_at_every_level():
    """The deviation is that of the reduced model: the full order ignored damping."""
    study = both()
    assert study.reference == "full"
    for level in ("reduced", "interface"):
        assert abs(study.deviations[level].peak_force) < 0.005
        assert abs(study.deviations[level].restitution) < 0.002
    full = study.levels["full"]
    assert full.energies["modal damping"] > 0.01 * full.energies["initial kinetic"]
    assert abs(full.energy_residual) < 1e-9


@pytest.mark.slow
def test_the_run_behind_the_estimate_damps_what_the_full_order_damps():
    """The modes of the case alone, of twice as many.  Truth: the level that has no others.

    Its restitution is known to 4e-6; damping of all modes took 1.4e-4 more.
    """
    study = both()
    reduced, points = (study.levels[n].measures.restitution for n in ("reduced", "interface"))
    behind = reduced - study.estimates["reduced"].restitution

    assert behind == pytest.approx(points, abs=1e-5)


@pytest.mark.slow
def test_the_full_order_alone_has_an_estimate_too():
    alone = run_impact(load_case(CASE), levels=("full",))
    assert alone.estimates["full"] == both().estimates["full"]
    assert list(alone.levels) == ["full"]


@pytest.mark.slow
def test_a_full_order_in_coarse_steps_is_no_reference():
    study = run_impact(changed(full_step=1e-6), levels=("reduced", "full"), certify=False)
    assert study.reference == "reduced"
    assert "reduced" not in study.deviations
    assert any("steps of 1 us in a contact" in note for note in study.warnings)
    assert "Answer (level 'reduced')" in answer_line(study)
    data = IMPACT.to_json(study)
    assert data["answer"] == "reduced"
    assert data["deviation"] is None
    assert data["levels"]["full"]["doubts"]


@pytest.mark.slow
def test_the_run_behind_the_estimate_is_the_answer_where_it_is_better():
    """A law far too soft; the interface level needs no law."""
    soft = with_contact(local_law=LinearLocalLaw(kind="linear", stiffness=1.2e7))
    study = run_impact(soft, levels=("reduced",))
    assert study.reference == "interface"
    assert study.ordered[0].level == "interface"
    assert abs(study.deviations["reduced"].peak_force) > 0.1
    assert any(
        "The answer is from level 'interface', not from level 'reduced'" in note
        for note in study.warnings
    )
    found = study.levels["interface"].measures
    truth = both().levels["full"].measures
    assert found.peak_force == pytest.approx(truth.peak_force, rel=0.005)


@pytest.mark.slow
def test_without_disagreement_the_answer_stays_the_level_asked_for():
    assert both().estimates
    assert list(both().levels) == ["reduced", "interface", "full"]
    assert both().levels["interface"].label.endswith("contact points")
    assert both().warnings == ()


@pytest.mark.slow
def test_the_steps_of_the_full_order_have_an_estimated_error():
    """Truth: the same run in steps of a quarter, whose own error is a sixteenth; order two.

    The estimate lacks the modes above twice those kept, and the ripple of single steps, which
    moves a peak by up to 0.04 %.
    """
    case = load_case(find_case("demo-valve-axisymmetric"))
    study = run_impact(case, levels=("reduced", "full"))
    fine = case.model_copy(
        update={"run": case.run.model_copy(update={"full_step": case.run.full_step / 4})}
    )
    truth = run_impact(fine, levels=("full",)).levels["full"].history
    error = compare_histories(truth, study.levels["full"].history)
    estimate, margin = study.estimates["full"], study.estimate_margins["full"]

    assert error.history_l2 == pytest.approx(estimate.history_l2, rel=0.25)
    assert estimate.peak_force < -5e-4
    assert error.peak_force == pytest.approx(estimate.peak_force, abs=4e-4 + margin.peak_force)
    assert error.contact_time == pytest.approx(estimate.contact_time, abs=margin.contact_time)


@pytest.mark.slow
def test_a_run_that_ends_in_contact_has_no_estimate():
    study = run_impact(changed(duration=4e-6), levels=("reduced",))
    assert study.estimates == {}
    assert estimate_lines(study)[0].startswith("No error estimate: ")
    assert "ends in contact" in estimate_lines(study)[0]


@pytest.mark.parametrize(
    "error",
    [
        InputError("contact submodel: size", got="a zone of no node", expected="-", hint="-"),
        ConvergenceError("the ladder did not settle"),
        MemoryError(),
    ],
    ids=["input", "convergence", "memory"],
)
def test_a_comparison_that_fails_is_a_note(error):
    def refuse() -> None:
        raise error

    with pytest.warns(
        AccuracyWarning, match="a number, which is computed only for comparison, was left out"
    ):
        assert for_comparison("a number", refuse) is None
    assert for_comparison("a number", lambda: 3.0) == 3.0


@pytest.mark.slow
def test_what_is_only_for_comparison_never_stops_a_run(monkeypatch):
    def refuse(*args: object, **how: object) -> None:
        raise InputError("contact submodel: size", got="a zone of no node", expected="-", hint="-")

    for name in ("classical_stiffness", "_certificate"):
        monkeypatch.setattr(impact, name, refuse)
    study = run_impact(load_case(CASE), levels=("reduced",))
    assert study.levels["reduced"].measures == both().levels["reduced"].measures
    assert study.estimates == {}
    assert len([note for note in study.warnings if "only for comparison" in note]) == 2
    assert not any("contact submodel: size" in note for note in study.warnings)


def lifted(distance: float) -> Case:
    """The ball drawn above the block, without contact.gap."""
    text = CASE.read_text(encoding="utf-8")
    for height in ("[0, 0]\n            edges:\n              - {arc", "[2, 2]", "[0, 4]"):
        r, z = height.split("]")[0].strip("[").split(", ")
        moved = height.replace(f"[{r}, {z}]", f"[{r}, {float(z) + distance}]")
        text = text.replace(height, moved)
    text = text.replace("centre: [0, 2]", f"centre: [0, {2 + distance}]")
    return read_case(text.replace(", gap: 0 um", ""), CASE)


@pytest.mark.slow
def test_a_gap_that_is_only_drawn_is_flown_at_every_level():
    """0.5 um at 0.5 m/s take 1 us."""
    study: ImpactStudy = run_impact(lifted(0.0005), levels=("reduced", "interface"), certify=False)
    touches = [level.measures.first_touch for level in study.levels.values()]
    assert touches == pytest.approx([1e-6, 1e-6], rel=0.05)  # the meshes bend the ball
    assert study.gap == pytest.approx(0.5e-6, rel=0.05)


@pytest.mark.slow
def test_a_closing_spring_acts_at_every_level():
    """The speed at first touch follows from the work on the way; the full order left it out."""
    gap, stiffness, preload = 0.5e-6, 2e6, 2.0
    case = with_contact(gap=gap)
    motion = case.motion.model_copy(
        update={"speed": 0.1, "spring": Spring(stiffness=stiffness, preload=preload)}
    )
    case = case.model_copy(
        update={"motion": motion, "run": case.run.model_copy(update={"duration": 45e-6})}
    )
    study = run_impact(case, levels=("reduced", "interface", "full"), certify=False)

    mass = study.bodies[0].mass
    work = preload * gap + 0.5 * stiffness * gap**2
    expected = (0.1**2 + 2 * work / mass) ** 0.5
    assert expected > 0.13  # the spring matters
    for result in study.levels.values():
        assert result.measures.approach_speed == pytest.approx(expected, rel=0.01)  # one step
    for level in ("reduced", "interface"):
        assert abs(study.deviations[level].peak_force) < 0.01
        assert abs(study.deviations[level].restitution) < 0.01


def test_parts_drawn_far_apart_are_the_reason_that_is_named():
    with pytest.raises(InputError, match=r"drawn 1\.09\d* mm apart, without contact\.gap"):
        run_impact(lifted(1.09), levels=("reduced",))
