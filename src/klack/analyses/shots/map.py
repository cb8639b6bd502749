"""Eccentricity and tilt of all shots in one picture, coloured by the restitution."""

from dataclasses import dataclass

import numpy as np
from matplotlib import rc_context
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from klack.analyses.shots.record import ShotsStudy
from klack.analyses.shots.wording import length_unit, shot_name
from klack.report.chart import COLOURS
from klack.report.printed import STYLE, svg

__all__ = ["ShotsMap", "shots_map"]

_MAP = "viridis"


@dataclass(frozen=True, slots=True)
class ShotsMap:
    """Picture (SVG) and its caption."""

    image: bytes
    note: str


def shots_map(study: ShotsStudy) -> ShotsMap:
    """Draw every shot as a dot at its eccentricity and tilt."""
    shots, centred = study.shots, study.centric
    unit, factor = length_unit(shots.eccentricity)
    with rc_context(STYLE):
        figure = Figure(figsize=(6.7, 3.3), layout="constrained")
        axes = figure.subplots()
        x, y = factor * shots.eccentricity, np.degrees(shots.tilt)
        best = study.highest
        values = np.append(shots.restitution, centred.restitution)
        scale = Normalize(float(np.nanmin(values)), float(np.nanmax(values)))
        dots = axes.scatter(
            x, y, c=shots.restitution, s=26.0, cmap=_MAP, norm=scale, linewidths=0.0, zorder=3
        )
        axes.scatter(
            x[best],
            y[best],
            s=90.0,
            facecolors="none",
            edgecolors=COLOURS["red"],
            linewidths=1.6,
            zorder=4,
            label=f"highest rebound, {shot_name(best)}",
        )
        axes.scatter(
            factor * centred.eccentricity,
            np.degrees(centred.tilt),
            c=centred.restitution,
            s=55.0,
            marker="s",
            cmap=_MAP,
            norm=scale,
            edgecolors=COLOURS["black"],
            linewidths=1.4,
            zorder=3,
            label="centred impact",
        )
        figure.legend(loc="outside upper left", ncols=2)
        axes.set_xlabel(f"eccentricity at the height of first touch [{unit}]")
        axes.set_ylabel("tilt [°]")
        axes.margins(x=0.06, y=0.1)
        figure.colorbar(dots, ax=axes, aspect=25).set_label("restitution")
        return ShotsMap(
            svg(figure),
            "Every dot is one shot; its colour is the restitution. The centred impact has neither "
            "eccentricity nor tilt.",
        )
