"""Meaning of the rows of a matrix: a table of node and direction.

Understood are ``node.direction`` (CalculiX ``.dof``), ``node, direction`` and
``row, node, direction`` (the mapping that ANSYS HBMAT writes).  A direction is 1 to 6, x, y, z,
UX, UY, UZ, R or Z, or ROTX ... for rotations.
"""

import re
from pathlib import Path

import numpy as np

from klack.errors import InputError, refuse
from klack.model_files.system_matrix import RowPlaces

__all__ = ["read_row_places"]

_LARGEST = 1 << 30
_SPLIT = re.compile(r"[\s,;]+")
_POINTED = re.compile(r"^(\d{1,15})\.([1-6])$")
_DIRECTION = {
    **{str(k): k for k in range(1, 7)},
    **{f"{k}.": k for k in range(1, 7)},
    **{"x": 1, "y": 2, "z": 3, "ux": 1, "uy": 2, "uz": 3, "u1": 1, "u2": 2, "u3": 3},
    **{"rotx": 4, "roty": 5, "rotz": 6, "ur1": 4, "ur2": 5, "ur3": 6},
}
_TURNED = {"r": 1, "ur": 1}


def read_row_places(path: Path) -> RowPlaces:
    """Read the table.

    Raises
    ------
    InputError
        With the line that cannot be understood, or for a place that comes twice.
    """
    if path.stat().st_size > _LARGEST:
        hint = "give the table of node and direction alone."
        raise InputError(str(path), got="more than 1 GB", expected="a table", hint=hint)
    node: list[int] = []
    direction: list[int] = []
    turned = False
    # undecodable letters cannot be part of a table
    lines = path.read_bytes().decode("utf-8-sig", "replace").splitlines()
    for number, line in enumerate(lines, start=1):
        words = [word for word in _SPLIT.split(line.strip().lower()) if word]
        if not words or words[0][0] in "#%!*$":
            continue
        pointed = _POINTED.match(words[0]) if len(words) == 1 else None
        if pointed:
            words = [pointed[1], pointed[2]]
        turned = turned or words[-1] in _TURNED
        place = _place(words, turned)
        if place is None:
            if not node and not any(word[0].isdigit() for word in words):
                continue  # a heading
            raise _wrong(f"{path}:{number}", f"'{line.strip()[:40]}'")
        if len(words) == 3 and int(words[0]) != len(node) + 1:
            raise _wrong(f"{path}:{number}", f"row {words[0]} after row {len(node)}")
        node.append(place[0])
        direction.append(place[1])
    places = RowPlaces(np.array(node, dtype=np.int64), np.array(direction, dtype=np.int64))
    refuse(
        (not node, _wrong(str(path), "no rows")),
        (
            len(np.unique(8 * places.node + places.direction)) < len(node),
            _wrong(str(path), "the same node and direction twice"),
        ),
    )
    return places


def _place(words: list[str], turned: bool) -> tuple[int, int] | None:
    if len(words) not in (2, 3) or not all(word.isascii() for word in words):
        return None
    if not all(word.isdigit() and len(word) < 16 for word in words[:-1]) or words[-2] == "0":
        return None
    known = _DIRECTION | _TURNED
    way = known.get(words[-1])
    if way is None:
        return None
    return int(words[-2]), 2 if turned and words[-1] in ("z", "uz") else way


def _wrong(where: str, got: str) -> InputError:
    return InputError(
        where,
        got=got,
        expected="node and direction of one row (1 to 3, or x, y, z), in the order of the matrix",
        hint="one line per row, such as '17, x'; CalculiX writes 17.1, HBMAT a mapping file.",
    )
