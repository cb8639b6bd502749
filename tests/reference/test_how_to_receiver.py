"""The page on receivers: its Python prints what the page says.

Truth: the numbers on the page, from the same version: a change detector; the coupling itself is
checked against exact bodies elsewhere.
"""

import numpy as np
import pytest
from pages import HOW_TO, ROOT, blocks, printed

from klack.acoustics.receivers.measured import measured_receiver
from klack.acoustics.receivers.opening import read_responses

PAGE = (HOW_TO / "bring-a-receiver.md").read_text(encoding="utf-8")


def test_python_of_the_page_prints_what_stands_below(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every block after the other, in the folder of the project."""
    monkeypatch.chdir(ROOT)
    names: dict = {}
    codes, shown = blocks(PAGE, "python"), blocks(PAGE, "text")
    assert len(codes) == len(shown) == 3
    for code, expected in zip(codes, shown, strict=True):
        assert printed(code, "bring-a-receiver.md", names) == expected
    joined, block = names["joined"], names["block"]
    # the source of the page is one: its free velocity is that of its blocked force
    own = (block.mobility @ block.blocked_force[..., None])[..., 0]
    assert own == pytest.approx(block.free_velocity, rel=1e-12, abs=0.0)
    assert (joined.energy_density().sum(axis=1) > 0.0).all()


def test_the_responses_of_the_page_are_without_doubt(recwarn: pytest.WarningsRecorder) -> None:
    """Reciprocal within its noise, and no warning."""
    bracket = measured_receiver(
        read_responses(HOW_TO / "bracket.csv"), {"front": "front", "rear": "rear"}
    )
    assert not recwarn.list
    Y = bracket.mobility
    assert np.abs(Y[:, 0, 1] / Y[:, 1, 0] - 1.0).max() < 0.03
