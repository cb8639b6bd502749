"""Catalogues of measures: what is described once is whole, and stands wherever it is used."""

import re
from pathlib import Path

import pytest
from draws import each

from klack.analyses.catalogue import ANALYSES, analyses
from klack.analyses.json_results import result_schema
from klack.analyses.measures import Column, Measure, json_of
from klack.analyses.named import named

DOCS = Path(__file__).parents[2] / "docs"
MEASURES = {of: found for a in analyses() for of, found in a.measures.items()}
EVERY = [(of, item) for of, measures in MEASURES.items() for item in measures]


@each(("of", "measure"), EVERY)
def test_a_measure_is_described_whole(of: str, measure: Measure):
    assert re.fullmatch(r"[a-z0-9_]+", measure.key)
    assert measure.definition.endswith(".")
    assert measure.name[0].islower() or measure.name[:2].isupper()
    assert (DOCS / f"{measure.source}.md").is_file()


def test_keys_are_unique_in_their_catalogue():
    for of, measures in MEASURES.items():
        for keys in ([item.json_key for item in measures], [item.key for item in measures]):
            assert len(keys) == len(set(keys)), of


def test_the_schema_has_every_measure():
    described = [part["properties"] for part in result_schema()["$defs"].values()]
    for of, measures in MEASURES.items():
        words = {item.json_key: item.definition for item in measures}
        assert any(
            all(keys.get(key, {}).get("description") == text for key, text in words.items())
            for keys in described
        ), of


@pytest.mark.parametrize("entry", ANALYSES, ids=lambda entry: entry.place)
def test_what_the_catalogue_names_is_there(entry):
    """Texts that name an analysis, its page and its command lead somewhere; forms are its own."""
    analysis = named(entry.place)

    assert (analysis.form.name if entry.form else "") == entry.form
    if entry.form:
        assert callable(named(analysis.page))
    if entry.example:
        names = [command.__name__ for command in entry.commands]
        assert names == [text.split()[1] for text in (entry.example, *entry.others) if text]


@pytest.mark.parametrize(
    ("kind", "unit", "value", "other", "shown"),
    [
        ("difference", "dB", 61.25, 58.25, "+3.0 dB"),
        ("difference", "dB", 58.249, 58.25, "+0.0 dB"),  # no minus in front of nothing
        ("energy", "J", 2.0, 1.0, "+3.0 dB"),  # 10 lg 2 = 3.01
        ("amplitude", "N", 1.0, 2.0, "-6.0 dB"),  # 20 lg 2 = 6.02
        ("factor", "sone", 3.0, 2.0, "x 1.5"),
        ("energy", "J", 0.0, 1.0, "–"),
        ("factor", "sone", 1.0, float("nan"), "–"),
        ("difference", "dB", float("nan"), 1.0, "–"),
    ],
)
def test_how_far_two_designs_are_apart(kind, unit, value, other, shown):
    measure = Measure[float](
        key="level", name="level", symbol="", unit=unit, definition="A.", source="",
        read=lambda number: number, deviation=kind,
    )  # fmt: skip
    assert measure.apart(value, other) == shown


def test_a_number_in_the_unit_of_its_own():
    measure = Measure[tuple[float, str]](
        key="value", name="value", symbol="", unit="", definition="A.", source="",
        read=lambda of: of[0], unit_of=lambda of: of[1], digits_of=lambda of: 3,
    )  # fmt: skip
    assert measure.json_key == "value"
    assert measure.on_page((1.5e-5, "m")).split() == ["15.0", "µm"]
    assert measure.cell((1.5e-5, "m")).split() == ["15", "um"]
    assert measure.on_page((0.0123, "")) == "0.0123"
    assert measure.on_page((float("inf"), "m")) == measure.cell((float("nan"), "m")) == "–"


def test_what_does_not_exist_is_null_and_a_dash():
    def made(value: float | None) -> Measure[None]:
        return Measure(
            key="peak_force", name="peak force", symbol="F", unit="N", definition="Largest.",
            source="theory/impact", read=lambda _: value, column=Column("kN", 1e-3, ".2f"),
        )  # fmt: skip

    assert json_of([made(1234.5)], None) == {"peak_force_N": 1234.5}
    assert made(1234.5).head == "peak force [kN]"
    assert made(1234.5).cell(None) == "1.23"
    assert made(1234.5).told(None) == "1.23 kN"
    assert made(1234.5).on_page(None).split() == ["1.234", "kN"]
    for nothing in (None, float("nan"), float("inf")):
        assert json_of([made(nothing)], None) == {"peak_force_N": None}
        assert made(nothing).cell(None) == "–"


def test_a_second_line_stands_in_reports_only():
    steps = Measure[dict](
        key="wall_time",
        unit="s",
        definition="Time.",
        column=Column("s", 1.0, ".3g"),
        page=True,
        remark=lambda _: ", cut off\n5 × real time",
    )
    of = {"wall_time": 2.0}
    assert steps.cell(of) == "2, cut off"
    assert steps.told(of) == "2 s, cut off"
    assert steps.on_page(of).endswith(", cut off\n5 × real time")
