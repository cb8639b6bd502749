"""Numbers as text, by hand."""

import json
from dataclasses import replace

import pytest

from klack.analyses.impact.analysis import (
    IMPACT,
    answer_line,
    contact_doubt,
    study_told,
)
from klack.analyses.impact.content import report_content
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.impact.wording import answer
from klack.report.wording import listed, quantity, share, signed, signed_share


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
        (7e-5, "m^2", 4, "70 mm^2"),  # not 70 µm^2, which is 7e-11 m^2
        (0.5, "m^2", 4, "0.5 m^2"),
        (2e-9, "m^3", 4, "2 mm^3"),
        (3.05e-3, "kg", 4, "3.050 g"),
        (7850.0, "kg/m^3", 4, "7850 kg/m^3"),
        (1.7e4, "1/s", 3, "1.7e+04 1/s"),
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
    summary = json.loads(json.dumps(IMPACT.to_json(impact_study), allow_nan=False))

    assert summary["case"] == "demo"
    assert summary["levels"]["full"]["peak_force_N"] == pytest.approx(250.0, rel=1e-3)  # records
    assert summary["levels"]["reduced"]["degrees_of_freedom"] == 61
    assert summary["deviation"] == summary["deviations"]["reduced"]
    assert set(summary["deviation"]) == {
        *("peak_force", "contact_time", "impulse", "restitution", "history_l2"),
        *("third_octave_max_dB", "third_octave_up_to_Hz"),
    }
    assert IMPACT.to_json(lonely_study)["deviation"] is None
    assert (summary["complete"], summary["failures"]) == (True, {})


def test_a_doubtful_contact_goes_with_every_number(impact_study: ImpactStudy) -> None:
    assert IMPACT.to_json(impact_study)["contact"]["doubts"] == []
    assert contact_doubt(impact_study.contact) == ""
    doubts = ("its mesh is too coarse", "2 contact points across are too few")
    contact = replace(impact_study.contact, points_across=2, doubts=doubts)
    study = replace(impact_study, contact=contact)
    words = "cannot be relied on: its mesh is too coarse and 2 contact points across are too"

    said = IMPACT.to_json(study)["contact"]
    assert (said["doubts"], said["points_across"]) == (list(doubts), 2)
    assert said["half_width_m"] == contact.half_width
    assert words in contact_doubt(contact)
    assert words in answer(study)


def test_summary_rows_fit_their_columns(impact_study: ImpactStudy) -> None:
    table = next(iter(study_told(impact_study)))
    rows = table.rows

    assert [row[0] for row in rows] == ["full", "reduced"]
    assert all(len(row) == len(table.columns) for row in rows)
    assert rows[0][2] == "15.000"


def with_restitution(study: ImpactStudy, restitution: float) -> ImpactStudy:
    level = study.levels["reduced"]
    measures = replace(level.measures, restitution=restitution)
    return replace(study, levels={"reduced": replace(level, measures=measures)})


def test_a_rebound_that_loses_little_is_not_rounded_to_none(lonely_study: ImpactStudy) -> None:
    said = answer(with_restitution(lonely_study, 0.9997))
    assert "rebounds with 99.97\N{NO-BREAK SPACE}% of its speed" in said


def test_a_run_that_ends_in_the_contact_says_so_everywhere(lonely_study: ImpactStudy) -> None:
    """Terminal, report, JSON: no peak, contact time or impulse that was not reached."""
    study = with_restitution(lonely_study, float("nan"))
    row = next(iter(study_told(study))).rows[0]
    assert all(cell.endswith(" (cut off)") for cell in row[1:4])
    assert row[4] == "–"
    assert "cut off in contact" in answer_line(study)
    assert "still in contact when the record ends" in answer(study)

    numbers = json.loads(json.dumps(IMPACT.to_json(study), allow_nan=False))["levels"]["reduced"]
    assert numbers["cut_off"] is True
    cut = ("peak_force_N", "contact_time_s", "impulse_Ns", "restitution", "total_contact_time_s")
    assert all(numbers[key] is None for key in cut)
    assert numbers["highest_force_N"] > 0.0

    table = report_content(study).numbers
    cells = {row[0]: row[1] for row in table.rows}
    assert all("(cut off)" in cells[key] for key in ("peak force", "contact time", "impulse"))
    assert "cut off" in table.columns[1]


def test_peak_and_contact_time_of_several_contacts_are_told_apart(
    lonely_study: ImpactStudy,
) -> None:
    level = lonely_study.levels["reduced"]
    measures = replace(level.measures, sub_contacts=3, strongest=2)
    study = replace(lonely_study, levels={"reduced": replace(level, measures=measures)})
    row = next(iter(study_told(study))).rows[0]
    assert row[1].endswith("(contact 2 of 3)")
    assert row[2].endswith("(contact 1 of 3)")
    assert IMPACT.to_json(study)["levels"]["reduced"]["strongest_contact"] == 2
    assert "(contact 2 of 3 in quick succession)" in answer(study)
    assert "(contact 1 of 3 in quick succession)" in answer(study)


def test_restitution_refers_to_the_speed_at_first_touch(lonely_study: ImpactStudy) -> None:
    """A preload has made 0.8 m/s out of 0.5 m/s on the way."""
    level = lonely_study.levels["reduced"]
    measures = replace(level.measures, approach_speed=0.8)
    study = replace(lonely_study, levels={"reduced": replace(level, measures=measures)})
    assert "0.8 m/s at first touch" in answer_line(study)
    assert "0.8 m/s at first touch, 0.5 m/s at the start" in answer(study)
    assert "at the start" not in answer(lonely_study)
    assert IMPACT.to_json(study)["levels"]["reduced"]["approach_speed_m_s"] == 0.8
