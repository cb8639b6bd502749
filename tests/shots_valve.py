"""A coarse valve in three dimensions for tests of many strokes: a stroke in half a second."""

from pathlib import Path

from klack.case.any_case import read_valve_case
from klack.case.valve import ValveCase

FILE = Path(__file__).parent / "data" / "case" / "stroke.yaml"
GUIDE = "guide: {surface: shaft, heights: [4 mm, 13 mm], clearance: 4 um, friction: 0.1}"
RUN = "run: {duration: 0.78 ms, variants: [dry]}"

_COARSER = (
    ("model: axisymmetric", "model: swept\n      layers: 8"),
    ("size: 1 mm", "size: 3 mm"),
    ("{size: 0.012 mm, ", "{size: 0.1 mm, "),
    ("{size: 0.02 mm, ", "{size: 0.1 mm, "),
    ("land: 0.04 mm", "land: 0.2 mm"),
)


def valve_text(shots: str = "shots: {count: 3}", run: str = RUN, guide: str = GUIDE) -> str:
    """Text of the case; the modes are few, and the contact far too coarse for a good impact."""
    text = FILE.read_text(encoding="utf-8")
    for old, new in _COARSER:
        assert old in text
        text = text.replace(old, new)
    head, _, _ = text.partition("\nrun: ")
    reduction, network = head.index("\nreduction:"), head.index("\nnetwork:")
    modes = "\nreduction: {modes: {needle: {count: 6}, housing: {count: 6}, pole: {count: 4}}}"
    head = head[:reduction] + modes + head[network:]
    return "\n".join([head, "motion: three-dimensional", guide, shots, run, ""])


def valve_case(shots: str = "shots: {count: 3}", run: str = RUN, guide: str = GUIDE) -> ValveCase:
    """Read the case of :func:`valve_text`."""
    return read_valve_case(valve_text(shots, run, guide), FILE)
