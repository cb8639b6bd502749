"""Words and pictures of reports.

Numbers as text, by hand.

Charts in words: the numbers are those of the data that the chart draws.

The answer to 'how good is the reduced level?'; the truth is the made-up study.

The schematic in reports: truth = the stored picture, and the pages that it is shown on.
"""

import json
import re
import zlib
from base64 import b64encode
from contextlib import suppress
from dataclasses import replace

import numpy as np
import pytest
from draws import each
from schematic_rules import random_network

from klack.analyses.impact.analysis import (
    IMPACT,
    answer_line,
    contact_doubt,
    estimate_lines,
    study_told,
)
from klack.analyses.impact.content import report_content
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.impact.wording import ESTIMATE_COLUMNS, answer, estimate_rows, estimate_sentence
from klack.analyses.page import schematic_section
from klack.contact.restitution import Deviation
from klack.report.html import render_html
from klack.report.one_unit import in_one_unit
from klack.report.page import Content, Section, Table
from klack.report.pdf import render_pdf
from klack.report.spoken import spoken
from klack.report.wording import listed, quantity, share, signed, signed_share
from klack.schematic.picture import schematic_svg
from klack.units import format_si


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
        (0.0, "m", 3, "0 µm"),
        (2.1e11, "Pa", 3, "210 GPa"),
        (1e-19, "J", 3, "1.00e\N{MINUS SIGN}19 J"),
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


@each("seed", range(40))
def test_a_column_has_one_unit_and_the_same_numbers(seed: int) -> None:
    """Definition: what the cells say stays, to every digit, and only one prefix is left."""
    rng = np.random.default_rng(seed)
    unit = str(rng.choice(["s", "N", "N s", "m/s", "Hz", "kg", "J", "N/m"]))
    values = 10.0 ** rng.uniform(-9.0, 6.0, 6) * rng.choice([-1.0, 1.0], 6)
    write = (quantity, format_si)[seed % 2]
    cells = [write(float(value), unit) for value in values]

    found = [cell for (cell,) in in_one_unit([(cell,) for cell in cells])]

    def read(cell: str) -> tuple[float, str]:
        number, _, of = cell.replace("−", "-").replace("\xa0", " ").partition(" ")
        return float(number), of

    assert len({read(cell)[1] for cell in found}) == 1 or unit == "kg"
    sizes = {"f": 1e-15, "p": 1e-12, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "m": 1e-3, "k": 1e3}
    sizes |= {"": 1.0, "M": 1e6, "G": 1e9}
    base = "g" if unit == "kg" else unit

    def size(cell: str) -> float:
        number, of = read(cell)
        return number * sizes[of.removesuffix(base)]

    written = [size(cell) for cell in cells]
    assert [size(cell) for cell in found] == pytest.approx(written, rel=1e-12, abs=0.0)


@each(
    ("rows", "shown"),
    [
        # things down: remarks, dashes and zeros stay; one cell alone as well
        (
            [("a", "7.67 mg (flows on)", "12 us"), ("b", "682 ug", "-"), ("c", "0 kg", "-")],
            [("a", "7.67 mg (flows on)", "12 us"), ("b", "0.682 mg", "-"), ("c", "0 mg", "-")],
        ),
        # things across: quantities in rows
        (
            [("time", "300 us", "2.5 ms", "-"), ("force", "1.2 kN", "950 N", "3 N")],
            [("time", "0.300 ms", "2.5 ms", "-"), ("force", "1200 N", "950 N", "3 N")],
        ),
        # no prefix before a power, a level or a word
        ([("3 m^2",), ("40 mm^2",)], [("3 m^2",), ("40 mm^2",)]),
        ([("3 modes",), ("5 m",)], [("3 modes",), ("5 m",)]),
        # round-off beside numbers: a power of ten
        ([("3.5 mJ",), ("2.1 pJ",)], [("3.5 mJ",), ("2.1e-9 mJ",)]),
        # a small number takes the next prefix if the others stay short
        ([("1.2 us",), ("2.78 ms",)], [("1.2 us",), ("2780 us",)]),
        ([("1.2 us",), ("27.8 ms",)], [("0.0012 ms",), ("27.8 ms",)]),
    ],
)
def test_columns_that_share_a_unit(rows: list[tuple[str, ...]], shown: list[tuple[str, ...]]):
    assert [tuple(row) for row in in_one_unit(rows)] == shown


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
    assert "the run ends in contact" in answer_line(study)
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


AXES = {"xaxis": {"title": {"text": "time [us]"}}, "yaxis": {"title": {"text": "force [N]"}}}


def line(name: str, y: list[float | None], **more: object) -> dict[str, object]:
    return {"type": "scatter", "name": name, "x": list(range(len(y))), "y": y, **more}


def test_each_named_curve_is_told_with_its_extremes_and_gaps_are_left_out():
    told = spoken(
        {
            "data": [
                line("now &amp; <b>then</b>", [0.0, None, 123.456, 5.0]),
                line("", [1.0], showlegend=False),
                line("flat", [2.0, 2.0]),
                line("area", [1.0, 2.0], mode="none"),
            ],
            "layout": AXES,
        }
    )

    assert told == (
        "force [N] over time [us]. now & then: highest 123.5 at 2, lowest 0 at 0, at the end 5. "
        "flat: 2 throughout."
    )


def test_bars_maps_and_parallel_axes_are_told():
    bar = {"type": "bar", "name": "film", "y": ["needle", "stop"], "x": [1.5, None]}
    heat = {"type": "heatmap", "z": [[1.0, 2.0], [-60.0, None]]}
    axis = {"label": "lift [um]", "low": 85.0, "high": 115.0, "values": [85.0, 90.0, 115.0]}

    assert spoken({"data": [bar], "layout": {}}) == "film: needle 1.5."
    assert spoken({"data": [heat], "layout": {}}) == "values: from -60 to 2."
    assert spoken({"axes": [axis]}) == (
        "Parallel axes of 1 quantities for 3 points. lift [um]: from 85 to 115."
    )


@pytest.mark.parametrize("y", [[], [None, None]])
def test_a_curve_without_values_is_left_out(y):
    assert spoken({"data": [line("empty", y)], "layout": AXES}) == "force [N] over time [us]."


def test_long_lists_end_with_how_many_are_left_out():
    told = spoken({"data": [line(f"c{i}", [1.0, 2.0]) for i in range(11)], "layout": AXES})

    assert told.count("highest") == 8
    assert told.endswith("and 3 more.")


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


def plain_estimate(text: str) -> str:
    return text.replace("\N{NO-BREAK SPACE}", " ")


def test_the_true_deviation_stands_beside_the_estimate(impact_study: ImpactStudy) -> None:
    study = certified(impact_study, deviation(0.0031))

    (row,) = estimate_rows(study)

    assert len(row) == len(ESTIMATE_COLUMNS)
    true = 100 * impact_study.deviations["reduced"].peak_force
    assert plain_estimate(row[1]) == f"+0.31 %\ntrue: {true:+.2f} %"
    sentence = estimate_sentence(study)
    assert "834 contact points" in sentence
    assert "the full order, which was run too" in sentence


def test_without_the_full_order_there_is_no_truth(impact_study: ImpactStudy) -> None:
    levels = {"reduced": impact_study.levels["reduced"]}
    study = replace(impact_study, levels=levels, reference="reduced", deviations={})
    study = certified(study, deviation(0.0031))

    assert "true" not in "".join(estimate_rows(study)[0])
    assert "full order" not in estimate_sentence(study)
    assert "Estimated error of this level: +0.31 % in peak force" in plain_estimate(answer(study))


def test_an_estimate_stands_with_how_far_it_may_be_off(impact_study: ImpactStudy) -> None:
    margin = replace(deviation(0.0004, restitution=0.0002), contact_time=0.02)
    study = certified(impact_study, deviation(0.0031))
    study = replace(study, estimate_margins={"reduced": margin})

    assert plain_estimate(estimate_rows(study)[0][1]).startswith("+0.31 % ± 0.04 %\n")
    (line,) = estimate_lines(study)
    assert "peak force +0.31 ± 0.04 %, contact time -0.10 ± 2.00 %" in line
    assert "restitution +0.0000 ± 0.0002 (" in line
    # 0.1 % of the contact time would be good, 2.1 % are not
    assert "not for the last per cent" in estimate_sentence(study)


def test_the_full_order_alone_tells_what_its_steps_do(impact_study: ImpactStudy) -> None:
    study = replace(
        certified(impact_study, deviation(0.0031)), estimates={"full": deviation(-2e-3)}
    )

    assert plain_estimate(estimate_sentence(study)).startswith(
        "The steps of the full order shift it by"
    )
    assert (
        plain_estimate(estimate_sentence(study)).count("-0.20 %".replace("-", "\N{MINUS SIGN}"))
        == 1
    )
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


def content(*sections: Section) -> Content:
    return Content(
        title="t",
        subtitle="s",
        description="",
        answer="a",
        numbers=Table(columns=("", "x"), rows=(("y", "1"),)),
        warnings=(),
        sections=sections,
        definitions=(),
        limits=(),
        case_text="",
        versions="",
    )


def test_the_page_shows_the_picture_of_the_result():
    picture = schematic_svg(random_network(3))

    page = render_html(content(schematic_section(picture)))

    assert b64encode(picture.encode()).decode() in page
    assert '<figure class="wide">' in page


def widths_of_pages(paper: bytes) -> set[int]:
    """Widths [pt] of the pages of a PDF, 595 upright and 842 on its side."""
    plain = paper
    for packed in re.findall(rb"stream\r?\n(.*?)\r?\nendstream", paper, re.DOTALL):
        with suppress(zlib.error):
            plain += zlib.decompress(packed)
    boxes = re.findall(rb"/MediaBox\s*\[\s*0 0 ([\d.]+) [\d.]+\s*\]", plain)
    return {round(float(width)) for width in boxes}


def test_paper_has_a_page_for_it_that_lies_only_for_a_wide_picture():
    wide, high = schematic_svg(random_network(3)), schematic_svg(random_network(9))

    assert widths_of_pages(render_pdf(content(schematic_section(wide)))) == {595, 842}
    assert widths_of_pages(render_pdf(content(schematic_section(high)))) == {595}


def test_an_older_result_has_no_schematic_and_a_damaged_one_says_so():
    assert schematic_section("").picture is None
    damaged = schematic_section("<svg><g></svg>")

    assert damaged.picture is None
    assert "klack show" in damaged.paragraphs[0]
