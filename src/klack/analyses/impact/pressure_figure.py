"""Where the bodies carry, stick and slip while they touch: pictures over time.

Of bodies in three dimensions the upper row shows the line load, that is the force per length of the
ring (or along x of a spot), over time, and the lower row the pressure at the peak force.
Axisymmetric bodies have one row: the pressure across the contact over time.  White is no contact.
Several runs stand side by side at one scale.

Friction is shown over the most that the points can hold: +1 where all slips with friction pushing
the moving body outwards, -1 inwards, between them where they stick.  Axisymmetric bodies have one
row, across the contact; bodies in three dimensions two, round the ring: friction along the face
away from the axis, and round the axis.
"""

from collections.abc import Sequence
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from klack.analyses.impact.contact_map import cell_edges, line_load_weights
from klack.analyses.impact.pressure_view import (
    FrictionView,
    PressureView,
    across_window,
    common_cells,
    line_load,
    peak_pressure,
    pressure_note,
    record_edges,
)
from klack.report.page import Picture
from klack.report.printed import STYLE, plain, svg

__all__ = ["draw_pressure", "friction_figure", "pressure_figure"]


Floats = NDArray[np.float64]

_MAP = "viridis"
_INK = "#22262b"
_TITLE_LETTERS = 68
"""Letters side by side above all columns together."""
_NOTHING = 1e-9
"""Share of the highest value that counts as nothing (round-off)."""


def pressure_figure(views: Sequence[PressureView]) -> Picture:
    """Draw one or more runs of one shape side by side, with a caption."""
    return Picture(draw_pressure(views), pressure_note(views))


def draw_pressure(views: Sequence[PressureView]) -> bytes:
    """The same as SVG."""
    shape = views[0].places.shape
    is_flat, is_spot = shape in ("meridian", "disc"), shape == "spot"
    with rc_context(STYLE | {"axes.grid": False}):
        # fields by runs; of spots, which are as high as wide, a row holds the fields of one run
        rows, columns = (len(views), 2) if is_spot else (1 if is_flat else 2, len(views))
        height = 0.3 + (2.6 if is_flat or is_spot else 2.3) * rows
        figure = Figure(figsize=(6.7, height), layout="constrained")
        grid = figure.subplots(rows, columns, squeeze=False)
        grid = grid.T if is_spot else grid
        longest = 1e6 * max(float(record_edges(view)[-1]) for view in views)
        for axes, view in zip(grid[0], views, strict=True):
            axes.set_title(plain(fill(view.title, _TITLE_LETTERS // columns)))
            axes.set_ylim(0.0, longest)
            axes.axhline(1e6 * view.time[view.peak], color=_INK, linewidth=0.7, dashes=(4, 3))
            axes.set_ylabel("time since\nfirst touch [µs]")
        if is_flat:
            _draw_profiles(figure, grid[0], views)
        else:
            _draw_unrolled(figure, grid, views)
        if not is_spot:
            for axes in grid[:, 1:].ravel():
                axes.set_ylabel("")
        return svg(figure)


def _draw_profiles(figure: Figure, row: Any, views: Sequence[PressureView]) -> None:
    pressures = [1e-6 * view.force / view.area for view in views]
    norm = _common_scale(pressures)
    low, high = across_window(views)
    is_ring = views[0].places.shape == "meridian"
    for axes, view, pressure in zip(row, views, pressures, strict=True):
        order, edges = cell_edges(view.places)
        mesh = _paint(axes, 1e6 * edges, 1e6 * record_edges(view), pressure[:, order], norm)
        axes.set_xlim(1e6 * low, 1e6 * high)
        axes.set_xlabel(f"distance {'across the ring' if is_ring else 'from the axis'} [µm]")
    figure.colorbar(mesh, ax=row, aspect=25).set_label("pressure [MPa]")


def _draw_unrolled(figure: Figure, grid: Any, views: Sequence[PressureView]) -> None:
    is_ring = views[0].places.shape == "ring"
    cells = common_cells(views)
    loads = [1e-3 * line_load(view, cut) for view, cut in zip(views, cells, strict=True)]
    pressures = [1e-6 * peak_pressure(view, cut) for view, cut in zip(views, cells, strict=True)]
    load_scale, pressure_scale = _common_scale(loads), _common_scale(pressures)
    for column, (view, cut) in enumerate(zip(views, cells, strict=True)):
        upper, lower = grid[:, column]
        x = cut.along if is_ring else 1e6 * cut.along
        above = _paint(upper, x, 1e6 * record_edges(view), loads[column], load_scale)
        below = _paint(lower, x, 1e6 * cut.across, pressures[column], pressure_scale)
        for axes in (upper, lower):
            axes.set_xlim(x[0], x[-1])
            if is_ring:
                axes.set_xticks(range(0, 361, 90))
            axes.set_xlabel("angle round the axis [°]" if is_ring else "x [µm]")
        lower.set_ylabel("distance across\nthe ring [µm]" if is_ring else "y [µm]")
        lower.set_ylim(1e6 * cut.across[0], 1e6 * cut.across[-1])
        peak = f"at peak force, after {1e6 * view.time[view.peak]:.3g} µs"
        lower.set_title(fill(peak, _TITLE_LETTERS // len(views)))
        if not is_ring:
            lower.set_aspect("equal")
    figure.colorbar(above, ax=grid[0], aspect=22).set_label("line load [N/mm]")
    figure.colorbar(below, ax=grid[1], aspect=22).set_label("pressure [MPa]")


def _common_scale(fields: Sequence[Floats]) -> Normalize:
    return Normalize(0.0, max(float(values.max()) for values in fields))


def _paint(axes: Any, x: Floats, y: Floats, values: Floats, norm: Normalize) -> Any:
    carried = np.ma.masked_less_equal(values, _NOTHING * float(norm.vmax or 0.0))
    return axes.pcolorfast(x, y, carried, norm=norm, cmap=_MAP, rasterized=True)


_SHARES = "RdYlBu_r"
_LITTLE = 1e-3
"""Share of the highest force below which nothing is shown."""
_NOTE = (
    "Friction on the moving body over the largest friction that the pressed points can carry. "
    "Dark red: the points slip and friction pushes the body {first}; dark blue: {second}; pale: "
    "they stick. White: no contact."
)


def friction_figure(views: Sequence[FrictionView]) -> Picture:
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
            axes.set_title(plain(title))
            if is_flat:
                mesh = _across(axes, view, across_window([v.pressure for v in views]))
                continue
            cells = cuts[column]
            weights = line_load_weights(view.pressure.places, cells)
            for way, lower in enumerate(grid[:, column]):
                x = cells.along if shape == "ring" else 1e6 * cells.along
                share = _share(view, way, weights)
                mesh = _paint_shares(lower, x, 1e6 * record_edges(view.pressure), share)
                if shape == "ring":
                    lower.set_xticks(range(0, 361, 90))
                lower.set_xlabel("angle round the axis [°]" if shape == "ring" else "x [µm]")
        for axes in grid.ravel():
            axes.set_ylim(0.0, longest)
        for axes in grid[:, 0]:
            axes.set_ylabel("time since\nfirst touch [µs]")
        labels = ["friction, outwards"] if is_flat else ["friction, outwards", "friction, round"]
        if shape == "spot":
            labels = ["friction, along x", "friction, along y"]
        for row, label in zip(grid, labels, strict=True):
            figure.colorbar(mesh, ax=row, aspect=22).set_label(f"{label}\n[of its limit]")
        first, second = (
            ("to +x or +y", "to -x or -y") if shape == "spot" else ("outwards", "inwards")
        )
        note = _NOTE.format(first=first, second=second)
        if shape == "ring":
            note += " Above: along the face, away from the axis. Below: around the axis."
        return Picture(svg(figure), note)


def _across(axes: Any, view: FrictionView, window: tuple[float, float]) -> Any:
    order, edges = cell_edges(view.pressure.places)
    share = _share(view, 0, np.eye(len(view.pressure.area)))[:, order]
    mesh = _paint_shares(axes, 1e6 * edges, 1e6 * record_edges(view.pressure), share)
    axes.set_xlim(1e6 * window[0], 1e6 * window[1])
    is_ring = view.pressure.places.shape == "meridian"
    axes.set_xlabel(f"distance {'across the ring' if is_ring else 'from the axis'} [µm]")
    return mesh


def _share(view: FrictionView, way: int, weights: Any) -> Floats:
    """Friction over its limit of columns of points; nan without pressure."""
    pressed = view.pressure.force @ weights
    rubbed = view.friction.force[:, way].astype(float) @ weights
    limit = view.friction.coefficient * pressed
    share = np.full(pressed.shape, np.nan)
    carried = pressed > _LITTLE * pressed.max()
    share[carried] = rubbed[carried] / np.maximum(limit[carried], 1e-300)
    return share


def _paint_shares(axes: Any, x: Floats, y: Floats, share: Floats) -> Any:
    values = np.ma.masked_invalid(share)
    return axes.pcolorfast(x, y, values, vmin=-1.0, vmax=1.0, cmap=_SHARES, rasterized=True)
