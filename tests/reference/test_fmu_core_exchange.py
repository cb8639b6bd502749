"""Model exchange with CVODE of SUNDIALS against co-simulation in steps of 1 ns.

Both live in one FMU and share the forces of a state only: CVODE integrates the equations its own
way, with first touch and release as events.
"""

import numpy as np
import pytest
from c_compiler import needs_compiler

from klack.contact.laws import HertzLaw, HuntCrossley, LinearLaw, TableLaw
from klack.exchange.fmu.build import build_fmu
from klack.exchange.modal_model import Provenance, pair_model
from klack.network.rows import FilmRow
from klack.simulation.bodies import rigid_mass_body, rod_body
from klack.verification.one_dimension import one_contact

fmpy = pytest.importorskip("fmpy")
pytestmark = [pytest.mark.slow, needs_compiler]

STEEL = {"young": 2.1e11, "density": 7850.0}
STEP = 1e-9  # [s]
MADE = Provenance(case="rods", title="Rods", version="1", created="2026-01-01T00:00:00")
TABLE = TableLaw(np.array([0.2, 0.5, 1.0, 2.0]) * 1e-6, [20.0, 70.0, 190.0, 520.0])
FILM = FilmRow(cubic=5e-17, linear=4e-12, cut_off=0.3e-6, suction=2.0)
SPEED = 0.4  # [m/s]
ROD = rod_body("needle", length=0.03, area=1.2e-5, elastic_modes=4, damping=0.01, **STEEL)
BALL = rigid_mass_body("needle", 3e-3, port="bottom")

CASES = {
    "linear": (ROD, LinearLaw(1e9), 0.0, None),
    "table": (ROD, TABLE, 0.0, None),
    "in series": (ROD, TABLE, 1e-9, None),
    "Hunt-Crossley": (BALL, HuntCrossley(HertzLaw(1.5e12), 0.2), 0.0, None),
    "film": (ROD, TABLE, 0.0, FILM),
}


@pytest.mark.parametrize("name", CASES)
def test_cvode_agrees_with_fine_steps(name, tmp_path):
    upper, law, series, film = CASES[name]
    seat = rod_body("seat", length=0.05, area=6e-5, elastic_modes=8, support="bottom", **STEEL)
    model = pair_model(
        "rods",
        one_contact(upper, seat, law, gap=2e-6, series=series),
        moving="needle",
        contact_names=["seat"],
        films=(film,),
        speed=-SPEED,
        step=STEP,
        duration=4e-5,
        provenance=MADE,
    )
    path, names = build_fmu(model, tmp_path / "it.fmu", fmi=2), ["lift", "gap", "contact_force"]

    def run(kind, **more):
        found = fmpy.simulate_fmu(
            str(path),
            fmi_type=kind,
            stop_time=4e-5,
            output_interval=0.2e-6,
            output=names,
            record_events=False,
            **more,
        )
        return [np.asarray(found[name]) for name in ("time", *names)]

    time, lift, gap, force = run("ModelExchange", solver="CVode", relative_tolerance=1e-10)
    own_time, own_lift, own_gap, own_force = run("CoSimulation")

    assert time == pytest.approx(own_time)
    assert np.count_nonzero(own_force) > 30
    assert own_force[-1] == 0.0
    # the force of the last step of 1 ns is that of half a nanosecond before
    slack = np.max(np.abs(np.diff(own_force))) * 0.5 * STEP / 0.2e-6
    assert np.max(np.abs(force - own_force)) < 1e-4 * own_force.max() + slack
    assert force.max() == pytest.approx(own_force.max(), rel=1e-4)
    # in the step of release a film may pull a whole step instead of a part of it
    late = FILM.suction * STEP / (upper.mass * 0.5 * SPEED) if film else 0.0
    assert np.max(np.abs(lift - own_lift)) < (1e-6 + late) * np.max(np.abs(own_lift))
    assert np.max(np.abs(gap - own_gap)) < (1e-6 + late) * np.max(np.abs(own_gap))
