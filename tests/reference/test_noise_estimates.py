"""Old estimates of sound against new ones: sums, what the page says, and a column made again."""

import re
from pathlib import Path

import numpy as np
import pytest

import klack
from klack.analyses.noise.in_machine import in_machine, installed
from klack.analyses.noise.source import sources_of
from klack.case.reader import find_case

PAGE = Path(__file__).parents[2] / "docs" / "theory" / "radiation.md"


@pytest.fixture(scope="module")
def table() -> tuple[list[str], np.ndarray]:
    text = PAGE.read_text(encoding="utf-8").partition("made by docs/noise_estimates.py")[2]
    rows = re.findall(r"^\| ([\d.]+ k?Hz|sum) \| (.*) \|$", text.partition("<!-- end")[0], re.M)
    return [name for name, _ in rows], np.array([row.split(" | ") for _, row in rows], dtype=float)


def test_the_table_is_what_the_page_says_of_it(table) -> None:
    """Bands make the sums; where each estimate is 10 dB off."""
    names, level = table
    assert len(names) == 24
    sums = 10.0 * np.log10((10.0 ** (level[:-1] / 10.0)).sum(axis=0))
    assert level[-1] == pytest.approx(sums, abs=0.1)
    unity, piston = (level[:, k] - level[:, 2] for k in (0, 1))
    sheet = level[:, 3] - level[:, 4]
    eight = names.index("8 kHz")
    for apart in (unity, piston):
        assert np.all(apart[: eight + 1] > 10.0)
        assert np.all(apart[eight + 1 : -1] < 10.0)
    wrong = [name for name, x in zip(names[:-1], sheet, strict=False) if abs(x) > 9.0]
    assert wrong == ["100 Hz", "500 Hz", "8 kHz", "10 kHz", "12.5 kHz", "16 kHz"]
    text = PAGE.read_text(encoding="utf-8")
    assert f"{unity[-1]:.1f} and {piston[-1]:.1f} dB too loud, the sheet {sheet[-1]:.1f} dB" in text


@pytest.mark.slow
def test_the_sound_through_the_machine_is_that_of_a_run(table) -> None:
    """Without the loudness of the whole command."""
    names, level = table
    (source,) = sources_of(klack.run_stroke(find_case("demo-mounted")).record)
    found = installed(source)
    assert found is not None
    bands = in_machine(found, source.speed)[0].ears[0].bands
    known = bands.level_re((20e-6) ** 2)[-len(names) + 1 :]
    assert bands.middle[-1] == pytest.approx(10**4.2, rel=1e-6)
    assert known == pytest.approx(level[:-1, 4], abs=0.1)
