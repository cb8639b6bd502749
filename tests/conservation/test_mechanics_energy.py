"""Every mechanical element keeps its books: work + change of stores = supplies - losses."""

import numpy as np
import pytest
from draws import each
from numpy.typing import NDArray

from klack.hydraulics.fluid import Fluid
from klack.hydraulics.liquid import Murnaghan
from klack.hydraulics.mixture import Vapour
from klack.hydraulics.unsteady_drag import UnsteadyDrag
from klack.mechanics.force import ConstantForce, ForceOverTime
from klack.mechanics.force_over_stroke import ForceOverStroke
from klack.mechanics.gravity import Gravity
from klack.mechanics.lugre_friction import LuGreFriction
from klack.mechanics.nonlinear_spring import NonlinearSpring
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.rubber_stop import MaxwellElement, RubberStop
from klack.mechanics.spring import Spring
from klack.mechanics.surging_spring import SurgingSpring
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import ElementRow
from klack.network.step_function import evaluate

pytestmark = pytest.mark.filterwarnings("ignore::klack.network.checks.LooseBodyWarning")

PARTS = {
    "spring": Spring(stiffness=5e3, preload=20.0),
    "stiff spring": Spring(stiffness=1e9, preload=-3.0),
    "damped spring": Spring(stiffness=5e3, preload=20.0, damping=0.5),
    "constant force": ConstantForce(force=-15.0),
    "force over time": ForceOverTime(time=(0.0, 5e-6, 9e-6), force=(0.0, 50.0, -20.0)),
    "force over stroke": ForceOverStroke(
        stroke=(-20e-6, 0.0, 30e-6, 80e-6), force=(5.0, -12.0, 3.0, 40.0)
    ),
    "gravity": Gravity(inclination=0.3),
    "cubic spring": NonlinearSpring(
        stiffness=5e3, higher=(0.1, 2.0), reference=50e-6, start=30e-6, damping=0.3
    ),
    "disc spring": NonlinearSpring(
        deflection=(-50e-6, 0.0, 40e-6, 90e-6, 130e-6), force=(-9.0, 0.0, 7.0, 6.0, 11.0)
    ),
    "surging spring": SurgingSpring(stiffness=5e3, preload=20.0, mass=1e-3, modes=4, damping=0.01),
    "LuGre friction": LuGreFriction(coulomb=0.5, breakaway=0.8, bristle_stiffness=1e5, viscous=0.1),
    "elasto-plastic friction": LuGreFriction(
        coulomb=0.5, breakaway=0.8, bristle_stiffness=1e5, elastic_share=0.7
    ),
    "sphere in a liquid": UnsteadyDrag(shape="sphere", radius=1e-3),
    "sphere in a flow": UnsteadyDrag(shape="sphere", radius=1e-3, typical_speed=1.0),
    "layer of liquid": UnsteadyDrag(shape="layer", area=1e-4, height=50e-6),
    "rubber stop": RubberStop(
        gap=-5e-6,
        stiffness=1e6,
        higher=(0.0, 3.0),
        reference=50e-6,
        maxwell=(
            MaxwellElement(stiffness=1e6, time=1e-6),
            MaxwellElement(stiffness=2e6, time=1e-4),
            MaxwellElement(stiffness=2e6, time=1e-12),
        ),
    ),
}


LIQUID = Fluid(
    name="oil",
    temperature=293.15,
    liquid=Murnaghan(density_at_reference=900.0, bulk_modulus_at_reference=1e9),
    base_viscosity=0.01,
    vapour=Vapour(pressure=10.0, density=1e-3),
)


def row_of(part: Component) -> ElementRow:
    """Row of a component between a needle and, if it has a second port, a housing."""
    first, *second = part.port_kinds()
    bodies = {"needle": RigidMass(mass=3e-3), "housing": RigidMass(mass=0.1)}
    connections = [["needle.body", f"part.{first}"]]
    connections += [["housing.body", f"part.{port}"] for port in second]
    return Network({**bodies, "part": part}, connections, fluid=LIQUID).rows().elements[0]


def balance(
    row: ElementRow, step: NDArray, places: NDArray
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Residual and losses of every step along given displacements; largest term of the books."""
    ports, states = len(row.ports), len(row.state)
    signs = {"store": 0.0, "supply": -1.0, "loss": 1.0}
    kinds = np.array([signs[book.kind] for book in row.books])
    stores = np.array([book.kind == "store" for book in row.books])
    outputs, state = ports + states + len(row.books), row.state

    def call(t: float, h: float, y0: NDArray, y1: NDArray) -> NDArray[np.float64]:
        inputs = [t, h, *np.column_stack([y0, y1]).ravel()]
        status, out = evaluate(row.step, row.parameters, state, inputs, outputs)
        assert status == 0
        return out

    held = call(0.0, 0.0, places[0], places[0])[ports + states :] * stores
    t, residual, losses, largest = 0.0, [], [], 0.0
    for h, y0, y1 in zip(step, places[:-1], places[1:], strict=True):
        out = call(t, h, y0, y1)
        state, books = out[ports : ports + states], out[ports + states :]
        terms = [*out[:ports] * (y1 - y0), *books, *held]
        losses.append(books[kinds == 1.0].sum())
        residual.append(sum(terms[:ports]) + stores @ books - held.sum() + kinds @ books)
        largest = max(largest, *np.abs(terms))
        held, t = books * stores, t + h
    return np.array(residual), np.array(losses), largest


@pytest.mark.slow
@each("name", PARTS)
@each("ways", ["long", "short"])
def test_books_balance_to_round_off_on_any_way(name, ways):
    rng = np.random.default_rng(7)
    size = 60e-6 if ways == "long" else 1e-9  # [m] per step; a stroke, and a step of 20 ns
    row = row_of(PARTS[name])
    jumps = rng.normal(0.0, size, (400, len(row.ports)))
    places = np.cumsum(jumps, axis=0) if ways == "short" else jumps

    residual, losses, largest = balance(row, rng.uniform(10e-9, 30e-9, 399), places)

    assert largest > 0.0
    assert np.abs(residual).max() <= 2e-15 * largest  # some roundings of the largest term
    assert np.all(losses >= 0.0)


@pytest.mark.parametrize("name", PARTS)
def test_a_step_of_no_length_reads_the_stores_only(name):
    row = row_of(PARTS[name])
    places = np.full((2, len(row.ports)), 12e-6)

    residual, losses, _ = balance(row, np.zeros(1), places)

    assert np.all(np.isfinite(residual))
    assert residual == pytest.approx(0.0, abs=1e-20)
    assert np.all(losses == 0.0)


MASSLESS = [
    name
    for name, part in PARTS.items()
    if len(part.port_kinds()) == 2 and not isinstance(part, SurgingSpring)
]


@pytest.mark.parametrize("name", MASSLESS)
def test_what_pushes_one_end_pushes_back_at_the_other(name):
    row = row_of(PARTS[name])
    inputs = [0.0, 20e-9, -1e-6, -1.5e-6, 0.2e-6, 0.1e-6]

    outputs = 2 + len(row.state) + len(row.books)
    _, out = evaluate(row.step, row.parameters, row.state, inputs, outputs)

    assert out[0] != 0.0
    assert out[0] == -out[1]
