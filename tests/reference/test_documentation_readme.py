"""The Python example of the README runs, and its number is the one written beside it."""

import contextlib
import io
import re
from pathlib import Path

import pytest

README = Path(__file__).parents[2] / "README.md"


@pytest.mark.slow
def test_python_example_of_the_readme():
    code = re.search(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
    assert code is not None
    written = re.search(r"# ([\d.]+) N", code.group(1))
    assert written is not None
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(code.group(1), str(README), "exec"), {})
    # the last digit may differ with the version of the mesher
    assert float(out.getvalue().split()[0]) == pytest.approx(float(written.group(1)), rel=2e-3)


def test_readme_has_exactly_two_commands_for_setting_up():
    section = README.read_text().split("## Two commands")[1].split("\n## ")[0]
    blocks = re.findall(r"```\n(.*?)\n```", section, re.DOTALL)
    assert blocks == ["pip install uv && uv run klack demo", "uv run --group dev pytest"]
