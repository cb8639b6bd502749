"""Libraries of numbers with sources."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

from klack.errors import InputError
from klack.input.problem import nearest, one_of

__all__ = ["Constant", "entry_named", "require_entry"]

_Entry = TypeVar("_Entry")


@dataclass(frozen=True, slots=True, kw_only=True)
class Constant:
    """Constant with its source.

    Parameters
    ----------
    label
        As ``"bulk modulus, isentropic, 20 degC"``.
    value
        Several for a table over temperature.
    verified
        The source was read or recomputed; False for numbers from memory or third parties and for
        estimates.
    """

    label: str
    value: float | tuple[float, ...]
    unit: str
    source: str
    verified: bool


def entry_named(name: str, library: Mapping[str, _Entry]) -> _Entry | None:
    """Entry, or None; case, blanks, hyphens and points do not matter.

    >>> entry_named("iso-vg-46", {"ISO VG 46": 1})
    1
    """
    return next((entry for key, entry in library.items() if _plain(key) == _plain(name)), None)


def require_entry(where: str, name: str, library: Mapping[str, _Entry], otherwise: str) -> _Entry:
    """Entry of this name.

    ``otherwise`` is what to try where no name is similar.
    """
    found = entry_named(name, library)
    if found is None:
        raise InputError(
            where,
            got=f"'{name}'",
            expected=f"one of: {one_of(library)}",
            hint=nearest(name, library, otherwise),
        )
    return found


def _plain(name: str) -> str:
    return "".join(character for character in name.lower() if character.isalnum())
