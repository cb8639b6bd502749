"""Peak and hold: the usual driver of an injector."""

from math import inf
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from klack.input.problem import CaseProblem, refuse_key_if
from klack.magnetics.driver import DriveProgram, DriveState, Switch, TimedDriver, When
from klack.units import Current, Time, Voltage, format_si

__all__ = ["PeakHold"]


class PeakHold(TimedDriver):
    """Boost to a peak current, then hold a lower one by two-point control.

    =============  ===================  ======================================================
    state          voltage              until
    =============  ===================  ======================================================
    boost          boost                the peak current
    peak-off, -on  freewheel, supply    ``peak_until``: two-point control below the peak
    fall           freewheel or decay   the current is down in the band of the hold
    hold-on, -off  supply, freewheel    ``end``: two-point control around the hold current
    off            decay                the current is zero; then the coil is open
    =============  ===================  ======================================================

    Usual values: direct injection 50 to 65 V to 8 to 15 A, hold 2 to 4 A, band 0.5 to 1 A.
    """

    type: ClassVar[str] = "peak-hold"

    boost_voltage: Voltage = Field(gt=0, description="Voltage until the peak current is reached.")
    peak_current: Current = Field(gt=0, description="Current at which the boost ends.")
    supply_voltage: Voltage = Field(gt=0, description="For holding (battery).")
    hold_current: Current = Field(gt=0, description="Middle of the hold band.")
    hold_band: Current = Field(gt=0, description="Upper minus lower current of the hold band.")
    peak_until: Time | None = Field(
        default=None,
        gt=0,
        description="End of the peak hold, in a band below the peak as wide as the hold band; "
        "default: no peak hold.",
    )
    fall: Literal["freewheel", "decay"] = Field(
        default="freewheel", description="Voltage against the current from peak to hold."
    )

    @model_validator(mode="after")
    def _order_of_currents(self) -> Self:
        refuse_key_if(
            not self.hold_band < 2.0 * self.hold_current,
            ("hold_band",),
            got=f"{self.hold_band:g} A",
            expected="less than twice the hold current",
            hint="0.5 to 1 A is usual.",
        )
        refuse_key_if(
            not self.hold_current + 0.5 * self.hold_band < self.peak_current,
            ("peak_current",),
            got=f"{self.peak_current:g} A",
            expected="a current above the band of the hold",
            hint="for a driver without a peak use type 'two-point'.",
        )
        if self.peak_until is not None and not (
            self.start < self.peak_until < (inf if self.end is None else self.end)
        ):
            raise CaseProblem(
                ("peak_until",),
                got=format_si(self.peak_until, "s"),
                expected=f"a time after the start at {format_si(self.start, 's')}"
                + (f" and before the end at {format_si(self.end, 's')}" if self.end else ""),
                hint="times count from the start of the run.",
            )
        return self

    def program(self) -> DriveProgram:
        """States idle, boost, peak, fall, hold, off."""
        upper = self.hold_current + 0.5 * self.hold_band
        lower = self.hold_current - 0.5 * self.hold_band
        down = -self.freewheel
        against = self.freewheel if self.fall == "freewheel" or self.decay is None else self.decay
        working = [DriveState("fall", -against, (Switch(When.CURRENT_BELOW, upper, "hold-off"),))]
        after = "fall"
        if self.peak_until is not None:
            leave = Switch(When.TIME, self.peak_until, "fall")
            least = Switch(When.CURRENT_BELOW, self.peak_current - self.hold_band, "peak-on")
            most = Switch(When.CURRENT_ABOVE, self.peak_current, "peak-off")
            working.append(DriveState("peak-off", down, (leave, least)))
            working.append(DriveState("peak-on", self.supply_voltage, (leave, most)))
            after = "peak-off"
        hold_off = Switch(When.CURRENT_BELOW, lower, "hold-on")
        hold_on = Switch(When.CURRENT_ABOVE, upper, "hold-off")
        return self.framed(
            DriveState(
                "boost",
                self.boost_voltage,
                (Switch(When.CURRENT_ABOVE, self.peak_current, after),),
            ),
            *working,
            DriveState("hold-off", down, (hold_off,)),
            DriveState("hold-on", self.supply_voltage, (hold_on,)),
        )
