"""rumoca, an independent Modelica compiler, runs what klack writes and meets the native run."""

import numpy as np
import pytest

from klack.case.any_case import load_any_case
from klack.case.reader import find_case
from klack.contact.laws import HertzLaw, LinearLaw, TableLaw
from klack.exchange.case_models import case_models
from klack.exchange.modal_model import Provenance, body_model
from klack.exchange.modelica import modelica_text, write_modelica
from klack.network.rows import FilmRow
from klack.simulation.bodies import rod_body

rumoca = pytest.importorskip("rumoca")

FILM = FilmRow(cubic=4e-17, linear=2e-7, cut_off=5e-7, suction=1.0)
ORIGIN = Provenance(case="rod", title="", version="0", created="today")


def _run(source, name, equations, duration, solver="rk-like", rtol=1e-8, dt=2e-8):
    """Compile a model that drives the exported one, and simulate it."""
    driven = f"model Driven\n  {name} m;\nequation\n  {equations}\nend Driven;\n"
    model = rumoca.Session().loads(source + driven, model="Driven")
    settings = rumoca.SimConfig(solver=solver, rtol=rtol, atol=1e-15, max_wall_seconds=60)
    result = model.simulate(t=(0.0, duration), dt=dt, config=settings)
    return {key: np.array(result[key]) for key in result.names} | {"time": np.array(result.time)}


@pytest.mark.parametrize(("solver", "deviation"), [("rk-like", 1e-9), ("bdf", 1e-6)])
def test_body_under_a_force_that_is_switched_on(solver, deviation):
    rod = rod_body(
        "rod", length=0.04, area=1.2e-5, young=2.1e11, density=7850, elastic_modes=20, damping=0.002
    )
    source = modelica_text(body_model(rod, provenance=ORIGIN, step=2e-8))
    forces = "m.force_bottom = 1; m.force_top = -0.25;"
    found = _run(source, "rod", forces, 50e-6, solver)
    t, w, z = found["time"][:, None], rod.omega[1:], rod.damping[1:]
    wd, decay = w * np.sqrt(1 - z**2), np.exp(-z * w * t)
    push = rod.port_shapes @ [1.0, -0.25]
    modal = (1 - decay * (np.cos(wd * t) + z * w / wd * np.sin(wd * t))) / w**2
    speed = decay * np.sin(wd * t) / wd
    y = np.hstack([t**2 / 2, modal]) @ (rod.port_shapes[:, 1] * push)
    v = np.hstack([t, speed]) @ (rod.port_shapes[:, 1] * push)
    assert abs(found["m.displacement_top"] - y).max() < deviation * abs(y).max()
    assert abs(found["m.velocity_top"] - v).max() < 10 * deviation * abs(v).max()


@pytest.mark.parametrize(
    ("law", "series"),
    [
        (LinearLaw(8e8), 0.0),
        (LinearLaw(8e8), 4e-10),
        (HertzLaw(5e11, 1.5), 0.0),
        (HertzLaw(5e11, 1.5), 4e-10),
        (TableLaw([2e-7, 5e-7, 1e-6, 2e-6], [60, 200, 500, 1400]), 0.0),
        (TableLaw([2e-7, 5e-7, 1e-6, 2e-6], [60, 200, 500, 1400]), 4e-10),
        (TableLaw([2e-7, 3e-7], [60, 100]), 4e-10),  # ends below the peak: its straight line
    ],
)
def test_pair_without_film(rod_impact, law, series):
    impact = rod_impact(law, series)
    native = impact.dry(1e-9, 40e-6)
    found = _run(modelica_text(impact.pair), "rods", "m.force = 0; m.force_top = 0;", 40e-6)
    history = native.impact()
    assert found["m.contact_force_tip"].max() == pytest.approx(history.peak_force.max(), rel=2e-5)
    # the native step of 1 ns is of order 2: 1e-6 of the speed
    assert found["m.velocity"][-1] == pytest.approx(native.velocity[-1, 0], rel=2e-6)
    lift = 1e-6 + np.trapezoid(native.velocity[:, 0], dx=1e-9)
    assert found["m.lift"][-1] == pytest.approx(lift, rel=2e-6)


@pytest.mark.slow
@pytest.mark.parametrize("series", [0.0, 4e-10])
@pytest.mark.parametrize("solver", ["rk-like", "bdf"])
def test_pair_with_film(rod_impact, stepped, series, solver):
    impact = rod_impact(series=series, film=FILM)
    pressed, squeezed, lift, velocity = stepped(impact.pair, 1e-9, 40e-6)
    source = modelica_text(impact.pair)
    found = _run(source, "rods", "m.force = 0; m.force_top = 0;", 40e-6, solver, rtol=1e-7)
    assert squeezed > 0.05 * pressed
    # the relaxation of 4 ns moves the peak by 5e-5; the spike of the film ends within one step
    assert found["m.contact_force_tip"].max() == pytest.approx(pressed, rel=1e-4)
    assert found["m.film_force_tip"].max() == pytest.approx(squeezed, rel=5e-3)
    assert found["m.velocity"][-1] == pytest.approx(velocity, rel=5e-5)
    assert found["m.lift"][-1] == pytest.approx(lift, rel=5e-5)


@pytest.mark.slow
def test_shipped_valve(stepped, tmp_path):
    pair = case_models(load_any_case(find_case("demo-valve-axisymmetric"))).pair
    (path,) = write_modelica([pair], tmp_path)
    found = _run(path.read_text(encoding="utf-8"), pair.name, "m.force = 0;", pair.duration)
    pressed, _, lift, velocity = stepped(pair, 4e-9, pair.duration)
    assert found["m.contact_force_contact"].max() == pytest.approx(pressed, rel=1e-5)
    assert found["m.lift"][-1] == pytest.approx(lift, rel=1e-6)
    assert found["m.velocity"][-1] == pytest.approx(velocity, rel=1e-6)


def test_start_and_outside_force_move_the_needle(rod_impact, tmp_path):
    (path,) = write_modelica([rod_impact().pair], tmp_path)
    source = path.read_text(encoding="utf-8")
    higher = source.replace('start_rise(unit="m") = 0', 'start_rise(unit="m") = 1e-6')
    faster = higher.replace('start_velocity(unit="m/s") = -0.5', 'start_velocity(unit="m/s") = 0.1')
    assert faster != higher != source
    found = _run(faster, "rods", "m.force = 12; m.force_top = 0;", 1e-6)
    assert found["m.lift"][0] == pytest.approx(2e-6)
    assert found["m.velocity"] == pytest.approx(0.1, rel=1e-9)  # 12 N balance the case's -12 N
    assert found["m.gap_tip"][0] == pytest.approx(2e-6)
