"""``klack export --to calculix``: the same impact for an independent solver."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from klack.terminal.output import Written, staged_folder
from klack.terminal.progress import show_progress

if TYPE_CHECKING:
    from klack.case.schema import Case
    from klack.exchange.calculix_deck import CalculixSettings

__all__ = ["DeckNumbers", "export_calculix"]


class DeckNumbers:
    """The quantities of the command line in SI; None where not given."""

    def __init__(
        self, step: str | None, duration: str | None, penalty: str | None, time_limit: str | None
    ) -> None:
        from klack.units import TIME, Kind, parse_quantity

        def si(text: str | None, kind: Kind, option: str) -> float | None:
            return None if text is None else parse_quantity(text, kind, option)

        units = ("MPa/mm", "N/mm^3", "Pa/m")
        bed = Kind("a pressure per length", "Pa/m", "1e9 MPa/mm", units, largest=1e24)
        self.step = si(step, TIME, "--step")
        self.duration = si(duration, TIME, "--duration")
        self.penalty = si(penalty, bed, "--penalty")
        self.time_limit = si(time_limit, TIME, "--time-limit")


def export_calculix(
    case: "Case", folder: Path, numbers: DeckNumbers, *, run: bool, threads: int, quiet: bool
) -> Written:
    """Write the deck of an impact; with ``run``, let the installed program compute it."""
    from klack.exchange.calculix_case import calculix_impact, calculix_settings
    from klack.exchange.calculix_deck import write_deck
    from klack.exchange.calculix_run import require_calculix, run_calculix

    if run:
        require_calculix()
    deck = folder / f"{case.name}.inp"
    with show_progress(quiet) as progress:
        impact = calculix_impact(case, progress)
        settings = calculix_settings(
            case, impact, step=numbers.step, duration=numbers.duration, penalty=numbers.penalty
        )
        progress("deck", 0.0)
        with staged_folder(folder) as stage:
            write_deck(impact, settings, stage / deck.name)
            made = Written.of(folder, stage, _described(deck, settings))
        if not run:
            then = f"Run it in its folder: ccx -i {deck.stem}"
            return replace(made, lines=(*made.lines, then))
        done = run_calculix(
            deck,
            duration=settings.duration,
            threads=threads,
            time_limit=numbers.time_limit,
            progress=lambda fraction: progress("CalculiX", fraction),
        )
    then = f"CalculiX took {done.wall_time:.0f} s: {done.data}"
    return replace(made, lines=(*made.lines, then))


def _described(deck: Path, settings: "CalculixSettings") -> str:
    return (
        f"Deck {deck}: {settings.duration / settings.step:.0f} steps of "
        f"{settings.step * 1e9:.4g} ns, penalty {settings.penalty * 1e-9:.4g} MPa/mm"
    )
