"""The report on paper, set by typst from the same content as the page.

Words travel as JSON and are printed as strings: typst never reads them as markup.
"""

import hashlib
import json
from dataclasses import asdict
from functools import cache
from importlib.metadata import distribution
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree

import typst

from klack.files.whole import whole_file
from klack.machine.cache.entry import bytes_of_entry, entry_of_bytes
from klack.machine.cache.remember import remembered
from klack.machine.cache.result_cache import result_cache
from klack.report.chart import AnyChart
from klack.report.page import Content, Section

__all__ = ["render_pdf", "write_pdf"]

_FONTS = "matplotlib/mpl-data/fonts/ttf"


def write_pdf(content: Content, path: Path) -> None:
    """Write the report as a PDF file (A4)."""
    with whole_file(path) as new:
        new.write_bytes(render_pdf(content))


def render_pdf(content: Content) -> bytes:
    """Set the content as pages."""
    template = files("klack.report").joinpath("template.typ").read_bytes()
    with TemporaryDirectory(prefix="klack-report-") as folder:
        work = Path(folder)
        (work / "template.typ").write_bytes(template)
        words = _words(content) | {
            "sections": [
                _section(section, f"{i}", work) for i, section in enumerate(content.sections)
            ]
        }
        (work / "content.json").write_text(json.dumps(words), encoding="utf-8")
        # the letters of the figures, so that the pages look the same on every machine
        pages = typst.compile(
            str(work / "template.typ"),
            root=str(work),
            font_paths=[str(distribution("matplotlib").locate_file(_FONTS))],
            ignore_system_fonts=True,
        )
    return bytes(pages)


def _words(content: Content) -> dict[str, Any]:
    return {
        "title": content.title,
        "subtitle": content.subtitle,
        "description": content.description,
        "answer": content.answer,
        "numbers": asdict(content.numbers),
        "warnings": content.warnings,
        "definitions": content.definitions,
        "limits": content.limits,
        "case_text": content.case_text,
        "versions": content.versions,
    }


def _section(section: Section, name: str, work: Path) -> dict[str, Any]:
    figures = []
    if section.picture is not None:
        figures.append({"title": "", "note": section.picture.note, "image": f"{name}-picture.svg"})
        (work / figures[-1]["image"]).write_bytes(section.picture.image)
    for i, chart in enumerate(section.charts):
        figures.append({"title": chart.title, "note": chart.note, "image": f"{name}-{i}.svg"})
        (work / figures[-1]["image"]).write_bytes(_drawn(chart))
    wide = section.picture if section.wide else None
    return {
        "title": section.title,
        "paragraphs": [*section.paragraphs, *(f"{s.title}. {s.note}" for s in section.sounds)],
        "figures": figures,
        "wide": wide is not None,
        "lying": wide is not None and _lies(wide.image),
        "tables": [asdict(table) for table in section.tables],
    }


def _drawn(chart: AnyChart) -> bytes:
    """SVG of a chart, from the cache a hundred times faster."""

    def draw() -> bytes:
        from klack.report.printed import svg_chart  # with matplotlib, which takes long to import

        return svg_chart(chart)

    return remembered(
        result_cache(),
        "figure",
        (_drawing(), chart),
        draw,
        pack=entry_of_bytes,
        unpack=bytes_of_entry,
    )


@cache
def _drawing() -> str:
    """Key for drawing: klack's sources for it, and matplotlib's release."""
    digest = hashlib.sha256(distribution("matplotlib").version.encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _lies(image: bytes) -> bool:
    box = ElementTree.fromstring(image).get("viewBox", "0 0 1 1").split()
    return float(box[2]) > float(box[3])
