"""Travel of one body between stops: the nearest stop. Truth: the linear programme, bit for bit."""

from math import inf

import numpy as np
import pytest
from draws import each

from klack.network.travel import StopBound, Travel


def drawn(rng: np.random.Generator) -> list[StopBound]:
    def gap() -> float:
        return float(np.exp(rng.uniform(np.log(1e-9), np.log(1e-2)))) if rng.random() < 0.8 else 0.0

    return [
        StopBound(
            f"stop {i}", *(("needle", None) if rng.random() < 0.5 else (None, "needle")), gap()
        )
        for i in range(rng.integers(1, 5))
    ]


@each("seed", range(100))
def test_the_nearest_stop_is_the_answer_of_the_programme(seed: int):
    rng = np.random.default_rng(seed)
    travel = Travel(drawn(rng))
    wanted = {"needle": float(rng.choice([1.0, -1.0, 2.5, rng.normal()]))}
    direct, whole = travel._of_one_body(wanted), travel._of_a_chain(wanted)
    assert direct is None or direct == whole
    assert travel.highest(wanted) == whole


def test_two_stops_equally_near_are_left_to_the_programme():
    bounds = [StopBound("a", None, "needle", 1e-4), StopBound("b", None, "needle", 1e-4)]
    assert Travel(bounds)._of_one_body({"needle": 1.0}) is None
    assert Travel(bounds).highest({"needle": 1.0})[0] == 1e-4


def test_a_body_between_moving_ones_is_left_to_the_programme():
    """An armature that pushes a needle: both ways add up."""
    chain = Travel(
        [StopBound("a", "needle", "armature", 2e-5), StopBound("b", None, "needle", 1e-4)]
    )
    assert chain._of_one_body({"armature": 1.0}) is None
    assert chain.highest({"armature": 1.0})[0] == pytest.approx(1.2e-4, rel=1e-12)
    assert chain.highest({"armature": -1.0})[0] == inf


def test_a_body_without_stops_goes_anywhere():
    travel = Travel([StopBound("a", None, "needle", 1e-4)])
    assert travel.highest({"housing": 1.0}) == travel._of_a_chain({"housing": 1.0}) == (inf, ())
