"""History of one contact between two bodies, from any solver and level.

Axis of motion z; body a (the needle) is above and moves in -z onto body b.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from klack.errors import refuse_if

__all__ = ["BodyEnergy", "EnergyLedger", "ImpactHistory"]


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyEnergy:
    """Energy of one body at the end of a run.

    Parameters
    ----------
    translation [J]
        ``m v_cm^2 / 2`` of the centre of mass along z.
    vibration [J]
        All other kinetic energy, and the strain energy.
    strain [J]
        Part of ``vibration``.
    frequency (m,) [Hz]
        Undamped, of each elastic mode; empty for a solver without modes.
    modal (m,) [J]
        Kinetic and strain energy of each.
    """

    name: str
    translation: float
    vibration: float
    strain: float
    frequency: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    modal: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    @property
    def total(self) -> float:
        """Translation and vibration [J]."""
        return self.translation + self.vibration


@dataclass(frozen=True, kw_only=True, eq=False)
class EnergyLedger:
    """Energy balance of an impact.

    Parameters
    ----------
    initial [J]
        Kinetic and strain energy of all bodies.
    bodies
        At the end.
    contact [J]
        Stored in contacts at the end (0 after separation).
    contact_dissipation [J]
        In contact damping, including work clipped where a law would have pulled.
    damping [J]
        In modal damping.
    work [J]
        Of constant forces on the bodies.
    spring [J]
        Change of springs to ground.
    friction [J]
        Of the faces, never below zero.
    plastic [J]
        Of faces that yield; a tenth stays in them as energy of residual stress.
    radiated [J]
        Through non-reflecting ends, never below zero.
    """

    initial: float
    bodies: tuple[BodyEnergy, ...]
    contact: float = 0.0
    contact_dissipation: float = 0.0
    damping: float = 0.0
    work: float = 0.0
    spring: float = 0.0
    friction: float = 0.0
    plastic: float = 0.0
    radiated: float = 0.0

    @property
    def lost(self) -> float:
        """Sum of all losses [J]."""
        return (
            self.contact_dissipation + self.damping + self.friction + self.plastic + self.radiated
        )

    @property
    def residual(self) -> float:
        """Energy from nowhere over the energy turned over [-]."""
        held = sum(body.total for body in self.bodies) + self.contact + self.spring
        scale = self.turned_over
        return (held + self.lost - self.initial - self.work) / scale if scale else 0.0

    @property
    def turned_over(self) -> float:
        """Scale of the residual [J]: initial energy, work, or change of the springs."""
        return max(self.initial, abs(self.work), abs(self.spring))

    @property
    def least_loss(self) -> float:
        """Smallest existing loss over the energy turned over [-]."""
        losses = [self.contact_dissipation, self.damping]
        losses += [loss for loss in (self.friction, self.plastic, self.radiated) if loss]
        scale = self.turned_over
        return min(losses) / scale if scale else 0.0

    def parts(self) -> dict[str, float]:
        """Every entry by name [J], the initial energy first; losses of faces if not zero."""
        out = {"initial kinetic": self.initial}
        for body in self.bodies:
            out[f"{body.name} kinetic (rigid)"] = body.translation
            out[f"{body.name} vibration"] = body.vibration
        out["contact"] = self.contact
        out["contact dissipation"] = self.contact_dissipation
        out["modal damping"] = self.damping
        out["work of constant forces"] = self.work
        out["springs"] = self.spring
        if self.friction:
            out["friction"] = self.friction
        if self.plastic:
            out["plastic"] = self.plastic
        if self.radiated:
            out["through non-reflecting ends"] = self.radiated
        return out


@dataclass(frozen=True, kw_only=True, eq=False)
class ImpactHistory:
    """Records of one contact on a uniform grid of ``n`` intervals.

    Forces and gaps are means over an interval (so sums are impulses, exactly); velocities and
    displacements hold at its ends.

    Parameters
    ----------
    step [s]
        A multiple of the integration step.
    force (n,) [N]
        Mean contact force over the interval, pushes a in +z and b in -z; >= 0, but for faces that
        friction keeps from parting.
    gap (n,) [m]
        Mean gap over the interval, negative where closed (of a full-order contact the
        pressure-weighted or area-weighted mean).
    velocity_a, velocity_b (n + 1,) [m/s]
        Of the centre of mass along z; zero for a supported body.
    speed [m/s]
        Of approach at the start, relative, above zero.
    mass_a, mass_b [kg]
        ``mass_b`` is ``inf`` for a supported body.
    peak_force (n,) [N]
        Largest force of any integration step within the interval; default: the mean.
    displacement_a, displacement_b (n + 1,) [m]
        Of the contact ports along z, or empty.
    external_force (n,) [N]
        Mean axial force on body a from springs and constant forces, + in z.
    longest_period [s]
        Of the elastic modes of body a, 0 if rigid; separates clusters of sub-contacts.
    pressed [m]
        Largest local indentation since the faces were new, of a law that yields; else 0.
    solver
        In words.
    start [s]
        Of the first interval.
    """

    step: float
    force: NDArray[np.float64]
    gap: NDArray[np.float64]
    velocity_a: NDArray[np.float64]
    velocity_b: NDArray[np.float64]
    speed: float
    mass_a: float
    mass_b: float
    ledger: EnergyLedger
    peak_force: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    displacement_a: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    displacement_b: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    external_force: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    longest_period: float = 0.0
    pressed: float = 0.0
    solver: str = ""
    start: float = 0.0

    def __post_init__(self) -> None:
        n = self.force.size
        if self.peak_force.size == 0:
            object.__setattr__(self, "peak_force", self.force)
        if self.external_force.size == 0:
            object.__setattr__(self, "external_force", np.zeros(n))
        for name, size in (
            ("peak_force", n),
            ("gap", n),
            ("external_force", n),
            ("velocity_a", n + 1),
            ("velocity_b", n + 1),
        ):
            refuse_if(
                getattr(self, name).shape != (size,),
                f"ImpactHistory.{name}",
                got=f"shape {getattr(self, name).shape}",
                expected=f"({size},) for {n} intervals",
                hint="forces and gaps are per interval, velocities per end of interval.",
            )

    @property
    def time(self) -> NDArray:
        """Middle of each interval, shape (n,) [s]."""
        return self.start + (np.arange(self.force.size) + 0.5) * self.step

    @property
    def edges(self) -> NDArray:
        """Ends of the intervals, shape (n + 1,) [s]."""
        return self.start + np.arange(self.force.size + 1) * self.step

    @property
    def impulse(self) -> float:
        """Integral of the contact force [N s]."""
        return float(np.sum(self.force) * self.step)
