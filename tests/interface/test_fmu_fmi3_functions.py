"""The C functions of FMI 3.0, called one by one: what they do, and what they say when refused."""

import ctypes
import re
from pathlib import Path

import numpy as np
import pytest
from c_compiler import needs_compiler

from klack.case import find_case, load_case
from klack.exchange.case_models import case_models
from klack.exchange.fmu.build import build_fmu
from klack.exchange.fmu.variables import fmu_variables

fmpy = pytest.importorskip("fmpy")
pytestmark = needs_compiler

STEP = 1e-7


class Unit:
    """An unpacked FMU, its variables by name, and what its instances said."""

    def __init__(self, model, folder):
        self.model = model
        path = build_fmu(model, folder / f"{model.name}.fmu", fmi=3, platforms=("linux64",))
        self.folder = fmpy.extract(str(path), str(folder / "unpacked"))
        self.description = fmpy.read_model_description(self.folder)
        self.reference = {v.name: v.valueReference for v in self.description.modelVariables}
        self.states = [item.variable.derivative.valueReference for item in self.of("derivatives")]
        self.said: list[str] = []

    def of(self, word):
        return getattr(self.description, word)

    @property
    def library(self):
        return ctypes.CDLL(str(next(Path(self.folder, "binaries").rglob("*.so"))))

    def instance(self, kind, token=None):
        from fmpy.fmi3 import FMU3Model, FMU3Slave

        self.said.clear()
        factory = {"exchange": FMU3Model, "stepping": FMU3Slave}[kind]
        fmu = factory(
            guid=token or self.description.instantiationToken,
            unzipDirectory=self.folder,
            modelIdentifier=self.model.name,
            instanceName="it",
        )
        fmu.instantiate(
            logMessage=lambda where, status, kind, text: self.said.append(text.decode())
        )
        return fmu

    def started(self, kind, **values):
        fmu = self.instance(kind)
        for name, value in values.items():
            fmu.setFloat64([self.reference[name]], [value])
        fmu.enterInitializationMode(startTime=0.0)
        fmu.exitInitializationMode()
        if kind == "exchange":
            fmu.updateDiscreteStates()
            fmu.enterContinuousTimeMode()
        return fmu

    def value(self, fmu, name):
        return fmu.getFloat64([self.reference[name]])[0]


@pytest.fixture(scope="module")
def models():
    return case_models(load_case(find_case("demo-valve-axisymmetric")))


@pytest.fixture(scope="module")
def pair(models, tmp_path_factory):
    return Unit(models.pair, tmp_path_factory.mktemp("pair"))


@pytest.fixture(scope="module")
def body(models, tmp_path_factory):
    return Unit(models.body_models("needle")[0], tmp_path_factory.mktemp("body"))


@pytest.fixture
def stepping(pair):
    fmu = pair.started("stepping")
    yield fmu
    fmu.terminate()
    fmu.freeInstance()


def forces(pair, fmu, first, count):
    found = []
    for k in range(first, first + count):
        fmu.doStep(k * STEP, STEP)
        found.append(pair.value(fmu, "mean_contact_force"))
    return np.array(found)


def test_every_function_of_the_standard_is_there(pair):
    header = Path(fmpy.__path__[0], "c-code", "fmi3Functions.h").read_text()
    names = re.findall(r"FMI3_Export\s+fmi3\w+TYPE\s+(fmi3\w+);", header)

    assert len(names) > 70
    for name in names:
        assert hasattr(pair.library, name), name


def test_sources_lie_inside(pair):
    names = {path.name for path in Path(pair.folder, "sources").iterdir()}

    assert {"buildDescription.xml", "klack_model.c", "klack_fmi3.c", "klack_data.h"} <= names


def test_wrong_token_is_refused(pair):
    with pytest.raises(Exception, match="nstantiat"):
        pair.instance("stepping", token="{another}")
    assert pair.said == ["The instantiation token is not that of this model."]


def test_time_counts(pair, stepping):
    forces(pair, stepping, 0, 3)

    assert pair.value(stepping, "time") == pytest.approx(3e-7, rel=1e-12)


def test_saved_state_goes_on_to_the_same_bits(pair, stepping):
    before = forces(pair, stepping, 0, 100)
    saved = stepping.getFMUState()
    packed = stepping.serializeFMUState(saved)
    first = forces(pair, stepping, 100, 150)
    stepping.setFMUState(saved)
    again = forces(pair, stepping, 100, 150)
    stepping.freeFMUState(saved)
    unpacked = stepping.deserializeFMUState(packed)
    stepping.setFMUState(unpacked)
    third = forces(pair, stepping, 100, 150)
    stepping.freeFMUState(unpacked)

    assert before.max() > 50.0  # in the middle of the impact
    np.testing.assert_array_equal(again, first)
    np.testing.assert_array_equal(third, first)


def test_saved_state_fits_another_instance(pair, stepping):
    forces(pair, stepping, 0, 100)
    packed = stepping.serializeFMUState(stepping.getFMUState())
    expected = forces(pair, stepping, 100, 50)
    other = pair.started("stepping")
    other.setFMUState(other.deserializeFMUState(packed))

    np.testing.assert_array_equal(forces(pair, other, 100, 50), expected)
    other.freeInstance()


@pytest.mark.parametrize("damage", ["short", "token", "phase"])
def test_damaged_state_is_refused(pair, stepping, damage):
    packed = bytearray(stepping.serializeFMUState(stepping.getFMUState()))
    if damage == "short":
        packed = packed[:-8]
    elif damage == "token":
        packed[3] ^= 1
    else:
        packed[80] = 77
    with pytest.raises(Exception, match="eserialize"):
        stepping.deserializeFMUState(bytes(packed))
    assert pair.said[-1].startswith("fmi3DeserializeFMUState: ")


def test_reset_starts_again(pair):
    fmu = pair.started("stepping")
    first = forces(pair, fmu, 0, 60)
    fmu.reset()
    fmu.enterInitializationMode(startTime=0.0)
    fmu.exitInitializationMode()

    np.testing.assert_array_equal(forces(pair, fmu, 0, 60), first)
    fmu.freeInstance()


def test_start_parameters_move_the_needle(pair):
    fmu = pair.started("stepping", start_velocity=-0.25, start_rise=2e-6)

    assert pair.value(fmu, "velocity") == pytest.approx(-0.25, rel=1e-12)
    assert pair.value(fmu, "gap") == pytest.approx(2e-6, rel=1e-9)
    fmu.freeInstance()


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_bad_input_is_refused_with_a_reason(pair, stepping, bad):
    with pytest.raises(Exception, match="fmi3SetFloat64"):
        stepping.setFloat64([pair.reference["force"]], [bad])
    assert "finite" in pair.said[-1]


def test_unknown_and_fixed_variables_are_refused(pair, stepping):
    for call in (
        lambda: stepping.getFloat64([100000]),
        lambda: stepping.setFloat64([100000], [0.0]),
        lambda: stepping.setFloat64([pair.reference["lift"]], [0.0]),
        lambda: stepping.setFloat64([pair.reference["time"]], [0.0]),
        lambda: stepping.setFloat64([pair.reference["start_velocity"]], [0.0]),
        lambda: stepping.getInt32([0]),
    ):
        count = len(pair.said)
        with pytest.raises(Exception, match="fmi3"):
            call()
        assert len(pair.said) == count + 1
        assert pair.said[-1]


def test_model_exchange_functions_are_refused_in_co_simulation(pair, stepping):
    library = pair.library
    library.fmi3EnterContinuousTimeMode.argtypes = [ctypes.c_void_p]

    assert library.fmi3EnterContinuousTimeMode(stepping.component) == 3  # fmi3Error
    assert "only in model exchange" in pair.said[-1]


def difference(fmu, unit, unknowns, known, size):
    """Central difference of the unknowns over one state or input."""
    count = len(unit.states)
    states = (ctypes.c_double * count)()
    fmu.getContinuousStates(states, count)
    found = []
    for way in (0.5 * size, -0.5 * size, 0.0):
        if known in unit.states:
            moved = (ctypes.c_double * count)(*states)
            moved[unit.states.index(known)] += way
            fmu.setContinuousStates(moved, count)
        else:
            fmu.setFloat64([known], [way])
        found.append(np.array(fmu.getFloat64(unknowns)))
    return (found[0] - found[1]) / size


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["pair", "body"])
def test_directional_derivatives_are_differences(kind, request):
    unit = request.getfixturevalue(kind)
    start = {"start_rise": -3e-7} if kind == "pair" else {}
    fmu = unit.started("exchange", **start)
    unknowns = [
        item.variable.valueReference for item in (*unit.of("outputs"), *unit.of("derivatives"))
    ]
    inputs = list(range(len(unit.model.inputs)))
    for known in (*inputs, unit.states[0], unit.states[3], unit.states[-2]):
        size = 1.0 if known in inputs else 1e-3 * fmu_variables(unit.model)[known].nominal
        slope = fmu.getDirectionalDerivative(unknowns, [known], [1.0])
        expected = difference(fmu, unit, unknowns, known, size)

        scale = np.abs(expected).max()
        # the curvature of the contact law over 1e-9 of a micrometre, and round-off
        np.testing.assert_allclose(slope, expected, rtol=2e-4, atol=2e-7 * scale)
    fmu.freeInstance()


def test_stated_dependencies_hold_for_the_binary(pair):
    fmu = pair.started("exchange", start_rise=-3e-7)
    items = (*pair.of("outputs"), *pair.of("derivatives"))
    unknowns = [item.variable.valueReference for item in items]
    for known in (0, *pair.states[::7]):
        slope = np.array(fmu.getDirectionalDerivative(unknowns, [known], [1.0]))
        stated = np.array(
            [known in {v.valueReference for v in item.dependencies} for item in items], dtype=bool
        )
        assert not np.any((slope != 0.0) & ~stated)
        assert np.any(slope != 0.0)
    fmu.freeInstance()
