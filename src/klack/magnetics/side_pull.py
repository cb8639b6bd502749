r"""Force of a solenoid across the axis of its armature.

The main flux passes rings round the armature and working gaps in series.  Each pulls across by the
slope of its own energy,

.. math:: F = \tfrac12 \frac{\varphi^2}{P^2}\,\frac{\partial P}{\partial q}

with the permeance ``P`` of :mod:`klack.magnetics.off_axis_gap` at the present position: a ring
pulls to the nearer side and tilts, a tilted working gap tilts further.  Edge fields of a working
gap carry their part of the flux and no moment.

Limits: flux and axial force are those of an armature on the axis of its guide.  An offset ``e`` in
the clearance ``c`` takes the share :math:`e^2/2c^2` of the reluctance of a ring, a tilt ``t`` takes
:math:`(r_o^2 + r_i^2) t^2/4g^2` of that of a face, to second order (:meth:`ArmaturePull.left_out`).
So the work of the force is not taken from the magnetic energy but counted as a source.
"""

from dataclasses import dataclass
from math import hypot

import numpy as np

from klack.arrays import Vector
from klack.magnetics.air_gap import face_permeance
from klack.magnetics.off_axis_gap import eccentric_ring, guide_ring, tilted_ring_face
from klack.magnetics.quiet_step import FRONT
from klack.magnetics.solenoid_parts import PoleGap
from klack.network.across import SideInputs

__all__ = ["ArmaturePull", "ArmatureRing"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmatureRing:
    """Radial gap between an armature and the bore that it moves in.

    Parameters
    ----------
    inner, outer, length [m]
        Radii, and length along the axis.
    height [m]
        Of its middle, in the drawing of the needle.
    centre [m]
        Axis of the bore, from that of the guide.
    """

    inner: float
    outer: float
    length: float
    height: float
    centre: tuple[float, float] = (0.0, 0.0)

    def offset(self, axis: Vector) -> Vector:
        """Offset of the armature from its bore in the middle of the ring, shape (2,) [m]."""
        return np.asarray(axis[:2] + self.height * axis[2:] - np.array(self.centre))

    def room(self, axis: Vector) -> float:
        """Smallest gap at both ends [m]."""
        middle, lean = self.offset(axis), 0.5 * self.length * axis[2:]
        return self.outer - self.inner - max(hypot(*(middle + lean)), hypot(*(middle - lean)))

    def permeance(self, axis: Vector) -> tuple[float, Vector]:
        """Permeance [H] and its slopes with the axis, shape (4,) [H/m], [H/m], [H], [H]."""
        # the face of the armature slopes by minus the slope of its axis
        place = np.concatenate((self.offset(axis), -axis[2:]))
        P, slopes = guide_ring(self.inner, self.outer, self.length, place)
        return P, np.concatenate((slopes[:2], self.height * slopes[:2] - slopes[2:]))


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmaturePull:
    """Rings and tilting working gaps of a solenoid.

    Parameters
    ----------
    loops
        Fluxes in the state; the first one is that of the gaps.
    gap [m]
        Working gap while both ports are at rest, with the residual gap.
    way
        Its change per displacement of the armature: -1 if that closes it.
    """

    rings: tuple[ArmatureRing, ...]
    faces: tuple[PoleGap, ...]
    loops: int
    gap: float
    way: float

    def flux(self, now: SideInputs) -> float:
        """Flux of the gaps in the middle of the step [Wb]."""
        return float(now.state[FRONT] + now.ahead * now.state[FRONT + self.loops])

    def working_gap(self, now: SideInputs) -> float:
        """Working gap on the axis, with the residual gap [m]."""
        return self.gap + self.way * float(now.ports[0] - now.ports[1])

    def force(self, now: SideInputs) -> Vector:
        """Force and moments, shape (4,) [N], [N], [N m], [N m]."""
        flux2, total = self.flux(now) ** 2, np.zeros(4)
        for ring in self.rings:
            P, slopes = ring.permeance(now.axis)
            total += 0.5 * flux2 / P**2 * slopes
        tilt = hypot(*now.axis[2:])
        if self.faces and tilt > 0.0:
            g = self.working_gap(now)
            for face in self.faces:
                flat, _, slope = tilted_ring_face(face.inner_radius, face.outer_radius, g, tilt)
                whole = float(flat) + _edge_permeance(face, g)
                total[2:] += 0.5 * flux2 / whole**2 * float(slope) * now.axis[2:] / tilt
        return total

    def room(self, now: SideInputs) -> float:
        """Smallest gap round the armature and at the edges of tilting faces [m]."""
        left = [ring.room(now.axis) for ring in self.rings]
        tilt, g = hypot(*now.axis[2:]), self.working_gap(now)
        left += [g - tilt * face.outer_radius for face in self.faces]
        return min(left)

    def left_out(self, now: SideInputs) -> float:
        """Reluctance that the position takes from these gaps, over that on the axis [-]."""
        g, tilt = self.working_gap(now), hypot(*now.axis[2:])
        on_axis, here = 0.0, 0.0
        for ring in self.rings:
            centred = eccentric_ring(ring.inner, ring.outer, ring.length, hypot(*ring.centre))[0]
            on_axis += 1.0 / float(centred)
            here += 1.0 / ring.permeance(now.axis)[0]
        for face in self.faces:
            edge = _edge_permeance(face, g)
            P, _, _ = tilted_ring_face(face.inner_radius, face.outer_radius, g, np.array([0, tilt]))
            on_axis += 1.0 / (float(P[0]) + edge)
            here += 1.0 / (float(P[1]) + edge)
        return 1.0 - here / on_axis

    def placement(self, axis: Vector) -> Vector:
        """Zero: the circuit is that of the centred armature."""
        return np.zeros(0)


def _edge_permeance(face: PoleGap, gap: float) -> float:
    reluctance, _ = face.reluctance(np.array(gap))
    return float(1.0 / reluctance - face_permeance(face.area, gap))
