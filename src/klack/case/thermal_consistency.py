"""Checks of the section ``thermal`` against the network of its case."""

from collections.abc import Iterator, Mapping

from klack.case.consistency import require_known
from klack.case.thermal import CaseThermal
from klack.case.valve_sections import ValveSections
from klack.input.problem import CaseProblem, Key, nearest, one_of
from klack.network.component import Component
from klack.network.described import kind_of_field
from klack.network.port import Role
from klack.units import format_si

__all__ = ["check_thermal"]

_NODES = (Role.HEAT_STORE, Role.TEMPERATURE)


def check_thermal(case: ValveSections) -> None:
    """Raise :class:`CaseProblem` if the section names what the network does not have."""
    thermal = case.thermal
    if thermal is None:
        return
    parts = case.network.components
    nodes = [name for name, part in parts.items() if _role(part) in _NODES]
    if not nodes:
        raise CaseProblem(
            ("thermal",),
            got="no thermal node in the network",
            expected="a component of the type heat-capacity for each part that warms up",
            hint="add e.g. 'copper: {type: heat-capacity, capacity: 9 J/K}'.",
            on_key=True,
        )
    for key, node in _named_nodes(thermal):
        require_known(("thermal", *key), node, nodes, "heat-capacity or fixed-temperature")
    if thermal.period < case.run.duration * (1.0 - 1e-12):
        raise CaseProblem(
            ("thermal", "period"),
            got=format_si(thermal.period, "s"),
            expected=f"run.duration or more, {format_si(case.run.duration, 's')}",
            hint="a stroke has to end before the next one begins; shorten run.duration.",
        )
    _check_heat(thermal, parts)
    if thermal.fluid is not None and case.network.fluid is None:
        raise CaseProblem(
            ("thermal", "fluid"),
            got="a node for the fluid of a dry valve",
            expected="a fluid: network.fluid",
            hint="leave thermal.fluid out, or add the fluid.",
        )
    for coil in thermal.windings:
        key = ("thermal", "windings", coil)
        require_known(key, coil, _wound(parts), "coil", on_key=True)
    for coil in thermal.magnets:
        key = ("thermal", "magnets", coil)
        with_magnets = [name for name in parts if getattr(parts[name], "magnets", ())]
        require_known(key, coil, with_magnets, "solenoid with magnets", on_key=True)
    taken: dict[str, str] = {}
    for name, growth in thermal.growth.items():
        for i, text in enumerate(growth.of):
            _check_grown(("thermal", "growth", name, "of", i), text, parts)
            if text in taken:
                raise CaseProblem(
                    ("thermal", "growth", name, "of", i),
                    got=f"'{text}' a second time (first in '{taken[text]}')",
                    expected="one chain for each gap",
                    hint="put all lengths into one chain.",
                )
            taken[text] = name


def _role(part: Component) -> Role | None:
    ports = list(part.port_kinds().values())
    return ports[0].role if len(ports) == 1 else None


def _wound(parts: Mapping[str, Component]) -> list[str]:
    """Every coil: that of a magnet, and those in further circuits of it."""
    wound = [name for name in parts if "winding_temperature" in type(parts[name]).model_fields]
    others = [f"{name}.{more}" for name in wound for more in getattr(parts[name], "circuits", {})]
    return wound + others


def _named_nodes(thermal: CaseThermal) -> Iterator[tuple[Key, str]]:
    """Every node that the section names, with its key."""
    for i, sent in enumerate(thermal.heat):
        yield ("heat", i, "node"), sent.node
    for coil, node in thermal.windings.items():
        yield ("windings", coil), node
    if thermal.fluid is not None:
        yield ("fluid",), thermal.fluid
    for coil, magnet in thermal.magnets.items():
        yield ("magnets", coil, "node"), magnet.node
    for name, growth in thermal.growth.items():
        for i, item in enumerate(growth.lengths):
            yield ("growth", name, "lengths", i, "node"), item.node


def _check_heat(thermal: CaseThermal, parts: Mapping[str, Component]) -> None:
    shares: dict[str, float] = {}
    for i, sent in enumerate(thermal.heat):
        key: Key = ("thermal", "heat", i, "loss")
        component = sent.loss.split(" ")[0]
        require_known(key, component, list(parts.keys()), "component")
        for other in shares:
            same = other.split(" ")[0] == component and other != sent.loss
            if same and component in (other, sent.loss):
                raise CaseProblem(
                    key,
                    got=f"'{sent.loss}' beside '{other}', which counts some heat twice",
                    expected="all losses of a component together, or each of them by its name",
                    hint=f"name the losses of '{component}' one by one.",
                )
        shares[sent.loss] = shares.get(sent.loss, 0.0) + sent.share
        if shares[sent.loss] > 1.0 + 1e-9:
            raise CaseProblem(
                ("thermal", "heat", i, "share"),
                got=f"{shares[sent.loss]:g} of '{sent.loss}' in all",
                expected="at most 1",
                hint="lower the shares.",
            )


def _check_grown(key: Key, text: str, parts: Mapping[str, Component]) -> None:
    component, _, _ = text.partition(".")
    require_known(key, component, list(parts.keys()), "component")
    part = parts[component]
    known = {
        name: kind
        for name, info in type(part).model_fields.items()
        if (kind := kind_of_field(info)) is not None
    }
    fitting = [
        f"{component}.{name}"
        for name, kind in known.items()
        if isinstance(getattr(part, name), float)
        and (kind.unit == "m" or (name == "preload" and hasattr(part, "stiffness")))
    ]
    if text not in fitting:
        raise CaseProblem(
            key,
            got=f"'{text}'",
            expected=f"a length of '{component}', or the preload of a spring: {one_of(fitting)}",
            hint=nearest(text, fitting, "write component.key, as stop.gap."),
        )
