"""Run CalculiX (ccx) on a deck, in its folder, with progress and a time limit."""

import os
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import monotonic

from klack.errors import ConvergenceError, InputError, require_positive

__all__ = ["CalculixRun", "find_calculix", "require_calculix", "run_calculix"]

_NAMES = ("ccx", "ccx_2.23", "ccx_2.22", "ccx_2.21", "ccx_2.20")
_POLL = 0.2  # s
_ERROR = re.compile(r"\*ERROR.*(?:\n(?! ?\*|\n).*){0,4}")
_LOG_TAIL = 200_000  # bytes
# what a crash or a diverged run would leave over from an earlier one
_RESULTS = (".dat", ".sta", ".cvg", ".log", ".frd", ".12d")


@dataclass(frozen=True, slots=True, kw_only=True)
class CalculixRun:
    """Finished run.

    Parameters
    ----------
    data
        The ``.dat`` file.
    wall_time [s]
    """

    data: Path
    wall_time: float


def find_calculix() -> Path | None:
    """Program ccx on the search path, if any."""
    for name in _NAMES:
        if found := shutil.which(name):
            return Path(found)
    return None


def require_calculix() -> Path:
    """Program ccx; the error says how to get it."""
    program = find_calculix()
    if program is None:
        raise InputError(
            "CalculiX",
            got="no program 'ccx' on the search path",
            expected="CalculiX 2.20 or later",
            hint="install it (Debian and Ubuntu: apt-get install calculix-ccx; others: "
            "calculix.de), or run the deck elsewhere and bring its .dat file back.",
        )
    return program


def run_calculix(
    deck: Path,
    *,
    duration: float,
    threads: int = 1,
    time_limit: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> CalculixRun:
    """Run a deck ``NAME.inp``; ``NAME.dat``, ``NAME.sta`` and ``NAME.log`` appear beside it.

    Parameters
    ----------
    duration [s]
        Simulated, for the progress.
    time_limit [s]
        Wall-clock; then the run is stopped.
    progress
        Gets the fraction done.

    Raises
    ------
    InputError
        If ccx is not installed, or rejects the deck.
    ConvergenceError
        If it stops early, crashes, or reaches the time limit.
    """
    require_positive("run_calculix: threads", threads, "cores")
    if time_limit is not None:
        require_positive("run_calculix: time_limit", time_limit, "s")
    deck = Path(deck).absolute()
    program = require_calculix()
    for suffix in _RESULTS:
        deck.with_suffix(suffix).unlink(missing_ok=True)
    log = deck.with_suffix(".log")
    environment = os.environ | {"OMP_NUM_THREADS": str(threads)}
    begin = monotonic()
    with log.open("xb") as stream:  # not through a link put there since
        process = subprocess.Popen(
            [program, "-i", deck.stem],
            cwd=deck.parent,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=stream,
            stderr=subprocess.STDOUT,
        )
        try:
            code = _wait(process, deck, duration, begin, time_limit, progress)
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
    data = deck.with_suffix(".dat")
    if code != 0 or "Job finished" not in _tail(log):
        raise _failure(deck, log, code)
    return CalculixRun(data=data, wall_time=monotonic() - begin)


def _wait(
    process: subprocess.Popen[bytes],
    deck: Path,
    duration: float,
    begin: float,
    time_limit: float | None,
    progress: Callable[[float], None] | None,
) -> int:
    """Wait for the end; returns the exit code."""
    while True:
        try:
            return process.wait(timeout=_POLL)
        except subprocess.TimeoutExpired:
            pass
        reached = _reached(deck.with_suffix(".sta"))
        if progress is not None:
            progress(min(reached / duration, 1.0))
        if time_limit is not None and monotonic() - begin > time_limit:
            raise ConvergenceError(
                f"CalculiX: {deck.name}: stopped after {time_limit:g} s of wall-clock time at "
                f"{reached * 1e6:.4g} us of {duration * 1e6:.4g} us.\n"
                "Try: a longer limit, a coarser mesh, or a longer step."
            )


def _reached(status: Path) -> float:
    """Simulated time [s] in the status file."""
    try:
        with status.open("rb") as stream:
            stream.seek(max(0, status.stat().st_size - 400))
            lines = stream.read().decode("ascii", "replace").splitlines()
        return float(lines[-1].split()[4])
    except (OSError, IndexError, ValueError):  # not yet there, or a line half written
        return 0.0


def _failure(deck: Path, log: Path, code: int) -> InputError | ConvergenceError:
    """Error message of ccx."""
    complaint = _ERROR.search(_tail(log))
    words = " ".join(complaint[0].split())[:400] if complaint else f"exit code {code}"
    reached = _reached(deck.with_suffix(".sta"))
    if reached == 0.0 and complaint:
        return InputError(
            f"CalculiX: {deck.name}",
            got=words,
            expected="a deck that ccx accepts",
            hint=f"see {log}.",
        )
    return ConvergenceError(
        f"CalculiX: {deck.name}: ended early at {reached * 1e6:.4g} us ({words}).\n"
        f"Try: a shorter step or a smaller penalty; see {log}."
    )


def _tail(log: Path) -> str:
    with log.open("rb") as stream:
        stream.seek(max(0, log.stat().st_size - _LOG_TAIL))
        return stream.read().decode("ascii", "replace")
