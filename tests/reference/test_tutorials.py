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

Quoted lines must be printed in this order; lines may be left out (:mod:`quoted_output`).  A number
with a unit in the prose must stand, to its digits, in a block of the page or in a comment
``<!-- by hand: ... -->``.
"""

import contextlib
import io
import re
import runpy
import shlex
import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from quoted_output import compare, number, unit_of_last_digit

from klack.cli.main import main

pytestmark = pytest.mark.slow

FOLDER = Path(__file__).parents[2] / "docs" / "tutorials"

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


class TestBetterValve(Tutorial):
    name = "better-valve"


class TestStairs(Tutorial):
    name = "stairs"


class TestClassicalChain(Tutorial):
    name = "classical-chain"


class TestOneValveInTwoMachines(Tutorial):
    name = "one-valve-in-two-machines"


def test_every_page_is_followed() -> None:
    pages = {path.stem for path in FOLDER.glob("*.md")} - {"index"}
    assert pages == {tutorial.name for tutorial in Tutorial.__subclasses__()}
