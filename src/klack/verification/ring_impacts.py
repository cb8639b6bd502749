"""Checks of bodies of revolution off their axis, at points on rings, for the group interface."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from klack.contact.restitution import measure_impact
from klack.elasticity.eigen import eigenmodes
from klack.elasticity.statics import Flexibility
from klack.mesh.rigid import rotation_matrix
from klack.transient.interface_model import InterfaceBody, InterfaceContact, interface_model
from klack.transient.interface_run import simulate_interface
from klack.verification.check import Check, ComparedCurve, compare
from klack.verification.ring_bodies import (
    NeedleOnRing,
    impulse_on_needle,
    momentum_of_needle,
    solid_over_ring_compliance,
)

__all__ = ["gaps_of_sphere_over_cone", "ring_checks"]

Floats = NDArray[np.float64]

_STEP, _SPEED, _TIME = 40e-9, 0.1, 90e-6
_ASIDE = np.array([3e-7, 1.2e-7, 0.0, 5e-5, -3e-5, 0.0])
_TIP = 2e-3  # radius [m]


def ring_checks() -> Iterator[Check]:
    """Centred impact, momentum, statics, gaps, and the compliance of a solid."""
    check = partial(compare, "interface")
    pair = NeedleOnRing()
    yield _centred(pair)
    space, _ = pair.placed(13, _ASIDE)
    model = pair.model(space, axial=6, others=8)
    result = simulate_interface(model, speed=_SPEED, duration=_TIME, step=_STEP)
    gained = momentum_of_needle(pair, result.motion.velocity[-1] - result.motion.velocity[0])
    pushed = impulse_on_needle(pair, space, result, _STEP)
    newton = "Newton's laws, forces summed over the hats of the half section"
    for what, of, tolerance in (
        ("momentum", slice(0, 3), 5e-8),
        ("moment about its centre", slice(3, 6), 3e-7),
    ):
        yield check(
            f"needle off-axis on a ring of 13 points: {what} against the forces [relative]",
            expected=0.0,
            computed=float(np.abs(gained - pushed)[of].max() / np.abs(pushed[of]).max()),
            tolerance=tolerance,
            source=newton,
            reason="point forces are kept in single precision",
        )
    yield check(
        "the same: residual of the energy balance [relative]",
        expected=0.0,
        computed=float(result.energy.residual),
        tolerance=5e-13,
        source="conservation of energy",
    )
    yield check(
        "the same: modes and residual against statics order by order [relative]",
        expected=0.0,
        computed=model.checks.static_limit,
        tolerance=3e-13,
        source="static solutions of the whole bodies in the orders 0 to 6",
    )
    yield from _gaps(pair)
    coarse = NeedleOnRing(size=60e-6, bulk=4e-3)
    for n in (0, 1):
        solid, rings = solid_over_ring_compliance(coarse, number=1, order=n, layers=12)
        yield check(
            f"seat under a pressure cos({n} theta): compliance [m/N]",
            expected=solid,
            computed=rings,
            tolerance=1e-3 if n == 0 else 5e-3,
            source="the seat as a solid of 12 layers, hats linear round the ring",
            reason=""
            if n == 0
            else "hats of the solid are triangles; falls with n / layers squared",
        )


def _centred(pair: NeedleOnRing) -> Check:
    """Impact on rings against one point per ring."""
    space, _ = pair.placed(9, np.zeros(6))
    model = pair.model(space, axial=6, others=8)
    rings = simulate_interface(model, speed=_SPEED, duration=_TIME, step=_STEP)
    section = pair.section.restricted(np.isin(np.arange(pair.section.count), space.ring))
    section = section.shifted(-float(np.min(section.gap / section.axial)))
    contact = InterfaceContact(
        name="seat", upper=pair.bodies[0].name, lower=pair.bodies[1].name, space=section
    )
    bodies = [
        InterfaceBody(
            body=body,
            flexibility=Flexibility(body),
            modes=eigenmodes(body, count=6),
            damping=np.zeros(6),
        )
        for body in pair.bodies
    ]
    plane = simulate_interface(
        interface_model(bodies, [contact]), speed=_SPEED, duration=_TIME, step=_STEP
    )
    ours, theirs = measure_impact(rings.history), measure_impact(plane.history)
    return compare(
        "interface",
        "centred needle on a ring of 9 points, peak force [N]",
        expected=float(theirs.peak_force),
        computed=float(ours.peak_force),
        tolerance=5e-10,
        source="the same half sections, axisymmetric",
        curve=ComparedCurve(
            x_label="time [us]",
            y_label="force [N]",
            expected=(plane.history.time * 1e6, plane.history.force),
            computed=(rings.history.time * 1e6, rings.history.force),
        ),
    )


def gaps_of_sphere_over_cone(pair: NeedleOnRing, count: int, placement: Floats) -> Floats:
    """Mean gaps of the hats of a spherical tip over a cone z = r - c, shape (hats, count) [m].

    A line from the sphere along its radius is cut with the cone by Newton's method.
    """
    gaps = pair.gaps(count)
    centre = np.array([0.0, 0.0, pair.sides[0].points[:, 1].min() + _TIP])
    seat_r, seat_z = pair.sides[2].points[pair.sides[3].nodes].T
    c, R = float(np.mean(seat_r - seat_z)), rotation_matrix(placement[3:])
    moved = R @ (centre - gaps.centre) + gaps.centre + placement[:3]
    x, angle = gaps.hats.position, gaps.angle
    places = np.stack(
        [
            np.outer(x[:, 0], np.cos(angle)),
            np.outer(x[:, 0], np.sin(angle)),
            np.repeat(x[:, 1:], count, axis=1),
        ],
        axis=-1,
    )
    n = (places - centre) @ R.T
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    start, s = moved + _TIP * n, np.zeros(places.shape[:2])
    for _ in range(50):
        at = start + s[..., None] * n
        rho = np.hypot(at[..., 0], at[..., 1])
        slope = (at[..., 0] * n[..., 0] + at[..., 1] * n[..., 1]) / rho - n[..., 2]
        s -= (rho - at[..., 2] - c) / slope
    W = gaps.hats.weight
    return np.asarray((W @ s) / (W @ np.ones(len(x)))[:, None])


def _gaps(pair: NeedleOnRing) -> Iterator[Check]:
    placement = np.array([30e-6, 10e-6, 40e-6, -3e-3, 2e-3, 0.0])
    exact = gaps_of_sphere_over_cone(pair, 8, placement)
    gaps = pair.gaps(8)
    ours = gaps(placement)
    met = ours < 0.5 * gaps.away
    yield compare(
        "interface",
        "sphere 32 um off-axis and tilted over a cone: gaps round the ring, largest deviation [m]",
        expected=0.0,
        computed=float(np.abs(ours - exact)[met].max()),
        tolerance=1e-9,
        source="lines along the radius of the sphere, cut with the cone",
        reason="arcs of quadratic elements",
    )
