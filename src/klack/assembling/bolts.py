"""Bolted joints of a case: pressure, stiffness, what lifts them, and their doubts."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from math import sqrt

from klack.assembling.fits import (
    ELEMENTS,
    Chosen,
    Drawn,
    FileShape,
    Sizes,
    joint_mesh,
    joints_of,
    stress_rows,
    yield_doubts,
    yield_stresses,
)
from klack.case.bodies import Bolts, CaseFile
from klack.case.placed_errors import tells_place
from klack.contact.bolted_joint import clamped_state
from klack.mesh.joint import FlatJoint, flat_joint
from klack.mesh.mesh import Mesh
from klack.mesh.solid_joint import flat_solid_joint
from klack.units import format_si

__all__ = ["BoltedJoint", "bolted_joints", "opening_doubts", "struck_bolts"]

_ACROSS = 8  # elements along an end of a half section
_ON_FACE, _ON_END = 400.0, 100.0  # squares of an element's size on the joint of solids, on an end
_STRONGEST = 1.1e9  # [Pa] yield of class 12.9, ISO 898-1
_OPEN, _MOSTLY = 0.01, 0.5  # of the face
_LENGTHS = (0.5, 3.0)  # stretched length over the distance of the ends
_SUDDEN = 2.0  # most that a suddenly applied force causes over a static one


@dataclass(frozen=True, kw_only=True)
class BoltedJoint:
    """Two parts of a body under the preload of their bolts.

    Parameters
    ----------
    joint, lower, upper, ends
        Names of the edge, of the parts, and of the edges that the bolts press.
    count
        Of bolts; numbers are of all together unless stated.
    area [m^2], distance [m]
        Of the joint; of the two ends along the axis.
    preload [N], length [m]
    bolt_stress, bolt_yield [Pa]
        Under the preload; where the bolts yield.
    pressure, least_pressure, largest_pressure [Pa]
        Mean over the joint; of all nodes, 0 where it is open; of those away from sharp corners.
    open_share [-]
        Part of the face that does not touch.
    stress, yield_stress [Pa]
        As of :class:`klack.assembling.fits.PressFit`.
    bolt_stiffness, part_stiffness [N/m]
    peak [N]
        Largest contact force of an impact; None without one.
    """

    body: str
    joint: str
    lower: str
    upper: str
    ends: tuple[str, str]
    count: int
    area: float
    distance: float
    preload: float
    length: float
    bolt_stress: float
    bolt_yield: float | None
    pressure: float
    least_pressure: float
    largest_pressure: float
    open_share: float
    stress: Mapping[str, float]
    yield_stress: Mapping[str, float]
    bolt_stiffness: float
    part_stiffness: float
    peak: float | None = None

    @property
    def load_factor(self) -> float:
        """Part of a force between the two ends that the bolts take."""
        return self.bolt_stiffness / (self.bolt_stiffness + self.part_stiffness)

    @property
    def lifting_force(self) -> float:
        """Force between the two ends that lifts the joint [N]."""
        return self.preload / (1.0 - self.load_factor)

    @property
    def carried(self) -> float | None:
        """Upper estimate of what pulls at the joint in an impact [N]."""
        return None if self.peak is None else _SUDDEN * self.peak

    @property
    def opens(self) -> bool:
        """Whether an impact may open the joint, wherever its force enters."""
        return self.carried is not None and self.carried > self.preload

    @property
    def opening_doubt(self) -> str:
        """That an impact may open the joint; empty where it stays closed."""
        if self.carried is None or not self.opens:
            return ""
        return (
            f"bolts {self.body}.{self.joint}: the joint may open: contact forces may pull at it "
            f"with up to {format_si(self.carried, 'N', 3)}, twice their peak, at a preload of "
            f"{format_si(self.preload, 'N', 3)}; the joint was taken as glued. Try: more preload."
        )

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why the joint may be other than computed."""
        where = f"bolts {self.body}.{self.joint}"
        found = []
        low, high = (share * self.distance for share in _LENGTHS)
        if not low <= self.length <= high:
            found.append(
                f"{where}: a length of {format_si(self.length, 'm', 3)} between ends that are "
                f"{format_si(self.distance, 'm', 3)} apart. Try: check its unit; the length is "
                "the stretched part of the bolt."
            )
        limit = self.bolt_yield or _STRONGEST
        if self.bolt_stress > limit:
            of = "their yield stress" if self.bolt_yield else "that of class 12.9, without 'yield',"
            found.append(
                f"{where}: the bolts yield: {format_si(self.bolt_stress, 'Pa', 3)} is above {of} "
                f"of {format_si(limit, 'Pa', 3)}. Try: less preload, or a larger area."
            )
        if self.open_share > _OPEN:
            found.append(
                f"{where}: {100 * self.open_share:.2g} % of the joint is open under the preload; "
                "the impact takes the whole joint as glued, which is stiffer. "
                + ("Its largest pressure is approximate. " if self.open_share > _MOSTLY else "")
                + "Try: a joint that ends where the pressure does."
            )
        found += yield_doubts(where, self.stress, self.yield_stress, "the preload", "preload")
        if self.opening_doubt:
            found.append(self.opening_doubt)
        return tuple(found)

    def rows(
        self, told: Callable[[float, str, int], str] = format_si
    ) -> tuple[tuple[str, str], ...]:
        """A row for each quantity; ``told`` writes value, unit and digits."""
        beside = "" if self.bolt_yield is None else f", yield {told(self.bolt_yield, 'Pa', 3)}"
        rows = [
            (
                "joint",
                f"{self.upper} on {self.lower}, {1e6 * self.area:.4g} mm^2, pressed between "
                f"{self.ends[0]} and {self.ends[1]}",
            ),
            (
                "preload",
                f"{told(self.preload, 'N', 3)}"
                + (f", {self.count} bolts together" if self.count > 1 else ""),
            ),
            ("stress of a bolt", told(self.bolt_stress, "Pa", 3) + beside),
            ("mean pressure", told(self.pressure, "Pa", 3)),
            (
                "least, largest pressure",
                f"{told(self.least_pressure, 'Pa', 3)}, {told(self.largest_pressure, 'Pa', 3)}",
            ),
            ("open under the preload", f"{100 * self.open_share:.2g} %"),
            *stress_rows(self.stress, self.yield_stress, told),
            (
                "stiffness of bolts, of parts",
                f"{told(self.bolt_stiffness, 'N/m', 3)}, {told(self.part_stiffness, 'N/m', 3)}",
            ),
            ("load factor", f"{self.load_factor:.3g}"),
            (
                "lifts at",
                f"{told(self.lifting_force, 'N', 3)} between the two ends, "
                f"{told(self.preload, 'N', 3)} at the joint",
            ),
        ]
        if self.carried is not None:
            rows.append(
                (
                    "largest pull in the impact",
                    f"{told(self.carried, 'N', 3)}, twice the peak force: "
                    + ("the joint may open" if self.opens else "the joint stays closed"),
                )
            )
        return tuple(rows)


@tells_place
def bolted_joints(case: CaseFile, body: str) -> tuple[BoltedJoint, ...]:
    """State of the bolted joint of a body, as drawn and free."""
    return joints_of(case, body, "bolts", case.bodies[body].bolts or {}, _computed)


def struck_bolts(case: CaseFile, peak: float) -> tuple[BoltedJoint, ...]:
    """Bolted joints of all bodies in an impact with this largest contact force [N]."""
    return tuple(
        replace(joint, peak=peak) for name in case.bodies for joint in bolted_joints(case, name)
    )


def opening_doubts(case: CaseFile, peaks: Iterable[float]) -> tuple[str, ...]:
    """That impacts with these peak forces [N] may open bolted joints."""
    joints = struck_bolts(case, max((peak for peak in peaks if peak == peak), default=0.0))
    return tuple(filter(None, (joint.opening_doubt for joint in joints)))


@lru_cache(maxsize=20)
def _computed(
    body: str,
    shape: Drawn | FileShape,
    chosen: Chosen,
    bolts: tuple[tuple[str, Bolts], ...],
    sizes: Sizes,
) -> tuple[BoltedJoint, ...]:
    """Kept: a run asks once for the doubts, and once for the numbers."""
    materials = dict(chosen)
    ((name, given),) = bolts
    joint, mesh = _meshed_joint(body, shape, name, given.ends, sizes)
    preload = given.count * given.preload
    state = clamped_state(mesh, materials, joint, preload)
    area = float(state.area.sum())
    return (
        BoltedJoint(
            body=body,
            joint=name,
            lower=joint.lower,
            upper=joint.upper,
            ends=joint.ends,
            count=given.count,
            area=area,
            distance=state.distance,
            preload=preload,
            length=given.length,
            bolt_stress=given.preload / given.area,
            bolt_yield=given.yield_stress,
            pressure=preload / area,
            least_pressure=float(state.pressure.min()),
            largest_pressure=float(state.pressure[state.away].max()),
            open_share=state.open_share,
            stress=state.stress,
            yield_stress=yield_stresses(materials),
            bolt_stiffness=given.count * given.area * given.modulus / given.length,
            part_stiffness=state.stiffness,
        ),
    )


def _meshed_joint(
    body: str, shape: Drawn | FileShape, name: str, ends: tuple[str, str], sizes: Sizes
) -> tuple[FlatJoint, Mesh]:
    """Joint of this name, and a mesh that is fine there and where bolts press."""
    if isinstance(shape, FileShape):
        squares = {name: _ON_FACE, **dict.fromkeys(ends, _ON_END)}
        finer = {face: sqrt(a / squares[face]) for face, a, _ in shape.faces if face in squares}
        mesh = joint_mesh(body, shape, sizes, finer)
        return flat_solid_joint(mesh, name, ends), mesh
    profiles = dict(shape)
    joint = flat_joint(profiles, name, ends)
    finer = {name: joint.length / (2 * ELEMENTS)}  # pressures are at corners only
    for end in sorted(ends):
        lengths = (c.length for p in profiles.values() for c in p.curves if c.name == end)
        finer[end] = sum(lengths) / _ACROSS
    return joint, joint_mesh(body, shape, sizes, finer)
