"""Interface for notebooks: cases, runs and results, exported by :mod:`klack`.

Every function takes a case by name (a file, a shipped case) or as :func:`load_case` returned it,
and returns a :class:`Result`.  Where it takes them:

components
    The user's own, which the case may name.
study
    File with a section ``study``; that of the case by default.
folder
    Where computed points or trials are kept, so that an interrupted run resumes.
threads
    All available cores by default.
workers
    Processes in place of threads; in a script, the call stands under
    ``if __name__ == "__main__":``.
dask
    Cluster of distributed in place of threads, also the address of its scheduler, or a file with
    that.

An :class:`InputError` comes before the first run, with file, line and key.
"""

import json
from base64 import b64encode
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from klack.analyses.analysis import StoredAnalysis
from klack.analyses.catalogue import analysis_in
from klack.analyses.measures import Measure, Value, json_of
from klack.analyses.point_table import PointTable, RunsInterrupted
from klack.analyses.sensitivities.record import SensitivityRecord
from klack.case.any_case import CaseTree, read_any_case, read_case_tree, tree_of
from klack.case.key_path import kind_at, node_at, quantity_at, split_path
from klack.case.points import GivenPoints
from klack.case.reader import find_case
from klack.case.rewriting import with_values
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.errors import InputError, refuse_if
from klack.input.problem import CaseProblem
from klack.machine.progress import Progress, silent
from klack.network.component import Component

if TYPE_CHECKING:
    from distributed import Client

    from klack.analyses.study.where import Where

__all__ = [
    "CaseOnHand",
    "Number",
    "PointTable",
    "Result",
    "RunsInterrupted",
    "calibrate",
    "compare",
    "load_case",
    "load_result",
    "noise_of",
    "optimise",
    "run_heat",
    "run_impact",
    "run_magnet",
    "run_many",
    "run_shots",
    "run_stroke",
    "run_study",
    "sensitivities",
]

Checked = TypeVar("Checked", Case, ValveCase)


@dataclass(frozen=True, eq=False)
class CaseOnHand:
    """A checked case, with the text that it was read from.

    Parameters
    ----------
    checked
        Typed, all numbers in SI: ``case.checked.motion.speed``.
    """

    checked: Case | ValveCase
    tree: CaseTree

    @property
    def name(self) -> str:
        """Short name."""
        return self.checked.name

    @property
    def title(self) -> str:
        """Title of the case."""
        return self.checked.title

    @property
    def text(self) -> str:
        """The file, with the values that were changed."""
        return self.tree.text

    def value(self, key: str) -> Any:
        """Value at a key, in SI where it is a quantity; None if there is none.

        Raises
        ------
        InputError
            If there is no such key.
        """
        return self._at(key)[0]

    def with_value(self, key: str, value: object) -> "CaseOnHand":
        """A case with another value at a key, checked as a whole.

        Parameters
        ----------
        key
            ``"network.components.spring.preload"``.
        value
            As in the case file: ``"14 N"``.

        Examples
        --------
        >>> case = load_case("demo-stroke")
        >>> changed = case.with_value("network.components.spring.preload", "14 N")
        >>> changed.value("network.components.spring.preload")
        14.0
        """
        node, field = self._at(key)
        place = split_path(key)
        if not isinstance(value, str | int | float):
            raise InputError(
                f"with_value('{key}')",
                got=f"a {type(value).__name__}",
                expected="one value, as in the case file",
                hint='give a text such as "14 N", or a number; set entries of a list one by one.',
            )
        if kind_at(node, field) is not None and isinstance(node, float):
            quantity_at(self.checked, place).parse(value)
        text = with_values(self.tree, {place: json.dumps(value)})
        own = tuple(self.tree.components.values())
        tree = tree_of(text, self.tree.path, own)
        return CaseOnHand(read_any_case(text, self.tree.path, own), tree)

    def _at(self, key: str) -> tuple[Any, Any]:
        try:
            return node_at(self.checked, split_path(key))
        except CaseProblem as problem:
            where = f"key of {self.tree.path.name}"
            raise InputError(
                where, got=problem.got, expected=problem.expected, hint=problem.hint
            ) from None

    def __repr__(self) -> str:
        return f"{self.name}: {self.title} ({self.tree.path.name})"

    def _repr_html_(self) -> str:
        return (
            f"<b>{escape(self.title or self.name)}</b><br>{escape(self.checked.description)}"
            f"<details><summary>{escape(str(self.tree.path.name))}</summary>"
            f"<pre>{escape(self.text)}</pre></details>"
        )


class Number(float):
    """Value of a measure in SI: a float that knows its unit, nan where the run has no value.

    It computes, compares, sorts, hashes and converts as the float that it is; what is computed from
    it is a plain float.  Only ``repr`` and ``str`` show the unit: ``123.5 N``.

    Parameters
    ----------
    value
        As in JSON: None without a value, whole numbers and truths as such.
    unit
        SI, ``"1"`` for a pure number.
    measure
        Name, symbol, definition, source.
    """

    __slots__ = ("measure", "unit", "value")

    value: Value
    unit: str
    measure: Measure[Any]

    def __new__(
        cls, value: Value, unit: str = "1", measure: Measure[Any] | None = None
    ) -> "Number":
        """Take None as nan; a plain float without a measure: so :mod:`statistics` makes a mean."""
        plain = float("nan") if value is None else float(value)
        if measure is None:
            return plain  # type: ignore[return-value]
        number = super().__new__(cls, plain)
        number.value, number.unit, number.measure = value, unit, measure
        return number

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle what describes the measure, without the functions that read it from a record."""
        words = {key: getattr(self.measure, key) for key in _DESCRIBING}
        return _number_from, (self.value, self.unit, words)

    def __repr__(self) -> str:
        unit = "" if self.unit == "1" else f" {self.unit}"
        return "none" if self.value is None else f"{self.value!r}{unit}"


_DESCRIBING = ("key", "definition", "name", "symbol", "unit", "source", "kind", "form", "digits")


def _number_from(value: Value, unit: str, words: Mapping[str, Any]) -> Number:
    return Number(value, unit, Measure(**words))


@dataclass(frozen=True, eq=False)
class Result:
    """Result of an analysis.

    Parameters
    ----------
    record
        Everything, as arrays and small records, in SI: ImpactStudy, StrokeStudy, ShotsStudy,
        NoiseStudy, ...
    analysis
        How it is stored and told.
    """

    record: Any
    analysis: StoredAnalysis[Any]

    @cached_property
    def measures(self) -> Mapping[str, Mapping[str, Number]]:
        """Named numbers, by level, variant, impact, shot or design, then by key."""
        found: dict[str, dict[str, Number]] = {}
        for name, of, measures in self.analysis.measured(self.record):
            values = json_of(measures, of)
            settled = {item.json_key: item.settled(of) for item in measures}
            found[name] = {
                item.key: Number(values[key], item.unit, item) for key, item in settled.items()
            }
        return found

    @property
    def json(self) -> dict[str, Any]:
        """Output of ``--json`` of the command."""
        return dict(self.analysis.to_json(self.record))

    def save(self, folder: str | Path, *, report: bool = False) -> Path:
        """Store the record, and its report if wanted; return the folder."""
        place = Path(folder)
        self.analysis.save(self.record, place)
        if report:
            from klack.report.html import write_report
            from klack.report.pdf import write_pdf

            content = self.analysis.content(self.record)
            write_report(content, place / "report.html")
            write_pdf(content, place / "report.pdf")
        return place

    def to_xarray(self, run: str | None = None, axis: str | None = None) -> Any:
        """Curves and numbers of one level or variant as an ``xarray.Dataset``.

        Coordinates are the axes of the run; ``units``, ``long_name`` and ``comment`` are attributes
        of every variable.

        Parameters
        ----------
        run
            Level, variant or design; the one that is the answer by default.
        axis
            Only the curves over this one; all axes and numbers by default.

        Raises
        ------
        MissingExtraError
            Without the package xarray.
        InputError
            For a record without curves, or a run or axis that it does not have.
        """
        from klack.exchange.results.dataset import dataset_of

        data = dataset_of(self.record, self.analysis.measured(self.record), run)
        if axis is None:
            return data
        from klack.exchange.results.curves import over_axis

        return over_axis(data, axis)

    def to_dataframe(self, run: str | None = None, axis: str | None = None) -> Any:
        """Curves over one axis as the columns of a ``pandas.DataFrame``.

        The first axis by default: time of impacts and strokes, shots, points of a study, bands of
        noise.  Names of columns are those of :meth:`to_xarray`, their units
        ``frame.attrs["units"]``.
        """
        data = self.to_xarray(run)
        from klack.exchange.results.curves import frame_of

        return frame_of(data, axis)

    def plot(self, chart: str | None = None) -> Any:
        """Draw a chart of the report with matplotlib, the first one by default.

        Returns its axes: one, or an array of them from top to bottom.  The figure is that of
        pyplot: a notebook shows it, ``matplotlib.pyplot.show`` too.

        Raises
        ------
        InputError
            For another name than those of :attr:`charts`.
        """
        from klack.report.printed import shown_chart

        charts = self._charts()
        name = next(iter(charts), "") if chart is None else chart
        refuse_if(
            name not in charts,
            "plot",
            got=f"'{name}'" if name else "a result without charts",
            expected=f"one of: {', '.join(charts)}" if charts else "a chart in its report",
            hint="result.charts lists the names.",
        )
        return shown_chart(charts[name])

    @property
    def charts(self) -> tuple[str, ...]:
        """Names of the charts of the report."""
        return tuple(self._charts())

    def _charts(self) -> dict[str, Any]:
        sections = self.analysis.content(self.record).sections
        return {chart.name: chart for section in sections for chart in section.charts}

    def __getitem__(self, name: str | tuple[str, str]) -> Any:
        """Curve of the answer, an ``xarray.DataArray`` with its axis and units.

        ``impact["force"]``, ``stroke["lift"]``, ``stroke["needle.tip velocity"]``, or words that
        only one name has, ``stroke["current"]``; of another level, variant or design
        ``stroke["dry", "lift"]``.  ``list(result)`` has the names.

        Raises
        ------
        InputError
            Also a :class:`KeyError`: for a name that no curve has, or several.
        """
        run, curve = name if isinstance(name, tuple) else (None, name)
        data = self.to_xarray(run)
        from klack.exchange.results.curves import curve_of
        from klack.exchange.results.dataset import short_names

        return curve_of(data, curve, short_names(self.record))

    def __contains__(self, name: object) -> bool:
        """Whether ``result[name]`` is one curve."""
        try:
            self[name]  # type: ignore[index]
        except InputError:
            return False
        return True

    def __iter__(self) -> Iterator[str]:
        """Names of the curves and numbers of the answer."""
        return iter(map(str, self.to_xarray().data_vars))

    def _ipython_key_completions_(self) -> list[str]:
        return list(self)

    def __repr__(self) -> str:
        every = self.measures
        lines = [f"{self.analysis.form.command}: {self.record.title or self.record.case}"]
        lines += [f"  {name}: {_short(every[name])}" for name in list(every)[:_LINES]]
        if len(every) > _LINES:
            lines.append(f"  and {len(every) - _LINES} more in measures")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """Key numbers, warnings and the first figure, as a notebook shows them."""
        content = self.analysis.content(self.record)
        rows = "".join(
            "<tr>" + "".join(f"<td>{_lines(cell)}</td>" for cell in row) + "</tr>"
            for row in content.numbers.rows
        )
        heads = "".join(f"<th>{_lines(head)}</th>" for head in content.numbers.columns)
        warnings = "".join(f"<li>{escape(text)}</li>" for text in content.warnings)
        charts = [chart for section in content.sections for chart in section.charts]
        figure = ""
        if charts:
            from klack.report.printed import png_chart

            pixels = b64encode(png_chart(charts[0])).decode()
            figure = f'<img alt="{escape(charts[0].title)}" src="data:image/png;base64,{pixels}">'
        return (
            f"<b>{escape(content.title)}</b><br>{escape(content.subtitle)}"
            f"<p>{escape(content.answer)}</p>"
            + (f"<ul>{warnings}</ul>" if warnings else "")
            + f"<table><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>{figure}"
        )


_LINES = 6  # of a result on a terminal


def _short(numbers: Mapping[str, Number]) -> str:
    shown = [item for item in numbers.values() if item.measure.page and item.value is not None]
    parts = [
        f"{n.measure.name} {n.measure.printed(n.value)}" for n in shown[:4] if n.value is not None
    ]
    return ", ".join(parts)


def _lines(cell: str) -> str:
    return escape(cell).replace("\n", "<br>")


# --------------------------------------------------------------------------- doing


Given = str | Path | CaseOnHand


def load_case(case: str | Path, components: Iterable[type[Component]] = ()) -> CaseOnHand:
    """Read and check a case: a file, or the name of a shipped one."""
    own = tuple(components)
    path = find_case(Path(case))
    tree = read_case_tree(path, own)
    return CaseOnHand(read_any_case(tree.text, path, own), tree)


def load_result(folder: str | Path) -> Result:
    """Read what a command, or :meth:`Result.save`, wrote."""
    analysis = analysis_in(Path(folder))
    return Result(analysis.load(Path(folder)), analysis)


def run_impact(
    case: Given,
    levels: Sequence[str] | None = None,
    *,
    certify: bool = True,
    progress: Progress = silent,
    threads: int | None = None,
) -> Result:
    """Compute one dry impact; see :func:`klack.analyses.impact.run.run_impact`."""
    from klack.analyses.impact.analysis import IMPACT
    from klack.analyses.impact.run import run_impact as run

    checked = _of_kind(case, Case, "an impact")
    wanted = checked.require_levels(list(levels) if levels else checked.run.levels)
    record = run(checked, levels=wanted, certify=certify, progress=progress, threads=threads)
    return Result(record, IMPACT)


def run_stroke(
    case: Given,
    variants: Sequence[str] | None = None,
    *,
    controllers: Mapping[str, str | Path] | None = None,
    progress: Progress = silent,
    threads: int | None = None,
) -> Result:
    """Compute one actuation of a valve; see :func:`klack.analyses.stroke.run.run_stroke`.

    ``controllers`` are FMUs by the controlled component of the case: their binaries run with your
    rights.
    """
    from klack.analyses.stroke.analysis import STROKE
    from klack.analyses.stroke.controllers import with_controllers
    from klack.analyses.stroke.run import run_stroke as run

    checked = _of_kind(case, ValveCase, "a whole valve")
    checked = with_controllers(checked, {n: Path(f) for n, f in (controllers or {}).items()})
    wanted = checked.require_variants(tuple(variants) if variants else checked.run.variants)
    return Result(run(checked, variants=wanted, progress=progress, threads=threads), STROKE)


def run_heat(
    case: Given,
    variant: str | None = None,
    *,
    soak: Sequence[float] = (),
    progress: Progress = silent,
    threads: int | None = None,
) -> Result:
    """Warm a valve up by its strokes, or ``soak`` it at temperatures [K].

    See :func:`klack.analyses.heat.run.run_heat`.
    """
    from klack.analyses.heat.run import run_heat as run
    from klack.analyses.heat.summary import HEAT

    checked = _of_kind(case, ValveCase, "a whole valve")
    record = run(checked, variant=variant, soak=soak, progress=progress, threads=threads)
    return Result(record, HEAT)


def run_magnet(case: str | Path, *, progress: Progress = silent) -> Result:
    """Compute the map of a drawn magnet.

    See :func:`klack.analyses.magnet.analysis.run_magnet`.
    """
    from klack.analyses.magnet.analysis import MAGNET
    from klack.analyses.magnet.analysis import run_magnet as run
    from klack.analyses.magnet.case import load_magnet_case

    return Result(run(load_magnet_case(case), progress=progress), MAGNET)


def run_many(
    case: Given,
    points: GivenPoints,
    measures: Sequence[str],
    *,
    variant: str | None = None,
    level: str | None = None,
    threads: int | None = None,
    workers: int | None = None,
    dask: "str | Client | None" = None,
    progress: Progress = silent,
) -> PointTable:
    """Compute measures of a stroke or an impact at many points of the parameter space of a case.

    Every number is that of :func:`run_stroke`, :func:`run_impact` or :func:`run_shots` of the
    changed case, to the last bit, whatever the number of threads and the order of the points.
    Steps of strokes are checked, and halved, for the impacts that the measures depend on: those of
    :func:`run_stroke` may be shorter for later ones.  A point that cannot be computed is a row with
    its error.

    Parameters
    ----------
    points
        Keys of the case to values with their units, for each point; or lists of values by key.
    measures
        ``"opening_time"``; of the first impact on the stop ``seat`` ``"seat.peak_force"``, of the
        second one ``"seat.2.peak_force"``; of an impact of two bodies ``"peak_force"``.
    variant
        Of a stroke; the first one of the case by default.
    level
        Of an impact; ``"reduced"`` by default.
    threads
        Always 1 with components in Python and FMUs, and for impacts.
    workers, dask
        See :mod:`klack.api`.

    Raises
    ------
    RunsInterrupted
        On Ctrl-C: a :class:`KeyboardInterrupt` whose ``table`` holds what was computed.

    Examples
    --------
    >>> run_many("demo-stroke", [], ["opening_time"])
    demo-stroke, wet: 0 points
    opening_time [s]
    """
    from klack.analyses.study.run_points import require_way, run_points
    from klack.analyses.study.where import Where

    where = Where(threads=threads, workers=workers, dask=dask)
    given = case if isinstance(case, CaseOnHand) else load_case(case)
    require_way(given.checked, variant, level)
    return run_points(
        given.checked,
        given.tree,
        points,
        measures,
        variant=level or variant,
        where=where,
        progress=progress,
    )


def run_study(
    case: Given,
    study: str | Path | None = None,
    *,
    made: int | None = None,
    folder: str | Path | None = None,
    threads: int | None = None,
    workers: int | None = None,
    dask: "str | Client | None" = None,
    progress: Progress = silent,
) -> Result:
    """Compute measures of a stroke or an impact at the points of a study, as ``klack study`` does.

    See :mod:`klack.api` for ``folder``, ``threads``, ``workers`` and ``dask``.

    Parameters
    ----------
    made
        Instead of the design of the study: so many valves made after the case, with the scatter of
        its section ``robust``.
    workers
        Faster than threads for impacts, and where measures of the noise, or several geometries, are
        asked for.
    """
    from klack.analyses.study.run import run_study as run
    from klack.analyses.study.where import Where

    where = Where(threads=threads, workers=workers, dask=dask)
    return _studied(run, case, study, folder, where, progress, made)


def optimise(
    case: Given,
    study: str | Path | None = None,
    *,
    folder: str | Path | None = None,
    threads: int | None = None,
    workers: int | None = None,
    dask: "str | Client | None" = None,
    progress: Progress = silent,
) -> Result:
    """Search the ranges of a study for the best points, as ``klack optimise`` does.

    Arguments are those of :func:`run_study`; the study has objectives.
    """
    from klack.analyses.study.optimise import run_optimisation
    from klack.analyses.study.where import Where

    where = Where(threads=threads, workers=workers, dask=dask)
    return _studied(run_optimisation, case, study, folder, where, progress)


def sensitivities(
    case: Given,
    study: str | Path | None = None,
    *,
    parameters: Sequence[str] = (),
    measures: Sequence[str] = (),
    variant: str | None = None,
    level: str | None = None,
    check: bool = True,
    progress: Progress = silent,
) -> SensitivityRecord:
    """Differentiate times, impacts and noise of a stroke, or measures of an impact.

    As ``klack sensitivities`` does: a stroke by exact tangents of one run, an impact by differences
    of impacts with each parameter changed by 1 % and 2 %.

    Parameters
    ----------
    study
        With parameters and measures.
    parameters
        Keys, or some of the study.
    measures
        ``"closing_time"``, ``"seat.peak_force"``.
    level
        Of an impact; ``"reduced"`` by default.
    check
        Whether further strokes, two of them with all parameters changed by 1 %, are compared.

    Raises
    ------
    InputError
        For a parameter or a measure that has no derivative.
    """
    from klack.analyses.sensitivities.differences import sensitivities_of
    from klack.case.study_source import study_if_any

    given = case if isinstance(case, CaseOnHand) else load_case(case)
    return sensitivities_of(given.checked, variant, level)(
        given.checked,
        given.tree,
        study_if_any(given.checked, given.tree, None if study is None else Path(study)),
        parameters=parameters,
        measures=measures,
        check=check,
        progress=progress,
    )


def _studied(
    run: Any,
    case: Given,
    study: str | Path | None,
    folder: str | Path | None,
    where: "Where",
    progress: Progress,
    made: int | None = None,
) -> Result:
    from klack.analyses.study.analysis import STUDY
    from klack.case.study_source import study_of

    given = case if isinstance(case, CaseOnHand) else load_case(case)
    source = study_of(given.checked, given.tree, None if study is None else Path(study))
    if made is not None:
        source = source.made(made)
    place = None if folder is None else Path(folder)
    record = run(given.checked, given.tree, source, folder=place, where=where, progress=progress)
    return Result(record, STUDY)


def run_shots(
    case: Given,
    count: int | None = None,
    *,
    variants: Sequence[str] | None = None,
    seed: int | None = None,
    workers: int | None = None,
    progress: Progress = silent,
    threads: int | None = None,
) -> Result:
    """Drop or actuate a valve many times.

    Drops of an impact case: :func:`klack.analyses.shots.run.run_shots`; strokes of a valve in three
    dimensions: :func:`klack.analyses.stroke_shots.run.run_stroke_shots`, which has ``variants``.
    """
    given = case if isinstance(case, CaseOnHand) else load_case(case)
    if isinstance(given.checked, ValveCase):
        from klack.analyses.stroke_shots.analysis import STROKE_SHOTS
        from klack.analyses.stroke_shots.run import run_stroke_shots

        strokes = run_stroke_shots(
            given.checked,
            variants=tuple(variants or ()),
            count=count,
            seed=seed,
            workers=workers,
            progress=progress,
            threads=threads,
        )
        return Result(strokes, STROKE_SHOTS)
    from klack.analyses.shots.analysis import SHOTS
    from klack.analyses.shots.run import run_shots as run

    checked = _of_kind(given, Case, "an impact")
    if variants:
        raise InputError(
            "run_shots: variants",
            got=f"'{variants[0]}' for drops of two bodies",
            expected="none: only whole strokes have variants",
            hint="leave them out.",
        )
    record = run(
        checked, count=count, seed=seed, workers=workers, progress=progress, threads=threads
    )
    return Result(record, SHOTS)


def noise_of(*results: Result, names: Sequence[str] = (), progress: Progress = silent) -> Result:
    """Estimate the sound of impacts and strokes, side by side.

    The first of ``results`` is the one to compare with; ``names`` are those of the designs.
    """
    from klack.analyses.noise.analysis import NOISE
    from klack.analyses.noise.run import run_noise
    from klack.analyses.noise.source import sources_of

    records = [getattr(result, "record", result) for result in results]
    sources = [source for record in records for source in sources_of(record)]
    return Result(run_noise(sources, names=names, progress=progress), NOISE)


def calibrate(
    case: Given,
    measurement: str | Path | Sequence[str | Path],
    *,
    folder: str | Path | None = None,
    workers: int | None = None,
    progress: Progress = silent,
) -> Result:
    """Fit the parameters of a valve to measured strokes, as ``klack calibrate`` does.

    The case has a section ``calibration``; ``measurement`` are recordings.
    """
    from klack.analyses.calibration.analysis import CALIBRATION
    from klack.analyses.calibration.run import calibration_of, run_calibration
    from klack.measurement.loading import load_stroke_set

    given = case if isinstance(case, CaseOnHand) else load_case(case)
    checked = _of_kind(given, ValveCase, "a whole valve")
    roles = ("lift", *calibration_of(checked).channels)
    strokes = load_stroke_set(_paths(measurement), checked.measurement, roles=roles)
    record = run_calibration(
        given.tree,
        strokes,
        folder=None if folder is None else Path(folder),
        workers=workers,
        progress=progress,
    )
    return Result(record, CALIBRATION)


def compare(
    result: Result,
    measurement: str | Path | Sequence[str | Path] | Mapping[str, str | Path],
    *,
    case: Given | None = None,
    level: str = "full",
    output: str | None = None,
    progress: Progress = silent,
) -> Result:
    """Compare a result with a measurement, like ``klack compare --measurement``.

    Parameters
    ----------
    result
        Of :func:`run_stroke`, :func:`run_shots` or :func:`run_impact`.
    measurement
        Paths, or a path by variant.
    case
        Whose section ``measurement`` is used; that of the result by default.
    level, output
        Of an impact; its output may be left out where there is one.
    """
    from klack.analyses.comparison.impacts import compare_impact
    from klack.analyses.comparison.impacts_summary import MEASURED_IMPACT
    from klack.analyses.comparison.shots import compare_shots
    from klack.analyses.comparison.shots_summary import MEASURED_SHOTS
    from klack.analyses.comparison.strokes import compare_strokes
    from klack.analyses.comparison.strokes_summary import MEASURED_STROKES
    from klack.analyses.impact.record import ImpactStudy
    from klack.analyses.shots.record import ShotsStudy
    from klack.analyses.stroke.record import StrokeStudy

    record = result.record
    if isinstance(record, ImpactStudy) and not isinstance(measurement, Mapping):
        pulses = compare_impact(
            record, _paths(measurement), level=level, output=output, progress=progress
        )
        return Result(pulses, MEASURED_IMPACT)
    if case is None:
        section = read_any_case(record.case_text, Path("case.yaml")).measurement
        text = None
    else:
        other = case if isinstance(case, CaseOnHand) else load_case(case)
        section, text = other.checked.measurement, other.text
    if isinstance(record, StrokeStudy):
        files = (
            {name: _paths(path) for name, path in measurement.items()}
            if isinstance(measurement, Mapping)
            else {record.reference.name: _paths(measurement)}
        )
        strokes = compare_strokes(record, files, section, case_text=text, progress=progress)
        return Result(strokes, MEASURED_STROKES)
    if isinstance(record, ShotsStudy) and not isinstance(measurement, Mapping):
        drops = compare_shots(
            record, _paths(measurement), section, case_text=text, progress=progress
        )
        return Result(drops, MEASURED_SHOTS)
    raise InputError(
        "compare",
        got=f"a result of '{result.analysis.form.command}'",
        expected="one of run_stroke, or one of run_shots or run_impact with a list of files",
        hint="run the stroke first: klack.run_stroke(case).",
    )


def _of_kind(case: Given, kind: type[Checked], words: str) -> Checked:
    given = case if isinstance(case, CaseOnHand) else load_case(case)
    if isinstance(given.checked, kind):
        return given.checked
    raise InputError(
        f"case {given.name}",
        got="a case of another kind",
        expected=f"a case of {words}",
        hint="a case with a section 'network' is a valve: run_stroke; with 'contact' it is an "
        "impact: run_impact, run_shots.",
    )


def _paths(given: str | Path | Sequence[str | Path]) -> list[Path]:
    return [Path(item) for item in ([given] if isinstance(given, str | Path) else given)]
