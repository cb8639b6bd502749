"""Available memory, and rejection of what would not fit.

The operating system kills a process that takes too much, or slows the machine to a crawl.
"""

import os
from dataclasses import dataclass
from pathlib import Path

from klack.errors import InputError

__all__ = ["AvailableMemory", "available_memory", "fits", "in_words", "require_memory"]

_SHARE = 0.95  # of what is there; the rest is for the small things beside a large one
_WORTH_A_LOOK = 50e6  # bytes that are always there
_MACHINE = "free memory of this machine"
_CGROUPS = Path("/sys/fs/cgroup")
_OWN_CGROUPS = Path("/proc/self/cgroup")


@dataclass(frozen=True, slots=True, kw_only=True)
class AvailableMemory:
    """Available memory [byte], and what limits it."""

    size: float
    bound: str


def available_memory() -> AvailableMemory:
    """Smallest of: free memory of the machine, limit of its control group, limit of the process.

    The system's cache of files counts as free.  Swap does not: a factorisation in it takes
    days.
    """
    import psutil

    found = [AvailableMemory(size=float(psutil.virtual_memory().available), bound=_MACHINE)]
    found += _control_groups()
    found += _limits_of_the_process()
    return min(found, key=lambda item: item.size)


def fits(needed: float) -> bool:
    """Whether so much more memory [byte] can be taken."""
    return needed < _WORTH_A_LOOK or needed <= _SHARE * available_memory().size


def require_memory(where: str, needed: float, *, what: str, hint: str) -> None:
    """Raise :class:`InputError` for what would not fit.

    Parameters
    ----------
    needed [byte]
        On top of what is taken now.
    what
        What takes it, for the message.
    """
    if fits(needed):
        return
    there = available_memory()
    raise InputError(
        where,
        got=f"{what} needing about {in_words(needed)} of memory",
        expected=f"at most {in_words(_SHARE * there.size)} ({there.bound})",
        hint=hint,
    )


def in_words(size: float) -> str:
    """Bytes in decimal units: ``1.2 GB``."""
    size = max(size, 0.0)
    for limit, unit in ((1e6, "kB"), (1e9, "MB"), (1e12, "GB"), (1e15, "TB")):
        if size < 0.9995 * limit:
            return f"{size / limit * 1e3:.3g} {unit}"
    return f"{size / 1e15:.3g} PB"


def _control_groups() -> list[AvailableMemory]:
    """Memory left by control groups of a container or batch system (Linux, version 1 and 2)."""
    try:
        lines = _OWN_CGROUPS.read_text(encoding="utf-8").splitlines()
    except OSError:
        return []
    found = []
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if controllers == "":
            roots = [_CGROUPS, _CGROUPS / "unified"]
            names = ("memory.max", "memory.current", "inactive_file")
        elif "memory" in controllers.split(","):
            roots = [_CGROUPS / "memory"]
            names = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
        else:
            continue
        # a limit may be set on any group above; in a container the path may start outside of it
        parts = [part for part in path.split("/") if part and part != ".."]
        for root in roots:
            for depth in range(len(parts), -1, -1):
                found += _control_group(root.joinpath(*parts[:depth]), *names)
    return found


def _control_group(folder: Path, limit: str, usage: str, cached: str) -> list[AvailableMemory]:
    try:
        most = float((folder / limit).read_text())
        used = float((folder / usage).read_text())
        told = (folder / "memory.stat").read_text()
        rows = dict(row.split(maxsplit=1) for row in told.splitlines())
        left = most - used + float(rows.get(cached, 0.0))
    except (OSError, ValueError):  # no such group, or "max"
        return []
    return [AvailableMemory(size=max(left, 0.0), bound="limit of the container or batch job")]


def _limits_of_the_process() -> list[AvailableMemory]:
    if os.name != "posix":
        return []
    import resource

    import psutil

    taken = psutil.Process().memory_info()
    found = []
    for name, used in (("RLIMIT_AS", taken.vms), ("RLIMIT_DATA", getattr(taken, "data", 0))):
        soft, _ = resource.getrlimit(getattr(resource, name))
        if soft != resource.RLIM_INFINITY:
            left = max(float(soft - used), 0.0)
            found.append(AvailableMemory(size=left, bound="limit of this process, ulimit"))
    return found
