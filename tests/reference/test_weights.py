"""The source grows with a reason only.

Truth: the page ``docs/project/weights.md`` against the tree, and statements counted by hand.
"""

import importlib.util
from pathlib import Path

import pytest

FILE = Path(__file__).parents[2] / "docs" / "weights.py"


def load():
    spec = importlib.util.spec_from_file_location("weights", FILE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


WEIGHTS = load()
MODULE = '''"""Three words here."""

import math

__all__ = ["area"]


def area(radius, *, parts=1):
    """Of a disc."""
    if parts:
        return math.pi * radius**2
    ...
'''
"""Import, assignment, function, if, return and an ellipsis: six statements; six words."""


def test_weight_of_a_module():
    assert WEIGHTS.weight(MODULE) == WEIGHTS.Weight(1, 6, 2, 6, 0)


@pytest.mark.parametrize(("statements", "parameters", "long"), [(60, 8, 0), (61, 8, 1), (60, 9, 1)])
def test_what_is_long(statements, parameters, long):
    given = ", ".join(f"a{i}" for i in range(parameters))
    text = f"def f({given}):\n" + "    x = 1\n" * statements

    assert WEIGHTS.weight(text).long == long


def test_growth_is_seen():
    """2 % of 1000 are 20 statements; a small room may grow by 10; a new one has grown."""
    page = WEIGHTS.fresh(
        "", {"src": {"big": WEIGHTS.Weight(2, 1000), "small": WEIGHTS.Weight(1, 5)}}
    )

    def grown(big, small, **more):
        now = {"big": WEIGHTS.Weight(2, big), "small": WEIGHTS.Weight(1, small)}
        more = {room: WEIGHTS.Weight(1, count) for room, count in more.items()}
        return WEIGHTS.grown(page, {"src": now | more})

    assert grown(1020, 15) == []
    assert grown(1021, 16) == ["src/big", "src/small"]
    assert grown(900, 5, new=11) == ["src/new"]


def test_reasons_stay():
    now = {"src": {"big": WEIGHTS.Weight(2, 12345, 6, 7, 8)}}
    page = WEIGHTS.fresh("# Head\n\n", now, "big: first")
    page = WEIGHTS.fresh(page, now, "big: second")

    assert page.startswith("# Head\n\n## `src`\n")
    assert page.endswith("\n- big: first\n- big: second\n")
    assert WEIGHTS.stated(page) == now


def test_no_room_has_grown_without_a_reason():
    page = WEIGHTS.PAGE.read_text(encoding="utf-8")
    now = {tree: WEIGHTS.rooms(WEIGHTS.ROOT / tree) for tree in WEIGHTS.TREES}

    assert WEIGHTS.grown(page, now) == [], "run: python docs/weights.py --because 'ROOM: WHY'"
