"""CalculiX as a witness: the same mesh, the same matrices, the same impact.

Truth: CalculiX (ccx 2.20), an independent finite-element program, run here on klack's decks.
"""

from math import sqrt
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import block_diag, coo_array, csr_array, triu
from scipy.sparse.linalg import norm

from klack.acoustics.comparison import compare_histories
from klack.assembling.problem import build_problem
from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.case import find_case, load_case
from klack.case.schema import Case
from klack.contact.face_friction import FaceFriction
from klack.contact.friction import Friction
from klack.contact.history import ImpactHistory
from klack.contact.mortar import contact_space, touching_shift
from klack.contact.restitution import measure_impact
from klack.exchange.calculix_case import calculix_impact, calculix_settings
from klack.exchange.calculix_deck import (
    CalculixImpact,
    CalculixSettings,
    deck_lines,
    default_penalty,
    write_deck,
)
from klack.exchange.calculix_result import other_run, read_calculix
from klack.exchange.calculix_run import find_calculix, run_calculix
from klack.machine.progress import silent
from klack.materials.material import Material
from klack.transient.full_order import simulate_full_order
from klack.verification.lattice import lattice_mesh

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        find_calculix() is None, reason="CalculiX is not installed (apt-get install calculix-ccx)"
    ),
]

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
STORED = Path(__file__).parents[1] / "data" / "calculix_bars.dat"


def bar(name: str, family: str, low: float, high: float, *, crown: bool, held: bool) -> ElasticBody:
    """Bar of 1 mm x 1 mm, its bottom crowned like a sphere of 40 mm if asked."""

    def shape(x: np.ndarray) -> np.ndarray:
        y = x.copy()
        y[:, 2] += crown * (high - x[:, 2]) / (high - low) * (x[:, 0] ** 2 + x[:, 1] ** 2) / 40e-3
        return y

    line = np.linspace(-0.5e-3, 0.5e-3, 3)
    mesh = lattice_mesh(family, [line, line, np.linspace(low, high, 3)], shape)
    nodes = mesh.surface("bottom").nodes if held else ()
    return elastic_body(name, mesh, {"solid": STEEL}, fixed_nodes=nodes)


def two_bars(family: str) -> CalculixImpact:
    upper = bar("upper", family, 0.0, 2e-3, crown=True, held=False)
    lower = bar("lower", family, -1e-3, 0.0, crown=False, held=True)
    return CalculixImpact(
        title="Two bars",
        upper=upper,
        lower=lower,
        upper_surface=upper.mesh.surface("bottom"),
        lower_surface=lower.mesh.surface("top"),
        materials={"upper": {"solid": STEEL}, "lower": {"solid": STEEL}},
        speed=0.5,
    )


def wedge(name: str, *, width: float, crown: float, up: bool) -> ElasticBody:
    """Bar 0.2 mm thick with two flanks at 45 degrees, finer where they touch at x = 0.5 mm.

    The upper one (``up``) is free, its flanks crowned with a radius ``crown``; the lower one is
    held, its flanks are straight.
    """
    height, middle, size = 1.2e-3, 0.5e-3, 30e-6
    half = np.array([0.0, *(middle + size * np.arange(-3, 4)), width])
    across = np.concatenate([-half[:0:-1], half])
    depth = np.array([0.0, 1.2 * size, 3 * size, 6 * size, 0.4 * height, height])

    def shape(x: np.ndarray) -> np.ndarray:
        y = x.copy()
        flank = np.abs(x[:, 0])
        along = sqrt(2.0) * (flank - middle)
        flank = flank + (along**2 / (sqrt(2.0) * crown) if up else 0.0)
        y[:, 2] += (1.0 - np.abs(x[:, 2]) / height) * flank
        return y

    z = depth if up else -depth[::-1]
    mesh = lattice_mesh("hex20", [across, np.array([-0.1e-3, 0.1e-3]), z], shape)
    nodes = () if up else mesh.surface("bottom").nodes
    return elastic_body(name, mesh, {"solid": STEEL}, fixed_nodes=nodes)


def symmetric(file: Path) -> csr_array:
    row, column, value = np.loadtxt(file, unpack=True)
    A = coo_array((value, (row.astype(int) - 1, column.astype(int) - 1))).tocsr()
    return A + triu(A, 1).T if triu(A, 1).nnz else A + triu(A.T, 1)


# How far the matrices are apart in the Frobenius norm.  ccx integrates wedges with fewer points,
# and the mass of tetrahedra with 4 or 1 points where 14 or 5 are exact.
APART = [
    ("hex8", 1e-12, 1e-12),
    ("hex20", 1e-12, 1e-12),
    ("tet4", 1e-11, 0.4),
    ("tet10", 1e-11, 0.3),
    ("wedge6", 0.1, 0.4),
    ("wedge15", 0.02, 0.2),
]


@pytest.mark.parametrize(("family", "stiffness", "mass"), APART)
def test_matrices_are_those_of_calculix(family, stiffness, mass, tmp_path):
    impact = two_bars(family)
    lines = list(deck_lines(impact, CalculixSettings(step=1e-7, duration=1e-6, penalty=1e16)))
    first, last = lines.index("*SURFACE INTERACTION, NAME=CONTACT"), lines.index("*BOUNDARY")
    lines = lines[:first] + lines[last : last + 2]
    step = ["*STEP", "*FREQUENCY, SOLVER=MATRIXSTORAGE", "1", "*END STEP"]
    deck = tmp_path / "bars.inp"
    deck.write_text("\n".join([*lines, *step]) + "\n")

    run_calculix(deck, duration=1.0)

    places = [line.split(".") for line in (tmp_path / "bars.dof").read_text().split()]
    dofs = np.array([3 * (int(node) - 1) + int(axis) - 1 for node, axis in places])
    bodies = (impact.upper, impact.lower)
    K = block_diag([body.K for body in bodies]).tocsr()[dofs][:, dofs]
    M = block_diag([body.M for body in bodies]).tocsr()[dofs][:, dofs]
    # N/mm and tonnes
    assert norm(1e3 * symmetric(tmp_path / "bars.sti") - K) < stiffness * norm(K)
    assert norm(1e3 * symmetric(tmp_path / "bars.mas") - M) < mass * norm(M)


def test_the_stored_output_is_what_calculix_prints(tmp_path):
    deck = tmp_path / "bars.inp"
    settings = CalculixSettings(step=100e-9, duration=3.6e-6, penalty=2e16)
    write_deck(two_bars("hex20"), settings, deck)

    result = read_calculix(run_calculix(deck, duration=settings.duration).data)

    stored = read_calculix(STORED)
    # versions of ccx iterate a little differently
    np.testing.assert_allclose(result.force, stored.force, atol=1e-3 * stored.force.max())
    np.testing.assert_allclose(result.total_energy, stored.total_energy, rtol=1e-4)


def apart(reference: ImpactHistory, history: ImpactHistory, *, within: float) -> float:
    """Smallest rms difference of the forces over the peak, first touch moved by up to ``within``.

    A record of CalculiX ends at the very touch, so that round-off decides which one is the first.
    """
    start = [measure_impact(run).first_touch for run in (reference, history)]
    edges = np.arange(int(measure_impact(reference).contact_time / reference.step) + 2)

    def means(run: ImpactHistory, first: float) -> np.ndarray:
        gathered = np.append(0.0, np.cumsum(run.force) * run.step)
        at = first + edges * reference.step - run.start
        return np.diff(np.interp(at, np.arange(len(gathered)) * run.step, gathered))

    wanted = means(reference, start[0])
    shifts = np.linspace(-within, within, 41)
    off = [np.sqrt(np.mean((means(history, start[1] + s) - wanted) ** 2)) for s in shifts]
    return float(min(off) / reference.step / measure_impact(reference).peak_force)


def coarse_witness() -> Case:
    """The shipped case on 5 200 instead of 8 700 degrees of freedom."""
    case = load_case(find_case("witness"))
    bodies = {}
    for name, body in case.bodies.items():
        contact = body.mesh.contact.model_copy(update={"extent": 0.07e-3})
        sizes = {"size": 1e-3, "grading": 0.7, "contact": contact}
        bodies[name] = body.model_copy(update={"mesh": body.mesh.model_copy(update=sizes)})
    return case.model_copy(update={"bodies": bodies})


@pytest.mark.slow
def test_full_order_agrees_with_calculix(tmp_path):
    """Goal of the project: force history within 2 % of the peak; 200 ns are converged to 0.7 %."""
    case = coarse_witness()
    problem = build_problem(case, silent)
    problem.close()
    result = simulate_full_order(
        problem.pair.upper,
        problem.pair.lower,
        problem.space,
        speed=case.motion.speed,
        duration=case.run.duration,
        step=case.run.full_step,
    )
    impact = calculix_impact(case, silent)
    settings = calculix_settings(case, impact, step=200e-9, duration=9.2e-6)
    deck = tmp_path / "witness.inp"
    write_deck(impact, settings, deck)

    run = run_calculix(deck, duration=settings.duration, time_limit=600.0)

    other = other_run(read_calculix(run.data), result.history)
    off = compare_histories(other.history, result.history)
    assert off.history_l2 < 0.02
    assert abs(off.peak_force) < 0.01
    assert abs(off.restitution) < 0.002
    assert measure_impact(result.history).sub_contacts == 1
    assert other.energy_swing < 5e-3


@pytest.mark.slow
def test_faces_that_slip_lose_in_calculix_what_they_lose_in_klack(tmp_path):
    """Wedge in a groove of 45 degrees, friction 0.1: slip in, stick and slip back.

    Smooth, the restitution is 0.833 on this mesh, 0.05 above that with friction.
    """
    upper = wedge("wedge", width=1.0e-3, crown=8e-3, up=True)
    lower = wedge("groove", width=1.6e-3, crown=0.0, up=False)
    below = (lower.mesh, lower.mesh.surface("top"))
    lift = touching_shift(upper.mesh, upper.mesh.surface("bottom"), *below)
    upper = elastic_body("wedge", upper.mesh.moved(np.array([0.0, 0.0, lift])), {"solid": STEEL})
    faces = (upper.mesh, upper.mesh.surface("bottom"), *below)
    space = contact_space(*faces, reach=3e-6)
    result = simulate_full_order(
        upper,
        lower,
        space,
        speed=1.0,
        duration=2.4e-6,
        step=5e-9,
        friction=FaceFriction.between(Friction.coulomb(0.1), space, *faces),
    )
    impact = CalculixImpact(
        title="Wedge in a groove",
        upper=upper,
        lower=lower,
        upper_surface=faces[1],
        lower_surface=faces[3],
        materials={name: {"solid": STEEL} for name in ("wedge", "groove")},
        speed=1.0,
        friction=0.1,
    )
    settings = CalculixSettings(step=25e-9, duration=1.725e-6, penalty=default_penalty(impact))
    deck = tmp_path / "groove.inp"
    write_deck(impact, settings, deck)

    run = run_calculix(deck, duration=settings.duration, time_limit=300.0)

    other = other_run(read_calculix(run.data), result.history)
    off = compare_histories(other.history, result.history)
    assert apart(other.history, result.history, within=2 * settings.step) < 0.02
    assert abs(off.peak_force) < 0.02
    assert abs(off.impulse) < 0.005
    assert abs(off.restitution) < 0.01
    taken = result.history.ledger.friction / result.history.ledger.initial
    assert other.energy_swing == pytest.approx(taken, abs=0.01)
