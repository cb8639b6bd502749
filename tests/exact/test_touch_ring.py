"""Whether points of first touch are a ring; truth: where they were put."""

import numpy as np
import pytest

from klack.assembling.touch_ring import goes_round

TURN = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)


def ring(radius, centre=(0.0, 0.0), turn=TURN):
    x, y = centre
    return np.column_stack(
        [x + radius * np.cos(turn), y + radius * np.sin(turn), np.full(turn.size, 1e-3)]
    )


@pytest.mark.parametrize("centre", [(0.0, 0.0), (3e-3, -1e-3)], ids=["centred", "off-axis"])
def test_a_ring_is_one_wherever_its_centre_is(centre):
    assert goes_round(ring(1e-3, centre))
    assert goes_round(ring(1e-3, centre, TURN[::4]))


def test_a_spot_of_many_points_is_none():
    """The top of a meshed dome: its centre and four rings of up to 48 points."""
    rings = [ring(r * 1e-5, turn=TURN[:: 8 // r]) for r in (1, 2, 4, 8)]
    spot = np.vstack([[[0.0, 0.0, 1e-3]], *rings])

    assert len(spot) > 40
    assert not goes_round(spot)


def test_some_pads_are_none():
    at = np.concatenate([TURN[:6], TURN[16:22], TURN[32:38]])

    assert not goes_round(ring(1e-3, turn=at))


def test_few_points_are_none():
    assert not goes_round(ring(1e-3, turn=TURN[::12]))
    assert not goes_round(np.zeros((0, 3)))
