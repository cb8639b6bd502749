"""Progress reports of a long step."""

from collections.abc import Callable

__all__ = ["Progress", "silent"]

Progress = Callable[[str, float], None]
"""Called with the name of a stage and the completed fraction, 0 to 1."""


def silent(stage: str, fraction: float) -> None:
    """No progress report."""
