"""What made the numbers of a study, in words: the same lines for every kind of study."""

from collections.abc import Iterable, Mapping

from klack.analyses.noise.record import NoiseStudy
from klack.analyses.record import CaseRecord
from klack.assembling.body_summary import BodySummary

__all__ = ["about_study"]


def about_study(
    study: CaseRecord | NoiseStudy, own: Mapping[str, str], bodies: Iterable[BodySummary] = ()
) -> dict[str, str]:
    """Case, versions, date and meshes, with the study's own lines between them.

    Parameters
    ----------
    study : CaseRecord or NoiseStudy
    own : mapping of str to str
        Lines of this kind of study.
    bodies : iterable of BodySummary
        Whose meshes are named.
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
    for body in bodies:
        about[f"mesh of {body.name}"] = (
            f"{body.model}, {body.nodes} nodes, {body.elements} elements, {body.dofs} degrees of "
            f"freedom, {body.mass!r} kg, {body.support}"
        )
    if study.warnings:
        about["warnings"] = " ".join(study.warnings)
    return about
