"""``klack verify``: klack against exact and published results."""

import sys
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from textwrap import fill
from typing import Annotated

from cyclopts import Parameter

from klack.terminal.options import SHOWN, Shown
from klack.terminal.output import require_file_target
from klack.terminal.progress import show_progress
from klack.terminal.tables import print_table
from klack.verification.check import (
    COVERS,
    GROUPS,
    Check,
    deviation_text,
    headroom_text,
    iterate_checks,
    number_text,
    summary,
    tolerance_text,
)

__all__ = ["verify"]


_COLUMNS = ("group", "verdict", "checks", "failed", "wide", "least headroom", "largest")
_CLOSEST = 5
_WIDTH = 100


def print_groups() -> None:
    """One sentence per group."""
    width = max(map(len, COVERS)) + 2
    for group, sentence in COVERS.items():
        indent = " " * width
        print(fill(sentence, _WIDTH, initial_indent=f"{group:<{width}}", subsequent_indent=indent))


def print_checks(checks: Sequence[Check], *, every: bool = False, to_stderr: bool) -> None:
    """Print a row per group, then the failed checks and the closest, or all of them.

    A check needs its name, its source and five numbers: too wide for 100 columns, and too many
    rows to find the one that matters.
    """
    groups = dict.fromkeys(check.group for check in checks)
    rows = [_row(group, [check for check in checks if check.group == group]) for group in groups]
    print_table(f"{summary(checks)}\n", _COLUMNS, rows, left=2, to_stderr=to_stderr)
    stream = sys.stderr if to_stderr else sys.stdout
    lines = chain.from_iterable(map(_lines, checks)) if every else _worst_lines(checks)
    for line in lines:
        print(line, file=stream)


def _row(group: str, checks: Sequence[Check]) -> tuple[str, ...]:
    failed = sum(not check.passed for check in checks)
    compared = [check for check in checks if check.tolerance > 0 and check.passed]
    by_headroom = sorted(compared, key=lambda check: check.headroom)
    return (
        group,
        "FAILED" if failed else "ok",
        str(len(checks)),
        str(failed),
        str(sum(check.is_wide for check in checks)),
        headroom_text(by_headroom[0]) if by_headroom else "",
        headroom_text(by_headroom[-1]) if by_headroom else "",
    )


def _worst_lines(checks: Sequence[Check]) -> Iterator[str]:
    for check in checks:
        if not check.passed:
            yield from _lines(check)
    close = [check for check in checks if check.passed and check.tolerance > 0]
    close.sort(key=lambda check: check.headroom)
    if close:
        yield "Closest to their tolerance (--all prints every check, --html makes a page):"
    for check in close[:_CLOSEST]:
        yield from _lines(check)


def _lines(check: Check) -> Iterator[str]:
    verdict = "ok" if check.passed else "FAILED"
    name = f"{check.group}: {check.name}"
    indent = " " * 8
    yield fill(name, _WIDTH, initial_indent=f"{verdict:<8}", subsequent_indent=indent)
    numbers = (
        f"expected {number_text(check.expected)}, computed {number_text(check.computed)}, "
        f"deviation {deviation_text(check)}, tolerance {tolerance_text(check)} "
        f"({headroom_text(check)})"
    )
    yield fill(numbers, _WIDTH, initial_indent=indent, subsequent_indent=indent)
    words = f"source: {check.source}" + (f"; {check.reason}" if check.reason else "")
    yield fill(words, _WIDTH, initial_indent=indent, subsequent_indent=indent)


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
    from klack.analyses.json_results import command_json
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
    wanted.write(lambda: command_json("verify", about=run_conditions(), checks=checks))
    return 0 if all(check.passed for check in checks) else 1
