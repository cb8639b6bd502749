"""Notes of a study: printed below its tables, and by a quiet command as well."""

import sys
from collections.abc import Iterable

__all__ = ["print_notes"]


def print_notes(notes: Iterable[str], *, to_stderr: bool) -> None:
    """Print what makes a result doubtful or incomplete, one line each.

    ``--quiet`` leaves tables and progress out, not these: they go to standard error then.
    """
    for note in notes:
        print(f"Note: {note}", file=sys.stderr if to_stderr else sys.stdout)
