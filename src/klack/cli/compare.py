"""``klack compare``: a stored result beside that of another program."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.cli.options import Json, Quiet
from klack.cli.output import require_folder, require_json_target, staged_folder, write_json
from klack.cli.tables import print_table

if TYPE_CHECKING:
    from klack.workflow.compare import Comparison

__all__ = ["compare"]

_PICTURE = "calculix.svg"


def compare(
    result: Annotated[Path, Parameter(name="RESULT", help="Folder that klack impact wrote.")],
    /,
    *,
    calculix: Annotated[
        Path,
        Parameter(
            name="--calculix",
            help="NAME.dat of a run of CalculiX on the deck of klack export; NAME.sta and NAME.log "
            "beside it tell iterations and time.",
        ),
    ],
    level: Annotated[
        str, Parameter(name="--level", help="Level of the result that is compared.")
    ] = "full",
    out: Annotated[
        Path | None, Parameter(name="--out", help="Folder for the picture. [default: RESULT]")
    ] = None,
    json: Json = None,
    quiet: Quiet = False,
) -> int:
    """Compare a result with that of CalculiX: force history, energy balance, wall time."""
    require_json_target(json)
    folder = out if out is not None else result

    from klack.exchange.calculix_result import other_run, read_calculix
    from klack.report.figures import force_chart
    from klack.report.printed import svg_chart
    from klack.workflow.compare import compare_with, comparison_to_json, level_of, with_other
    from klack.workflow.store import load_study

    study = load_study(result)
    require_folder(folder)
    history = level_of(study, level).history
    comparison = compare_with(study, level, other_run(read_calculix(calculix), history))
    with staged_folder(folder) as stage:
        chart = force_chart(with_other(study, comparison))
        (stage / _PICTURE).write_bytes(svg_chart(chart))
    if not quiet:
        _print(comparison, study.title, folder / _PICTURE, to_stderr=str(json) == "-")
    if json is not None:
        write_json(json, comparison_to_json(comparison))
    return 0


def _print(comparison: "Comparison", title: str, picture: Path, *, to_stderr: bool) -> None:
    from klack.workflow.compare import COMPARISON_COLUMNS, comparison_rows

    print_table(title, COMPARISON_COLUMNS, comparison_rows(comparison), to_stderr=to_stderr)
    stream = sys.stderr if to_stderr else sys.stdout
    d = comparison.deviation
    print(
        f"Force history: {100 * d.history_l2:.2f} % rms of the peak; third octaves within "
        f"{d.third_octave_max_dB:.2g} dB up to {d.third_octave_up_to_Hz / 1e3:.4g} kHz.",
        file=stream,
    )
    if (swing := comparison.other.energy_swing) is not None:
        print(
            f"Energy of {comparison.other.program} within {swing:.1e} of that at the start "
            "at all times.",
            file=stream,
        )
    print(f"Picture: {picture}", file=stream)
