"""What in a docstring of klack would read as markup and is none."""

import re
from typing import Any

from sphinx.application import Sphinx
from sphinx.util.typing import ExtensionMetadata

__all__ = ["setup"]

_KEYWORD = re.compile(r"(?<![\\`*\w])\*(?=[A-Z])")  # *NODE, of Abaqus and CalculiX


def setup(app: Sphinx) -> ExtensionMetadata:
    """Mend docstrings while they are read."""
    app.connect("autodoc-process-docstring", _mend, priority=400)
    return {"parallel_read_safe": True}


def _mend(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    if what == "data":  # a constant without words of its own brings those of its type
        inherited = (getattr(type(thing), "__doc__", None) or "").strip().splitlines()
        if inherited and lines and lines[0].strip() == inherited[0].strip():
            lines.clear()
    lines[:] = [line if "``" in line else _KEYWORD.sub(r"\\*", line) for line in lines]
