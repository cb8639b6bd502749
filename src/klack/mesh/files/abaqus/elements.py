"""Element types of Abaqus and CalculiX, and their data lines."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, refuse_if
from klack.mesh.families import FAMILIES
from klack.mesh.files.abaqus.keywords import DataLine, Keyword
from klack.mesh.files.abaqus.numbers import integer, integer_records, records
from klack.mesh.files.named_faces import ALSO_OTHERS

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


# Elements without a volume of their own, of any number of nodes.
_MAY_BE_LEFT_OUT = re.compile(
    r"[BT][23][1-3]\w*|T[23]D[23]\w*|(PIPE|ELBOW|FRAME)\d\w*|SPRING[12A]|DASHPOT[12A]|MASS|"
    r"ROTARYI|HEATCAP|CONN[23]D2|GAP(UNI|CYL|SPHER)\w*|DCOUP[23]D|RB[23]D2|R2D2|RAX2|JOINT\w+|"
    r"(ITT|ISL|DRAG)\w+|(S|DS|M3D|SFM3D|CPS|CPE|STRI|R3D|MCL|SFMCL)\d+\w*"
)


@dataclass(frozen=True)
class ElementGroup:
    """Elements of one *ELEMENT keyword.

    Parameters
    ----------
    family
        "" for ignored elements, with numbers alone.
    solid
        False for surface elements.
    numbers (n,)
    nodes (n, k)
        Rows.
    first
        Row of the first element.
    elset
        Of the keyword, or "".
    instance
        Of a part, or "".
    kind
        Element type in the file.
    """

    family: str
    solid: bool
    numbers: NDArray[np.int64]
    nodes: NDArray[np.int64]
    first: int
    elset: str
    instance: str
    place: str
    kind: str

    @property
    def rows(self) -> NDArray[np.int64]:
        """Rows of the elements."""
        return np.arange(self.first, self.first + len(self.numbers))

    def adopted(self, instance: str, first_node: int, first_element: int) -> "ElementGroup":
        """Elements of an instance."""
        return replace(
            self,
            nodes=self.nodes + first_node if first_node else self.nodes,
            first=self.first + first_element,
            elset=f"{instance}.{self.elset}" if self.elset else "",
            instance=instance,
        )


def read_elements(keyword: Keyword, *, solids_only: bool) -> tuple[str, bool, NDArray[np.int64]]:
    """Family, whether it is a solid, and the records of one *ELEMENT keyword.

    With ``solids_only`` others have the family "" and records of their number.
    """
    kind = keyword.parameter("TYPE").upper()
    if _is_left_out(keyword, kind):
        if not solids_only:
            _refuse(keyword, kind, ALSO_OTHERS)
        own = [integer(line, line.fields[0]) for line in keyword.lines() if line.fields]
        return "", False, np.array(own, dtype=np.int64).reshape(-1, 1)
    family, solid = _family(keyword, kind)
    refuse_if(
        "OFFSET" in keyword.parameters,
        f"{keyword.place}: *ELEMENT",
        got="the parameter OFFSET, which generates node numbers",
        expected="all nodes listed explicitly",
        hint="write the file again from the preprocessor, as a flat mesh.",
    )
    return family, solid, integer_records(keyword, *_record(family, kind))


def place_of_element(keyword: Keyword, label: int, count: int) -> str:
    """Place of record ``count``, from 1, of an element."""
    kind = keyword.parameter("TYPE").upper()
    found: Iterable[tuple[DataLine, Sequence[str]]]
    if _is_left_out(keyword, kind):
        found = ((line, line.fields) for line in keyword.lines() if line.fields)
    else:
        width, what = _record(_family(keyword, kind)[0], kind)
        found = records(keyword, (width, width), what)
    for line, fields in found:
        count -= int(fields[0]) == label
        if not count:
            return line.place
    return keyword.place


def _record(family: str, kind: str) -> tuple[int, str]:
    nodes = FAMILIES[family].nodes
    return nodes + 1, f"an element number and {nodes} nodes ({kind})"


def _is_left_out(keyword: Keyword, kind: str) -> bool:
    """True for elements that are neither solids nor fit to mark a surface.

    So is a beam with a third node for its direction.
    """
    if _SOLID.match(kind) or not _MAY_BE_LEFT_OUT.fullmatch(kind):
        return False
    family = next((f for f, known in _SURFACES.items() if re.fullmatch(known, kind)), None)
    if family is None:
        return True
    first = next(iter(keyword.lines()), None)
    width = FAMILIES[family].nodes + 1
    return family.startswith("line") and first is not None and len(first.fields) > width


def _family(keyword: Keyword, kind: str) -> tuple[str, bool]:
    match = _SOLID.match(kind)
    if match:
        return _SOLIDS[match[1]], True
    for family, pattern in _SURFACES.items():
        if re.fullmatch(pattern, kind):
            return family, False
    of_meshio = " meshio writes quadrilaterals like this." if kind == "CAX4P" else ""
    _refuse(keyword, kind, f"remove elements of other kinds from the file.{of_meshio}")


def _refuse(keyword: Keyword, kind: str, hint: str) -> NoReturn:
    raise InputError(
        f"{keyword.place}: *ELEMENT",
        got=f"TYPE={kind[:40]}",
        expected="C3D4, C3D10, C3D8, C3D20, C3D6, C3D15, CAX3, CAX4, CAX6, CAX8 (and their "
        "variants R, H, I, M), or surface elements such as S3, STRI65, CPS6, SFM3D4",
        hint=hint,
    )
