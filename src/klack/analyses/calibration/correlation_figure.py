"""Correlation matrices as pictures: which parameters the data tell apart."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import NDArray

from klack.report.printed import STYLE, plain, svg

__all__ = ["CorrelationFigure", "correlation_figure"]

_WIDTH = 6.7  # [in], text of an A4 page


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrelationFigure:
    """Image and caption."""

    image: bytes
    note: str


def correlation_figure(
    names: Sequence[str],
    matrices: Sequence[tuple[str, NDArray[np.float64]]],
    note: str,
) -> CorrelationFigure:
    """Draw correlation matrices side by side; every field carries its number.

    Parameters
    ----------
    names : sequence of str
        Of the parameters.
    matrices : sequence of (title, array of shape (p, p))
    note : str
    """
    count = len(names)
    height = 0.9 + min(0.42 * count, 2.8)
    with rc_context(STYLE | {"axes.grid": False}):
        figure = Figure(figsize=(_WIDTH, height), layout="constrained")
        grid = figure.subplots(1, len(matrices), squeeze=False)[0]
        for k, (axes, (title, matrix)) in enumerate(zip(grid, matrices, strict=True)):
            _draw(axes, names if k == 0 else [""] * count, names, title, matrix)
        return CorrelationFigure(image=svg(figure), note=note)


def _draw(
    axes: Any,
    rows: Sequence[str],
    columns: Sequence[str],
    title: str,
    matrix: NDArray[np.float64],
) -> None:
    axes.imshow(matrix, cmap="RdBu_r", vmin=-1.0, vmax=1.0, aspect="auto")
    axes.set_title(plain(title), fontsize=8)
    axes.set_yticks(range(len(rows)), [plain(name) for name in rows])
    axes.set_xticks(range(len(columns)), [plain(name) for name in columns], rotation=35, ha="right")
    axes.tick_params(length=0)
    for i in range(len(columns)):
        for j in range(len(columns)):
            value = matrix[i, j]
            axes.text(
                j,
                i,
                f"{value:+.2f}".replace("-", "\N{MINUS SIGN}") if i != j else "1",
                ha="center",
                va="center",
                fontsize=7,
                color="white" if abs(value) > 0.6 else "black",
                fontweight="bold" if i != j and abs(value) > 0.95 else "normal",
            )
