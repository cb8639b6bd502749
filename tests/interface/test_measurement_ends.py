"""Truth: a valve that stays closed until it opens has touched nothing before."""

import numpy as np
import pytest

from klack.measurement.stop_levels import SmoothLift, find_touches


@pytest.mark.parametrize("end", [slice(0, 3), slice(-3, None)])
def test_the_noisy_ends_of_a_smoothed_record_make_no_impacts(end):
    lift = np.zeros(400)
    lift[150:250] = 80e-6
    lift[end] = 5e-6  # above twice the least height
    smooth = SmoothLift(
        lift=lift,
        velocity=np.gradient(lift, 1e-6),
        noise=1e-6,
        lift_noise=0.3e-6,
        velocity_noise=0.03,
        half=10,
        least_height=1.5e-6,
    )
    touches = find_touches(smooth, {"seat": 0.0})

    assert [(touch.index, touch.rebounds) for touch in touches] == [(250, False)]
