"""``klack heat``: strokes at temperatures, and heat network between them."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.analyses.heat.heated_stroke import (
    NUMBERS,
    Aspect,
    HeatedStroke,
    aspects_of,
    heated_stroke,
    hot_windings,
    sent_heat,
)
from klack.analyses.heat.record import CauseRow, HeatStudy, WarmColumn
from klack.analyses.record import case_fields, run_fields
from klack.analyses.stroke.run import one_variant
from klack.analyses.unfinished import LogForm, UnfinishedLog, fingerprint
from klack.assembling.valve import Valve, build_valve
from klack.case.levels import Variant
from klack.case.placed_errors import tells_place
from klack.case.spatial_consistency import require_axial
from klack.case.thermal import CaseThermal
from klack.case.valve import ValveCase
from klack.case.valve_roles import ValveRoles, find_roles
from klack.machine.cache.result_cache import result_cache
from klack.machine.progress import Progress, silent
from klack.machine.stages import StageClock, collected_warnings
from klack.thermal.heat_network import HeatNetwork, heat_network
from klack.thermal.slow_warm_up import SlowSettings, SlowWarmUp, WarmPoint, warm_up

__all__ = ["HEAT_LOG", "run_heat"]


HeatLog = UnfinishedLog[str, HeatedStroke]
"""Strokes by their temperatures."""


def heat_mark(case: ValveCase, threads: int | None) -> str:
    """Digest of all that decides the numbers of a stroke."""
    files = (path.read_bytes() for path in case.component_files.values())
    own = (f"{name} {digest}".encode() for name, digest in case.own_components.items())
    run = case.run.model_dump_json().encode()
    return fingerprint(case, (run, str(threads).encode(), *own, *files))


def _data(key: str, stroke: HeatedStroke) -> Mapping[str, Any]:
    return {
        "key": key,
        "losses": dict(stroke.losses),
        "numbers": dict(stroke.numbers),
        "values": {name: list(value) for name, value in stroke.values.items()},
        "doubts": list(stroke.doubts),
    }


def _stroke(data: Mapping[str, Any]) -> tuple[str, HeatedStroke]:
    return str(data["key"]), HeatedStroke(
        losses={str(name): float(value) for name, value in data["losses"].items()},
        numbers={str(name): float(value) for name, value in data["numbers"].items()},
        values={str(name): (float(v), str(unit)) for name, (v, unit) in data["values"].items()},
        doubts=tuple(map(str, data["doubts"])),
    )


HEAT_LOG = LogForm(
    file="heat.unfinished.jsonl",
    format="klack heat 1",
    parts="finished strokes",
    data=_data,
    read=_stroke,
)
"""How finished strokes are kept."""


Vector = NDArray[np.float64]
Temperatures = Mapping[str, float]

REFERENCE = 293.15
"""20 degC [K]: the base that soaked strokes are compared with."""

_ZERO_CELSIUS = 273.15


@dataclass(slots=True)
class _Strokes:
    valve: Valve
    roles: ValveRoles
    variant: Variant
    log: HeatLog
    progress: Progress
    aspects: tuple[Aspect, ...]
    halvings: int
    asked: set[str] = field(default_factory=set)
    cpu_time: float = 0.0
    doubts: dict[str, None] = field(default_factory=dict)

    def at(
        self, temperature: Temperatures, base: Temperatures | None = None, *only: Aspect
    ) -> HeatedStroke:
        """Stroke with all aspects, or ``only`` some, at temperatures; the rest at the base."""
        nodes = {
            aspect: dict(temperature if base is None or aspect in only else base)
            for aspect in self.aspects
        }
        key = json.dumps(nodes, sort_keys=True)
        self.asked.add(key)
        self.progress("strokes", 0.0)
        if key not in self.log.done:
            begin = process_time()
            self.log.add(key, self._stroke(nodes))
            self.cpu_time += process_time() - begin
        found = self.log.done[key]
        self.doubts |= dict.fromkeys(found.doubts)
        return found

    def _stroke(self, nodes: Mapping[Aspect, Temperatures]) -> HeatedStroke:
        return heated_stroke(self.valve, self.roles, self.variant, nodes, self.halvings)


@tells_place
def run_heat(
    case: ValveCase,
    *,
    variant: str | None = None,
    soak: Sequence[float] = (),
    threads: int | None = None,
    folder: Path | None = None,
    progress: Progress = silent,
) -> HeatStudy:
    """Follow the warm-up of a valve, or compute its strokes soaked at temperatures [K].

    Finished strokes are kept in ``folder`` until the result stands.  InputError also for heat that
    has no way out.
    """
    begin = perf_counter()
    name = case.one_variant(variant)
    aspects = aspects_of(case)
    thermal = case.thermal
    assert thermal is not None  # refused by aspects_of
    require_axial(case, "klack heat")
    clock = StageClock(progress, result_cache())
    network = heat_network(case.network.network())
    assert network is not None  # a section thermal names its nodes
    with collected_warnings() as warned, HEAT_LOG.open(folder, heat_mark(case, threads)) as log:
        valve = build_valve(case, clock, threads=threads)
        roles = find_roles(case)
        cold = one_variant(valve, roles, name, clock)  # warns if impacts depend on the steps
        strokes = _Strokes(valve, roles, name, log, clock, aspects, cold.variant.halvings)
        if soak:
            found = _soaked(strokes, network, soak)
        else:
            found = _warmed(strokes, network, thermal)
    last = found.strokes[-1]
    return HeatStudy(
        **case_fields(case),
        **run_fields(begin, clock),
        variant=name,
        period=thermal.period,
        time=found.time,
        temperature=_columns(found.temperature, "K"),
        heat=_columns(found.heat, "W"),
        numbers=tuple(
            WarmColumn(
                name=item,
                unit=unit,
                values=np.array([stroke.numbers[item] for stroke in found.strokes]),
            )
            for item, (unit, _) in NUMBERS.items()
        ),
        values=tuple(
            WarmColumn(
                name=item,
                unit=unit,
                values=np.array([stroke.values[item][0] for stroke in found.strokes]),
            )
            for item, (_, unit) in last.values.items()
        ),
        causes=found.causes,
        end=found.slow.end if found.slow else "soaked",
        gain=found.slow.gain if found.slow else float("nan"),
        supplied=_named(network.names, found.slow.supplied if found.slow else ()),
        stored=_named(network.names, found.slow.stored if found.slow else ()),
        given_off=_named(network.fixed_names, found.slow.given_off if found.slow else ()),
        energy_residual=found.slow.residual if found.slow else 0.0,
        unsent=_unsent(thermal, last.losses),
        strokes=len(strokes.asked),
        repeats=found.slow.repeats if found.slow else 0,
        cpu_time=strokes.cpu_time,
        warnings=(*warned, *strokes.doubts, *found.doubts),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _Found:
    time: Vector
    temperature: Mapping[str, Vector]
    heat: Mapping[str, Vector]
    strokes: Sequence[HeatedStroke]
    causes: tuple[CauseRow, ...]
    slow: SlowWarmUp | None = None
    doubts: tuple[str, ...] = ()


def _soaked(strokes: _Strokes, network: HeatNetwork, soak: Sequence[float]) -> _Found:
    names = (*network.node_of, *network.fixed_names)
    base = dict.fromkeys(names, REFERENCE)
    soaked = {_celsius(T): T for T in soak}  # each once
    states = {name: dict.fromkeys(names, T) for name, T in soaked.items()}
    whole = [strokes.at(state) for state in states.values()]
    return _Found(
        time=np.zeros(len(soaked)),
        temperature={"valve": np.array(list(soaked.values()))},
        heat={},
        strokes=whole,
        causes=_causes(strokes, _celsius(REFERENCE), base, states),
        doubts=(*hot_windings(strokes.valve.case, dict.fromkeys(names, max(soak))), *_lost(whole)),
    )


def _warmed(strokes: _Strokes, network: HeatNetwork, thermal: CaseThermal) -> _Found:

    def mean_heat(temperature: Vector) -> Vector:
        sent = sent_heat(thermal, strokes.at(_nodes(network, temperature)).losses)
        flow = np.zeros(network.count)
        for node, heat in sent.items():
            if node in network.node_of:
                flow[network.node_of[node]] += heat / thermal.period
        return flow

    settings = SlowSettings(
        tolerance=thermal.tolerance, spacing=thermal.spacing, duration=thermal.duration
    )
    slow = warm_up(network, mean_heat, settings)
    points = slow.points
    computed = [strokes.at(_nodes(network, point.stroke_temperature)) for point in points]
    start, end = (_nodes(network, point.stroke_temperature) for point in (points[0], points[-1]))
    state = "steady state" if slow.end == "steady" else f"after {points[-1].time:.4g} s"
    return _Found(
        time=np.array([point.time for point in points]),
        temperature=_named_columns(network, points, "temperature"),
        heat=_named_columns(network, points, "heat"),
        strokes=computed,
        causes=_causes(strokes, "start", start, {state: end}),
        slow=slow,
        doubts=(
            *hot_windings(strokes.valve.case, _highest(network, points)),
            *_ripple(network, thermal, points),
            *_lost(computed),
        ),
    )


def _causes(
    strokes: _Strokes, named: str, base: Temperatures, states: Mapping[str, Temperatures]
) -> tuple[CauseRow, ...]:
    """Every aspect alone at the temperatures of each state."""
    rows = [CauseRow(state=named, cause="base", numbers=dict(strokes.at(base).numbers))]
    for name, state in states.items():
        for aspect in strokes.aspects:
            stroke = strokes.at(state, base, aspect)
            rows.append(CauseRow(state=name, cause=aspect, numbers=dict(stroke.numbers)))
        rows.append(CauseRow(state=name, cause="all", numbers=dict(strokes.at(state).numbers)))
    return tuple(rows)


def _nodes(network: HeatNetwork, temperature: Vector) -> dict[str, float]:
    """Temperature of every named node [K]."""
    found = {name: float(temperature[i]) for name, i in network.node_of.items()}
    return found | dict(zip(network.fixed_names, network.fixed.tolist(), strict=True))


def _highest(network: HeatNetwork, points: Sequence[WarmPoint]) -> dict[str, float]:
    """Highest temperature of every named node [K]."""
    found: dict[str, float] = {}
    for point in points:
        for at in (point.temperature, point.stroke_temperature):
            for name, T in _nodes(network, at).items():
                found[name] = max(T, found.get(name, T))
    return found


def _named_columns(
    network: HeatNetwork, points: Sequence[WarmPoint], what: str
) -> dict[str, Vector]:
    return {
        name: np.array([getattr(point, what)[i] for point in points])
        for i, name in enumerate(network.names)
    }


def _columns(found: Mapping[str, Vector], unit: str) -> tuple[WarmColumn, ...]:
    return tuple(WarmColumn(name=name, unit=unit, values=v) for name, v in found.items())


def _named(names: Sequence[str], values: Sequence[float] | Vector) -> dict[str, float]:
    return {name: float(value) for name, value in zip(names, values, strict=False)}


def _unsent(thermal: CaseThermal, losses: Mapping[str, float]) -> dict[str, float]:
    """Mean power [W] of what warms no node."""
    left = dict(losses)
    for sent in thermal.heat:
        for name, loss in losses.items():
            if name == sent.loss or name.startswith(f"{sent.loss} "):
                left[name] -= sent.share * loss
    total = sum(abs(x) for x in losses.values())
    return {name: x / thermal.period for name, x in left.items() if abs(x) > 1e-9 * total}


def _ripple(
    network: HeatNetwork, thermal: CaseThermal, points: Sequence[WarmPoint]
) -> tuple[str, ...]:
    """Nodes that one stroke warms by more than the tolerance: the mean is not enough."""
    found = []
    most = np.max([np.abs(point.heat) for point in points], axis=0) * thermal.period
    for i, name in enumerate(network.names):
        if network.capacity[i] > 0.0 and most[i] > thermal.tolerance * network.capacity[i]:
            found.append(
                f"one stroke warms '{name}' by {most[i] / network.capacity[i]:.3g} K: within a "
                "period its temperature oscillates by about as much about the mean that is "
                "shown."
            )
    return tuple(found)


def _lost(strokes: Sequence[HeatedStroke]) -> tuple[str, ...]:
    """Delays that only some strokes have: in others the valve does not open or close."""
    found = []
    for name in ("opening delay", "closing delay"):
        missing = sum(not isfinite(stroke.numbers[name]) for stroke in strokes)
        if 0 < missing < len(strokes):
            way = "open to 90 % of its lift" if name == "opening delay" else "touch its seat"
            found.append(
                f"{missing} of {len(strokes)} strokes have no {name}: in these the valve does "
                f"not {way} within the stroke."
            )
    return tuple(found)


def _celsius(temperature: float) -> str:
    return f"{temperature - _ZERO_CELSIUS:.6g} °C"
