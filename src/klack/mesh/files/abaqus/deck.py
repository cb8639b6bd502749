"""Keywords of an Abaqus or CalculiX file, collected: parts, instances, assembly, materials."""

import warnings
from dataclasses import dataclass, field, replace
from pathlib import Path

from klack.errors import AccuracyWarning, InputError
from klack.mesh.files.abaqus.instances import Placement, add_instance, read_placement
from klack.mesh.files.abaqus.keywords import DataLine, Keyword, read_keywords
from klack.mesh.files.abaqus.numbers import number, records
from klack.mesh.files.abaqus.scope import Scope, Section
from klack.mesh.files.abaqus.surfaces import read_surface
from klack.mesh.files.mesh_model import FileMaterial

__all__ = ["Deck", "read_deck"]

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
_END_OF_MATERIAL = {"MATERIAL", "STEP", "PART", "ASSEMBLY", "SOLID SECTION", "NODE", "ELEMENT"}


@dataclass(frozen=True, slots=True)
class Deck:
    """Content of a file: all instances in one scope, and the materials."""

    scope: Scope
    materials: dict[str, FileMaterial]
    foreign: dict[str, str]
    """Materials that are not isotropic, and what they are."""


def read_deck(path: Path, *, solids_only: bool = False) -> Deck:
    """Read all keywords that describe the model, without its steps.

    With ``solids_only`` elements of other kinds are left out.

    Warns
    -----
    AccuracyWarning
        Once, if the file holds *TRANSFORM or constraints between nodes, which are ignored.
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
    """A *MATERIAL of which the values are still coming."""

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
            case name if name in _GENERATING:
                raise InputError(
                    f"{keyword.place}: *{keyword.name}",
                    got="a keyword that makes nodes or elements",
                    expected="all nodes and elements written out",
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
            if name in self.parts:
                raise InputError(
                    f"{keyword.place}: *PART",
                    got=f"a second part '{keyword.parameter('NAME')[:80]}'",
                    expected="every name once",
                    hint="look for a file that is included twice.",
                )
            self.scope = Scope(solids_only=self.root.solids_only)
        else:
            keyword.parameter("NAME")
            if name not in self.parts:
                raise InputError(
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
        """Resolve what had to wait for the end of the file."""
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
        if len(self.parts) > 1 or self.root.groups:
            raise InputError(
                str(self.path),
                got=f"{len(self.parts)} parts and no *INSTANCE",
                expected="an assembly with instances of the parts",
                hint="write the whole model, or one part per file.",
            )
        ((name, part),) = self.parts.items()
        placement = read_placement(Keyword("INSTANCE", {}, str(self.path)))
        add_instance(self.root, name, part, placement, str(self.path))

    def _warn(self) -> None:
        if self.ignored:
            found = ", ".join(f"*{name} ({place})" for name, place in self.ignored.items())
            warnings.warn(
                f"ignored: {found}. Only mesh, sets and materials are read; directions of "
                "loads and constraints between nodes are not.",
                AccuracyWarning,
                stacklevel=4,
            )


def _slip(name: str) -> str | None:
    """Keyword that is read and differs in one letter: left out, added, another, or two swapped."""
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
    """Resolve surfaces and sections, which may name sets that come after them."""
    for keyword in scope.waiting:
        if keyword.name == "SURFACE":
            read_surface(scope, keyword)
        else:
            name = keyword.parameter("ELSET")
            key = scope.elements.sets.names.require(keyword.place, name)
            scope.sections.append(Section(key, keyword.parameters.get("MATERIAL", "")))
    scope.waiting.clear()
