"""Bodies of revolution that meet off-axis: points on rings, bodies in all orders.

Bodies stay centred in the meridian plane; the placement enters with the gaps of the surfaces.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from math import inf, pi

import numpy as np
from numpy.typing import NDArray

from klack.assembling.bodies import BodyPair, warn_far_touch
from klack.assembling.held_nodes import held_nodes
from klack.assembling.layers import layers_of
from klack.assembling.modes import damping_of, selection_of
from klack.assembling.problem import ContactProblem
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.elasticity.fourier_body import FourierBody, fourier_body
from klack.bodies.elasticity.ring_points import RingSections
from klack.bodies.reduction.selection import ByFrequency
from klack.case.bodies import CaseFile
from klack.case.guide import Placement
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.contact.gap_update import ABOVE, BELOW, PlacedGaps, RigidGaps, RingGaps
from klack.contact.mortar import ContactSpace, contact_space
from klack.contact.rings import RingFriction, RingSpace
from klack.errors import AccuracyWarning, ConvergenceError, InputError
from klack.mesh.mesh import Mesh, Surface
from klack.mesh.rigid import rigid_placement, rotation_matrix
from klack.transient.interface_model import InterfaceModel
from klack.transient.revolved_model import RevolvedBody, RingContact, revolved_model

__all__ = [
    "ANGLES",
    "off_axis_model",
    "off_axis_space",
    "ring_contacts",
    "touch_height",
    "turned",
    "turning_body",
]


Floats = NDArray[np.float64]

ANGLES = 48
"""Contact points round each ring without ``contact.angles``."""

_FIRST = 0.02  # share of the reach: points with so small a gap touch first
_MOVES = 30
_TOUCHING = 1e-12  # [m]


def ring_contacts(
    problem: ContactProblem, placement: Placement, count: int, reach: float
) -> list[RingContact]:
    """Contact points on rings with the moving body where the case places it.

    It is tilted about the point of its axis at the height of first touch, shifted aside, and moved
    along z to the gap of the case.  Rejects a contact around the axis.

    Parameters
    ----------
    problem
        Of bodies of revolution, centred.
    count
        Angles of every ring.
    reach [m]
        Largest gap of a contact point above the smallest.
    """
    pair, above, faces = problem.pair, problem.opposite, problem.case.contact.faces
    space, moved = _on_seat(problem, placement, count, reach)
    opposite = problem.case.opposite
    stop_faces = faces if opposite is None else opposite.faces(faces)
    smooth = faces.is_none and stop_faces.is_none
    contacts = [
        RingContact(
            name="contact",
            upper=pair.upper.name,
            lower=pair.lower.name,
            space=space,
            faces=None if smooth else RingFriction.on(faces, space.section, *_sides(pair)),
        )
    ]
    if above is not None:
        sides = (above.body.mesh, above.surface, pair.upper.mesh, above.moving_surface)
        more = _most_change(placement, above.space)
        section = contact_space(
            *sides, reach=above.space.reach + 2.0 * more, slave=above.space.slave
        )
        gaps = RingGaps.of(section, *sides, angle=space.angles, centre=_centre(pair))
        shift, rotation = moved[:3], moved[3:]
        # the moving body is body b here: body a is moved the opposite way, and along z to its gap
        back = np.concatenate([-rotation_matrix(rotation).T @ shift, -rotation])
        gap, _ = _at_gap(gaps, section, back, 0.0 if opposite is None else opposite.gap)
        there = RingSpace.within(section, gap, float(gap.min()) + above.space.reach + more)
        contacts.append(
            RingContact(
                name="opposite",
                upper=above.body.name,
                lower=pair.upper.name,
                space=there,
                faces=None if smooth else RingFriction.on(stop_faces, section, *sides),
            )
        )
    return contacts


def _on_seat(
    problem: ContactProblem, placement: Placement, count: int, reach: float
) -> tuple[RingSpace, Floats]:
    """Contact points of the seat, and placement of the moving body."""
    pair, sides = problem.pair, _sides(problem.pair)
    about = np.array([0.0, 0.0, touch_height(problem.space, of_upper=True)])
    more = _most_change(placement, problem.space)
    section = contact_space(
        *sides, reach=reach + 2.0 * more, slave=problem.space.slave, form=pair.form
    )
    angle = 2.0 * np.pi * np.arange(count) / count
    gaps = RingGaps.of(section, *sides, angle=angle, centre=_centre(pair), form=pair.form)
    # from above: a line that starts deep inside the other body does not find its surface
    moved = _rigid_placement(pair, placement, about) + np.array([0.0, 0.0, more, 0.0, 0.0, 0.0])
    gap, moved = _at_gap(gaps, section, moved, problem.case.contact.gap or 0.0)
    _check_refinement(problem.case, section, gap)
    return RingSpace.within(section, gap, float(gap.min()) + reach), moved


def _at_gap(
    gaps: RingGaps, section: ContactSpace, placement: Floats, wanted: float
) -> tuple[Floats, Floats]:
    """Gaps and placement of body a, moved along z until its first gap is ``wanted``."""
    facing = section.axial > 1e-6
    for _ in range(_MOVES):  # points slide along the other surface
        gap = gaps(placement)
        lift = wanted - float(np.min(gap[facing] / section.axial[facing, None]))
        if abs(lift) <= _TOUCHING:
            return gap, placement
        placement = placement + np.array([0.0, 0.0, lift, 0.0, 0.0, 0.0])
    raise ConvergenceError(
        "contact: placing the moving body off-axis did not converge; the last correction was "
        f"{lift * 1e6:.3g} um.\n"
        "Try: a smaller motion.placement."
    )


def _most_change(placement: Placement, space: ContactSpace) -> float:
    """Bound of the change of any gap [m]: its point moves by less."""
    widest = float(space.points[:, 0].max())
    return 2.0 * (placement.eccentricity + placement.tilt * widest)


def _check_refinement(case: Case, section: ContactSpace, gap: Floats) -> None:
    """Warn when the first touch leaves the fine meshes."""
    facing = np.flatnonzero(section.axial > 1e-6)
    lift = gap[facing].min(axis=1) / section.axial[facing]
    centred = section.gap[facing] / section.axial[facing]
    now, before = section.points[facing[[np.argmin(lift), np.argmin(centred)]]]
    for name in (case.contact.moving.body, case.contact.stop.body):
        mesh = case.bodies[name].mesh
        if mesh is not None and mesh.contact is not None:
            warn_far_touch(name, float(np.linalg.norm(now - before)), mesh.contact.extent)


def _sides(pair: BodyPair) -> tuple[Mesh, Surface, Mesh, Surface]:
    return pair.upper.mesh, pair.upper_surface, pair.lower.mesh, pair.lower_surface


def _centre(pair: BodyPair) -> Floats:
    return np.array([0.0, 0.0, float(pair.upper.centre_of_mass[1])])


def _rigid_placement(pair: BodyPair, placement: Placement, about: Floats) -> Floats:
    """Translation of the centre of mass and rotation vector, shape (6,) [m], [rad]."""
    towards, leaning = (
        np.array([np.cos(angle), np.sin(angle)])
        for angle in (placement.direction, placement.tilt_direction)
    )
    aside, lean = placement.eccentricity * towards, placement.tilt * leaning
    return rigid_placement(aside, lean, about, _centre(pair))


def turning_body(case: CaseFile, name: str, mesh: Mesh) -> Callable[[int], FourierBody]:
    """Body in any Fourier order, held where the case holds it, all round; not of given matrices.

    Warns
    -----
    AccuracyWarning
        Of linear elements, which lock in bending.
    """
    body = case.bodies[name]
    if body.matrices is not None:
        raise InputError(
            f"{case.path or 'case'}: bodies.{name}.matrices",
            got="the axial motion of a body of revolution, off-axis",
            expected="a body that klack assembles, which can move in every direction",
            hint="remove 'matrices', or give the matrices of a solid.",
        )
    linear = sorted({block.family for block in mesh.blocks if not block.topology.quadratic})
    if linear:
        warnings.warn(
            f"'{name}' is too stiff off-axis: its mesh has linear elements ({', '.join(linear)}), "
            "which lock in bending. Try: elements with mid-side nodes.",
            AccuracyWarning,
            stacklevel=2,
        )
    materials, nodes = case.materials_of(name, mesh.solids), held_nodes(body, mesh)
    layers = layers_of(case, name)
    return lambda order: fourier_body(
        name, mesh, materials, order=order, fixed_nodes=nodes, layers=layers
    )


def turned(
    case: Case | ValveCase, body: ElasticBody, axial: Modes, sections: RingSections | None = None
) -> RevolvedBody:
    """Body of a case that moves in all Fourier orders.

    It keeps the axial modes and as many others, the lowest of the orders above 0, or all others up
    to a highest frequency of the case.

    Parameters
    ----------
    body
        Half section.
    axial
        Kept by the centred case.
    sections
        Of its shaft, in a guide.
    """
    choice = selection_of(case.reduction.choice(body.name))
    highest = choice.maximum if isinstance(choice, ByFrequency) else None
    return RevolvedBody(
        name=body.name,
        in_order=turning_body(case, body.name, body.mesh),
        axial=axial,
        others=len(axial.omega) if highest is None else None,
        below=inf if highest is None else 2.0 * pi * highest,
        damping=damping_of(case.bodies[body.name].damping).ratios,
        sections=sections,
    )


def off_axis_model(
    problem: ContactProblem, kept: Mapping[str, Modes], contacts: Sequence[RingContact]
) -> InterfaceModel:
    """Interface model at points on rings; bodies as of :func:`turned`.

    Parameters
    ----------
    kept
        Axial modes of the centred case.
    contacts
        Of :func:`ring_contacts`.
    """
    case, pair, above = problem.case, problem.pair, problem.opposite
    bodies = [
        turned(case, body, kept[body.name])
        for body in (pair.upper, pair.lower, *(() if above is None else (above.body,)))
    ]
    return revolved_model(bodies, contacts, cache=problem.flexibility_upper.cache)


Vector = NDArray[np.float64]

# An eccentric contact carries on a part of the ring only, and yields more.
_SOFTER = 1.6
_WIDER = 4.0


def touch_height(space: ContactSpace, *, of_upper: bool = False) -> float:
    """Height z [m] of first touch, centred; of the moving body where it is now."""
    facing = space.axial > 1e-6
    lift = space.gap[facing] / space.axial[facing]
    first = lift <= lift.min() + _FIRST * space.reach
    moved = lift[first] if of_upper and space.slave == "b" else 0.0
    return float(np.mean(space.points[facing][first, -1] + moved))


def off_axis_space(
    pair: BodyPair,
    space: ContactSpace,
    farthest: Sequence[Vector],
    off_axis: float,
    *,
    centre: Vector,
    upper_moves: bool = True,
    angle: Vector | None = None,
) -> ContactSpace:
    """Contact points that close in a centred impact or from the farthest placements.

    Of bodies of revolution hats of the half section, for whole rings: a needle may come from any
    side.

    Parameters
    ----------
    pair
        In first touch.
    space
        Of the centred contact.
    farthest (6,) [m], [rad]
        Placements: translation of ``centre`` and rotation vector.
    off_axis [m]
        Largest distance from the axis among them.
    centre (3,) [m]
        Of mass of the moving body.
    angle (n,) [rad]
        Of the points of every ring; None for solids.
    """
    reach = space.reach
    surfaces = (pair.upper.mesh, pair.upper_surface, pair.lower.mesh, pair.lower_surface)
    wide = contact_space(
        *surfaces, reach=_WIDER * reach + off_axis, slave=space.slave, form=pair.form
    )
    moved: RigidGaps | RingGaps
    if angle is None:
        moved, axial = RigidGaps.of(wide, *surfaces, centre=centre, form=pair.form), wide.axial
    else:
        moved = RingGaps.of(wide, *surfaces, angle=angle, centre=centre, form=pair.form)
        axial = np.repeat(wide.axial, len(angle))
    gaps = PlacedGaps((moved,), (ABOVE if upper_moves else BELOW,))
    keep = wide.gap <= wide.gap.min() + _SOFTER * reach
    for placement in farthest:
        near = _gaps_in_touch(gaps, axial, placement, upper_moves) <= _SOFTER * reach
        keep |= np.any(near.reshape(wide.count, -1), axis=1)
    return _with_neighbours(wide, keep)


def _with_neighbours(wide: ContactSpace, keep: NDArray[np.bool_]) -> ContactSpace:
    """These hats and one row more: on coarse elements a contact is hardly wider."""
    G = abs(wide.G_a if wide.slave == "a" else wide.G_b)
    return wide.restricted(G @ (G.T @ keep.astype(float)) > 0)


def _gaps_in_touch(
    gaps: Callable[[Vector], Vector], axial: Vector, placement: Vector, upper_moves: bool
) -> Vector:
    """Gaps [m] of the moving body moved along z to first touch."""
    facing = axial > 1e-6
    side = 1.0 if upper_moves else -1.0
    for _ in range(3):  # points slide along the other surface
        gap = gaps(placement)
        lift = float(np.min(gap[facing] / axial[facing]))
        placement = placement - side * np.array([0.0, 0.0, lift, 0.0, 0.0, 0.0])
    return np.asarray(gap - lift * axial)
