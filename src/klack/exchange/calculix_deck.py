r"""An impact as an input deck of CalculiX (ccx), a witness that shares no code with klack.

Elements C3D4, C3D6, C3D8, C3D10, C3D15, C3D20 have the node order and face numbers of
:mod:`klack.mesh.families`. The contact is ccx's face-to-face penalty: at every integration point
of the upper (slave) surface the pressure is

.. math:: p = K \max(0, -g)

with the overclosure :math:`-g` on the curved faces. With friction they hold
:math:`\min(\lambda s, \mu p)` across, *s* the elastic part of the slip: a spring of the stick
slope :math:`\lambda` before the slider, where klack's faces stick rigidly. The system is then
unsymmetric, which the iterative solvers of ccx do not take, and the deck has a ballast, a heavy
cube in free flight: ccx stops a run of fixed steps where the energy balance leaves some 0.3 % of
the largest energy, as if friction were an error of the steps; a thousandfold energy prevents that.

The Hilber-Hughes-Taylor rule takes fixed steps (``DIRECT``), so that runs can be compared step by
step.

Units are mm, t, s, N, MPa, mJ, which suit absolute tolerances of ccx.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.assembling.placement import first_touch_of_meshes
from klack.bodies.elasticity.body import ElasticBody
from klack.contact.pairing import axial_distance, face_thickness
from klack.errors import refuse_if, require_positive
from klack.materials.material import Material
from klack.mesh.families import FAMILIES
from klack.mesh.mesh import FaceTable, Mesh, Surface

__all__ = [
    "LOWER",
    "UPPER",
    "CalculixImpact",
    "CalculixSettings",
    "deck_lines",
    "default_penalty",
    "start_of_flight",
    "write_deck",
]

UPPER, LOWER = "UPPER", "LOWER"
"""Element sets of the two bodies; node sets and surfaces begin so."""

_TYPES = {
    **{"tet4": "C3D4", "tet10": "C3D10", "hex8": "C3D8", "hex20": "C3D20"},
    **{"wedge6": "C3D6", "wedge15": "C3D15"},
}
_MM, _MPA, _TONNE_PER_MM3 = 1e-3, 1e6, 1e12
_PER_LINE = 10  # entries of a data line; ccx reads 16 at most
_FLIGHT_STEPS = 2.0
_PENALTY_FACTOR = 300.0
_BALLAST = "BALLAST"
_BALLAST_FACTOR = 1e3  # its kinetic energy over that of the upper body
_ALPHA = -0.05  # of Hilber, Hughes & Taylor (1977), the default of ccx
_STICK = 1.0 / 30.0  # stick slope over penalty


@dataclass(frozen=True, kw_only=True, eq=False)
class CalculixImpact:
    """Two solids and their motion; the upper one flies in -z.

    Parameters
    ----------
    materials : mapping of body name to mapping of solid to Material
    speed [m/s]
        Of the upper body where it is.
    closing_force [N]
        Constant, on the upper body, positive in -z, spread like its weight.
    friction [-]
        Coulomb's coefficient, sticking or slipping.
    """

    title: str
    upper: ElasticBody
    lower: ElasticBody
    upper_surface: Surface
    lower_surface: Surface
    materials: Mapping[str, Mapping[str, Material]]
    speed: float
    closing_force: float = 0.0
    friction: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CalculixSettings:
    """Settings of ccx for an impact.

    Parameters
    ----------
    step, duration [s]
        Fixed increment, and time from the start.
    penalty [Pa/m]
        Pressure per overclosure, see :func:`default_penalty`.
    """

    step: float
    duration: float
    penalty: float

    def __post_init__(self) -> None:
        require_positive("CalculiX: step", self.step, "s")
        require_positive("CalculiX: penalty", self.penalty, "Pa/m")
        refuse_if(
            not self.duration >= self.step,
            "CalculiX: duration",
            got=f"{self.duration:g} s",
            expected=f"the time of one step ({self.step:g} s) or more",
            hint="check the units; an impact of steel parts lasts 5 to 50 us.",
        )


def default_penalty(impact: CalculixImpact) -> float:
    r"""Penalty [Pa/m] that adds little to the approach of the bodies.

    .. math:: K = 300\, E^* / h

    with the contact modulus :math:`1 / E^* = \sum (1 - \nu^2) / E` of the softest solids and the
    smallest element *h* of both surfaces, on a sound mesh below the half width *b* of the contact.
    The penalty adds :math:`p / K` to some :math:`p\, b / E^*`: less than 1/300.
    """
    inverse = sum(
        1.0
        / min(material.plane_strain_modulus for material in impact.materials[body.name].values())
        for body in (impact.upper, impact.lower)
    )
    size = min(
        float(np.min(face_thickness(body.mesh, surface)))
        for body, surface in (
            (impact.upper, impact.upper_surface),
            (impact.lower, impact.lower_surface),
        )
    )
    return _PENALTY_FACTOR / inverse / size


def start_of_flight(impact: CalculixImpact, step: float) -> tuple[float, float]:
    """Shift along +z [m] and speed [m/s] of the upper body at the start.

    A penalty turns overlap into energy, and curved faces overlap a little where their weighted gap
    is zero. So the upper body starts two steps of flight before any point touches. Under an
    outside force it is only moved back if nearer, at the speed that the force leaves of the given
    one; rejected if the force alone would stop the flight.
    """
    distance = _distance(impact)
    least = _FLIGHT_STEPS * step * impact.speed
    if impact.closing_force == 0.0:
        return least - distance, impact.speed
    back = max(least - distance, 0.0)
    square = impact.speed**2 - 2.0 * impact.closing_force / impact.upper.mass * back
    refuse_if(
        not square > 0,
        "CalculiX: step",
        got=f"{step:g} s: the speed is too low for two steps of flight",
        expected="a step much shorter than the time in which the force stops the body",
        hint="take a shorter step.",
    )
    return back, sqrt(square)


def _distance(impact: CalculixImpact) -> float:
    """Travel of the upper body to -z until any point touches [m], negative for overlap.

    Sampled densely: faces of a coarse swept mesh wave by up to 0.1 um between their nodes, which a
    penalty at integration points feels.
    """
    sides = (impact.upper.mesh, impact.upper_surface, impact.lower.mesh, impact.lower_surface)
    distance = axial_distance(*sides)
    refuse_if(
        not np.isfinite(distance),
        f"contact of '{impact.upper_surface.name}' with '{impact.lower_surface.name}'",
        got="no line along z that meets both surfaces",
        expected="surfaces that face each other along the axis of motion z",
        hint="check which faces are named in contact.between.",
    )
    return min(distance, first_touch_of_meshes(*sides, tolerance=0.0).clearance)


def write_deck(impact: CalculixImpact, settings: CalculixSettings, path: Path) -> None:
    """Write the deck; start ``ccx`` with its name without ``.inp``."""
    with path.open("w", encoding="ascii", newline="\n") as stream:
        stream.writelines(f"{line}\n" for line in deck_lines(impact, settings))


def deck_lines(impact: CalculixImpact, settings: CalculixSettings) -> Iterator[str]:
    """Lines of the deck, in the order of ccx.

    Rejects bodies of revolution and a held body a.
    """
    _require_solids(impact)
    shift, speed = start_of_flight(impact, settings.step)
    yield from _heading(impact, settings, shift)
    node = element = 0
    for role, body, surface, lift in (
        (UPPER, impact.upper, impact.upper_surface, shift),
        (LOWER, impact.lower, impact.lower_surface, 0.0),
    ):
        mesh = body.mesh.moved(np.array([0.0, 0.0, lift]))
        yield from _body_lines(role, mesh, surface, body.fixed, node, element)
        yield from _section_lines(role, mesh, impact.materials[body.name])
        node += mesh.node_count
        element += mesh.element_count
    if impact.friction:
        yield from _ballast_lines(impact, node, element)
    yield from _contact_lines(settings, impact.friction)
    for role, body in ((UPPER, impact.upper), (LOWER, impact.lower)):
        if len(body.fixed):
            yield from ("*BOUNDARY", f"{role}_FIXED, 1, 3")
    yield from ("*INITIAL CONDITIONS, TYPE=VELOCITY", f"{UPPER}_NODES, 3, {-speed / _MM:.12g}")
    if impact.friction:
        yield f"{_BALLAST}_NODES, 3, {-speed / _MM:.12g}"
    yield from _step_lines(impact, settings)


def _require_solids(impact: CalculixImpact) -> None:
    for body in (impact.upper, impact.lower):
        refuse_if(
            body.dimension != 3,
            f"body '{body.name}'",
            got="a body of revolution",
            expected="a solid: CalculiX turns axisymmetric elements into wedges of "
            "one layer, with a different contact problem",
            hint="use 'model: swept' (with layers) or 'model: solid' in the geometry.",
        )
    refuse_if(
        len(impact.upper.fixed),
        f"body '{impact.upper.name}'",
        got="an upper body that is held",
        expected="an upper body that is free to move in -z",
        hint="remove its supports from the case, or swap the bodies.",
    )


def _heading(impact: CalculixImpact, settings: CalculixSettings, shift: float) -> Iterator[str]:
    title = impact.title.encode("ascii", "replace").decode().replace("\n", " ")
    yield from (
        "*HEADING",
        title[:72],
        "** written by klack; units: mm, t, s, N, MPa, mJ; axis of motion: z",
        f"** {UPPER} = {_plain(impact.upper.name)}, moved by {shift / _MM:.9g} mm along z from",
        f"** where the case puts it; {LOWER} = {_plain(impact.lower.name)}",
        f"** step {settings.step:g} s, penalty {settings.penalty * _MM / _MPA:g} MPa/mm",
    )


def _body_lines(
    role: str,
    mesh: Mesh,
    surface: Surface,
    fixed: NDArray[np.int64],
    first_node: int,
    first_element: int,
) -> Iterator[str]:
    """Nodes, elements, contact faces and held nodes of one body."""
    yield f"*NODE, NSET={role}_NODES"
    yield from (
        f"{i}, {x:.12e}, {y:.12e}, {z:.12e}"
        for i, (x, y, z) in enumerate((mesh.points / _MM).tolist(), start=first_node + 1)
    )
    number = first_element
    for block in mesh.blocks:
        yield f"*ELEMENT, TYPE={_TYPES[block.family]}, ELSET={_solid_set(role, mesh, block.solid)}"
        for nodes in (block.connectivity + first_node + 1).tolist():
            number += 1
            yield from _wrapped([number, *nodes])
    yield f"*ELSET, ELSET={role}"
    yield from (f"{_solid_set(role, mesh, solid)}," for solid in mesh.solids)
    yield f"*SURFACE, NAME={role}_CONTACT, TYPE=ELEMENT"
    yield from (
        f"{first_element + element + 1}, S{side + 1}" for element, side in _faces(mesh, surface)
    )
    held = np.unique(fixed // 3)
    if len(held):
        yield f"*NSET, NSET={role}_FIXED"
        yield from (f"{i}," for i in (held + first_node + 1).tolist())


def _wrapped(numbers: list[int]) -> Iterator[str]:
    """Data line, continued where it is long."""
    for start in range(0, len(numbers), _PER_LINE):
        part = ", ".join(map(str, numbers[start : start + _PER_LINE]))
        yield part + ("," if start + _PER_LINE < len(numbers) else "")


def _faces(mesh: Mesh, surface: Surface) -> Iterator[tuple[int, int]]:
    """Element (over all blocks) and side of every face."""
    table = FaceTable.of(mesh.blocks)
    first = np.cumsum([0, *(len(block.connectivity) for block in mesh.blocks)])
    for block in surface.blocks:
        rows = table.find(block.connectivity[:, : FAMILIES[block.family].corners])
        for row in rows.tolist():
            yield int(first[table.block[row]] + table.element[row]), int(table.side[row])


def _section_lines(role: str, mesh: Mesh, materials: Mapping[str, Material]) -> Iterator[str]:
    """One material and one section per solid."""
    for solid in mesh.solids:
        material, name = materials[solid], _solid_set(role, mesh, solid)
        yield from (
            f"** {_plain(material.name)}",
            f"*MATERIAL, NAME={name}",
            "*ELASTIC",
            f"{material.young / _MPA:.12g}, {material.poisson:.12g}",
            "*DENSITY",
            f"{material.density / _TONNE_PER_MM3:.12g},",
            f"*SOLID SECTION, ELSET={name}, MATERIAL={name}",
        )


def _ballast_lines(impact: CalculixImpact, node: int, element: int) -> Iterator[str]:
    """Cube in free flight, numbered after ``node`` and ``element``."""
    bodies = (impact.upper.mesh, impact.lower.mesh)
    size = max(float(np.ptp(mesh.points, axis=0).max()) for mesh in bodies) / _MM
    first = max(float(mesh.points[:, 0].max()) for mesh in bodies) / _MM + size
    density = _BALLAST_FACTOR * impact.upper.mass / (size * _MM) ** 3 / _TONNE_PER_MM3
    yield from (
        "** ballast, without contact: beside its energy ccx does not take the loss of friction",
        "** for an error of the time steps",
        f"*NODE, NSET={_BALLAST}_NODES",
    )
    base = ((0, 0), (1, 0), (1, 1), (0, 1))
    corners = [(x, y, z) for z in (0, 1) for x, y in base]
    yield from (
        f"{i}, {first + x * size:.12e}, {y * size:.12e}, {z * size:.12e}"
        for i, (x, y, z) in enumerate(corners, start=node + 1)
    )
    yield from (
        f"*ELEMENT, TYPE=C3D8, ELSET={_BALLAST}",
        ", ".join(map(str, (element + 1, *range(node + 1, node + 9)))),
        f"*MATERIAL, NAME={_BALLAST}",
        "*ELASTIC",
        "210000, 0.3",
        "*DENSITY",
        f"{density:.12g},",
        f"*SOLID SECTION, ELSET={_BALLAST}, MATERIAL={_BALLAST}",
    )


def _contact_lines(settings: CalculixSettings, friction: float) -> Iterator[str]:
    yield from (
        "*SURFACE INTERACTION, NAME=CONTACT",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR",
        f"{settings.penalty * _MM / _MPA:.12g},",
    )
    if friction > 0.0:
        slope = _STICK * settings.penalty
        yield from (
            f"** stick slope: penalty times {_STICK:.3g}. Faces that stick give way",
            f"** across by up to {friction / _STICK:.3g} times their overclosure.",
            "** A larger slope is closer to Coulomb, but where the slip turns the iterations may",
            "** cycle between stick and slip.",
            "*FRICTION",
            f"{friction:.12g}, {slope * _MM / _MPA:.12g}",
        )
    yield from (
        "*CONTACT PAIR, INTERACTION=CONTACT, TYPE=SURFACE TO SURFACE",
        f"{UPPER}_CONTACT, {LOWER}_CONTACT",
    )


def _step_lines(impact: CalculixImpact, settings: CalculixSettings) -> Iterator[str]:
    increments = int(np.ceil(settings.duration / settings.step * (1.0 - 1e-9)))
    # the iterative solver, in a third of the time of SPOOLES, takes no unsymmetric systems
    solver = "SPOOLES" if impact.friction else "ITERATIVE SCALING"
    yield from (
        f"*STEP, INC={10 * increments + 100}",
        f"*DYNAMIC, DIRECT, ALPHA={_ALPHA:g}, SOLVER={solver}",
        f"{settings.step:.9g}, {increments * settings.step:.9g}",
    )
    if impact.closing_force != 0.0:
        acceleration = impact.closing_force / impact.upper.mass / _MM
        yield from ("*DLOAD", f"{UPPER}, GRAV, {acceleration:.12g}, 0., 0., -1.")
    yield from (
        f"*CONTACT PRINT, SLAVE={UPPER}_CONTACT, MASTER={LOWER}_CONTACT",
        "CF",
        "*CONTACT PRINT, TOTALS=ONLY",
        "CELS",
    )
    for role in (UPPER, LOWER):
        yield from (f"*EL PRINT, ELSET={role}, TOTALS=ONLY", "ELSE, ELKE")
    yield "*END STEP"


def _solid_set(role: str, mesh: Mesh, solid: str) -> str:
    """Element set of a solid, without signs that ccx does not take."""
    return f"{role}_{mesh.solids.index(solid) + 1}"


def _plain(name: str) -> str:
    return name.encode("ascii", "replace").decode().replace("\n", " ")[:60]
