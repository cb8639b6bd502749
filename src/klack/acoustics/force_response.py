r"""Vibration of a held body under the forces of its stops, exactly, step by step.

Forces are constant over each interval (recorded means), so modes are propagated without error,
from static equilibrium under the first force:

.. math:: \ddot q_i + 2 \zeta_i \omega_i \dot q_i + \omega_i^2 q_i = \sum_p \varphi_{ip} F_p

The energy injected at a port is :math:`\int F v\,\mathrm dt = \sum_k F_k\,(y_{k+1} - y_k)` with
the motion ``y`` of the modes, exactly. The loss :math:`\int 2 \zeta \omega \dot q^2 \mathrm dt` is
integrated over the exact motion, not taken as a difference, so their balance with the energy of
the modes is a check. The static rest of the omitted modes is a massless spring, which gives back
what it takes.

The force on the rigid hold follows from the momentum of the whole body,

.. math:: R = \sum_p F_p - \frac{\mathrm d}{\mathrm dt} \sum_i p_i \dot q_i,

exact at rest for any number of modes: the omitted ones are in static equilibrium with the force.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from klack.arrays import Floats
from klack.bodies.reduction.structure import Structure
from klack.errors import refuse_if
from klack.machine.compiling.jit import njit
from klack.signals.sampled import TimeSeries
from klack.simulation.propagator import damping_loss, modal_propagator

__all__ = ["ModalResponse", "aligned_forces", "modal_response", "port_forces"]


def port_forces(
    structure: Structure, stop_forces: Mapping[str, TimeSeries]
) -> dict[str, TimeSeries]:
    """Forces along +z at the ports that stops push.

    Parameters
    ----------
    stop_forces [N]
        By stop, above zero when it presses.
    """
    result = {}
    for port, stop, sign in zip(
        structure.port_names, structure.port_stops, structure.port_signs, strict=True
    ):
        if stop in stop_forces:
            given = stop_forces[stop]
            result[port] = TimeSeries(
                step=given.step,
                values=float(sign) * given.values,
                unit=given.unit,
                start=given.start,
                name=f"{structure.name}.{port}",
            )
    return result


def aligned_forces(
    structure: Structure, forces: Mapping[str, TimeSeries]
) -> tuple[TimeSeries, Floats]:
    """One force, for its time axis, and the forces at all ports (n, p) [N], on one grid."""
    refuse_if(
        not forces,
        f"forces on '{structure.name}'",
        got="none",
        expected=f"a force at one or more of: {', '.join(structure.port_names)}",
        hint="port_forces makes them from the forces of the stops.",
    )
    first = next(iter(forces.values()))
    result = np.zeros((first.values.size, len(structure.port_names)))
    for name, force in forces.items():
        same = (
            force.values.size == first.values.size
            and abs(force.step / first.step - 1.0) < 1e-9
            and abs(force.start - first.start) < 1e-6 * first.step
        )
        refuse_if(
            not same,
            f"forces on '{structure.name}': '{name}'",
            got=f"{force.values.size} values every {force.step:g} s from {force.start:g} s",
            expected=f"{first.values.size} every {first.step:g} s from {first.start:g} s",
            hint="bring all forces onto one grid.",
        )
        result[:, structure.port_index(name)] = force.values
    return first, result


@dataclass(frozen=True, kw_only=True, eq=False)
class ModalResponse:
    """Response of a structure to forces.

    Parameters
    ----------
    injected (p,) [J]
        Work of each force on the modes.
    energy_before [J]
        Static equilibrium at the start.
    modal_energy (m,) [J]
        Kinetic and strain, at the end.
    dissipated (m,) [J]
        In the damping of each mode.
    ringing (m,) [J]
        At the end about equilibrium under the last force: still to be lost if it stays.
    stored (n + 1,) [J]
        All modes, ends of intervals.
    blocked_force [N]
        Axial, on the hold, means; along +z from the forces.
    sample_time (k,) [s]
    modal_displacement, modal_velocity (k, m) [m sqrt(kg)], [m sqrt(kg)/s]
        At the sample times.
    """

    body: str
    port_names: tuple[str, ...]
    injected: Floats
    energy_before: float
    modal_energy: Floats
    dissipated: Floats
    ringing: Floats
    stored: Floats
    blocked_force: TimeSeries
    sample_time: Floats
    modal_displacement: Floats
    modal_velocity: Floats

    @property
    def injected_energy(self) -> float:
        """Work of all forces [J]."""
        return float(self.injected.sum())

    @property
    def vibration_energy(self) -> float:
        """Energy into vibration [J]: lost so far, or ringing."""
        return float(self.dissipated.sum() + self.ringing.sum())

    @property
    def residual(self) -> float:
        """Of the energy balance, over the throughput [-]."""
        held = float(self.modal_energy.sum()) - self.energy_before
        lost = float(self.dissipated.sum())
        scale = max(float(np.abs(self.injected).sum()), self.energy_before, float(self.stored[-1]))
        return (held + lost - self.injected_energy) / scale if scale > 0.0 else 0.0


def modal_response(
    structure: Structure, forces: Mapping[str, TimeSeries], *, sample: float | None = None
) -> ModalResponse:
    """Propagate the modes of a structure exactly under forces at its ports.

    Parameters
    ----------
    structure
        Rigidly held, or :func:`klack.acoustics.mount.mounted`.
    forces [N]
        By port, along +z, means over intervals whose middles are their times, on one grid.  The
        first value has always acted.
    sample [s]
        Spacing of recorded states; default: none.
    """
    axis, values = aligned_forces(structure, forces)
    every = _interval(sample, axis)
    w, zeta, phi = structure.omega, structure.damping, structure.port_shapes
    P = modal_propagator(w, zeta, axis.step)
    q = phi @ values[0] / w**2
    before = float(0.5 * np.sum((w * q) ** 2))
    n, m, count = len(values), len(w), (len(values) // every + 1 if every else 0)
    states = np.zeros((count, 2, m))
    stored, momentum, lost = np.zeros(n + 1), np.zeros(n + 1), np.zeros(m)
    work = np.zeros(phi.shape[1])
    v = np.zeros(m)
    _march(
        np.array([P.A11, P.A12, P.A21, P.A22, P.B1, P.B2]),
        damping_loss(w, zeta, axis.step),
        w**2,
        np.ascontiguousarray(phi),
        structure.participation,
        np.ascontiguousarray(values),
        q,
        v,
        every,
        states,
        stored,
        momentum,
        work,
        lost,
    )
    begin = axis.start - 0.5 * axis.step
    reaction = values.sum(axis=1) - np.diff(momentum) / axis.step
    return ModalResponse(
        body=structure.name,
        port_names=structure.port_names,
        injected=work,
        energy_before=before,
        modal_energy=0.5 * (v**2 + (w * q) ** 2),
        dissipated=lost,
        ringing=0.5 * (v**2 + (w * q - phi @ values[-1] / w) ** 2),
        stored=stored,
        blocked_force=TimeSeries(
            step=axis.step,
            values=reaction,
            unit=axis.unit,
            start=axis.start,
            name=f"{structure.name} blocked force",
        ),
        sample_time=begin + axis.step * every * np.arange(count, dtype=np.float64),
        modal_displacement=states[:, 0],
        modal_velocity=states[:, 1],
    )


def _interval(sample: float | None, axis: TimeSeries) -> int:
    """Intervals between recorded states; 0 for none."""
    if sample is None:
        return 0
    every = round(sample / axis.step)
    refuse_if(
        every < 1 or abs(every * axis.step / sample - 1.0) > 1e-6,
        "modal_response: sample",
        got=f"{sample:g} s for intervals of {axis.step:g} s",
        expected="a multiple of the interval",
        hint=f"for example {10 * axis.step:g} s.",
    )
    return every


@njit
def _march(  # type: ignore[no-untyped-def]
    A, Q, squares, phi, part, force, q, v, every, states, stored, momentum, work, lost
):  # pragma: no cover - compiled
    """Propagate all modes; ``q`` and ``v`` are states at the start, then at the end."""
    m, ports = phi.shape
    moved = np.zeros(ports)
    for k in range(len(force) + 1):
        if every > 0 and k % every == 0:
            states[k // every, 0] = q
            states[k // every, 1] = v
        total, carried = 0.0, 0.0
        for i in range(m):
            total += v[i] * v[i] + squares[i] * q[i] * q[i]
            carried += part[i] * v[i]
        stored[k] = 0.5 * total
        momentum[k] = carried
        if k == len(force):
            break
        for p in range(ports):
            moved[p] = 0.0
        for i in range(m):
            x, u, f = q[i], v[i], 0.0
            for p in range(ports):
                f += phi[i, p] * force[k, p]
            lost[i] += (
                Q[0, i] * x * x
                + Q[1, i] * x * u
                + Q[2, i] * u * u
                + f * (Q[3, i] * x + Q[4, i] * u + Q[5, i] * f)
            )
            q[i] = A[0, i] * x + A[1, i] * u + A[4, i] * f
            v[i] = A[2, i] * x + A[3, i] * u + A[5, i] * f
            for p in range(ports):
                moved[p] += phi[i, p] * (q[i] - x)
        for p in range(ports):
            work[p] += force[k, p] * moved[p]
