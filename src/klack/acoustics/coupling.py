r"""A source at its mounts on a receiver: interface forces, powers and contributions by path.

Lagrange multipliers on the free parts (LM-FBS: de Klerk, Rixen & Voormeeren 2008) give

.. math:: g = (Y_S + Y_K + Y_R)^{-1} v_f, \qquad v_R = Y_R g, \qquad p = H g

with the mobility :math:`Y_K = s / k` of elements without mass.  Elements with inertia are third
bodies with the forces :math:`F_1` and :math:`g` at their ends (:mod:`klack.acoustics.isolator`):

.. math:: \begin{pmatrix} s + k_{11} Y_S & k_t Y_R \\ k_t Y_S & s + k_{22} Y_R \end{pmatrix}
          \begin{pmatrix} F_1 \\ g \end{pmatrix} = \begin{pmatrix} k_{11} v_f \\ k_t v_f
          \end{pmatrix}

The source mobility alone, nearly singular at the resonances of the free source, is never
inverted.  The receiver is brought into the frame of the source first, :math:`v' = T v`, so
:math:`Y' = T Y T^T` and :math:`H' = H T^T`.

A freedom may take up power or give it back; only the sum over all is never negative.
"""

import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from klack.acoustics.interface import (
    Complexes,
    Freedom,
    InterfacePoint,
    Receiver,
    ReceiverResponse,
    SourceAtMounts,
)
from klack.acoustics.isolator import Isolator
from klack.arrays import Matrix, Vector
from klack.errors import AccuracyWarning, InputError, refuse_if

__all__ = [
    "Coupled",
    "Junction",
    "Missing",
    "Placement",
    "axes_of",
    "couple",
    "joined",
    "junction",
    "power_balance",
    "transformation",
]

Missing = Literal["blocked", "free"]
"""What a receiver does in a direction in which it is not known."""

_ACTIVE = 1e-6  # least active over apparent power
_ALONG = 1e-6
_WORST_CONDITION = 1e10


def axes_of(x: Sequence[float], y: Sequence[float]) -> Matrix:
    """Three axes from the directions x and y, shape (3, 3); z follows.

    Raises
    ------
    InputError
        Unless x and y are at right angles within 0.1 degrees.
    """
    first, second = (np.asarray(a, dtype=float) / max(np.linalg.norm(a), 1e-300) for a in (x, y))
    refuse_if(
        not abs(first @ second) < 2e-3 or np.linalg.norm(first) < 0.5,
        "axes",
        got=f"x = {list(x)} and y = {list(y)}",
        expected="two directions at right angles",
        hint="give the source's x and y as vectors in the frame of the receiver.",
    )
    second = second - (first @ second) * first
    second = second / np.linalg.norm(second)
    return np.array([first, second, np.cross(first, second)])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Placement:
    """Where a mount of the source stands on the receiver.

    Parameters
    ----------
    point
        Name of the receiver's point; that of the mount without.
    axes (3, 3)
        Rows are the x, y, z of the source's drawing in the frame of the receiver.
    offset (3,) [m]
        From the receiver's point to the mount, in the frame of the receiver; they move together
        as one rigid body.
    """

    point: str | None = None
    axes: Matrix = field(default_factory=lambda: np.eye(3))
    offset: Vector = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Coupled:
    """Source and receiver as they vibrate together; spectra of one click.

    Freedoms are those of the source that the receiver takes up, in the frame of the source.

    Parameters
    ----------
    frequency (k,) [Hz]
    freedoms
        n of them.
    ears
    free_velocity (k, n) [m/s/Hz]
        Of the source, as it came.
    source_force (k, n) [N/Hz]
        Of the source on the element below it; equal to ``force`` where that has no mass.
    force (k, n) [N/Hz]
        On the receiver.
    source_velocity, velocity (k, n) [m/s/Hz]
        Of the source's side, and of the receiver's.
    contributions (k, ears, n) [Pa/Hz]
        Of each path to the sound pressure; complex, their sum is the pressure.
    shift [1/s]
        Real part of ``s``.
    notes
        What was assumed, one sentence each.
    """

    frequency: Vector
    freedoms: tuple[Freedom, ...]
    ears: tuple[str, ...]
    free_velocity: Complexes
    source_force: Complexes
    force: Complexes
    source_velocity: Complexes
    velocity: Complexes
    contributions: Complexes
    shift: float = 0.0
    notes: tuple[str, ...] = ()

    @property
    def pressure(self) -> Complexes:
        """Sound pressure at the ears [Pa/Hz], shape (k, ears)."""
        return np.asarray(self.contributions.sum(axis=2))

    @property
    def power(self) -> Matrix:
        r"""Power into the receiver by freedom, :math:`\tfrac12 \mathrm{Re}(g_i^* v_i)`, (k, n).

        Of amplitudes; the energy density of a click is four times it [J/Hz].  Negative where a
        freedom gives power back.
        """
        return 0.5 * np.real(np.conj(self.force) * self.velocity)

    @property
    def power_from_source(self) -> Matrix:
        """Power that leaves the source by freedom, shape (k, n); elements lose the difference."""
        return 0.5 * np.real(np.conj(self.source_force) * self.source_velocity)

    def energy_density(self) -> Matrix:
        r"""Energy into the receiver by freedom [J/Hz], shape (k, n), of one click.

        Its integral over the frequencies above 0 is :math:`\int g_i v_i\,\mathrm dt`.
        """
        return 4.0 * self.power


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Junction:
    """Source and receiver at the freedoms that they share, in the frame of the source.

    Parameters
    ----------
    s (k,) [1/s]
    freedoms
        n of them.
    free_velocity (k, n), mobility (k, n, n)
        Of the source.
    receiver
        Mobility and transfers at the same freedoms.
    places
        Freedoms of the receiver in its own frame.
    spread (k, places, n)
        Their velocities per force at the n freedoms.
    isolators
        By mount.
    """

    s: Complexes
    freedoms: tuple[Freedom, ...]
    free_velocity: Complexes
    mobility: Complexes
    receiver: ReceiverResponse
    places: tuple[Freedom, ...]
    spread: Complexes
    isolators: Mapping[str, Isolator]
    notes: tuple[str, ...] = ()

    def forces(self, free_velocity: Complexes) -> tuple[Complexes, Complexes]:
        """Forces on the elements and on the receiver (k, n, r) for free velocities (k, n, r)."""
        return _interface_forces(self, free_velocity)


def junction(
    source: SourceAtMounts,
    receiver: Receiver,
    *,
    placements: Mapping[str, Placement] | None = None,
    isolators: Mapping[str, Isolator] | None = None,
    missing: Mapping[str, Missing] | None = None,
) -> Junction:
    """Bring source and receiver together; parameters and errors as of :func:`couple`."""
    T, kept, notes = transformation(
        source.points, source.freedoms, receiver, placements or {}, missing or {}
    )
    unknown = set(isolators or {}) - {point.name for point in source.points}
    refuse_if(
        unknown,
        "isolators",
        got=f"the mount '{min(unknown, default='')}'",
        expected=f"one of: {', '.join(point.name for point in source.points)}",
        hint="name the mount of the source that the element is below.",
    )
    answer = receiver.at(source.s)
    spread = answer.mobility @ T.T
    return Junction(
        s=source.s,
        freedoms=tuple(source.freedoms[i] for i in kept),
        free_velocity=source.free_velocity[:, kept],
        mobility=source.mobility[:, kept][:, :, kept],
        receiver=ReceiverResponse(mobility=T @ spread, transfers=answer.transfers @ T.T),
        places=receiver.freedoms,
        spread=spread,
        isolators=isolators or {},
        notes=notes,
    )


def couple(
    source: SourceAtMounts,
    receiver: Receiver,
    *,
    placements: Mapping[str, Placement] | None = None,
    isolators: Mapping[str, Isolator] | None = None,
    missing: Mapping[str, Missing] | None = None,
) -> Coupled:
    """Join a source and a receiver.

    Parameters
    ----------
    source, receiver
        The receiver is evaluated at the source's ``s``.
    placements
        Mount -> where it stands; a point of the same name, frame and place without.
    isolators
        Mount -> element below it; a rigid joint without.
    missing
        ``flange.rx`` or ``flange`` -> what the receiver does where it is not known: ``blocked`` (it
        does not move) or ``free`` (it takes up no force).

    Raises
    ------
    InputError
        For freedoms of the source that the receiver does not have, all of them by name.
    """
    joint = junction(source, receiver, placements=placements, isolators=isolators, missing=missing)
    return joined(joint, source, receiver.ears)


def joined(joint: Junction, source: SourceAtMounts, ears: tuple[str, ...]) -> Coupled:
    """Solve a junction for its source; ``ears`` are those of its receiver."""
    vf = joint.free_velocity
    F_1, g = (forces[..., 0] for forces in joint.forces(vf[..., None]))
    return Coupled(
        frequency=source.frequency,
        freedoms=joint.freedoms,
        ears=ears,
        free_velocity=vf,
        source_force=F_1,
        force=g,
        source_velocity=vf - (joint.mobility @ F_1[..., None])[..., 0],
        velocity=(joint.receiver.mobility @ g[..., None])[..., 0],
        contributions=joint.receiver.transfers * g[:, None, :],
        shift=source.shift,
        notes=joint.notes,
    )


def power_balance(joint: Junction, found: Coupled) -> tuple[Vector, Vector]:
    """What elements lose, and what is left of the sum of all powers, each (k,), of amplitudes.

    Power of the forces inside the source = lost in the source + in elements + into the receiver,
    each from its own matrix, not as a difference of the others; per line over the largest of them,
    or a millionth of the apparent power, of whose round-off a lossless machine has nothing else.
    """
    F, g, s = found.source_force, found.force, joint.s
    given = 0.5 * np.real(np.einsum("ki,ki->k", F.conj(), joint.free_velocity))
    kept = 0.5 * np.real(np.einsum("ki,kij,kj->k", F.conj(), joint.mobility, F))
    taken = 0.5 * np.real(np.einsum("ki,kij,kj->k", g.conj(), joint.receiver.mobility, g))
    lost = np.zeros(s.size)
    for i, freedom in enumerate(joint.freedoms):
        element, direction = joint.isolators.get(freedom.point), abs(freedom.direction)
        if element is None or direction not in element.directions:
            continue
        k = element.stiffness(direction, s)
        if k.driving is None or k.receiving is None:  # the ends of a stiff one hardly part
            lost += 0.5 * np.abs(F[:, i]) ** 2 * np.real(s / k.transfer)
            continue
        one, two = found.source_velocity[:, i], found.velocity[:, i]
        above = (k.driving * one - k.transfer * two) / s
        below = (k.transfer * one - k.receiving * two) / s
        lost += 0.5 * np.real(above.conj() * one - below.conj() * two)
    apparent = 0.5 * np.sum(np.abs(F * joint.free_velocity), axis=1)
    size = np.maximum.reduce([np.abs(given), kept, np.abs(lost), taken, _ACTIVE * apparent])
    rest = np.abs(given - kept - lost - taken) / np.maximum(size, np.finfo(float).tiny)
    return lost, rest


# --------------------------------------------------------------------------- frames


def transformation(
    points_of_source: Sequence[InterfacePoint],
    freedoms: Sequence[Freedom],
    receiver: Receiver,
    placements: Mapping[str, Placement],
    missing: Mapping[str, Missing],
) -> tuple[Matrix, list[int], tuple[str, ...]]:
    """Rows of ``v' = T v``, which freedoms of the source are kept, and what was assumed."""
    mounts = {point.name: point for point in points_of_source}
    points = {point.name: point for point in receiver.points}
    rows, kept, open_ones = [], [], []
    taken: dict[str, list[str]] = {}
    idle = set(missing) & {*mounts, *map(str, freedoms)}
    for i, freedom in enumerate(freedoms):
        place = placements.get(freedom.point, Placement())
        name = place.point or freedom.point
        refuse_if(
            name not in points,
            f"mount '{freedom.point}'",
            got=f"the point '{name}' of the receiver",
            expected=f"one of: {', '.join(points) or '(none)'}",
            hint="state where the mount is (placement: point).",
        )
        row, rest = _row(freedom, mounts[freedom.point], points[name], receiver.freedoms, place)
        if rest > _ALONG:
            idle -= {freedom.point, str(freedom)}
            wanted = missing.get(str(freedom)) or missing.get(freedom.point)
            if wanted is None:
                open_ones.append(str(freedom))
                continue
            taken.setdefault(wanted, []).append(str(freedom))
            if wanted == "free":
                continue
        rows.append(row)
        kept.append(i)
    _refuse_open(open_ones, receiver)
    refuse_if(
        not kept,
        "coupling",
        got="no degree of freedom that source and receiver share",
        expected="at least one",
        hint="do not set them all free.",
    )
    notes = tuple(
        f"{', '.join(names)}: the receiver is not known there and is taken as {wanted}."
        for wanted, names in taken.items()
    )
    if idle:
        notes += (f"missing: no effect at {', '.join(sorted(idle))}: the receiver is known there.",)
    return np.array(rows), kept, notes


def _row(
    freedom: Freedom,
    mount: InterfacePoint,
    point: InterfacePoint,
    known: tuple[Freedom, ...],
    place: Placement,
) -> tuple[Vector, float]:
    """One row of T, and the share of the motion in directions that the receiver lacks."""
    axis = freedom.sign * mount.axes[freedom.index % 3] @ place.axes
    # translation of the mount: e . (v + w x d) = e . v + (d x e) . w
    needed = np.zeros(6)
    if freedom.is_rotation:
        needed[3:] = axis
    else:
        needed[:3], needed[3:] = axis, np.cross(place.offset, axis)
    row = np.zeros(len(known))
    reached = np.zeros(6)
    for j, other in enumerate(known):
        if other.point != point.name:
            continue
        along = np.zeros(6)
        start = 3 if other.is_rotation else 0
        along[start : start + 3] = other.sign * point.axes[other.index % 3]
        row[j] = needed @ along
        reached += row[j] * along
    return row, float(np.linalg.norm(needed - reached) / np.linalg.norm(needed))


def _refuse_open(open_ones: list[str], receiver: Receiver) -> None:
    if not open_ones:
        return
    raise InputError(
        "coupling",
        got=f"no response of the receiver at {', '.join(open_ones)}",
        expected="the receiver's mobility at every freedom of the source; it has "
        f"{', '.join(map(str, receiver.freedoms)) or 'none'}",
        hint=f"measure them, or state for each what the receiver does: missing: {{{open_ones[0]}: "
        "blocked} (does not move) or free (takes up no force).",
    )


# --------------------------------------------------------------------------- forces


def _interface_forces(joint: Junction, vf: Complexes) -> tuple[Complexes, Complexes]:
    """Forces of the source on the elements, and of the elements on the receiver, (k, n, r)."""
    s, freedoms = joint.s, joint.freedoms
    Y_S, Y_R = joint.mobility, joint.receiver.mobility
    k, n = Y_S.shape[:2]
    compliance = np.zeros((k, n), dtype=complex)
    with_mass: dict[int, tuple[Complexes, Complexes, Complexes]] = {}
    for i, freedom in enumerate(freedoms):
        element, direction = joint.isolators.get(freedom.point), abs(freedom.direction)
        if element is None or direction not in element.directions:
            continue
        stiffness = element.stiffness(direction, s)
        if stiffness.driving is None or stiffness.receiving is None:
            compliance[:, i] = s / stiffness.transfer
        else:
            with_mass[i] = stiffness.driving, stiffness.transfer, stiffness.receiving
    place = np.arange(n)
    light = Y_S.copy()
    light[:, place, place] += compliance
    if not with_mass:
        g = _solved(light + Y_R, vf)
        return g, g
    # two rows for each freedom, all in velocity: v_1 - v_2 = Y_K F_1 and F_1 = g without mass
    Z = np.zeros((k, 2 * n, 2 * n), dtype=complex)
    right = np.concatenate([vf, np.zeros_like(vf)], axis=1)
    Z[:, :n, :n], Z[:, :n, n:] = light, Y_R
    size = np.abs(np.einsum("kii->ki", light + Y_R))
    Z[:, n + place, place], Z[:, n + place, n + place] = size, -size
    for i, parts in with_mass.items():
        whole = 1.0 / sum(np.abs(part) for part in parts)
        k_11, k_t, k_22 = (whole * part for part in parts)
        Z[:, i, :n], Z[:, i, n:] = k_11[:, None] * Y_S[:, i], k_t[:, None] * Y_R[:, i]
        Z[:, n + i, :n], Z[:, n + i, n:] = k_t[:, None] * Y_S[:, i], k_22[:, None] * Y_R[:, i]
        Z[:, i, i] += s * whole
        Z[:, n + i, n + i] += s * whole
        right[:, i], right[:, n + i] = k_11[:, None] * vf[:, i], k_t[:, None] * vf[:, i]
    both = _solved(Z, right)
    return both[:, :n], both[:, n:]


def _solved(Z: Complexes, right: Complexes) -> Complexes:
    """Solve at every frequency; rows and columns are scaled, as their units differ.

    One inverse gives solution and condition; one refinement leaves residuals of round-off in every
    row (Skeel 1980), also where source and receiver cancel on the diagonal.
    """
    worst = np.inf
    if np.all(np.isfinite(Z)) and np.all(np.isfinite(right)):
        size = np.sqrt(np.abs(np.einsum("kii->ki", Z)))
        row = 1.0 / np.where(size > 0.0, size, 1.0)
        scaled = Z * row[:, :, None]
        scaled *= row[:, None, :]
        with suppress(np.linalg.LinAlgError), np.errstate(all="ignore"):
            inverse = np.linalg.inv(scaled)
            worst = float(np.max(np.multiply(_norm(scaled), _norm(inverse))))
    refuse_if(
        not worst < 1.0 / np.finfo(float).eps,
        "coupling",
        got="matrices that are singular or not finite",
        expected="a source or a receiver that moves in every freedom",
        hint="a freedom in which neither moves carries no defined force: leave it out.",
    )
    if worst > _WORST_CONDITION:
        warnings.warn(
            f"The interface forces lose {np.log10(worst):.0f} of 16 digits: two degrees of "
            "freedom of the mounts move alike. Use fewer degrees of freedom.",
            AccuracyWarning,
            stacklevel=5,
        )
    given = row[..., None] * right
    found = inverse @ given
    found += inverse @ (given - scaled @ found)
    return np.asarray(row[..., None] * found)


def _norm(A: NDArray[np.complexfloating]) -> Vector:
    """Largest sum of a column, (k,)."""
    return np.asarray(np.abs(A).sum(axis=1).max(axis=1))
