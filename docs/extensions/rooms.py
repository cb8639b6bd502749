"""Pages of the Python API: one page for each room of klack.

A page ``reference/api/<room>.md`` (or ``<room>/<part>.md``) says in words what the room is for;
below them stands here what its modules list in ``__all__``: first a table of names, then their
docstrings.
"""

import ast
from functools import cache
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.util.typing import ExtensionMetadata

__all__ = ["modules", "public_names", "setup"]

PACKAGE = Path(__file__).resolve().parents[2] / "src" / "klack"
_FOLDER = "reference/api/"
# arrays through compiled loops; their sources are readable, their signatures no interface
_INSIDE = ("_kernel", "_step", "_rows")


def modules(room: str) -> list[str]:
    """Names of the modules of a room (a package or a single module) that belong to the API."""
    if (PACKAGE / f"{room}.py").is_file():
        return [f"klack.{room.replace('/', '.')}"]
    files = sorted((PACKAGE / room).rglob("*.py"), key=lambda f: (len(f.parts), f))
    names = [
        ".".join(("klack", *file.relative_to(PACKAGE).with_suffix("").parts)) for file in files
    ]
    names = [name.removesuffix(".__init__") for name in names]
    return [name for name in names if public_names(name) and not name.endswith(_INSIDE)]


def public_names(module: str) -> list[str]:
    """List ``__all__`` of a module without importing it."""
    for statement in _statements(module):
        if isinstance(statement, ast.Assign) and ast.unparse(statement.targets[0]) == "__all__":
            return list(ast.literal_eval(statement.value))
    return []


def setup(app: Sphinx) -> ExtensionMetadata:
    """Write the part below the words when such a page is read."""
    app.connect("source-read", _read, priority=700)
    return {"parallel_read_safe": True}


def _read(app: Sphinx, page: str, content: list[str]) -> None:
    if page.startswith(_FOLDER):
        room = page.removeprefix(_FOLDER)
        content[0] += "\n" + "\n".join(_section(module) for module in modules(room))


@cache
def _statements(module: str) -> list[ast.stmt]:
    path = PACKAGE.parent.joinpath(*module.split("."))
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return ast.parse(file.read_text(encoding="utf-8")).body


def _section(module: str) -> str:
    """One module: its docstring, a table of names, then each of them."""
    names = public_names(module)
    table = "\n".join(f"   {name}" for name in names)
    made_here = _directives(module)
    # a name of a front door is documented where it is made
    each = "\n".join(f".. {made_here[name]}" for name in names if name in made_here)
    return (
        f"## {module}\n\n```{{eval-rst}}\n.. automodule:: {module}\n   :no-members:\n\n"
        f".. currentmodule:: {module}\n\n.. autosummary::\n   :nosignatures:\n\n{table}\n\n"
        f"{each}```\n"
    )


def _directives(module: str) -> dict[str, str]:
    """The directive that documents each name which a module makes itself."""
    found = {}
    for statement in _statements(module):
        match statement:
            case ast.ClassDef(name=name):
                found[name] = f"autoclass:: {name}\n   :members:\n   :member-order: bysource\n"
            case ast.FunctionDef(name=name):
                found[name] = f"autofunction:: {name}\n"
            case ast.Assign(targets=targets):
                for target in targets:
                    for name in ast.walk(target):
                        if isinstance(name, ast.Name):
                            found[name.id] = f"autodata:: {name.id}\n   :no-value:\n"
            case ast.AnnAssign(target=ast.Name(id=name)):
                found[name] = f"autodata:: {name}\n   :no-value:\n"
    return found
