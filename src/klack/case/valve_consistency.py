"""Checks between the sections of a valve case."""

from collections.abc import Iterator, Mapping

from klack.case.consistency import (
    check_body,
    check_drawn_place,
    check_shifts,
    check_surface,
    require_known,
    require_surfaces,
)
from klack.case.spatial_consistency import check_motion
from klack.case.thermal import CaseThermal
from klack.case.valve_roles import END_STOP, FLEXIBLE_BODY, Meeting, find_meetings, find_roles
from klack.case.valve_sections import ValveSections
from klack.input.problem import CaseProblem, Key, nearest, one_of, refuse_key_if
from klack.network.component import Component
from klack.network.described import kind_of_field
from klack.network.port import Role
from klack.units import format_si

__all__ = ["check_thermal", "check_valve", "is_consistent"]


def check_shots_of_valve(case: ValveSections) -> None:
    """Reject shots that this valve cannot have."""
    shots = case.shots
    if shots is None:
        return
    placed = case.placement is not None
    refuse_key_if(
        case.motion == "axial",
        ("shots",),
        got="shots of a needle that moves along its axis",
        expected="motion: three-dimensional, and a guide: along the axis all strokes are equal",
        hint="add 'motion: three-dimensional' and 'guide', or remove this section.",
        on_key=True,
    )
    if case.guide is None:
        raise CaseProblem(
            ("shots",),
            got="shots without a guide",
            expected="a section 'guide', whose clearance bounds the position of the needle",
            hint="add 'guide: {surface: ..., heights: [..., ...], clearance: ...}'.",
            on_key=True,
        )
    check_drawn_place(shots.eccentricity, shots.tilt)
    refuse_key_if(
        placed and not shots.carry,
        ("placement",),
        got="a placement together with shots, each of which has its own",
        expected="one of them",
        hint="remove 'placement': shots draw it from shots.seed. With shots.carry: true "
        "the first stroke starts from it.",
        on_key=True,
    )
    refuse_key_if(
        placed and shots.draws_position,
        ("shots", "eccentricity"),
        got="a drawn position together with a placement",
        expected="only one of them: the first stroke starts from it",
        hint="remove 'placement', or shots.eccentricity and shots.tilt.",
        on_key=True,
    )


def check_valve(case: ValveSections) -> None:
    """Reject the first contradiction between sections."""
    for name in case.bodies:
        require_surfaces(case, name)
        check_body(case, name)
        _check_ports(case, name)
        refuse_key_if(
            case.bodies[name].non_reflecting is not None,
            ("bodies", name, "non_reflecting"),
            got="a non-reflecting end of a body of a valve",
            expected="none: strokes use only modes",
            hint="use it in an impact, at level full.",
            on_key=True,
        )
    for name in case.reduction.modes:
        require_known(("reduction", "modes", name), name, case.bodies, "body", on_key=True)
    check_shifts(case, case.reduction)
    refuse_key_if(
        case.reduction.shifts and case.reduction.correction != "attachment",
        ("reduction", "shifts"),
        got=f"shifts of attachment modes with the correction '{case.reduction.correction}'",
        expected="the correction 'attachment'",
        hint="remove 'shifts', or write 'correction: attachment' and give the end stops a law.",
        on_key=True,
    )
    _check_flexible_bodies(case)
    network = case.network.network()
    meetings = find_meetings(network)
    for name in case.stops:
        _check_stop(case, name, meetings)
    _check_laws(case)
    _check_friction(case)
    _check_worn(case)
    if case.lumped is None:
        for variant in case.run.variants:
            refuse_key_if(
                variant.endswith("lumped"),
                ("run", "variants"),
                got=f"the variant '{variant}' without a section 'lumped'",
                expected="its stiffness",
                hint="add 'lumped: {stiffness: 1e9 N/m}', or remove the variant.",
            )
    check_motion(case, meetings, find_roles(case, network))
    check_shots_of_valve(case)


def _check_ports(case: ValveSections, name: str) -> None:
    body = case.bodies[name]
    for port, place in body.ports.items():
        key: Key = ("bodies", name, "ports", port)
        profile = body.geometry.profile
        if profile is None:
            continue
        require_known((*key, "surface"), place.surface, profile.surfaces, f"surface of {name}")
        refuse_key_if(
            port in profile.surfaces and port != place.surface,
            key,
            got=f"the name of the surface '{port}' for a port on '{place.surface}'",
            expected="a different name",
            hint="rename the port here and in the network.",
            on_key=True,
        )


def _check_flexible_bodies(case: ValveSections) -> None:
    """Each flexible body is a body of the case, once, at existing points."""
    used: dict[str, str] = {}
    for name, part in case.network.components.items():
        if part.type != FLEXIBLE_BODY:
            continue
        key: Key = ("network", "components", name)
        body, points = str(getattr(part, "body", "")), tuple(getattr(part, "points", ()))
        require_known((*key, "body"), body, case.bodies, "body")
        if body in used:
            raise CaseProblem(
                (*key, "body"),
                got=f"'{body}' for the second time (first in '{used[body]}')",
                expected="one component for each body",
                hint="give one component all the points.",
            )
        used[body] = name
        known = _points(case, body)
        for i, point in enumerate(points):
            if known is not None:
                require_known((*key, "points", i), point, known, f"surface or port of {body}")
    for body in case.bodies:
        refuse_key_if(
            body not in used,
            ("bodies", body),
            got=f"a body '{body}' that the network does not use",
            expected=f"a component {{type: {FLEXIBLE_BODY}, body: {body}, points: [...]}}",
            hint="add it to network.components, or remove the body.",
            on_key=True,
        )


def _points(case: ValveSections, body: str) -> tuple[str, ...] | None:
    """Points of a body; None if only its mesh has them."""
    profile = case.bodies[body].geometry.profile
    return None if profile is None else (*case.bodies[body].ports, *profile.surfaces)


def _check_stop(case: ValveSections, name: str, meetings: dict[str, Meeting]) -> None:
    key: Key = ("stops", name)
    stop = case.stops[name]
    for i, surface in enumerate(stop.between):
        check_surface(case, (*key, "between", i), surface)
        for other, rival in case.stops.items():
            refuse_key_if(
                other != name and surface in rival.between,
                (*key, "between", i),
                got=f"{surface}, which the stop '{other}' uses as well",
                expected="a separate surface for each stop",
                hint="split the edge in the drawing.",
            )
    refuse_key_if(
        stop.upper.body == stop.lower.body,
        (*key, "between"),
        got=f"{stop.upper} and {stop.lower}, two surfaces of one body",
        expected="surfaces of two bodies",
        hint="draw the stop as a separate body.",
    )
    flat = [side.body for side in stop.between if case.bodies[side.body].geometry.dimension == 2]
    if len(flat) == 1:
        (solid,) = {stop.upper.body, stop.lower.body} - set(flat)
        raise CaseProblem(
            (*key, "between"),
            got=f"an axisymmetric '{flat[0]}' and a three-dimensional '{solid}'",
            expected="both axisymmetric or both three-dimensional",
            hint=f"use 'model: swept' with 'layers: 18' for '{flat[0]}', or 'model: "
            f"axisymmetric' for '{solid}' if it is a turned part.",
        )
    require_known(key, name, meetings, f"{END_STOP} of the network", on_key=True)
    for side, surface in zip(("upper", "lower"), stop.between, strict=True):
        met: tuple[str, str] | None = getattr(meetings[name], side)
        part = case.network.components[met[0]] if met else None
        if part is None or met is None or (getattr(part, "body", ""), met[1]) != surface:
            found = f"{met[0]}.{met[1]}" if met else "the ground"
            raise CaseProblem(
                (*key, "between"),
                got=f"{surface}, but the network joins {name}.{side} to {found}",
                expected=f"{name}.{side} at the point '{surface.surface}' of '{surface.body}'",
                hint="the upper surface must come first; correct the connection or the stop.",
            )


def _check_laws(case: ValveSections) -> None:
    """A consistent law needs surfaces, and a correction with residual compliance."""
    for name, part in case.network.components.items():
        if part.type != END_STOP or not is_consistent(part):
            continue
        refuse_key_if(
            name not in case.stops,
            ("network", "components", name, "law"),
            got="a consistent law, but no surfaces to compute it from",
            expected=f"the surfaces of the stop: stops: {{{name}: {{between: ...}}}}",
            hint=f"add them (bodies of this case: {one_of(case.bodies)}), or give a law.",
        )
        series = getattr(part, "series_compliance", 0.0)
        if series > 0.0:
            raise CaseProblem(
                ("network", "components", name, "series_compliance"),
                got=f"{series:g} m/N together with a consistent law",
                expected="no series compliance: that law has its own",
                hint="leave it out, or give the end stop a linear law.",
            )
        refuse_key_if(
            case.reduction.correction != "consistent",
            ("reduction", "correction"),
            got=f"'{case.reduction.correction}' with the consistent law of '{name}'",
            expected="the correction 'consistent'",
            hint="or give the end stop a linear law.",
        )


def _check_friction(case: ValveSections) -> None:
    """Friction of faces needs a fitting law, and no other loss of the impact."""
    for name, stop in case.stops.items():
        if stop.friction == 0.0:
            continue
        part = case.network.components[name]
        if not is_consistent(part):
            raise CaseProblem(
                ("stops", name, "friction"),
                got=f"{stop.friction:g} at an end stop whose law is not computed",
                expected="0, or the consistent law at this stop, the only law with friction",
                hint=f"write law: {{kind: consistent}} in network.components.{name}, or leave the "
                "friction out.",
            )
        restitution = getattr(part, "restitution", None)
        if restitution is not None:
            raise CaseProblem(
                ("network", "components", name, "restitution"),
                got=f"{restitution:g} together with the friction {stop.friction:g} of the same "
                f"stop",
                expected="only one of them: a restitution represents all losses of an impact",
                hint=f"leave the restitution out, or stops.{name}.friction.",
            )


def _check_worn(case: ValveSections) -> None:
    """Worn faces are those of a computed law."""
    for name, stop in case.stops.items():
        refuse_key_if(
            stop.worn is not None and not is_consistent(case.network.components[name]),
            ("stops", name, "worn"),
            got="worn faces at an end stop whose law is not computed",
            expected="the consistent law at this stop, the only law with faces",
            hint=f"write law: {{kind: consistent}} in network.components.{name}, or leave "
            "'worn' out.",
            on_key=True,
        )


def is_consistent(part: Component) -> bool:
    """Whether an end stop waits for a law from static contact."""
    return getattr(getattr(part, "law", None), "kind", "") == "consistent"


_NODES = (Role.HEAT_STORE, Role.TEMPERATURE)


def check_thermal(case: ValveSections) -> None:
    """Reject names that the network does not have."""
    thermal = case.thermal
    if thermal is None:
        return
    parts = case.network.components
    nodes = [name for name, part in parts.items() if _role(part) in _NODES]
    refuse_key_if(
        not nodes,
        ("thermal",),
        got="no thermal node in the network",
        expected="a component of the type heat-capacity for each part that warms up",
        hint="add e.g. 'copper: {type: heat-capacity, capacity: 9 J/K}'.",
        on_key=True,
    )
    for key, node in _named_nodes(thermal):
        require_known(("thermal", *key), node, nodes, "heat-capacity or fixed-temperature")
    refuse_key_if(
        thermal.period < case.run.duration * (1.0 - 1e-12),
        ("thermal", "period"),
        got=format_si(thermal.period, "s"),
        expected=f"run.duration or more, {format_si(case.run.duration, 's')}",
        hint="a stroke must end before the next one begins; shorten run.duration.",
    )
    _check_heat(thermal, parts)
    refuse_key_if(
        thermal.fluid is not None and case.network.fluid is None,
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
                    got=f"'{text}' for the second time (first in '{taken[text]}')",
                    expected="one chain for each gap",
                    hint="put all lengths into one chain.",
                )
            taken[text] = name


def _role(part: Component) -> Role | None:
    ports = list(part.port_kinds().values())
    return ports[0].role if len(ports) == 1 else None


def _wound(parts: Mapping[str, Component]) -> list[str]:
    """Coils of magnets and of their further circuits."""
    wound = [name for name in parts if "winding_temperature" in type(parts[name]).model_fields]
    others = [f"{name}.{more}" for name in wound for more in getattr(parts[name], "circuits", {})]
    return wound + others


def _named_nodes(thermal: CaseThermal) -> Iterator[tuple[Key, str]]:
    """Nodes that the section names, with keys."""
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
            refuse_key_if(
                same and component in (other, sent.loss),
                key,
                got=f"'{sent.loss}' together with '{other}', which would count some heat twice",
                expected="all losses of a component together, or each of them by name",
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
