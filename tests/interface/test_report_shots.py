"""Reports of shots and of many strokes.

Reports of shots; the truth is a made-up study of forty shots.

Statistics and report of many strokes; the truth is a made-up study of forty strokes.
"""

import json
import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest
from json_schema_check import require_documented

import klack
from klack.analyses.impact.content import Content
from klack.analyses.impact.record import PressureRecord
from klack.analyses.shots.analysis import SHOTS
from klack.analyses.shots.content import shots_content
from klack.analyses.shots.figures import distribution_chart
from klack.analyses.shots.record import RuleVerdict, ShotColumns, ShotsStudy, ShotTraces
from klack.analyses.stroke_shots.analysis import STROKE_SHOTS
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
from klack.cli.main import main
from klack.errors import InputError
from klack.exchange.results.dataset import dataset_of
from klack.report.chart import Chart
from klack.report.html import render_html
from klack.report.interactive import plotly_chart
from klack.report.pdf import render_pdf
from klack.report.printed import svg_chart

COUNT = 40
HOSTILE = "<script>alert(1)</script> #set page(width: 1cm) $x_1$ \\ & \"'"
CENTRED = {"restitution": 0.9951, "rebound_height": 4.4e-5, "peak_force": 121.0}


def columns(count: int, **given: float | np.ndarray) -> ShotColumns:
    values: dict[str, float | np.ndarray] = {
        "eccentricity": 0.0,
        "direction": 0.0,
        "tilt": 0.0,
        "tilt_direction": 0.0,
        "force": 20.0,
        "friction": 0.0,
        "waviness": 0.0,
        "approach_speed": 0.3,
        "contact_time": 39.3e-6,
        "impulse": 2.91e-3,
        "sub_contacts": 1.0,
        "rocking": 0.0,
        "second_impact": 5e-4,
        "impacts": 3.0,
        "energy_residual": 1e-6,
        **CENTRED,
        **given,
    }
    return ShotColumns(**{name: np.full(count, value, float) for name, value in values.items()})


def traces(count: int) -> ShotTraces:
    time, force_time = np.linspace(0.0, 5e-3, 601), np.linspace(0.0, 60e-6, 401)
    height = 4e-5 * np.abs(np.sin(np.pi * time / 5e-4)) * np.ones((count, 1))
    force = 120.0 * np.sin(np.pi * force_time / 39e-6).clip(0.0) * np.ones((count, 1))
    return ShotTraces(
        time=time,
        height=height.astype(np.float32),
        force_time=force_time,
        force=force.astype(np.float32),
    )


def pressure() -> PressureRecord:
    angle = 2 * np.pi * np.arange(24) / 24
    points = np.concatenate(
        [
            np.column_stack([r * np.cos(angle), r * np.sin(angle), 0 * angle + r])
            for r in np.linspace(0.40e-3, 0.44e-3, 5)
        ]
    )
    time = (np.arange(40) + 0.5) * 1e-6
    force = np.sin(np.pi * time / 40e-6)[:, None] * np.repeat([0.0, 1.0, 2.0, 1.0, 0.0], 24)
    return PressureRecord(
        time=time,
        points=points,
        area=np.full(120, 1.4e-9),
        point_force=force.astype(np.float32),
    )


@pytest.fixture(scope="module")
def study() -> ShotsStudy:
    """Rebound falls with eccentricity; the shot with the smallest one is number 17."""
    random = np.random.default_rng(2)
    eccentricity = np.append(random.uniform(0.4e-6, 3e-6, COUNT - 1), 0.0)
    eccentricity = np.concatenate([eccentricity[:17], [0.2e-6], eccentricity[17:-1]])
    loss = 0.01 * (eccentricity / 3e-6) ** 2
    shots = columns(
        COUNT,
        eccentricity=eccentricity,
        direction=random.uniform(0, 2 * np.pi, COUNT),
        tilt=random.uniform(0, 5e-4, COUNT),
        tilt_direction=random.uniform(0, 2 * np.pi, COUNT),
        restitution=CENTRED["restitution"] - loss,
        rebound_height=CENTRED["rebound_height"] * (1 - 2 * loss),
        peak_force=CENTRED["peak_force"] * (1 - 3 * loss),
        rocking=loss,
    )
    records = {"centric": pressure(), "highest": pressure(), "lowest": pressure()}
    return ShotsStudy(
        case="demo",
        title="Needle, dropped often",
        description="",
        case_text="shots: {count: 40}\n",
        version="0.1.0",
        versions={"numpy": "2.0"},
        created="2025-01-31T12:00:00+00:00",
        wall_time=80.0,
        shot_time=60.0,
        stage_times={"mesh": 3.0, "shots": 60.0},
        seed=7,
        workers=2,
        resumed=3,
        speed=0.3,
        start_height=1e-6,
        step=4e-8,
        distributions={"eccentricity": "uniform from 0 to 3 um"},
        surfaces="needle.tip on housing.seat",
        guide="",
        mass=4.86e-3,
        modes=(20, 40),
        points=720,
        approach=4e-6,
        shots=shots,
        centric=columns(1),
        shot_traces=traces(COUNT),
        centric_traces=traces(1),
        highest=17,
        rule=RuleVerdict(
            restitution_bias=float(shots.restitution[17]) - CENTRED["restitution"],
            rebound_height_bias=float(shots.rebound_height[17]) - CENTRED["rebound_height"],
            relative_restitution_bias=-4e-5,
            relative_rebound_height_bias=-9e-5,
            rank=0,
            holds=True,
            sentence="The rule is right for this made-up valve.",
        ),
        pressures=records,
        warnings=("a made-up warning",),
    )


@pytest.fixture(scope="module")
def content(study: ShotsStudy) -> Content:
    return shots_content(study)


def plain(text: str) -> str:
    return text.replace("\N{NO-BREAK SPACE}", " ")


def test_the_answer_comes_first(content: Content) -> None:
    answer = plain(content.answer)
    assert answer.startswith("Of 40 shots, shot 17 rebounds highest, 44.0 µm")
    assert (
        "right for this valve, judged by 1 % of restitution: the restitution is wrong by 0.00 %"
        in answer
    )
    assert content.subtitle.startswith("40 shots")
    rule = plain(content.sections[0].paragraphs[0])
    assert "No shot rebounds as high as the centred impact." in rule
    assert (
        "the eccentricity has the strongest correlation with the rebound height, which "
        "falls with it (rank correlation −1.00)" in rule
    )


def test_key_numbers_stand_beside_the_centred_ones(content: Content) -> None:
    rows = {row[0]: [plain(cell) for cell in row[1:]] for row in content.numbers.rows}

    assert rows["restitution"][:2] == ["0.9951", "0.9951\n0.0000"]  # 4.4e-5 below
    assert rows["rebound height"][0] == "44.00 µm"
    assert rows["energy residual, largest"][-1] == "1.0·10⁻⁶"
    assert all(len(row) == len(content.numbers.columns) for row in content.numbers.rows)


def test_only_what_varies_is_on_an_axis(content: Content, study: ShotsStudy) -> None:
    def names(of: Content) -> list[str]:
        return [chart.name for chart in of.sections[0].charts]

    assert names(content) == ["rebound-eccentricity", "rebound-tilt"]
    forces = np.linspace(19.0, 21.0, COUNT)
    shots = replace(study.shots, force=forces, tilt=np.zeros(COUNT))
    pushed = replace(study, shots=shots, pressures={})
    assert names(shots_content(pushed)) == ["rebound-eccentricity"]
    heights = replace(shots, rebound_height=-1e-6 * forces)
    assert names(shots_content(replace(pushed, shots=heights)))[-1] == "rebound-force"


def test_friction_of_the_faces_is_related_to_the_rebound(study: ShotsStudy) -> None:
    coefficients = np.linspace(0.1, 0.2, COUNT)
    shots = replace(study.shots, contact_friction=coefficients, rebound_height=1e-5 / coefficients)
    rubbing = replace(study, shots=shots, pressures={}, faces="coefficient drawn, mean 0.15")

    first = shots_content(rubbing).sections[0]

    assert "the friction between the faces has the strongest correlation" in first.paragraphs[0]
    assert first.charts[-1].name == "rebound-contact_friction"


def test_the_bias_is_a_line_from_the_highest_to_the_centred_value(content: Content) -> None:
    chart = content.sections[0].charts[0]
    assert isinstance(chart, Chart)
    restitution, height = chart.panels

    (bias,) = [curve for curve in height.curves if curve.label == "bias"]

    np.testing.assert_allclose(bias.x, 0.2)  # um
    np.testing.assert_allclose(bias.y, [44.0 * (1 - 2 * 0.01 * (0.2 / 3) ** 2), 44.0])
    assert restitution.marks[0].value == pytest.approx(0.9951)


def test_the_distribution_counts_every_shot(study: ShotsStudy) -> None:
    histogram, below = distribution_chart(study).panels

    assert histogram.curves[0].y.sum() == COUNT
    assert below.curves[0].y[-1] == 100.0
    assert [mark.label for mark in histogram.marks] == ["highest rebound", "centred impact"]


@pytest.mark.slow
def test_a_shot_without_a_rebound_height_keeps_its_restitution(study: ShotsStudy) -> None:
    heights = study.shots.rebound_height.copy()
    heights[3] = np.nan
    lost = replace(study, shots=replace(study.shots, rebound_height=heights), pressures={})

    chart = distribution_chart(lost)

    assert "rank correlation −1.00" in shots_content(lost).sections[0].paragraphs[0]
    assert chart.x.label == "restitution"
    assert chart.panels[0].curves[0].y.sum() == COUNT
    assert json.dumps(
        [plotly_chart(c) for s in shots_content(lost).sections for c in s.charts], allow_nan=False
    )


def test_all_shots_are_listed_with_what_varies(content: Content) -> None:
    (table,) = next(s for s in content.sections if s.title == "All shots").tables

    assert len(table.rows) == COUNT + 1
    assert table.rows[0][0] == "centred"
    assert table.rows[18][0] == "17\nhighest"
    assert table.rows[18][1] == "0.20"
    assert not any("force" in column or "waviness" in column for column in table.columns)


def test_the_page_shows_everything_and_stays_light(content: Content) -> None:
    page = render_html(content)

    found = re.findall(r'<script type="application/json">(.*?)</script>', page, re.DOTALL)
    assert len(found) == sum(len(section.charts) for section in content.sections)
    for text in found:
        figure = go.Figure(json.loads(text))  # refuses unknown names and values
        assert len(figure.data) > 0
    assert "shot 17: %{x" not in page  # names are data, not templates
    assert page.count("data:image/svg+xml") == 2  # where the shots were, and the pressure
    assert len(page) < 5e6


def test_points_say_which_shot_they_are(content: Content) -> None:
    figure = plotly_chart(next(c for c in content.sections[0].charts if isinstance(c, Chart)))

    assert figure["layout"]["hovermode"] == "closest"
    assert figure["data"][0]["text"][17] == "shot 17"


@pytest.mark.slow
def test_user_text_stays_text(study: ShotsStudy) -> None:
    hostile = replace(
        study,
        case=HOSTILE,
        title=HOSTILE,
        description=HOSTILE,
        case_text=HOSTILE,
        surfaces=HOSTILE,
        guide=HOSTILE,
        distributions={HOSTILE: HOSTILE},
        warnings=(HOSTILE,),
        pressures={},
    )
    page = render_html(shots_content(hostile))

    assert page.count(HOSTILE) == 0
    assert unescape(page).count(HOSTILE) > 7


@pytest.mark.slow
def test_charts_are_drawn_on_paper(content: Content) -> None:
    for section in content.sections:
        for chart in section.charts:
            assert isinstance(chart, Chart)
            assert svg_chart(chart).startswith(b"<?xml")


@pytest.mark.slow
def test_the_paper_has_pages(content: Content) -> None:
    pdf = render_pdf(content)

    assert pdf.startswith(b"%PDF-")
    assert len(re.findall(rb"/Type\s*/Page\b", pdf)) >= 6


@pytest.mark.slow
def test_a_stored_result_is_reported_again(
    study: ShotsStudy, content: Content, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    SHOTS.save(study, tmp_path)

    assert main(["report", str(tmp_path), "--out", str(tmp_path / "again")]) == 0

    assert (tmp_path / "again" / "report.pdf").read_bytes().startswith(b"%PDF-")
    page = (tmp_path / "again" / "report.html").read_text()
    assert page == render_html(content)
    assert page == render_html(shots_content(SHOTS.load(tmp_path)))
    assert "report.html" in capsys.readouterr().out


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


def study_report(**more: object) -> StrokeShotsStudy:
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
    texts = list(stroke_answers(study_report()))

    ratio = next(text for text in texts if "peak force at 'seat' is" in text)
    assert "is 40 % of the dry scatter (95 % interval 40 to 40 %), over 40 strokes" in ratio
    assert any(
        "over 40 strokes of each row" in text for text in stroke_answers(study_report(carry=True))
    )
    highest = next(text for text in texts if text.startswith("dry, 'seat': the highest"))
    assert f"the highest of 40 rebounds is stroke {int(np.argmin(OFF))}," in highest
    assert "the most centred one." in highest
    assert not any(
        "% of the dry scatter" in t
        for t in stroke_answers(study_report(variants={"dry": variant("dry", 1.0)}))
    )


def test_json_is_that_of_its_schema():
    numbers = json.loads(json.dumps(STROKE_SHOTS.to_json(study_report())))

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
    content = STROKE_SHOTS.content(study_report())
    page = unescape(re.sub(r"<[^>]+>", " ", render_html(content)))

    for words in (
        "40 strokes, independent",
        "is 40 % of the dry scatter",
        "Placement at touch",
        "highest",
    ):
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
    content = STROKE_SHOTS.content(study_report(variants={"dry": shots}, carry=True))

    assert "strokes, in a row" in content.subtitle
    assert render_pdf(content).startswith(b"%PDF")
    json.dumps(STROKE_SHOTS.to_json(study_report(variants={"dry": shots})), allow_nan=False)


def test_a_dataset_has_every_stroke_and_the_centred_one_last():
    record = study_report()
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
