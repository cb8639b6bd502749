"""Processor cores that this process may use."""

import os

__all__ = ["available_cores"]


def available_cores() -> int:
    """Cores that the scheduler lets this process have; all of the machine where it does not say.

    Fewer than the machine has inside of a container or batch job that is bound to some of them.
    """
    if hasattr(os, "sched_getaffinity"):  # not on macOS and Windows
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
