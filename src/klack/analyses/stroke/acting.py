"""Which recorded channel is a force on which port of which body, of the rows of one run."""

from collections.abc import Iterator
from dataclasses import dataclass

from klack.mechanics.flexible_body import FlexibleBody
from klack.network.network import Network
from klack.network.rows import Rows

__all__ = ["ActingForce", "MovingBody", "acting_forces", "moving_bodies"]


@dataclass(frozen=True, kw_only=True)
class ActingForce:
    """A recorded force at one mechanical port.

    Parameters
    ----------
    component
        That acts; an end stop with contact and film.
    channel
        Of the result; means over records.
    body, port
        That it acts on: a body of the case, or a component that moves; both empty for the ground.
    sign [-]
        Of the force along +z.
    """

    component: str
    channel: str
    body: str
    port: str
    sign: float


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
    """

    body: str
    velocity: str
    mass: float
    in_fluid: bool
    driven: bool


def acting_forces(rows: Rows, network: Network) -> tuple[ActingForce, ...]:
    """All recorded forces of elements, end stops and friction."""
    places = dict(_places(rows, network))

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
    return tuple(found)


def moving_bodies(rows: Rows, network: Network) -> tuple[MovingBody, ...]:
    """Bodies that nothing holds."""
    pushed = {wall.port for wall in rows.walls}
    pushed |= {handle for branch in rows.branches for handle in branch.ports}
    return tuple(
        MovingBody(
            body=_body(row.component, network),
            velocity=f"{row.component} velocity",
            mass=float(row.body.mass),
            in_fluid=bool(pushed & set(row.ports)),
            driven=row.course is not None,
        )
        for row in rows.bodies
        if row.body.rigid_count > 0
    )


def _places(rows: Rows, network: Network) -> Iterator[tuple[int, tuple[str, str]]]:
    for row in rows.bodies:
        body = _body(row.component, network)
        for name, handle in zip(row.names, row.ports, strict=True):
            yield handle, (body, name)


def _body(component: str, network: Network) -> str:
    part = network.components.get(component)
    return part.body if isinstance(part, FlexibleBody) else component
