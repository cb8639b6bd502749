"""Keyword files of Abaqus and CalculiX, taken apart line by line.

A keyword starts with one ``*``, a comment with two.  Keywords, parameters and set names do not
care about capitals.  A keyword line that ends with a comma goes on in the next line.  Files that
are included must lie in the folder of the main file or below it.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from klack.errors import InputError

__all__ = ["DataLine", "Keyword", "read_keywords"]

LARGEST_BYTES = 2_000_000_000
"""Largest size of all files of one model together."""

_DEEPEST = 10


@dataclass(frozen=True, slots=True)
class DataLine:
    """Fields between commas, stripped, and where they stand (``file:line``)."""

    place: str
    fields: tuple[str, ...]


@dataclass(slots=True)
class Keyword:
    """One keyword with its parameters (names in capitals) and data lines."""

    name: str
    parameters: dict[str, str]
    place: str
    data: list[DataLine] = field(default_factory=list)

    def parameter(self, name: str) -> str:
        """Value of a parameter that must be there."""
        value = self.parameters.get(name, "")
        if not value:
            raise InputError(
                f"{self.place}: *{self.name}",
                got=f"no parameter {name}",
                expected=f"{name}=...",
                hint="write the file again from the preprocessor.",
            )
        return value


def read_keywords(path: Path) -> list[Keyword]:
    """All keywords of a file and of those that it includes, in order."""
    keywords: list[Keyword] = []
    source = _Source(path)
    lines = source.lines(path, ())
    pending = next(lines, None)
    while pending is not None:
        place, text = pending
        pending = next(lines, None)
        if not text.startswith("*"):
            if not keywords:
                raise InputError(
                    place,
                    got=repr(text[:40]),
                    expected="a keyword, which starts with '*'",
                    hint="give an Abaqus or CalculiX input file (.inp).",
                )
            keywords[-1].data.append(DataLine(place, _fields(text)))
            continue
        while text.endswith(",") and pending is not None and not pending[1].startswith("*"):
            text += pending[1]
            pending = next(lines, None)
        keywords.append(_keyword(place, text))
    return keywords


def _fields(text: str) -> tuple[str, ...]:
    parts = [part.strip() for part in text.split(",")]
    while parts and not parts[-1]:
        parts.pop()
    return tuple(parts)


def _keyword(place: str, text: str) -> Keyword:
    name, *rest = (part.strip() for part in text[1:].split(","))
    parameters = {}
    for part in rest:
        key, _, value = part.partition("=")
        if key.strip():
            parameters[key.strip().upper()] = value.strip().strip('"')
    return Keyword(" ".join(name.upper().split()), parameters, place)


class _Source:
    """Lines of the main file and of its includes."""

    def __init__(self, main: Path) -> None:
        self._folder = main.resolve().parent
        self._bytes = 0

    def lines(self, path: Path, above: tuple[Path, ...]) -> Iterator[tuple[str, str]]:
        """Place and text of every line that is neither empty nor a comment."""
        raw = self._read(path)
        for number, line in enumerate(raw.splitlines(), start=1):
            text = line.strip()
            if not text or text.startswith("**"):
                continue
            place = f"{path.name}:{number}"
            included = _included(place, text)
            if included is None:
                yield place, text
                continue
            file, keyword_text = included
            if keyword_text:
                yield place, keyword_text
            yield from self.lines(self._below(place, file, (*above, path)), (*above, path))

    def _read(self, path: Path) -> str:
        if not path.is_file():
            raise InputError(
                str(path),
                got="no such file",
                expected="an Abaqus or CalculiX input file (.inp)",
                hint="check the path; it is relative to where you started the program.",
            )
        self._bytes += path.stat().st_size
        if self._bytes > LARGEST_BYTES:
            raise InputError(
                str(path),
                got=f"{self._bytes / 1e9:.3g} GB with all includes",
                expected=f"at most {LARGEST_BYTES / 1e9:.3g} GB",
                hint="write the mesh only, without results or steps.",
            )
        raw = path.read_bytes()
        if b"\0" in raw[:4096]:
            raise InputError(
                str(path),
                got="a binary file",
                expected="a text file of keywords",
                hint="export the mesh as .inp from the preprocessor.",
            )
        return raw.decode("latin-1")

    def _below(self, place: str, file: str, above: tuple[Path, ...]) -> Path:
        path = (self._folder / file).resolve()
        if not path.is_relative_to(self._folder):
            raise InputError(
                f"{place}: *INCLUDE",
                got=f"the file '{file}'",
                expected="a file in the folder of the main file or below it",
                hint="copy it next to the main file.",
            )
        if len(above) > _DEEPEST or path in [p.resolve() for p in above]:
            raise InputError(
                f"{place}: *INCLUDE",
                got=f"'{file}', which is included from itself or {len(above)} levels deep",
                expected=f"includes without a circle and up to {_DEEPEST} levels deep",
                hint="write the model into one file.",
            )
        return path


def _included(place: str, text: str) -> tuple[str, str] | None:
    """File of an *INCLUDE or of an INPUT parameter, and the keyword line without it."""
    if not text.startswith("*") or "INPUT" not in text.upper():
        return None
    keyword = _keyword(place, text)
    if "INPUT" not in keyword.parameters:
        return None
    file = keyword.parameter("INPUT")
    if keyword.name == "INCLUDE":
        return file, ""
    kept = [p for p in text.split(",") if p.partition("=")[0].strip().upper() != "INPUT"]
    return file, ",".join(kept)
