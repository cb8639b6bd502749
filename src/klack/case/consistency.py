"""Checks that need more than one section of a case."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

from klack.input.problem import CaseProblem, Key, nearest, one_of

if TYPE_CHECKING:
    from klack.case.bodies import CaseFile, SurfaceName
    from klack.case.schema import Case

__all__ = ["check_body", "check_consistency", "check_surface", "require_known"]


def check_consistency(case: "Case") -> None:
    """Raise :class:`CaseProblem` for the first contradiction between sections."""
    _check_bodies(case)
    for i, surface in enumerate(case.contact.between):
        check_surface(case, ("contact", "between", i), surface)
    _check_roles(case)
    for name in case.bodies:
        check_body(case, name)
    for name in case.reduction.modes:
        require_known(("reduction", "modes", name), name, case.bodies, "body", on_key=True)
    _check_local_law(case)
    if "lumped" in case.run.levels and case.lumped is None:
        raise CaseProblem(
            ("run", "levels"),
            got="the level 'lumped' without a section 'lumped'",
            expected="its stiffness",
            hint="add 'lumped: {stiffness: 1e9 N/m}', or remove the level.",
        )


def require_known(
    key: Key, name: str, known: Iterable[str], what: str, *, on_key: bool = False
) -> None:
    """Raise :class:`CaseProblem` unless ``name`` is among the known ones; propose the nearest."""
    known = list(known)
    if name not in known:
        raise CaseProblem(
            key,
            got=f"the unknown {what} '{name}'",
            expected=f"one of: {one_of(known)}",
            hint=nearest(name, known, f"name a {what} that this case defines."),
            on_key=on_key,
        )


def _check_bodies(case: "Case") -> None:
    if len(case.bodies) != 2:
        raise CaseProblem(
            ("bodies",),
            got=f"{len(case.bodies)} bodies ({one_of(case.bodies)})",
            expected="exactly two",
            hint="one that moves and one that it hits.",
        )


def check_surface(case: "CaseFile", key: Key, surface: "SurfaceName") -> None:
    """Check that a body has the surface that ``key`` names, as far as a drawing tells."""
    require_known(key, surface.body, case.bodies, "body")
    profile = case.bodies[surface.body].geometry.profile
    if profile is not None:
        require_known(key, surface.surface, profile.surfaces, f"surface of {surface.body}")


def _check_roles(case: "Case") -> None:
    moving, stop = case.contact.between
    if moving.body == stop.body:
        raise CaseProblem(
            ("contact", "between"),
            got=f"{moving} and {stop}, two surfaces of one body",
            expected="surfaces of two bodies",
            hint=f"name a surface of {one_of(n for n in case.bodies if n != moving.body)}.",
        )
    if case.moving_body.fixed:
        raise CaseProblem(
            ("bodies", moving.body, "fixed"),
            got=f"supports of '{moving.body}', the body that moves",
            expected="no supports there",
            hint="remove 'fixed', or swap the two surfaces in contact.between.",
            on_key=True,
        )
    models = [case.bodies[s.body].geometry.dimension for s in case.contact.between]
    if models[0] != models[1]:
        flat, solid = (moving, stop) if models[0] == 2 else (stop, moving)
        raise CaseProblem(
            ("bodies", flat.body, "geometry", "model"),
            got=f"an axisymmetric '{flat.body}' and a three-dimensional '{solid.body}'",
            expected="both axisymmetric or both three-dimensional",
            hint=f"take 'model: swept' with 'layers: 18' for '{flat.body}'.",
        )


def check_body(case: "CaseFile", name: str) -> None:
    """Check the materials of a body and the surfaces that its supports and mesh name."""
    _check_materials(case, name)
    _check_surfaces(case, name)


def _check_materials(case: "CaseFile", name: str) -> None:
    body = case.bodies[name]
    key: Key = ("bodies", name, "material")
    if isinstance(body.material, str):
        require_known(key, body.material, case.materials, "material")
        return
    for solid, material in body.material.items():
        require_known((*key, solid), material, case.materials, "material")
    if body.geometry.profile is not None:
        parts = body.geometry.profile.parts
        for solid in body.material:
            require_known((*key, solid), solid, parts, "part", on_key=True)
        for part in parts:
            if part not in body.material:
                raise CaseProblem(
                    key,
                    got=f"no material for the part '{part}'",
                    expected=f"one for each part: {one_of(parts)}",
                    hint=f"add '{part}: {next(iter(case.materials))}'.",
                )


def _check_surfaces(case: "CaseFile", name: str) -> None:
    body = case.bodies[name]
    if body.geometry.profile is None:
        return  # the names are inside the file; the mesh says which are missing
    known = body.geometry.profile.surfaces
    for i, support in enumerate(body.fixed or ()):
        key: Key = ("bodies", name, "fixed", i, "surface")
        require_known(key, support.surface, known, f"surface of {name}")
    for surface in body.mesh.surfaces if body.mesh else ():
        key = ("bodies", name, "mesh", "surfaces", surface)
        require_known(key, surface, known, f"surface of {name}", on_key=True)


def _check_local_law(case: "Case") -> None:
    correction, law = case.reduction.correction, case.contact.local_law.kind
    if correction == "consistent" and law != "consistent":
        raise CaseProblem(
            ("contact", "local_law", "kind"),
            got=f"a {law} law with the correction 'consistent'",
            expected="the law 'consistent': it is what carries the missing compliance",
            hint="remove local_law, or set 'reduction: {correction: attachment}' for it.",
        )
    if correction != "consistent" and law == "consistent":
        raise CaseProblem(
            ("reduction", "correction"),
            got=f"the correction '{correction}' with a consistent local law",
            expected="a local law of the kind linear, hertz or submodel",
            hint="add 'contact: {local_law: {kind: submodel, size: 1 mm}}', or take the correction "
            "'consistent'.",
        )
