"""Cards of a Nastran file: small, large and free fields, continuations, includes.

A line has a name and eight small data fields (8 columns each, or between commas) or four large
ones (16 columns; the name or continuation mark has a ``*``). It continues in the next line if that
has no name, but blanks or a mark that starts with ``+`` or ``*``. ``$`` starts a comment.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, refuse_if
from klack.mesh.files.plausible import LARGEST_BYTES, read_bytes
from klack.mesh.files.text_columns import TextLines

__all__ = ["BulkData", "Card", "read_bulk"]


_KIND = "a Nastran bulk data file"
_DEEPEST = 10
_INCLUDE = re.compile(rb"^[ \t]*INCLUDE[ \t]+['\"]?([^'\"\r\n$]+)", re.IGNORECASE | re.MULTILINE)


def text_with_includes(path: Path) -> tuple[bytes, tuple[tuple[int, str, int], ...]]:
    """Text of the file with its includes, and the origin of its lines.

    An origin (line, file name, its line there) begins each run; lines of the text count from 0, of
    a file from 1. Includes outside the folder, or twice, are rejected.
    """
    folder = path.resolve().parent
    parts: list[bytes] = []
    pieces: list[tuple[int, str, int]] = []
    size = lines = 0
    seen = {path.resolve()}

    def add(data: bytes, file: str, number: int) -> None:
        nonlocal lines
        if data and not data.endswith(b"\n"):
            data += b"\n"
        if data:
            parts.append(data)
            pieces.append((lines, file, number))
            lines += data.count(b"\n")

    def read(file: Path, above: tuple[Path, ...]) -> None:
        nonlocal size
        data = read_bytes(file, _KIND)
        size += len(data)
        _require_text(file, data, size)
        done = number = 0
        for match in _INCLUDE.finditer(data):
            add(data[done : match.start()], file.name, number + 1)
            number += data.count(b"\n", done, match.start())
            place = f"{file.name}:{number + 1}"
            name = match[1].decode("utf-8", "replace").strip().replace("\\", "/")
            included = _below(place, folder, name, len(above), seen)
            seen.add(included)
            read(included, (*above, file))
            done = data.find(b"\n", match.end())
            done = len(data) if done < 0 else done + 1
            number += 1
        add(data[done:], file.name, number + 1)

    read(path, ())
    return b"".join(parts), tuple(pieces) or ((0, path.name, 1),)


def _require_text(file: Path, data: bytes, size: int) -> None:
    refuse_if(
        b"\0" in data[:4096],
        str(file),
        got="a binary file",
        expected=_KIND,
        hint="export the mesh as bulk data (.bdf) from the preprocessor.",
    )
    refuse_if(
        size > LARGEST_BYTES,
        str(file),
        got=f"{size / 1e9:.3g} GB with all includes",
        expected=f"at most {LARGEST_BYTES / 1e9:.3g} GB",
        hint="write the mesh only, without results or steps.",
    )


def _below(place: str, folder: Path, name: str, depth: int, seen: set[Path]) -> Path:
    path = (folder / name).resolve()
    refuse_if(
        not path.is_relative_to(folder),
        f"{place}: INCLUDE",
        got=f"the file '{name}'",
        expected="a file in the folder of the main file or below it",
        hint="copy it next to the main file.",
    )
    refuse_if(
        depth > _DEEPEST or path in seen,
        f"{place}: INCLUDE",
        got=f"'{name}' for the second time, or {depth} levels deep",
        expected=f"every file included once, and up to {_DEEPEST} levels deep",
        hint="write the model into one file.",
    )
    return path


_WIDEST = 32  # columns of a free field
_CHUNK = 50_000
_MESH_CARDS = (b"GRID", b"GRID*", b"CHEXA", b"CHEXA*", b"CTETRA", b"CTETRA*", b"CPENTA", b"CPENTA*")


@dataclass(frozen=True, slots=True)
class Card:
    """One card; fields stripped, without blanks at the end."""

    place: str
    name: str
    fields: list[str]

    def field(self, number: int) -> str:
        """Data field, from 1 behind the name, or ""."""
        return self.fields[number - 1] if number <= len(self.fields) else ""

    def integer(self, number: int, what: str) -> int:
        """Whole number in a field."""
        text = self.field(number)
        if not re.fullmatch(r"[+-]?\d{1,18}", text):
            self.refuse(f"'{text}' as {what}", "a whole number")
        return int(text)

    def real(self, number: int, what: str) -> float:
        """Real number in a field."""
        text = re.sub(r"(?<=[\d.])([+-])", r"E\1", self.field(number).upper().replace("D", "E"))
        if not re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)(E[+-]?\d{1,3})?", text):
            self.refuse(f"'{self.field(number)}' as {what}", "a real number")
        return float(text)

    def refuse(self, got: str, expected: str) -> None:
        """Reject the card."""
        raise InputError(
            f"{self.place}: {self.name}",
            got=got,
            expected=expected,
            hint="the file may be truncated: write it again from the preprocessor.",
        )


@dataclass(frozen=True)
class BulkData:
    """Lines of a Nastran file and the cards that they form.

    Parameters
    ----------
    lines
        With includes; ends cut at ``$``.
    rows (n_cards,)
        First line of each card.
    counts (n_cards,)
        Its lines, counted in ``order``.
    order
        Lines of the bulk data without comments and empty ones.
    position (n_cards,)
        Of the first line in ``order``.
    words
        First field of every line in ``order``, in capitals.
    names (n_cards,)
        In capitals, without ``*``.
    head
        Lines before BEGIN BULK.
    pieces
        As of :func:`text_with_includes`.
    """

    lines: TextLines
    rows: NDArray[np.int64]
    counts: NDArray[np.int64]
    order: NDArray[np.int64]
    position: NDArray[np.int64]
    words: NDArray[np.bytes_]
    names: NDArray[np.bytes_]
    head: tuple[str, ...]
    comments: tuple[str, ...]
    pieces: tuple[tuple[int, str, int], ...]

    def place(self, row: int) -> str:
        """File and line of a line."""
        first, file, number = [piece for piece in self.pieces if piece[0] <= row][-1]
        return f"{file}:{row - first + number}"

    @cached_property
    def _by_name(self) -> dict[str, NDArray[np.int64]]:
        order = np.argsort(self.names, kind="stable")
        ends = np.flatnonzero(np.append(self.names[order][1:] != self.names[order][:-1], True))
        starts = np.concatenate([[0], ends[:-1] + 1]) if len(ends) else ends
        return (
            {
                self.names[order[a]].decode("latin-1"): order[a : b + 1]
                for a, b in zip(starts.tolist(), ends.tolist(), strict=True)
            }
            if len(self.names)
            else {}
        )

    @property
    def known(self) -> tuple[str, ...]:
        """Names of cards that the file has."""
        return tuple(self._by_name)

    def numbers_of(self, name: str) -> NDArray[np.int64]:
        """Cards of a name, in the order of the file."""
        return self._by_name.get(name, np.empty(0, dtype=np.int64))

    def cards(self, name: str) -> Iterator[Card]:
        """Cards of one name as text: for few cards."""
        for number in self.numbers_of(name).tolist():
            first = self.position[number]
            fields: list[str] = []
            for row in self.order[first : first + self.counts[number]].tolist():
                fields += _fields(self.lines.line(row), self.place(row))
            while fields and not fields[-1]:
                fields.pop()
            yield Card(self.place(int(self.rows[number])), name, fields)

    def tables(self, name: str, most: int) -> Iterator[tuple[NDArray[np.int64], NDArray[np.uint8]]]:
        """First lines (n,) and data fields (n, most, width) of all cards of one name, many at once.

        Blanks fill up to ``most`` fields.
        """
        numbers = self.numbers_of(name)
        for begin in range(0, len(numbers), _CHUNK):
            part = numbers[begin : begin + _CHUNK]
            for same in self._of_same_form(part):
                yield self.rows[same], self._cells(same, most)

    def _of_same_form(self, cards: NDArray[np.int64]) -> Iterator[NDArray[np.int64]]:
        """Cards with equal numbers of lines and kinds of fields."""
        counts = np.minimum(self.counts[cards], 8)
        key = counts.copy()
        for line in range(int(counts.max(initial=0))):
            has = line < counts
            rows = self.order[np.where(has, self.position[cards] + line, 0)]
            key = key * 4 + np.where(has, self._kinds[rows], 0)
        for value in np.unique(key):
            yield cards[key == value]

    @cached_property
    def _kinds(self) -> NDArray[np.int8]:
        """By line: 0 small fields, 1 large ones; 2 and 3 the same between commas or tabs."""
        lines = self.lines
        kinds = np.zeros(len(lines), dtype=np.int8)
        kinds[self.order[np.char.find(self.words, b"*") >= 0]] = 1
        for mark in b",\t":
            at = np.flatnonzero(lines.text == mark)
            row = np.searchsorted(lines.start, at, side="right") - 1
            row = np.unique(row[at < lines.end[row]])
            kinds[row[kinds[row] < 2]] += 2
        return kinds

    def _cells(self, cards: NDArray[np.int64], most: int) -> NDArray[np.uint8]:
        parts: list[NDArray[np.uint8]] = []
        filled = 0
        for line in range(int(self.counts[cards[0]])):
            if filled >= most:
                break
            rows = self.order[self.position[cards] + line]
            kind = self._kinds[rows[0]]
            if kind > 1:
                parts.append(self._free(rows))
            else:
                parts.append(self.lines.cells(rows, 8, (8, 16)[kind], (8, 4)[kind]))
            filled += parts[-1].shape[1]
        width = max(part.shape[2] for part in parts)
        out = np.full((len(cards), max(filled, most), width), ord(" "), dtype=np.uint8)
        filled = 0
        for part in parts:
            out[:, filled : filled + part.shape[1], : part.shape[2]] = part
            filled += part.shape[1]
        return out[:, :most]

    def _free(self, rows: NDArray[np.int64]) -> NDArray[np.uint8]:
        """Fields between commas; four after a ``*``."""
        words = [_fields(self.lines.line(row), self.place(row)) for row in rows.tolist()]
        count = len(words[0])
        longest = max((len(word) for fields in words for word in fields), default=1)
        if longest > _WIDEST:
            where = next(i for i, f in enumerate(words) if any(len(w) > _WIDEST for w in f))
            raise InputError(
                self.place(int(rows[where])),
                got=f"a field of {longest} characters",
                expected=f"at most {_WIDEST}",
                hint="the file may be damaged: write it again from the preprocessor.",
            )
        raw = [[word.encode("latin-1") for word in fields] for fields in words]
        table = np.array(raw, dtype=f"S{max(longest, 1)}")
        cells = table.view(np.uint8).reshape(len(words), count, -1)
        return np.where(cells == 0, np.uint8(ord(" ")), cells)


def _fields(text: str, place: str) -> list[str]:
    """Stripped data fields of a line: eight, or four large ones."""
    if "," in text:
        head, *words = [word.strip() for word in text.split(",")]
        count = 4 if "*" in head else 8
        refuse_if(
            len([word for word in words[count + 1 :] if word]),
            place,
            got=f"{len(words)} fields between commas",
            expected=f"at most {count} and the mark of a continuation",
            hint="put the further fields into a continuation line.",
        )
        return (words + [""] * count)[:count]
    text = text.expandtabs(8)
    count, width = (4, 16) if "*" in text[:8] else (8, 8)
    return [text[8 + i * width : 8 + (i + 1) * width].strip() for i in range(count)]


def read_bulk(path: Path) -> BulkData:
    """Read a file and its includes, and find the cards.

    Rejects a file without ENDDATA and continuations that do not follow their card.
    """
    data, pieces = text_with_includes(path)
    lines = TextLines.of(data, path.name)
    lines, comment_rows = _without_comments(lines)
    comments = tuple(
        lines.text[lines.start[row] : lines.start[row] + 200]
        .tobytes()
        .partition(b"\n")[0]
        .decode("utf-8", "replace")
        .rstrip("\r")
        for row in comment_rows.tolist()
    )
    filled = _filled(lines)
    head, body = _split(path, lines, filled)
    first_cells = lines.cells(body, 0, 8)[:, 0]
    names = _names(first_cells)
    is_card = (names != b"") & ~np.char.startswith(names, b"+") & ~np.char.startswith(names, b"*")
    position = np.flatnonzero(is_card)
    if len(body) and (not len(position) or position[0] != 0):
        raise InputError(
            f"{path.name}:{int(body[0]) + 1}",
            got=repr(lines.line(int(body[0]))[:40]),
            expected="a card of bulk data, such as GRID",
            hint="give a Nastran bulk data file (.bdf, .dat, .nas).",
        )
    _require_marks_in_order(path, lines, body, np.flatnonzero(~is_card), names)
    counts = np.diff(np.append(position, len(body)))
    return BulkData(
        lines=lines,
        rows=body[position],
        counts=counts,
        order=body,
        position=position,
        words=names,
        names=np.char.rstrip(names[position], b"*"),
        head=head,
        comments=comments,
        pieces=pieces,
    )


def _require_marks_in_order(
    path: Path,
    lines: TextLines,
    body: NDArray[np.int64],
    continued: NDArray[np.int64],
    names: NDArray[np.bytes_],
) -> None:
    """The mark at the end of a line must start the next one."""
    for begin in range(0, len(continued), _CHUNK):
        part = continued[begin : begin + _CHUNK]
        mark = np.char.lstrip(names[part], b"+*")
        part = part[mark != b""]
        if not len(part):
            continue
        before = lines.cells(body[part - 1], 0, 80)[:, 0]
        fixed = ~((before == ord(",")) | (before == ord("\t"))).any(axis=1)
        left = np.char.lstrip(_names(np.ascontiguousarray(before[:, 72:])), b"+*")
        wrong = fixed & (left != b"") & (left != np.char.lstrip(names[part], b"+*"))
        if wrong.any():
            row = int(body[part[wrong][0]])
            raise InputError(
                f"{path.name}:{row + 1}",
                got=f"a continuation marked {lines.line(row)[:8]!r}",
                expected="the mark at the end of the line before",
                hint="write the file again with every continuation after its card.",
            )


def _names(cells: NDArray[np.uint8]) -> NDArray[np.bytes_]:
    """Word in the first field, in capitals."""
    small = (cells >= ord("a")) & (cells <= ord("z"))
    cells = cells - np.uint8(32) * small.astype(np.uint8)
    stop = np.zeros(len(cells), dtype=bool)
    for column in cells.T:
        stop |= (column == ord(",")) | (column == ord("\t"))
        column[stop] = ord(" ")
    words = np.ascontiguousarray(cells).view("S8").ravel()
    return np.char.strip(words)


def _without_comments(lines: TextLines) -> tuple[TextLines, NDArray[np.int64]]:
    """Cut lines at ``$``, and mark comment lines."""
    at = np.flatnonzero(lines.text == ord("$"))
    row = np.searchsorted(lines.start, at, side="right") - 1
    end = lines.end.copy()
    np.minimum.at(end, row, at)
    comment = np.unique(row[at == lines.start[row]])
    return TextLines(lines.text, lines.start, end, lines.file), comment


def _filled(lines: TextLines) -> NDArray[np.int64]:
    """Lines with more than blanks in their first 80 columns."""
    some = np.zeros(len(lines), dtype=bool)
    for begin in range(0, len(lines), _CHUNK):
        rows = np.arange(begin, min(begin + _CHUNK, len(lines)))
        rows = rows[lines.end[rows] > lines.start[rows]]
        head = lines.cells(rows, 0, 8)[:, 0]
        here = ((head != ord(" ")) & (head != ord("\t"))).any(axis=1)
        some[rows[here]] = True
        rest = lines.cells(rows[~here], 8, 72)[:, 0]
        some[rows[~here]] = ((rest != ord(" ")) & (rest != ord("\t"))).any(axis=1)
    return np.flatnonzero(some)


def _split(
    path: Path, lines: TextLines, filled: NDArray[np.int64]
) -> tuple[tuple[str, ...], NDArray[np.int64]]:
    """Lines before BEGIN BULK as text, and those up to ENDDATA."""
    words = _names(lines.cells(filled, 0, 8)[:, 0])
    begin = np.flatnonzero(np.char.startswith(words, b"BEGIN"))
    first = int(begin[0]) + 1 if len(begin) else 0
    end = np.flatnonzero(words[first:] == b"ENDDATA")
    if not len(end):
        raise InputError(
            str(path),
            got=f"no ENDDATA after its last line ({lines.line(int(filled[-1]))[:40].strip()!r})"
            if len(filled)
            else "an empty file",
            expected="bulk data that end with the line ENDDATA",
            hint="the file may be truncated: write it again from the preprocessor. If it is "
            "complete, such as a file for INCLUDE, add ENDDATA as its last line.",
        )
    last = first + int(end[0])
    behind = np.flatnonzero(np.isin(words[last + 1 :], _MESH_CARDS))
    if len(behind):
        row = int(filled[last + 1 + behind[0]])
        raise InputError(
            lines.place(row),
            got=f"{words[last + 1 + behind[0]].decode()} after ENDDATA",
            expected="ENDDATA as the last line of the bulk data",
            hint="lines are out of order, or two files are joined: write the file again, or "
            "remove the lines after ENDDATA.",
        )
    head = tuple(lines.line(row) for row in filled[: max(first - 1, 0)].tolist())
    return head, filled[first:last]
