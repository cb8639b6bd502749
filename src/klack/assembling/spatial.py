"""From a valve case to bodies that meet point by point, with a guide."""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import cos, hypot, pi, sin
from typing import Self

import numpy as np
from numpy.typing import NDArray

from klack.assembling.bodies import BodyPair
from klack.assembling.modes import damping_of, selection_of, shape_marks
from klack.assembling.off_axis import off_axis_space, touch_height
from klack.assembling.placement import axis_through, in_disc
from klack.assembling.stops import StopContact
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.damping import damping_ratios
from klack.bodies.reduction.ports import Port
from klack.bodies.reduction.reduce import kept_modes
from klack.case.bodies import BodySurface
from klack.case.guide import LinearGuideLaw, ValveGuide
from klack.case.valve import ValveCase
from klack.case.valve_roles import ValveRoles
from klack.contact.face_friction import FaceFriction
from klack.contact.friction import Friction
from klack.contact.gap_update import Pairing, PlacedGaps, RigidGaps, RingGaps
from klack.contact.mortar import ContactSpace
from klack.contact.rings import RingSpace
from klack.contact.statics import contact_compliance, extended_compliance
from klack.errors import AccuracyWarning, InputError
from klack.hydraulics.film import ConeFilm, DiscFilm, FilmShape, RingFilm
from klack.hydraulics.tilted_film import SectorFilm, sector_film
from klack.mesh.rigid import rigid_placement, rotation_matrix
from klack.transient.guide import ShaftSection, guide_at_sections, solid_sections
from klack.transient.interface_arrays import Guide
from klack.transient.interface_model import (
    InterfaceBody,
    InterfaceContact,
    InterfaceModel,
    interface_model,
)
from klack.transient.placed_gaps import gap_course
from klack.transient.spatial_run import SpatialValve
from klack.transient.tilting_films import BearingFilm, TiltingFilm
from klack.units import format_si

__all__ = [
    "Meeting",
    "Movers",
    "body_guide",
    "build_spatial",
    "check_heights",
    "modes_in_network",
    "placed_bodies",
    "placement_of",
    "seat_height",
    "valve_of_meetings",
]


_WIDE = 0.1  # width over mean radius, above which heights differ across the land
_TOUCHING = 0.05  # share of the reach: points that touch first


def tilting_film(
    stop: str, film: FilmShape, space: ContactSpace | RingSpace, reach: float
) -> TiltingFilm:
    """Land of a film, and its lift and tilts in the gaps of contact points.

    A conical land is unrolled to a flat ring of its mean radius and width, with heights normal to
    the cone.

    Parameters
    ----------
    space
        Of the stop, centred, all round.
    reach [m]
        Largest gap in touch.
    """
    slope, land, cubic = 1.0, None, 1.0
    if isinstance(film, RingFilm):
        land = _ring(film.inner_radius, film.outer_radius, film.sectors)
        cubic = film.coefficients()[0]
    elif isinstance(film, DiscFilm):
        land = sector_film(0.0, film.radius, sectors=film.sectors, circles=2)
        cubic = film.coefficients()[0]
    elif isinstance(film, ConeFilm):
        half = 0.5 * min(film.width, 1.9 * film.mean_radius)
        inner, outer = film.mean_radius - half, film.mean_radius + half
        land, slope = _ring(inner, outer, film.sectors), sin(film.half_angle)
        flat = RingFilm(shape="ring", inner_radius=inner, outer_radius=outer)
        cubic = flat.coefficients()[0]
    lift = space.gap / np.maximum(space.axial * np.sign(np.sum(space.axial)), 1e-6)
    near = lift <= lift.min() + _TOUCHING * reach
    weight = np.where(near, space.area, 0.0)
    shapes = np.column_stack([np.ones(len(space.gap)), space.points[:, :2]])
    fit = np.linalg.solve((shapes.T * weight) @ shapes, shapes.T * weight)
    touching = space.gap - lift.min() * np.abs(space.axial)
    return TiltingFilm(stop=stop, land=land, cubic=cubic, slope=slope, fit=fit, base=fit @ touching)


def _ring(inner: float, outer: float, sectors: int) -> SectorFilm:
    wide = outer - inner > _WIDE * 0.5 * (inner + outer)
    return sector_film(inner, outer, sectors=sectors, circles=2 if wide else 1)


Vector = NDArray[np.float64]

_DIRECTIONS = 8
_NOMINAL = 1e-4  # of a radius: bore and shaft drawn with one size
_AS_DRAWN = 0.1  # of a drawn gap that the clearance may be off by
_IN_THE_WALL = 1e-3  # of the clearance: the axis of a meshed shaft is known as well


@dataclass(frozen=True, kw_only=True, eq=False)
class Meeting:
    """One stop, its bodies apart as at the start.

    Parameters
    ----------
    reach [m]
        Largest gap of the centred bodies in touch.
    arm (3,) [m]
        Middle of the points from the centre of mass of the mover: the upper body, unless it is
        held.
    gaps
        At any rigid placement.
    pairing
        The mover, and what it meets.
    """

    name: str
    space: ContactSpace | RingSpace
    reach: float
    arm: Vector
    gaps: RigidGaps | RingGaps
    pairing: Pairing


@dataclass(frozen=True, kw_only=True, eq=False)
class Movers:
    """Bodies of a valve that move, the needle first, and where they may be.

    Parameters
    ----------
    names
        Of the bodies.
    guides
        Of those that have one.
    carriers
        Of each: the body on which it slides, -1 for a fixed bore or none.
    levers (n, 3) [m]
        Centre of mass of each from that of its carrier.
    placements (n, 6) [m], [rad]
        At the start.
    farthest
        Of each: placements that contact points must suffice for, as its carrier sees them, and how
        far off-axis these are [m].  The first two are along x, the others turned.
    """

    names: tuple[str, ...]
    guides: Mapping[str, ValveGuide]
    carriers: tuple[int, ...]
    levers: Vector
    placements: Vector
    farthest: tuple[tuple[list[Vector], float], ...]

    @classmethod
    def of(
        cls, case: ValveCase, needle: str, bodies: Mapping[str, ElasticBody], height: float
    ) -> Self:
        """Those of a case; ``height`` [m] is that of the seat in the drawing of the needle."""
        centres = {needle: bodies[needle].centre_in_space}
        centres |= {n: body.centre_in_space for n, body in bodies.items() if not body.is_fixed}
        names = list(centres)
        guides = dict(case.guides) if case.guide is None else {needle: case.guide, **case.guides}
        farthest = []
        for name, centre in centres.items():
            about = np.array([0.0, 0.0, height if name == needle else float(centre[2])]), centre
            placed = np.zeros(2), np.zeros(2)
            if name == needle:
                placed = placement_of(case, height)
                first = rigid_placement(*placed, *about)
            far = farthest_positions(guides.get(name), placed, float(about[0][2]))
            farthest.append(
                ([rigid_placement(*each, *about) for each in far], max(hypot(*a) for a, _ in far))
            )
        seed = None if case.placement is None else case.placement.seed
        carriers = _carriers(case, names)
        levers = [centres[n] - centres[names[c]] for n, c in zip(names, carriers, strict=True)]
        return cls(
            names=tuple(names),
            guides={name: guides[name] for name in names if name in guides},
            carriers=carriers,
            levers=np.array(levers),
            placements=placed_bodies(case, first, centres, None if seed is None else [seed]),
            farthest=tuple(farthest),
        )

    def pairing(self, pair: BodyPair, gap: float) -> Pairing:
        """Which of them meet at a stop, its upper body raised by the gap [m]."""
        upper, lower = pair.upper, pair.lower
        if upper.name not in self.names:
            return Pairing(self.names.index(lower.name), -1, np.zeros(3), is_upper=False)
        other = self.names.index(lower.name) if lower.name in self.names else -1
        lever = upper.centre_in_space - lower.centre_in_space + [0.0, 0.0, gap]
        return Pairing(self.names.index(upper.name), other, lever)

    def reach(self, pairing: Pairing, turns: int = _DIRECTIONS) -> tuple[list[Vector], float]:
        """Farthest placements of the mover of a contact as the other body sees it.

        Two bodies that move lean opposite ways.

        Parameters
        ----------
        turns
            Directions round the axis.
        """
        mover, other = pairing.mover, pairing.other
        far, aside = self.farthest[mover]
        if self.carriers[mover] == other:
            return far[: 2 * turns], aside
        found = []
        for k in range(turns):
            opposite = (k + _DIRECTIONS // 2) % _DIRECTIONS
            ours, theirs = self._towards(mover, k), [np.zeros(6)]
            if other >= 0 and self.carriers[other] == mover:
                ours, theirs = theirs, _by_direction(self.farthest[other][0])[opposite]
            elif other >= 0:
                theirs = self._towards(other, opposite)
            for one in ours:
                for beside in theirs:
                    placed = np.zeros((len(self.names), 6))
                    placed[mover] = one
                    if other >= 0:
                        placed[other] = beside
                    found.append(pairing.relative(placed))
        return found, sum(width for _, width in self.farthest)

    def _towards(self, number: int, k: int) -> list[Vector]:
        """Farthest placements of a body in a direction, with those of its carrier."""
        own, carrier = _by_direction(self.farthest[number][0])[k], self.carriers[number]
        if carrier < 0:
            return own
        lever = self.levers[number]
        return [
            _carried(below, lever) + here for below in self._towards(carrier, k) for here in own
        ]

    def guided(self) -> Iterator[tuple[str, ValveGuide, BodySurface | None]]:
        """Each guided body, its guide, and on what it slides."""
        for name, guide in self.guides.items():
            yield name, guide, getattr(guide, "on", None)

    def joined(self, guides: Mapping[str, Guide]) -> tuple[Guide | None, tuple[int, ...]]:
        """Guides of all bodies in one, and the body at each height."""
        if not guides:
            return None, ()
        ordered = [(k, guides[name]) for k, name in enumerate(self.names) if name in guides]
        parts = zip(*(guide for _, guide in ordered), strict=True)
        joined = Guide(*(np.concatenate(part) for part in parts))
        return joined, tuple(k for k, guide in ordered for _ in guide.heights)

    def bearing(self) -> BearingFilm | None:
        """Films at the heights of all guides."""
        films = [guide.film for guide in self.guides.values() for _ in guide.heights]
        if not any(films):
            return None
        return BearingFilm(
            length=np.array([0.0 if film is None else film.length for film in films]),
            cut_off=np.array([0.0 if film is None else film.cut_off for film in films]),
        )


def _carriers(case: ValveCase, names: Sequence[str]) -> tuple[int, ...]:
    """The body on which each slides, -1 for none."""
    on = [None if name not in case.guides else case.guides[name].on for name in names]
    return tuple(-1 if place is None else names.index(place.body) for place in on)


def _carried(below: Vector, lever: Vector) -> Vector:
    """Placement of a body that moves with its carrier, ``lever`` [m] from its centre of mass."""
    return below + np.append(rotation_matrix(below[3:]) @ lever - lever, np.zeros(3))


def placed_bodies(
    case: ValveCase, first: Vector, centres: Mapping[str, Vector], seed: Sequence[int] | None
) -> Vector:
    """Placements (6 bodies,) [m], [rad] of all bodies that move, beside that of the needle.

    Parameters
    ----------
    first (6,) [m], [rad]
        Of the needle.
    centres
        Of mass of all these bodies, as drawn, the needle first.
    seed
        Others are drawn within their guides; None: centred in them.
    """
    names, placed = list(centres), {0: first}
    carriers = _carriers(case, names)
    for number in sorted(range(1, len(names)), key=lambda k: carriers[k] >= 0):
        name, carrier = names[number], carriers[number]
        centre = centres[name]
        about = np.array([0.0, 0.0, float(centre[2])])
        own = rigid_placement(*drawn_beside(case, name, float(centre[2]), seed), about, centre)
        if carrier >= 0:
            own = own + _carried(placed[carrier], centre - centres[names[carrier]])
        placed[number] = own
    return np.concatenate([placed[k] for k in range(len(names))])


def drawn_beside(
    case: ValveCase, name: str, height: float, seed: Sequence[int] | None
) -> tuple[Vector, Vector]:
    """Position in its guide at a height, and slope, of the axis of a body beside the needle.

    Centred without a seed or a guide.
    """
    guide = case.guides.get(name)
    if seed is None or guide is None:
        return np.zeros(2), np.zeros(2)
    own = list(case.bodies).index(name)
    shares = np.random.default_rng([*seed, own]).random(4)
    c = guide.clearance
    return axis_through(guide, height, in_disc(shares[:2], c), in_disc(shares[2:], c))


def _by_direction(far: list[Vector]) -> list[list[Vector]]:
    """Placements of each direction round the axis."""
    size = len(far) // _DIRECTIONS
    if not size:
        return [far] * _DIRECTIONS
    return [far[size * k : size * (k + 1)] for k in range(_DIRECTIONS)]


def build_spatial(
    case: ValveCase,
    roles: ValveRoles,
    bodies: Mapping[str, ElasticBody],
    flexibilities: Mapping[str, Flexibility],
    pools: Mapping[str, Modes],
    ports: Mapping[str, Sequence[Port]],
    contacts: Mapping[str, StopContact],
) -> SpatialValve:
    """Bodies of a valve with all freedoms, contact points of its stops, and its guide.

    Modes are those of the network. Contact points are all that can close in any position within
    the guide, or of the start without. With friction of one stop, or in shots, all have tangential
    directions. Rejects a guide that does not fit, or a placement outside of it.
    """
    parts = case.network.components
    needle = str(getattr(parts[roles.needle], "body", ""))
    kept = {name: modes_in_network(case, name, pools, ports) for name in bodies}
    movers = Movers.of(case, needle, bodies, seat_height(contacts, needle))
    rubs = case.rubs
    found = [
        _meeting(
            contact,
            movers,
            flexibilities,
            float(getattr(parts[name], "gap", 0.0)),
            Friction.coulomb(case.stops[name].friction) if rubs else None,
        )
        for name, contact in contacts.items()
    ]
    model = interface_model(
        [
            InterfaceBody(
                body=bodies[name],
                flexibility=flexibilities[name],
                modes=kept[name],
                damping=damping_ratios(
                    damping_of(case.bodies[name].damping),
                    bodies[name],
                    kept[name].omega,
                    kept[name].shapes,
                ),
            )
            for name in [needle, *(name for name in bodies if name != needle)]
        ],
        [
            InterfaceContact(
                name=name,
                upper=contact.pair.upper.name,
                lower=contact.pair.lower.name,
                space=space,
                compliance=compliance,
                faces=faces,
            )
            for (name, contact), (_, space, compliance, faces) in zip(
                contacts.items(), found, strict=True
            )
        ],
    )

    def sections(name: str, surface: str, guide: ValveGuide) -> list[ShaftSection]:
        shapes = np.hstack([bodies[name].rigid_modes, kept[name].shapes])
        whole = None if isinstance(guide.law, LinearGuideLaw) else flexibilities[name]
        return solid_sections(bodies[name], shapes, whole, surface, guide.heights)

    guides = {
        name: body_guide(
            model,
            name,
            guide,
            sections(name, guide.surface, guide),
            None if on is None else (on.body, sections(on.body, on.surface, guide)),
        )
        for name, guide, on in movers.guided()
    }
    spatial = valve_of_meetings(case, model, [meeting for meeting, *_ in found], guides, movers)
    shapes = [np.hstack([bodies[name].rigid_modes, kept[name].shapes]) for name in model.bodies]
    return replace(spatial, shape_marks=np.concatenate([shape_marks(each) for each in shapes]))


def body_guide(
    model: InterfaceModel,
    name: str,
    guide: ValveGuide,
    sections: Sequence[ShaftSection],
    on: tuple[str, Sequence[ShaftSection]] | None,
) -> Guide:
    """Guide of a body at its sections; ``on``: the body on which it slides, and its sections.

    Rejects a drawn bore that is narrower than the drawn shaft in it; warns where their gap is not
    the clearance.
    """
    law = guide.law
    if on is not None:
        _check_bore(name, guide, sections, on)
    return guide_at_sections(
        model,
        name,
        sections,
        on=on,
        clearance=guide.clearance,
        stiffness=law.stiffness if isinstance(law, LinearGuideLaw) else law.bore,
        friction=guide.friction,
        viscous=guide.viscous,
    )


def _check_bore(
    name: str,
    guide: ValveGuide,
    sections: Sequence[ShaftSection],
    on: tuple[str, Sequence[ShaftSection]],
) -> None:
    """Compare the clearance with the drawing, in which bore and shaft may be of equal width."""
    for bore, shaft in zip(sections, on[1], strict=True):
        drawn, nominal = bore.radius - shaft.radius, _NOMINAL * shaft.radius
        at = f"guides.{name} at z = {format_si(bore.centre[2], 'm')}"
        radii = f"{format_si(bore.radius, 'm', 5)} and {format_si(shaft.radius, 'm', 5)}"
        if drawn < -nominal:
            raise InputError(
                at,
                got=f"radii of '{name}' and of '{on[0]}' in it of {radii}, as drawn",
                expected="a bore wider than its shaft",
                hint="check the surfaces in 'surface' and 'on', and the drawings.",
            )
        if drawn > nominal and abs(drawn - guide.clearance) > max(nominal, _AS_DRAWN * drawn):
            warnings.warn(
                f"{at}: the clearance is {format_si(guide.clearance, 'm')} in the run, but "
                f"{format_si(drawn, 'm', 3)} as '{name}' and '{on[0]}' are drawn, with radii of "
                f"{radii}. Try: the drawn value for guides.{name}.clearance, or one radius for "
                "both drawings.",
                AccuracyWarning,
                stacklevel=2,
            )
            return


def valve_of_meetings(
    case: ValveCase,
    model: InterfaceModel,
    meetings: Sequence[Meeting],
    guides: Mapping[str, Guide],
    movers: Movers,
) -> SpatialValve:
    """Join the bodies of a valve that meet there.

    Parameters
    ----------
    model
        With the contacts of the meetings.
    guides
        By body.
    """
    parts = case.network.components
    component = {str(getattr(part, "body", "")): name for name, part in parts.items()}
    arms = np.array([meeting.arm for meeting in meetings])
    gaps = PlacedGaps(
        tuple(meeting.gaps for meeting in meetings),
        tuple(meeting.pairing for meeting in meetings),
    )
    reach = float(np.max(np.linalg.norm(arms, axis=1)))
    guide, guided = movers.joined(guides)
    return SpatialValve(
        model=model,
        components=tuple(component[name] for name in model.bodies),
        stops=tuple(meeting.name for meeting in meetings),
        arms=arms,
        guide=guide,
        guided=guided,
        gaps=gaps,
        course=gap_course(lambda at: gaps.between([at] * len(meetings)), reach),
        pairings=gaps.pairings,
        carried=movers.carriers,
        placement=movers.placements,
        bearing=movers.bearing(),
        films=tuple(
            tilting_film(meeting.name, film, meeting.space, meeting.reach)
            for meeting in meetings
            if (film := getattr(parts[meeting.name], "film", None)) is not None
        ),
    )


def check_heights(case: ValveCase, roles: ValveRoles, bodies: Mapping[str, ElasticBody]) -> None:
    """Reject a force across the axis beside the needle."""
    needle = str(getattr(case.network.components[roles.needle], "body", ""))
    low, high = (float(f(bodies[needle].mesh.points[:, -1])) for f in (np.min, np.max))
    for name, component in case.network.components.items():
        for part in component.off_axis_parts():
            outside = [z for z in part.heights if not low <= z <= high]
            if outside:
                keys = ".".join(str(key) for key in ("network", "components", name, *part.key))
                raise InputError(
                    f"{case.path or 'case'}: {keys}",
                    got=f"a force across the axis at z = {format_si(outside[0], 'm')}",
                    expected=f"a height of '{needle}' as drawn, {format_si(low, 'm')} to "
                    f"{format_si(high, 'm')}",
                    hint="heights are measured along z in the drawing of the needle, as in "
                    "guide.heights.",
                )


def modes_in_network(
    case: ValveCase, name: str, pools: Mapping[str, Modes], ports: Mapping[str, Sequence[Port]]
) -> Modes:
    """Elastic modes of a body in the network, with full shapes."""
    return kept_modes(
        selection_of(case.reduction.choice(name)),
        pools[name],
        np.column_stack([port.pattern for port in ports[name]]),
    )


def seat_height(contacts: Mapping[str, StopContact], needle: str) -> float:
    """Height of first touch in the drawing of the needle: seat, else stop [m]."""
    below = [contact for contact in contacts.values() if contact.pair.upper.name == needle]
    above = [contact for contact in contacts.values() if contact.pair.lower.name == needle]
    held = [contact for contact in below if contact.pair.lower.is_fixed]
    contact = (held or below or above)[0]
    height = touch_height(contact.static.space)
    return height - contact.pair.shift if below else height


def placement_of(case: ValveCase, height: float) -> tuple[Vector, Vector]:
    """Position of the axis at this height, and its slope; must fit into the guide."""
    at, guide = case.placement, case.guide
    if at is None:
        return np.zeros(2), np.zeros(2)
    if at.seed is not None and guide is not None:
        shares = np.random.default_rng(at.seed).random(4)
        c = guide.clearance
        return axis_through(guide, height, in_disc(shares[:2], c), in_disc(shares[2:], c))
    aside = at.eccentricity * np.array([cos(at.direction), sin(at.direction)])
    lean = at.tilt * np.array([cos(at.tilt_direction), sin(at.tilt_direction)])
    for z in () if guide is None else guide.heights:
        off = hypot(*(aside + lean * (z - height)))
        if guide is not None and off > guide.clearance * (1.0 + _IN_THE_WALL):
            raise InputError(
                f"{case.path or 'case'}: placement",
                got=f"a shaft {format_si(off, 'm')} off-axis in its guide at z = "
                f"{format_si(z, 'm')}",
                expected=f"at most the clearance, {format_si(guide.clearance, 'm')}",
                hint="reduce placement.eccentricity or placement.tilt, or enlarge guide.clearance.",
            )
    return aside, lean


def farthest_positions(
    guide: ValveGuide | None, placement: tuple[Vector, Vector], height: float
) -> list[tuple[Vector, Vector]]:
    """Positions and slopes of the axis that contact points must suffice for, all round.

    The first two are along x, the others turned.
    """
    aside, lean = placement
    if guide is None:
        turns = [_turned(2.0 * pi * k / _DIRECTIONS) for k in range(_DIRECTIONS)]
        return [(R @ aside, R @ lean) for R in turns] if np.any([aside, lean]) else [placement]
    found = []
    for k in range(_DIRECTIONS):
        towards = guide.clearance * _turned(2.0 * pi * k / _DIRECTIONS)[:, 0]
        found += [axis_through(guide, height, towards, sign * towards) for sign in (1.0, -1.0)]
    return found


def _turned(angle: float) -> NDArray[np.float64]:
    return np.array([[cos(angle), -sin(angle)], [sin(angle), cos(angle)]])


def _meeting(
    contact: StopContact,
    movers: Movers,
    flexibilities: Mapping[str, Flexibility],
    gap: float,
    friction: Friction | None,
) -> tuple[Meeting, ContactSpace, NDArray[np.float64], FaceFriction | None]:
    """A stop, its contact points, and the compliance of both bodies there."""
    pair, static = contact.pair, contact.static
    pairing = movers.pairing(pair, gap)
    upper_moves = pairing.is_upper
    centre = (pair.upper if upper_moves else pair.lower).centre_of_mass
    farthest, off_axis = movers.reach(pairing)
    space = off_axis_space(
        pair, static.space, farthest, off_axis, centre=centre, upper_moves=upper_moves
    )
    both = flexibilities[pair.upper.name], flexibilities[pair.lower.name]
    faces = None
    if friction is None:
        compliance = extended_compliance(space, static, *both)
    else:
        surfaces = (pair.upper.mesh, pair.upper_surface, pair.lower.mesh, pair.lower_surface)
        faces = FaceFriction.on(friction, space, *surfaces)
        compliance = contact_compliance(space, *both, faces=faces)
    up = np.array([0.0, 0.0, gap])
    raised = replace(pair, upper=replace(pair.upper, mesh=pair.upper.mesh.moved(up)))
    open_by, here = space.shifted(gap), centre + up if upper_moves else centre
    meeting = Meeting(
        name=contact.name,
        space=open_by,
        reach=space.reach,
        arm=space.points.mean(axis=0) - here,
        gaps=RigidGaps.of(
            open_by,
            raised.upper.mesh,
            raised.upper_surface,
            raised.lower.mesh,
            raised.lower_surface,
            centre=here,
            form=raised.form,
        ),
        pairing=pairing,
    )
    return meeting, open_by, compliance, faces
