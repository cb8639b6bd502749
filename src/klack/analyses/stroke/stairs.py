r"""Stairs: steps that waves in lines leave in the velocity of a body after its impacts.

A body that turns round sends a jump of pressure into the line that ends at it, which comes back
after :math:`2L/a`, and so on.  Between two such edges the force is nearly constant, and so is the
slope of the velocity: that is one stair.  With the step :math:`\Delta p` of the mean pressure from
one stair to the next, and the area :math:`A` on which it acts,

.. math:: \Delta F = A\,\Delta p, \qquad \Delta v = \Delta F\,\frac{2L}{a\,m} .

Pressure and velocity are read apart: where both forces agree, the line made the step.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from klack.analyses.measures import Column, Measure, described_in
from klack.analyses.stroke.step_check import NOTICED
from klack.measurement.channels import LiftSensor
from klack.network.rows import LineRow, Rows
from klack.simulation.network_result import ImpactEvent, NetworkResult

__all__ = ["STAIR_MEASURES", "LineEnd", "Stair", "line_ends", "stairs"]

Vector = NDArray[np.float64]

_MOST = 6  # edges after one impact
_EDGE = 0.7  # of the time of the impact: half of what an edge takes
_FEWEST = 8  # records of a stair
_RISE = 0.35  # over the bandwidth: the time in which a low pass of first order rises
_SEEN = 3.0  # times what the velocity scatters about its stairs


@dataclass(frozen=True, kw_only=True)
class LineEnd:
    """End of a line whose pressure pushes a body.

    Parameters
    ----------
    echo_time [s]
        ``2 L / a``.
    pressure, velocity
        Channels of the node there, and of the centre of mass of the body.
    area [m^2]
        With a positive pressure pushing along +z.
    mass [kg]
    stops
        End stops of the body.
    resolution, bandwidth [m], [Hz]
        Of the lift sensor, where the case states them; else 0 and infinite.
    """

    line: str
    echo_time: float
    pressure: str
    body: str
    velocity: str
    area: float
    mass: float
    stops: tuple[str, ...]
    resolution: float = 0.0
    bandwidth: float = inf


@dataclass(frozen=True, kw_only=True)
class Stair:
    """One edge: the step from the stair before it to the one behind.

    Parameters
    ----------
    number
        Echo since the impact.
    time [s]
        Centre of the change of pressure, from the start of the run.
    expected_time [s]
        ``number`` echo times after the middle of the impact.
    pressure_step [Pa]
    force, seen_force [N]
        Area times pressure step; mass times change of the slope of the velocity.
    velocity_step [m/s]
        That change over one echo time.
    lift [m]
        By which a lift leaves its parabola within half a stair.
    scatter [m/s]
        Of the velocity about the straight lines of both stairs: vibration.
    hidden_by
        ``"vibration"`` where the step is less than three times that, ``"sensor"`` where the lift
        sensor of the case does not show it; else empty.
    """

    line: str
    body: str
    stop: str
    impact: int
    number: int
    time: float
    expected_time: float
    pressure_step: float
    force: float
    seen_force: float
    velocity_step: float
    lift: float
    scatter: float
    hidden_by: str

    @property
    def name(self) -> str:
        """As in a table: ``"feed: needle after seat 1, echo 2"``."""
        return f"{self.line}: {self.body} after {self.stop} {self.impact}, echo {self.number}"


def line_ends(rows: Rows, sensor: LiftSensor | None = None) -> tuple[LineEnd, ...]:
    """Ends of lines whose pressures push free bodies, and the sensor that sees these."""
    ends, delays = dict[str, tuple[int, int]](), dict[str, float]()
    lines: Sequence[LineRow] = rows.lines
    for line in lines:  # pieces of a line follow each other
        ends[line.component] = (ends.get(line.component, (line.a, 0))[0], line.b)
        delays[line.component] = delays.get(line.component, 0.0) + line.delay
    found = []
    for row in rows.bodies:
        if row.body.rigid_count == 0 or row.course is not None:
            continue
        own = set(row.ports)
        stops = tuple(x.component for x in rows.interfaces if own & {x.upper, x.lower})
        for name, nodes in ends.items():
            for node in dict.fromkeys(nodes):
                walls = [wall for wall in rows.walls if wall.node == node and wall.port in own]
                area = sum(wall.area for wall in walls)
                if area == 0.0 or rows.nodes[node].prescribed:
                    continue
                found.append(
                    LineEnd(
                        line=name,
                        echo_time=2.0 * delays[name],
                        pressure=f"{rows.nodes[node].component} pressure",
                        body=row.component,
                        velocity=f"{row.component} velocity",
                        area=area,
                        mass=float(row.body.mass),
                        stops=stops,
                        resolution=0.0 if sensor is None else sensor.resolution,
                        bandwidth=inf if sensor is None else sensor.bandwidth or inf,
                    )
                )
    return tuple(found)


def stairs(ends: Sequence[LineEnd], result: NetworkResult) -> Iterator[Stair]:
    """Edges after each impact that is one, until the next contact of that body."""
    for end in ends:
        events = [event for event in result.events if event.stop in end.stops]
        fastest: dict[str, float] = {}
        for event in events:
            fastest[event.stop] = max(fastest.get(event.stop, 0.0), event.approach_speed)
        counts: dict[str, int] = {}
        for k, event in enumerate(events):
            counts[event.stop] = counts.get(event.stop, 0) + 1
            if event.approach_speed <= NOTICED * fastest[event.stop]:
                continue
            until = events[k + 1].time if k + 1 < len(events) else float(result.time[-1])
            yield from _after(end, result, event, counts[event.stop], until)


def _after(
    end: LineEnd, result: NetworkResult, event: ImpactEvent, number: int, until: float
) -> Iterator[Stair]:
    time, echo, half = result.time, end.echo_time, _EDGE * event.contact_time
    pressure = result.channels[end.pressure].values
    speed = result.channels[end.velocity].values
    middle = event.time + 0.5 * event.contact_time
    before: tuple[float, float, float] | None = None
    for k in range(_MOST + 1):
        edge = middle + k * echo
        on = (time > edge + half) & (time < edge + echo - half)
        if edge + echo - half > until or np.count_nonzero(on) < _FEWEST:
            return
        line = np.polyfit(time[on] - edge, speed[on], 1)
        about = float(np.std(speed[on] - np.polyval(line, time[on] - edge)))
        here = float(np.mean(pressure[on])), float(line[0]), about
        if before is not None:
            slope, scatter = here[1] - before[1], max(before[2], here[2])
            lift = 0.125 * abs(slope) * echo**2
            hidden = "sensor" if lift < end.resolution or echo < _RISE / end.bandwidth else ""
            yield Stair(
                line=end.line,
                body=end.body,
                stop=event.stop,
                impact=number,
                number=k,
                time=_centre(time, pressure, edge, 2.0 * half),
                expected_time=edge,
                pressure_step=here[0] - before[0],
                force=end.area * (here[0] - before[0]),
                seen_force=end.mass * slope,
                velocity_step=slope * echo,
                lift=lift,
                scatter=scatter,
                hidden_by="vibration" if abs(slope * echo) <= _SEEN * scatter else hidden,
            )
        before = here


def _centre(time: Vector, pressure: Vector, about: float, half: float) -> float:
    near = np.abs(time - about) < half
    rate = np.abs(np.gradient(pressure, time))[near]
    total = float(np.sum(rate))
    return float(np.sum(rate * time[near])) / total if total > 0.0 else about


STAIR_MEASURES: tuple[Measure[Stair], ...] = described_in(
    "theory/lines",
    Measure(
        key="time",
        symbol="t",
        unit="s",
        definition="Centre of the change of pressure at the edge, from the start of the run.",
        digits=5,
        column=Column("ms", 1e3, ".4f"),
        page=True,
    ),
    Measure(
        key="expected_time",
        symbol="t_k",
        unit="s",
        definition="Number of echo times 2L/a after the middle of the impact.",
        digits=5,
        column=Column("ms", 1e3, ".4f", "k 2L/a"),
        page=True,
    ),
    Measure(
        key="pressure_step",
        symbol="dp",
        unit="Pa",
        definition="Mean pressure of the stair after the edge minus that of the stair before.",
        column=Column("bar", 1e-5, "+.3f", "dp"),
        page=True,
    ),
    Measure(
        key="force",
        symbol="A dp",
        unit="N",
        definition="Pressure step times the area of the body that it pushes, along +z.",
        column=Column("N", 1.0, "+.3f", "A dp"),
        page=True,
    ),
    Measure(
        key="seen_force",
        symbol="m dv/dt",
        unit="N",
        definition="Mass of the body times the change of the slope of its velocity, determined "
        "only from the velocity; it includes all forces that change.",
        column=Column("N", 1.0, "+.3f", "by velocity"),
        page=True,
        title="force from the velocity",
    ),
    Measure(
        key="velocity_step",
        symbol="dv",
        unit="m/s",
        definition="Change of that slope over one echo time: the height of the stair.",
        column=Column("m/s", 1.0, "+.4f", "dv"),
        page=True,
    ),
    Measure(
        key="lift",
        symbol="dy",
        unit="m",
        definition="Deviation of the lift from its previous parabola within half a stair: "
        "invisible to a lift sensor with larger noise.",
        digits=3,
        column=Column("um", 1e6, ".3g", "lift"),
        page=True,
        title="in the lift",
    ),
    Measure(
        key="scatter",
        symbol="s_v",
        unit="m/s",
        definition="Standard deviation of the velocity about the straight lines of the two stairs.",
        digits=2,
        column=Column("m/s", 1.0, ".1e"),
        remark=lambda stair: f" ({stair.hidden_by})" if stair.hidden_by else "",
        page=True,
        note="Vibration: the step is less than three times that. Sensor: the step in the lift is "
        "less than the resolution of the lift sensor of the case, or the stairs are shorter than "
        "its rise time, 0.35 over its bandwidth.",
    ),
)
"""Of one edge of the stairs after an impact."""
