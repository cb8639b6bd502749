r"""Stability margins of a loop that is opened where one component acts on the others.

The closed loop tells the open one (return ratio, Bode 1945): what a component adds at a place, per
what is injected there, is :math:`T = -L/(1 + L)`, so :math:`L = -T/(1 + T)`.

Open loop of a PID controller: its law, its sampling, its sensor, and the valve between.

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
import scipy
from numpy.typing import NDArray

from klack.analyses.linearisation.record import LoopMargins
from klack.control.controlled import Controlled
from klack.control.pid import PidController
from klack.errors import InputError, refuse_if
from klack.hydraulics.gas.gas_source import GasSource
from klack.input.problem import one_of
from klack.network.network import Network
from klack.network.port import Role
from klack.network.rows import Rows
from klack.simulation.linear_system import LinearSystem, Signal, transfer
from klack.units import KINDS, parse_quantity

__all__ = ["controllers_of", "gas_drives", "loop_margins", "pid_loop", "plain_name", "return_ratio"]


def plain_name(name: str) -> str:
    """Name of a signal, however its words are joined."""
    return ".".join(name.replace("_", ".").replace(" ", ".").split("."))


def controllers_of(network: Network) -> dict[str, Controlled]:
    """Components with a controller, by name."""
    return {n: part for n, part in network.components.items() if isinstance(part, Controlled)}


def pid_loop(
    name: str, network: Network, rows: Rows, system: LinearSystem
) -> tuple[Callable[[float], complex], float]:
    """Open loop of a controller over the frequency [Hz], and half its sampling rate [Hz].

    InputError for another law than a PID, and for a sensor whose channel the linear model lacks.
    """
    part = controllers_of(network)[name]
    law = part.controller
    if not isinstance(law, PidController):
        raise InputError(
            f"--loop {name}",
            got=f"a controller of the kind '{'function' if law is None else law.kind}'",
            expected="a pid controller: a switch has no linear law",
            hint="a stroke shows whether it oscillates; margins do not describe a limit cycle.",
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
    refuse_if(
        plain_name(name) not in names,
        where,
        got=f"'{name}', which is not in the linear model",
        expected=f"one of: {one_of([x.name for x in signals])}",
        hint="give the sensor a displacement, velocity, pressure, flow or current.",
    )
    return names.index(plain_name(name))


def gas_drives(network: Network) -> dict[str, tuple[str, Network]]:
    """Unit, and network with one unit more, by the name of an input."""
    found = {}
    for name, part in network.components.items():
        if not isinstance(part, GasSource):
            continue
        source = part.at_start()
        assert isinstance(source, GasSource)
        warm = source.temperature or network.ambient.temperature
        changes: tuple[tuple[str, str, float], ...] = (
            ("pressure", "Pa", (source.pressure or 0.0) + 1.0),
            ("temperature", "K", warm + 1.0),
        )
        for key, unit, value in changes:
            changed = source.model_copy(update={key: value})
            found[f"{name}.{key}"] = (unit, network.with_components({name: changed}))
    return found


Vector = NDArray[np.float64]


def return_ratio(
    system: LinearSystem, output: int, source: int, sign: float
) -> Callable[[float], complex]:
    """Open loop over [Hz] through an output that adds ``sign`` times itself to an input."""

    def opened(frequency: float) -> complex:
        T = sign * complex(next(transfer(system, np.array([frequency])))[output, source])
        return -T / (1.0 + T)

    return opened


def loop_margins(name: str, opened: Callable[[float], complex], axis: Vector) -> LoopMargins:
    """Margins of an open loop over the frequency [Hz], closed by -1.

    Crossings are searched between the points of ``axis`` [Hz].
    """
    L = np.array([opened(float(f)) for f in axis])
    gain = _nearest(
        _crossings(axis, L.imag, lambda f: opened(f).imag, L.real < 0.0),
        lambda f: 1.0 / max(-opened(f).real, 1e-300),
        lambda x: abs(np.log(x)),
    )
    phase = _nearest(
        _crossings(axis, np.log(np.abs(L) + 1e-300), lambda f: np.log(abs(opened(f))), None),
        lambda f: float(np.degrees(np.angle(-opened(f)))),
        abs,
    )
    k = int(np.argmin(np.abs(1.0 + L)))
    return LoopMargins(
        name=name,
        frequency=axis,
        real=L.real.copy(),
        imaginary=L.imag.copy(),
        gain_margin=gain[0],
        gain_frequency=gain[1],
        phase_margin=phase[0],
        phase_frequency=phase[1],
        distance=float(np.abs(1.0 + L)[k]),
        distance_frequency=float(axis[k]),
    )


def _crossings(
    axis: Vector,
    values: Vector,
    at: Callable[[float], float],
    where: NDArray[np.bool_] | None,
) -> list[float]:
    found = []
    for i in np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0.0):
        if where is None or (where[i] and where[i + 1]):
            found.append(
                float(scipy.optimize.brentq(at, axis[i], axis[i + 1], xtol=1e-12 * axis[i]))
            )
    return found


def _nearest(
    places: list[float], value: Callable[[float], float], size: Callable[[float], float]
) -> tuple[float, float]:
    """Smallest value and its place; nan without any."""
    found = [(value(f), f) for f in places]
    return min(found, key=lambda pair: size(pair[0])) if found else (np.nan, np.nan)
