"""Widths of printed text, without a font: what a label needs at most.

The widths are those of DejaVu Sans, the widest of the fonts that a viewer is told to use; in
another one the text is narrower.
"""

from functools import lru_cache

__all__ = ["cut", "text_width"]

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
    """Width [px] that a line of text takes at most.

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
    """Text of a bearable length.

    >>> cut("a_rather_long_name", 8)
    'a_rathe…'
    """
    return text if len(text) <= most else f"{text[: most - 1]}…"
