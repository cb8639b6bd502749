"""Truth: the energy of a chamber is a convex potential of mass and volume."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.fluid_table import fluid_at, fluid_table
from klack.hydraulics.pressure_face import PressureFace
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.network.rows import Ambient
from klack.simulation.network_run import simulate_network

AMBIENT = 101_325.0
TABLE = fluid_table(library_fluid("n-heptane").at(293.15, gas_fraction=1e-3), AMBIENT)


def pressure(mass: float, volume: float) -> float:
    """Solve ``V rho(p) = m``."""
    return brentq(
        lambda p: fluid_at(TABLE, p, 0)[0] - mass / volume, 1e-3, 3e8, xtol=1e-9, rtol=1e-15
    )


def energy(mass: float, volume: float) -> float:
    p = pressure(mass, volume)
    return mass * fluid_at(TABLE, p, 0)[2] - (p - AMBIENT) * volume


@pytest.mark.parametrize("p", [50.0, 4700.0, 2e4, 6e5, 2e7])
def test_energy_changes_by_work_and_by_inflow(p):
    """Its derivatives are -(p - p_ambient) over volume and g over mass."""
    V = 1e-8
    rho, _, g, _ = fluid_at(TABLE, p, 0)
    m = rho * V
    d = 1e-6
    over_volume = (energy(m, V * (1 + d)) - energy(m, V * (1 - d))) / (2 * d * V)
    over_mass = (energy(m * (1 + d), V) - energy(m * (1 - d), V)) / (2 * d * m)
    assert over_volume == pytest.approx(AMBIENT - p, rel=1e-4)
    assert over_mass == pytest.approx(g, rel=1e-4)


def test_drawing_a_piston_out_until_it_boils_stores_the_work():
    """Work of a closed volume from 100 bar to 100 Pa, -int (p - p_ambient) dV = change of store.

    ``dV = m dv`` with the slope of the table, six Gauss points per piece: exact for its
    polynomials, so density, slope and energy must fit together to round-off.
    """
    mass = 1e-5
    ends = np.concatenate(
        ([100.0], TABLE[8::8][(TABLE[8::8] > 100.0) & (TABLE[8::8] < 1e7)], [1e7])
    )
    x, w = np.polynomial.legendre.leggauss(6)
    work = 0.0
    for a, b in pairwise(ends):
        half = 0.5 * (b - a)
        for p, weight in zip(0.5 * (a + b) + half * x, w, strict=True):
            rho, slope, _, _ = fluid_at(TABLE, p, 0)
            work += weight * half * (p - AMBIENT) * mass * slope / rho**2

    rho0, _, g0, _ = fluid_at(TABLE, 100.0, 0)
    rho1, _, g1, _ = fluid_at(TABLE, 1e7, 0)
    stored = mass * (g1 - g0 - (1e7 - AMBIENT) / rho1 + (100.0 - AMBIENT) / rho0)
    assert len(ends) > 200
    assert work == pytest.approx(stored, rel=1e-12)


def test_an_implicit_step_never_gains_energy():
    """Inflow at the pressure of the end: ``m0 (g0 - g1) + (p1 - p0) V``, free of cancellation."""
    random = np.random.default_rng(2)
    p0 = 10.0 ** random.uniform(0.0, 8.0, 6000)
    p1 = p0 * np.exp(random.normal(0.0, 1.0, 6000) * 10.0 ** random.uniform(-7.0, 0.0, 6000))
    lossy = 0
    for a, b in zip(p0, p1, strict=True):
        rho, _, g_a, _ = fluid_at(TABLE, a, 0)
        _, _, g_b, _ = fluid_at(TABLE, b, 0)
        loss = rho * (g_a - g_b) + (b - a)  # per volume
        assert loss >= -4e-15 * rho * (abs(g_a) + abs(g_b))
        lossy += loss > 1e-9 * abs(b - a)
    assert lossy > 4000  # the others are tiny steps


def test_a_run_through_boiling_and_collapse_keeps_mass_and_energy():
    """A piston on a spring draws 100 mm^3 out to 121 mm^3, and back onto the cavity."""
    fluid = library_fluid("n-heptane").at(293.15, gas_fraction=1e-4)
    network = Network(
        {
            "piston": RigidMass(mass=3e-3, speed=3.0),
            "room": Chamber(volume=1e-7, pressure=5e5),
            "face": PressureFace(area=20e-6, direction="opening"),
            "back": Spring(stiffness=20e3, preload=0.0),
        },
        [["piston.body", "face.body", "back.end"], ["room.fluid", "face.fluid"]],
        Ambient(),
        fluid,
    )

    result = simulate_network(
        network.rows(), duration=3e-3, step=20e-9, coarse=1, record=1e-6, start="free"
    )

    p = result.channels["room pressure"].values
    y = result.channels["piston.body displacement"].values
    mass = fluid.density(p) * (1e-7 + 20e-6 * y)
    assert p.min() < fluid.kinks[1]  # it boiled
    assert p.max() > 100e5  # and collapsed
    np.testing.assert_allclose(mass, mass[0], rtol=1e-9)  # the solver's tolerance
    books = result.books
    gained = sum(books.stores_after.values()) - sum(books.stores_before.values())
    residual = sum(books.supplies.values()) - sum(books.losses.values()) - gained
    assert abs(residual) < 1e-12 * sum(books.stores_before.values())
    assert min(books.losses.values()) >= 0.0
    assert books.losses["room implicit step"] < 0.01 * sum(books.stores_before.values())
