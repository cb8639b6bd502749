"""One stroke with other values of its parameters, computed many times by a calibration.

Meshes, modes and contact laws do not depend on these; they are made once.  A trial checks the
changed case as a whole, joins its network anew and runs it.  Trials are kept on disk for the same
command, if it is interrupted.
"""

from base64 import b64decode, b64encode
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.analyses.stroke.run import halved
from klack.analyses.unfinished import LogForm, UnfinishedLog, fingerprint
from klack.analyses.workers import LoggedWork
from klack.assembling.modes import damping_of
from klack.assembling.stops import StopFaces
from klack.assembling.valve import filled_network
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.case.any_case import CaseTree
from klack.case.free_parameters import FreeParameter
from klack.case.valve import ValveCase
from klack.case.valve_roles import ValveRoles
from klack.errors import InputError
from klack.input.problem import Key, one_of
from klack.machine.stages import trial
from klack.measurement.channels import LiftSensor, Trigger
from klack.measurement.lift_sensor import recorded_stroke
from klack.measurement.stroke_measures import StrokeSet
from klack.network.network import Network
from klack.simulation.network_run import simulate_network

__all__ = [
    "TRIAL_LOG",
    "Motion",
    "MotionModel",
    "StrokeModel",
    "TrialKey",
    "TrialPool",
    "calibration_mark",
    "channel_names",
    "trial_log",
]


_FINER, _MOST_COARSE = 2, 256
"""As parameters move, a touch moves between two fine steps, and the lift jumps by some nm; by a
third of that with half the step, which improves the derivatives as much.
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """Channels (n,) of one trial by role, SI, with a ``step`` [s] from time zero.

    ``impacts`` [s] are times by "opening" and "seat".
    """

    step: float
    channels: Mapping[str, NDArray[np.float32]]
    impacts: Mapping[str, tuple[float, ...]]

    @property
    def time(self) -> NDArray[np.float64]:
        """Of the channels, shape (n,) [s]."""
        count = next(iter(self.channels.values())).size
        return self.step * np.arange(count, dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionModel:
    """A valve of which some numbers of the case are still open.

    ``parameters`` are those of the motion, ``channels`` recorded ones by role; ``record`` [s] is
    the spacing of the records; ``by_layers`` [-] are damping ratios by the layers of bodies.
    ``halvings`` of all steps are those that the stroke of the case requires.
    """

    tree: CaseTree
    parameters: tuple[FreeParameter, ...]
    variant: str
    roles: ValveRoles
    channels: Mapping[str, str]
    reduced: Mapping[str, ReducedBody]
    by_layers: Mapping[str, NDArray[np.float64]]
    laws: Mapping[str, StopFaces]
    record: float
    halvings: int = 0

    def changes(self, values: Sequence[float]) -> dict[Key, str | float]:
        """Texts for the case at parameter values [SI]."""
        return {
            place.key: place.written(value)
            for parameter, value in zip(self.parameters, values, strict=True)
            for place in parameter.places
        }

    def at(self, values: Sequence[float]) -> tuple[ValveCase, Network]:
        """Case and network with these values [SI] of the parameters.

        InputError for values that the case refuses.
        """
        case = self.tree.case(self.changes(values))
        damped = {  # with the damping of the case; everything else of bodies is as it was
            name: replace(
                body,
                damping=damping_of(case.bodies[name].damping).ratios(body.omega)
                + self.by_layers.get(name, 0.0),
            )
            for name, body in self.reduced.items()
        }
        return case, filled_network(case, damped, self.laws)

    def run(self, values: Sequence[float], duration: float) -> Motion:
        """Compute one stroke with these values [SI] of the parameters.

        InputError for values that the case refuses.
        """
        case, network = self.at(values)
        if self.variant == "dry":
            network = network.dry()
        run, rows = case.run, network.rows()
        with trial():  # the fitted stroke warns
            result = simulate_network(
                rows,
                duration=duration,
                sizes=halved(case, rows, self.halvings) if self.halvings else None,
                accuracy=run.accuracy,
                step=run.fine_step / _FINER,
                coarse=None if run.coarse is None else min(run.coarse * _FINER, _MOST_COARSE),
                record=min(self.record, run.record),
            )
        names = {"opening": self.roles.opening_stop, "seat": self.roles.seat}
        return Motion(
            step=float(result.time[1] - result.time[0]),
            # single precision keeps 6 pm of 100 um, far below any noise
            channels={
                role: result.channels[name].values.astype(np.float32)
                for role, name in self.channels.items()
            },
            impacts={
                stop: tuple(event.time for event in result.events if event.stop == name)
                for stop, name in names.items()
                if name
            },
        )


def channel_names(
    network: Network, roles: ValveRoles, wanted: Sequence[str], where: str
) -> dict[str, str]:
    """Recorded channel of each role that a calibration needs.

    InputError for a role that the computed stroke does not have, or several times.
    """
    point = f"{roles.needle}.{roles.point}"
    coils = network.coil_labels()
    known = {"lift": [f"{point} displacement"], "velocity": [f"{point} velocity"]}
    known |= {role: [f"{coil} {role}" for coil in coils] for role in ("current", "voltage")}
    result = {}
    for role in wanted:
        names = known.get(role, [])
        if len(names) != 1:
            raise InputError(
                where,
                got=f"the channel '{role}', of which this valve has {len(names)}"
                + (f" ({one_of(names)})" if names else ""),
                expected=f"one of: {one_of(r for r, n in known.items() if len(n) == 1)}",
                hint="use only channels that the computed stroke has exactly once for trigger "
                "and fit.",
            )
        result[role] = names[0]
    return result


TrialKey = tuple[float, ...]
"""Duration [s] and parameter values [SI], to the last bit."""

TrialLog = UnfinishedLog[TrialKey, Motion]
"""Computed trials by duration and values."""


def calibration_mark(case: ValveCase, strokes: StrokeSet) -> str:
    """Digest of all that decides a trial: the case and the measured strokes."""
    return fingerprint(case, _deciding(case, strokes))


def _deciding(case: ValveCase, strokes: StrokeSet) -> Iterator[bytes]:
    for name, digest in case.own_components.items():
        yield f"{name} {digest}".encode()
    yield strokes.time.tobytes()
    for stroke in strokes.strokes:
        for role, values in stroke.values.items():
            yield role.encode()
            yield np.ascontiguousarray(values).tobytes()


def _data(key: TrialKey, motion: Motion) -> Mapping[str, Any]:
    return {
        "trial": list(key),
        "step": motion.step,
        "channels": {
            role: b64encode(values.astype("<f4").tobytes()).decode()
            for role, values in motion.channels.items()
        },
        "impacts": {stop: list(times) for stop, times in motion.impacts.items()},
    }


def _trial(data: Mapping[str, Any]) -> tuple[TrialKey, Motion]:
    motion = Motion(
        step=float(data["step"]),
        channels={
            str(role): np.frombuffer(b64decode(text, validate=True), dtype="<f4")
            for role, text in data["channels"].items()
        },
        impacts={str(stop): tuple(map(float, t)) for stop, t in data["impacts"].items()},
    )
    return tuple(map(float, data["trial"])), motion


TRIAL_LOG = LogForm(
    file="calibration.unfinished.jsonl",
    format="klack calibration 1",
    parts="computed strokes",
    data=_data,
    read=_trial,
)
"""How computed trials are kept."""
trial_log = TRIAL_LOG.open


class TrialPool(LoggedWork[TrialKey, Motion]):
    """Computes trials that the log does not hold, and keeps them there."""

    def __init__(self, model: MotionModel, workers: int, log: TrialLog) -> None:
        super().__init__(_run, model, workers, log, self._name_of)
        self.model = model
        self.used: set[TrialKey] = set()

    def motions(self, values: Sequence[Sequence[float]], duration: float) -> list[Motion]:
        """Motions for several parameter vectors [SI], in their order.

        Errors of a trial name its parameters.
        """
        keys: list[TrialKey] = [(duration, *map(float, item)) for item in values]
        self.used.update(keys)
        for _ in self.completed({key: key for key in keys}):
            pass
        return [self.log.done[key] for key in keys]

    def _name_of(self, key: TrialKey) -> str:
        values = ", ".join(
            f"{parameter.name} = {value:.6g} {parameter.unit}".rstrip()
            for parameter, value in zip(self.model.parameters, key[1:], strict=True)
        )
        return f"trial with {values}"


def _run(model: MotionModel, key: TrialKey) -> Motion:
    return model.run(key[1:], key[0])


Vector = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class StrokeModel:
    """Computed strokes as the bench would have recorded them.

    Parameters
    ----------
    parameters
        All, in the order of the fit.
    pool
        Computes motions, from parameters that are not of the sensor.
    zeroed
        Whether the lift before the trigger is set to zero.
    time (k,) [s]
        Of the measured strokes.
    channels, counted (k,)
        Fitted roles and samples.
    duration [s]
        To compute: up to the last fitted sample.
    """

    parameters: tuple[FreeParameter, ...]
    pool: TrialPool
    sensor: LiftSensor
    trigger: Trigger | None
    zeroed: bool
    time: Vector
    channels: tuple[str, ...]
    counted: NDArray[np.bool_]
    duration: float

    def __call__(self, vectors: Sequence[Vector]) -> list[Vector]:
        """Fitted samples of all channels, one after the other, for scaled parameters."""
        values = [self.unscaled(z) for z in vectors]
        motions = self.pool.motions([self._of_motion(v) for v in values], self.duration)
        return [
            np.concatenate([self.recorded(m, v)[role][self.counted] for role in self.channels])
            for m, v in zip(motions, values, strict=True)
        ]

    def unscaled(self, z: Vector) -> Vector:
        """Parameters [SI] from scaled ones."""
        return np.array(
            [
                p.lower + share * (p.upper - p.lower)
                for p, share in zip(self.parameters, z, strict=True)
            ]
        )

    def scaled(self, values: Vector) -> Vector:
        """Scaled parameters from those in SI."""
        return np.array(
            [
                (v - p.lower) / (p.upper - p.lower)
                for p, v in zip(self.parameters, values, strict=True)
            ]
        )

    def motion(self, values: Vector, duration: float) -> Motion:
        """Compute one motion for parameters in SI."""
        return self.pool.motions([self._of_motion(values)], duration)[0]

    def recorded(self, motion: Motion, values: Vector) -> Mapping[str, Vector]:
        """Channels on the time axis of the set, for a motion and parameters in SI."""
        return recorded_stroke(
            motion.time,
            {role: trace.astype(np.float64) for role, trace in motion.channels.items()},
            self.time,
            sensor=self.sensor_of(values),
            trigger=self.trigger,
            zeroed=self.zeroed,
        )

    def sensor_of(self, values: Vector) -> LiftSensor:
        """Sensor with its parameters in place."""
        changed = {
            str(place.key[-1]): float(value)
            for parameter, value in zip(self.parameters, values, strict=True)
            for place in parameter.places
            if place.key[0] == "measurement"
        }
        return LiftSensor.model_validate({**dict(self.sensor), **changed})

    def _of_motion(self, values: Vector) -> list[float]:
        return [
            float(value)
            for parameter, value in zip(self.parameters, values, strict=True)
            if not parameter.of_sensor
        ]
