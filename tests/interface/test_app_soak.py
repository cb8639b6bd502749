"""Many slider moves and page changes in bounded memory: a short run of benchmarks/app_soak.py."""

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("playwright.sync_api")
pytest.importorskip("nicegui")
sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from app_soak import Memory, soaking

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium here"),
]


@pytest.fixture(scope="module")
def soaked() -> Iterator[tuple[list[Memory], list[Memory]]]:
    """Memory before and after 50 moves, and after 6 and 12 page changes, on the overview."""
    with soaking("demo-valve-axisymmetric") as found:
        found.open_sliders()
        for share in np.linspace(0.02, 0.98, 20):  # every reach once, all kinds of answers
            found.move(float(share))
        found.move(0.5)  # both times the same answer: others have other parts in the page
        moves = [found.memory()]
        for number in range(50):
            found.move((0.618 * number) % 1.0)
        found.move(0.5)
        moves.append(found.memory())
        pages = []
        for _ in range(2):
            found.change_pages(6)
            pages.append(found.memory())
        yield moves, pages


def _grows(memories: list[Memory], what: str) -> Any:
    return getattr(memories[1], what) / getattr(memories[0], what)


def test_moves_leave_nothing_behind(soaked):
    moves, _ = soaked

    assert _grows(moves, "heap") < 1.2
    assert _grows(moves, "nodes") < 1.05
    assert _grows(moves, "listeners") < 1.05
    assert _grows(moves, "worker") < 1.2
    assert _grows(moves, "server") < 1.2


def test_page_changes_leave_nothing_behind(soaked):
    _, pages = soaked

    assert _grows(pages, "heap") < 1.2  # once collected: before, it is what the browser defers
    assert _grows(pages, "nodes") < 1.2
    assert pages[1].documents <= pages[0].documents
    assert _grows(pages, "server") < 1.2
