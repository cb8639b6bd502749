"""What every controlled component has: sample time, sensors and a law."""

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field, PrivateAttr, model_validator

from klack.control.hysteresis import HysteresisController
from klack.control.law import Law, LawMaker
from klack.control.memory import Memory, Remembering
from klack.control.pid import PidController
from klack.control.sensor import RunningSensor, Sensor
from klack.control.state_machine import StateMachine
from klack.input.problem import CaseProblem, nearest, one_of, refuse_key_if
from klack.input.section import Name
from klack.network.component import Component
from klack.network.rows import ControllerRow, Rows
from klack.units import Time

__all__ = ["ControlLaw", "Controlled"]

_LAW = "law"
_SENSOR = "sensor"

ControlLaw = Annotated[
    PidController | HysteresisController | StateMachine, Field(discriminator="kind")
]


class Controlled(Component):
    """A component with one output that a controller sets at its sampling instants.

    The output is constant from one instant to the next; the first one is time zero.  No step is
    longer than the sample time.  In Python a function can be the controller: :meth:`by`; in a case
    file, which runs no code, one of the laws is.

    A run can continue from a stored state with a law, with a function that is a
    :class:`klack.control.memory.Remembering`, but not with an FMU.

    Limits: a run with a controller has no derivatives.
    """

    output_unit: ClassVar[str] = "-"
    """Unit of the output of its controller."""

    sample_time: Time = Field(
        gt=0, description="Time between two sampling instants, in whole steps of the time loop."
    )
    sensors: Mapping[Name, Sensor] = Field(
        default_factory=dict, description="Sensors by name: {channel: ..., unit: ...}."
    )
    controller: ControlLaw | None = Field(default=None, description="Law of the output.")

    _function: Law | LawMaker | None = PrivateAttr(None)

    @model_validator(mode="after")
    def _known_sensors(self) -> Self:
        for name in self.controller.used() if self.controller is not None else ():
            if name not in self.sensors:
                raise CaseProblem(
                    ("controller",),
                    got=f"the sensor '{name}'",
                    expected=f"one of: {one_of(self.sensors) if self.sensors else 'no sensors'}",
                    hint=nearest(name, self.sensors, "describe it under 'sensors'."),
                )
        return self

    def by(self, function: Law | LawMaker) -> Self:
        """Same component with a function as its controller.

        Parameters
        ----------
        function
            ``function(time, signals) -> output``: time [s], signals by the names of the sensors in
            their units, output [V], [N] or [Pa].  Called once at every sampling instant from time
            zero.  An object has ``begin(sample_time)``, which returns such a function for each run.
        """
        result = self.model_copy()
        result._function = function
        return result

    @property
    def own_law(self) -> Law | LawMaker | None:
        """What :meth:`by` gave."""
        return self._function

    def control(
        self, rows: Rows, actuator: Literal["voltage", "force", "pressure"], handle: int
    ) -> None:
        """Add the controller of ``handle``: a node, or the number of an element."""
        law, function = self.controller, self._function
        refuse_key_if(
            (law is None) == (function is None),
            ("components", rows.component, "controller"),
            got="no controller" if law is None else "a law and a function",
            expected="one of: pid, hysteresis, state-machine; or a function in Python",
            hint="add 'controller: {kind: pid, ...}', or use .by(function) in Python; an FMU: "
            f"--controller {rows.component}=FILE.fmu.",
        )

        def begin() -> _Running:
            made = function if law is None else law
            assert made is not None
            act = made.begin(self.sample_time) if isinstance(made, LawMaker) else made
            return _Running(act, {n: sensor.begin() for n, sensor in self.sensors.items()})

        rows.controllers.append(
            ControllerRow(
                component=rows.component,
                sensors=tuple(self.sensors),
                channels=tuple(sensor.channel for sensor in self.sensors.values()),
                units=tuple(sensor.unit for sensor in self.sensors.values()),
                period=self.sample_time,
                begin=begin,
                actuator=actuator,
                handle=handle,
            )
        )


class _Running:
    """Output of a law from the channels that its sensors read.

    Parameters
    ----------
    sensors
        In the order of the channels.
    """

    def __init__(self, act: Law, sensors: Mapping[str, RunningSensor]) -> None:
        self._act, self._sensors = act, dict(sensors)

    def __call__(self, time: float, values: tuple[float, ...]) -> float:
        """Output at a sampling instant [s] for the values of the channels, in their units."""
        read = zip(self._sensors.items(), values, strict=True)
        return self._act(time, {name: sensor(time, value) for (name, sensor), value in read})

    @property
    def can_be_stored(self) -> bool:
        """Whether a run can continue from what it remembers."""
        return isinstance(self._act, Remembering)

    def memory(self) -> Memory:
        """Memory of law and sensors; empty if it cannot be stored."""
        if not isinstance(self._act, Remembering):
            return {}
        parts = {_LAW: self._act.memory()}
        parts |= {f"{_SENSOR}.{name}": s.memory() for name, s in self._sensors.items()}
        return {f"{part}.{key}": a for part, found in parts.items() for key, a in found.items()}

    def recall(self, memory: Memory) -> None:
        """Continue from a memory; KeyError for one of other laws or sensors."""
        assert isinstance(self._act, Remembering)
        self._act.recall(_part(memory, _LAW))
        for name, sensor in self._sensors.items():
            sensor.recall(_part(memory, f"{_SENSOR}.{name}"))


def _part(memory: Memory, part: str) -> Memory:
    head = f"{part}."
    return {key[len(head) :]: a for key, a in memory.items() if key.startswith(head)}
