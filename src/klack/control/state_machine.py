"""States with an output each, and transitions by signals and times."""

from collections.abc import Mapping
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from klack.control.memory import Memory, remembered
from klack.input.problem import CaseProblem, nearest, refuse_key_if
from klack.input.section import Name, Number, Section
from klack.units import Time

__all__ = ["MachineState", "RunningMachine", "StateMachine", "Transition"]

_ROUNDING = 1e-9  # of a sample time


class Transition(Section):
    """A way out of a state: a signal above or below a value, or a time in the state."""

    to: Name = Field(description="Next state.")
    sensor: Name | None = Field(
        default=None, description="Its signal is compared with above and below."
    )
    above: Number | None = Field(default=None, description="Taken at or above this signal.")
    below: Number | None = Field(default=None, description="Taken at or below this signal.")
    after: Time | None = Field(
        default=None, ge=0, description="Taken after this time in the state."
    )

    @model_validator(mode="after")
    def _one_condition(self) -> Self:
        given = [self.above is not None, self.below is not None, self.after is not None]
        refuse_key_if(
            sum(given) != 1 or (self.sensor is None) != (self.after is not None),
            ("to",),
            got=f"{sum(given)} conditions"
            + (" and no sensor" if self.sensor is None else f" and the sensor {self.sensor}"),
            expected="'sensor' with 'above' or 'below', or only 'after'",
            hint="write a transition for each condition; the first that holds is taken.",
        )
        return self


class MachineState(Section):
    """A state: its output, and the ways out of it in their order."""

    name: Name = Field(description="Name of the state.")
    output: Number = Field(description="Output (V, N or Pa) in it.")
    transitions: tuple[Transition, ...] = Field(
        default=(), description="Transitions out of the state."
    )


class StateMachine(Section):
    """States and transitions, looked at once in each sample; it starts in the first state."""

    kind: Literal["state-machine"] = Field(description="Which law: state-machine.")
    states: tuple[MachineState, ...] = Field(min_length=1, description="All states.")

    @model_validator(mode="after")
    def _known_states(self) -> Self:
        names = [state.name for state in self.states]
        refuse_key_if(
            len(set(names)) < len(names),
            ("states",),
            got=", ".join(names),
            expected="states with different names",
            hint="rename one.",
        )
        for i, state in enumerate(self.states):
            for j, way in enumerate(state.transitions):
                if way.to not in names or way.to == state.name:
                    raise CaseProblem(
                        ("states", i, "transitions", j, "to"),
                        got=f"'{way.to}'",
                        expected=f"another state: {', '.join(n for n in names if n != state.name)}",
                        hint=nearest(way.to, names, "add the state."),
                    )
        return self

    def used(self) -> tuple[str, ...]:
        """Sensors that it reads."""
        ways = [way for state in self.states for way in state.transitions]
        return tuple(dict.fromkeys(way.sensor for way in ways if way.sensor is not None))

    def begin(self, period: float) -> "RunningMachine":
        """Fresh machine for a sample time [s]."""
        return RunningMachine(self, period)


class RunningMachine:
    """A running state machine: its state, and when it entered it."""

    def __init__(self, law: StateMachine, period: float) -> None:
        self._states, self._period = law.states, period
        self._places = {state.name: k for k, state in enumerate(law.states)}
        self._state, self._entered = 0, 0.0

    def __call__(self, time: float, signals: Mapping[str, float]) -> float:
        """Output at a sampling instant."""
        for way in self._states[self._state].transitions:
            if way.after is not None:
                due = time - self._entered >= way.after - _ROUNDING * self._period
            elif way.above is not None:
                due = signals[str(way.sensor)] >= way.above
            else:
                due = signals[str(way.sensor)] <= float(way.below or 0.0)
            if due:
                self._state, self._entered = self._places[way.to], time
                break
        return self._states[self._state].output

    def memory(self) -> Memory:
        """Number of the state, and when it was entered [s]."""
        return {"state-machine": np.array([float(self._state), self._entered])}

    def recall(self, memory: Memory) -> None:
        """Continue from there."""
        state, self._entered = (float(x) for x in remembered(memory, "state-machine", 2))
        if not 0.0 <= state < len(self._states):
            raise KeyError("state-machine")
        self._state = int(state)
