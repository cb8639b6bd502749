"""Oblique impacts of spheres that others have measured."""

from functools import partial
from math import cos, radians, sin

import numpy as np
from numpy.typing import NDArray

from klack.contact.friction import Friction
from klack.materials import Material
from klack.verification.check import Check, ComparedCurve, compare
from klack.verification.half_space import SphereImpact

__all__ = ["alumina_on_glass", "oblique_spheres"]

_check = partial(compare, "measured")

# Kharaz, Gorham & Salman 2001: alumina sphere of 5 mm on soda-lime glass, 3.9 m/s, mu 0.092, as
# digitised by the makers of two programs: incidence in degrees, measured value
_TANGENTIAL = (
    (1.84, 0.79344), (3.703, 0.74533), (9.496, 0.67257), (20.012, 0.59691), (30.127, 0.68756),
    (39.382, 0.77148), (49.694, 0.84761), (60.02, 0.90142), (71.0693, 0.93657), (79.2277, 0.96952),
)  # fmt: skip
_SPIN = (
    (21.251, 577.65), (31.157, 612.88), (39.143, 595.49), (50.348, 453.21), (60.328, 382.09),
    (69.9606, 242.966), (78.5602, 142.355),
)  # fmt: skip
_ANGLE = ((20.567, 12.208), (30.29, 21.67), (39.535, 32.613), (49.747, 45.125), (60.208, 57.474))
_KHARAZ = "Kharaz, Gorham & Salman 2001, Powder Technol. 120:281 (measured; no free parameter)"
_STEEP = 15.0  # degrees; nearer to the normal the measurement is not that of linear elasticity


def alumina_on_glass(normal: float, cells: float = 6.0) -> SphereImpact:
    """Sphere of 5 mm on a thick plate, with a speed normal to it [m/s]."""
    alumina = Material(name="alumina", young=380e9, poisson=0.23, density=4000.0)
    glass = Material(name="glass", young=70e9, poisson=0.25, density=2500.0)
    return SphereImpact(radius=2.5e-3, sphere=alumina, ground=glass, speed=normal, cells=cells)


def oblique_spheres() -> list[Check]:
    """Return the checks of alumina on glass.

    Linear elasticity with one coefficient of friction does not hold near the normal.
    """
    friction, speed = Friction.coulomb(0.092), 3.9

    def hit(degrees: float) -> tuple[float, float, float]:
        angle = radians(degrees)
        after = alumina_on_glass(speed * cos(angle)).hit(speed * sin(angle), friction, steps=200)
        out = np.degrees(np.arctan2(after.centre, after.normal))
        return after.centre / (speed * sin(angle)), after.spin, float(out)

    tangential = np.array([hit(angle)[0] for angle, _ in _TANGENTIAL])
    spin = np.array([hit(angle)[1] for angle, _ in _SPIN])
    rebound = np.array([hit(angle)[2] for angle, _ in _ANGLE])
    angles, values = (np.array(column) for column in zip(*_TANGENTIAL, strict=True))
    steep = angles > _STEEP
    curve = ComparedCurve(
        x_label="angle of incidence [deg]",
        y_label="tangential restitution [-]",
        expected=(angles, values),
        computed=(angles, tangential),
    )
    return [
        _check(
            "alumina on glass above 15 degrees: tangential restitution, rms deviation [-]",
            expected=0.0,
            computed=_rms(tangential[steep] - values[steep]),
            tolerance=0.02,
            source=_KHARAZ,
            curve=curve,
        ),
        _check(
            "alumina on glass below 15 degrees: tangential restitution, rms deviation [-]",
            expected=0.0,
            computed=_rms(tangential[~steep] - values[~steep]),
            tolerance=0.12,
            source=_KHARAZ,
            curve=curve,
            reason="unlike bodies: linear elasticity with one coefficient gives 0.66 where 0.79 "
            "was measured; the difference is shown, not explained",
        ),
        _check(
            "alumina on glass above 15 degrees: spin after, rms deviation [rad/s]",
            expected=0.0,
            computed=_rms(spin - np.array([row[1] for row in _SPIN])),
            tolerance=25.0,
            source=_KHARAZ,
        ),
        _check(
            "alumina on glass above 15 degrees: rebound angle of the centre, rms deviation [deg]",
            expected=0.0,
            computed=_rms(rebound - np.array([row[1] for row in _ANGLE])),
            tolerance=0.4,
            source=_KHARAZ,
        ),
    ]


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))
