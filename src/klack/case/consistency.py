"""Checks that need more than one section of a case."""

from collections.abc import Iterable

import numpy as np

from klack.case.bodies import CaseBody, CaseFile, Reduction, SurfaceName
from klack.case.impact_sections import ImpactSections
from klack.case.machine import machine_mounts
from klack.case.noise import CaseNoise, mounting_places
from klack.case.outputs import check_outputs
from klack.case.valve_roles import find_roles
from klack.case.valve_sections import ValveSections
from klack.contact.friction import MOST_FRICTION
from klack.input.problem import CaseProblem, Key, nearest, one_of, refuse_key_if
from klack.units import format_si

__all__ = [
    "BACKING_LEVELS",
    "GIVEN_LEVELS",
    "check_body",
    "check_consistency",
    "check_drawn_place",
    "check_noise",
    "check_shifts",
    "check_surface",
    "require_known",
    "require_surfaces",
]


GIVEN_LEVELS = ("lumped", "reduced")
"""Levels that need no surfaces."""

_ON_SURFACES = ("guide", "opposite", "backing", "shots", "noise", "measurement")


def check_port(key: Key, surface: SurfaceName, body: CaseBody) -> None:
    """A body without surfaces must have a port or node set of that name.

    Such bodies meet at one port each. What needs faces (contact points, placement, guide, sound)
    is rejected before anything is read.
    """
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
    """Reject a body without surfaces in a valve, whose stops solve static contact."""
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
    """Reject what needs surfaces that a body does not have."""
    name = next(name for name, body in case.bodies.items() if not body.has_surfaces)
    what = "a reduced model" if case.bodies[name].reduced is not None else "nodes alone"
    for section in _ON_SURFACES:
        refuse_key_if(
            getattr(case, section) is not None,
            (section,),
            got=f"'{section}' with '{name}', {what}",
            expected="bodies with surfaces",
            hint=f"remove '{section}', or give '{name}' a mesh.",
            on_key=True,
        )
    refuse_key_if(
        not case.motion.is_straight,
        ("motion",),
        got=f"a motion sideways or a spin with '{name}', {what}",
        expected="a motion along the axis: a port moves only along the axis",
        hint="remove 'sideways_speed' and 'spin'.",
    )
    refuse_key_if(
        not case.motion.placement.is_centred,
        ("motion", "placement"),
        got=f"an off-axis placement with '{name}', {what}",
        expected="a centred body: a port moves only along the axis",
        hint="remove 'placement'.",
        on_key=True,
    )
    refuse_key_if(
        case.run.transfer is not None,
        ("run", "transfer"),
        got=f"transfer functions of the full order with '{name}', {what}",
        expected="bodies that are reduced by klack",
        hint="remove 'transfer'.",
        on_key=True,
    )
    refuse_key_if(
        case.reduction.shifts,
        ("reduction", "shifts"),
        got=f"shifts of attachment modes with '{name}', {what}",
        expected="two meshed bodies: attachment modes need a mesh",
        hint="remove 'shifts'.",
        on_key=True,
    )
    _check_law(case, name, what)
    forms = ("crown", "waviness", "tilt", "roughness")
    form = next((key for key in forms if getattr(case.contact, key)), None)
    refuse_key_if(
        not case.contact.faces.is_none,
        ("contact", "friction" if case.contact.friction else "static_friction"),
        got=f"friction with '{name}', {what}",
        expected="no friction: without a surface the slip is unknown",
        hint="leave friction out, or give the body a mesh.",
    )
    refuse_key_if(
        form is not None,
        ("contact", str(form)),
        got=f"the key '{form}' of faces with '{name}', {what}",
        expected="bodies with surfaces",
        hint=f"remove '{form}', or give '{name}' a mesh.",
        on_key=True,
    )
    for i, level in enumerate(case.run.levels):
        refuse_key_if(
            level not in GIVEN_LEVELS,
            ("run", "levels", i) if "levels" in case.run.model_fields_set else ("run",),
            got=f"the level '{level}' with '{name}', {what}",
            expected=f"levels among: {one_of(GIVEN_LEVELS)}",
            hint="write 'levels: [reduced]'.",
        )


def _check_law(case: ImpactSections, name: str, what: str) -> None:
    law = case.contact.local_law
    refuse_key_if(
        law.kind not in ("linear", "hertz"),
        ("contact", "local_law", "kind")
        if "local_law" in case.contact.model_fields_set
        else ("contact",),
        got=f"the local law '{law.kind}' with '{name}', {what}",
        expected="a given law: linear or hertz",
        hint="add 'local_law: {kind: linear, stiffness: 1e9 N/m}', for only the contact "
        "zone; the static compliance of the bodies is added.",
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
    refuse_key_if(
        case.reduction.correction == "attachment",
        ("reduction", "correction"),
        got=f"attachment modes with '{name}', {what}",
        expected="consistent (the residual compliance in series with the law), or none",
        hint="remove 'correction'.",
    )


def check_consistency(case: ImpactSections) -> None:
    """Reject the first contradiction between sections (:class:`CaseProblem`)."""
    _check_bodies(case)
    for i, surface in enumerate(case.contact.between):
        check_surface(case, ("contact", "between", i), surface)
    _check_roles(case)
    if not case.has_surfaces:
        check_given(case)
    for name in case.bodies:
        check_body(case, name)
    for name in case.reduction.modes:
        require_known(("reduction", "modes", name), name, case.bodies, "body", on_key=True)
    check_shifts(case, case.reduction)
    for check in (
        _check_backing,
        _check_local_law,
        _check_opposite,
        _check_roughness,
        _check_solid_only,
        _check_off_axis,
        _check_oblique,
        _check_guide,
        _check_shots,
        _check_outputs,
        _check_nodes,
        _check_ends,
    ):
        check(case)
    motion = case.motion
    centred = motion.placement.is_centred and motion.is_straight
    centred = centred and case.guide is None and case.shots is None
    # worn faces are those of a centred impact
    refuse_key_if(
        case.contact.worn is not None and not (centred and case.has_surfaces),
        ("contact", "worn"),
        got="worn faces of off-axis bodies, or of given models",
        expected="a centred impact of bodies with meshes",
        hint="remove 'worn', or the placement, guide or shots.",
        on_key=True,
    )
    refuse_key_if(
        "lumped" in case.run.levels and case.lumped is None,
        ("run", "levels"),
        got="the level 'lumped' without a section 'lumped'",
        expected="its stiffness",
        hint="add 'lumped: {stiffness: 1e9 N/m}', or remove the level.",
    )


def require_known(
    key: Key, name: str, known: Iterable[str], what: str, *, on_key: bool = False
) -> None:
    """Reject a ``name`` that is not known; propose the nearest."""
    known = list(known)
    if name not in known:
        raise CaseProblem(
            key,
            got=f"the unknown {what} '{name}'",
            expected=f"one of: {one_of(known)}",
            hint=nearest(name, known, f"name a {what} that this case defines, or define it."),
            on_key=on_key,
        )


def check_shifts(case: CaseFile, reduction: Reduction) -> None:
    """Shifts of attachment modes need bodies with elements."""
    for name in reduction.shifts:
        key: Key = ("reduction", "shifts", name)
        require_known(key, name, case.bodies, "body", on_key=True)
        refuse_key_if(
            case.bodies[name].reduced is not None,
            key,
            got=f"shifts of '{name}', which is a reduced model already",
            expected="shifts of a body that klack reduces",
            hint="remove them.",
            on_key=True,
        )


def _check_bodies(case: ImpactSections) -> None:
    refuse_key_if(
        case.opposite is not None and case.backing is not None,
        ("backing",),
        got="a body behind the struck body together with an upper stop",
        expected="only one of them: no level supports both",
        hint="remove 'backing' or 'opposite'; klack stroke supports both.",
        on_key=True,
    )
    has_third = case.opposite is not None or case.backing is not None
    count, words = (3, "three") if has_third else (2, "two")
    if len(case.bodies) != count:
        names = [side.body for side in case.contact.between]
        third = next((name for name in case.bodies if name not in names), "housing")
        raise CaseProblem(
            ("bodies",),
            got=f"{len(case.bodies)} bodies ({one_of(case.bodies)})",
            expected=f"exactly {words}",
            hint="a moving body and the one that it hits; a third as an upper stop "
            f"('opposite'), or behind the struck body: 'backing: {{between: [{names[1]}.SURFACE, "
            f"{third}.SURFACE]}}'.",
        )


def check_surface(case: CaseFile, key: Key, surface: SurfaceName) -> None:
    """A body must have the surface named by ``key``, as far as the drawing shows."""
    require_known(key, surface.body, case.bodies, "body")
    body = case.bodies[surface.body]
    if not body.has_surfaces:
        check_port(key, surface, body)
    profile = body.geometry.profile
    if profile is not None:
        require_known(key, surface.surface, profile.surfaces, f"surface of {surface.body}")


def _check_roles(case: ImpactSections) -> None:
    moving, stop = case.contact.between
    refuse_key_if(
        moving.body == stop.body,
        ("contact", "between"),
        got=f"{moving} and {stop}, two surfaces of one body",
        expected="surfaces of two bodies",
        hint=f"name a surface of {one_of(n for n in case.bodies if n != moving.body)}.",
    )
    refuse_key_if(
        case.moving_body.fixed,
        ("bodies", moving.body, "fixed"),
        got=f"supports of '{moving.body}', the moving body",
        expected="no supports there",
        hint="remove 'fixed', or swap the two surfaces in contact.between.",
        on_key=True,
    )
    models = [case.bodies[s.body].geometry.dimension for s in case.contact.between]
    if models[0] != models[1] and case.has_surfaces:
        flat, solid = (moving, stop) if models[0] == 2 else (stop, moving)
        raise CaseProblem(
            ("bodies", flat.body, "geometry", "model"),
            got=f"an axisymmetric '{flat.body}' and a three-dimensional '{solid.body}'",
            expected="both axisymmetric or both three-dimensional",
            hint=f"use 'model: swept' with 'layers: 18' for '{flat.body}'.",
        )


def check_body(case: CaseFile, name: str) -> None:
    """Check materials of a body and surfaces of its supports and mesh."""
    _check_materials(case, name)
    _check_surfaces(case, name)


def _check_materials(case: CaseFile, name: str) -> None:
    body = case.bodies[name]
    key: Key = ("bodies", name, "material")
    if isinstance(body.material, str):
        require_known(key, body.material, case.materials, "material")
        return
    if body.material is None:
        return  # given by matrices or reduced already
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
                    expected=f"a material for each part: {one_of(parts)}",
                    hint=f"add '{part}: {next(iter(case.materials))}'.",
                )


def _check_surfaces(case: CaseFile, name: str) -> None:
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


def _check_local_law(case: ImpactSections) -> None:
    correction, law = case.reduction.correction, case.contact.local_law.kind
    if not case.has_surfaces:
        return  # in given_consistency
    refuse_key_if(
        correction == "consistent" and law != "consistent",
        ("contact", "local_law", "kind"),
        got=f"a {law} law with the correction 'consistent'",
        expected="the law 'consistent', which carries the residual compliance",
        hint="remove local_law, or set 'reduction: {correction: attachment}' for it.",
    )
    refuse_key_if(
        correction != "consistent" and law == "consistent",
        ("reduction", "correction"),
        got=f"the correction '{correction}' with a consistent local law",
        expected="a local law of the kind linear, hertz or submodel",
        hint="add 'contact: {local_law: {kind: submodel, size: 1 mm}}', or use the "
        "correction 'consistent'.",
    )


def _check_opposite(case: ImpactSections) -> None:
    if case.opposite is None:
        return
    for i, surface in enumerate(case.opposite.between):
        check_surface(case, ("opposite", "between", i), surface)
    stop, moving = case.opposite.between
    between = [surface.body for surface in case.contact.between]
    refuse_key_if(
        moving.body != between[0] or stop.body in between,
        ("opposite", "between"),
        got=f"{stop} and {moving}",
        expected=f"a surface of the third body, then one of '{between[0]}', which moves",
        hint="the upper stop is a separate body.",
    )
    refuse_key_if(
        case.bodies[stop.body].geometry.dimension != case.dimension,
        ("bodies", stop.body, "geometry", "model"),
        got=f"'{stop.body}' of another dimension than the moving body",
        expected="all bodies axisymmetric or all three-dimensional",
        hint="use 'model: swept' with 'layers: 18'.",
    )


BACKING_LEVELS = ("reduced",)
"""Levels that know a third body behind the struck one."""


def _check_backing(case: ImpactSections) -> None:
    """A loose body in the middle, met along the axis by elastic, smooth faces as drawn."""
    backing = case.backing
    if backing is None:
        return
    for i, surface in enumerate(backing.between):
        check_surface(case, ("backing", "between", i), surface)
    lower, third = backing.between
    moving, struck = case.contact.between
    refuse_key_if(
        lower.body != struck.body or third.body in (moving.body, struck.body) or lower == struck,
        ("backing", "between"),
        got=f"{lower} and {third}",
        expected=f"another surface of '{struck.body}', then one of the third body",
        hint="the order is needle, insert, housing.",
    )
    if case.contact.gap is None:
        raise CaseProblem(
            ("contact",),
            got="no gap between the moving body and a body that may shift on the one behind it",
            expected="gap: the distance between them at the start",
            hint="add 'gap: 0 um'.",
            on_key=True,
        )
    middle, last = case.bodies[struck.body], case.bodies[third.body]
    refuse_key_if(
        middle.fixed,
        ("bodies", struck.body, "fixed"),
        got=f"supports of '{struck.body}', and a body behind it",
        expected="no supports there: the contact with the body behind carries it",
        hint="remove 'fixed', or 'backing' and the third body.",
        on_key=True,
    )
    refuse_key_if(
        last.geometry.dimension != case.dimension and case.has_surfaces,
        ("bodies", third.body, "geometry", "model"),
        got=f"'{third.body}' of another dimension than the moving body",
        expected="all bodies axisymmetric or all three-dimensional",
        hint="use 'model: swept' with 'layers: 18'.",
    )
    if backing.clamp is not None:
        key: Key = ("backing", "clamp", "surface")
        check_surface(case, key, SurfaceName(body=struck.body, surface=backing.clamp.surface))
        refuse_key_if(
            backing.clamp.surface in (lower.surface, struck.surface),
            key,
            got=f"'{backing.clamp.surface}', where '{struck.body}' meets another body",
            expected="a separate surface, such as a shoulder",
            hint="split the edge in the drawing.",
        )
        refuse_key_if(
            not last.fixed,
            ("backing", "clamp"),
            got=f"a clamp, but '{third.body}' is not held",
            expected=f"bodies.{third.body}.fixed: a surface that carries the preload",
            hint="add 'fixed: [{surface: NAME}]' to it, or remove 'clamp'.",
            on_key=True,
        )
    _check_beside_backing(case)


def _check_beside_backing(case: ImpactSections) -> None:
    """Reject what an impact with a body behind does not have."""
    contact, motion, run = case.contact, case.motion, case.run
    straight = motion.placement.is_centred and motion.is_straight
    rubs = "friction" if contact.friction else "static_friction"
    others = [level for level in run.levels if level not in BACKING_LEVELS]
    asked: list[tuple[Key, object, str]] = [
        (
            ("run", "levels") if "levels" in run.model_fields_set else ("run",),
            others,
            "other levels",
        ),
        (("motion",), not straight, "motion off-axis"),
        (("guide",), case.guide, "a guide"),
        (("shots",), case.shots, "shots"),
        (("measurement",), case.measurement, "a measurement"),
        (("noise",), case.noise, "noise"),
        (("outputs",), case.outputs, "sensors"),
        (("contact", rubs), not contact.faces.is_none, "friction of the faces"),
        (("contact", "roughness"), contact.roughness, "rough faces"),
        (("contact", "crown"), contact.crown, "a crown"),
        (("contact", "waviness"), contact.waviness, "waviness"),
        (("contact", "tilt"), contact.tilt, "a tilt"),
        (("contact", "worn"), contact.worn, "worn faces"),
        (("contact", "local_law"), contact.local_law.kind != "consistent", "this local law"),
        (("run", "impacts"), run.impacts > 1, "several impacts"),
        (("run", "run_in"), run.run_in, "running in"),
        (("run", "transfer"), run.transfer, "transfer functions"),
        (("reduction", "correction"), case.reduction.correction != "consistent", "this correction"),
        (("reduction", "shifts"), case.reduction.shifts, "shifts"),
    ]
    for key, is_there, what in asked:
        refuse_key_if(
            is_there,
            key,
            got=f"{what}, and a body behind the struck body",
            expected="one impact along the axis at 'levels: [reduced]', of smooth faces as "
            "drawn and with consistent laws",
            hint="write 'run: {levels: [reduced]}'."
            if what == "other levels"
            else f"remove '{key[-1]}', or 'backing' and the third body; klack stroke also "
            "supports three bodies (how-to/seat-insert).",
            on_key=True,
        )


def _check_roughness(case: ImpactSections) -> None:
    """Reject what excludes a layer of asperities."""
    contact = case.contact
    if contact.roughness is None:
        return
    drawn = case.shots is not None and case.shots.contact_friction is not None
    others: list[tuple[Key, bool, str]] = [
        (("contact", "friction"), not contact.faces.is_none, "friction between rough faces"),
        (("shots", "contact_friction"), drawn, "drawn friction between rough faces"),
        (("contact", "local_law"), contact.local_law.kind != "consistent", "a given local law"),
        (("opposite",), case.opposite is not None, "an upper stop"),
    ]
    for key, is_there, what in others:
        refuse_key_if(
            is_there,
            ("contact", "roughness"),
            got=f"rough faces and {what} ({'.'.join(map(str, key))})",
            expected="only one of them: no level combines a layer of asperities with that",
            hint="remove one of them; contact.crown can be combined with everything.",
            on_key=True,
        )


def _check_solid_only(case: ImpactSections) -> None:
    """Reject what breaks axisymmetry."""
    if case.dimension == 3:
        return
    waves = case.contact.waviness
    straight = waves is not None and waves.direction is not None
    asked: list[tuple[Key, object, str]] = [
        (("guide",), case.guide is not None, "a guide"),
        (("shots",), case.shots is not None, "shots, whose placements vary,"),
        (("contact", "tilt"), case.contact.tilt, "a tilt between the faces"),
        (("contact", "waviness", "direction"), straight, "straight waves on the faces"),
    ]
    for key, is_there, what in asked:
        refuse_key_if(
            is_there,
            key,
            got=f"{what} of axisymmetric bodies",
            expected="three-dimensional bodies",
            hint="take 'model: swept' with 'layers: 18' for both of them.",
            on_key=True,
        )


def _check_off_axis(case: ImpactSections) -> None:
    """Reject what axisymmetric bodies cannot have off-axis."""
    refuse_key_if(
        case.contact.angles is not None and case.dimension == 3,
        ("contact", "angles"),
        got="angles of bodies of three dimensions",
        expected="axisymmetric bodies: the mesh of a solid has its own points around the ring",
        hint="remove 'angles'; more 'layers' refine a swept mesh around the ring.",
        on_key=True,
    )
    if not case.leaves_axis:
        return
    asked: list[tuple[Key, bool, str]] = [
        (("contact", "roughness"), case.contact.roughness is not None, "rough faces"),
        (("outputs",), bool(case.outputs), "sensors, whose angle is not known,"),
    ]
    for key, is_there, what in asked:
        refuse_key_if(
            is_there,
            key,
            got=f"{what} of axisymmetric bodies off-axis (motion)",
            expected="faces without roughness, and no sensors",
            hint=f"remove '{key[-1]}', or take 'model: swept' with 'layers: 18' for both.",
            on_key=True,
        )


def _check_oblique(case: ImpactSections) -> None:
    """Reject what knows no motion across the axis."""
    motion = case.motion
    if motion.is_straight:
        return
    key = "sideways_speed" if motion.sideways_speed else "spin"
    several = case.run.run_in or case.run.impacts > 1
    asked: list[tuple[str, object, str]] = [
        ("shots", case.shots is not None, "shots"),
        ("noise", case.noise is not None, "noise"),
        ("run_in", several, "impacts one after another"),
    ]
    for name, is_there, what in asked:
        refuse_key_if(
            is_there,
            ("motion", key),
            got=f"a motion sideways or a spin, and {what}",
            expected="only one of them: those start along the axis",
            hint=f"remove '{key}', or '{name}'.",
            on_key=True,
        )


def _check_ends(case: ImpactSections) -> None:
    """Non-reflecting ends: of the body that is hit, off its contact and supports, of one bar."""
    for name, body in case.bodies.items():
        if body.non_reflecting is None:
            continue
        key: Key = ("bodies", name, "non_reflecting")
        stop = case.contact.stop
        refuse_key_if(
            case.shots is not None or case.opposite is not None,
            key,
            got="a non-reflecting end together with 'shots' or 'opposite'",
            expected="neither: both belong to the interface level",
            hint="remove non_reflecting.",
            on_key=True,
        )
        refuse_key_if(
            name != stop.body or not body.has_surfaces or not isinstance(body.material, str),
            key,
            got=f"a non-reflecting end of '{name}'",
            expected=f"an end of '{stop.body}', the body that is hit, meshed and of one material",
            hint="it would brake the moving body from the start.",
            on_key=True,
        )
        check_surface(case, key, SurfaceName(body=name, surface=body.non_reflecting))
        held = [support.surface for support in body.fixed or ()]
        refuse_key_if(
            body.non_reflecting in (stop.surface, *held),
            key,
            got=f"'{body.non_reflecting}', a surface that is hit or held",
            expected="another surface: the far end of a bar",
            hint="waves leave where the body is not held.",
        )
        others = [level for level in case.run.levels if level != "full"]
        if others:
            raise CaseProblem(
                ("run", "levels"),
                got=f"the level '{others[0]}' with a non-reflecting end of '{name}'",
                expected="only the level full: a body without an end has no modes",
                hint="levels: [full].",
            )


def _check_outputs(case: ImpactSections) -> None:
    for i, output in enumerate(case.outputs):
        require_known(("outputs", i, "body"), output.body, case.bodies, "body")
    given = [name for name, body in case.bodies.items() if not body.has_surfaces]
    others = [f"bodies.{name}" for name in given]
    others += [key for key in ("guide", "opposite", "shots") if getattr(case, key) is not None]
    dimensions = {name: body.geometry.dimension for name, body in case.bodies.items()}
    check_outputs(case.outputs, dimensions, next(iter(others), ""))


def _check_nodes(case: ImpactSections) -> None:
    """Nodes that klack reduce reads belong to the two bodies that meet."""
    for name, place in (case.run.transfer.nodes if case.run.transfer else {}).items():
        key: Key = ("run", "transfer", "nodes", name)
        between = [surface.body for surface in case.contact.between]
        require_known(key, name, between, "body", on_key=True)
        axes = ("r", "z") if case.bodies[name].geometry.dimension == 2 else ("x", "y", "z")
        refuse_key_if(
            len(place) != len(axes),
            key,
            got=f"{len(place)} coordinates",
            expected=f"[{', '.join(axes)}] of '{name}'",
            hint="give coordinates as in the drawing.",
        )


def _check_guide(case: ImpactSections) -> None:
    guide = case.guide
    profile = case.moving_body.geometry.profile
    if guide is None or profile is None:
        return  # the names of other geometries are inside their files
    known = profile.surfaces
    require_known(
        ("guide", "surface"), guide.surface, known, f"surface of {case.contact.moving.body}"
    )
    curves = [c for p in profile.profiles().values() for c in p.curves if c.name == guide.surface]
    ends = [z for curve in curves for z in curve.at(np.linspace(0.0, 1.0, 65))[:, 1]]
    low, high = min(ends), max(ends)
    for i, height in enumerate(guide.heights):
        refuse_key_if(
            not low <= height <= high,
            ("guide", "heights", i),
            got=f"a height of {format_si(height, 'm')}",
            expected=f"a height on '{guide.surface}': {format_si(low, 'm')} to "
            f"{format_si(high, 'm')}",
            hint="heights are z coordinates in the drawing of the moving body.",
        )


def _check_shots(case: ImpactSections) -> None:
    shots = case.shots
    if shots is None:
        return
    refuse_key_if(
        case.guide is None and shots.friction is not None,
        ("shots", "friction"),
        got="friction without a guide",
        expected="a section 'guide' for the moving body",
        hint="add 'guide', or remove 'friction'.",
        on_key=True,
    )
    if case.guide is not None:
        check_drawn_place(shots.eccentricity, shots.tilt)
    _check_drawn_friction(case)
    drawn = ("eccentricity", "tilt", "force", "contact_friction", "waviness")
    refuse_key_if(
        case.guide is None and all(getattr(shots, name) is None for name in drawn),
        ("shots",),
        got="identical shots",
        expected=f"a section 'guide', or at least one of: {one_of(drawn)}",
        hint="'guide' draws placements within its clearance.",
        on_key=True,
    )


def check_drawn_place(eccentricity: object, tilt: object) -> None:
    """In a guide both are drawn, or none."""
    given, other = "tilt", "eccentricity"
    if tilt is None:
        given, other = other, given
    refuse_key_if(
        (eccentricity is None) != (tilt is None),
        ("shots", given),
        got=f"{given} without {other}, and a guide",
        expected="both or neither: without them the guide limits the placement",
        hint=f"add '{other}' (0 is possible), or remove '{given}'.",
        on_key=True,
    )


def _check_drawn_friction(case: ImpactSections) -> None:
    """The static coefficient must be able to follow the drawn kinetic one."""
    faces = case.contact.faces
    drawn = case.shots.contact_friction if case.shots is not None else None
    if drawn is None or faces.is_constant:
        return
    refuse_key_if(
        faces.kinetic == 0.0,
        ("shots", "contact_friction"),
        got=f"drawn friction with contact.static_friction {faces.static:g} and contact.friction 0",
        expected="contact.friction above 0: the static coefficient keeps its ratio to it",
        hint="give contact.friction, or remove contact.static_friction.",
        on_key=True,
    )
    ratio = faces.static / faces.kinetic
    refuse_key_if(
        ratio * drawn.largest > MOST_FRICTION,
        ("shots", "contact_friction"),
        got=f"static coefficients up to {ratio * drawn.largest:.3g}, {ratio:.3g} times the "
        "drawn one as in 'contact'",
        expected=f"at most {MOST_FRICTION:g} in every shot",
        hint="draw smaller coefficients, or remove contact.static_friction.",
        on_key=True,
    )


def _moving(case: ImpactSections | ValveSections) -> str:
    """Body that may lack a support: the one that hits, or the needle."""
    if isinstance(case, ImpactSections):
        return case.contact.moving.body
    return str(getattr(case.network.components[find_roles(case).needle], "body", ""))


def check_noise(case: ImpactSections | ValveSections) -> None:
    """Reject names in the noise section that the case does not have."""
    noise = case.noise
    if noise is None:
        return
    held = [name for name, body in case.bodies.items() if body.fixed]
    for i, surface in enumerate(noise.surfaces or ()):
        key: Key = ("noise", "surfaces", i)
        check_surface(case, key, surface)
        if surface.body in held:
            continue
        refuse_key_if(
            surface.body == _moving(case),
            key,
            got=f"'{surface}', but '{surface.body}' is not held",
            expected=f"surfaces of held bodies ({one_of(held)})",
            hint="a free body, such as a needle, radiates into the fluid.",
        )
        raise CaseProblem(
            ("bodies", surface.body),
            got=f"no key 'fixed', although '{surface}' radiates sound (noise.surfaces)",
            expected=f"fixed: the surfaces that hold '{surface.body}'",
            hint="add 'fixed: [{surface: NAME}]' to the body, or remove its surfaces from 'noise'.",
        )
    _check_mounts(case, noise)
    _check_machine(case, noise)
    if noise.plate is not None:
        key = ("noise", "plate", "material")
        require_known(key, noise.plate.material, case.materials, "material")


def _check_mounts(case: ImpactSections | ValveSections, noise: CaseNoise) -> None:
    """Mounts are the supports of held bodies, all of them; reactions act on held bodies."""
    taken: dict[SurfaceName, str] = {}
    for key, place in mounting_places(noise):
        check_surface(case, key, place)
        supports = [support.surface for support in case.bodies[place.body].fixed or ()]
        held = [f"{place.body}.{surface}" for surface in supports]
        on_mount = key[1] == "mounts"
        refuse_key_if(
            (on_mount and place.surface not in supports) or not supports,
            key,
            got=f"'{place}', which is not held",
            expected=f"a held surface: {one_of(held)}" if held else "a held body",
            hint=f"add it to bodies.{place.body}.fixed, or name another surface.",
        )
        if on_mount and place in taken:
            raise CaseProblem(
                key,
                got=f"'{place}', which belongs to mount '{taken[place]}' already",
                expected="each held surface in one mount",
                hint="remove it from one of the two.",
            )
        if on_mount:
            taken[place] = str(key[2])
    for body in {place.body for place in taken}:
        for support in case.bodies[body].fixed or ():
            refuse_key_if(
                SurfaceName(body, support.surface) not in taken,
                ("noise", "mounts"),
                got=f"no mount at '{body}.{support.surface}', which is held",
                expected=f"all held surfaces of '{body}'",
                hint="add a mount, or list the surface together with those that it moves with.",
            )
    components = case.network.components if isinstance(case, ValveSections) else {}
    for name in noise.reactions or {}:
        key = ("noise", "reactions", name)
        require_known(key, name, [*components, "fluid"], "component of the network")
    for name in noise.passages or {}:
        key = ("noise", "passages", name)
        require_known(key, name, components, "component of the network")
    for word in ("reactions", "passages"):
        refuse_key_if(
            getattr(noise, word) and not noise.mounts,
            ("noise", word),
            got=f"{word} without mounts",
            expected="noise.mounts",
            hint=f"add a mount, or remove the {word}.",
            on_key=True,
        )


def _check_machine(case: ImpactSections | ValveSections, noise: CaseNoise) -> None:
    """A machine stands below mounts, and there is one only."""
    without = {
        "elements": (noise.elements, "mounts", noise.mounts),
        "receiver": (noise.receiver, "mounts", noise.mounts),
        "ears": (noise.ears, "receiver", noise.receiver),
        "indicators": (noise.indicators, "receiver", noise.receiver),
    }
    for name, (given, needed, there) in without.items():
        refuse_key_if(
            given and not there,
            ("noise", name),
            got=f"{name} without {needed}",
            expected=f"noise.{needed}",
            hint=f"add '{needed}', or remove '{name}'.",
            on_key=True,
        )
    for key, mount in machine_mounts(noise.elements or {}, noise.receiver):
        require_known(key, mount, noise.mounts or {}, "mount", on_key=True)
    receiver = noise.receiver
    if receiver is None:
        return
    for name in ("mount", "plate"):
        refuse_key_if(
            getattr(noise, name) is not None,
            ("noise", name),
            got=f"{name} together with a receiver",
            expected="only one machine below the valve",
            hint=f"remove '{name}'; describe a spring below a mount in 'elements'.",
            on_key=True,
        )
    if receiver.is_plate is not None:
        kind = "plate" if receiver.plate is not None else "infinite_plate"
        key = ("noise", "receiver", kind, "material")
        require_known(key, receiver.is_plate.material, case.materials, "material")
    body = receiver.body
    refuse_key_if(
        body is not None and body.inertia is None and len(noise.mounts or {}) > 1,
        ("noise", "receiver", "body"),
        got="no inertia for a body below several mounts",
        expected="inertia: three moments about its centre of mass",
        hint="add 'inertia: [Ixx, Iyy, Izz]' in kg m^2.",
    )
    for name, place in (noise.indicators or {}).items():
        refuse_key_if(
            isinstance(place, tuple) == (receiver.file is not None) or name in (noise.mounts or {}),
            ("noise", "indicators", name),
            got="a place" if isinstance(place, tuple) else f"the node '{place}'",
            expected="a node of the file, in addition to the mounts"
            if receiver.file is not None
            else "the position [x, y, z] of a sensor from the first mount, in addition to "
            "the mounts",
            hint="give it a name other than that of a mount; for a model write [10 mm, 0 mm, "
            "0 mm].",
        )
    measured = receiver.file is not None or receiver.pressures is not None
    for ear, place in (noise.ears or {}).items():
        refuse_key_if(
            isinstance(place, tuple) == measured or (receiver.is_plate is None and not measured),
            ("noise", "ears", ear),
            got="a place" if isinstance(place, tuple) else f"the node '{place}'",
            expected="a node with a pressure in the file"
            if measured
            else "the position [x, y, z] of an ear above a plate, or a file of pressures",
            hint="write the node of the microphone."
            if measured
            else "write [0 m, 0 m, 1 m] for 1 m on the normal of a plate, or add "
            "receiver.pressures.",
        )
