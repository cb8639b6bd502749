r"""A rigid mass on one point with a layer of asperities, and what its impact is in closed form.

The pressure is straight between points of the curve, so the mass moves on arcs of oscillators: from
the closure :math:`c_j` with the pressure :math:`p_j`, its slope :math:`s_j` and the speed
:math:`v_j` on

.. math:: R_j = \sqrt{p_j^2 + s_j \tfrac{m}{A} v_j^2}, \qquad
    t = \sqrt{\frac{m}{A s_j}} \left(\arcsin\frac{p}{R_j} - \arcsin\frac{p_j}{R_j}\right) .
"""

from dataclasses import dataclass, replace
from math import asin, sqrt

import numpy as np
from numpy.typing import NDArray

from klack.contact.asperity_layer import AsperityLayer
from klack.transient.interface_model import InterfaceModel
from klack.transient.interface_run import simulate_interface
from klack.verification.check import Check, compare
from klack.verification.interface_bodies import advance, free_rod, rigid_body

__all__ = ["LAYER", "MassOnLayer", "rough_checks", "rough_rod", "time_above"]

_GROUP = "interface"

LAYER = AsperityLayer.of_summits(rms=0.2e-6, radius=50e-6, density=0.05, modulus=115e9)
"""Steel on steel, ground."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MassOnLayer:
    """A rigid mass that meets a layer.

    Parameters
    ----------
    layer : AsperityLayer
    mass : float [kg]
    area : float [m^2]
    stiffness : float [N/m]
        Of the bodies behind the layer, in series.
    """

    layer: AsperityLayer = LAYER
    mass: float = 3e-3
    area: float = 4e-6
    stiffness: float = 1e15

    @property
    def model(self) -> InterfaceModel:
        """Model of the interface level."""
        point = rigid_body(
            mass=self.mass, inertia=(1.0, 1.0, 1.0), points=np.zeros((1, 3)), stiffness=1.0
        )
        return replace(
            point,
            compliance=np.array([[1.0 / self.stiffness]]),
            area=np.array([self.area]),
            layer=self.layer,
        )

    def peak(self, speed: float) -> float:
        """Highest force [N] on rigid bodies: all energy is in the layer."""
        return self.area * self._arcs(speed)[1]

    def time_above(self, force: float, speed: float) -> float:
        """Time [s] for which rigid bodies press harder than a force, in and out."""
        return 2.0 * self._arcs(speed, force / self.area)[0]

    def _arcs(self, speed: float, above: float = 0.0) -> tuple[float, float]:
        """Time [s] from a pressure to the highest one, and the latter [Pa]."""
        curve, per_area = self.layer, self.mass / self.area
        slope = np.diff(curve.pressure) / np.diff(curve.closure)
        energy = curve.state(curve.closure)[2]
        time = 0.0
        for j in range(len(slope)):
            squared = speed**2 - 2.0 * energy[j] / per_area
            radius = sqrt(curve.pressure[j] ** 2 + slope[j] * per_area * squared)
            last = j + 1 == len(slope) or radius <= curve.pressure[j + 1]
            begin = max(float(curve.pressure[j]), above)
            end = radius if last else float(curve.pressure[j + 1])
            if end > begin:
                arc = asin(min(end / radius, 1.0)) - asin(begin / radius)
                time += sqrt(per_area / slope[j]) * arc
            if last:
                return time, radius
        raise AssertionError


def time_above(force: float, history: NDArray[np.float64], step: float) -> float:
    """Time [s] for which mean forces of steps, straight between their middles, exceed a force."""
    is_above = np.flatnonzero(history > force)
    first, last = is_above[0], is_above[-1]
    before = (history[first] - force) / (history[first] - history[first - 1])
    after = (history[last] - force) / (history[last] - history[last + 1])
    return float(step * (last - first + before + after))


def rough_rod(modes: int = 10) -> InterfaceModel:
    """Steel rod D4 x L30 mm whose end is rough, over a rigid wall with a spring of 1e9 N/m."""
    rod = free_rod(modes, stiffness=1e9, gap=0.1e-6)
    return replace(rod, area=np.array([1e-6]), layer=LAYER)


def rough_checks() -> list[Check]:
    """Return the checks of contact points with a layer of asperities."""
    return [*_mass_on_layer(), *_rod()]


def _mass_on_layer() -> list[Check]:
    mass, speed, step = MassOnLayer(), 0.05, 10e-9
    peak = mass.peak(speed)
    run = simulate_interface(mass.model, speed=speed, duration=30e-6, step=step)
    force = run.history.force
    source = "arcs of oscillators on the pieces of the curve of Greenwood and Williamson"
    return [
        compare(
            _GROUP,
            "rigid mass on a layer of asperities: peak force [N]",
            expected=peak,
            computed=float(force.max()),
            tolerance=1e-5,
            source=source,
        ),
        compare(
            _GROUP,
            "rigid mass on a layer of asperities: time above half of the peak [s]",
            expected=mass.time_above(0.5 * peak, speed),
            computed=time_above(0.5 * peak, force, step),
            tolerance=5e-6,
            source=source,
        ),
        compare(
            _GROUP,
            "rigid mass on a layer of asperities: restitution [-]",
            expected=1.0,
            computed=float(run.motion.velocity[-1, 2]) / speed,
            tolerance=1e-13,
            source="an elastic layer gives all energy back",
        ),
    ]


def _rod() -> list[Check]:
    model, speed = rough_rod(), 0.5
    q, v = np.zeros((2, model.mode_count))
    v[0] = -speed * sqrt(model.mass)

    def end(steps: int) -> NDArray[np.float64]:
        return advance(model, q, v, step=20e-6 / steps, steps=steps).v

    exact = end(64_000)
    errors = [float(np.linalg.norm(end(n) - exact)) for n in (1000, 2000, 4000)]
    cut = simulate_interface(model, speed=speed, duration=5e-6, step=40e-9)
    return [
        compare(
            _GROUP,
            "rough rod with 10 modes through an impact: order of convergence of the step [-]",
            expected=2.0,
            computed=float(np.log2(errors[0] / errors[2]) / 2.0),
            tolerance=5e-2,
            source="forces of both ends weighed by energy, exact modes",
        ),
        compare(
            _GROUP,
            "rough rod, run ended while it is pressed: energy residual [-]",
            expected=0.0,
            computed=cut.energy.residual,
            tolerance=1e-13,
            source="the work of each step is the change of the energy of bodies and layer",
        ),
    ]
