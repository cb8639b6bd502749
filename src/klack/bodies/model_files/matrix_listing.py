"""Named matrices in a text file: CSV blocks, and what ANSYS ``SPMWRITE`` writes.

A line that names a matrix opens a block, the numbers below it fill the block row by row::

    A, 2, 2                     or   A matrix     or   [A] 2 2     or   A =
    0, 1
    -4, 0
    inputs, tip
    outputs, tip

Numbers are separated by commas, semicolons or blanks; rows may be broken over lines. A block may
be in Matrix Market form, as ``SPMWRITE`` writes in its file format 1 (non-zeros only). Sizes are
optional: those of A, B, C and D, and of square matrices, follow from the count of numbers. The
maker does not lay down the dense layout, so a line with one such letter alone, with or without the
word matrix, is a title.
"""

import io
import re
from array import array
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, refuse_if

__all__ = ["read_listing"]

_LARGEST = 256 << 20  # bytes of text
_LARGEST_MATRIX = 1 << 28  # bytes: 5800 states
_MEMORY_PER_BYTE = 4
_KNOWN = ("A", "B", "C", "D", "K", "M")
_NAME = re.compile(
    r"""^[\s!*#%/"'\[\]()=:-]*(?:\d+[.)]?\s+)?
        (?:the\s+)?(?:state[- ]space\s+)?(?:matrix\s+)?[\["'(]*\b(?P<name>[A-DKM])\b[\]"')]*
        (?:[\s_-]*(?:matrix|mat))?[\s"'\[\]()=:,;*#x]*
        (?P<sizes>(?:\b\d+\b[\s,;:x()*]*){0,3})(?:rows?|columns?|[\s,;:\[\]()*=#"-])*$""",
    re.IGNORECASE | re.VERBOSE,
)
_TITLED = re.compile(r"\bmatri(?:x|ces)\b|^#\s*name:", re.IGNORECASE)
_LETTER = re.compile(r"(?<![A-Za-z_-])[A-DKM](?![A-Za-z_])")
_LABELS = re.compile(
    r"""^[\s!*#%"'\[]*(?P<kind>inputs?|outputs?|names)(?:[ _-]?(?:labels?|names?))?["'\]]*\s*
        [\s:=,;]\s*(?P<rest>.*)$""",
    re.IGNORECASE | re.VERBOSE,
)
_SPLIT = re.compile(r"[\s,;]+")
_FORTRAN = re.compile(r"(?<=[\d.])[dD](?=[+-]?\d)")
_NO_LETTER = re.compile(r"(?<=[\d.])(?=[+-]\d{3}$)")
_MARKET = "%%matrixmarket"

Arrays = dict[str, NDArray[np.float64]]
Texts = dict[str, tuple[str, ...]]


@dataclass
class _Block:
    name: str
    line: int
    sizes: tuple[int, ...] = ()
    market: bool = False
    symmetric: bool = False
    coordinate: bool = False
    values: "array[float]" = field(default_factory=lambda: array("d"))
    first: int = 0
    rows: int = 0
    widths: set[int] = field(default_factory=set)

    def add(self, numbers: Sequence[float]) -> None:
        if self.rows == 0:
            self.first = len(numbers)
        else:
            self.widths.add(len(numbers))
        self.values.extend(numbers)
        self.rows += 1

    @property
    def numbers(self) -> NDArray[np.float64]:
        return np.frombuffer(self.values, dtype=np.float64)


def read_listing(path: Path) -> tuple[Arrays, Texts]:
    """Read the matrices ``A``, ``B``, ``C``, ``D``, ``K``, ``M`` of a text, and lists of names.

    The lists are ``inputs``, ``outputs``, ``names``; what is not there is missing.
    """
    size = path.stat().st_size
    if size > _LARGEST:
        raise _refused(path, 0, f"{size / 2**20:.0f} MB of text", "at most 256 MB")
    data = path.read_bytes()
    if b"\0" in data[:4096] and not data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise _refused(path, 0, "a binary file", "text")
    refuse_if(
        re.search(rb"^\s*(MODELDEF|SML)\b", data[:4000], re.IGNORECASE | re.MULTILINE),
        str(path),
        got="a model in the SML language",
        expected="dense numbers or Matrix Market form",
        hint="write it with the file format 0 or 1 of SPMWRITE.",
    )
    # line by line: a list of short lines would take many times the size of the file
    with io.TextIOWrapper(io.BytesIO(data), encoding=_encoding(data), newline=None) as text:
        blocks, texts = _blocks(path, text)
    return _finished(path, blocks, size), texts


def _encoding(data: bytes) -> str:
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8-sig"


def _refused(path: Path, line: int, got: str, expected: str) -> InputError:
    return InputError(
        f"{path}, line {line}" if line else str(path),
        got=got,
        expected=expected,
        hint="a line with the name of a matrix (A, B, C, D, K, M), then its rows.",
    )


def _blocks(path: Path, text: Iterable[str]) -> tuple[list[_Block], Texts]:
    blocks: list[_Block] = []
    texts: Texts = {}
    open_block: _Block | None = None
    pending = ""  # name of a matrix that a comment gave before a Matrix Market block
    for number, line in enumerate(text, 1):
        plain = line.strip()
        values = _numbers(plain)
        if values is not None:
            if values and open_block is None:
                raise _refused(
                    path, number, "numbers before the first name", "the name of a matrix"
                )
            if values and open_block is not None:
                open_block.add(values)
            continue
        if plain.lower().startswith(_MARKET):
            name = pending or (open_block.name if open_block and not open_block.rows else "")
            name = name or _KNOWN[min(len(blocks), 3)]
            if open_block is not None and not open_block.rows and open_block in blocks:
                blocks.remove(open_block)
            open_block = _market_block(path, number, plain, name)
            blocks.append(open_block)
            pending = ""
            continue
        title = _title(plain)
        if title is not None:
            name, sizes = title
            if open_block is not None and open_block.market and plain.startswith("%"):
                pending = name
                continue
            open_block = _Block(name=name, line=number, sizes=sizes)
            blocks.append(open_block)
            continue
        labels = _LABELS.match(plain)
        if labels:
            words = [w.strip("\"'[]() ") for w in re.split(r"[,;\t]|\s{1,}", labels["rest"])]
            kind = labels["kind"].lower().rstrip("s") + "s"
            texts[kind] = tuple(word for word in words if word)
            continue
        if plain[0] in "!*#%/\"'" or open_block is None:
            continue  # a comment, or a title
        raise _refused(path, number, f"'{plain[:40]}'", f"numbers of matrix {open_block.name}")
    return blocks, texts


def _title(line: str) -> tuple[str, tuple[int, ...]] | None:
    named = _NAME.match(line)
    if named:
        sizes = re.findall(r"\d+", named["sizes"])[:2]
        return named["name"].upper(), tuple(int(n) for n in sizes)
    letters = _LETTER.findall(line)
    if len(letters) == 1 and _TITLED.search(line):
        sizes = re.findall(r"(?<![\w.-])\d+(?![\w.])", line)
        return letters[0], tuple(int(n) for n in sizes) if len(sizes) == 2 else ()
    return None


def _numbers(line: str) -> list[float] | None:
    words = [word for word in _SPLIT.split(line.strip().strip("[]();,")) if word]
    try:
        return [float(word) for word in words]
    except ValueError:
        pass
    try:
        plain = [_NO_LETTER.sub("e", _FORTRAN.sub("e", word.strip("[]()\"'"))) for word in words]
        return [float(word) for word in plain if word]
    except ValueError:
        return None


def _market_block(path: Path, number: int, line: str, name: str) -> _Block:
    words = line.lower().split()
    if len(words) < 5 or words[3] not in ("real", "integer", "double"):
        raise _refused(path, number, f"'{line[:60]}'", "a real Matrix Market matrix")
    if words[2] not in ("coordinate", "array") or words[4] not in ("general", "symmetric"):
        raise _refused(path, number, f"'{line[:60]}'", "coordinate or array, general or symmetric")
    return _Block(
        name=name,
        line=number,
        market=True,
        symmetric=words[4] == "symmetric",
        coordinate=words[2] == "coordinate",
    )


def _finished(path: Path, blocks: Sequence[_Block], size: int) -> Arrays:
    arrays: Arrays = {}
    for block in blocks:
        if not block.rows:
            continue  # a title that looks like a name
        if block.name in arrays:
            raise _refused(path, block.line, f"matrix {block.name} again", "each matrix once")
        if block.market:
            arrays[block.name] = _from_market(path, block, size)
        else:
            arrays[block.name] = _dense(path, block, arrays)
    if not arrays:
        raise _refused(path, 0, "no matrix", "at least one")
    for name, matrix in arrays.items():
        if not np.all(np.isfinite(matrix)):
            raise _refused(path, 0, f"numbers of {name} that are not finite", "finite numbers")
    return arrays


def _from_market(path: Path, block: _Block, size: int) -> NDArray[np.float64]:
    numbers = block.numbers
    head, numbers = numbers[: block.first], numbers[block.first :]
    expected = 3 if block.coordinate else 2
    whole = np.all(np.isfinite(head)) and np.all(head == np.round(head)) and np.all(head >= 0)
    if len(head) != expected or not whole:
        raise _refused(path, block.line + 1, "another line", "rows, columns and, if sparse, count")
    rows, columns = int(head[0]), int(head[1])
    if 8 * rows * columns > _LARGEST_MATRIX or (
        not block.coordinate and rows * columns > _MEMORY_PER_BYTE * size
    ):
        raise _refused(path, block.line + 1, f"{rows} x {columns} numbers", "a reduced matrix")
    matrix = np.zeros((rows, columns))
    if not block.coordinate:
        values = numbers
        where = np.tril_indices(rows) if block.symmetric and rows == columns else None
        if where is not None and len(values) == len(where[0]):
            order = np.lexsort((where[0], where[1]))
            matrix[where[0][order], where[1][order]] = values
            return matrix + np.tril(matrix, -1).T
        if len(values) != rows * columns:
            raise _refused(
                path, block.line, f"{len(values)} numbers of {block.name}", f"{rows * columns}"
            )
        return values.reshape((rows, columns), order="F")
    count = block.rows - 1
    if not block.widths <= {3} or count != int(head[2]):
        raise _refused(path, block.line, f"{count} entries of {block.name}", f"{int(head[2])}")
    table = numbers.reshape(-1, 3)
    index = table[:, :2]
    inside = (index >= 1) & (index <= [rows, columns]) & (index == np.round(index))
    if not np.all(inside):
        raise _refused(path, block.line, "an entry outside the matrix", f"{rows} x {columns}")
    i, j = index.astype(np.int64).T - 1
    matrix[i, j] = table[:, 2]
    if block.symmetric:
        off = i != j
        matrix[j[off], i[off]] = table[off, 2]
    return matrix


def _dense(path: Path, block: _Block, known: Arrays) -> NDArray[np.float64]:
    values = block.numbers.copy()
    shape = block.sizes if len(block.sizes) == 2 else _shape(block, len(values), known)
    if shape is None or shape[0] * shape[1] != len(values):
        expected = f"{shape[0]} x {shape[1]}" if shape else "whole rows of equal length"
        raise _refused(path, block.line, f"{len(values)} numbers of {block.name}", expected)
    return values.reshape(shape)


def _shape(block: _Block, count: int, known: Arrays) -> tuple[int, int] | None:
    """Shape by the number of states; else by the lines."""
    n = len(known["A"]) if "A" in known else 0
    if block.name in ("A", "K", "M"):
        side = round(count**0.5)
        return (side, side) if side * side == count else None
    if n and block.name == "B":
        return (n, count // n) if count % n == 0 else None
    if n and block.name == "C":
        return (count // n, n) if count % n == 0 else None
    if block.name == "D" and "B" in known and "C" in known:
        return len(known["C"]), known["B"].shape[1]
    widths = {block.first, *block.widths}
    return (block.rows, block.first) if len(widths) == 1 else None
