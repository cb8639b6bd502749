"""Element types of Abaqus and CalculiX, and their data lines."""

import re
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.mesh.abaqus_keywords import Keyword
from klack.mesh.abaqus_numbers import integer_records, records
from klack.mesh.families import FAMILIES

__all__ = ["ElementGroup", "place_of_element", "read_elements"]

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
        As in the file.
    nodes : int array, shape (n, k)
        Rows of the nodes.
    first : int
        Row of the first element; the others follow.
    elset : str
        Set that the keyword names, or "".
    instance : str
        Instance of a part, or "".
    place : str
    """

    family: str
    solid: bool
    numbers: NDArray[np.int64]
    nodes: NDArray[np.int64]
    first: int
    elset: str
    instance: str
    place: str

    @property
    def rows(self) -> NDArray[np.int64]:
        """Rows of the elements."""
        return np.arange(self.first, self.first + len(self.numbers))

    def adopted(self, instance: str, first_node: int, first_element: int) -> "ElementGroup":
        """Elements of an instance, with its name before the set."""
        return replace(
            self,
            nodes=self.nodes + first_node if first_node else self.nodes,
            first=self.first + first_element,
            elset=f"{instance}.{self.elset}" if self.elset else "",
            instance=instance,
        )


def read_elements(keyword: Keyword) -> tuple[str, bool, NDArray[np.int64]]:
    """Family, whether it is a solid, and the records of one *ELEMENT keyword."""
    kind = keyword.parameter("TYPE").upper()
    family, solid = _family(keyword, kind)
    if "OFFSET" in keyword.parameters:
        raise InputError(
            f"{keyword.place}: *ELEMENT",
            got="the parameter OFFSET, which makes node numbers",
            expected="all nodes written out",
            hint="write the file again from the preprocessor, as a flat mesh.",
        )
    return family, solid, integer_records(keyword, *_record(family, kind))


def place_of_element(keyword: Keyword, label: int, count: int) -> str:
    """Place of the record number ``count``, from 1, of an element."""
    kind = keyword.parameter("TYPE").upper()
    width, what = _record(_family(keyword, kind)[0], kind)
    for line, fields in records(keyword, (width, width), what):
        count -= int(fields[0]) == label
        if not count:
            return line.place
    return keyword.place


def _record(family: str, kind: str) -> tuple[int, str]:
    nodes = FAMILIES[family].nodes
    return nodes + 1, f"an element number and {nodes} nodes ({kind})"


def _family(keyword: Keyword, kind: str) -> tuple[str, bool]:
    match = _SOLID.match(kind)
    if match:
        return _SOLIDS[match[1]], True
    for family, pattern in _SURFACES.items():
        if re.fullmatch(pattern, kind):
            return family, False
    raise InputError(
        f"{keyword.place}: *ELEMENT",
        got=f"TYPE={kind[:40]}",
        expected="C3D4, C3D10, C3D8, C3D20, C3D6, C3D15, CAX3, CAX4, CAX6, CAX8 (and their "
        "variants R, H, I, M), or surface elements such as S3, STRI65, CPS6, SFM3D4",
        hint="take elements of other kinds out of the file.",
    )
