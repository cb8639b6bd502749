"""Results as xarray datasets, for notebooks."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from klack.analyses.analysis import Measured
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.measures import Measure, json_of
from klack.analyses.noise.record import NoiseDesign, NoiseStudy
from klack.analyses.shots.record import SHOT_MEASURES, ShotsStudy
from klack.analyses.stroke.record import StrokeStudy
from klack.analyses.stroke_shots.record import (
    FIRST_TOUCH_MEASURES,
    STROKE_MEASURES,
    StrokeShotsStudy,
    VariantShots,
)
from klack.analyses.study.record import StudyColumn, StudyRecord
from klack.arrays import Floats
from klack.errors import InputError, optional_package, refuse_if
from klack.exchange.results.study_table import about_study, result_table
from klack.exchange.results.table import ResultChannel, ResultRun, ResultScalar, identifiers
from klack.signals.sampled import TimeSeries

__all__ = ["dataset_of", "short_names"]


class Variable(NamedTuple):
    """Dimensions, values, and attributes (``units``, ``long_name``, ``comment``)."""

    dimensions: tuple[str, ...]
    values: NDArray[Any] | float | int | bool
    attributes: dict[str, str]


def about_measure(measure: Measure[Any]) -> dict[str, str]:
    """Attributes of the values of a measure."""
    return {"units": measure.unit, "long_name": measure.name, "comment": measure.definition}


def noise_variables(design: NoiseDesign) -> tuple[dict[str, Variable], dict[str, Variable]]:
    """Variables and coordinates of a design: forces of the stops, bodies, sound of one click.

    Over ``band``, the middles of third octaves: energies of force, radiated energy, sound
    exposure. Forces share ``time`` where sampled alike; every stop has a frequency axis.
    """
    bands = design.band_middle
    coordinates = {
        "band": Variable(
            ("band",), bands, {"units": "Hz", "long_name": "middle of the third octave"}
        )
    }
    variables = {
        "net_share": Variable(
            ("band",),
            design.net_share,
            {
                "units": "1",
                "long_name": "share of the energy of the contact forces that is not balanced by "
                "others",
            },
        )
    }

    sampled: dict[tuple[float, float, int], str] = {}

    def add_series(name: str, series: TimeSeries, meaning: str) -> None:
        new = f"{name}_time" if sampled else "time"
        axis = sampled.setdefault((series.start, series.step, series.values.size), new)
        coordinates[axis] = Variable((axis,), series.time, {"units": "s", "long_name": "time"})
        variables[name] = Variable(
            (axis,), series.values, {"units": series.unit, "long_name": meaning}
        )

    def add_bands(name: str, energy: Floats, unit: str, meaning: str) -> None:
        variables[name] = Variable(("band",), energy, {"units": unit, "long_name": meaning})

    stops = identifiers([item.stop for item in design.stops])
    for name, stop in zip(stops, design.stops, strict=True):
        add_series(f"{name}_force", stop.force, f"force on '{stop.stop}', means over steps")
        add_bands(f"{name}_force_energy", stop.bands.energy, "N^2 s", f"force on '{stop.stop}'")
        axis = f"{name}_frequency"
        coordinates[axis] = Variable(
            (axis,), stop.frequency, {"units": "Hz", "long_name": "frequency"}
        )
        variables[f"{name}_force_level"] = Variable(
            (axis,),
            stop.level,
            {"units": "dB", "long_name": f"strongest impact on '{stop.stop}', re 1 uN s"},
        )
    bodies = identifiers([body.name for body in design.bodies], stops)
    for name, body in zip(bodies, design.bodies, strict=True):
        radiated = body.radiated.sum(axis=0)
        add_bands(f"{name}_radiated", radiated, "J", f"sound energy of '{body.name}', estimate")
        add_series(f"{name}_blocked_force", body.blocked, f"force of '{body.name}' on its support")
    if design.sound is not None:
        add_series("sound_pressure", design.sound.pressure, "sound of one click, estimate")
        exposure = np.full(bands.size, np.nan)  # heard from 20 Hz to 20 kHz only
        heard = np.isin(design.stops[0].bands.number, design.sound.bands.number)
        exposure[heard] = design.sound.bands.energy
        add_bands("sound_exposure", exposure, "Pa^2 s", "sound of one click, estimate")
    return variables, coordinates


_SAID = {"failure": "why there are no measures", "doubts": "doubts about the numbers"}


def points_variables(study: StudyRecord) -> tuple[dict[str, Variable], dict[str, Variable]]:
    """Variables and coordinates of all points, in the order of the design.

    Parameters and measures (points,) over ``point``, names with underscores; ``failure`` says why
    a point has no measures, ``doubts`` what speaks against its numbers.
    """
    names = identifiers([item.name for item in study.columns], ("point", *_SAID))
    variables = {
        name: Variable(
            ("point",),
            (np.array([item.words[int(i)] for i in item.values]) if item.words else item.values),
            _about(item),
        )
        for name, item in zip(names, study.columns, strict=True)
    }
    for (name, long_name), texts in zip(_SAID.items(), (study.failures, study.notes), strict=True):
        variables[name] = Variable(("point",), np.array(texts, dtype=str), {"long_name": long_name})
    number = np.arange(study.count)
    return variables, {"point": Variable(("point",), number, {"long_name": "number of the point"})}


def _about(item: StudyColumn) -> dict[str, str]:
    comment = {"comment": item.spread} if item.spread else {}
    return {"units": item.unit or "1", "long_name": item.name, **comment}


def shots_variables(study: ShotsStudy) -> tuple[dict[str, Variable], dict[str, Variable]]:
    """Variables and coordinates of all shots and the centred one.

    Numbers (n + 1,) over ``shot``; height and force (n + 1, k) over ``shot`` and time. Shots count
    from 1; the last row, shot 0, is the centred one.
    """
    shots, centred = study.shot_traces, study.centric_traces
    count = study.shots.count
    rows = [*(study.shots.row(index) for index in range(count)), study.centric.row(0)]
    variables = {
        measure.key: Variable(
            ("shot",), np.array([row[measure.key] for row in rows]), about_measure(measure)
        )
        for measure in SHOT_MEASURES
    }
    variables["height"] = Variable(
        ("shot", "time"),
        np.vstack([shots.height, centred.height]),
        {
            "units": "m",
            "long_name": "height of the centre of mass above its position at first touch",
        },
    )
    variables["contact_force"] = Variable(
        ("shot", "force_time"),
        np.vstack([shots.force, centred.force]),
        {"units": "N", "long_name": "axial contact force of the first impact"},
    )
    after = {"units": "s", "long_name": "time after the first touch"}
    coordinates = {
        "shot": Variable(
            ("shot",),
            np.append(np.arange(1, count + 1), 0),
            {"long_name": "number of the shot; 0 is the centred shot"},
        ),
        "time": Variable(("time",), shots.time, after),
        "force_time": Variable(("force_time",), shots.force_time, after),
    }
    return variables, coordinates


def strokes_variables(shots: VariantShots) -> tuple[dict[str, Variable], dict[str, Variable]]:
    """Variables and coordinates of all strokes of a variant and the centred one.

    Numbers (n + 1,) over ``stroke``, of the first impact on a stop behind its name,
    ``seat_peak_force``; lift (n + 1, k) over ``stroke`` and ``time``. Strokes count from 0; the
    last row, stroke -1, is the centred one.
    """
    variables = {
        measure.key: _column(measure, shots.strokes, shots.centric) for measure in STROKE_MEASURES
    }
    for stop, columns in shots.stops.items():
        variables |= {
            f"{stop}_{measure.key}": _column(measure, columns, shots.centric_stops[stop])
            for measure in FIRST_TOUCH_MEASURES
        }
    variables["lift"] = Variable(
        ("stroke", "time"),
        np.vstack([shots.lift, shots.centric_lift]),
        {"units": "m", "long_name": "displacement of the point of the lift"},
    )
    coordinates = {
        "stroke": Variable(
            ("stroke",),
            np.append(np.arange(shots.strokes.count), -1),
            {"long_name": "number of the stroke; -1 starts centred"},
        ),
        "time": Variable(("time",), shots.time, {"units": "s", "long_name": "time"}),
    }
    return variables, coordinates


def _column(measure: Measure[Mapping[str, float]], every: Any, alone: Any) -> Variable:
    values = np.append(getattr(every, measure.key), getattr(alone, measure.key))
    return Variable(("stroke",), values, about_measure(measure))


Variables = dict[str, Variable]


def dataset_of(record: object, measured: Iterable[Measured], run: str | None = None) -> Any:
    """Curves and numbers of one run of a record as an ``xarray.Dataset``.

    Variables have ``units`` and ``long_name``, as in netCDF files
    (:func:`klack.exchange.results.netcdf.write_netcdf`).

    Parameters
    ----------
    record : ImpactStudy, StrokeStudy, ShotsStudy, StrokeShotsStudy, StudyRecord or NoiseStudy
    measured : iterable of (name, part of the record, measures)
        Of the record; a noise study needs none.
    run
        Level, variant or design; default: answer of an impact, reference of a stroke, first
        design. Shots and studies have one run.

    Raises
    ------
    MissingExtraError
        Without the package xarray.
    InputError
        For another record or run.
    """
    optional_package("xarray", "datasets of results", "exchange")
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
                        float("nan") if (value := values[item.json_key]) is None else value,
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
    from klack.exchange.results.curves import Curves

    shown = {key: text for key, text in about.items() if text}
    return Curves(variables, coords=coordinates, attrs=shown)


def short_names(record: object) -> Mapping[str, str]:
    """Channels that a record itself calls by one word."""
    if isinstance(record, ImpactStudy):
        return {"force": "contact force"}
    if isinstance(record, StrokeStudy):
        return {"lift": record.channels.lift, "velocity": record.channels.velocity}
    return {"force": "contact_force"} if isinstance(record, ShotsStudy) else {}


def _named(run: str | None, usual: str, known: Iterable[str]) -> str:
    name = usual if run is None else run
    refuse_if(
        name not in known,
        "to_xarray",
        got=f"'{name}'",
        expected=f"one of: {', '.join(known)}",
        hint="name a level, a variant, a design, or a transfer function of this result.",
    )
    return name


def _table_variables(run: ResultRun) -> tuple[Variables, Variables]:
    """Data variables and coordinates, by Python names."""
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
        name: Variable((dimension[item.axis],), item.values, _about_item(item))
        for name, item in zip(names, run.channels, strict=False)
    }
    numbers = zip(names[len(run.channels) :], run.scalars, strict=True)
    return curves | {
        name: Variable((), n.value, _about_item(n)) for name, n in numbers
    }, coordinates


def _about_item(item: ResultChannel | ResultScalar) -> dict[str, str]:
    return {"units": item.unit, "long_name": item.name, "comment": item.meaning}
