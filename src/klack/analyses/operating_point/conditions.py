"""Conditions of operating points, and sweeps."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from math import isfinite
from typing import Literal

import numpy as np

from klack.case.any_case import CaseTree
from klack.case.key_path import Quantity, quantity_at, split_path
from klack.case.points import with_changes
from klack.case.valve import ValveCase
from klack.errors import InputError, refuse_if
from klack.input.problem import CaseProblem, Key, nearest, one_of
from klack.magnetics.constant_drive import Coil, coils_of
from klack.network.network import Network
from klack.units import CURRENT, LENGTH, VOLTAGE, Kind, parse_quantity

__all__ = ["Conditions", "Origin", "Sweep", "asked_sweeps", "point_conditions", "stated_drive"]

Origin = Literal["start", "far"]

_MOST_POINTS = 2000
_OWN: Mapping[str, Kind] = {"lift": LENGTH, "current": CURRENT, "voltage": VOLTAGE}


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """Conditions of one operating point.

    ``current`` [A] and ``voltage`` [V] are by coil, an empty name for all coils; without a ``lift``
    [m] the needle finds its place.  ``changes`` are to the case.
    """

    current: Mapping[str, float] = field(default_factory=dict)
    voltage: Mapping[str, float] = field(default_factory=dict)
    lift: float | None = None
    changes: Mapping[Key, str | float] = field(default_factory=dict)

    def currents(self, network: Network, usual: Mapping[str, float]) -> dict[str, float]:
        """Current of each coil [A]: as stated, else that of the start of a run.

        InputError for an unknown coil, or one with current and voltage.
        """
        coils = coils_of(network)
        for name in (*self.current, *self.voltage):
            if (name and name not in coils) or not coils:
                raise InputError(
                    "--current" if name in self.current else "--voltage",
                    got=f"the coil '{name}'" if name else "a valve without a coil",
                    expected=f"one of: {one_of(coils)}" if coils else "no current and no voltage",
                    hint=nearest(name, coils, "name a coil of the case.")
                    if coils
                    else "leave it out.",
                )
        return {name: self._current(name, coil, usual[name]) for name, coil in coils.items()}

    def _current(self, name: str, coil: Coil, usual: float) -> float:
        given = [of[key] for of in (self.current, self.voltage) for key in (name, "") if key in of]
        refuse_if(
            len(given) > 1,
            f"drive of '{name}'",
            got="more than one statement",
            expected="one current or one voltage for each coil",
            hint=f'write --current "{name}=3 A", or a voltage, but not both.',
        )
        for of, factor in ((self.current, 1.0), (self.voltage, 1.0 / coil.resistance)):
            for key in (name, ""):
                if key in of:
                    return factor * of[key]
        return usual


@dataclass(frozen=True, slots=True)
class Sweep:
    """A quantity and the values that it takes.

    ``name`` is a key of the case, with its ``place``, or one of ``lift``, ``current``, ``voltage``.
    """

    name: str
    unit: str
    values: tuple[float, ...]
    place: Quantity | None

    def applied(self, to: Conditions, value: float) -> Conditions:
        """Conditions with one of the values."""
        if self.place is not None:
            text = self.place.written(value)
            return replace(to, changes={**to.changes, self.place.key: text})
        if self.name == "lift":
            return replace(to, lift=value)
        if self.name == "current":
            return replace(to, current={"": value})
        return replace(to, voltage={"": value})


def stated_drive(texts: Sequence[str], option: str, kind: Kind) -> dict[str, float]:
    """Values by coil from ``"3 A"`` or ``"coil=3 A"``; an empty name means all coils."""
    found: dict[str, float] = {}
    for text in texts:
        name, _, value = text.rpartition("=")
        refuse_if(
            name.strip() in found,
            option,
            got=f"'{text}' after another value for the same coil",
            expected="one value for each coil",
            hint=f'write {option} "coil={kind.example}" once for each.',
        )
        found[name.strip()] = parse_quantity(value.strip(), kind, option)
    return found


def asked_sweeps(
    case: ValveCase, tree: CaseTree, given: Sequence[tuple[str, str, str, int]]
) -> tuple[Sweep, ...]:
    """Check key, ends and number of points of every sweep."""
    if len(given) > 2:
        raise _refused("--sweep", f"{len(given)} sweeps", "one or two", "leave the others out.")
    sweeps = tuple(_sweep(case, tree, *row) for row in given)
    names = [sweep.name for sweep in sweeps]
    if len(set(names)) < len(names):
        raise _refused("--sweep", f"'{names[0]}' twice", "two quantities", "leave one out.")
    if {"current", "voltage"} <= set(names):
        raise _refused(
            "--sweep",
            "current and voltage",
            "only one of them: at rest each follows from the other",
            "sweep only the current.",
        )
    total = int(np.prod([len(sweep.values) for sweep in sweeps], dtype=float))
    if total > _MOST_POINTS:
        raise _refused(
            "--sweep", f"{total} points", f"{_MOST_POINTS} at most", "use fewer values of each."
        )
    return sweeps


def _refused(where: str, got: str, expected: str, hint: str) -> InputError:
    return InputError(where, got=got, expected=expected, hint=hint)


def _sweep(case: ValveCase, tree: CaseTree, name: str, low: str, high: str, steps: int) -> Sweep:
    where = f"--sweep {name}"
    if steps < 2:
        raise _refused(where, f"{steps} values", "2 or more", "both ends count.")
    place: Quantity | None = None
    if name in _OWN:
        kind = _OWN[name]
        ends = [parse_quantity(text, kind, where) for text in (low, high)]
    else:
        try:
            place = quantity_at(case, split_path(name))
            with_changes(tree.data, {place.key: place.written(place.value)})
        except CaseProblem as problem:
            raise InputError(
                where,
                got=problem.got,
                expected=f"{problem.expected}; or lift, current or voltage",
                hint=problem.hint,
            ) from None
        kind = place.kind
        try:
            ends = [place.parse(_plain(text, kind)) for text in (low, high)]
        except InputError as error:
            raise InputError(
                where, got=error.got, expected=error.expected, hint=error.hint
            ) from None
    if not all(map(isfinite, ends)) or ends[0] == ends[1]:
        raise _refused(where, f"from {low} to {high}", "two different ends", "check both.")
    values = tuple(float(x) for x in np.linspace(ends[0], ends[1], steps))
    return Sweep(name, "1" if kind.bare else kind.unit, values, place)


def _plain(text: str, kind: Kind) -> str | float:
    """A pure number as a number."""
    if not kind.bare:
        return text
    try:
        return float(text)
    except ValueError:
        return text


def point_conditions(base: Conditions, sweeps: Sequence[Sweep]) -> list[Conditions]:
    """Conditions of every point; the first sweep runs fastest."""
    found = []
    for row in product(*(sweep.values for sweep in reversed(sweeps))):
        here = base
        for sweep, value in zip(sweeps, reversed(row), strict=True):
            here = sweep.applied(here, value)
        found.append(here)
    return found
