"""Numbers as text, by hand."""

import json
from dataclasses import replace

import pytest

from klack.cli.notes import ends_in_contact
from klack.report.wording import answer, listed, quantity, share, signed, signed_share
from klack.workflow.study import ImpactStudy
from klack.workflow.summary import SUMMARY_COLUMNS, study_to_json, summary_rows


def plain(text: str) -> str:
    """Text with ordinary spaces: units stand after one that does not break."""
    assert " " not in text
    return text.replace("\N{NO-BREAK SPACE}", " ")


@pytest.mark.parametrize(
    ("value", "unit", "digits", "text"),
    [
        (255.31, "N", 3, "255 N"),
        (2.5e-3, "N s", 3, "2.50 mN s"),
        (999.96e-9, "s", 4, "1.000 µs"),
        (-3e-6, "m", 3, "−3.00 µm"),
        (0.0, "m", 3, "0 m"),
        (2.1e11, "Pa", 3, "210 GPa"),
        (1e-19, "J", 3, "0.000100 fJ"),
        (float("inf"), "kg", 3, "∞"),
        (float("nan"), "kg", 3, "–"),
    ],
)
def test_quantity(value: float, unit: str, digits: int, text: str) -> None:
    assert plain(quantity(value, unit, digits)) == text


def test_signs_and_shares() -> None:
    assert plain(signed_share(0.0042)) == "+0.42 %"
    assert plain(signed_share(-0.00001)) == "0.00 %"
    assert signed(-0.0011, 4) == "−0.0011"
    assert plain(share(0.5)) == "50.0 %"
    assert share(float("nan")) == "–"
    assert listed(["a", "b"]) == "a and b"


def test_summary_in_plain_numbers(impact_study: ImpactStudy, lonely_study: ImpactStudy) -> None:
    summary = json.loads(json.dumps(study_to_json(impact_study), allow_nan=False))

    assert summary["case"] == "demo"
    assert summary["levels"]["full"]["peak_force_N"] == pytest.approx(250.0, rel=1e-3)  # records
    assert summary["levels"]["reduced"]["degrees_of_freedom"] == 61
    assert summary["deviation"] == summary["deviations"]["reduced"]
    assert set(summary["deviation"]) == {
        *("peak_force", "contact_time", "impulse", "restitution", "history_l2"),
        *("third_octave_max_dB", "third_octave_up_to_Hz"),
    }
    assert study_to_json(lonely_study)["deviation"] is None


def test_summary_rows_fit_their_columns(impact_study: ImpactStudy) -> None:
    rows = summary_rows(impact_study)

    assert [row[0] for row in rows] == ["full", "reduced"]
    assert all(len(row) == len(SUMMARY_COLUMNS) for row in rows)
    assert rows[0][2] == "15.000"


def with_restitution(study: ImpactStudy, restitution: float) -> ImpactStudy:
    level = study.levels["reduced"]
    measures = replace(level.measures, restitution=restitution)
    return replace(study, levels={"reduced": replace(level, measures=measures)})


def test_a_rebound_that_loses_little_is_not_rounded_to_none(lonely_study: ImpactStudy) -> None:
    said = answer(with_restitution(lonely_study, 0.9997))
    assert "rebounds with 99.97\N{NO-BREAK SPACE}% of its speed" in said


def test_a_run_that_ends_in_the_contact_says_so(lonely_study: ImpactStudy) -> None:
    assert ends_in_contact(with_restitution(lonely_study, 0.9).levels) == ()
    (note,) = ends_in_contact(with_restitution(lonely_study, float("nan")).levels)
    assert note.startswith("reduced: the run ends before the bodies have parted.")
    assert "run.duration" in note
