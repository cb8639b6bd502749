"""Processor cores available to this process."""

import os

__all__ = ["available_cores"]


def available_cores() -> int:
    """Cores that the scheduler allows this process; all of the machine if unknown.

    Fewer than the machine has inside of a container or batch job that is bound to some of them.
    """
    if hasattr(os, "sched_getaffinity"):  # not on macOS and Windows
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
