"""The rooms of klack: no circle of files, no import of a higher floor, and a map that is fresh.

Truth: the imports in the source, and the order of the rooms that ``docs/import_map.py`` states.
"""

import ast
import importlib.util
import re
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

DOCS = Path(__file__).parents[2] / "docs"
FRESH = "run: python docs/import_map.py"


def load():
    spec = importlib.util.spec_from_file_location("import_map", DOCS / "import_map.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


MAP = load()


@pytest.fixture(scope="module")
def graph():
    return MAP.imports()


def test_every_room_has_its_floor(graph):
    stated = [room for floor in MAP.FLOORS for room in floor]

    assert {MAP.room_of(name) for name in graph} - {MAP.DOOR} == set(stated)
    assert len(stated) == len(set(stated))


def test_no_circle_of_files(graph):
    assert MAP.circles(graph) == []


def test_no_import_of_a_higher_floor(graph):
    assert MAP.upward(graph) == []


def test_the_front_door_gives_no_more_than_the_version(graph):
    """Else what it hands on would close a circle through the door."""
    for file in MAP.PACKAGE.rglob("*.py"):
        taken = re.findall(r"^\s*from klack import (\w+)", file.read_text("utf-8"), re.MULTILINE)
        assert {name for name in taken if f"klack.{name}" not in graph} <= {"__version__"}, file


def test_picture_and_page_are_fresh(graph):
    page = MAP.PAGE.read_text(encoding="utf-8")

    assert MAP.picture(graph) == MAP.PICTURE.read_text(encoding="utf-8"), FRESH
    assert MAP.page(page, graph) == page, FRESH
    assert MAP.table(graph) in page


def test_no_module_binds_a_name_twice():
    """The second constant of a name would count for code that was written for the first."""
    for file in MAP.PACKAGE.rglob("*.py"):
        bound = [
            name.id
            for statement in ast.parse(file.read_text("utf-8")).body
            if isinstance(statement, ast.Assign)
            for target in statement.targets
            for name in ast.walk(target)
            if isinstance(name, ast.Name) and isinstance(name.ctx, ast.Store)
        ]
        assert len(bound) == len(set(bound)), file


PLANTED = {
    "__init__": "",
    "low/__init__": "",
    "low/a": "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from klack.low import b\n",
    "low/b": "def late():\n    from .c import x\n",
    "low/c": "import klack.low.a as a\n",
    "high/__init__": "from klack.low.a import x",
    "high/d": "from ..low import c",
    "low/e": "async def late():\n    import klack.high.d\n",
}


def test_every_kind_of_import_is_seen(tmp_path):
    """A planted package: for its types, in functions, relative, by name, and one that goes up."""
    for name, text in PLANTED.items():
        file = tmp_path / "klack" / f"{name}.py"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")

    graph = MAP.imports(tmp_path / "klack")

    assert graph["klack.low.a"] == {"klack.low.b"}
    assert graph["klack.high"] == {"klack.low.a"}
    assert graph["klack.high.d"] == {"klack.low.c"}
    assert MAP.circles(graph) == [["klack.low.a", "klack.low.b", "klack.low.c"]]
    assert MAP.upward(graph, (("low",), ("high",))) == [("klack.low.e", "klack.high.d")]
    # rooms of one floor do not import each other either
    assert len(MAP.upward(graph, (("low", "high"),))) == 3


def test_arrows_that_follow_from_others_are_left_out():
    rooms = {"top": {"middle", "ground"}, "middle": {"ground"}, "ground": set()}

    assert MAP.reduced(rooms) == {"top": ["middle"], "middle": ["ground"], "ground": []}


def test_the_map_prints_for_mermaid(graph):
    text = MAP.mermaid(graph)

    assert text.startswith("flowchart TD\n")
    assert "    contact --> bodies\n" in text
    assert "    mesh --> ground\n" in text
