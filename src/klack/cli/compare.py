"""``klack compare``: a stored result against that of another program, or against a measurement."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.analyses.ending import Ending
from klack.errors import InputError, refuse_if
from klack.terminal.options import SHOWN, Components, Shown, imported
from klack.terminal.output import require_folder, staged_folder
from klack.terminal.progress import show_progress

if TYPE_CHECKING:
    from klack.analyses.impact.record import ImpactStudy
    from klack.case.any_case import OwnComponents
    from klack.case.measurement import CaseMeasurement
    from klack.signals.low_pass import LowPass

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
        Path, Parameter(name="RESULT", help="Folder written by klack impact, stroke or shots.")
    ],
    /,
    *,
    measurement: Annotated[
        list[str] | None,
        Parameter(
            name="--measurement",
            consume_multiple=True,
            negative="",
            help="Recording of the valve, or of a sensor on a body, for results of klack "
            "impact, stroke and shots; several files make one set. VARIANT=FILE for a variant "
            "other than the first: dry=FILE.",
        ),
    ] = None,
    variant: Annotated[list[str] | None, Parameter(name="--variant", show=False)] = None,
    case: _Case = None,
    calculix: Annotated[
        Path | None,
        Parameter(
            name="--calculix",
            help="NAME.dat of a run of CalculiX on the deck of klack export, for results of klack "
            "impact; NAME.sta and NAME.log next to it give iterations and time.",
        ),
    ] = None,
    level: Annotated[
        str, Parameter(name="--level", help="Level of an impact that is compared.")
    ] = "full",
    report: Annotated[
        bool, Parameter(help="Write report.html and report.pdf for a measurement.")
    ] = True,
    out: Annotated[
        Path | None,
        Parameter(
            name="--out",
            help="Folder for the output. [default: RESULT, or RESULT/measured for a measurement]",
        ),
    ] = None,
    output: Annotated[
        str | None,
        Parameter(
            name="--output",
            help="Output of an impact that is compared. [default: the only one of the case]",
        ),
    ] = None,
    channel: Annotated[
        str | None,
        Parameter(
            name="--channel",
            help="Channel of the recordings of an impact. [default: the only one of the file]",
        ),
    ] = None,
    known_speed: Annotated[
        bool,
        Parameter(
            name="--known-speed",
            negative="",
            help="For impacts: the speed is known and the recordings are absolute, so no factor is "
            "fitted.",
        ),
    ] = False,
    component: Components = None,
    wanted: Shown = SHOWN,
) -> int:
    """Compare a result with a measurement, or with CalculiX: curves, numbers, residuals."""
    if variant is not None:
        raise InputError(
            "--variant",
            got=", ".join(variant),
            expected="the variant before its recording",
            hint=f"--measurement {variant[0] if variant else 'dry'}=FILE.",
        )
    refuse_if(
        (calculix is None) == (not measurement),
        "--measurement and --calculix",
        got="neither of them" if calculix is None else "both of them",
        expected="one: a measurement, or a run of CalculiX",
        hint="klack compare RESULT --measurement strokes.csv.",
    )
    if calculix is not None:
        folder = out if out is not None else result
        _with_calculix(result, calculix, level, folder, wanted)
        return 0
    folder = out if out is not None else result / _MEASURED
    own = imported(component)
    ending = Ending(json=wanted.json, quiet=wanted.quiet, folder=folder, report=report)
    sensor = _Sensor(level=level, output=output, channel=channel, known_speed=known_speed)
    return _with_measurement(result, measurement or [], case, own, sensor, ending)


# --------------------------------------------------------------------------- measurement


def _with_measurement(
    result: Path,
    given: Sequence[str],
    case: Path | None,
    own: "OwnComponents",
    sensor: "_Sensor",
    ending: Ending,
) -> int:
    from klack.analyses.catalogue import analysis_in, load_result
    from klack.analyses.comparison.shots import compare_shots
    from klack.analyses.comparison.shots_summary import MEASURED_SHOTS
    from klack.analyses.comparison.strokes import compare_strokes
    from klack.analyses.comparison.strokes_summary import MEASURED_STROKES
    from klack.analyses.impact.record import ImpactStudy
    from klack.analyses.shots.record import ShotsStudy
    from klack.analyses.stroke.record import StrokeStudy

    study = load_result(result)
    if isinstance(study, ImpactStudy):
        return _with_pulses(study, given, case, sensor, ending)
    if not isinstance(study, StrokeStudy | ShotsStudy):
        raise InputError(
            f"result {result}",
            got=f"a result of another kind ({analysis_in(result).form.name})",
            expected="one of klack impact, klack stroke or klack shots",
            hint="run `klack impact CASE` for a sensor on a body, `klack stroke CASE` for strokes, "
            "`klack shots CASE` for drops.",
        )
    section, text = _section(study.case_text, result, case, own)
    if isinstance(study, StrokeStudy):
        files = _files(given, study.reference.name)
        with show_progress(ending.quiet) as progress:
            strokes = compare_strokes(study, files, section, case_text=text, progress=progress)
        return ending.end(MEASURED_STROKES, strokes)
    paths = [path for paths in _files(given, "dry").values() for path in paths]
    with show_progress(ending.quiet) as progress:
        drops = compare_shots(study, paths, section, case_text=text, progress=progress)
    return ending.end(MEASURED_SHOTS, drops)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Sensor:
    """Which output of an impact is compared with which channel."""

    level: str
    output: str | None
    channel: str | None
    known_speed: bool


def _with_pulses(
    study: "ImpactStudy", given: Sequence[str], case: Path | None, sensor: _Sensor, ending: Ending
) -> int:
    from klack.analyses.comparison.impacts import compare_impact
    from klack.analyses.comparison.impacts_summary import MEASURED_IMPACT

    paths = [Path(text) for text in given]
    for path in paths:
        _require_file(str(path), path, "a recording of the sensor")
    with show_progress(ending.quiet) as progress:
        found = compare_impact(
            study,
            paths,
            level=sensor.level,
            output=sensor.output,
            channel=sensor.channel,
            low_pass=None if case is None else _low_pass_in(case, study, sensor),
            known_speed=sensor.known_speed,
            progress=progress,
        )
    return ending.end(MEASURED_IMPACT, found)


def _low_pass_in(case: Path, study: "ImpactStudy", sensor: _Sensor) -> "LowPass | None":
    from klack.analyses.comparison.impacts import gauge_of
    from klack.case.reader import load_case

    name = gauge_of(study, sensor.level, sensor.output).name
    outputs = {item.name: item for item in load_case(case).outputs}
    refuse_if(
        name not in outputs,
        f"--case {case}",
        got=f"no output '{name}'",
        expected=f"an output of the same name, one of: {', '.join(outputs) or 'none'}",
        hint="its low pass is used; without --case the one of the result.",
    )
    low_pass = outputs[name].low_pass
    return None if low_pass is None else low_pass.filter


def _require_file(text: str, path: Path, expected: str) -> None:
    refuse_if(
        not path.is_file(),
        f"--measurement {text}",
        got="a folder" if path.is_dir() else "no such file",
        expected=expected,
        hint="check spelling and folder.",
    )


def _files(given: Sequence[str], usual: str) -> Mapping[str, list[Path]]:
    """Files by variant; all must exist."""
    from klack.case.levels import VARIANTS

    files: dict[str, list[Path]] = {}
    for text in given:
        variant, sign, name = text.partition("=")
        if not sign or variant not in VARIANTS:
            variant, name = usual, text
        path = Path(name)
        refuse_if(
            not path.is_file(),
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
    from klack.case.any_case import load_any_case, read_any_case

    if case is None:
        return read_any_case(text, result / "case.yaml", own).measurement, None
    other = load_any_case(case, own)
    return other.measurement, other.source


# --------------------------------------------------------------------------- CalculiX


def _with_calculix(result: Path, calculix: Path, level: str, folder: Path, wanted: Shown) -> None:
    from klack.analyses.comparison.calculix import CALCULIX, compare_with, level_of, with_other
    from klack.analyses.impact.analysis import IMPACT
    from klack.analyses.impact.figures import force_chart
    from klack.analyses.incomplete import missing_in
    from klack.exchange.calculix_result import other_run, read_calculix
    from klack.report.printed import svg_chart

    study = IMPACT.load(result)
    require_folder(folder)
    wanted.warn(missing_in(study))
    history = level_of(study, level).history
    comparison = compare_with(study, level, other_run(read_calculix(calculix), history))
    with staged_folder(folder) as stage:
        chart = force_chart(with_other(study, comparison))
        (stage / _PICTURE).write_bytes(svg_chart(chart))
    wanted.show(CALCULIX.told(comparison))
    wanted.say(f"Picture: {folder / _PICTURE}")
    wanted.write(lambda: CALCULIX.to_json(comparison))
