r"""Driver of a coil: a small state machine, compiled from every driver component.

A *state* has a voltage (constant, or a course over time), perhaps a diode that keeps the current
from turning negative, and *switches* into other states: current above or below a value, time in the
state, or time since the start of the cycle; the first that is due wins.  With a *target*, a current
over time, the currents of the switches count from there.

With a diode the coil is left open once its current has come down to zero, and is connected again
when the driver offers more than the coil induces, :math:`u > \dot\psi`.  Freewheeling is a state of
a small negative voltage (the forward voltage of a diode), fast decay one of a large negative
voltage (zener diode or boost capacitor): what flows back is a negative supply.

Limits: ideal switches without transients of their own; sources without inner resistance (add a
harness to the resistance of the coil).
"""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from klack.errors import refuse_if
from klack.input.problem import CaseProblem
from klack.magnetics.output_stage import OutputStage
from klack.network.component import Component
from klack.network.port import VOLTAGE, Port
from klack.network.rows import Rows
from klack.units import Time, Voltage, format_si

__all__ = [
    "DiodeDriver",
    "DriveCourse",
    "DriveProgram",
    "DriveState",
    "Driver",
    "Switch",
    "TimedDriver",
    "When",
    "driver_of",
]


class When(IntEnum):
    """Condition of a transition, by its number in the compiled program."""

    CURRENT_ABOVE = 0
    CURRENT_BELOW = 1
    STATE_LASTS = 2
    TIME = 3


@dataclass(frozen=True, slots=True)
class Switch:
    """Transition from a state.

    Parameters
    ----------
    value [A] or [s]
        Times in the state count from entering it, ``When.TIME`` from the start of the cycle.
    new_cycle
        A new cycle starts (``When.TIME`` only), exactly ``value`` after the last.
    """

    when: When
    value: float
    to: str
    new_cycle: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class DriveCourse:
    """Voltage or current over time since the start of the cycle, straight between its points.

    Parameters
    ----------
    time (n,) [s]
        Not falling; a time that stands twice is a jump.
    value (n,) [V] or [A]
        Constant before the first and after the last point.
    """

    time: NDArray[np.float64]
    value: NDArray[np.float64]

    def __init__(self, time: ArrayLike, value: ArrayLike) -> None:
        t, v = np.array(time, dtype=float).ravel(), np.array(value, dtype=float).ravel()
        refuse_if(
            t.size != v.size or t.size == 0 or np.any(np.diff(t) < 0),
            "DriveCourse",
            got=f"{t.size} times and {v.size} values"
            + (", decreasing times" if t.size == v.size > 0 else ""),
            expected="as many times as values, at least one, not decreasing",
            hint="sort the points by time; write a jump as the same time twice.",
        )
        object.__setattr__(self, "time", t)
        object.__setattr__(self, "value", v)

    def numbers(self) -> list[float]:
        """Flat course for the compiled step: ``n, times, values``."""
        return [float(self.time.size), *self.time, *self.value]


@dataclass(frozen=True, slots=True)
class DriveState:
    """State of a driver.

    Parameters
    ----------
    voltage [V]
    target [A]
        With a constant voltage only.
    """

    name: str
    voltage: float | DriveCourse
    switches: tuple[Switch, ...] = ()
    diode: bool = True
    target: DriveCourse | None = None


@dataclass(frozen=True, slots=True)
class DriveProgram:
    """States of a driver; it starts in the first one at time zero.

    Parameters
    ----------
    stage
        Paths of the current by state; the voltages of the states are then those without current.

    Examples
    --------
    >>> on = DriveState("on", 12.0, (Switch(When.CURRENT_ABOVE, 2.2, "off"),))
    >>> off = DriveState("off", -0.7, (Switch(When.CURRENT_BELOW, 1.8, "on"),))
    >>> DriveProgram((on, off)).numbers().size
    19
    """

    states: tuple[DriveState, ...]
    stage: OutputStage | None = None

    def __post_init__(self) -> None:
        names = [state.name for state in self.states]
        refuse_if(
            not names or len(set(names)) < len(names),
            "DriveProgram.states",
            got=f"the states {', '.join(names) or 'none'}",
            expected="at least one state, all with different names",
            hint="rename a state.",
        )
        for state in self.states:
            for switch in state.switches:
                _check(state, switch, names)

    def numbers(self) -> NDArray[np.float64]:
        """Flat program for the compiled step.

        ``[n] | offset of each state | states``; a state is ``source, diode, n switches`` and four
        numbers per switch ``when, value, next state, new cycle``; then ``voltage`` (source 0),
        ``n, times, voltages`` (source 1), or ``voltage, n, times, currents`` of the target
        (source 2).  Offsets count from the start of the program.
        """
        names = [state.name for state in self.states]
        blocks = [_block(state, names) for state in self.states]
        sizes = [block.size for block in blocks]
        starts = 1 + len(blocks) + np.concatenate(([0], np.cumsum(sizes[:-1])))
        return np.concatenate(([float(len(blocks))], starts, *blocks))

    @property
    def switching(self) -> bool:
        """Whether it switches to and fro within a cycle: a state can be reached from itself."""
        after = {
            state.name: {switch.to for switch in state.switches if not switch.new_cycle}
            for state in self.states
        }
        for name in after:
            reached, ahead = set[str](), set(after[name])
            while ahead:
                reached |= ahead
                ahead = set().union(*(after[other] for other in ahead)) - reached
            if name in reached:
                return True
        return False

    def stage_numbers(self) -> NDArray[np.float64]:
        """Flat output stage for the compiled step; none without one."""
        if self.stage is None:
            return np.zeros(0)
        return self.stage.numbers([state.name for state in self.states])


def _check(state: DriveState, switch: Switch, names: Sequence[str]) -> None:
    where = f"DriveState '{state.name}'"
    refuse_if(
        state.target is not None and isinstance(state.voltage, DriveCourse),
        where,
        got="a voltage over time and a target current",
        expected="a constant voltage with a target",
        hint="the switches of the state follow the target.",
    )
    refuse_if(
        switch.to not in names or (switch.to == state.name and not switch.new_cycle),
        where,
        got=f"a switch to '{switch.to}'",
        expected=f"another state: {', '.join(name for name in names if name != state.name)}",
        hint="check the names of the states.",
    )
    refuse_if(
        switch.new_cycle and (switch.when is not When.TIME or not switch.value > 0),
        where,
        got=f"a new cycle by {switch.when.name} {switch.value:g}",
        expected="When.TIME with a period above 0 s",
        hint="let a new cycle start after its period.",
    )


def _block(state: DriveState, names: Sequence[str]) -> NDArray[np.float64]:
    switches = [
        number
        for s in state.switches
        for number in (float(s.when), s.value, float(names.index(s.to)), float(s.new_cycle))
    ]
    if isinstance(state.voltage, DriveCourse):
        kind, source = 1.0, state.voltage.numbers()
    elif state.target is not None:
        kind, source = 2.0, [state.voltage, *state.target.numbers()]
    else:
        kind, source = 0.0, [state.voltage]
    return np.array([kind, float(state.diode), float(len(state.switches)), *switches, *source])


class Driver(Component):
    """Something with two terminals that drives a coil; joined to the terminals of a solenoid.

    It adds no rows: its coil runs its program, because switching depends on the current in the
    coil.
    """

    ports: ClassVar[Mapping[str, Port]] = {"terminals": VOLTAGE}

    @abstractmethod
    def program(self) -> DriveProgram:
        """States and switches of this driver."""

    def commands(self) -> tuple[tuple[float, float | None], ...]:
        """When it is switched on, and off again, in its first cycle [s].

        None for a course over time and a controller: which of their changes opens the valve is
        unknown.
        """
        return ()

    def add_rows(self, rows: Rows) -> None:
        """Add nothing: the coil runs the program."""


class DiodeDriver(Driver):
    """A driver that works from some time to another, perhaps again and again.

    Before and after, the decay voltage drives the current down through a diode, until the coil is
    open.
    """

    freewheel: Voltage = Field(
        default=0.7, ge=0, description="Forward voltage of the diode while the coil freewheels."
    )
    decay: Voltage | None = Field(
        default=None,
        ge=0,
        description="Voltage against the current after the end (Zener diode, boost capacitor); "
        "default: freewheeling.",
    )
    repeat_every: Time | None = Field(
        default=None, gt=0, description="Period of repetition; default no repetition."
    )

    @property
    def down(self) -> float:
        """Voltage at the coil while the driver is off [V]."""
        return -(self.freewheel if self.decay is None else self.decay)

    def between(self, start: float, end: float | None, *working: DriveState) -> DriveProgram:
        """Program of the working states, the first one entered at ``start``, left at ``end``."""
        states = [DriveState("idle", self.down, (Switch(When.TIME, start, working[0].name),))]
        for state in working:
            over = () if end is None else (Switch(When.TIME, end, "off"),)
            states.append(replace(state, switches=(*over, *state.switches)))
        if end is not None:
            again: tuple[Switch, ...] = ()
            if self.repeat_every is not None:
                again = (Switch(When.TIME, self.repeat_every, "idle", new_cycle=True),)
            states.append(DriveState("off", self.down, again))
        return DriveProgram(tuple(states))

    def require_period(self, end: float | None) -> None:
        """Reject a driver that would start again before its end."""
        if self.repeat_every is not None and (end is None or self.repeat_every < end):
            raise CaseProblem(
                ("repeat_every",),
                got=f"a period of {format_si(self.repeat_every, 's')}",
                expected="an end, and a period that is not shorter",
                hint="give an end, or a longer period.",
            )


class TimedDriver(DiodeDriver):
    """A driver that works from ``start`` to ``end``."""

    start: Time = Field(default=0.0, ge=0, description="When the driver switches on.")
    end: Time | None = Field(
        default=None, gt=0, description="When the driver switches off; default: never."
    )

    @model_validator(mode="after")
    def _order_of_times(self) -> Self:
        if self.end is not None and not self.end > self.start:
            raise CaseProblem(
                ("end",),
                got=f"an end at {format_si(self.end, 's')}",
                expected=f"a time after the start at {format_si(self.start, 's')}",
                hint="times count from the start of the run.",
            )
        self.require_period(self.end)
        return self

    def commands(self) -> tuple[tuple[float, float | None], ...]:
        """Its start and end."""
        return ((self.start, self.end),)

    def framed(self, *working: DriveState) -> DriveProgram:
        """Program of the working states, the first one entered at ``start``, with both ends."""
        return self.between(self.start, self.end, *working)


def driver_of(rows: Rows, port: str = "terminals") -> DriveProgram:
    """Program of the driver at the coil ``port`` of the present component."""
    drivers = [partner for partner in rows.partner(port) if isinstance(partner, Driver)]
    refuse_if(
        len(drivers) != 1,
        f"{rows.component}.{port}",
        got=f"{len(drivers)} drivers",
        expected="one driver at the terminals of a coil",
        hint="connect the port 'terminals' of one driver (voltage-step, peak-hold, ...) to it.",
    )
    return drivers[0].program()
