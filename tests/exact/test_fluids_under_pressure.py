"""Truth: closed integrals of Barus' law, quadrature of that of Roelands, differences of flows."""

from math import exp, pi

import numpy as np
import pytest
from scipy.integrate import quad

from klack.errors import InputError
from klack.hydraulics.annulus import Annulus
from klack.hydraulics.fluid_choice import FluidChoice
from klack.hydraulics.inertance import Inertance
from klack.hydraulics.liquid import ATMOSPHERE
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_viscosity import PressureViscosity, mean_viscosity_ratio
from klack.hydraulics.seat import Seat
from klack.network.rows import Ambient, Rows
from klack.network.step_function import evaluate

HANDLES = {"a": 1, "b": 2, "needle": 0, "body": 1}
OIL = {law: FluidChoice(name="ISO VG 46", viscosity_law=law).at(313.15) for law in
       ("ambient", "barus", "roelands")}  # fmt: skip
PARTS = {
    "annulus": Annulus(diameter=4e-3, length=8e-3, clearance=6e-6, eccentricity=0.4),
    "orifice": Orifice(diameter=0.1e-3),
    "cone": Seat(
        shape="cone", diameter=1.5e-3, half_angle=0.8, land_width=0.1e-3, lift=5e-6, leak_area=1e-12
    ),
    "channel": Inertance(length=5e-3, diameter=0.3e-3),
}


def step(part, fluid, p_a, p_b, moved=(0.0, 0.0), h=1e-7):
    """Outputs of one step of a component at given pressures."""
    rows = Rows(ambient=Ambient(), fluid=fluid, component="part", handles=HANDLES)
    part.add_rows(rows)
    row = rows.branches[0]
    rho = [float(fluid.density(ATMOSPHERE))] * 2  # held: only the viscosity differs
    moves = [0.0, moved[0], 0.0, moved[1]][: 2 * len(row.ports)]
    size = 3 + len(row.ports) + row.state.size + len(row.books)
    status, out = evaluate(
        row.step, row.parameters, row.state, [0.0, h, p_a, p_b, *rho, *moves], size
    )
    assert status == 0
    return out


def test_mean_viscosity_of_barus_is_its_closed_integral():
    alpha, p_b = 18e-9, 3e5
    for p_a in (3.1e5, 500e5, 1000e5, 2000e5):
        law = PressureViscosity.barus(alpha)
        mean, _, _ = mean_viscosity_ratio(p_a, p_b, *law.numbers)
        a, b = (exp(-alpha * (p - ATMOSPHERE)) for p in (p_a, p_b))
        assert mean == pytest.approx(alpha * (p_a - p_b) / (b - a), rel=1e-6)  # of Gauss


def test_mean_viscosity_of_roelands_is_its_quadrature():
    law = PressureViscosity.roelands(0.04, 18e-9)
    for p_a, p_b in ((2000e5, 1e5), (1e5, 1500e5)):
        whole = quad(lambda p: 1.0 / float(law.ratio(p)), p_b, p_a, epsrel=1e-11)[0]
        assert mean_viscosity_ratio(p_a, p_b, *law.numbers)[0] == pytest.approx(
            (p_a - p_b) / whole, rel=1e-5
        )


def test_both_laws_begin_with_the_coefficient_and_roelands_meets_his_formula():
    mu, alpha = 0.04, 18e-9
    laws = PressureViscosity.barus(alpha), PressureViscosity.roelands(mu, alpha)
    for law in laws:
        slope = (float(law.ratio(ATMOSPHERE + 1e4)) - float(law.ratio(ATMOSPHERE - 1e4))) / 2e4
        assert slope == pytest.approx(alpha, rel=1e-6)
    # log10 mu + 4.2 = (log10 mu_0 + 4.2) (1 + p/1.962e8)^Z with mu in mPa s over 1000: his form
    z = alpha * 1.962e8 / (np.log(mu) + 9.67)
    expected = np.exp((np.log(mu) + 9.67) * (1.0 + 1e8 / 1.962e8) ** z - 9.67) / mu
    assert float(laws[1].ratio(1e8 + ATMOSPHERE)) == pytest.approx(expected, rel=1e-12)
    assert float(laws[0].ratio(1e8 + ATMOSPHERE)) == pytest.approx(exp(1.8), rel=1e-12)


@pytest.mark.parametrize("law", ["barus", "roelands"])
@pytest.mark.parametrize("name", ["annulus", "orifice", "cone"])
@pytest.mark.parametrize(("p_a", "p_b"), [(900e5, 200e5), (2e5, 600e5), (40e5, 41e5)])
def test_slopes_are_those_of_the_flow(name, law, p_a, p_b):
    fluid, d = OIL[law], 1e3
    _, by_a, by_b = step(PARTS[name], fluid, p_a, p_b)[:3]
    along_a = step(PARTS[name], fluid, p_a + d, p_b)[0] - step(PARTS[name], fluid, p_a - d, p_b)[0]
    along_b = step(PARTS[name], fluid, p_a, p_b + d)[0] - step(PARTS[name], fluid, p_a, p_b - d)[0]
    assert by_a == pytest.approx(along_a / (2 * d), rel=1e-5, abs=0.0)
    assert by_b == pytest.approx(along_b / (2 * d), rel=1e-5, abs=0.0)


@pytest.mark.parametrize("name", PARTS)
def test_at_one_atmosphere_nothing_changes(name):
    """The two numbers of the law do nothing where the pressure is that of its reference."""
    p = ATMOSPHERE
    before = step(PARTS[name], OIL["ambient"], p + 100.0, p)
    for law in ("barus", "roelands"):
        assert step(PARTS[name], OIL[law], p + 100.0, p)[0] == pytest.approx(
            before[0], rel=1e-5, abs=0.0
        )


def test_leakage_at_2000_bar_is_that_of_the_integral():
    """Q = pi d c^3 / (12 l) int dp/mu, and the drag of the mean viscosity along the gap."""
    gap, fluid, p_a, p_b = PARTS["annulus"], OIL["roelands"], 2000e5, ATMOSPHERE
    out = step(gap, fluid, p_a, p_b)
    whole = quad(lambda p: 1.0 / float(fluid.viscosity(p)), p_b, p_a, epsrel=1e-11)[0]
    size = pi * gap.diameter * gap.clearance**3 / (12.0 * gap.length) * (1.0 + 1.5 * 0.4**2)
    assert out[0] / float(fluid.density(ATMOSPHERE)) == pytest.approx(size * whole, rel=1e-5)
    moving = step(gap, fluid, p_a, p_b, moved=(1e-7, 0.0))
    drag = gap.drag((p_a - p_b) / whole)
    assert 0.5 * (moving[4] - moving[3]) == pytest.approx(drag * 1.0, rel=1e-5)


@pytest.mark.parametrize("name", PARTS)
def test_a_fluid_without_a_law_is_the_one_before(name):
    rows = Rows(ambient=Ambient(), fluid=OIL["ambient"], component="part", handles=HANDLES)
    PARTS[name].add_rows(rows)
    assert "under_pressure" not in rows.branches[0].step.__name__


def test_laws_that_cannot_be_used_are_told():
    with pytest.raises(InputError, match="viscosity_pressure"):
        FluidChoice(name="generic mineral oil", viscosity_law="barus").at(313.15)
    with pytest.raises(InputError, match=r"0\.07 mPa s"):
        PressureViscosity.roelands(6e-5, 1e-8)
    with pytest.raises(InputError, match="at most 1"):  # 9 times too viscous at 2000 bar
        FluidChoice(name="n-heptane", viscosity_law="roelands").at(373.15)
