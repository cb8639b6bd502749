"""Truth: order of convergence of a coupled simulation over its communication step.

A spring outside the FMU pulls the needle: its force is computed from the lift at the start of a
step and held, or from where the lift will be at half the step.
"""

import numpy as np
import pytest
from c_compiler import needs_compiler

from klack.case import find_case
from klack.case.any_case import load_any_case
from klack.exchange.case_models import case_models
from klack.exchange.fmu.build import build_fmu

fmpy = pytest.importorskip("fmpy")
pytestmark = [needs_compiler, pytest.mark.slow]

STIFFNESS, PUSH, END = 50e3, 23.0, 160e-6  # [N/m], [N], [s] in free flight
STEPS = (8e-6, 4e-6, 2e-6, 1e-6)


class Coupled:
    def __init__(self, folder):
        from fmpy.fmi2 import FMU2Slave

        pair = case_models(load_any_case(find_case("demo-stroke"))).pair
        path = str(build_fmu(pair, folder / "v.fmu", fmi=2, platforms=("linux64",)))
        description = fmpy.read_model_description(path)
        self.reference = {v.name: v.valueReference for v in description.modelVariables}
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=fmpy.extract(path, str(folder / "unpacked")),
            modelIdentifier=description.modelName,
            instanceName="valve",
        )
        self.fmu.instantiate()

    def lift(self, step, *, ahead):
        """Lift at the end, for a spring that looks ahead by half a step or not."""
        fmu, reference = self.fmu, self.reference
        fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        seen = [reference["lift"], reference["velocity"]]
        for k in range(round(END / step)):
            lift, velocity = fmu.getReal(seen)
            way = lift + (0.5 * step * velocity if ahead else 0.0)
            fmu.setReal([reference["force_spring_face"]], [PUSH - STIFFNESS * way])
            fmu.doStep(k * step, step)
        lift = fmu.getReal(seen)[0]
        fmu.reset()
        return lift


@pytest.fixture(scope="module")
def coupled(tmp_path_factory):
    return Coupled(tmp_path_factory.mktemp("valve"))


@pytest.fixture(scope="module")
def exact(coupled):
    return coupled.lift(4e-8, ahead=True)


@pytest.mark.parametrize(("ahead", "order", "size"), [(False, 1.0, 5e-4), (True, 2.0, 2e-6)])
def test_error_of_held_inputs_falls_with_its_order(coupled, exact, ahead, order, size):
    errors = np.array([coupled.lift(step, ahead=ahead) for step in STEPS]) / exact - 1.0
    orders = np.log2(errors[:-1] / errors[1:])

    np.testing.assert_allclose(orders, order, atol=0.06)
    assert 0.0 < errors[-1] < size  # a late spring lets the needle go too far
