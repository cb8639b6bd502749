"""Truth: second law. What a restriction takes from the fluid and does not pass on is heat."""

import numpy as np
import pytest
from draws import each

from klack.hydraulics.annulus import Annulus
from klack.hydraulics.check_valve import CheckValve
from klack.hydraulics.conical_seat import ConicalSeat
from klack.hydraulics.flow_source import FlowSource
from klack.hydraulics.fluid_choice import FluidChoice
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.fluid_table import fluid_at, fluid_table
from klack.hydraulics.inertance import Inertance
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pipe_friction import PipeFriction
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_loss import PressureLoss
from klack.hydraulics.pulsating_flow import PulsatingFlow
from klack.hydraulics.pump import Pump
from klack.hydraulics.relief_valve import ReliefValve
from klack.hydraulics.seat import Seat
from klack.hydraulics.spool_edge import SpoolEdge
from klack.hydraulics.variable_orifice import VariableOrifice
from klack.network.rows import Ambient, Rows
from klack.network.step_function import evaluate

AMBIENT = Ambient()
FLUIDS = {
    "liquid": library_fluid("n-heptane").at(293.15),
    "with gas": library_fluid("n-heptane").at(293.15, gas_fraction=2e-3),
    "with Barus": FluidChoice(name="ISO VG 46", viscosity_law="barus").at(313.15),
    "with Roelands": FluidChoice(name="ISO VG 46", viscosity_law="roelands").at(313.15),
}
PARTS = {
    "orifice": Orifice(diameter=0.4e-3),
    "seat": Seat(
        shape="cone", diameter=1.5e-3, half_angle=0.8, land_width=0.1e-3, lift=5e-6, leak_area=1e-12
    ),
    "annulus": Annulus(diameter=4e-3, length=8e-3, clearance=6e-6, eccentricity=0.4),
    "inertance": Inertance(length=5e-3, diameter=1e-3),
    "pump": FlowSource(flow=3e-6),
    "check valve": CheckValve(cracking_pressure=1e4, open_pressure=3e5, area=1e-6, leak_area=1e-9),
    "relief valve": ReliefValve(
        set_pressure=3e5,
        rated_pressure=4e5,
        rated_flow=1e-5,
        area=2e-6,
        hysteresis=1e5,
        time_constant=1e-6,
        leak_area=1e-9,
    ),
    "spool edge": SpoolEdge(
        diameter=4e-3, radial_clearance=3e-6, overlap=20e-6, direction="closing", flow_force={}
    ),
    "notched edge": SpoolEdge(
        diameter=4e-3,
        radial_clearance=3e-6,
        overlap=20e-6,
        direction="closing",
        flow_force={"damping_length": 0.0},
        notches=[
            {"shape": shape, "count": 2, "width": 40e-6, "depth": 20e-6, "length": 30e-6}
            for shape in ("rectangular", "triangular", "round")
        ],
    ),
    "conical seat": ConicalSeat(
        half_angle=0.5,
        lower_diameter=1e-3,
        upper_diameter=2e-3,
        edge_diameter=1.5e-3,
        tip_half_angle=0.6,
        edge_radius=40e-6,
        land_width=50e-6,
        leak_area=1e-9,
        flow_force={},
    ),
    "conical seat that its faces follow": ConicalSeat(
        half_angle=0.5,
        lower_diameter=1e-3,
        upper_diameter=2e-3,
        edge_diameter=1.5e-3,
        tip_half_angle=0.6,
        chamfer_half_angle=0.55,
        chamfer_width=30e-6,
        leak_area=1e-9,
        tip_side="b",
    ),
    "pressure loss": PressureLoss(diameter=1e-3, coefficient=0.3, reverse_coefficient=2.0),
    "pipe friction": PipeFriction(length=0.3, diameter=1e-3, roughness=2e-6),
    "variable orifice": VariableOrifice(lift=[0.0, 40e-6], area=[1e-8, 1e-6]),
    "pump of pistons": Pump(displacement=1e-6, speed=20.0, pistons=7),
    "pulsation": PulsatingFlow(mean=3e-6, harmonics=[{"frequency": 1e3, "amplitude": 1e-6}]),
}
FACE = PressureFace(direction="opening", area=1e-6)
HANDLES = {"a": 1, "b": 2, "needle": 0, "spool": 0, "body": 1}


def balance(part, fluid, rng, count=300):
    """Power [W] that is lost, and its scale, for random pressures, motions and histories."""
    rows = Rows(
        ambient=AMBIENT, fluid=fluid, component="part", handles=HANDLES, partners={"b": (FACE,)}
    )
    part.add_rows(rows)
    row = rows.branches[0]
    table = fluid_table(fluid, AMBIENT.pressure)
    state, stores = row.state, 0.0
    lost, scale = [], []
    for _ in range(count):
        h = 10.0 ** rng.uniform(-8.5, -6.5)
        p = np.exp(rng.uniform(np.log(2e4), np.log(2e6), 2))
        y = rng.uniform(-10e-6, 50e-6, 2)
        moved = np.stack([y, y + h * rng.uniform(-1.0, 1.0, 2)], axis=1)
        (rho_a, _, g_a, _), (rho_b, _, g_b, _) = (fluid_at(table, x, 0) for x in p)
        forces = len(row.ports)
        status, out = evaluate(
            row.step,
            row.parameters,
            state,
            [0.0, h, *p, rho_a, rho_b, *moved[:forces].ravel()],
            3 + forces + row.state.size + len(row.books),
        )
        assert status == 0
        state = out[3 + forces : 3 + forces + row.state.size]
        work = float(out[3 : 3 + forces] @ np.diff(moved[:forces]).ravel())
        power = (g_a - g_b) * out[0] * h
        book = out[-1] if row.books else 0.0
        if row.books and row.books[0].kind == "store":
            book, stores = stores - book, book
        lost.append((power - work + book) / h)
        scale.append((abs(power) + abs(work) + abs(book)) / h)
    return np.array(lost), np.array(scale)


@pytest.mark.slow
@each("fluid", FLUIDS)
@each("name", PARTS)
def test_loss_is_never_negative(name, fluid):
    lost, scale = balance(PARTS[name], FLUIDS[fluid], np.random.default_rng(7))

    assert np.all(scale > 0.0)
    assert np.all(lost >= -1e-12 * scale)


@pytest.mark.slow
def test_pumps_and_a_column_without_friction_lose_nothing():
    rng = np.random.default_rng(8)
    smooth = Inertance(length=5e-3, diameter=1e-3, friction="none")
    for part in (*map(PARTS.get, ("pump", "pump of pistons", "pulsation")), smooth):
        lost, scale = balance(part, FLUIDS["with gas"], rng)

        # differences of stores: 1e-16 of the largest kinetic energy
        assert np.max(np.abs(lost)) <= 1e-12 * np.max(scale)


def test_annulus_loses_leakage_and_shear_and_nothing_else():
    guide, fluid = PARTS["annulus"], FLUIDS["liquid"]
    rows = Rows(ambient=AMBIENT, fluid=fluid, component="guide", handles=HANDLES)
    guide.add_rows(rows)
    row = rows.branches[0]
    viscosity = float(fluid.viscosity(AMBIENT.pressure))
    h, drop, needle, body = 2e-8, 3e5, 0.7, -0.2
    inputs = [0.0, h, 4e5, 1e5, 700.0, 700.0, 0.0, needle * h, 0.0, body * h]

    _, out = evaluate(row.step, row.parameters, [], inputs, 5)

    heat = drop * out[0] / 700.0 - out[3] * needle - out[4] * body
    exact = guide.conductance(viscosity) * drop**2 + guide.drag(viscosity) * 0.9**2
    assert heat == pytest.approx(exact, rel=1e-12)
