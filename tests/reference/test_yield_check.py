"""Where a contact yields, told from the pressure of elastic bodies."""

import warnings
from pathlib import Path

import pytest
from doubts import doubts

from klack.analyses.impact.contact_check import check_yield
from klack.assembling.problem import build_problem
from klack.case import read_case
from klack.errors import InputError

DATA = Path(__file__).parents[1] / "data" / "case"
SPHERES = DATA / "yielding_spheres.yaml"
VALVE = Path(__file__).parents[2] / "cases" / "demo-valve-axisymmetric" / "case.yaml"


def _problem(path, old, new):
    text = path.read_text("utf-8")
    assert old in text
    return build_problem(read_case(text.replace(old, new), path), lambda *_: None)


@pytest.mark.slow
def test_seat_yields_where_the_elastic_stress_reaches_it():
    """Reference: von Mises stress of the whole bodies by finite elements, 15 %.

    Hertz leaves out what the bodies add; the pressure of a ring at first yield is 1.79 Y.
    """
    problem = _problem(VALVE, "density: 7850 kg/m^3}", "density: 7850 kg/m^3, yield: 600 MPa}")

    with doubts() as told:
        found = check_yield(problem.case, problem.pair, problem.static, 100.0, "tip on seat")

    assert "'needle' (steel, 600 MPa) from about" in told[0]
    first = float(told[0].split("from about ")[1].split(" N")[0])
    loops = problem.yielding(lambda *_: None)
    assert first == pytest.approx(loops.first_yield, rel=0.15)
    assert "'housing'" in told[0]
    again = _problem(
        VALVE,
        "density: 7850 kg/m^3}",
        f"density: 7850 kg/m^3, yield: {found.needed * 1.01} Pa}}",
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_yield(again.case, again.pair, again.static, 100.0, "tip on seat")


def test_spheres_need_the_yield_stress_of_their_pressure():
    """Reference: Hertz, p0 = (6 P E*^2/(pi^3 R^2))^(1/3); 10 %, few elements across."""
    problem = _problem(SPHERES, ", yield: 280 MPa, hardening: {isotropic: 1 GPa}", "")
    modulus, radius = 210e9 / (1 - 0.3**2) / 2, 1.25e-3 / 2
    force = 0.9 * problem.static.max_force
    found = check_yield(problem.case, problem.pair, problem.static, force, "tip on tip")

    assert found.pressure == pytest.approx(
        (6 * force * modulus**2 / (3.14159**3 * radius**2)) ** (1 / 3), rel=0.1
    )
    assert found.needed == pytest.approx(found.pressure / 1.613, rel=0.01)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("yield: 5 GPa", r"materials.steel.yield: .* at most a fiftieth"),
        ("yield: 300 MPa, hardness: {HV: 180}", "hardness"),
        ("hardening: {isotropic: 1 GPa}", "no yield stress"),
        ("yield: 300 MPa, hardening: {isotropic: -1 GPa}", "isotropic"),
        ("yield: -300 MPa", "yield"),
        ("hardness: {HRC: 80}", "HRC"),
        ("hardness: {HRC: 60, HV: 700}", "hardness"),
        ("hardness: {}", "hardness"),
    ],
)
def test_materials_that_cannot_be_are_refused(given, message):
    text = SPHERES.read_text("utf-8")
    text = text.replace("yield: 280 MPa, hardening: {isotropic: 1 GPa}", given)
    with pytest.raises(InputError, match=message):
        read_case(text, SPHERES)


@pytest.mark.parametrize(
    ("given", "yields"), [("HV: 180", 588e6), ("HRC: 60", 2278e6), ("HRC: 62.5", 2499e6)]
)
def test_hardness_is_an_estimate_of_the_yield_stress(given, yields):
    """Reference: Tabor 1951, a third of the Vickers hardness; ASTM E140."""
    text = SPHERES.read_text("utf-8")
    text = text.replace("yield: 280 MPa, hardening", f"hardness: {{{given}}}, hardening")
    material = read_case(text, SPHERES).materials["steel"].named("steel")

    assert material.hardening.yield_stress == pytest.approx(yields, rel=2e-3)
    assert material.hardening.isotropic == 1e9
