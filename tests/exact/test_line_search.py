"""How far to go along a step of Newton's method."""

import pytest

from klack.plasticity.line_search import lowest_share


def test_a_step_that_ends_lower_is_taken_whole():
    """Exact: slopes of a parabola with its minimum at or beyond the end, and round-off."""
    assert lowest_share(lambda share: share - 1.0, 0.0) == 1.0
    assert lowest_share(lambda share: share - 2.0, 0.0) == 1.0
    assert lowest_share(lambda share: 1e-20 * (3.0 * share - 1.0), 1e-18) == 1.0
    assert lowest_share(lambda share: 1.0 + share, 0.0) == 1.0


@pytest.mark.parametrize("steep", [10.0, 1e4])
@pytest.mark.parametrize("kink", [0.01, 0.5, 0.97])
def test_a_step_that_goes_too_far_ends_at_the_minimum(steep, kink):
    """Exact: a slope with a kink, as of points that begin to yield; 1e-4 of the step."""

    def slope(share):
        return -1.0 + 0.2 * share + steep * max(share - kink, 0.0) / (1.0 - kink)

    lowest = kink + (1.0 - 0.2 * kink) / (0.2 + steep / (1.0 - kink))
    assert lowest_share(slope, 1e-12) == pytest.approx(lowest, abs=1.1e-4)
