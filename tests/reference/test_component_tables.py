"""The tables of components name every component type, and no other; truth: the catalogue."""

import re
from importlib import import_module
from pathlib import Path

import pytest

from klack.network.catalogue import component_class, type_words

REFERENCE = Path(__file__).parents[2] / "docs" / "reference"
PAGES = sorted(REFERENCE.glob("*components.md"))
_HEAD = re.compile(r"^\| klack \|.*\| tested against \|$")
_CODE = re.compile(r"`([^`]+)`")


def rows() -> list[tuple[str, list[str]]]:
    """Page and cells of every row of the tables that begin with klack."""
    found = []
    for page in PAGES:
        inside = False
        for line in page.read_text(encoding="utf-8").splitlines():
            if not line.startswith("|"):
                inside = False
            elif _HEAD.match(line):
                inside = True
            elif inside and not line.startswith("|--"):
                found.append((page.name, [cell.strip() for cell in line[1:-1].split("|")]))
    return found


def named(cell: str) -> tuple[list[str], list[str]]:
    """Types that a cell of the first column names, and the keys after 'with'."""
    before, _, after = cell.partition(" with ")
    return _CODE.findall(before), _CODE.findall(after)


def test_every_component_stands_in_a_table():
    listed = {word for _, cells in rows() for word in named(cells[0])[0]}

    assert sorted(set(type_words()) - listed) == []


def test_the_tables_name_what_exists():
    words = set(type_words())
    for page, cells in rows():
        types, keys = named(cells[0])
        assert types, (page, cells[0])
        assert set(types) <= words, (page, cells[0])
        for key in keys:
            assert keys_of(types[0], key), (page, cells[0], key)


def keys_of(word: str, key: str) -> bool:
    """Whether a component has a key, itself or in one of its parts."""
    fields = component_class(word).model_fields
    inner = [
        part
        for field in fields.values()
        for part in re.findall(r"klack[\w.]*\.\w+", str(field.annotation))
    ]
    return key in fields or any(key in getattr(resolve(name), "model_fields", ()) for name in inner)


def resolve(path: str) -> object:
    """Class of a dotted path."""
    module, name = path.rsplit(".", 1)
    try:
        return getattr(import_module(module), name, None)
    except ImportError:
        return None


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_each_row_names_others_and_a_number_or_a_truth(page):
    found = [cells for name, cells in rows() if name == page.name]

    assert len(found) > 5
    for cells in found:
        assert len(cells) == 5, cells[0]
        assert cells[-1], cells[0]
