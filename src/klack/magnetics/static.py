"""A magnetic circuit at rest: current and gap in, fluxes, force and energies out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.errors import ConvergenceError
from klack.magnetics.circuit import MagneticCircuit

__all__ = ["StaticState", "static_state"]

_MOST_ITERATIONS = 200
_SETTLED = 1e-13


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StaticState:
    """Fields of a circuit that carries a constant current.

    Parameters
    ----------
    current [A]
    gap [m]
    loop_fluxes, branch_fluxes [Wb]
    linkage [Wb]
        Of the coil at the terminals, ``psi``.
    force [N]
        Along the working gap; negative pulls it shut.
    energy, coenergy [J]
        Their sum is ``psi i`` of all circuits.
    """

    current: float
    gap: float
    loop_fluxes: NDArray[np.float64]
    branch_fluxes: NDArray[np.float64]
    linkage: float
    force: float
    energy: float
    coenergy: float

    @property
    def inductance(self) -> float:
        """Static inductance ``psi / i`` [H]; nan without current."""
        return self.linkage / self.current if self.current else float("nan")


def static_state(
    circuit: MagneticCircuit,
    *,
    current: float,
    gap: float,
    start: NDArray[np.float64] | None = None,
    others: Mapping[str, float] | None = None,
) -> StaticState:
    """Solve the circuit for a constant current [A] at a working gap [m].

    ``others`` are the currents [A] of further electric circuits, by name.  The loop fluxes minimise
    the convex function ``W(phi) - psi(phi) i`` by damped Newton steps, from any ``start`` [Wb].

    Raises
    ------
    ConvergenceError
        For a law that does not rise.
    """
    C, drive = circuit.loops, current * circuit.loop_turns
    linked = [(i, circuit.turns_of(name)) for name, i in (others or {}).items()]
    for amperes, turns in linked:
        drive = drive + amperes * turns
    phi = np.zeros(C.shape[1]) if start is None else np.array(start, dtype=float)

    def gradient(phi: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(C.T @ circuit.mmf(C @ phi, gap) - drive, dtype=float)

    here = gradient(phi)
    for _ in range(_MOST_ITERATIONS):
        step = -np.linalg.solve((C.T * circuit.slope(C @ phi, gap)) @ C, here)
        if np.max(np.abs(step)) <= _SETTLED * np.max(np.abs(phi)):
            return _state(circuit, phi + step, current, gap, linked)
        # of a convex function the slope along the step is enough, which round-off spares: it
        # starts at -downhill, and a step is too long where it has risen well above zero
        downhill, share = abs(float(here @ step)), 1.0
        while float((there := gradient(phi + share * step)) @ step) > 0.5 * downhill:
            if share <= 1e-9:
                break
            share *= 0.5
        phi, here = phi + share * step, there
    raise ConvergenceError(
        f"static magnetic circuit at {current:g} A and a gap of {gap:g} m: the last flux step "
        f"was {np.max(np.abs(step)):.2g} Wb after {_MOST_ITERATIONS} iterations.\n"
        "Try: check that every reluctance is above 0 and every B-H curve increases."
    )


def _state(
    circuit: MagneticCircuit,
    phi: NDArray[np.float64],
    current: float,
    gap: float,
    others: Sequence[tuple[float, NDArray[np.float64]]],
) -> StaticState:
    branch = circuit.loops @ phi
    linkage, energy = float(circuit.loop_turns @ phi), circuit.energy(branch, gap)
    return StaticState(
        current=current,
        gap=gap,
        loop_fluxes=phi,
        branch_fluxes=branch,
        linkage=linkage,
        force=circuit.force(branch, gap),
        energy=energy,
        coenergy=sum((i * float(turns @ phi) for i, turns in others), linkage * current) - energy,
    )
