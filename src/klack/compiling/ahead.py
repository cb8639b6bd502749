"""Compile in another process what a command will need, while the command reads and prepares.

The other process fills the store; the command finds there what it has compiled, waits for what it
compiles at this moment, and compiles the rest itself (:mod:`klack.compiling.turn`).  It costs two
seconds of a processor, so it is only started where the store has no mark of all its groups.
"""

import hashlib
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import klack
from klack.compiling.compiled_folder import compiled_folder, is_usable
from klack.cores import available_cores

__all__ = [
    "LOOP_AND_REST",
    "compiling_ahead",
    "is_ready",
    "mark_ready",
    "start_compiling",
    "stop_compiling",
]

LOOP_AND_REST = ("loop", "rest")
"""Groups that every network needs, the longest first."""

_TELL = "Compiling for this processor, once: about a minute or less. 'klack warm' does it ahead."
_WARM = "klack.warming"
_FAREWELL = 5.0  # [s] until a process that was asked to end is ended


@contextmanager
def compiling_ahead(
    groups: Sequence[str], threads: int | None, *, quiet: bool = False
) -> Iterator[None]:
    """Compile groups of functions in another process meanwhile, if this processor has none yet.

    Parameters
    ----------
    groups : sequence of str
        Of :data:`klack.warming.groups.GROUPS`.
    threads : int, optional
        Cores that the command may use; with one nothing is done.
    quiet : bool
        Do not say so on the error stream.
    """
    if all(is_ready(group) for group in groups):
        yield
        return
    if not quiet:
        print(_TELL, file=sys.stderr, flush=True)
    cores = min(threads or available_cores(), available_cores())
    if cores < 2 or not is_usable(compiled_folder()):
        yield
        return
    process = None
    with suppress(OSError):
        process = start_compiling([group for group in groups if not is_ready(group)])
    try:
        yield
    finally:
        if process is not None:
            stop_compiling(process)


def start_compiling(
    groups: Sequence[str], output: int = subprocess.DEVNULL
) -> "subprocess.Popen[bytes]":
    """Start a process that compiles these groups, one after another.

    It ends by itself when this process has gone.

    Parameters
    ----------
    groups : sequence of str
    output : int
        ``subprocess.PIPE`` to read a line for each group: name, seconds, functions.

    Raises
    ------
    OSError
        If the system starts no more processes.
    """
    return subprocess.Popen(
        [sys.executable, "-P", "-m", _WARM, *groups],
        stdin=subprocess.PIPE,
        stdout=output,
        stderr=output,
        cwd=Path(klack.__file__).parent,
        env=os.environ | {"KLACK_CACHE": "off"},
    )


def stop_compiling(process: "subprocess.Popen[bytes]") -> None:
    """End a process of :func:`start_compiling`; what it has compiled stays."""
    if process.stdin is not None:
        with suppress(OSError):
            process.stdin.close()
    try:
        process.terminate()
        process.wait(_FAREWELL)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def is_ready(group: str) -> bool:
    """Whether a group was compiled by these sources, on this kind of processor."""
    mark = _mark(group)
    return mark is not None and mark.exists()


def mark_ready(group: str) -> None:
    """Note that all functions of a group are in the store."""
    mark = _mark(group)
    if mark is not None:
        with suppress(OSError):
            mark.touch(mode=0o600)


def _mark(group: str) -> Path | None:
    folder = compiled_folder()
    return None if folder is None else folder / f"{group}-{_version()}.ready"


@cache
def _version() -> str:
    """Key of klack's files as they are, the versions of the compiler, and the processor."""
    found = hashlib.sha256()
    root = Path(klack.__file__).parent
    for folder, _, files in sorted(os.walk(root)):
        for name in sorted(files):
            if name.endswith(".py"):
                state = os.stat(os.path.join(folder, name))
                found.update(f"{name} {state.st_size} {state.st_mtime_ns}\n".encode())
    for name in ("numba", "llvmlite", "numpy"):
        with suppress(PackageNotFoundError):
            found.update(f"{name} {version(name)}\n".encode())
    found.update(f"{sys.version} {_processor()}".encode())
    for name, value in sorted(os.environ.items()):
        if name.startswith("NUMBA_") and name != "NUMBA_CACHE_DIR":
            found.update(f"{name}={value}\n".encode())
    return found.hexdigest()[:20]


def _processor() -> str:
    """Instruction sets, without loading the compiler."""
    from importlib import import_module

    features = getattr(import_module("numpy._core._multiarray_umath"), "__cpu_features__", {})
    return ",".join(sorted(name for name, there in features.items() if there))
