"""Make the picture of the page of free travel: ``python docs/free_travel_pictures.py RESULT``.

From the case ``free-travel`` with three free travels, and from the result of ``klack study
free-travel``, comes free-travel.svg.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import klack
from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import CaseTree
from klack.case.reader import parse, shipped_cases
from klack.report.chart import COLOURS
from klack.report.printed import STYLE, svg

DOCS = Path(__file__).parent
FREE = {5: "black", 40: "blue", 80: "orange"}  # [um]
SHOWN = (
    ("opening_time", "opens [ms]", 1e3),
    ("carry.touch_speed", "armature meets collar [m/s]", 1.0),
    ("seat.peak_force", "peak on the seat [N]", 1.0),
    ("noise.force_level", "force of the housing [dB]", 1.0),
)


def main(result: Path) -> None:
    """Run the case, and draw it with the points of the study."""
    with rc_context(STYLE):
        (DOCS / "images" / "free-travel.svg").write_bytes(svg(figure(result)))


def figure(result: Path) -> Figure:
    """Motions of three valves, and four measures of all."""
    drawn = Figure(figsize=(9.0, 6.4), layout="constrained")
    above, below = drawn.subfigures(2, 1, height_ratios=(1.0, 1.0))
    lifts(above.subplots(1, 2))
    points(below.subplots(1, 4), result)
    return drawn


def lifts(axes: "np.ndarray[tuple[int], np.dtype[np.object_]]") -> None:
    """Displacement of needle and armature."""
    path = shipped_cases()["free-travel"]
    text = path.read_text(encoding="utf-8")
    data, lines = parse(text, path)
    tree = CaseTree(path=path, text=text, data=data, lines=lines)
    components = ("network", "components")
    for free, colour in FREE.items():
        gaps = {"carry": free, "pole": 60 + free, "coil": 60 + free}
        case = tree.case({(*components, name, "gap"): f"{gap} um" for name, gap in gaps.items()})
        run = case.run.model_copy(update={"variants": ("wet",)})
        result = run_stroke(case.model_copy(update={"run": run})).reference.result
        time = 1e3 * result.time
        for port, style in (("needle.tip", "-"), ("armature.top", "--")):
            way = 1e6 * result.channels[f"{port} displacement"].values
            for axis in axes:
                label = f"{port.split('.')[0]}, {free} um" if axis is axes[0] else None
                axis.plot(time, way, style, color=COLOURS[colour], lw=1.0, label=label)
    for axis, span, title in ((axes[0], (0.0, 0.5), "opening"), (axes[1], (1.2, 1.8), "closing")):
        axis.set_xlim(*span)
        axis.set_title(title)
        axis.set_xlabel("time [ms]")
        axis.set_ylabel("displacement [um]")
        _grid(axis)
    axes[0].legend(loc="upper left", fontsize=7, ncols=2)
    axes[0].set_ylim(top=215.0)


def points(axes: "np.ndarray[tuple[int], np.dtype[np.object_]]", result: Path) -> None:
    """Measures over the free travel; the colour is the preload of the coupling spring."""
    table = klack.load_result(result).to_xarray()
    free = 1e6 * table["free"].values
    preload = np.log10(table["network_components_coupling_preload"].values)
    for axis, (name, label, factor) in zip(axes, SHOWN, strict=True):
        dots = axis.scatter(
            free, factor * table[name.replace(".", "_")].values, c=preload, s=7, cmap="viridis"
        )
        axis.set_title(label, fontsize=8)
        axis.set_xlabel("free travel [um]")
        _grid(axis)
    bar = axes[-1].figure.colorbar(dots, ax=list(axes), location="right", pad=0.01)
    bar.set_label("coupling preload [N]")
    bar.set_ticks(np.log10([0.5, 1, 2, 4, 8]), labels=["0.5", "1", "2", "4", "8"])


def _grid(axis: Axes) -> None:
    axis.grid(visible=True, color="#dddddd", lw=0.5)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
