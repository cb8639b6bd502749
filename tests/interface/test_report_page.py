"""Contents, parts that fold, next steps and full pages of every report; truth = the content."""

import re
import shlex
import zlib
from collections import Counter
from contextlib import suppress
from dataclasses import replace
from importlib.resources import files
from io import BytesIO
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import typst
from matplotlib import pyplot
from matplotlib.axes import Axes

from klack.analyses.impact.content import report_content
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.stroke.content import NEXT_STEPS
from klack.cli.commands import parser
from klack.report.chart import (
    AxisSpec,
    Band,
    Chart,
    Curve,
    Mark,
    Panel,
    ParallelAxis,
    ParallelChart,
    mark_rows,
)
from klack.report.html import render_html
from klack.report.interactive import figure_of
from klack.report.page import Content, NextStep, Section, Table
from klack.report.pdf import render_pdf
from klack.report.printed import STYLE, shown_chart

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def impact_content(impact_study: ImpactStudy) -> Content:
    return report_content(impact_study)


def test_contents_lead_to_every_part(impact_content: Content):
    page = render_html(impact_content)

    links = re.findall(r'<li><a href="#([\w-]+)">([^<]+)</a>', page)
    parts = re.findall(r'<details class="part" open id="([\w-]+)">\s*<summary><h2>([^<]+)<', page)

    assert links == parts
    titles = [title for _, title in parts]
    assert titles[: len(impact_content.sections)] == [s.title for s in impact_content.sections]
    assert titles[-3:] == ["Glossary", "Limits", "Reproducing this result"]


def test_next_steps_are_commands_that_exist(impact_study: ImpactStudy):
    levels = {"reduced": impact_study.levels["reduced"]}
    alone = replace(impact_study, levels=levels, reference="reduced", deviations={})
    contents = (
        report_content(impact_study),
        report_content(alone),
        replace(_EMPTY, next_steps=NEXT_STEPS),
    )
    found = [
        step.command
        for content in contents
        for step in content.placed(result="a result", case="my case.yaml").next_steps
    ]

    assert any("'a result'" in command for command in found)
    assert "klack impact 'my case.yaml' --level reduced,full" in found
    for command in found:
        program, *words = shlex.split(command)
        assert program == "klack"
        parser.parse_args(words, exit_on_error=False, print_error=False)


def test_steps_that_need_an_unknown_case_are_left_out():
    content = one_chart_each(0)
    content = replace(
        content,
        next_steps=(
            NextStep(purpose="a", command="klack noise RESULT"),
            NextStep(purpose="b", command="klack advise CASE"),
        ),
    )

    steps = content.placed(result="$(reboot); x").next_steps

    assert [shlex.split(step.command) for step in steps] == [["klack", "noise", "$(reboot); x"]]
    assert "klack noise &#39;&lt;b&gt;&#39;" in render_html(content.placed(result="<b>", case=""))
    assert "Next steps" not in render_html(content.placed())


def one_chart_each(count: int, panels: int = 2) -> Content:
    """Sections with one chart; two panels are a little more than half a page high."""
    x = np.linspace(0.0, 1.0, 5)
    axis = AxisSpec(label="x")
    panel = Panel(y=axis, curves=(Curve(x=x, y=x, label="line"),), share=1.05)
    chart = Chart(name="c", title="c", x=axis, panels=panels * (panel,), note="Caption.")
    return replace(_EMPTY, sections=count * (Section(title="One", charts=(chart,)),))


def unpacked(paper: bytes) -> bytes:
    plain = paper
    for packed in re.findall(rb"stream\r?\n(.*?)\r?\nendstream", paper, re.DOTALL):
        with suppress(zlib.error):
            plain += zlib.decompress(packed)
    return plain


def pages_of(paper: bytes) -> int:
    return len(re.findall(rb"/MediaBox", unpacked(paper)))


def letters_of(paper: bytes) -> set[float]:
    """Sizes [pt] of all texts; nothing else scales them in what typst writes."""
    return {float(size) for size in re.findall(rb"/\w+ ([\d.]+) Tf", unpacked(paper))}


def table_of(columns: int, rows: int, cell: str = "1234.5 mm/s") -> Table:
    return Table(
        columns=tuple(f"head {k}\nwith its unit" for k in range(columns)),
        rows=tuple((f"row {i}\nand more", *((columns - 1) * (cell,))) for i in range(rows)),
    )


@pytest.mark.parametrize(("columns", "rows"), [(2, 5), (9, 30), (20, 12), (20, 60), (2, 150)])
def test_no_table_is_set_below_eight_points(columns: int, rows: int, impact_content: Content):
    """However wide or long it is; the rest of the report with it."""
    content = replace(impact_content, numbers=table_of(columns, rows))

    assert min(letters_of(render_pdf(content))) >= 8.0


def test_a_list_that_is_long_and_narrow_stands_in_several_columns():
    """150 rows: four pages in one column of 40 rows, one page in three or more."""
    long = replace(_EMPTY, numbers=table_of(2, 150, "1"))

    assert pages_of(render_pdf(long)) == 2  # one of rows, one of the words at the end


def test_a_section_that_fits_fills_the_page_before_a_tall_figure():
    """The figure of 204 mm has no room below the head, the table of 8 rows has."""
    tall = replace(one_chart_each(2, panels=4), numbers=table_of(3, 12))
    short = Section(title="Short", tables=(table_of(3, 8),))
    content = replace(tall, sections=(*tall.sections, *(5 * (short,))))

    assert pages_of(render_pdf(content)) == pages_of(render_pdf(tall))


def test_the_section_after_a_tall_figure_begins_before_it_where_one_of_its_figures_fits():
    """Of 133 mm on a page of 259 mm: one below the head, two on the next; then two of 204 mm."""
    tall, tall_too = one_chart_each(2, panels=4).sections
    charts = tuple(chart for one in one_chart_each(3).sections for chart in one.charts)
    three = Section(title="Three", charts=charts)
    content = replace(_EMPTY, numbers=table_of(3, 12), sections=(tall, three, tall_too))

    assert pages_of(render_pdf(content)) == 5  # the last one has the words


def test_pictures_leave_the_size_of_their_letters_to_the_style():
    """A size of its own would be too small on paper, and is not measured by the test of STYLE."""
    root = Path(str(files("klack")))
    found = [
        f"{path.name}: {line.strip()}"
        for folder in ("analyses", "report")
        for path in (root / folder).rglob("*.py")
        for line in path.read_text("utf-8").splitlines()
        if "fontsize=" in line
    ]

    assert found == []


def test_figures_that_nearly_fit_are_drawn_smaller_instead_of_leaving_half_a_page():
    # 0.9 + 2 * 1.05 * 1.7 = 4.5 in = 114 mm high; with heading and caption 133 mm of 259
    assert pages_of(render_pdf(one_chart_each(8))) == 5  # two each, and the first page's head


def test_a_figure_that_needs_a_page_of_its_own_keeps_its_size():
    # 0.9 + 4 * 1.05 * 1.7 = 8.0 in = 204 mm; the last one leaves room for the words at the end
    assert pages_of(render_pdf(one_chart_each(3, panels=4))) == 4


_EMPTY = Content(
    title="t",
    subtitle="s",
    description="",
    answer="a",
    numbers=Table(columns=("", "x"), rows=(("y", "1"),)),
    warnings=(),
    sections=(),
    definitions=(),
    limits=(),
    case_text="",
    versions="",
)


@pytest.mark.parametrize("store", ["off", "new"])
def test_a_figure_is_drawn_once_and_the_pages_are_set_once(store: str, tmp_path, monkeypatch):
    """``savefig`` would draw one with a layout twice; the cache gives it back bit by bit."""
    monkeypatch.setenv("KLACK_CACHE", "off" if store == "off" else str(tmp_path / store))
    calls = Counter()

    def counted(function, name):
        def call(*args, **kwargs):
            calls[name] += 1
            return function(*args, **kwargs)

        return call

    monkeypatch.setattr(Axes, "draw", counted(Axes.draw, "drawn"))
    monkeypatch.setattr(typst, "compile", counted(typst.compile, "set"))
    first = render_pdf(one_chart_each(1, panels=3))
    assert calls == {"drawn": 3, "set": 1}

    assert render_pdf(one_chart_each(1, panels=3)) == first
    assert calls == {"drawn": 6 if store == "off" else 3, "set": 2}
    render_pdf(one_chart_each(1, panels=2))  # another one
    assert calls["drawn"] == (8 if store == "off" else 5)


def test_letters_in_figures_have_eight_points_on_paper_and_on_a_telephone():
    """Paper draws a figure at LETTERS times its share of the width; 1 px of a screen is 3/4 pt."""
    template = files("klack.report").joinpath("template.typ").read_text("utf-8")
    smallest = float(re.search(r"#let smallest = ([\d.]+)", template)[1])
    sizes = [v for k, v in STYLE.items() if k.endswith("size")]
    narrow = files("klack.report").joinpath("page.js").read_text("utf-8")
    pixels = [int(size) for size in re.findall(r"size: (\d+)\}", narrow)]
    shown = figure_of(marked(1.0))["layout"]
    pixels += [shown["font"]["size"], *(mark["font"]["size"] for mark in shown["annotations"])]

    assert min(sizes) * smallest >= 8.0
    assert min(pixels) * 0.75 >= 8.0


def marked(at: float) -> Chart:
    x = np.linspace(0.0, 1.0, 5)
    panel = Panel(
        y=AxisSpec(label="y"),
        curves=(Curve(x=x, y=x, label="line"),),
        marks=(Mark(value=at, label="347 kHz, the last of them"),),
    )
    return Chart(name="marked", title="marked", x=AxisSpec(label="x"), panels=(panel,))


def test_the_label_of_a_band_that_begins_before_the_axis_is_seen_whole():
    """It would begin outside and be cut; on paper and on the screen."""
    x = np.linspace(0.0, 4.0, 5)
    panel = Panel(
        y=AxisSpec(label="y"),
        curves=(Curve(x=x, y=x, label="line"),),
        bands=(Band(low=0.0, high=3.0, label="closing"),),
    )
    axis = AxisSpec(label="x", range=(2.0, 4.0))
    chart = Chart(name="banded", title="banded", x=axis, panels=(panel,))
    (label,) = figure_of(chart)["layout"]["annotations"]
    axes = shown_chart(chart)
    axes.figure.draw_without_rendering()
    (text,) = axes.texts
    frame, box = axes.get_window_extent(), text.get_window_extent()
    pyplot.close(axes.figure)

    assert label["x"] == 2.0
    assert frame.x0 <= box.x0 + 0.01  # pixels, rounded
    assert box.x1 <= frame.x1


@pytest.mark.parametrize(
    "names",
    [
        ("full order, 87132 degrees of freedom", "reduced, 20 + 40 modes, consistent law"),
        ("MMMMMMMMMMMMMMMMMMM", "MMMMMMMMMMMMMMMMMM", "WWWWWWWWWWWWWWWWWWW"),
    ],
    ids=["two", "three"],
)
def test_a_legend_is_seen_whole(names: tuple[str, ...]):
    x = np.linspace(0.0, 1.0, 5)
    curves = tuple(Curve(x=x, y=x, label=name) for name in names)
    panel = Panel(y=AxisSpec(label="y"), curves=curves)
    axes = shown_chart(Chart(name="long", title="long", x=AxisSpec(label="x"), panels=(panel,)))
    axes.figure.draw_without_rendering()
    (legend,) = axes.figure.legends
    frame, box = axes.figure.bbox, legend.get_window_extent()
    pyplot.close(axes.figure)

    assert frame.x0 <= box.x0
    assert box.x1 <= frame.x1


def test_labels_of_upright_lines_hide_neither_curves_nor_each_other():
    """On paper above even a low panel; a row of its own only where two names would meet."""
    x = np.linspace(0.0, 5.0, 5)
    names = {0.2: "opening stop touched", 2.5: "drive ends", 2.8: "seat touched", 4.9: "last one"}
    panel = Panel(
        y=AxisSpec(label="voltage", unit="V"),
        curves=(Curve(x=x, y=x, label="line"),),
        marks=(
            *(Mark(value=at, label=name) for at, name in names.items()),
            Mark(value=9.0, label="far"),
        ),
        share=0.4,
    )
    chart = Chart(name="low", title="low", x=AxisSpec(label="x"), panels=(panel, panel))
    axes = shown_chart(chart)
    axes[0].figure.draw_without_rendering()
    boxes = [[text.get_window_extent() for text in one.texts] for one in axes]
    frames = [one.get_window_extent() for one in axes]
    whole = axes[0].figure.bbox
    pyplot.close(axes[0].figure)

    rows = {mark.label: row for mark, row in mark_rows(chart, panel, 60.0)}
    assert rows == {name: int(name == "seat touched") for name in names.values()}
    for above, frame in zip(boxes, frames, strict=True):
        assert all(box.y0 >= frame.y1 and box.x1 <= whole.x1 for box in above)
    drawn = [*boxes[0], *boxes[1], *frames]
    assert not any(a.overlaps(b) for a, b in combinations(drawn, 2))


@pytest.mark.parametrize("at", [0.0, 0.3, 0.7, 1.0])
def test_a_label_stays_within_its_plot(at: float):
    """At the left end right of its line, at the right end left of it; drawn and measured."""
    (label,) = figure_of(marked(at))["layout"]["annotations"]
    axes = shown_chart(marked(at))
    axes.figure.draw_without_rendering()
    (text,) = axes.texts
    frame, box = axes.get_window_extent(), text.get_window_extent()
    pyplot.close(axes.figure)

    assert label["xanchor"] == ("right" if at > 0.6 else "left")
    assert frame.x0 <= box.x0
    assert box.x1 <= frame.x1


def test_a_table_that_goes_on_shows_it(browser):
    """A shadow at the side that is hidden: darker pixels there than in a table that fits."""
    wide = Table(columns=tuple("abcdefghijkl"), rows=(tuple(f"{'9' * 9}" for _ in range(12)),))
    seen = {}
    for name, table in (("wide", wide), ("fits", Table(columns=("a",), rows=(("1",),)))):
        page = browser.new_page(viewport={"width": 400, "height": 700})
        page.set_content(render_html(replace(_EMPTY, numbers=table)))
        box = page.locator(".scroll").first.bounding_box()
        clip = {"x": box["x"] + box["width"] - 6, "y": box["y"] + 1, "width": 4, "height": 4}
        image = plt_image(page.screenshot(clip=clip))
        seen[name] = float(image.mean())
        page.close()

    assert seen["fits"] > 0.995
    assert seen["wide"] < 0.97


_DRAWN = "[...document.querySelectorAll('.plot')].every(plot => plot.firstChild)"


def test_buttons_of_a_chart_do_not_cover_its_legend(browser):
    """Legends of eight curves fill the width; measured as drawn."""
    x = np.linspace(0.0, 1.0, 5)
    curves = tuple(Curve(x=x, y=k * x, label=f"a curve with number {k}") for k in range(8))
    panel = Panel(y=AxisSpec(label="y"), curves=curves)
    chart = Chart(name="c", title="c", x=AxisSpec(label="x"), panels=(panel,))
    page = browser.new_page(viewport={"width": 1000, "height": 900})
    page.set_content(render_html(replace(_EMPTY, sections=(Section(title="s", charts=(chart,)),))))
    page.wait_for_function(f"{_DRAWN} && document.querySelector('.legend')")
    buttons = page.locator(".modebar").bounding_box()
    legend = page.locator(".legend").bounding_box()
    page.close()

    assert buttons["y"] + buttons["height"] <= legend["y"] + 1.0


def test_values_on_parallel_axes_are_readable_in_the_dark(browser):
    """The ground of their letters is the paper of the page: nothing large is white."""
    values = np.linspace(0.0, 1.0, 3)
    axes = tuple(ParallelAxis(spec=AxisSpec(label=name), values=values) for name in "abc")
    chart = ParallelChart(name="p", title="p", axes=axes, coloured=0)
    page = browser.new_page(viewport={"width": 1000, "height": 900}, color_scheme="dark")
    page.set_content(render_html(replace(_EMPTY, sections=(Section(title="s", charts=(chart,)),))))
    page.wait_for_function(_DRAWN)
    image = plt_image(page.locator("canvas").screenshot())
    page.close()

    assert float((image.min(axis=2) > 0.75).mean()) < 0.01


def plt_image(png: bytes) -> np.ndarray:
    return pyplot.imread(BytesIO(png))[..., :3]
