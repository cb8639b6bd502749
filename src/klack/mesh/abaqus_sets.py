"""Numbers in keyword files: nodes, elements, and the sets made of them."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.mesh.abaqus_keywords import DataLine, Keyword

__all__ = ["NamedSets", "integer", "number", "records"]

_CUT_OFF = "the file may be cut off or edited by hand: write it again from the preprocessor."


def number(line: DataLine, text: str) -> float:
    """Convert a finite number; Fortran's exponent D is accepted."""
    try:
        value = float(text.upper().replace("D", "E"))
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise InputError(line.place, got=repr(text), expected="a finite number", hint=_CUT_OFF)
    return value


def integer(line: DataLine, text: str) -> int:
    """Convert a positive whole number."""
    if not text.isdecimal() or int(text) == 0:
        raise InputError(
            line.place, got=repr(text), expected="a whole number above 0", hint=_CUT_OFF
        )
    return int(text)


def records(
    keyword: Keyword, lengths: tuple[int, int], what: str
) -> Iterator[tuple[DataLine, list[str]]]:
    """Yield records with their first line; a record goes on in the next line until it is full.

    Parameters
    ----------
    keyword : Keyword
    lengths : (least, most)
        Fields per record; one with fewer than ``most`` is only complete if it is one line with
        at least ``least``.
    what : str
        For the error text: what a record holds.
    """
    least, most = lengths
    fields: list[str] = []
    first = None
    for line in keyword.data:
        first = first or line
        fields += line.fields
        if len(fields) > most:
            _wrong_length(first, len(fields), what)
        if len(fields) >= least:
            yield first, fields
            fields, first = [], None
    if first is not None:
        _wrong_length(first, len(fields), what)


def _wrong_length(line: DataLine, came: int, what: str) -> None:
    raise InputError(line.place, got=f"{came} numbers", expected=what, hint=_CUT_OFF)


@dataclass
class NamedSets:
    """Sets of numbers, found by name without regard to capitals.

    Parameters
    ----------
    kind : str
        ``"node"`` or ``"element"``, for error texts.
    """

    kind: str
    _names: dict[str, str] = field(default_factory=dict)
    _parts: dict[str, list[NDArray[np.int64]]] = field(default_factory=dict)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names.values())

    def find(self, name: str) -> str | None:
        """Key of a set; the name of an instance in front (``Part-1-1.tip``) is left away."""
        key = name.strip('"').upper()
        for candidate in (key, key.rpartition(".")[2]):
            if candidate in self._names:
                return candidate
        return None

    def numbers(self, name: str) -> NDArray[np.int64]:
        """Sorted members of a set that is known to exist."""
        return np.unique(np.concatenate(self._parts[self.find(name) or name]))

    def resolve(self, line: DataLine, name: str) -> NDArray[np.int64]:
        """Members of a set, named in a data line."""
        if self.find(name) is None:
            known = ", ".join(list(self)[:12]) or "none"
            raise InputError(
                line.place,
                got=f"{self.kind} set '{name}'",
                expected=f"a number, or a set defined above ({known})",
                hint="check the spelling, or define the set before it is used.",
            )
        return self.numbers(name)

    def add(self, name: str, members: Iterable[int]) -> None:
        """Add members to a set, which is made if it is new."""
        key = name.upper()
        self._names.setdefault(key, name)
        self._parts.setdefault(key, []).append(np.array(list(members), dtype=np.int64))

    def read(self, keyword: Keyword, name: str, exists: Callable[[int], bool]) -> None:
        """Add what *NSET or *ELSET lists: numbers, names of sets, or GENERATE ranges."""
        self.add(name, ())
        if "GENERATE" in keyword.parameters:
            for line in keyword.data:
                self.add(name, (i for i in _range(line) if exists(i)))
            return
        members = []
        for line in keyword.data:
            for text in line.fields:
                if not text.isdecimal():
                    members += self.resolve(line, text).tolist()
                elif exists(int(text)):
                    members.append(int(text))
                else:
                    raise InputError(
                        line.place,
                        got=f"{self.kind} {text}, which the file does not define",
                        expected=f"numbers of {self.kind}s of this file",
                        hint=_CUT_OFF,
                    )
        self.add(name, members)


def _range(line: DataLine) -> range:
    values = [integer(line, text) for text in line.fields]
    if len(values) not in (2, 3) or values[1] < values[0]:
        raise InputError(
            line.place,
            got=", ".join(line.fields),
            expected="first, last, step with last >= first (GENERATE)",
            hint=_CUT_OFF,
        )
    return range(values[0], values[1] + 1, values[2] if len(values) == 3 else 1)
