"""Notes of a study: printed below its tables, and by a quiet command as well."""

import sys
from collections.abc import Iterable, Mapping
from math import isnan
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from klack.workflow.study import LevelResult

__all__ = ["ends_in_contact", "print_notes"]


def ends_in_contact(levels: Mapping[str, "LevelResult"]) -> tuple[str, ...]:
    """Say which runs ended before the bodies had parted: their restitution is nan."""
    names = [name for name, result in levels.items() if isnan(result.measures.restitution)]
    if not names:
        return ()
    return (
        f"{', '.join(names)}: the run ends before the bodies have parted. Contact time and impulse "
        "are cut off, and there is no restitution. Try: a longer run.duration, two to three times "
        "the contact time.",
    )


def print_notes(notes: Iterable[str], *, to_stderr: bool) -> None:
    """Print what makes a result doubtful or incomplete, one line each.

    ``--quiet`` leaves tables and progress out, not these: they go to standard error then.
    """
    for note in notes:
        print(f"Note: {note}", file=sys.stderr if to_stderr else sys.stdout)
