"""DMIG entries of a Nastran punch file (``.pch``): matrices by grid and component.

``DMIG, NAME, 0, IFO, TIN, ...`` opens a matrix, ``DMIG*, NAME, GJ, CJ`` a column, and lines below
it (``*``) hold ``GI, CI, value``. Fields may be small (8 wide), large (16) or between commas.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.bodies.model_files.coordinate_files import places_of_entries
from klack.bodies.model_files.number_lines import numbers_in, whole_numbers
from klack.bodies.model_files.system_matrix import (
    Role,
    SystemMatrix,
    choose_matrix,
    symmetric_matrix,
)
from klack.errors import InputError, refuse_if

__all__ = ["read_nastran_pch"]

_REAL = (1, 2)
_SQUARE, _SYMMETRIC = 1, 6
_MOST_WORDS = 200_000


@dataclass
class _Punched:
    """A matrix while it is read: words of its entries, four numbers and a value each."""

    kind: int
    words: list[bytes] = field(default_factory=list)
    parts: list[NDArray[np.float64]] = field(default_factory=list)

    def flush(self, where: str) -> None:
        if not self.words:
            return
        values = numbers_in(b" ".join(self.words))
        if values is None or len(values) != len(self.words):
            # 1.25+3 stands for 1.25E+3
            values = numbers_in(b" ".join(_with_letter(word.strip()) for word in self.words))
        if values is None or len(values) != len(self.words):
            raise _no_numbers(where)
        self.parts.append(values.reshape(-1, 5))
        self.words.clear()


def read_nastran_pch(path: Path, name: str | None, role: Role | None) -> SystemMatrix:
    """Read one matrix of a punch file; rejects complex and rectangular ones."""
    data = path.read_bytes()
    chosen = choose_matrix(str(path), _names(data), name, role)
    found = _read(path, data, chosen)
    where = f"{path}: {chosen}"
    punched = found[chosen]
    punched.flush(where)
    if not punched.parts:
        raise _no_numbers(where)
    table = np.concatenate(punched.parts)
    nodes = whole_numbers(where, table[:, [0, 2]], "a grid")
    ways = whole_numbers(where, table[:, [1, 3]], "a component")
    rows, row, column = places_of_entries(where, nodes, ways)
    # several entries of one place may come, zeros among them
    matrix, notes = symmetric_matrix(where, row, column, table[:, 4], len(rows.node))
    return SystemMatrix(path=path, name=chosen, matrix=matrix, rows=rows, notes=notes)


def _names(data: bytes) -> list[str]:
    result = []
    at = -1
    while (at := data.find(b"DMIG", at + 1)) >= 0:
        if at and data[at - 1 : at] not in (b"\n", b"\r"):
            continue
        end = data.find(b"\n", at)
        words = [word.strip() for word in _fields(data[at : end if end >= 0 else len(data)])[1:3]]
        if len(words) == 2 and words[1] == b"0":
            result.append(words[0].decode("ascii", "replace"))
    return result


def _read(path: Path, data: bytes, chosen: str) -> dict[str, _Punched]:
    """Entries of the chosen matrix."""
    found: dict[str, _Punched] = {}
    open_matrix: _Punched | None = None
    column: tuple[bytes, bytes] | None = None
    fields: list[bytes]
    wanted = False
    for number, line in enumerate(data.splitlines(), start=1):
        if open_matrix is not None and column is not None and line[:8] == b"*       ":
            if not wanted:
                continue
            if len(line) > 40 and not line[56:72].strip() and b"," not in line:
                # anything else than three numbers changes their count
                open_matrix.words += (line[8:24], line[24:40], *column, line[40:56])
                if len(open_matrix.words) > _MOST_WORDS:
                    open_matrix.flush(f"{path}:{number}")
                continue
        if line[:1] in (b"*", b"+", b" ") and open_matrix is not None and column is not None:
            fields = _fields(line)[1:]
            _append(f"{path}:{number}", open_matrix, column, fields)
            continue
        if line[:4].upper() != b"DMIG" or line[4:5] not in (b" ", b"*", b","):
            open_matrix = column = None  # titles, other entries
            continue
        fields = _fields(line)
        words = [word.strip() for word in fields[1:]]
        name = words[0].decode("ascii", "replace") if words else ""
        if len(words) > 1 and words[1] == b"0":
            _check(f"{path}:{number}", name, name in found, words)
            open_matrix, column = found.setdefault(name, _Punched(int(words[2]))), None
            wanted = name == chosen
            continue
        if name not in found or len(words) < 3:
            raise _wrong(f"{path}:{number}", line)
        open_matrix, column = found[name], (words[1], words[2] or b"0")
        wanted = name == chosen
        _append(f"{path}:{number}", open_matrix, column, fields[5:])
    return found


def _fields(line: bytes) -> list[bytes]:
    """Fields of a line; the first is its name or continuation mark."""
    if b"," in line:
        return line.split(b",")
    line = line.rstrip().expandtabs(8)
    if b"*" in line[:8]:
        return [line[:8], line[8:24], line[24:40], line[40:56], line[56:72]]
    return [line[k : k + 8] for k in range(0, min(len(line), 72), 8)]


def _append(place: str, matrix: _Punched, column: tuple[bytes, bytes], fields: list[bytes]) -> None:
    """Take GI, CI, A and an empty B, once or twice in a line."""
    for k in range(0, len(fields), 4):
        part = [word.strip() for word in fields[k : k + 4]]
        if not any(part):
            continue
        if len(part) < 3 or not (part[0] and part[2]) or any(part[3:]):
            raise _wrong(place, b" ".join(part))
        if b" " in part[0] or b" " in part[2] or b" " in part[1]:
            raise _wrong(place, b" ".join(part))
        matrix.words += [part[0], part[1] or b"0", *column, part[2]]


def _check(place: str, name: str, again: bool, words: list[bytes]) -> None:
    try:
        form, kind = int(words[2]), int(words[3])
    except (IndexError, ValueError):
        raise _wrong(place, b" ".join(words)) from None
    refuse_if(
        again or form not in (_SQUARE, _SYMMETRIC) or kind not in _REAL,
        place,
        got=f"matrix '{name}' {'again' if again else f'of form {form} and type {kind}'}",
        expected="each matrix once, of form 1 or 6 (square, symmetric) and type 1 or 2 (real)",
        hint="write K and M of a model without damping.",
    )


def _no_numbers(where: str) -> InputError:
    hint = "the file is damaged or truncated; write it again."
    return InputError(where, got="entries that are not numbers", expected="numbers", hint=hint)


def _with_letter(word: bytes) -> bytes:
    plain = word.upper()
    for sign in (b"+", b"-"):
        at = plain.rfind(sign)
        if at > 0 and plain[at - 1 : at] not in (b"E", b"D"):
            return plain[:at] + b"E" + plain[at:]
    return plain


def _wrong(place: str, line: bytes) -> InputError:
    return InputError(
        place,
        got=f"'{line[:60].decode('ascii', 'replace').strip()}'",
        expected="a DMIG entry: grid, component, value",
        hint="the file is damaged; write it again with EXTSEOUT(DMIGPCH) or PARAM,EXTOUT,DMIGPCH.",
    )
