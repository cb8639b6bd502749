"""INCLUDE statements of a Nastran file: all files as one text."""

import re
from pathlib import Path

from klack.errors import InputError, refuse
from klack.mesh.files.file_bytes import LARGEST_BYTES, read_bytes

__all__ = ["text_with_includes"]

_KIND = "a Nastran bulk data file"
_DEEPEST = 10
_INCLUDE = re.compile(rb"^[ \t]*INCLUDE[ \t]+['\"]?([^'\"\r\n$]+)", re.IGNORECASE | re.MULTILINE)


def text_with_includes(path: Path) -> tuple[bytes, tuple[tuple[int, str, int], ...]]:
    """Text of the file with its includes, and the origin of its lines.

    Returns
    -------
    text : bytes
    pieces : tuple of (line, file name, its line there)
        Where a run of lines begins; lines of the text count from 0, those of a file from 1.

    Raises
    ------
    InputError
        For files that are missing, binary, too large, outside the folder, or included twice.
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
    refuse(
        (
            b"\0" in data[:4096],
            InputError(
                str(file),
                got="a binary file",
                expected=_KIND,
                hint="export the mesh as bulk data (.bdf) from the preprocessor.",
            ),
        ),
        (
            size > LARGEST_BYTES,
            InputError(
                str(file),
                got=f"{size / 1e9:.3g} GB with all includes",
                expected=f"at most {LARGEST_BYTES / 1e9:.3g} GB",
                hint="write the mesh only, without results or steps.",
            ),
        ),
    )


def _below(place: str, folder: Path, name: str, depth: int, seen: set[Path]) -> Path:
    path = (folder / name).resolve()
    refuse(
        (
            not path.is_relative_to(folder),
            InputError(
                f"{place}: INCLUDE",
                got=f"the file '{name}'",
                expected="a file in the folder of the main file or below it",
                hint="copy it next to the main file.",
            ),
        ),
        (
            depth > _DEEPEST or path in seen,
            InputError(
                f"{place}: INCLUDE",
                got=f"'{name}' for the second time, or {depth} levels deep",
                expected=f"every file included once, and up to {_DEEPEST} levels deep",
                hint="write the model into one file.",
            ),
        ),
    )
    return path
