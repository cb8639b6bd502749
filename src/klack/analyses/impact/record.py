"""Record of an impact study."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from klack.analyses.record import CaseRecord
from klack.assembling.body_summary import BodySummary
from klack.assembling.bolts import BoltedJoint
from klack.assembling.fits import PressFit
from klack.assembling.layers import LayerState
from klack.bodies.gauges.gauge import GaugeRecord
from klack.bodies.reduction.structure import Structure
from klack.bodies.reduction.transfer import TransferComparison
from klack.contact.history import ImpactHistory
from klack.contact.restitution import Deviation, ImpactMeasures
from klack.contact.statics import StuckCompliance
from klack.mesh.skin import Skin

__all__ = [
    "SETTLED",
    "BackingContact",
    "BodyPicture",
    "ContactSummary",
    "FrictionRecord",
    "ImpactStudy",
    "LawSummary",
    "LevelResult",
    "ModalEnergy",
    "ObliqueMotion",
    "PressureRecord",
    "RunningIn",
    "SectionPicture",
]


SETTLED = 0.02
"""Largest spread of the force history [-] of a reference."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactSummary:
    """Static frictionless contact of the two full bodies.

    Parameters
    ----------
    surfaces
        For example ``"needle.tip on housing.seat"``.
    points
        Contact points (mortar multipliers).
    half_width [m]
        At the highest force of the impact.
    size_ratio [-]
        Element size across the contact over the half width; good up to 1, doubtful above 1.5.
    points_across
        Loaded contact points across the width then; 0 if unknown.
    doubts
        Why no error can be judged on these meshes.
    needed_yield [Pa]
        Yield stress from which on both bodies stay elastic; nan if unknown.
    layer
        Asperities of rough faces in words; empty for smooth ones.
    stuck
        Compliance of the contact while its points stick; of half sections and faces that rub.
    approach, force, area (n,) [m], [N], [m^2]
        Ladder from first touch.
    """

    surfaces: str
    points: int
    half_width: float
    size_ratio: float
    approach: NDArray[np.float64]
    force: NDArray[np.float64]
    area: NDArray[np.float64]
    points_across: int = 0
    doubts: tuple[str, ...] = ()
    needed_yield: float = float("nan")
    layer: str = ""
    stuck: StuckCompliance | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class LawSummary:
    """The local contact law of the reduced level and its classical alternative.

    Parameters
    ----------
    kind
        ``"consistent"``, ``"linear"``, ``"hertz"``.
    indentation, force [m], [N]
    share [-]
        Of the static compliance that the law carries, at each ``force``.
    linear_stiffness [N/m]
        Straight line through the law over ``fit_range`` [N].
    classical_stiffness [N/m]
        Linear fit of a static submodel of the contact region alone.
    classical_size [m]
        Radius of that submodel.
    """

    kind: str
    indentation: NDArray[np.float64]
    force: NDArray[np.float64]
    share: NDArray[np.float64]
    linear_stiffness: float
    fit_range: tuple[float, float]
    classical_stiffness: float
    classical_size: float


@dataclass(frozen=True, kw_only=True, eq=False)
class ModalEnergy:
    """Energy left in the modes of one body after separation: (n,) [Hz], (n,) [J]."""

    body: str
    frequency: NDArray[np.float64]
    energy: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class FrictionRecord:
    """Friction of all contact points, at the times of their :class:`PressureRecord`.

    Parameters
    ----------
    force (n, ways, nc) [N]
        On the moving body: outwards from the axis along the face; in three dimensions round the
        axis too.
    doing (n, nc)
        0 open, 1 sticking, 2 slipping (:mod:`klack.transient.rubbing`).
    coefficient [-]
        While a point slips.
    """

    force: NDArray[np.float32]
    doing: NDArray[np.int8]
    coefficient: float


@dataclass(frozen=True, kw_only=True, eq=False)
class PressureRecord:
    """Forces of all contact points during the first impact.

    Parameters
    ----------
    time (n,) [s]
        Middle of each recorded step.
    points (nc, dimension) [m]
    area (nc,) [m^2]
        The pressure of a point is its force over its area.
    point_force (n, nc) [N]
    friction
        Where the faces rub.
    """

    time: NDArray[np.float64]
    points: NDArray[np.float64]
    area: NDArray[np.float64]
    point_force: NDArray[np.float32]
    friction: FrictionRecord | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class ObliqueMotion:
    """Rigid motion of the moving body that starts across the axis, before and after the impact.

    Parameters
    ----------
    velocity_before, velocity_after (3,) [m/s]
        Of its centre of mass.
    spin_before, spin_after (3,) [rad/s]
    mass [kg]
        Of the moving body.
    mass_ratio [-]
        Over that of the body that it hits; 0 for a held one.
    impulse [N s]
        Of the contact, along the axis.
    """

    velocity_before: NDArray[np.float64]
    velocity_after: NDArray[np.float64]
    spin_before: NDArray[np.float64]
    spin_after: NDArray[np.float64]
    mass: float
    mass_ratio: float
    impulse: float

    @property
    def tangential_restitution(self) -> float:
        """Sideways velocity of the centre after over before, of both bodies; nan without."""
        before, after = self.velocity_before[:2], self.velocity_after[:2]
        square = float(before @ before)
        if not square > 0.0:
            return float("nan")
        # the lower body takes what the moving one loses
        return float((after + self.mass_ratio * (after - before)) @ before) / square

    @property
    def impulse_ratio(self) -> float:
        """Impulse of the contact across the axis over that along it [-]."""
        change = self.velocity_after[:2] - self.velocity_before[:2]
        return self.mass * float(np.hypot(*change)) / self.impulse


@dataclass(frozen=True, kw_only=True, eq=False)
class BackingContact:
    """Contact of the struck body with the third one behind it, during the whole run.

    Parameters
    ----------
    surfaces
        For example ``"insert.foot on housing.ledge"``.
    preload [N]
        At the start.
    """

    surfaces: str
    preload: float
    history: ImpactHistory

    @property
    def peak_force(self) -> float:
        """Largest force of any time step [N]."""
        return float(self.history.peak_force.max())

    @property
    def least_force(self) -> float:
        """Smallest force [N]; without a preload, after the first contact."""
        return float(self.history.force[self._first :].min(initial=0.0 if self._none else np.inf))

    @property
    def lift_off(self) -> float:
        """When the contact first opens, from the start of the run [s]; nan if it never does."""
        opened = np.flatnonzero(self._open)
        return float(self.history.edges[opened[0]]) if opened.size else float("nan")

    @property
    def open_time(self) -> float:
        """Time without force after the first contact [s]."""
        return float(self.history.step * np.count_nonzero(self._open))

    @property
    def largest_gap(self) -> float:
        """After the first contact [m]; 0 if it never opens."""
        return float(self.history.gap[self._open].max(initial=0.0))

    @property
    def _none(self) -> bool:
        return not self.history.force.any()

    @property
    def _first(self) -> int:
        """First record in contact; their number if there is none."""
        closed = self.history.force > 0.0
        return int(np.argmax(closed)) if closed.any() else closed.size

    @property
    def _open(self) -> NDArray[np.bool_]:
        after = np.arange(self.history.force.size) >= self._first
        return after & (self.history.force <= 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class LevelResult:
    """One computed impact.

    Parameters
    ----------
    level
        ``lumped``, ``reduced``, ``reduced-attachment``, ``reduced-none``,
        ``reduced-participation``, ``interface`` or ``full``.
    label
        For a legend, for example ``"reduced, 20 + 40 modes, consistent law"``.
    step [s]
    wall_time [s]
        Of the time integration alone.
    setup_time [s]
        Of all that this level needs before (shared steps counted once each).
    energies [J]
        After separation, e.g. ``"needle kinetic (rigid)"``, ``"needle vibration"``, ...; the first
        entry is ``"initial kinetic"``, of a clamped row with what the preload stores.
    energy_residual [-]
        Over the initial kinetic energy.
    pressure
        Of levels with contact points.
    frictionless
        Without the friction of the faces, where they rub.
    doubts
        Why this level can be no reference for others (:mod:`klack.analyses.impact.trust`).
    gauges
        Output channels; none at the level lumped.
    oblique
        Of a body that starts sideways or with a spin.
    backing
        Of three bodies in a row.
    """

    level: str
    label: str
    history: ImpactHistory
    measures: ImpactMeasures
    degrees_of_freedom: int
    steps: int
    step: float
    wall_time: float
    setup_time: float
    energies: Mapping[str, float]
    energy_residual: float
    modal_energy: tuple[ModalEnergy, ...] = ()
    pressure: PressureRecord | None = None
    frictionless: ImpactMeasures | None = None
    doubts: tuple[str, ...] = ()
    gauges: tuple[GaugeRecord, ...] = ()
    oblique: ObliqueMotion | None = None
    backing: BackingContact | None = None

    def doubted(self, *doubts: str) -> Self:
        """The same with further doubts, if not empty."""
        return replace(self, doubts=(*self.doubts, *filter(None, doubts)))


@dataclass(frozen=True, kw_only=True, eq=False)
class SectionPicture:
    """Half-section of a body in the (r, z) plane at one instant, true to the mesh.

    Parameters
    ----------
    points (n, 2) [m]
        Undeformed: distance from the axis and height.
    displacement (n, 2) [m]
        In these directions, elastic and rigid.
    magnitude (n,) [m]
        Length of the displacement vector (three components) that colours the picture.
    triangles (t, 3)
    edges (e, 2)
        Element edges to draw as thin lines.
    time [s]
    closing [m]
        Mean axial displacement of a body that is held nowhere; 0 for a held one.
    """

    body: str
    points: NDArray[np.float64]
    displacement: NDArray[np.float64]
    magnitude: NDArray[np.float64]
    triangles: NDArray[np.int64]
    edges: NDArray[np.int64]
    time: float
    closing: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyPicture:
    """A body in three dimensions, for a picture that moves: its surface, modes and impact.

    Parameters
    ----------
    skin
        At the start.
    held (v,)
        Held vertices of the skin.
    section (s, 2, 3) [m]
        Sides of elements in the plane y = 0.
    finest [m]
        Shortest side of an element.
    node (n,)
        Nodes of the mesh on the skin, rising.
    shapes (m, n, dimension)
        Displacements of these nodes, in 32767ths of the largest component of a shape: rigid modes,
        elastic modes, and last any static rest of the contact force.
    scale (m,)
        Displacement of 32767 [m] per unit of its amplitude.
    frequency (m,) [Hz]
        0 of rigid modes; nan of attachment modes and of the static rest.
    instants (frames,) [s]
        Of the reduced level, if computed.
    amplitude (frames, m)
        Of the modes in sqrt(kg) m, of the static rest in N.
    stress (n,) [Pa]
        Von Mises at the highest force, of the full level if computed; empty without.
    touch (k, 3) [m]
        Points of first touch of the centred bodies round the axis, of the lower body; none for
        faces that touch all at once.
    """

    body: str
    skin: Skin
    held: NDArray[np.bool_]
    section: NDArray[np.float64]
    finest: float
    node: NDArray[np.int64]
    shapes: NDArray[np.int16]
    scale: NDArray[np.float64]
    frequency: NDArray[np.float64]
    instants: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    amplitude: NDArray[np.float32] = field(default_factory=lambda: np.empty((0, 0), np.float32))
    stress: NDArray[np.float32] = field(default_factory=lambda: np.empty(0, np.float32))
    touch: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 3)))


@dataclass(frozen=True, kw_only=True, eq=False)
class RunningIn:
    """Impacts of the same start, one after another on the same faces.

    Parameters
    ----------
    asked
        Impacts asked for; those of running-in follow.
    peak_force (n,) [N]
    contact_time (n,) [s]
    restitution (n,) [-]
    lost (n,) [J]
        In yield, of each impact.
    set (n,) [m]
        After each impact: how much lower the bodies touch than new ones.
    land (n,) [m]
        Width of the strip that has been in contact at the highest force so far; nan at the
        interface level.
    run_in
        The last impact does not yield any more.
    radius (nc,) [m]
        Of the contact points, rising; none at the interface level, where the set differs round the
        ring.
    opening (nc,) [m]
        Gap that has stayed there after the last impact.
    worn_by [N]
        Force up to which the faces are elastic now; nan at the interface level.
    """

    asked: int
    peak_force: NDArray[np.float64]
    contact_time: NDArray[np.float64]
    restitution: NDArray[np.float64]
    lost: NDArray[np.float64]
    set: NDArray[np.float64]
    land: NDArray[np.float64]
    run_in: bool
    radius: NDArray[np.float64]
    opening: NDArray[np.float64]
    worn_by: float
    level: str = "reduced"

    @property
    def heads(self) -> tuple[str, ...]:
        """Heads of :meth:`rows`: first impact, last asked for, last of all."""
        last = len(self.peak_force) - 1
        ends = {last: ", run in"} if self.run_in else {}
        return ("", *(f"impact {i + 1}{ends.get(i, '')}" for i in self._shown))

    def rows(self, told: Callable[[float, str, int], str]) -> tuple[tuple[str, ...], ...]:
        """A row for each quantity; ``told`` writes value, unit and digits."""

        def row(title: str, values: np.ndarray, unit: str, digits: int) -> tuple[str, ...]:
            return (title, *(told(float(values[i]), unit, digits) for i in self._shown))

        land = [row("width of the land", self.land, "m", 3)] if np.isfinite(self.land[0]) else []
        return (
            row("peak force", self.peak_force, "N", 5),
            row("contact time", self.contact_time, "s", 4),
            ("restitution", *(f"{self.restitution[i]:.4f}" for i in self._shown)),
            row("lost in yield", self.lost, "J", 3),
            row("set after it", self.set, "m", 3),
            *land,
        )

    @property
    def _shown(self) -> list[int]:
        last = len(self.peak_force) - 1
        return sorted({0, min(self.asked - 1, last), last})


@dataclass(frozen=True, kw_only=True, eq=False)
class ImpactStudy(CaseRecord):
    """All levels of one dry impact, side by side.

    Parameters
    ----------
    speed, gap [m/s], [m]
    reference
        Level of the answer: the finest one that nothing speaks against.
    deviations
        From the reference; none where that has doubts itself.
    estimates
        Estimated error of reduced levels: their deviation from one interface-level run.  With the
        full order also that of its steps: of the same run with its periods and steps.
    estimate_basis
        What that run was, in words; empty without one.
    estimate_margins
        How far each estimate may be off, no signs: what half the modes in longer steps do to that
        run, and what its steps leave open.  None in results of earlier versions.
    estimate_spread [-]
        That of the force history.  Above :data:`SETTLED` the run is no reference, and the
        estimates say little.
    estimate_doubt
        Why an estimate that was asked for is missing.
    structures
        Held bodies as sources of sound; their stop is called ``"contact"``.
    failures
        Why a level has no result, by its name.
    running_in
        Where faces yield and more than one impact was asked for.
    pictures
        Of both bodies; none in results of earlier versions.
    fits, bolts, layers
        Press fits, bolted joints and layers of all bodies.
    """

    speed: float
    gap: float
    bodies: tuple[BodySummary, ...]
    contact: ContactSummary
    law: LawSummary
    levels: Mapping[str, LevelResult]
    reference: str
    deviations: Mapping[str, Deviation]
    transfer: tuple[TransferComparison, ...] = ()
    sections: tuple[SectionPicture, ...] = ()
    estimates: Mapping[str, Deviation] = field(default_factory=dict)
    estimate_basis: str = ""
    estimate_margins: Mapping[str, Deviation] = field(default_factory=dict)
    estimate_spread: float = 0.0
    structures: tuple[Structure, ...] = ()
    estimate_doubt: str = ""
    failures: Mapping[str, str] = field(default_factory=dict)
    running_in: RunningIn | None = None
    pictures: tuple[BodyPicture, ...] = ()
    fits: tuple[PressFit, ...] = ()
    bolts: tuple[BoltedJoint, ...] = ()
    layers: tuple[LayerState, ...] = ()

    @property
    def estimates_settled(self) -> bool:
        """Whether the estimates are reliable."""
        return self.estimate_spread <= SETTLED and not self.estimate_doubt

    @property
    def ordered(self) -> tuple[LevelResult, ...]:
        """Results in the order of tables: reference, interface, reduced, others."""
        best = (self.reference, "interface", "reduced")
        first = dict.fromkeys(name for name in best if name in self.levels)
        return tuple(self.levels[name] for name in first | dict.fromkeys(self.levels))

    @property
    def is_row(self) -> bool:
        """Whether three bodies stand in a row, which the level ``reduced`` alone knows."""
        return any(level.backing is not None for level in self.levels.values())

    def why_missing(self, name: str) -> str:
        """Why a level failed; empty if it was not requested."""
        text = self.failures.get(name, "")
        return f": it failed ({' '.join(text.split())})" if text else ""
