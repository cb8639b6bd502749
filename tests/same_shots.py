"""Shots computed in two ways: their columns side by side."""

from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from klack.analyses.shots.one_shot import ShotOutcome
from klack.analyses.shots.record import ShotColumns

ROUND_OFF = 1e-12
"""Of a time, a speed, an energy: other machine code sums in another order."""


def columns_of(outcomes: Sequence[ShotOutcome]) -> ShotColumns:
    return ShotColumns.of([outcome.numbers for outcome in outcomes])


def same(one: ShotColumns, other: ShotColumns, error: float = 0.0) -> None:
    for field in fields(ShotColumns):
        np.testing.assert_allclose(
            getattr(one, field.name), getattr(other, field.name), rtol=error, atol=error
        )
