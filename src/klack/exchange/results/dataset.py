"""Results as xarray datasets, for notebooks."""

from collections.abc import Iterable
from typing import Any

from klack.analyses.analysis import Measured
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.measures import json_of
from klack.analyses.noise.record import NoiseStudy
from klack.analyses.shots.record import ShotsStudy
from klack.analyses.stroke.record import StrokeStudy
from klack.analyses.stroke_shots.record import StrokeShotsStudy
from klack.analyses.study.record import StudyRecord
from klack.errors import InputError, optional_package
from klack.exchange.results.about import about_study
from klack.exchange.results.naming import identifiers
from klack.exchange.results.noise_dataset import noise_variables
from klack.exchange.results.points_dataset import points_variables
from klack.exchange.results.shots_dataset import shots_variables
from klack.exchange.results.strokes_dataset import strokes_variables
from klack.exchange.results.study_table import result_table
from klack.exchange.results.table import ResultChannel, ResultRun, ResultScalar
from klack.exchange.results.variables import Variable, about_measure

__all__ = ["dataset_of"]

Variables = dict[str, Variable]


def dataset_of(record: object, measured: Iterable[Measured], run: str | None = None) -> Any:
    """Curves and numbers of one run of a record as an ``xarray.Dataset``.

    Coordinates are the axes of the run; every variable has ``units`` and ``long_name``, as in
    netCDF files (:func:`klack.exchange.results.netcdf.write_netcdf`).

    Parameters
    ----------
    record : ImpactStudy, StrokeStudy, ShotsStudy, StrokeShotsStudy, StudyRecord or NoiseStudy
    measured : iterable of (name, part of the record, measures)
        Those of the record; the numbers of a noise study are read from them.
    run : str, optional
        Level, variant or design; the answer of an impact, the reference of a stroke, the first
        design by default.  Shots and studies have one run.

    Raises
    ------
    MissingExtraError
        Without the package xarray.
    InputError
        For another record, or a run that it does not have.
    """
    xarray = optional_package("xarray", "datasets of results", "exchange")
    about: dict[str, str]
    if isinstance(record, ImpactStudy | StrokeStudy):
        table = result_table(record)
        usual = record.reference if isinstance(record, ImpactStudy) else record.reference.name
        runs = {item.name: item for item in table.runs}
        found = runs[_named(run, usual, runs)]
        variables, coordinates = _table_variables(found)
        about = {**table.about, "run": found.name, "label": found.label}
    elif isinstance(record, ShotsStudy):
        _named(run, "shots", ("shots",))
        variables, coordinates = shots_variables(record)
        about = about_study(record, {"surfaces": record.surfaces, "guide": record.guide})
    elif isinstance(record, StrokeShotsStudy):
        shots = record.variants[_named(run, next(iter(record.variants)), record.variants)]
        variables, coordinates = strokes_variables(shots)
        about = about_study(record, {"run": shots.name, "label": shots.label})
    elif isinstance(record, StudyRecord):
        _named(run, "points", ("points",))
        variables, coordinates = points_variables(record)
        about = about_study(record, {"run": record.variant, "label": record.design})
    elif isinstance(record, NoiseStudy):
        designs = {item.name: item for item in record.designs}
        design = designs[_named(run, record.reference.name, designs)]
        variables, coordinates = noise_variables(design)
        for _, of, measures in measured:
            if of is design:
                values = json_of(measures, of)
                variables |= {
                    item.key: Variable(
                        (),
                        (float("nan") if values[item.json_key] is None else values[item.json_key]),
                        about_measure(item),
                    )
                    for item in measures
                }
        about = about_study(record, {"run": design.name, "label": design.label})
    else:
        raise InputError(
            "to_xarray",
            got=f"a {type(record).__name__}",
            expected="the record of an impact, a stroke, shots, a study or noise",
            hint="its arrays are fields of the record: result.record.",
        )
    shown = {key: text for key, text in about.items() if text}
    return xarray.Dataset(variables, coords=coordinates, attrs=shown)


def _named(run: str | None, usual: str, known: Iterable[str]) -> str:
    name = usual if run is None else run
    if name not in known:
        raise InputError(
            "to_xarray",
            got=f"'{name}'",
            expected=f"one of: {', '.join(known)}",
            hint="name a level, a variant, a design, or a transfer function of this result.",
        )
    return name


def _table_variables(run: ResultRun) -> tuple[Variables, Variables]:
    """Data variables and coordinates, by names that Python takes."""
    axes = identifiers([axis.name for axis in run.axes])
    dimension = dict(zip([axis.name for axis in run.axes], axes, strict=True))
    coordinates = {
        dimension[axis.name]: Variable(
            (dimension[axis.name],), axis.values, {"units": axis.unit, "long_name": axis.meaning}
        )
        for axis in run.axes
    }
    words = [item.name for item in run.channels] + [item.name for item in run.scalars]
    names = identifiers(words, axes)
    curves = {
        name: Variable((dimension[item.axis],), item.values, _about(item))
        for name, item in zip(names, run.channels, strict=False)
    }
    numbers = zip(names[len(run.channels) :], run.scalars, strict=True)
    return curves | {name: Variable((), n.value, _about(n)) for name, n in numbers}, coordinates


def _about(item: ResultChannel | ResultScalar) -> dict[str, str]:
    return {"units": item.unit, "long_name": item.name, "comment": item.meaning}
