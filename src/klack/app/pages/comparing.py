"""Two results of one kind, one over the other."""

import asyncio
from collections.abc import Mapping
from dataclasses import replace

from nicegui import ui

from klack.app.answers import Answer
from klack.app.pages.charts import bands_figure, curves_figure
from klack.app.pages.described_chart import DescribedChart
from klack.app.pages.frame import dead_end, differing, frame, heading, number_text, plain
from klack.app.state import State
from klack.errors import KlackError

__all__ = ["comparing_page"]


async def comparing_page(state: State, given: Mapping[str, str]) -> None:
    """The page of two results, ``a`` the one that ``b`` is compared with."""
    first, second = given.get("a", ""), given.get("b", "")
    with frame(state, "Two results", f"{second} (line) against {first} (dashed)"):
        waiting = plain("Reading ...", "p").props("role=status")
        body = ui.element("div")

        async def fill() -> None:
            try:
                places = [
                    str(await asyncio.to_thread(state.folder.absolute, name))
                    for name in (first, second)
                ]
                ghost, now = await state.reader.call("compare", *places)
            except KlackError as error:
                waiting.delete()
                with body:
                    dead_end(error)
                return
            waiting.delete()
            with body:
                _show(state, now, ghost, (second, first))

        ui.timer(0.05, fill, once=True)


def _show(state: State, now: Answer, ghost: Answer, names: tuple[str, str]) -> None:
    scrolled = ui.element("section").classes("k-section k-sheet k-scroll").props("tabindex=0")
    scrolled.props["aria-label"] = "main numbers of both results"
    with scrolled:
        _show_numbers(now, ghost, names)
    unit = now.time_unit
    with ui.element("div").classes("k-grid"):
        for title, figure in (
            (
                "Contact force",
                curves_figure(now.force, ghost.force, f"time [{unit}]", "force [N]", names),
            ),
            ("Motion", curves_figure(now.lift, ghost.lift, f"time [{unit}]", "lift [um]", names)),
            ("Third octaves of the force", bands_figure(now, ghost, names)),
        ):
            DescribedChart(title, figure)
        with ui.element("section").classes("k-sheet k-chart"):
            heading("Hear it")
            for name, wav in ((names[1], ghost.wav), (names[0], now.wav)):
                if wav:
                    with ui.element("figure").style("margin:8px 0"):
                        plain(name, "figcaption").classes("k-soft")
                        player = ui.element("audio").props("controls preload=none")
                        player.props["src"] = state.sounds.add(wav)
                        player.props["aria-label"] = f"click of {name}"
                        player.style("width:100%")
            plain(
                f"Both to one scale: {now.scale}." if now.scale else "Nothing radiates.", "p"
            ).classes("k-note")
    for name, answer in ((names[1], ghost), (names[0], now)):
        if answer.doubts:
            plain(f"{name}: " + "\n".join(answer.doubts), "p").classes("k-note")


def _show_numbers(now: Answer, ghost: Answer, names: tuple[str, str]) -> None:
    ours = {number.key: number for number in now.numbers}
    then = {number.key: number for number in ghost.numbers}
    with ui.element("table").classes("k-table"):
        with ui.element("thead"), ui.element("tr"):
            for word in ("", names[1], names[0], "difference"):
                plain(word, "th").props("scope=col")
        with ui.element("tbody"):
            for known in (ours | then).values():
                number, other = (
                    side.get(known.key, replace(known, value=None)) for side in (ours, then)
                )
                with ui.element("tr"):
                    unit = f" [{known.unit}]" if known.unit else ""
                    plain(f"{known.name}{unit}", "td")
                    plain(number_text(other), "td")
                    plain(number_text(number), "td")
                    plain(differing(number, other), "td")
            with ui.element("tr"):
                plain("level or variant", "td")
                plain(ghost.run, "td")
                plain(now.run, "td")
                plain("the same" if now.run == ghost.run else "not the same", "td")
