"""Make the picture of lines with local properties: ``python docs/local_line_pictures.py``.

From two checks of ``klack verify --group lines`` comes local-line.svg.
"""

from pathlib import Path

from matplotlib import rc_context
from matplotlib.figure import Figure

from klack.report.chart import COLOURS
from klack.report.printed import STYLE, svg
from klack.verification.local_lines import local_lines

DOCS = Path(__file__).parent
SHOWN = (
    ("steepening wave of 400 bar, mean error", "a wave of 400 bar, 100 cells", "characteristics"),
    ("shock into fluid at rest, pressure", "a shock of 590 bar, 200 cells", "Rankine-Hugoniot"),
)


def main() -> None:
    """Run the checks and draw them."""
    with rc_context(STYLE):
        (DOCS / "images" / "local-line.svg").write_bytes(svg(figure()))


def figure() -> Figure:
    """Pressure over the place: computed in cells, and exact."""
    drawn = Figure(figsize=(9.0, 3.6), layout="constrained")
    checks = local_lines()
    for axes, (name, title, exact) in zip(drawn.subplots(1, 2), SHOWN, strict=True):
        curve = next(check.curve for check in checks if name in check.name)
        assert curve is not None
        axes.plot(*curve.expected, color=COLOURS["black"], lw=1.0, label=exact)
        axes.plot(*curve.computed, ".", color=COLOURS["orange"], ms=4, label="in cells")
        axes.set_title(title)
        axes.set_xlabel(curve.x_label)
        axes.set_ylabel(curve.y_label)
        axes.legend()
    return drawn


if __name__ == "__main__":
    main()
