"""Numbers, arrays, strings and names as Modelica writes them."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["array", "class_name", "number", "table", "text"]

_WIDTH = 96
_TAKEN = frozenset(
    """algorithm and annotation assert block break class connect connector constant constrainedby
    der discrete each else elseif elsewhen encapsulated end enumeration equation expandable extends
    external false final flow for function if import impure in initial inner input loop model not
    operator or outer output package parameter partial protected public pure record redeclare
    replaceable return stream then true type when while within
    Real Integer Boolean String time q v i omega damping rest rise drift""".split()
)


def number(value: float) -> str:
    """Shortest text that reads back as the same number."""
    return repr(float(value))


def text(words: str) -> str:
    """Quoted string on one line."""
    plain = " ".join(words.split()).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{plain}"'


def class_name(name: str) -> str:
    """Name of a class that is neither a keyword nor a variable of the model."""
    return f"{name}_model" if name in _TAKEN else name


def array(declaration: str, values: ArrayLike, words: str) -> str:
    """Declaration of a vector, broken into lines."""
    return _declared(declaration, [number(x) for x in np.ravel(values)], words)


def table(declaration: str, rows: NDArray[np.float64], words: str) -> str:
    """Declaration of a matrix, row by row."""
    return _declared(declaration, ["{" + ", ".join(map(number, r)) + "}" for r in rows], words)


def _declared(declaration: str, items: list[str], words: str) -> str:
    lines, line = [f"  {declaration} = {{"], "   "
    for k, item in enumerate(items):
        end = "," if k + 1 < len(items) else ""
        if len(line) + len(item) + 2 > _WIDTH and line.strip():
            lines.append(line)
            line = "   "
        line += f" {item}{end}"
    return "\n".join([*lines, f"{line}}} {text(words)};"])
