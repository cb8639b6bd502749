"""Reports on screen and paper; the truth is the study that they were made from."""

import gzip
import json
import re
from base64 import b64decode
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest
from plotly.offline import get_plotlyjs

from klack.analyses.impact.content import Content, report_content
from klack.analyses.impact.figures import charts, spectrum_chart
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.impact.section_figure import section_figure
from klack.analyses.impact.wording import answer
from klack.errors import InputError
from klack.report.chart import AxisSpec, BarChart, Chart, Curve, Mark, Panel
from klack.report.html import render_html, write_report
from klack.report.interactive import plotly_bars, plotly_chart
from klack.report.pdf import render_pdf, write_pdf
from klack.report.printed import svg_chart
from klack.report.wording import quantity

HOSTILE = "<script>alert(1)</script> #set page(width: 1cm) $x_1$ \\ & \"'"


@pytest.fixture(scope="module")
def content(impact_study: ImpactStudy) -> Content:
    return report_content(impact_study)


@pytest.fixture(scope="module")
def page(content: Content) -> str:
    return render_html(content)


def own_part(page: str) -> str:
    """Page without the plotly library."""
    start = page.index('<script type="application/gzip"')
    return page[:start] + page[page.index("</script>", start) :]


def hostile(study: ImpactStudy) -> ImpactStudy:
    """User text everywhere that user text can come from."""
    reduced = study.levels["reduced"]
    return replace(
        study,
        case=HOSTILE,
        title=HOSTILE,
        description=HOSTILE,
        case_text=HOSTILE,
        warnings=(HOSTILE,),
        bodies=tuple(
            replace(body, name=HOSTILE, source=HOSTILE, material=HOSTILE) for body in study.bodies
        ),
        contact=replace(study.contact, surfaces=HOSTILE),
        levels={**study.levels, "reduced": replace(reduced, label=HOSTILE)},
        transfer=(replace(study.transfer[0], body=HOSTILE, port=HOSTILE, labels=(HOSTILE,) * 5),),
        sections=tuple(replace(picture, body=HOSTILE) for picture in study.sections),
    )


# --------------------------------------------------------------------------- the page


def test_the_page_loads_nothing_from_elsewhere(page: str) -> None:
    """Checked on our own part; the library is forbidden to load by the security policy."""
    text = own_part(page)
    assert re.findall(r"""(?:src|href|action|data)\s*=\s*["']?(?!data:)[a-z]*:?//""", text) == []
    assert re.findall(r"""<script[^>]+src|<link|@import|url\(\s*["']?http""", text) == []
    assert "default-src 'none'" in page


def test_the_page_shows_the_numbers_of_the_study(impact_study: ImpactStudy, page: str) -> None:
    text = own_part(page)
    for result in impact_study.levels.values():
        for value, unit in (
            (result.measures.peak_force, "N"),
            (result.measures.contact_time, "s"),
            (result.measures.impulse, "N s"),
        ):
            assert quantity(value, unit) in text
        assert f"{result.measures.restitution:.4f}" in text
    deviation = impact_study.deviations["reduced"]
    assert f"{100 * deviation.peak_force:+.2f}\N{NO-BREAK SPACE}%" in text
    assert "made-up study is coarse" in text


@pytest.mark.slow
def test_user_text_stays_text_on_the_page(impact_study: ImpactStudy) -> None:
    text = own_part(render_html(report_content(hostile(impact_study))))

    assert "<script>alert" not in text
    assert text.count(HOSTILE) == 0
    assert unescape(text).count(HOSTILE) > 10


@pytest.mark.slow
def test_every_chart_on_the_page_is_one_that_plotly_accepts(page: str, content: Content) -> None:
    found = re.findall(r'<script type="application/json">(.*?)</script>', page, re.DOTALL)

    assert len(found) == sum(len(section.charts) for section in content.sections)
    for text in found:
        figure = go.Figure(json.loads(text))  # refuses unknown names and values
        assert len(figure.data) > 0


def test_the_page_carries_the_whole_library_packed(page: str) -> None:
    packed = re.search(r'<script type="application/gzip"[^>]*>([^<]*)</script>', page)

    assert packed is not None
    assert gzip.decompress(b64decode(packed.group(1))).decode() == get_plotlyjs()
    assert len(page) < 5e6


def test_the_heading_says_each_thing_once(lonely_study: ImpactStudy) -> None:
    parts = report_content(lonely_study).subtitle.split(" · ")

    assert parts[:2] == ["Dry impact", f"case {lonely_study.case}"]
    assert parts[-1] == f"klack {lonely_study.version}"
    assert len(parts) == 4


def test_writing_leaves_one_complete_file(lonely_study: ImpactStudy, tmp_path: Path) -> None:
    write_report(report_content(lonely_study), tmp_path / "new" / "report.html")

    assert [path.name for path in (tmp_path / "new").iterdir()] == ["report.html"]
    assert (tmp_path / "new" / "report.html").read_text().rstrip().endswith("</html>")


# --------------------------------------------------------------------------- paper


def page_count(pdf: bytes) -> int:
    return len(re.findall(rb"/Type\s*/Page\b", pdf))


@pytest.mark.slow
def test_the_paper_has_pages_also_with_hostile_words(impact_study: ImpactStudy) -> None:
    """`#set page(width: 1cm)` as a title must not change the pages (A4 is 595.28 x 841.89 pt)."""
    pdf = render_pdf(report_content(hostile(impact_study)))

    assert pdf.startswith(b"%PDF-")
    assert page_count(pdf) >= 5
    boxes = set(re.findall(rb"/MediaBox\s*\[([^\]]*)\]", pdf))
    sizes = {tuple(round(float(v)) for v in box.split()) for box in boxes}
    assert sizes == {(0, 0, 595, 842)}


@pytest.mark.slow
def test_a_single_level_without_extras_is_enough(lonely_study: ImpactStudy, tmp_path: Path) -> None:
    write_pdf(report_content(lonely_study), tmp_path / "report.pdf")

    assert [path.name for path in tmp_path.iterdir()] == ["report.pdf"]
    assert page_count((tmp_path / "report.pdf").read_bytes()) >= 3
    names = {chart.name for chart in charts(lonely_study)}
    assert {"force", "law", "energy", "modes"} <= names
    assert "deviates" not in answer(lonely_study)


# --------------------------------------------------------------------------- figures


def test_force_curves_start_at_first_touch(impact_study: ImpactStudy) -> None:
    """Half sines of 15.0 and 14.9 us whose touches lie 0.11 us apart: zero up to t = 0 in both."""
    chart = next(chart for chart in charts(impact_study) if chart.name == "force")
    assert isinstance(chart, Chart)
    full, reduced = chart.panels[0].curves

    for curve, duration in ((full, 15.0), (reduced, 14.9)):
        closed = curve.x[curve.y > 0]
        assert abs(closed[0]) < 0.05  # half a record of 50 ns either way, and the locating of touch
        assert closed[-1] - closed[0] == pytest.approx(duration, abs=0.06)
    (difference,) = chart.panels[1].curves
    expected = 100 * (reduced.y - np.interp(reduced.x, full.x, full.y)) / full.y.max()
    np.testing.assert_allclose(difference.y, expected, atol=0.02)  # peak of records, not of law


def test_energy_bars_add_up(impact_study: ImpactStudy) -> None:
    """All parts of the made-up energy are positive and sum to the initial energy."""
    bars = next(chart for chart in charts(impact_study) if isinstance(chart, BarChart))

    sums = np.sum([part.values for part in bars.parts], axis=0)

    np.testing.assert_allclose(sums, 100.0, rtol=1e-9)


def test_curves_differ_in_black_and_white(impact_study: ImpactStudy) -> None:
    """Also with all six levels at once."""
    reduced = impact_study.levels["reduced"]
    names = ("lumped", "reduced-none", "reduced-attachment", "reduced-participation")
    more = {name: replace(reduced, level=name, label=name) for name in names}
    crowded = replace(impact_study, levels={**impact_study.levels, **more})
    for chart in charts(crowded):
        if isinstance(chart, Chart):
            for panel in chart.panels:
                lines = [(c.style, c.drawn, c.width) for c in panel.curves if c.label]
                assert len(set(lines)) == len(lines), chart.name


def test_uneven_curves_are_refused() -> None:
    with pytest.raises(InputError, match="curve 'a'"):
        Curve(x=np.zeros(3), y=np.zeros(2), label="a")


@pytest.mark.parametrize("log", [False, True])
def test_both_renderers_draw_every_kind_of_curve(log: bool) -> None:
    x = np.array([1.0, 2.0, 3.0])
    curves = tuple(
        Curve(x=x, y=np.array([1.0, np.nan, 2.0]), label=kind, drawn=kind)  # type: ignore[arg-type]
        for kind in ("line", "steps", "points")
    )
    panel = Panel(
        y=AxisSpec(label="force", unit="N", log=log, range=(0.5, 4.0)),
        curves=curves,
        marks=(Mark(value=2.0, label="$ <b>"), Mark(value=1.0, axis="y")),
    )
    chart = Chart(
        name="kinds", title="kinds", x=AxisSpec(label="time", unit="s", log=log), panels=(panel,)
    )

    figure = plotly_chart(chart)

    assert [trace["y"][1] for trace in figure["data"]] == [None, None, None]
    go.Figure(json.loads(json.dumps(figure, allow_nan=False)))
    assert svg_chart(chart).startswith(b"<?xml")


def test_bars_are_drawn_by_both_renderers(impact_study: ImpactStudy) -> None:
    bars = next(chart for chart in charts(impact_study) if isinstance(chart, BarChart))

    go.Figure(json.loads(json.dumps(plotly_bars(bars), allow_nan=False)))
    assert svg_chart(bars).startswith(b"<?xml")


@pytest.mark.slow
def test_section_figure_leaves_the_closing_motion_out_of_the_shape(
    impact_study: ImpactStudy,
) -> None:
    """The made-up needle moves 3.0 um as a whole and deforms by less than 0.6 um."""
    figure = section_figure(impact_study)

    assert figure.image.startswith(b"<?xml")
    assert len(figure.image) < 3e6
    assert any(f"magnified {factor} times" in figure.note for factor in (100, 200, 500))
    assert "−3.00\N{NO-BREAK SPACE}µm" in figure.note


def test_without_a_full_run_the_report_says_why_it_has_no_picture(
    impact_study: ImpactStudy,
) -> None:
    (section,) = (
        section
        for section in report_content(replace(impact_study, sections=())).sections
        if section.title == "The bodies at peak force"
    )

    assert section.picture is None
    assert "only available at level 'full'" in section.paragraphs[0]
    assert "--level reduced,full" in section.paragraphs[0]


def test_frequencies_in_figures_have_prefixes(impact_study: ImpactStudy) -> None:
    """A small stiff needle keeps modes above 1 MHz."""
    high = tuple(
        replace(body, frequencies=np.append(body.frequencies[:-1], 1.53e6))
        for body in impact_study.bodies
    )
    chart = spectrum_chart(replace(impact_study, bodies=high))
    (band,) = chart.panels[0].bands

    assert band.label.replace("\N{NO-BREAK SPACE}", " ") == "below the highest kept mode, 1.53 MHz"
