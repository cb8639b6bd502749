"""Section of a report with the schematic of the valve."""

from dataclasses import dataclass
from xml.etree import ElementTree

from klack.report.page import Section

__all__ = ["schematic_section"]

_NOTE = (
    "The network of the case: chambers, restrictions and lines of the fluid on the left, bodies in "
    "the middle, what pushes and stops them on the right, magnets and drivers beside them. (0) is "
    "the state at the start. A dashed ring is a port in no connection."
)
_TITLE = "Schematic"


@dataclass(frozen=True, slots=True)
class _Schematic:
    """Picture (SVG) and its caption."""

    image: bytes
    note: str


def schematic_section(picture: str) -> Section:
    """Show a stored schematic; empty for a result of an earlier klack, which has none."""
    if not picture:
        return Section(title=_TITLE)
    try:
        ElementTree.fromstring(picture)
    except ElementTree.ParseError:
        text = "The picture in this result is damaged; klack show draws it again from the case."
        return Section(title=_TITLE, paragraphs=(text,))
    return Section(title=_TITLE, picture=_Schematic(picture.encode(), _NOTE), wide=True)
