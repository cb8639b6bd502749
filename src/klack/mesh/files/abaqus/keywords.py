"""Keyword files of Abaqus and CalculiX: keywords and blocks of data lines.

A keyword starts with one ``*``, a comment with two; case does not matter. A keyword line that ends
with a comma continues. Includes must lie in the folder of the main file or below. Text is UTF-8,
else Latin-1.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from klack.errors import InputError, refuse_if
from klack.mesh.files.plausible import LARGEST_BYTES

__all__ = ["DataLine", "Keyword", "Segment", "read_keywords"]

_LONGEST_KEYWORD = 20_000  # bytes
_LONGEST_LINE = 1_000_000
_PIECE = 1_000_000
_DEEPEST = 10
_WITH_FILE = {"INCLUDE", "NODE", "ELEMENT", "NSET", "ELSET", "SURFACE"}
_NOT_BLANK = re.compile(rb"\S")
_PART = re.compile(r'((?:"[^"]*"|[^,])*)(?:,|$)')  # between commas outside quotes


@dataclass(frozen=True, slots=True)
class DataLine:
    """Stripped fields between commas, and their place (``file:line``)."""

    place: str
    fields: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Segment:
    """Consecutive data lines: a slice of a file, and its first line number."""

    file: str
    text: bytes
    start: int
    end: int
    line: int

    def lines(self) -> Iterator[tuple[int, bytes]]:
        """Number and text of non-empty lines."""
        position, number = self.start, self.line
        while position < self.end:
            end = self.text.find(b"\n", position, self.end)
            end = self.end if end < 0 else end
            _require_short(f"{self.file}:{number}", end - position, _LONGEST_LINE)
            line = self.text[position:end].strip()
            if line:
                yield number, line
            position, number = end + 1, number + 1

    def slices(self) -> Iterator[bytes]:
        """Whole lines, some megabytes at a time."""
        position = self.start
        while position < self.end:
            end = self.end
            if end - position > _PIECE:
                end = self.text.find(b"\n", position + _PIECE, self.end) + 1 or self.end
            yield self.text[position:end]
            position = end


@dataclass(slots=True)
class Keyword:
    """Keyword with parameters (names in capitals) and data lines."""

    name: str
    parameters: dict[str, str]
    place: str
    segments: list[Segment] = field(default_factory=list)

    def parameter(self, name: str) -> str:
        """Value of a parameter that must be there."""
        value = self.parameters.get(name, "")
        refuse_if(
            not value,
            f"{self.place}: *{self.name}",
            got=f"no parameter {name}",
            expected=f"{name}=...",
            hint="write the file again from the preprocessor.",
        )
        return value

    def lines(self) -> Iterator[DataLine]:
        """Non-empty data lines."""
        for segment in self.segments:
            for number, line in segment.lines():
                yield DataLine(f"{segment.file}:{number}", _fields(_decoded(line)))

    def pieces(self) -> Iterator[bytes]:
        """Data lines as text, some megabytes at a time."""
        waiting: list[bytes] = []
        size = 0
        for segment in self.segments:
            for text in segment.slices():
                waiting.append(text)
                size += len(text)
                if size >= _PIECE:
                    yield b"\n".join(waiting)
                    waiting, size = [], 0
        if waiting:
            yield b"\n".join(waiting)


def read_keywords(path: Path) -> Iterator[Keyword]:
    """Keywords of a file and its includes, in order."""
    current: Keyword | None = None
    for found in _Source(path).content(path, ()):
        if isinstance(found, Keyword):
            if current is not None:
                yield current
            current = found
        elif current is not None:
            current.segments.append(found)
        else:
            number, line = next(found.lines())
            raise InputError(
                f"{found.file}:{number}",
                got=repr(_decoded(line)[:40]),
                expected="a keyword, which starts with '*'",
                hint="give an Abaqus or CalculiX input file (.inp).",
            )
    if current is not None:
        yield current


def _decoded(raw: bytes) -> str:
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _fields(text: str) -> tuple[str, ...]:
    quoted = '"' in text and len(text) <= _LONGEST_KEYWORD
    found = _PART.findall(text) if quoted else text.split(",")
    parts = [part.strip().strip('"') for part in found]
    while parts and not parts[-1]:
        parts.pop()
    return tuple(parts)


def _keyword(place: str, text: str) -> Keyword:
    name, *rest = (part.strip() for part in _PART.findall(text[1:]))
    parameters = {}
    for part in rest:
        key, _, value = part.partition("=")
        if key.strip():
            parameters[" ".join(key.upper().split())] = value.strip().strip('"')
    return Keyword(" ".join(name.upper().split()), parameters, place)


def _require_short(place: str, size: int, longest: int) -> None:
    refuse_if(
        size > longest,
        place,
        got=f"a line of {size} bytes",
        expected=f"at most {longest} bytes",
        hint="the file is not a keyword file, or its line endings are lost.",
    )


def _next_star(text: bytes, position: int) -> int:
    """Start of the next line with a star; ``position`` is the start of a line."""
    while (star := text.find(b"*", position)) >= 0:
        begin = max(text.rfind(b"\n", position, star) + 1, position)
        if not text[begin:star].strip():
            return begin
        following = text.find(b"\n", star)
        if following < 0:
            break
        position = following + 1
    return len(text)


class _Source:
    """Keywords and data lines of the main file and of its includes."""

    def __init__(self, main: Path) -> None:
        self._folder = main.resolve().parent
        self._bytes = 0

    def content(self, path: Path, above: tuple[Path, ...]) -> Iterator[Keyword | Segment]:
        """Keywords without data lines, and the data lines after them."""
        text = self._read(path)
        position, line = 0, 1
        while position < len(text):
            star = _next_star(text, position)
            if _NOT_BLANK.search(text, position, star):
                yield Segment(path.name, text, position, star, line)
            line += text.count(b"\n", position, star)
            position = star
            if position == len(text):
                return
            place = f"{path.name}:{line}"
            following, line, words = _keyword_line(text, position, line, place)
            position = following
            if not words:
                continue
            keyword = _keyword(place, words)
            file = keyword.parameters.get("INPUT", "") if keyword.name in _WITH_FILE else ""
            if keyword.name == "INCLUDE":
                file = keyword.parameter("INPUT")
            else:
                yield keyword
            if file:
                yield from self.content(self._below(place, file, (*above, path)), (*above, path))

    def _read(self, path: Path) -> bytes:
        raw = self._bytes_of(path)
        refuse_if(
            b"\0" in raw,
            str(path),
            got="a binary file",
            expected="a text file of keywords",
            hint="export the mesh as .inp from the preprocessor.",
        )
        if b"\r" in raw:
            raw = raw.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        return raw.removeprefix(b"\xef\xbb\xbf")

    def _bytes_of(self, path: Path) -> bytes:
        try:
            if not path.is_file():
                raise FileNotFoundError("no such file")
            self._bytes += path.stat().st_size
            if self._bytes <= LARGEST_BYTES:
                return path.read_bytes()
        except OSError as error:
            raise InputError(
                str(path)[:200],
                got=(error.strerror or str(error)).lower(),
                expected="an Abaqus or CalculiX input file (.inp)",
                hint="check the path; the path of an *INCLUDE is relative to the file that "
                "contains it.",
            ) from None
        raise InputError(
            str(path),
            got=f"{self._bytes / 1e9:.3g} GB with all includes",
            expected=f"at most {LARGEST_BYTES / 1e9:.3g} GB",
            hint="write the mesh only, without results or steps.",
        )

    def _below(self, place: str, file: str, above: tuple[Path, ...]) -> Path:
        try:
            path = (self._folder / file.replace("\\", "/")).resolve()
        except (OSError, RuntimeError):  # a name that is too long, links in a circle
            path = Path("/")
        refuse_if(
            not path.is_relative_to(self._folder),
            f"{place}: *INCLUDE",
            got=f"the file '{file[:200]}'",
            expected="a file in the folder of the main file or below it",
            hint="copy it next to the main file.",
        )
        refuse_if(
            len(above) > _DEEPEST or path in [p.resolve() for p in above],
            f"{place}: *INCLUDE",
            got=f"'{file}', which is included from itself or {len(above)} levels deep",
            expected=f"includes without a loop and up to {_DEEPEST} levels deep",
            hint="write the model into one file.",
        )
        return path


def _keyword_line(text: bytes, position: int, line: int, place: str) -> tuple[int, int, str]:
    """Next position and line, and the joined keyword line; "" for a comment."""
    words = b""
    while position < len(text):
        end = text.find(b"\n", position)
        end = len(text) if end < 0 else end
        head = text[position : min(end, position + _LONGEST_KEYWORD)].lstrip()
        comment = head.startswith(b"**")
        if words and head.startswith(b"*") and not comment:
            break
        if not comment:
            _require_short(place, len(words) + end - position, _LONGEST_KEYWORD)
            words += text[position:end].strip()
        position, line = end + 1, line + 1
        if not words.endswith(b","):
            break
    return position, line, _decoded(words)
