"""Peak and hold from a boost capacitor, with the losses of the output stage."""

from collections.abc import Mapping
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from klack.input.problem import CaseProblem, refuse_key_if
from klack.input.section import Section
from klack.magnetics.driver import DriveProgram, Driver, DriveState, Switch, When
from klack.magnetics.output_stage import Capacitor, OutputStage, StagePath
from klack.magnetics.shared_capacitors import shared_capacitors
from klack.network.port import FED, VOLTAGE, Port
from klack.network.rows import Rows
from klack.units import Capacitance, Current, Power, Ratio, Resistance, Time, Voltage, format_si

__all__ = ["BoostDriver", "Shot"]


class Shot(Section):
    """One actuation: when the driver switches on and off."""

    start: Time = Field(
        ge=0, description="Time of switching on, from the start of the run or cycle."
    )
    end: Time = Field(gt=0, description="Switched off.")


class BoostDriver(Driver):
    r"""Boost from a finite capacitor to a peak current, then hold from the battery.

    =============  =======================================  ======================================
    state          path of the current                      until
    =============  =======================================  ======================================
    boost          capacitor, two switches                  the peak current
    supply         battery, diode, two switches             the peak current; entered when the
                                                            capacitor has fallen to the battery
    peak-off, -on  one diode and switch; battery            ``peak_duration`` after the start
    fall           one diode and switch, or the decay       the current is down in the hold band
    hold-on, -off  battery; one diode and switch            the end of the shot
    off            decay: two diodes into the capacitor,    the current is zero; then the coil is
                   or one diode and the clamp               open
    =============  =======================================  ======================================

    The capacitor gives and takes :math:`C\,\dot U = -i`; a converter always recharges it from the
    battery at constant power, :math:`U = \sqrt{U_0^2 + 2 P t/C}`, with a largest current.  A second
    shot before it has recovered starts from a lower voltage and is late.  Recuperated energy may
    raise it above ``boost_voltage``; then the converter rests.

    Without ``capacitance`` the driver draws from the boost-capacitor at its port ``supply``, which
    others may share.

    Limits: those of :mod:`klack.magnetics.output_stage`.
    """

    type: ClassVar[str] = "boost-driver"
    ports: ClassVar[Mapping[str, Port]] = {"terminals": VOLTAGE, "supply": FED}

    battery: Voltage = Field(gt=0, description="Battery, for holding and for the converter.")
    capacitance: Capacitance | None = Field(
        default=None,
        gt=0,
        description="Its own boost capacitor; without it: the one joined to 'supply'.",
    )
    boost_voltage: Voltage | None = Field(
        default=None,
        gt=0,
        description="Voltage to which the converter recharges its own capacitor.",
    )
    start_voltage: Voltage | None = Field(
        default=None,
        ge=0,
        description="Voltage of the capacitor at the start; default: boost_voltage.",
    )
    recharge_power: Power | None = Field(
        default=None, ge=0, description="Power into its own capacitor; 0: no recharge."
    )
    recharge_current: Current | None = Field(
        default=None, gt=0, description="Largest current into the capacitor; default no limit."
    )
    efficiency: Ratio = Field(
        default=1.0, gt=0, le=1, description="Efficiency of its own converter."
    )
    peak_current: Current = Field(gt=0, description="Current at which the boost ends.")
    peak_duration: Time | None = Field(
        default=None,
        gt=0,
        description="Time after the start of each shot until which the current is held in a "
        "band below the peak, as wide as the hold band; default: no peak hold.",
    )
    hold_current: Current = Field(gt=0, description="Middle of the hold band.")
    hold_band: Current = Field(gt=0, description="Upper minus lower current of the hold band.")
    fall: Literal["freewheel", "decay"] = Field(
        default="freewheel",
        description="Voltage against which the current falls from peak to hold.",
    )
    decay: Literal["capacitor", "clamp"] = Field(
        default="capacitor",
        description="Where the energy of the coil goes after the end: back into the capacitor, "
        "or into a clamp.",
    )
    clamp_voltage: Voltage | None = Field(
        default=None, gt=0, description="Zener or avalanche voltage of the clamp."
    )
    clamp_resistance: Resistance = Field(
        default=0.0, ge=0, description="Slope of the clamp voltage over current."
    )
    diode_voltage: Voltage = Field(default=0.7, ge=0, description="Forward voltage of each diode.")
    diode_resistance: Resistance = Field(
        default=0.0, ge=0, description="Slope of the voltage of each diode over current."
    )
    switch_resistance: Resistance = Field(
        default=0.0,
        ge=0,
        description="On-resistance of each switch.",
    )
    shots: tuple[Shot, ...] = Field(
        min_length=1, description="Actuations in order: {start: ..., end: ...}."
    )
    repeat_every: Time | None = Field(
        default=None, gt=0, description="Period of repetition; default no repetition."
    )

    @model_validator(mode="after")
    def _levels(self) -> Self:
        self._check_capacitor()
        if self.boost_voltage is not None and not self.battery < self.boost_voltage:
            raise CaseProblem(
                ("boost_voltage",),
                got=f"{self.boost_voltage:g} V",
                expected=f"more than the battery, {self.battery:g} V",
                hint="for a driver without boost use type 'two-point'.",
            )
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
        refuse_key_if(
            self.decay == "clamp" and self.clamp_voltage is None,
            ("clamp_voltage",),
            got="none, with decay: clamp",
            expected="the Zener or avalanche voltage of the clamp",
            hint="add it, or decay: capacitor.",
        )
        return self

    @model_validator(mode="after")
    def _order_of_shots(self) -> Self:
        before = 0.0
        for k, shot in enumerate(self.shots):
            refuse_key_if(
                not before <= shot.start < shot.end,
                ("shots", k),
                got=f"from {format_si(shot.start, 's')} to {format_si(shot.end, 's')}",
                expected=f"a start from {format_si(before, 's')} on, and an end after it",
                hint="list the shots in order; they must not overlap.",
            )
            if self.peak_duration is not None and not shot.start + self.peak_duration < shot.end:
                raise CaseProblem(
                    ("peak_duration",),
                    got=format_si(self.peak_duration, "s"),
                    expected=f"less than the {format_si(shot.end - shot.start, 's')} of a shot",
                    hint="shorten it, or leave it out.",
                )
            before = shot.end
        if self.repeat_every is not None and self.repeat_every < before:
            raise CaseProblem(
                ("repeat_every",),
                got=f"a period of {format_si(self.repeat_every, 's')}",
                expected=f"at least {format_si(before, 's')}, the end of the last shot",
                hint="give a longer period.",
            )
        return self

    def commands(self) -> tuple[tuple[float, float | None], ...]:
        """Start and end of every shot."""
        return tuple((shot.start, shot.end) for shot in self.shots)

    def program(self) -> DriveProgram:
        """States idle, then those of each shot, with the paths of the output stage."""
        states: list[tuple[str, StagePath, tuple[Switch, ...]]] = []
        paths = self._paths()
        first = Switch(When.TIME, self.shots[0].start, "boost")
        states.append(("idle", paths["off"], (first,)))
        for k, shot in enumerate(self.shots):
            tail = "" if k == 0 else f"-{k + 1}"
            after: tuple[Switch, ...] = ()
            if k + 1 < len(self.shots):
                after = (Switch(When.TIME, self.shots[k + 1].start, f"boost-{k + 2}"),)
            elif self.repeat_every is not None:
                after = (Switch(When.TIME, self.repeat_every, "idle", new_cycle=True),)
            states += self._shot(shot, tail, paths, after)
        return DriveProgram(
            tuple(DriveState(name, path.still, switches) for name, path, switches in states),
            stage=OutputStage(
                capacitor=self._capacitor(),
                paths={name: path for name, path, _ in states},
            ),
        )

    def _check_capacitor(self) -> None:
        needed = ("capacitance", "boost_voltage", "recharge_power")
        more = ("start_voltage", "recharge_current")
        given = [key for key in (*needed, *more) if getattr(self, key) is not None]
        missing = [key for key in needed if getattr(self, key) is None]
        if given and missing:
            raise CaseProblem(
                (missing[0],),
                got=f"none, with {', '.join(given)}",
                expected=f"all of {', '.join(needed)}, or none of them",
                hint="add it; or join 'supply' to a boost-capacitor, which has these keys.",
            )

    def port_kinds(self) -> Mapping[str, Port]:
        """Terminals, and ``supply`` without a capacitor of its own."""
        return {"terminals": VOLTAGE} if self.capacitance is not None else self.ports

    def add_rows(self, rows: Rows) -> None:
        """Name the capacitor at ``supply``; the coil runs the program."""
        if self.capacitance is None:
            shared_capacitors(rows).drawing[rows.port("terminals")] = rows.port("supply")

    def _capacitor(self) -> Capacitor | None:
        if self.capacitance is None or self.boost_voltage is None:
            return None
        return Capacitor(
            capacitance=self.capacitance,
            start=self.boost_voltage if self.start_voltage is None else self.start_voltage,
            nominal=self.boost_voltage,
            power=self.recharge_power or 0.0,
            current=self.recharge_current or 0.0,
            efficiency=self.efficiency,
        )

    def _paths(self) -> Mapping[str, StagePath]:
        two = 2.0 * self.switch_resistance
        diode, slope = self.diode_voltage, self.diode_resistance
        freewheel = StagePath(
            diodes=diode, diode_resistance=slope, switch_resistance=self.switch_resistance
        )
        if self.decay == "capacitor":
            off = StagePath(capacitor=-1, diodes=2.0 * diode, diode_resistance=2.0 * slope)
        else:
            off = StagePath(
                clamp=self.clamp_voltage or 0.0,
                clamp_resistance=self.clamp_resistance,
                diodes=diode,
                diode_resistance=slope,
            )
        return {
            "boost": StagePath(capacitor=1, switch_resistance=two),
            "battery": StagePath(
                battery=self.battery, diodes=diode, diode_resistance=slope, switch_resistance=two
            ),
            "freewheel": freewheel,
            "off": off,
            "fall": freewheel if self.fall == "freewheel" else off,
        }

    def _shot(
        self, shot: Shot, tail: str, paths: Mapping[str, StagePath], after: tuple[Switch, ...]
    ) -> list[tuple[str, StagePath, tuple[Switch, ...]]]:
        """States of one shot, their names ending in ``tail``, and what follows its end."""
        upper = self.hold_current + 0.5 * self.hold_band
        lower = self.hold_current - 0.5 * self.hold_band
        peak = "fall" if self.peak_duration is None else "peak-off"
        above, below = When.CURRENT_ABOVE, When.CURRENT_BELOW
        leave: tuple[tuple[When, float, str], ...] = ()
        if self.peak_duration is not None:
            leave = ((When.TIME, shot.start + self.peak_duration, "fall"),)
        # without the diode of the battery path the capacitor would be charged by the battery
        empty = (max(self.battery - self.diode_voltage, 0.0), f"supply{tail}")
        working: list[tuple[str, StagePath, tuple[tuple[When, float, str], ...]]] = [
            ("boost", paths["boost"], ((above, self.peak_current, peak),)),
            ("supply", paths["battery"], (*leave, (above, self.peak_current, peak))),
            ("fall", paths["fall"], ((below, upper, "hold-off"),)),
            ("hold-off", paths["freewheel"], ((below, lower, "hold-on"),)),
            ("hold-on", paths["battery"], ((above, upper, "hold-off"),)),
        ]
        if self.peak_duration is not None:
            least = self.peak_current - self.hold_band
            working += [
                ("peak-off", paths["freewheel"], (*leave, (below, least, "peak-on"))),
                ("peak-on", paths["battery"], (*leave, (above, self.peak_current, "peak-off"))),
            ]
        over = Switch(When.TIME, shot.end, f"off{tail}")
        made = []
        for name, path, switches in working:
            ways = tuple(Switch(when, value, f"{to}{tail}") for when, value, to in switches)
            if name == "boost":
                path = StagePath(capacitor=1, switch_resistance=path.switch_resistance, empty=empty)
            made.append((f"{name}{tail}", path, (over, *ways)))
        made.append((f"off{tail}", paths["off"], after))
        return made
