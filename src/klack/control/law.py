"""What a control law is once it runs."""

from collections.abc import Callable, Mapping

__all__ = ["Law"]

Law = Callable[[float, Mapping[str, float]], float]
"""Output [V], [N] or [Pa] for a time [s] and the signals by sensor, each in its unit."""
