"""``klack export``: models, decks and results for other programs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from klack.analyses.catalogue import load_result
from klack.analyses.ending import is_result
from klack.errors import InputError, refuse_if
from klack.terminal.options import WANTED, Components, Out, Wanted, imported
from klack.terminal.output import Written, require_folder, staged_folder
from klack.terminal.progress import show_progress

if TYPE_CHECKING:
    from klack.analyses.study.record import StudyRecord
    from klack.case.any_case import OwnComponents
    from klack.case.schema import Case
    from klack.case.valve import ValveCase
    from klack.exchange.modal_model import ModalModel

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
_MODELS = {
    "mat": "matlab_model:write_matlab",
    "csv": "text_model:write_text",
    "fmu": "fmu.build:build_fmu",
    "modelica": "modelica:write_modelica",
}
_CURVES = {
    "mat": ("mat:write_mat", ".mat"),
    "csv": ("csv_files:write_csv", ""),
    "netcdf": ("netcdf:write_netcdf", ".nc"),
    "mdf": ("mdf:write_mdf", ".mf4"),
}
_RESULTS = (*_CURVES, "parquet")
_USED_BY: Mapping[str, tuple[str, ...]] = {
    "part": tuple(_MODELS),
    "body": tuple(_MODELS),
    "fmi": ("fmu",),
    "platform": ("fmu",),
    "level": ("vtk",),
    "frames": ("vtk",),
    "impact": ("vtk",),
    "variant": ("vtk",),
    "step": ("calculix",),
    "duration": ("calculix",),
    "penalty": ("calculix",),
    "run": ("calculix",),
    "time_limit": ("calculix",),
    "point": ("case",),
}
_FRAMES = 50


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Choice:
    """What of a source is exported, and how; None for what was not asked for."""

    part: Annotated[
        Literal["body", "pair"] | None,
        Parameter(
            name="--part",
            help="body: each linear body by itself; pair: all bodies with contacts and films. "
            "[default: both]",
        ),
    ] = None
    body: Annotated[str | None, Parameter(name="--body", help="Only this body. [default: all]")] = (
        None
    )
    fmi: Annotated[
        Literal["2", "3"] | None,
        Parameter(name="--fmi", help="Version of the standard. [default: 2]"),
    ] = None
    platform: Annotated[
        list[str] | None,
        Parameter(
            name="--platform",
            consume_multiple=True,
            negative="",
            help="linux64, win64; several binaries fit into one FMU. [default: this computer's]",
        ),
    ] = None
    level: Annotated[
        Literal["reduced", "full"] | None,
        Parameter(name="--level", help="Level whose fields vtk shows. [default: reduced]"),
    ] = None
    frames: Annotated[
        int | None, Parameter(name="--frames", help="Number of frames for vtk. [default: 50]")
    ] = None
    impact: Annotated[
        int | None,
        Parameter(
            name="--impact",
            help="Impact of a stroke in three dimensions that vtk shows, as its report numbers it.",
        ),
    ] = None
    variant: Annotated[
        str | None,
        Parameter(name="--variant", help="Variant of that stroke. [default: the first one]"),
    ] = None
    step: Annotated[
        str | None,
        Parameter(
            name="--step",
            help='Time increment of the calculix deck, "50 ns". [default: full_step of the case]',
        ),
    ] = None
    duration: Annotated[
        str | None,
        Parameter(name="--duration", help='Simulated time, "10 us". [default: as in the case]'),
    ] = None
    penalty: Annotated[
        str | None,
        Parameter(
            name="--penalty",
            help='Contact pressure per overclosure of the calculix deck, "1e9 MPa/mm". '
            "[default: 300 E* / element size]",
        ),
    ] = None
    run: Annotated[
        bool,
        Parameter(name="--run", negative="", help="Run CalculiX as well, which must be installed."),
    ] = False
    time_limit: Annotated[
        str | None, Parameter(name="--time-limit", help='Stop that run after this long, "20 min".')
    ] = None
    point: Annotated[
        int | None, Parameter(name="--point", help="Point of a study, as its report numbers it.")
    ] = None

    def require_used(self, to: str) -> None:
        """Refuse what the format has no use for."""
        for name, users in _USED_BY.items():
            value = getattr(self, name)
            if not (value is None or value is False or to in users):
                option = f"--{name.replace('_', '-')}"
                raise InputError(
                    option,
                    got=f"it with --to {to}",
                    expected=f"it with --to {' or '.join(users)} only",
                    hint=f"leave {option} out.",
                )

    @property
    def platforms(self) -> tuple[str, ...] | None:
        """Both "--platform a,b" and "--platform a --platform b"."""
        if self.platform is None:
            return None
        words = (name for item in self.platform for name in item.split(",") if name)
        return tuple(dict.fromkeys(words))

    @property
    def frame_count(self) -> int:
        """Of fields over time."""
        return _FRAMES if self.frames is None else self.frames

    def deck_numbers(self) -> tuple[float | None, ...]:
        """Step, duration, penalty and limit of time in SI."""
        from klack.units import TIME, Kind, parse_quantity

        units = ("MPa/mm", "N/mm^3", "Pa/m")
        bed = Kind("a pressure per length", "Pa/m", "1e9 MPa/mm", units, largest=1e24)
        return tuple(
            None if text is None else parse_quantity(text, kind, option)
            for text, kind, option in (
                (self.step, TIME, "--step"),
                (self.duration, TIME, "--duration"),
                (self.penalty, bed, "--penalty"),
                (self.time_limit, TIME, "--time-limit"),
            )
        )


_CHOICE = Choice()


def export(
    source: _Source,
    /,
    *,
    to: _Target,
    choice: Choice = _CHOICE,
    component: Components = None,
    out: Out = None,
    wanted: Wanted = WANTED,
) -> int:
    """Write models, results or decks of a case for another program."""
    choice.require_used(to)
    if to == "case":
        _tell(*_export_point(source, choice.point, out), to, wanted)
        return 0
    if is_result(source):
        if to == "vtk" and choice.impact is not None:
            told = _export_stored_impact(source, out, choice, imported(component), wanted)
        else:
            told = _export_stored(source, to, out, wanted)
        _tell(*told, to, wanted)
        return 0
    refuse_if(
        choice.impact is not None or choice.variant is not None,
        str(source),
        got="a case with --impact or --variant",
        expected="the folder of a stored stroke in three dimensions",
        hint="run klack stroke first, and give the folder that it names at the end.",
    )
    if to == "parquet":
        raise _parquet_is_for_studies(f"'{source}', which is not a stored result")

    from klack.case.any_case import load_any_case

    case = load_any_case(source, imported(component))
    folder = out if out is not None else Path("klack-results") / case.name
    require_folder(folder)
    incomplete: Exception | None = None
    if to == "calculix":
        numbers = choice.deck_numbers()
        made = _export_calculix(_impact_only(case, to), folder, numbers, choice.run, wanted)
    elif to in _MODELS:
        made = _export_models(case, to, folder, choice, wanted)
    elif to == "vtk":
        made = _export_fields(_impact_only(case, to), folder, choice, wanted)
    else:
        made, incomplete = _run_and_export(case, to, folder, wanted)
    wanted.warn(case.input_notes)
    _tell(case.name, made, to, wanted)
    if incomplete:
        raise incomplete
    return 0


def _tell(case: str, made: Written, to: str, wanted: Wanted) -> None:
    from klack.analyses.json_results import command_json

    wanted.say("\n".join(made.lines))
    wanted.write(
        lambda: command_json("export", case=case, to=to, folder=str(made.folder), files=made.files)
    )


def _export_stored(source: Path, to: str, out: Path | None, wanted: Wanted) -> tuple[str, Written]:
    refuse_if(
        to not in _RESULTS,
        str(source),
        got=f"a stored result with --to {to}",
        expected=f"--to {', '.join(_RESULTS)} for a result",
        hint="models, decks and fields come from the case: give the case file or its name; "
        "vtk of a stroke in three dimensions takes --impact.",
    )
    from klack.analyses.incomplete import missing_in

    folder = out if out is not None else source
    require_folder(folder)
    study = load_result(source)
    wanted.warn(missing_in(study))
    return study.case, _export_result(study, to, folder)


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


def _export_calculix(
    case: "Case", folder: Path, numbers: tuple[float | None, ...], run: bool, wanted: Wanted
) -> Written:
    from klack.exchange.calculix_case import calculix_impact, calculix_settings
    from klack.exchange.calculix_deck import write_deck
    from klack.exchange.calculix_run import require_calculix, run_calculix

    if run:
        require_calculix()
    step, duration, penalty, time_limit = numbers
    deck = folder / f"{case.name}.inp"
    with show_progress(wanted.quiet) as progress:
        impact = calculix_impact(case, progress)
        settings = calculix_settings(case, impact, step=step, duration=duration, penalty=penalty)
        progress("deck", 0.0)
        with staged_folder(folder) as stage:
            write_deck(impact, settings, stage / deck.name)
            words = (
                f"Deck {deck}: {settings.duration / settings.step:.0f} steps of "
                f"{settings.step * 1e9:.4g} ns, penalty {settings.penalty * 1e-9:.4g} MPa/mm"
            )
            made = Written.of(folder, stage, words)
        then = f"Run it in its folder: ccx -i {deck.stem}"
        if run:
            done = run_calculix(
                deck,
                duration=settings.duration,
                threads=wanted.threads or 1,
                time_limit=time_limit,
                progress=lambda fraction: progress("CalculiX", fraction),
            )
            then = f"CalculiX took {done.wall_time:.0f} s: {done.data}"
    return replace(made, lines=(*made.lines, then))


def _export_models(
    case: "Case | ValveCase", to: str, folder: Path, choice: Choice, wanted: Wanted
) -> Written:
    from klack.exchange.case_models import case_models

    if to == "fmu":
        from klack.exchange.fmu.compiler import require_compilers

        require_compilers(choice.platforms)
    with show_progress(wanted.quiet) as progress:
        alone = choice.part == "body" or choice.body is not None
        every = case_models(case, progress, threads=wanted.threads, alone=alone)
        bodies: tuple[ModalModel, ...] = ()
        if choice.part != "pair" or choice.body is not None:
            bodies = every.body_models(choice.body)
        pair = (every.pair,) if every.pair and not alone else ()
        progress(to, 0.0)
        with staged_folder(folder) as stage:
            _write_models((*bodies, *pair), to, stage, choice)
            made = Written.of(folder, stage)
        progress(to, 1.0)
    lines = [*map(_described, (*bodies, *pair))]
    if pair and every.outside:
        lines.append(f"Not in the models, to be added by you: {', '.join(every.outside)}")
    return replace(made, lines=(*lines, *made.lines))


def _write_models(models: Sequence["ModalModel"], to: str, folder: Path, choice: Choice) -> None:
    write = resolve_name(f"klack.exchange.{_MODELS[to]}")
    if to != "fmu":
        write(models, folder)
        return
    fmi = 3 if choice.fmi == "3" else 2
    for model in models:
        write(model, folder / f"{model.name}.fmu", fmi=fmi, platforms=choice.platforms)


def _described(model: "ModalModel") -> str:
    inputs = ", ".join(item.name for item in model.inputs)
    highest = model.frequencies.max() / 1e3 if model.mode_count else 0.0
    words = f"{model.name}: {model.mode_count} modes up to {highest:.4g} kHz, inputs {inputs}"
    if model.contacts:
        words += f", contacts {', '.join(contact.name for contact in model.contacts)}"
    return f"{words}; step {model.step * 1e9:.4g} ns"


def _export_result(study: Any, to: str, folder: Path) -> Written:
    from klack.analyses.impact.record import ImpactStudy
    from klack.analyses.stroke.record import StrokeStudy
    from klack.analyses.study.record import StudyRecord
    from klack.exchange.results.study_table import result_table

    if isinstance(study, StudyRecord):
        return _export_points(study, to, folder)
    if not isinstance(study, ImpactStudy | StrokeStudy):
        raise InputError(
            "the stored result",
            got=f"a stored {type(study).__name__}",
            expected="the result of klack impact, stroke, study or optimise",
            hint="its numbers are in --json of the command that wrote it.",
        )
    if to == "parquet":
        raise _parquet_is_for_studies("a stored result with curves")
    table = result_table(study)
    with staged_folder(folder) as stage:
        write, ending = _CURVES[to]
        target = stage / f"{study.case}_result{ending}" if ending else stage
        resolve_name(f"klack.exchange.results.{write}")(table, target)
        return Written.of(folder, stage)


def _export_points(study: "StudyRecord", to: str, folder: Path) -> Written:
    from klack.analyses.study.record import study_table

    refuse_if(
        to not in ("csv", "parquet"),
        f"--to {to}",
        got="points of a study",
        expected="--to csv or parquet, or --to case with --point",
        hint='in Python, klack.load_result("FOLDER").to_xarray().',
    )
    table = study_table(study)
    with staged_folder(folder) as stage:
        if to == "parquet":
            table.to_parquet(stage / "points.parquet")
        else:
            table.to_csv(stage / "points.csv")
        return Written.of(folder, stage)


def _parquet_is_for_studies(got: str) -> InputError:
    return InputError(
        "--to parquet",
        got=got,
        expected="the folder of klack study or klack optimise: a row for each point",
        hint="--to csv or netcdf for curves.",
    )


def _export_point(source: Path, point: int | None, out: Path | None) -> tuple[str, Written]:
    from klack.analyses.study.point_case import case_of_point
    from klack.analyses.study.record import StudyRecord

    study = load_result(source) if is_result(source) else None
    if not isinstance(study, StudyRecord):
        raise InputError(
            str(source),
            got="a folder without the result of a study",
            expected="the folder of klack study or klack optimise",
            hint="give the folder that the command names at the end.",
        )
    folder = out if out is not None else source
    require_folder(folder)
    name, text = case_of_point(study, point, folder)
    with staged_folder(folder) as stage:
        (stage / name).write_text(text, encoding="utf-8")
        return study.case, Written.of(folder, stage)


def _run_and_export(
    case: "Case | ValveCase", to: str, folder: Path, wanted: Wanted
) -> tuple[Written, Exception | None]:
    from klack.analyses.impact.run import run_impact
    from klack.analyses.incomplete import IncompleteImpactError
    from klack.analyses.stroke.record import IncompleteStrokeError
    from klack.analyses.stroke.run import run_stroke
    from klack.case.schema import Case

    study: Any
    incomplete: Exception | None = None
    with show_progress(wanted.quiet) as progress:
        try:
            if isinstance(case, Case):
                study = run_impact(
                    case,
                    levels=case.run.levels,
                    certify=False,
                    progress=progress,
                    threads=wanted.threads,
                )
            else:
                study = run_stroke(case, progress=progress, threads=wanted.threads)
        except (IncompleteImpactError, IncompleteStrokeError) as error:
            study, incomplete = error.study, error
    return _export_result(study, to, folder), incomplete


def _export_fields(case: "Case", folder: Path, choice: Choice, wanted: Wanted) -> Written:
    from klack.exchange.results.vtk_series import write_impact_series

    with show_progress(wanted.quiet) as progress, staged_folder(folder) as stage:
        made = write_impact_series(
            case,
            stage,
            level=choice.level or "reduced",
            frames=choice.frame_count,
            progress=progress,
            threads=wanted.threads,
        )
        place = folder / made.relative_to(stage)
        return Written.of(folder, stage, f"Written: {place}; open it in ParaView")


def _export_stored_impact(
    source: Path, out: Path | None, choice: Choice, own: "OwnComponents", wanted: Wanted
) -> tuple[str, Written]:
    from klack.analyses.stroke.record import StrokeStudy
    from klack.case.any_case import read_valve_case
    from klack.exchange.results.spatial_series import write_spatial_series

    refuse_if(
        choice.level is not None,
        "--level",
        got="it with the result of a stroke",
        expected="no level: the motion comes from the recorded modes",
        hint="leave --level out.",
    )
    study = load_result(source)
    if not isinstance(study, StrokeStudy):
        raise InputError(
            str(source),
            got=f"a stored {type(study).__name__} with --impact",
            expected="the folder of klack stroke",
            hint="fields of an impact of two bodies come from its case: leave --impact out.",
        )
    folder = out if out is not None else source
    require_folder(folder)
    case = read_valve_case(study.case_text, Path(f"{study.case}.yaml"), own)
    with show_progress(wanted.quiet) as progress, staged_folder(folder) as stage:
        made = write_spatial_series(
            study,
            case,
            stage,
            impact=choice.impact or 0,
            variant=choice.variant,
            frames=choice.frame_count,
            progress=progress,
            threads=wanted.threads,
        )
        place = folder / made.relative_to(stage)
        return study.case, Written.of(folder, stage, f"Written: {place}; open it in ParaView")
