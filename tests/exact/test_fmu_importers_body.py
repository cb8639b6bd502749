"""Truth: closed solution of every mode under a constant force, for the FMU of a linear body."""

from dataclasses import replace

import numpy as np
import pytest
from c_compiler import needs_compiler

from klack.case import find_case, load_case
from klack.exchange.case_models import case_models
from klack.exchange.fmu.build import build_fmu
from klack.exchange.fmu.documentation import receptance

fmpy = pytest.importorskip("fmpy")
validation = pytest.importorskip("fmpy.validation")
pytestmark = needs_compiler

FORCE, DURATION = 10.0, 1e-4  # [N], [s]


@pytest.fixture(scope="module")
def bodies():
    models = case_models(load_case(find_case("demo-valve-axisymmetric"))).body_models()
    return {model.name: with_damping(model) for model in models}


def with_damping(model):
    """The case has none: another one for each elastic mode."""
    ratios = np.linspace(0.002, 0.02, model.mode_count)
    return replace(model, damping=np.where(model.omega > 0.0, ratios, 0.0))


def step_response(model, time):
    """Displacement and velocity of the loaded port."""
    shape = np.asarray(model.inputs[0].shape)
    w, z, t = model.omega, model.damping, time[:, None]
    f = FORCE * shape
    wd = w * np.sqrt(1.0 - z**2)
    safe = np.where(w > 0.0, w, 1.0)
    fading, turn = np.exp(-z * w * t), wd * t
    elastic = (
        f / safe**2 * (1.0 - fading * (np.cos(turn) + z * w / np.where(w, wd, 1) * np.sin(turn)))
    )
    q = np.where(w > 0.0, elastic, 0.5 * f * t**2)
    v = np.where(w > 0.0, f / np.where(w, wd, 1) * fading * np.sin(turn), f * t)
    return q @ shape, v @ shape


@pytest.mark.slow
@pytest.mark.parametrize("name", ["needle", "housing"])
@pytest.mark.parametrize("fmi", [2, 3])
def test_constant_force(bodies, tmp_path, name, fmi):
    model = bodies[name]
    path = str(build_fmu(model, tmp_path / "b.fmu", fmi=fmi, platforms=("linux64",)))
    outputs = [output.name for output in model.outputs]
    common = {
        "stop_time": DURATION,
        "output_interval": 1e-6,
        "start_values": {model.inputs[0].name: FORCE},
        "output": outputs,
    }
    stepped = fmpy.simulate_fmu(path, fmi_type="CoSimulation", **common)
    exchanged = fmpy.simulate_fmu(
        path, fmi_type="ModelExchange", solver="CVode", relative_tolerance=1e-10, **common
    )

    assert validation.validate_fmu(path) == []
    for output, exact in zip(outputs, step_response(model, stepped["time"]), strict=True):
        size = np.abs(exact).max()
        # held inputs move the modes exactly
        np.testing.assert_allclose(stepped[output], exact, rtol=0.0, atol=1e-11 * size)
        np.testing.assert_allclose(exchanged[output], exact, rtol=0.0, atol=1e-5 * size)


def test_receptance_of_the_picture_solves_the_equations(bodies):
    model = bodies["needle"]
    shape = np.asarray(model.inputs[0].shape)
    for f in (3e3, 60e3, 400e3):
        w = 2.0 * np.pi * f
        stiff = np.diag(model.omega**2 - w**2 + 2j * model.damping * model.omega * w)
        expected = shape @ np.linalg.solve(stiff, shape)

        assert receptance(model, 0, 0, np.array([f]))[0] == pytest.approx(expected, rel=1e-12)
