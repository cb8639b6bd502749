"""``klack schema``: every key of a case file."""

from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from klack.terminal.output import require_json_target, write_json

__all__ = ["schema"]


def schema(
    *,
    kind: Annotated[
        Literal["impact", "stroke", "study", "result"],
        Parameter(
            name="--kind",
            help="impact: two bodies that hit each other (klack impact, klack reduce); stroke: a "
            "whole valve with all components of its network (klack stroke); study: a study in a "
            "file of its own; result: what every command writes with --json.",
        ),
    ] = "impact",
    json: Annotated[
        Path,
        Parameter(
            name="--json",
            allow_leading_hyphen=True,
            help="Write to this file; - for the terminal.",
        ),
    ] = Path("-"),
) -> int:
    """Print the JSON schema of case files, for editors that check while one types, or results."""
    require_json_target(json)
    write_json(json, _schema_of(kind))
    return 0


def _schema_of(kind: str) -> dict[str, Any]:
    # the components of a network take a while to import
    if kind == "stroke":
        from klack.case.any_case import valve_case_schema

        return valve_case_schema()

    if kind == "study":
        from klack.case.reader import schema_of
        from klack.case.study import StudyFile

        return schema_of(StudyFile)

    if kind == "result":
        from klack.analyses.json_results import result_schema

        return result_schema()

    from klack.case import case_schema

    return case_schema()
