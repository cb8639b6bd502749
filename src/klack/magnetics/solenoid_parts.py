"""Parts of a solenoid as a case describes them: pole gaps, guides, iron, eddy currents."""

from dataclasses import dataclass
from math import pi
from typing import Literal, Self

from pydantic import Field, model_validator

from klack.arrays import Vector
from klack.errors import InputError
from klack.input.problem import CaseProblem, refuse_key_if
from klack.input.section import Count, Number, Section
from klack.magnetics.air_gap import (
    edge_on_plane,
    edges_beside_wall,
    equal_edges,
    face_permeance,
    ring_permeance,
)
from klack.magnetics.eddy import MOST_TERMS, EddyLadder, cylinder_ladder, sheet_ladder
from klack.magnetics.hysteresis import (
    IronStops,
    LoopWidth,
    constant_width,
    falling_width,
    measured_width,
)
from klack.magnetics.iron import VACUUM_PERMEABILITY
from klack.magnetics.iron_choice import IronChoice
from klack.magnetics.off_axis_gap import eccentric_ring
from klack.magnetics.reluctance import IronReluctance
from klack.magnetics.solid_iron import shells
from klack.units import (
    Angle,
    Area,
    Conductivity,
    FieldStrength,
    FluxDensity,
    Length,
    Permeance,
    Ratio,
    format_si,
)

__all__ = [
    "ArmatureBore",
    "EddyPart",
    "Hysteresis",
    "IronPart",
    "IronShell",
    "ParasiticGap",
    "PermanentMagnet",
    "PoleGap",
    "SolidIron",
]


class PoleGap(Section):
    r"""One working gap between pole and armature, closed by the stroke.

    .. math:: P = \mu_0 \frac{A}{g} + \mu_0\, c(g)\, l_\text{edge}

    with the gap plus the residual gap ``g``, and an edge number ``c`` of
    :mod:`klack.magnetics.air_gap`.
    """

    outer_radius: Length = Field(gt=0, description="Outer radius of the pole face.")
    inner_radius: Length = Field(default=0.0, ge=0, description="Inner radius; 0: a full disc.")
    fringing: Literal["none", "equal", "plane", "wall"] = Field(
        description="Edge field: none, equal (two equal poles), plane (pole facing a larger "
        "plane), wall (two equal poles inside a tube)."
    )
    shoulder: Length | None = Field(
        default=None,
        gt=0,
        description="Length of the side face next to the edge, for equal and plane.",
    )
    wall: Length | None = Field(
        default=None, gt=0, description="Distance of the tube from the side face, for wall."
    )
    tilts: bool = Field(
        default=False,
        description="Whether a tilted armature feels the moment of this gap, with motion: "
        "three-dimensional.",
    )

    @model_validator(mode="after")
    def _complete(self) -> Self:
        refuse_key_if(
            self.inner_radius >= self.outer_radius,
            ("inner_radius",),
            got=f"{self.inner_radius:g} m with an outer radius of {self.outer_radius:g} m",
            expected="an inner radius below the outer radius",
            hint="swap the two radii.",
        )
        needed = {"none": None, "equal": "shoulder", "plane": "shoulder", "wall": "wall"}
        key = needed[self.fringing]
        for name in ("shoulder", "wall"):
            if name != key:
                self._refuse_with((name,), f"fringing: {self.fringing}", "it is not used there")
        refuse_key_if(
            key is not None and getattr(self, key) is None,
            (),
            got=f"fringing: {self.fringing} without {key}",
            expected=f"a length '{key}'",
            hint=f"add {key}, or choose fringing: none.",
        )
        return self

    @property
    def area(self) -> float:
        """Face area [m^2]."""
        return pi * (self.outer_radius**2 - self.inner_radius**2)

    def reluctance(self, gap: Vector) -> tuple[Vector, Vector]:
        """Reluctance [A/Wb] at a gap [m] above zero, and its derivative by the gap."""
        edge = VACUUM_PERMEABILITY * 2.0 * pi * (self.outer_radius + self.inner_radius)
        P, dP = face_permeance(self.area, gap), -face_permeance(self.area, gap) / gap
        if self.fringing != "none":
            c, dc = self._edge(gap)
            P, dP = P + edge * c, dP + edge * dc
        return 1.0 / P, -dP / P**2

    def _edge(self, gap: Vector) -> tuple[Vector, Vector]:
        if self.fringing == "wall":
            return edges_beside_wall(gap, self.wall or 0.0)
        law = equal_edges if self.fringing == "equal" else edge_on_plane
        return law(gap, self.shoulder or 0.0)


class ArmatureBore(Section):
    """Where a gap is that surrounds the armature, so that it pulls an armature off its axis."""

    height: Length = Field(
        description="Height z of the middle of the ring, in the drawing of the needle."
    )
    eccentricity: Length = Field(
        default=0.0, ge=0, description="Distance between the axes of bore and guide."
    )
    direction: Angle = Field(default=0.0, description="Direction of the offset, from x towards y.")


class ParasiticGap(Section):
    """A gap that the stroke does not change: the guide of the armature, a joint, a weld ring."""

    permeance: Permeance | None = Field(default=None, gt=0, description="Given directly.")
    radius: Length | None = Field(default=None, gt=0, description="Inner radius of a guide ring.")
    clearance: Length | None = Field(default=None, gt=0, description="Radial clearance there.")
    length: Length | None = Field(default=None, gt=0, description="Axial length of the ring.")
    off_axis: ArmatureBore | None = Field(
        default=None,
        description="Offset of a ring round the armature, with motion: three-dimensional: the "
        "ring pulls the armature to the nearer side. Without it there is no force across the "
        "axis.",
    )

    @model_validator(mode="after")
    def _one(self) -> Self:
        ring = ("radius", "clearance", "length", "off_axis")
        if self.permeance is not None:
            return self._refuse_with(ring, "permeance", "the permeance is sufficient")
        refuse_key_if(
            any(getattr(self, name) is None for name in ring[:3]),
            (),
            got="an incomplete gap",
            expected="either permeance, or radius, clearance and length",
            hint="add the missing lengths of the guide ring.",
        )
        clearance = self.clearance or 0.0
        if self.off_axis is not None and self.off_axis.eccentricity >= clearance:
            raise CaseProblem(
                ("off_axis", "eccentricity"),
                got=f"{format_si(self.off_axis.eccentricity, 'm')} in a clearance of "
                f"{format_si(clearance, 'm')}",
                expected="less than the clearance",
                hint="check both, and their units.",
            )
        return self

    @property
    def reluctance(self) -> float:
        """Reluctance [A/Wb], the armature on the axis of its guide."""
        if self.permeance is not None:
            return 1.0 / self.permeance
        assert self.radius is not None
        assert self.clearance is not None
        assert self.length is not None
        outer = self.radius + self.clearance
        if self.off_axis is not None and self.off_axis.eccentricity > 0.0:
            e = self.off_axis.eccentricity
            return 1.0 / float(eccentric_ring(self.radius, outer, self.length, e)[0])
        return 1.0 / ring_permeance(self.radius, outer, self.length)


class Hysteresis(Section):
    """Hysteresis of a part: its major loop; see :mod:`klack.magnetics.hysteresis`."""

    coercivity: FieldStrength | None = Field(
        default=None, gt=0, description="H_c of the major loop; not with material: loop."
    )
    remanence: FluxDensity | None = Field(
        default=None,
        gt=0,
        description="B_r of the closed ring; without it the width of the loop is constant.",
    )
    initial_permeability: Number = Field(
        gt=1, description="Relative permeability of the demagnetised iron for small changes."
    )


class SolidIron(Section):
    """Eddy currents of a solid piece of iron, with its own magnetisation curve.

    In shells (:mod:`klack.magnetics.solid_iron`); not with an entry of ``eddy`` for the same piece.
    """

    shape: Literal["cylinder", "sheet"] = Field(
        default="cylinder", description="Solid round core, or sheet / thin-walled tube."
    )
    conductivity: Conductivity = Field(
        gt=0, description="Of the iron; ferritic stainless 1.3 to 1.7 MS/m, pure iron 10 MS/m."
    )
    thickness: Length | None = Field(default=None, gt=0, description="Of a sheet or tube wall.")
    terms: Count = Field(default=3, le=MOST_TERMS, description="Shells, 1 to 4.")
    slots: Ratio = Field(
        default=1.0, gt=0, le=1, description="Factor on the eddy conductance of slotted iron."
    )

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.shape == "cylinder":
            return self._refuse_with(("thickness",), "shape: cylinder", "its area is sufficient")
        refuse_key_if(
            self.thickness is None,
            (),
            got="no key 'thickness'",
            expected="thickness, for shape: sheet",
            hint="add thickness.",
        )
        return self


@dataclass(frozen=True, slots=True, eq=False)
class IronShell:
    """A shell of solid iron behind its shorted turn: conductance [S], curve, stops."""

    turn: float
    law: IronReluctance
    stops: IronStops | None


class IronPart(Section):
    """A piece of iron that the main flux passes, of constant section."""

    material: IronChoice = Field(description="Name of a library material, or a curve.")
    length: Length = Field(gt=0, description="Mean path of the flux in the part.")
    area: Area = Field(gt=0, description="Cross-section across the flux.")
    hysteresis: Hysteresis | None = Field(
        default=None,
        description="Remanence and hysteresis loss; the material gives the mean curve.",
    )
    eddy: SolidIron | None = Field(
        default=None, description="Eddy currents with the momentary permeability."
    )

    @model_validator(mode="after")
    def _one_loop(self) -> Self:
        given = self.hysteresis
        if given is None:
            return self
        if self.material.loop is None:
            refuse_key_if(
                given.coercivity is None,
                ("hysteresis",),
                got="no key 'coercivity'",
                expected="the coercivity of the iron",
                hint="add coercivity, or measure the loop: material: {loop: ...}.",
            )
        else:
            for name in ("coercivity", "remanence"):
                refuse_key_if(
                    getattr(given, name) is not None,
                    ("hysteresis", name),
                    got=f"{name} together with material: loop",
                    expected="one of them",
                    hint=f"remove {name}; the loop contains it.",
                )
        try:
            self.width()
        except InputError as error:
            key = error.where.rpartition(": ")[2]
            place = ("hysteresis", key) if key in Hysteresis.model_fields else ("hysteresis",)
            raise CaseProblem(
                place, got=error.got, expected=error.expected, hint=error.hint
            ) from None
        return self

    def width(self) -> LoopWidth | None:
        """Half the width of the loop; None without hysteresis."""
        given = self.hysteresis
        if given is None:
            return None
        mu, loop = float(given.initial_permeability), self.material.loop
        if loop is not None:
            return measured_width(loop.flux_density, loop.field_strength, mu)
        assert given.coercivity is not None
        curve = self.material.curve()
        if given.remanence is None:
            return constant_width(curve, given.coercivity, mu)
        return falling_width(curve, given.coercivity, given.remanence, mu)

    def stops(self, share: float = 1.0) -> IronStops | None:
        """Stops of a share of the section; None without hysteresis."""
        width = self.width()
        return None if width is None else width.stops(self.length, share * self.area)

    def shells(self) -> tuple[IronShell, ...]:
        """Shells of solid iron from the surface inwards; none without ``eddy``."""
        solid = self.eddy
        if solid is None:
            return ()
        size = solid.slots * solid.conductivity * self.length  # R tau
        if solid.thickness is None:
            size /= pi
        else:
            size *= solid.thickness**2 / self.area
        parts, curve = shells(solid.shape, solid.terms), self.material.curve()
        return tuple(
            IronShell(q * size, curve.law(self.length, w * self.area), self.stops(w))
            for w, q in zip(parts.shares, parts.turns, strict=True)
        )


class PermanentMagnet(Section):
    r"""A magnet in series with the main flux, on its straight recoil line.

    .. math:: B = B_r + \mu_0\mu_r H, \qquad
              \Theta = \frac{l}{\mu_0\mu_r A}\,\varphi - \frac{B_r l}{\mu_0\mu_r}

    Limits: no knee; check that the working point stays above it.
    """

    remanence: FluxDensity = Field(gt=0, description="B_r at its temperature; NdFeB 1.0 to 1.4 T.")
    recoil_permeability: Number = Field(
        ge=1,
        description="mu_r of the recoil line; NdFeB and SmCo 1.03 to 1.1, ferrite 1.05 to 1.2.",
    )
    length: Length = Field(gt=0, description="Along its magnetisation.")
    area: Area = Field(gt=0, description="Cross-section across it.")
    polarity: Literal["with-coil", "against-coil"] = Field(
        description="Whether its flux adds to that of a positive current."
    )

    @property
    def reluctance(self) -> float:
        """Reluctance of the recoil line [A/Wb]."""
        return self.length / (VACUUM_PERMEABILITY * self.recoil_permeability * self.area)

    @property
    def mmf(self) -> float:
        """Magnetomotive force [A], positive with the coil."""
        size = self.remanence * self.length / (VACUUM_PERMEABILITY * self.recoil_permeability)
        return size if self.polarity == "with-coil" else -size


class EddyPart(Section):
    """Solid iron whose eddy currents hold back the main flux; see :mod:`klack.magnetics.eddy`."""

    shape: Literal["cylinder", "sheet"] = Field(
        default="cylinder", description="Solid round core, or sheet / thin-walled tube."
    )
    conductivity: Conductivity = Field(
        gt=0, description="Of the iron; ferritic stainless 1.3 to 1.7 MS/m, pure iron 10 MS/m."
    )
    length: Length = Field(gt=0, description="Along the flux.")
    radius: Length | None = Field(default=None, gt=0, description="Of a cylinder.")
    thickness: Length | None = Field(default=None, gt=0, description="Of a sheet or tube wall.")
    width: Length | None = Field(default=None, gt=0, description="Of a sheet; circumference.")
    terms: Count = Field(default=1, le=MOST_TERMS, description="Terms of the ladder, 1 to 4.")
    permeability: Ratio | None = Field(
        default=None, gt=1, description="Relative permeability, for more than one term."
    )
    slots: Ratio = Field(
        default=1.0, gt=0, le=1, description="Factor on the eddy conductance of slotted iron."
    )

    @model_validator(mode="after")
    def _complete(self) -> Self:
        cylinder, sheet = ("radius",), ("thickness", "width")
        wanted, unused = (cylinder, sheet) if self.shape == "cylinder" else (sheet, cylinder)
        self._refuse_with(unused, f"shape: {self.shape}", f"it takes {', '.join(wanted)}")
        if self.terms > 1:
            wanted = (*wanted, "permeability")
        for name in wanted:
            refuse_key_if(
                getattr(self, name) is None,
                (),
                got=f"no key '{name}'",
                expected=f"{name}, for shape: {self.shape} with {self.terms} terms",
                hint=f"add {name}.",
            )
        return self

    def ladder(self) -> EddyLadder:
        """Return the ladder."""
        mu = self.permeability or 1e3  # one term does not depend on it
        sigma = self.conductivity * self.slots
        if self.shape == "cylinder":
            assert self.radius is not None
            return cylinder_ladder(
                conductivity=sigma,
                length=self.length,
                radius=self.radius,
                permeability=mu,
                terms=self.terms,
            )
        assert self.thickness is not None
        assert self.width is not None
        return sheet_ladder(
            conductivity=sigma,
            length=self.length,
            thickness=self.thickness,
            width=self.width,
            permeability=mu,
            terms=self.terms,
        )
