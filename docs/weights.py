"""Weights of the source: what a reader has to read and every start has to load, room by room.

Run it in the folder of the project::

    python docs/weights.py                          # writes the page docs/project/weights.md anew
    python docs/weights.py --because "ROOM: WHY"    # where rooms have grown by more than 2 %

Only what formatting cannot change is counted: modules, statements (a docstring is none), parameters
of functions, words of docstrings, and functions above 60 statements or 8 parameters ("long").
"""

import argparse
import ast
import re
import sys
from collections.abc import Mapping
from dataclasses import astuple, dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "project" / "weights.md"
TREES = ("src/klack", "tests")
GROWTH, FEW = 0.02, 10
"""A room that has grown by a larger part, and by more statements than these, needs a reason."""
_LONGEST, _MOST = 60, 8


@dataclass(frozen=True)
class Weight:
    """Weight of a file, a room or a tree."""

    modules: int = 0
    statements: int = 0
    parameters: int = 0
    words: int = 0
    long: int = 0

    def __add__(self, other: "Weight") -> "Weight":
        return Weight(*(a + b for a, b in zip(astuple(self), astuple(other), strict=True)))


def weight(source: str) -> Weight:
    """Weight of the text of one module."""
    statements = parameters = words = long = 0
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Expr) and isinstance(text := node.value, ast.Constant):
            is_text = isinstance(text.value, str)
            words += len(text.value.split()) if is_text else 0
            statements += not is_text
        elif isinstance(node, ast.stmt):
            statements += 1
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            given = node.args
            count = len(given.posonlyargs) + len(given.args) + len(given.kwonlyargs)
            parameters += count
            inside = sum(isinstance(part, ast.stmt) for part in ast.walk(node)) - 1
            long += inside > _LONGEST or count > _MOST
    return Weight(1, statements, parameters, words, long)


def rooms(tree: Path) -> dict[str, Weight]:
    """Weight of each room: a folder of the tree, or ``.`` for the modules in the tree itself."""
    found: dict[str, Weight] = {}
    for file in sorted(tree.rglob("*.py")):
        room = "." if file.parent == tree else file.relative_to(tree).parts[0]
        found[room] = found.get(room, Weight()) + weight(file.read_text(encoding="utf-8"))
    return found


_ROW = re.compile(r"^\| `([\w.]+)` \|" + r" ([\d ]+) \|" * 5 + "$", re.MULTILINE)
_TREE = re.compile(r"^## `(.+?)`\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)
_HEAD = """
| room | modules | statements | parameters | words of docstrings | long |
|---|---|---|---|---|---|
"""
_REASONS = "## Why a room has grown\n"


def stated(page: str) -> dict[str, dict[str, Weight]]:
    """Weights that the page states, by tree and room."""
    return {
        tree: {
            row[0]: Weight(*(int(cell.replace(" ", "")) for cell in row[1:]))
            for row in _ROW.findall(part)
        }
        for tree, part in _TREE.findall(page)
    }


def grown(page: str, now: Mapping[str, Mapping[str, Weight]]) -> list[str]:
    """What has grown since the page was written, ``tree/room``; a new room has."""
    before = stated(page)
    return [
        f"{tree}/{room}"
        for tree, weights in now.items()
        for room, found in weights.items()
        if found.statements
        > (was := before.get(tree, {}).get(room, Weight()).statements) + max(GROWTH * was, FEW)
    ]


def fresh(page: str, now: Mapping[str, Mapping[str, Weight]], reason: str = "") -> str:
    """The page with the weights of now; the reasons given so far stay."""
    text = page.partition("## `")[0]
    for tree, weights in now.items():
        rows = sorted(weights.items(), key=lambda item: -item[1].statements)
        lines = [_line(f"`{room}`", found) for room, found in rows]
        text += (
            f"## `{tree}`\n{_HEAD}{''.join(lines)}{_line('all', sum(weights.values(), Weight()))}\n"
        )
    reasons = [*page.partition(_REASONS)[2].split("\n"), f"- {reason}" if reason else ""]
    return text + "\n".join([_REASONS, *filter(None, reasons)]) + "\n"


def _line(name: str, found: Weight) -> str:
    cells = " | ".join(f"{number:,}".replace(",", " ") for number in astuple(found))
    return f"| {name} | {cells} |\n"


def main() -> int:
    """Write the page, unless a room has grown without a reason."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--because", default="", metavar="ROOM, ROOM: WHY")
    reason = parser.parse_args().because
    now = {tree: rooms(ROOT / tree) for tree in TREES}
    page = PAGE.read_text(encoding="utf-8")
    explained = [room.strip() for room in reason.partition(":")[0].split(",")]
    missing = [room for room in grown(page, now) if room.rpartition("/")[2] not in explained]
    if missing:
        print(f"grown by more than {GROWTH:.0%}: {', '.join(missing)}; say why with --because")
        return 1
    PAGE.write_text(fresh(page, now, reason), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
