"""Write the table of docs/reference/exchange.md: what comes back from other programs.

Run it in the folder of the project: ``python docs/exchange_table.py``.  It runs the checks of
``klack verify --group exchange``.
"""

from collections.abc import Iterable
from pathlib import Path

from klack.verification import Check, run_checks

PAGE = Path(__file__).parent / "reference" / "exchange.md"
START, END = "<!-- table -->\n", "<!-- end of table -->"


def table(checks: Iterable[Check]) -> str:
    """Markdown table of what was compared, how far off it is, and what is allowed."""
    rows = ["| round trip | deviation | allowed |", "|---|---|---|"]
    rows += [
        f"| {check.name} | {abs(check.deviation):.0e} | {check.tolerance:.0e} |" for check in checks
    ]
    return "\n".join(rows) + "\n"


def main() -> None:
    """Replace the table in the page."""
    text = PAGE.read_text(encoding="utf-8")
    before, rest = text.split(START)
    _, after = rest.split(END)
    made = table(run_checks(["exchange"]))
    PAGE.write_text(f"{before}{START}{made}{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
