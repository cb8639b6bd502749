"""Coil spring with mass: waves run through its coils."""

from math import cos, expm1, pi, sin, sqrt
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, Strict

from klack.network.component import Component
from klack.network.port import ELEMENT, Port
from klack.network.rows import Book, Channel, Rows
from klack.network.step_function import step_function
from klack.units import Force, Mass, Ratio, Stiffness

__all__ = ["SurgingSpring"]

_MOST_MODES = 40


@step_function
def surging_spring_step(par: Any, state: Any, inp: Any, out: Any) -> int:
    """Spring between two ports with oscillators that both carry, exact for ports of even motion.

    par: stiffness, preload, oscillators n, then stiffness, damping, mass and sign of each.  State:
    displacement and velocity of each.
    """
    h, end0, end1, base0, base1 = inp[1], inp[2], inp[3], inp[4], inp[5]
    n = int(par[2])
    start, end = end0 - base0, end1 - base1
    force = par[1] + 0.5 * par[0] * (start + end)
    on_end, on_base = -force, force
    store, loss = end * (par[1] + 0.5 * par[0] * end), 0.0
    for i in range(n):
        k, c, m, sign = par[3 + 4 * i], par[4 + 4 * i], par[5 + 4 * i], par[6 + 4 * i]
        x, v = state[2 * i], state[2 * i + 1]
        s0, s1 = end0 + sign * base0, end1 + sign * base1
        way, after = 0.0, v
        pull = k * (0.5 * (s0 + s1) - x)  # as it is for a step of no length
        if h > 0.0:
            # z = s - x swings freely while s moves evenly: z'' + 2 g z' + w^2 z = 0
            rate, z, w2, g = (s1 - s0) / h, s0 - x, k / m, 0.5 * c / m
            wd, lost = sqrt(w2 - g * g), -expm1(-g * h)
            half = sin(0.5 * wd * h)
            turn = 2.0 * (1.0 - lost) * half * cos(0.5 * wd * h) / wd
            lost += 2.0 * (1.0 - lost) * half * half  # 1 less exp(-g h) cos(wd h)
            change = (lost + g * turn) * (rate - v) + w2 * turn * z
            after = v + change
            way = s1 - s0 + (lost - g * turn) * z - turn * (rate - v)
            pull = m * change / h
        stretch = s1 - x - way
        store += 0.5 * k * stretch * stretch + 0.5 * m * after * after
        if h > 0.0 and c > 0.0:
            loss += pull * (s1 - s0) - 0.5 * m * (after * after - v * v)
            loss -= 0.5 * k * (stretch * stretch - (s0 - x) * (s0 - x))
        on_end -= pull
        on_base -= sign * pull
        out[2 + 2 * i] = x + way
        out[3 + 2 * i] = after
    out[0], out[1] = on_end, on_base
    out[2 + 2 * n] = store
    out[3 + 2 * n] = loss
    return 0


class SurgingSpring(Component):
    r"""Linear spring with the mass of its coils: an elastic rod between two ports.

    Between fixed ends the rod has the frequencies (A. M. Wahl, Mechanical Springs, 1963, ch. 25)

    .. math:: \omega_i = i \pi \sqrt{k/m}, \qquad i = 1, 2, \ldots

    and with moving ends its dynamic stiffness is, without approximation,

    .. math::

        F_\text{end} = -F_0 - k\,(y_\text{end} - y_\text{base})
            - \sum_i k_i\,(s_i - x_i), \qquad
        m_i \ddot x_i = k_i (s_i - x_i), \qquad s_i = y_\text{end} - (-1)^i y_\text{base},

    an oscillator for each mode with :math:`k_i = 2 k`, :math:`m_i = 2 m / (i \pi)^2`.  The static
    stiffness is exact.  All modes above the ``modes`` first ones are two more oscillators, even and
    odd, with their mass and an answer that is right up to the fourth power of the frequency: the
    whole mass is there, and a third of it at an end whose other end is held.

    A step of any length is exact for ends of even motion.  ``damping`` is a share of critical
    damping, of each mode alike.

    Limits: linear, no contact between coils (coil bind) nor of the coils at their seats; the twist
    of the wire is in the axial stiffness.
    """

    type: ClassVar[str] = "surging-spring"
    ports: ClassVar = {
        "end": ELEMENT,
        "base": Port("mechanical", ELEMENT.role, optional=True),
    }

    stiffness: Stiffness = Field(gt=0, description="Spring rate k.")
    preload: Force = Field(
        description="Force F0 on 'end' at the start, positive in -z (closing); negative opens."
    )
    mass: Mass = Field(gt=0, description="Mass m of the moving coils.")
    modes: Annotated[int, Strict()] = Field(
        default=6, ge=1, le=_MOST_MODES, description="Surge modes between fixed ends."
    )
    damping: Ratio = Field(
        default=0.0, ge=0, lt=1, description="Damping ratio of each mode; 0.5 to 2 % is usual."
    )

    def frequencies(self) -> NDArray[np.float64]:
        """Frequencies of the kept modes between fixed ends [Hz]."""
        first = 0.5 * sqrt(self.stiffness / self.mass)
        return first * np.arange(1.0, self.modes + 1.0)

    def oscillators(self) -> NDArray[np.float64]:
        """Stiffness [N/m], damping [N s/m], mass [kg] and sign of each oscillator, by rows."""
        k, m, z = self.stiffness, self.mass, self.damping
        i = np.arange(1.0, self.modes + 1.0)
        mass, stiffness = 2.0 * m / (i * pi) ** 2, np.full(self.modes, 2.0 * k)
        sign = np.where(i % 2 == 1, 1.0, -1.0)
        # sums of all 1/i^2 and 1/i^4 over odd and even i, less those of the kept modes
        for parity, square, fourth in ((1.0, 8.0, 96.0), (-1.0, 24.0, 1440.0)):
            kept = i[sign[: self.modes] == parity]
            left = pi**2 / square - np.sum(1.0 / kept**2)
            slow = pi**4 / fourth - np.sum(1.0 / kept**4)
            rest = 2.0 * m / pi**2 * left
            omega2 = (left / slow) * pi**2 * k / m
            mass, stiffness = np.append(mass, rest), np.append(stiffness, rest * omega2)
            sign = np.append(sign, parity)
        damping = 2.0 * z * np.sqrt(stiffness * mass)
        return np.column_stack((stiffness, damping, mass, sign))

    def add_rows(self, rows: Rows) -> None:
        """Add one element; without ``base`` the spring acts against the ground."""
        table = self.oscillators()
        sign = table[:, 3]

        def at_rest(displacement: NDArray[np.float64]) -> NDArray[np.float64]:
            state = np.zeros(2 * len(sign))
            state[::2] = float(displacement[0]) + sign * float(displacement[1])
            return state

        rows.element(
            surging_spring_step,
            ports=(rows.port("end"), rows.port("base")),
            parameters=(self.stiffness, self.preload, len(table), *table.ravel()),
            state=at_rest(np.zeros(2)),
            at_rest=at_rest,
            books=(Book("energy", "store"), Book("damping", "loss")),
            channels=(Channel("first surge mode", "m", 0),),
            state_names={
                2 * i + k: (f"surge mode {i + 1}{word}", unit)
                for i in range(len(table))
                for k, (word, unit) in enumerate((("", "m"), (" velocity", "m/s")))
            },
        )
