"""Fluids of CoolProp. Truth: its equations of state on the isentrope, evaluated one by one."""

import sys

import numpy as np
import pytest
from pydantic import ValidationError

from klack.errors import InputError, MissingExtraError
from klack.hydraulics.fluid_choice import FluidChoice
from klack.hydraulics.liquid import ATMOSPHERE

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("celsius", [0.0, 40.0, 140.0])
@pytest.mark.parametrize(
    ("fluid", "top"), [("n-Dodecane", 2000e5), ("n-Heptane", 1000e5), ("Water", 2500e5)]
)
def test_the_isentrope_is_that_of_the_equation_of_state(fluid, top, celsius):
    """The end of the range is that of the equation; the curve of 1/K has 80 points."""
    CP = pytest.importorskip("CoolProp.CoolProp")
    T = 273.16 + celsius  # water above its triple point
    ours = FluidChoice(name=f"CoolProp:{fluid}").at(T)
    p0 = max(ATMOSPHERE, 1.02 * ours.vapour_pressure)
    entropy = CP.PropsSI("S", "T", T, "P", p0, fluid)
    assert ours.liquid.pressure[-1] == pytest.approx(top, rel=1e-12)
    for p in (p0, 50e5, 321e5, 950e5):
        at = ("S", entropy, "P", p, fluid)
        rho, speed = CP.PropsSI("D", *at), CP.PropsSI("A", *at)
        assert float(ours.liquid.density(p)) == pytest.approx(rho, rel=1e-7)
        assert float(np.sqrt(ours.liquid.bulk_modulus(p) / rho)) == pytest.approx(speed, rel=1e-5)
    mu = CP.PropsSI("V", "T", T, "P", 200e5, fluid)
    assert float(ours.viscosity(200e5)) == pytest.approx(mu, rel=4e-2)  # one exponential
    assert ours.vapour_pressure == pytest.approx(CP.PropsSI("P", "T", T, "Q", 0, fluid), rel=1e-9)


def test_it_is_the_fluid_of_the_library_where_both_hold():
    pytest.importorskip("CoolProp")
    T, p = 293.15, 100e5
    ours = FluidChoice(name="coolprop: n-Heptane", gas_fraction=1e-4).at(T)
    library = FluidChoice(name="n-heptane", gas_fraction=1e-4).at(T)
    assert float(ours.sound_speed(p)) == pytest.approx(float(library.sound_speed(p)), rel=1e-2)
    assert float(ours.density(p)) == pytest.approx(float(library.density(p)), rel=1e-3)


@pytest.mark.parametrize("name", ["CoolProp:nope", "CoolProp:", "CoolProp:n-heptane-oil"])
def test_fluids_that_it_does_not_have_are_told(name):
    pytest.importorskip("CoolProp")
    with pytest.raises(ValidationError, match="as CoolProp spells it"):
        FluidChoice(name=name)


def test_temperatures_and_gases_are_told():
    pytest.importorskip("CoolProp")
    with pytest.raises(InputError, match=r"got -20 degC, expected -9\.55 to"):
        FluidChoice(name="CoolProp:n-Dodecane").at(253.15)
    with pytest.raises(ValidationError, match="together with your own values"):
        FluidChoice.model_validate({"name": "CoolProp:Water", "viscosity": "1 mPa*s"}, context={})
    with pytest.raises(InputError, match="CoolProp has no viscosity"):
        FluidChoice(name="CoolProp:Neon").at(30.0)


def test_without_the_package_one_error_says_how_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "CoolProp", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'FILE.whl\[coolprop\]'"):
        FluidChoice(name="CoolProp:n-Dodecane")
