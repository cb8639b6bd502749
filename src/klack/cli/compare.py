"""``klack compare``: a stored result beside that of another program, or beside a measurement."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.cli.notes import print_notes
from klack.cli.options import Components, Json, Quiet, imported
from klack.cli.output import require_folder, require_json_target, staged_folder, write_json
from klack.cli.progress import show_progress
from klack.cli.reports import REPORTS, write_result
from klack.cli.tables import print_table
from klack.errors import InputError

if TYPE_CHECKING:
    from klack.case.measurement import CaseMeasurement
    from klack.case.valve_reader import OwnComponents
    from klack.workflow.compare import Comparison
    from klack.workflow.measured_shots_study import MeasuredShotsStudy
    from klack.workflow.measured_study import MeasuredStrokeStudy

__all__ = ["compare"]

_PICTURE = "calculix.svg"
_MEASURED = "measured"

_Case = Annotated[
    Path | None,
    Parameter(
        name="--case",
        help="Case file (or shipped case) whose section 'measurement' is used. [default: that of "
        "the result]",
    ),
]


def compare(
    result: Annotated[
        Path, Parameter(name="RESULT", help="Folder that klack impact, stroke or shots wrote.")
    ],
    /,
    *,
    measurement: Annotated[
        list[str] | None,
        Parameter(
            name="--measurement",
            consume_multiple=True,
            negative="",
            help="Recording of the valve, for results of klack stroke and shots; several files "
            "make one set. VARIANT=FILE for another variant than the first: dry=FILE.",
        ),
    ] = None,
    variant: Annotated[list[str] | None, Parameter(name="--variant", show=False)] = None,
    case: _Case = None,
    calculix: Annotated[
        Path | None,
        Parameter(
            name="--calculix",
            help="NAME.dat of a run of CalculiX on the deck of klack export, for results of klack "
            "impact; NAME.sta and NAME.log beside it tell iterations and time.",
        ),
    ] = None,
    level: Annotated[
        str, Parameter(name="--level", help="Level of an impact that is compared.")
    ] = "full",
    report: Annotated[
        bool, Parameter(help="Write report.html and report.pdf beside a measurement.")
    ] = True,
    out: Annotated[
        Path | None,
        Parameter(
            name="--out",
            help="Folder for what is written. [default: RESULT, or RESULT/measured for a "
            "measurement]",
        ),
    ] = None,
    component: Components = None,
    json: Json = None,
    quiet: Quiet = False,
) -> int:
    """Compare a result with a measurement, or with CalculiX: curves, numbers, residuals."""
    require_json_target(json)
    if variant is not None:
        raise InputError(
            "--variant",
            got=", ".join(variant),
            expected="the variant in front of its recording",
            hint=f"--measurement {variant[0] if variant else 'dry'}=FILE.",
        )
    if (calculix is None) == (not measurement):
        raise InputError(
            "--measurement and --calculix",
            got="neither of them" if calculix is None else "both of them",
            expected="one: a measurement, or a run of CalculiX",
            hint="klack compare RESULT --measurement strokes.csv.",
        )
    if calculix is not None:
        folder = out if out is not None else result
        _with_calculix(result, calculix, level, folder, json, quiet)
        return 0
    folder = out if out is not None else result / _MEASURED
    own = imported(component)
    _with_measurement(result, measurement or [], case, own, folder, report, json, quiet)
    return 0


# --------------------------------------------------------------------------- measurement


def _with_measurement(
    result: Path,
    given: Sequence[str],
    case: Path | None,
    own: "OwnComponents",
    folder: Path,
    report: bool,
    json: Path | None,
    quiet: bool,
) -> None:
    from klack.workflow.record_store import stored_format
    from klack.workflow.shots_store import SHOTS_FORMAT
    from klack.workflow.stroke_store import STROKE_FORMAT

    kind = stored_format(result)
    if kind not in (STROKE_FORMAT.name, SHOTS_FORMAT.name):
        raise InputError(
            f"result {result}",
            got=f"a result of another kind ({kind})",
            expected="one of klack stroke or klack shots",
            hint="run `klack stroke CASE` for strokes, `klack shots CASE` for drops.",
        )
    require_folder(folder)
    if kind == STROKE_FORMAT.name:
        _strokes(result, given, case, own, folder, report, json, quiet)
    else:
        _drops(result, given, case, own, folder, report, json, quiet)


def _strokes(
    result: Path,
    given: Sequence[str],
    case: Path | None,
    own: "OwnComponents",
    folder: Path,
    report: bool,
    json: Path | None,
    quiet: bool,
) -> None:
    from klack.workflow.measured_store import save_measured_strokes
    from klack.workflow.measured_strokes import compare_strokes
    from klack.workflow.measured_summary import measured_to_json
    from klack.workflow.stroke_store import load_stroke

    study = load_stroke(result)
    files = _files(given, study.reference.name)
    section, text = _section(study.case_text, result, case, own)
    with show_progress(quiet) as progress:
        compared = compare_strokes(study, files, section, case_text=text, progress=progress)
        failure = write_result(
            compared, folder, save_measured_strokes, report=report, progress=progress
        )
    if not quiet:
        _print_strokes(compared, to_stderr=str(json) == "-")
        _print_folder(folder, report and failure is None, to_stderr=str(json) == "-")
    else:
        notes = [note for variant in compared.variants.values() for note in variant.notes]
        print_notes((*notes, *compared.warnings), to_stderr=True)
    if json is not None:
        write_json(json, measured_to_json(compared))
    if failure:
        raise failure


def _drops(
    result: Path,
    given: Sequence[str],
    case: Path | None,
    own: "OwnComponents",
    folder: Path,
    report: bool,
    json: Path | None,
    quiet: bool,
) -> None:
    from klack.workflow.measured_shots import compare_shots
    from klack.workflow.measured_shots_summary import measured_shots_to_json
    from klack.workflow.measured_store import save_measured_shots
    from klack.workflow.shots_store import load_shots

    study = load_shots(result)
    paths = [path for paths in _files(given, "dry").values() for path in paths]
    section, text = _section(study.case_text, result, case, own)
    with show_progress(quiet) as progress:
        compared = compare_shots(study, paths, section, case_text=text, progress=progress)
        failure = write_result(
            compared, folder, save_measured_shots, report=report, progress=progress
        )
    if not quiet:
        _print_drops(compared, to_stderr=str(json) == "-")
        _print_folder(folder, report and failure is None, to_stderr=str(json) == "-")
    else:
        print_notes((*compared.notes, *compared.warnings), to_stderr=True)
    if json is not None:
        write_json(json, measured_shots_to_json(compared))
    if failure:
        raise failure


def _files(given: Sequence[str], usual: str) -> Mapping[str, list[Path]]:
    """Files by variant; all of them must be there."""
    from klack.case.valve import VARIANTS

    files: dict[str, list[Path]] = {}
    for text in given:
        variant, sign, name = text.partition("=")
        if not sign or variant not in VARIANTS:
            variant, name = usual, text
        path = Path(name)
        if not path.is_file():
            raise InputError(
                f"--measurement {text}",
                got="a folder" if path.is_dir() else "no such file",
                expected="a recording, as FILE or VARIANT=FILE",
                hint=f"variants are {', '.join(VARIANTS)}; check spelling and folder.",
            )
        files.setdefault(variant, []).append(path)
    return files


def _section(
    text: str, result: Path, case: Path | None, own: "OwnComponents"
) -> "tuple[CaseMeasurement | None, str | None]":
    """Section ``measurement`` of the result, or of another case with its text."""
    from klack.case.shipped import find_case
    from klack.case.valve_reader import load_any_case, read_any_case

    if case is None:
        return read_any_case(text, result / "case.yaml", own).measurement, None
    other = load_any_case(find_case(case), own)
    return other.measurement, other.source


def _print_strokes(study: "MeasuredStrokeStudy", *, to_stderr: bool) -> None:
    from klack.workflow.measured_summary import (
        CURVE_COLUMNS,
        HIGHEST_COLUMNS,
        IMPACT_COLUMNS,
        curve_rows,
        highest_rows,
        impact_rows,
        rule,
        verdict,
    )

    stream = sys.stderr if to_stderr else sys.stdout
    for variant in study.variants.values():
        aside = f", {len(variant.rejected)} put aside" if variant.rejected else ""
        title = f"{study.title}, {variant.variant}: {variant.count} strokes{aside}"
        print_table(title, CURVE_COLUMNS, curve_rows(variant), to_stderr=to_stderr)
        rows = impact_rows(variant)
        print_table("Impacts", IMPACT_COLUMNS, rows, left=2, to_stderr=to_stderr)
        if variant.highest:
            highest = highest_rows(variant)
            print_table("Measured", HIGHEST_COLUMNS, highest, left=2, to_stderr=to_stderr)
        for item in variant.rejected:
            print(f"Put aside: {item.name}: {item.reason}", file=stream)
        print_notes(variant.notes, to_stderr=to_stderr)
    for variant in study.variants.values():
        print(verdict(study, variant), file=stream)
    print(rule(study), file=stream)
    print_notes(study.warnings, to_stderr=to_stderr)


def _print_drops(study: "MeasuredShotsStudy", *, to_stderr: bool) -> None:
    from klack.workflow.measured_shots_summary import (
        DROP_COLUMNS,
        bias_sentence,
        drop_rows,
        drop_rule,
        drop_verdict,
    )

    stream = sys.stderr if to_stderr else sys.stdout
    title = f"{study.title}: beside {len(study.names)} measured drops"
    print_table(title, DROP_COLUMNS, drop_rows(study), left=2, to_stderr=to_stderr)
    for item in study.rejected:
        print(f"Put aside: {item.name}: {item.reason}", file=stream)
    for line in (drop_verdict(study), bias_sentence(study), drop_rule(study)):
        print(line, file=stream)
    print_notes((*study.notes, *study.warnings), to_stderr=to_stderr)


def _print_folder(folder: Path, report: bool, *, to_stderr: bool) -> None:
    made = ["result.zarr", *(REPORTS if report else ())]
    print(f"Results in {folder}: {', '.join(made)}", file=sys.stderr if to_stderr else sys.stdout)


# --------------------------------------------------------------------------- CalculiX


def _with_calculix(
    result: Path, calculix: Path, level: str, folder: Path, json: Path | None, quiet: bool
) -> None:
    from klack.exchange.calculix_result import other_run, read_calculix
    from klack.report.figures import force_chart
    from klack.report.printed import svg_chart
    from klack.workflow.compare import compare_with, comparison_to_json, level_of, with_other
    from klack.workflow.incomplete import missing_in
    from klack.workflow.store import load_study

    study = load_study(result)
    require_folder(folder)
    print_notes(missing_in(study), to_stderr=True)
    history = level_of(study, level).history
    comparison = compare_with(study, level, other_run(read_calculix(calculix), history))
    with staged_folder(folder) as stage:
        chart = force_chart(with_other(study, comparison))
        (stage / _PICTURE).write_bytes(svg_chart(chart))
    if not quiet:
        _print(comparison, study.title, folder / _PICTURE, to_stderr=str(json) == "-")
    if json is not None:
        write_json(json, comparison_to_json(comparison))


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
