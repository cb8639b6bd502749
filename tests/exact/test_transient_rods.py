"""Impacts at full order: rods, damping, sliding.

Impacts of rods against the one-dimensional wave equation (St Venant; Goldsmith 1960, ch. 2).

A front is smeared by the dispersion of the elements over a number of elements that grows with their
number to the power 1/3, so contact time and restitution hold to about 1 % only, while the plateau
behind the front is exact.

Damping of the full order against the damped modes themselves (exact for a linear free decay).

A trapezoidal step maps the coordinate q of a damped mode and its velocity exactly as

    (1 - h/2 B)^-1 (1 + h/2 B),    B = [[0, 1], [-omega^2, -2 zeta omega]]

so that after separation every mode of a body has to follow that map, to round-off.

A long bar with a non-reflecting end.

Truth: exact, the wave of St Venant.  In a bar without lateral strain a dashpot of rho c A at the
end takes the whole wave; with lateral strain the front, which is short, comes back in part.
Conservation: what leaves is booked, and the balance closes.

A rigid block that slides on a rigid plane (exact): Coulomb's law in textbook form.
"""

import warnings
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import csr_array

from klack.analyses.impact.run import run_impact
from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.reduction.damping import Damping, LossFactor, ModalDamping, RayleighDamping
from klack.case import read_case
from klack.cli.main import main
from klack.contact.face_friction import FaceFriction
from klack.contact.friction import Friction
from klack.contact.mortar import ContactSpace
from klack.errors import InputError
from klack.mesh.mesh import Mesh
from klack.transient.body_damping import body_damping
from klack.transient.full_order import Scheme, simulate_full_order
from klack.transient.result import FullOrderResult
from klack.verification.transient import (
    STEEL,
    blocked_bar,
    drop_rod,
    plateau,
    rod_body,
    rod_contact,
)

SPEED = 0.5
AREA = 1e-4
IMPEDANCE = STEEL.density * STEEL.bar_wave_speed * AREA
SCHEMES = ["contact-stabilised-newmark", "massless"]


@pytest.mark.parametrize("scheme", SCHEMES)
def test_rod_on_rigid_wall(scheme):
    """F = Z v, T = 2 L / c, e = 1."""
    length = 0.03
    duration = 2 * length / STEEL.bar_wave_speed

    run = drop_rod(length, elements=200, scheme=scheme)

    touching = np.count_nonzero(run.history.force > 0) * run.history.step
    assert plateau(run, duration) == pytest.approx(IMPEDANCE * SPEED, rel=1e-5)
    assert touching == pytest.approx(duration, rel=1e-2)
    assert run.history.velocity_a[-1] == pytest.approx(SPEED, rel=1.5e-2)
    assert run.history.velocity_a[-1] < SPEED


@pytest.mark.slow
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("ratio", [1.0, 2.0])
def test_two_rods_part_with_the_ratio_of_their_lengths(ratio, scheme):
    """F = Z v / 2 and e = L1 / L2 (equal lengths exchange their velocities)."""
    length = 0.02

    run = drop_rod(length, ratio * length, elements=200, scheme=scheme)

    history = run.history
    parting = (history.velocity_a[-1] - history.velocity_b[-1]) / SPEED
    force = plateau(run, 2 * length / STEEL.bar_wave_speed)
    assert force == pytest.approx(IMPEDANCE * SPEED / 2, rel=1e-5)
    assert parting == pytest.approx(1.0 / ratio, rel=2e-2)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_constant_force_in_flight(scheme):
    """Displacement -v t + F t^2 / 2 m, uniform over the body."""
    rod = rod_body("rod", STEEL, area=AREA, length=0.02, elements=10)
    force, duration = -40.0, 2e-6

    run = simulate_full_order(
        rod,
        None,
        rod_contact(rod, None, area=AREA, gap=1e-3),
        speed=SPEED,
        duration=duration,
        step=0.1e-6,
        axial_force=force,
        scheme=scheme,
    )

    mass = STEEL.density * AREA * 0.02
    moved = -SPEED * duration + force * duration**2 / (2 * mass)
    assert not np.any(run.history.force)
    assert run.fields[0].end_displacement == pytest.approx(np.full(11, moved), rel=1e-10)
    assert run.history.velocity_a[-1] == pytest.approx(-SPEED + force * duration / mass, rel=1e-12)


def test_flight_to_the_first_touch_is_skipped():
    """The clock keeps counting from the placement: touch at gap / speed."""
    rod = rod_body("rod", STEEL, area=AREA, length=0.02, elements=20)
    step, gap = 0.1e-6, 10e-6

    run = simulate_full_order(
        rod,
        None,
        rod_contact(rod, None, area=AREA, gap=gap),
        speed=SPEED,
        duration=3e-6,
        step=step,
    )

    first = run.history.time[np.argmax(run.history.force > 0)]
    assert run.history.start > 0.9 * gap / SPEED
    assert first == pytest.approx(gap / SPEED, abs=step)


LENGTH, SPEED_DAMPING, KEPT = 0.03, 0.5, 6
PERIOD = 2 * LENGTH / STEEL.bar_wave_speed
STEP = PERIOD / 100
DAMPINGS = {
    "modal": ModalDamping(ratio=0.05),
    "loss factor": LossFactor(eta=0.02),
    "Rayleigh": RayleighDamping(alpha=4e3, beta=2e-8),
}


@cache
def bar() -> tuple[ElasticBody, ContactSpace]:
    """A free bar, axisymmetric, over a rigid wall."""
    blocked, space = blocked_bar(LENGTH, 2e-3, 12, STEEL)
    return elastic_body("bar", blocked.mesh, {"solid": STEEL}), space


@cache
def modes() -> Modes:
    """Every elastic mode, dense."""
    body = bar()[0]
    grid = np.ix_(body.free, body.free)
    squares, vectors = eigh(body.K.toarray()[grid], body.M.toarray()[grid])
    shapes = np.zeros((body.dof_count, len(squares)))
    shapes[body.free] = vectors
    return Modes(np.sqrt(squares[1:]), shapes[:, 1:])  # the first one is rigid


def run(
    damping: Damping, duration: float, scheme: Scheme = "contact-stabilised-newmark"
) -> FullOrderResult:
    body, space = bar()
    kept = Modes(modes().omega[:KEPT], modes().shapes[:, :KEPT])
    return simulate_full_order(
        body,
        None,
        space,
        speed=SPEED_DAMPING,
        duration=duration,
        step=STEP,
        scheme=scheme,
        damping=(body_damping(damping, kept), None),
        energy_interval=1,
    )


def coordinates(result: FullOrderResult) -> np.ndarray:
    """Modal coordinates and velocities at the end, shape (2, m)."""
    weighted = bar()[0].M @ modes().shapes
    fields = result.fields[0]
    return np.array([weighted.T @ fields.end_displacement, weighted.T @ fields.end_velocity])


def stepped(state: np.ndarray, omega: np.ndarray, zeta: np.ndarray, steps: int) -> np.ndarray:
    """The map above, mode by mode."""
    out = np.empty_like(state)
    for i, (w, z) in enumerate(zip(omega, zeta, strict=True)):
        B = np.array([[0.0, 1.0], [-(w**2), -2 * z * w]])
        one = np.linalg.solve(np.eye(2) - STEP / 2 * B, np.eye(2) + STEP / 2 * B)
        out[:, i] = np.linalg.matrix_power(one, steps) @ state[:, i]
    return out


@pytest.mark.slow
@pytest.mark.parametrize("name", DAMPINGS)
def test_every_mode_decays_as_its_damping_says(name):
    """Kept modes with their ratio, the others without; Rayleigh damping all of them."""
    damping, steps = DAMPINGS[name], 300
    apart = run(damping, 2 * PERIOD)
    later = run(damping, 2 * PERIOD + steps * STEP)
    assert later.history.force.max() > 0.0
    assert later.history.force[-steps - 1 :].max() == 0.0

    omega = modes().omega
    zeta = damping.ratios(omega)
    if name != "Rayleigh":
        zeta = np.where(np.arange(len(omega)) < KEPT, zeta, 0.0)
    expected = stepped(coordinates(apart), omega, zeta, steps)
    found = coordinates(later)
    scale = np.max(np.hypot(omega * expected[0], expected[1]))
    assert np.max(np.abs(omega * (found[0] - expected[0]))) < 1e-8 * scale  # 300 steps of round-off
    assert np.max(np.abs(found[1] - expected[1])) < 1e-8 * scale


@pytest.mark.parametrize("name", DAMPINGS)
def test_damping_leaves_rigid_motion_alone(name):
    """The bar flies on with its velocity, although ``alpha M`` alone would slow it down."""
    velocity = run(DAMPINGS[name], 8 * PERIOD).history.velocity_a
    assert velocity[-1] > 0.1 * SPEED_DAMPING
    assert velocity[-1] == pytest.approx(velocity[len(velocity) // 2], rel=1e-9)


@pytest.mark.parametrize("scheme", ["contact-stabilised-newmark", "massless"])
@pytest.mark.parametrize("name", DAMPINGS)
def test_energy_taken_by_damping_is_booked_in_every_step(name, scheme):
    result = run(DAMPINGS[name], 2 * PERIOD, scheme)
    energy = result.energy

    assert np.max(np.abs(energy.residual)) < 1e-10 * energy.total[0]  # as without damping
    assert np.all(np.diff(energy.damping) >= 0.0)
    assert result.history.ledger.damping == energy.damping[-1] > 1e-3 * energy.total[0]
    assert abs(result.history.ledger.residual) < 1e-10


@pytest.mark.parametrize("scheme", ["contact-stabilised-newmark", "massless"])
def test_a_spring_gives_and_takes_what_is_booked(scheme):
    """Momentum and energy of a damped bar that a stiff spring holds back, to round-off."""
    body, space = bar()
    kept = Modes(modes().omega[:KEPT], modes().shapes[:, :KEPT])
    result = simulate_full_order(
        body,
        None,
        space,
        speed=SPEED_DAMPING,
        duration=3 * PERIOD,
        step=STEP,
        scheme=scheme,
        axial_force=-5.0,
        spring_stiffness=1e7,
        damping=(body_damping(DAMPINGS["modal"], kept), None),
        energy_interval=1,
    )
    history = result.history
    pushed = (history.force.sum() + history.external_force.sum()) * STEP
    gained = history.mass_a * (history.velocity_a[-1] + SPEED_DAMPING)
    assert gained == pytest.approx(pushed, rel=1e-9)
    assert np.ptp(history.external_force) > 10.0
    assert np.max(np.abs(result.energy.residual)) < 1e-10 * result.energy.total[0]
    assert history.ledger.spring == result.energy.spring[-1] != 0.0


def test_no_damping_is_no_matrix():
    assert body_damping(ModalDamping(ratio=0.0), modes()) is None
    assert body_damping(RayleighDamping(alpha=0.0, beta=0.0), modes()) is None


ROD = (Path(__file__).parents[1] / "data" / "struck_rod.yaml").read_text(encoding="utf-8")
OPEN = ROD.replace("\n  bar:\n", "\n  bar:\n    non_reflecting: far\n")
LONG = OPEN.replace("duration: 32 us", "duration: 60 us")
SPEED_OF_WAVES = np.sqrt(210e9 / 7850.0)


def full(text: str):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        study = run_impact(read_case(text, Path("case.yaml")), levels=["full"], certify=False)
    return study.levels["full"]


def echo(level) -> float:
    """Energy of the wave that comes back over that of the wave that went."""
    gauge = level.gauges[0]
    c = SPEED_OF_WAVES
    # past the gauge at 60 mm until 140 mm / c; the echo from 120 mm passes it from 180 mm / c on
    gone = gauge.time < 160e-3 / c
    back = (gauge.time > 162e-3 / c) & (gauge.time < 265e-3 / c)
    return float(np.sum(gauge.exact[back] ** 2) / np.sum(gauge.exact[gone] ** 2))


@pytest.mark.slow
def test_a_wave_in_a_bar_leaves_through_the_end():
    closed, open_end = full(LONG.replace("    non_reflecting: far\n", "")), full(LONG)

    assert echo(closed) > 0.9  # the free end returns it all
    assert echo(open_end) < 1e-4
    ledger = open_end.history.ledger
    given = 0.5 * open_end.history.mass_a * 1.0**2
    # equal bars: the striker stops and all of its energy is in the wave; the mesh keeps a ripple
    assert ledger.radiated == pytest.approx(given, rel=0.01)
    assert open_end.energies["through non-reflecting ends"] == ledger.radiated
    assert abs(ledger.residual) < 1e-9
    assert closed.history.ledger.radiated == 0.0


@pytest.mark.slow
def test_with_lateral_strain_a_long_pulse_leaves():
    """Pulse of 80 mm in a bar of 4 mm: its length over the radius is 40."""
    assert echo(full(LONG.replace("poisson: 0.0", "poisson: 0.3"))) < 1e-3


@pytest.mark.slow
def test_a_bar_without_end_does_not_move_as_a_whole():
    level = full(OPEN)

    assert level.history.mass_b == np.inf
    assert np.all(level.history.velocity_b == 0.0)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("levels: [full]", "levels: [reduced, full]", "only the level full"),
        ("non_reflecting: far", "non_reflecting: end", "another surface"),
        ("non_reflecting: far", "non_reflecting: tip", "surface of bar"),
        ("  striker:\n", "  striker:\n    non_reflecting: far\n", "the body that is hit"),
    ],
)
def test_ends_that_cannot_be(old, new, text):
    with pytest.raises(InputError, match=text):
        read_case(OPEN.replace(old, new, 1), Path("case.yaml"))


@pytest.mark.parametrize(
    "command", [["impact", "--level", "reduced"], ["reduce"], ["advise"], ["noise"]]
)
def test_what_has_only_modes_says_which_level_to_use(tmp_path, capsys, command):
    case = tmp_path / "case.yaml"
    case.write_text(OPEN, encoding="utf-8")

    assert main([command[0], str(case), *command[1:]]) == 2
    assert "klack impact with --level full" in " ".join(capsys.readouterr().err.split())


MASS, PRESS, STEP_SLIDING = 0.01, 20.0, 1e-6
SIDEWAYS = (0.03, -0.04)
SPEED_SLIDING = float(np.hypot(*SIDEWAYS))


def block() -> ElasticBody:
    """A solid of one node: three displacements, no stiffness."""
    return ElasticBody(
        name="block",
        mesh=Mesh(points=np.zeros((1, 3)), blocks=()),
        K=csr_array((3, 3)),
        M=csr_array(MASS * np.eye(3)),
        fixed=np.empty(0, dtype=np.int64),
    )


def slide(law: Friction, duration: float, body: ElasticBody | None = None, **options):
    """Along x and y, pressed against the plane z = 0."""
    body = body or block()
    along = csr_array(np.eye(3)[:2])
    space = ContactSpace(
        G_a=csr_array(np.eye(3)[2:]),
        G_b=csr_array((1, 3)),
        gap=np.zeros(1),
        area=np.array([1e-6]),
        points=np.zeros((1, 3)),
        axial=np.ones(1),
        rim=np.zeros(1, dtype=bool),
        size=np.array([1e-3]),
        slave="a",
        nodes=np.zeros(1, dtype=np.int64),
        reach=0.0,
        clearance=0.0,
        entry=np.zeros(1),
    )
    given = {
        "speed": 1e-9,
        "step": STEP_SLIDING,
        "axial_force": -PRESS,
        "across": np.array([*SIDEWAYS, 0.0, 0.0, 0.0, 0.0]),
    } | options
    return simulate_full_order(
        body,
        None,
        space,
        duration=duration,
        energy_interval=1,
        friction=FaceFriction(law=law, T_a=along, T_b=csr_array((2, 3))),
        **given,
    )


@pytest.mark.slow
def test_it_slows_down_by_mu_times_the_impulse_against_its_way():
    """Velocity times mass falls by mu times the normal impulse."""
    result = slide(Friction.coulomb(0.2), 50e-6)
    lost = 0.2 * result.history.impulse / MASS
    expected = np.array(SIDEWAYS) * (1.0 - lost / SPEED_SLIDING)
    assert 0.2 < lost / SPEED_SLIDING < 0.9
    np.testing.assert_allclose(result.fields[0].end_velocity[:2], expected, rtol=1e-10)
    energy = result.energy
    gone = 0.5 * MASS * (SPEED_SLIDING**2 - (SPEED_SLIDING - lost) ** 2)
    assert energy.friction[-1] == pytest.approx(gone, rel=1e-6)


@pytest.mark.slow
def test_it_stops_where_its_energy_is_spent():
    """After v^2 m / (2 mu F), to the step; then it holds, with less than mu times the force."""
    result = slide(Friction.coulomb(0.2), 300e-6)
    way = result.fields[0].end_displacement[:2]
    length = SPEED_SLIDING**2 * MASS / (2.0 * 0.2 * PRESS)
    np.testing.assert_allclose(
        way, length * np.array(SIDEWAYS) / SPEED_SLIDING, atol=SPEED_SLIDING * STEP_SLIDING
    )
    later = slide(Friction.coulomb(0.2), 400e-6)
    np.testing.assert_allclose(later.fields[0].end_displacement[:2], way, rtol=1e-12)
    kinetic = 0.5 * MASS * SPEED_SLIDING**2
    assert result.energy.friction[-1] == pytest.approx(kinetic, rel=1e-3)


@pytest.mark.slow
def test_the_coefficient_follows_the_speed_of_slip():
    """Stribeck's curve: m dv/dt = -mu(v) F, in a hundred parts of each step."""
    law = Friction(kinetic=0.1, static=0.4, speed=0.05)
    result = slide(law, 50e-6)
    v, parts = SPEED_SLIDING, 100
    for force in result.history.force:
        for _ in range(parts):
            v -= float(law.coefficient(np.array(v))) * force * STEP_SLIDING / MASS / parts
    found = float(np.hypot(*result.fields[0].end_velocity[:2]))
    kinetic_only = SPEED_SLIDING - 0.1 * result.history.impulse / MASS
    assert found == pytest.approx(v, rel=0.02)
    assert kinetic_only > 1.3 * v


def test_a_plane_across_which_nothing_can_move_is_refused():
    held = block()
    held = ElasticBody(
        name="held", mesh=held.mesh, K=held.K, M=held.M, fixed=np.array([0, 1], dtype=np.int64)
    )
    with pytest.raises(InputError, match="cannot move across"):
        slide(Friction.coulomb(0.2), 5e-6, held, across=np.zeros(6))
    with pytest.raises(InputError, match="held sideways"):
        slide(Friction.coulomb(0.2), 5e-6, held)
