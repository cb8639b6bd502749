"""``klack demo``: the shipped valve, from its drawing to a report in the browser."""

import os
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from klack.analyses.impact.command import run_case
from klack.terminal.options import Out
from klack.terminal.wanted import WANTED, Wanted, WantedResult

__all__ = ["demo"]

_CASE = Path("demo-valve")


def demo(
    *,
    open: Annotated[bool, Parameter(help="Show the report in the browser.")] = True,
    out: Out = None,
    wanted: Wanted = WANTED,
) -> int:
    """Compute the shipped valve, reduced and in full, and show the report."""
    from klack.case import shipped_cases

    # by its full path: a file of the same name in the working folder is not the demo
    case = shipped_cases().get(_CASE.name, _CASE)
    levels = ["reduced", "full"]
    folder = run_case(case, levels, WantedResult(**vars(wanted), out=out))
    if open and _has_display():
        import webbrowser

        webbrowser.open((folder / "report.html").resolve().as_uri())
    return 0


def _has_display() -> bool:
    """Tell whether somebody sits in front of a screen that shows a browser."""
    if not sys.stdout.isatty():
        return False
    if sys.platform in ("darwin", "win32"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
