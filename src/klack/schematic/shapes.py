"""Parts of a schematic, in px."""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, Self

__all__ = [
    "Box",
    "Domain",
    "Label",
    "Lead",
    "Point",
    "Stroke",
    "Symbol",
    "Wire",
    "bounds",
    "cut",
    "text_width",
]


_FIRST, _OTHER, _BOLD, _MOST = 32, 1.0, 1.16, 40
_HINTED = 1.02  # what fitting letters to pixels may add
_WIDTHS = (
    "318 401 460 838 636 950 780 275 390 390 500 838 318 361 318 337 636 636 636 636 636 636 636 "
    "636 636 636 337 337 838 838 838 531 1000 684 686 698 770 632 575 775 752 295 295 656 557 863 "
    "748 787 603 787 695 635 611 732 684 989 685 611 685 390 337 390 838 500 500 613 635 550 635 "
    "615 352 635 634 278 278 579 278 974 634 612 635 635 411 521 392 634 592 818 592 592 525 636 "
    "337 636 838"
)
_ASCII = tuple(int(width) / 1000.0 for width in _WIDTHS.split())
_NARROW = {"²": 0.44, "³": 0.44, "µ": 0.74, "°": 0.5, "·": 0.38, "Ω": 0.85, "…": 1.0}


@lru_cache(maxsize=4096)
def text_width(text: str, size: float, *, bold: bool = False) -> float:
    """Width [px] that a line of text takes at most: that in DejaVu Sans, the widest font in use.

    >>> text_width("needle", 10.0) < text_width("needle", 10.0, bold=True) < 60.0
    True
    """
    width = sum(_letter(letter) for letter in text)
    return size * width * (_BOLD if bold else 1.0) * _HINTED


def _letter(letter: str) -> float:
    place = ord(letter) - _FIRST
    if 0 <= place < len(_ASCII):
        return _ASCII[place]
    return _NARROW.get(letter, _OTHER)


def cut(text: str, most: int = _MOST) -> str:
    """Text shortened to a length.

    >>> cut("a_rather_long_name", 8)
    'a_rathe…'
    """
    return text if len(text) <= most else f"{text[: most - 1]}…"


Domain = Literal["hydraulic", "pneumatic", "mechanical", "electric", "thermal"]
Point = tuple[float, float]
Ink = Literal["line", "thin", "heavy", "solid", "fluid", "metal", "paper", "unknown"]
_ASCENT, _DESCENT = 0.8, 0.25  # of the size: letters above and below their line


@dataclass(frozen=True, slots=True)
class Box:
    """Upright rectangle; y points down."""

    x: float
    y: float
    width: float
    height: float

    def meets(self, other: "Box", gap: float = 0.0) -> bool:
        """Whether both overlap, or are closer than ``gap``."""
        return (
            self.x < other.x + other.width + gap
            and other.x < self.x + self.width + gap
            and self.y < other.y + other.height + gap
            and other.y < self.y + self.height + gap
        )

    def moved(self, dx: float, dy: float) -> "Box":
        """The same box at another place."""
        return Box(self.x + dx, self.y + dy, self.width, self.height)


def bounds(boxes: "list[Box]") -> Box:
    """Smallest box round all of them."""
    left, top = min(box.x for box in boxes), min(box.y for box in boxes)
    right = max(box.x + box.width for box in boxes)
    bottom = max(box.y + box.height for box in boxes)
    return Box(left, top, right - left, bottom - top)


@dataclass(frozen=True, slots=True)
class Label:
    """One line of text; ``y`` is its baseline."""

    text: str
    x: float
    y: float
    size: float
    anchor: Literal["start", "middle", "end"] = "start"
    bold: bool = False
    soft: bool = False

    @property
    def box(self) -> Box:
        """Space that it takes at most."""
        width = text_width(self.text, self.size, bold=self.bold)
        shift = {"start": 0.0, "middle": 0.5, "end": 1.0}[self.anchor]
        top = self.y - _ASCENT * self.size
        return Box(self.x - shift * width, top, width, (_ASCENT + _DESCENT) * self.size)

    def moved(self, dx: float, dy: float) -> Self:
        """The same label at another place."""
        return replace(self, x=self.x + dx, y=self.y + dy)


@dataclass(frozen=True, slots=True)
class Stroke:
    """SVG path data, in the coordinates of its symbol."""

    path: str
    ink: Ink = "line"


@dataclass(frozen=True, slots=True)
class Symbol:
    """Strokes round an origin, turned clockwise by ``turn`` degrees, and their box."""

    strokes: tuple[Stroke, ...]
    x: float
    y: float
    box: Box
    turn: int = 0
    component: str = ""

    def moved(self, dx: float, dy: float) -> Self:
        """The same symbol at another place."""
        return replace(self, x=self.x + dx, y=self.y + dy, box=self.box.moved(dx, dy))


@dataclass(frozen=True, slots=True)
class Lead:
    """Line from a port, ``component.port``, at the edge of a cell to its symbol.

    ``node`` is None at a port that no wire leads to.
    """

    domain: Domain
    points: tuple[Point, ...]
    port: str
    node: int | None = None

    def moved(self, dx: float, dy: float) -> Self:
        """The same lead at another place."""
        return replace(self, points=tuple((x + dx, y + dy) for x, y in self.points))


@dataclass(frozen=True, slots=True)
class Wire:
    """Upright and level lines of one node of the network, and the points where they branch.

    ``joints`` are its ports, as ``component.port``.
    """

    node: int
    domain: Domain
    lines: tuple[tuple[Point, Point], ...]
    branches: tuple[Point, ...]
    joints: tuple[str, ...]

    def moved(self, dx: float, dy: float) -> Self:
        """The same wire at another place."""
        return replace(
            self,
            lines=tuple(((a + dx, b + dy), (c + dx, d + dy)) for (a, b), (c, d) in self.lines),
            branches=tuple((a + dx, b + dy) for a, b in self.branches),
        )
