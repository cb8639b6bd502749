"""A sensor: any channel of a run, late, noisy and in steps."""

from collections import deque
from collections.abc import Callable
from math import floor
from typing import Annotated

import numpy as np
from pydantic import Field, Strict

from klack.input.section import Number, Section, Text
from klack.units import Time

__all__ = ["Sensor"]


class Sensor(Section):
    r"""Signal of a channel at the sampling instants of its controller.

    .. math:: s_k = q\,\mathrm{round}\bigl([\,c(t_k - t_d) + \sigma\,n_k\,]/q\bigr)

    ``channel`` is its name in the record of the run (``needle.tip displacement``, ``coil current``,
    ``sac pressure``); the signal, its noise and its quantisation count in ``unit``, and so do the
    numbers of the controller.  A channel that is a mean (a force, a flow) is that of the
    last look before the instant.  A delay that is no multiple of the sample time is interpolated
    between samples; before the start the channel is as at the start.
    """

    channel: Text = Field(description="Name of a recorded channel.")
    unit: Text = Field(description="Unit of the signal: um, A, bar, N; kg/s for a flow.")
    delay: Time = Field(default=0.0, ge=0, description="Dead time t_d.")
    noise: Number = Field(default=0.0, ge=0, description="Standard deviation of the noise.")
    seed: Annotated[int, Strict()] = Field(default=1, ge=0, description="Seed of the noise.")
    quantisation: Number = Field(default=0.0, ge=0, description="Step q of the signal; 0: none.")

    def begin(self) -> Callable[[float, float], float]:
        """Return a fresh sensor: its signal from a time [s] and the value of the channel then."""
        past: deque[tuple[float, float]] = deque()
        random = np.random.default_rng(self.seed)

        def read(time: float, value: float) -> float:
            past.append((time, value))
            wanted = time - self.delay
            while len(past) > 2 and past[1][0] <= wanted:
                past.popleft()
            signal = past[0][1]
            if len(past) > 1 and wanted > past[0][0]:
                (t0, v0), (t1, v1) = past[0], past[1]
                signal = v1 if wanted >= t1 else v0 + (v1 - v0) * (wanted - t0) / (t1 - t0)
            if self.noise > 0.0:
                signal += self.noise * float(random.standard_normal())
            if self.quantisation > 0.0:
                signal = self.quantisation * floor(signal / self.quantisation + 0.5)
            return signal

        return read
