"""``klack export``: models, decks and results for other programs, through one door."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from klack.analyses.ending import is_result
from klack.errors import InputError
from klack.terminal.options import Components, Out, imported
from klack.terminal.output import Written, require_folder
from klack.terminal.wanted import WANTED, Wanted

if TYPE_CHECKING:
    from klack.analyses.json_results import ExportJson

__all__ = ["export"]

_Source = Annotated[
    Path,
    Parameter(
        name="CASE",
        help="Case file (YAML) or name of a shipped case; or the folder of a stored result.",
    ),
]
_Target = Annotated[
    Literal["mat", "csv", "fmu", "modelica", "calculix", "netcdf", "mdf", "parquet", "vtk", "case"],
    Parameter(
        name="--to",
        help="mat, csv: models of a case, or a result; fmu, modelica: models; netcdf, mdf: results "
        "(a case is run first); csv, parquet: points of a study; case: of one of them; vtk: fields "
        "over time; calculix: a deck of the impact.",
    ),
]
_Part = Annotated[
    Literal["body", "pair"] | None,
    Parameter(
        name="--part",
        help="body: each linear body alone; pair: all bodies with contacts and films. "
        "[default: both]",
    ),
]
_Body = Annotated[str | None, Parameter(name="--body", help="One body alone. [default: all]")]
_Fmi = Annotated[
    Literal["2", "3"] | None, Parameter(name="--fmi", help="Version of the standard. [default: 2]")
]
_Platform = Annotated[
    list[str] | None,
    Parameter(
        name="--platform",
        consume_multiple=True,
        negative="",
        help="linux64, win64; several binaries fit into one FMU. [default: this computer's]",
    ),
]
_Level = Annotated[
    Literal["reduced", "full"] | None,
    Parameter(name="--level", help="Whose fields vtk shows. [default: reduced]"),
]
_Impact = Annotated[
    int | None,
    Parameter(
        name="--impact",
        help="Impact of a stroke in three dimensions that vtk shows, as its report numbers it.",
    ),
]
_Variant = Annotated[
    str | None, Parameter(name="--variant", help="Its variant. [default: the first one]")
]
_Frames = Annotated[
    int | None, Parameter(name="--frames", help="Number of frames for vtk. [default: 50]")
]
_Step = Annotated[
    str | None,
    Parameter(
        name="--step",
        help='Time increment of the calculix deck, "50 ns". [default: full_step of the case]',
    ),
]
_Duration = Annotated[
    str | None,
    Parameter(name="--duration", help='Simulated time, "10 us". [default: as in the case]'),
]
_Penalty = Annotated[
    str | None,
    Parameter(
        name="--penalty",
        help='Its contact pressure per overclosure, "1e9 MPa/mm". [default: 300 E* / element size]',
    ),
]
_Run = Annotated[
    bool, Parameter(name="--run", negative="", help="Run CalculiX too (it must be installed).")
]
_TimeLimit = Annotated[
    str | None, Parameter(name="--time-limit", help='Stop that run after this long, "20 min".')
]

_Point = Annotated[
    int | None, Parameter(name="--point", help="Point of a study, as its report numbers it.")
]

_MODELS = ("mat", "csv", "fmu", "modelica")
_RESULTS = ("mat", "csv", "netcdf", "mdf", "parquet")
_USED_BY: Mapping[str, tuple[str, ...]] = {
    "--part": _MODELS,
    "--body": _MODELS,
    "--fmi": ("fmu",),
    "--platform": ("fmu",),
    "--level": ("vtk",),
    "--frames": ("vtk",),
    "--impact": ("vtk",),
    "--variant": ("vtk",),
    "--step": ("calculix",),
    "--duration": ("calculix",),
    "--penalty": ("calculix",),
    "--run": ("calculix",),
    "--time-limit": ("calculix",),
    "--point": ("case",),
}


def export(
    source: _Source,
    /,
    *,
    to: _Target,
    part: _Part = None,
    body: _Body = None,
    fmi: _Fmi = None,
    platform: _Platform = None,
    level: _Level = None,
    frames: _Frames = None,
    impact: _Impact = None,
    variant: _Variant = None,
    step: _Step = None,
    duration: _Duration = None,
    penalty: _Penalty = None,
    run: _Run = False,
    time_limit: _TimeLimit = None,
    point: _Point = None,
    component: Components = None,
    out: Out = None,
    wanted: Wanted = WANTED,
) -> int:
    """Write models, results or decks of a case for another program."""
    threads, quiet = wanted.threads, wanted.quiet
    _require_used(
        to,
        {
            "--part": part,
            "--body": body,
            "--fmi": fmi,
            "--platform": platform,
            "--level": level,
            "--frames": frames,
            "--impact": impact,
            "--variant": variant,
            "--step": step,
            "--duration": duration,
            "--penalty": penalty,
            "--run": run or None,
            "--time-limit": time_limit,
            "--point": point,
        },
    )
    if to == "case":
        from klack.cli.export_results import export_point

        name, made = export_point(source, point, out)
        _tell(name, to, made, wanted)
        return 0
    if is_result(source):
        if to == "vtk" and impact is not None:
            from klack.cli.export_results import StoredImpact, export_stored_impact

            if level is not None:
                raise _no_level()
            chosen = StoredImpact(impact, variant, 50 if frames is None else frames)
            own = imported(component)
            name, made = export_stored_impact(
                source, out, chosen, own, threads=threads, quiet=quiet
            )
        else:
            name, made = _export_stored(source, to, out, wanted)
        _tell(name, to, made, wanted)
        return 0
    if impact is not None or variant is not None:
        raise InputError(
            str(source),
            got="a case with --impact or --variant",
            expected="the folder of a stored stroke in three dimensions",
            hint="run klack stroke first, and give the folder that it names at the end.",
        )

    if to == "parquet":
        from klack.cli.export_results import parquet_is_for_studies

        raise parquet_is_for_studies(f"'{source}', which is no stored result")

    from klack.case.any_case import load_any_case
    from klack.case.reader import find_case

    case = load_any_case(find_case(source), imported(component))
    folder = out if out is not None else Path("klack-results") / case.name
    require_folder(folder)
    incomplete: Exception | None = None
    if to == "calculix":
        from klack.cli.export_calculix import DeckNumbers, export_calculix

        numbers = DeckNumbers(step, duration, penalty, time_limit)
        made = export_calculix(
            _impact_only(case, to), folder, numbers, run=run, threads=threads or 1, quiet=quiet
        )
    elif to in _MODELS:
        from klack.cli.export_models import ModelChoice, export_models

        choice = ModelChoice(to, part, body, 3 if fmi == "3" else 2, _platforms(platform))
        made = export_models(case, folder, choice, threads=threads, quiet=quiet)
    elif to == "vtk":
        from klack.cli.export_results import export_fields

        made = export_fields(
            _impact_only(case, to),
            folder,
            level=level or "reduced",
            frames=50 if frames is None else frames,
            threads=threads,
            quiet=quiet,
        )
    else:
        from klack.cli.export_results import run_and_export

        made, incomplete = run_and_export(case, to, folder, threads=threads, quiet=quiet)
    wanted.warn(case.input_notes)
    _tell(case.name, to, made, wanted)
    if incomplete:
        raise incomplete
    return 0


def _tell(case: str, to: str, made: Written, wanted: Wanted) -> None:
    wanted.say("\n".join(made.lines))
    result: ExportJson = {
        "schema": "klack-export/1",
        "case": case,
        "to": to,
        "folder": str(made.folder),
        "files": list(made.files),
    }
    wanted.write(lambda: result)


def _require_used(to: str, options: Mapping[str, object]) -> None:
    for name, value in options.items():
        if value is not None and to not in _USED_BY[name]:
            raise InputError(
                name,
                got=f"it with --to {to}",
                expected=f"it with --to {' or '.join(_USED_BY[name])} only",
                hint=f"leave {name} out.",
            )


def _export_stored(source: Path, to: str, out: Path | None, wanted: Wanted) -> tuple[str, Written]:
    if to not in _RESULTS:
        raise InputError(
            str(source),
            got=f"a stored result with --to {to}",
            expected=f"--to {', '.join(_RESULTS)} for a result",
            hint="models, decks and fields come from the case: give the case file or its name; "
            "vtk of a stroke in three dimensions takes --impact.",
        )
    from klack.analyses.catalogue import load_result
    from klack.analyses.incomplete import missing_in
    from klack.cli.export_results import export_result

    folder = out if out is not None else source
    require_folder(folder)
    study = load_result(source)
    wanted.warn(missing_in(study))
    return study.case, export_result(study, to, folder)


def _no_level() -> InputError:
    return InputError(
        "--level",
        got="it with the result of a stroke",
        expected="no level: the motion is that of the recorded modes",
        hint="leave --level out.",
    )


def _impact_only(case: Any, to: str) -> Any:
    from klack.case.schema import Case

    if not isinstance(case, Case):
        raise InputError(
            f"{case.path}: --to {to}",
            got="the case of a whole valve",
            expected="the case of one impact of two bodies",
            hint="describe the impact on one stop as a case of its own; see demo-valve.",
        )
    return case


def _platforms(names: list[str] | None) -> tuple[str, ...] | None:
    """Both "--platform a,b" and "--platform a --platform b"."""
    if names is None:
        return None
    return tuple(dict.fromkeys(name for item in names for name in item.split(",") if name))
