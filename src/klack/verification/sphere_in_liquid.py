"""Spheres that hit a wall in a liquid: film, Hertz contact, drag."""

from dataclasses import dataclass
from math import exp, log, pi, sqrt
from typing import Any, ClassVar

import numpy as np
from pydantic import Field

from klack.contact.laws import HertzLaw, LinearLaw
from klack.hydraulics.film import SphereFilm
from klack.hydraulics.fluid import Fluid
from klack.hydraulics.liquid import Murnaghan
from klack.hydraulics.mixture import Vapour
from klack.network.component import Component
from klack.network.network import Network
from klack.network.port import ELEMENT
from klack.network.rows import Book, Rows
from klack.network.step_function import step_function
from klack.simulation.network_run import simulate_network
from klack.units import Density, DynamicViscosity, Length
from klack.verification.benches import component

__all__ = [
    "GLASS",
    "NYLON",
    "READ_AT",
    "ROUGHNESS",
    "STEEL",
    "STOKES_NUMBERS",
    "Sphere",
    "elastohydrodynamic_height",
    "film_alone",
    "measured_ratio",
    "on_compliance",
    "restitution",
]

RADIUS = 3e-3  # [m]
SPEED = 0.3  # [m/s]
LIQUID = 1100.0  # [kg/m^3], water with glycerol
ROUGHNESS = 0.1e-6  # [m], polished spheres and walls: 0.05 to 0.3 um
READ_AT = 0.5 * RADIUS  # height [m] at which the speeds before and after are read
STOKES_NUMBERS = (5.0, 10.0, 20.0, 30.0, 50.0, 70.0, 100.0, 200.0, 300.0, 500.0, 1000.0, 3000.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sphere:
    """Sphere of 6 mm over a thick glass wall.

    Parameters
    ----------
    density [kg/m^3]
    modulus [Pa]
        ``E*`` of sphere and wall.
    """

    name: str
    density: float
    modulus: float

    @property
    def mass(self) -> float:
        """Mass [kg] with the added mass of a sphere far from walls."""
        return (self.density + 0.5 * LIQUID) * 4.0 / 3.0 * pi * RADIUS**3

    def viscosity(self, stokes: float) -> float:
        """Viscosity [Pa s] of the liquid at a Stokes number, ``(rho_p + rho_f/2) d v / 9 St``."""
        return (self.density + 0.5 * LIQUID) * 2.0 * RADIUS * SPEED / (9.0 * stokes)


_WALL = (1.0 - 0.22**2) / 70e9
STEEL = Sphere(name="steel", density=7800.0, modulus=1.0 / (_WALL + (1.0 - 0.3**2) / 210e9))
GLASS = Sphere(name="glass", density=2500.0, modulus=1.0 / (2.0 * _WALL))
NYLON = Sphere(name="nylon", density=1140.0, modulus=1.0 / (_WALL + (1.0 - 0.4**2) / 2.8e9))


def measured_ratio(stokes: float) -> float:
    """Fit ``e/e_dry = exp(-35/St)`` of several experiments, Legendre et al. (2005)."""
    return exp(-35.0 / stokes)


def film_alone(stokes: float, cut_off: float) -> float:
    """``1 - 2 ln(h/h_r)/St``: a film takes equal momentum both ways (Reynolds)."""
    return max(0.0, 1.0 - 2.0 / stokes * log((READ_AT + cut_off) / cut_off))


def elastohydrodynamic_height(sphere: Sphere, stokes: float) -> float:
    r"""Height [m] at which the film pressure begins to flatten the faces.

    .. math:: x_r = \Bigl(\frac{3 \mu v R^{3/2}}{\sqrt2\,E^*}\Bigr)^{2/5}

    (Davis, Serayssol & Hinch 1986, in the form of Davis, Rager & Good 2002.)
    """
    return float(
        (3.0 * sphere.viscosity(stokes) * SPEED * RADIUS**1.5 / (sqrt(2.0) * sphere.modulus)) ** 0.4
    )


@step_function
def _drag_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Steady drag at the mean velocity: its loss is never negative."""
    moved = inp[3] - inp[2]
    out[0] = out[1] = 0.0
    if inp[1] > 0.0:
        speed = moved / inp[1]
        out[0] = -par[0] * (1.0 + 0.15 * (par[1] * abs(speed)) ** 0.687) * speed
        out[1] = -out[0] * moved
    return 0


class SphereDrag(Component):
    r"""Steady drag of a sphere, ``6 pi mu R v (1 + 0.15 Re^0.687)`` (Schiller and Naumann 1933)."""

    type: ClassVar[str] = "sphere-drag"
    ports: ClassVar = {"body": ELEMENT}

    radius: Length = Field(gt=0, description="Of the sphere.")
    density: Density = Field(gt=0, description="Of the liquid.")
    viscosity: DynamicViscosity = Field(gt=0, description="Of the liquid.")

    def add_rows(self, rows: Rows) -> None:
        """Add one element that turns work into heat."""
        mu = self.viscosity
        rows.element(
            _drag_step,
            ports=(rows.port("body"),),
            parameters=(6.0 * pi * mu * self.radius, 2.0 * self.radius * self.density / mu),
            books=(Book("heat", "loss"),),
        )


def restitution(
    sphere: Sphere,
    stokes: float,
    *,
    cut_off: float = 3.0 * ROUGHNESS,
    pull: bool = True,
    drag: bool = False,
) -> float:
    """Speed after over speed before, half a radius from the wall; 0 for a sphere that stays.

    Parameters
    ----------
    stokes [-]
    cut_off [m]
    pull
        The film may pull up to the ambient pressure; else it cavitates at once.
    """
    return _bounce(
        sphere,
        stokes,
        HertzLaw(4.0 / 3.0 * sphere.modulus * sqrt(RADIUS)),
        cut_off=cut_off,
        pull=pull,
        drag=drag,
    )


def on_compliance(sphere: Sphere, stokes: float, *, cut_off: float, pull: bool) -> float:
    """As :func:`restitution`, of stiff asperities with the film before the bulk of the bodies.

    The bulk is the compliance ``1/(2 E* a)`` of a flat circle, ``a^2 = R x_r``.
    """
    a = sqrt(RADIUS * elastohydrodynamic_height(sphere, stokes))
    series = 1.0 / (2.0 * sphere.modulus * a)
    return _bounce(
        sphere, stokes, LinearLaw(100.0 / series), cut_off=cut_off, pull=pull, series=series
    )


def _bounce(
    sphere: Sphere,
    stokes: float,
    law: HertzLaw | LinearLaw,
    *,
    cut_off: float,
    pull: bool,
    drag: bool = False,
    series: float = 0.0,
) -> float:
    mu = sphere.viscosity(stokes)
    fluid = Fluid(
        name="water with glycerol",
        temperature=293.15,
        liquid=Murnaghan(density_at_reference=LIQUID, bulk_modulus_at_reference=3e9),
        base_viscosity=mu,
        vapour=Vapour(pressure=2339.0, density=0.0173),
    )
    film = SphereFilm(
        shape="sphere",
        radius=RADIUS,
        cut_off=cut_off,
        cavitation_pressure=None if pull else 101325.0,
    )
    stop = component("end-stop", gap=READ_AT, film=film).with_law(law, series)
    parts: dict[str, Component] = {
        "sphere": component("rigid-mass", mass=sphere.mass, speed=-SPEED),
        "wall": stop,
    }
    if drag:
        parts["drag"] = SphereDrag(radius=RADIUS, density=LIQUID, viscosity=mu)
    joined = [["sphere.body", "wall.upper", *(["drag.body"] if drag else [])]]
    network = Network(parts, [*joined, ["wall.lower", "ground"]], fluid=fluid)
    result = simulate_network(
        network.rows(),
        duration=20.0 * READ_AT / SPEED,
        step=20e-9,
        record=20e-6,
        start="free",
    )
    height = READ_AT + result.channels["sphere.body displacement"].values
    speed = result.channels["sphere.body velocity"].values
    back = np.flatnonzero((height > READ_AT) & (speed > 0.0))
    if back.size == 0:
        return 0.0
    k = back[0]
    return float(np.interp(READ_AT, height[k - 1 : k + 1], speed[k - 1 : k + 1])) / SPEED
