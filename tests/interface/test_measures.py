"""Catalogues of measures: what is described once is whole, and stands wherever it is used."""

import re
from pathlib import Path

import pytest

from klack.analyses.json_results import MEASURES, result_schema
from klack.analyses.measures import Column, Measure, json_of

DOCS = Path(__file__).parents[2] / "docs"
EVERY = [(of, item) for of, measures in MEASURES.items() for item in measures]


@pytest.mark.parametrize(("of", "measure"), EVERY, ids=lambda x: getattr(x, "key", str(x)))
def test_a_measure_is_described_whole(of: str, measure: Measure):
    assert re.fullmatch(r"[a-z0-9_]+", measure.key)
    assert measure.definition.endswith(".")
    assert measure.name[0].islower() or measure.name[:2].isupper()
    assert (DOCS / f"{measure.source}.md").is_file()


def test_keys_are_unique_in_their_catalogue():
    for of, measures in MEASURES.items():
        keys = [item.json_key for item in measures]
        assert len(keys) == len(set(keys)), of


def test_the_schema_has_every_measure():
    parts = result_schema()["$defs"]
    for part, of in (
        ("LevelJson", "impact level"),
        ("DeviationJson", "difference of two levels"),
        ("EventJson", "impact of a stroke"),
        ("VariantJson", "stroke variant"),
        ("ShotJson", "shot"),
    ):
        for item in MEASURES[of]:
            assert parts[part]["properties"][item.json_key]["description"] == item.definition


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
