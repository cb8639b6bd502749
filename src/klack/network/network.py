"""A valve as components and connections: checked, then translated into rows for the solver.

A *connection* lists all ports that meet in one node: one point of one body (or of the ground) and
everything that pushes it there, one pressure of liquid or gas, one pair of wires, or one
temperature. Two words may stand in place of a port: ``ground`` does not move, ``ambient`` has the
pressure, or the temperature, of the surroundings.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Self

from klack.errors import ConvergenceError
from klack.input.problem import refuse_key_if
from klack.network.checks import check_nodes, check_rows
from klack.network.component import Component
from klack.network.nodes import RESERVED, Node, join
from klack.network.port import FLUID_DOMAINS, Role
from klack.network.protocols import NetworkFluid, NetworkGas
from klack.network.rows import AMBIENT, GROUND, Ambient, Rows

__all__ = ["Network"]

_FIRST = {Role.MOTION: 0, Role.COMPLIANCE: 1, Role.PRESSURE: 1}


@dataclass(frozen=True, eq=False)
class Network:
    """Components joined in their ports.

    Parameters
    ----------
    connections
        Ports, ``"component.port"``, that meet in one node; or ``"ground"``, ``"ambient"``.
    fluid
        At its temperature; needed if anything is hydraulic.
    gas
        Needed if anything is pneumatic.
    is_draft
        Of a network to be drawn: open ports and a missing fluid are for :meth:`rows` to reject.

    Raises
    ------
    CaseProblem
        An :class:`klack.errors.InputError` that names the component or the connection.

    Examples
    --------
    >>> from klack.mechanics.rigid_mass import RigidMass
    >>> from klack.mechanics.spring import Spring
    >>> parts = {"needle": RigidMass(mass=3e-3), "spring": Spring(stiffness=5e3, preload=20.0)}
    >>> rows = Network(parts, [["needle.body", "spring.end"]]).rows()
    >>> len(rows.bodies), len(rows.elements)
    (1, 1)
    """

    components: Mapping[str, Component]
    connections: Sequence[Sequence[str]]
    ambient: Ambient = field(default_factory=Ambient)
    fluid: NetworkFluid | None = None
    gas: NetworkGas | None = None
    is_draft: bool = False
    nodes: tuple[Node, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "components", dict(self.components))
        connections = tuple(tuple(connection) for connection in self.connections)
        object.__setattr__(self, "connections", connections)
        for name in self.components:
            refuse_key_if(
                name in RESERVED or "." in name,
                ("components", name),
                got=f"the name '{name}'",
                expected="a name without point, other than ground and ambient",
                hint="rename the component.",
                on_key=True,
            )
        object.__setattr__(self, "nodes", join(self.components, self.connections))
        if not self.is_draft:
            self._require_complete()

    def _require_complete(self) -> None:
        check_nodes(self.components, self.nodes)
        if self.fluid is None:
            for name, component in self.components.items():
                refuse_key_if(
                    _has_port_of(component, "hydraulic"),
                    (),
                    got=f"no fluid, but the hydraulic component '{name}'",
                    expected="fluid: the fluid of the valve",
                    hint="add e.g. 'fluid: {name: n-heptane}'.",
                )
        if self.gas is None:
            for name, component in self.components.items():
                refuse_key_if(
                    _has_port_of(component, "pneumatic"),
                    (),
                    got=f"no gas, but the pneumatic component '{name}'",
                    expected="gas: the gas of the valve",
                    hint="add e.g. 'gas: air'.",
                )

    def rows(self) -> Rows:
        """Translate into what the solver runs, after the checks of :mod:`klack.network.checks`.

        Bodies come first, then whatever rules a pressure, then all others in their own order, so
        that each finds what it needs.
        """
        if self.is_draft:
            self._require_complete()
        rows = Rows(ambient=self.ambient, fluid=self.fluid, gas=self.gas)
        if any(_has_port_of(component, "hydraulic") for component in self.components.values()):
            rows.component = "ambient"
            rows.pressure(AMBIENT, time=[0.0], pressure=[self.ambient.pressure])
        handles, partners = self._handles(), self._partners()
        for name in sorted(self.components, key=self._rank):  # stable: else in the given order
            rows.component = name
            rows.handles, rows.partners = handles[name], partners[name]
            try:
                self.components[name].add_rows(rows)
            except ConvergenceError as error:
                raise ConvergenceError(f"{name}, at the start: {error}") from error
        for close in rows.closing.values():
            close(rows)
        check_rows(rows)
        return rows

    def _rank(self, name: str) -> int:
        ports = self.components[name].port_kinds().values()
        return min((_FIRST.get(port.role, 2) for port in ports), default=2)

    def _handles(self) -> dict[str, dict[str, int]]:
        handles: dict[str, dict[str, int]] = {}
        moving = 0
        for name, component in self.components.items():
            handles[name] = {}
            for port, kind in component.port_kinds().items():
                rest = AMBIENT if kind.domain in FLUID_DOMAINS else GROUND
                handles[name][port] = rest
                if kind.role is Role.MOTION:
                    handles[name][port], moving = moving, moving + 1
        pressures = AMBIENT
        for node in self.nodes:
            if node.domain in FLUID_DOMAINS and not node.word:
                pressures += 1
            bodies = node.having(Role.MOTION)
            motion = handles[bodies[0].component][bodies[0].name] if bodies else GROUND
            shared = {"mechanical": motion, "electric": node.index, "thermal": node.index}
            shared["hydraulic"] = shared["pneumatic"] = AMBIENT if node.word else pressures
            for joint in node.joints:
                handles[joint.component][joint.name] = shared[node.domain]
        return handles

    def _partners(self) -> dict[str, dict[str, tuple[Component, ...]]]:
        partners: dict[str, dict[str, tuple[Component, ...]]] = {}
        for name in self.components:
            partners[name] = {}
        for node in self.nodes:
            for joint in node.joints:
                partners[joint.component][joint.name] = tuple(
                    self.components[other.component] for other in node.joints if other is not joint
                )
        return partners

    def coil_labels(self) -> list[str]:
        """Names of the channels of each coil: its magnet, and its port but for ``terminals``."""
        return [
            name if port == "terminals" else f"{name} {port}"
            for name, part in self.components.items()
            for port, kind in part.port_kinds().items()
            if kind.role is Role.COIL
        ]

    def with_components(
        self, components: Mapping[str, Component], connections: Sequence[Sequence[str]] = ()
    ) -> Self:
        """Same network with components added or, under a known name, replaced.

        Added ``connections`` that share a port with one that is there extend it.
        """
        merged = [list(connection) for connection in self.connections]
        for new in connections:
            met = [old for old in merged if (set(old) & set(new)) - set(RESERVED)]
            together = [port for old in met for port in old]
            together += [port for port in new if port not in together]
            merged = [old for old in merged if old not in met] + [together]
        parts = {**self.components, **components}
        return type(self)(parts, merged, self.ambient, self.fluid, self.gas)

    def dry(self) -> Self:
        """Same valve without fluid: no flow, no pressure force, no film, no leakage."""
        parts = {name: part.dry() for name, part in self.components.items()}
        left = [part for part in parts.values() if part is not None]
        wet = any(_has_port_of(part, "hydraulic") for part in left)
        return self._changed(parts, "", self.fluid if wet else None)

    def lumped(self, stiffness: float, restitution: float | None = None) -> Self:
        """Lumped baseline: rigid bodies, one spring and one dashpot per end stop.

        Parameters
        ----------
        stiffness [N/m]
            Usually 1e9 N/m.
        restitution [-]
            Sets the dashpots after Gonthier et al. (2004); no loss without.
        """
        parts = {
            name: part.lumped(stiffness, restitution) for name, part in self.components.items()
        }
        return self._changed(parts, "ground", self.fluid)

    def at_start(self) -> Self:
        """Same valve with all sources and forces held at their value at time zero."""
        return self.with_components({n: part.at_start() for n, part in self.components.items()})

    def _changed(
        self, parts: Mapping[str, Component | None], instead: str, fluid: NetworkFluid | None
    ) -> Self:
        """Replace components; None removes one, and its ports become the word ``instead``."""
        kept = {name: part for name, part in parts.items() if part is not None}
        connections = []
        for connection in self.connections:
            ports = [port for port in connection if port in RESERVED or _part_of(port) in kept]
            if instead and len(ports) < len(connection) and instead not in ports:
                ports.append(instead)
            if len(ports) > 1:
                connections.append(ports)
        gas = self.gas if any(_has_port_of(part, "pneumatic") for part in kept.values()) else None
        return type(self)(kept, connections, self.ambient, fluid, gas)


def _has_port_of(component: Component, domain: str) -> bool:
    return any(port.domain == domain for port in component.port_kinds().values())


def _part_of(port: str) -> str:
    return port.partition(".")[0]
