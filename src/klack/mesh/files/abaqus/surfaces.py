"""*SURFACE of a keyword file: which faces of which elements, or which nodes, it names."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.mesh.families import FAMILIES
from klack.mesh.files.abaqus.keywords import DataLine, Keyword
from klack.mesh.files.abaqus.numbers import is_integer
from klack.mesh.files.abaqus.scope import FaceSelection, Scope

__all__ = ["read_surface"]

Integers = NDArray[np.int64]

_MARKER_SIDES = {"", "SPOS", "SNEG", "S1", "S2"}  # of surface elements: each is one face


def read_surface(scope: Scope, keyword: Keyword) -> None:
    """Put the surface of one *SURFACE keyword into its scope, all sets of which are known."""
    name = keyword.parameter("NAME")
    kind = keyword.parameters.get("TYPE", "ELEMENT").upper()
    if "COMBINE" in keyword.parameters:
        _combine(scope, keyword, name)
    elif "CROP" in keyword.parameters:
        raise _unsupported(keyword, "the parameter CROP", "a surface without a box")
    elif kind == "NODE":
        rows = [scope.named(line, line.fields[0], "node") for line in _filled(keyword)]
        members = np.concatenate([np.empty(0, dtype=np.int64), *rows])
        scope.node_surfaces.add(keyword.place, name, members)
    elif kind == "ELEMENT":
        scope.surfaces.add(name, *_selections(scope, list(_filled(keyword))))
    else:
        raise _unsupported(keyword, f"TYPE={kind[:40]}", "TYPE=ELEMENT or TYPE=NODE")


def _filled(keyword: Keyword) -> list[DataLine]:
    return [line for line in keyword.lines() if line.fields]


def _unsupported(keyword: Keyword, got: str, expected: str) -> InputError:
    return InputError(
        f"{keyword.place}: *SURFACE",
        got=got,
        expected=expected,
        hint="define the surface by element faces.",
    )


def _combine(scope: Scope, keyword: Keyword, name: str) -> None:
    """Join surfaces that are defined above."""
    how = keyword.parameter("COMBINE").upper()
    if how != "UNION":
        raise _unsupported(keyword, f"COMBINE={how[:40]}", "COMBINE=UNION")
    for line in _filled(keyword):
        for other in line.fields:
            key = scope.surfaces.require(line.place, other)
            scope.surfaces.add(name, *list(scope.surfaces.parts(key)))


def _selections(scope: Scope, lines: Sequence[DataLine]) -> list[FaceSelection]:
    """Faces of all data lines; lines with one number each are looked up together."""
    found: list[FaceSelection] = []
    single: dict[str, list[DataLine]] = {}
    for line in lines:
        label = line.fields[1].upper() if len(line.fields) > 1 else ""
        if is_integer(line.fields[0]):
            single.setdefault(label, []).append(line)
        else:
            rows = scope.named(line, line.fields[0], "element")
            found.append(FaceSelection(rows, _side(scope, line, label, rows)))
    for label, those in single.items():
        numbers = np.array([int(line.fields[0]) for line in those], dtype=np.int64)
        rows = scope.elements.numbering.find(numbers)
        for index in np.flatnonzero(rows < 0).tolist():
            rows[index] = scope.named(those[index], those[index].fields[0], "element")[0]
        wrong = _wrong_sides(scope, label, rows)
        line = those[int(np.argmax(wrong))] if wrong.any() else those[0]
        found.append(FaceSelection(rows, _side(scope, line, label, rows)))
    return found


def _wrong_sides(scope: Scope, label: str, rows: Integers) -> NDArray[np.bool_]:
    """True for every element that has no such face."""
    side = int(label[1:]) if label[:1] == "S" and is_integer(label[1:]) else 0
    wrong = [
        not (label == "" or 1 <= side <= len(FAMILIES[group.family].faces))
        if group.solid
        else label not in _MARKER_SIDES
        for group in scope.groups
    ]
    return np.array(wrong, dtype=bool)[scope.group_of(rows)]


def _side(scope: Scope, line: DataLine, label: str, rows: Integers) -> int:
    wrong = _wrong_sides(scope, label, rows)
    if wrong.any():
        group = scope.groups[int(scope.group_of(rows[wrong][:1])[0])]
        sides = f"S1 to S{len(FAMILIES[group.family].faces)}" if group.solid else "SPOS or SNEG"
        raise InputError(
            line.place,
            got=f"face '{label[:40]}'",
            expected=f"{sides} ({group.family})",
            hint="check the surface in the preprocessor.",
        )
    return int(label[1:]) if is_integer(label[1:]) else 0
