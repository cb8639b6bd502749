"""Where faces stick and slip while they touch, and which way: a picture over time.

Friction over the most that the points can hold, +1 where all slips with friction pushing the moving
body outwards, -1 inwards, between them where they stick.  Axisymmetric bodies have one row, across
the contact; bodies in three dimensions two, round the ring: friction along the face away from the
axis, and round the axis.
"""

from collections.abc import Sequence
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import NDArray

from klack.analyses.impact.contact_map import cell_edges, line_load_weights
from klack.analyses.impact.pressure_figure import PressureFigure
from klack.analyses.impact.pressure_view import (
    FrictionView,
    across_window,
    common_cells,
    record_edges,
)
from klack.report.printed import STYLE, plain, svg

__all__ = ["friction_figure"]

Floats = NDArray[np.float64]

_MAP = "RdYlBu_r"
_TITLE_LETTERS = 84
_LITTLE = 1e-3
"""Of the highest force of a point or column: below it nothing is shown."""
_NOTE = (
    "Friction on the moving body over the most that the pressed points can hold. Dark red: they "
    "slip and friction pushes it {first}; dark blue: {second}; pale: they stick. White: no contact."
)


def friction_figure(views: Sequence[FrictionView]) -> PressureFigure:
    """Draw one or more runs of one shape side by side, with a caption."""
    shape = views[0].pressure.places.shape
    is_flat = shape in ("meridian", "disc")
    rows = 1 if is_flat else 2
    with rc_context(STYLE | {"axes.grid": False}):
        figure = Figure(figsize=(6.7, 0.3 + 2.4 * rows), layout="constrained")
        grid = figure.subplots(rows, len(views), squeeze=False)
        longest = 1e6 * max(float(record_edges(v.pressure)[-1]) for v in views)
        cuts = () if is_flat else common_cells([v.pressure for v in views])
        for column, view in enumerate(views):
            axes = grid[0, column]
            title = fill(view.pressure.title, _TITLE_LETTERS // len(views))
            axes.set_title(plain(title), fontsize=8)
            if is_flat:
                mesh = _across(axes, view, across_window([v.pressure for v in views]))
                continue
            cells = cuts[column]
            weights = line_load_weights(view.pressure.places, cells)
            for way, lower in enumerate(grid[:, column]):
                x = cells.along if shape == "ring" else 1e6 * cells.along
                share = _share(view, way, weights)
                mesh = _paint(lower, x, 1e6 * record_edges(view.pressure), share)
                if shape == "ring":
                    lower.set_xticks(range(0, 361, 90))
                lower.set_xlabel("angle round the axis [°]" if shape == "ring" else "x [µm]")
        for axes in grid.ravel():
            axes.set_ylim(0.0, longest)
        for axes in grid[:, 0]:
            axes.set_ylabel("time since first touch [µs]")
        labels = ["friction, outwards"] if is_flat else ["friction, outwards", "friction, round"]
        if shape == "spot":
            labels = ["friction, along x", "friction, along y"]
        for row, label in zip(grid, labels, strict=True):
            figure.colorbar(mesh, ax=row, aspect=22).set_label(f"{label} [of its limit]")
        first, second = (
            ("to +x or +y", "to -x or -y") if shape == "spot" else ("outwards", "inwards")
        )
        note = _NOTE.format(first=first, second=second)
        if shape == "ring":
            note += " Above: along the face, away from the axis. Below: round the axis."
        return PressureFigure(svg(figure), note)


def _across(axes: Any, view: FrictionView, window: tuple[float, float]) -> Any:
    """Friction over the distance across an axisymmetric contact and time."""
    order, edges = cell_edges(view.pressure.places)
    share = _share(view, 0, np.eye(len(view.pressure.area)))[:, order]
    mesh = _paint(axes, 1e6 * edges, 1e6 * record_edges(view.pressure), share)
    axes.set_xlim(1e6 * window[0], 1e6 * window[1])
    is_ring = view.pressure.places.shape == "meridian"
    axes.set_xlabel(f"distance {'across the ring' if is_ring else 'from the axis'} [µm]")
    return mesh


def _share(view: FrictionView, way: int, weights: Any) -> Floats:
    """Friction in a direction over its limit, of columns of points; nan where nothing presses."""
    pressed = view.pressure.force @ weights
    rubbed = view.friction.force[:, way].astype(float) @ weights
    limit = view.friction.coefficient * pressed
    share = np.full(pressed.shape, np.nan)
    carried = pressed > _LITTLE * pressed.max()
    share[carried] = rubbed[carried] / np.maximum(limit[carried], 1e-300)
    return share


def _paint(axes: Any, x: Floats, y: Floats, share: Floats) -> Any:
    values = np.ma.masked_invalid(share)
    return axes.pcolorfast(x, y, values, vmin=-1.0, vmax=1.0, cmap=_MAP, rasterized=True)
