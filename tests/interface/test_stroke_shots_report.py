"""Statistics and report of many strokes; the truth is a made-up study of forty strokes."""

import json
import re
from dataclasses import replace
from html import unescape

import numpy as np
import pytest
from json_schema_check import require_documented

import klack
from klack.analyses.stroke_shots.analysis import STROKE_SHOTS, stroke_shots_to_json
from klack.analyses.stroke_shots.record import (
    StopColumns,
    StrokeColumns,
    StrokeShotsStudy,
    VariantShots,
    highest_rebound,
)
from klack.analyses.stroke_shots.run import missing_notes
from klack.analyses.stroke_shots.scatter import (
    correlations,
    median_interval,
    scatter_ratio,
    scattered,
    stroke_answers,
)
from klack.errors import InputError
from klack.exchange.results.dataset import dataset_of
from klack.report.html import render_html
from klack.report.pdf import render_pdf

COUNT = 40
RANDOM = np.random.default_rng(5)
OFF = np.abs(RANDOM.normal(0.0, 3e-6, COUNT))
NOISE = RANDOM.normal(0.0, 1.0, COUNT)
NAN = float("nan")


def stop(count: int, **given: float | np.ndarray) -> StopColumns:
    values: dict[str, float | np.ndarray] = {
        "eccentricity": 0.0,
        "direction": 0.4,
        "tilt": 2e-4,
        "tilt_direction": 1.0,
        "approach_speed": 0.7,
        "peak_force": 300.0,
        "contact_time": 28e-6,
        "impulse": 4.5e-3,
        "restitution": 0.95,
        "rebound_height": 5e-5,
        "energy_loss": 1e-4,
        "impacts": 2.0,
        **given,
    }
    return StopColumns(**{name: np.full(count, value, float) for name, value in values.items()})


def whole(count: int, **given: float | np.ndarray) -> StrokeColumns:
    values: dict[str, float | np.ndarray] = {
        "eccentricity": 1e-6,
        "direction": 0.0,
        "tilt": 1e-4,
        "tilt_direction": 0.0,
        "friction": 0.1,
        "opening_time": 1.5e-4,
        "closing_time": 7e-4,
        "impacts": 3.0,
        "impact_loss": 2e-4,
        "guide_loss": 1e-5,
        "injected_energy": 1e-4,
        "radiated_energy": NAN,
        "energy_residual": 1e-13,
        **given,
    }
    return StrokeColumns(**{name: np.full(count, value, float) for name, value in values.items()})


def variant(name: str, spread: float, **seat: float | np.ndarray) -> VariantShots:
    """Rebound falls with the square of the eccentricity; the force scatters by ``spread`` [N]."""
    given = {
        "eccentricity": OFF,
        "peak_force": 300.0 + spread * NOISE,
        "rebound_height": 5e-5 * (1.0 - (OFF / 2e-5) ** 2),
        "restitution": 0.95 - OFF / 1e-3,
        **seat,
    }
    time = np.linspace(0.0, 1e-3, 11)
    return VariantShots(
        name=name,
        label=f"{name}, 6 + 6 modes",
        strokes=whole(COUNT, closing_time=7e-4 + 1e-6 * NOISE),
        stops={"seat": stop(COUNT, **given), "opening": stop(COUNT, eccentricity=OFF)},
        centric=whole(1, eccentricity=0.0),
        centric_stops={"seat": stop(1), "opening": stop(1)},
        time=time,
        lift=np.ones((COUNT, 1), np.float32) * np.sin(time * 3e3).astype(np.float32) * 1e-4,
        centric_lift=(1e-4 * np.sin(time * 3e3)).astype(np.float32),
        failures={},
    )


def study(**more: object) -> StrokeShotsStudy:
    given: dict = {
        "title": "<b>A valve</b> #1 $x$",
        "description": "",
        "version": "0.1.0",
        "versions": {},
        "created": "2026-01-01T00:00:00+00:00",
        "wall_time": 2.0,
        "stage_times": {"strokes": 1.0},
        "case": "made-up",
        "case_text": "klack: 1\n",
        "seed": 1,
        "workers": 2,
        "carry": False,
        "resumed": 0,
        "stroke_time": 1.0,
        "duration": 1e-3,
        "needle": "needle",
        "seat": "seat",
        "opening_stop": "opening",
        "guide": "shaft at 4 mm and 13 mm",
        "distributions": {"eccentricity and tilt": "axis within the clearance"},
        "largest_eccentricity": {"seat": 8e-6, "opening": 9e-6},
        "mass": 3e-3,
        "points": {"seat": 160, "opening": 112},
        "variants": {"wet": variant("wet", 4.0), "dry": variant("dry", 10.0)},
    }
    return StrokeShotsStudy(**{**given, **more})


def test_the_ratio_of_two_scatters_is_that_of_their_draws():
    """Proportional values have their factor, in every sample drawn from them."""
    values = RANDOM.normal(5.0, 2.0, 60)
    found = scatter_ratio(0.4 * values + 7.0, values)

    assert (found.ratio, found.pairs) == (pytest.approx(0.4), 60)
    assert (found.low, found.high) == pytest.approx((0.4, 0.4))
    # strokes that have a value in one variant alone are left out
    holed = values.copy()
    holed[:10] = NAN
    assert scatter_ratio(holed, values).pairs == 50
    assert scatter_ratio(holed, values).ratio == pytest.approx(1.0)
    assert np.isnan(scatter_ratio(values, np.ones(60)).ratio)
    assert np.isnan(scatter_ratio(values[:4], values[:4]).low)


def test_the_interval_of_a_ratio_covers_it():
    """Independent normal values: the interval should hold the true ratio in 95 % of all sets.

    Bootstrap percentiles of 50 values hold it in about 93 %; 200 sets have a deviation of 1.8 %.
    """
    random = np.random.default_rng(1)
    held = 0
    for _ in range(200):
        found = scatter_ratio(random.normal(0.0, 0.5, 50), random.normal(0.0, 1.0, 50))
        held += found.low <= 0.5 <= found.high
    assert 0.88 <= held / 200 <= 0.99


def test_the_median_lies_between_two_values_of_the_sample():
    values = np.arange(1.0, 51.0)
    # binomial: ranks 18 and 33 of 50 hold the median in 96.7 % (David and Nagaraja, table)
    assert median_interval(values) == (18.0, 33.0)
    assert median_interval(np.append(values, NAN)) == (18.0, 33.0)
    assert median_interval(values[:4]) == (-np.inf, np.inf)


def test_the_highest_rebound_is_found_and_placed():
    shots = variant("dry", 1.0)
    found = highest_rebound(shots, "seat")
    assert found.stroke == int(np.argmin(OFF)) == found.most_centred
    assert found.place == 1
    assert found.is_most_centred
    assert found.relative_height_bias == pytest.approx(-((OFF.min() / 2e-5) ** 2))

    height = np.array(shots.stops["seat"].rebound_height)
    third = int(np.argsort(OFF)[2])
    height[third] = 6e-5
    height[int(np.argmin(OFF))] = NAN  # the most centred one has no rebound
    moved = replace(shots, stops={"seat": replace(shots.stops["seat"], rebound_height=height)})
    found = highest_rebound(moved, "seat")
    assert (found.stroke, found.place, found.count) == (third, 2, COUNT - 1)
    assert found.most_centred == int(np.argsort(OFF)[1])
    assert not found.is_most_centred
    none = replace(shots.stops["seat"], rebound_height=np.full(COUNT, NAN))
    assert highest_rebound(replace(shots, stops={"seat": none}), "seat") is None


@pytest.mark.parametrize("known", [0, 1, 4, 5, COUNT])
def test_a_correlation_of_few_or_equal_values_is_no_number(known):
    """Truth: Spearman's coefficient of fewer than five values, or of equal ones, says nothing."""
    shots = variant("dry", 1.0)
    few = np.where(np.arange(COUNT) < known, shots.stops["seat"].rebound_height, NAN)
    stops = {"seat": replace(shots.stops["seat"], rebound_height=few, tilt=np.ones(COUNT))}
    item = {item.key: item for item in scattered(shots)}["seat.rebound_height_m"]
    found = correlations(replace(shots, stops=stops), replace(item, values=few))

    assert np.isfinite(found["eccentricity"]) == (known >= 5)
    assert np.isnan(found["tilt"])


def test_correlations_follow_the_position_at_touch():
    shots = variant("dry", 1.0)
    items = {item.key: item for item in scattered(shots)}

    assert correlations(shots, items["seat.rebound_height_m"])["eccentricity"] == pytest.approx(-1)
    assert abs(correlations(shots, items["seat.peak_force_N"])["eccentricity"]) < 0.5
    assert "friction" not in correlations(shots, items["closing_time_s"])
    drawn = replace(shots, strokes=whole(COUNT, friction=0.1 + 0.01 * NOISE, closing_time=NOISE))
    item = next(item for item in scattered(drawn) if item.key == "closing_time_s")
    assert correlations(drawn, item)["friction"] == pytest.approx(1.0)
    assert "radiated_energy_J" not in items  # no stroke has it


def test_the_answers_are_those_of_the_numbers():
    texts = list(stroke_answers(study()))

    ratio = next(text for text in texts if "peak force at 'seat' wet" in text)
    assert "is 40 % of dry (95 % interval 40 to 40 %), over 40 strokes" in ratio
    assert any("over 40 strokes of each row" in text for text in stroke_answers(study(carry=True)))
    highest = next(text for text in texts if text.startswith("dry, 'seat': the highest"))
    assert f"the highest of 40 rebounds is stroke {int(np.argmin(OFF))}," in highest
    assert "the most centred one." in highest
    assert not any(
        "% of dry" in t for t in stroke_answers(study(variants={"dry": variant("dry", 1.0)}))
    )


def test_json_is_that_of_its_schema():
    numbers = json.loads(json.dumps(stroke_shots_to_json(study())))

    require_documented(numbers)
    dry = numbers["variants"]["dry"]
    assert len(dry["strokes"]) == COUNT
    assert dry["strokes"][3]["stops"]["seat"]["eccentricity_m"] == OFF[3]
    assert dry["strokes"][3]["radiated_energy_J"] is None
    assert dry["distribution"]["seat.peak_force_N"]["standard_deviation"] == pytest.approx(
        np.std(10.0 * NOISE)
    )
    assert numbers["wet_over_dry"]["seat.peak_force_N"]["ratio"] == pytest.approx(0.4)
    assert dry["highest"]["seat"]["stroke"] == int(np.argmin(OFF))


@pytest.mark.slow
def test_the_report_says_what_the_numbers_say(tmp_path):
    content = STROKE_SHOTS.content(study())
    page = unescape(re.sub(r"<[^>]+>", " ", render_html(content)))

    for words in ("40 strokes, independent", "is 40 % of dry", "Placement at touch", "highest"):
        assert words in page
    assert "<b>A valve</b>" in page  # as text, not as a tag
    assert render_pdf(content).startswith(b"%PDF")


@pytest.mark.slow
@pytest.mark.parametrize("missing", ["rebound_height", "everything"])
def test_strokes_without_an_impact_leave_a_report(missing):
    """A needle that never touches its seat, and one that never turns."""
    names = [missing] if missing != "everything" else list(stop(1).row(0))
    none = dict.fromkeys(names, NAN)
    shots = variant("dry", 1.0, **none)
    shots = replace(shots, centric_stops={**shots.centric_stops, "seat": stop(1, **none)})
    content = STROKE_SHOTS.content(study(variants={"dry": shots}, carry=True))

    assert "strokes, in a row" in content.subtitle
    assert render_pdf(content).startswith(b"%PDF")
    json.dumps(stroke_shots_to_json(study(variants={"dry": shots})), allow_nan=False)


def test_a_dataset_has_every_stroke_and_the_centred_one_last():
    record = study()
    found = dataset_of(record, STROKE_SHOTS.measured(record), run="dry")

    assert found.attrs["run"] == "dry"
    assert found["stroke"].values.tolist() == [*range(COUNT), -1]
    assert found["seat_eccentricity"].values.tolist() == [*OFF, 0.0]
    assert found["seat_peak_force"].attrs["units"] == "N"
    assert found["lift"].shape == (COUNT + 1, 11)
    with pytest.raises(InputError, match="one of: wet, dry"):
        dataset_of(record, (), run="damp")


def test_what_strokes_did_not_reach_is_told():
    speed = np.full(COUNT, 0.7)
    speed[5] = 0.05  # a mere touch
    height = np.full(COUNT, 5e-5)
    height[:3] = NAN
    off = np.full(COUNT, 1e-6)
    off[39] = NAN
    seat = {"approach_speed": speed, "rebound_height": height, "eccentricity": off}
    notes = list(missing_notes({"dry": variant("dry", 1.0, **seat)}))

    assert len(notes) == 3
    assert "1 of 40 strokes do not hit 'seat'" in notes[0]
    assert "mere touch in 1 of 40 strokes, 50 mm/s in stroke 5 against a median of 700" in notes[1]
    assert "3 of 40 strokes have no rebound height at 'seat'" in notes[2]
    assert list(missing_notes({"dry": variant("dry", 1.0)})) == []
    none = dict.fromkeys(stop(1).row(0), NAN)
    notes = list(missing_notes({"dry": variant("dry", 1.0, **none)}))
    assert len(notes) == 1


def test_drops_have_no_variants_in_python():
    with pytest.raises(InputError, match="drops of two bodies"):
        klack.run_shots("demo-shots", variants=["dry"])
