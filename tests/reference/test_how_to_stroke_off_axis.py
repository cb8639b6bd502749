"""Page on strokes off the axis; truth: what its example prints."""

import pytest
from pages import HOW_TO, blocks, printed

PAGE = HOW_TO / "stroke-off-axis.md"


@pytest.mark.slow
def test_the_example_prints_what_the_page_shows(monkeypatch):
    monkeypatch.chdir(PAGE.parent)
    text = PAGE.read_text(encoding="utf-8")
    (code,), (shown,) = blocks(text, "python"), blocks(text, "text")

    assert printed(code, str(PAGE)) == shown


def test_the_sections_of_the_page_are_those_of_its_case():
    text, case = PAGE.read_text(encoding="utf-8"), PAGE.with_name("half_section_stroke.yaml")
    (shown,) = blocks(text, "yaml")

    assert shown in case.read_text(encoding="utf-8")
