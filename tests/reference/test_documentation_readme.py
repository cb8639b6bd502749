"""The Python example of the README runs, and its number is the one written beside it."""

import re
from pathlib import Path

import pytest
from pages import blocks, numbers, printed

README = Path(__file__).parents[2] / "README.md"


@pytest.mark.slow
def test_python_example_of_the_readme():
    code = blocks(README.read_text(), "python")[0]
    found = float(printed(code, str(README)).split()[0])
    # the last digit may differ with the version of the mesher
    assert found == pytest.approx(numbers(code, r"# ([\d.]+) N")[0], rel=2e-3)


def test_readme_has_exactly_two_commands_for_setting_up():
    section = README.read_text().split("## Two commands")[1].split("\n## ")[0]
    blocks = re.findall(r"```\n(.*?)\n```", section, re.DOTALL)
    assert blocks == ["pip install uv && uv run klack demo", "uv run --group dev pytest"]
