"""``klack linearise``: from a case to its linear model."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from time import perf_counter, process_time

import numpy as np
from numpy.typing import NDArray

from klack.analyses.linearisation.loops import (
    controllers_of,
    gas_drives,
    loop_margins,
    pid_loop,
    plain_name,
    return_ratio,
)
from klack.analyses.linearisation.record import (
    Eigenvalue,
    LinearModel,
    PointValue,
    Response,
    SignalName,
    StabilitySweep,
)
from klack.analyses.operating_point.conditions import Conditions, Origin, Sweep
from klack.analyses.operating_point.quantities import measured
from klack.analyses.operating_point.run import PointFound, find_point, valve_at
from klack.analyses.record import case_fields, run_fields
from klack.analyses.stroke.run import variant_network
from klack.assembling.valve import Valve, build_valve
from klack.case.any_case import CaseTree
from klack.case.levels import Variant
from klack.case.placed_errors import tells_place
from klack.case.spatial_consistency import require_axial
from klack.case.valve import ValveCase
from klack.case.valve_roles import find_roles
from klack.errors import InputError, KlackError
from klack.input.problem import nearest, one_of
from klack.machine.cache.result_cache import result_cache
from klack.machine.progress import Progress, silent
from klack.machine.stages import StageClock, collected_warnings, trial
from klack.magnetics.constant_drive import coils_of, driven
from klack.magnetics.driver import Driver
from klack.network.network import Network
from klack.network.rows import Rows
from klack.simulation.linear_network import LinearNetwork, linear_network
from klack.simulation.linear_system import (
    ORDER,
    PIECE,
    LinearSystem,
    Mode,
    Signal,
    modes,
    rational,
    transfer,
)
from klack.simulation.operating_point import compiled_at

__all__ = ["LinearPoint", "linear_point", "run_linearisation", "usual_band"]

Vector = NDArray[np.float64]

_STEP = 20e-9  # [s] of the laws of rows, at most
_BAND = 20e3  # [Hz]
_FEW_STATES = 400  # of lines, in the usual band
_POINTS = 400
_ABOUT = 12  # points about each resonance, to both sides
_LEAST = 1e-3  # [Hz]
_WORDS = {1: "grows", 0: "neutral", -1: "decays"}


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearPoint:
    """An operating point and the linear network about it."""

    found: PointFound
    linear: LinearNetwork


def linear_point(found: PointFound, held: Sequence[str] = ()) -> LinearPoint:
    """Linearise about an operating point; InputError where there is no linear law."""
    network, step = compiled_at(found.rows, found.point)
    drives: dict[str, tuple[str, Rows]] = {}
    for name, coil in coils_of(found.network).items():
        more = {**found.currents, name: found.currents[name] + 1.0 / coil.resistance}
        with trial():
            drives[f"{name}.voltage"] = ("V", driven(found.network, more).at_start().rows())
    for key, (unit, changed) in gas_drives(found.network).items():
        with trial():
            drives[key] = (unit, driven(changed, found.currents).at_start().rows())
    linear = linear_network(network, min(step, _STEP), held=held, drives=drives)
    return LinearPoint(found=found, linear=linear)


def usual_band(system: LinearSystem) -> float:
    """Band [Hz] that few states describe."""
    total = float(np.sum(system.delays))
    if total == 0.0:
        return _BAND
    return min(_BAND, _FEW_STATES * PIECE / (2.0 * np.pi * ORDER * total))


@tells_place
def run_linearisation(
    case: ValveCase,
    *,
    variant: str | None = None,
    base: Conditions | None = None,
    origin: Origin = "start",
    band: float | None = None,
    sources: Sequence[str] = (),
    targets: Sequence[str] = (),
    frequencies: tuple[float, float] | None = None,
    loops: Sequence[str] = (),
    tree: CaseTree | None = None,
    sweep: Sweep | None = None,
    threads: int | None = None,
    progress: Progress = silent,
) -> LinearModel:
    """Linearise a valve about its operating point.

    Parameters
    ----------
    origin
        Where the search begins.
    band [Hz]
        As of :class:`LinearModel`.
    sources, targets
        Inputs and outputs of frequency responses.
    frequencies [Hz]
    loops
        Outputs at which a loop is opened.
    tree
        The case as it was written; for a sweep.
    sweep
        What changes from point to point.

    Raises
    ------
    InputError
        Also for a valve in three dimensions, or a point without a linear law.
    ConvergenceError
        If there is no operating point.
    """
    begin = perf_counter()
    name = case.one_variant(variant)
    require_axial(case, "klack linearise")
    clock = StageClock(progress, result_cache())
    roles = find_roles(case)
    with collected_warnings() as warned:
        valve = build_valve(case, clock, threads=threads)
    clock("operating point", 0.0)
    taken, conditions = process_time(), base or Conditions()
    found = find_point(valve, roles, name, conditions, origin)
    clock("linear laws", 0.0)
    here = linear_point(found, () if conditions.lift is None else (roles.needle,))
    system = here.linear.system
    pairs = _pairs(system, sources, targets)
    own = variant_network(valve, name)
    opened = [_opened(here.linear, loop, own, found.rows) for loop in loops]
    clock("eigenvalues", 0.0)
    limit = usual_band(system) if band is None else band
    model = rational(system, limit)
    found_modes, lost = modes(system, limit)
    clock("frequency response", 0.0)
    axis = _axis(found_modes, limit if len(system.delays) else None, frequencies)
    responses = _responses(system, pairs, axis)
    margins = tuple(loop_margins(word, L, axis[axis < most]) for word, L, most in opened)
    owners = list(dict.fromkeys([*(x.owner for x in system.states), *system.waves]))
    swept = (
        ()
        if sweep is None or tree is None
        else (_stability(valve, tree, name, conditions, origin, sweep, band, clock, threads),)
    )
    values = measured(found.point, found.network, found.rows, found.currents, roles).values
    return LinearModel(
        **case_fields(case),
        **run_fields(begin, clock),
        variant=name,
        drive=dict(found.currents),
        point=tuple(
            PointValue(component=c, quantity=q, unit=u, value=float(x))
            for (c, q, u), x in values.items()
        ),
        band=limit,
        delays=system.delays,
        states=_names(model.states),
        inputs=_names(model.inputs),
        outputs=_names(model.outputs),
        A=model.A,
        B=model.B,
        C=model.C,
        D=model.D,
        eigenvalues=tuple(
            Eigenvalue(
                real=mode.root.real,
                imaginary=mode.root.imag,
                uncertainty=mode.uncertainty,
                verdict=_WORDS[mode.verdict],
            )
            for mode in found_modes
        ),
        owners=tuple(owners),
        shares=np.array(
            [[mode.participation.get(name, 0.0) for name in owners] for mode in found_modes]
        ).reshape(len(found_modes), len(owners)),
        unconfirmed=lost,
        responses=responses,
        loops=margins,
        sweeps=swept,
        cpu_time=process_time() - taken,
        warnings=(*warned, *found.notes, *here.linear.doubts, *_notes(own, lost, limit)),
    )


def _stability(
    valve: Valve,
    tree: CaseTree,
    variant: Variant,
    base: Conditions,
    origin: Origin,
    sweep: Sweep,
    band: float | None,
    clock: StageClock,
    threads: int | None,
) -> StabilitySweep:
    count = len(sweep.values)
    told = np.full((3, count), np.nan)
    unstable, failures = np.full(count, -1, dtype=np.int64), list[str]()
    for i, value in enumerate(sweep.values):
        clock("sweep", i / count)
        conditions = sweep.applied(base, value)
        try:
            here = valve_at(valve, tree, conditions, clock, threads)
            roles = find_roles(here.case)
            found = find_point(here, roles, variant, conditions, origin)
            held = () if conditions.lift is None else (roles.needle,)
            system = linear_point(found, held).linear.system
            every, _ = modes(system, usual_band(system) if band is None else band)
        except KlackError as error:
            failures.append(str(error))
            continue
        failures.append("")
        unstable[i] = sum(mode.verdict > 0 for mode in every)
        tones = [mode for mode in every if mode.frequency > 0.0]
        if tones:
            least = max(tones, key=lambda mode: mode.root.real)
            told[:, i] = least.root.real, least.frequency, least.damping
    return StabilitySweep(
        name=sweep.name,
        unit=sweep.unit,
        values=np.array(sweep.values),
        growth=told[0].copy(),
        frequency=told[1].copy(),
        damping=told[2].copy(),
        unstable=unstable,
        failures=tuple(failures),
    )


def _notes(network: Network, lost: int, band: float) -> list[str]:
    told = [
        f"the controller '{name}' holds its output at the start: the linear model describes the "
        "valve with this loop open (--loop gives the margins of a pid)."
        for name in controllers_of(network)
    ]
    told += [
        f"the driver '{name}' switches repeatedly: in the model the coil has a constant voltage "
        "instead, as between two switchings."
        for name, part in network.components.items()
        if isinstance(part, Driver) and part.program().switching
    ]
    told += [
        f"the capacitor, diodes and switches of the driver '{name}' are not part of the model: "
        "the coil has a constant voltage and only its own resistance."
        for name, part in network.components.items()
        if isinstance(part, Driver) and part.program().stage is not None
    ]
    if lost:
        told.append(
            f"{lost} eigenvalues of the matrices below {band:.4g} Hz do not lead to a root of "
            "the equation with delays: raise --band to see whether they change."
        )
    return told


def _names(signals: Sequence[Signal]) -> tuple[SignalName, ...]:
    return tuple(SignalName(name=x.name, unit=x.unit) for x in signals)


def _place(option: str, signals: Sequence[Signal], name: str, others: Iterable[str] = ()) -> int:
    plain = [plain_name(x.name) for x in signals]
    if plain_name(name) not in plain:
        names = [*(x.name for x in signals), *others]
        raise InputError(
            option,
            got=f"'{name}'",
            expected=f"one of: {one_of(names)}" if names else "a valve with one",
            hint=nearest(name, names, "choose a name from this list."),
        )
    return plain.index(plain_name(name))


def _pairs(
    system: LinearSystem, sources: Sequence[str], targets: Sequence[str]
) -> list[tuple[int, int]]:
    into = [_place("--from", system.inputs, name) for name in sources]
    out = [_place("--to", system.outputs, name) for name in targets]
    if bool(into) != bool(out):
        missing, signals = ("--to", system.outputs) if into else ("--from", system.inputs)
        raise InputError(
            missing,
            got="nothing beside " + ("--from" if into else "--to"),
            expected=f"one of: {one_of([x.name for x in signals])}",
            hint="name both ends of the response.",
        )
    return [(i, o) for i in dict.fromkeys(into) for o in dict.fromkeys(out)]


def _opened(
    linear: LinearNetwork, name: str, network: Network, rows: Rows
) -> tuple[str, Callable[[float], complex], float]:
    """Name of a loop, the open loop, and its highest valid frequency [Hz]."""
    controllers = controllers_of(network)
    if name in controllers:
        return name, *pid_loop(name, network, rows, linear.system)
    signals = [linear.system.outputs[k] for k in linear.adds]
    output = list(linear.adds)[_place("--loop", signals, name, controllers)]
    source, sign = linear.adds[output]
    loop = return_ratio(linear.system, output, source, sign)
    return linear.system.outputs[output].name, loop, np.inf


def _axis(found: Sequence[Mode], limit: float | None, asked: tuple[float, float] | None) -> Vector:
    """Frequencies [Hz], closer about resonances."""
    sizes = [abs(mode.root) / (2.0 * np.pi) for mode in found if mode.verdict != 0]
    tones = [mode for mode in found if mode.frequency > 0.0]
    if asked is not None:
        low, high = asked
    else:
        fast = [abs(mode.root) / (2.0 * np.pi) for mode in tones] or sizes or [1e3]
        low, high = 0.03 * min(sizes or [1e3]), 10.0 * min(max(fast), 1e5)
        if limit is not None:
            high = max(limit, 10.0 * low)
        low = max(low, _LEAST)
    points = [np.geomspace(low, high, _POINTS)]
    for mode in tones:
        centre = abs(mode.root) / (2.0 * np.pi)
        width = max(abs(mode.damping), 1e-9) * centre
        away = width * np.geomspace(0.05, 20.0, _ABOUT)
        points.append(np.concatenate([centre - away, [centre], centre + away]))
    every = np.unique(np.concatenate(points))
    return every[(every >= low) & (every <= high)]


def _responses(
    system: LinearSystem, pairs: Sequence[tuple[int, int]], axis: Vector
) -> tuple[Response, ...]:
    if not pairs:
        return ()
    found = np.array([[G[o, i] for i, o in pairs] for G in transfer(system, axis)])
    named = _names(system.inputs), _names(system.outputs)
    return tuple(
        Response(
            source=named[0][i],
            target=named[1][o],
            frequency=axis,
            real=found[:, k].real.copy(),
            imaginary=found[:, k].imag.copy(),
        )
        for k, (i, o) in enumerate(pairs)
    )
