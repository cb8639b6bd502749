"""Write docs/reference/conformance.md: every check of ``klack verify``, from one run.

Run it in the folder of the project::

    klack verify --json verify.json
    python docs/conformance_page.py verify.json

With ``--check`` nothing is written: it fails where the page lists other checks than the run has,
another tolerance or another source.

Deviations have one digit, and those that are round-off only a bound, so that the page changes where
klack changes and not with the processor.
"""

import json
import re
import sys
from collections.abc import Iterable, Mapping
from math import ceil, floor, isfinite, log10
from pathlib import Path
from typing import Any

from klack.verification import COVERS, LARGEST_HEADROOM

PAGE = Path(__file__).parent / "reference" / "conformance.md"

_ROUND_OFF, _LEAST = 1e-10, 1e-14
_OPTIONAL = re.compile("^exchange: |: direct solver ")
_HEAD = """# What klack is checked against

Made by `docs/conformance_page.py` from a run of `klack verify`; do not edit. {summary}

{conditions}

Each check compares one number that klack computes with a known one: from a closed formula, a
published table, a standard, or another program. *Deviation* is computed minus expected, relative to
the expected number; where that is zero, or where a unit is given, it is absolute. It is rounded to
one digit, and mere round-off to a bound. *Headroom* is the tolerance over the deviation: the factor
by which the error could grow unnoticed; above {largest:g} a reason is given with the source.

`klack verify --html FILE` writes the same as a page that can be searched and sorted, with the
curves; `klack verify --group NAME` runs one group. Checks of programs that are not installed
(CalculiX, fmpy, a C compiler, a second direct solver) are skipped.

"""
_MANY = f"> {LARGEST_HEADROOM:g}"
_COLUMNS = "| check | expected | computed | deviation | tolerance | headroom | source |"


def page(run: Mapping[str, Any]) -> str:
    """Markdown of the whole page from the JSON of ``klack verify``."""
    checks = run["checks"]
    passed = sum(check["passed"] for check in checks)
    wide = sum(check["wide"] for check in checks)
    summary = f"{passed} of {len(checks)} checks passed" + (
        f"; without a reason given, a tolerance is wide in {wide}." if wide else "."
    )
    conditions = ", ".join(f"{name} {text}" for name, text in run["about"].items())
    head = _HEAD.format(summary=summary, conditions=conditions, largest=LARGEST_HEADROOM)
    groups = dict.fromkeys(check["group"] for check in checks)
    return head + "\n".join(
        _section(group, [check for check in checks if check["group"] == group]) for group in groups
    )


def _section(group: str, checks: Iterable[Mapping[str, Any]]) -> str:
    lines = [f"## {group}", "", COVERS.get(group, ""), "", _COLUMNS, "|---" * 7 + "|"]
    return "\n".join([*lines, *map(row, checks), ""])


def row(check: Mapping[str, Any]) -> str:
    """One check as a row of its table."""
    source = plain(check["source"]) + (f"; *{plain(check['reason'])}*" if check["reason"] else "")
    zero = check["expected"] == 0
    cells = (
        plain(check["name"]) + ("" if check["passed"] else " **FAILED**"),
        _number(check["expected"]),
        rounded(check["computed"]) if zero else _number(check["computed"]),
        _deviation(check),
        f"{check['tolerance']:.1e}" if check["tolerance"] else "0",
        _headroom(check),
        source,
    )
    return f"| {' | '.join(cells)} |"


def plain(text: str) -> str:
    """Text in which Markdown sees no signs of its own."""
    return re.sub(r"([\\|*_`<${~])", r"\\\1", text)


def rounded(value: float | None) -> str:
    """One digit; a power of ten as a bound where the value is round-off.

    >>> rounded(3.4e-5), rounded(-3.4e-12), rounded(1e-17), rounded(0.0)
    ('3e-05', '< 1e-11', '< 1e-14', '0')
    """
    if value is None:
        return "none"
    if value == 0.0:
        return "0"
    if abs(value) >= _ROUND_OFF:
        return f"{abs(value):.0e}"
    return f"< {_bound(value):.0e}"


def _bound(value: float) -> float:
    return max(_LEAST, 10.0 ** ceil(log10(abs(value))))


def _number(value: float | None) -> str:
    return "none" if value is None or not isfinite(value) else f"{value:.6g}"


def _deviation(check: Mapping[str, Any]) -> str:
    unit = check["deviation_unit"]
    text = rounded(check["deviation"])
    return text if unit in ("relative", "absolute") or text in ("0", "none") else f"{text} {unit}"


def _headroom(check: Mapping[str, Any]) -> str:
    deviation, tolerance = check["deviation"], check["tolerance"]
    if deviation is None or not check["passed"]:
        return "none"
    if tolerance == 0.0:
        return "exact"
    if abs(deviation) >= _ROUND_OFF:
        room = tolerance / abs(deviation)
        return _MANY if room >= LARGEST_HEADROOM else f"x {float(f'{room:.1g}'):g}"
    room = tolerance / (_bound(deviation) if deviation else _LEAST)
    if room >= LARGEST_HEADROOM:
        return _MANY
    return f"> {floor(room * (1.0 + 1e-9))}" if room > 1.0 - 1e-9 else "round-off"


def differences(text: str, run: Mapping[str, Any]) -> list[str]:
    """What the page says of the checks otherwise than a run: names, tolerances, sources.

    Checks of programs that are not installed here may stand on the page alone.
    """
    there, made = listed(text), listed(page(run))
    return [
        *(f"not on the page: {name}" for name in made if name not in there),
        *(
            f"only on the page: {name}"
            for name in there
            if name not in made and not _OPTIONAL.search(name)
        ),
        *(
            f"{name}: the page has {there[name]}, the run {said}"
            for name, said in made.items()
            if there.get(name, said) != said
        ),
    ]


def listed(text: str) -> dict[str, tuple[str, str]]:
    """Tolerance and source of every row of a page, by ``group: name``."""
    found = {}
    for section in re.split(r"^## ", text, flags=re.M)[1:]:
        group, _, table = section.partition("\n")
        rows = [line for line in table.splitlines() if line.startswith("| ")]
        for line in rows[1:]:
            cells = re.split(r"(?<!\\) \| ", line[2:-2])
            found[f"{group}: {cells[0]}"] = cells[4], cells[6]
    return found


def main() -> None:
    """Write the page from the file that is named on the command line, or compare it with it."""
    match sys.argv[1:]:
        case [file]:
            PAGE.write_text(page(_run(file)), encoding="utf-8")
        case ["--check", file]:
            found = differences(PAGE.read_text(encoding="utf-8"), _run(file))
            if found:
                sys.exit("\n".join([*found, "Try: python docs/conformance_page.py FILE"]))
        case _:
            sys.exit("usage: conformance_page.py [--check] FILE   (of klack verify --json FILE)")


def _run(file: str) -> Any:
    return json.loads(Path(file).read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
