"""``klack verify``: klack against exact and published results."""

from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from klack.cli.options import Json, Quiet
from klack.cli.output import require_json_target, write_json
from klack.cli.progress import show_progress
from klack.cli.tables import print_table
from klack.verification.registry import GROUPS

if TYPE_CHECKING:
    from klack.verification import Check

__all__ = ["verify"]

_COLUMNS = ("group", "check", "source", "verdict", "expected", "computed", "deviation", "tolerance")


def verify(
    *,
    group: Annotated[
        list[str] | None,
        Parameter(
            name="--group",
            consume_multiple=True,
            negative="",
            help=f"{', '.join(GROUPS)}. [default: all]",
        ),
    ] = None,
    json: Json = None,
    quiet: Quiet = False,
) -> int:
    """Compare klack with exact and published results; exit code 1 if a check fails."""
    from klack.verification import iterate_checks

    require_json_target(json)
    wanted = tuple(group) if group else GROUPS
    checks: list[Check] = []
    with show_progress(quiet) as progress:
        for _, found in iterate_checks(wanted, started=lambda name: progress(name, 0.0)):
            checks += found
    failed = sum(not check.passed for check in checks)
    if not quiet:
        title = f"{len(checks) - failed} of {len(checks)} checks passed"
        print_table(title, _COLUMNS, map(_row, checks), left=4, to_stderr=str(json) == "-")
    if json is not None:
        write_json(json, {"checks": [_numbers(check) for check in checks]})
    return 1 if failed else 0


def _row(check: "Check") -> tuple[str, ...]:
    return (
        check.group,
        check.name,
        check.source,
        "ok" if check.passed else "FAILED",
        f"{check.expected:.6g}",
        f"{check.computed:.6g}",
        f"{check.deviation:+.1e}",
        f"{check.tolerance:.1e}",
    )


def _numbers(check: "Check") -> dict[str, Any]:
    def finite(value: float) -> float | None:
        return value if abs(value) < float("inf") else None

    return {
        "group": check.group,
        "name": check.name,
        "expected": finite(check.expected),
        "computed": finite(check.computed),
        "deviation": finite(check.deviation),
        "tolerance": check.tolerance,
        "passed": check.passed,
        "source": check.source,
    }
