"""A chart with its main numbers in words, for those who hear the page instead of seeing it."""

from typing import Any

from nicegui import ui

from klack.app.pages.frame import heading, plain
from klack.report.spoken import spoken

__all__ = ["DescribedChart"]


class DescribedChart:
    """Heading, chart, and a text that only screen readers have; it is an image to them.

    Parameters
    ----------
    title : str
    figure : dict
        What Plotly draws.
    """

    def __init__(self, title: str, figure: dict[str, Any]) -> None:
        with ui.element("section").classes("k-sheet k-chart"):
            name = heading(title)
            self._words = plain(_told(figure), "p").classes("k-sr")
            self.plot = ui.plotly(figure).classes("k-plot")
            self.plot.props["role"] = "img"
            self.plot.props["aria-labelledby"] = f"{name.html_id} {self._words.html_id}"

    def update_figure(self, figure: dict[str, Any]) -> None:
        """Draw another one, and tell it."""
        self.plot.update_figure(figure)
        self._words.set_text(_told(figure))


def _told(figure: dict[str, Any]) -> str:
    return spoken(figure) if figure["data"] else "Nothing is drawn yet."
