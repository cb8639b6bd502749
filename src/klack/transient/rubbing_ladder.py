r"""Static contact with Coulomb friction: up a ladder of approaches, down from several of them.

As :mod:`klack.contact.statics`, with the offset *s* of the faces along their tangents and the
forces across the normals,

.. math::
    \begin{pmatrix} g \\ s \end{pmatrix} =
    \begin{pmatrix} g_0 \\ 0 \end{pmatrix} - \delta \begin{pmatrix} a \\ a_t \end{pmatrix}
    + C \begin{pmatrix} \lambda_n \\ \lambda_t \end{pmatrix}, \qquad
    P = a^T \lambda_n + a_t^T \lambda_t ,

with the offset :math:`a_t` per translation along +z, not zero on a cone.  Each step is one
increment of Coulomb's law (:mod:`klack.transient.rubbing`): a point slips by the change of *s*.  A
point that opens forgets its forces; one that closes slips over the whole step.

Closing a contact that grows, the slip is self-similar (Spence, J. Elasticity 5 (1975) 297): the
force converges with the increments as the frictionless one does.  Opening, points stick first and
slip back from the edge inwards.  An impact loses the loop in between.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from klack.arrays import Matrix, Vector
from klack.contact.complementarity import ComplementaritySolver
from klack.contact.face_friction import FaceFriction, lifted_offset
from klack.contact.rubbing_fit import Loop
from klack.contact.statics import StaticContact, check_rim
from klack.errors import ConvergenceError, InputError
from klack.transient.interface_arrays import Closed, Rings
from klack.transient.rubbing import solve_rubbing

__all__ = ["LockedError", "RubbingContact", "rubbing_contact"]


TURNS = (0.5, 0.75, 1.0)
"""Approaches from which the contact opens again, over the highest one."""

_LEFT = 1e-9  # residual of the law over the highest force
_PULL = 1e-6  # force over the highest one below which the contact is pulled apart


class LockedError(InputError):
    """Friction holds the faces together: they do not part by themselves."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RubbingContact:
    """Static states of a contact with friction.

    Parameters
    ----------
    closing
        From first touch; ``force`` is that of pressure and friction together.
    shear (n, ways nc) [N]
        Forces across the normals.
    loops
        Opening from several states, the last one from the highest.
    """

    closing: StaticContact
    shear: Matrix
    faces: FaceFriction
    loops: tuple[Loop, ...]

    @property
    def max_force(self) -> float:
        """Highest axial force of the ladder [N]."""
        return self.closing.max_force

    def load_patterns(self, force: float) -> tuple[Vector, Vector]:
        """Nodal loads on a and b, resultants +1 N and -1 N along z, while ``force`` closes it."""
        of = self.closing
        forces = np.append(0.0, of.force)
        at = float(np.interp(force, forces, np.arange(len(forces))))
        low = min(int(at), len(of.force) - 1)
        share = at - low
        lam, shear = (
            (1.0 - share) * (values[low - 1] if low else 0.0) + share * values[low]
            for values in (of.pressures, self.shear)
        )
        space, faces = of.space, self.faces
        resultant = float(space.axial @ lam + lifted_offset(faces.T_a, space.dimension) @ shear)
        lam, shear = lam / resultant, shear / resultant
        return space.G_a.T @ lam + faces.T_a.T @ shear, space.G_b.T @ lam + faces.T_b.T @ shear


def rubbing_contact(
    static: StaticContact,
    faces: FaceFriction,
    C: Matrix,
    *,
    turns: Sequence[float] = TURNS,
    count: int = 24,
    key: str = "contact.friction",
) -> RubbingContact:
    """States of a contact with friction at the approaches of the frictionless ladder.

    Parameters
    ----------
    static
        Without friction.
    faces
        Of one coefficient: of two, the kinetic one counts.
    C (d nc, d nc) [m/N]
        Of :func:`klack.contact.statics.contact_compliance`.
    turns
        As :data:`TURNS`; the last is 1.
    count
        Steps of each opening.
    key
        Of the friction in the case, for an error.

    Raises
    ------
    LockedError
    ReachError
        Where the contact grows to the rim of its candidates.
    ConvergenceError
    """
    friction = faces.law.kinetic
    state = _State(static, faces, C)
    pressures, shear, opened = [], [], []
    places = {int(np.searchsorted(static.approach, t * static.approach[-1] * 0.999)) for t in turns}
    for place, approach in enumerate(static.approach):
        state.move(approach)
        pressures.append(state.lam[: state.count])
        shear.append(state.lam[state.count :])
        if place in places:
            opened.append(_opened(state.copy(), approach, count, friction, key))
    closing = replace(
        static,
        force=np.hstack([pressures, shear]) @ state.axial,
        pressures=np.array(pressures),
        area=(np.array(pressures) > 0) @ static.space.area,
        active_count=(np.array(pressures) > 0).sum(axis=1),
    )
    check_rim(closing)
    return RubbingContact(
        closing=closing,
        shear=np.array(shear),
        faces=faces,
        loops=tuple(_loop(closing, *curve) for curve in opened),
    )


def _opened(
    state: "_State", approach: float, count: int, friction: float, key: str
) -> tuple[Vector, Vector]:
    down = np.linspace(approach, 0.0, count + 1)
    force = [state.force]
    for at in down[1:]:
        state.move(at)
        force.append(state.force)
    if min(force) < -_PULL * force[0]:
        raise LockedError(
            key,
            got=f"{friction:g}: the faces lock: {-min(force):.3g} N are needed to separate them "
            f"after {force[0]:.3g} N",
            expected="less than the slope of the faces: they then separate by themselves",
            hint="lower the coefficient; the levels without a local law, interface and full, "
            "have no such limit.",
        )
    return down, np.array(force)


def _loop(closing: StaticContact, approach: Vector, force: Vector) -> Loop:
    up = scipy.interpolate.PchipInterpolator(
        np.append(0.0, closing.approach), np.append(0.0, closing.force)
    )
    down = scipy.interpolate.PchipInterpolator(approach[::-1], force[::-1])
    top = approach[0]
    loss = float(up.integrate(0.0, top) - down.integrate(approach[-1], top))
    return Loop(approach=approach, force=force, loss=loss)


class _State:
    def __init__(self, static: StaticContact, faces: FaceFriction, C: Matrix) -> None:
        space = static.space
        lifted = lifted_offset(faces.T_a, space.dimension)
        self.count = space.count
        self.C = np.ascontiguousarray((C + C.T) / 2.0)
        self.axial = np.concatenate([space.axial, lifted])
        self.start = min(space.clearance, space.touch)
        self.gap = np.append(space.gap, np.zeros(len(lifted)))
        self.mu = np.full(space.count, faces.law.kinetic)
        self.tolerance = _LEFT * static.max_force
        self.lam = np.zeros(len(self.axial))
        self.offset = -self.start * lifted
        self.frictionless = ComplementaritySolver(C[: space.count, : space.count])

    def copy(self) -> "_State":
        other = object.__new__(_State)
        vars(other).update(vars(self))
        return other

    @property
    def force(self) -> float:
        return float(self.axial @ self.lam)

    def move(self, approach: float) -> None:
        q = self.gap - (self.start + approach) * self.axial
        q[self.count :] -= self.offset
        w, doing = np.empty_like(q), np.zeros(self.count, dtype=np.int64)
        for lam in (self.lam.copy(), self._without_friction(q)):
            closed = Closed.none(self.count, len(q) // self.count - 1)
            if (
                solve_rubbing(
                    self.C, q, self.mu, closed, Rings.none(), lam, w, doing, self.tolerance
                )
                != 0
            ):
                break
        else:
            raise ConvergenceError(
                "static contact with friction: no forces found at an approach of "
                f"{approach * 1e6:.4g} um.\nTry: a lower coefficient of friction."
            )
        self.lam = lam
        self.offset = self.offset + w[self.count :]

    def _without_friction(self, q: Vector) -> Vector:
        """Forces of the same gaps without friction, a first guess."""
        lam, _, _ = self.frictionless.solve(q[: self.count], self.lam[: self.count] > 0.0)
        return np.append(lam, np.zeros(len(q) - self.count))
