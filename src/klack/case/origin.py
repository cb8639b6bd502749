"""Where sections of an expanded case are written."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

from klack.case.case_text import Lines
from klack.input.problem import Key, key_text

__all__ = ["ExpandedCase", "Filled", "Origin"]

_RANGES = ("study", "calibration")


@dataclass(frozen=True, slots=True)
class Origin:
    """Where a section is written.

    Parameters
    ----------
    key
        In that file.
    copy
        Included part; empty for the case itself.
    """

    path: Path
    lines: Lines
    key: Key = ()
    copy: str = ""

    def where(self, rest: Key = (), *, on_key: bool = False) -> str:
        """File, line and key of something in this section."""
        key = (*self.key, *rest)
        line = self.lines.find(key, on_key=on_key)
        name = f": {key_text(key)}" if key else ""
        return f"{self.path}:{line}{name}" + (f" (of '{self.copy}')" if self.copy else "")

    def below(self, *rest: str | int) -> Self:
        """Origin of a section inside this one."""
        return replace(self, key=(*self.key, *rest))


@dataclass(frozen=True, slots=True)
class Filled:
    """What a file has in place of a value: an expression.

    Parameters
    ----------
    sources
        Parameters of the case, and arguments of its includes, behind the value.
    """

    text: str
    sources: frozenset[Key]


@dataclass(frozen=True, slots=True)
class ExpandedCase:
    """Plain data of a case without expressions and parts.

    Two of them never differ: checked cases with the same sections and text are equal, though one
    was checked from parts made before.

    Parameters
    ----------
    origins
        Of the case (empty key), and of all that comes from parts.
    """

    data: Any = field(compare=False)
    origins: Mapping[Key, Origin] = field(compare=False)
    expressions: Mapping[Key, Filled] = field(default_factory=dict, compare=False)

    @classmethod
    def plain(cls, data: Any, lines: Lines, path: Path) -> Self:
        """Data of a file as they are."""
        return cls(data, {(): Origin(path, lines)})

    def origin(self, key: Key) -> Origin:
        """Where a place is written."""
        length = next(n for n in range(len(key), -1, -1) if key[:n] in self.origins)
        return self.origins[key[:length]].below(*key[length:])

    def behind(self, key: Key) -> tuple[Key, ...]:
        """Keys (parameters, arguments) behind the value of a key; else itself.

        Ranges of a study and bounds of a calibration decide nothing of what is computed.
        """
        is_argument = key[:1] == ("include",) and key[2:3] == ("with",)
        if key[:1] != ("parameters",) and not is_argument:
            return (key,)
        return tuple(
            place
            for place, item in self.expressions.items()
            if key in item.sources and place[0] not in _RANGES
        )

    def unused_parameters(self) -> tuple[str, ...]:
        """Parameters of the case behind no value and no range."""
        used = {key for item in self.expressions.values() for key in item.sources}
        names = self.data.get("parameters") or {}
        return tuple(name for name in names if ("parameters", name) not in used)
