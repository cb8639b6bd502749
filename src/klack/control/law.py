"""What a control law is once it runs, and what makes one."""

from collections.abc import Callable, Mapping
from typing import Protocol, runtime_checkable

__all__ = ["Law", "LawMaker"]

Law = Callable[[float, Mapping[str, float]], float]
"""Output [V], [N] or [Pa] for a time [s] and the signals by sensor, each in its unit."""


@runtime_checkable
class LawMaker(Protocol):
    """Something that gives each run a fresh law."""

    def begin(self, period: float) -> Law:
        """Fresh law for a sample time [s]."""
