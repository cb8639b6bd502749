"""Regions of meshes, and the axisymmetric twin of swept bodies."""

from collections.abc import Mapping, Sequence
from math import isnan, nan

from klack.analyses.advice.settings import Setting, SettingValue
from klack.case.bodies import CaseBody, ModeChoice, SurfaceName
from klack.case.guide import Placement
from klack.case.schema import Case
from klack.contact.statics import COARSE

__all__ = [
    "axisymmetric_twin",
    "coarse_contact_notes",
    "layer_setting",
    "mesh_settings",
    "unmeshed",
    "unmeshed_notes",
]


def mesh_settings(
    bodies: Mapping[str, CaseBody], surfaces: tuple[SurfaceName, ...]
) -> tuple[Setting, ...]:
    """Contact region of all bodies together, the growth away from it, then the rest of each body.

    The contact region is ``mesh.contact`` and the sizes of the touching ``surfaces``; the growth is
    the grading of all bodies; the rest of a body are its other sizes.
    """
    contact: list[SettingValue] = []
    names: list[str] = []
    growth: list[SettingValue] = []
    rest: list[Setting] = []
    for name, body in bodies.items():
        mesh = body.mesh
        if mesh is None:
            continue
        key = ("bodies", name, "mesh")
        before = len(contact)
        if mesh.contact is not None:
            place = (*key, "contact", "size")
            contact.append(SettingValue(key=place, value=mesh.contact.size, unit="m"))
        values = [SettingValue(key=(*key, "size"), value=mesh.size, unit="m")]
        for surface, size in mesh.surfaces.items():
            touching = SurfaceName(name, surface) in surfaces
            value = SettingValue(key=(*key, "surfaces", surface), value=size, unit="m")
            (contact if touching else values).append(value)
        if len(contact) > before:
            names.append(name)
            growth.append(SettingValue(key=(*key, "grading"), value=mesh.grading, most=1.0))
        away = ", away from the contact" if len(contact) > before else ""
        rest.append(Setting(name=f"{name}{away}", group="mesh", values=tuple(values)))
    if contact:
        both = " and ".join(names)
        region = Setting(name=f"contact of {both}", group="mesh", values=tuple(contact))
        growing = Setting(name=f"growth in {both}", group="mesh", values=tuple(growth))
        return (region, growing, *rest)
    return tuple(rest)


def layer_setting(bodies: Mapping[str, CaseBody]) -> Setting | None:
    """Layers round the circle, of all swept bodies together."""
    values = tuple(
        SettingValue(
            key=("bodies", name, "geometry", "layers"),
            value=float(body.geometry.layers),
            kind="count",
            least=6.0,
        )
        for name, body in bodies.items()
        if body.geometry.layers is not None
    )
    return (
        Setting(name="layers of the swept bodies", group="layers", values=values)
        if values
        else None
    )


def axisymmetric_twin(case: Case, highest: Mapping[str, float]) -> Case | None:
    """The same half sections as axisymmetric bodies; None where a body has no swept profile.

    Refining them changes as much at a hundredth of the cost. Supports in sectors become supports
    all round, the impact is centred, and the modes go as high up as those of the case, ``highest``
    [Hz] by body.
    """
    names = (case.contact.moving.body, case.contact.stop.body)
    bodies = {}
    for name in names:
        body = case.bodies[name]
        if body.geometry.model != "swept":
            return None
        geometry = body.geometry.model_copy(update={"model": "axisymmetric", "layers": None})
        fixed = body.fixed and tuple(
            support.model_copy(update={"sectors": None}) for support in body.fixed
        )
        bodies[name] = body.model_copy(update={"geometry": geometry, "fixed": fixed})
    modes = {name: ModeChoice(frequency=highest[name]) for name in names}
    return case.model_copy(
        update={
            "bodies": bodies,
            "motion": case.motion.model_copy(update={"placement": Placement()}),
            "guide": None,
            "opposite": None,
            "reduction": case.reduction.model_copy(update={"modes": modes}),
        }
    )


def unmeshed(bodies: Mapping[str, CaseBody]) -> tuple[str, ...]:
    """Bodies that klack did not mesh and cannot refine."""
    return tuple(name for name, body in bodies.items() if body.mesh is None)


def unmeshed_notes(bodies: Mapping[str, CaseBody], size_ratio: float = nan) -> list[str]:
    """Why the meshes of some bodies have no advice, and what to do instead.

    ``size_ratio`` [-] is the element size across the contact over its half width; nan if unknown.
    """
    names = unmeshed(bodies)
    reduced = [name for name in names if bodies[name].reduced is not None]
    matrices = [
        name for name in names if name not in reduced and bodies[name].geometry.nodes is not None
    ]
    meshes = [name for name in names if name not in (*reduced, *matrices)]
    notes = []
    if meshes:
        notes.append(
            f"{_mesh_of(meshes)} given: klack cannot refine a finished mesh, so its error is not "
            "in the sums, and only modes and step are advised there. Try: export a second mesh "
            "of half the element size and compare both runs."
        )
        if not isnan(size_ratio):
            notes.append(
                f"Elements across the contact are {size_ratio:.2g} half widths long: "
                + ("fine enough." if size_ratio <= 1.0 else "too coarse, 1 or less is good.")
            )
    if matrices:
        notes.append(
            f"Nodes and matrices of {_names(matrices)} are given, and klack cannot refine them: "
            "their error is not in the sums. Try: export them from a second mesh of half the "
            "element size and compare both runs."
        )
    if reduced:
        notes.append(
            f"Reduced models ({_names(reduced)}): neither their meshes nor their omitted modes "
            "can be measured here. Try: obtain a second model, reduced from a finer mesh with "
            "more modes, and compare both runs."
        )
    return notes


def coarse_contact_notes(size_ratio: float) -> list[str]:
    """Comment on a coarse-mesh warning where finer elements change little.

    ``size_ratio`` as in :func:`unmeshed_notes`.
    """
    if not size_ratio > COARSE:
        return []
    return [
        f"Elements across the contact are {size_ratio:.2g} half widths long, and a run warns "
        f"above {COARSE:g}. That rule applies to pressures and the width of the contact; this "
        "advice applies to the numbers judged here, from runs with other elements."
    ]


def _mesh_of(names: Sequence[str]) -> str:
    return (
        f"The mesh of {_names(names)} is" if len(names) == 1 else f"Meshes of {_names(names)} are"
    )


def _names(names: Sequence[str]) -> str:
    return " and ".join(f"'{name}'" for name in names)
