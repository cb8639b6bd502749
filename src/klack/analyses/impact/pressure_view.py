"""Contact forces of one run as fields over a picture."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.analyses.impact.contact_map import (
    Cells,
    ContactMap,
    averaged,
    closed,
    contact_map,
    line_load_weights,
    map_cells,
)
from klack.analyses.impact.record import FrictionRecord, ImpactStudy, PressureRecord
from klack.report.wording import quantity

__all__ = [
    "FrictionView",
    "PressureView",
    "across_window",
    "common_cells",
    "friction_views",
    "line_load",
    "peak_pressure",
    "pressure_note",
    "pressure_rows",
    "pressure_view",
    "record_edges",
    "study_views",
]


Floats = NDArray[np.float64]

_COLUMNS, _ROWS = 1080, 180
"""Rectangles of the picture; a cell of a spot is about 30 wide."""
_MARGIN = 0.18
"""Margin of the carrying zone on either side."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressureView:
    """One run: title of its picture, and the forces (n, nc) [N] of its contact points.

    ``time`` [s] counts from first touch.
    """

    title: str
    time: Floats
    force: Floats
    area: Floats
    places: ContactMap

    @property
    def peak(self) -> int:
        """Record of the largest sum of the point forces."""
        return int(np.argmax(self.force.sum(axis=1)))


def pressure_view(
    title: str, record: PressureRecord | None, first_touch: float
) -> PressureView | None:
    """Lay out a record, if anything is carried."""
    if record is None or len(record.time) < 2 or not record.point_force.max(initial=0.0) > 0:
        return None
    return PressureView(
        title=title,
        time=record.time - first_touch,
        force=np.asarray(record.point_force, dtype=float),
        area=record.area,
        places=contact_map(record),
    )


def study_views(study: ImpactStudy) -> tuple[PressureView, ...]:
    """Levels with contact points that look alike."""
    found = [
        pressure_view(result.label, result.pressure, result.measures.first_touch)
        for result in study.ordered
    ]
    views = [view for view in found if view is not None]
    return tuple(view for view in views if view.places.shape == views[0].places.shape)


def record_edges(view: PressureView) -> Floats:
    """Limits (n + 1,) of the records in time [s]."""
    middles = 0.5 * (view.time[1:] + view.time[:-1])
    first, last = 2 * view.time[0] - middles[0], 2 * view.time[-1] - middles[-1]
    return np.concatenate([[max(first, 0.0)], middles, [last]])


# --------------------------------------------------------------------------- windows


def across_window(views: Sequence[PressureView]) -> tuple[float, float]:
    """Range [m] across the contact that carries at some time, with a margin."""
    return _window(views, [view.places.across for view in views])


def _window(views: Sequence[PressureView], places: Sequence[Floats]) -> tuple[float, float]:
    carrying = np.concatenate(
        [where[view.force.any(axis=0)] for view, where in zip(views, places, strict=True)]
    )
    everywhere = np.concatenate(places)
    margin = _MARGIN * float(np.ptp(carrying)) or 0.1 * float(np.ptp(everywhere))
    return (
        max(float(carrying.min()) - margin, float(everywhere.min())),
        min(float(carrying.max()) + margin, float(everywhere.max())),
    )


def common_cells(views: Sequence[PressureView]) -> tuple[Cells, ...]:
    """Cells of every view, rings or spots, in one common window."""
    along, across = (0.0, 360.0), across_window(views)
    columns = _columns(views[0].places)
    if views[0].places.shape == "spot":
        sideways = _window(views, [view.places.along for view in views])
        reach = max(abs(value) for value in (*across, *sideways))
        along = across = (-reach, reach)
    return tuple(map_cells(view.places, along, across, (columns, _ROWS)) for view in views)


def _columns(places: ContactMap) -> int:
    """Columns of the picture: as many for every angle of a regular ring, half on either side."""
    angles = np.unique(np.round(places.along, 6) % 360.0)
    if places.shape != "ring" or len(angles) > _COLUMNS // 2 or len(angles) < 2:
        return _COLUMNS
    steps = np.diff(angles, append=angles[0] + 360.0)
    if np.ptp(steps) > 1e-3 * steps.mean():
        return _COLUMNS
    return 2 * len(angles) * round(_COLUMNS / (2 * len(angles)))


# --------------------------------------------------------------------------- fields


def line_load(view: PressureView, cells: Cells) -> Floats:
    """Force per length (n, nx) [N/m] in every column of the picture over time."""
    return view.force @ line_load_weights(view.places, cells)


def peak_pressure(view: PressureView, cells: Cells) -> Floats:
    """Pressure (ny, nx) [Pa] at the peak force, averaged over an element.

    Points at the corners of quadratic elements and points in the middle of their sides may
    alternate; the mean over both does not.  Zero where neighbouring points carry nothing.
    """
    single = np.append(view.force[view.peak] / view.area, 0.0)[cells.owner]
    return np.where(closed(single > 0, cells), averaged(single, cells), 0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrictionView:
    """One run: its pressure and its friction."""

    pressure: PressureView
    friction: FrictionRecord


def friction_views(study: ImpactStudy) -> tuple[FrictionView, ...]:
    """Levels with friction at contact points that look alike."""
    found = []
    for result in study.ordered:
        view = pressure_view(result.label, result.pressure, result.measures.first_touch)
        if view is not None and result.pressure is not None and result.pressure.friction:
            found.append(FrictionView(pressure=view, friction=result.pressure.friction))
    return tuple(v for v in found if v.pressure.places.shape == found[0].pressure.places.shape)


_AT_ONCE = 0.01
"""Share of the contact within which a ring that closes at once is closed."""
_EVEN = 0.02
"""Relative spread of the line load of an even ring."""


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
        "around the ring, counted from +x towards +y"
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
    around = load[view.peak]
    mean, low, high = (float(value) for value in (around.mean(), around.min(), around.max()))
    text = f"{1e-3 * mean:.1f} N/mm on average"
    if high - low < _EVEN * mean:
        return f"{text}\neven round the ring"
    return f"{text}\n{1e-3 * low:.1f} to {1e-3 * high:.1f} N/mm round the ring"


def _first(view: PressureView, load: Floats, angle: Floats) -> str:
    """Where the ring begins to carry: middle of the first record."""
    if _closes_at_once(view, load):
        return "all round at once"
    begins = int(np.argmax(load.any(axis=1)))
    middle = np.angle(load[begins] @ np.exp(1j * np.radians(angle)), deg=True)
    return f"at {round(middle) % 360}°"


def _closed(view: PressureView, load: Floats) -> str:
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
