"""Command ``klack magnet``."""

from pathlib import Path

from klack.analyses.ending import Ending
from klack.terminal.options import WANTED_RESULT, CaseArgument, WantedResult
from klack.terminal.progress import show_progress

__all__ = ["magnet"]


def magnet(case: CaseArgument, /, *, wanted: WantedResult = WANTED_RESULT) -> int:
    """Compute the map of force and flux linkage of a drawn magnet, and its error."""
    with show_progress(wanted.quiet):
        from klack.analyses.magnet.case import load_magnet_case

        checked = load_magnet_case(case)
    ending = Ending.of(wanted, checked.name, case=case)

    with show_progress(wanted.quiet) as progress:
        from klack.analyses.magnet.analysis import MAGNET, MAP_NAME, magnet_charts, run_magnet

        record = run_magnet(checked, progress=progress)

    def beside(folder: Path) -> tuple[str, ...]:
        from klack.report.printed import write_charts

        record.map.write(folder / MAP_NAME)
        return (MAP_NAME, *write_charts(magnet_charts(record), folder))

    return ending.end(MAGNET, record, beside=beside)
