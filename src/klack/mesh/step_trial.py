"""First reading of a STEP file in a separate process.

OpenCASCADE does not survive every damaged file, and some keep it busy without end; neither may
happen in the process that holds the work of a user. The second reading takes as long as the first;
meshing takes far longer. A file that passed is not tried again until it changes.
"""

import re
import subprocess
import sys
from collections import Counter
from functools import cache
from pathlib import Path

from klack.errors import InputError

__all__ = ["require_readable_step"]

_TEXT = re.compile(rb"'[^']*'|/\*.*?\*/", re.DOTALL)
_ENTITY = re.compile(rb"#(\d+)(\s*=)?")
_PATIENCE = 600.0  # s; a part of 20 MB takes some seconds
_PROGRAM = """
import os, sys
for stream in (1, 2):
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
from netgen.occ import OCCGeometry
try:
    len(OCCGeometry(sys.argv[1]).shape.solids)
except Exception:  # of any kind: what the reading that follows raises as well, and says
    pass
os._exit(0)
"""


def require_readable_step(path: Path, patience: float = _PATIENCE) -> None:
    """Read a STEP file, and forget it.

    Rejects missing and repeated entities, which OpenCASCADE ignores, a file that breaks it, and
    one that takes longer than ``patience`` [s].
    """
    state = path.stat()
    _try(path, patience, (state.st_dev, state.st_ino, state.st_size, state.st_mtime_ns))


def _require_entities(path: Path) -> None:
    defined, named = Counter[int](), set[int]()
    for number, defines in _ENTITY.findall(_TEXT.sub(b"", path.read_bytes())):
        (defined.update if defines else named.update)((int(number),))
    if missing := named - defined.keys():
        raise _refuse(path, f"a damaged STEP file: entity #{min(missing)} is missing")
    if twice := [number for number, count in defined.items() if count > 1]:
        raise _refuse(path, f"a damaged STEP file: entity #{min(twice)} is defined twice")


@cache  # a file that was refused is tried again: memory may have been short
def _try(path: Path, patience: float, state: tuple[int, ...]) -> None:
    """Look for losses, and start the child; ``state`` identifies a version of the file."""
    _require_entities(path)
    if not sys.executable:  # inside of another program
        return
    try:
        done = subprocess.run(
            [sys.executable, "-c", _PROGRAM, str(path.absolute())],
            stdin=subprocess.DEVNULL,
            timeout=patience,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise _refuse(path, f"a STEP file that takes longer than {patience:g} s to read") from None
    if done.returncode != 0:
        raise _refuse(path, "a damaged STEP file: OpenCASCADE crashes on it")


def _refuse(path: Path, got: str) -> InputError:
    return InputError(
        str(path),
        got=got,
        expected="a complete STEP file (AP203, AP214 or AP242)",
        hint="export it again; open it in a CAD program and repair it.",
    )
