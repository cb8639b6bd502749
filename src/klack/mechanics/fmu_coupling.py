r"""Coupling of an FMU to the time loop: exchange at communication points, and what it costs.

The loop goes first.  At a communication point :math:`t_{k+1}` the FMU advances from :math:`t_k`
with the displacement of its end and the mean velocity of the interval, and gives the force
:math:`f_{k+1}`.  Until the next point the loop feels

.. math:: F(t) = f_{k+1} \quad\text{(hold)}, \qquad
          F(t) = f_{k+1} + \frac{f_{k+1} - f_k}{t_{k+1} - t_k}\,(t - t_{k+1}) \quad\text{(linear)}

The FMU itself did the work :math:`W_k = \tfrac12 (f_k + f_{k+1})(y_{k+1} - y_k)`, the loop got
:math:`\int F\,\mathrm dy`.  The difference is energy that coupling loses (above zero) or makes
(below), the residual energy of Sadjina et al. (2017), of first order in the coupling step for
``hold`` and of second for ``linear``.  The work is a supply of the energy balance, the difference a
loss, so that the balance of the whole network still closes to round-off.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.mechanics.fmu_slave import FmuSlave

__all__ = ["STATES", "Extrapolation", "FmuCoupling"]

Extrapolation = Literal["hold", "linear"]
Vector = NDArray[np.float64]

STATES = 6
"""Exchanges so far, time and displacement of the last one, its force, slope, work felt since."""

_ROUND_OFF = 1e-6  # of the coupling step


class FmuCoupling:
    """Step function of an imported FMU: two ports, :data:`STATES` states, two energy entries.

    Parameters
    ----------
    coupling_step [s]
        Shortest time between two exchanges; rounded up to whole steps of the loop.
    """

    def __init__(self, slave: FmuSlave, coupling_step: float, extrapolation: Extrapolation) -> None:
        self.slave, self.coupling_step = slave, coupling_step
        self.linear = extrapolation == "linear"
        self._ready = False  # in its initialisation
        self._exchange = [0.0] * STATES  # the last one
        self._began_from = -1.0  # exchanges before the last one
        self._loss = 0.0

    def __call__(self, par: Vector, state: Vector, inp: Vector, out: Vector) -> int:
        """One step; called again with a better end it does not exchange again."""
        t, h, y0, y1, base0, base1 = inp.tolist()  # plain numbers are faster one by one
        start, end = y0 - base0, y1 - base1
        now = state.tolist()
        if h == 0.0 or t < 0.0:  # the stores, of which there are none; the static start
            force = 0.0 if h == 0.0 else self._before_start(end, (end - start) / h)
            now[3] = force
            out[:] = (force, -force, *now, 0.0, 0.0)
            return 0
        if h > self.coupling_step * (1.0 + _ROUND_OFF):
            raise self._too_long(h)
        loss = 0.0
        if self._is_due(now, t):
            if not (self._began_from == now[0] and self._exchange[1] == t):
                self._communicate(now, t, start, (end - start) / h)
            now, loss = self._exchange, self._loss
        count, time, place, at_point, slope, felt = now
        force = at_point + slope * (t + 0.5 * h - time)
        work = force * (end - start)
        after = (count, time, place, at_point, slope, felt + work)
        out[:] = (force, -force, *after, work + loss, loss)
        return 0

    def _before_start(self, displacement: float, speed: float) -> float:
        if not self._ready:
            self.slave.begin()
            self._ready, self._began_from = True, -1.0
        return self.slave.force(displacement, speed)

    def _is_due(self, state: list[float], t: float) -> bool:
        return state[0] == 0.0 or t - state[1] >= self.coupling_step * (1.0 - _ROUND_OFF)

    def _communicate(self, state: list[float], t: float, y: float, speed: float) -> None:
        """Advance the FMU to ``t``; sets the exchange and the energy lost since the last one."""
        if state[0] == 0.0:
            if not self._ready:
                self.slave.begin()
            force, slope, self._loss = self.slave.force(y, speed), 0.0, 0.0
            self.slave.run()
            self._ready = False
        else:
            if state[0] != self._exchange[0] or state[1] != self._exchange[1]:
                raise _gone_on(self.slave)
            step = t - state[1]
            if not self.slave.fmu.variable_step and self._uneven(step):
                raise self._not_whole(step)
            force = self.slave.advance(state[1], step, y, (y - state[2]) / step)
            slope = (force - state[3]) / step if self.linear else 0.0
            before = state[3]
            self._loss = 0.5 * (before + force) * (y - state[2]) - state[5]
        self._began_from = state[0]
        self._exchange = [state[0] + 1.0, t, y, force, slope, 0.0]

    def _uneven(self, step: float) -> bool:
        return abs(step - self.coupling_step) > _ROUND_OFF * self.coupling_step

    def _too_long(self, h: float) -> InputError:
        return InputError(
            f"{self.slave.fmu.path.name}: coupling_step",
            got=f"{self.coupling_step:g} s, shorter than a step of {h:g} s",
            expected="at least one step of the time loop",
            hint="enlarge it to whole macro steps, or switch macro steps off: run: {coarse: 1}.",
        )

    def _not_whole(self, step: float) -> InputError:
        return InputError(
            f"{self.slave.fmu.path.name}: coupling_step",
            got=f"{self.coupling_step:g} s, and an exchange after {step:g} s",
            expected="whole steps of the time loop, for an FMU with fixed steps only",
            hint="use a whole number of macro steps (run.coarse times run.step).",
        )


def _gone_on(slave: FmuSlave) -> InputError:
    return InputError(
        slave.fmu.path.name,
        got="a run continued from a stored state",
        expected="a run from its start: the internal state of an FMU is not stored",
        hint="compute the whole time in one run.",
    )
