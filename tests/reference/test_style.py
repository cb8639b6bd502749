"""Texts use the vocabulary of the page of style; truth: the table of that page."""

import ast
import json
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
STYLE = ROOT / "docs" / "project" / "style.md"
_ROW = re.compile(r"^\| *(?P<term>[^|]+?) *\| *[^|]+\| *(?P<avoid>[^|]*?) *\|$", re.MULTILINE)
_CODE = re.compile(
    r"^( *)(`{3,}|~{3,}).*?^\1\2|``.+?``|`[^`]+`|\]\([^)]*\)"
    r"|^ *\w[\w, ]* : .*?$|^ *\w+(?:, \w+)* [(\[][^\n]*[)\]]$",  # entries of parameter lists
    re.DOTALL | re.MULTILINE,
)


@cache
def avoided() -> dict[str, str]:
    """Discarded phrase -> term to use."""
    return {
        phrase: row["term"]
        for row in [row for row in _ROW.finditer(STYLE.read_text(encoding="utf-8")) if row["avoid"]]
        if row["term"] not in ("term", "---")
        for phrase in row["avoid"].split(", ")
    }


@cache
def pattern() -> re.Pattern[str]:
    """Any discarded phrase."""
    phrases = sorted(avoided(), key=len, reverse=True)
    words = "|".join(re.escape(phrase).replace(r"\ ", r"\s+") for phrase in phrases)
    return re.compile(rf"(?<![\w-])(?:{words})(?![\w-])", re.IGNORECASE)


def pages() -> Iterator[tuple[str, str]]:
    """Pages and notebooks of the documentation, without the table of the page of style."""
    for path in [*ROOT.glob("*.md"), *ROOT.glob("*/README.md"), *(ROOT / "docs").rglob("*.md")]:
        text = path.read_text(encoding="utf-8")
        if path != STYLE and "_build" not in path.parts:
            yield str(path.relative_to(ROOT)), text
    for path in (ROOT / "docs" / "notebooks").glob("*.ipynb"):
        for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
            if cell["cell_type"] == "markdown":
                yield str(path.relative_to(ROOT)), "".join(cell["source"])


def strings() -> Iterator[tuple[str, str]]:
    """Messages, help texts and docstrings: all texts of more than one word in the source."""
    for path in (ROOT / "src").rglob("*.py"):
        source = path.read_text(encoding="utf-8")
        if not loose().search(source):
            continue
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                if len(node.value.split()) > 1:
                    yield f"{path.relative_to(ROOT)}:{node.lineno}", node.value


@cache
def loose() -> re.Pattern[str]:
    """Like :func:`pattern`, also over the end of a string that the next line continues."""
    return re.compile(pattern().pattern.replace(r"\s+", r"""[\s"rf]+"""), re.IGNORECASE)


def found(text: str) -> list[str]:
    """Discarded phrases in a text, code left out."""
    return [match.group() for match in pattern().finditer(_CODE.sub(" ", text))]


def test_the_table_is_read():
    terms = avoided()
    assert len(terms) > 20
    assert terms["ledger"] == "energy balance"
    assert found("the ledger and\nwhat goes\non, `books=`, off axis") == [
        "ledger",
        "goes\non",
        "off axis",
    ]
    assert found("bookshelf, off-axis, ```\nbooks\n```\n") == []


@pytest.mark.parametrize(
    "texts",
    [pytest.param(pages, id="pages"), pytest.param(strings, id="source")],
)
def test_texts_use_the_vocabulary(texts):
    wrong = [
        f"{where}: {phrase!r}, use {term!r}"
        for where, text in texts()
        for phrase in found(text)
        for term in [avoided()[" ".join(phrase.lower().split())]]
    ]
    assert not wrong, "\n".join(wrong)
