"""Forces of the contact points of one run as fields over a picture."""

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

__all__ = [
    "FrictionView",
    "PressureView",
    "across_window",
    "common_cells",
    "friction_views",
    "line_load",
    "peak_pressure",
    "pressure_view",
    "record_edges",
    "study_views",
]

Floats = NDArray[np.float64]

_COLUMNS, _ROWS = 1080, 180
"""Rectangles of the picture: so narrow that a cell of a spot is 30 or so wide."""
_MARGIN = 0.18
"""Of the carrying zone, added to the picture on either side."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressureView:
    """One run: title of its picture, and the forces of its contact points.

    Parameters
    ----------
    title : str
    time : array, shape (n,) [s]
        Since first touch.
    force : array, shape (n, nc) [N]
    area : array, shape (nc,) [m^2]
    places : ContactMap
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
    """Lay out what a run has recorded; None where nothing is carried."""
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
    """All levels that resolve the contact point by point, as far as they look alike."""
    found = [
        pressure_view(result.label, result.pressure, result.measures.first_touch)
        for result in study.ordered
    ]
    views = [view for view in found if view is not None]
    return tuple(view for view in views if view.places.shape == views[0].places.shape)


def record_edges(view: PressureView) -> Floats:
    """Limits of the records in time, in the middle between two, shape (n + 1,) [s]."""
    middles = 0.5 * (view.time[1:] + view.time[:-1])
    first, last = 2 * view.time[0] - middles[0], 2 * view.time[-1] - middles[-1]
    return np.concatenate([[max(first, 0.0)], middles, [last]])


# --------------------------------------------------------------------------- windows


def across_window(views: Sequence[PressureView]) -> tuple[float, float]:
    """Range across the contact that carries at some time, with a margin, where points are [m]."""
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
    """Columns of the picture: of a regular ring as many for every angle, half on either side."""
    angles = np.unique(np.round(places.along, 6) % 360.0)
    if places.shape != "ring" or len(angles) > _COLUMNS // 2 or len(angles) < 2:
        return _COLUMNS
    steps = np.diff(angles, append=angles[0] + 360.0)
    if np.ptp(steps) > 1e-3 * steps.mean():
        return _COLUMNS
    return 2 * len(angles) * round(_COLUMNS / (2 * len(angles)))


# --------------------------------------------------------------------------- fields


def line_load(view: PressureView, cells: Cells) -> Floats:
    """Force per length in every column of the picture over time, shape (n, nx) [N/m]."""
    return view.force @ line_load_weights(view.places, cells)


def peak_pressure(view: PressureView, cells: Cells) -> Floats:
    """Pressure at the peak force, averaged over an element, shape (ny, nx) [Pa].

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
    """All levels that resolve friction point by point, as far as they look alike."""
    found = []
    for result in study.ordered:
        view = pressure_view(result.label, result.pressure, result.measures.first_touch)
        if view is not None and result.pressure is not None and result.pressure.friction:
            found.append(FrictionView(pressure=view, friction=result.pressure.friction))
    return tuple(v for v in found if v.pressure.places.shape == found[0].pressure.places.shape)
