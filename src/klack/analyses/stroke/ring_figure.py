"""Line load round the ring over time for each impact."""

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from klack.analyses.stroke.film_frames import recorded_impacts
from klack.analyses.stroke.record import StrokeVariant
from klack.report.page import Picture
from klack.report.printed import STYLE, plain, svg
from klack.report.wording import quantity
from klack.simulation.network_result import ImpactEvent
from klack.simulation.spatial_impact import SpatialImpact

__all__ = ["line_load_picture"]

_SHOWN, _COLUMNS = 8, 2
_NOTHING = 1e-9  # of the highest load: round-off


def line_load_picture(variant: StrokeVariant) -> Picture | None:
    """Draw the first impacts, if any were recorded."""
    found = recorded_impacts(variant)
    shown = found[:_SHOWN]
    if not shown:
        return None
    columns = min(_COLUMNS, len(shown))
    rows = -(-len(shown) // columns)
    with rc_context(STYLE | {"axes.grid": False}):
        figure = Figure(figsize=(6.7, 0.25 + 1.95 * rows), layout="constrained")
        grid = figure.subplots(rows, columns, squeeze=False).ravel()
        for axes in grid[len(shown) :]:
            axes.set_axis_off()
        for axes, (number, event, record) in zip(grid, shown, strict=False):
            _draw(figure, axes, number, event, record)
        return Picture(svg(figure), _note(variant, len(shown), shown))


def _draw(figure: Figure, axes, number: int, event: ImpactEvent, record: SpatialImpact) -> None:  # type: ignore[no-untyped-def]
    load = 1e-3 * record.line_load
    masked = np.ma.masked_less_equal(load, _NOTHING * float(load.max()))
    time = 1e6 * (record.edges - record.begin)
    angle = np.linspace(0.0, 360.0, load.shape[1] + 1)
    mesh = axes.pcolorfast(
        time, angle, masked.T, cmap="viridis", vmin=0.0, vmax=float(load.max()), rasterized=True
    )
    title = f"{number}. '{event.stop}' at {quantity(event.time, 's', 4)}"
    axes.set_title(plain(title))
    axes.set_xlabel("time since first touch [µs]")
    axes.set_ylabel("angle round the axis [°]")
    axes.set_yticks(range(0, 361, 90))
    figure.colorbar(mesh, ax=axes, aspect=16).set_label("line load [N/mm]")


def _note(
    variant: StrokeVariant,
    count: int,
    shown: tuple[tuple[int, ImpactEvent, SpatialImpact], ...],
) -> str:
    total = len(variant.result.events)
    parts = [
        "Contact force per length of the ring through the contact points, over time and angle; "
        "0° lies at +x, 90° at +y; white is no contact. Each field has its own scale. The "
        "integral around the ring is the contact force along the axis.",
    ]
    if count < total:
        parts.append(
            f"The first {count} of {total} impacts of '{variant.name}' are shown; "
            f"{total - count} are left out."
        )
    spots = [number for number, _, record in shown if not record.is_ring]
    if spots:
        parts.append(
            f"In impact {', '.join(map(str, spots))} the force does not act on a ring: its load "
            "is given per length of the circle at its mean distance from the axis."
        )
    return " ".join(parts)
