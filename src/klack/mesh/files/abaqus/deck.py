"""Keywords of an Abaqus or CalculiX file: parts, instances, assembly, materials."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from klack.arrays import Flags, Floats, Ints
from klack.errors import AccuracyWarning, InputError, refuse_if
from klack.mesh.families import FAMILIES
from klack.mesh.files.abaqus.keywords import DataLine, Keyword, read_keywords
from klack.mesh.files.abaqus.numbers import is_integer, number, records
from klack.mesh.files.abaqus.scope import FaceSelection, Instance, Scope, Section
from klack.mesh.files.mesh_model import FileMaterial
from klack.mesh.rigid import rotation_matrix

__all__ = ["Deck", "read_deck"]


LARGEST_NODES = 100_000_000
"""Most nodes of all instances together."""


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """Rigid displacement of an instance, in the units of the file.

    Parameters
    ----------
    shift (3,)
    turn (3, 3)
    about (3,)
        Of the axis, after the shift.
    """

    shift: Floats
    turn: Floats
    about: Floats

    @property
    def along_axis(self) -> bool:
        """True if a body of revolution (r = x, z = y) stays one."""
        return not self.shift[[0, 2]].any() and np.array_equal(self.turn, np.eye(3))

    def of(self, points: Floats) -> Floats:
        """Points (n, 3) of the part, where the instance has them."""
        if not self.shift.any() and np.array_equal(self.turn, np.eye(3)):
            return points
        moved = points + self.shift
        if np.array_equal(self.turn, np.eye(3)):
            return moved
        return (moved - self.about) @ self.turn.T + self.about


def read_placement(keyword: Keyword) -> Placement:
    r"""Placement of an *INSTANCE; without data lines as the part is drawn.

    Data lines: a translation :math:`t`, then two points :math:`a, b` of an axis and an angle in
    degrees,

    .. math:: x' = R\,(x + t - a) + a .
    """
    rows = [[number(line, t) for t in line.fields] for line in keyword.lines() if line.fields]
    refuse_if(
        [len(row) for row in rows] not in ([], [3], [3, 7]),
        f"{keyword.place}: *INSTANCE",
        got=f"data lines of {', '.join(str(len(row)) for row in rows[:8])} numbers",
        expected="a translation (3 numbers) and, if rotated, two points and an angle (7)",
        hint="write both lines, with zeros for no translation.",
    )
    shift = np.array(rows[0] if rows else [0.0, 0.0, 0.0])
    if len(rows) < 2:
        return Placement(shift, np.eye(3), np.zeros(3))
    a, b, angle = np.array(rows[1][:3]), np.array(rows[1][3:6]), np.deg2rad(rows[1][6])
    length = float(np.linalg.norm(b - a))
    refuse_if(
        not (length > 0 and np.isfinite(length)),
        f"{keyword.place}: *INSTANCE",
        got=f"an axis of length {length:g}",
        expected="two different points of the axis",
        hint="check the second data line: two points and an angle in degrees.",
    )
    return Placement(shift, rotation_matrix((b - a) / length * angle), a)


def add_instance(root: Scope, name: str, part: Scope, placement: Placement, place: str) -> None:
    """Put an instance into the assembly, its sets and surfaces as ``name.set``."""
    refuse_if(
        name.upper() in root.instances,
        f"{place}: *INSTANCE",
        got=f"a second instance '{name[:80]}'",
        expected="every name once",
        hint="give every instance its own name.",
    )
    refuse_if(
        root.nodes.count + part.nodes.count > LARGEST_NODES,
        f"{place}: *INSTANCE",
        got=f"{root.nodes.count + part.nodes.count} nodes with this instance",
        expected=f"at most {LARGEST_NODES}",
        hint="leave out unneeded instances.",
    )
    _require_revolution(part, placement, place)
    node, element = root.nodes.count, root.elements.count
    root.instances[name.upper()] = Instance(name, part, node, element)
    root.labels += part.labels
    root.points += [placement.of(points) for points in part.points]
    root.groups += [group.adopted(name, node, element) for group in part.groups]
    root.nodes.count += part.nodes.count
    root.elements.count += part.elements.count
    root.nodes.sets.adopt(place, name, part.nodes.sets, node)
    root.elements.sets.adopt(place, name, part.elements.sets, element)
    root.node_surfaces.adopt(place, name, part.node_surfaces, node)
    root.surfaces.adopt(
        name, part.surfaces, lambda part: FaceSelection(part.elements + element, part.side)
    )
    root.listed += [f"{name}.{key}".upper() for key in part.listed]
    root.sections += [Section(f"{name}.{s.elset}".upper(), s.material) for s in part.sections]


def _require_revolution(part: Scope, placement: Placement, place: str) -> None:
    flat = any(group.solid and FAMILIES[group.family].dimension == 2 for group in part.groups)
    refuse_if(
        flat and not placement.along_axis,
        f"{place}: *INSTANCE",
        got="an axisymmetric part that is rotated, or moved away from its axis",
        expected="a translation along y, which is the axis",
        hint="draw the part at its radius.",
    )


_MARKER_SIDES = {"", "SPOS", "SNEG", "S1", "S2"}  # of surface elements: each is one face


def read_surface(scope: Scope, keyword: Keyword) -> None:
    """Put a *SURFACE into its scope, whose sets are known."""
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
    """Faces of all data lines; those with one number are looked up together."""
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


def _wrong_sides(scope: Scope, label: str, rows: Ints) -> Flags:
    """True for elements without such a face."""
    side = int(label[1:]) if label[:1] == "S" and is_integer(label[1:]) else 0
    wrong = [
        not (label == "" or 1 <= side <= len(FAMILIES[group.family].faces))
        if group.solid
        else label not in _MARKER_SIDES
        for group in scope.groups
    ]
    return np.array(wrong, dtype=bool)[scope.group_of(rows)]


def _side(scope: Scope, line: DataLine, label: str, rows: Ints) -> int:
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


_GENERATING = {"NGEN", "NFILL", "NMAP", "NCOPY", "ELGEN", "ELCOPY"}
_IGNORED = {
    "TRANSFORM",
    *("TIE", "EQUATION", "MPC", "COUPLING", "KINEMATIC", "DISTRIBUTING", "RIGID BODY"),
    *("EMBEDDED ELEMENT", "KINEMATIC COUPLING", "DISTRIBUTING COUPLING", "MODEL CHANGE"),
}
_READ = (
    *("NODE", "ELEMENT", "NSET", "ELSET", "SURFACE", "SOLID SECTION", "SYSTEM", "INCLUDE"),
    *("MATERIAL", "ELASTIC", "DENSITY", "PART", "INSTANCE", "ASSEMBLY", "HEADING"),
)
_ALIKE = {"PLASTIC"}  # other keywords that are one letter away from one of them
_TAGS = "gmsh:bounding_entities"
_END_OF_MATERIAL = {"MATERIAL", "STEP", "PART", "ASSEMBLY", "SOLID SECTION", "NODE", "ELEMENT"}


@dataclass(frozen=True, slots=True)
class Deck:
    """Content of a file: all instances in one scope, and materials."""

    scope: Scope
    materials: dict[str, FileMaterial]
    foreign: dict[str, str]
    """Materials that are not isotropic, in words."""


def read_deck(path: Path, *, solids_only: bool = False) -> Deck:
    """Read all keywords of the model, without its steps; perhaps solids only.

    Warns
    -----
    AccuracyWarning
        Once, of *TRANSFORM or constraints between nodes, which are ignored, and of what meshio
        makes of the boundaries of Gmsh.
    """
    reader = _Reader(path, Scope(solids_only=solids_only))
    in_step = False
    for keyword in read_keywords(path):
        in_step = (in_step or keyword.name == "STEP") and keyword.name != "END STEP"
        if not in_step:
            reader.take(keyword)
    return reader.finish()


@dataclass
class _Material:
    """A *MATERIAL with values still to come."""

    name: str
    elastic: tuple[float, float] | None = None
    density: float | None = None


@dataclass
class _Reader:
    """Where in the file we are."""

    path: Path
    root: Scope = field(default_factory=Scope)
    parts: dict[str, Scope] = field(default_factory=dict)
    scope: Scope | None = None  # of the part or instance that is open
    opened: Keyword | None = None
    assembly: Keyword | None = None  # that is open
    placement: Placement | None = None
    material: _Material | None = None
    materials: dict[str, FileMaterial] = field(default_factory=dict)
    foreign: dict[str, str] = field(default_factory=dict)
    ignored: dict[str, str] = field(default_factory=dict)
    tags: str = ""  # place of the set of meshio that holds none of elements

    def take(self, keyword: Keyword) -> None:
        """Process one keyword."""
        if keyword.name in _END_OF_MATERIAL:
            self.material = None
        match keyword.name:
            case "PART" | "INSTANCE":
                self._open(keyword)
            case "END PART" | "END INSTANCE":
                self._close(keyword)
            case "ASSEMBLY" | "END ASSEMBLY":
                self._require_closed(keyword)
                self.assembly = keyword if keyword.name == "ASSEMBLY" else None
            case "MATERIAL":
                self.material = _Material(keyword.parameter("NAME"))
            case "ELASTIC" | "DENSITY":
                self._take_value(keyword)
            case "ELSET" if keyword.parameters.get("ELSET", "").lower() == _TAGS:
                self.tags = keyword.place
            case name if name in _GENERATING:
                raise InputError(
                    f"{keyword.place}: *{keyword.name}",
                    got="a keyword that generates nodes or elements",
                    expected="all nodes and elements listed explicitly",
                    hint="write the file again from the preprocessor, as a flat mesh.",
                )
            case name if name in _IGNORED:
                self.ignored.setdefault(name, keyword.place)
            case name if name not in _ALIKE and (meant := _slip(name)) is not None:
                raise InputError(
                    keyword.place,
                    got=f"*{name}",
                    expected=f"*{meant}",
                    hint="correct the keyword; its content would be ignored.",
                )
            case _:
                (self.root if self.scope is None else self.scope).take(keyword)

    def _require_closed(self, keyword: Keyword) -> None:
        if self.opened is not None:
            raise InputError(
                f"{keyword.place}: *{keyword.name}",
                got=f"*{self.opened.name} of {self.opened.place} without its end",
                expected=f"*END {self.opened.name} before",
                hint="the file may be truncated or edited by hand.",
            )

    def _open(self, keyword: Keyword) -> None:
        self._require_closed(keyword)
        name = keyword.parameter("NAME" if keyword.name == "PART" else "PART").upper()
        if keyword.name == "PART":
            refuse_if(
                name in self.parts,
                f"{keyword.place}: *PART",
                got=f"a second part '{keyword.parameter('NAME')[:80]}'",
                expected="every name once",
                hint="look for a file that is included twice.",
            )
            self.scope = Scope(solids_only=self.root.solids_only)
        else:
            keyword.parameter("NAME")
            refuse_if(
                name not in self.parts,
                f"{keyword.place}: *INSTANCE",
                got=f"PART={keyword.parameter('PART')[:80]}",
                expected=f"a part that is defined above ({', '.join(self.parts) or 'none'})",
                hint="check the spelling; instances of results files are not read.",
            )
            self.scope = self.parts[name].copy()
            self.placement = read_placement(keyword)
        self.opened = keyword

    def _close(self, keyword: Keyword) -> None:
        opened = self.opened
        if self.scope is None or opened is None or keyword.name != f"END {opened.name}":
            raise InputError(
                f"{keyword.place}: *{keyword.name}",
                got="an end without a start",
                expected=f"*{keyword.name.removeprefix('END ')} before",
                hint="the file may be reordered or edited by hand.",
            )
        _finish(self.scope)
        if opened.name == "PART":
            self.parts[opened.parameter("NAME").upper()] = self.scope
        elif self.placement is not None:
            name = opened.parameter("NAME")
            add_instance(self.root, name, self.scope, self.placement, opened.place)
        self.scope = self.opened = self.placement = None

    def _take_value(self, keyword: Keyword) -> None:
        """Read *ELASTIC (isotropic) or *DENSITY of the present material."""
        if self.material is None:
            return
        if keyword.name == "DENSITY":
            line, fields = _first_record(keyword, (1, 2), "a density")
            self.material.density = number(line, fields[0])
        elif not (kind := keyword.parameters.get("TYPE", "ISOTROPIC").upper()).startswith("ISO"):
            self.foreign[self.material.name] = f"anisotropic (*ELASTIC, TYPE={kind[:40]})"
        else:
            line, fields = _first_record(keyword, (2, 3), "Young's modulus and Poisson's ratio")
            self.material.elastic = number(line, fields[0]), number(line, fields[1])
        if self.material.elastic is not None:
            young, poisson = self.material.elastic
            self.materials[self.material.name] = FileMaterial(
                name=self.material.name,
                young=young,
                poisson=poisson,
                density=self.material.density,
            )

    def finish(self) -> Deck:
        """Resolve what waits for the end of the file."""
        if (opened := self.opened or self.assembly) is not None:
            raise InputError(
                f"{opened.place}: *{opened.name}",
                got="the end of the file",
                expected=f"*END {opened.name} before",
                hint="the file may be truncated: write it again from the preprocessor.",
            )
        if self.parts and not self.root.instances:
            self._add_only_part()
        _finish(self.root)
        self._warn()
        shown = {name.upper(): name for name in self.materials}
        self.root.sections = [
            replace(section, material=shown.get(section.material.upper(), section.material))
            for section in self.root.sections
        ]
        return Deck(self.root, self.materials, self.foreign)

    def _add_only_part(self) -> None:
        """A part without an assembly is taken as drawn."""
        refuse_if(
            len(self.parts) > 1 or self.root.groups,
            str(self.path),
            got=f"{len(self.parts)} parts and no *INSTANCE",
            expected="an assembly with instances of the parts",
            hint="write the whole model, or one part per file.",
        )
        ((name, part),) = self.parts.items()
        placement = read_placement(Keyword("INSTANCE", {}, str(self.path)))
        add_instance(self.root, name, part, placement, str(self.path))

    def _warn(self) -> None:
        if self.tags:
            warnings.warn(
                f"ignored: *ELSET, ELSET={_TAGS} ({self.tags}), in which meshio stores tags of "
                "Gmsh instead of element numbers.",
                AccuracyWarning,
                stacklevel=4,
            )
        if self.ignored:
            found = ", ".join(f"*{name} ({place})" for name, place in self.ignored.items())
            warnings.warn(
                f"ignored: {found}. Only mesh, sets and materials are read; directions of "
                "loads and constraints between nodes are not.",
                AccuracyWarning,
                stacklevel=4,
            )


def _slip(name: str) -> str | None:
    """Known keyword that differs in one letter: missing, added, another, or two swapped."""
    for known in _READ:
        shorter = min(len(name), len(known))
        first = next((i for i in range(shorter) if name[i] != known[i]), shorter)
        last = next((i for i in range(shorter) if name[-1 - i] != known[-1 - i]), shorter)
        last = min(last, shorter - first)
        typed, meant = name[first : len(name) - last], known[first : len(known) - last]
        if (typed, meant) == ("", ""):
            return None
        if max(len(typed), len(meant)) == 1 or (len(typed) == 2 and typed == meant[::-1]):
            return known
    return None


def _first_record(
    keyword: Keyword, lengths: tuple[int, int], what: str
) -> tuple[DataLine, list[str]]:
    for line, fields in records(keyword, lengths, what):
        return line, fields
    raise InputError(
        f"{keyword.place}: *{keyword.name}",
        got="no data line",
        expected=what,
        hint="the file may be truncated or edited by hand.",
    )


def _finish(scope: Scope) -> None:
    """Resolve surfaces and sections, which may name later sets."""
    for keyword in scope.waiting:
        if keyword.name == "SURFACE":
            read_surface(scope, keyword)
        else:
            name = keyword.parameter("ELSET")
            key = scope.elements.sets.names.require(keyword.place, name)
            scope.sections.append(Section(key, keyword.parameters.get("MATERIAL", "")))
    scope.waiting.clear()
