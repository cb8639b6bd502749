r"""A magnetic circuit as branches and loops.

Branch fluxes follow from loop fluxes, :math:`\varphi_b = C\,\varphi`; each loop balances

.. math:: C^T\bigl[\Theta_b(\varphi_b, x) - \Theta_{0,b} + S_b\,\dot\varphi_b - N_b\, i\bigr] = 0 ,

with the linkage of the coil :math:`\psi = N_b^T C \varphi`, one working gap ``x`` for the whole
circuit, and ``C``, :attr:`MagneticCircuit.loops`.  Loop fluxes satisfy Kirchhoff's node law by
construction and make the stored energy a convex function of the unknowns.

Further coils, in electric circuits of their own, add their ``N_b i``: mutual induction follows
from the fluxes that they share.

Limits: lumped flux tubes, one moving direction.  At rest iron follows its mean curve;
hysteresis acts in the time step only.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from klack.errors import refuse_if, require_nonnegative
from klack.magnetics.hysteresis import IronStops
from klack.magnetics.reluctance import GapReluctance, LinearReluctance, ReluctanceLaw

__all__ = ["MOST_LOOPS", "BranchKind", "MagneticBranch", "MagneticCircuit"]

MOST_LOOPS = 6
"""Most loops that the compiled time step solves."""

BranchKind = Literal["linear", "gap", "iron"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MagneticBranch:
    r"""One flux tube: :math:`\Theta = \Theta_b(\varphi, x) - \Theta_0 + S\,\dot\varphi - N i`.

    Parameters
    ----------
    law
        :math:`\Theta_b`, see :mod:`klack.magnetics.reluctance`.
    eddy [S]
        ``S``: eddy currents around the tube oppose its change (``1/R_e`` of a shorted turn); the
        loss is ``S (dflux/dt)^2``.
    turns [-]
        ``N``: of the coil around this branch, signed by its direction.
    circuit
        Electric circuit of these turns; empty: that of the magnet's terminals.
    remanence [A]
        :math:`\Theta_0`: constant mmf along the branch (remanence of the iron, a magnet), part of
        the stored energy: ``law.energy - remanence * flux``.
    stops
        Hysteresis of iron, beside ``law`` as its mean curve.
    """

    name: str
    law: ReluctanceLaw
    eddy: float = 0.0
    turns: float = 0.0
    remanence: float = 0.0
    stops: IronStops | None = None
    circuit: str = ""

    def __post_init__(self) -> None:
        require_nonnegative(f"MagneticBranch '{self.name}': eddy", self.eddy, "S")

    @property
    def kind(self) -> BranchKind:
        """Which of the three laws the branch has."""
        if isinstance(self.law, LinearReluctance):
            return "linear"
        return "gap" if isinstance(self.law, GapReluctance) else "iron"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MagneticCircuit:
    """Branches, and the loops through them.

    Parameters
    ----------
    loops (n_branches, n_loops) [-]
        0, +1 or -1: ``branch flux = loops @ loop fluxes``.  Independent columns, at most
        :data:`MOST_LOOPS`.
    main
        Branch whose flux is shown as *the* flux: usually the working gap.
    """

    branches: tuple[MagneticBranch, ...]
    loops: NDArray[np.int64]
    main: str

    def __post_init__(self) -> None:
        loops = np.array(self.loops, dtype=np.int64)
        object.__setattr__(self, "loops", loops)
        rows, columns = loops.shape if loops.ndim == 2 else (0, 0)
        refuse_if(
            rows != len(self.branches) or not 1 <= columns <= MOST_LOOPS,
            "MagneticCircuit.loops",
            got=f"shape {loops.shape} for {len(self.branches)} branches",
            expected=f"one row per branch and 1 to {MOST_LOOPS} columns",
            hint="write +1 or -1 where a loop passes through a branch, else 0.",
        )
        refuse_if(
            np.any(np.abs(loops) > 1) or np.linalg.matrix_rank(loops) < columns,
            "MagneticCircuit.loops",
            got=f"{loops.tolist()}",
            expected="independent columns of 0, +1 and -1",
            hint="drop the loop that is a sum of others.",
        )
        names = [branch.name for branch in self.branches]
        refuse_if(
            self.main not in names or len(set(names)) < len(names),
            "MagneticCircuit.branches",
            got=f"the names {', '.join(names)} and the main branch '{self.main}'",
            expected="different names, among them the main branch",
            hint="rename a branch.",
        )
        refuse_if(
            not np.any(loops.T @ self.turns),
            "MagneticCircuit.branches",
            got="no loop around turns of the coil",
            expected="at least one branch with turns in a loop",
            hint="give the branch through the coil a number of turns.",
        )

    @property
    def hysteretic(self) -> bool:
        """Whether some iron has hysteresis."""
        return any(branch.stops is not None for branch in self.branches)

    @property
    def turns(self) -> NDArray[np.float64]:
        """Turns of the coil per branch, shape (n_branches,) [-]."""
        return self._turns("")

    def _turns(self, circuit: str) -> NDArray[np.float64]:
        turns = [b.turns if b.circuit == circuit else 0.0 for b in self.branches]
        return np.array(turns, dtype=float)

    def turns_of(self, circuit: str) -> NDArray[np.float64]:
        """Turns of an electric circuit per loop, shape (n_loops,) [-]."""
        return np.asarray(self.loops.T @ self._turns(circuit), dtype=float)

    @property
    def loop_turns(self) -> NDArray[np.float64]:
        """Turns of the coil per loop, shape (n_loops,): ``linkage = loop_turns @ loop fluxes``."""
        return self.turns_of("")

    @property
    def eddy(self) -> NDArray[np.float64]:
        """Eddy conductance per branch, shape (n_branches,) [S]."""
        return np.array([branch.eddy for branch in self.branches], dtype=float)

    @property
    def remanence(self) -> NDArray[np.float64]:
        """Constant magnetomotive force per branch, shape (n_branches,) [A]."""
        return np.array([branch.remanence for branch in self.branches], dtype=float)

    def mmf(self, fluxes: NDArray[np.float64], gap: float) -> NDArray[np.float64]:
        """Mmf of each branch [A] at branch fluxes [Wb], without eddy currents."""
        pairs = zip(self.branches, fluxes, strict=True)
        return np.array([float(b.law.mmf(f, gap)) - b.remanence for b, f in pairs])

    def slope(self, fluxes: NDArray[np.float64], gap: float) -> NDArray[np.float64]:
        """Differential reluctance of each branch [A/Wb] at branch fluxes [Wb]."""
        return np.array(
            [float(b.law.slope(f, gap)) for b, f in zip(self.branches, fluxes, strict=True)]
        )

    def energy(self, fluxes: NDArray[np.float64], gap: float) -> float:
        """Stored energy [J] at branch fluxes [Wb]."""
        pairs = zip(self.branches, fluxes, strict=True)
        return float(sum(float(b.law.energy(f, gap)) - b.remanence * f for b, f in pairs))

    def force(self, fluxes: NDArray[np.float64], gap: float) -> float:
        """Force along the working gap, -dW/dx at constant flux [N]; negative closes the gap."""
        pairs = zip(self.branches, fluxes, strict=True)
        return -float(sum(float(b.law.energy_slope(f, gap)) for b, f in pairs))
