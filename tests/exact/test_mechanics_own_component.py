"""The component of the how-to page slows down as its formula says, compiled and in Python."""

import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

pytestmark = pytest.mark.filterwarnings("ignore::klack.network.checks.LooseBodyWarning")

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"


@pytest.fixture(scope="module")
def example() -> Iterator[ModuleType]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(HOW_TO)
        yield import_module("eddy_brake")


def test_the_brake_slows_down_by_its_formula(example):
    speed, residual = example.slow_down(example.EddyBrake(damping=2.0, critical_speed=0.5))

    # second order: (h/tau)^2 with tau = m/c = 1.5 ms
    assert example.time_to(speed, 2.0, 0.5) == pytest.approx(2e-3, rel=1e-7)
    assert residual < 1e-12


def test_plain_python_gives_the_same(example):
    settings = {"damping": 2.0, "critical_speed": 0.5}

    compiled = example.slow_down(example.EddyBrake(**settings))
    plain = example.slow_down(example.PlainEddyBrake(**settings))

    assert plain[0] == pytest.approx(compiled[0], rel=1e-12)  # order of operations


def test_the_page_shows_the_code_that_runs():
    source = (HOW_TO / "eddy_brake.py").read_text()
    page = (HOW_TO / "add-a-component.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)

    assert len(blocks) == 4
    lines = {line.split("#")[0].strip() for line in source.splitlines()}
    for block in blocks[:3]:
        assert {line.strip() for line in block.splitlines()} <= lines
