"""Strokes of one case at many points of its parameter space, on the threads of this process.

Meshes, modes and contact laws are made once for all points that leave them as they are; the time
loop runs outside of the interpreter, so that threads share them.  Every point is computed alone and
from rest, by the very functions that compute a single stroke: its numbers depend neither on the
number of threads nor on the other points.
"""

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from klack.analyses.point_table import NOT_COMPUTED, PointTable, RunsInterrupted, column_of
from klack.analyses.stroke.chosen_measures import ChosenMeasure, chosen_measures
from klack.analyses.stroke.rest import rest_note
from klack.analyses.stroke.run import one_variant, variant_network
from klack.analyses.threads import Stopped, on_threads, warnings_of_threads
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
from klack.case.valve_roles import END_STOP, FLEXIBLE_BODY, find_roles
from klack.case.valve_sections import Variant
from klack.cores import available_cores
from klack.errors import AccuracyWarning, InputError, KlackError
from klack.input.problem import Key
from klack.memory import require_memory
from klack.progress import Progress, silent
from klack.simulation.network_recorder import recorded_columns
from klack.simulation.network_run import has_python_steps
from klack.stages import FAILURES, collected_warnings, show

__all__ = ["run_strokes"]

_AROUND = 50e6  # [byte] of a run beside its records
_FINE, _MOST_FINE = 80.0, 1e6  # [byte] of a step with contact, and how many of them are kept
_STAGE = "points"
_ASIDE = ("run", "lumped", "measurement", "calibration", "title", "description")
"""Sections that bodies, contact laws and their stops do not depend on."""


@dataclass(frozen=True, slots=True)
class _Row:
    """What one point leaves behind."""

    values: tuple[float | None, ...]
    failure: str = ""
    notes: tuple[str, ...] = ()
    others: tuple[warnings.WarningMessage, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Asked:
    """What is computed at every point."""

    tree: CaseTree
    points: Points
    chosen: tuple[ChosenMeasure, ...]
    variant: Variant

    def failed(self, error: BaseException) -> _Row:
        """Row of a point without measures."""
        known = isinstance(error, KlackError)
        text = str(error) if known else f"{type(error).__name__}: {error}"
        return _Row((None,) * len(self.chosen), text)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Group:
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
    notes : tuple of str
        Doubts about bodies and laws.
    """

    made: Mapping[Key, PointValue]
    tree: CaseTree
    parts: CaseTree
    valve: Valve
    notes: tuple[str, ...]


def run_strokes(
    case: ValveCase,
    tree: CaseTree,
    points: GivenPoints,
    measures: Iterable[str],
    *,
    variant: str | None = None,
    threads: int | None = None,
    progress: Progress = silent,
) -> PointTable:
    """Compute one variant of a stroke at many points.

    Parameters
    ----------
    case : ValveCase
    tree : CaseTree
        The same as it was written.
    points : sequence of mappings, or mapping of sequences
        Key of the case to a value with its unit, for every point; or a list of values by key.
    measures : iterable of str
        See :class:`~klack.analyses.stroke.chosen_measures.ChosenMeasure`.
    variant : str, optional
        The first one of the case by default.
    threads : int, optional
        The available cores by default; 1 for a case whose components call Python or an FMU, which
        need not bear several calls at a time.
    progress : callable
        Called with a stage and the share of the points that are done.

    Raises
    ------
    InputError
        Before the first run: for a key, a unit or a measure that does not exist, and where so many
        strokes at a time do not fit into the memory.
    RunsInterrupted
        On Ctrl-C, with the table of what was computed until then.
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
    name = case.require_variants((variant,) if variant is not None else case.run.variants)[0]
    if threads is not None and (isinstance(threads, bool) or threads < 1):
        raise InputError(
            "threads", got=str(threads), expected="1 or more", hint="leave it out: all cores."
        )
    work = _Asked(tree=tree, points=asked, chosen=chosen, variant=name)
    rows: list[_Row | None] = [None] * len(asked)
    try:
        for group in _groups(case, asked):
            _run_group(work, group, rows, threads, progress)
    except KeyboardInterrupt:
        raise RunsInterrupted(_table(case, work, rows)) from None
    finally:
        others = [item for row in rows if row is not None for item in row.others]
        show({str(item.message): item for item in others}.values())
    return _table(case, work, rows)


def _table(case: ValveCase, asked: _Asked, found: Sequence[_Row | None]) -> PointTable:
    none = _Row((None,) * len(asked.chosen), NOT_COMPUTED)
    rows = [none if row is None else row for row in found]
    return PointTable(
        case=case.name,
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


def _groups(case: ValveCase, points: Points) -> tuple[_Group, ...]:
    """Points that share their bodies, in the order of the first one of each group."""
    found: dict[tuple[tuple[Key, PointValue], ...], list[int]] = {}
    for i in range(len(points)):
        made = tuple(item for item in points.changes(i).items() if _makes_bodies(case, item[0]))
        found.setdefault(made, []).append(i)
    return tuple(_Group(made=dict(made), places=tuple(at)) for made, at in found.items())


def _makes_bodies(case: ValveCase, place: Key) -> bool:
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
    asked: _Asked,
    group: _Group,
    rows: list[_Row | None],
    threads: int | None,
    progress: Progress,
) -> None:
    def tell() -> None:
        progress(_STAGE, sum(row is not None for row in rows) / len(rows))

    tell()
    built = _build(asked, group, rows, progress)
    if built is None:
        return
    left = [i for i in group.places if rows[i] is None]
    with warnings_of_threads() as taken:
        crew = _crew(asked, built, left, threads)
        taken()
        on_threads(
            left, lambda i, check: _row(asked, built, i, check, taken), crew, rows.__setitem__, tell
        )


def _build(
    asked: _Asked, group: _Group, rows: list[_Row | None], progress: Progress
) -> _Built | None:
    """Bodies and laws for the first point that the case allows; None if it allows none.

    The rows of points that cannot be computed are filled.
    """
    tree = replace(asked.tree, data=with_changes(asked.tree.data, group.made))
    for i in group.places:
        try:
            case = case_at(tree, tree, asked.points.changes(i))
        except InputError as error:
            rows[i] = asked.failed(error)
            continue
        try:
            with collected_warnings() as notes:
                valve = build_valve(case, progress)
        except FAILURES as error:
            for k in group.places:
                rows[k] = asked.failed(error)
            return None
        places = [key.place for key in asked.points.keys if key.place not in group.made]
        return _Built(
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
            ),
            notes=tuple(notes),
        )
    return None


def _valve_at(asked: _Asked, built: _Built, i: int) -> Valve:
    """Valve of a point; its case is checked as a whole."""
    changes = asked.points.changes(i)
    own = {place: value for place, value in changes.items() if place not in built.made}
    case = case_at(built.tree, built.parts, own)
    case.require_variants((asked.variant,))
    network = filled_network(case, built.valve.reduced, built.valve.laws)
    return replace(built.valve, case=case, network=network)


def _row(
    asked: _Asked,
    built: _Built,
    i: int,
    check: Callable[[], None],
    taken: Callable[[], list[warnings.WarningMessage]],
) -> _Row:
    """Compute one point, in whichever thread."""
    try:
        valve = _valve_at(asked, built, i)
        roles = find_roles(valve.case, valve.network)
        run = one_variant(valve, roles, asked.variant, None, lambda stage, fraction: check())
        if run.failure is not None:
            raise run.failure
        values = tuple(item.of(run.variant) for item in asked.chosen)
    except Stopped:
        raise
    except BaseException as error:  # a component of the user's own may raise anything
        return replace(asked.failed(error), others=_others(taken()))
    caught = taken()
    result = run.variant.result
    doubts = [str(item.message) for item in caught if issubclass(item.category, AccuracyWarning)]
    begun = result.start.notes if result.start is not None else ()
    rest = rest_note(asked.variant, result, roles.seat)
    notes = [*built.notes, *doubts]
    notes += [note for note in begun if not any(note in other for other in notes)]
    notes += [rest] if rest else []
    return _Row(values, notes=tuple(dict.fromkeys(notes)), others=_others(caught))


def _others(caught: Iterable[warnings.WarningMessage]) -> tuple[warnings.WarningMessage, ...]:
    """Warnings that are no doubt about a number, to be shown as usual."""
    return tuple(item for item in caught if not issubclass(item.category, AccuracyWarning))


def _crew(asked: _Asked, built: _Built, places: Sequence[int], threads: int | None) -> int:
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
