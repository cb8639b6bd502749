"""Regions of a case's meshes, and the axisymmetric twin of bodies that are swept."""

from collections.abc import Mapping

from klack.advice.settings import Setting, SettingValue
from klack.case.bodies import CaseBody, ModeChoice, Reduction, SurfaceName
from klack.case.placement import Placement
from klack.case.schema import Case

__all__ = ["axisymmetric_twin", "layer_setting", "mesh_settings", "unmeshed_note"]


def mesh_settings(
    bodies: Mapping[str, CaseBody], surfaces: tuple[SurfaceName, ...]
) -> tuple[Setting, ...]:
    """Contact region of all bodies together, the growth away from it, then the rest of each body.

    The contact region holds ``mesh.contact`` and the sizes of the touching surfaces; the growth is
    the grading of all bodies; the rest of a body is its size and those of its other surfaces.

    Parameters
    ----------
    bodies : mapping of str to CaseBody
    surfaces : tuple of SurfaceName
        That touch.
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
    """Layers round the circle of all swept bodies together; None without any."""
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

    Their meshes are those that are swept, so what refining them changes is measured at a hundredth
    of the cost.  Supports in sectors become supports all round, the impact is centred, and the
    modes go as high up as those of the case.

    Parameters
    ----------
    case : Case
    highest : mapping of str to float [Hz]
        Highest kept mode of each body.
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
            "reduction": Reduction(correction=case.reduction.correction, modes=modes),
        }
    )


def unmeshed_note(name: str, body: CaseBody) -> str:
    """Why the mesh of a body has no advice, and what to do instead."""
    what = "its nodes and matrices are" if body.geometry.nodes is not None else "its mesh is"
    if body.reduced is not None:
        return (
            f"'{name}' is a reduced model: neither its mesh nor the modes that it left out can be "
            "measured here. Try: ask its source for a second one, reduced from a finer mesh with "
            "more modes, and compare both runs."
        )
    return (
        f"The mesh of '{name}' cannot be advised: {what} given, and klack cannot refine it, so its "
        "error is not in the sums. Try: export a second mesh of half the element size and compare "
        "both runs."
    )
