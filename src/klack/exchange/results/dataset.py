"""Results as xarray datasets, for notebooks."""

from typing import Any

from klack.analyses.impact.record import ImpactStudy
from klack.analyses.stroke.record import StrokeStudy
from klack.errors import InputError, MissingExtraError
from klack.exchange.results.naming import identifiers
from klack.exchange.results.study_table import result_table
from klack.exchange.results.table import ResultChannel, ResultRun, ResultScalar

__all__ = ["dataset_of"]


def dataset_of(record: object, run: str | None = None) -> Any:
    """Curves and numbers of one run of a record as an ``xarray.Dataset``.

    Coordinates are the axes of the run; every variable has ``units``, ``long_name`` and
    ``comment``, as in netCDF files (:func:`klack.exchange.results.netcdf.write_netcdf`).

    Parameters
    ----------
    record : ImpactStudy or StrokeStudy
    run : str, optional
        Level or variant; the answer of an impact, the reference of a stroke by default.

    Raises
    ------
    MissingExtraError
        Without the package xarray.
    InputError
        For another record, or a run that it does not have.
    """
    if not isinstance(record, ImpactStudy | StrokeStudy):
        raise InputError(
            "to_xarray",
            got=f"a {type(record).__name__}",
            expected="the record of an impact or a stroke",
            hint="its arrays are fields of the record: result.record.",
        )
    try:
        import xarray
    except ImportError as error:
        raise MissingExtraError("xarray", "datasets of results", "exchange") from error
    table = result_table(record)
    usual = record.reference if isinstance(record, ImpactStudy) else record.reference.name
    runs = {item.name: item for item in table.runs}
    if (run or usual) not in runs:
        raise InputError(
            "to_xarray",
            got=f"'{run}'",
            expected=f"one of: {', '.join(runs)}",
            hint="name a level, a variant, or a transfer function of this result.",
        )
    found = runs[run or usual]
    variables, coordinates = _variables(found)
    about = {key: text for key, text in table.about.items() if text}
    attributes = {**about, "run": found.name, "label": found.label}
    return xarray.Dataset(variables, coords=coordinates, attrs=attributes)


def _variables(run: ResultRun) -> tuple[dict[str, Any], dict[str, Any]]:
    """Data variables and coordinates, by names that Python takes."""
    axes = identifiers([axis.name for axis in run.axes])
    dimension = dict(zip([axis.name for axis in run.axes], axes, strict=True))
    coordinates = {
        dimension[axis.name]: (
            (dimension[axis.name],),
            axis.values,
            {"units": axis.unit, "long_name": axis.meaning},
        )
        for axis in run.axes
    }
    words = [item.name for item in run.channels] + [item.name for item in run.scalars]
    names = identifiers(words, axes)
    variables: dict[str, Any] = {
        name: ((dimension[item.axis],), item.values, _about(item))
        for name, item in zip(names, run.channels, strict=False)
    }
    numbers = zip(names[len(run.channels) :], run.scalars, strict=True)
    return variables | {name: ((), n.value, _about(n)) for name, n in numbers}, coordinates


def _about(item: ResultChannel | ResultScalar) -> dict[str, str]:
    return {"units": item.unit, "long_name": item.name, "comment": item.meaning}
