"""Press fits of a case: pressure, stress, what they hold, and their doubts."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple, TypeVar

import numpy as np

from klack.assembling.generated_mesh import meshed_for_case, meshed_profiles, meshed_step
from klack.bodies.elasticity.body import elastic_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.press_fit import pressed_state
from klack.bodies.elasticity.stress import work_of_stress
from klack.case.bodies import CaseFile, Fit, joints_told_at
from klack.case.geometry import StepFile
from klack.case.placed_errors import tells_place
from klack.materials.material import Material
from klack.mesh.joint import Joint, cylinder_joint
from klack.mesh.mesh import Mesh
from klack.mesh.moments import Moments
from klack.mesh.profile import Profile
from klack.mesh.sizing import MeshSizing
from klack.mesh.solid_joint import solid_joint
from klack.mesh.step_content import step_content
from klack.units import format_si

__all__ = [
    "ELEMENTS",
    "Chosen",
    "Drawn",
    "FileShape",
    "PressFit",
    "Sizes",
    "joint_mesh",
    "joints_of",
    "press_fits",
    "stress_rows",
    "yield_doubts",
    "yield_stresses",
]

G = TypeVar("G")
S = TypeVar("S")

Drawn = tuple[tuple[str, Profile], ...]


class FileShape(NamedTuple):
    """A STEP file, what it has now, and its faces: area [m^2], radius of one that is a cylinder."""

    step: StepFile
    content: bytes
    faces: tuple[tuple[str, float, float], ...]


Chosen = tuple[tuple[str, Material], ...]
Sizes = tuple[float, float, tuple[tuple[str, float], ...]]
"""General element size [m], grading, and sizes of edges."""

ELEMENTS = 24
"""Along a joint of a half section."""
_MODES = 10
_LARGE = 1e-3  # interference over diameter: 0.5 to 1 per mille is a heavy fit
_STIFFENED = 1e-3  # shift of a frequency that is no longer small beside other errors


@dataclass(frozen=True, kw_only=True)
class PressFit:
    """One joint of a body with a press fit.

    Parameters
    ----------
    joint, inner, outer
        Names of the edge and of the parts.
    interference [m]
        On the diameter.
    pressure, least_pressure, largest_pressure [Pa]
        Mean over the joint; of all sides of elements; of those away from sharp corners.
    force [N]
        Integral of the pressure.
    stress, yield_stress [Pa]
        Of every part of the body: largest equivalent stress away from sharp corners, and where its
        material yields.
    stiffening [-]
        Largest relative shift of the first frequencies of the free body (of a drawn one, the
        axisymmetric) by the stress of all its fits; the impact leaves it out.
    """

    body: str
    joint: str
    inner: str
    outer: str
    radius: float
    length: float
    interference: float
    friction: float
    pressure: float
    least_pressure: float
    largest_pressure: float
    force: float
    stress: Mapping[str, float]
    yield_stress: Mapping[str, float]
    stiffening: float

    @property
    def axial_force(self) -> float:
        """Force along the axis that friction holds [N]."""
        return self.friction * self.force

    @property
    def torque(self) -> float:
        """Torque that friction holds [N m]."""
        return self.axial_force * self.radius

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why the fit may be other than computed."""
        where = f"press fit {self.body}.{self.joint}"
        found = []
        if self.interference > 2.0 * _LARGE * self.radius:
            found.append(
                f"{where}: an interference of {format_si(self.interference, 'm', 3)} is more "
                f"than a thousandth of the diameter, {format_si(2.0 * self.radius, 'm', 4)}. "
                "Try: check its unit; interference is measured on the diameter."
            )
        if self.least_pressure < -1e-9 * abs(self.largest_pressure):
            found.append(
                f"{where}: the joint opens: its pressure would be "
                f"{format_si(self.least_pressure, 'Pa', 3)} at one place. The numbers of this "
                "fit assume that the joint can pull. Try: a joint that ends there, or stiffer "
                "parts."
            )
        found += yield_doubts(where, self.stress, self.yield_stress, "the pressure", "interference")
        if self.stiffening > _STIFFENED:
            found.append(
                f"{where}: its stress shifts frequencies by up to {100 * self.stiffening:.2g} %, "
                "which the impact leaves out. Try: less interference."
            )
        return tuple(found)

    def rows(
        self, told: Callable[[float, str, int], str] = format_si
    ) -> tuple[tuple[str, str], ...]:
        """A row for each quantity; ``told`` writes value, unit and digits."""
        return (
            (
                "joint",
                f"{self.outer} on {self.inner}, diameter {told(2 * self.radius, 'm', 4)}, "
                f"length {told(self.length, 'm', 4)}",
            ),
            ("interference on the diameter", told(self.interference, "m", 3)),
            ("mean pressure", told(self.pressure, "Pa", 3)),
            (
                "least, largest pressure",
                f"{told(self.least_pressure, 'Pa', 3)}, {told(self.largest_pressure, 'Pa', 3)}",
            ),
            *stress_rows(self.stress, self.yield_stress, told),
            (
                f"holds, friction {self.friction:g}",
                f"{told(self.axial_force, 'N', 3)} along the axis or "
                f"{told(self.torque, 'N*m', 3)} around it",
            ),
            ("its stress shifts frequencies by up to", f"{100 * self.stiffening:.2g} %"),
        )


@tells_place
def press_fits(case: CaseFile, body: str) -> tuple[PressFit, ...]:
    """State of the press fits of a body, as drawn and free."""
    return joints_of(case, body, "fits", case.bodies[body].fits or {}, _computed)


def joints_of(
    case: CaseFile,
    body: str,
    key: str,
    given: Mapping[str, G],
    compute: Callable[[str, Any, Chosen, tuple[tuple[str, G], ...], Sizes], tuple[S, ...]],
) -> tuple[S, ...]:
    """States of joints of a body; an error of one gets its key in the case."""
    if not given:
        return ()
    drawn = case.bodies[body]
    assert drawn.mesh is not None
    shape: Drawn | FileShape
    if drawn.geometry.profile is not None:
        profiles = drawn.geometry.profile.profiles()
        shape, solids = tuple(profiles.items()), tuple(profiles)
    else:
        step = drawn.geometry.step
        assert step is not None
        content = step_content(step.file)
        faces = ((face.name, face.size, _radius(face.moments)) for face in content.faces)
        shape = FileShape(step, step.file.read_bytes(), tuple(faces))
        solids = tuple(solid.name for solid in content.solids)
    with joints_told_at("bodies", body, key):
        return compute(
            body,
            shape,
            tuple(case.materials_of(body, solids).items()),
            tuple(given.items()),
            (drawn.mesh.size, drawn.mesh.grading, tuple(drawn.mesh.surfaces.items())),
        )


def _radius(moments: Moments) -> float:
    """Of a cylinder, from the middle one of its second moments [m]: half its area times R^2."""
    return float(np.sqrt(2.0 * np.linalg.eigvalsh(moments.second)[1] / moments.volume))


def joint_mesh(
    body: str, shape: Drawn | FileShape, sizes: Sizes, finer: Mapping[str, float]
) -> Mesh:
    """Mesh whose edges or faces of these names have elements of this size [m] or smaller.

    Of drawn parts the half section.
    """
    size, grading, surfaces = sizes[0], sizes[1], dict(sizes[2])
    for edge, most in finer.items():
        surfaces[edge] = min(most, surfaces.get(edge, size))

    def mesher(sizing: MeshSizing) -> Mesh:
        if isinstance(shape, FileShape):
            return meshed_step(shape.step, sizing)
        return meshed_profiles(dict(shape), sizing, "axisymmetric", None)

    return meshed_for_case(body, MeshSizing(size=size, grading=grading, surfaces=surfaces), mesher)


def yield_stresses(materials: Mapping[str, Material]) -> dict[str, float]:
    """Where the materials that yield do [Pa]."""
    return {
        part: material.hardening.yield_stress
        for part, material in materials.items()
        if material.hardening is not None
    }


def yield_doubts(
    where: str, stress: Mapping[str, float], limits: Mapping[str, float], less: str, cause: str
) -> Iterator[str]:
    """Parts whose stress is above where they yield."""
    for part, limit in limits.items():
        if stress[part] > limit:
            yield (
                f"{where}: '{part}' yields: {format_si(stress[part], 'Pa', 3)} is above its yield "
                f"stress of {format_si(limit, 'Pa', 3)}, and {less} is less than "
                f"computed. Try: less {cause}, or a harder material."
            )


def stress_rows(
    stress: Mapping[str, float], limits: Mapping[str, float], told: Callable[[float, str, int], str]
) -> Iterator[tuple[str, str]]:
    """Largest stress of every part beside its yield stress."""
    for part, value in stress.items():
        limit = limits.get(part)
        beside = "" if limit is None else f", yield {told(limit, 'Pa', 3)}"
        yield f"largest stress of {part}", told(value, "Pa", 3) + beside


@lru_cache(maxsize=20)
def _computed(
    body: str,
    shape: Drawn | FileShape,
    chosen: Chosen,
    fits: tuple[tuple[str, Fit], ...],
    sizes: Sizes,
) -> tuple[PressFit, ...]:
    """Kept: a run asks once for the doubts, and once for the numbers."""
    materials = dict(chosen)
    joints, mesh = _meshed_joints(body, shape, [name for name, _ in fits], sizes)
    overlaps = [fit.interference / 2.0 for _, fit in fits]
    state = pressed_state(mesh, materials, joints, overlaps)
    modes = eigenmodes(elastic_body(body, mesh, materials), count=_MODES)
    shapes = modes.shapes.reshape(mesh.node_count, mesh.dimension, -1)[state.nodes]
    work = work_of_stress(
        state.mesh, materials, state.displacement, shapes.reshape(-1, shapes.shape[-1])
    )
    stiffening = float(np.abs(work / (2.0 * modes.omega**2)).max())
    return tuple(
        PressFit(
            body=body,
            joint=joint.name,
            inner=joint.inner,
            outer=joint.outer,
            radius=joint.radius,
            length=joint.length,
            interference=fit.interference,
            friction=fit.friction,
            pressure=found.force / found.area,
            least_pressure=float(found.pressure.min()),
            largest_pressure=float(found.pressure[found.away].max()),
            force=found.force,
            stress=state.stress,
            yield_stress=yield_stresses(materials),
            stiffening=stiffening,
        )
        for joint, (_, fit), found in zip(joints, fits, state.joints, strict=True)
    )


def _meshed_joints(
    body: str, shape: Drawn | FileShape, names: Sequence[str], sizes: Sizes
) -> tuple[list[Joint], Mesh]:
    """Joints of these names, and a mesh that is fine there."""
    if isinstance(shape, FileShape):
        finer = {
            name: _size_of_solid(area / (2.0 * np.pi * radius), radius)
            for name, area, radius in shape.faces
            if name in names
        }
        mesh = joint_mesh(body, shape, sizes, finer)
        return [solid_joint(mesh, name) for name in names], mesh
    joints = [cylinder_joint(dict(shape), name) for name in names]
    finer = {joint.name: joint.length / ELEMENTS for joint in joints}
    return joints, joint_mesh(body, shape, sizes, finer)


def _size_of_solid(length: float, radius: float) -> float:
    """Size [m] of elements of a solid: 8 along a joint, but 25 to 75 round it."""
    return max(min(length / 8.0, radius / 4.0), radius / 12.0)
