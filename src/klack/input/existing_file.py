"""The name of a file in a case, looked for relative to the folder of the case."""

import stat
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, ValidationInfo, WithJsonSchema

from klack.errors import InputError
from klack.input.problem import CaseProblem

__all__ = ["InputPath", "instead_of_file", "refuse_lfs_pointer"]

_LONGEST = 300  # characters of a name that a message repeats
_LFS_POINTER = b"version https://git-lfs.github.com/spec/"


def refuse_lfs_pointer(path: Path) -> None:
    """Raise for the short text that git leaves in place of a large file.

    A file that does not exist is left to the reader.
    """
    try:
        with path.open("rb") as stream:
            start = stream.read(len(_LFS_POINTER))
    except OSError:
        return
    if start == _LFS_POINTER:
        raise InputError(
            str(path),
            got="a git-LFS pointer: a placeholder for a file that was not downloaded",
            expected="the file itself",
            hint="run 'git lfs pull' in its repository, or download the file by hand.",
        )


def instead_of_file(path: Path) -> str:
    """Description of what is in place of a file; empty for a file.

    A name may also be too long for the system, or lie in a folder that is closed to this user.
    """
    try:
        if stat.S_ISREG(path.stat().st_mode):
            return ""
        return "a folder" if path.is_dir() else "no plain file"
    except (FileNotFoundError, NotADirectoryError):
        return "a file that does not exist"
    except (OSError, ValueError) as error:  # a null character in the name
        reason = error.strerror if isinstance(error, OSError) else str(error)
        return f"a file that cannot be reached ({reason})"


def _existing_file(value: Any, info: ValidationInfo) -> Path:
    """Resolve a path relative to the folder of the case; it must be a file."""
    if isinstance(value, Path):
        value = str(value)
    if not isinstance(value, str) or not value.strip():
        got, hint = f"'{value}'", "write the name of a file, relative to the case file."
        raise CaseProblem((), got=got, expected="a file name", hint=hint)
    folder = info.context.get("folder", Path()) if info.context else Path()
    name = value if len(value) <= _LONGEST else f"{value[:_LONGEST]}..."
    try:
        path = (folder / Path(value).expanduser()).resolve()
    except (OSError, RuntimeError) as error:  # the present folder is gone; links in a circle
        hint = "write the full path of the file."
        got = f"'{name}', which has no target ({error})"
        raise CaseProblem((), got=got, expected="an existing file", hint=hint) from None
    if kind := instead_of_file(path):
        raise CaseProblem(
            (),
            got=f"'{name}', {kind}" + (f" ({path})" if name == value else ""),
            expected="an existing file, relative to the folder of the case",
            hint="check the spelling and the folder.",
        )
    try:
        refuse_lfs_pointer(path)
    except InputError as error:
        raise CaseProblem((), got=error.got, expected=error.expected, hint=error.hint) from error
    return path


InputPath = Annotated[
    Path, BeforeValidator(_existing_file), WithJsonSchema({"type": "string", "format": "path"})
]
"""Field of a section that names an existing file."""
