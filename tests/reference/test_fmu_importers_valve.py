"""Truth: klack's network solver runs bodies and end stops of a valve; fmpy runs their FMU.

Without films, or without series compliances, the same model has model exchange, and CVode of
SUNDIALS runs it.
"""

from dataclasses import replace

import numpy as np
import pytest
from c_compiler import needs_compiler

from klack.assembling.valve import build_valve
from klack.case import find_case
from klack.case.any_case import load_any_case
from klack.contact.laws import HuntCrossley
from klack.exchange.case_models import case_models
from klack.exchange.fmu.build import build_fmu
from klack.mechanics.force import ConstantForce
from klack.network.network import Network
from klack.simulation.network_run import simulate_network

fmpy = pytest.importorskip("fmpy")
validation = pytest.importorskip("fmpy.validation")
pytestmark = [pytest.mark.slow, needs_compiler]

OPENING = ("contact_force_opening", "peak_contact_force_opening")
FORCE, DURATION = 20.0, 3e-4  # [N] opening, on the spring face; one impact on the opening stop


@pytest.fixture(scope="module")
def case():
    return load_any_case(find_case("demo-stroke"))


@pytest.fixture(scope="module")
def pair(case):
    return case_models(case).pair


def native(case, step):
    """Flexible bodies and end stops of the valve alone, pushed by a constant force."""
    valve = build_valve(case)
    parts = {
        name: part
        for name, part in valve.network.components.items()
        if part.type in ("flexible-body", "end-stop")
    }
    joined = [
        [port for port in ports if port.split(".")[0] in parts]
        for ports in valve.network.connections
    ]
    joined = [ports + ["drive.end"] * ("needle.spring_face" in ports) for ports in joined]
    network = Network(
        parts | {"drive": ConstantForce(force=FORCE)},
        [ports for ports in joined if len(ports) > 1],
        fluid=valve.network.fluid,
    )
    return simulate_network(
        network.rows(), duration=DURATION, step=step, coarse=1, record=1e-6, start="free"
    )


def by_fmu(path, kind, **more):
    return fmpy.simulate_fmu(
        str(path),
        fmi_type=kind,
        stop_time=DURATION,
        start_values={"force_spring_face": FORCE} | more.pop("start_values", {}),
        output=[*("velocity", "lift", "gap_opening"), *OPENING],
        **more,
    )


@pytest.mark.parametrize("share", [1, 4])
def test_co_simulation_with_films_is_the_native_network(case, pair, tmp_path, share):
    """The same steps up to the release, which the network cuts and the FMU takes in one step."""
    pair = replace(pair, step=pair.step / share)
    run = native(case, pair.step)
    path = build_fmu(pair, tmp_path / "v.fmu", fmi=2, platforms=("linux64",))
    found = by_fmu(path, "CoSimulation", step_size=1e-6, output_interval=1e-6)
    record = run.interfaces["opening"]
    leaving = run.time > record.time[record.contact_force.argmax()]

    assert record.contact_force.max() > 500.0  # the needle has hit its stop
    # the same steps with other sums of round-off, which an impact enlarges
    assert found["peak_contact_force_opening"].max() == pytest.approx(
        record.contact_force.max(), rel=1e-9
    )
    velocity = run.channels["needle velocity"].values
    gap = run.channels["opening gap"].values
    # m/s, m; 6.4e-6 m/s was seen after it, which is a gap in the time that is left
    for here, speed, way in ((~leaving, 1e-7, 1e-13), (leaving, 1.5e-5 / share, 5e-9 / share)):
        pairs = (found["velocity"][here], velocity[here]), (found["gap_opening"][here], gap[here])
        for two, left in zip(pairs, (speed, way), strict=True):
            np.testing.assert_allclose(*two, rtol=0.0, atol=left)


@pytest.mark.parametrize("fmi", [2, 3])
def test_films_in_series_leave_co_simulation_alone(pair, tmp_path, fmi):
    path = build_fmu(pair, tmp_path / "v.fmu", fmi=fmi, platforms=("linux64",))
    description = fmpy.read_model_description(str(path))

    assert validation.validate_fmu(str(path)) == []
    assert description.modelExchange is None
    assert description.coSimulation is not None


def dry(contact):
    return replace(contact, film=None)


def wet(contact):
    return replace(contact, series_compliance=0.0)


def damped(contact):
    law = HuntCrossley(contact.law, dissipation=0.2)
    return replace(contact, series_compliance=0.0, film=None, law=law)


@pytest.mark.parametrize(
    ("change", "fmi", "force", "way"),
    [(dry, 2, 1e-5, 1e-6), (wet, 3, 1e-4, 3e-6), (damped, 3, 1e-4, 1e-6)],
)
def test_model_exchange_is_co_simulation(pair, tmp_path, change, fmi, force, way):
    changed = replace(pair, contacts=tuple(change(contact) for contact in pair.contacts))
    path = build_fmu(changed, tmp_path / "d.fmu", fmi=fmi, platforms=("linux64",))
    fine = by_fmu(
        path,
        "CoSimulation",
        step_size=1e-6,
        output_interval=1e-6,
        start_values={"internal_step": 1.25e-9},
    )
    exchanged = by_fmu(
        path, "ModelExchange", solver="CVode", relative_tolerance=1e-8, output_interval=2e-8
    )

    assert validation.validate_fmu(str(path)) == []
    peak = fine["peak_contact_force_opening"].max()
    assert peak > 500.0
    # a film and a damped law begin with a step of order 1; the peak falls between two outputs
    assert exchanged["contact_force_opening"].max() == pytest.approx(peak, rel=force)
    lift = np.interp(fine["time"], exchanged["time"], exchanged["lift"])
    np.testing.assert_allclose(lift, fine["lift"], rtol=0.0, atol=way * 1e-4)
