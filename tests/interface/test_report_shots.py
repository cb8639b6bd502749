"""Reports of shots; the truth is a made-up study of forty shots."""

import json
import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest

from klack.analyses.impact.content import Content
from klack.analyses.impact.record import PressureRecord
from klack.analyses.shots.analysis import SHOTS
from klack.analyses.shots.content import shots_content
from klack.analyses.shots.figures import distribution_chart
from klack.analyses.shots.record import RuleVerdict, ShotColumns, ShotsStudy, ShotTraces
from klack.cli.main import main
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
        "right for this valve, judged by 1 % of restitution: the restitution is off by 0.00 %"
        in answer
    )
    assert content.subtitle.startswith("40 shots")
    rule = plain(content.sections[0].paragraphs[0])
    assert "No shot rebounds as high as the centred impact." in rule
    assert (
        "correlates most with the eccentricity: it falls with it (rank correlation −1.00)" in rule
    )


def test_key_numbers_stand_beside_the_centred_ones(content: Content) -> None:
    rows = {row[0]: [plain(cell) for cell in row[1:]] for row in content.numbers.rows}

    assert rows["restitution"][:2] == ["0.9951", "0.9951\n0.0000"]  # 4.4e-5 below
    assert rows["rebound height"][0] == "44.00 µm"
    assert rows["energy residual, largest"][-1] == "1.0e−06"
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

    assert "correlates most with the friction between the faces: it falls" in first.paragraphs[0]
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
