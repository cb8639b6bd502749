"""The import map of klack: which file imports which, and which room stands on which.

Run it in the folder of the project::

    python docs/import_map.py            # writes the picture and the table of the architecture page
    python docs/import_map.py --mermaid  # prints the map for a Mermaid viewer

A *room* is a package or a single module directly below ``klack``.  Rooms stand on *floors*: a room
imports rooms of lower floors only, never one of its own floor.  Every import counts: at the top of
a file, inside a function, and under ``TYPE_CHECKING``.
"""

import ast
import re
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "src" / "klack"
PAGE = ROOT / "docs" / "project" / "architecture.md"
PICTURE = ROOT / "docs" / "images" / "rooms.svg"

DOOR = "klack"
"""``klack/__init__.py``: all may read ``__version__`` there.  What it hands on to notebooks it
imports at first use, so arrows that begin there are not counted."""

FLOORS: tuple[tuple[str, ...], ...] = (
    # ground: errors, what users write, files that are whole or not there, the machine
    ("arrays", "errors"),
    ("files", "input", "signals", "studies"),
    ("machine", "materials", "units"),
    # bodies, and the valve as a network of components
    ("mesh", "report"),
    ("bodies",),
    ("contact", "measurement", "network"),
    ("case", "control", "schematic", "terminal", "thermal"),
    ("hydraulics", "magnetics"),
    # in time, and what is made of it
    ("mechanics", "simulation"),
    ("acoustics", "transient"),
    # from a case to results
    ("assembling",),
    ("analyses",),
    ("exchange", "viewer", "warming"),
    ("api", "app", "verification"),
    ("cli",),
    ("__main__",),
)
"""Rooms from the ground up."""

GROUND = 3
"""Floors that everything stands on: one row of the picture."""

Graph = Mapping[str, Iterable[str]]


def module_name(file: Path, package: Path = PACKAGE) -> str:
    """Dotted name of a file; that of a package stands for its ``__init__.py``."""
    parts = (package.name, *file.relative_to(package).with_suffix("").parts)
    return ".".join(parts).removesuffix(".__init__")


def room_of(module: str) -> str:
    """Room of a module: the part after ``klack``."""
    return module.split(".")[1] if "." in module else module


def imports(package: Path = PACKAGE) -> dict[str, set[str]]:
    """Modules of the package that each of its modules imports, anywhere in its text."""
    files = {module_name(file, package): file for file in sorted(package.rglob("*.py"))}
    graph: dict[str, set[str]] = {}
    for name, file in files.items():
        is_package = file.name == "__init__.py"
        found: set[str] = set()
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"), str(file))):
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                source = _source(node, name, is_package)
                for alias in node.names:
                    inside = f"{source}.{alias.name}"
                    found.add(inside if inside in files else source)
        graph[name] = {target for target in found if target in files} - {name}
    return graph


def _source(node: ast.ImportFrom, module: str, is_package: bool) -> str:
    """Module after ``from``, with the dots of a relative import counted from ``module``."""
    if not node.level:
        return node.module or ""
    parts = module.split(".")
    base = parts[: len(parts) - node.level + is_package]
    return ".".join([*base, *([node.module] if node.module else [])])


def circles(graph: Graph) -> list[list[str]]:
    """Groups of modules that all reach each other (strongly connected, of two or more)."""
    graph = {name: () if name == DOOR else targets for name, targets in graph.items()}
    reach = {name: _reached(graph, name) for name in graph}
    groups = {
        frozenset(other for other in reach[name] if name in reach.get(other, ())) for name in graph
    }
    return sorted(sorted(group) for group in groups if len(group) > 1)


def _reached(graph: Graph, start: str) -> set[str]:
    """Whatever is imported directly or through others."""
    seen: set[str] = set()
    waiting = list(graph.get(start, ()))
    while waiting:
        name = waiting.pop()
        if name not in seen:
            seen.add(name)
            waiting += graph.get(name, ())
    return seen


def upward(graph: Graph, floors: tuple[tuple[str, ...], ...] = FLOORS) -> list[tuple[str, str]]:
    """Imports of another room that is not on a lower floor."""
    floor = {room: level for level, rooms in enumerate(floors) for room in rooms}
    arrows = [
        (importer, imported)
        for importer, targets in graph.items()
        for imported in targets
        if DOOR not in (importer, imported) and room_of(importer) != room_of(imported)
    ]
    return sorted(
        (importer, imported)
        for importer, imported in arrows
        if floor[room_of(imported)] >= floor[room_of(importer)]
    )


def room_graph(graph: Graph) -> dict[str, set[str]]:
    """Rooms that each room imports, without the door and what is known to point upward."""
    rooms: dict[str, set[str]] = {room: set() for floor in FLOORS for room in floor}
    for importer, targets in graph.items():
        for imported in targets:
            pair = room_of(importer), room_of(imported)
            if DOOR not in pair and pair[0] != pair[1]:
                rooms[pair[0]].add(pair[1])
    return rooms


def reduced(rooms: Graph) -> dict[str, list[str]]:
    """Without the arrows that follow from others: a room's room is its own."""
    return {
        room: sorted(
            target
            for target in targets
            if not any(target in _reached(rooms, other) for other in targets if other != target)
        )
        for room, targets in rooms.items()
    }


def _drawn(rooms: Graph) -> tuple[list[tuple[str, ...]], dict[str, list[str]]]:
    """Rows of the picture from the ground up, and the arrows between what is above the ground."""
    ground = {room for floor in FLOORS[:GROUND] for room in floor}
    above = {room: set(targets) - ground for room, targets in rooms.items() if room not in ground}
    rows = [floor for floor in FLOORS[GROUND:] if floor != ("__main__",)]
    return rows, {room: targets for room, targets in reduced(above).items() if room != "__main__"}


def mermaid(graph: Graph) -> str:
    """Text of the room map for Mermaid, arrows from a room to what it stands on."""
    rows, arrows = _drawn(room_graph(graph))
    lines = ["flowchart TD"]
    lines += [f"    {room} --> {target}" for room in arrows for target in arrows[room]]
    lines += [f"    {room} --> ground" for row in rows for room in row if not arrows[room]]
    return "\n".join(lines) + "\n"


_LANE, _ROW, _WIDE, _TALL = 112, 52, 100, 28  # [px]
_LANES: Mapping[str, float] = {
    "cli": 2, "api": 1, "app": 2, "verification": 3, "warming": 4, "viewer": 2, "exchange": 3,
    "analyses": 2, "assembling": 3, "transient": 0, "acoustics": 1, "simulation": 1,
    "mechanics": 2, "hydraulics": 1, "magnetics": 3, "terminal": 0, "control": 2, "thermal": 3,
    "case": 4, "schematic": 5, "contact": 2, "network": 4, "measurement": 5, "bodies": 3,
    "report": 5, "mesh": 4,
}  # fmt: skip
"""Lane of each room in the picture, from the left; looks only."""
_MIDDLE = 2.5


def picture(graph: Graph) -> str:
    """SVG of the room map: a row for each floor, lines to what a room stands on directly."""
    rows, arrows = _drawn(room_graph(graph))
    width, height = _LANE * (2 * _MIDDLE + 1), _ROW * (len(rows) + 1)
    place = {
        room: (_LANE * (_LANES.get(room, _MIDDLE) + 0.5), _ROW * (level + 0.5))
        for level, row in enumerate(reversed(rows))
        for room in row
    }
    bottom = height - 0.5 * _ROW
    lines = [
        _line(place[room], place[target] if target else (place[room][0], bottom))
        for room, targets in arrows.items()
        for target in targets or [""]
    ]
    boxes = [_box(room, *at, _WIDE) for room, at in place.items()]
    boxes.append(_box(_GROUND, width / 2, bottom, width - 2 * (_LANE - _WIDE)))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height}" '
        'font-family="sans-serif" font-size="13" text-anchor="middle">\n'
        f'<rect width="{width:g}" height="{height}" fill="#ffffff"/>\n'
        + "\n".join([*lines, *boxes])
        + "\n</svg>\n"
    )


_GROUND = "ground: errors, input, units, files, machine, materials, signals, studies"


def _line(upper: tuple[float, float], lower: tuple[float, float]) -> str:
    (x0, y0), (x1, y1) = upper, lower
    y0, y1 = y0 + _TALL / 2, y1 - _TALL / 2
    bend = 0.5 * (y1 - y0)
    return (
        f'<path d="M{x0:g} {y0:g} C{x0:g} {y0 + bend:g} {x1:g} {y1 - bend:g} {x1:g} {y1:g}" '
        'fill="none" stroke="#7a8aa0"/>'
    )


def _box(words: str, x: float, y: float, width: float) -> str:
    return (
        f'<rect x="{x - width / 2:g}" y="{y - _TALL / 2:g}" width="{width:g}" height="{_TALL}" '
        'rx="4" fill="#eef3fa" stroke="#3d5a80"/>'
        f'<text x="{x:g}" y="{y + 4:g}" fill="#1c2733">{words}</text>'
    )


def table(graph: Graph) -> str:
    """Rooms from the top down: what each is, and what it stands on directly."""
    direct = reduced(room_graph(graph))
    lines = ["| room | what it is | stands on |", "|---|---|---|"]
    for floor in reversed(FLOORS):
        for room in floor:
            below = ", ".join(f"`{target}`" for target in direct[room]) or "-"
            lines.append(f"| `{room}` | {_first_line(room)} | {below} |")
    return "\n".join(lines) + "\n"


def _first_line(room: str) -> str:
    folder = PACKAGE / room
    file = folder / "__init__.py" if folder.is_dir() else folder.with_suffix(".py")
    words = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return words.split("\n\n")[0].replace("\n", " ").replace("``", "`").replace("|", "\\|")


_PART = re.compile(r"(?<=<!-- made by docs/import_map\.py -->\n).*?(?=<!-- end -->)", re.DOTALL)


def page(text: str, graph: Graph) -> str:
    """The architecture page with a fresh table between its two marks."""
    return _PART.sub(lambda _: "\n" + table(graph) + "\n", text)


def main() -> None:
    """Write picture and table, or print the map."""
    graph = imports()
    if sys.argv[1:] == ["--mermaid"]:
        sys.stdout.write(mermaid(graph))
    elif sys.argv[1:]:
        sys.exit("usage: python docs/import_map.py [--mermaid]")
    else:
        PICTURE.write_text(picture(graph), encoding="utf-8")
        PAGE.write_text(page(PAGE.read_text(encoding="utf-8"), graph), encoding="utf-8")


if __name__ == "__main__":
    main()
