"""Reports of finished studies, of either kind, beside their results."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from klack.report.study_content import Study

__all__ = ["REPORTS", "remove_reports", "write_reports"]

REPORTS = ("report.html", "report.pdf")


def write_reports(study: "Study", folder: Path) -> None:
    """Write the report of a study as HTML and as PDF."""
    from klack.report.html import write_report
    from klack.report.pdf import write_pdf

    page, print_ = (folder / name for name in REPORTS)
    write_report(study, page)
    write_pdf(study, print_)


def remove_reports(folder: Path) -> None:
    """Remove reports that do not belong to the result any more."""
    for name in REPORTS:
        (folder / name).unlink(missing_ok=True)
