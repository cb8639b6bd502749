"""Options that several commands share."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.errors import InputError, require_positive

if TYPE_CHECKING:
    from klack.network.component import Component

__all__ = [
    "CaseArgument",
    "CheckSteps",
    "Components",
    "Json",
    "Levels",
    "Out",
    "Quiet",
    "Report",
    "StudyPath",
    "Threads",
    "imported",
    "require_files",
    "require_threads",
]

CaseArgument = Annotated[
    Path, Parameter(name="CASE", help="Case file (YAML), or the name of a shipped case.")
]
Json = Annotated[
    Path | None,
    Parameter(
        name="--json",
        allow_leading_hyphen=True,
        help="Write plain numbers in SI to this file; - for the terminal.",
    ),
]
Out = Annotated[
    Path | None,
    Parameter(name="--out", help="Folder for the results. [default: klack-results/NAME]"),
]
Report = Annotated[bool, Parameter(help="Write report.html and report.pdf.")]
Quiet = Annotated[
    bool, Parameter(name=["--quiet", "-q"], negative="", help="No progress and no tables.")
]
Threads = Annotated[
    int | None, Parameter(name="--threads", help="Processor cores to use. [default: all]")
]
StudyPath = Annotated[
    Path | None,
    Parameter(name="--study", help="File with a section 'study'. [default: that of the case]"),
]
CheckSteps = Annotated[
    bool | None,
    Parameter(
        name="--check-steps",
        help="Run strokes again with all steps twice as long; halve them where that changes first "
        "impacts by more than half of what the accuracy promises. [default: as in the case, or "
        "yes; of a search its front alone; in three dimensions compared only]",
    ),
]
Components = Annotated[
    list[str] | None,
    Parameter(
        name="--component",
        negative="",
        help="Class of your own that the case may name as a type, package.module:Class; its "
        "module is run. Several times for several classes.",
    ),
]
Levels = Annotated[
    list[str] | None,
    Parameter(
        name="--level",
        consume_multiple=True,
        negative="",
        help="lumped, reduced, reduced-attachment, reduced-none, reduced-participation, "
        "interface, full; several (a,b,c) are compared. [default: as in the case]",
    ),
]


def imported(words: Sequence[str] | None) -> "tuple[type[Component], ...]":
    """Import the classes that the user named by ``--component``."""
    if not words:
        return ()

    from klack.network.own_component import import_component

    return tuple(import_component(word) for word in words)


def require_threads(threads: int | None) -> None:
    """Refuse a number of processor cores that cannot be."""
    if threads is not None:
        require_positive("--threads", threads, "cores")


def require_files(option: str, files: Sequence[Path]) -> None:
    """Refuse files that are not there, before the long work begins."""
    for file in files:
        if not file.is_file():
            raise InputError(
                f"{option} {file}",
                got="a folder" if file.is_dir() else "no such file",
                expected="a file",
                hint="check the spelling; the path is relative to the current folder.",
            )
