"""Form and roughness of the faces of a case on its meshes."""

from math import nan

import numpy as np
from numpy.typing import NDArray

from klack.case.schema import Case
from klack.contact.asperity_layer import AsperityLayer
from klack.contact.face_form import STEEPEST, FaceForm
from klack.contact.pairing import face_thickness
from klack.errors import InputError
from klack.mesh.mesh import Mesh, Surface, solid_at
from klack.units import format_si

__all__ = ["form_of_faces", "layer_of_faces"]

_PER_WAVE = 4.0
"""Elements that a wave needs: eight contact points."""


def form_of_faces(
    case: Case, upper: Mesh, surface: Surface, lower: Mesh, other: Surface
) -> FaceForm | None:
    """Form of both faces, centred on the smaller one, if any.

    Rejects a crown that is deep against its face, and waves that the elements do not resolve.  The
    upper mesh is where it starts but for its height.
    """
    contact = case.contact
    if not contact.has_form:
        return None
    centre, radius = min(
        (_extent(mesh.points[face.nodes]) for mesh, face in ((upper, surface), (lower, other))),
        key=lambda extent: extent[1],
    )
    _check_crown(case, radius)
    _check_waves(case, ((upper, surface), (lower, other)))
    waves = contact.waviness
    return FaceForm(
        centre=centre,
        radius=radius,
        crown=contact.crown,
        waves=None if waves is None else waves.waves,
        tilt=contact.tilt,
        tilt_direction=contact.tilt_direction,
    )


def layer_of_faces(
    case: Case, upper: Mesh, surface: Surface, lower: Mesh, other: Surface
) -> AsperityLayer | None:
    """Layer of asperities between both faces, if any; rejects summits on a body of matrices."""
    rough = case.contact.roughness
    if rough is None:
        return None
    if rough.curve is not None:
        closure, pressure = np.array(rough.curve).T
        if closure[0] > 0.0:
            closure, pressure = np.append(0.0, closure), np.append(0.0, pressure)
        return AsperityLayer(closure=closure, pressure=pressure)
    assert rough.rms is not None
    assert rough.asperity_radius is not None
    inverse = 0.0
    moving, stop = case.contact.between
    for name, mesh, face in ((moving.body, upper, surface), (stop.body, lower, other)):
        if case.bodies[name].material is None:
            raise InputError(
                f"{case.path or 'case'}: contact.roughness",
                got=f"summits on '{name}', whose material is only in matrices",
                expected="a material, or a measured curve",
                hint="give 'curve': pairs of closure and pressure.",
            )
        material = case.materials_of(name, mesh.solids)[solid_at(mesh, face)]
        inverse += 1.0 / material.plane_strain_modulus
    return AsperityLayer.of_summits(
        rms=rough.rms,
        radius=rough.asperity_radius,
        density=rough.density,
        modulus=1.0 / inverse,
    )


def _extent(points: NDArray[np.float64]) -> tuple[tuple[float, float], float]:
    """Middle of a face (x, y), distance of its outermost point [m]."""
    if points.shape[1] == 2:
        return (0.0, 0.0), float(points[:, 0].max())
    middle = (points[:, :2].min(axis=0) + points[:, :2].max(axis=0)) / 2.0
    radius = float(np.linalg.norm(points[:, :2] - middle, axis=1).max())
    return (float(middle[0]), float(middle[1])), radius


def _check_crown(case: Case, radius: float) -> None:
    most = STEEPEST * radius / 2.0
    if case.contact.crown > most:
        raise InputError(
            f"{case.path or 'case'}: contact.crown",
            got=f"{format_si(case.contact.crown, 'm')} on a face of radius "
            f"{format_si(radius, 'm')}",
            expected=f"at most {format_si(most, 'm', 3)}, a slope of {STEEPEST:g} at its edge",
            hint="ground faces have 0.2 to 5 um; draw a deeper crown as an arc of the geometry.",
        )


def _check_waves(case: Case, sides: tuple[tuple[Mesh, Surface], ...]) -> None:
    waves = case.contact.waviness
    if waves is None:
        return
    size = min((float(np.median(face_thickness(*side))) for side in sides), default=nan)
    if waves.wavelength < _PER_WAVE * size:
        raise InputError(
            f"{case.path or 'case'}: contact.waviness.wavelength",
            got=f"{format_si(waves.wavelength, 'm')} on elements of {format_si(size, 'm', 3)}",
            expected=f"at least {_PER_WAVE:g} elements per wave: "
            f"{format_si(_PER_WAVE * size, 'm', 3)} here",
            hint="give the two surfaces smaller elements (mesh.surfaces), or leave out the waves.",
        )
