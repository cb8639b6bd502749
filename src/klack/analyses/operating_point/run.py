"""``klack stroke --steady``: operating points of a valve."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter, process_time
from warnings import WarningMessage

import numpy as np
from numpy.typing import NDArray

from klack.analyses.operating_point.conditions import (
    Conditions,
    Origin,
    Sweep,
    point_conditions,
)
from klack.analyses.operating_point.quantities import Measured, measured
from klack.analyses.operating_point.record import (
    OperatingPoints,
    PointQuantity,
    SweptQuantity,
)
from klack.analyses.record import case_fields, run_fields
from klack.analyses.stroke.run import variant_network
from klack.analyses.study.strokes import STROKES
from klack.assembling.valve import Valve, build_valve, filled_network
from klack.case.any_case import CaseTree
from klack.case.levels import Variant
from klack.case.placed_errors import tells_place
from klack.case.points import case_at
from klack.case.spatial_consistency import require_axial
from klack.case.valve import ValveCase
from klack.case.valve_roles import ValveRoles, find_roles
from klack.errors import AccuracyWarning, ConvergenceError, InputError, KlackError
from klack.machine.cache.result_cache import result_cache
from klack.machine.progress import Progress, silent
from klack.machine.stages import StageClock, collected_warnings, trial
from klack.magnetics.constant_drive import driven, hysteretic_coils, start_currents
from klack.network.checks import LooseBodyWarning
from klack.network.network import Network
from klack.network.ranges import Travel
from klack.network.rows import Rows
from klack.simulation.operating_point import (
    OperatingPoint,
    far_ends,
    operating_point,
    without_guesses,
)
from klack.units import format_si

__all__ = [
    "PointFound",
    "find_point",
    "run_operating_points",
    "searched",
    "valve_at",
]

Vector = NDArray[np.float64]

_SAME = 1e-3  # of the travel: two displacements are one
_TRAVEL = 1e-5  # [m] of a body that no stop ends
_FELT = 1e-2  # of the travel: friction that may hold a body away is worth a word
_UNGUESSED = (
    "the search from the pressures stated in the case did not converge; this point was found "
    "from ambient pressure in all volumes."
)
_BEYOND = 1e-9  # of the travel: a lift that lies on its stop


@dataclass(frozen=True, kw_only=True, eq=False)
class PointFound:
    """Operating point, network with constant drives, and notes."""

    point: OperatingPoint
    network: Network
    rows: Rows
    currents: Mapping[str, float]
    notes: tuple[str, ...]


@tells_place
def run_operating_points(
    case: ValveCase,
    tree: CaseTree,
    *,
    variant: str | None = None,
    base: Conditions | None = None,
    sweeps: Sequence[Sweep] = (),
    origin: Origin = "start",
    threads: int | None = None,
    progress: Progress = silent,
) -> OperatingPoints:
    """Find the operating point of a valve, or those along one or two sweeps.

    ``base`` is drive and lift, by default of the start of a run.  The search begins at bodies as
    drawn (``start``), or at the stops ``far`` from there.  InputError also for a motion in three
    dimensions, and for a single point that does not exist; ConvergenceError for one that is not
    found.
    """
    begin = perf_counter()
    name = case.one_variant(variant)
    require_axial(case, "klack stroke --steady")
    clock = StageClock(progress, result_cache())
    roles = find_roles(case)
    with collected_warnings() as warned:
        valve = build_valve(case, clock, threads=threads)
    asked = point_conditions(base or Conditions(), sweeps)
    found: list[Measured | None] = []
    failures, doubts, errors = list[str](), list[str](), list[KlackError]()
    drive: dict[str, float] = {}
    spent = 0.0
    for i, conditions in enumerate(asked):
        clock("operating points", i / len(asked))
        try:
            here, taken = valve_at(valve, tree, conditions, clock, threads), process_time()
            now = find_point(here, roles, name, conditions, origin)
            measures = measured(now.point, now.network, now.rows, now.currents, roles)
        except KlackError as error:
            if not sweeps:
                raise
            found.append(None)
            failures.append(str(error))
            errors.append(error)
            doubts.append("")
            continue
        spent += process_time() - taken
        drive = drive or dict(now.currents)
        found.append(measures)
        failures.append("")
        doubts.append("\n".join(" ".join(note.split()) for note in now.notes))
    if not any(found) and all(isinstance(error, InputError) for error in errors):
        raise errors[0]  # what is asked for fits no point of this case
    if not any(found):
        raise ConvergenceError(
            f"operating points: none of {len(asked)} was found; the first one: {failures[0]}"
        )
    return OperatingPoints(
        **case_fields(case),
        **run_fields(begin, clock),
        variant=name,
        needle=f"{roles.needle}.{roles.point}",
        origin=origin,
        drive=drive,
        swept=_swept(sweeps),
        quantities=_quantities(found),
        force_left=_column([None if x is None else x.force_left for x in found]),
        flow_left=_column([None if x is None else x.flow_left for x in found]),
        voltage_left=_column([None if x is None else x.voltage_left for x in found]),
        failures=tuple(failures),
        doubts=tuple(doubts),
        cpu_time=spent,
        warnings=(*warned, *_told(failures, doubts, sweeps)),
    )


def find_point(
    valve: Valve,
    roles: ValveRoles,
    variant: Variant,
    conditions: Conditions,
    origin: Origin = "start",
) -> PointFound:
    """Find one operating point, and others from other places."""
    network = variant_network(valve, variant)
    currents = conditions.currents(network, start_currents(network))
    network = driven(network, currents).at_start()
    with trial() as caught:
        rows = network.rows()
    notes = [str(x.message) for x in caught if issubclass(x.category, LooseBodyWarning)]
    held, first = set[str](), dict[str, float]()
    if conditions.lift is not None:
        _require_reached(rows, roles, conditions.lift)
        held, first = {roles.needle}, {roles.needle: conditions.lift}
    places = [first, *({**end, **first} for end in far_ends(rows))]
    places = [place for i, place in enumerate(places) if place not in places[:i]]
    if origin == "far" and len(places) > 1:
        places = [places[1], places[0], *places[2:]]
    point, others, told = searched(rows, places, held)
    notes += told
    notes += _own_notes(point, rows, held)
    notes += [_other_note(rows, roles, point, other) for other in others]
    for name in hysteretic_coils(network):
        notes.append(_loop_note(name, getattr(network.components[name], "start", "")))
    return PointFound(
        point=point, network=network, rows=rows, currents=currents, notes=tuple(notes)
    )


def valve_at(
    valve: Valve,
    tree: CaseTree,
    conditions: Conditions,
    progress: Progress,
    threads: int | None,
) -> Valve:
    """Valve with the changes of a point, built anew where meshes or laws may change."""
    changes = conditions.changes
    if not changes:
        return valve
    case = case_at(ValveCase, tree, tree, changes)
    if any(STROKES.makes_bodies(valve.case, key) for key in changes):
        return build_valve(case, progress, threads=threads)
    return replace(valve, case=case, network=filled_network(case, valve.reduced, valve.laws))


def searched(
    rows: Rows, places: Sequence[Mapping[str, float]], held: set[str]
) -> tuple[OperatingPoint, list[OperatingPoint], list[str]]:
    """Point found from the first place that leads to one, others, and what is told of the first.

    Where none leads to one, stated pressures may be too far from any: ambient ones are tried.
    """
    found: list[OperatingPoint] = []
    told = list[str]()
    first: KlackError | None = None
    for place in places:
        try:
            with trial() as caught:
                point = operating_point(rows, first=place, held=held)
        except (ConvergenceError, InputError) as error:
            first = first or error
            continue
        if not found:
            told = _told_by(caught)
        if all(_differs(rows, point, other) for other in found):
            found.append(point)
    if found:
        return found[0], found[1:], told
    assert first is not None
    try:
        with trial() as caught:
            point = operating_point(without_guesses(rows), first=places[0], held=held)
    except (ConvergenceError, InputError):
        raise first from None
    return point, [], [_UNGUESSED, *_told_by(caught)]


def _told_by(caught: Sequence[WarningMessage]) -> list[str]:
    return [str(item.message) for item in caught if issubclass(item.category, AccuracyWarning)]


def _differs(rows: Rows, one: OperatingPoint, other: OperatingPoint) -> bool:
    travels = _travels(rows)
    for port, here in one.start.displacement.items():
        travel = travels.get(port.partition(".")[0], _TRAVEL)
        if abs(here - other.start.displacement[port]) > _SAME * travel:
            return True
    pressures = zip(one.start.pressure.values(), other.start.pressure.values(), strict=True)
    return any(abs(a - b) > _SAME * max(a, b) for a, b in pressures)


def _travels(rows: Rows) -> dict[str, float]:
    travel, found = Travel.of(rows), dict[str, float]()
    for row in rows.bodies:
        if row.body.rigid_count:
            name = row.component
            way = travel.highest({name: 1.0})[0] - travel.lowest({name: 1.0})[0]
            found[name] = way if np.isfinite(way) and way > 0.0 else _TRAVEL
    return found


def _require_reached(rows: Rows, roles: ValveRoles, lift: float) -> None:
    travel = Travel.of(rows)
    low, high = travel.lowest({roles.needle: 1.0})[0], travel.highest({roles.needle: 1.0})[0]
    slack = _BEYOND * (high - low) if np.isfinite(high - low) else 0.0
    if not low - slack <= lift <= high + slack:
        ends = " to ".join(format_si(x, "m") if np.isfinite(x) else "any" for x in (low, high))
        raise InputError(
            "lift",
            got=format_si(lift, "m"),
            expected=f"{ends}, between the stops of '{roles.needle}'",
            hint="displacements are measured from the drawn position of the needle.",
        )


def _other_note(rows: Rows, roles: ValveRoles, point: OperatingPoint, other: OperatingPoint) -> str:
    port = f"{roles.needle}.{roles.point}"
    travels = _travels(rows)

    def apart(name: str) -> float:
        way = abs(point.start.displacement[name] - other.start.displacement[name])
        return way / travels.get(name.partition(".")[0], _TRAVEL)

    if apart(port) <= _SAME:
        port = max(point.start.displacement, key=apart)
    here, there = (format_si(x.start.displacement[port], "m", 4) for x in (point, other))
    stable = "" if other.stable else ", which is unstable"
    return (
        f"more than one operating point: '{port}' at {here} here and at {there} from another "
        f"start{stable}. The actual point depends on the history of the valve (--from)."
    )


def _loop_note(coil: str, start: str) -> str:
    if start == "remanent":
        return (
            f"'{coil}' has iron with hysteresis and starts at remanence: the point lies on the "
            "falling branch of its loop. When approached from a smaller current, flux and force "
            "are smaller."
        )
    return (
        f"'{coil}' has iron with hysteresis: the point lies on its mean curve. When approached "
        "from a larger current, flux and force are larger, from a smaller current smaller; a "
        "run with such a drive shows by how much."
    )


def _own_notes(point: OperatingPoint, rows: Rows, held: set[str]) -> list[str]:
    notes = list(point.start.notes)
    travels = _travels(rows)
    if point.enclosed:
        names = " and ".join(f"'{name}'" for name in point.enclosed)
        notes.append(
            f"no open path leads from {names} to a known pressure: the 'pressure' stated there, "
            "or ambient pressure, is kept or shared."
        )
    for name, way in point.friction.items():
        if way > _FELT * travels.get(name, _TRAVEL) and name not in held:
            notes.append(
                f"dry friction may hold '{name}' up to {format_si(way, 'm', 3)} away from there; "
                "this is the point without friction."
            )
    if not point.stable:
        notes.append("the point is unstable: a small push drives a body away from it.")
    return notes


def _swept(sweeps: Sequence[Sweep]) -> tuple[SweptQuantity, ...]:
    grids = np.meshgrid(*(sweep.values for sweep in sweeps), indexing="ij") if sweeps else []
    return tuple(
        SweptQuantity(
            name=sweep.name, unit=sweep.unit, values=np.asarray(grid.ravel(order="F"), dtype=float)
        )
        for sweep, grid in zip(sweeps, grids, strict=True)
    )


def _quantities(found: Sequence[Measured | None]) -> tuple[PointQuantity, ...]:
    keys = dict.fromkeys(key for point in found if point is not None for key in point.values)
    return tuple(
        PointQuantity(
            component=component,
            quantity=quantity,
            unit=unit,
            values=_column(
                [None if x is None else x.values.get((component, quantity, unit)) for x in found]
            ),
        )
        for component, quantity, unit in keys
    )


def _column(values: Sequence[float | None]) -> Vector:
    return np.array([np.nan if x is None else x for x in values], dtype=float)


def _told(failures: Sequence[str], doubts: Sequence[str], sweeps: Sequence[Sweep]) -> list[str]:
    if not sweeps:
        return [line for line in doubts[0].splitlines() if line]
    told = []
    missing = [text for text in failures if text]
    if missing:
        told.append(
            f"{len(missing)} of {len(failures)} points were not found; the first of them: "
            + " ".join(missing[0].split())
        )
    doubtful = [text for text in doubts if text]
    if doubtful:
        told.append(
            f"{len(doubtful)} of {len(failures)} points have notes (column 'doubts'); the first: "
            + doubtful[0].splitlines()[0]
        )
    return told
