"""Impacts along one axis with exact answers, by the reduced kernel; pulses; a bouncing drop."""

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import betaincinv

from klack.bodies.reduction.reduced_body import ReducedBody
from klack.contact.history import ImpactHistory
from klack.contact.laws import ContactLaw, HertzLaw, LinearLaw
from klack.signals.sampled import TimeSeries
from klack.simulation.bodies import fixed_body, rigid_mass_body, rod_body
from klack.simulation.impact import simulate_impact
from klack.simulation.system import AxialForce, ContactPair, ReducedSystem

__all__ = [
    "BAR_SPEED",
    "DENSITY",
    "NEEDLE_AREA",
    "BouncingDrop",
    "half_sines",
    "hertz_force",
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
    """Lower end of ``a`` above the upper end of ``b``; ``press`` [N] on ``a``, gap [m]."""
    pair = ContactPair(
        body_a=a.name,
        port_a="bottom",
        body_b=b.name,
        port_b="top",
        law=law,
        gap=gap,
        series_compliance=series,
    )
    return ReducedSystem(
        bodies=(a, b),
        contacts=(pair,),
        forces=(AxialForce(body=a.name, force=-press),) if press else (),
    )


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
    system = one_contact(
        rod, fixed_body("wall", port="top"), LinearLaw(1.0 / (1.0 / kappa + missing)), gap=0.1
    )
    return simulate_impact(system, speed=1.0, step=step, duration=duration)


def st_venant_rods(stiffness: float, modes: int, *, step: float) -> ImpactHistory:
    """Two free rods of equal section, 40 and 80 mm, at 1 m/s, with static correction."""
    a, b = steel_rod("a", 0.04, modes), steel_rod("b", 0.08, 2 * modes)
    system = one_contact(
        a,
        b,
        LinearLaw(stiffness),
        gap=0.1e-6,
        series=float(a.residual_compliance[0, 0] + b.residual_compliance[1, 1]),
    )
    return simulate_impact(system, speed=1.0, step=step, duration=60e-6)


def sphere_on_rod(inelasticity: float) -> ImpactHistory:
    """Rigid sphere with a Hertz law (m = K = v = 1) on a rod of impedance ``1/inelasticity``.

    Its far end is not felt during contact.
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


@dataclass(frozen=True, slots=True, kw_only=True)
class BouncingDrop:
    """Closed form: rest, free fall, contacts of a given time, parabolas, rest.

    During a contact the lift is the cubic that joins both speeds, exact at first touch and
    release.

    Parameters
    ----------
    speed [m/s]
        At first touch.
    acceleration [m/s^2]
    restitution
        Per impact; after the last flight the needle rests.
    contact [s]
    before, after [s]
        Of rest at the top, and on the seat.
    """

    speed: float
    acceleration: float
    restitution: tuple[float, ...]
    contact: float = 0.0
    before: float = 200e-6
    after: float = 300e-6

    @property
    def height(self) -> float:
        """From which it drops [m]."""
        return self.speed**2 / (2.0 * self.acceleration)

    @property
    def speeds(self) -> tuple[float, ...]:
        """Approach speed of each impact, and of the last touch [m/s]."""
        return tuple((self.speed * np.cumprod([1.0, *self.restitution])).tolist())

    @property
    def touches(self) -> tuple[float, ...]:
        """First touch of each impact, and of the last landing [s]."""
        times = [self.before + self.speed / self.acceleration]
        for w in self.speeds[1:]:
            times.append(times[-1] + self.contact + 2.0 * w / self.acceleration)
        return tuple(times)

    @property
    def duration(self) -> float:
        """Of the whole record [s]."""
        return self.touches[-1] + self.after

    def lift(self, time: np.ndarray) -> np.ndarray:
        """Height of the needle above its seat [m]."""
        a, v = self.acceleration, self.speeds
        fall = np.clip(time - self.before, 0.0, v[0] / a)
        x = np.where(time < self.touches[0], self.height - 0.5 * a * fall**2, 0.0)
        for k, touch in enumerate(self.touches[:-1]):
            release = touch + self.contact
            if self.contact > 0.0:
                u = np.clip((time - touch) / self.contact, 0.0, 1.0)
                dip = -self.contact * u * (1.0 - u) * (v[k] * (1.0 - u) + v[k + 1] * u)
                x = np.where((time >= touch) & (time < release), dip, x)
            s = time - release
            flies = (s >= 0.0) & (s < 2.0 * v[k + 1] / a)
            x = np.where(flies, v[k + 1] * s - 0.5 * a * s**2, x)
        return np.asarray(x)


def hertz_force(time: ArrayLike, *, duration: float, peak: float) -> np.ndarray:
    r"""Force [N] of an elastic Hertz impact at times [s] after first touch, in closed form.

    Zero before it and after ``duration`` [s]. Energy gives the time at a depth :math:`\delta`
    below first touch (Johnson 1985, section 11.4):

    .. math:: t = \frac{2 \delta_m}{5 v} B_u(2/5, 1/2), \qquad u = (\delta/\delta_m)^{5/2},

    with the incomplete beta function, whose inverse gives :math:`F = F_m u^{3/5}`.
    """
    t = np.asarray(time, dtype=float)
    return np.asarray(
        peak
        * betaincinv(0.4, 0.5, np.clip(np.minimum(t, duration - t) / (0.5 * duration), 0.0, 1.0))
        ** 0.6
    )


def half_sines(
    *, step: float, count: int, times: tuple[float, ...], length: float, peak: float = 100.0
) -> TimeSeries:
    """Half sines of a peak [N] that begin at some times [s], means over steps."""
    edges = step * np.arange(count + 1)
    impulse = np.zeros(count + 1)
    for start in times:
        phase = np.clip((edges - start) / length, 0.0, 1.0)
        impulse += peak * length / np.pi * (1.0 - np.cos(np.pi * phase))
    return TimeSeries(step=step, values=np.diff(impulse) / step, unit="N", start=0.5 * step)
