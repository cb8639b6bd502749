"""Impacts of reduced bodies, step by step.

Truth: closed solutions of one impact (half sine, Hertz, St Venant, Gonthier).

A case is run at the scale of a valve, and the simplest also with unit mass, stiffness and speed.

Truth: the matrix exponential of the same mode (scipy), and closed formulas.

A closing spring between the start and first touch; truth = its work.

The spring pushes with its preload at first touch and harder above, so over a gap g it does the work
P g + k g^2 / 2.
"""

from dataclasses import replace
from math import gamma, pi, sqrt

import numpy as np
import pytest
from draws import each
from scipy.linalg import expm

from klack.analyses.impact.run import run_impact
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.case import find_case, read_case
from klack.contact.laws import HertzLaw, HuntCrossley, LinearLaw, TableLaw, gonthier_coefficient
from klack.contact.restitution import measure_impact
from klack.errors import InputError
from klack.simulation.bodies import fixed_body, rigid_mass_body, rod_body
from klack.simulation.impact import propose_step, simulate, simulate_impact
from klack.simulation.propagator import damping_loss, modal_propagator
from klack.simulation.system import AxialForce, ContactPair, ReducedSystem, ReturnSpring

C = 5000.0  # [m/s]
STEEL = {"young": 7850.0 * C**2, "density": 7850.0}
AREA = pi * 2e-3**2  # [m^2]
Z = AREA * 7850.0 * C  # [N s/m]


def pair(a, b, law, gap=0.1e-6, series=0.0):
    port = ("bottom", "top") if "bottom" in a.port_names else ("contact", "contact")
    return ContactPair(
        body_a=a.name,
        port_a=port[0],
        body_b=b.name,
        port_b=port[1] if port[1] in b.port_names else "contact",
        law=law,
        gap=gap,
        series_compliance=series,
    )


def system(a, b, law, gap=0.1e-6, series=0.0, **extra):
    return ReducedSystem(bodies=(a, b), contacts=(pair(a, b, law, gap, series),), **extra)


def needle_on_wall(mass, law, gap=0.1e-6, **extra):
    return system(rigid_mass_body("needle", mass), fixed_body("seat"), law, gap, **extra)


@pytest.mark.parametrize(
    ("mass", "stiffness", "speed", "gap"),
    [(1.0, 1.0, 1.0, 0.1), (2e-3, 1e9, 0.4, 1e-6)],
    ids=["unit scale", "valve needle"],
)
def test_mass_on_a_spring_is_half_a_sine(mass, stiffness, speed, gap):
    duration = pi * sqrt(mass / stiffness)
    history = simulate_impact(
        needle_on_wall(mass, LinearLaw(stiffness), gap),
        speed=speed,
        step=duration / 1e4,  # the scheme is second order: (omega h)^2/12 = 8.2e-9
        duration=1.5 * duration + gap / speed,
    )
    m = measure_impact(history)

    assert m.contact_time == pytest.approx(duration, rel=1e-8)
    assert m.peak_force == pytest.approx(speed * sqrt(mass * stiffness), rel=5e-8)
    assert m.first_touch == pytest.approx(gap / speed, rel=1e-8)
    assert m.restitution == pytest.approx(1.0, abs=1e-12)
    assert m.impulse == pytest.approx(2.0 * mass * speed, rel=1e-12)
    assert m.sub_contacts == 1


def test_hertz_sphere_on_plane():
    """Johnson 1985, section 11.4: m = 1 g, R = 2 mm, E* = 115.4 GPa, 0.5 m/s."""
    mass, radius, modulus, speed = 1e-3, 2e-3, 115.4e9, 0.5
    K = 4.0 / 3.0 * modulus * sqrt(radius)
    depth = (5.0 * mass * speed**2 / (4.0 * K)) ** 0.4
    duration = 4.0 * sqrt(pi) / 5.0 * gamma(0.4) / gamma(0.9) * depth / speed

    m = measure_impact(
        simulate_impact(needle_on_wall(mass, HertzLaw(K)), speed=speed, step=1e-9, duration=30e-6)
    )

    assert duration == pytest.approx(27.0855e-6, rel=1e-5)
    assert m.contact_time == pytest.approx(duration, rel=1e-7)
    assert m.peak_force == pytest.approx(67.916, rel=1e-5)
    assert m.peak_force == pytest.approx(K * depth**1.5, rel=1e-7)
    assert m.restitution == pytest.approx(1.0, abs=1e-11)


def test_table_of_a_hertz_law_gives_the_hertz_impact():
    K, mass, speed = 6.9e9, 1e-3, 0.5
    d = 5e-6 * np.linspace(0.0, 1.0, 120)[1:] ** 1.5
    histories = [
        simulate_impact(needle_on_wall(mass, law), speed=speed, step=5e-9, duration=32e-6)
        for law in (HertzLaw(K), TableLaw(d, K * d**1.5))
    ]
    hertz, table = map(measure_impact, histories)

    # 1e-4: a monotone cubic through 120 points of a 1.5 power
    assert table.peak_force == pytest.approx(hertz.peak_force, rel=1e-5)
    assert table.contact_time == pytest.approx(hertz.contact_time, rel=1e-4)
    assert table.restitution == pytest.approx(1.0, abs=1e-11)


@pytest.mark.parametrize("e", [0.05, 0.3, 0.5, 0.7, 0.9, 0.95])
@pytest.mark.parametrize(
    "law",
    [LinearLaw(1e8), HertzLaw(7e9), TableLaw([1e-6, 3e-6, 8e-6], [40.0, 200.0, 900.0])],
    ids=["linear", "hertz", "table"],
)
def test_gonthier_damping_gives_the_restitution_asked_for(law, e):
    damped = HuntCrossley(law, gonthier_coefficient(e))
    m = measure_impact(
        simulate_impact(needle_on_wall(1e-3, damped), speed=0.5, step=20e-9, duration=1e-3)
    )

    assert m.restitution == pytest.approx(e, rel=1e-3)  # exact law, scheme of second order
    assert m.dissipated_share == pytest.approx(1.0 - m.restitution**2, rel=1e-9)


def test_equal_rods_of_length_one_to_two_after_st_venant():
    """F = Z v/2 for 2 L1/c, restitution L1/L2 = 1/2 (Goldsmith 1960, section 3.2)."""
    length, speed, modes = 0.04, 1.0, 320
    a = rod_body("a", length=length, area=AREA, elastic_modes=modes, **STEEL)
    b = rod_body("b", length=2 * length, area=AREA, elastic_modes=2 * modes, **STEEL)
    missing = a.residual_compliance[0, 0] + b.residual_compliance[1, 1]

    plateau = simulate_impact(
        system(a, b, LinearLaw(1e9), series=missing), speed=speed, step=10e-9, duration=30e-6
    )
    inside = (plateau.time > 6e-6) & (plateau.time < 14e-6)  # 8 of 16 us, after the rise
    assert 0.5 * Z * speed == pytest.approx(246.6, rel=1e-4)
    assert np.mean(plateau.force[inside]) == pytest.approx(0.5 * Z * speed, rel=1e-3)

    hard = simulate_impact(
        system(a, b, LinearLaw(1e12), series=missing), speed=speed, step=5e-9, duration=40e-6
    )
    m = measure_impact(hard)
    assert m.restitution == pytest.approx(0.5, rel=5e-3)
    assert m.contact_time == pytest.approx(2.0 * length / C, rel=1e-2)  # 1 %: rise and tail


def test_equal_rods_with_a_soft_joint():
    """Converged value 0.5231 at 1e9 N/m; 20 + 40 modes with static correction come near it."""
    a = rod_body("a", length=0.04, area=AREA, elastic_modes=20, **STEEL)
    b = rod_body("b", length=0.08, area=AREA, elastic_modes=40, **STEEL)
    missing = a.residual_compliance[0, 0] + b.residual_compliance[1, 1]

    m = measure_impact(
        simulate_impact(
            system(a, b, LinearLaw(1e9), series=missing), speed=1.0, step=10e-9, duration=60e-6
        )
    )

    assert m.restitution == pytest.approx(0.5231, rel=3e-3)
    assert m.contact_time == pytest.approx(17.9e-6, rel=1e-2)


def test_rod_on_a_rigid_wall_after_st_venant():
    """F = Z v for 2 L/c, restitution 1 (1 % each: the joint has a finite stiffness)."""
    rod = rod_body("rod", length=0.04, area=AREA, elastic_modes=320, **STEEL)
    law = LinearLaw(1.0 / (1e-11 + rod.residual_compliance[0, 0]))
    history = simulate_impact(
        system(rod, fixed_body("wall"), law), speed=1.0, step=5e-9, duration=40e-6
    )
    m = measure_impact(history)
    inside = (history.time > 3e-6) & (history.time < 13e-6)

    assert np.mean(history.force[inside]) == pytest.approx(Z, rel=1e-2)
    assert m.contact_time == pytest.approx(2.0 * 0.04 / C, rel=1e-2)
    assert m.restitution == pytest.approx(1.0, abs=1e-2)


def test_series_compliance_is_a_softer_spring():
    """k_eff = 1/(1/k + D) for a linear law, exactly; second order in the step."""
    mass, k, D, speed = 2e-3, 1e9, 2e-9, 0.5
    k_eff = k / (1.0 + k * D)
    duration = pi * sqrt(mass / k_eff)
    history = simulate_impact(
        system(rigid_mass_body("n", mass), fixed_body("w"), LinearLaw(k), series=D),
        speed=speed,
        step=duration / 2000,
        duration=1.5 * duration,
    )
    m = measure_impact(history)

    # the series spring starts one step late, which the instant of touch feels: 1e-4 of a contact
    assert m.contact_time == pytest.approx(duration, rel=1e-4)
    assert m.peak_force == pytest.approx(speed * sqrt(mass * k_eff), rel=2e-6)
    assert m.restitution == pytest.approx(1.0, abs=1e-8)


def test_rod_compliance_is_the_known_one():
    """Free rod end: EA/L times the residual after N modes is 1/3 - (2/pi^2) sum 1/n^2."""
    for N in (0, 1, 20):
        rod = rod_body("r", length=1.0, area=1.0, young=1.0, density=1.0, elastic_modes=N)
        n = np.arange(1, N + 1)
        assert rod.residual_compliance[0, 0] == pytest.approx(
            1.0 / 3.0 - 2.0 / pi**2 * np.sum(1.0 / n**2), rel=1e-12
        )
        cross = -1.0 / 6.0 - 2.0 / pi**2 * np.sum((-1.0) ** n / n**2)
        assert rod.residual_compliance[0, 1] == pytest.approx(cross, rel=1e-10)


def test_needle_on_a_soft_spring_leaves_in_a_harmonic_flight():
    """v(t) = v cos(w t) - P/(m w) sin(w t) after release, v from the energy of the spring."""
    mass, speed, preload, stiffness, gap = 2e-3, 0.2, 20.0, 4e4, 1e-6
    spring = ReturnSpring(body="needle", port="contact", stiffness=stiffness, preload=preload)
    history = simulate_impact(
        needle_on_wall(mass, LinearLaw(1e10), gap=gap, springs=(spring,)),
        speed=speed,
        step=10e-9,
        duration=50e-6,  # the next touch is at 55 us
    )
    m = measure_impact(history)
    omega, pressing = sqrt(stiffness / mass), preload - stiffness * gap  # at the wall
    at_wall = sqrt(speed**2 + (2.0 * preload * gap - stiffness * gap**2) / mass)
    release = m.first_touch + m.total_contact_time

    flying = history.edges > release
    t = history.edges[flying] - release
    expected = at_wall * np.cos(omega * t) - pressing / mass / omega * np.sin(omega * t)
    assert m.approach_speed == pytest.approx(at_wall, rel=1e-6)
    np.testing.assert_allclose(history.velocity_a[flying], expected, atol=1e-5 * speed)
    assert m.restitution == pytest.approx(1.0, abs=1e-5)
    assert history.ledger.residual == pytest.approx(0.0, abs=1e-11)


def test_weight_and_port_force_accelerate_a_rigid_needle_alike():
    free = {}
    for port in (None, "contact"):
        history = simulate_impact(
            needle_on_wall(
                1e-3,
                LinearLaw(1e9),
                gap=1.0,
                forces=(AxialForce(body="needle", force=-3.0, port=port),),
            ),
            speed=0.1,
            step=1e-6,
            duration=1e-3,
        )
        free[port] = history.velocity_a
        np.testing.assert_allclose(
            history.velocity_a, -0.1 - 3.0 / 1e-3 * history.edges, rtol=1e-13
        )
    np.testing.assert_allclose(free[None], free["contact"], rtol=1e-15)


@pytest.mark.slow
def test_tilting_rigid_modes_do_not_matter_for_a_central_impact():
    """A body with six rigid modes and one with the axial mode alone move alike along the axis."""
    rod = rod_body("needle", length=0.04, area=AREA, elastic_modes=5, **STEEL)
    mass = rod.mass
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(6, 6)))[0]  # any orthonormal basis
    axial = turn.T @ (np.eye(6)[0] * sqrt(mass))
    shapes = np.vstack([np.outer(turn.T[:, 0], np.full(2, 1.0 / sqrt(mass))), rod.port_shapes[1:]])
    solid = ReducedBody(
        name="needle",
        mass=mass,
        omega=np.concatenate((np.zeros(6), rod.omega[1:])),
        damping=np.zeros(11),
        port_names=rod.port_names,
        port_shapes=shapes,
        observer_names=(),
        observer_shapes=np.zeros((11, 0)),
        static_compliance=rod.static_compliance,
        rigid_count=6,
        rigid_axial=axial,
        dof_count=11,
    )
    spring = ReturnSpring(body="needle", port="top", stiffness=2e4, preload=5.0)
    one, six = (
        simulate_impact(
            system(body, fixed_body("wall"), LinearLaw(5e8), springs=(spring,)),
            speed=0.5,
            step=20e-9,
            duration=40e-6,
        )
        for body in (rod, solid)
    )

    np.testing.assert_allclose(six.force, one.force, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(six.velocity_a, one.velocity_a, rtol=1e-9)


def test_decimated_records_keep_impulse_and_peak():
    rod = rod_body("rod", length=0.04, area=AREA, elastic_modes=20, **STEEL)
    both = [
        simulate_impact(
            system(rod, fixed_body("wall"), LinearLaw(5e8)),
            speed=0.5,
            step=10e-9,
            duration=30e-6,
            steps_per_record=count,
        )
        for count in (1, 25)
    ]

    assert both[1].impulse == pytest.approx(both[0].impulse, rel=1e-13)
    assert both[1].peak_force.max() == both[0].peak_force.max()
    np.testing.assert_allclose(both[1].velocity_a, both[0].velocity_a[::25], rtol=1e-12)
    np.testing.assert_allclose(both[1].displacement_a, both[0].displacement_a[::25], rtol=1e-12)
    np.testing.assert_allclose(
        both[1].gap, both[0].gap.reshape(-1, 25).mean(axis=1), rtol=1e-10, atol=1e-18
    )


def test_proposed_step_resolves_modes_and_rise():
    """Rod: rise Z/k, highest mode N c/(2 L); steps are 1-2-5 numbers at most 5 % of both."""
    rod = rod_body("rod", length=0.04, area=AREA, elastic_modes=20, **STEEL)
    highest = rod.frequencies[-1]
    hard, soft = (
        propose_step(system(rod, fixed_body("wall"), LinearLaw(k)), speed=1.0) for k in (1e10, 1e7)
    )

    # 1/Z = pi sum(phi^2)/(2 omega_max) is (2 N + 1)/(2 N) too high for N modes and the rigid one
    assert 0.4 * 0.05 * Z / 1e10 < hard <= 0.05 * Z / 1e10
    assert 0.4 * 0.05 / highest < soft <= 0.05 / highest


def test_port_that_is_not_axial_is_refused():
    body = rigid_mass_body("needle", 1e-3)
    turned = replace(body, port_shapes=-body.port_shapes)
    with pytest.raises(InputError, match=r"resultant of 1 N along \+z"):
        system(turned, fixed_body("seat"), LinearLaw(1e9))


def test_names_that_do_not_exist_are_refused():
    with pytest.raises(InputError, match="one of: needle, seat"):
        needle_on_wall(1e-3, LinearLaw(1e9), forces=(AxialForce(body="nedle", force=1.0),))
    good = needle_on_wall(1e-3, LinearLaw(1e9))
    with pytest.raises(InputError, match="supported body"):
        simulate(good, velocities={"seat": 1.0}, step=1e-8, duration=1e-6)
    walls = system(fixed_body("needle"), fixed_body("seat"), LinearLaw(1e9))
    with pytest.raises(InputError, match="without a single mode"):
        simulate(walls, velocities={}, step=1e-8, duration=1e-6)
    with pytest.raises(InputError, match="speed"):
        simulate_impact(good, speed=-1.0, duration=1e-6)


OMEGA = [1e3, 3e4, 4e5, 6e6]  # [rad/s]
ZETA = [0.0, 1e-3, 0.02, 0.9, 1.0 - 1e-9, 1.0, 1.0 + 1e-9, 1.5, 20.0]
STEP = [5e-9, 2e-8, 3e-7, 1e-5]  # [s]


@each("step", STEP)
@each("zeta", ZETA)
@each("omega", OMEGA)
def test_step_is_the_matrix_exponential(omega, zeta, step):
    P = modal_propagator(np.array([omega]), np.array([zeta]), step)
    x = omega * step  # state (q, q'/omega, f/omega^2, its rise, mean of q): all of order one
    matrix = np.zeros((5, 5))
    matrix[:3, 1:4] = [[x, 0.0, 0.0], [-2.0 * zeta * x, x, 0.0], [0.0, 0.0, 1.0]]
    matrix[1, 0], matrix[4, 0] = -x, 1.0
    E = expm(matrix)

    ours = [P.A11, P.A12 * omega, P.A21 / omega, P.A22, P.B1 * omega**2, P.B2 * omega]
    ours += [P.R1 * omega**2, P.R2 * omega, P.Rm * omega**2]
    theirs = [E[0, 0], E[0, 1], E[1, 0], E[1, 1], E[0, 2], E[1, 2]]
    theirs += [E[row, 3] - 0.5 * E[row, 2] for row in (0, 1, 4)]  # from -1/2 to 1/2
    small = min(1.0, x)
    scale = np.array([1.0, small, small, 1.0, small**2, small, small**2, small, small**2])

    # 1e-11: what scipy's scaling and squaring keeps at 60 rad per step; ours is 1e-14
    ours, theirs = np.ravel(ours) / scale, np.array(theirs) / scale
    np.testing.assert_allclose(ours[:-1], theirs[:-1], rtol=1e-11, atol=1e-11)
    assert ours[-1] == pytest.approx(theirs[-1], rel=1e-8)  # differences cancel at zeta = 20


@pytest.mark.parametrize("step", STEP)
def test_rigid_mode_under_constant_force_is_a_parabola(step):
    P = modal_propagator(np.zeros(1), np.zeros(1), step)
    steps, f, v0 = 100, 3.0, -0.5
    q, v = 0.0, v0
    for _ in range(steps):
        q, v = P.A11[0] * q + P.A12[0] * v + P.B1[0] * f, P.A21[0] * q + P.A22[0] * v + P.B2[0] * f
    t = steps * step

    assert q == pytest.approx(v0 * t + 0.5 * f * t**2, rel=1e-14)
    assert v == pytest.approx(v0 + f * t, rel=1e-14)
    assert P.R1[0] == pytest.approx(-(step**2) / 12.0, rel=1e-14)
    assert P.R2[0] == 0.0
    assert P.Rm[0] == pytest.approx(-(step**2) / 24.0, rel=1e-14)


def test_two_steps_are_one_double_step():
    omega, zeta = np.array([0.0, 1e4, 2e6, 5e5]), np.array([0.0, 0.3, 0.002, 3.0])
    one, two = (modal_propagator(omega, zeta, h) for h in (1e-6, 2e-6))

    np.testing.assert_allclose(one.A11**2 + one.A12 * one.A21, two.A11, atol=1e-14)
    np.testing.assert_allclose(one.A11 * one.B1 + one.A12 * one.B2 + one.B1, two.B1, rtol=1e-12)


def test_damping_loss_closes_the_energy_balance_of_one_step():
    """Conservation: energy lost = work in - energy gained; the loss is integrated, not balanced."""
    omega, zeta = np.array([1e5, 2e6, 3e7, 1e6]), np.array([0.01, 0.002, 0.02, 1.4])
    h = 2e-7
    P, (Q11, Q12, Q22, L1, L2, S) = modal_propagator(omega, zeta, h), damping_loss(omega, zeta, h)
    q, v, f = 1.0 / omega, np.array([0.3, -1.0, 0.8, 0.4]), 0.7 * omega
    q1, v1 = P.A11 * q + P.A12 * v + P.B1 * f, P.A21 * q + P.A22 * v + P.B2 * f
    energy = 0.5 * (v**2 + (omega * q) ** 2), 0.5 * (v1**2 + (omega * q1) ** 2)

    lost = Q11 * q**2 + Q12 * q * v + Q22 * v**2 + f * (L1 * q + L2 * v) + S * f**2

    # 1e-12 of the energy: the balance itself loses that much by subtraction
    np.testing.assert_allclose(lost, energy[0] + f * (q1 - q) - energy[1], atol=1e-12)
    assert np.all(lost > 0.0)


@pytest.mark.parametrize(
    ("omega", "zeta", "step"), [([1e3], [-0.1], 1e-6), ([-1.0], [0.0], 1e-6), ([1.0], [0.0], 0.0)]
)
def test_impossible_modes_are_refused(omega, zeta, step):
    with pytest.raises(InputError, match="modal_propagator"):
        modal_propagator(np.array(omega), np.array(zeta), step)


GAP, PRELOAD, RATE, SPEED = 20e-6, 10.0, 1e6, 0.3


@pytest.mark.slow
def test_the_needle_arrives_with_the_work_of_the_spring():
    path = find_case("demo-valve-axisymmetric")
    text = path.read_text(encoding="utf-8")
    assert "gap: 0 um" in text
    assert "motion: {speed: 0.3 m/s}" in text
    text = text.replace("gap: 0 um", "gap: 20 um").replace(
        "motion: {speed: 0.3 m/s}",
        "motion: {speed: 0.3 m/s, spring: {stiffness: 1000 N/mm, preload: 10 N}}",
    )
    case = read_case(text, path)
    run = case.run.model_copy(update={"duration": 130e-6, "transfer": None})
    case = case.model_copy(update={"run": run})
    study = run_impact(case, levels=("reduced", "interface"), certify=False)

    mass = study.bodies[0].mass
    work = PRELOAD * GAP + 0.5 * RATE * GAP**2
    exact = sqrt(SPEED**2 + 2.0 * work / mass)
    assert exact > 1.4 * SPEED
    for level in study.levels.values():
        # weighted gaps close some ten nanometres late
        assert level.measures.approach_speed == pytest.approx(exact, rel=2e-3)
        assert abs(level.energy_residual) < 1e-6
