r"""Elements and branches as linear laws about a state: the limit of their own step functions.

A step function maps states, displacements and pressures of a step of length :math:`h` to forces,
flows and next states.  Its exact derivatives (:mod:`klack.machine.compiling.tangent_number`),

.. math:: s_1 = P s_0 + Q_0 y_0 + Q_1 y_1 + Q_p p, \qquad
          f = R s_0 + T_0 y_0 + T_1 y_1 + T_p p,

belong to the laws :math:`\dot s = a(s, y, v, p)`, :math:`f = f(s, y, v, p)` if all is taken in the
middle of the step: :math:`y_{0,1} = y \mp \tfrac12 h v`, :math:`s_{0,1} = s \mp \tfrac12 h \dot s`
give, with :math:`M = (1 + P)^{-1}`,

.. math::

    \dot s = \tfrac2h M\,[(P - 1)\,s + (Q_0 + Q_1)\,y + \tfrac12 h (Q_1 - Q_0)\,v + Q_p p].

For the implicit midpoint rule this is exact, for any other rule of second order two steps remove
the quadratic error, and their difference tells whether there is a limit.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numba.core.errors import NumbaError

from klack.arrays import Matrix, Vector
from klack.errors import ConvergenceError, InputError, refuse_if
from klack.machine.compiling.jit import njit
from klack.network.rows import BranchRow, ElementRow
from klack.network.step_function import address_of, call, first, is_step_function
from klack.simulation.tangent_loop import LANES, lanes_of, tangent_address

__all__ = ["LinearRow", "RowPoint", "linear_row"]


_MOVED = 1e-13  # [m] by which the point is left to both sides: laws may have a kink there
_SPEED = 1e-8  # [m/s] the same
_PRESSED = 1e-9  # of a pressure: the same
_KEPT = 0.5  # of a state after a step: what keeps less has no memory
_FELT = 1e-4  # of the effect of all that acts on a number
_SHARE = 1e-3  # of a state or pressure: a small change
_WAY = 1e-6  # [m] the same
_RATE = 1e4  # [1/s] ... and its speed
_WARMING = 12  # steps at rest, after which parts have forgotten that they have just begun


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RowPoint:
    """Where a row is linearised.

    Parameters
    ----------
    y [m]
        Of its ports.
    p, density, compressed [Pa], [kg/m^3], [kg/(m^3 Pa)]
        Of both nodes of a branch, with the slope of the density; empty for an element.
    inputs (inputs, parameters)
        Directions in which its parameters change.
    """

    row: ElementRow | BranchRow
    state: Vector
    y: Vector
    p: Vector
    density: Vector
    compressed: Vector
    inputs: Matrix

    @property
    def head(self) -> int:
        """Numbers of the output before the forces."""
        return 3 if isinstance(self.row, BranchRow) else 0

    def told(self, h: float, side: float) -> Vector:
        """Inputs of the step function for a step to one side of the point."""
        along = side * np.arange(1.0, self.y.size + 1.0)
        y, way = self.y + _MOVED * along, 0.5 * h * _SPEED * along
        rise = side * _PRESSED * self.p * np.where(np.arange(self.p.size) % 2, -1.0, 1.0)
        pairs = np.column_stack([y - way, y + way]).ravel()
        density = self.density + self.compressed * rise
        return np.concatenate([[0.0, h], self.p + rise, density, pairs])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearRow:
    """Linear law of a row; columns are kept states, ports, their speeds, pressures, inputs.

    Parameters
    ----------
    kept
        States that change what the row does.  Of states tied by a constraint (fluxes without eddy
        currents) some are left, less what the constraint makes of ports and pressures.
    rate (kept, columns)
        Their derivatives with time.
    acts (flows + forces, columns)
        Mass flow of a branch, then the forces.
    channels (channels, columns)
        Recorded states.
    doubt
        Difference between the laws of two steps, relative to the largest of their kind.
    kink
        The same between the laws to both sides of the point.
    """

    kept: tuple[int, ...]
    rate: Matrix
    acts: Matrix
    channels: Matrix
    doubt: float
    kink: float


@njit
def _ask(address: int, par: Vector, state: Vector, inp: Vector, out: Vector) -> int:
    return int(call(address, first(par), first(state), first(inp), first(out)))


def linear_row(at: RowPoint, h: float) -> LinearRow:
    """Linear law of a row, from steps of ``h`` and ``h / 2``.

    Raises
    ------
    InputError
        For a step function that is not compiled: it has no derivatives.
    ConvergenceError
        If the row refuses the step.
    """
    refuse_if(
        not is_step_function(at.row.step),
        f"components.{at.row.component}",
        got="a component that runs outside compiled code (Python, or an FMU)",
        expected="components with derivatives, for a linearisation",
        hint="replace it with springs, masses and forces of klack about this point.",
    )
    sides = []
    for step in (h, 0.5 * h):
        here = _warm(at, step)
        sides.append([_derivatives(here, step, side) for side in (1.0, -1.0)])
    kept = _kept(at, np.abs(sides[1][0]) + np.abs(sides[1][1]))
    right, left = (_law(at, d, kept, 0.5 * h) for d in sides[1])
    slow, quick = (
        _law(at, 0.5 * (d[0] + d[1]), kept, step)
        for d, step in zip(sides, (h, 0.5 * h), strict=True)
    )
    usual = _usual(at, quick[3])
    doubt = max(_apart(a, b, usual) for a, b in zip(slow[:2], quick[:2], strict=True))
    if slow[3] != quick[3]:
        slow, doubt = quick, 1.0
    rate, acts = ((4.0 * b - a) / 3.0 for a, b in zip(slow[:2], quick[:2], strict=True))
    return LinearRow(
        kept=quick[3],
        rate=rate,
        acts=acts,
        channels=2.0 * quick[2] - slow[2],
        doubt=doubt,
        kink=max(_apart(a, b, usual) for a, b in zip(left[:2], right[:2], strict=True)),
    )


def _warm(at: RowPoint, h: float) -> RowPoint:
    """The same point after some steps at rest."""
    row, state = at.row, at.state
    count = at.head + len(row.ports) + state.size + len(row.books)
    for _ in range(_WARMING if state.size else 0):
        out = np.zeros(count + 1)
        arrays = [np.append(x, 0.0) for x in (row.parameters, state, at.told(h, 0.0))]
        if _ask(address_of(row.step), *arrays, out) != 0:
            break
        state = out[_states_at(at)].copy()
    return replace(at, state=state)


def _apart(a: Matrix, b: Matrix, changes: Vector) -> float:
    """Largest relative difference of two laws.

    Numbers with less than 1e-4 of the effect of their row are left out: round-off.
    ``changes`` are usual ones of states, displacements, speeds, pressures and inputs.
    """
    if a.shape != b.shape:  # a state more, or less
        return 1.0
    if not a.size:
        return 0.0
    effect = np.max(np.abs(b) * changes, axis=1, keepdims=True)
    size = np.maximum(np.abs(b), _FELT * effect / changes)
    return float(np.max(np.abs(a - b) / np.where(size > 0.0, size, 1.0)))


def _usual(at: RowPoint, kept: tuple[int, ...]) -> Vector:
    states = _SHARE * np.abs(at.state[list(kept)])
    ports, inputs = at.y.size, len(at.inputs)
    return np.concatenate(
        [
            np.where(states > 0.0, states, _WAY),
            np.full(ports, _WAY),
            np.full(ports, _RATE * _WAY),
            _SHARE * at.p,
            np.ones(inputs),
        ]
    )


def _derivatives(at: RowPoint, h: float, side: float) -> Matrix:
    row = at.row
    told, first_port = at.told(h, side), 2 + 2 * at.p.size
    seeds: list[tuple[str, int, Vector | float]] = []
    seeds += [("state", j, 1.0) for j in range(at.state.size)]
    seeds += [("told", first_port + 2 * j, 1.0) for j in range(at.y.size)]
    seeds += [("told", first_port + 2 * j + 1, 1.0) for j in range(at.y.size)]
    seeds += [("pressure", j, 1.0) for j in range(at.p.size)]
    seeds += [("parameter", j, 1.0) for j in range(len(at.inputs))]
    count = at.head + len(row.ports) + at.state.size + len(row.books)
    found = np.zeros((count, len(seeds)))
    address = _address(row)
    for begin in range(0, max(len(seeds), 1), LANES - 1):
        part = seeds[begin : begin + LANES - 1]
        par, state, inp, out = (
            lanes_of((size + 1,)) for size in (row.parameters.size, at.state.size, told.size, count)
        )
        par[:-1, 0], state[:-1, 0], inp[:-1, 0] = row.parameters, at.state, told
        for lane, (kind, j, _) in enumerate(part, start=1):
            if kind == "state":
                state[j, lane] = 1.0
            elif kind == "told":
                inp[j, lane] = 1.0
            elif kind == "pressure":
                inp[2 + j, lane] = 1.0
                inp[2 + at.p.size + j, lane] = at.compressed[j]
            else:
                par[:-1, lane] = at.inputs[j]
        status = _ask(address, par.ravel(), state.ravel(), inp.ravel(), out.ravel())
        if status != 0:
            words = row.failures.get(status, f"status {status} of its step function")
            raise ConvergenceError(f"linearisation: {row.component}: {words}.")
        found[:, begin : begin + len(part)] = out[:count, 1 : 1 + len(part)]
    return found


def _address(row: ElementRow | BranchRow) -> int:
    try:
        return tangent_address(row.step)
    except NumbaError as error:
        raise InputError(
            f"components.{row.component}",
            got="a step function that cannot carry derivatives: "
            + " ".join(str(error).split())[:200],
            expected="arithmetic and functions of math that klack differentiates",
            hint="write it without ceil, floor and local arrays; int(x) rounds down.",
        ) from error


def _states_at(at: RowPoint) -> slice:
    begin = at.head + len(at.row.ports)
    return slice(begin, begin + at.state.size)


def _kept(at: RowPoint, d: Matrix) -> tuple[int, ...]:
    n, states = at.state.size, _states_at(at)
    P = d[states, :n]
    acting = np.vstack([d[:1] if at.head else d[:0], d[at.head : states.start]])
    shown = [c.index for c in at.row.channels if c.derived]
    matters = np.any(acting[:, :n] != 0.0, axis=0)
    matters |= np.any((P[shown] != 0.0) & ~np.eye(n, dtype=bool)[shown], axis=0)
    while True:
        more = matters | np.any((P != 0.0)[matters], axis=0)
        if np.array_equal(more, matters):
            break
        matters = more
    others = P - np.diag(np.diag(P))
    driven = np.any(d[states, n:] != 0.0, axis=1) | (np.diag(P) != 2.0)
    if isinstance(at.row, ElementRow):
        for inflow in at.row.inflows:
            driven[list(inflow.rates(at.state))] = True
    while True:
        more = driven | np.any((others != 0.0)[:, driven], axis=1)
        if np.array_equal(more, driven):
            break
        driven = more
    return tuple(int(j) for j in np.flatnonzero(matters & driven))


def _law(
    at: RowPoint, d: Matrix, kept: tuple[int, ...], h: float
) -> tuple[Matrix, Matrix, Matrix, tuple[int, ...]]:
    """Rates, forces and channels in the middle of a step; and the states that name them."""
    n, ports, k = at.state.size, at.y.size, list(kept)
    states = _states_at(at)
    acting = np.vstack([d[:1] if at.head else d[:0], d[at.head : states.start]])
    after = d[states]

    def others(block: Matrix) -> Matrix:
        """By displacement, speed, pressure and input."""
        y0, y1 = block[:, n : n + ports], block[:, n + ports : n + 2 * ports]
        return np.hstack([y0 + y1, 0.5 * h * (y1 - y0), block[:, n + 2 * ports :]])

    slow, fast, named = _split(after[np.ix_(k, k)])
    back = np.linalg.inv(np.hstack([slow, fast])) if k else np.zeros((0, 0))
    count = slow.shape[1]
    Q = back @ others(after[k])
    change = back @ (after[np.ix_(k, k)] - np.eye(len(k)))
    L = change[:count] @ slow  # next slow state less the present one
    M = np.linalg.inv(2.0 * np.eye(count) + L)
    pushed = M @ Q[:count]
    rate = (2.0 / h) * np.hstack([M @ L, pushed])
    follows = -np.linalg.solve(change[count:] @ fast, Q[count:])  # what has no memory
    start = np.hstack([slow @ (2.0 * M), -slow @ pushed + fast @ follows])

    def with_start(block: Matrix) -> Matrix:
        own = np.hstack([np.zeros((len(block), count)), others(block)])
        return np.asarray(block[:, k] @ start + own)

    told = with_start(after)
    channels = np.array([told[c.index] for c in at.row.channels]).reshape(-1, rate.shape[1])
    return rate, with_start(acting), channels, tuple(k[j] for j in named)


def _split(P: Matrix) -> tuple[Matrix, Matrix, list[int]]:
    """Bases of what a step keeps and of what it does not, and states that name the former.

    The trapezoidal rule reverses a constraint without memory, other rules forget it.
    """
    if not len(P):
        return np.zeros((0, 0)), np.zeros((0, 0)), []
    T, Z, count = scipy.linalg.schur(P, output="real", sort=lambda re, im: re > _KEPT)
    slow = Z[:, :count]
    fast = Z[:, count:]
    if 0 < count < len(P):
        fast = fast + slow @ scipy.linalg.solve_sylvester(
            T[:count, :count], -T[count:, count:], -T[:count, count:]
        )
    if not count:
        return slow, fast, []
    named = sorted(int(j) for j in scipy.linalg.qr(slow.T, pivoting=True, mode="r")[1][:count])
    return slow @ np.linalg.inv(slow[named]), fast, named
