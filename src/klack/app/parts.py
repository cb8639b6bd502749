"""Part of a new valve, from STEP or a drawing, as half section if it has one."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import hypot
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.app.answers import FaceFacts, PartFacts
from klack.app.face_places import EVEN, profile_places, solid_places
from klack.case.geometry import Outline
from klack.errors import InputError
from klack.mesh.meridian import mesh_meridian
from klack.mesh.mesh import Mesh
from klack.mesh.occ import MM, glue, revolved_solids
from klack.mesh.profile import Profile
from klack.mesh.quality import PoorElementError
from klack.mesh.sizing import MeshSizing
from klack.mesh.solid import mesh_step, read_step
from klack.mesh.step_content import StepContent, step_content
from klack.mesh.step_profile import NotTurnedError, profiles_of_step

__all__ = ["Part", "outline_of_table", "part_of_step", "part_of_table"]


Floats = NDArray[np.float64]

_MOST = 500  # rows
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]{0,60}")


def outline_of_table(body: str, text: str) -> dict[str, Any]:
    """Outline as a case has it, in mm: ``start`` and ``edges``.

    Each row is a corner of the outline in mm, and says which surface leads to it and, for an arc,
    where its centre lies::

        r, z, surface, centre r, centre z
        0, -0.6
        0.6, 0, tip, 0, 0
        2.5, 1.9, taper

    The outline closes by itself; commas, semicolons, tabs or blanks separate, and a comma is a
    decimal sign where semicolons or tabs separate.  An error names the row.
    """
    rows = list(_rows(body, text))
    if len(rows) < 3:
        raise InputError(
            f"drawing of the {body}",
            got=f"{len(rows)} corners",
            expected="at least 3, one in each row: r, z, surface",
            hint="fill in the example, and change it.",
        )
    if rows[0][1][2]:
        raise _refused(body, rows[0][0], f"the surface '{rows[0][1][2]}'", "r, z alone: the start")
    start = rows[0][1][:2]
    edges: list[dict[str, Any]] = []
    for number, (r, z, name, centre) in rows[1:]:
        edge: dict[str, Any] = {"line": [r, z]} if centre is None else {"arc": [r, z]}
        if centre is not None:
            edge["centre"] = list(centre)
        edge["name"] = name or f"row{number}"
        edges.append(edge)
    end = rows[-1][1][:2]
    if hypot(end[0] - start[0], end[1] - start[1]) > 0.0:
        edges.append({"close": True, "name": "axis" if start[0] == end[0] == 0.0 else "closing"})
    return {"start": list(start), "edges": edges}


_Row = tuple[float, float, str, tuple[float, float] | None]


def _rows(body: str, text: str) -> Iterator[tuple[int, _Row]]:
    count = 0
    for number, line in enumerate(text.splitlines(), 1):
        cells = _cells(line)
        if not any(cells) or cells[0].lstrip().startswith("#") or _is_heading(cells):
            continue
        count += 1
        if count > _MOST:
            raise _refused(body, number, f"more than {_MOST} corners", f"at most {_MOST}")
        cells = [*cells, "", "", "", "", ""][: max(5, len(cells))]
        if any(cells[5:]):
            raise _refused(body, number, f"{len(cells)} columns", "r, z, surface, centre r, z")
        r, z = (_number(body, number, cell) for cell in cells[:2])
        centre = None
        if cells[3] or cells[4]:
            centre = _number(body, number, cells[3]), _number(body, number, cells[4])
        name = cells[2]
        if name and not _NAME.fullmatch(name):
            raise _refused(
                body, number, f"the name '{name[:60]}'", "a letter, then letters, digits, - and _"
            )
        yield number, (r, z, name, centre)


def _cells(line: str) -> list[str]:
    sign = next((sign for sign in ";\t," if sign in line), None)
    cells = [cell.strip().strip('"') for cell in line.split(sign)]
    return [cell.replace(",", ".") for cell in cells] if sign in (";", "\t") else cells


def _is_heading(cells: list[str]) -> bool:
    return cells[0].lower().startswith("r") and not cells[0][1:2].isdigit()


def _number(body: str, row: int, text: str) -> float:
    try:
        found = float(text)
    except ValueError:
        raise _refused(body, row, f"'{text[:40]}'", "a number in mm") from None
    if not abs(found) < 1e6:
        raise _refused(body, row, f"'{text[:40]}'", "a number in mm")
    return found + 0.0


def _refused(body: str, row: int, got: str, expected: str) -> InputError:
    return InputError(
        f"drawing of the {body}, row {row}",
        got=got,
        expected=expected,
        hint="0.6, 0, tip, 0, 0 is an arc round (0, 0) that forms the surface 'tip'.",
    )


_FINER = (25, 50, 100)  # elements over the longest side, of a mesh for the picture alone
_MOST_FACES = 400  # in a list


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """One of the two bodies.

    Parameters
    ----------
    path
        STEP file; None for a drawing.
    profiles
        Half section of each solid; None for a part that is not turned.
    """

    name: str
    path: Path | None
    profiles: Mapping[str, Profile] | None
    content: StepContent | None = None
    not_turned: str = ""

    @property
    def box(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lowest and highest corner [m]."""
        if self.content is not None:
            low = np.min([solid.low for solid in self.content.solids], axis=0)
            high = np.max([solid.high for solid in self.content.solids], axis=0)
            return low, high
        assert self.profiles is not None
        points = np.concatenate(
            [c.at(np.linspace(0, 1, 33)) for p in self.profiles.values() for c in p.curves]
        )
        r = float(points[:, 0].max())
        return np.array([-r, -r, points[:, 1].min()]), np.array([r, r, points[:, 1].max()])

    @property
    def longest(self) -> float:
        """Longest side [m]."""
        low, high = self.box
        return float(np.max(high - low))

    @property
    def volume(self) -> float:
        """Of all solids [m^3]."""
        if self.content is not None:
            return float(sum(solid.size for solid in self.content.solids))
        assert self.profiles is not None
        return float(sum(profile.volume for profile in self.profiles.values()))

    def is_half(self, model: str) -> bool:
        """Whether it is computed as half section."""
        return model == "half" and self.profiles is not None

    def faces(self, model: str) -> tuple[str, ...]:
        """Names of its faces in a model."""
        if self.is_half(model):
            assert self.profiles is not None
            return tuple(profile_places(self.profiles))
        return () if self.content is None else tuple(face.name for face in self.content.faces)

    @cached_property
    def facts(self) -> PartFacts:
        """For the page."""
        low, high = self.box
        size = " x ".join(f"{1e3 * x:.4g}" for x in high - low)
        solids = 1 if self.content is None else len(self.content.solids)
        count = "" if solids == 1 else f"{solids} solids, glued where they touch; "
        count_of_faces = len(self.faces("solid" if self.profiles is None else "half"))
        if count_of_faces > _MOST_FACES:
            raise InputError(
                self.name,
                got=f"{count_of_faces} faces",
                expected=f"at most {_MOST_FACES}",
                hint="suppress small fillets and threads in the CAD program, or write the case.",
            )
        return PartFacts(
            words=f"{count}{size} mm, {self.volume * 1e9:.5g} mm^3, {count_of_faces} named faces",
            faces=() if self.profiles is None else _profile_faces(self.profiles),
            solid_faces=self._solid_faces,
            not_turned=self.not_turned,
        )

    @property
    def _solid_faces(self) -> tuple[FaceFacts, ...]:
        if self.content is None:
            return ()
        assert self.path is not None
        # a shape of its own: with triangles its boxes are other ones
        return tuple(_step_faces(self.content, solid_places(read_step(self.path))))

    def picture_mesh(self, model: str) -> Mesh:
        """Coarse mesh, for a picture and the place of touch."""
        if self.is_half(model):
            return self._half_mesh
        return self._solid_mesh

    @cached_property
    def _half_mesh(self) -> Mesh:
        assert self.profiles is not None
        return mesh_meridian(self.profiles, MeshSizing(size=self.longest / 20))

    @cached_property
    def _solid_mesh(self) -> Mesh:
        if self.path is None:
            raise InputError(
                self.name, got="a drawing", expected="a STEP file", hint="use the half section."
            )
        for count in _FINER[:-1]:
            try:
                return mesh_step(self.path, MeshSizing(size=self.longest / count))
            except PoorElementError:
                continue
        return mesh_step(self.path, MeshSizing(size=self.longest / _FINER[-1]))

    @cached_property
    def shape(self) -> Any:
        """As OpenCASCADE has it [mm]."""
        if self.path is not None:
            return read_step(self.path)
        assert self.profiles is not None
        return glue(revolved_solids(self.profiles))


def part_of_step(name: str, path: Path) -> Part:
    """Read a STEP file with solids that do not overlap."""
    content = step_content(path)
    profiles, why = None, ""
    try:
        profiles = _plainly_named(profiles_of_step(path))
    except NotTurnedError as error:
        why = error.got
    except InputError as error:  # an outline that crosses itself, by a flaw of the file
        why = f"a half section that cannot be used ({error.got})"
    return Part(name=name, path=path, profiles=profiles, content=content, not_turned=why)


def part_of_table(name: str, text: str) -> Part:
    """Read the rows of a drawing, whose outline is closed and does not cross itself."""
    outline = Outline.model_validate(outline_of_table(name, text))
    try:
        profile = outline.profile(1.0 / MM)
    except InputError as error:
        raise InputError(
            f"drawing of the {name}", got=error.got, expected=error.expected, hint=error.hint
        ) from None
    return Part(name=name, path=None, profiles={name: profile})


def _plainly_named(profiles: Mapping[str, Profile]) -> dict[str, Profile]:
    """Profiles with solid and edge names for a case."""
    names: dict[str, str] = {}

    def plain(name: str) -> str:
        if name not in names:
            base = re.sub(r"[^A-Za-z0-9_-]+", "_", name)
            base = (base if base[:1].isalpha() else f"_{base}")[:60]
            taken, number = set(names.values()), 1
            found = base
            while found in taken:
                number += 1
                found = f"{base}_{number}"
            names[name] = found
        return names[name]

    return {
        plain(solid): Profile(
            profile.start,
            tuple(replace(e, name=plain(e.name)) if e.name else e for e in profile.edges),
        )
        for solid, profile in profiles.items()
    }


def _profile_faces(profiles: Mapping[str, Profile]) -> tuple[FaceFacts, ...]:
    found = []
    for name, place in profile_places(profiles).items():
        curves = [c for p in profiles.values() for c in p.curves if c.name == name]
        points = np.concatenate([c.at(np.linspace(0, 1, 33)) for c in curves])
        low, high = points.min(axis=0), points.max(axis=0)
        words = f"r {_range(low[0], high[0])}, z {_range(low[1], high[1])}"
        found.append(FaceFacts(name=name, words=words, place=place))
    return tuple(found)


def _step_faces(content: StepContent, places: Mapping[str, str]) -> Iterator[FaceFacts]:
    """Faces of solids: area, centre across z if it is not on the axis, heights."""
    least = EVEN * max(float(np.max(face.high - face.low)) for face in content.faces)
    for part in content.faces:
        count = "" if part.count == 1 else f"{part.count} faces, "
        x, y = 0.5 * (part.low + part.high)[:2]
        beside = f"x {_range(x, x)}, y {_range(y, y)}, " if np.hypot(x, y) > least else ""
        heights = _range(float(part.low[2]), float(part.high[2]))
        words = f"{count}{part.size * 1e6:.4g} mm^2, {beside}z {heights}"
        yield FaceFacts(name=part.name, words=words, place=places[part.name])


def _range(low: float, high: float) -> str:
    a, b = (round(float(x) * MM, 7) + 0.0 for x in (low, high))
    return f"{a:.4g} mm" if b - a < 1e-6 else f"{a:.4g} to {b:.4g} mm"
