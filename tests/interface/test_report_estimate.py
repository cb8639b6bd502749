"""The answer to 'how good is the reduced level?'; the truth is the made-up study."""

from dataclasses import replace

import pytest

from klack.analyses.impact.analysis import estimate_lines
from klack.analyses.impact.content import report_content
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.impact.wording import (
    ESTIMATE_COLUMNS,
    answer,
    estimate_rows,
    estimate_sentence,
)
from klack.contact.restitution import Deviation


def deviation(peak: float, restitution: float = 0.0) -> Deviation:
    return Deviation(
        peak_force=peak,
        contact_time=-0.001,
        impulse=0.0,
        restitution=restitution,
        history_l2=0.002,
        third_octave_max_dB=0.1,
        third_octave_up_to_Hz=2e5,
    )


def certified(study: ImpactStudy, estimate: Deviation) -> ImpactStudy:
    basis = "interface level, 80 + 80 modes, 834 contact points"
    return replace(
        study, estimates={"reduced": estimate}, estimate_margins={}, estimate_basis=basis
    )


def plain(text: str) -> str:
    return text.replace("\N{NO-BREAK SPACE}", " ")


def test_the_true_deviation_stands_beside_the_estimate(impact_study: ImpactStudy) -> None:
    study = certified(impact_study, deviation(0.0031))

    (row,) = estimate_rows(study)

    assert len(row) == len(ESTIMATE_COLUMNS)
    true = 100 * impact_study.deviations["reduced"].peak_force
    assert plain(row[1]) == f"+0.31 %\ntrue: {true:+.2f} %"
    sentence = estimate_sentence(study)
    assert "834 contact points" in sentence
    assert "the full order, which was run too" in sentence


def test_without_the_full_order_there_is_no_truth(impact_study: ImpactStudy) -> None:
    levels = {"reduced": impact_study.levels["reduced"]}
    study = replace(impact_study, levels=levels, reference="reduced", deviations={})
    study = certified(study, deviation(0.0031))

    assert "true" not in "".join(estimate_rows(study)[0])
    assert "full order" not in estimate_sentence(study)
    assert "Estimated error of this level: +0.31 % in peak force" in plain(answer(study))


def test_an_estimate_stands_with_how_far_it_may_be_off(impact_study: ImpactStudy) -> None:
    margin = replace(deviation(0.0004, restitution=0.0002), contact_time=0.02)
    study = certified(impact_study, deviation(0.0031))
    study = replace(study, estimate_margins={"reduced": margin})

    assert plain(estimate_rows(study)[0][1]).startswith("+0.31 % ± 0.04 %\n")
    (line,) = estimate_lines(study)
    assert "peak force +0.31 ± 0.04 %, contact time -0.10 ± 2.00 %" in line
    assert "restitution +0.0000 ± 0.0002 (" in line
    # 0.1 % of the contact time would be good, 2.1 % are not
    assert "not for the last per cent" in estimate_sentence(study)


def test_the_full_order_alone_tells_what_its_steps_do(impact_study: ImpactStudy) -> None:
    study = replace(
        certified(impact_study, deviation(0.0031)), estimates={"full": deviation(-2e-3)}
    )

    assert plain(estimate_sentence(study)).startswith("The steps of the full order put it off by")
    assert plain(estimate_sentence(study)).count("-0.20 %".replace("-", "\N{MINUS SIGN}")) == 1
    assert report_content(study).sections[0].title == "Accuracy of the full order"


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (deviation(0.009), "good enough to rely on"),
        (deviation(-0.03), "not for the last per cent"),
        (deviation(0.0, restitution=-0.17), "use the interface level"),
        (deviation(float("nan"), restitution=0.0), "good enough to rely on"),
    ],
)
def test_the_largest_error_decides(impact_study: ImpactStudy, error: Deviation, words: str) -> None:
    assert words in estimate_sentence(certified(impact_study, error))


def test_nothing_is_good_while_the_contact_is_in_doubt(impact_study: ImpactStudy) -> None:
    """Two levels that share one row of elements agree with each other, whatever is true."""
    doubtful = replace(impact_study.contact, doubts=("it lies on a sharp edge",))
    study = certified(replace(impact_study, contact=doubtful), deviation(0.0001))

    assert "good enough" not in estimate_sentence(study)
    assert "cannot be relied on, because it lies on a sharp edge" in estimate_sentence(study)


@pytest.mark.slow
def test_the_report_answers_first(impact_study: ImpactStudy) -> None:
    content = report_content(certified(impact_study, deviation(0.0031)))

    assert content.sections[0].title == "Accuracy of the reduced level"
    assert "estimated error" in dict(content.definitions)
    titles = [section.title for section in report_content(impact_study).sections]
    assert "Accuracy of the reduced level" not in titles
