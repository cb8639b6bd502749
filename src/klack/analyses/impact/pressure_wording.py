"""Texts and numbers for the pictures of the contact pressure."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from klack.analyses.impact.contact_map import Cells
from klack.analyses.impact.pressure_view import PressureView, common_cells, line_load, peak_pressure
from klack.report.wording import quantity

__all__ = ["pressure_note", "pressure_rows"]

Floats = NDArray[np.float64]

_AT_ONCE = 0.01
"""A ring that is closed all round within this share of the contact closes at once."""
_EVEN = 0.02
"""Relative spread of the line load below which a ring carries evenly."""


def pressure_note(views: Sequence[PressureView]) -> str:
    """Note on how to read the picture."""
    shape = views[0].places.shape
    side_by_side = " All runs have the same scale." if len(views) > 1 else ""
    common = f" White: no contact. Dashed: the instant of the peak force.{side_by_side}"
    if shape == "meridian":
        return (
            "Pressure over the distance across the ring, along the surface and outwards, zero "
            "where the bodies touch first. Every stripe is one contact point, its force over its "
            f"area; nothing is interpolated.{common}"
        )
    if shape == "disc":
        return (
            "Pressure over the distance from the axis. Every stripe is one contact point, its "
            f"force over its area; nothing is interpolated.{common}"
        )
    where = (
        "round the ring, counted from +x towards +y"
        if shape == "ring"
        else "along x, counted from the middle of the contact"
    )
    zero = ", zero where the bodies touch first" if shape == "ring" else ""
    unrolled = "the contact unrolled" if shape == "ring" else "the contact seen along the axis"
    first, second = ("Above", "Below") if shape == "ring" else ("Left", "Right")
    return (
        f"{first}: line load (force normal to the surface, per length) {where}. Every contact "
        "point spreads its force over the cell around it; nothing is interpolated. "
        f"{second}: {unrolled}{zero}; pressure at the peak force, averaged over one element, "
        "because points at corners and in the middle of the sides of quadratic elements "
        f"alternate.{common}"
    )


def pressure_rows(views: Sequence[PressureView]) -> tuple[tuple[str, ...], ...]:
    """Numbers of the picture: a row per quantity, a column per run."""
    shape = views[0].places.shape
    if shape in ("meridian", "disc"):
        highest = [quantity(float((v.force[v.peak] / v.area).max()), "Pa", 3) for v in views]
        return (("highest pressure at the peak force", *highest),)
    cells = common_cells(views)
    loads = [line_load(view, cut) for view, cut in zip(views, cells, strict=True)]
    highest = [
        f"{quantity(float(peak_pressure(v, c).max()), 'Pa', 3)}\nmean over an element"
        for v, c in zip(views, cells, strict=True)
    ]
    rows = [("highest pressure at the peak force", *highest)]
    if shape == "ring":
        pairs = list(zip(views, loads, strict=True))
        rows.insert(0, ("line load at the peak force", *(_around(v, q) for v, q in pairs)))
        angles = [_degrees(cut) for cut in cells]
        rows += [
            ("first touch", *(_first(v, q, a) for (v, q), a in zip(pairs, angles, strict=True))),
            ("closed all round", *(_closed(v, q) for v, q in pairs)),
        ]
    return tuple(rows)


def _degrees(cells: Cells) -> Floats:
    return 0.5 * (cells.along[1:] + cells.along[:-1])


def _around(view: PressureView, load: Floats) -> str:
    """Mean line load at the peak force, and its range round the ring."""
    around = load[view.peak]
    mean, low, high = (float(value) for value in (around.mean(), around.min(), around.max()))
    text = f"{1e-3 * mean:.1f} N/mm on average"
    if high - low < _EVEN * mean:
        return f"{text}\neven round the ring"
    return f"{text}\n{1e-3 * low:.1f} to {1e-3 * high:.1f} N/mm round the ring"


def _first(view: PressureView, load: Floats, angle: Floats) -> str:
    """Where the ring begins to carry: the middle of what carries in the first record."""
    if _closes_at_once(view, load):
        return "all round at once"
    begins = int(np.argmax(load.any(axis=1)))
    middle = np.angle(load[begins] @ np.exp(1j * np.radians(angle)), deg=True)
    return f"at {round(middle) % 360}°"


def _closed(view: PressureView, load: Floats) -> str:
    """From when to when every part of the ring carries."""
    whole = np.flatnonzero((load > 0).all(axis=1))
    if not len(whole):
        return f"never\nat most {100 * float((load > 0).mean(axis=1).max()):.0f} % of it"
    start, end = float(view.time[whole[0]]), float(view.time[whole[-1]])
    if _closes_at_once(view, load):
        return f"until {quantity(end, 's', 3)}"
    return f"from {quantity(start, 's', 3)} to {quantity(end, 's', 3)}"


def _closes_at_once(view: PressureView, load: Floats) -> bool:
    whole = np.flatnonzero((load > 0).all(axis=1))
    return bool(len(whole)) and bool(view.time[whole[0]] < _AT_ONCE * view.time[-1])
