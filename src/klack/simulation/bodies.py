"""Bodies without finite elements, for the lumped level and the exact one-dimensional tests."""

from math import pi, sqrt
from typing import Literal

import numpy as np

from klack.bodies.reduction.reduced_body import ReducedBody
from klack.errors import InputError, require_nonnegative, require_positive

__all__ = ["fixed_body", "rigid_mass_body", "rod_body"]


def rigid_mass_body(name: str, mass: float, *, port: str = "contact") -> ReducedBody:
    """Rigid mass [kg] that moves along z: one mode, shape ``1/sqrt(m)``, one ``port``."""
    require_positive(f"rigid_mass_body '{name}': mass", mass, "kg")
    return ReducedBody(
        name=name,
        mass=mass,
        omega=np.zeros(1),
        damping=np.zeros(1),
        port_names=(port,),
        port_shapes=np.full((1, 1), 1.0 / sqrt(mass)),
        observer_names=(),
        observer_shapes=np.zeros((1, 0)),
        static_compliance=np.zeros((1, 1)),
        rigid_count=1,
        rigid_axial=np.array([sqrt(mass)]),
        dof_count=1,
        correction="none",
    )


def fixed_body(name: str, *, port: str = "contact") -> ReducedBody:
    """Immovable wall: a body without modes, with one ``port``."""
    return ReducedBody(
        name=name,
        mass=np.inf,
        omega=np.zeros(0),
        damping=np.zeros(0),
        port_names=(port,),
        port_shapes=np.zeros((0, 1)),
        observer_names=(),
        observer_shapes=np.zeros((0, 0)),
        static_compliance=np.zeros((1, 1)),
        rigid_count=0,
        rigid_axial=np.zeros(0),
        dof_count=0,
        correction="none",
    )


def rod_body(
    name: str,
    *,
    length: float,
    area: float,
    young: float,
    density: float,
    elastic_modes: int,
    support: Literal["free", "bottom"] = "free",
    damping: float = 0.0,
) -> ReducedBody:
    r"""Thin elastic rod along z with its exact longitudinal modes; ports ``bottom`` and ``top``.

    Free: :math:`\omega_n = n\pi c/L`, shape :math:`\sqrt{2/m}\cos(n\pi z/L)`.  Held at the bottom:
    :math:`\omega_n = (n - \tfrac12)\pi c/L`, shape :math:`\sqrt{2/m}\sin((n-\tfrac12)\pi z/L)`.
    The static compliance is the exact one (free: inertia relief, ``L/(3EA)`` at an end and
    ``-L/(6EA)`` between the ends), so ``residual_compliance`` is what the truncation misses.

    Parameters
    ----------
    length, area [m], [m^2]
    young, density [Pa], [kg/m^3]
    damping [-]
        Ratio of every elastic mode.

    Examples
    --------
    >>> rod = rod_body("rod", length=0.03, area=1e-5, young=2e11, density=8e3, elastic_modes=20)
    >>> float(round(rod.compliance_share[0], 4))
    0.9704
    """
    for key, value, unit in (
        ("length", length, "m"),
        ("area", area, "m^2"),
        ("young", young, "Pa"),
        ("density", density, "kg/m^3"),
    ):
        require_positive(f"rod_body '{name}': {key}", value, unit)
    require_nonnegative(f"rod_body '{name}': elastic_modes", elastic_modes, "modes")
    require_nonnegative(f"rod_body '{name}': damping", damping, "-")
    mass, c, stiffness = density * area * length, sqrt(young / density), young * area / length
    n = np.arange(1, elastic_modes + 1)
    if support == "free":
        omega = np.concatenate(([0.0], n * pi * c / length))
        shapes = np.column_stack([np.ones(n.size), (-1.0) ** n]) * sqrt(2.0 / mass)
        shapes = np.vstack([np.full((1, 2), 1.0 / sqrt(mass)), shapes])
        static = np.array([[1.0 / 3.0, -1.0 / 6.0], [-1.0 / 6.0, 1.0 / 3.0]]) / stiffness
        rigid_axial = np.array([sqrt(mass)])
    elif support == "bottom":
        omega = (n - 0.5) * pi * c / length
        shapes = np.column_stack([np.zeros(n.size), -((-1.0) ** n)]) * sqrt(2.0 / mass)
        static = np.array([[0.0, 0.0], [0.0, 1.0]]) / stiffness
        rigid_axial = np.zeros(0)
    else:
        raise InputError(
            f"rod_body '{name}': support",
            got=repr(support),
            expected="'free' or 'bottom'",
            hint="a seat body is fixed at the bottom and has its contact at the top.",
        )
    return ReducedBody(
        name=name,
        mass=mass,
        omega=omega,
        damping=np.where(omega > 0.0, damping, 0.0),
        port_names=("bottom", "top"),
        port_shapes=shapes,
        observer_names=(),
        observer_shapes=np.zeros((omega.size, 0)),
        static_compliance=static,
        rigid_count=rigid_axial.size,
        rigid_axial=rigid_axial,
        dof_count=omega.size,
        correction="none",
    )
