"""The pages of keys are those of the schema, and the API page's five lines run.

Truth: the pydantic classes that read a case, through ``klack schema``.
"""

import importlib.util
import re
from pathlib import Path

import pytest
from pages import blocks, numbers, printed

from klack.case import case_schema
from klack.case.any_case import valve_case_schema

DOCS = Path(__file__).parents[2] / "docs"


def load(name: str):
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


CASE_KEYS = load("case_keys")


@pytest.mark.slow
@pytest.mark.parametrize("name", list(CASE_KEYS.PAGES))
def test_the_page_is_fresh(name):
    title, about, schema = CASE_KEYS.PAGES[name]
    stored = (DOCS / "reference" / f"{name}.md").read_text(encoding="utf-8")

    assert CASE_KEYS.page(title, about, schema()) == stored, "run: python docs/case_keys.py"


@pytest.mark.parametrize(
    ("name", "make"), [("case-keys", case_schema), ("valve-keys", valve_case_schema)]
)
def test_every_key_of_every_section_has_its_row(name, make):
    text = (DOCS / "reference" / f"{name}.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([^`]+)` \|", text, re.MULTILINE)
    schema = make()
    sections = [schema, *schema["$defs"].values()]

    assert len(rows) >= sum(len(section["properties"]) for section in sections)
    for section in sections:
        assert set(section["properties"]) <= set(rows)


def test_defaults_limits_and_units_are_told():
    text = (DOCS / "reference" / "case-keys.md").read_text(encoding="utf-8")

    assert "| `reduced_step` | time [s], as `40 us` | 20 ns | above 0 |" in text
    assert "| `poisson` | number without unit, as `0.3` | *required* |" in text
    assert re.search(r"\| `count` \| whole number \| .* \| at least 1 \|", text)


def test_links_inside_a_page_lead_to_its_headings():
    for name in CASE_KEYS.PAGES:
        text = (DOCS / "reference" / f"{name}.md").read_text(encoding="utf-8")
        anchors = re.findall(r"\]\(#([^)]+)\)", text)
        heads = {CASE_KEYS.anchor(head) for head in re.findall(r"^## (.*)$", text, re.MULTILINE)}

        assert len(anchors) > 20
        assert set(anchors) <= heads


@pytest.mark.slow
def test_five_lines_of_python():
    page = (DOCS / "reference" / "api.md").read_text(encoding="utf-8")
    code = blocks(page, "python")[0]
    written = numbers(code, r"# ([\d.]+) N, ([\d.]+) us")
    peak, time = re.findall(r"[\d.]+", printed(code, "api.md"))

    # the last digit may differ with the version of the mesher
    assert float(peak) == pytest.approx(written[0], rel=2e-3)
    assert float(time) == pytest.approx(written[1], rel=5e-3)


def test_the_page_of_measures_is_fresh():
    stored = (DOCS / "reference" / "measures.md").read_text(encoding="utf-8")

    assert load("measures_page").page() == stored, "run: python docs/measures_page.py"


def test_the_page_of_results_is_fresh():
    stored = (DOCS / "reference" / "json.md").read_text(encoding="utf-8")

    assert load("json_page").page() == stored, "run: python docs/json_page.py"
