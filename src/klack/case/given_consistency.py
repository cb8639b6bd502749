"""Checks of cases with bodies that have no surfaces: reduced models, and nodes with matrices.

Such bodies meet at one port each.  What needs faces (point by point contact, placement, guide,
sound) is refused here, before anything is read.
"""

from klack.case.bodies import CaseBody, CaseFile, SurfaceName
from klack.case.impact_sections import ImpactSections
from klack.errors import refuse
from klack.input.problem import CaseProblem, Key, nearest, one_of

__all__ = ["GIVEN_LEVELS", "check_given", "check_port", "require_surfaces"]

GIVEN_LEVELS = ("lumped", "reduced")
"""Levels that need no surfaces."""

_ON_SURFACES = ("guide", "opposite", "shots", "noise", "measurement")


def check_port(key: Key, surface: SurfaceName, body: CaseBody) -> None:
    """Check that a body without surfaces has a port or node set of that name."""
    if body.reduced is not None:
        known, what = list(body.reduced.ports), "port"
    elif body.geometry.nodes is not None:
        known, what = list(body.geometry.nodes.sets), "node set"
    else:
        return
    if surface.surface not in known:
        raise CaseProblem(
            key,
            got=f"the unknown {what} '{surface.surface}' of {surface.body}",
            expected=f"one of: {one_of(known) or '(none)'}",
            hint=nearest(surface.surface, known, f"name a {what} of this body."),
        )


def require_surfaces(case: CaseFile, name: str) -> None:
    """Refuse a body without surfaces in a whole valve, whose stops solve their static contact."""
    body = case.bodies[name]
    if not body.has_surfaces:
        kind = "reduced" if body.reduced is not None else "geometry"
        raise CaseProblem(
            ("bodies", name, kind),
            got="a reduced model or nodes without elements in a whole valve",
            expected="a body with meshed surfaces",
            hint="'klack impact' takes such bodies; for a stroke give the mesh, optionally "
            "with its matrices.",
            on_key=True,
        )


def check_given(case: ImpactSections) -> None:
    """Raise :class:`CaseProblem` for what needs the surfaces that a body does not have."""
    name = next(name for name, body in case.bodies.items() if not body.has_surfaces)
    what = "a reduced model" if case.bodies[name].reduced is not None else "nodes alone"
    for section in _ON_SURFACES:
        if getattr(case, section) is not None:
            raise CaseProblem(
                (section,),
                got=f"'{section}' with '{name}', {what}",
                expected="bodies with surfaces",
                hint=f"remove '{section}', or give '{name}' a mesh.",
                on_key=True,
            )
    refuse(
        (
            not case.motion.placement.is_centred,
            CaseProblem(
                ("motion", "placement"),
                got=f"an off-axis placement with '{name}', {what}",
                expected="a centred body: a port moves along the axis alone",
                hint="remove 'placement'.",
                on_key=True,
            ),
        ),
        (
            case.run.transfer is not None,
            CaseProblem(
                ("run", "transfer"),
                got=f"transfer functions of the full order with '{name}', {what}",
                expected="bodies that klack reduces itself",
                hint="remove 'transfer'.",
                on_key=True,
            ),
        ),
        (
            case.reduction.shifts,
            CaseProblem(
                ("reduction", "shifts"),
                got=f"shifts of attachment modes with '{name}', {what}",
                expected="two meshed bodies: there are no attachment modes without",
                hint="remove 'shifts'.",
                on_key=True,
            ),
        ),
    )
    _check_law(case, name, what)
    forms = ("crown", "waviness", "tilt", "roughness")
    form = next((key for key in forms if getattr(case.contact, key)), None)
    refuse(
        (
            not case.contact.faces.is_none,
            CaseProblem(
                ("contact", "friction" if case.contact.friction else "static_friction"),
                got=f"friction with '{name}', {what}",
                expected="no friction: without a surface nothing is known of its slip",
                hint="leave it out, or give the body a mesh.",
            ),
        ),
        (
            form is not None,
            CaseProblem(
                ("contact", form),
                got=f"the key '{form}' of faces with '{name}', {what}",
                expected="bodies with surfaces",
                hint=f"remove '{form}', or give '{name}' a mesh.",
                on_key=True,
            ),
        ),
    )
    for i, level in enumerate(case.run.levels):
        if level not in GIVEN_LEVELS:
            raise CaseProblem(
                ("run", "levels", i) if "levels" in case.run.model_fields_set else ("run",),
                got=f"the level '{level}' with '{name}', {what}",
                expected=f"levels among: {one_of(GIVEN_LEVELS)}",
                hint="write 'levels: [reduced]'.",
            )


def _check_law(case: ImpactSections, name: str, what: str) -> None:
    law = case.contact.local_law
    if law.kind not in ("linear", "hertz"):
        raise CaseProblem(
            ("contact", "local_law", "kind")
            if "local_law" in case.contact.model_fields_set
            else ("contact",),
            got=f"the local law '{law.kind}' with '{name}', {what}",
            expected="a given law: linear or hertz",
            hint="add 'local_law: {kind: linear, stiffness: 1e9 N/m}': the contact zone alone; "
            "the static compliance of the bodies is added.",
        )
    if law.kind == "hertz" and law.modulus is None:
        for body, given in case.bodies.items():
            if given.material is None:
                raise CaseProblem(
                    ("contact", "local_law"),
                    got=f"a Hertz law without modulus, and '{body}' without material",
                    expected="modulus: the effective modulus E*",
                    hint="115 GPa for steel on steel.",
                )
    if case.reduction.correction == "attachment":
        raise CaseProblem(
            ("reduction", "correction"),
            got=f"attachment modes with '{name}', {what}",
            expected="consistent (the residual compliance in series with the law), or none",
            hint="remove 'correction'.",
        )
