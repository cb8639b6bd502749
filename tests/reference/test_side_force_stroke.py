"""A stroke of finite-element bodies whose magnet and seat act across the axis.

Truth: the closed permeance of the ring and area of the seat at the placement of every record; the
same stroke without these keys where the needle is centred; the energy balance.
"""

from math import hypot
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.stroke.axis import axis_over_time_chart
from klack.analyses.stroke.content import stroke_content
from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import read_valve_case
from klack.errors import InputError
from klack.hydraulics.off_axis_seat import SeatFace, flow_area
from klack.magnetics.off_axis_gap import guide_ring

CASE = Path(__file__).parents[2] / "docs" / "how-to" / "guided_magnet.yaml"
TEXT = CASE.read_text(encoding="utf-8")
SHOTS = "shots: {count: 50, seed: 1}\n"
PLACED = "placement: {seed: 3}\n"


def stroke(*changes):
    text = TEXT.replace("duration: 1 ms", "duration: 300 us").replace("[wet, dry]", "[wet]")
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return run_stroke(read_valve_case(text, CASE))


@pytest.mark.slow
def test_a_magnet_pulls_the_needle_of_a_stroke_aside():
    study = stroke((SHOTS, PLACED))
    result = study.reference.result

    told = {name: channel.values for name, channel in result.channels.items()}
    low, high = (np.column_stack([told[f"guide {k} {a}"] for a in "xy"]) for k in (1, 2))
    slope = (high - low) / 9e-3
    # the records of guides are those of the same moments; the flux of the first is of a step before
    for k in range(20, len(result.time), 40):
        middle = low[k] + slope[k] * (16.75e-3 - 4e-3) - (20e-6, 0.0)
        P, slopes = guide_ring(5e-3, 5.2e-3, 3.5e-3, [*middle, *-slope[k]])
        pull = 0.5 * told["coil flux"][k] ** 2 / P**2 * slopes[:2]
        side = [told[f"coil side force {a}"][k] for a in "xy"]
        np.testing.assert_allclose(side, pull, rtol=1e-4, atol=1e-5 * hypot(*pull))
    assert max(-told["coil side force x"]) > 1.0  # [N], away from the axis of the bore
    aside = np.mean(told["guide 2 x"][-100:])
    assert aside < -2e-6  # so it is held at that side of its guide
    face = SeatFace(shape="ball", radius=0.884e-3, angle=float(np.arccos(0.884 / 1.25)))
    k = len(result.time) - 60
    lift = told["restriction lift"][k]
    offset = low[k] + slope[k] * (-0.884e-3 - 4e-3)
    assert told["restriction area"][k] == pytest.approx(
        min(flow_area(face, [lift, *offset, *-slope[k]]), 0.25 * np.pi * 0.9e-3**2), rel=1e-6
    )
    assert abs(result.books.relative_residual) < 1e-8
    assert result.books.supplies["coil side force"] != 0.0
    assert [panel.y.label for panel in axis_over_time_chart(study).panels][-1] == "side force"
    limits = dict(stroke_content(study).limits)
    assert "only 'coil' and 'restriction' act across the axis" in limits["Contact"]


@pytest.mark.slow
def test_a_centred_stroke_is_that_without_side_forces():
    ring, seat = "          off_axis: {height: 16.75 mm", "      off_axis: {height: -0.884 mm}\n"
    ours = stroke((", eccentricity: 20 um", ""))
    plain = stroke((ring + ", eccentricity: 20 um}\n", ""), (", tilts: true", ""), (seat, ""))

    first, same = (study.reference.result.events[0] for study in (ours, plain))
    assert "restriction side force x" not in plain.reference.result.channels
    assert first.time == pytest.approx(same.time, rel=1e-10)
    # 1e-12 N more preload changes the peak by 5e-7 without them, 1e-10 N by 1.4e-5
    assert first.peak_force == pytest.approx(same.peak_force, rel=1e-4)
    assert first.restitution == pytest.approx(same.restitution, rel=1e-4)
    assert "off_axis and tilts" in dict(stroke_content(plain).limits)["Contact"]


@pytest.mark.slow
def test_a_height_beside_the_needle_is_refused():
    with pytest.raises(InputError, match=r"z = 40 mm.*-1.25 mm to 18.5 mm"):
        stroke(("height: -0.884 mm", "height: 40 mm"))
