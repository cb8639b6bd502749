"""A sensor: any channel of a run, late, noisy and in steps."""

from collections import deque
from math import floor
from typing import Annotated

import numpy as np
from pydantic import Field, Strict

from klack.control.memory import Memory, generator_words, put_generator_words, remembered
from klack.input.section import Number, Section, Text
from klack.units import Time

__all__ = ["RunningSensor", "Sensor"]


class Sensor(Section):
    r"""Signal of a channel at the sampling instants of its controller.

    .. math:: s_k = q\,\mathrm{round}\bigl([\,c(t_k - t_d) + \sigma\,n_k\,]/q\bigr)

    ``channel`` is a name of the record (``needle.tip displacement``, ``coil current``, ``sac
    pressure``); the signal, its noise and its quantisation are in ``unit``, and so are the numbers
    of the controller.  A channel that is a mean (a force, a flow) is that of the last look before
    the instant.  A delay that is no multiple of the sample time is interpolated between samples;
    before the start the channel is as at the start.
    """

    channel: Text = Field(description="Name of a recorded channel.")
    unit: Text = Field(description="Unit of the signal: um, A, bar, N; kg/s for a flow.")
    delay: Time = Field(default=0.0, ge=0, description="Dead time t_d.")
    noise: Number = Field(default=0.0, ge=0, description="Standard deviation of the noise.")
    seed: Annotated[int, Strict()] = Field(default=1, ge=0, description="Seed of the noise.")
    quantisation: Number = Field(default=0.0, ge=0, description="Step q of the signal; 0: none.")

    def begin(self) -> "RunningSensor":
        """Fresh sensor: its signal from a time [s] and the value of the channel then."""
        return RunningSensor(self)


class RunningSensor:
    """A running sensor: values on their way, and the generator of its noise."""

    def __init__(self, sensor: Sensor) -> None:
        self._sensor = sensor
        self._past: deque[tuple[float, float]] = deque()
        self._random = np.random.default_rng(sensor.seed)

    def __call__(self, time: float, value: float) -> float:
        """Signal at a sampling instant."""
        sensor, past = self._sensor, self._past
        past.append((time, value))
        wanted = time - sensor.delay
        while len(past) > 2 and past[1][0] <= wanted:
            past.popleft()
        signal = past[0][1]
        if len(past) > 1 and wanted > past[0][0]:
            (t0, v0), (t1, v1) = past[0], past[1]
            signal = v1 if wanted >= t1 else v0 + (v1 - v0) * (wanted - t0) / (t1 - t0)
        if sensor.noise > 0.0:
            signal += sensor.noise * float(self._random.standard_normal())
        if sensor.quantisation > 0.0:
            signal = sensor.quantisation * floor(signal / sensor.quantisation + 0.5)
        return signal

    def memory(self) -> Memory:
        """Times and values on their way, and the state of the generator."""
        past = np.array(self._past, dtype=float).reshape(-1, 2)
        return {
            "times": past[:, 0].copy(),
            "values": past[:, 1].copy(),
            "generator": generator_words(self._random),
        }

    def recall(self, memory: Memory) -> None:
        """Continue from there."""
        times = remembered(memory, "times")
        values = remembered(memory, "values", times.size)
        words = remembered(memory, "generator", 6)
        self._past = deque(zip(map(float, times), map(float, values), strict=True))
        put_generator_words(self._random, words)
