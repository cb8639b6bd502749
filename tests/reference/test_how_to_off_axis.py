"""Pages on what is off-axis; truth: what their examples print."""

import io
import re
from contextlib import redirect_stdout
from pathlib import Path

import pytest

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"


@pytest.mark.parametrize(
    "name",
    ["off-axis-magnet-and-seat", pytest.param("off-axis-impact", marks=pytest.mark.slow)],
)
def test_the_example_prints_what_the_page_shows(name):
    text = (HOW_TO / f"{name}.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    (shown,) = re.findall(r"```text\n(.*?)```", text, re.DOTALL)
    printed = io.StringIO()
    with redirect_stdout(printed):
        exec(compile(code, name, "exec"), {})

    assert printed.getvalue() == shown
