r"""What the gauges of a case read at each level.

Full order: the row of a gauge on the displacements of all nodes, step by step.  Modal levels: the
modes are linear oscillators under the contact forces that the level found, so their motion follows
once more from these forces, exactly for forces that are constant within each step, and

.. math:: y = \rho^T \Phi q + \Big(\rho^T K^+ - \rho^T \Phi_e \Omega_e^{-2} \Phi_e^T\Big) f

with the row :math:`\rho`, the kept modes and the static answer of the modes left out to the contact
forces *f* (mode acceleration; Craig & Kurdila 2006, ch. 17).  The level ``reduced`` has the
pressure pattern of its contact port for all forces: near the contact its gauges are no better than
that.  A velocity is that of the modes alone.  Constant forces and springs act on the whole body
like its weight, so they move it and do not strain it.

Waves shorter than those of the kept modes are missing: in a bar these are the parts of the force
above the highest kept mode, which at *f* are :math:`1 / (2 \pi f T)` of the peak of a half sine of
the duration *T*; in a block they are those of its rate.  What the upper modes add to the static
answer of the lower ones tells how far a gauge has settled (``upper_share``).
"""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.analyses.impact.record import LevelResult
from klack.assembling.bodies import BodyPair
from klack.assembling.problem import ContactProblem
from klack.assembling.reduced_pair import ReducedPair
from klack.bodies.gauges.gauge import Gauge, GaugeRecord
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.case.schema import Case
from klack.contact.history import ImpactHistory
from klack.errors import AccuracyWarning
from klack.transient.interface_model import InterfaceModel
from klack.transient.interface_result import InterfaceResult
from klack.transient.result import MotionOfBody, Snapshots

__all__ = ["FullGauges", "interface_gauges", "modal_motion", "with_reduced_gauges"]

Floats = NDArray[np.float64]

_UPPER = 0.5**0.5
"""Of the highest frequency: above it is half of the modes of a plane body."""


# ------------------------------------------------------------------------ full order


class FullGauges:
    """Reads gauges while every degree of freedom moves."""

    def __init__(self, pair: BodyPair) -> None:
        self._gauges = pair.gauges
        self._time: list[float] = []
        self._values: list[list[float]] = []

    def snapshots(self, case: Case) -> Snapshots | None:
        """Look after every step; None without a gauge."""
        if not self._gauges:
            return None
        steps = int(np.ceil(case.run.duration / case.run.full_step)) + 1
        return Snapshots(steps=range(steps + 1), receive=self._receive)

    def _receive(self, time: float, motion: tuple[MotionOfBody, ...]) -> None:
        fields = {item.name: item for item in motion}
        self._time.append(time)
        self._values.append(
            [
                float(
                    gauge.row
                    @ (
                        fields[gauge.body].velocity
                        if gauge.kind == "velocity"
                        else fields[gauge.body].displacement
                    )
                )
                for gauge in self._gauges
            ]
        )

    def records(self, step: float) -> tuple[GaugeRecord, ...]:
        """What was read."""
        return tuple(
            gauge.record(self._time[0], step, np.array(values))
            for gauge, values in zip(self._gauges, zip(*self._values, strict=True), strict=False)
        )


# ------------------------------------------------------------------------ modal levels


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModalMotion:
    """Modes over time, displacement and velocity, (n + 1, m) each; ``omega`` (m,) [rad/s].

    ``waves``: displacement beyond the static one under the same loads; 0 of rigid modes.
    """

    omega: Floats
    q: Floats
    v: Floats
    waves: Floats


def modal_motion(
    omega: Floats, damping: Floats, loads: Floats, velocity: Floats, step: float
) -> ModalMotion:
    r"""Motion of modes from rest under loads that are constant within each step.

    .. math:: q = \frac{1}{p_1 - p_2} (z_1 - z_2), \qquad \dot z_i = p_i z_i + f

    with the two poles of each mode; exact at any step.

    Parameters
    ----------
    omega, damping (m,) [rad/s], [-]
    loads (n, m)
        Modal force of each interval.
    velocity (m,)
        At the start.
    step [s]
    """
    n, m = loads.shape
    q, v = np.zeros((n + 1, m)), np.zeros((n + 1, m))
    for i in range(m):
        f = loads[:, i]
        if omega[i] == 0.0:
            v[:, i] = velocity[i] + step * np.append(0.0, np.cumsum(f))
            q[1:, i] = np.cumsum(0.5 * step * (v[1:, i] + v[:-1, i]))
            continue
        root = omega[i] * np.sqrt(complex(damping[i] ** 2 - 1.0) or 1e-12)
        states = []
        for pole in (-damping[i] * omega[i] + root, -damping[i] * omega[i] - root):
            decay = np.exp(pole * step)
            # of an impulse at the start the state is the velocity itself
            start = np.array([decay * velocity[i]])
            part, _ = scipy.signal.lfilter(
                [(decay - 1.0) / pole], [1.0, -decay], f.astype(complex), zi=start
            )
            states.append((pole, np.append(velocity[i], part)))
        (p1, z1), (p2, z2) = states
        q[:, i] = ((z1 - z2) / (p1 - p2)).real
        v[:, i] = ((p1 * z1 - p2 * z2) / (p1 - p2)).real
    elastic = omega > 0.0
    waves = np.zeros_like(q)
    waves[:, elastic] = q[:, elastic] - _at_edges(loads[:, elastic]) / omega[elastic] ** 2
    return ModalMotion(omega=omega, q=q, v=v, waves=waves)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Response:
    """What a body has for its gauges at a modal level.

    ``extra`` (n + 1, k): what the gauges read besides the modes.
    """

    gauges: tuple[Gauge, ...]
    shapes: Floats
    motion: ModalMotion
    extra: Floats = field(default_factory=lambda: np.zeros(0))

    def records(self, history: ImpactHistory) -> Iterator[GaugeRecord]:
        for k, gauge in enumerate(self.gauges):
            if gauge.kind == "velocity":
                values = self.motion.v @ self.shapes[k]
            else:
                values = self.motion.q @ self.shapes[k] + self.extra[:, k]
            record = gauge.record(history.start, history.step, values)
            yield self._judged(record, self.shapes[k])

    def _judged(self, record: GaugeRecord, shape: Floats) -> GaugeRecord:
        """With its highest mode, and what the upper half of the modes in a plane adds."""
        motion = self.motion
        omega = np.where(shape == 0.0, 0.0, motion.omega)
        upper = omega > _UPPER * omega.max(initial=0.0)
        moved = motion.v if record.kind == "velocity" else motion.waves
        added = replace(record, exact=moved[:, upper] @ shape[upper])
        peak = float(np.abs(record.values).max())
        return replace(
            record,
            kept_up_to=float(omega.max(initial=0.0)) / (2.0 * np.pi),
            upper_share=float(np.abs(added.values).max()) / peak if peak > 0.0 else 0.0,
        )


def _at_edges(values: Floats) -> Floats:
    """Means of n intervals at their n + 1 ends."""
    first, last = values[:1], values[-1:]
    return np.concatenate([first, 0.5 * (values[1:] + values[:-1]), last])


def _in_order(problem: ContactProblem, found: list[GaugeRecord]) -> tuple[GaugeRecord, ...]:
    by_name = {item.name: item for item in found}
    return tuple(by_name[gauge.name] for gauge in problem.pair.gauges if gauge.name in by_name)


def with_reduced_gauges(
    result: LevelResult, problem: ContactProblem, pair: ReducedPair
) -> LevelResult:
    """A reduced level with what its gauges read.

    The static solutions of ``problem`` still exist.
    """
    history, found = result.history, []
    sides = (
        (pair.upper, problem.flexibility_upper, pair.ports[0], 1.0),
        (pair.lower, problem.flexibility_lower, pair.ports[1], -1.0),
    )
    for body, flexibility, port, sign in sides:
        gauges = tuple(gauge for gauge in problem.pair.gauges if gauge.body == body.name)
        if not gauges:
            continue
        shapes = body.observer_shapes.T
        force = sign * history.force
        extra = np.zeros((len(force) + 1, len(gauges)))
        if body.correction == "consistent":
            static = flexibility.deflections(port.pattern[:, None])[:, 0]
            rows = np.array([gauge.row for gauge in gauges])
            elastic = slice(body.rigid_count, None)
            held = shapes[:, elastic] @ (body.port_shapes[elastic, 0] / body.omega[elastic] ** 2)
            extra = np.outer(_at_edges(force), rows @ static - held)
        motion = _reduced_motion(body, history, force, moving=sign > 0)
        response = _Response(gauges=gauges, shapes=shapes, motion=motion, extra=extra)
        found += list(response.records(history))
    return replace(result, gauges=_in_order(problem, found))


def _reduced_motion(
    body: ReducedBody, history: ImpactHistory, force: Floats, *, moving: bool
) -> ModalMotion:
    loads = np.outer(force, body.port_shapes[:, 0])
    velocity = np.zeros(body.mode_count)
    if moving:
        rigid = slice(0, body.rigid_count)
        loads[:, rigid] += np.outer(history.external_force / body.mass, body.rigid_axial)
        velocity[rigid] = -history.speed * body.rigid_axial
    return modal_motion(body.omega, body.damping, loads, velocity, history.step)


def interface_gauges(
    problem: ContactProblem, model: InterfaceModel, result: InterfaceResult
) -> tuple[GaugeRecord, ...]:
    """What the gauges read at the interface level.

    Warns, without channels, where the run is too long to keep the forces of all points.
    """
    if not problem.pair.gauges:
        return ()
    segment = result.impacts[0]
    history = segment.history
    if not len(segment.point_force):
        warnings.warn(
            "outputs: none at level interface, because its run is too long to keep the forces "
            "of all contact points. Try: a shorter run.duration, or a longer run.interface_step.",
            AccuracyWarning,
            stacklevel=2,
        )
        return ()
    forces = segment.point_force.astype(float)
    traces = model.traces
    if model.ways:
        forces = np.hstack([forces, segment.friction_force.astype(float)])
        traces = np.vstack([traces, model.tangents])
    loads = forces @ traces
    velocity = np.zeros(model.mode_count)
    own = (model.owner == 0) & (model.omega == 0.0)
    axial = model.mass * model.drift[0] * own  # modal velocities of a unit axial velocity
    velocity -= history.speed * axial
    loads += np.outer(history.external_force / model.mass, axial)
    extra = _at_edges(forces @ model.observed_residual.T)
    gauges = tuple(
        gauge for name in model.bodies for gauge in problem.pair.gauges if gauge.body == name
    )
    motion = modal_motion(model.omega, model.damping, loads, velocity, history.step)
    response = _Response(gauges=gauges, shapes=model.observed, motion=motion, extra=extra)
    return _in_order(problem, list(response.records(history)))
