"""The page about many points: its examples run and print what it shows.

Truth of its number: the work of the magnet and of the spring, as the page states it.
"""

import re
from math import sqrt
from pathlib import Path
from typing import Any

import pytest
from pages import blocks, printed
from quoted_output import compare

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "how-to" / "many-points.md").read_text(encoding="utf-8")
CODE = blocks(PAGE, "python")


def test_the_examples_of_the_page(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(ROOT)
    names: dict[str, Any] = {}
    (quoted,) = re.findall(r"```\n(small_valve, .*?)```", PAGE, re.DOTALL)
    compare(quoted, printed(CODE[0], "many-points.md", names), "many-points.md")

    speeds = dict(
        zip(names["table"][names["preload"]], names["table"]["opening.approach_speed"], strict=True)
    )
    for preload, speed in speeds.items():
        # 0.07 uJ of the spring in the seat come back: 2e-5 of the slowest one
        by_hand = sqrt(2.0 * ((35.0 - preload) * 100e-6 - 50e-6) / 3e-3)
        assert speed == pytest.approx(by_hand, rel=4e-4)
    written = re.search(r"=\n?\s*([\d.]+) m/s", PAGE)
    assert written is not None
    assert float(written[1]) == pytest.approx(speeds[16.0], abs=1e-4)

    for code in CODE[1:]:
        exec(compile(code, "many-points.md", "exec"), names)
        assert len(names["table"]) == 2
        assert not names["table"].failed.any()
