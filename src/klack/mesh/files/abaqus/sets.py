"""Node and element sets of keyword files: numbers, ranges, sets of sets."""

from array import array
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.input.problem import one_of
from klack.mesh.files.abaqus.keywords import DataLine, Keyword
from klack.mesh.files.abaqus.names import Names
from klack.mesh.files.abaqus.numbering import Numbering, distinct
from klack.mesh.files.abaqus.numbers import CUT_OFF, integer, integer_list, is_integer

__all__ = ["NamedSets", "read_members"]

LARGEST_MEMBERS = 200_000_000
"""Most members of all node sets, or of all element sets, together."""

_FLAGS = {"GENERATE", "INTERNAL", "UNSORTED"}
_MANY = 50
_FEW = 100_000
_PER_ARRAY = 20  # numbers that would take the memory of an empty array

Integers = NDArray[np.int64]


@dataclass
class NamedSets:
    """Sets of nodes or of elements, by name.

    Parameters
    ----------
    names : Names of int arrays
        Rows of the members.
    size : int
        Members that were added so far.
    """

    names: Names[Integers]
    size: int = 0

    def copy(self) -> "NamedSets":
        """Independent copy of the sets."""
        return NamedSets(self.names.copy(), self.size)

    def members(self, key: str) -> Integers:
        """Rows of all members, ascending."""
        parts = self.names.parts(key)
        if parts:
            parts[:] = [distinct(parts[0] if len(parts) == 1 else np.concatenate(parts))]
        return parts[0] if parts else np.empty(0, dtype=np.int64)

    def resolve(self, place: str, name: str) -> Integers:
        """Members of a set that must be there."""
        return self.members(self.names.require(place, name))

    def add(self, place: str, name: str, rows: Integers) -> None:
        """Add members to a set, which is made if it is new."""
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
        if self.size > LARGEST_MEMBERS:
            raise InputError(
                place,
                got=f"sets of {self.size} members together",
                expected=f"at most {LARGEST_MEMBERS}",
                hint="remove unneeded sets from the file.",
            )


def read_members(
    keyword: Keyword, numbering: Numbering, resolve: Callable[[DataLine, str], Integers]
) -> Integers:
    """Rows of what *NSET or *ELSET lists: numbers, names of sets, or GENERATE ranges.

    Parameters
    ----------
    keyword : Keyword
    numbering : Numbering
    resolve : function of a data line and a text to int array
        Rows of a value that is not a number that is known; raises if there is no such set.
    """
    flags = {name for name, value in keyword.parameters.items() if not value}
    if unknown := flags - _FLAGS:
        raise InputError(
            f"{keyword.place}: *{keyword.name}",
            got=", ".join(sorted(unknown)),
            expected=one_of(sorted(_FLAGS)),
            hint="without GENERATE, a range is read as three members of the set.",
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
    keyword: Keyword, numbering: Numbering, resolve: Callable[[DataLine, str], Integers]
) -> Iterator[Integers]:
    """Rows of numbers, and of what is no known number: every name once."""
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


def _collected(parts: Iterable[Integers]) -> Integers:
    """All parts in one, without letting many of them, or repetitions, pile up."""
    found: list[Integers] = []
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
