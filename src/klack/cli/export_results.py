"""``klack export --to netcdf|mdf|mat|csv|parquet|vtk``: results for other programs."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from klack.errors import InputError
from klack.terminal.output import Written, staged_folder
from klack.terminal.progress import show_progress

if TYPE_CHECKING:
    from klack.analyses.study.record import StudyRecord
    from klack.case.any_case import OwnComponents
    from klack.case.schema import Case
    from klack.case.valve import ValveCase

__all__ = [
    "StoredImpact",
    "export_fields",
    "export_point",
    "export_result",
    "export_stored_impact",
    "parquet_is_for_studies",
    "run_and_export",
]


def export_result(study: Any, to: str, folder: Path) -> Written:
    """Write the histories of a stored result, or the points of a study."""
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
        raise parquet_is_for_studies("a stored result with curves")
    table = result_table(study)
    name = f"{study.case}_result"
    with staged_folder(folder) as stage:
        if to == "netcdf":
            from klack.exchange.results.netcdf import write_netcdf

            write_netcdf(table, stage / f"{name}.nc")
        elif to == "mdf":
            from klack.exchange.results.mdf import write_mdf

            write_mdf(table, stage / f"{name}.mf4")
        elif to == "mat":
            from klack.exchange.results.mat import write_mat

            write_mat(table, stage / f"{name}.mat")
        else:
            from klack.exchange.results.csv_files import write_csv

            write_csv(table, stage)
        return Written.of(folder, stage)


def _export_points(study: "StudyRecord", to: str, folder: Path) -> Written:
    from klack.analyses.study.record import study_table

    if to not in ("csv", "parquet"):
        raise InputError(
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


def parquet_is_for_studies(got: str) -> InputError:
    """The error where Parquet cannot be written."""
    return InputError(
        "--to parquet",
        got=got,
        expected="the folder of klack study or klack optimise: a row for each point",
        hint="--to csv or netcdf for curves.",
    )


def export_point(source: Path, point: int | None, out: Path | None) -> tuple[str, Written]:
    """Write the case file of a point of a stored study."""
    from klack.analyses.catalogue import load_result
    from klack.analyses.ending import is_result
    from klack.analyses.study.point_case import case_of_point
    from klack.analyses.study.record import StudyRecord
    from klack.terminal.output import require_folder

    study = load_result(source) if is_result(source) else None
    if not isinstance(study, StudyRecord):
        raise InputError(
            str(source),
            got="no result of a study",
            expected="the folder of klack study or klack optimise",
            hint="give the folder that the command names at the end.",
        )
    folder = out if out is not None else source
    require_folder(folder)
    name, text = case_of_point(study, point, folder)
    with staged_folder(folder) as stage:
        (stage / name).write_text(text, encoding="utf-8")
        return study.case, Written.of(folder, stage)


def run_and_export(
    case: "Case | ValveCase", to: str, folder: Path, *, threads: int | None, quiet: bool
) -> tuple[Written, Exception | None]:
    """Run a case, write its result, and pass on why a run ended early."""
    from klack.analyses.impact.run import run_impact
    from klack.analyses.incomplete import IncompleteImpactError
    from klack.analyses.stroke.record import IncompleteStrokeError
    from klack.analyses.stroke.run import run_stroke
    from klack.case.schema import Case

    study: Any
    incomplete: Exception | None = None
    with show_progress(quiet) as progress:
        try:
            if isinstance(case, Case):
                study = run_impact(
                    case, levels=case.run.levels, certify=False, progress=progress, threads=threads
                )
            else:
                study = run_stroke(case, progress=progress, threads=threads)
        except (IncompleteImpactError, IncompleteStrokeError) as error:
            study, incomplete = error.study, error
    return export_result(study, to, folder), incomplete


def export_fields(
    case: "Case",
    folder: Path,
    *,
    level: Literal["reduced", "full"],
    frames: int,
    threads: int | None,
    quiet: bool,
) -> Written:
    """Write displacement, velocity and stress of an impact over time, for ParaView."""
    from klack.exchange.results.vtk_series import write_impact_series

    with show_progress(quiet) as progress, staged_folder(folder) as stage:
        made = write_impact_series(
            case, stage, level=level, frames=frames, progress=progress, threads=threads
        )
        place = folder / made.relative_to(stage)
        return Written.of(folder, stage, f"Written: {place}; open it in ParaView")


@dataclass(frozen=True, slots=True)
class StoredImpact:
    """Which impact of a stored stroke is shown, and in how many frames."""

    number: int
    variant: str | None
    frames: int


def export_stored_impact(
    source: Path,
    out: Path | None,
    chosen: StoredImpact,
    components: "OwnComponents",
    *,
    threads: int | None,
    quiet: bool,
) -> tuple[str, Written]:
    """Write the bodies and the line load of an impact of a stored stroke, for ParaView."""
    from klack.analyses.catalogue import load_result
    from klack.analyses.stroke.record import StrokeStudy
    from klack.case.any_case import read_valve_case
    from klack.exchange.results.spatial_series import write_spatial_series
    from klack.terminal.output import require_folder

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
    case = read_valve_case(study.case_text, Path(f"{study.case}.yaml"), components)
    with show_progress(quiet) as progress, staged_folder(folder) as stage:
        made = write_spatial_series(
            study,
            case,
            stage,
            impact=chosen.number,
            variant=chosen.variant,
            frames=chosen.frames,
            progress=progress,
            threads=threads,
        )
        place = folder / made.relative_to(stage)
        return study.case, Written.of(folder, stage, f"Written: {place}; open it in ParaView")
