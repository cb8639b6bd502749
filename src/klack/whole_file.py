"""Files and folders of files that are either complete or as they were before."""

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from klack.errors import InputError

__all__ = ["whole_file", "whole_files"]

Refusal = Callable[[Path, OSError], InputError]


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
def whole_files(folder: Path, refuse: Refusal | None = None) -> Iterator[Path]:
    """Give a hidden folder whose contents move into ``folder`` when all of it is complete.

    Files and folders of the same names are replaced, everything else in ``folder`` stays.  Folders
    that were made for it go again where nothing came into them.

    Parameters
    ----------
    folder : Path
    refuse : callable, optional
        Turns the error of the system into that of the caller.

    Raises
    ------
    InputError
        If the place cannot be written to.
    """
    made = [p for p in (folder, *folder.absolute().parents) if not p.exists()]
    stage = folder / f".new.{os.getpid()}"
    try:
        stage.mkdir(parents=True)
        yield stage
        for item in sorted(stage.iterdir()):
            _replace(item, folder / item.name)
    except OSError as error:
        raise (refuse or _refuse)(folder, error) from error
    finally:
        shutil.rmtree(stage, ignore_errors=True)
        for path in made:  # innermost first; stays if the results are inside
            try:
                path.rmdir()
            except OSError:
                break


def _replace(new: Path, target: Path) -> None:
    """Move a file or folder to its place; a folder there is put aside first."""
    aside = new.with_name(f"old.{target.name}")
    if target.is_dir() and not target.is_symlink():
        target.rename(aside)
    os.replace(new, target)


def _refuse(path: Path, error: OSError) -> InputError:
    return InputError(
        str(path),
        got=f"an error: {error.strerror or error}",
        expected="a place to write to",
        hint="check the path and the space that is left.",
    )
