r"""The lifting magnet of the Modelica Standard Library as a network of flux tubes.

A plunger of 10 mm in a pot with a flat pole, 957 turns, published with static finite-element
results (force, armature flux, inductance over a gap of 0.25 to 5 mm at 1.2 A): the most complete
public static reference, and a hard one, since at 5 mm most of the flux leaks through the coil.
Nothing is fitted; every permeance comes from the drawing.

Partition, along the axis (bottom of the pot at z = 0)::

    z/mm   3.5    6.75    10     15      23.25    31.5
           |======|=======|  gap  |========|========|==  parasitic gap   core (r = 5 mm)
           |  1   |   2   |   3   |   4    |   5    |                    loops
           |      |       |       |        |        |
           ------ leak 1  2 ----- 3 ------ 4 ------ 5 -                  yoke (r = 13.5 mm)

The mmf between core and yoke rises linearly along the coil, so Simpson's rule for the radial
leakage between two sections is exact for its energy.  The armature side between its moving end and
z = 15 mm, where the mmf is ``(31.5 mm - z)/16.5 mm`` times that at z = 15 mm, counts with the
square of this ratio: a leakage that depends on the gap, and pulls.  The field around the gap is
:func:`~klack.magnetics.air_gap.edges_beside_wall` with its correction for round cores; the part of
it that both poles send to the yoke together is the slot of Carter.

With a current density ``J`` in the window and a radial field ``~1/r`` the axial field of the coil
is ``n I f(r)``, ``f = ln(r/r_i)/ln(r_o/r_i) - (r - r_c)/(r_o - r_c)`` (the second term only within
the coil).  Along ``z`` the field of the gap falls by ``V g(r)``, ``g = 1 - ln(r/r_i)/
ln(r_o/r_i)``.  Their co-energy, :math:`\tfrac12 L I^2 + c\,I V`, is that of one more flux tube
beside the gap with a share of the turns.
"""

from collections.abc import Callable
from functools import cache
from math import pi

import numpy as np
import scipy

from klack.arrays import Vector
from klack.magnetics.air_gap import (
    cylinder_wall,
    edges_beside_wall,
    outer_ring,
    ring_permeance,
    round_excess,
    slot_loss,
    step_excess,
)
from klack.magnetics.circuit import MagneticBranch, MagneticCircuit
from klack.magnetics.iron import VACUUM_PERMEABILITY, IronCurve
from klack.magnetics.iron_library import iron_curve
from klack.magnetics.reluctance import GapReluctance, IronReluctance, LinearReluctance
from klack.magnetics.tabulation import hermite_grid

__all__ = ["lifting_magnet"]

TURNS = 957.0
RADIUS = 5e-3  # armature and pole
YOKE_INNER, YOKE_OUTER = 13.5e-3, 15e-3
LENGTH, PLATE, POLE = 35e-3, 3.5e-3, 6.5e-3
GUIDE = 0.65e-3  # radial clearance around the armature; the coil begins outside it
ARMATURE = 26e-3
LEAST_GAP, MOST_GAP = 0.25e-3, 5e-3
MATERIAL = "9SMnPb28"

_MU0 = VACUUM_PERMEABILITY
_WINDOW = LENGTH - 2.0 * PLATE
_CORE_AREA = pi * RADIUS**2
_YOKE_AREA = pi * (YOKE_OUTER**2 - YOKE_INNER**2)
_EDGE = 2.0 * pi * RADIUS
_WALL = cylinder_wall(RADIUS, YOKE_INNER)
_LEAKAGE = ring_permeance(RADIUS, YOKE_INNER, 1.0)  # [H/m]
_SIDE = _WINDOW - POLE - MOST_GAP  # armature inside the window at the largest gap


def lifting_magnet(iron: IronCurve | None = None) -> MagneticCircuit:
    """Network of the lifting magnet, of another ``iron`` than 9SMnPb28 if given; gap ``x``."""
    iron = iron or iron_curve(MATERIAL)
    core = np.array([POLE / 2, POLE / 2, MOST_GAP, _SIDE / 2, _SIDE / 2])
    turns = TURNS * core / _WINDOW
    yoke = core.copy()
    core[2] -= LEAST_GAP  # iron of the armature within the section of the gap
    core[[0, 4]] += PLATE / 2
    yoke[[0, 4]] += PLATE / 2

    branches: list[MagneticBranch] = []
    loops: list[list[int]] = []

    def add(branch: MagneticBranch, *loop: int) -> None:
        row = [0] * 6
        for k in loop:
            row[abs(k) - 1] = 1 if k > 0 else -1
        branches.append(branch)
        loops.append(row)

    for k in range(5):
        law = iron.law(core[k], _CORE_AREA)
        add(MagneticBranch(name=f"core {k + 1}", law=law, turns=float(turns[k])), k + 1)
        add(MagneticBranch(name=f"yoke {k + 1}", law=iron.law(yoke[k], _YOKE_AREA)), k + 1)
    add(MagneticBranch(name="pole plate", law=_plate(iron, RADIUS)), 1)
    add(MagneticBranch(name="yoke plate", law=_plate(iron, RADIUS + GUIDE)), 5)
    window, share = _window_tube()
    tube = LinearReluctance(1.0 / window)
    add(MagneticBranch(name="working gap", law=_table(_working_gap)), 3, -6)
    add(MagneticBranch(name="window", law=tube, turns=share * TURNS), 6)
    add(MagneticBranch(name="leakage 1", law=_leak(POLE * 4 / 6)), 1, -2)
    add(MagneticBranch(name="leakage 2", law=_table(_pole_leakage)), 2, -3)
    add(MagneticBranch(name="leakage 3", law=_table(_armature_leakage)), 3, -4)
    add(MagneticBranch(name="leakage 4", law=_leak(_SIDE * 4 / 6)), 4, -5)
    add(MagneticBranch(name="parasitic gap", law=_table(_guide)), 5)
    return MagneticCircuit(
        branches=tuple(branches), loops=np.array(loops, dtype=np.int64), main="core 4"
    )


def _plate(iron: IronCurve, inner: float) -> IronReluctance:
    """End plate: the area whose reluctance of radial flux is exact for constant permeability."""
    length = YOKE_INNER - inner
    return iron.law(length, 2.0 * pi * PLATE * length / np.log(YOKE_INNER / inner))


def _leak(length: float) -> LinearReluctance:
    return LinearReluctance(1.0 / (_LEAKAGE * length))


def _table(permeance: Callable[[Vector], tuple[Vector, Vector]]) -> GapReluctance:
    def reluctance(x: Vector) -> tuple[Vector, Vector]:
        P, dP = permeance(x)
        return 1.0 / P, -dP / P**2

    grid = hermite_grid(reluctance, 0.05e-3, 6e-3, tolerance=1e-7)
    return GapReluctance.of(reluctance, grid)


def _common(x: Vector) -> tuple[Vector, Vector]:
    """Half of the flux to the yoke across the open gap, per mean mmf of both poles [H]."""
    lost, dlost = slot_loss(x, _WALL)
    return 0.5 * _LEAKAGE * (x - lost), 0.5 * _LEAKAGE * (1.0 - dlost)


def _working_gap(x: Vector) -> tuple[Vector, Vector]:
    edge, dedge = edges_beside_wall(x, _WALL)
    common, dcommon = _common(x)
    more, dmore = round_excess(x, RADIUS, YOKE_INNER)
    edge, dedge = edge + more, dedge + dmore
    P = _MU0 * _CORE_AREA / x + _MU0 * _EDGE * edge - 0.5 * common - _window_tube()[0]
    return P, -_MU0 * _CORE_AREA / x**2 + _MU0 * _EDGE * dedge - 0.5 * dcommon


def _pole_leakage(x: Vector) -> tuple[Vector, Vector]:
    common, dcommon = _common(x)
    return common + _LEAKAGE * POLE / 6.0, dcommon


def _armature_leakage(x: Vector) -> tuple[Vector, Vector]:
    """Side of the armature beyond z = 15 mm and its edge, seen with the mmf at z = 15 mm."""
    ratio = (_SIDE + MOST_GAP - x) / _SIDE
    common, dcommon = _common(x)
    side = _LEAKAGE * _SIDE / 3.0 * (ratio**3 - 1.0)
    dside = -_LEAKAGE * ratio**2
    P = _LEAKAGE * _SIDE / 6.0 + side + common * ratio**2
    return P, dside + dcommon * ratio**2 - 2.0 * common * ratio / _SIDE


def _guide(x: Vector) -> tuple[Vector, Vector]:
    """Parasitic gap with the edge fields inside the window and around the armature outside."""
    gap = cylinder_wall(RADIUS, RADIUS + GUIDE)
    inside = ring_permeance(RADIUS, RADIUS + GUIDE, PLATE) + _LEAKAGE * _SIDE / 6.0
    inside += _MU0 * _EDGE * step_excess(gap, _WALL)
    # armature end: its side outside, and its face as a strip of the same edge length
    reach = PLATE + POLE + x + ARMATURE - LENGTH + RADIUS / 2.0
    outside, doutside = outer_ring(GUIDE, reach, RADIUS)
    return inside + _MU0 * _EDGE * outside, _MU0 * _EDGE * doutside


@cache
def _window_tube() -> tuple[float, float]:
    """Permeance [H] of the axial flux tube in the window, and its share of the turns [-]."""
    begin = RADIUS + GUIDE
    whole = np.log(YOKE_INNER / RADIUS)

    def own(r: float) -> float:
        return float(np.log(r / RADIUS) / whole - max(0.0, (r - begin) / (YOKE_INNER - begin)))

    def falling(r: float) -> float:
        return float(1.0 - np.log(r / RADIUS) / whole)

    square = scipy.integrate.quad(lambda r: own(r) ** 2 * r, RADIUS, YOKE_INNER, points=[begin])[0]
    mixed = scipy.integrate.quad(
        lambda r: own(r) * falling(r) * r, RADIUS, YOKE_INNER, points=[begin]
    )[0]
    return 2.0 * pi * _MU0 * mixed**2 / (_WINDOW * square), square / mixed
