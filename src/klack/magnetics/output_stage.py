r"""Output stage of a driver: battery, boost capacitor, switches, diodes and a clamp.

In every state of the driver the current takes one *path*, with the voltage at the coil

.. math:: u = U_b - U_z + k\,U_c - U_d - (R_s + R_d + R_z)\,i, \qquad
          C\,\dot U_c = -k\,i + i_r , \qquad i > 0,

with the battery :math:`U_b`, a clamp :math:`U_z` (a Zener diode, or a transistor in avalanche), the
forward voltage :math:`U_d` of the diodes, the resistances of switches, diodes and clamp, and the
boost capacitor: :math:`k = 1` discharges it into the coil, :math:`k = -1` takes the energy of the
coil back.  A converter recharges it up to its nominal voltage (:func:`recharged`).

Limits: switches are ideal apart from their resistance, diodes apart from forward voltage and
resistance (no reverse recovery); no resistance in series with the capacitor, no inductance of the
wires; an ideal battery.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.machine.compiling.jit import inner

__all__ = [
    "STAGE_HEADER",
    "STAGE_ROW",
    "START_VOLTAGE",
    "Capacitor",
    "OutputStage",
    "StagePath",
    "recharged",
    "stage_path",
    "still_voltage",
]

STAGE_HEADER = 6
"""Numbers of a stage before its paths: capacitance, nominal, power, current, efficiency, start."""

START_VOLTAGE = 5
"""Place of the voltage at the start in a stage."""

STAGE_ROW = 9
"""Numbers of a path: battery, clamp, k, diodes, three resistances, lowest voltage, next state."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StagePath:
    """Path of the current in one state of the driver.

    Parameters
    ----------
    battery [V]
        Source in the path.
    clamp [V]
        Against the current; its energy is lost.
    capacitor
        ``k``.
    diodes [V]
        Sum of the forward voltages.
    switch_resistance, diode_resistance, clamp_resistance [ohm]
    empty
        Voltage [V] of the capacitor, and the state for which the driver leaves at it.
    """

    battery: float = 0.0
    clamp: float = 0.0
    capacitor: int = 0
    diodes: float = 0.0
    switch_resistance: float = 0.0
    diode_resistance: float = 0.0
    clamp_resistance: float = 0.0
    empty: tuple[float, str] | None = None

    @property
    def still(self) -> float:
        """Voltage at the terminals without current and without the capacitor [V]."""
        return self.battery - self.clamp - self.diodes


@dataclass(frozen=True, slots=True, kw_only=True)
class Capacitor:
    """A boost capacitor with its converter.

    Parameters
    ----------
    capacitance [F]
    start [V]
    nominal [V]
        Up to which it is recharged.
    power [W]
        Power into the capacitor; 0: no recharge.
    current [A]
        Largest one into the capacitor; 0: no limit.
    efficiency [-]
        Of the converter.
    """

    capacitance: float
    start: float
    nominal: float
    power: float
    current: float
    efficiency: float

    def numbers(self) -> list[float]:
        """Flat capacitor for the compiled step."""
        numbers = [self.capacitance, self.nominal, self.power, self.current]
        return [*numbers, self.efficiency, self.start]


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputStage:
    """A stage with the paths of all states of its driver; ``capacitor`` None: a shared one."""

    capacitor: Capacitor | None
    paths: Mapping[str, StagePath]

    def numbers(self, states: Sequence[str]) -> NDArray[np.float64]:
        """Flat stage for the compiled step, the paths in the order of the states."""
        numbers = self.capacitor.numbers() if self.capacitor else [0.0] * STAGE_HEADER
        for name in states:
            path = self.paths[name]
            low, then = path.empty or (-1.0, name)
            numbers += [path.battery, path.clamp, float(path.capacitor), path.diodes]
            numbers += [path.switch_resistance, path.diode_resistance, path.clamp_resistance]
            numbers += [low, float(states.index(then))]
        return np.array(numbers)


@inner(error_model="numpy")
def recharged(par: Any, stage: int, voltage: float, time: float) -> float:
    r"""Voltage of the capacitor after the converter has worked for a time.

    At constant power :math:`U_1 = \sqrt{U_0^2 + 2 P t/C}`, at constant current
    :math:`U_1 = U_0 + I t/C`; the current limits where it is below :math:`P/U`.
    """
    capacitance, nominal = par[stage], par[stage + 1]
    power, limit = par[stage + 2], par[stage + 3]
    if power <= 0.0 or voltage >= nominal:
        return voltage
    left = time
    if limit > 0.0 and limit * voltage < power:
        end = min(power / limit, nominal)
        needed = capacitance * (end - voltage) / limit
        if left <= needed:
            return voltage + limit * left / capacitance
        voltage = end
        left -= needed
    # increments, so that nothing is lost over a short time
    square = 2.0 * power * left / capacitance
    return min(voltage + square / (sqrt(voltage * voltage + square) + voltage), nominal)


@inner(error_model="numpy", forceinline=True)
def stage_path(stage: int, mode: float) -> int:
    """Where the path of the current in a state of the driver starts."""
    return stage + STAGE_HEADER + STAGE_ROW * int(mode)


@inner(error_model="numpy", forceinline=True)
def still_voltage(par: Any, path: int, charged: float) -> float:
    """Voltage [V] along a path at a coil without current."""
    return par[path] - par[path + 1] + par[path + 2] * charged - par[path + 3]
