"""Surface names of a case, checked when its STEP file or mesh is read.

Those of a drawn body are known before.
"""

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

from klack.case.bodies import CaseFile
from klack.case.noise import mounting_places
from klack.case.reader import parse
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.case.valve_roles import FLEXIBLE_BODY
from klack.errors import InputError
from klack.input.problem import Key, key_text, nearest, one_of

__all__ = ["place_of", "require_surface_names"]

_Named = tuple[Key, str, str]
"""Key, body, surface."""


def require_surface_names(case: CaseFile, known: Mapping[str, Collection[str]]) -> None:
    """Check every surface name of the bodies whose surfaces are known; proposes the nearest."""
    for key, body, surface in (*_of_bodies(case), *_of_contacts(case)):
        if body in known and surface not in known[body]:
            raise InputError(
                place_of(case, key, on_key=key[-1] == surface),
                got=f"the unknown surface '{surface}' of {body}",
                expected=f"one of: {one_of(known[body])}",
                hint=nearest(
                    surface, known[body], "klack inspect FILE shows the position of each."
                ),
            )


def _of_bodies(case: CaseFile) -> Iterator[_Named]:
    for name, body in case.bodies.items():
        for i, support in enumerate(body.fixed or ()):
            yield ("bodies", name, "fixed", i, "surface"), name, support.surface
        for surface in body.mesh.surfaces if body.mesh else ():
            yield ("bodies", name, "mesh", "surfaces", surface), name, surface
    noise = case.noise if isinstance(case, Case | ValveCase) else None
    for i, place in enumerate(noise.surfaces or () if noise else ()):
        yield ("noise", "surfaces", i), place.body, place.surface
    for key, place in mounting_places(noise) if noise else ():
        yield key, place.body, place.surface


def _of_contacts(case: CaseFile) -> Iterator[_Named]:
    if isinstance(case, Case):
        pairs = [(("contact", "between"), case.contact.between)]
        if case.opposite is not None:
            pairs.append((("opposite", "between"), case.opposite.between))
        if case.backing is not None:
            pairs.append((("backing", "between"), case.backing.between))
            if case.backing.clamp is not None:
                yield (
                    ("backing", "clamp", "surface"),
                    case.contact.stop.body,
                    case.backing.clamp.surface,
                )
        if case.guide is not None:
            yield ("guide", "surface"), case.contact.moving.body, case.guide.surface
        for key, between in pairs:
            for i, place in enumerate(between):
                yield (*key, i), place.body, place.surface
    elif isinstance(case, ValveCase):
        yield from _of_valve(case)


def _of_valve(case: ValveCase) -> Iterator[_Named]:
    for name, stop in case.stops.items():
        for i, place in enumerate(stop.between):
            yield ("stops", name, "between", i), place.body, place.surface
    for name, body in case.bodies.items():
        for port, at in body.ports.items():
            yield ("bodies", name, "ports", port, "surface"), name, at.surface
    for name, part in case.network.components.items():
        if part.type != FLEXIBLE_BODY:
            continue
        used = str(getattr(part, "body", ""))
        for i, point in enumerate(getattr(part, "points", ())):
            if used in case.bodies and point not in case.bodies[used].ports:
                yield ("network", "components", name, "points", i), used, point


def place_of(case: CaseFile, key: Key, *, on_key: bool) -> str:
    """File, line and key in a case."""
    if case.expanded is not None:
        return case.expanded.origin(key).where(on_key=on_key)
    path = case.path or Path("case")
    if not case.source:
        return f"{path}: {key_text(key)}"
    _, lines = parse(case.source, path)
    return f"{path}:{lines.find(key, on_key=on_key)}: {key_text(key)}"
