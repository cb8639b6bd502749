"""Files of a command: whole or not at all."""

import json
import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from klack.errors import InputError
from klack.files.held import Mark
from klack.files.own import planted
from klack.files.whole import whole_file, whole_files

__all__ = [
    "Written",
    "listing",
    "require_file_target",
    "require_folder",
    "require_json_target",
    "staged_folder",
    "write_json",
]

_MOST_NAMES = 8


@dataclass(frozen=True, slots=True)
class Written:
    """Files written to a folder, and lines on them."""

    folder: Path
    files: tuple[str, ...]
    lines: tuple[str, ...]

    @classmethod
    def of(cls, folder: Path, stage: Path, *lines: str) -> Self:
        """Content of a stage; without lines, one that lists it."""
        files = tuple(sorted(path.name for path in stage.iterdir()))
        return cls(folder, files, lines or (f"Written to {folder}: {listing(files)}",))


def require_json_target(path: Path | None) -> None:
    """Refuse a target of ``--json`` that cannot be written."""
    if str(path) != "-":
        require_file_target("--json", path)


def require_file_target(option: str, path: Path | None) -> None:
    """Refuse an unwritable file before the long work begins."""
    if path is None:
        return
    if path.is_dir():
        raise _refuse(option, path, "a folder", "the name of a file")
    through = path.exists() and not path.is_file()  # a link to a file is merely replaced
    if through and (found := planted(path)) is not None:
        raise _refuse(option, path, found, "a file, or a path for one")
    if not path.absolute().parent.is_dir():
        raise _refuse(option, path, "a file in a folder that does not exist", "an existing folder")
    target = path if path.exists() else path.absolute().parent
    if not os.access(target, os.W_OK):
        raise _refuse(option, path, "a path that is not writable", "a writable file")


def write_json(path: Path, data: Mapping[str, Any]) -> None:
    """Write plain numbers; ``-`` is the standard output."""
    text = json.dumps(data, indent=2, allow_nan=False) + "\n"
    if str(path) == "-":
        sys.stdout.write(text)
        return

    def refuse(place: Path, error: OSError) -> InputError:
        reason = error.strerror or str(error)
        return _refuse("--json", place, f"an error: {reason}", "a writable file")

    if path.exists() and not path.is_file():  # /dev/stdout, a named pipe
        try:
            _write_to_stream(path, text)
        except OSError as error:
            raise refuse(path, error) from error
        return
    with whole_file(path, refuse) as new:
        new.write_text(text, encoding="utf-8")


def _write_to_stream(path: Path, text: str) -> None:
    handle = os.open(path, os.O_WRONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0))
    os.set_blocking(handle, True)
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        file.write(text)


_FILES = frozenset(
    f".{ending}"
    for ending in "csv fmu html inp json mat mf4 mo nc pdf svg vtk vtu wav yaml yml".split()
)
"""Endings of klack's files: a folder with one was meant as a file."""


def require_folder(folder: Path) -> None:
    """Refuse a target of ``--out`` that cannot be written."""
    if (found := planted(folder)) is not None:
        raise _refuse("--out", folder, found, "a folder, or a path for one")
    existing = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    if folder.suffix.lower() in _FILES and not folder.exists():
        raise InputError(
            "--out",
            got=f"'{folder}', the name of a file",
            expected="a folder; klack names the files in it",
            hint=f"--out {folder.with_suffix('')}",
        )
    if not existing.is_dir():
        raise _refuse("--out", folder, f"a path through the file {existing}", "a folder")
    if not os.access(existing, os.W_OK):
        raise _refuse("--out", folder, "a path that is not writable", "a writable folder")


def listing(names: Iterable[str]) -> str:
    """File names in one line; of many, some and their number."""
    every = sorted(names)
    if len(every) <= _MOST_NAMES:
        return ", ".join(every)
    return f"{', '.join(every[: _MOST_NAMES - 1])}, ... ({len(every)} files)"


@contextmanager
def staged_folder(folder: Path, beside: Mapping[str, Mark] | None = None) -> Iterator[Path]:
    """Give a hidden folder whose contents move to ``folder`` when all of them are complete.

    See :func:`klack.files.whole.whole_files`.
    """

    def refuse(path: Path, error: OSError) -> InputError:
        reason = error.strerror or str(error)
        return _refuse("--out", path, f"an error: {reason}", "a folder to write to")

    with whole_files(folder, refuse, beside) as stage:
        yield stage


def _refuse(option: str, path: Path, got: str, expected: str) -> InputError:
    hint = "check the path and the free space; '-' writes JSON to the terminal."
    return InputError(f"{option} {path}", got=got, expected=expected, hint=hint)
