"""Checks of the interface level."""

from itertools import pairwise
from math import exp, inf, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from klack.contact.complementarity import solve_lcp
from klack.contact.history import ImpactHistory
from klack.contact.restitution import find_contacts, measure_impact
from klack.elasticity.body import elastic_body
from klack.elasticity.eigen import eigenmodes
from klack.elasticity.statics import Flexibility
from klack.materials import Material
from klack.transient.active_set import solve_active
from klack.transient.full_order import simulate_full_order
from klack.transient.interface_arrays import ActiveSet
from klack.transient.interface_model import InterfaceContact, InterfaceModel
from klack.transient.interface_result import InterfaceResult
from klack.transient.interface_run import simulate_interface
from klack.verification.beam_impact import sphere_on_beam
from klack.verification.check import Check, ComparedCurve, compare
from klack.verification.hertz_pulse import hertz_force
from klack.verification.impacts import (
    STEEL,
    bulk_wave_speed,
    needle_over_seat,
    sphere_over_cylinder,
)
from klack.verification.indentation import uniform_compression
from klack.verification.interface_bodies import (
    advance,
    free_rod,
    lateral_guide,
    modal_model,
    momenta,
    reduce_bodies,
    rigid_body,
    rod_between_stops,
)
from klack.verification.interface_impacts import (
    block_on_pad,
    blocked_bar_model,
    free_blocks,
    hertz_impact,
    two_spheres,
)
from klack.verification.ring_impacts import ring_checks
from klack.verification.rough_point import rough_checks

__all__ = ["checks"]

_GROUP = "interface"
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
        compare(
            _GROUP,
            "two blocks, 20 modes: gaps under an uneven pressure, largest deviation [relative]",
            expected=0.0,
            computed=float(np.max(np.abs(ours - exact)) / np.max(np.abs(exact))),
            tolerance=1e-12,
            source="static solutions of the whole bodies (inertia relief)",
            reason="round-off of two solutions: 1e-15 with MKL, 6e-14 with SuperLU",
        ),
        compare(
            _GROUP,
            "two blocks: difference of the works of two loads on each other [relative]",
            expected=0.0,
            computed=model.checks.reciprocity,
            tolerance=5e-14,
            source="Betti 1872",
        ),
        compare(
            _GROUP,
            "two free blocks, oblique impact: change of linear momentum [relative]",
            expected=0.0,
            computed=float(np.max(np.abs(later[0] - before[0])) / np.max(np.abs(before[0]))),
            tolerance=1e-13,
            source=source,
        ),
        compare(
            _GROUP,
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
    opening = residual @ load + shares @ (shares.T @ load)
    return compare(
        _GROUP,
        "patch test, cubes that do not match, 10 modes each: mean opening under 1 MPa [m]",
        expected=2.0 * 1e6 / 210e9,
        computed=float(np.average(opening, weights=problem.space.area)),
        tolerance=1e-4,
        source="uniform compression of two unit cubes, 2 p L / E",
    )


def _eccentric() -> list[Check]:
    out = []
    for arm in (1e-3, 5e-3, 20e-3):
        reduced = 1.0 / (1.0 / _MASS + arm**2 / _INERTIA[1])
        time = pi * sqrt(reduced / 1e8)
        model = rigid_body(
            mass=_MASS, inertia=_INERTIA, points=np.array([[arm, 0.0, 0.0]]), stiffness=1e8
        )
        run = simulate_interface(model, speed=_SPEED, duration=1.1 * time, step=time / 4000)
        out.append(
            compare(
                _GROUP,
                f"rigid needle hit {arm * 1e3:g} mm off its centre: restitution of the centre [-]",
                expected=2.0 / (1.0 + _MASS * arm**2 / _INERTIA[1]) - 1.0,
                computed=float(run.motion.velocity[-1, 2]) / _SPEED,
                tolerance=1e-13,
                source="e' = (1 + e)/(1 + m r^2/J) - 1 with e = 1",
                absolute=True,
            )
        )
    return out


def _block_on_pad() -> Check:
    arm = 4e-3
    block, pad, space = block_on_pad(arm)
    model, _ = reduce_bodies((block, pad), [_face("block", "pad", space)], (10, 0))
    time = pi * sqrt(block.mass / (1e9 * 0.4e-3))
    run = simulate_interface(model, speed=0.1, duration=1.2 * time, step=time / 4000)
    return compare(
        _GROUP,
        "steel block on a soft pad 4 mm off its axis: restitution of the centre [-]",
        expected=2.0 / (1.0 + block.mass * arm**2 / block.inertia[1, 1]) - 1.0,
        computed=float(run.motion.velocity[-1, 2]) / 0.1,
        tolerance=1e-4,
        source="e' = (1 + e)/(1 + m r^2/J) - 1; the pad of 0.2 mm tilts: r is 0.2 um less",
        absolute=True,
    )


def _needle_on_spring() -> list[Check]:
    length, modulus = 30e-3, 210e9 * pi * 2e-3**2
    c = sqrt(210e9 / 7850.0)
    exact = "exact delay relation v_end = v0 - (F(t) + 2 sum F(t - 2jL/c))/Z"
    few = "rod with so many exact modes and its static residual, velocity Verlet"
    out = []
    for kappa, modes, peak, restitution, source in (
        (3.0, 200, 0.997523, 0.982917, exact),
        (11.37, 200, 1.000000, 0.995452, exact),
        (11.37, 20, 1.0075, 0.99548, few),
    ):
        model = free_rod(modes, stiffness=kappa * modulus / length)
        run = simulate_interface(
            model, speed=_SPEED, duration=4.0 * length / c, step=length / c / 2000, points=False
        )
        name = f"needle on a spring, kL/EA = {kappa:g}, {modes} modes"
        out += [
            compare(
                _GROUP,
                f"{name}: peak force [Z v]",
                expected=peak,
                computed=measure_impact(run.history).peak_force / (modulus / c * _SPEED),
                tolerance=1e-4,
                source=source,
            ),
            compare(
                _GROUP,
                f"{name}: restitution [-]",
                expected=restitution,
                computed=float(run.history.velocity_a[-1]) / _SPEED,
                tolerance=1e-5,
                source=source,
                absolute=True,
            ),
        ]
    return out


def _blocked_bar() -> list[Check]:
    length, c = 0.03, bulk_wave_speed(STEEL)
    time = 2.0 * length / c
    model = blocked_bar_model(length, modes=40)
    run = simulate_interface(model, speed=_SPEED, duration=1.6 * time, step=time / 4000)
    history = run.history
    inside = (history.time > 0.2 * time) & (history.time < 0.8 * time)
    pressure = run.impacts[0].point_force[inside].mean(axis=0) / model.area
    height = STEEL.density * c * pi * 2e-3**2 * _SPEED
    since = _since_touch(history)
    curve = ComparedCurve(
        x_label="time since first touch [us]",
        y_label="force [N]",
        expected=(since * 1e6, np.where((since > 0.0) & (since < time), height, 0.0)),
        computed=(since * 1e6, history.force),
    )
    name = "bar without lateral strain on a wall, 40 modes"
    source = "square pulse F = rho c_p A v, T = 2 L/c_p, e = 1; 40 modes ring at its front"
    return [
        compare(
            _GROUP,
            f"{name}: mean force [N]",
            expected=height,
            computed=float(history.force[inside].mean()),
            tolerance=1e-2,
            source=source,
            curve=curve,
        ),
        compare(
            _GROUP,
            f"{name}: contact time [s]",
            expected=time,
            computed=measure_impact(history).contact_time,
            tolerance=1e-2,
            source=source,
            curve=curve,
        ),
        compare(
            _GROUP,
            f"{name}: impulse [N s]",
            expected=2.0 * model.mass * _SPEED,
            computed=history.impulse,
            tolerance=5e-3,
            source=source,
        ),
        compare(
            _GROUP,
            f"{name}: restitution [-]",
            expected=1.0,
            computed=float(history.velocity_a[-1]) / _SPEED,
            tolerance=1e-2,
            source=source,
        ),
        compare(
            _GROUP,
            f"{name}: spread of the mean pressure over the face [relative]",
            expected=0.0,
            computed=float(np.ptp(pressure) / pressure.mean()),
            tolerance=1e-4,
            source="plane wave",
        ),
    ]


def _since_touch(history: ImpactHistory) -> NDArray[np.float64]:
    first = int(np.argmax(history.force > 0))
    return np.asarray(history.time - history.time[first] + 0.5 * history.step)


def _two_spheres() -> list[Check]:
    hertz = hertz_impact(2e-3, 2e-3, 0.2)
    a, b, space = two_spheres(2e-3, 2e-3, size=hertz.radius / 5.0)
    model, _ = reduce_bodies((a, b), [_face("upper", "lower", space)], (12, 12))
    time = hertz.contact_time
    run = simulate_interface(model, speed=0.2, duration=1.3 * time, step=time / 800, height=1e-9)
    full = simulate_full_order(a, b, space, speed=0.2, duration=1.3 * time, step=time / 400)
    source = "Hertz 1882 (quasi-static, small slopes; contact radius 1/60 of the spheres')"
    out = []
    for level, history in (("interface level", run.history), ("full order", full.history)):
        measures = measure_impact(history)
        since = _since_touch(history)
        curve = ComparedCurve(
            x_label="time since first touch [us]",
            y_label="force [N]",
            expected=(
                since * 1e6,
                hertz_force(since, duration=time, peak=hertz.peak_force),
            ),
            computed=(since * 1e6, history.force),
        )
        out += [
            compare(
                _GROUP,
                f"two steel spheres D4, 0.2 m/s, {level}: peak force [N]",
                expected=hertz.peak_force,
                computed=measures.peak_force,
                tolerance=1e-2,
                source=source,
                curve=curve,
            ),
            compare(
                _GROUP,
                f"two steel spheres D4, 0.2 m/s, {level}: contact time [s]",
                expected=time,
                computed=measures.contact_time,
                tolerance=1e-2,
                source=source,
                curve=curve,
            ),
        ]
    out.append(
        compare(
            _GROUP,
            "two steel spheres: energy lost by the scheme of the full order",
            expected=0.0,
            computed=full.energy_loss,
            tolerance=1e-4,
            source="conservation of energy",
        )
    )
    return out


def _sphere_on_beam() -> list[Check]:
    impact, step = sphere_on_beam(), 0.5e-6
    touches = impact.touches(speed=_SPEED, duration=1e-3)
    run = simulate_interface(impact.model(), speed=_SPEED, duration=1e-3, step=step, points=False)
    found = find_contacts(run.history, threshold=1e-4)
    source = "DOP853 on the same 20 modes and springs, tolerance 1e-9"
    out = [
        compare(
            _GROUP,
            "sphere on a beam: sub-impacts within 1 ms",
            expected=len(touches),
            computed=len(found),
            tolerance=0.0,
            source=source,
        )
    ]
    for number, (phase, touch) in enumerate(zip(found, touches, strict=False), start=1):
        name = f"sphere on a beam, sub-impact {number}"
        impulse = float(run.history.force[phase.first : phase.last].sum()) * step
        for what, expected, computed, tolerance in (
            ("impulse [N s]", touch.impulse, impulse, 2e-5),
            ("end [s]", touch.end, phase.end, 1e-3),
        ):
            out.append(
                compare(
                    _GROUP,
                    f"{name}: {what}",
                    expected=expected,
                    computed=computed,
                    tolerance=tolerance,
                    source=source,
                )
            )
    return out


def _metal_bar() -> list[Check]:
    """Rigid and elastic bar of the showcase; the wall of the rigid one is a spring of 1e12 N/m."""
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
        compare(
            _GROUP,
            "rigid metal bar of 9.300 g on a rigid wall: rebound [m/s]",
            expected=227.00,
            computed=rebound,
            tolerance=4e-12,
            source=source,
        ),
        compare(
            _GROUP,
            "rigid metal bar of 9.300 g on a rigid wall: energy after impact [J]",
            expected=239.61,
            computed=0.5 * mass * rebound**2,
            tolerance=8e-12,
            source=source,
        ),
        compare(
            _GROUP,
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

    def end(steps: int) -> NDArray[np.float64]:
        return advance(model, q, v, step=20e-6 / steps, steps=steps).v

    exact = end(128_000)
    errors = [float(np.linalg.norm(end(n) - exact)) for n in (500, 1000, 2000)]
    there = advance(model, q, v, step=25e-9, steps=800)
    back = advance(model, there.q, -there.v, step=25e-9, steps=800)
    return [
        compare(
            _GROUP,
            "rod with 10 modes through an impact: order of convergence of the step [-]",
            expected=2.0,
            computed=float(np.mean([np.log2(a / b) for a, b in pairwise(errors)])),
            tolerance=3e-2,
            source="trapezoidal contact force, exact modes",
        ),
        compare(
            _GROUP,
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
        compare(
            _GROUP,
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

    bore = lateral_guide(needle, clearance=clearance, stiffness=stiffness)
    half = pi * sqrt(_MASS / stiffness)
    place, back = end(bore, 2.0 * clearance / speed + half, aside=speed)
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
        compare(
            _GROUP,
            "shaft against its bore: place after half a period outside [clearances]",
            expected=0.0,
            computed=float(place[0]) / clearance,
            tolerance=1e-5,
            source="free inside of the clearance, pi sqrt(m/k) outside",
        ),
        compare(
            _GROUP,
            "shaft against its bore: speed of return [m/s]",
            expected=-speed,
            computed=float(back[0]),
            tolerance=5e-9,
            source="elastic",
        ),
        compare(
            _GROUP,
            "shaft squeezed from two sides by 50 N, friction 0.2: speed halfway to rest [m/s]",
            expected=-0.5 * _SPEED,
            computed=float(slower[2]),
            tolerance=1e-6,
            source="Coulomb: 2 mu N/m",
        ),
        compare(
            _GROUP,
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
        compare(
            _GROUP,
            "rod between two walls: energy over some 80 impacts, largest deviation [relative]",
            expected=0.0,
            computed=_largest_deviation(run, 0.0),
            tolerance=1e-11,
            source="conservation of energy",
        ),
        compare(
            _GROUP,
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
    pressed = _bounce(needle, press, 1000)
    ball, floor, space = sphere_over_cylinder(
        sphere_radius=2e-3, radius=10e-3, height=10e-3, size=20e-6, bulk=2e-3
    )
    floor = elastic_body(
        "floor", floor.mesh, {"block": STEEL}, fixed_nodes=floor.mesh.surface("base").nodes
    )
    sphere, _ = reduce_bodies((ball, floor), [_face("sphere", "floor", space)], (10, 30))
    weight = 20.0 * 9.81 * sphere.mass
    bouncing = _bounce(sphere, weight, 100)
    source = "conservation of energy; both bodies ring, nothing is damped"
    return [
        compare(
            _GROUP,
            "needle pressed on its seat, 1000 impacts: energy, largest deviation [relative]",
            expected=0.0,
            computed=_largest_deviation(pressed, press),
            tolerance=8e-10,
            source=source,
        ),
        compare(
            _GROUP,
            "ball under 20 times its weight, 100 impacts: energy, largest deviation [relative]",
            expected=0.0,
            computed=_largest_deviation(bouncing, weight),
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
    """Of the total energy at the start of each impact from that of the start of the run."""
    lift = np.array([impact.position[2] for impact in run.impacts]) - run.motion.position[0, 2]
    energy = np.array([impact.history.ledger.initial for impact in run.impacts]) + force * lift
    energy = np.append(energy, run.energy.final - run.energy.work)
    return float(np.max(np.abs(energy / run.energy.initial - 1.0)))
