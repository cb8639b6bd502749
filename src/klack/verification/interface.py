"""Checks of the interface level."""

from collections.abc import Iterator
from itertools import pairwise
from math import exp, inf, pi, sqrt

import numpy as np

from klack.bodies.elasticity.body import elastic_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.statics import Flexibility
from klack.contact.complementarity import solve_lcp
from klack.contact.restitution import find_contacts, measure_impact
from klack.materials.material import Material
from klack.mesh.rigid import rotation_matrix
from klack.transient.active_set import solve_active
from klack.transient.full_order import simulate_full_order
from klack.transient.interface_arrays import ActiveSet
from klack.transient.interface_model import (
    InterfaceBody,
    InterfaceContact,
    InterfaceModel,
    interface_model,
)
from klack.transient.interface_result import InterfaceResult
from klack.transient.interface_run import simulate_interface
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.contact import uniform_compression
from klack.verification.interface_bodies import (
    advance,
    free_rod,
    lateral_guide,
    modal_model,
    momenta,
    reduce_bodies,
    rigid_body,
    rod_between_stops,
    rough_checks,
    sphere_on_beam,
)
from klack.verification.one_dimension import hertz_force
from klack.verification.ring_bodies import (
    NeedleOnRing,
    impulse_on_needle,
    momentum_of_needle,
    solid_over_ring_compliance,
)
from klack.verification.transient import (
    STEEL,
    block_on_pad,
    blocked_bar_model,
    bulk_wave_speed,
    force_curve,
    free_blocks,
    hertz_impact,
    needle_over_seat,
    since_touch,
    sphere_over_cylinder,
    square_pulse,
    two_spheres,
)

__all__ = ["checks", "gaps_of_sphere_over_cone"]


_SPEED = 0.5  # [m/s]
_MASS, _INERTIA = 2.96e-3, (2.3e-7, 2.3e-7, 5.9e-9)  # needle D4 x L30 mm [kg], [kg m^2]


def checks() -> list[Check]:
    """Return all checks of the interface level."""
    return [
        *_free_blocks(),
        _patch_test(),
        *_eccentric(),
        _block_on_pad(),
        *_needle_on_spring(),
        *_blocked_bar(),
        *_two_spheres(),
        *_sphere_on_beam(),
        *_metal_bar(),
        *_order(),
        *rough_checks(),
        *_complementarity(),
        *_guide(),
        *_two_stops(),
        *_many_impacts(),
        *ring_checks(),
    ]


def _face(upper: str, lower: str, space) -> InterfaceContact:  # type: ignore[no-untyped-def]
    return InterfaceContact(name="face", upper=upper, lower=lower, space=space)


def _free_blocks() -> list[Check]:
    """Statics, and the momenta of an off-axis, tilted, sliding and spinning pair."""
    a, b, space = free_blocks()
    model, items = reduce_bodies((a, b), [_face("upper", "lower", space)], (10, 10))
    load = np.random.default_rng(1).uniform(0.0, 1.0, space.count) ** 4
    with Flexibility(a) as on_a, Flexibility(b) as on_b:
        exact = space.G_a @ on_a.solve(space.G_a.T @ load)
        exact += space.G_b @ on_b.solve(space.G_b.T @ load)
    shares = model.traces[:, model.omega > 0] / model.omega[model.omega > 0]
    ours = model.compliance @ load + shares @ (shares.T @ load)
    q, v = np.zeros((2, model.mode_count))
    q[:6] = np.linalg.solve(model.rigid[:, :6], [0.0, 0.0, 1e-6, 2e-3, -3e-3, 0.0])
    v[:6] = np.linalg.solve(model.rigid[:, :6], [0.01, 0.02, -0.5, 5.0, -3.0, 20.0])
    after = advance(model, q, v, step=40e-9, steps=800)
    before, later = momenta(items, v), momenta(items, after.v)
    source = "Newton's laws; the normals of both faces are one and the same"
    return [
        check(
            "two blocks, 20 modes: gaps under an uneven pressure, largest deviation [relative]",
            expected=0.0,
            computed=float(np.max(np.abs(ours - exact)) / np.max(np.abs(exact))),
            tolerance=1e-12,
            source="static solutions of the whole bodies (inertia relief)",
            reason="round-off of two solutions: 1e-15 with MKL, 6e-14 with SuperLU",
        ),
        check(
            "two blocks: difference of the works of two loads on each other [relative]",
            expected=0.0,
            computed=model.checks.reciprocity,
            tolerance=5e-14,
            source="Betti 1872",
        ),
        check(
            "two free blocks, oblique impact: change of linear momentum [relative]",
            expected=0.0,
            computed=float(np.max(np.abs(later[0] - before[0])) / np.max(np.abs(before[0]))),
            tolerance=1e-13,
            source=source,
        ),
        check(
            "two free blocks, oblique impact: change of the moment of momentum [relative]",
            expected=0.0,
            computed=float(np.max(np.abs(later[1] - before[1])) / np.max(np.abs(before[1]))),
            tolerance=5e-13,
            source=source,
        ),
    ]


def _patch_test() -> Check:
    problem = uniform_compression("hex20", "tet10", (3, 4), skew=0.03)
    shares = np.hstack(
        [
            G @ modes.shapes / modes.omega
            for G, modes in (
                (problem.space.G_a, eigenmodes(problem.body_a, count=10)),
                (problem.space.G_b, eigenmodes(problem.body_b, count=10)),
            )
        ]
    )
    residual = problem.compliance() - shares @ shares.T
    load = 1e6 * problem.space.area
    return check(
        "patch test, cubes that do not match, 10 modes each: mean opening under 1 MPa [m]",
        expected=2.0 * 1e6 / 210e9,
        computed=float(
            np.average(residual @ load + shares @ (shares.T @ load), weights=problem.space.area)
        ),
        tolerance=1e-4,
        source="uniform compression of two unit cubes, 2 p L / E",
    )


def _eccentric() -> Iterator[Check]:
    for arm in (1e-3, 5e-3, 20e-3):
        reduced = 1.0 / (1.0 / _MASS + arm**2 / _INERTIA[1])
        time = pi * sqrt(reduced / 1e8)
        model = rigid_body(
            mass=_MASS, inertia=_INERTIA, points=np.array([[arm, 0.0, 0.0]]), stiffness=1e8
        )
        run = simulate_interface(model, speed=_SPEED, duration=1.1 * time, step=time / 4000)
        yield check(
            f"rigid needle hit {arm * 1e3:g} mm off its centre: restitution of the centre [-]",
            expected=2.0 / (1.0 + _MASS * arm**2 / _INERTIA[1]) - 1.0,
            computed=float(run.motion.velocity[-1, 2]) / _SPEED,
            tolerance=1e-13,
            source="e' = (1 + e)/(1 + m r^2/J) - 1 with e = 1",
            absolute=True,
        )


def _block_on_pad() -> Check:
    arm = 4e-3
    block, pad, space = block_on_pad(arm)
    model, _ = reduce_bodies((block, pad), [_face("block", "pad", space)], (10, 0))
    time = pi * sqrt(block.mass / (1e9 * 0.4e-3))
    run = simulate_interface(model, speed=0.1, duration=1.2 * time, step=time / 4000)
    return check(
        "steel block on a soft pad 4 mm off its axis: restitution of the centre [-]",
        expected=2.0 / (1.0 + block.mass * arm**2 / block.inertia[1, 1]) - 1.0,
        computed=float(run.motion.velocity[-1, 2]) / 0.1,
        tolerance=1e-4,
        source="e' = (1 + e)/(1 + m r^2/J) - 1; the pad of 0.2 mm tilts: r is 0.2 um less",
        absolute=True,
    )


def _needle_on_spring() -> Iterator[Check]:
    length, modulus = 30e-3, 210e9 * pi * 2e-3**2
    c = sqrt(210e9 / 7850.0)
    exact = "exact delay relation v_end = v0 - (F(t) + 2 sum F(t - 2jL/c))/Z"
    for kappa, modes, peak, restitution, source in (
        (3.0, 200, 0.997523, 0.982917, exact),
        (11.37, 200, 1.000000, 0.995452, exact),
        (
            11.37,
            20,
            1.0075,
            0.99548,
            "rod with so many exact modes and its static residual, velocity Verlet",
        ),
    ):
        run = simulate_interface(
            free_rod(modes, stiffness=kappa * modulus / length),
            speed=_SPEED,
            duration=4.0 * length / c,
            step=length / c / 2000,
            points=False,
        )
        name = f"needle on a spring, kL/EA = {kappa:g}, {modes} modes"
        yield from [
            check(
                f"{name}: peak force [Z v]",
                expected=peak,
                computed=measure_impact(run.history).peak_force / (modulus / c * _SPEED),
                tolerance=1e-4,
                source=source,
            ),
            check(
                f"{name}: restitution [-]",
                expected=restitution,
                computed=float(run.history.velocity_a[-1]) / _SPEED,
                tolerance=1e-5,
                source=source,
                absolute=True,
            ),
        ]


def _blocked_bar() -> list[Check]:
    length, c = 0.03, bulk_wave_speed(STEEL)
    time = 2.0 * length / c
    model = blocked_bar_model(length, modes=40)
    run = simulate_interface(model, speed=_SPEED, duration=1.6 * time, step=time / 4000)
    history = run.history
    inside = (history.time > 0.2 * time) & (history.time < 0.8 * time)
    pressure = run.impacts[0].point_force[inside].mean(axis=0) / model.area
    height = STEEL.density * c * pi * 2e-3**2 * _SPEED
    curve = square_pulse(history, height, time)
    name = "bar without lateral strain on a wall, 40 modes"
    source = "square pulse F = rho c_p A v, T = 2 L/c_p, e = 1; 40 modes ring at its front"
    return [
        check(
            f"{name}: mean force [N]",
            expected=height,
            computed=float(history.force[inside].mean()),
            tolerance=1e-2,
            source=source,
            curve=curve,
        ),
        check(
            f"{name}: contact time [s]",
            expected=time,
            computed=measure_impact(history).contact_time,
            tolerance=1e-2,
            source=source,
            curve=curve,
        ),
        check(
            f"{name}: impulse [N s]",
            expected=2.0 * model.mass * _SPEED,
            computed=history.impulse,
            tolerance=5e-3,
            source=source,
        ),
        check(
            f"{name}: restitution [-]",
            expected=1.0,
            computed=float(history.velocity_a[-1]) / _SPEED,
            tolerance=1e-2,
            source=source,
        ),
        check(
            f"{name}: spread of the mean pressure over the face [relative]",
            expected=0.0,
            computed=float(np.ptp(pressure) / pressure.mean()),
            tolerance=1e-4,
            source="plane wave",
        ),
    ]


def _two_spheres() -> Iterator[Check]:
    hertz = hertz_impact(2e-3, 2e-3, 0.2)
    a, b, space = two_spheres(2e-3, 2e-3, size=hertz.radius / 5.0)
    model, _ = reduce_bodies((a, b), [_face("upper", "lower", space)], (12, 12))
    time = hertz.contact_time
    run = simulate_interface(model, speed=0.2, duration=1.3 * time, step=time / 800, height=1e-9)
    full = simulate_full_order(a, b, space, speed=0.2, duration=1.3 * time, step=time / 400)
    source = "Hertz 1882 (quasi-static, small slopes; contact radius 1/60 of the spheres')"
    for level, history in (("interface level", run.history), ("full order", full.history)):
        measures = measure_impact(history)
        curve = force_curve(
            history, hertz_force(since_touch(history), duration=time, peak=hertz.peak_force)
        )
        yield from [
            check(
                f"two steel spheres D4, 0.2 m/s, {level}: peak force [N]",
                expected=hertz.peak_force,
                computed=measures.peak_force,
                tolerance=1e-2,
                source=source,
                curve=curve,
            ),
            check(
                f"two steel spheres D4, 0.2 m/s, {level}: contact time [s]",
                expected=time,
                computed=measures.contact_time,
                tolerance=1e-2,
                source=source,
                curve=curve,
            ),
        ]
    yield check(
        "two steel spheres: energy lost by the scheme of the full order",
        expected=0.0,
        computed=full.energy_loss,
        tolerance=1e-4,
        source="conservation of energy",
    )


def _sphere_on_beam() -> Iterator[Check]:
    impact, step = sphere_on_beam(), 0.5e-6
    touches = impact.touches(speed=_SPEED, duration=1e-3)
    run = simulate_interface(impact.model(), speed=_SPEED, duration=1e-3, step=step, points=False)
    found = find_contacts(run.history, threshold=1e-4)
    source = "DOP853 on the same 20 modes and springs, tolerance 1e-9"
    yield from [
        check(
            "sphere on a beam: sub-impacts within 1 ms",
            expected=len(touches),
            computed=len(found),
            tolerance=0.0,
            source=source,
        )
    ]
    for number, (phase, touch) in enumerate(zip(found, touches, strict=False), start=1):
        name = f"sphere on a beam, sub-impact {number}"
        for what, expected, computed, tolerance in (
            (
                "impulse [N s]",
                touch.impulse,
                float(run.history.force[phase.first : phase.last].sum()) * step,
                2e-5,
            ),
            ("end [s]", touch.end, phase.end, 1e-3),
        ):
            yield check(
                f"{name}: {what}",
                expected=expected,
                computed=computed,
                tolerance=tolerance,
                source=source,
            )


def _metal_bar() -> list[Check]:
    """Rigid and elastic bar of the showcase; the rigid one on a wall of 1e12 N/m."""
    speed, energy = 227.0, 239.61
    mass = 2.0 * energy / speed**2
    rigid = modal_model(
        masses=(mass, inf),
        omega=np.zeros(1),
        traces=np.array([[mass**-0.5]]),
        compliance=np.array([[1e-12]]),
        gap=np.array([1e-3]),
    )
    run = simulate_interface(
        rigid, speed=speed, duration=8e-6, step=1e-3 * pi * sqrt(mass / 1e12), flight=True
    )
    rebound = float(run.motion.velocity[-1, 2])
    copper = Material(name="copper", young=117e9, poisson=0.35, density=8930.0)
    time = 2.0 * 32.4e-3 / bulk_wave_speed(copper)
    elastic = blocked_bar_model(32.4e-3, modes=40, radius=3.2e-3, material=copper)
    ring = simulate_interface(elastic, speed=speed, duration=1.6 * time, step=time / 4000)
    source = "ANSYS, Technology Showcase 17, impact of a metal bar on a rigid wall, rigid bar"
    return [
        check(
            "rigid metal bar of 9.300 g on a rigid wall: rebound [m/s]",
            expected=227.00,
            computed=rebound,
            tolerance=4e-12,
            source=source,
        ),
        check(
            "rigid metal bar of 9.300 g on a rigid wall: energy after impact [J]",
            expected=239.61,
            computed=0.5 * mass * rebound**2,
            tolerance=8e-12,
            source=source,
        ),
        check(
            "elastic copper bar without lateral strain, 227 m/s: energy after impact [J]",
            expected=0.5 * elastic.mass * speed**2,
            computed=ring.energy.final,
            tolerance=1e-13,
            source="conservation of energy; kinetic and strain energy of the bar",
        ),
    ]


def _order() -> list[Check]:
    model = free_rod(10, stiffness=1e9, gap=0.1e-6)
    q, v = np.zeros((2, model.mode_count))
    v[0] = -_SPEED * sqrt(model.mass)

    def end(steps: int) -> np.ndarray:
        return advance(model, q, v, step=20e-6 / steps, steps=steps).v

    exact = end(128_000)
    errors = [float(np.linalg.norm(end(n) - exact)) for n in (500, 1000, 2000)]
    there = advance(model, q, v, step=25e-9, steps=800)
    back = advance(model, there.q, -there.v, step=25e-9, steps=800)
    return [
        check(
            "rod with 10 modes through an impact: order of convergence of the step [-]",
            expected=2.0,
            computed=float(np.mean([np.log2(a / b) for a, b in pairwise(errors)])),
            tolerance=3e-2,
            source="trapezoidal contact force, exact modes",
        ),
        check(
            "rod with 10 modes, impact run backwards: deviation from the start [relative]",
            expected=0.0,
            computed=float(np.max(np.abs(back.v + v)) / abs(v[0])),
            tolerance=1e-7,
            source="symmetry of the step in time, but for the payment of the energy debt",
        ),
    ]


def _complementarity() -> list[Check]:
    """A sequence of random problems with a warm active set."""
    rng = np.random.default_rng(11)
    B = rng.standard_normal((60, 60))
    A, q = B @ B.T / 60 + 0.05 * np.eye(60), rng.standard_normal(60)
    carrying = ActiveSet.none(60)
    lam, gap, worst = np.zeros(60), np.zeros(60), 0.0
    for jump in (0.0, *np.repeat([0.05, 0.5, 3.0], 20)):
        q = q + jump * rng.standard_normal(60)
        solve_active(A, q, carrying, lam, gap, 1e-13, 1.0)
        exact, _, _ = solve_lcp(A, q)
        worst = max(worst, float(np.max(np.abs(lam - exact)) / np.max(exact, initial=1e-300)))
    return [
        check(
            "61 complementarity problems, warm and cold: largest deviation of a force [relative]",
            expected=0.0,
            computed=worst,
            tolerance=2e-13,
            source="primal-dual active set with a Cholesky factor each (klack.contact)",
        )
    ]


def _guide() -> list[Check]:
    stiffness, clearance, depth, speed = 1e7, 4e-6, 5e-6, 0.1
    needle = rigid_body(
        mass=_MASS, inertia=_INERTIA, points=np.zeros((1, 3)), stiffness=1e9, gap=1.0
    )

    def end(guide, duration: float, *, fall: float = 0.0, aside: float = 0.0):  # type: ignore[no-untyped-def]
        run = simulate_interface(
            needle,
            speed=fall,
            velocity=np.array([aside, 0.0, 0.0, 0.0, 0.0, 0.0]),
            duration=duration,
            step=duration / 4000,
            guide=guide,
        )
        return run.motion.position[-1], run.motion.velocity[-1]

    half = pi * sqrt(_MASS / stiffness)
    place, back = end(
        lateral_guide(needle, clearance=clearance, stiffness=stiffness),
        2.0 * clearance / speed + half,
        aside=speed,
    )
    braking = 2.0 * 0.2 * stiffness * depth / _MASS
    squeezed = lateral_guide(
        needle,
        clearance=clearance,
        stiffness=stiffness,
        heights=(0.0, 0.0),
        offset=((clearance + depth, 0.0), (-clearance - depth, 0.0)),
        friction=0.2,
    )
    _, slower = end(squeezed, 0.5 * _SPEED / braking, fall=_SPEED)
    oily = lateral_guide(needle, clearance=clearance, stiffness=stiffness, viscous=30.0)
    _, dragged = end(oily, 100e-6, fall=_SPEED)
    return [
        check(
            "shaft against its bore: place after half a period outside [clearances]",
            expected=0.0,
            computed=float(place[0]) / clearance,
            tolerance=1e-5,
            source="free inside of the clearance, pi sqrt(m/k) outside",
        ),
        check(
            "shaft against its bore: speed of return [m/s]",
            expected=-speed,
            computed=float(back[0]),
            tolerance=5e-9,
            source="elastic",
        ),
        check(
            "shaft squeezed from two sides by 50 N, friction 0.2: speed halfway to rest [m/s]",
            expected=-0.5 * _SPEED,
            computed=float(slower[2]),
            tolerance=1e-6,
            source="Coulomb: 2 mu N/m",
        ),
        check(
            "shaft with viscous drag of 30 N s/m after 100 us: speed [m/s]",
            expected=-_SPEED * exp(-30.0 * 100e-6 / _MASS),
            computed=float(dragged[2]),
            tolerance=2e-7,
            source="v = v0 exp(-c t/m)",
        ),
    ]


def _two_stops() -> list[Check]:
    model = rod_between_stops(10, stiffness=1e9, gaps=(10e-6, 15e-6))
    run = simulate_interface(model, speed=_SPEED, duration=5e-3, flight=True, points=False)
    shares = model.traces[:, 1:] / model.omega[1:]
    return [
        check(
            "rod between two walls: energy over some 80 impacts, largest deviation [relative]",
            expected=0.0,
            computed=_largest_deviation(run, 0.0),
            tolerance=1e-11,
            source="conservation of energy",
        ),
        check(
            "rod between two walls, 10 modes: compliance from end to end [m/N]",
            expected=30e-3 / (6.0 * 210e9 * pi * 2e-3**2),
            computed=float(model.compliance[0, 1] + shares[0] @ shares[1]),
            tolerance=5e-14,
            source="free rod with inertia relief: L/(6EA)",
        ),
    ]


def _many_impacts() -> list[Check]:
    a, b, space = needle_over_seat(size=20e-6, bulk=2e-3)
    needle, _ = reduce_bodies((a, b), [_face("needle", "seat", space)], (20, 20))
    press = 2.0 * 0.3 * needle.mass / 2e-3
    ball, floor, space = sphere_over_cylinder(
        sphere_radius=2e-3, radius=10e-3, height=10e-3, size=20e-6, bulk=2e-3
    )
    floor = elastic_body(
        "floor", floor.mesh, {"block": STEEL}, fixed_nodes=floor.mesh.surface("base").nodes
    )
    sphere, _ = reduce_bodies((ball, floor), [_face("sphere", "floor", space)], (10, 30))
    weight = 20.0 * 9.81 * sphere.mass
    source = "conservation of energy; both bodies ring, nothing is damped"
    return [
        check(
            "needle pressed on its seat, 1000 impacts: energy, largest deviation [relative]",
            expected=0.0,
            computed=_largest_deviation(_bounce(needle, press, 1000), press),
            tolerance=8e-10,
            source=source,
        ),
        check(
            "ball under 20 times its weight, 100 impacts: energy, largest deviation [relative]",
            expected=0.0,
            computed=_largest_deviation(_bounce(sphere, weight, 100), weight),
            tolerance=5e-10,
            source=source,
        ),
    ]


def _bounce(model: InterfaceModel, force: float, impacts: int) -> InterfaceResult:
    return simulate_interface(
        model,
        speed=0.3,
        duration=100.0,
        height=0.1e-6,
        force=force,
        flight=True,
        impacts=impacts,
        points=False,
    )


def _largest_deviation(run: InterfaceResult, force: float) -> float:
    """Of the total energy at the start of each impact from the initial one."""
    lift = np.array([impact.position[2] for impact in run.impacts]) - run.motion.position[0, 2]
    energy = np.array([impact.history.ledger.initial for impact in run.impacts]) + force * lift
    energy = np.append(energy, run.energy.final - run.energy.work)
    return float(np.max(np.abs(energy / run.energy.initial - 1.0)))


_STEP, _SPEED_RING, _TIME = 40e-9, 0.1, 90e-6
_ASIDE = np.array([3e-7, 1.2e-7, 0.0, 5e-5, -3e-5, 0.0])
_TIP = 2e-3  # radius [m]


def ring_checks() -> Iterator[Check]:
    """Centred impact, momentum, statics, gaps, and the compliance of a solid."""
    pair = NeedleOnRing()
    yield _centred(pair)
    space, _ = pair.placed(13, _ASIDE)
    model = pair.model(space, axial=6, others=8)
    result = simulate_interface(model, speed=_SPEED_RING, duration=_TIME, step=_STEP)
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
    rings = simulate_interface(
        pair.model(space, axial=6, others=8), speed=_SPEED_RING, duration=_TIME, step=_STEP
    )
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
        interface_model(bodies, [contact]), speed=_SPEED_RING, duration=_TIME, step=_STEP
    )
    ours, theirs = measure_impact(rings.history), measure_impact(plane.history)
    return check(
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


def gaps_of_sphere_over_cone(pair: NeedleOnRing, count: int, placement: np.ndarray) -> np.ndarray:
    """Mean gaps of the hats of a sphere over a cone z = r - c, shape (hats, count) [m].

    Radial lines are cut with the cone by Newton's method.
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
    yield check(
        "sphere 32 um off-axis and tilted over a cone: gaps round the ring, largest deviation [m]",
        expected=0.0,
        computed=float(np.abs(ours - exact)[met].max()),
        tolerance=1e-9,
        source="lines along the radius of the sphere, cut with the cone",
        reason="arcs of quadratic elements",
    )
