"""Windings that share a magnet or a capacitor as one row of a network."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from klack.arrays import Vector
from klack.errors import AccuracyWarning, InputError
from klack.magnetics.coupled_step import coupled_step
from klack.magnetics.coupled_table import (
    MAGNET_ROW,
    PER_WINDING,
    WINDING_ROW,
    CoupledMagnet,
    CoupledSystem,
)
from klack.magnetics.flux_step import FAILURES
from klack.magnetics.network_loops import loop_names
from klack.magnetics.output_stage import Capacitor
from klack.magnetics.remanent_start import magnetised_otherwise, remanent_state
from klack.magnetics.steady_coil import steady_fluxes
from klack.network.rows import Book, Channel, ElementRow, Rows

__all__ = ["PlacedMagnet", "coupled_rows"]


_OF_WINDING = (("voltage", "V", 5), ("current", "A", 4), ("driver state", "-", 0))
_PLAIN = ("electric", "ohmic")
_STAGED = ("battery", "ohmic", "switches", "diodes", "clamp")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlacedMagnet:
    """A magnet of a system in its network.

    Parameters
    ----------
    armature, base
        Mechanical ports.
    nodes
        Electric node of each winding.
    remanent
        Whether hysteretic iron starts as saturation left it.
    names_loops
        Whether the flux of every loop is recorded.
    """

    component: str
    magnet: CoupledMagnet
    armature: int
    base: int
    nodes: tuple[int, ...]
    remanent: bool = False
    names_loops: bool = False


def coupled_rows(
    rows: Rows,
    placed: Sequence[PlacedMagnet],
    shared: Mapping[int, tuple[str, Capacitor]] | None = None,
) -> None:
    """Add windings that share magnets or capacitors to a network, as one row.

    ``shared`` has, by electric node of a winding, the name and numbers of its capacitor that is a
    component.
    """
    _tell_remanence(placed)
    system, capacitors = _system(placed, shared or {})
    try:
        parameters = system.numbers()
    except InputError as error:
        raise InputError(
            f"components.{rows.component}",
            got=f"{error.got} ({', '.join(part.component for part in placed)})",
            expected=error.expected,
            hint=error.hint,
        ) from None
    first = system.first_states()

    def at_rest(displacement: Vector) -> Vector:
        fluxes, stops = list[Vector](), list[Vector]()
        for m, part in enumerate(placed):
            row = int(parameters[4]) + MAGNET_ROW * m
            moved = float(displacement[2 * m] - displacement[2 * m + 1])
            gap = float(parameters[row + 1]) + float(parameters[row + 2]) * moved
            found, kept = _resting(part, gap)
            fluxes.append(found)
            stops.append(kept)
        return system.state(parameters, fluxes, stops)

    state = at_rest(np.zeros(2 * len(placed)))
    flows = any(
        np.any(state[k + 1 : k + 1 + part.magnet.circuit.loops.shape[1]])
        for k, part in zip(first, placed, strict=True)
    )
    ports = [port for part in placed for port in (part.armature, part.base)]
    before = "" if len(placed) == 1 else "{}."
    names = [
        before.format(part.component) + name for part in placed for name in ("armature", "base")
    ]
    element = len(rows.elements)
    rows.elements.append(
        ElementRow(
            component=rows.component,
            label="",
            step=coupled_step,
            ports=tuple(ports),
            names=tuple(names),
            parameters=parameters,
            state=state,
            books=_books(placed, capacitors),
            channels=_channels(system, placed, capacitors, first),
            failures=FAILURES,
            at_rest=at_rest if flows else None,
            state_names=_state_names(placed, first),
        )
    )
    w = 0
    for part in placed:
        for node in part.nodes:
            rows.coils[node] = (element, int(parameters[5]) + WINDING_ROW * w + 2)
            w += 1


def _system(
    placed: Sequence[PlacedMagnet], shared: Mapping[int, tuple[str, Capacitor]]
) -> tuple[CoupledSystem, list[tuple[str, str]]]:
    """System, and of each capacitor the component and its name there, perhaps empty."""
    names, capacitors = list[tuple[str, str]](), list[Capacitor]()
    magnets = []
    for part in placed:
        windings = []
        for node, winding in zip(part.nodes, part.magnet.windings, strict=True):
            stage = winding.driver.stage
            if stage is not None:
                name, capacitor = (part.component, winding.name), stage.capacitor
                if capacitor is None:
                    component, capacitor = shared[node]
                    name = (component, "")
                if name not in names:
                    names.append(name)
                    capacitors.append(capacitor)
                winding = replace(winding, capacitor=names.index(name))
            windings.append(winding)
        magnets.append(replace(part.magnet, windings=tuple(windings)))
    return CoupledSystem(magnets=tuple(magnets), capacitors=tuple(capacitors)), names


def _tell_remanence(placed: Sequence[PlacedMagnet]) -> None:
    """Doubt a remanent start that depends on which circuit acted last."""
    for part in placed:
        if not part.remanent:
            continue
        circuit = part.magnet.circuit
        names = [w.circuit for w in part.magnet.windings if w.circuit]
        for name, parts in magnetised_otherwise(circuit, names, gap=part.magnet.gap).items():
            warnings.warn(
                f"components.{part.component}.start: remanent iron starts in the state left by "
                f"the coils at 'terminals'; a strong current of '{name}' would leave "
                f"{', '.join(parts)} in a different state. Try: if '{name}' acts last, put its "
                "coil at 'terminals'; or run two strokes with start: demagnetised, and use the "
                "second.",
                AccuracyWarning,
                stacklevel=4,
            )


def _resting(part: PlacedMagnet, gap: float) -> tuple[Vector, Vector]:
    magnet = part.magnet
    others = dict(magnet.currents)
    main = others.pop("", 0.0)
    if part.remanent:
        return remanent_state(magnet.circuit, current=main, gap=gap, others=others)
    return steady_fluxes(magnet.circuit, current=main, gap=gap, others=others), np.zeros(0)


def _channels(
    system: CoupledSystem,
    placed: Sequence[PlacedMagnet],
    capacitors: Sequence[tuple[str, str]],
    first: Sequence[int],
) -> tuple[Channel, ...]:
    found, w = list[Channel](), 0
    for m, part in enumerate(placed):
        for winding in part.magnet.windings:
            for label, unit, place in _OF_WINDING:
                index = PER_WINDING * w + place
                name = _joined(winding.name, label)
                found.append(Channel(name, unit, index, place == 5, part.component))
            w += 1
        found.append(Channel("flux", "Wb", first[m], True, part.component))
        if part.names_loops:
            found += [
                Channel(f"flux of {name}", "Wb", first[m] + 1 + k, owner=part.component)
                for k, name in enumerate(loop_names(part.magnet.circuit))
            ]
    for c, (owner, name) in enumerate(capacitors):
        index = PER_WINDING * len(system.windings) + c
        found.append(Channel(_joined(name, "capacitor voltage"), "V", index, owner=owner))
    return tuple(found)


def _books(
    placed: Sequence[PlacedMagnet], capacitors: Sequence[tuple[str, str]]
) -> tuple[Book, ...]:
    found = list[Book]()
    for part in placed:
        for winding in part.magnet.windings:
            kinds = _STAGED if winding.driver.stage is not None else _PLAIN
            found += [
                Book(_joined(winding.name, label), "loss" if k else "supply", part.component)
                for k, label in enumerate(kinds)
            ]
    for owner, name in capacitors:
        found += [
            Book(_joined(name, "recharge"), "supply", owner),
            Book(_joined(name, "converter"), "loss", owner),
            Book(_joined(name, "capacitor"), "store", owner),
        ]
    for part in placed:
        found += [Book("eddy", "loss", part.component), Book("magnetic", "store", part.component)]
        if part.magnet.circuit.hysteretic:
            found.append(Book("hysteresis", "loss", part.component))
    return tuple(found)


def _joined(name: str, label: str) -> str:
    return f"{name} {label}" if name else label


def _state_names(
    placed: Sequence[PlacedMagnet], first: Sequence[int]
) -> Mapping[int, tuple[str, str]]:
    before = "" if len(placed) == 1 else "{}."
    return {
        first[m] + 1 + j: (f"{before.format(part.component)}flux of loop {j + 1}", "Wb")
        for m, part in enumerate(placed)
        for j in range(part.magnet.circuit.loops.shape[1])
    }
