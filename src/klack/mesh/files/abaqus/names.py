"""Names of sets and surfaces: without capitals, with and without the instance in front."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from klack.errors import InputError

__all__ = ["Names"]

T = TypeVar("T")


@dataclass
class Names(Generic[T]):
    """Named items that a file defines piece by piece.

    Parameters
    ----------
    kind : str
        ``"node set"``, ``"element set"`` or ``"surface"``, for error texts.
    """

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
        """All parts, which the caller may replace by fewer."""
        return self._parts[key]

    def find(self, name: str) -> str | None:
        """Key of a name; a name that only one instance has is known without the instance."""
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
        """Name to show where only one can be: without the instance, if that is unique."""
        plain = self._plain.get(key)
        if plain is None or plain.upper() in self._parts:
            return self._shown[key]
        return plain if len(self._owners[plain.upper()]) == 1 else self._shown[key]

    def public(self, *, single: bool) -> Iterator[tuple[str, str]]:
        """Names to show, with their keys.

        Parameters
        ----------
        single : bool
            True where there is one instance: its names are shown without it, if they are free.
            Otherwise those of instances come with the instance, and without it too if unique.
        """
        for key, shown in self._shown.items():
            short = self.shortest(key)
            if not single:
                yield shown, key
            if single or short != shown:
                yield short, key
