"""Node and element sets of keyword files: numbers, ranges, sets of sets."""

from array import array
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np

from klack.arrays import Ints
from klack.errors import InputError, refuse_if
from klack.input.problem import one_of
from klack.mesh.files.abaqus.keywords import DataLine, Keyword
from klack.mesh.files.abaqus.numbers import CUT_OFF, integer, integer_list, is_integer

__all__ = ["NamedSets", "Names", "Numbering", "distinct", "read_members"]


T = TypeVar("T")


@dataclass
class Names(Generic[T]):
    """Named items that a file defines piece by piece; ``kind`` is for errors."""

    kind: str
    _shown: dict[str, str] = field(default_factory=dict)
    _parts: dict[str, list[T]] = field(default_factory=dict)
    _plain: dict[str, str] = field(default_factory=dict)  # of an instance's name, without it
    _owners: dict[str, list[str]] = field(default_factory=dict)  # the other way round

    def copy(self) -> "Names[T]":
        """Independent copy of the names."""
        parts = {key: list(part) for key, part in self._parts.items()}
        return Names(self.kind, dict(self._shown), parts)

    def add(self, name: str, *parts: T) -> str:
        """Add parts to an item by name; return its key."""
        key = name.upper()
        self._shown.setdefault(key, name)
        self._parts.setdefault(key, []).extend(parts)
        return key

    def parts(self, key: str) -> list[T]:
        """Parts, which the caller may merge."""
        return self._parts[key]

    def find(self, name: str) -> str | None:
        """Key of a name, without the instance if only one has it."""
        key = name.upper()
        if key in self._parts:
            return key
        owners = self._owners.get(key, ())
        return owners[0] if len(owners) == 1 else None

    def require(self, place: str, name: str) -> str:
        """Key of a name that must be there."""
        key = self.find(name)
        if key is not None:
            return key
        owners = self._owners.get(name.upper())
        known = [self._shown[k] for k in (owners or list(self._shown))[:12]]
        what = "a surface" if self.kind == "surface" else "a number, or a set"
        raise InputError(
            place,
            got=f"{self.kind} '{name[:80]}'" + (" of several instances" if owners else ""),
            expected=f"{what} defined above ({', '.join(known) or 'none'})",
            hint="check the spelling, or define the set before it is used.",
        )

    def adopt(self, instance: str, part: "Names[T]", convert: Callable[[T], T]) -> None:
        """Take over the names of a part as ``instance.name``."""
        for key, shown in part._shown.items():
            own = self.add(f"{instance}.{shown}", *map(convert, part._parts[key]))
            self._plain[own] = shown
            self._owners.setdefault(key, []).append(own)

    def shortest(self, key: str) -> str:
        """Name without the instance if that is unique."""
        plain = self._plain.get(key)
        if plain is None or plain.upper() in self._parts:
            return self._shown[key]
        return plain if len(self._owners[plain.upper()]) == 1 else self._shown[key]

    def public(self, *, single: bool) -> Iterator[tuple[str, str]]:
        """Names to show, with their keys.

        With a ``single`` instance names are shown without it, if free; else with the instance, and
        without it too if unique.
        """
        for key, shown in self._shown.items():
            short = self.shortest(key)
            if not single:
                yield shown, key
            if single or short != shown:
                yield short, key


@dataclass(frozen=True, slots=True)
class _Run:
    """Ascending numbers with their rows."""

    labels: Ints
    rows: Ints

    def find(self, wanted: Ints) -> Ints:
        """Rows, -1 where there is none."""
        first, last = self.labels[0], self.labels[-1]
        if last - first + 1 == len(self.labels):
            inside = (wanted >= first) & (wanted <= last)
            return np.where(inside, self.rows[np.where(inside, wanted - first, 0)], -1)
        at = np.minimum(np.searchsorted(self.labels, wanted), len(self.labels) - 1)
        return np.where(self.labels[at] == wanted, self.rows[at], -1)

    def within(self, first: int, last: int, step: int) -> Ints:
        """Rows of the numbers first, first + step, ... up to last."""
        low, high = np.searchsorted(self.labels, [first, last + 1])
        if (last - first) // step + 1 < high - low:
            rows = self.find(np.arange(first, last + 1, step))
            return rows[rows >= 0]
        return self.rows[low:high][(self.labels[low:high] - first) % step == 0]


def _sorted_run(labels: Ints, rows: Ints) -> _Run:
    if (labels[1:] > labels[:-1]).all():
        return _Run(labels, rows)
    order = np.argsort(labels, kind="stable")
    return _Run(labels[order], rows[order])


def distinct(values: Ints) -> Ints:
    """Ascending, each once; sorted, which beats hashing where numbers are nearly sorted."""
    if (values[1:] > values[:-1]).all():
        return values
    ordered = np.sort(values, kind="stable")
    return ordered[np.append(True, ordered[1:] != ordered[:-1])]


class Numbering:
    """Numbers of a file, looked up while reading.

    In sorted runs, each at least twice as long as the next: neither many small blocks nor few
    large ones are slow.
    """

    def __init__(self, runs: tuple[_Run, ...] = ()) -> None:
        self._runs = list(runs)

    def __len__(self) -> int:
        return sum(len(run.labels) for run in self._runs)

    def copy(self) -> "Numbering":
        """Independent copy of the numbering."""
        return Numbering(tuple(self._runs))

    def find(self, labels: Ints) -> Ints:
        """Rows of these numbers, -1 for the unknown."""
        rows = np.full(np.shape(labels), -1, dtype=np.int64)
        for run in self._runs:
            rows = np.maximum(rows, run.find(labels))
        return rows

    def within(self, first: int, last: int, step: int) -> Ints:
        """Rows of the known numbers among first, first + step, ... last."""
        found = [run.within(first, last, step) for run in self._runs]
        return np.concatenate(found) if found else np.empty(0, dtype=np.int64)

    def repeated(self, labels: Ints) -> int | None:
        """Smallest number already known, or twice in ``labels``."""
        ordered = labels if (labels[1:] > labels[:-1]).all() else np.sort(labels)
        twice = ordered[1:][ordered[1:] == ordered[:-1]]
        known = ordered[self.find(ordered) >= 0]
        found = np.concatenate([twice, known])
        return int(found.min()) if len(found) else None

    def add(self, labels: Ints, first_row: int) -> None:
        """Take new numbers, rows from ``first_row``."""
        if not len(labels):
            return
        run = _sorted_run(labels, np.arange(first_row, first_row + len(labels)))
        while self._runs and len(self._runs[-1].labels) < 2 * len(run.labels):
            last = self._runs.pop()
            run = _sorted_run(
                np.concatenate([last.labels, run.labels]), np.concatenate([last.rows, run.rows])
            )
        self._runs.append(run)


LARGEST_MEMBERS = 200_000_000
"""Most members of all node sets, or all element sets."""

_FLAGS = {"GENERATE", "INTERNAL", "UNSORTED"}
_MANY = 50
_FEW = 100_000
_PER_ARRAY = 20  # numbers that would take the memory of an empty array


@dataclass
class NamedSets:
    """Sets of nodes or of elements, by name.

    Members are rows; ``size`` counts those added so far.
    """

    names: Names[Ints]
    size: int = 0

    def copy(self) -> "NamedSets":
        """Independent copy of the sets."""
        return NamedSets(self.names.copy(), self.size)

    def members(self, key: str) -> Ints:
        """Rows of all members, ascending."""
        parts = self.names.parts(key)
        if parts:
            parts[:] = [distinct(parts[0] if len(parts) == 1 else np.concatenate(parts))]
        return parts[0] if parts else np.empty(0, dtype=np.int64)

    def resolve(self, place: str, name: str) -> Ints:
        """Members of a set that must be there."""
        return self.members(self.names.require(place, name))

    def add(self, place: str, name: str, rows: Ints) -> None:
        """Add members to a set, perhaps new."""
        self._count(place, len(rows))
        key = self.names.add(name, rows)
        if len(self.names.parts(key)) > _MANY:  # repetitions must not pile up
            self.members(key)

    def adopt(self, place: str, instance: str, part: "NamedSets", first_row: int) -> None:
        """Take over the sets of a part as ``instance.name``."""
        self._count(place, part.size)
        self.names.adopt(instance, part.names, lambda rows: rows + first_row)

    def _count(self, place: str, more: int) -> None:
        self.size += more
        refuse_if(
            self.size > LARGEST_MEMBERS,
            place,
            got=f"sets with a total of {self.size} members",
            expected=f"at most {LARGEST_MEMBERS}",
            hint="remove unneeded sets from the file.",
        )


def read_members(
    keyword: Keyword, numbering: Numbering, resolve: Callable[[DataLine, str], Ints]
) -> Ints:
    """Rows of what *NSET or *ELSET lists: numbers, names of sets, or GENERATE ranges.

    ``resolve`` gives the rows of a text that is no known number.
    """
    flags = {name for name, value in keyword.parameters.items() if not value}
    if unknown := flags - _FLAGS:
        raise InputError(
            f"{keyword.place}: *{keyword.name}",
            got=", ".join(sorted(unknown)),
            expected=one_of(sorted(_FLAGS)),
            hint="without GENERATE a range is read as three members of the set.",
        )
    if "GENERATE" in flags:
        return _collected(
            numbering.within(*_range(line)) for line in keyword.lines() if line.fields
        )
    labels = integer_list(keyword)
    if labels is not None:
        rows = numbering.find(labels)
        if (rows >= 0).all():
            return rows
    return _collected(_mixed_members(keyword, numbering, resolve))


def _mixed_members(
    keyword: Keyword, numbering: Numbering, resolve: Callable[[DataLine, str], Ints]
) -> Iterator[Ints]:
    """Rows of numbers, and of names, each once."""
    labels, names = array("q"), set()
    for line in keyword.lines():
        for text in line.fields:
            if is_integer(text):
                labels.append(int(text))
            elif text not in names:
                names.add(text)
                yield resolve(line, text)
    numbers = distinct(np.array(labels, dtype=np.int64))
    rows = numbering.find(numbers)
    yield rows[rows >= 0]
    unknown = set(numbers[rows < 0].tolist())
    for line in keyword.lines() if unknown else ():
        for text in line.fields:
            if is_integer(text) and int(text) in unknown:
                unknown.remove(int(text))
                yield resolve(line, text)


def _collected(parts: Iterable[Ints]) -> Ints:
    """All parts in one, without piling up many or repeated ones."""
    found: list[Ints] = []
    size, limit = 0, _FEW
    for part in parts:
        found.append(part)
        size += len(part) + _PER_ARRAY
        if size > limit:
            found = [distinct(np.concatenate(found))]
            size, limit = 0, len(found[0]) + _FEW
    return np.concatenate(found) if found else np.empty(0, dtype=np.int64)


def _range(line: DataLine) -> tuple[int, int, int]:
    values = [integer(line, text) for text in line.fields]
    if len(values) not in (2, 3) or values[1] < values[0]:
        raise InputError(
            line.place,
            got=", ".join(line.fields[:8]),
            expected="first, last, step with last >= first (GENERATE)",
            hint=CUT_OFF,
        )
    return values[0], values[1], values[2] if len(values) == 3 else 1
