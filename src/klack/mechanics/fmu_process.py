"""Process that serves one FMU: start, calls and end.

It ends with the process that started it, whatever happens to that.  A thread ends calls that take
too long; a call costs one round trip through two pipes.
"""

import json
import os
import signal
import subprocess
import sys
import threading
import weakref
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from klack.files.closing import Closing
from klack.mechanics import fmu_child
from klack.mechanics.fmu_child import ANSWER, request

__all__ = ["FmuFailed", "FmuProcess"]

_START = 120.0  # [s] until Python itself must have started
_LAST_MOMENTS = 2.0  # [s] to free the instance
_LOOKS, _LONGEST_LOOK = 10, 0.25  # of the watching thread: within the time limit, and [s]


class FmuFailed(Exception):
    """An FMU failed; the text describes the fault."""


class FmuProcess(Closing):
    """One instance of an FMU in a process of its own, in its initialisation.

    Parameters
    ----------
    given
        ``version`` (2 or 3), ``library``, and what :meth:`klack.mechanics.fmu_child.Instance.begin`
        takes.
    time_limit [s]
        For one call, and for the initialisation.

    Raises
    ------
    FmuFailed
        If the FMU cannot be loaded, fails, or takes too long; the process is gone then.
    """

    def __init__(self, given: Mapping[str, Any], time_limit: float) -> None:
        self._request = request(len(given["inputs"]))
        self._process = subprocess.Popen(
            [sys.executable, "-I", "-S", str(fmu_child.__file__), str(os.getpid())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            cwd=Path(given["library"]).parent,  # libraries beside it are found
            bufsize=0,
            process_group=0 if os.name == "posix" else None,  # Ctrl-C is for klack
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._writer, self._reader = self._process.stdin.fileno(), self._process.stdout.fileno()
        self._watch = _Watch(self._process, _START)
        self._end = weakref.finalize(self, _end, self._process, self._watch)
        self._watch.start()
        try:
            self._receive()
            self._watch.limit = time_limit
            self._send(json.dumps(dict(given)).encode() + b"\n")
            self._receive()
        except BaseException:
            self.close()
            raise

    def call(self, what: int, time: float, step: float, *inputs: float) -> float:
        """Send a :func:`klack.mechanics.fmu_child.request`; output in the unit of the FMU.

        Raises
        ------
        FmuFailed
            The process is gone then.
        """
        try:
            self._send(self._request.pack(what, time, step, *inputs))
            return self._receive()
        except BaseException:  # also Ctrl-C: its answer would be taken for that of the next call
            self.close()
            raise

    def close(self) -> None:
        """End the process."""
        self._end()

    def _send(self, data: bytes) -> None:
        self._watch.calls += 1  # odd: a call is under way
        try:
            os.write(self._writer, data)
        except OSError:
            raise self._died() from None

    def _receive(self) -> float:
        failed, force, length = ANSWER.unpack(self._read(ANSWER.size))
        if failed:
            error, _, said = self._read(length).decode(errors="replace").partition("\0")
            raise FmuFailed(f"failed ({error})" + (f"; its output: {said}" if said else ""))
        self._watch.calls += 1
        return float(force)

    def _read(self, size: int) -> bytes:
        data = os.read(self._reader, size)
        while len(data) < size:
            more = os.read(self._reader, size - len(data)) if data else b""
            if not more:
                raise self._died()
            data += more
        return data

    def _died(self) -> FmuFailed:
        try:
            code = self._process.wait(_LAST_MOMENTS)
        except subprocess.TimeoutExpired:
            return FmuFailed("closed its connection")
        if self._watch.has_ended_it:
            return FmuFailed(f"did not answer within {self._watch.limit:g} s")
        if code < 0:
            return FmuFailed(f"crashed (signal {-code}, {_signal(-code)})")
        return FmuFailed(f"ended its process (exit code {code})")


class _Watch(threading.Thread):
    """Ends the process when one call takes longer than the limit.

    It counts its own ticks: time in which klack was stopped (Ctrl-Z, a suspended computer) does not
    count.
    """

    def __init__(self, process: subprocess.Popen[bytes], limit: float) -> None:
        super().__init__(name="klack-fmu", daemon=True)
        self.limit, self.calls, self.has_ended_it = limit, 1, False
        self._process, self._is_over = process, threading.Event()

    def run(self) -> None:
        seen, waited = -1, 0.0
        while not self._is_over.wait(pause := min(self.limit / _LOOKS, _LONGEST_LOOK)):
            if self.calls != seen:
                seen, waited = self.calls, 0.0
            elif seen % 2:
                waited += pause
                if waited >= self.limit:
                    self.has_ended_it = True
                    _kill(self._process)
                    return

    def stop(self) -> None:
        self._is_over.set()


def _end(process: subprocess.Popen[bytes], watch: _Watch) -> None:
    """End and reap a process: it frees its instance when the pipes close, or is killed."""
    watch.stop()
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            pipe.close()
    try:
        process.wait(_LAST_MOMENTS)
    except subprocess.TimeoutExpired:
        _kill(process)
        process.wait()


def _kill(process: subprocess.Popen[bytes]) -> None:
    """Kill it with all that it started."""
    if process.poll() is None:
        with suppress(ProcessLookupError):
            if os.name == "posix":
                os.killpg(process.pid, signal.SIGKILL)
            else:
                process.kill()


def _signal(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return "of the system"
