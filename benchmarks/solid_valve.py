"""Shipped solid cases on meshes of any size: what the parts with degrees of freedom time."""

from klack.case import find_case, load_case
from klack.case.schema import Case

__all__ = ["coarse_witness", "resized", "solid_valve"]


def solid_valve(scale: float, layers: int, *, contact: float = 1.0) -> Case:
    """The solid demo valve with elements of ``scale`` times their size in ``layers`` sectors.

    Those at the contact have ``contact`` times their size in the meridian plane.  Scales of 1 and
    18 layers are the shipped case (87 132 degrees of freedom); 0.55 and 28 have 153 351.
    """
    case = load_case(find_case("demo-valve"))
    bodies = {}
    for name, body in case.bodies.items():
        geometry = body.geometry.model_copy(update={"layers": layers})
        bodies[name] = body.model_copy(update={"geometry": geometry})
    return resized(case.model_copy(update={"bodies": bodies}), scale, contact)


def coarse_witness() -> Case:
    """The witness with elements of about twice their size."""
    return resized(load_case(find_case("witness")), 1.5, 2.0)


def resized(case: Case, scale: float, contact: float) -> Case:
    """The same case with other elements far from the contact, and at it."""
    bodies = {}
    for name, body in case.bodies.items():
        mesh = body.mesh
        if mesh is not None:
            fine = mesh.contact and mesh.contact.model_copy(
                update={"size": mesh.contact.size * contact}
            )
            mesh = mesh.model_copy(update={"size": mesh.size * scale, "contact": fine})
        bodies[name] = body.model_copy(update={"mesh": mesh})
    return case.model_copy(update={"bodies": bodies})
