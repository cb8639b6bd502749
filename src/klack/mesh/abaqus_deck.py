"""Keywords of an Abaqus or CalculiX file, collected: nodes, elements, sets, surfaces, materials."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.mesh.abaqus_elements import ElementGroup, read_elements
from klack.mesh.abaqus_keywords import DataLine, Keyword, read_keywords
from klack.mesh.abaqus_sets import NamedSets, integer, number, records
from klack.mesh.mesh_model import FileMaterial

__all__ = ["Deck", "read_deck"]

_GENERATING = {"NGEN", "NFILL", "NMAP", "NCOPY", "ELGEN", "ELCOPY", "SYSTEM"}


@dataclass
class Deck:
    """Content of the keywords, numbers as in the file."""

    nodes: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    groups: list[ElementGroup] = field(default_factory=list)
    elements: set[int] = field(default_factory=set)
    nsets: NamedSets = field(default_factory=lambda: NamedSets("node"))
    elsets: NamedSets = field(default_factory=lambda: NamedSets("element"))
    listed: list[str] = field(default_factory=list)  # names of *ELSET keywords
    surfaces: list[Keyword] = field(default_factory=list)
    sections: list[Keyword] = field(default_factory=list)
    materials: dict[str, FileMaterial] = field(default_factory=dict)
    parts: list[Keyword] = field(default_factory=list)
    instances: list[Keyword] = field(default_factory=list)


def read_deck(path: Path) -> Deck:
    """Read all keywords that describe the model, up to its steps."""
    deck = Deck()
    keywords = read_keywords(path)
    in_step = False
    for i, keyword in enumerate(keywords):
        in_step = (in_step or keyword.name == "STEP") and keyword.name != "END STEP"
        if not in_step:
            _take(deck, keyword, keywords[i + 1 :])
    return deck


def _take(deck: Deck, keyword: Keyword, rest: list[Keyword]) -> None:
    """Put one keyword into the deck."""
    match keyword.name:
        case "NODE":
            _take_nodes(deck, keyword)
        case "ELEMENT":
            _take_elements(deck, keyword)
        case "NSET":
            name = keyword.parameter("NSET")
            if "ELSET" in keyword.parameters:
                members = deck.elsets.resolve(
                    DataLine(keyword.place, ()), keyword.parameter("ELSET")
                )
                deck.nsets.add(name, _nodes_of(deck, members))
            else:
                deck.nsets.read(keyword, name, deck.nodes.__contains__)
        case "ELSET":
            name = keyword.parameter("ELSET")
            deck.elsets.read(keyword, name, deck.elements.__contains__)
            deck.listed.append(name)
        case "SURFACE":
            deck.surfaces.append(keyword)
        case "SOLID SECTION":
            deck.sections.append(keyword)
        case "MATERIAL":
            _take_material(deck, keyword, rest)
        case "PART":
            _take_single(deck.parts, keyword)
        case "INSTANCE":
            _take_single(deck.instances, keyword)
        case name if name in _GENERATING:
            raise InputError(
                f"{keyword.place}: *{keyword.name}",
                got="a keyword that makes nodes or elements",
                expected="all nodes and elements written out",
                hint="write the file again from the preprocessor, as a flat mesh.",
            )


def _take_single(seen: list[Keyword], keyword: Keyword) -> None:
    seen.append(keyword)
    if len(seen) > 1 or (keyword.name == "INSTANCE" and keyword.data):
        raise InputError(
            f"{keyword.place}: *{keyword.name}",
            got="a second one" if len(seen) > 1 else "an instance that is moved or turned",
            expected="one part with one instance in place",
            hint="write every body into its own file, or as a flat file without parts.",
        )


def _take_nodes(deck: Deck, keyword: Keyword) -> None:
    if keyword.parameters.get("SYSTEM", "R").upper() != "R":
        raise InputError(
            f"{keyword.place}: *NODE",
            got=f"SYSTEM={keyword.parameters['SYSTEM']}",
            expected="rectangular coordinates",
            hint="write the file again with global rectangular coordinates.",
        )
    numbers = []
    for line in keyword.data:
        count = len(line.fields)
        if count not in (3, 4):
            raise InputError(
                line.place,
                got=f"{count} numbers",
                expected="a node number and 2 or 3 coordinates",
                hint="the file may be cut off: write it again from the preprocessor.",
            )
        label = integer(line, line.fields[0])
        x = [number(line, text) for text in line.fields[1:]]
        if label in deck.nodes:
            _defined_twice(line, "node", label)
        deck.nodes[label] = (x[0], x[1], x[2] if count == 4 else 0.0)
        numbers.append(label)
    if "NSET" in keyword.parameters:
        deck.nsets.add(keyword.parameter("NSET"), numbers)


def _take_elements(deck: Deck, keyword: Keyword) -> None:
    group = read_elements(keyword)
    before = len(deck.elements)
    deck.elements.update(group.numbers.tolist())
    if len(deck.elements) != before + len(group.numbers):
        known = np.concatenate([*(g.numbers for g in deck.groups), group.numbers])
        labels, counts = np.unique(known, return_counts=True)
        _defined_twice(keyword.data[0], "element", int(labels[counts > 1][0]))
    missing = [n for n in np.unique(group.nodes).tolist() if n not in deck.nodes]
    if missing:
        row = int(np.flatnonzero((group.nodes == missing[0]).any(axis=1))[0])
        raise InputError(
            f"{group.place}: *ELEMENT: element {group.numbers[row]}",
            got=f"node {missing[0]}, which the file does not define above",
            expected="nodes of this file",
            hint="the file may be cut off, or its *NODE lines are in a file that is not included.",
        )
    deck.groups.append(group)
    if group.elset:
        deck.elsets.add(group.elset, group.numbers.tolist())


def _defined_twice(line: DataLine, kind: str, label: int) -> None:
    raise InputError(
        line.place,
        got=f"{kind} {label} for the second time",
        expected=f"every {kind} number once",
        hint="look for a file that is included twice, or for two parts in one file.",
    )


def _nodes_of(deck: Deck, elements: NDArray[np.int64]) -> list[int]:
    parts = [g.nodes[np.isin(g.numbers, elements)].ravel() for g in deck.groups]
    return np.unique(np.concatenate(parts)).tolist()


def _take_material(deck: Deck, keyword: Keyword, rest: list[Keyword]) -> None:
    """Read *ELASTIC (isotropic) and *DENSITY below a *MATERIAL."""
    name = keyword.parameter("NAME")
    elastic, density = None, None
    for part in rest:
        if part.name in ("MATERIAL", "STEP", "PART", "SOLID SECTION", "NODE", "ELEMENT"):
            break
        isotropic = part.parameters.get("TYPE", "ISOTROPIC").upper().startswith("ISO")
        if part.name == "ELASTIC" and isotropic:
            line, fields = next(records(part, (2, 3), "Young's modulus and Poisson's ratio"))
            elastic = number(line, fields[0]), number(line, fields[1])
        if part.name == "DENSITY":
            line, fields = next(records(part, (1, 2), "a density"))
            density = number(line, fields[0])
    if elastic is not None:
        deck.materials[name] = FileMaterial(
            name=name, young=elastic[0], poisson=elastic[1], density=density
        )
