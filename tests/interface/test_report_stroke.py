"""Reports of a stroke on screen and paper; the truth is the made-up study they were made from.

The needle of the study flies on parabolas between two half-sine impacts whose size and time are
known; nothing in it was computed by the solver.
"""

import json
import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest

from klack.analyses.stroke.analysis import STROKE, first_impact, stroke_answer
from klack.analyses.stroke.axis import guide_of
from klack.analyses.stroke.content import stroke_content
from klack.analyses.stroke.film_frames import film_charts
from klack.analyses.stroke.measures import pace
from klack.analyses.stroke.record import (
    FluidSummary,
    LineSummary,
    StopSummary,
    StrokeChannels,
    StrokeStudy,
    StrokeVariant,
)
from klack.analyses.stroke.ring_figure import line_load_picture
from klack.assembling.body_summary import BodySummary
from klack.report.chart import AnyChart, BarChart, Chart, RingFrames, frame_text, squeezed, ticks_of
from klack.report.html import render_html, write_report
from klack.report.looks import thinned
from klack.report.pdf import render_pdf
from klack.report.wording import quantity
from klack.simulation.film_sectors import sector_pressure
from klack.simulation.network_result import (
    ChannelData,
    EnergyBooks,
    ImpactEvent,
    InterfaceRecord,
    NetworkResult,
    StepCounts,
)
from klack.simulation.spatial_impact import FilmLand, FilmMoments, SpatialImpact
from klack.simulation.step_sizes import StepSizes

HOSTILE = "<script>alert(1)</script> #set page(width: 1cm) $x_1$ \\ & \"'"
STEP, RECORD, END = 20e-9, 1e-6, 2e-3
TOUCH = {"opening": 0.2e-3, "seat": 1.5e-3}
NAN = float("nan")


def half_sine(touch: float, peak: float, duration: float) -> InterfaceRecord:
    time = touch + STEP * np.arange(round(duration / STEP))
    force = peak * np.sin(np.pi * (time + 0.5 * STEP - touch) / duration)
    return InterfaceRecord(
        time=time,
        step=np.full(time.size, STEP),
        contact_force=force,
        film_force=np.zeros(time.size),
        gap=-1e-8 * force,
        complete=True,
    )


def impact(stop: str, time: float, peak: float, duration: float, speed: float) -> ImpactEvent:
    return ImpactEvent(
        stop=stop,
        time=time,
        approach_speed=speed,
        peak_force=peak,
        peak_time=time + 0.5 * duration,
        contact_time=duration,
        separation_time=time + duration,
        impulse=2.0 / np.pi * peak * duration,
        restitution=0.8,
        energy_loss=1e-4,
    )


def books(wet: bool) -> EnergyBooks:
    supplies = {"coil electric": 20e-3}
    losses = {"coil ohmic": 12e-3, "coil eddy": 6e-3, "needle damping": 0.5e-3}
    before, after = {"spring energy": 0.1e-3}, {"spring energy": 1.6e-3}
    if wet:
        supplies["source pressure"] = 2e-3
        losses |= {"nozzle flow": 1.7e-3, "opening film": 0.3e-3}
    return EnergyBooks(supplies=supplies, losses=losses, stores_before=before, stores_after=after)


def variant(name: str, *, peak: float, late: float) -> StrokeVariant:
    wet, flexible = not name.startswith("dry"), not name.endswith("lumped")
    time = np.arange(0.0, END + 0.5 * RECORD, RECORD)
    begin, back = TOUCH["opening"] + late, TOUCH["seat"] + late
    lift = 1e-4 * np.clip(np.minimum(time / begin, (back - time) / 0.3e-3), 0.0, 1.0)
    values = {
        "coil voltage": ("V", np.where(time < 1e-3, 14.0, 0.0)),
        "coil current": ("A", np.where(time < 1e-3, 5.0, 0.0)),
        "coil.armature force": ("N", np.where(time < 1e-3, 40.0, 0.0)),
        "needle.tip displacement": ("m", lift),
        "needle.tip velocity": ("m/s", np.gradient(lift, time)),
        "needle velocity": ("m/s", np.gradient(lift, time)),
        "opening gap": ("m", 1e-4 - lift),
        "seat gap": ("m", lift),
        "opening peak force": ("N", np.where(abs(time - begin) < 20e-6, peak, 0.0)),
        "seat peak force": ("N", np.where(abs(time - back) < 20e-6, 0.5 * peak, 0.0)),
    }
    if wet:
        values["sac pressure"] = ("Pa", 6e5 + 1e5 * np.sin(3e4 * time))
    result = NetworkResult(
        time=time,
        channels={key: ChannelData(unit=unit, values=v) for key, (unit, v) in values.items()},
        interfaces={
            "opening": half_sine(begin, peak, 20e-6),
            "seat": half_sine(back, 0.5 * peak, 30e-6),
        },
        events=(
            impact("seat", 30e-6, 0.02, 80e-9, 1e-3),  # the pressed seat lets go
            impact("opening", begin, peak, 20e-6, 1.0),
            impact("seat", back, 0.5 * peak, 30e-6, 0.7),
        ),
        books=books(wet),
        sizes=StepSizes(step=STEP, coarse=32, near=16, middle=4),
        steps=StepCounts(flight=4000, near=1000, sub=8000, sub_fine=5000),
        wall_time=0.05,
        state={},
    )
    return StrokeVariant(
        name=name,
        label=f"label of {name}",
        wet=wet,
        flexible=flexible,
        modes=60,
        opening_time=begin,
        closing_time=back,
        result=result,
        setup_time=0.1,
    )


def stop_summary(name: str) -> StopSummary:
    force = np.linspace(0.0, 500.0, 20)
    return StopSummary(
        name=name,
        surfaces="needle.tip on housing.seat",
        kind="consistent",
        gap=1e-4,
        film=True,
        indentation=1e-9 * force,
        force=force,
        share=np.append(np.nan, np.full(19, 0.3)),
        approach=4e-9 * force,
        static_force=force,
        area=1e-9 * force,
        pattern_force=400.0,
        half_width=40e-6,
        size_ratio=0.3,
    )


@pytest.fixture(scope="module")
def study() -> StrokeStudy:
    body = BodySummary(
        name="needle",
        model="axisymmetric",
        source="profile",
        support="free",
        material="steel",
        mass=3e-3,
        nodes=2000,
        elements=900,
        dofs=4000,
        frequencies=60e3 * np.arange(1, 21),
        compliance_share=0.7,
    )
    return StrokeStudy(
        case="made-up",
        title="A made-up stroke",
        description="Parabolas and half sines.",
        case_text="klack: 1\n",
        version="0.1.0",
        versions={"numpy": "2.0"},
        created="2025-01-31T12:00:00+00:00",
        wall_time=1.5,
        stage_times={"mesh": 0.5, "run wet": 0.1},
        needle="needle",
        lift=1e-4,
        switch_off=1e-3,
        duration=END,
        step=STEP,
        variants={
            "wet": variant("wet", peak=800.0, late=10e-6),
            "dry": variant("dry", peak=900.0, late=0.0),
            "wet-lumped": variant("wet-lumped", peak=2000.0, late=11e-6),
            "dry-lumped": variant("dry-lumped", peak=2400.0, late=1e-6),
        },
        channels=StrokeChannels(
            lift="needle.tip displacement",
            lift_velocity="needle.tip velocity",
            velocity="needle velocity",
            voltage=("coil voltage",),
            current=("coil current",),
            magnetic_force=("coil.armature force",),
            pressures=("sac pressure",),
            flows=(),
            opening_stop="opening",
            seat="seat",
        ),
        bodies=(body,),
        stops=(stop_summary("seat"), stop_summary("opening")),
        fluid=FluidSummary(
            name="n-heptane",
            temperature=293.15,
            pressure=6.013e5,
            density=684.3,
            bulk_modulus=8.83e8,
            sound_speed=1136.0,
            viscosity=4.14e-4,
            vapour_pressure=4722.0,
        ),
        lines=(LineSummary(name="feed", length=0.06, sound_speed=1200.0, echo_time=1e-4),),
        warnings=("the made-up study is made up",),
    )


@pytest.fixture(scope="module")
def page(study: StrokeStudy) -> str:
    return render_html(stroke_content(study))


def stroke_charts(study: StrokeStudy) -> list[AnyChart]:
    return [chart for section in stroke_content(study).sections for chart in section.charts]


def chart(study: StrokeStudy, name: str) -> Chart:
    found = next(item for item in stroke_charts(study) if item.name == name)
    assert isinstance(found, Chart)
    return found


def own_part(page: str) -> str:
    """Page without the plotly library."""
    start = page.index('<script type="application/gzip"')
    return page[:start] + page[page.index("</script>", start) :]


def lonely(study: StrokeStudy) -> StrokeStudy:
    """One dry variant of rigid parts that never moves."""
    dry = study.variants["dry-lumped"]
    none = InterfaceRecord(
        **dict.fromkeys(("time", "step", "contact_force", "film_force", "gap"), np.empty(0)),
        complete=True,
    )
    result = replace(dry.result, events=(), interfaces={"opening": none, "seat": none})
    still = replace(dry, result=result, opening_time=NAN, closing_time=NAN, flexible=False)
    channels = replace(study.channels, voltage=(), current=(), magnetic_force=(), pressures=())
    return replace(
        study,
        variants={"dry": replace(still, name="dry")},
        channels=channels,
        switch_off=None,
        bodies=(),
        stops=(),
        fluid=None,
        lines=(),
        warnings=(),
    )


# --------------------------------------------------------------------------- page and paper


def test_the_page_shows_the_numbers_of_the_study(study: StrokeStudy, page: str):
    text = own_part(page)
    for item in study.variants.values():
        assert quantity(item.opening_time, "s") in text
        assert quantity(item.closing_time, "s") in text
        for event in item.result.events[1:]:
            assert quantity(event.peak_force, "N", 4) in text
            assert quantity(event.impulse, "N s", 4) in text
    for words in ("1136 m/s", "n-heptane", "made-up study is made up", "20 °C", "2.000 mJ"):
        assert words in text.replace("\N{NO-BREAK SPACE}", " ")
    assert "klack 0.1.0, numpy 2.0" in text
    assert len(page) < 5e6


def test_user_text_stays_text_on_the_page(study: StrokeStudy):
    hostile = replace(
        study,
        case=HOSTILE,
        title=HOSTILE,
        description=HOSTILE,
        case_text=HOSTILE,
        needle=HOSTILE,
        warnings=(HOSTILE,),
        variants={**study.variants, "wet": replace(study.variants["wet"], label=HOSTILE)},
        stops=tuple(replace(stop, surfaces=HOSTILE, name=HOSTILE) for stop in study.stops),
        lines=(replace(study.lines[0], name=HOSTILE),),
    )
    text = own_part(render_html(stroke_content(hostile)))

    assert "<script>alert" not in text
    assert text.count(HOSTILE) == 0
    assert unescape(text).count(HOSTILE) > 10


@pytest.mark.slow
def test_every_chart_is_one_that_plotly_accepts(study: StrokeStudy, page: str):
    found = re.findall(r'<script type="application/json">(.*?)</script>', page, re.DOTALL)

    assert len(found) == len(stroke_charts(study)) >= 12
    for text in found:
        assert len(go.Figure(json.loads(text)).data) > 0


@pytest.mark.slow
@pytest.mark.parametrize("given", ["", "<svg xmlns='http://www.w3.org/2000/svg'/>"])
def test_the_schematic_is_shown_if_the_result_has_one(study: StrokeStudy, given: str):
    titles = [section.title for section in stroke_content(replace(study, schematic=given)).sections]

    assert ("Schematic" in titles) is bool(given)


@pytest.mark.slow
def test_the_paper_has_pages(study: StrokeStudy):
    pdf = render_pdf(stroke_content(replace(study, title=HOSTILE)))

    assert pdf.startswith(b"%PDF-")
    assert len(re.findall(rb"/Type\s*/Page\b", pdf)) >= 8


def test_a_valve_that_does_nothing_has_a_report(study: StrokeStudy, tmp_path: Path):
    still = lonely(study)
    write_report(stroke_content(still), tmp_path / "report.html")

    names = {item.name for item in stroke_charts(still)}
    assert names == {"actuation", "energy"}
    assert "does not reach the opening stop" in stroke_answer(still)
    assert "Variant 'dry' has no impacts" in unescape((tmp_path / "report.html").read_text())


def test_a_speed_before_the_film_is_not_told_as_that_of_the_touch(study: StrokeStudy):
    """By definition: with a film the speed of an impact is the highest since it began to press."""
    bare = replace(study, stops=tuple(replace(stop, film=False) for stop in study.stops))

    assert "m/s (the highest since its film force set in) and a peak" in stroke_answer(study)
    assert "film began" not in stroke_answer(bare)


@pytest.mark.slow
def test_a_stored_study_gives_the_same_page(study: StrokeStudy, page: str, tmp_path: Path):
    STROKE.save(study, tmp_path)

    assert render_html(stroke_content(STROKE.load(tmp_path))) == page


# --------------------------------------------------------------------------- figures


@pytest.mark.parametrize(("stop", "duration"), [("opening", 20.0), ("seat", 30.0)])
def test_first_impacts_start_at_zero_and_keep_their_peak(study, stop, duration):
    picture = chart(study, f"first-{stop}")

    for curve, name in zip(picture.panels[0].curves, ("wet", "dry"), strict=True):
        event = first_impact(study.variants[name], stop)
        assert event is not None
        closed = curve.x[curve.y > 0.0]
        assert closed[0] == pytest.approx(0.0, abs=0.03)  # half a step of 20 ns, and thinning
        assert closed[-1] == pytest.approx(duration, abs=0.03)
        # no thinning cuts the peak; the middle of a step lies beside it by 1e-5 of the peak
        assert curve.y.max() == pytest.approx(event.peak_force, rel=1e-5)
    gap = next(panel for panel in picture.panels if panel.y.label == "gap").curves[0]
    assert np.all(np.diff(gap.x) >= 0.0)
    assert gap.y.min() == pytest.approx(-0.01 * (800.0 if stop == "opening" else 400.0), rel=1e-5)


def test_a_touch_of_the_pressed_seat_is_no_first_impact(study: StrokeStudy):
    event = first_impact(study.variants["wet"], "seat")

    assert event is not None
    assert event.time == TOUCH["seat"] + 10e-6


def test_echoes_are_marked_every_two_lengths(study: StrokeStudy):
    picture = chart(study, "echo-seat-feed")

    upright = [mark.value for mark in picture.panels[0].marks if mark.axis == "x"]
    np.testing.assert_allclose(np.diff(upright), 100.0, rtol=1e-12)  # [us]
    assert upright[0] == 0.0
    assert "100\N{NO-BREAK SPACE}µs" in picture.note


def test_pairs_of_energy_bars_are_equally_long(study: StrokeStudy):
    bars = [item for item in stroke_charts(study) if isinstance(item, BarChart)]

    assert [item.name for item in bars] == ["energy", "energy-mechanics"]
    for item in bars:
        sums = np.sum([part.values for part in item.parts], axis=0)
        assert len(sums) == 2 * len(study.variants)
        np.testing.assert_allclose(sums[::2], sums[1::2], rtol=1e-12)
    whole, mechanics = (np.sum([part.values for part in item.parts], axis=0) for item in bars)
    assert whole[0] == pytest.approx(22.0, rel=1e-12)  # [mJ] wet: coil and source
    assert mechanics[0] == pytest.approx(4.0, rel=1e-12)  # 20 - 12 - 6 of the coil, 2 of the source


def test_curves_differ_in_black_and_white(study: StrokeStudy):
    for picture in stroke_charts(study):
        if isinstance(picture, Chart):
            for panel in picture.panels:
                lines = [(c.style, c.drawn, c.width) for c in panel.curves if c.label]
                assert len(set(lines)) == len(lines), picture.name


def test_each_variant_looks_the_same_everywhere(study: StrokeStudy):
    looks = {}
    for picture in stroke_charts(study):
        if isinstance(picture, Chart):
            for curve in (c for panel in picture.panels for c in panel.curves):
                if curve.label.startswith("label of"):
                    looks.setdefault(curve.label, set()).add((curve.colour, curve.style))
    assert len(looks) == 4
    assert all(len(found) == 1 for found in looks.values())


# --------------------------------------------------------------------------- thinning and numbers


def test_thinning_keeps_every_peak_at_its_place():
    x = np.linspace(0.0, 1.0, 100_001)
    y = np.sin(300.0 * x)
    y[[777, 50_123, 99_998]] = (5.0, -7.0, 6.0)

    few_x, few_y = thinned(x, y, columns=500)

    assert few_x.size <= 1002
    assert np.all(np.diff(few_x) > 0.0)
    for i in (777, 50_123, 99_998):
        assert few_y[few_x == x[i]] == [y[i]]
    assert (few_x[0], few_x[-1]) == (0.0, 1.0)
    np.testing.assert_array_equal(few_y, y[np.searchsorted(x, few_x)])


def test_short_and_broken_curves_stay_as_they_are():
    x = np.arange(3000.0)
    broken = np.where(x == 5, np.nan, x)

    for curve in (x[:10], broken):
        few_x, few_y = thinned(x[: curve.size], curve, columns=100)
        np.testing.assert_array_equal(few_y, curve)
        assert few_x.size == curve.size
    inside, _ = thinned(x, x, window=(10.0, 20.0))
    assert (inside[0], inside[-1]) == (10.0, 20.0)


@pytest.mark.slow
def test_a_doubtful_contact_is_said_with_its_stop(study: StrokeStudy, tmp_path: Path):
    doubts = ("it lies on a sharp edge", "2 contact points across are too few")
    seat = replace(study.stops[1], points_across=2, doubts=doubts)
    doubtful = replace(study, stops=(study.stops[0], seat))
    STROKE.save(doubtful, tmp_path)
    said = STROKE.to_json(STROKE.load(tmp_path))["stops"]

    assert said[seat.name]["doubts"] == list(doubts)
    assert said[seat.name]["points_across"] == 2
    assert (said[study.stops[0].name]["doubts"], seat.half_width) == ([], 40e-6)
    tables = [table for section in stroke_content(doubtful).sections for table in section.tables]
    rows = {row[0]: row[1:] for table in tables for row in table.rows if table.columns[0] == "stop"}
    assert rows["doubts about the contact"] == ("–", "\n".join(doubts))
    assert rows["contact points across"] == ("–", "2")


def test_numbers_of_a_study_are_pure_json(study: StrokeStudy):
    text = json.dumps(STROKE.to_json(lonely(study)), allow_nan=False)
    assert json.loads(text)["opening_time_s"] is None
    whole = STROKE.to_json(study)
    assert whole["variant"] == "wet"
    assert whole["opening_time_s"] == TOUCH["opening"] + 10e-6
    assert whole["steps"] == 5000
    assert whole["real_time_factor"] == pytest.approx(0.05 / END, rel=1e-9)
    assert whole["energy_residual"] == pytest.approx(0.0, abs=1e-12)
    event = whole["variants"]["dry"]["events"][1]
    assert (event["stop"], event["peak_force_N"], event["contact_time_s"]) == (
        "opening",
        900.0,
        20e-6,
    )


# --------------------------------------------------------------------------- three dimensions

LAND = FilmLand(
    inner_radius=1.35e-3,
    outer_radius=1.95e-3,
    sectors=36,
    circles=2,
    viscosity=4e-4,
    tension=6e5,
    lowest=1e-6,
    slope=1.0,
    shear=0.0,
)


def ring_impact(number: int, begin: float) -> SpatialImpact:
    """Half a sine over time, one side carries; the film closes, then opens, tilted."""
    edges = begin + np.linspace(0.0, 20e-6, 101)
    angle = 2.0 * np.pi * (np.arange(36) + 0.5) / 36
    rise = np.sin(np.pi * (np.arange(100) + 0.5) / 100)
    time = begin + np.linspace(-10e-6, 30e-6, 60)
    lift = np.append(np.linspace(12e-6, 2e-6, 30), np.linspace(2e-6, 12e-6, 31))
    tilts = np.tile([2e-4, 0.0], (61, 1))
    ends = np.column_stack([lift, tilts])
    return SpatialImpact(
        number=number,
        stop="opening",
        edges=edges,
        sector_force=np.outer(rise, 10.0 * np.maximum(np.cos(angle), 0.0)),
        radius=1.6e-3,
        spread=5e-5,
        height=18.5e-3,
        film=FilmMoments(
            land=LAND,
            time=time,
            step=np.full(60, 20e-9),
            film_force=np.ones(60),
            before=ends[:-1],
            after=ends[1:],
        ),
    )


def in_space(study: StrokeStudy, impacts: int | None) -> StrokeStudy:
    """The study as if it had moved in three dimensions, with so many recorded impacts."""
    wet = study.variants["wet"]
    result = wet.result
    aside = ChannelData(unit="m", values=np.zeros(len(result.time)))
    channels = {
        **result.channels,
        **{f"needle {what}": aside for what in ("x", "y", "tilt x", "tilt y")},
    }
    begins = [0.3e-3 + 60e-6 * k for k in range(impacts or 0)]
    result = replace(
        result,
        channels=channels,
        events=tuple(impact("opening", begin, 100.0, 20e-6, 1.0) for begin in begins)
        or result.events,
        spatial_impacts=None
        if impacts is None
        else tuple(ring_impact(k + 1, begin) for k, begin in enumerate(begins)),
    )
    return replace(study, variants={"wet": replace(wet, result=result)})


@pytest.mark.slow
def test_impacts_round_the_ring_have_their_figures(study: StrokeStudy):
    content = stroke_content(in_space(study, 2))
    rings, films = (
        next(s for s in content.sections if s.title == title)
        for title in ("Line load round the ring, wet", "Pressure in the films, wet")
    )
    assert rings.picture is not None
    assert "left out" not in rings.picture.note
    assert len(films.charts) == 2
    page = render_html(content)
    text = page[page.index("<h2>Pressure in the films, wet") :]
    figure = json.loads(re.search(r'<script type="application/json">(.*?)</script>', text)[1])
    go.Figure(data=figure["data"], layout=figure["layout"], frames=figure["frames"])
    assert 10 < len(figure["frames"]) <= 41
    assert len(figure["frames"]) == len(figure["layout"]["sliders"][0]["steps"])
    assert [len(trace["r"]) for trace in figure["data"]] == [36, 36]
    assert len(json.dumps(figure)) < 100_000
    assert render_pdf(content).startswith(b"%PDF")


@pytest.mark.slow
def test_the_animation_shows_the_pressure_of_the_sectors(study: StrokeStudy):
    chart = film_charts(in_space(study, 1).reference)[0]
    truth = sector_pressure(ring_impact(1, 0.3e-3).film)
    k = int(np.argmax(chart.values.max(axis=1)))
    at = int(np.argmax(truth.pressure.max(axis=1)))
    np.testing.assert_allclose(chart.values[k], 1e-5 * truth.pressure[at], rtol=1e-12)
    # a tilt of the height along +x: the film is lowest, and presses most, at 180 degrees
    assert int(np.argmax(chart.values[k])) == 18
    assert chart.marked.any()
    assert np.all(chart.values[chart.marked] == pytest.approx(-6.0, rel=1e-6))
    assert np.all(np.diff(chart.time) > 0.0)


@pytest.mark.slow
def test_impacts_that_are_not_shown_are_counted(study: StrokeStudy):
    found = in_space(study, 11)
    picture = line_load_picture(found.reference)
    assert picture is not None
    assert "first 8 of 11 impacts" in picture.note
    assert "3 are left out" in picture.note
    charts = film_charts(found.reference)
    assert len(charts) == 4
    assert "7 further impacts are left out" in charts[0].note


def test_a_result_of_an_earlier_version_says_so(study: StrokeStudy, tmp_path: Path):
    STROKE.save(in_space(study, None), tmp_path)
    content = stroke_content(STROKE.load(tmp_path))
    section = next(s for s in content.sections if s.title.startswith("Line load"))
    assert "a version of klack that did not record" in section.paragraphs[0]
    assert section.picture is None


def test_an_axial_stroke_has_no_rings(study: StrokeStudy, page: str):
    assert "Line load round the ring" not in page


def test_a_ring_keeps_its_values_over_colours():
    frames = RingFrames(
        name="a",
        title="b",
        label="pressure",
        unit="bar",
        time=np.array([-1.5, 2.0]),
        time_unit="µs",
        values=np.array([[-5.0, 0.0, 0.5, 20.0], [0.0, 0.0, 0.0, 300.0]]),
        marked=np.zeros((2, 4), dtype=bool),
        mark="cavitates",
        captions=("1 N", "2 N"),
    )
    assert ticks_of(frames) == (-1.0, 0.0, 1.0, 10.0, 100.0)
    assert frame_text(frames, 0) == "\N{MINUS SIGN}1.50 µs, 1 N"
    colours = squeezed(frames, np.array([0.1, 10.0, 100.0]))
    assert colours[0] == pytest.approx(0.1, rel=2e-3)  # linear
    assert colours[2] - colours[1] == pytest.approx(np.log(10.0), rel=2e-3)  # logarithmic


def test_a_guide_with_a_film_is_known_to_the_report(study: StrokeStudy):
    guide = "guide: {surface: shaft, heights: [4 mm, 13 mm], clearance: 4 um, film: {length: 1 mm}}"
    found = guide_of(replace(study, case_text=f"klack: 1\n{guide}\n"))
    assert found is not None
    assert found.film is not None
    assert found.film.length == pytest.approx(1e-3, rel=1e-12)


# --------------------------------------------------------------------------- what is read first


def test_ten_numbers_come_first_and_no_paragraphs_are_among_them(study: StrokeStudy):
    content = stroke_content(study)
    first = {row[0] for row in content.numbers.rows}
    further = next(s for s in content.sections if s.title == "Further numbers").tables

    assert len(first) <= 10
    assert {"opening time", "closing time", "largest lift"} <= first
    assert all(len(cell) < 40 for row in content.numbers.rows for cell in row)
    named = {row[0] for table in further for row in table.rows}
    assert {"impacts", "energy residual", "computing time", "shortest time step"} <= named
    assert not first & named


def test_the_speed_of_the_computation_has_a_direction(study: StrokeStudy):
    wall, end = 4e-4, float(study.reference.result.time[-1])
    quick = replace(study.reference, result=replace(study.reference.result, wall_time=wall))

    assert pace(quick) == f"{end / wall:.3g} times faster than real time"
    assert "than real time" in stroke_content(study).answer


def test_a_document_has_one_micro_and_one_way_of_powers(study: StrokeStudy):
    noted = replace(study, warnings=("wider by 3 um, area 2 mm^2, {gap: 3 um^2}, 1.5e-07 of it",))
    content = stroke_content(noted)
    words = [content.answer, *content.warnings]
    for table in (content.numbers, *(t for s in content.sections for t in s.tables)):
        words += [*table.columns, *(cell for row in table.rows for cell in row)]

    assert content.warnings[0] == "wider by 3 µm, area 2 mm², {gap: 3 um^2}, 1.5·10⁻⁷ of it"
    for word in words:
        plain = re.sub(r"\{.*\}", "", word)  # of a case, to be copied
        assert not re.search(r"[\[/]u[msN]\b|\d[ \u00a0]u[msN]\b|\d[eE][+−-]?\d", plain), word
