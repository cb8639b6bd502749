"""Files of named arrays: versioned, without pickle, written completely or not at all."""

import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.whole_file import whole_file

__all__ = ["read_arrays", "write_arrays"]

Arrays = dict[str, NDArray[Any]]

# a count that cannot be held, a password, an unknown packing
_OTHERS = (MemoryError, RuntimeError, NotImplementedError, KeyError, SyntaxError)


def write_arrays(path: Path, kind: str, version: int, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays to ``path``, all of them or none.

    Parameters
    ----------
    path : Path
    kind : str
        What the file holds, for example ``"klack.reduced_body"``.
    version : int
    arrays : mapping of str to array
        Numbers or text.
    """
    contents: Arrays = {"format": np.array(kind), "version": np.array(version), **arrays}
    with whole_file(path) as new, new.open("wb") as stream:
        np.savez(stream, **contents)  # type: ignore[arg-type]


def read_arrays(path: Path, kind: str, version: int, required: Sequence[str]) -> Arrays:
    """Read arrays back and check that the file is what it should be.

    Raises
    ------
    InputError
        If the file is missing, truncated, of another kind or newer than this program.
    """
    where = f"file '{path}'"
    try:
        with path.open("rb") as stream:
            if not zipfile.is_zipfile(stream):  # numpy would also take a bare .npy
                raise zipfile.BadZipFile
        with np.load(path, allow_pickle=False) as stored:
            arrays: Arrays = {key: stored[key] for key in stored.files}
    except FileNotFoundError as error:
        raise InputError(
            where, got="no such file", expected=f"a {kind} file", hint="check the path."
        ) from error
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error, *_OTHERS) as error:
        raise InputError(
            where,
            got=f"something unreadable ({type(error).__name__})",
            expected=f"a complete {kind} file",
            hint="the file is damaged or not written by klack; write it again.",
        ) from error
    _check_kind(where, arrays, kind, version)
    missing = [key for key in required if key not in arrays]
    if missing:
        raise InputError(
            where,
            got=f"a file without {', '.join(missing)}",
            expected=f"a complete {kind} file of version {version}",
            hint="the file is damaged or was edited; write it again.",
        )
    return arrays


def _check_kind(where: str, arrays: Arrays, kind: str, version: int) -> None:
    found = str(arrays["format"]) if "format" in arrays else "nothing known"
    if found != kind or "version" not in arrays:
        raise InputError(
            where,
            got=f"a file that holds {found}",
            expected=kind,
            hint="choose a file written by klack for this purpose.",
        )
    if int(arrays["version"]) > version:
        raise InputError(
            where,
            got=f"version {int(arrays['version'])}",
            expected=f"version {version} or older",
            hint="it was written by a newer version of klack; update this one.",
        )
