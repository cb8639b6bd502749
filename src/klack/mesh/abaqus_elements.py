"""Element types of Abaqus and CalculiX, and their data lines."""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.mesh.abaqus_keywords import Keyword
from klack.mesh.abaqus_sets import integer, records
from klack.mesh.families import FAMILIES

__all__ = ["ElementGroup", "read_elements"]

# Letters behind the name (reduced, hybrid, modified, incompatible, thermal) keep the nodes.
_SOLIDS = {
    **{"C3D4": "tet4", "C3D10": "tet10", "C3D8": "hex8", "C3D20": "hex20"},
    **{"C3D6": "wedge6", "C3D15": "wedge15"},
    **{"CAX3": "tri3", "CAX4": "quad4", "CAX6": "tri6", "CAX8": "quad8"},
}
_SOLID = re.compile(r"(C3D(?:4|6|8|10|15|20)|CAX[3468])[RHIMST]*$")
_SURFACES = {
    "tri3": r"(S|DS|CPS|CPE|M3D|SFM3D|R3D|STRI)3R?",
    "tri6": r"(S|DS|CPS|CPE|M3D|SFM3D)6M?|STRI65",
    "quad4": r"(S|DS|CPS|CPE|M3D|SFM3D|R3D)4(R|I|RS|R5)?",
    "quad8": r"(S|DS|CPS|CPE|M3D|SFM3D)8(R|R5)?",
    "line2": r"T[23]D2|B[23]1|SAX1|MAX1|SFMAX1|RAX2",
    "line3": r"T[23]D3|B[23]2|SAX2|MAX2|SFMAX2",
}


@dataclass(frozen=True)
class ElementGroup:
    """Elements of one *ELEMENT keyword.

    Parameters
    ----------
    family : str
    solid : bool
        False for surface elements.
    numbers : int array, shape (n,)
    nodes : int array, shape (n, k)
        Node numbers of the file.
    elset : str
        Set that the keyword names, or "".
    place : str
    """

    family: str
    solid: bool
    numbers: NDArray[np.int64]
    nodes: NDArray[np.int64]
    elset: str
    place: str


def read_elements(keyword: Keyword) -> ElementGroup:
    """Elements of one *ELEMENT keyword."""
    kind = keyword.parameter("TYPE").upper()
    family, solid = _family(keyword, kind)
    count = FAMILIES[family].nodes
    rows = [
        [integer(line, text) for text in fields]
        for line, fields in records(
            keyword, (count + 1, count + 1), f"an element number and {count} nodes ({kind})"
        )
    ]
    table = np.array(rows, dtype=np.int64).reshape(-1, count + 1)
    return ElementGroup(
        family=family,
        solid=solid,
        numbers=table[:, 0],
        nodes=table[:, 1:],
        elset=keyword.parameters.get("ELSET", ""),
        place=keyword.place,
    )


def _family(keyword: Keyword, kind: str) -> tuple[str, bool]:
    match = _SOLID.match(kind)
    if match:
        return _SOLIDS[match[1]], True
    for family, pattern in _SURFACES.items():
        if re.fullmatch(pattern, kind):
            return family, False
    raise InputError(
        f"{keyword.place}: *ELEMENT",
        got=f"TYPE={kind}",
        expected="C3D4, C3D10, C3D8, C3D20, C3D6, C3D15, CAX3, CAX4, CAX6, CAX8 (and their "
        "variants R, H, I, M), or surface elements such as S3, STRI65, CPS6, SFM3D4",
        hint="take elements of other kinds out of the file.",
    )
