"""``klack schema``: every key of a case file."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from klack.cli.output import require_json_target, write_json

__all__ = ["schema"]


def schema(
    *,
    json: Annotated[
        Path,
        Parameter(
            name="--json",
            allow_leading_hyphen=True,
            help="Write to this file; - for the terminal.",
        ),
    ] = Path("-"),
) -> int:
    """Print the JSON schema of case files, for editors that check while one types."""
    from klack.case import case_schema

    require_json_target(json)
    write_json(json, case_schema())
    return 0
