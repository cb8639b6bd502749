"""Materials, bodies and their reduction, shared by every kind of case."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from math import isclose
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, Self

from pydantic import (
    BeforeValidator,
    Field,
    PrivateAttr,
    WithJsonSchema,
    field_validator,
    model_validator,
)

from klack.case.foreign import Matrices, ReducedModel
from klack.case.geometry import Geometry, MeshSettings, Support
from klack.case.layers import CaseLayer
from klack.case.origin import ExpandedCase
from klack.case.parameters import PARAMETERS, Written
from klack.case.plausible import GO_ON, Number
from klack.contact.friction import MOST_FRICTION
from klack.errors import InputError
from klack.input.problem import CaseProblem, Key, key_text, nearest, one_of, refuse_key_if
from klack.input.section import Count, Name, NamedSection, PlainName, Section, Text
from klack.materials.hardening import (
    HARDNESS_SPREAD,
    LARGEST_YIELD,
    Hardening,
    vickers_of_rockwell,
    yield_of_hardness,
)
from klack.materials.library import MATERIALS, find_material
from klack.materials.material import Material
from klack.mesh.joint import JointError, cylinder_joint, edges_of_two, flat_joint
from klack.units import (
    Area,
    Density,
    Force,
    Frequency,
    Length,
    Modulus,
    Rate,
    Ratio,
    Time,
    format_si,
)

__all__ = [
    "BodyDamping",
    "BodySurface",
    "Bolts",
    "CaseBody",
    "CaseFile",
    "CaseMaterial",
    "Fit",
    "HardeningSlopes",
    "Hardness",
    "ModeChoice",
    "RayleighCoefficients",
    "Reduction",
    "SurfaceName",
    "WrittenCase",
    "joints_told_at",
]


_MOST_SHIFTS = 8  # more are nearly parallel or near eigenfrequencies


class SurfaceName(NamedTuple):
    """A surface of a body, written ``needle.tip``."""

    body: str
    surface: str

    def __str__(self) -> str:
        return f"{self.body}.{self.surface}"


def _surface_name(value: Any) -> SurfaceName:
    if isinstance(value, SurfaceName):
        return value
    body, dot, surface = value.partition(".") if isinstance(value, str) else ("", "", "")
    if not (body and dot and surface):
        hint = "join the names of the body and of its surface with a point."
        raise CaseProblem((), got=f"'{value}'", expected="text such as needle.tip", hint=hint)
    return SurfaceName(body, surface)


BodySurface = Annotated[
    SurfaceName,
    BeforeValidator(_surface_name),
    WithJsonSchema({"type": "string", "pattern": r"^[^.]+\..+$", "examples": ["needle.tip"]}),
]


class Hardness(Section):
    """Hardness of a metal, from which its yield stress is estimated: exactly one of the two."""

    HV: Ratio | None = Field(default=None, gt=0, description="Vickers, e.g. 180.")
    HRC: Ratio | None = Field(default=None, ge=20, le=68, description="Rockwell C, 20 to 68.")

    @model_validator(mode="after")
    def _one(self) -> Self:
        self._exactly_one(("HV", "HRC"), "the hardness of the material")
        return self

    @property
    def yield_stress(self) -> float:
        """Yield stress [Pa] by :func:`klack.materials.hardening.yield_of_hardness`."""
        vickers = self.HV
        if vickers is None:
            assert self.HRC is not None
            vickers = vickers_of_rockwell(self.HRC)
        return yield_of_hardness(vickers)


class HardeningSlopes(Section):
    """Rise of the stress per plastic strain."""

    isotropic: Modulus = Field(default=0.0, ge=0, description="Rise of the yield stress.")
    kinematic: Modulus = Field(default=0.0, ge=0, description="Shift of the yield surface.")


class CaseMaterial(NamedSection):
    """Isotropic material: elastic, and when it yields; a bare text is a name of the library."""

    name: Text | None = Field(
        default=None, description="Name in the library; further keys replace its numbers."
    )
    young: Modulus = Field(gt=0, description="Young's modulus; steel 210 GPa.")
    poisson: Ratio = Field(gt=-1, lt=0.5, description="Poisson's ratio; steel 0.3.")
    density: Density = Field(gt=0, description="Density; steel 7850 kg/m^3.")
    yield_stress: Modulus | None = Field(
        default=None,
        alias="yield",
        gt=0,
        description="Yield stress; soft magnetic steel 280 MPa. Default: always elastic.",
    )
    hardness: Hardness | None = Field(
        default=None,
        description="HV or HRC, from which the yield stress is estimated; instead of a yield "
        "stress.",
    )
    hardening: HardeningSlopes | None = Field(
        default=None, description="Linear hardening; without it perfectly plastic."
    )

    @model_validator(mode="before")
    @classmethod
    def _from_library(cls, value: Any) -> Any:
        name = value.get("name") if isinstance(value, Mapping) else value
        if not isinstance(name, str):
            return value
        entry = find_material(name)
        if entry is None:
            raise CaseProblem(
                ("name",) if isinstance(value, Mapping) else (),
                got=f"'{name}'"[:80],
                expected=f"a material of the library: {one_of(MATERIALS)}",
                hint=nearest(name, MATERIALS, "give young, poisson, density instead of a name."),
            )
        given = value if isinstance(value, Mapping) else {"name": name}
        numbers: dict[str, Any] = {
            "young": f"{entry.young.value!r} Pa",
            "poisson": entry.poisson.value,
            "density": f"{entry.density.value!r} kg/m^3",
        }
        if entry.yield_stress is not None and not {"yield", "hardness"} & set(given):
            numbers["yield"] = f"{entry.yield_stress.value!r} Pa"
        return numbers | dict(given)

    @model_validator(mode="after")
    def _one_yield(self) -> Self:
        if self.yield_stress is not None:
            self._refuse_with(
                ("hardness",), "a yield stress", "the hardness is used to estimate it"
            )
        if self.yield_stress is None and self.hardness is None:
            self._refuse_with(("hardening",), "no yield stress", "give 'yield' or 'hardness'")
        limit = LARGEST_YIELD * self.young
        given = self.yield_stress or (self.hardness.yield_stress if self.hardness else 0.0)
        refuse_key_if(
            given > limit,
            ("yield",) if self.hardness is None else ("hardness",),
            got=f"a yield stress of {given / 1e6:.4g} MPa",
            expected=f"at most a fiftieth of Young's modulus, {limit / 1e6:.4g} MPa",
            hint="check the unit; hardened steel has 2000 MPa.",
        )
        return self

    @property
    def doubtful_yield(self) -> tuple[float, str] | None:
        """Lowest yield stress [Pa] behind an estimate, and its basis; None for a given one.

        A hardness gives an estimate (:data:`klack.materials.hardening.HARDNESS_SPREAD`); a number
        of the library is that of another bar.
        """
        if self.hardness is not None:
            low, high = (share * self.hardness.yield_stress for share in HARDNESS_SPREAD)
            between = f"{format_si(low, 'Pa', 2)} to {format_si(high, 'Pa', 2)}"
            return low, f"estimated from its hardness, {between}"
        entry = None if self.name is None else find_material(self.name)
        hardening = None if entry is None else entry.material.hardening
        if entry is None or entry.yield_stress is None or hardening is None:
            return None
        if self.yield_stress is None or not isclose(self.yield_stress, hardening.yield_stress):
            return None
        return self.yield_stress, f"that of the library ({entry.yield_stress.source})"

    def named(self, name: str) -> Material:
        """As the finite elements need it."""
        hardening, given = None, self.yield_stress
        if given is None and self.hardness is not None:
            given = self.hardness.yield_stress
        if given is not None:
            slopes = self.hardening or HardeningSlopes()
            hardening = Hardening(
                yield_stress=given, isotropic=slopes.isotropic, kinematic=slopes.kinematic
            )
        return Material(
            name=name,
            young=self.young,
            poisson=self.poisson,
            density=self.density,
            hardening=hardening,
        )


class RayleighCoefficients(Section):
    """Damping matrix alpha M + beta K."""

    alpha: Rate = Field(default=0.0, ge=0, description="Share of the mass matrix.")
    beta: Time = Field(default=0.0, ge=0, description="Share of the stiffness matrix.")


class BodyDamping(Section):
    """Material and mounting losses: exactly one of the three."""

    loss_factor: Ratio | None = Field(
        default=None, ge=0, lt=1, description="eta; modal ratio eta / 2."
    )
    modal: Ratio | None = Field(
        default=None, ge=0, lt=1, description="Damping ratio of every mode."
    )
    rayleigh: RayleighCoefficients | None = Field(default=None, description="alpha M + beta K.")

    @model_validator(mode="after")
    def _one(self) -> Self:
        self._exactly_one(("loss_factor", "modal", "rayleigh"), "how the body is damped")
        return self


class Fit(Section):
    """A part pressed on another one: their overlap, and the friction that holds it."""

    interference: Length = Field(
        ge=0,
        examples=["8 um"],
        description="Overlap before joining, on the diameter: the diameter of the inner part "
        "minus the bore of the outer part.",
    )
    friction: Ratio = Field(
        ge=0,
        le=MOST_FRICTION,
        examples=[0.12],
        description="Coefficient of friction that holds force and torque.",
    )


class Bolts(Section):
    """Bolts that press two parts together along the axis, or a nut on a thread round the axis."""

    ends: tuple[Name, Name] = Field(
        description="Edges or faces that the bolts press, one on each part: under the head, and "
        "at the thread.",
    )
    preload: Force = Field(
        gt=0, examples=["8 kN"], description="Preload of each bolt after tightening."
    )
    area: Area = Field(
        gt=0, examples=["20.1 mm^2"], description="Stretched cross-section of each bolt."
    )
    length: Length = Field(
        gt=0,
        examples=["22 mm"],
        description="Stretched length: clamped length and part of head and thread.",
    )
    modulus: Modulus = Field(
        gt=0, examples=["205 GPa"], description="Young's modulus of the bolts."
    )
    count: Count = Field(default=1, description="Number of bolts, evenly round the axis.")
    yield_stress: Modulus | None = Field(
        default=None,
        alias="yield",
        gt=0,
        description="Yield stress of the bolts; class 8.8 has 640 MPa. Default: 1.1 GPa, class "
        "12.9.",
    )


class CaseBody(Section):
    """An elastic body."""

    geometry: Geometry = Field(
        default=Geometry.absent(), description="Shape: profile, step, mesh or nodes."
    )
    material: Name | dict[Name, Name] | None = Field(
        default=None,
        description="Name of a material, or solid: material for a body of several solids.",
    )
    matrices: Matrices | None = Field(
        default=None,
        description="Stiffness and mass from another program, for a mesh or for nodes.",
    )
    reduced: ReducedModel | None = Field(
        default=None, description="Reduced model from another program, instead of a geometry."
    )
    mesh: MeshSettings | None = Field(
        default=None, description="Element sizes; needed unless the geometry is a finished mesh."
    )
    fixed: tuple[Support, ...] | None = Field(
        default=None, min_length=1, description="Held surfaces; without any the body is free."
    )
    non_reflecting: Name | None = Field(
        default=None,
        description="Surface at which a long bar continues: axial waves leave the body there; "
        "only at "
        "level full.",
    )
    damping: BodyDamping = Field(
        default=BodyDamping(loss_factor=0.0), description="Losses inside the body; none by default."
    )
    fits: dict[Name, Fit] | None = Field(
        default=None,
        description="edge or face: press fit of the two parts that share it, a cylinder; "
        "klack inspect and klack impact show its pressure. Other shared edges are glued.",
    )
    bolts: dict[Name, Bolts] | None = Field(
        default=None,
        max_length=1,
        description="edge or face: bolts that press together the two parts that share it, a flat "
        "face; klack inspect and klack impact show pressure, stiffness and the force that lifts "
        "the joint.",
    )
    layers: dict[Name, CaseLayer] | None = Field(
        default=None,
        description="edge or face that two parts share: gasket, O-ring or adhesive there. Other "
        "shared edges and faces are glued.",
    )

    @field_validator("material", mode="before")
    @classmethod
    def _material_names(cls, value: Any) -> Any:
        if value is None:
            return None
        pairs = value.items() if isinstance(value, Mapping) else [((), value)]
        for key, name in pairs:
            refuse_key_if(
                not isinstance(name, str),
                (key,) if isinstance(key, str) else (),
                got=f"'{name}'",
                expected="the name of a material, or a mapping solid: material",
                hint="define the properties in 'materials' and give the name here.",
            )
        return dict(value) if isinstance(value, Mapping) else value

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        self._check_joints()
        self._check_layers()
        if self.reduced is not None:
            self._refuse_with(
                ("material", "mesh", "matrices", "fixed"),
                "a reduced model",
                "it already includes mass, stiffness and supports",
            )
            if not self.geometry.is_absent:
                self._refuse_with(("geometry",), "a reduced model", "it has no shape")
            return self
        refuse_key_if(
            self.geometry.is_absent,
            (),
            got="no key 'geometry'",
            expected="geometry: Shape: profile, step, mesh or nodes",
            hint="add 'geometry' here, or 'reduced' for a reduced model.",
        )
        if self.matrices is not None:
            self._refuse_with(("material",), "matrices", "they already include the material")
            refuse_key_if(
                self.geometry.mesh is None and self.geometry.nodes is None,
                ("matrices",),
                got="matrices with a shape that klack meshes",
                expected="geometry.mesh or geometry.nodes of the program that wrote them",
                hint="give the mesh file of these matrices.",
            )
        elif self.geometry.nodes is not None:
            hint = "add matrices: {stiffness: ..., mass: ..., units: ...}."
            raise CaseProblem((), got="nodes without matrices", expected="matrices", hint=hint)
        elif self.material is None:
            hint = "name a material of the section 'materials'."
            raise CaseProblem(
                (),
                got="no key 'material'",
                expected="material: Name of a material, or solid: material for a body of several",
                hint=hint,
            )
        if self.geometry.mesh is not None or self.geometry.nodes is not None:
            self._refuse_with(("mesh",), "a finished mesh", "its elements exist already")
        elif self.mesh is None:
            hint = "start with a tenth of the length of the body for 'size'."
            raise CaseProblem((), got="no key 'mesh'", expected="mesh: {size: ...}", hint=hint)
        if self.geometry.dimension == 2:
            for i, support in enumerate(self.fixed or ()):
                refuse_key_if(
                    support.sectors is not None,
                    ("fixed", i, "sectors"),
                    got="sectors on an axisymmetric body",
                    expected="a support around the whole circumference",
                    hint="remove 'sectors', or use 'model: swept' with 'layers: 18'.",
                    on_key=True,
                )
        return self

    def _check_joints(self) -> None:
        """Reject fits and bolts of other geometries, and of edges of another shape."""
        shape = None if self.geometry.is_absent or self.matrices is not None else self.geometry
        profile = None if shape is None else shape.profile
        kinds = {"fits": ("a press fit", self.fits), "bolts": ("bolts", self.bolts)}
        for key, (kind, given) in kinds.items():
            if given and not (shape and (profile or shape.step)):
                raise CaseProblem(
                    (key,),
                    got=f"{kind} of a body that is neither drawn nor a STEP file",
                    expected="geometry.profile or geometry.step with a part on each side of the "
                    "joint",
                    hint=f"draw the parts, or remove '{key}': the solids are then glued.",
                    on_key=True,
                )
            for name, item in (given or {}).items():
                if profile is None:  # faces of the file are known with its mesh
                    continue
                with joints_told_at(key):
                    if isinstance(item, Bolts):
                        flat_joint(profile.profiles(), name, item.ends)
                    else:
                        cylinder_joint(profile.profiles(), name)
        others = [key for key in ("fits", "layers") if getattr(self, key)]
        if self.bolts and others:
            raise CaseProblem(
                ("bolts",),
                got=f"bolts beside {others[0]}",
                expected="a body with only one kind of joint that is not glued",
                hint=f"remove '{others[0]}' to compute the bolted joint; the other joint is then "
                "glued.",
                on_key=True,
            )

    def _check_layers(self) -> None:
        """Reject layers of what has no parts, and of edges that are not those of two parts."""
        if not self.layers:
            return
        geometry = self.geometry
        no_parts = geometry.is_absent or geometry.nodes is not None or self.matrices is not None
        refuse_key_if(
            no_parts or self.fits,
            ("layers",),
            got="a layer together with a press fit"
            if self.fits
            else "a layer in a body given by its matrices or as a reduced model",
            expected="a body whose parts klack assembles, without 'fits'",
            hint="remove 'fits'; compute the press fit of the body without its layers."
            if self.fits
            else "include the layer in that model, and remove 'layers'.",
            on_key=True,
        )
        if geometry.profile is None:
            return
        for name in self.layers:
            with joints_told_at("layers"):
                edges_of_two(geometry.profile.profiles(), name)

    @property
    def has_surfaces(self) -> bool:
        """False for a reduced model and for nodes alone: contact is then at a port."""
        return self.reduced is None and self.geometry.nodes is None


@contextmanager
def joints_told_at(*key: str) -> Iterator[None]:
    """What is wrong with a joint, at its name below a key of the case."""
    try:
        yield
    except JointError as error:
        raise CaseProblem(
            (*key, error.name), got=error.got, expected=error.expected, hint=error.hint, on_key=True
        ) from error


class ModeChoice(Section):
    """Which elastic modes a body keeps: exactly one of count, frequency and participation."""

    count: Count | None = Field(default=None, description="Number of lowest elastic modes.")
    frequency: Frequency | None = Field(
        default=None, gt=0, description="All elastic modes up to this frequency."
    )
    participation: Count | None = Field(
        default=None,
        description="Number of modes of a pool with the largest share of compliance.",
    )
    pool: Count | None = Field(
        default=None, description="Number of modes to choose from, with participation."
    )

    @model_validator(mode="before")
    @classmethod
    def _some_modes(cls, value: Any) -> Any:
        for key in ("count", "participation", "pool"):
            refuse_key_if(
                isinstance(value, Mapping) and value.get(key) == 0,
                (key,),
                got="0 modes",
                expected="1 or more",
                hint="for a rigid body use the level 'lumped'; 20 modes are a good start here.",
            )
        return value

    @model_validator(mode="after")
    def _one(self) -> Self:
        kind = self._exactly_one(("count", "frequency", "participation"), "which modes to keep")
        if kind != "participation":
            return self._refuse_with(("pool",), kind, "only participation selects from a pool")
        refuse_key_if(
            self.pool is None or self.participation is None or self.pool < self.participation,
            ("pool",) if self.pool is not None else (),
            got=f"a pool of {self.pool or 'no'} modes for {self.participation}",
            expected=f"pool: {self.participation} or more",
            hint="pool: 100 is enough for most bodies.",
        )
        return self


class Reduction(Section):
    """Reduction of the bodies."""

    correction: Literal["consistent", "attachment", "none"] = Field(
        default="consistent",
        description="Correction for the omitted modes. consistent: the local law carries their "
        "compliance; attachment: attachment modes, as usual; none: no correction, for "
        "comparison.",
    )
    modes: Mapping[Name, ModeChoice] = Field(
        default_factory=dict, description="Kept modes of each body; default 40."
    )

    shifts: Mapping[Name, tuple[Frequency, ...]] = Field(
        default_factory=dict,
        description="Per body, shifted instead of residual attachment modes, one per frequency "
        "and exact there; negative: an imaginary frequency.",
        examples=[{"needle": ["-20 kHz", "150 kHz"]}],
    )

    @field_validator("shifts", mode="after")
    @classmethod
    def _some_shifts(
        cls, shifts: Mapping[str, tuple[float, ...]]
    ) -> Mapping[str, tuple[float, ...]]:
        for body, frequencies in shifts.items():
            refuse_key_if(
                not 1 <= len(frequencies) <= _MOST_SHIFTS,
                (body,),
                got=f"{len(frequencies)} shifts",
                expected=f"1 to {_MOST_SHIFTS} frequencies",
                hint="two are usual for a free body; leave the body out for its residual mode.",
            )
            refuse_key_if(
                len(set(frequencies)) < len(frequencies),
                (body,),
                got="the same shift twice",
                expected="different frequencies",
                hint="each adds one mode per contact; a duplicate adds nothing.",
            )
        return shifts

    def choice(self, body: str) -> ModeChoice:
        """Modes to keep of one body."""
        return self.modes.get(body, ModeChoice(count=40))

    def shifts_of(self, body: str, correction: str) -> tuple[float, ...] | None:
        """Shifts [(rad/s)^2] of attachment modes; None for residual or none."""
        if correction != "attachment" or body not in self.shifts:
            return None
        from klack.bodies.reduction.attachment import (
            shift_at,  # loads the solvers: not to read a case
        )

        return tuple(shift_at(frequency) for frequency in self.shifts[body])


class WrittenCase(Section):
    """Common part of every case: title, parameters, and its file."""

    klack: Literal[1] = Field(description="Format version of the file: 1.")
    title: Text = Field(min_length=1, description="One line.")
    description: Text = Field(
        default="", description="What the case shows, and the source of its numbers."
    )
    parameters: Mapping[PlainName, Written] = Field(default_factory=dict, description=PARAMETERS)

    _path: Path | None = PrivateAttr(None)
    _source: str = PrivateAttr("")
    _expanded: ExpandedCase | None = PrivateAttr(None)

    def model_post_init(self, context: Any, /) -> None:
        """Remember the file that the case was read from."""
        if context:
            self._path, self._source = context.get("path"), context.get("source", "")
            self._expanded = context.get("expanded")

    @field_validator("klack", mode="before")
    @classmethod
    def _known_version(cls, version: Any) -> Any:
        refuse_key_if(
            isinstance(version, bool) or version != 1,
            (),
            got=f"the format version {version}",
            expected="1",
            hint="this version of klack reads version 1; a later one may read others.",
        )
        return version

    @property
    def path(self) -> Path | None:
        """Its file; None for one made in Python."""
        return self._path

    @property
    def folder(self) -> Path:
        """Folder of that file."""
        return self._path.parent if self._path is not None else Path.cwd()

    @property
    def source(self) -> str:
        """Text of that file."""
        return self._source

    @property
    def expanded(self) -> ExpandedCase | None:
        """Plain data, expressions evaluated and parts in place; None in Python."""
        return self._expanded

    def behind(self, key: Key) -> tuple[Key, ...]:
        """As :meth:`ExpandedCase.behind`."""
        return self._expanded.behind(key) if self._expanded is not None else (key,)

    def _where(self, key: Key) -> str:
        if self._expanded is None:
            return f"{self._path or 'case'}: {key_text(key)}"
        return self._expanded.origin(key).where()

    @property
    def doubts(self) -> tuple[str, ...]:
        """What is doubtful about its numbers."""
        return ()

    @property
    def input_notes(self) -> tuple[str, ...]:
        """Doubtful numbers, and parameters without effect."""
        unused = self._expanded.unused_parameters() if self._expanded is not None else ()
        return self.doubts + tuple(
            f"parameters.{name}: nothing in this case depends on it. Try: an expression where "
            f"its value belongs, such as '= {name}'."
            for name in unused
        )

    @property
    def own_components(self) -> Mapping[str, str]:
        """Components that are not part of klack, with a digest of their code."""
        return {}

    @property
    def component_files(self) -> Mapping[str, Path]:
        """Files of components with a model inside."""
        return {}

    @property
    def name(self) -> str:
        """Short name: file, or folder if the file is ``case.yaml``."""
        if self._path is None:
            return "case"
        return self._path.resolve().parent.name if self._path.stem == "case" else self._path.stem


class CaseFile(WrittenCase):
    """Case with materials and elastic bodies."""

    materials: Mapping[Name, CaseMaterial] = Field(
        default_factory=dict, description="name: properties."
    )
    bodies: Mapping[Name, CaseBody] = Field(description="name: body.")
    unusual: bool = Field(
        default=False,
        strict=True,
        description="true: numbers that no valve has, such as 300 m/s, are computed with a "
        "note; otherwise they are an error.",
    )

    def plausible_numbers(self) -> Iterator[Number]:
        """Numbers whose size tells of a wrong unit."""
        return iter(())

    def require_possible(self) -> None:
        """Reject numbers that cannot be, unless the case confirms them."""
        if self.unusual:
            return
        for number in self.plausible_numbers():
            number.require_possible(self._where(number.key))
        for name, given in self.materials.items():
            if (question := given.named(name).question) is not None:
                got, _, reason = question.partition(": ")[2].partition(" would ")
                raise InputError(
                    self._where(("materials", name)),
                    got=got,
                    expected=f"a solid: this one would {reason.partition('. Try')[0]}",
                    hint=f"steel has 210 GPa and 7850 kg/m^3; {GO_ON}",
                )

    @property
    def doubts(self) -> tuple[str, ...]:
        """What is doubtful about its numbers."""
        found = (number.doubt for number in self.plausible_numbers())
        return tuple(doubt for doubt in found if doubt is not None)

    def materials_of(self, body: str, solids: Iterable[str]) -> dict[str, Material]:
        """Material of each solid of a body; rejects one without."""
        chosen = self.bodies[body].material
        if chosen is None:
            raise InputError(
                f"{self._path or 'case'}: bodies.{body}",
                got="a body given by its matrices or as a reduced model",
                expected="a body with a material",
                hint="use a law that needs no material, e.g. {kind: linear, stiffness: 1e9 N/m}.",
            )
        result = {}
        for solid in solids:
            if not isinstance(chosen, str) and solid not in chosen:
                raise InputError(
                    f"{self._path or 'case'}: bodies.{body}.material",
                    got=f"no material for the solid '{solid}'",
                    expected=f"a material for each solid (given: {one_of(chosen)})",
                    hint=nearest(solid, chosen, f"add '{solid}: ...' there."),
                )
            name = chosen if isinstance(chosen, str) else chosen[solid]
            result[solid] = self.materials[name].named(name)
        return result
