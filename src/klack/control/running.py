"""A controller that runs, with its sensors."""

from collections.abc import Mapping

from klack.control.law import Law
from klack.control.memory import Memory, Remembering
from klack.control.sensor import RunningSensor

__all__ = ["RunningControl"]

_LAW = "law"
_SENSOR = "sensor"


class RunningControl:
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
