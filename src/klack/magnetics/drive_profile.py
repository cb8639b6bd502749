"""Current or voltage that follows a drawn course, such as a braking pulse."""

from collections.abc import Iterator
from typing import ClassVar, Self

import numpy as np
from pydantic import Field, model_validator

from klack.input.problem import CaseProblem, refuse_key_if
from klack.magnetics.driver import (
    DiodeDriver,
    DriveCourse,
    DriveProgram,
    DriveState,
    Switch,
    When,
)
from klack.units import Current, Time, Voltage, format_si

__all__ = ["DriveProfile"]

_USUAL_BAND = 0.05  # of the largest current


class DriveProfile(DiodeDriver):
    r"""Straight lines between points of time: of the current, or of the voltage.

    A **current** is followed by switching: the supply below the target by half of the band,
    freewheeling above it by half of the band, the decay voltage above it by the whole band, where
    the target falls faster than the coil freewheels.  At a target of zero the driver is off.  The
    current lags, without notice, where the supply is too low for the slope, :math:`L\,di/dt > u -
    R\,i`.

    A **voltage** is applied as it is; a diode keeps the current from turning negative.

    Before the first and after the last point the driver is off, with the decay voltage against what
    flows.
    """

    type: ClassVar[str] = "drive-profile"

    time: tuple[Time, ...] = Field(
        min_length=2, description="Times in ascending order from 0; the same time twice for a jump."
    )
    current: tuple[Current, ...] | None = Field(
        default=None, description="Target current at these times; or give the voltage."
    )
    voltage: tuple[Voltage, ...] | None = Field(
        default=None, description="Voltage at the terminals, of either sign."
    )
    supply_voltage: Voltage | None = Field(
        default=None, gt=0, description="Voltage that raises the current; only with a current."
    )
    band: Current | None = Field(
        default=None,
        gt=0,
        description="Current between switching on and off about the target; default: 5 % of the "
        "largest current.",
    )

    @model_validator(mode="after")
    def _one_course(self) -> Self:
        refuse_key_if(
            (self.current is None) == (self.voltage is None),
            (),
            got="neither current nor voltage" if self.current is None else "both",
            expected="a current over time, or a voltage over time",
            hint="current: [0 A, 10 A, 10 A, 0 A] with supply_voltage: 65 V.",
        )
        values = self.current if self.current is not None else self.voltage or ()
        refuse_key_if(
            len(values) != len(self.time),
            ("time",),
            got=f"{len(self.time)} times for {len(values)} values",
            expected="as many times as values",
            hint="one value for each point of time.",
        )
        falls = [k for k in range(1, len(self.time)) if self.time[k] < self.time[k - 1]]
        if self.time[0] < 0 or falls or not self.time[-1] > self.time[0]:
            k = falls[0] if falls else 0
            raise CaseProblem(
                ("time", k),
                got=format_si(self.time[k], "s")
                + (f" after {format_si(self.time[k - 1], 's')}" if falls else ""),
                expected="times from 0 s in ascending order, the last one after the first",
                hint="write a jump as the same time twice.",
            )
        self.require_period(self.time[-1])
        return self

    @model_validator(mode="after")
    def _supply(self) -> Self:
        if self.current is None:
            given = "supply_voltage" if self.supply_voltage is not None else "band"
            refuse_key_if(
                self.supply_voltage is not None or self.band is not None,
                (given,),
                got=f"'{given}' with a voltage over time",
                expected="with a current over time only",
                hint="remove it.",
            )
            return self
        refuse_key_if(
            self.supply_voltage is None,
            ("supply_voltage",),
            got="a current over time without a supply",
            expected="the voltage that raises the current",
            hint="supply_voltage: 65 V, from a boost capacitor, or 14 V from the battery.",
        )
        if min(self.current) < 0 or not max(self.current) > 0:
            k = int(np.argmin(self.current))
            raise CaseProblem(
                ("current", k),
                got=f"{self.current[k]:g} A",
                expected="currents that are not negative, one of them above zero",
                hint="the driver has a diode: the current cannot turn negative.",
            )
        return self

    def program(self) -> DriveProgram:
        """States idle, follow, off; with a current on, freewheel, decay and pause, numbered."""
        start, end = self.time[0], self.time[-1]
        if self.current is None:
            course = DriveCourse(self.time, self.voltage or ())
            return self.between(start, end, DriveState("follow", course))
        pieces = list(_pieces(self.time, self.current))
        names = [f"{'on' if works else 'pause'}-{k + 1}" for k, (_, works) in enumerate(pieces)]
        states: list[DriveState] = []
        for k, (until, works) in enumerate(pieces):
            last = k + 1 == len(pieces)
            over = () if last else (Switch(When.TIME, until, names[k + 1]),)
            if works:
                states.extend(self._follow(f"{k + 1}", over))
            else:
                states.append(DriveState(names[k], self.down, over))
        return self.between(start, end, *states)

    def _follow(self, number: str, over: tuple[Switch, ...]) -> list[DriveState]:
        current = self.current or ()
        band = _USUAL_BAND * max(current) if self.band is None else self.band
        target = DriveCourse(self.time, current)
        on, slow, fast = f"on-{number}", f"freewheel-{number}", f"decay-{number}"
        high = Switch(When.CURRENT_ABOVE, 0.5 * band, slow)
        low = Switch(When.CURRENT_BELOW, -0.5 * band, on)
        far = Switch(When.CURRENT_ABOVE, band, fast)
        near = Switch(When.CURRENT_BELOW, 0.5 * band, slow)
        return [
            DriveState(on, self.supply_voltage or 0.0, (*over, high), target=target),
            DriveState(slow, -self.freewheel, (*over, low, far), target=target),
            DriveState(fast, self.down, (*over, near), target=target),
        ]


def _pieces(time: tuple[float, ...], current: tuple[float, ...]) -> Iterator[tuple[float, bool]]:
    """End of each stretch with or without a zero target: time, whether it is not zero."""
    works: bool | None = None
    for k in range(1, len(time)):
        if time[k] == time[k - 1]:
            continue
        now = current[k] > 0.0 or current[k - 1] > 0.0
        if works is not None and now != works:
            yield time[k - 1], works
        works = now
    yield time[-1], bool(works)
