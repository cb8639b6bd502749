"""Impacts along one axis that have exact answers, run through the reduced kernel."""

from math import pi

from klack.contact.history import ImpactHistory
from klack.contact.laws import ContactLaw, HertzLaw, LinearLaw
from klack.reduction.reduced_body import ReducedBody
from klack.simulation.bodies import fixed_body, rigid_mass_body, rod_body
from klack.simulation.impact import simulate_impact
from klack.simulation.system import AxialForce, ContactPair, ReducedSystem

__all__ = [
    "BAR_SPEED",
    "DENSITY",
    "NEEDLE_AREA",
    "mass_on_law",
    "needle_on_spring",
    "one_contact",
    "sphere_on_rod",
    "st_venant_rods",
    "steel_rod",
]

BAR_SPEED, DENSITY = 5000.0, 7850.0  # [m/s], [kg/m^3]
NEEDLE_AREA = pi * 2e-3**2  # [m^2]


def one_contact(
    a: ReducedBody,
    b: ReducedBody,
    law: ContactLaw,
    *,
    gap: float,
    series: float = 0.0,
    press: float = 0.0,
) -> ReducedSystem:
    """Lower end of ``a`` above the upper end of ``b``; ``press`` [N] pushes ``a`` down.

    Parameters
    ----------
    a, b : ReducedBody
    law : ContactLaw
    gap, series, press : float [m], [m/N], [N]
    """
    pair = ContactPair(
        body_a=a.name,
        port_a="bottom",
        body_b=b.name,
        port_b="top",
        law=law,
        gap=gap,
        series_compliance=series,
    )
    forces = (AxialForce(body=a.name, force=-press),) if press else ()
    return ReducedSystem(bodies=(a, b), contacts=(pair,), forces=forces)


def steel_rod(
    name: str, length: float, modes: int, *, clamped: bool = False, damping: float = 0.0
) -> ReducedBody:
    """Steel rod of 4 mm diameter (``c`` = 5000 m/s)."""
    return rod_body(
        name,
        length=length,
        area=NEEDLE_AREA,
        young=DENSITY * BAR_SPEED**2,
        density=DENSITY,
        elastic_modes=modes,
        support="bottom" if clamped else "free",
        damping=damping,
    )


def mass_on_law(
    mass: float, law: ContactLaw, *, speed: float, step: float, duration: float
) -> ImpactHistory:
    """Rigid mass on an immovable wall."""
    system = one_contact(
        rigid_mass_body("needle", mass, port="bottom"),
        fixed_body("wall", port="top"),
        law,
        gap=0.02 * speed * duration,
    )
    return simulate_impact(system, speed=speed, step=step, duration=duration)


def needle_on_spring(
    kappa: float, modes: int, *, static_spring: bool, step: float = 5e-4, duration: float = 14.0
) -> ImpactHistory:
    """Free rod with ``L = c = Z = m = v = 1`` on a wall through a spring ``kappa = k L/(EA)``."""
    rod = rod_body("rod", length=1.0, area=1.0, young=1.0, density=1.0, elastic_modes=modes)
    missing = float(rod.residual_compliance[0, 0]) if static_spring else 0.0
    law = LinearLaw(1.0 / (1.0 / kappa + missing))
    system = one_contact(rod, fixed_body("wall", port="top"), law, gap=0.1)
    return simulate_impact(system, speed=1.0, step=step, duration=duration)


def st_venant_rods(stiffness: float, modes: int, *, step: float) -> ImpactHistory:
    """Two free rods of equal section, 40 and 80 mm, at 1 m/s, with static correction."""
    a, b = steel_rod("a", 0.04, modes), steel_rod("b", 0.08, 2 * modes)
    missing = float(a.residual_compliance[0, 0] + b.residual_compliance[1, 1])
    system = one_contact(a, b, LinearLaw(stiffness), gap=0.1e-6, series=missing)
    return simulate_impact(system, speed=1.0, step=step, duration=60e-6)


def sphere_on_rod(inelasticity: float) -> ImpactHistory:
    """Rigid sphere with a Hertz law (m = K = v = 1) on a rod of impedance ``1/inelasticity``.

    The rod is so long that its far end is not felt during contact.
    """
    rod = rod_body(
        "rod",
        length=3.0,
        area=1.0 / inelasticity,
        young=1.0,
        density=1.0,
        elastic_modes=400,
        support="bottom",
    )
    system = one_contact(
        rigid_mass_body("sphere", 1.0, port="bottom"),
        rod,
        HertzLaw(1.0),
        gap=0.01,
        series=float(rod.residual_compliance[1, 1]),
    )
    return simulate_impact(system, speed=1.0, step=1e-3, duration=5.5)
