"""A component of one's own: a brake by eddy currents, in compiled and in plain Python.

A conducting disc on the needle moves through a magnetic field.  The drag rises with the speed up to
a critical one and falls again, as the currents push the field out (Wouterse 1991):

    F = -c v / (1 + (v / v_c)^2)

Run it: ``python docs/how-to/eddy_brake.py``.
"""

from math import log
from typing import ClassVar

from pydantic import Field

from klack.mechanics.rigid_mass import RigidMass
from klack.network.component import Component
from klack.network.network import Network
from klack.network.port import ELEMENT
from klack.network.rows import Book, Rows
from klack.network.step_function import python_step, step_function
from klack.simulation.network_run import simulate_network
from klack.units import DampingCoefficient, Speed


def drag(par, state, inp, out):
    """One step: inp is t, h, y0, y1; out is the mean force and the heat."""
    damping, critical = par[0], par[1]
    h, moved = inp[1], inp[3] - inp[2]
    speed = moved / h if h > 0.0 else 0.0  # before the first step h is 0
    out[0] = -damping * speed / (1.0 + (speed / critical) ** 2)
    out[1] = -out[0] * moved  # all work against the drag is heat
    return 0


drag_step = step_function(drag)  # some nanoseconds per call


class EddyBrake(Component):
    r"""Drag of a conducting disc in a magnetic field.

    .. math:: F = -\frac{c v}{1 + (v / v_c)^2}

    Limits: currents as if steady, so for changes slower than the decay of the field in the disc.
    Source: J. H. Wouterse, IEE Proceedings B 138 (1991) 153.
    """

    type: ClassVar[str] = "eddy-brake"
    ports: ClassVar = {"disc": ELEMENT}

    damping: DampingCoefficient = Field(gt=0, description="Drag per speed at low speed, c.")
    critical_speed: Speed = Field(gt=0, description="Speed of the greatest drag, v_c.")

    def add_rows(self, rows: Rows) -> None:
        """Add one element that turns work into heat."""
        rows.element(
            drag_step,
            ports=(rows.port("disc"),),
            parameters=(self.damping, self.critical_speed),
            books=(Book("heat", "loss"),),
        )


class PlainEddyBrake(EddyBrake):
    """The same without compiler: any Python may stand in the step, at 2 us per call."""

    type: ClassVar[str] = "plain-eddy-brake"

    def add_rows(self, rows: Rows) -> None:
        """Add one element; the lengths are those of par, state, inp and out."""
        rows.element(
            python_step(drag, parameters=2, states=0, inputs=4, outputs=2),
            ports=(rows.port("disc"),),
            parameters=(self.damping, self.critical_speed),
            books=(Book("heat", "loss"),),
        )


def slow_down(brake: EddyBrake) -> tuple[float, float]:
    """Speed [m/s] of 3 g after 2 ms from 1 m/s, and energy residual over throughput."""
    parts = {"needle": RigidMass(mass=3e-3, speed=1.0), "brake": brake}
    network = Network(parts, [["needle.body", "brake.disc"]])
    result = simulate_network(
        network.rows(), duration=2e-3, step=200e-9, coarse=1, record=10e-6, start="free"
    )
    return float(result.channels["needle velocity"].values[-1]), result.books.relative_residual


def time_to(speed: float, damping: float, critical: float) -> float:
    """Exact time [s] from 1 m/s down to a speed, by separation of variables."""
    return -3e-3 / damping * (log(speed) + (speed**2 - 1.0) / (2.0 * critical**2))


if __name__ == "__main__":
    for kind in (EddyBrake, PlainEddyBrake):
        speed, residual = slow_down(kind(damping=2.0, critical_speed=0.5))
        exact = time_to(speed, 2.0, 0.5)
        print(f"{kind.type}: {speed:.6f} m/s after 2 ms (exact: {exact * 1e3:.6f} ms)")
        print(f"  energy residual {residual:.1e} of the throughput")
