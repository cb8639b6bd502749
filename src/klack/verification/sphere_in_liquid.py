"""Spheres that hit a wall in a liquid: film, Hertz contact, drag, memory of the liquid."""

from dataclasses import dataclass
from math import exp, log, pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.special import wofz

from klack.contact.laws import HertzLaw, HuntCrossley, LinearLaw, gonthier_coefficient
from klack.hydraulics.film import SphereFilm
from klack.hydraulics.fluid import Fluid
from klack.hydraulics.liquid import Murnaghan
from klack.hydraulics.mixture import Vapour
from klack.hydraulics.unsteady_drag import UnsteadyDrag
from klack.machine.stages import collected_warnings
from klack.mechanics.gravity import Gravity
from klack.network.component import Component
from klack.network.network import Network
from klack.simulation.network_run import simulate_network
from klack.verification.benches import component

__all__ = [
    "CUT_OFF",
    "GLASS",
    "NYLON",
    "READ_AT",
    "REBOUNDS",
    "ROUGHNESS",
    "STEEL",
    "STOKES_NUMBERS",
    "Rebound",
    "Sphere",
    "elastohydrodynamic_height",
    "film_alone",
    "measured_ratio",
    "on_compliance",
    "rebounds",
    "restitution",
    "settling_error",
]

RADIUS = 3e-3  # [m]
SPEED = 0.3  # [m/s]
LIQUID = 1100.0  # [kg/m^3], water with glycerol
ROUGHNESS = 0.1e-6  # [m], polished spheres and walls: 0.05 to 0.3 um
_OIL = 935.0  # [kg/m^3]; the ratio to the sphere rules
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


def _liquid(density: float, viscosity: float) -> Fluid:
    return Fluid(
        name="liquid",
        temperature=293.15,
        liquid=Murnaghan(density_at_reference=density, bulk_modulus_at_reference=3e9),
        base_viscosity=viscosity,
        vapour=Vapour(pressure=2339.0, density=0.0173),
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
    fluid = _liquid(LIQUID, mu)
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
        parts["drag"] = UnsteadyDrag(shape="sphere", radius=RADIUS, memory=False, added_mass=0.0)
    joined = [["sphere.body", "wall.upper", *(["drag.body"] if drag else [])]]
    network = Network(parts, [*joined, ["wall.lower", "ground"]], fluid=fluid)
    # drag counts little where the Reynolds number is above the range of its law
    with collected_warnings():
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


def _settling(
    time: NDArray[np.float64],
    *,
    mass: float,
    force: float,
    radius: float,
    density: float,
    viscosity: float,
) -> NDArray[np.float64]:
    r"""Speed [m/s] of a sphere in a liquid that a constant force starts from rest, exactly.

    Stokes' drag and Basset's memory, :math:`V(s) = F/(s\,(M s + D\sqrt{\tau s} + D))` with
    :math:`\tau = a^2/\nu`, by the roots of the quadratic in :math:`\sqrt s` (Boussinesq 1885).
    ``mass`` [kg] has the added mass; ``density`` and ``viscosity`` are those of the liquid.
    """
    drag = 6.0 * pi * viscosity * radius
    memory = drag * sqrt(radius**2 * density / viscosity)
    a, b = np.roots([mass, memory, drag]).astype(complex)

    def part(z: complex) -> NDArray[np.complex128]:
        return np.asarray((wofz(-1j * z * np.sqrt(time)) - 1.0) / z)

    return np.asarray((force / mass * (part(a) - part(b)) / (a - b)).real)


def settling_error() -> float:
    """Largest deviation from the closed form over the last speed [-], at Re = 1e-3."""
    density, viscosity, radius = _OIL, 1.0, 1.5e-3
    mass = 8.0 * density * 4.0 / 3.0 * pi * radius**3
    force = 6.0 * pi * viscosity * radius * 3.6e-4
    drag = UnsteadyDrag(shape="sphere", radius=radius)
    parts: dict[str, Component] = {
        "sphere": component("rigid-mass", mass=mass),
        "push": component("constant-force", force=force),
        "drag": drag,
    }
    joined = [["sphere.body", "push.end", "drag.body"]]
    run = simulate_network(
        Network(parts, joined, fluid=_liquid(density, viscosity)).rows(),
        duration=0.05,
        step=1e-6,
        record=5e-5,
        start="free",
    )
    exact = _settling(
        run.time[1:],
        mass=mass + drag.added(density),
        force=force,
        radius=radius,
        density=density,
        viscosity=viscosity,
    )
    computed = run.channels["sphere.body velocity"].values[1:]
    return float(np.abs(computed - exact).max() / exact[-1])


@dataclass(frozen=True, slots=True, kw_only=True)
class Rebound:
    """A steel sphere that falls through silicone oil onto glass and bounces; measured.

    P. Gondret, M. Lance, L. Petit, Phys. Fluids 14 (2002) 643; conditions as in E. Biegert,
    B. Vowinckel, E. Meiburg, J. Comput. Phys. 340 (2017), table 1; read from pictures 2 ms apart.

    Parameters
    ----------
    radius [m]
    density_ratio [-]
        Sphere over liquid.
    kinematic_viscosity [m^2/s]
    speed [m/s]
        Of arrival, constant down to 1 mm.
    heights [m], tops [s]
        Of the rebounds, and their times after the first contact.
    contacts [s]
        Times of the contacts after the first one.
    """

    stokes: float
    radius: float
    density_ratio: float
    kinematic_viscosity: float
    speed: float
    heights: tuple[float, ...]
    tops: tuple[float, ...]
    contacts: tuple[float, ...]


REBOUNDS = (
    Rebound(
        stokes=152.0,
        radius=1.5e-3,
        density_ratio=8.342,
        kinematic_viscosity=1.070e-5,
        speed=0.585,
        heights=(7.47e-3, 2.23e-3, 0.52e-3, 0.10e-3),
        tops=(38e-3, 106e-3, 140e-3, 156e-3),
        contacts=(83.7e-3, 130.1e-3, 153e-3),
    ),
    Rebound(
        stokes=27.0,
        radius=3e-3,
        density_ratio=8.083,
        kinematic_viscosity=1.036e-4,
        speed=0.518,
        heights=(1.97e-3,),
        tops=(19e-3,),
        contacts=(42.4e-3,),
    ),
)
_DRY = 0.97  # restitution of steel on glass in air
CUT_OFF = 5e-6
"""Cut-off [m] of the films of both, the one number that is fitted."""
_FROM = 0.5  # radii from which the sphere starts: the film is that of a parabola from there on
_RECORD = 20e-6  # [s]


def rebounds(
    shot: Rebound,
    *,
    cut_off: float = CUT_OFF,
    memory: bool = True,
    typical_speed: float | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Height [m] of a sphere over 0.2 s after its first contact, of its rebounds, their contacts.

    Parameters
    ----------
    cut_off [m]
        Of the film, by roughness.
    memory, typical_speed
        As of ``unsteady-drag``.

    Returns
    -------
    course (2, n) [s], [m]
    heights (rebounds,) [m]
    contacts (rebounds,) [s]
    """
    a, start = shot.radius, _FROM * shot.radius
    law = HertzLaw(4.0 / 3.0 * STEEL.modulus * sqrt(a))
    film = SphereFilm(shape="sphere", radius=a, cut_off=cut_off)
    weight = 9.81 * (1.0 - 1.0 / shot.density_ratio)
    mass = shot.density_ratio * _OIL * 4.0 / 3.0 * pi * a**3
    parts: dict[str, Component] = {
        "sphere": component("rigid-mass", mass=mass, speed=-shot.speed),
        "wall": component("end-stop", gap=start, film=film).with_law(
            HuntCrossley(law, gonthier_coefficient(_DRY)), 0.0
        ),
        "drag": UnsteadyDrag(shape="sphere", radius=a, memory=memory, typical_speed=typical_speed),
        "weight": Gravity(acceleration=weight),
    }
    joined = [["sphere.body", "wall.upper", "drag.body", "weight.body"], ["wall.lower", "ground"]]
    fluid = _liquid(_OIL, _OIL * shot.kinematic_viscosity)
    run = simulate_network(
        Network(parts, joined, fluid=fluid).rows(),
        duration=0.2 + start / shot.speed,
        step=20e-9,
        record=_RECORD,
        start="free",
    )
    height = start + run.channels["sphere.body displacement"].values
    rising = np.diff(height) > 0.0
    top = np.flatnonzero(rising[:-1] & ~rising[1:]) + 1
    low = np.flatnonzero(~rising[:-1] & rising[1:]) + 1
    time = run.time - run.time[low[0]]
    return np.array([time, height]), height[top], time[low[1:]]
