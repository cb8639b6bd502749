"""Origin of the numbers of a study, as text: the same lines for every kind of study."""

from collections.abc import Mapping

from klack.analyses.impact.record import ImpactStudy
from klack.analyses.stroke.record import StrokeStudy

__all__ = ["about_study"]


def about_study(study: ImpactStudy | StrokeStudy, own: Mapping[str, str]) -> dict[str, str]:
    """Case, versions, date and meshes, with the study's own lines between them.

    Parameters
    ----------
    study : ImpactStudy or StrokeStudy
    own : mapping of str to str
        Lines of this kind of study.
    """
    about = {
        "case": study.case,
        "title": study.title,
        "description": study.description,
        "klack": study.version,
        "created": study.created,
        "libraries": ", ".join(f"{name} {number}" for name, number in study.versions.items()),
        **own,
    }
    for body in study.bodies:
        about[f"mesh of {body.name}"] = (
            f"{body.model}, {body.nodes} nodes, {body.elements} elements, {body.dofs} degrees of "
            f"freedom, {body.mass!r} kg, {body.support}"
        )
    if study.warnings:
        about["warnings"] = " ".join(study.warnings)
    return about
