"""Energy of an FMU in co-simulation: modal energies, contact and work of the force from outside."""

import numpy as np
import pytest
from c_compiler import needs_compiler

from klack.contact.laws import TableLaw
from klack.exchange.fmu.build import build_fmu
from klack.exchange.modal_model import Provenance, pair_model
from klack.simulation.bodies import rod_body
from klack.verification.one_dimension import one_contact

fmpy = pytest.importorskip("fmpy")
pytestmark = [pytest.mark.slow, needs_compiler]

STEEL = {"young": 2.1e11, "density": 7850.0}
TABLE = TableLaw(np.array([0.2, 0.5, 1.0, 2.0]) * 1e-6, [20.0, 70.0, 190.0, 520.0])
MADE = Provenance(case="rods", title="Rods", version="1", created="2026-01-01T00:00:00")


@pytest.mark.parametrize("internal_step", [20e-9, 200e-9])
def test_energy_is_kept_at_any_internal_step(internal_step, tmp_path):
    """20 N over the mass: its work is the force times the way of the centre of mass."""
    needle = rod_body("needle", length=0.03, area=1.2e-5, elastic_modes=8, **STEEL)
    seat = rod_body("seat", length=0.05, area=6e-5, elastic_modes=12, support="bottom", **STEEL)
    model = pair_model(
        "rods",
        one_contact(needle, seat, TABLE, gap=0.3e-6),
        moving="needle",
        contact_names=["seat"],
        speed=-0.4,
        step=internal_step,
        duration=6e-5,
        provenance=MADE,
    )
    states = [f"{kind}_{name}" for kind in "qv" for name in model.mode_names]

    found = fmpy.simulate_fmu(
        str(build_fmu(model, tmp_path / "it.fmu", fmi=2)),
        fmi_type="CoSimulation",
        stop_time=6e-5,
        output_interval=1e-6,
        start_values={"force": -20.0},
        output=["lift", "gap", "contact_force", *states],
    )

    q, v = np.split(np.column_stack([found[name] for name in states]), 2, axis=1)
    energy = 0.5 * np.sum(v**2 + (model.omega * q) ** 2, axis=1)
    energy += TABLE.potential(-found["gap"]) + 20.0 * (found["lift"] - found["lift"][0])
    assert found["contact_force"].max() > 100.0
    assert TABLE.potential(-found["gap"]).max() > 0.2 * energy[0]
    # a step accepts errors of the force of 1e-11 of it
    assert energy == pytest.approx(energy[0], rel=1e-12)
