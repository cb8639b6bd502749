"""``klack verify``: klack against exact and published results."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.cli.verify_text import print_checks, print_groups
from klack.terminal.output import require_file_target
from klack.terminal.progress import show_progress
from klack.terminal.wanted import SHOWN, Shown
from klack.verification.check import GROUPS

if TYPE_CHECKING:
    from klack.analyses.json_results import CheckJson, VerificationJson
    from klack.verification import Check

__all__ = ["verify"]


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
    html: Annotated[
        Path | None,
        Parameter(name="--html", help="Write a page of all checks with their curves to this file."),
    ] = None,
    every: Annotated[
        bool, Parameter(name="--all", negative="", help="Print every check, not only the worst.")
    ] = False,
    listing: Annotated[
        bool, Parameter(name="--list", negative="", help="List the groups with what each covers.")
    ] = False,
    wanted: Shown = SHOWN,
) -> int:
    """Compare klack with exact and published results; exit code 1 if a check fails."""
    if listing:
        print_groups()
        return 0
    from klack.verification import iterate_checks
    from klack.verification.run_conditions import run_conditions

    require_file_target("--html", html)
    groups = tuple(group) if group else GROUPS
    checks: list[Check] = []
    with show_progress(wanted.quiet) as progress:
        for _, found in iterate_checks(groups, started=lambda name: progress(name, 0.0)):
            checks += found
        if html is not None:
            from klack.verification.page import write_page

            progress("page", 0.0)
            write_page(html, checks, run_conditions())
    if not wanted.quiet:
        print_checks(checks, every=every, to_stderr=wanted.to_stderr)
        if html is not None and not wanted.to_stderr:
            print(f"Page in {html}")
    wanted.write(lambda: _results(run_conditions(), checks))
    return 0 if all(check.passed for check in checks) else 1


def _results(about: dict[str, str], checks: "list[Check]") -> "VerificationJson":
    return {
        "schema": "klack-verify/1",
        "about": about,
        "checks": [_numbers(check) for check in checks],
    }


def _numbers(check: "Check") -> "CheckJson":
    def finite(value: float) -> float | None:
        return value if abs(value) < float("inf") else None

    return {
        "group": check.group,
        "name": check.name,
        "expected": finite(check.expected),
        "computed": finite(check.computed),
        "deviation": finite(check.deviation),
        "deviation_unit": check.deviation_unit,
        "tolerance": check.tolerance,
        "headroom": finite(check.headroom),
        "wide": check.is_wide,
        "passed": check.passed,
        "source": check.source,
        "reason": check.reason,
    }
