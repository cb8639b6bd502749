"""Press fits of a case: pressure, stress, what they hold, and their doubts."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import pi

import numpy as np

from klack.assembling.generated_mesh import meshed_for_case, meshed_profiles
from klack.bodies.elasticity.body import elastic_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.press_fit import pressed_state
from klack.bodies.elasticity.stress import work_of_stress
from klack.case.bodies import CaseFile, Fit
from klack.case.placed_errors import tells_place
from klack.errors import InputError
from klack.materials.material import Material
from klack.mesh.joint import cylinder_joint
from klack.mesh.profile import Profile
from klack.mesh.sizing import MeshSizing
from klack.units import format_si

__all__ = ["PressFit", "press_fits"]

_ELEMENTS = 24  # along a joint
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
        Largest relative shift of the first frequencies of the free body, axisymmetric, by the
        stress of all its fits; the impact leaves it out.
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
                f"{where}: an interference of {format_si(self.interference, 'm', 3)} is more than "
                f"a thousandth of the diameter, {format_si(2.0 * self.radius, 'm', 4)}. "
                "Try: check its unit; it is on the diameter."
            )
        if self.least_pressure < -1e-9 * abs(self.largest_pressure):
            found.append(
                f"{where}: the joint opens: its pressure would be "
                f"{format_si(self.least_pressure, 'Pa', 3)} at one place. The numbers of this fit "
                "are those of a joint that pulls. Try: a joint that ends there, or stiffer parts."
            )
        for part, limit in self.yield_stress.items():
            stress = self.stress[part]
            if stress > limit:
                found.append(
                    f"{where}: '{part}' yields: {format_si(stress, 'Pa', 3)} is above its yield "
                    f"stress of {format_si(limit, 'Pa', 3)}, and the pressure is less than "
                    "computed. Try: less interference, or a harder material."
                )
        if self.stiffening > _STIFFENED:
            found.append(
                f"{where}: its stress moves frequencies by up to {100 * self.stiffening:.2g} %, "
                "which the impact leaves out. Try: less interference."
            )
        return tuple(found)

    def rows(
        self, told: Callable[[float, str, int], str] = format_si
    ) -> tuple[tuple[str, str], ...]:
        """A row for each quantity; ``told`` writes value, unit and digits."""
        stresses = []
        for part, stress in self.stress.items():
            limit = self.yield_stress.get(part)
            beside = "" if limit is None else f", yield {told(limit, 'Pa', 3)}"
            stresses.append((f"largest stress of {part}", told(stress, "Pa", 3) + beside))
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
            *stresses,
            (
                f"holds, friction {self.friction:g}",
                f"{told(self.axial_force, 'N', 3)} along the axis or "
                f"{told(self.torque, 'N*m', 3)} around it",
            ),
            ("its stress moves frequencies by up to", f"{100 * self.stiffening:.2g} %"),
        )


@tells_place
def press_fits(case: CaseFile, body: str) -> tuple[PressFit, ...]:
    """State of the press fits of a body, as drawn and free."""
    given = case.bodies[body]
    if not given.fits:
        return ()
    assert given.geometry.profile is not None
    assert given.mesh is not None
    profiles = given.geometry.profile.profiles()
    try:
        return _computed(
            body,
            tuple(profiles.items()),
            tuple(case.materials_of(body, profiles).items()),
            tuple(given.fits.items()),
            (given.mesh.size, given.mesh.grading, tuple(given.mesh.surfaces.items())),
        )
    except InputError as error:
        if not error.where.startswith("fits"):
            raise
        raise InputError(
            f"bodies.{body}.{error.where}",
            got=error.got,
            expected=error.expected,
            hint=error.hint,
        ) from error


@lru_cache(maxsize=20)
def _computed(
    body: str,
    drawn: tuple[tuple[str, Profile], ...],
    chosen: tuple[tuple[str, Material], ...],
    fits: tuple[tuple[str, Fit], ...],
    sizes: tuple[float, float, tuple[tuple[str, float], ...]],
) -> tuple[PressFit, ...]:
    """Kept: a run asks once for the doubts, and once for the numbers."""
    profiles, materials = dict(drawn), dict(chosen)
    joints = [cylinder_joint(profiles, name) for name, _ in fits]
    size, grading, surfaces = sizes[0], sizes[1], dict(sizes[2])
    for joint in joints:
        surfaces[joint.name] = min(joint.length / _ELEMENTS, surfaces.get(joint.name, size))
    mesh = meshed_for_case(
        body,
        MeshSizing(size=size, grading=grading, surfaces=surfaces),
        lambda sizing: meshed_profiles(profiles, sizing, "axisymmetric", None),
    )
    overlaps = [fit.interference / 2.0 for _, fit in fits]
    state = pressed_state(mesh, materials, joints, overlaps)
    modes = eigenmodes(elastic_body(body, mesh, materials), count=_MODES)
    shapes = modes.shapes.reshape(mesh.node_count, 2, -1)[state.nodes]
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
            pressure=found.force / (2.0 * pi * joint.radius * joint.length),
            least_pressure=float(found.pressure.min()),
            largest_pressure=float(found.pressure[found.away].max()),
            force=found.force,
            stress=state.stress,
            yield_stress={
                part: material.hardening.yield_stress
                for part, material in materials.items()
                if material.hardening is not None
            },
            stiffening=stiffening,
        )
        for joint, (_, fit), found in zip(joints, fits, state.joints, strict=True)
    )
