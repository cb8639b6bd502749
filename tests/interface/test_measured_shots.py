"""Shots against measured drops.

Truth: throws under a constant force, where the rebound of a drop with restitution e and speed v
rises ``(e v)^2 / 2 a``, and the mean of the highest of m draws, counted out.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.comparison.shots import compare_shots, mean_of_highest
from klack.analyses.comparison.shots_summary import MEASURED_SHOTS, bias_sentence, drop_verdict
from klack.analyses.shots.analysis import SHOTS
from klack.analyses.shots.record import RuleVerdict, ShotColumns, ShotsStudy, ShotTraces
from klack.case.measurement import CaseMeasurement
from klack.cli.main import main
from klack.errors import InputError
from klack.measurement.channels import LiftSensor
from klack.measurement.lift_sensor import sense

SPEED, FORCE, MASS = 0.3, 6.0, 5e-3
DECELERATION = FORCE / MASS
DROPS, RATE, TOUCH, NOISE = 8, 400e3, 0.2e-3, 0.05e-6
SECTION = CaseMeasurement.model_validate(
    {"channels": {"lift": "drop_*"}, "zero": "none", "sensor": {"bandwidth": "50 kHz"}}, context={}
)


def height(time: np.ndarray, restitution: float) -> np.ndarray:
    """Height of a drop that touches at zero: bounces without a time of contact."""
    falling = -SPEED * time - 0.5 * DECELERATION * time**2
    result, start, speed = np.where(time < 0.0, falling, 0.0), 0.0, SPEED
    for _ in range(4):
        speed *= restitution
        flight = 2.0 * speed / DECELERATION
        t = time - start
        up = speed * t - 0.5 * DECELERATION * t**2
        result = np.where((t >= 0.0) & (t <= flight), up, result)
        start += flight
    return result


def columns(restitution: np.ndarray) -> ShotColumns:
    count = restitution.size
    values = dict.fromkeys(ShotColumns.__dataclass_fields__, np.zeros(count))
    values |= {
        "force": np.full(count, FORCE),
        "approach_speed": np.full(count, SPEED),
        "restitution": restitution,
        "rebound_height": 0.5 * (restitution * SPEED) ** 2 / DECELERATION,
    }
    return ShotColumns(**values)


def traces(restitution: np.ndarray) -> ShotTraces:
    time = np.linspace(0.0, 3e-3, 601)
    rows = np.array([height(time, e) for e in restitution], dtype=np.float32)
    rows[:, time > 1.2e-3] = np.nan  # shots end
    return ShotTraces(time=time, height=rows, force_time=time[:2], force=rows[:, :2])


def shots(restitution: np.ndarray) -> ShotsStudy:
    centric = np.array([0.95])
    return ShotsStudy(
        case="made-up",
        title="Thrown up and down",
        description="",
        case_text="shots: {}\n",
        version="0.1.0",
        versions={},
        created="2025-01-31T12:00:00+00:00",
        wall_time=1.0,
        shot_time=1.0,
        stage_times={},
        seed=1,
        workers=1,
        resumed=0,
        speed=SPEED,
        start_height=0.0,
        step=4e-8,
        distributions={},
        surfaces="",
        guide="",
        mass=MASS,
        modes=(1, 1),
        points=1,
        approach=0.0,
        shots=columns(restitution),
        centric=columns(centric),
        shot_traces=traces(restitution),
        centric_traces=traces(centric),
        highest=int(np.argmax(restitution)),
        rule=RuleVerdict(
            restitution_bias=0.0,
            rebound_height_bias=0.0,
            relative_restitution_bias=0.0,
            relative_rebound_height_bias=0.0,
            rank=0,
            holds=True,
            sentence="",
        ),
        pressures={},
    )


def record(path: Path, restitution: np.ndarray) -> Path:
    time = np.arange(0.0, 1.2e-3, 1.0 / RATE)
    fine = np.arange(0.0, 1.2e-3, 1e-7)
    random = np.random.default_rng(3)
    sensor = LiftSensor(bandwidth=50e3)
    drops = [
        np.interp(time, fine, sense(fine, height(fine - TOUCH, e), sensor)) for e in restitution
    ]
    table = np.array(
        [1e6 * time, *(1e6 * (x + NOISE * random.standard_normal(x.size)) for x in drops)]
    )
    names = ["time [us]", *(f"drop_{i + 1:02d} [um]" for i in range(len(drops)))]
    np.savetxt(path, table.T, fmt="%.4f", delimiter=",", header=",".join(names), comments="")
    return path


SAME = np.linspace(0.80, 0.94, DROPS)


@pytest.fixture(scope="module")
def drops(tmp_path_factory) -> Path:
    return record(tmp_path_factory.mktemp("drops") / "drops.csv", SAME)


def test_the_mean_of_the_highest_is_counted_out():
    values = np.array([3.0, 1.0, 2.0])
    heights = np.array([1.0, 3.0, 2.0])  # the highest shot has the value 1
    # 9 pairs: the highest of 5 is the third shot, of 3 the second, of 1 the first
    assert mean_of_highest(values, heights, 2) == pytest.approx((5 * 1 + 3 * 2 + 1 * 3) / 9)
    assert mean_of_highest(values, heights, 1) == pytest.approx(2.0)
    lost = np.append(values, 7.0), np.append(heights, np.nan)
    assert mean_of_highest(*lost, 2) == pytest.approx(14 / 9)


@pytest.mark.slow
def test_drops_are_read_as_they_were_thrown(drops):
    found = compare_shots(shots(SAME), [drops], SECTION)
    restitution, risen = found.distributions

    assert [d.name for d in found.distributions] == ["restitution", "rebound height"]
    # noise of 50 nm on flights of 0.4 ms, 160 samples
    for values in (restitution.measured, restitution.computed):
        assert values == pytest.approx(SAME, abs=0.005)
    expected = 0.5 * (SAME * SPEED) ** 2 / DECELERATION
    assert risen.measured == pytest.approx(expected, rel=0.01)
    assert risen.computed == pytest.approx(expected, rel=0.01)
    assert restitution.centred == pytest.approx(0.95, abs=0.005)
    assert restitution.measured_highest == pytest.approx(SAME[-1], abs=0.005)
    assert found.approach_speed.measured == pytest.approx(SPEED, rel=0.005)
    assert "agree" in drop_verdict(found)
    # evenly spread below it: the highest lies below the centred one
    assert restitution.highest_bias < 0
    assert "on average" in bias_sentence(found)


@pytest.mark.slow
def test_other_drops_are_told_apart(drops):
    found = compare_shots(shots(SAME - 0.12), [drops], SECTION)
    restitution, _ = found.distributions
    # shifted by 0.12 of a range of 0.14: six or seven of eight lie below all of the others
    assert restitution.statistic == pytest.approx(6 / 8, abs=0.13)
    assert restitution.significance < 0.05
    assert "differ in the restitution" in drop_verdict(found)


def test_drops_that_tell_nothing_are_one_message(tmp_path):
    path = record(tmp_path / "few.csv", SAME[:2])
    with pytest.raises(InputError, match="at least 3"):
        compare_shots(shots(SAME), [path], SECTION)


@pytest.mark.slow
def test_the_command_stores_and_reports(drops, tmp_path, capsys):
    SHOTS.save(shots(SAME), tmp_path)
    words = ["compare", str(tmp_path), "--measurement", str(drops), "--case", "demo-shots"]
    assert main([*words, "--json", str(tmp_path / "numbers.json")]) == 0

    numbers = json.loads((tmp_path / "numbers.json").read_text())
    assert numbers["drops"] == DROPS
    assert set(numbers["distribution"]) == {"restitution", "rebound_height_m"}
    restitution = numbers["distribution"]["restitution"]
    assert restitution["measured"]["quantile_0.5"] == pytest.approx(np.median(SAME), abs=0.005)
    assert restitution["highest_bias"] == pytest.approx(
        restitution["expected_highest"] - restitution["centred"]
    )
    assert f"against {DROPS} measured drops" in capsys.readouterr().out
    stored = MEASURED_SHOTS.load(tmp_path / "measured")
    assert stored.distributions[0].measured == pytest.approx(SAME, abs=0.005)
    page = (tmp_path / "measured" / "report.html").read_text()
    for words in ("Distribution of the restitution", "highest rebound, measured", "mean highest"):
        assert words in page
    assert (tmp_path / "measured" / "report.pdf").read_bytes().startswith(b"%PDF")
