"""Libraries of numbers: each with its source, each entry found by its name."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

from klack.errors import InputError
from klack.input.problem import nearest, one_of

__all__ = ["Constant", "entry_named", "require_entry"]

_Entry = TypeVar("_Entry")


@dataclass(frozen=True, slots=True, kw_only=True)
class Constant:
    """A constant of a fluid or a material with its source.

    Parameters
    ----------
    label
        What it is, e.g. ``"bulk modulus, isentropic, 20 degC"``.
    value : float or tuple of float
        Several for a table over temperature.
    verified
        True when the source itself was read or recomputed; False for numbers quoted from memory
        or by a third party, and for estimates, which deserve a look before a result depends on
        them.
    """

    label: str
    value: float | tuple[float, ...]
    unit: str
    source: str
    verified: bool


def entry_named(name: str, library: Mapping[str, _Entry]) -> _Entry | None:
    """Entry of this name, or None; case, blanks, hyphens and points do not matter.

    >>> entry_named("iso-vg-46", {"ISO VG 46": 1})
    1
    """
    return next((entry for key, entry in library.items() if _plain(key) == _plain(name)), None)


def require_entry(where: str, name: str, library: Mapping[str, _Entry], otherwise: str) -> _Entry:
    """Entry of this name.

    Parameters
    ----------
    library : mapping of str to entry
    otherwise
        What to try where no entry has a similar name.

    Raises
    ------
    InputError
        For an unknown name, with the nearest one.
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
