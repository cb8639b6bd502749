"""Files and folders of files that are either complete or as they were before."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from klack.errors import InputError

__all__ = ["whole_file", "whole_files"]


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a path beside ``path``, with its suffix, that takes its place when all went well.

    Raises
    ------
    InputError
        If the place cannot be written to.
    """
    new = path.with_name(f".{path.stem[:80]}.{os.getpid()}.new{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            yield new
            new.replace(path)
        finally:
            new.unlink(missing_ok=True)
    except OSError as error:
        raise _refuse(path, error) from error


@contextmanager
def whole_files(folder: Path) -> Iterator[Path]:
    """Give a hidden folder whose contents move into ``folder`` when all of it is complete.

    Files and folders of the same names are replaced, everything else in ``folder`` stays.

    Raises
    ------
    InputError
        If the place cannot be written to.
    """
    stage = folder / f".new.{os.getpid()}"
    try:
        stage.mkdir(parents=True)
        yield stage
        for item in sorted(stage.iterdir()):
            target = folder / item.name
            if target.is_dir() and not target.is_symlink():
                target.rename(stage / f"old.{item.name}")
            item.replace(target)
    except OSError as error:
        raise _refuse(folder, error) from error
    finally:
        shutil.rmtree(stage, ignore_errors=True)


def _refuse(path: Path, error: OSError) -> InputError:
    return InputError(
        str(path),
        got=f"an error: {error.strerror or error}",
        expected="a place to write to",
        hint="check the path and the space that is left.",
    )
