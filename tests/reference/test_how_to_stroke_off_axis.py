"""Page on strokes off the axis; truth: what its example prints."""

import io
import re
from contextlib import redirect_stdout
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "stroke-off-axis.md"


@pytest.mark.slow
def test_the_example_prints_what_the_page_shows(monkeypatch):
    monkeypatch.chdir(PAGE.parent)
    text = PAGE.read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    (shown,) = re.findall(r"```text\n(.*?)```", text, re.DOTALL)
    printed = io.StringIO()
    with redirect_stdout(printed):
        exec(compile(code, str(PAGE), "exec"), {})

    assert printed.getvalue() == shown


def test_the_sections_of_the_page_are_those_of_its_case():
    text, case = PAGE.read_text(encoding="utf-8"), PAGE.with_name("half_section_stroke.yaml")
    (shown,) = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)

    assert shown in case.read_text(encoding="utf-8")
