"""``klack export``: a case as the input of another program."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from klack.cli.options import CaseArgument, Out, Quiet, Threads, require_threads
from klack.cli.output import require_folder, staged_folder
from klack.cli.progress import show_progress

if TYPE_CHECKING:
    from klack.case.schema import Case
    from klack.exchange.calculix_deck import CalculixSettings

__all__ = ["export"]

_Target = Annotated[
    Literal["calculix"], Parameter(name="--to", help="Program that the case is written for.")
]
_Step = Annotated[
    str | None,
    Parameter(name="--step", help='Time increment, "50 ns". [default: full_step of the case]'),
]
_Duration = Annotated[
    str | None,
    Parameter(name="--duration", help='Time to compute, "10 us". [default: as in the case]'),
]
_Penalty = Annotated[
    str | None,
    Parameter(
        name="--penalty",
        help='Contact pressure per overclosure, "1e9 MPa/mm". [default: 300 E* / element size]',
    ),
]
_Run = Annotated[
    bool, Parameter(name="--run", negative="", help="Run the program too (it must be installed).")
]
_TimeLimit = Annotated[
    str | None, Parameter(name="--time-limit", help='Stop that run after this long, "20 min".')
]


def export(
    case: CaseArgument,
    /,
    *,
    to: _Target,
    step: _Step = None,
    duration: _Duration = None,
    penalty: _Penalty = None,
    run: _Run = False,
    time_limit: _TimeLimit = None,
    out: Out = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> int:
    """Write a case for another program: mesh, materials, contact, motion, time steps."""
    from klack.case import find_case, load_case

    require_threads(threads)
    checked = load_case(find_case(case))
    numbers = _Numbers(step, duration, penalty, time_limit)
    folder = out if out is not None else Path("klack-results") / checked.name
    require_folder(folder)
    targets = {"calculix": _to_calculix}
    targets[to](checked, folder, numbers, run=run, threads=threads or 1, quiet=quiet)
    return 0


class _Numbers:
    """The quantities of the command line in SI; None where not given."""

    def __init__(
        self, step: str | None, duration: str | None, penalty: str | None, time_limit: str | None
    ) -> None:
        from klack.units import TIME, Kind, parse_quantity

        def si(text: str | None, kind: Kind, option: str) -> float | None:
            return None if text is None else parse_quantity(text, kind, option)

        bed = Kind("a pressure per length", "Pa/m", "1e9 MPa/mm", ("MPa/mm", "N/mm^3", "Pa/m"))
        self.step = si(step, TIME, "--step")
        self.duration = si(duration, TIME, "--duration")
        self.penalty = si(penalty, bed, "--penalty")
        self.time_limit = si(time_limit, TIME, "--time-limit")


def _to_calculix(
    case: "Case", folder: Path, numbers: _Numbers, *, run: bool, threads: int, quiet: bool
) -> None:
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
        if not run:
            if not quiet:
                print(f"{_described(deck, settings)}\nRun it in its folder: ccx -i {deck.stem}")
            return
        done = run_calculix(
            deck,
            duration=settings.duration,
            threads=threads,
            time_limit=numbers.time_limit,
            progress=lambda fraction: progress("CalculiX", fraction),
        )
    if not quiet:
        print(f"{_described(deck, settings)}\nCalculiX took {done.wall_time:.0f} s: {done.data}")


def _described(deck: Path, settings: "CalculixSettings") -> str:
    return (
        f"Deck {deck}: {settings.duration / settings.step:.0f} steps of "
        f"{settings.step * 1e9:.4g} ns, penalty {settings.penalty * 1e-9:.4g} MPa/mm"
    )
