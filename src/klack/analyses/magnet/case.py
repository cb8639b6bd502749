"""The case of a magnet: its drawing, and the points of its map."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import Field, PrivateAttr, model_validator

from klack.case.bodies import WrittenCase
from klack.case.reader import find_case, parse, text_of, validated
from klack.errors import InputError
from klack.input.problem import CaseProblem, Key, refuse_key_if
from klack.input.section import Name, Number, Section
from klack.magnetics.drawn_magnet import DrawnMagnet, DrawnPart, section
from klack.magnetics.iron_choice import IronChoice
from klack.mesh.profile import Profile
from klack.units import LENGTH, Current, Length, LengthUnit, format_si

__all__ = ["MagnetCase", "load_magnet_case"]

_CORNERS = "Corners (r, z) of the half section in order; two corners define a rectangle."


class MagnetPart(Section):
    """A body of revolution of iron."""

    corners: tuple[tuple[Number, Number], ...] = Field(min_length=2, description=_CORNERS)
    iron: IronChoice | None = Field(
        default=None, description="Material, if other than that of the magnet."
    )


class MagnetCoil(Section):
    """The winding, its turns spread evenly."""

    corners: tuple[tuple[Number, Number], ...] = Field(min_length=2, description=_CORNERS)
    turns: Number = Field(gt=0, description="Number of turns.")


class Drawing(Section):
    """A magnet of revolution, drawn as its half section, and the points of its map."""

    unit: LengthUnit = Field(description="Unit of all coordinates, e.g. mm.")
    iron: IronChoice = Field(description="Magnetisation curve: a name of the library, or a curve.")
    fixed: dict[Name, MagnetPart] = Field(min_length=1, description="Fixed iron parts, by name.")
    moving: dict[Name, MagnetPart] = Field(min_length=1, description="Moving iron parts, by name.")
    coil: MagnetCoil = Field(description="Section of the coil, without bobbin.")
    drawn_gap: Length = Field(default=0.0, ge=0, description="Working gap of the drawing.")
    opens: Literal["upward", "downward"] = Field(
        default="upward", description="Motion along z that opens the working gap."
    )
    current: tuple[Current, ...] = Field(
        min_length=2, description="Currents of the map, increasing; 0 A may be left out."
    )
    gap: tuple[Length, ...] = Field(
        min_length=3, description="Working gaps of the map, increasing."
    )
    mesh_size: Length | None = Field(
        default=None,
        gt=0,
        description="Element size at corners of the iron; at most the shortest distance between "
        "moving and fixed parts, which is the default.",
    )

    _magnet: DrawnMagnet = PrivateAttr()

    @model_validator(mode="after")
    def _drawable(self) -> Self:
        for name, values, unit in (("current", self.current, "A"), ("gap", self.gap, "m")):
            for k, (one, other) in enumerate(zip((-1.0, *values), values, strict=False)):
                if other <= one or other < 0.0:
                    got = format_si(other, unit) + (f" after {format_si(one, unit)}" if k else "")
                    hint = f"give each {name} once, the smallest first, from 0."
                    raise CaseProblem((name, k), got=got, expected="increasing numbers", hint=hint)
        curve = self.iron.curve()  # one object: parts of one iron are one region

        def parts(group: str, given: Mapping[str, MagnetPart], lower: float) -> Any:
            for name, part in given.items():
                iron = part.iron or self.iron
                yield DrawnPart(
                    name,
                    self._profile((group, name, "corners"), part.corners, lower),
                    curve if part.iron is None else part.iron.curve(),
                    iron.highest,
                )

        opens = 1 if self.opens == "upward" else -1
        fixed = tuple(parts("fixed", self.fixed, 0.0))
        moving = tuple(parts("moving", self.moving, opens * self.drawn_gap))
        coil = self._profile(("coil", "corners"), self.coil.corners, 0.0)
        key: Key = ("coil",)
        try:
            magnet = DrawnMagnet(
                fixed=fixed, moving=moving, coil=coil, turns=self.coil.turns, opens=opens
            )
            for k, gap in enumerate(self.gap):
                key = ("gap", k)
                magnet.require_resolved(gap, self.mesh_size)
        except InputError as error:
            word = error.where.removeprefix("DrawnMagnet: ")
            group = next((g for g in ("fixed", "moving") if word in getattr(self, g)), "")
            raise CaseProblem(
                (group, word) if group else key,
                got=error.got,
                expected=error.expected,
                hint=error.hint,
            ) from None
        self._magnet = magnet
        return self

    def _profile(self, key: Key, corners: Any, lower: float) -> Profile:
        for r, z in corners:
            refuse_key_if(
                not (LENGTH.holds(r * self.unit) and LENGTH.holds(z * self.unit)),
                key,
                got=f"the point [{r:g}, {z:g}] in a unit of {self.unit:g} m",
                expected=f"coordinates of 0, or of {LENGTH.smallest:g} to {LENGTH.largest:g} m",
                hint="check the unit and the powers of ten.",
            )
        try:
            # 15 digits: 0.3 mm must be the same number here as 0.0003 m elsewhere
            return section(
                *(
                    (float(f"{r * self.unit:.15g}"), float(f"{z * self.unit - lower:.15g}"))
                    for r, z in corners
                )
            )
        except InputError as error:
            raise CaseProblem(
                key,
                got=f"({error.where.removeprefix('Profile: ')}) {error.got}",
                expected=error.expected,
                hint=error.hint,
            ) from None

    @property
    def magnet(self) -> DrawnMagnet:
        """As drawn, in SI, its gap closed."""
        return self._magnet


class MagnetCase(WrittenCase):
    """A magnet, from its drawing to its map."""

    magnet: Drawing = Field(description="Drawing, and points of the map.")


def load_magnet_case(path: str | Path) -> MagnetCase:
    """Read and check the case file of a magnet, or a shipped one by name."""
    path = find_case(path)
    text = text_of(path)
    data, lines = parse(text, path)
    other = next((key for key in ("network", "contact") if key in data), None)
    if other is not None and "magnet" not in data:
        raise InputError(
            f"{path}:{lines.find((other,), on_key=True)}: {other}",
            got="a case of a whole valve" if other == "network" else "a case of an impact",
            expected="a case of a magnet, with a section 'magnet'",
            hint=f"run it with klack {'stroke' if other == 'network' else 'impact'}.",
        )
    return validated(MagnetCase, text, path, data, lines)
