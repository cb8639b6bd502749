"""Which recorded channel is a force on which port of which body, of the rows of one run.

Forces of all pressures and flows on a port are one, called ``fluid``, and recorded by its impulse.
"""

from dataclasses import dataclass
from math import pi

from klack.hydraulics.inertance import Inertance
from klack.hydraulics.line import Line
from klack.network.network import Network
from klack.network.rows import AMBIENT, GROUND, LineRow, Rows, WaveRow
from klack.simulation.flow_channels import flow_label

__all__ = [
    "FLUID",
    "ActingForce",
    "FluidPassage",
    "MovingBody",
    "acting_forces",
    "fluid_passages",
    "moving_bodies",
]

FLUID = "fluid"
"""What acts with all pressures and flows."""


@dataclass(frozen=True, kw_only=True)
class ActingForce:
    """A recorded force at one mechanical port.

    Parameters
    ----------
    component
        That acts; an end stop with contact and film, or ``fluid``.
    channel
        Of the result; means over records, or the impulse so far.
    body, port
        That it acts on: a body of the case, or a component that moves; both empty for the ground.
    sign [-]
        Of the force along +z.
    impulse
        Whether the channel is an impulse.
    """

    component: str
    channel: str
    body: str
    port: str
    sign: float
    impulse: bool = False


@dataclass(frozen=True, kw_only=True)
class FluidPassage:
    """A column of fluid, or a way into the valve, along which fluid carries momentum.

    Parameters
    ----------
    pressures
        Channels at ends a and b; empty for the surroundings.
    inside
        Whether each end lies in the valve.
    flows [kg/s]
        Channels of the flow from a to b, means over records; none of a column.
    area [m^2]
        Of a column; 0 else.
    density [kg/m^3], ambient [Pa]
        In the surroundings; a density of 0 of a gas.
    """

    component: str
    pressures: tuple[str, str]
    inside: tuple[bool, bool]
    flows: tuple[str, ...]
    area: float
    density: float
    ambient: float


@dataclass(frozen=True, kw_only=True)
class MovingBody:
    """A body that moves as a whole.

    Parameters
    ----------
    velocity
        Channel of its centre of mass.
    mass [kg]
    in_fluid
        Whether a fluid pushes it, whose forces have no channels of their own.
    driven
        Whether it follows a given motion.
    repaid
        Channel of the impulse of the force that takes back energy of macro steps.
    """

    body: str
    velocity: str
    mass: float
    in_fluid: bool
    driven: bool
    repaid: str = ""


def acting_forces(rows: Rows) -> tuple[ActingForce, ...]:
    """All recorded forces of elements, end stops and friction."""
    places = {
        handle: place
        for row in rows.bodies
        for handle, place in zip(row.ports, row.places, strict=True)
    }
    names = {handle: row.component for row in rows.bodies for handle in row.ports}

    def acting(component: str, channel: str, handle: int, sign: float) -> ActingForce:
        body, port = places.get(handle, ("", ""))
        return ActingForce(component=component, channel=channel, body=body, port=port, sign=sign)

    found = []
    for row in rows.elements:
        for name, handle in zip(row.names, row.ports, strict=True):
            owner, _, port = name.rpartition(".")
            owner = owner or row.component
            words = filter(None, (f"{owner}.{port}", row.label, "force"))
            found.append(acting(owner, " ".join(words), handle, 1.0))
    for slider in rows.sliders:
        for name, handle in zip(slider.names, (slider.upper, slider.lower), strict=True):
            channel = f"{slider.component}.{name} force"
            found.append(acting(slider.component, channel, handle, 1.0))
    for stop in rows.interfaces:
        for kind in ("contact", "film"):
            for handle, sign in ((stop.upper, 1.0), (stop.lower, -1.0)):
                channel = f"{stop.component} {kind} force"
                found.append(acting(stop.component, channel, handle, sign))
    for handle in sorted(rows.in_fluid - {GROUND}):
        body, port = places[handle]
        channel = f"{names[handle]}.{port} fluid impulse"
        found.append(
            ActingForce(
                component=FLUID, channel=channel, body=body, port=port, sign=1.0, impulse=True
            )
        )
    return tuple(found)


def fluid_passages(rows: Rows, network: Network) -> tuple[FluidPassage, ...]:
    """Columns of fluid, and branches between the valve and what is outside."""
    ends: dict[str, tuple[int, int]] = {}
    columns: list[LineRow | WaveRow] = [*rows.lines, *rows.waves]
    for column in columns:  # pieces of a line follow each other
        ends[column.component] = (ends.get(column.component, (column.a, 0))[0], column.b)
    flows: dict[str, tuple[str, ...]] = dict.fromkeys(ends, ())
    for row in rows.branches:
        if row.column is not None:
            ends[row.component], flows[row.component] = (row.a, row.b), ()
        elif _outside(rows, row.a) or _outside(rows, row.b):
            ends[row.component] = (row.a, row.b)
            name = " ".join(filter(None, (row.component, row.label, flow_label(row))))
            flows[row.component] = (*flows.get(row.component, ()), name)
    density = 0.0 if rows.fluid is None else float(rows.fluid.density(rows.ambient.pressure))
    return tuple(
        FluidPassage(
            component=name,
            pressures=(_pressure(rows, a), _pressure(rows, b)),
            inside=(not _outside(rows, a), not _outside(rows, b)),
            flows=flows[name],
            area=_area(network, name) if not flows[name] else 0.0,
            density=density,
            ambient=rows.ambient.pressure,
        )
        for name, (a, b) in ends.items()
    )


def _outside(rows: Rows, node: int) -> bool:
    return node == AMBIENT or rows.nodes[node].prescribed


def _pressure(rows: Rows, node: int) -> str:
    return "" if node == AMBIENT else f"{rows.nodes[node].component} pressure"


def _area(network: Network, component: str) -> float:
    part = network.components.get(component)
    if isinstance(part, Inertance):
        return part.channel_area
    return 0.25 * pi * part.diameter**2 if isinstance(part, Line) else 0.0


def moving_bodies(rows: Rows) -> tuple[MovingBody, ...]:
    """Bodies that nothing holds."""
    return tuple(
        MovingBody(
            body=row.places[0][0],
            velocity=f"{row.component} velocity",
            mass=float(row.body.mass),
            in_fluid=bool(rows.in_fluid & set(row.ports)),
            driven=row.course is not None,
            repaid=f"{row.component} repaid impulse",
        )
        for row in rows.bodies
        if row.body.rigid_count > 0
    )
