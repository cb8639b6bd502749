"""Compile all groups, several at a time, each in a process of its own."""

import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from klack.compiling.ahead import start_compiling, stop_compiling
from klack.errors import ConvergenceError

__all__ = ["Warmed", "warm"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Warmed:
    """One group that is in the store now.

    Parameters
    ----------
    name : str
    functions : int
        Functions of klack that had to be compiled for it; 0 if all were there.
    seconds : float [s]
        Spent on compiling.
    wall_time : float [s]
        From the start of its process to the end, waiting for others included.
    """

    name: str
    functions: int
    seconds: float
    wall_time: float


def warm(groups: Sequence[str], processes: int) -> Iterator[Warmed]:
    """Compile groups of functions; yield each when it is done.

    Raises
    ------
    ConvergenceError
        If the calculation of a group fails: with the last line of what it wrote.
    """
    running: list[subprocess.Popen[bytes]] = []
    with ThreadPoolExecutor(processes) as pool:
        try:
            for future in as_completed([pool.submit(_warm, name, running) for name in groups]):
                yield future.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
            for process in running:
                stop_compiling(process)


def _warm(name: str, running: "list[subprocess.Popen[bytes]]") -> Warmed:
    begin = perf_counter()
    process = start_compiling([name], output=subprocess.PIPE)
    running.append(process)
    assert process.stdout is not None
    assert process.stderr is not None
    with ThreadPoolExecutor(1) as pool:
        said = pool.submit(process.stderr.read)
        words = process.stdout.read().split()
        problem = said.result().decode(errors="replace").strip().splitlines()
    code = process.wait()
    if code != 0 or len(words) != 3:
        last = problem[-1] if problem else f"exit code {code}"
        raise ConvergenceError(
            f"group '{name}' was not compiled: {last}\n"
            f"Try: {Path(sys.executable).name} -P -m klack.warming {name}, which shows all of it."
        )
    return Warmed(
        name=name,
        functions=int(words[2]),
        seconds=float(words[1]),
        wall_time=perf_counter() - begin,
    )
