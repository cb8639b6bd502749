"""The impact of a case as CalculiX shall compute it."""

import warnings

from klack.assembling.bodies import build_bodies
from klack.assembling.yielding import tell_elastic
from klack.case.schema import Case
from klack.contact.friction import Friction
from klack.errors import AccuracyWarning, refuse_if
from klack.exchange.calculix_deck import CalculixImpact, CalculixSettings, default_penalty
from klack.machine.progress import Progress
from klack.units import format_si

__all__ = ["calculix_impact", "calculix_settings"]


def calculix_impact(case: Case, progress: Progress) -> CalculixImpact:
    """Mesh and place the bodies of a case, with the forces of the full order; solids only.

    A closing spring pushes with its preload.

    Warns
    -----
    AccuracyWarning
        Of a guide, an upper stop, friction (another law), materials that yield and worn faces.
    """
    refuse_if(
        case.dimension != 3,
        f"{case.path or 'case'}: bodies",
        got="axisymmetric bodies",
        expected="solids: CalculiX would turn axisymmetric elements into wedges of "
        "one layer, with a different contact problem",
        hint="use 'model: swept' (with layers) or 'model: solid' in both geometries.",
    )
    case.require_ends("a deck")
    case.require_pair("a deck")
    case.require_straight("a deck")
    forms = ("crown", "waviness", "tilt", "roughness")
    form = next((key for key in forms if getattr(case.contact, key)), None)
    refuse_if(
        form is not None,
        f"{case.path or 'case'}: contact.{form}",
        got="a form or roughness of the faces, which the meshes do not contain",
        expected="faces as drawn: a deck contains only the meshes",
        hint="draw the crown as an arc or the tilt as a placement, and remove the key.",
    )
    layered = next((name for name, body in case.bodies.items() if body.layers), None)
    refuse_if(
        layered is not None,
        f"{case.path or 'case'}: bodies.{layered}.layers",
        got="a layer between two parts, which the meshes do not contain",
        expected="glued parts: a deck contains only the meshes",
        hint="draw the layer as a thin part with a material of its own, and remove the key.",
    )
    left_out = [name for name in ("guide", "opposite") if getattr(case, name) is not None]
    if left_out:
        warnings.warn(
            f"left out of the deck, as in the full order: {', '.join(left_out)}. Try: compare with "
            "the level 'full'.",
            AccuracyWarning,
            stacklevel=2,
        )
    if said := _other_friction(case.contact.faces):
        warnings.warn(said, AccuracyWarning, stacklevel=2)
    tell_elastic(case, "the deck is one of")
    if case.contact.worn is not None:
        warnings.warn(
            "left out of the deck: contact.worn; the faces in the deck are unworn. Try: compare "
            "with the case without 'worn'.",
            AccuracyWarning,
            stacklevel=2,
        )
    pair = build_bodies(case, progress)
    return CalculixImpact(
        title=case.title,
        upper=pair.upper,
        lower=pair.lower,
        upper_surface=pair.upper_surface,
        lower_surface=pair.lower_surface,
        materials={
            body.name: case.materials_of(body.name, body.mesh.solids)
            for body in (pair.upper, pair.lower)
        },
        speed=case.motion.speed,
        closing_force=case.motion.closing_force,
        friction=case.contact.faces.kinetic,
    )


def _other_friction(faces: Friction) -> str:
    """What CalculiX's friction lacks of that of the case, or empty."""
    if faces.is_none:
        return ""
    left_out = ""
    if not faces.is_constant:
        left_out = f"; left out: contact.static_friction {faces.static:g}"
        if faces.speed:
            left_out += f", stribeck_speed {format_si(faces.speed, 'm/s')}"
    if not faces.kinetic:
        return f"the deck has no friction because contact.friction is 0{left_out}."
    return (
        f"contact.friction {faces.kinetic:g} is regularised in the deck: sticking faces yield "
        f"like a spring (stick slope), and one coefficient holds at every slip speed{left_out}."
    )


def calculix_settings(
    case: Case,
    impact: CalculixImpact,
    *,
    step: float | None = None,
    duration: float | None = None,
    penalty: float | None = None,
) -> CalculixSettings:
    """Settings of a run.

    Parameters
    ----------
    step [s]
        Default: of the full order.
    duration [s]
        Default: of the case.
    penalty [Pa/m]
    """
    return CalculixSettings(
        step=case.run.full_step if step is None else step,
        duration=case.run.duration if duration is None else duration,
        penalty=default_penalty(impact) if penalty is None else penalty,
    )
