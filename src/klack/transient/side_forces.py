r"""Forces of magnets and seats across the axis of a needle, in its rigid freedoms.

Each law gives force and moments :math:`f` on the four numbers :math:`u = A q` of the axis
(:mod:`klack.network.across`); the modes feel :math:`A^T f`.  It is constant over a macro step, with
the position (at the speed of the start), fluxes and pressures of its middle.  So its work is
:math:`f^T A\,\Delta q`, to round-off, displacement by a repair included.
"""

import warnings

import numpy as np

from klack.arrays import Vector
from klack.errors import AccuracyWarning, ConvergenceError
from klack.network.across import SideInputs
from klack.network.rows import SideRow
from klack.simulation.network_arrays import StepRows
from klack.simulation.network_compile import CompiledNetwork
from klack.transient.interface_model import InterfaceModel
from klack.units import format_si

__all__ = ["SideForces"]


_LEFT_OUT = 0.02  # of the reluctance of these gaps: about as much of the axial force


class SideForces:
    """Forces across the axis in one run.

    Parameters
    ----------
    ports (M, k)
        Shapes of the ports of the network.
    """

    def __init__(self, network: CompiledNetwork, model: InterfaceModel, ports: Vector) -> None:
        self.network, self.ports = network, ports
        self.rows: list[SideRow] = network.rows.sides
        R = model.rigid
        slope = np.vstack([R[4], -R[3]])
        self.height = float(model.centre[2]) if len(model.centre) == 3 else 0.0
        self.A = np.vstack([R[:2] - self.height * slope, slope])
        self.force = np.zeros((len(self.rows), 4))
        self.work = np.zeros(len(self.rows))
        self.push = np.zeros(model.mode_count)
        self.left_out = np.zeros(len(self.rows))

    @property
    def acts(self) -> bool:
        """Whether there is one."""
        return bool(self.rows)

    def begin(self, q: Vector, v: Vector, H: float, pressures: Vector, t: float) -> None:
        """Forces of a step of ``H`` [s] from ``t`` [s] on, and their modal force.

        Raises
        ------
        ConvergenceError
            Where faces meet, and the law ends.
        """
        if not self.rows:
            return
        middle = q + 0.5 * H * v
        for k, row in enumerate(self.rows):
            now = self._inputs(row, middle, 0.5 * H, pressures)
            _require_room(row, now, t)
            self.force[k] = row.law.force(now)
        self.push[:] = self.A.T @ self.force.sum(axis=0)

    def move(self, way: Vector) -> None:
        """Count the work of the step over this displacement of the modes."""
        if self.rows:
            self.work += self.force @ (self.A @ way)

    def place(self, q: Vector) -> None:
        """Give the rows the place of the axis in the step."""
        for row in self.rows:
            if row.placement >= 0:
                steps, k = self._row(row)
                at = row.law.placement(self.A @ q)
                begin = int(steps.parameter0[k]) + row.placement
                steps.parameters[begin : begin + len(at)] = at

    def now(self, q: Vector, t: float) -> Vector:
        """Forces and moments about the centre of mass (n, 4); an error as in :meth:`begin`."""
        told = np.zeros((len(self.rows), 4))
        for k, row in enumerate(self.rows):
            now = self._inputs(row, q, 0.0, self.network.node_state.p)
            _require_room(row, now, t)
            told[k] = row.law.force(now)
            told[k, 2:] -= self.height * told[k, :2]
            self.left_out[k] = max(self.left_out[k], row.law.left_out(now))
        return told

    def warn(self) -> None:
        """Warn of reluctances that the position changes, but not flux and axial force."""
        for row, share in zip(self.rows, self.left_out, strict=True):
            if share > _LEFT_OUT:
                warnings.warn(
                    f"'{row.component}': at the position of the needle, the air gaps that act "
                    f"across its axis have up to {100 * share:.2g} % less reluctance than "
                    "centred ones. Flux and axial force are computed without that. Give more "
                    "clearance, or less play in the guide.",
                    AccuracyWarning,
                    stacklevel=2,
                )

    def supplies(self) -> dict[str, float]:
        """Energies [J] that they supplied since the start of the run."""
        return {
            f"{row.component} side force": float(work)
            for row, work in zip(self.rows, self.work, strict=True)
        }

    def _row(self, row: SideRow) -> tuple[StepRows, int]:
        """Rows of the network that it belongs to, and its index."""
        if row.element >= 0:
            return self.network.elements, row.element
        return self.network.branches, row.branch

    def _inputs(self, row: SideRow, q: Vector, ahead: float, pressures: Vector) -> SideInputs:
        steps, k = self._row(row)
        y = np.append(self.ports.T @ q, 0.0)  # the ground does not move
        first, last = int(steps.port0[k]), int(steps.port0[k + 1])
        begin = int(steps.state0[k])
        p = np.zeros(2)
        if row.branch >= 0:
            p = pressures[[int(steps.a[k]), int(steps.b[k])]]
        return SideInputs(
            axis=self.A @ q,
            ports=y[steps.ports[first:last]],
            state=steps.state[begin : begin + int(steps.states[k])],
            ahead=ahead,
            pressures=p,
        )


def _require_room(row: SideRow, now: SideInputs, t: float) -> None:
    if row.law.room(now) > 0.0:
        return
    raise ConvergenceError(
        f"{row.component}: the needle is so far off-axis that the armature touches the iron around "
        f"it at {format_si(t, 's', 4)}.\nTry: a larger clearance of its magnetic gaps, or a guide "
        "that holds it."
    )
