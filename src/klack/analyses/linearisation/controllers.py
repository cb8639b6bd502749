r"""Open loop of a PID controller: its law, its sampling, its sensor, and the valve between.

.. math::

    L(s) = \kappa\,e^{-s t_d}\;\frac{1 - e^{-sT}}{sT}\,
           \Bigl[K + \frac{K T}{T_i (1 - z^{-1})}
           + \frac{K T_d (1 - z^{-1})}{T_f + T - T_f z^{-1}}\Bigr] G(s), \qquad z = e^{sT}

with the valve :math:`G` from the actuator to the channel, units of the signal per SI
:math:`\kappa`, and an output that is held over the sample time :math:`T`.  Limit: frequencies below
half the sampling rate, where sampling folds nothing back.
"""

from collections.abc import Callable, Sequence

import numpy as np

from klack.control.controlled import Controlled
from klack.control.pid import PidController
from klack.errors import InputError
from klack.input.problem import one_of
from klack.network.network import Network
from klack.network.port import Role
from klack.network.rows import Rows
from klack.simulation.linear_system import LinearSystem, Signal, transfer
from klack.units import KINDS, parse_quantity

__all__ = ["controllers_of", "pid_loop", "plain_name"]


def plain_name(name: str) -> str:
    """Name of a signal however its words are joined."""
    return ".".join(name.replace("_", ".").replace(" ", ".").split("."))


def controllers_of(network: Network) -> dict[str, Controlled]:
    """Components with a controller, by name."""
    return {n: part for n, part in network.components.items() if isinstance(part, Controlled)}


def pid_loop(
    name: str, network: Network, rows: Rows, system: LinearSystem
) -> tuple[Callable[[float], complex], float]:
    """Open loop of a controller over the frequency [Hz], and half its sampling rate [Hz].

    Parameters
    ----------
    name : str
        Of the component.
    network : Network
        As the case has it, with its drivers.
    rows : Rows
        Of the operating point.
    system : LinearSystem

    Raises
    ------
    InputError
        For another law than a PID, and for a sensor whose channel the linear model has not.
    """
    part = controllers_of(network)[name]
    law = part.controller
    if not isinstance(law, PidController):
        raise InputError(
            f"--loop {name}",
            got=f"a controller of the kind '{'function' if law is None else law.kind}'",
            expected="a pid: a switch has no linear law",
            hint="a stroke shows whether it swings; its limit cycle is not a matter of margins.",
        )
    sensor = part.sensors[law.sensor]
    source = _place(system.inputs, _actuator(name, network, rows), f"--loop {name}")
    target = _place(system.outputs, sensor.channel, f"components.{name}.sensors.{law.sensor}")
    kind = next((kind for kind in KINDS if kind.unit == system.outputs[target].unit), None)
    scale = 1.0 if kind is None else 1.0 / parse_quantity(f"1 {sensor.unit}", kind, sensor.channel)
    T, gain = part.sample_time, law.gain

    def opened(frequency: float) -> complex:
        s = 2j * np.pi * frequency
        held = 1.0 - np.exp(-s * T)
        act = gain + gain * law.derivative_time * held / (
            law.derivative_filter + T - law.derivative_filter * np.exp(-s * T)
        )
        if law.integral_time is not None:
            act += gain * T / law.integral_time / held
        G = complex(next(transfer(system, np.array([frequency])))[target, source])
        return complex(scale * np.exp(-s * sensor.delay) * held / (s * T) * act * G)

    return opened, 0.5 / T


def _actuator(name: str, network: Network, rows: Rows) -> str:
    """Input of the linear model that a controller sets."""
    for node in network.nodes:
        if any(joint.component == name for joint in node.having(Role.VOLTAGE)):
            return f"{node.having(Role.COIL)[0].component}.voltage"
    row = next(row for row in rows.controllers if row.component == name)
    if row.actuator == "pressure":
        return f"{rows.nodes[row.handle].component}.pressure"
    port = rows.elements[row.handle].ports[0]
    points = {
        handle: f"{body.component}.{point}.force"
        for body in rows.bodies
        for handle, point in zip(body.ports, body.names, strict=True)
    }
    return points.get(port, "")


def _place(signals: Sequence[Signal], name: str, where: str) -> int:
    names = [plain_name(x.name) for x in signals]
    if plain_name(name) not in names:
        raise InputError(
            where,
            got=f"'{name}', which the linear model has not",
            expected=f"one of: {one_of([x.name for x in signals])}",
            hint="give the sensor a displacement, velocity, pressure, flow or current.",
        )
    return names.index(plain_name(name))
