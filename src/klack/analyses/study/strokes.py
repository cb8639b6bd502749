"""Strokes of one case at many points of its parameter space, on the threads of this process.

Meshes, modes and contact laws are made once for all points that leave them as they are; the time
loop runs outside of the interpreter, so that threads share them.  Every point is computed alone and
from rest, by the very functions that compute a single stroke: its numbers depend neither on the
number of threads nor on the other points.
"""

import warnings
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Self

from klack.analyses.noise.body import Transfers
from klack.analyses.noise.source import NoiseSource, stroke_sources
from klack.analyses.point_table import NOT_COMPUTED, PointTable, column_of
from klack.analyses.record import run_fields
from klack.analyses.stroke.record import StopSummary
from klack.analyses.stroke.rest import rest_note
from klack.analyses.stroke.run import (
    VariantRun,
    body_summaries,
    one_variant,
    stop_summaries,
    stroke_study,
    variant_network,
)
from klack.analyses.study.chosen_measures import ChosenMeasure, PointRun, chosen_measures
from klack.analyses.study.point_row import PointRow
from klack.analyses.study.tally import Tally
from klack.analyses.threads import (
    Stopped,
    on_threads,
    one_thread_of_blas,
    warnings_of_threads,
)
from klack.assembling.body_summary import BodySummary
from klack.assembling.valve import Valve, build_valve, filled_network
from klack.case.case_tree import CaseTree
from klack.case.points import (
    GivenPoints,
    Points,
    PointValue,
    case_at,
    checked_parts,
    points_of,
    with_changes,
)
from klack.case.valve import ValveCase
from klack.case.valve_roles import END_STOP, FLEXIBLE_BODY, ValveRoles, find_roles
from klack.case.variants import Variant
from klack.cores import available_cores
from klack.errors import AccuracyWarning, InputError, KlackError
from klack.input.problem import Key
from klack.memory import require_memory
from klack.progress import Progress, silent
from klack.signals import TimeSeries
from klack.simulation.network_recorder import recorded_columns
from klack.simulation.network_run import has_python_steps
from klack.stages import FAILURES, StageClock, collected_warnings

__all__ = [
    "AskedPoints",
    "Builds",
    "PointGroup",
    "compute_alone",
    "compute_points",
    "groups_of",
    "makes_bodies",
    "row_table",
    "sounds_of",
]

_AROUND = 50e6  # [byte] of a run beside its records
_FINE, _MOST_FINE = 80.0, 1e6  # [byte] of a step with contact, and how many of them are kept
_MOST_BUILDS = 8
_ASIDE = ("run", "lumped", "measurement", "calibration", "title", "description")
"""Sections that bodies, contact laws and their stops do not depend on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AskedPoints:
    """Points of a case, and what is computed at every one of them.

    Parameters
    ----------
    case : ValveCase
    tree : CaseTree
        The same as it was written.
    points : Points
    chosen : tuple of ChosenMeasure
    variant : str
    """

    case: ValveCase
    tree: CaseTree
    points: Points
    chosen: tuple[ChosenMeasure, ...]
    variant: Variant

    @classmethod
    def of(
        cls,
        case: ValveCase,
        tree: CaseTree,
        points: GivenPoints,
        measures: Iterable[str],
        variant: str | None,
    ) -> Self:
        """Check everything that can be known before the first run.

        Raises
        ------
        InputError
            For a key, a unit, a measure or a variant that does not exist.
        """
        chosen = chosen_measures(case, measures)
        asked = points_of(case, tree, points)
        for key in asked.keys:
            if key.place[:2] == ("run", "variants"):
                raise InputError(
                    f"points: {key.name}",
                    got="a variant as a part of a point",
                    expected="one variant for all points",
                    hint='write variant="dry", and compute two tables.',
                )
        name = case.one_variant(variant)
        return cls(case=case, tree=tree, points=asked, chosen=chosen, variant=name)

    def failed(self, error: BaseException) -> PointRow:
        """Row of a point without measures."""
        known = isinstance(error, KlackError)
        text = str(error) if known else f"{type(error).__name__}: {error}"
        return PointRow((None,) * len(self.chosen), text, by_chance=not known)


@dataclass(frozen=True, slots=True, kw_only=True)
class PointGroup:
    """Points with the same bodies and contact laws.

    Parameters
    ----------
    made : mapping of Key to value
        What these points exchange that bodies and laws follow from.
    places : tuple of int
        Of the points.
    """

    made: Mapping[Key, PointValue]
    places: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Built:
    """Bodies and laws of a group.

    Parameters
    ----------
    made : mapping of Key to value
        Of the group.
    tree : CaseTree
        With these values.
    parts : CaseTree
        The same, checked where no point changes it.
    valve : Valve
        Of one point, without meshes.
    bodies : tuple of BodySummary
    stops : tuple of StopSummary
    notes : tuple of str
        Doubts about bodies and laws.
    transfers : Transfers
        Of the bodies to the sound.
    """

    made: Mapping[Key, PointValue]
    tree: CaseTree
    parts: CaseTree
    valve: Valve
    bodies: tuple[BodySummary, ...]
    stops: tuple[StopSummary, ...]
    notes: tuple[str, ...]
    transfers: Transfers = field(default_factory=Transfers)


class Builds:
    """Bodies and laws of the latest groups, for the next points of the same case."""

    def __init__(self) -> None:
        self._found: OrderedDict[tuple[object, ...], _Built] = OrderedDict()

    def find(self, asked: AskedPoints, group: PointGroup) -> _Built | None:
        """What a group needs, if it is there."""
        return self._found.get(self._key(asked, group))

    def keep(self, asked: AskedPoints, group: PointGroup, built: _Built) -> None:
        """Keep it, and let go of the oldest."""
        key = self._key(asked, group)
        self._found[key] = built
        self._found.move_to_end(key)
        while len(self._found) > _MOST_BUILDS:
            self._found.popitem(last=False)

    def _key(self, asked: AskedPoints, group: PointGroup) -> tuple[object, ...]:
        touched = tuple(key.place for key in asked.points.keys)
        return (id(asked.tree), touched, tuple(group.made.items()))


def compute_points(
    asked: AskedPoints,
    places: Iterable[int],
    keep: Callable[[int, PointRow], None],
    threads: int | None = None,
    progress: Progress = silent,
    builds: Builds | None = None,
) -> None:
    """Compute some of the points, those with the same bodies one after another.

    Parameters
    ----------
    asked : AskedPoints
    places : iterable of int
        Of the points that are wanted.
    keep : callable
        Called in this thread with each place and its row, in the order of their end.
    threads : int, optional
    progress : callable
    builds : Builds, optional
        Bodies and laws that were made before.

    Raises
    ------
    InputError
        Where so many strokes at a time do not fit into the memory.
    KeyboardInterrupt
        Ctrl-C, after the rows that were finished have been kept.
    """
    wanted = list(places)
    kept = builds or Builds()
    tally = Tally(len(asked.points), len(wanted), keep, progress)
    with tally, one_thread_of_blas():
        for group in groups_of(asked, wanted):
            tally.tell()
            _run_group(asked, group, tally, threads, progress, kept)


def row_table(asked: AskedPoints, found: Sequence[PointRow | None]) -> PointTable:
    """Table of all points; those without a row were not computed."""
    none = PointRow((None,) * len(asked.chosen), NOT_COMPUTED)
    rows = [none if row is None else row for row in found]
    return PointTable(
        case=asked.case.name,
        variant=asked.variant,
        points=tuple(
            column_of(
                key.name,
                key.unit,
                [
                    key.value(row[key.name]) if key.name in row else None
                    for row in asked.points.written
                ],
            )
            for key in asked.points.keys
        ),
        measures=tuple(
            column_of(item.name, item.measure.unit, [row.values[k] for row in rows], item.measure)
            for k, item in enumerate(asked.chosen)
        ),
        failures=tuple(row.failure for row in rows),
        warnings=tuple(row.notes for row in rows),
    )


def groups_of(asked: AskedPoints, places: Iterable[int]) -> tuple[PointGroup, ...]:
    """Points that share their bodies, in the order of the first one of each group."""
    found: dict[tuple[tuple[Key, PointValue], ...], list[int]] = {}
    for i in places:
        changes = asked.points.changes(i).items()
        made = tuple(item for item in changes if makes_bodies(asked.case, item[0]))
        found.setdefault(made, []).append(i)
    return tuple(PointGroup(made=dict(made), places=tuple(at)) for made, at in found.items())


def makes_bodies(case: ValveCase, place: Key) -> bool:
    """Whether meshes, modes or contact laws may follow from what stands there.

    They do from the damping of a body: the port pattern of a stop is that of an impact.
    """
    if place[0] != "network":
        return place[0] not in _ASIDE
    if place[1:2] != ("components",):
        return False
    if len(place) < 4 or place[3] == "type":
        return True
    part = case.network.components[str(place[2])]
    if part.type == FLEXIBLE_BODY:
        return place[3] != "speed"
    return part.type == END_STOP and place[3] == "law"


def _run_group(
    asked: AskedPoints,
    group: PointGroup,
    tally: Tally,
    threads: int | None,
    progress: Progress,
    builds: Builds,
) -> None:
    built, left = builds.find(asked, group), group.places
    if built is None:
        built, left = _build(asked, group, tally, progress)
    if built is None:
        return
    builds.keep(asked, group, built)
    with warnings_of_threads() as taken:
        crew = _crew(asked, built, left, threads)
        taken()
        on_threads(
            left, lambda i, check: _row(asked, built, i, check, taken), crew, tally, tally.tell
        )


def compute_alone(asked: AskedPoints, builds: Builds) -> list[PointRow]:
    """Compute all points in this thread, one after another.

    Parameters
    ----------
    asked : AskedPoints
    builds : Builds
        Bodies and laws that were made before.

    Returns
    -------
    list of PointRow
        In the order of the points; warnings of the bodies go with the last one.
    """
    found: dict[int, PointRow] = {}
    with warnings.catch_warnings(record=True) as caught, one_thread_of_blas():
        warnings.simplefilter("always")
        for group in groups_of(asked, range(len(asked.points))):
            _run_alone(asked, group, found, builds)
    rows = [found[i] for i in range(len(found))]
    if caught and rows:
        rows[-1] = replace(rows[-1], others=(*rows[-1].others, *caught))
    return rows


def _run_alone(
    asked: AskedPoints, group: PointGroup, found: dict[int, PointRow], builds: Builds
) -> None:
    built, left = builds.find(asked, group), group.places
    is_new = built is None
    if built is None:
        built, left = _build(asked, group, found.__setitem__, silent)
    if built is None:
        return
    with warnings_of_threads() as taken:
        if is_new:
            try:
                _crew(asked, built, left, 1)
            except InputError as error:  # the memory is full at this moment
                found.update(dict.fromkeys(left, replace(asked.failed(error), by_chance=True)))
                return
            taken()
            builds.keep(asked, group, built)
        for i in left:
            found[i] = _row(asked, built, i, _never, taken)


def _never() -> None:
    """Nothing asks this work to stop."""


def _build(
    asked: AskedPoints, group: PointGroup, keep: Callable[[int, PointRow], None], progress: Progress
) -> tuple[_Built | None, tuple[int, ...]]:
    """Bodies and laws for the first point that the case allows, and the points that are left.

    None if it allows none.  Points that cannot be computed have their rows.
    """
    tree = replace(asked.tree, data=with_changes(asked.tree.data, group.made))
    for k, i in enumerate(group.places):
        try:
            case = case_at(tree, tree, asked.points.changes(i))
        except InputError as error:
            keep(i, asked.failed(error))
            continue
        left = group.places[k:]
        try:
            with collected_warnings() as notes:
                valve = build_valve(case, progress, threads=1)
        except FAILURES as error:
            for place in left:
                keep(place, asked.failed(error))
            return None, ()
        places = [key.place for key in asked.points.keys if key.place not in group.made]
        built = _Built(
            made=group.made,
            tree=tree,
            parts=checked_parts(tree, case, places),
            valve=Valve(
                case=case,
                bodies={},
                reduced={name: replace(b, recovery=None) for name, b in valve.reduced.items()},
                contacts={},
                laws=valve.laws,
                network=valve.network,
                structures=valve.structures,
            ),
            bodies=body_summaries(valve),
            stops=stop_summaries(valve),
            notes=tuple(notes),
        )
        return built, left
    return None, ()


def _valve_at(asked: AskedPoints, built: _Built, i: int) -> Valve:
    """Valve of a point; its case is checked as a whole."""
    changes = asked.points.changes(i)
    own = {place: value for place, value in changes.items() if place not in built.made}
    case = case_at(built.tree, built.parts, own)
    case.require_variants((asked.variant,))
    network = filled_network(case, built.valve.reduced, built.valve.laws)
    return replace(built.valve, case=case, network=network)


def _row(
    asked: AskedPoints,
    built: _Built,
    i: int,
    check: Callable[[], None],
    taken: Callable[[], list[warnings.WarningMessage]],
) -> PointRow:
    """Compute one point, in whichever thread."""
    try:
        whole, roles = _point_run(asked, built, i, check)
        values = tuple(item.value(whole) for item in asked.chosen)
    except Stopped:
        raise
    except BaseException as error:  # a component of the user's own may raise anything
        return replace(asked.failed(error), others=_others(taken()))
    caught = taken()
    result = whole.variant.result
    doubts = [str(item.message) for item in caught if issubclass(item.category, AccuracyWarning)]
    begun = result.start.notes if result.start is not None else ()
    rest = rest_note(asked.variant, result, roles.seat)
    notes = [*built.notes, *doubts, *whole.notes]
    notes += [note for note in begun if not any(note in other for other in notes)]
    notes += [rest] if rest else []
    return PointRow(values, notes=tuple(dict.fromkeys(notes)), others=_others(caught))


def _point_run(
    asked: AskedPoints, built: _Built, i: int, check: Callable[[], None]
) -> tuple[PointRun, ValveRoles]:
    """Stroke of a point."""
    valve = _valve_at(asked, built, i)
    roles = find_roles(valve.case, valve.network)
    run = one_variant(valve, roles, asked.variant, None, lambda stage, fraction: check())
    if run.failure is not None:
        raise run.failure
    whole = PointRun(
        run.variant, lambda: _noise_source(asked, built, valve, roles, run), built.transfers
    )
    return whole, roles


def sounds_of(asked: AskedPoints, progress: Progress) -> tuple[TimeSeries | None, ...]:
    """Sound of a click of every point, computed once more; None where there is none.

    Parameters
    ----------
    asked : AskedPoints
    progress : callable
    """
    found: list[TimeSeries | None] = [None] * len(asked.points)
    done = 0
    with warnings.catch_warnings(), one_thread_of_blas():
        warnings.simplefilter("ignore")  # the points have been computed, and their doubts told
        for group in groups_of(asked, range(len(found))):
            built, left = _build(asked, group, lambda place, row: None, silent)
            if built is None:
                continue
            for i in left:
                progress("sounds", done / len(found))
                with suppress(KlackError):
                    found[i] = _point_run(asked, built, i, _never)[0].pressure
                done += 1
    return tuple(found)


def _noise_source(
    asked: AskedPoints, built: _Built, valve: Valve, roles: ValveRoles, run: VariantRun
) -> NoiseSource:
    """What the noise of a point comes from; the section ``noise`` is that of the point."""
    made = run_fields(0.0, StageClock(silent))
    runs: dict[Variant, VariantRun] = {asked.variant: run}
    study = stroke_study(valve, roles, runs, made, bodies=built.bodies, stops=built.stops)
    return stroke_sources(study, case=valve.case)[0]


def _others(caught: Iterable[warnings.WarningMessage]) -> tuple[warnings.WarningMessage, ...]:
    """Warnings that are no doubt about a number, to be shown as usual."""
    return tuple(item for item in caught if not issubclass(item.category, AccuracyWarning))


def _crew(asked: AskedPoints, built: _Built, places: Sequence[int], threads: int | None) -> int:
    """Threads for these points: one where a component calls Python.

    Raises
    ------
    InputError
        If so many strokes at a time do not fit into the memory.
    """
    crew = min(available_cores() if threads is None else threads, max(len(places), 1))
    for i in places:
        try:
            valve = _valve_at(asked, built, i)
            rows = variant_network(valve, asked.variant).rows()
        except KlackError:
            continue  # its row will say
        if has_python_steps(rows):
            return 1
        run = valve.case.run
        records = run.duration / run.record
        steps = min(run.duration / run.fine_step, _MOST_FINE) * len(rows.interfaces)
        require_memory(
            "run_many: threads",
            crew * (8.0 * records * recorded_columns(rows) + _FINE * steps + _AROUND),
            what=f"{crew} strokes at a time, each of {records:.4g} records of "
            f"{recorded_columns(rows)} channels,",
            hint="use fewer threads, a longer record interval (run.record), or a shorter duration.",
        )
        return crew
    return crew
