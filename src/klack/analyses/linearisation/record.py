"""Record of a linearisation."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.analyses.record import CaseRecord

__all__ = [
    "Eigenvalue",
    "LinearModel",
    "LoopMargins",
    "PointValue",
    "Response",
    "SignalName",
    "StabilitySweep",
]

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalName:
    """State, input or output: name and SI unit."""

    name: str
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Eigenvalue:
    """One eigenvalue, or one of a conjugate pair.

    Parameters
    ----------
    real, imaginary [1/s]
        The latter zero or above.
    uncertainty [1/s]
        By round-off.
    verdict
        ``decays``, ``grows`` or ``neutral``.
    """

    real: float
    imaginary: float
    uncertainty: float
    verdict: str

    @property
    def frequency(self) -> float:
        """Of the oscillation [Hz]; 0 without one."""
        return self.imaginary / (2.0 * np.pi)

    @property
    def damping(self) -> float:
        """Damping ratio [-]; below zero where the motion grows."""
        size = float(np.hypot(self.real, self.imaginary))
        return -self.real / size if size else 0.0

    @property
    def time_constant(self) -> float:
        """Time [s] of decay to 1/e, or growth by e; infinite for neither."""
        return 1.0 / abs(self.real) if self.real and self.verdict != "neutral" else np.inf


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """Frequency response, in the unit of the output per unit of the input."""

    source: SignalName
    target: SignalName
    frequency: Vector
    real: Vector
    imaginary: Vector

    @property
    def unit(self) -> str:
        """Of the magnitude."""
        below = self.source.unit
        return f"{self.target.unit}/{f'({below})' if '/' in below else below}"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopMargins:
    """Margins of a loop that is opened at one place; nan where there is no crossing.

    Parameters
    ----------
    name
        Of the output where it is opened.
    frequency [Hz]
    real, imaginary [-]
        Of the open loop ``L``, closed by ``-1``.
    gain_margin [-]
        Factor on the loop for the limit of stability, the nearest to one.
    gain_frequency [Hz]
    phase_margin [degrees]
        Lag, or lead below zero, for that limit.
    phase_frequency [Hz]
    distance [-]
        Least distance of ``L`` from -1.
    distance_frequency [Hz]
    """

    name: str
    frequency: Vector
    real: Vector
    imaginary: Vector
    gain_margin: float
    gain_frequency: float
    phase_margin: float
    phase_frequency: float
    distance: float
    distance_frequency: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PointValue:
    """One quantity of the operating point [SI]."""

    component: str
    quantity: str
    unit: str
    value: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StabilitySweep:
    """The oscillation that decays the slowest along a swept quantity; nan where there is none.

    Parameters
    ----------
    name, unit
        Key of the case, or lift, current, voltage; SI.
    values (points,)
    growth [1/s]
        Real part of its eigenvalue.
    frequency [Hz]
    damping [-]
    unstable
        Number of growing eigenvalues, also without oscillation; -1 without a point.
    failures
        Why there is no point.
    """

    name: str
    unit: str
    values: Vector
    growth: Vector
    frequency: Vector
    damping: Vector
    unstable: NDArray[np.int64]
    failures: tuple[str, ...]

    @property
    def short(self) -> str:
        """Name without the sections that hold all components."""
        return self.name.removeprefix("network.components.")


@dataclass(frozen=True, kw_only=True, eq=False)
class LinearModel(CaseRecord):
    """A valve as a linear system about an operating point.

    Parameters
    ----------
    drive [A]
        Current of each coil.
    band [Hz]
        Up to which matrices and eigenvalues hold with lines.
    delays [s]
        Of the segments of lines, both directions.
    A, B, C, D
        Without delays: those of lines are all-passes.
    eigenvalues
        Those that grow first, then by their distance from zero.
    owners
        Components that have states.
    shares (eigenvalues, owners) [-]
        Participation; every row adds up to one.
    unconfirmed
        Eigenvalues of the matrices in the band that lead to no root with delays.
    sweeps
        None or one.
    cpu_time [s]
        Without bodies and contact laws.
    """

    variant: str
    drive: Mapping[str, float]
    point: tuple[PointValue, ...]
    band: float
    delays: Vector
    states: tuple[SignalName, ...]
    inputs: tuple[SignalName, ...]
    outputs: tuple[SignalName, ...]
    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    eigenvalues: tuple[Eigenvalue, ...]
    owners: tuple[str, ...]
    shares: Matrix
    unconfirmed: int
    responses: tuple[Response, ...]
    loops: tuple[LoopMargins, ...]
    sweeps: tuple[StabilitySweep, ...]
    cpu_time: float

    @property
    def has_lines(self) -> bool:
        """Whether there are delays."""
        return len(self.delays) > 0

    def parts(self, mode: int) -> dict[str, float]:
        """Components with a share of 0.01 or more, the largest first."""
        order = np.argsort(-self.shares[mode])
        row = {self.owners[k]: float(self.shares[mode, k]) for k in order}
        return {name: share for name, share in row.items() if share >= 0.01}

    @property
    def growing(self) -> tuple[Eigenvalue, ...]:
        """Eigenvalues that grow."""
        return tuple(mode for mode in self.eigenvalues if mode.verdict == "grows")

    @property
    def neutral(self) -> tuple[Eigenvalue, ...]:
        """Eigenvalues that neither decay nor grow."""
        return tuple(mode for mode in self.eigenvalues if mode.verdict == "neutral")
