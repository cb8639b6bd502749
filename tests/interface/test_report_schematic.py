"""The schematic in reports: truth = the stored picture, and the pages that it is shown on."""

import re
import zlib
from base64 import b64encode
from contextlib import suppress

from schematic_rules import random_network

from klack.analyses.page import schematic_section
from klack.report.html import render_html
from klack.report.page import Content, Section, Table
from klack.report.pdf import render_pdf
from klack.schematic.picture import schematic_svg


def content(*sections: Section) -> Content:
    return Content(
        title="t",
        subtitle="s",
        description="",
        answer="a",
        numbers=Table(columns=("", "x"), rows=(("y", "1"),)),
        warnings=(),
        sections=sections,
        definitions=(),
        limits=(),
        case_text="",
        versions="",
    )


def test_the_page_shows_the_picture_of_the_result():
    picture = schematic_svg(random_network(3))

    page = render_html(content(schematic_section(picture)))

    assert b64encode(picture.encode()).decode() in page
    assert '<figure class="wide">' in page


def widths_of_pages(paper: bytes) -> set[int]:
    """Widths [pt] of the pages of a PDF, 595 upright and 842 on its side."""
    plain = paper
    for packed in re.findall(rb"stream\r?\n(.*?)\r?\nendstream", paper, re.DOTALL):
        with suppress(zlib.error):
            plain += zlib.decompress(packed)
    boxes = re.findall(rb"/MediaBox\s*\[\s*0 0 ([\d.]+) [\d.]+\s*\]", plain)
    return {round(float(width)) for width in boxes}


def test_paper_has_a_page_for_it_that_lies_only_for_a_wide_picture():
    wide, high = schematic_svg(random_network(3)), schematic_svg(random_network(9))

    assert widths_of_pages(render_pdf(content(schematic_section(wide)))) == {595, 842}
    assert widths_of_pages(render_pdf(content(schematic_section(high)))) == {595}


def test_an_older_result_has_no_schematic_and_a_damaged_one_says_so():
    assert schematic_section("").picture is None
    damaged = schematic_section("<svg><g></svg>")

    assert damaged.picture is None
    assert "klack show" in damaged.paragraphs[0]
