r"""Windings that share magnets and boost capacitors, as flat numbers for the compiled step.

The currents must follow from the fluxes alone.  In directions ``v`` of the loop fluxes without eddy
currents the balance holds at every instant,

.. math:: v^T C^T \Theta = v^T N i, \qquad C^T S C\,v = 0 ,

with a column of ``N`` per winding.  The directions :math:`v_m` with :math:`N^T v_m = e_m` give the
currents, :math:`i_m = v_m^T C^T\Theta`; they exist if each winding has leakage of its own, without
which the currents of an ideal transformer would jump with the voltage.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from klack.arrays import Vector
from klack.errors import InputError, refuse_if, require_positive
from klack.magnetics.circuit import MagneticCircuit
from klack.magnetics.driver import DriveProgram
from klack.magnetics.flux_table import STOPS, circuit_numbers, free_loops, tubes_of
from klack.magnetics.output_stage import START_VOLTAGE, Capacitor

__all__ = [
    "CAPACITOR_ROW",
    "MAGNET_ROW",
    "MOST_WINDINGS",
    "PER_WINDING",
    "WINDING_ROW",
    "CoupledMagnet",
    "CoupledSystem",
    "Winding",
    "independent_ways",
]


MOST_WINDINGS = 8
"""Most windings, and most magnets, in one system."""

MAGNET_ROW, WINDING_ROW, CAPACITOR_ROW = 8, 8, 6
"""Numbers of a magnet, a winding and a capacitor; see :meth:`CoupledSystem.numbers`."""

PER_WINDING = 6
"""States of a winding: drive state, entered, cycle, open, current, voltage."""

_HEAD = 8
_SAFE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Winding:
    """A winding with its driver.

    Parameters
    ----------
    name
        Of its channels and energies; may be empty.
    owner
        Component of its magnet.
    circuit
        That of the branches with its turns.
    resistance [ohm]
        At temperature.
    current [A]
        At the start.
    capacitor
        Number of the boost capacitor of its output stage; by default its own.
    """

    name: str
    owner: str
    circuit: str
    resistance: float
    driver: DriveProgram
    current: float = 0.0
    capacitor: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CoupledMagnet:
    """A magnet and its windings.

    Parameters
    ----------
    gap [m]
        Working gap while both ports are at rest.
    closing
        Whether the gap closes as the armature moves along +z.
    """

    circuit: MagneticCircuit
    gap: float
    closing: bool
    windings: tuple[Winding, ...]

    @property
    def turns(self) -> Vector:
        """Turns of each winding per loop, shape (n_loops, n_windings) [-]."""
        return np.column_stack([self.circuit.turns_of(w.circuit) for w in self.windings])

    @property
    def currents(self) -> dict[str, float]:
        """Current of each circuit at the start [A]."""
        return {w.circuit: w.current for w in self.windings}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CoupledSystem:
    """Magnets, windings and capacitors that are solved together."""

    magnets: tuple[CoupledMagnet, ...]
    capacitors: tuple[Capacitor, ...]

    @property
    def windings(self) -> list[Winding]:
        """All windings, magnet by magnet."""
        return [winding for magnet in self.magnets for winding in magnet.windings]

    @property
    def hysteretic(self) -> list[bool]:
        """Whether each magnet has iron with hysteresis."""
        return [magnet.circuit.hysteretic for magnet in self.magnets]

    def numbers(self) -> Vector:
        """Flat system for :mod:`klack.magnetics.coupled_step`.

        ``[magnets, windings, capacitors, states, rows of magnets, of windings, of capacitors,
        spare]``, then the rows, then what they point to, all offsets from the start.

        A magnet: ``circuit, gap, way of the armature, first state, first winding, windings,
        directions that change no linkage (0: none is needed), spare``; a winding: ``magnet,
        resistance, program, output stage (0: none), capacitor, turns per loop, weights of the
        tubes in its current, direction that changes its linkage alone``; a capacitor:
        :meth:`klack.magnetics.output_stage.Capacitor.numbers`.
        """
        windings = self.windings
        refuse_if(
            len(windings) > MOST_WINDINGS,
            "windings",
            got=f"{len(windings)} windings that share magnets or a capacitor",
            expected=f"at most {MOST_WINDINGS}",
            hint="give some of their drivers a capacitance of their own; coils of one magnet "
            "in series need one circuit only.",
        )
        rows_m = _HEAD
        rows_w = rows_m + MAGNET_ROW * len(self.magnets)
        rows_c = rows_w + WINDING_ROW * len(windings)
        offset = rows_c + CAPACITOR_ROW * len(self.capacitors)
        blocks: list[Vector] = []

        def put(block: Vector) -> float:
            nonlocal offset
            blocks.append(np.asarray(block, dtype=float))
            offset += blocks[-1].size
            return float(offset - blocks[-1].size)

        head_m, head_w = list[float](), list[float]()
        state = PER_WINDING * len(windings) + len(self.capacitors)
        first = 0
        for m, magnet in enumerate(self.magnets):
            numbers = circuit_numbers(magnet.circuit)
            at = put(numbers)
            still, own = independent_ways(
                magnet.circuit, [winding.circuit for winding in magnet.windings]
            )
            settles = _settles(magnet.circuit, np.vstack((still, own)))
            ways = put(np.append(float(still.shape[0]), still.ravel())) if settles else 0.0
            way = -1.0 if magnet.closing else 1.0
            count = len(magnet.windings)
            head_m += [at, magnet.gap, way, float(state), float(first), float(count), ways, 0.0]
            tubes = tubes_of(magnet.circuit)[0]
            for winding, turns, along in zip(magnet.windings, magnet.turns.T, own, strict=True):
                require_positive(f"{winding.name} resistance".strip(), winding.resistance, "ohm")
                stage = winding.driver.stage_numbers()
                head_w += [
                    float(m),
                    winding.resistance,
                    put(winding.driver.numbers()),
                    put(stage) if stage.size else 0.0,
                    float(winding.capacitor or 0),
                    put(turns),
                    put(np.array([tube.row @ along for tube in tubes])),
                    put(along),
                ]
            first += count
            state += _magnet_states(numbers)
        head = [len(self.magnets), len(windings), len(self.capacitors), state + 1]
        head += [rows_m, rows_w, rows_c, 0]
        own_rows = [number for item in self.capacitors for number in item.numbers()]
        return np.concatenate((head, head_m, head_w, own_rows, *blocks))

    def first_states(self) -> list[int]:
        """First state of each magnet: its flux, then the loop fluxes."""
        numbers = self.numbers()
        at = int(numbers[4])
        return [int(numbers[at + MAGNET_ROW * m + 3]) for m in range(len(self.magnets))]

    def state(
        self, parameters: Vector, fluxes: Sequence[Vector], stops: Sequence[Vector]
    ) -> Vector:
        """State at the start: drivers in their first states, coils without current open.

        ``fluxes`` of the loops [Wb] and ``stops`` of hysteretic iron [A] are those of each magnet.
        """
        state = np.zeros(int(parameters[3]))
        for w, winding in enumerate(self.windings):
            state[PER_WINDING * w + 3] = 1.0 if winding.current == 0.0 else 0.0
            state[PER_WINDING * w + 4] = winding.current
        for c in range(len(self.capacitors)):
            row = int(parameters[6]) + CAPACITOR_ROW * c
            state[PER_WINDING * len(self.windings) + c] = parameters[row + START_VOLTAGE]
        for m in range(len(self.magnets)):
            row = int(parameters[4]) + MAGNET_ROW * m
            at, first = int(parameters[row]), int(parameters[row + 3])
            loops, tubes = int(parameters[at]), int(parameters[at + 1])
            state[first + 1 : first + 1 + loops] = fluxes[m]
            kept = first + 1 + 3 * loops + 2 * tubes
            state[kept : kept + stops[m].size] = stops[m]
            last = first + _magnet_states(parameters[at:]) - 1
            state[last] = np.max(np.abs(fluxes[m]), initial=0.0)
        return state


def _magnet_states(numbers: Vector) -> int:
    """States of a magnet: flux, loop fluxes with rates and bends, places, stops, largest flux."""
    return 2 + 3 * int(numbers[0]) + 2 * int(numbers[1]) + int(numbers[STOPS])


def independent_ways(circuit: MagneticCircuit, names: Sequence[str]) -> tuple[Vector, Vector]:
    """Directions of the loop fluxes that no eddy term opposes, shape (k, n_loops).

    First those that change no linkage of the electric circuits ``names``, then those that each
    change that of one of them by 1 Wb.

    Raises
    ------
    InputError
        If windings are not linked with such loops independently.
    """
    null = free_loops(circuit)
    turns = np.column_stack([circuit.turns_of(name) for name in names])
    linked = null.T @ turns
    size = np.linalg.norm(turns, axis=0)
    found = np.linalg.svd(linked / size, compute_uv=False)
    if linked.shape[0] < linked.shape[1] or found[-1] <= _SAFE:
        found_names = ", ".join(f"'{name or 'terminals'}'" for name in names)
        raise InputError(
            "magnetic circuit",
            got=f"the coils of {found_names} without enough leakage paths of their own",
            expected="a leakage path around the coils of each, without an eddy term; otherwise "
            "their currents would jump with the voltage",
            hint="add a leakage in parallel with each coil (an element 'leakage' between its "
            "nodes); windings on top of each other have 1 to 5 % of the main permeance.",
        )
    own = null @ linked @ np.linalg.inv(linked.T @ linked)
    q, _ = np.linalg.qr(np.column_stack((linked, np.eye(linked.shape[0]))))
    still = null @ q[:, linked.shape[1] :]
    return np.asarray(still.T), np.asarray(own.T)


def _settles(circuit: MagneticCircuit, ways: Vector) -> bool:
    """Whether the balance along these directions can be lost in a step."""
    touched = [tube for tube in tubes_of(circuit)[0] if np.any(np.abs(ways @ tube.row) > _SAFE)]
    return any(tube.gap.size or tube.iron.size or tube.remanence for tube in touched)
