"""Let a second process compile half of what a first run needs, while this one compiles the rest.

Each waits for a function that the other one is compiling (:mod:`klack.machine.compiling.turn`).
"""

import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from numba.core import event

from klack.machine.compiling.compiled_folder import compiled_folder, is_usable
from klack.machine.cores import available_cores

__all__ = ["compiling_ahead"]

_MODULE = "klack.warming"


@contextmanager
def compiling_ahead(groups: Sequence[str], threads: int | None = None) -> Iterator[None]:
    """Start a second process with the first function of klack that is compiled meanwhile.

    None starts if all functions are in the store, without a store, and on one core. It ends with
    this block or process.

    Parameters
    ----------
    groups
        Of :data:`klack.warming.groups.GROUPS`, in the reverse order of need.
    """
    starting = _Starting(groups)
    if min(threads or available_cores(), available_cores()) < 2:
        yield
        return
    event.register("numba:compile", starting)
    try:
        yield
    finally:
        event.unregister("numba:compile", starting)
        starting.end()


class _Starting(event.Listener):
    """Starts the process once something is compiled."""

    def __init__(self, groups: Sequence[str]) -> None:
        self._groups, self._tried = groups, False
        self._process: subprocess.Popen[bytes] | None = None

    def on_start(self, event: Any) -> None:
        function = event.data["dispatcher"].py_func
        if self._tried or not function.__module__.startswith("klack."):
            return
        self._tried = True
        folder = compiled_folder()
        if folder is not None and is_usable(folder):
            with suppress(OSError):
                self._process = subprocess.Popen(
                    [sys.executable, "-P", "-m", _MODULE, *self._groups],
                    stdin=subprocess.PIPE,  # its end tells that this process has gone
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    cwd=Path(__file__).parent,
                )

    def on_end(self, event: Any) -> None:
        pass

    def end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
