"""The tutorials do what they say: every file is written, every command run, every number compared.

Truth: the page itself, as a change detector of klack and of the page; the physics behind the
numbers has tests of its own.  A page is followed from top to bottom in an empty folder:

=================================  ===============================================================
on the page                        what happens
=================================  ===============================================================
a link to ``files/NAME``           that file is there from the beginning
``# file: NAME`` in a block        the block is written under that name
``diff`` with ``---`` and ``+++``  the first file with these lines changed, under the second name
``console`` with ``$ klack ...``   the command runs; the lines below it are what it prints
``console`` with ``$ python ...``  the script runs, in the same way
=================================  ===============================================================

Quoted lines must be printed in this order; lines may be left out.  Words are the same, numbers
within 1 % or two units of their last digit: meshers, linear algebra and compilers of other
machines move them by some 0.1 %.  A number with a unit in the prose must stand, to its digits, in
a block of the page or in a comment ``<!-- by hand: ... -->``.
"""

import contextlib
import io
import math
import re
import runpy
import shlex
import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from klack.cli.main import main

pytestmark = pytest.mark.slow

FOLDER = Path(__file__).parents[2] / "docs" / "tutorials"

RELATIVE, LAST_DIGITS = 0.01, 2.0
ROUNDING = 1e-8
"""Where residuals of an energy balance are nothing but rounding."""

FREE_COLUMNS = ("wall time [s]", "real-time factor", "steps")
"""Columns that belong to the machine, or to the last bits."""

NUMBER = re.compile(r"(?<![\w.])[-+−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.]*\w)")
UNITS = "N|mN|kN|ns|us|ms|s|nm|um|mm|mm^3|m/s|g|Hz|kHz|MHz|dB|sone|uJ|mJ|bar|V|A|%"
WITH_UNIT = re.compile(rf"(?<![\w.])[-+−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?= ?(?:{UNITS})(?![\w/^]))")


@dataclass(frozen=True)
class Block:
    """A fenced block: what kind, its text, its first line on the page."""

    kind: str
    text: str
    line: int


class Page:
    """A tutorial and what it asks of its reader."""

    def __init__(self, name: str) -> None:
        self.path = FOLDER / f"{name}.md"
        self.text = self.path.read_text(encoding="utf-8")

    def blocks(self) -> Iterator[Block]:
        """All fenced blocks, in their order."""
        for found in re.finditer(r"^```(\w*)\n(.*?)^```$", self.text, re.DOTALL | re.MULTILINE):
            line = self.text[: found.start()].count("\n") + 2
            yield Block(found[1], found[2], line)

    def prose(self) -> str:
        """The page without blocks, comments, code and links."""
        text = re.sub(r"^```.*?^```$", "", self.text, flags=re.DOTALL | re.MULTILINE)
        text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
        return re.sub(r"`[^`]*`|\]\([^)]*\)", " ", text)

    def by_hand(self) -> str:
        """Numbers of the prose that no block holds."""
        return " ".join(re.findall(r"<!-- by hand: (.*?) -->", self.text, re.DOTALL))

    def follow(self) -> None:
        """Do all of it in the present folder."""
        for name in set(re.findall(r"\]\(files/([\w.]+)\)", self.text)):
            shutil.copy(FOLDER / "files" / name, name)
        for block in self.blocks():
            place = f"{self.path.name}:{block.line}"
            if block.kind == "console":
                run_console(block, place)
            elif block.kind == "diff":
                change_file(block.text, place)
            elif named := re.match(r"# file: (\S+)\n", block.text):
                Path(named[1]).write_text(block.text, encoding="utf-8")

    def check_prose(self) -> None:
        """Every number with a unit stands in a block, to the digits that the prose gives."""
        stock = " ".join(block.text for block in self.blocks()) + self.by_hand()
        # "0.6mm" and "[0.6," in a block count as well
        known = [abs(float(x)) for x in re.findall(r"\d+(?:\.\d+)?(?:e[-+]?\d+)?", stock)]
        for text in WITH_UNIT.findall(self.prose()):
            value = abs(number(text))
            half = 0.5 * unit_of_last_digit(text) * (1 + 1e-9)
            assert any(abs(value - x) <= half for x in known), (
                f"{self.path.name}: {text} is nowhere"
            )


def change_file(text: str, place: str) -> None:
    """Apply a block of lines with ' ', '-' and '+' in front."""
    head = re.match(r"--- (\S+)\n\+\+\+ (\S+)\n", text)
    assert head, f"{place}: a diff begins with '--- old' and '+++ new'"
    whole = Path(head[1]).read_text(encoding="utf-8")
    lines = text[head.end() :].splitlines()
    # an empty line or '@@' stands between changes
    for hunk in re.split(r"\n@@\n", "\n".join(lines)):
        rows = hunk.splitlines()
        old = "\n".join(row[1:] for row in rows if row[0] in " -")
        new = "\n".join(row[1:] for row in rows if row[0] in " +")
        assert whole.count(old) == 1, f"{place}: not once in {head[1]}: {old}"
        whole = whole.replace(old, new)
    Path(head[2]).write_text(whole, encoding="utf-8")


def run_console(block: Block, place: str) -> None:
    """Run the commands of a block and compare what they print."""
    for part in re.split(r"^\$ ", block.text, flags=re.MULTILINE)[1:]:
        command, _, quoted = part.partition("\n")
        code, printed = run(command)
        assert code == 0 or "Try: " in quoted, f"{place}: $ {command}: exit {code}\n{printed}"
        compare(quoted, printed, f"{place}: $ {command}")


def run(command: str) -> tuple[int, str]:
    """Exit code of a command, and all that it printed."""
    program, *arguments = shlex.split(command)
    stream = io.StringIO()
    with contextlib.redirect_stdout(stream), contextlib.redirect_stderr(stream):
        if program == "klack":
            code = main(arguments)
        elif program == "python":
            before = sys.argv, sys.path
            sys.argv, sys.path = arguments, [str(Path.cwd()), *sys.path]
            try:
                runpy.run_path(arguments[0], run_name="__main__")
            finally:
                sys.argv, sys.path = before
            code = 0
        else:
            raise AssertionError(f"$ {command}: only klack and python are run")
    # a reader's folder has another name
    return code, stream.getvalue().replace(f"{Path.cwd()}/", "")


def compare(quoted: str, printed: str, place: str) -> None:
    """Every quoted line is printed, in this order."""
    there = [cells(line) for line in printed.splitlines()]
    free: set[int] = set()
    position = 0
    for line in quoted.splitlines():
        wanted = cells(line)
        if not wanted:
            continue
        if wanted[-1] in FREE_COLUMNS or FREE_COLUMNS[0] in wanted:
            free = {i for i, cell in enumerate(wanted) if cell in FREE_COLUMNS}
        for i, found in enumerate(there[position:], position):
            if same_cells(wanted, found, free):
                position = i + 1
                break
        else:
            raise AssertionError(f"{place}\nnot printed: {line}\nin:\n{printed}")


def cells(line: str) -> list[str]:
    """Cells of a row of a table, or the whole line; rules are nothing."""
    return [cell for cell in re.split(r" {2,}", line.strip()) if cell.strip("─━-= ")]


def same_cells(wanted: list[str], found: list[str], free: set[int]) -> bool:
    """Whether two rows agree, but for columns that are free."""
    return len(wanted) == len(found) and all(
        i in free or same(a, b) for i, (a, b) in enumerate(zip(wanted, found, strict=True))
    )


def same(quoted: str, printed: str) -> bool:
    """Whether words are the same and numbers agree."""
    if NUMBER.sub("#", quoted) != NUMBER.sub("#", printed):
        return False
    pairs = zip(NUMBER.findall(quoted), NUMBER.findall(printed), strict=True)
    return all(agree(a, b) for a, b in pairs)


def agree(quoted: str, printed: str) -> bool:
    """Whether two numbers agree within 1 % or two units of the last quoted digit."""
    a, b = number(quoted), number(printed)
    if max(abs(a), abs(b)) < ROUNDING:
        return True
    margin = max(RELATIVE * abs(b), LAST_DIGITS * unit_of_last_digit(quoted))
    return math.isclose(a, b, rel_tol=0.0, abs_tol=margin * (1 + 1e-9))


def number(text: str) -> float:
    """Value of a printed number."""
    return float(text.replace("−", "-"))


def unit_of_last_digit(text: str) -> float:
    """What one more in the last digit means; 0.01 for "1.23"."""
    mantissa, _, exponent = text.partition("e")
    return 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


# One class for each page: a worker of pytest-xdist takes a class as a whole.


class Tutorial:
    """A page followed from top to bottom."""

    name: str

    @pytest.mark.slow
    def test_the_page_can_be_followed(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.chdir(tmp_path)
        Page(self.name).follow()

    def test_numbers_of_the_prose_stand_in_its_blocks(self) -> None:
        Page(self.name).check_prose()


class TestOwnStep(Tutorial):
    name = "own-step"


class TestOwnInp(Tutorial):
    name = "own-inp"


class TestDryImpact(Tutorial):
    name = "dry-impact"


class TestWetStroke(Tutorial):
    name = "wet-stroke"


class TestMeasurement(Tutorial):
    name = "measurement"


class TestSystemTool(Tutorial):
    name = "system-tool"


class TestQuieterDesign(Tutorial):
    name = "quieter-design"


def test_every_page_is_followed() -> None:
    pages = {path.stem for path in FOLDER.glob("*.md")} - {"index"}
    assert pages == {tutorial.name for tutorial in Tutorial.__subclasses__()}


def test_the_comparison_sees_a_wrong_number_a_wrong_word_and_a_missing_line() -> None:
    printed = "  level     force [N]   wall time [s]\n ─────\n  reduced   123.4    0.1\nall done\n"
    compare("level   force [N]   wall time [s]\nreduced   123.9   9.9\nall done\n", printed, "")
    for wrong in ("reduced  125.6  0.1", "full  123.4  0.1", "all done\nreduced  123.4  0.1"):
        with pytest.raises(AssertionError, match="not printed"):
            compare(wrong, printed, "")
