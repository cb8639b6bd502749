"""What a number was measured on: machine, versions, commit."""

import os
import platform
import re
import resource
import subprocess
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

__all__ = ["describe_machine", "peak_gigabytes"]

_PACKAGES = (
    *("klack", "numpy", "scipy", "numba", "mkl", "netgen-mesher"),
    *("ngsolve", "scikit-sundae", "fmpy"),
)


def describe_machine() -> dict[str, str | int | float | dict[str, str]]:
    """Processor, cores, memory, load, versions and commit, as the JSON holds them."""
    return {
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)),
        "memory_GB": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9, 1),
        "load": round(os.getloadavg()[0], 2),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "versions": {name: found for name in _PACKAGES if (found := _version(name))},
        "commit": _commit(),
    }


def peak_gigabytes(*, children: bool = False) -> float:
    """Largest resident size so far [GB] of this process, or of the largest one it has waited for.

    The value of the kernel for a process counts what its parent held when it was started; the
    status file does not (Linux).
    """
    status = Path("/proc/self/status")
    if not children and status.exists():
        (kilobytes,) = re.findall(r"VmHWM:\s*(\d+) kB", status.read_text())
        return 1024 * int(kilobytes) / 1e9
    who = resource.RUSAGE_CHILDREN if children else resource.RUSAGE_SELF
    return 1024 * resource.getrusage(who).ru_maxrss / 1e9


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    names = re.findall(r"model name\s*: (.+)", info.read_text()) if info.exists() else []
    return names[0].strip() if names else platform.processor()


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


def _commit() -> str:
    """Short hash of the checkout; with a plus if files differ from it."""
    folder = Path(__file__).parent
    command = ["git", "-C", str(folder), "describe", "--always", "--dirty=+", "--exclude=*"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
