"""Make the picture of metering notches: ``python docs/notch_pictures.py`` writes notches.svg."""

from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from klack.hydraulics.notch import Notch
from klack.hydraulics.spool_edge import SpoolEdge
from klack.report.chart import COLOURS
from klack.report.printed import STYLE, svg

IMAGES = Path(__file__).parent / "images"
SIZES = {
    "rectangular": ("blue", "-", 0.9, 0.4),
    "round": ("orange", "--", 0.9, 0.4),
    "triangular": ("green", "-.", 0.9, 0.4),
    "hole": ("red", ":", 1.2, None),
}


def edge(shape: str | None) -> SpoolEdge:
    """Edge of 8 mm with four notches of one shape, 1 mm wide."""
    notches = []
    if shape is not None:
        _, _, length, depth = SIZES[shape]
        depth_si = None if depth is None else depth * 1e-3
        notches = [
            Notch(shape=shape, count=4, width=1e-3, length=length * 1e-3, depth=depth_si)  # type: ignore[arg-type]
        ]
    return SpoolEdge(
        diameter=8e-3,
        radial_clearance=4e-6,
        overlap=0.0,
        direction="opening",
        notches=tuple(notches),
    )


def figure() -> Figure:
    """Areas over the opening, on a linear and a logarithmic scale."""
    drawn = Figure(figsize=(9.0, 3.6), layout="constrained")
    x = np.linspace(-1.3e-3, 0.3e-3, 1601)
    for axes, log in zip(drawn.subplots(1, 2), (False, True), strict=True):
        for shape, (colour, dash, _, _) in SIZES.items():
            area = np.array([edge(shape).opening(float(v)) for v in x])
            axes.plot(1e3 * x, 1e6 * area, dash, color=COLOURS[colour], lw=1.4, label=shape)
        area = np.array([edge(None).opening(float(v)) for v in x])
        axes.plot(1e3 * x, 1e6 * area, color=COLOURS["black"], lw=1.0, label="without notches")
        axes.axvline(0.0, color=COLOURS["grey"], lw=0.6)
        axes.set_xlabel("opening of the edge [mm], negative: covered")
        axes.set_ylabel("flow area [mm²]")
        axes.grid(visible=True, color="#dddddd", lw=0.5)
        if log:
            axes.set_yscale("log")
            axes.set_ylim(0.05, 12.0)
        else:
            axes.set_ylim(0.0, 6.0)
            axes.legend(loc="upper left")
    return drawn


def main() -> None:
    """Write the picture."""
    with rc_context(STYLE):
        (IMAGES / "notches.svg").write_bytes(svg(figure()))


if __name__ == "__main__":
    main()
