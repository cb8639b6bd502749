"""Progress reports of a long step."""

from collections.abc import Callable

__all__ = ["Progress", "remark", "silent"]

Progress = Callable[[str, float], None]
"""Called with the name of a stage and the completed fraction, 0 to 1."""


def remark(progress: Progress, line: str) -> None:
    """Show a line of text where progress is shown, if the reporter has a method ``remark``."""
    show = getattr(progress, "remark", None)
    if show is not None:
        show(line)


def silent(stage: str, fraction: float) -> None:
    """No progress report."""
