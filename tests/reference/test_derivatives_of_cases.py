"""Derivatives of strokes with every number of a case; truth: strokes with that number changed.

The comparison is that of ``benchmarks/derivatives.py``, which goes over all shipped cases.
"""

import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
COMPARED = runpy.run_path(str(ROOT / "benchmarks" / "derivatives.py"))["compared"]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize(
    ("name", "count", "deviation"),
    [("relief_on_pipe", 24, 1e-3), ("remanent_magnet", 24, 1e-4), ("held_open", 15, 1e-4)],
)
def test_every_number_of_a_valve_has_the_derivatives_of_its_strokes(name, count, deviation):
    """Up to the first touch: supply and start pressures, lines, remanence, magnets, springs."""
    path = ROOT / "docs" / "how-to" / f"{name}.yaml"
    found = list(COMPARED(path, duration=3e-4, enough=deviation))

    compared = [item for item in found if not item.refused]
    assert len(compared) == count
    for item in compared:
        assert item.deviation < deviation, item
