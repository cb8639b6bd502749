"""One self-contained page of all checks: tables, curves, and a few lines of plain JavaScript.

The page loads nothing from anywhere; its content security policy forbids it.  Without JavaScript,
and on paper, all tables are open and complete; what needs JavaScript is not shown then.
"""

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined

from klack.report.printed import svg_chart
from klack.verification.check import LARGEST_HEADROOM, Check, ComparedCurve
from klack.verification.curve_chart import curve_chart
from klack.verification.registry import COVERS
from klack.verification.run_conditions import RunConditions
from klack.verification.wording import (
    deviation_text,
    headroom_text,
    number_text,
    summary,
    tolerance_text,
)
from klack.whole_file import whole_file

__all__ = ["render_page", "write_page"]

_WIDTH = 4.6
"""Of a plot [in]: three stand beside each other on a wide screen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plot:
    """A drawn curve and the numbers of the checks that it belongs to."""

    name: str
    image: bytes
    checks: tuple[tuple[int, str], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """One group: numbered checks, and each curve once."""

    group: str
    covers: str
    rows: tuple[tuple[int, Check, str], ...]
    plots: tuple[Plot, ...]

    @property
    def failed(self) -> int:
        """Number of failed checks."""
        return sum(not check.passed for _, check, _ in self.rows)

    @property
    def wide(self) -> int:
        """Number of wide tolerances without a reason."""
        return sum(check.is_wide for _, check, _ in self.rows)


def write_page(path: Path, checks: Sequence[Check], conditions: RunConditions) -> None:
    """Write the page; an interruption leaves an earlier one as it was."""
    text = render_page(checks, conditions)
    with whole_file(path) as new:
        new.write_text(text, encoding="utf-8")


def render_page(checks: Sequence[Check], conditions: RunConditions) -> str:
    """HTML of all checks, in the order of their groups."""
    environment = Environment(
        loader=PackageLoader("klack.verification", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["base64"] = lambda data: b64encode(data).decode()
    environment.filters["number"] = number_text
    environment.filters["deviation"] = deviation_text
    environment.filters["tolerance"] = tolerance_text
    environment.filters["headroom"] = headroom_text
    failed = sum(not check.passed for check in checks)
    return environment.get_template("page.html").render(
        sections=_sections(checks),
        conditions=conditions.words(),
        summary=summary(checks),
        failed=failed,
        wide=sum(check.is_wide for check in checks),
        largest=f"{LARGEST_HEADROOM:g}",
    )


def _sections(checks: Sequence[Check]) -> tuple[Section, ...]:
    groups = dict.fromkeys(check.group for check in checks)
    numbered = tuple(enumerate(checks, 1))
    return tuple(
        _section(group, [(i, check) for i, check in numbered if check.group == group])
        for group in groups
    )


def _section(group: str, checks: Sequence[tuple[int, Check]]) -> Section:
    curves: dict[int, ComparedCurve] = {}
    users: dict[int, list[tuple[int, str]]] = {}
    for number, check in checks:
        if check.curve is not None:
            curves[id(check.curve)] = check.curve
            users.setdefault(id(check.curve), []).append((number, check.name))
    names = {key: f"{group}-{k}" for k, key in enumerate(curves, 1)}
    return Section(
        group=group,
        covers=COVERS.get(group, ""),
        rows=tuple((i, check, names.get(id(check.curve), "")) for i, check in checks),
        plots=tuple(
            Plot(
                name=names[key],
                image=svg_chart(curve_chart(curve, name=names[key], title=group), width=_WIDTH),
                checks=tuple(users[key]),
            )
            for key, curve in curves.items()
        ),
    )
