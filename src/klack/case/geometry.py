"""Source of the shape of a body: a drawn outline, a STEP file, or a finished mesh."""

from collections.abc import Iterator, Mapping
from functools import lru_cache
from math import tau
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from klack.errors import InputError
from klack.input.problem import CaseProblem, Key, refuse_key_if
from klack.input.section import Count, InputPath, Name, Number, Section
from klack.mesh.profile import Arc, Line, Profile
from klack.units import LENGTH, Angle, Length, LengthUnit, format_si

__all__ = [
    "ContactRefinement",
    "Edge",
    "Geometry",
    "MeshFile",
    "MeshSettings",
    "NodeTable",
    "Outline",
    "ProfileGeometry",
    "Sectors",
    "StepFile",
    "Support",
]


Point = tuple[Number, Number]


class Edge(Section):
    """One edge of an outline, from the end of the edge before to its own end."""

    line: Point | None = Field(default=None, description="Straight edge to this point (r, z).")
    arc: Point | None = Field(default=None, description="Circular arc to this point (r, z).")
    close: Literal[True] | None = Field(
        default=None, description="Straight edge back to the start; last."
    )
    centre: Point | None = Field(default=None, description="Centre (r, z) of an arc.")
    clockwise: bool | None = Field(
        default=None,
        strict=True,
        description="Direction of an arc; default: the shorter arc.",
    )
    name: Name | None = Field(
        default=None, description="Name of the surface that the edge forms; edges may share one."
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        kind = self._exactly_one(("line", "arc", "close"), "the end of the edge")
        if kind != "arc":
            return self._refuse_with(("centre", "clockwise"), kind, "only an arc has a centre")
        if self.centre is None:
            hint = "add the point (r, z) with the same distance to both ends."
            raise CaseProblem((), got="an arc without a centre", expected="centre", hint=hint)
        return self


class Outline(Section):
    """Closed outline of one solid in the half plane (r, z); r is the distance from the axis."""

    start: Point = Field(description="First corner (r, z), in the unit of the profile.")
    edges: tuple[Edge, ...] = Field(
        min_length=2, description="Edges in order; the last one ends at the start."
    )

    @model_validator(mode="after")
    def _close_is_last(self) -> Self:
        for i, edge in enumerate(self.edges[:-1]):
            refuse_key_if(
                edge.close,
                ("edges", i, "close"),
                got=f"close at edge {i + 1} of {len(self.edges)}",
                expected="close at the last edge only",
                hint="move it to the end, or remove the edges after it.",
            )
        return self

    def points(self) -> Iterator[tuple[Key, Point]]:
        """Points with their keys."""
        yield ("start",), self.start
        for i, edge in enumerate(self.edges):
            for name in ("line", "arc", "centre"):
                point = getattr(edge, name)
                if point is not None:
                    yield ("edges", i, name), point

    def profile(self, unit: float) -> Profile:
        """Meridian; ``unit`` is one drawing unit [m]."""

        def metres(point: Point) -> tuple[float, float]:
            # 15 digits: 0.3 mm must be the same number here as 0.0003 m elsewhere
            r, z = (float(f"{x * unit:.15g}") for x in point)
            return r, z

        edges: list[Line | Arc] = []
        for edge in self.edges:
            name = edge.name or ""
            if edge.arc is not None and edge.centre is not None:
                edges.append(Arc(metres(edge.arc), metres(edge.centre), name, edge.clockwise))
            else:
                edges.append(Line(metres(edge.line or self.start), name))
        return _drawn(metres(self.start), tuple(edges))


@lru_cache(maxsize=100)
def _drawn(start: Point, edges: tuple[Line | Arc, ...]) -> Profile:
    """Profile, kept: a case asks for it at every surface name."""
    return Profile(start, edges)


class ProfileGeometry(Section):
    """A body of revolution, drawn as its half section."""

    unit: LengthUnit = Field(description="Unit of all coordinates, e.g. mm.")
    parts: dict[Name, Outline] = Field(
        min_length=1,
        description="One closed outline for each solid; solids are glued where they share edges.",
    )

    @model_validator(mode="after")
    def _drawable(self) -> Self:
        for name, part in self.parts.items():
            for key, point in part.points():
                refuse_key_if(
                    not all(LENGTH.holds(x * self.unit) for x in point),
                    ("parts", name, *key),
                    got=f"the point {list(point)} in a unit of {self.unit:g} m",
                    expected=f"coordinates of 0, or of {LENGTH.smallest:g} to {LENGTH.largest:g} m",
                    hint="check the unit of the profile and the powers of ten.",
                )
            try:
                part.profile(self.unit)
            except InputError as error:
                raise CaseProblem(
                    ("parts", name),
                    got=f"({error.where.removeprefix('Profile: ')}) {error.got}",
                    expected=error.expected,
                    hint=error.hint,
                ) from error
        return self

    def profiles(self) -> dict[str, Profile]:
        """Meridian of each solid, in metres."""
        return {name: part.profile(self.unit) for name, part in self.parts.items()}

    @property
    def surfaces(self) -> tuple[str, ...]:
        """Surfaces in the order of drawing."""
        names = [name for profile in self.profiles().values() for name in profile.names]
        return tuple(dict.fromkeys(names))


class StepFile(Section):
    """A body from a STEP file; its faces and solids carry their names there."""

    file: InputPath = Field(description="STEP file, relative to the case; axis of motion = z.")


class MeshFile(Section):
    """A finished finite-element mesh."""

    file: InputPath = Field(
        description="Abaqus or CalculiX (.inp), ANSYS (.cdb), Nastran (.bdf, .dat, .nas), Gmsh "
        "(.msh), VTK (.vtk, .vtu); relative to the case."
    )
    unit: LengthUnit | None = Field(
        default=None,
        description="Unit of its coordinates, e.g. mm; required unless the file states it.",
    )
    elements: Literal["all", "solids-only"] = Field(
        default="all",
        description="all: the file contains only solids and surface elements on them; "
        "solids-only: beams, springs, masses, rigid elements and shells are left out and "
        "counted in a note.",
    )

    @property
    def solids_only(self) -> bool:
        """Whether other elements are left out."""
        return self.elements == "solids-only"


class NodeTable(Section):
    """Nodes of a body without elements: a table of numbers and coordinates, and sets of them."""

    file: InputPath = Field(
        description="Table (CSV or text: node, x, y, z), or a mesh file whose nodes are used."
    )
    unit: LengthUnit = Field(description="Unit of its coordinates, e.g. mm.")
    sets: Mapping[Name, tuple[Count, ...] | InputPath] = Field(
        default_factory=dict,
        description="name: node numbers, or a text file of node numbers; a set is used as a "
        "surface in a contact or support.",
    )


Model = Literal["axisymmetric", "swept", "solid"]


class Geometry(Section):
    """Shape of a body: exactly one of profile, step, mesh and nodes."""

    profile: ProfileGeometry | None = Field(
        default=None, description="Half section of a turned part."
    )
    step: StepFile | None = Field(default=None, description="CAD file.")
    mesh: MeshFile | None = Field(default=None, description="Finished mesh.")
    nodes: NodeTable | None = Field(
        default=None, description="Only nodes, for a body given by its matrices."
    )
    model: Model | None = Field(
        default=None,
        description="axisymmetric: only the half section (fastest); swept: three-dimensional, "
        "the meshed half section revolved in layers; solid: three-dimensional, unstructured. "
        "Needed for a profile; a step file is always solid, a mesh solid by default.",
    )
    layers: Count | None = Field(
        default=None, ge=6, description="Layers around the circumference of a swept mesh."
    )
    extent: Length | None = Field(
        default=None,
        gt=0,
        description="Longest side of the shape, to confirm its unit of length; required "
        "where it is unusual: all bodies below 0.1 mm, one above 1 m, or two that differ 100-fold.",
    )

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        kind = self._exactly_one(("profile", "step", "mesh", "nodes"), "the source of the shape")
        allowed = {
            "profile": ("axisymmetric", "swept", "solid"),
            "step": ("solid",),
            "mesh": ("solid", "axisymmetric"),
            "nodes": ("solid", "axisymmetric"),
        }[kind]
        refuse_key_if(
            kind == "profile" and self.model is None,
            (),
            got="a profile without a model",
            expected="model: axisymmetric, swept or solid",
            hint="start with axisymmetric; swept for bodies held in sectors.",
        )
        refuse_key_if(
            self.model is not None and self.model not in allowed,
            ("model",),
            got=f"model {self.model} for a {kind}",
            expected=f"one of: {', '.join(allowed)}",
            hint="a profile can be turned into any of the three models.",
        )
        if self.model == "swept" and self.layers is None:
            hint = "use 18: contact of turned parts needs only a few layers."
            raise CaseProblem((), got="a swept body without layers", expected="layers", hint=hint)
        if self.model != "swept":
            return self._refuse_with(
                ("layers",), f"model {self.model}", "only a swept body has layers"
            )
        return self

    @classmethod
    def absent(cls) -> Self:
        """Geometry of a reduced model, which has none."""
        return cls.model_construct()

    @property
    def is_absent(self) -> bool:
        """True where no shape is known."""
        return all(part is None for part in (self.profile, self.step, self.mesh, self.nodes))

    @property
    def dimension(self) -> int:
        """2 for an axisymmetric body, else 3."""
        return 2 if self.model == "axisymmetric" else 3


class ContactRefinement(Section):
    """Small elements around the ring or point of first touch."""

    size: Length = Field(
        examples=["5 um"],
        gt=0,
        description="Edge length at the contact; half the contact width or less.",
    )
    extent: Length = Field(
        examples=["50 um"],
        gt=0,
        description="Radius around the point of first touch within which it applies.",
    )


class MeshSettings(Section):
    """Element sizes for a profile or a STEP file."""

    size: Length = Field(examples=["1 mm"], gt=0, description="Largest edge length anywhere.")
    grading: Number = Field(
        default=0.3,
        gt=0,
        le=1,
        description="Growth of the edge length per distance: 0.15 smooth, 0.5 coarse.",
    )
    surfaces: Mapping[str, Annotated[Length, Field(gt=0)]] = Field(
        default_factory=dict, description="Largest edge length on named surfaces."
    )
    contact: ContactRefinement | None = Field(
        default=None, description="Refinement at the first touch."
    )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        refuse_key_if(
            self.contact is not None and self.contact.size > self.size,
            ("contact", "size"),
            got="a contact size above the general size",
            expected=f"{format_si(self.size, 'm')} or less",
            hint="the contact needs the smallest elements.",
        )
        return self


class Sectors(Section):
    """Equal sectors of a surface round the axis, for a body that is clamped at some places."""

    count: Count = Field(description="Number of sectors, evenly spaced.")
    width: Angle = Field(gt=0, description="Angle of one sector.")
    first: Angle = Field(default=0.0, description="Middle of the first sector, from x towards y.")

    @model_validator(mode="after")
    def _fit(self) -> Self:
        refuse_key_if(
            self.count * self.width > tau * (1 + 1e-12),
            ("width",),
            got=f"{self.count} sectors of {self.width * 360 / tau:g} deg",
            expected="360 deg or less in total",
            hint="leave 'sectors' out to hold the whole surface.",
        )
        return self


class Support(Section):
    """A surface, or sectors of it, whose nodes are held in all directions."""

    surface: Name = Field(description="Name of the surface.")
    sectors: Sectors | None = Field(
        default=None, description="Held sectors; default: the whole surface."
    )
