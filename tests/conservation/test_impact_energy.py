"""Truth: conservation. Energy and momentum of impacts, reduced and at full order.

Truth: energy and momentum. The scheme balances them to round-off at every step size.

Momentum, angular momentum and reciprocity of the contact; truth: they cancel to round-off.

Truth: 40-digit integrals of the force, and the work that every contact step has to account for.

Small changes of the indentation are where nearly all steps of an impact lie, and where a short
series stands for a difference that would lose its digits.

Momentum and energy of full-order impacts: both must balance to round-off at any step.
"""

from decimal import Decimal, localcontext
from functools import cache
from math import pi

import numpy as np
import pytest
from draws import each

from klack.bodies.elasticity.body import ElasticBody
from klack.contact.laws import HertzLaw, HuntCrossley, LinearLaw, TableLaw
from klack.contact.mortar import contact_space
from klack.contact.restitution import measure_impact
from klack.simulation.bodies import fixed_body, rigid_mass_body, rod_body
from klack.simulation.contact_step import law_potential, mean_force, solve_step
from klack.simulation.impact import simulate, simulate_impact
from klack.simulation.interface_step import film_force, interface_store, solve_interface
from klack.simulation.system import AxialForce, ContactPair, ReducedSystem, ReturnSpring
from klack.transient.full_order import simulate_full_order
from klack.transient.result import FullOrderResult
from klack.verification.contact import half_spaces, parabola, sphere_on_cone
from klack.verification.lattice import lattice_mesh
from klack.verification.transient import sphere_over_cylinder

STEEL = {"young": 2.1e11, "density": 7850.0}
DEPTH = 6e-6 * np.linspace(0.0, 1.0, 30)[1:] ** 1.3  # [m]
LAWS = [LinearLaw(1e9), HertzLaw(2e11), TableLaw(DEPTH, 2e11 * DEPTH**1.5)]
IDS = ["linear", "hertz", "table"]


def needle(modes=19, damping=0.0, area=pi * 4e-6):
    return rod_body("needle", length=0.04, area=area, elastic_modes=modes, damping=damping, **STEEL)


def seat(modes=40, damping=0.0, name="seat", support="bottom"):
    return rod_body(
        name,
        length=0.1,
        area=pi * 25e-6,
        elastic_modes=modes,
        support=support,
        damping=damping,
        **STEEL,
    )


def contact(law, gap=1e-6, a=("needle", "bottom"), b=("seat", "top"), series=0.0):
    return ContactPair(
        body_a=a[0],
        port_a=a[1],
        body_b=b[0],
        port_b=b[1],
        law=law,
        gap=gap,
        series_compliance=series,
    )


@pytest.mark.parametrize("step", [20e-9, 100e-9, 1e-6])
@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_energy_of_thousands_of_impacts(law, step):
    """20 ms under 200 N without damping: drift below 1e-10 even where a step skips a contact."""
    system = ReducedSystem(
        bodies=(needle(), seat()),
        contacts=(contact(law),),
        forces=(AxialForce(body="needle", force=-200.0),),
    )
    history = simulate_impact(system, speed=1.0, step=step, duration=20e-3)

    closed = history.force > 0.0

    assert abs(history.ledger.residual) < 1e-10
    touches = np.count_nonzero(closed[1:] & ~closed[:-1])  # chaotic: about 900, 5000, 900
    assert touches > (200 if step > 5e-7 else 3000 if isinstance(law, LinearLaw) else 500)


@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_modal_damping_is_booked(law):
    system = ReducedSystem(
        bodies=(needle(damping=0.02), seat(damping=0.005)),
        contacts=(contact(law),),
        forces=(AxialForce(body="needle", force=-50.0),),
    )
    ledger = simulate_impact(system, speed=1.0, step=20e-9, duration=2e-3).ledger

    assert ledger.damping > 0.05 * ledger.initial
    assert abs(ledger.residual) < 1e-11


@pytest.mark.parametrize("exponent", [1.0, 1.5])
def test_hunt_crossley_loss_is_booked_and_never_negative(exponent):
    law = HuntCrossley(HertzLaw({1.0: 1e9, 1.5: 2e11}[exponent], exponent=exponent), 0.3)
    system = ReducedSystem(
        bodies=(rigid_mass_body("needle", 3e-3), fixed_body("seat")),
        contacts=(contact(law, a=("needle", "contact"), b=("seat", "contact")),),
        forces=(AxialForce(body="needle", force=-100.0),),
    )
    lost = [
        simulate_impact(system, speed=0.5, step=20e-9, duration=t).ledger
        for t in np.linspace(2e-6, 300e-6, 30)
    ]

    assert np.all(np.diff([ledger.contact_dissipation for ledger in lost]) >= 0.0)
    assert lost[-1].contact_dissipation > 0.2 * lost[-1].initial
    assert max(abs(ledger.residual) for ledger in lost) < 1e-12


def test_clipped_damping_work_is_booked():
    """Strong damping on a body that is pulled away by its own ringing: the law must not pull."""
    system = ReducedSystem(
        bodies=(needle(), seat()), contacts=(contact(HuntCrossley(LinearLaw(1e9), 5.0)),)
    )
    history = simulate_impact(system, speed=1.0, step=20e-9, duration=100e-6)

    assert np.all(history.force >= 0.0)
    assert abs(history.ledger.residual) < 1e-11


@pytest.mark.slow
def test_two_contacts_at_once_conserve_energy_and_momentum():
    """A needle between two free rods, both contacts closed together much of the time."""
    low, high = seat(name="low", support="free"), seat(name="high", support="free")
    system = ReducedSystem(
        bodies=(needle(), low, high),
        contacts=(
            contact(LinearLaw(1e9), b=("low", "top")),
            contact(
                TableLaw(DEPTH, 2e11 * DEPTH**1.5),
                a=("high", "bottom"),
                b=("needle", "top"),
                gap=2e-6,
            ),
        ),
    )
    record = simulate(
        system, velocities={"high": -0.8, "needle": -0.2}, step=20e-9, duration=400e-6
    )
    mass = np.array([body.mass for body in system.bodies])
    momentum = record.velocity @ mass
    assert np.count_nonzero(np.all(record.force > 0.0, axis=1)) > 50
    assert abs(record.ledger.residual) < 1e-11
    np.testing.assert_allclose(momentum, momentum[0], rtol=1e-12)
    # each body gains what its contacts push
    gained = mass[0] * np.diff(record.velocity[:, 0])
    np.testing.assert_allclose(
        gained,
        (record.force[:, 0] - record.force[:, 1]) * record.step,
        atol=1e-12 * abs(momentum[0]),
    )


@pytest.mark.slow
def test_two_parallel_contacts_share_the_force():
    """Two contacts at one place are one of the sum of the stiffnesses (stiff against the step)."""
    wall = fixed_body("seat", port="top")
    one = ReducedSystem(bodies=(needle(), wall), contacts=(contact(LinearLaw(5e9)),))
    two = ReducedSystem(
        bodies=(needle(), wall), contacts=(contact(LinearLaw(4e9)), contact(LinearLaw(1e9)))
    )
    single, double = (
        simulate(system, velocities={"needle": -1.0}, step=50e-9, duration=60e-6)
        for system in (one, two)
    )

    np.testing.assert_allclose(
        double.force.sum(axis=1), single.force[:, 0], rtol=1e-6, atol=1e-6 * single.force.max()
    )
    np.testing.assert_allclose(double.force[:, 0], 4.0 * double.force[:, 1], rtol=1e-6, atol=1e-6)
    assert abs(double.ledger.residual) < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize("damping", [0.0, 0.01])
@pytest.mark.parametrize("law", [*LAWS, HuntCrossley(LAWS[1], 0.2)], ids=[*IDS, "lossy"])
def test_loops_for_one_and_for_several_contacts_agree(law, damping):
    """A second contact that stays open changes nothing (100 modes: more than one chunk)."""
    bodies = needle(modes=29, damping=damping), seat(modes=70, damping=damping)
    press = (AxialForce(body="needle", force=-30.0),)
    one = contact(law, series=0.0 if isinstance(law, HuntCrossley) else 1e-10)
    far = contact(LinearLaw(1e9), gap=1.0, a=("needle", "top"))
    single, several = (
        simulate(
            ReducedSystem(bodies=bodies, contacts=contacts, forces=press),
            velocities={"needle": -0.7},
            step=20e-9,
            duration=100e-6,
            steps_per_record=4,
        )
        for contacts in ((one,), (one, far))
    )

    scale = single.force.max()
    np.testing.assert_allclose(several.force[:, 0], single.force[:, 0], atol=1e-7 * scale)
    np.testing.assert_allclose(several.velocity, single.velocity, atol=1e-9)
    np.testing.assert_allclose(several.displacement[:, 0], single.displacement[:, 0], atol=1e-14)
    assert several.ledger.damping == pytest.approx(single.ledger.damping, rel=1e-7)
    assert several.ledger.contact_dissipation == pytest.approx(
        single.ledger.contact_dissipation, rel=1e-6, abs=1e-15
    )


@pytest.mark.parametrize("law", LAWS, ids=IDS)
def test_series_compliance_loses_next_to_nothing(law):
    """The state of the series spring at release is the only loss: booked, and of second order."""
    system = ReducedSystem(bodies=(needle(), seat()), contacts=(contact(law, series=1e-9),))
    ledger = simulate_impact(system, speed=0.5, step=20e-9, duration=100e-6).ledger

    assert abs(ledger.residual) < 1e-12
    assert 0.0 <= ledger.contact_dissipation < 1e-5 * ledger.initial


def test_spring_to_ground_keeps_the_books():
    system = ReducedSystem(
        bodies=(needle(damping=0.01), seat()),
        contacts=(contact(LinearLaw(1e9), gap=30e-6),),
        springs=(ReturnSpring(body="needle", port="top", stiffness=2e4, preload=15.0),),
    )
    ledger = simulate_impact(system, speed=0.3, step=50e-9, duration=3e-3).ledger

    assert ledger.spring != 0.0
    assert abs(ledger.residual) < 1e-9  # the spring is folded into modes up to 1.2 MHz


def test_impulse_is_the_change_of_momentum():
    low = seat(support="free")
    system = ReducedSystem(
        bodies=(needle(), low),
        contacts=(contact(LinearLaw(1e9)),),
        forces=(AxialForce(body="needle", force=-40.0),),
    )
    m = measure_impact(simulate_impact(system, speed=0.7, step=20e-9, duration=80e-6))

    assert m.impulse_residual == pytest.approx(0.0, abs=1e-12)
    assert m.restitution_from_impulse == pytest.approx(m.restitution, rel=1e-9)


def pair(family, slave=None):
    sphere, cone, _ = sphere_on_cone(family, (14, 11))
    space = contact_space(
        sphere, sphere.surface("bottom"), cone, cone.surface("top"), reach=4e-6, slave=slave
    )
    return sphere, cone, space


@pytest.mark.parametrize("family", ["tet10", "hex20", "wedge15", "tet4", "hex8"])
@pytest.mark.parametrize("slave", ["a", "b"])
def test_forces_and_moments_cancel_row_by_row(family, slave):
    """Each pair of forces lies on one line, so the moments cancel on curved faces as well."""
    sphere, cone, space = pair(family, slave)
    force_a = [space.G_a[:, k::3] for k in range(3)]
    force_b = [space.G_b[:, k::3] for k in range(3)]

    for k in range(3):
        total = force_a[k].sum(axis=1) + force_b[k].sum(axis=1)
        np.testing.assert_allclose(total, 0.0, atol=1e-13)
        i, j = (k + 1) % 3, (k + 2) % 3
        moment = sum(
            force[j] @ points[:, i] - force[i] @ points[:, j]
            for force, points in ((force_a, sphere.points), (force_b, cone.points))
        )
        np.testing.assert_allclose(moment, 0.0, atol=1e-13 * 1e-3)
    assert space.count > 10


@pytest.mark.parametrize("slave", ["a", "b"])
def test_a_lift_of_a_opens_the_gaps_by_the_axial_weights(slave):
    sphere, cone, space = pair("hex20", slave)
    lift = np.tile([0.0, 0.0, 1e-9], sphere.node_count)

    np.testing.assert_allclose(space.G_a @ lift, 1e-9 * space.axial, rtol=1e-12)
    assert space.axial.min() > 0.5
    assert space.axial.max() < 0.9  # cos 45 deg, plus minus the width of the ring
    moved = sphere.moved(np.array([0.0, 0.0, 1e-9]))
    again = contact_space(
        moved, moved.surface("bottom"), cone, cone.surface("top"), reach=4e-6, slave=slave
    )
    np.testing.assert_array_equal(again.nodes, space.nodes)
    # first order in the angle between the two normals, s/R at a distance s from the ring
    change = (again.gap - space.gap) / (1e-9 * space.axial)
    np.testing.assert_allclose(change, 1.0, atol=0.1)
    assert change.mean() == pytest.approx(1.0, abs=0.01)


def test_overhanging_faces_keep_the_balance_and_the_covered_area():
    """A block that overhangs: points that meet nothing count on neither side."""
    line = np.linspace(0, 1e-3, 5)
    a = lattice_mesh("tet10", [line + 0.33e-3, line, line + 1e-3])
    b = lattice_mesh("tet10", [np.linspace(0, 1e-3, 4)] * 3)

    space = contact_space(a, a.surface("bottom"), b, b.surface("top"), reach=1e-6, slave="a")

    for k in range(3):
        total = space.G_a[:, k::3].sum(axis=1) + space.G_b[:, k::3].sum(axis=1)
        np.testing.assert_allclose(total, 0.0, atol=1e-13)
    np.testing.assert_allclose(space.axial, 1.0, rtol=1e-12)
    assert space.area.sum() == pytest.approx(0.67e-6, rel=0.03)
    assert not space.rim.any()


def test_compliance_is_symmetric_and_positive_definite():
    problem = half_spaces(parabola(40e-3, 4e-4), contact=1e-4, cells=(6, 5), reach=0.2e-6)

    C = problem.compliance()

    np.testing.assert_array_equal(C, C.T)
    assert np.linalg.eigvalsh(C).min() > 0


def test_axisymmetric_areas_are_those_of_full_rings():
    """Hats over the radius, times the circle; the pieces of a quad8 face are exact for them."""
    radius, cells = 1.2e-3, 8
    h = radius / (2 * cells)  # between nodes
    height = np.linspace(0.0, radius, 3)
    upper = lattice_mesh("quad8", [np.linspace(0.0, radius, cells + 1), height + radius])
    lower = lattice_mesh("quad8", [np.linspace(0.0, radius, 6), height])

    space = contact_space(
        upper, upper.surface("bottom"), lower, lower.surface("top"), reach=1e-6, slave="a"
    )

    r = space.points[:, 0]
    exact = 2.0 * np.pi * r * h
    exact[r == 0.0] = np.pi * h**2 / 3.0
    exact[r == radius] = np.pi * h * (radius - h / 3.0)
    assert space.count == 2 * cells + 1
    np.testing.assert_allclose(space.area, exact, rtol=1e-13)
    assert space.area.sum() == pytest.approx(np.pi * radius**2, rel=1e-13, abs=0.0)


DEPTH_CHANGES = np.array([2e-7, 5e-7, 1e-6, 1.8e-6, 3e-6, 4e-6])  # [m]
LAWS_CHANGES = {
    "linear": LinearLaw(1e9),
    "hertz": HertzLaw(7.5e9),
    "power": HertzLaw(3e8, exponent=1.2),
    "table": TableLaw(DEPTH_CHANGES, 7.5e9 * DEPTH_CHANGES**1.5),
}
RATIOS = [9e-1, 2e-1, 2.1e-2, 1.9e-2, 1.2e-2, 9.9e-3, 5e-3, 1e-3, 1e-5, 1e-8]


@each("sign", [1, -1])
@each("change", RATIOS)
@each("exponent", ["1", "1.1", "1.5", "2.5", "3"])
def test_mean_of_a_power_law_keeps_its_digits(exponent, change, sign):
    """``[V(d1) - V(d0)]/(d1 - d0)``, on both sides of 1 % between the ends and their mean."""
    law = HertzLaw(7.5e9, exponent=float(exponent)).flat()
    d0 = 2e-6
    d1 = d0 * (1.0 + sign * change)

    mean, _, _ = mean_force(law.kind, law.parameters, 0, d0, d1, 0)

    with localcontext() as exact:
        exact.prec = 40
        a, b, n = Decimal(d0), Decimal(d1), Decimal(exponent) + 1
        expected = Decimal("7.5e9") / n * (b**n - a**n) / (b - a)
    # just above 1 % the difference of the potentials has lost two digits; exponents are doubles
    assert mean == pytest.approx(float(expected), rel=2e-13, abs=0.0)


@pytest.mark.parametrize("share", np.array([-0.96, -0.5, -0.1, 0.1, 0.5, 0.96, 1.04]) * 0.05)
def test_mean_shear_of_a_film_keeps_its_digits(share):
    """``ln(x0/x1)`` by its series, up to the largest change that it stands for, and beyond."""
    x0, h = 2e-6, 20e-9
    x1 = x0 * (1.0 - share) / (1.0 + share)

    force = film_force(0.0, 4e-12, 1e-7, h, x0 - 1e-7, x1 - 1e-7)

    # six terms leave 2/13 of the sixth power of 0.05^2 over 2: 2e-17; the gaps have lost a digit
    assert force == pytest.approx(
        4e-12 * np.log1p(2.0 * share / (1.0 - share)) / h, rel=4e-14, abs=0.0
    )


@each("G", [1e-12, 1e-10, 1e-8])  # [m/N]
@each("chi_over_h", [1e5, 3e6, 1e8])  # [1/m]
@each("name", list(LAWS_CHANGES))
def test_a_damped_step_books_what_the_store_does_not_get(name, chi_over_h, G):
    """``F (d1 - d0) = V(d1) - V(d0) + loss``, clipped or not, and no loss is negative.

    Between the ends, the force is that of the law where it pushes, and zero where it would pull.
    """
    law = LAWS_CHANGES[name].flat()
    clipped = 0
    for d0 in (-1e-7, 1e-7, 9e-7, 3.5e-6):
        for way in (-4e-6, -1e-6, -2e-7, -1e-8, 1e-8, 2e-7, 1e-6):
            force, _, loss = solve_step(
                law.kind, law.parameters, 0, chi_over_h, G, d0, d0 + way, 0.0, 0
            )
            d1 = d0 + way - G * force
            before, after = (law_potential(law.kind, law.parameters, 0, d) for d in (d0, d1))
            turned = before + after + abs(force * (d1 - d0))
            # the residual of the Newton iteration and the subtraction of two potentials
            assert force * (d1 - d0) == pytest.approx(after - before + loss, abs=2e-9 * turned)
            assert loss >= -1e-12 * turned
            if chi_over_h * (d1 - d0) <= -1.0 and before > 0.0:
                clipped += 1
                assert force == 0.0
                assert loss == pytest.approx(before - after, rel=1e-12, abs=0.0)
    if chi_over_h == 1e8:
        assert clipped >= 8


@pytest.mark.parametrize("series", [0.0, 1e-9])
@pytest.mark.parametrize("name", list(LAWS_CHANGES))
def test_a_clipped_contact_in_a_network_books_its_store(name, series):
    """The same in the step of an interface: pressed in by 0.9 um, and torn out in one step."""
    law = LAWS_CHANGES[name].flat()
    g0, e0 = -0.9e-6, 0.0
    contact, film, g1, e1, _, lost, film_loss = solve_interface(
        law.kind, law.parameters, 0, 1e8, 0.0, 0.0, 1e-7, 0.0, 20e-9, 1e-12, series,
        g0, -0.2e-6, e0, 0.0, 0, 0.0,
    )  # fmt: skip
    before = interface_store(law.kind, law.parameters, 0, series, g0, e0)
    after = interface_store(law.kind, law.parameters, 0, series, g1, e1)

    assert (contact, film, film_loss) == (0.0, 0.0, 0.0)
    assert before > after > 0.0
    assert lost == pytest.approx(before - after, rel=1e-12, abs=0.0)


SCHEMES = ["contact-stabilised-newmark", "massless"]
SPEED = 0.5


@cache
def problem():
    return sphere_over_cylinder(
        sphere_radius=2e-3, radius=4e-3, height=6e-3, size=25e-6, bulk=1.5e-3
    )


@cache
def run(scheme: str, step: float = 100e-9, axial_force: float = 0.0) -> FullOrderResult:
    a, b, space = problem()
    return simulate_full_order(
        a,
        b,
        space,
        speed=SPEED,
        duration=25e-6,
        step=step,
        scheme=scheme,
        axial_force=axial_force,
        energy_interval=1,
    )


def momentum(body: ElasticBody, velocity: np.ndarray) -> float:
    return float((body.M @ velocity)[1::2].sum())


@pytest.mark.parametrize("scheme", SCHEMES)
def test_impulse_is_the_change_of_momentum_of_both_bodies(scheme):
    a, b, _ = problem()
    result = run(scheme)
    history = result.history

    assert history.impulse > 0
    assert history.mass_a * np.diff(history.velocity_a[[0, -1]])[0] == pytest.approx(
        history.impulse, rel=1e-10
    )
    assert history.mass_b * np.diff(history.velocity_b[[0, -1]])[0] == pytest.approx(
        -history.impulse, rel=1e-10
    )
    # the recorded velocity fields carry the same momentum; the massless scheme moves the mass of
    # the contact nodes by part of an element
    rel = 1e-10 if scheme == "contact-stabilised-newmark" else 1e-5
    total = momentum(a, result.fields[0].end_velocity) + momentum(b, result.fields[1].end_velocity)
    assert total == pytest.approx(-history.mass_a * SPEED, rel=rel)


@pytest.mark.parametrize("step", [pytest.param(20e-9, marks=pytest.mark.slow), 100e-9, 400e-9])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_energy_balances_at_every_step(scheme, step):
    result = run(scheme, step)
    energy = result.energy

    assert np.max(np.abs(energy.residual)) < 1e-10 * energy.total[0]
    assert abs(result.history.ledger.residual) < 1e-10
    assert result.energy_loss == pytest.approx(
        result.history.ledger.contact_dissipation / energy.total[0], abs=1e-10
    )


def test_stabilised_scheme_never_gains_energy():
    """Deuflhard, Krause & Ertel 2008: both losses grow monotonically."""
    energy = run("contact-stabilised-newmark", 400e-9).energy
    scale = energy.total[0]

    assert np.all(np.diff(energy.contact) >= -1e-13 * scale)
    assert np.all(np.diff(energy.overshoot) >= -1e-13 * scale)
    assert np.max(np.diff(energy.total)) <= 1e-11 * scale  # round-off
    assert energy.contact[-1] + energy.overshoot[-1] > 1e-6 * scale


def test_end_fields_hold_the_recorded_energy():
    """v^T M v / 2 with the true velocity, M^-1 G^T y taken off."""
    a, b, _ = problem()
    result = run("contact-stabilised-newmark")

    for i, (body, field) in enumerate(zip((a, b), result.fields, strict=True)):
        kinetic = 0.5 * field.end_velocity @ (body.M @ field.end_velocity)
        strain = 0.5 * field.end_displacement @ (body.K @ field.end_displacement)
        assert kinetic == pytest.approx(result.energy.kinetic[-1, i], rel=1e-9)
        size = np.abs(field.end_displacement)
        round_off = np.finfo(float).eps * size @ (abs(body.K) @ size)  # of the terms of strain
        assert strain == pytest.approx(result.energy.strain[-1, i], rel=1e-9, abs=round_off)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_constant_force_is_booked_as_work(scheme):
    result = run(scheme, axial_force=-60.0)
    history = result.history

    total = history.impulse - 60.0 * history.force.size * history.step
    assert history.mass_a * (history.velocity_a[-1] + SPEED) == pytest.approx(total, rel=1e-9)
    assert result.energy.work[-1] != 0.0
    assert np.max(np.abs(result.energy.residual)) < 1e-10 * result.energy.total[0]


def test_forces_only_push_and_only_where_closed():
    result = run("contact-stabilised-newmark")
    history = result.history

    assert np.all(result.point_force >= 0)
    assert np.all(history.gap > -1e-12)
    assert np.all(history.gap[history.force > 1.0] < 30e-9)  # mean over a step of 0.5 m/s x 100 ns
    assert 0 < np.max((result.point_force > 0) @ result.area) < np.sum(result.area)
    assert result.pressure[result.peak_index].max() > 1e9
