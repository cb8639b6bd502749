"""Exact steps of a linear heat network under heat flows that run straight in time."""

from dataclasses import dataclass
from functools import lru_cache
from math import factorial

import numpy as np
from numpy.typing import NDArray

from klack.thermal.heat_network import HeatNetwork, Links

__all__ = ["HeatStep", "grounded_inverse", "heat_step", "in_balance", "steady_temperature"]

Array = NDArray[np.float64]

_SERIES = 1.0  # below it, quotients of differences lose digits
_TERMS = 20


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeatStep:
    """End of a step, and where the heat went.

    Parameters
    ----------
    temperature (n,) [K]
    supplied (n,) [J]
        Heat into each free node.
    stored (n,) [J]
        Rise of its store.
    given_off (f,) [J]
        Heat into each node of known temperature.
    """

    temperature: Array
    supplied: Array
    stored: Array
    given_off: Array

    @property
    def residual(self) -> float:
        """What does not balance [J]."""
        return float(self.supplied.sum() - self.stored.sum() - self.given_off.sum())


def heat_step(
    network: HeatNetwork, links: Links, start: Array, flow: tuple[Array, Array], length: float
) -> HeatStep:
    r"""Advance by ``length`` [s] under a heat flow that runs straight from one value to another.

    With the modes of :math:`C^{-1/2} G C^{-1/2}`, which decay as :math:`e^{-\lambda t}`, no step
    length and no ratio of time constants is too large.  They are taken from the inverse of :math:`G
    + C/h`, whose largest eigenvalues, the slow modes, are the exact ones.  Nodes without capacity
    follow at once.

    Parameters
    ----------
    start (n,) [K]
    flow (n,) [W]
        Into each free node, at the start and at the end of the step.
    length [s]
    """
    zero = network.fixed[0]
    known = network.fixed - zero
    held = network.capacity > 0.0
    C = network.capacity[held]
    slow, fast = np.flatnonzero(held), np.flatnonzero(~held)
    W, B = links.between, links.to_fixed
    down = W[np.ix_(fast, slow)]
    inner = grounded_inverse(W[np.ix_(fast, fast)], down.sum(axis=1) + B[fast].sum(axis=1))
    across = down.T @ inner
    joined = W[np.ix_(slow, slow)] + across @ down
    np.fill_diagonal(joined, 0.0)
    outward = B[slow] + across @ B[fast]
    root = np.sqrt(C)
    near = grounded_inverse(joined, outward.sum(axis=1) + C / length)
    mu, V = np.linalg.eigh(root[:, None] * near * root)
    z = np.maximum(length / np.maximum(mu, np.finfo(float).tiny) - 1.0, 0.0)
    first, last = (V.T @ ((q[slow] + across @ q[fast] + outward @ known) / root) for q in flow)
    y = V.T @ (root * (start[slow] - zero))
    one, two, three = (_phi(k, z) for k in (1, 2, 3))
    end = np.exp(-z) * y + length * (one * first + two * (last - first))
    over = length * (one * y + length * (two * first + three * (last - first)))

    def everywhere(modes: Array, q: Array, scale: float) -> Array:
        """Temperatures of all nodes from the modes, above zero."""
        found = np.empty(network.count)
        found[slow] = (V @ modes) / root
        found[fast] = inner @ (q[fast] + down @ found[slow] + scale * (B[fast] @ known))
        return found

    supplied = 0.5 * length * (flow[0] + flow[1])
    rise = everywhere(end, flow[1], 1.0)
    sums = everywhere(over, supplied, length)
    stored = network.capacity * (rise - (start - zero))
    given_off = np.array(
        [B[:, j] @ (sums - length * known[j]) for j in range(len(known))], dtype=float
    )
    return HeatStep(temperature=zero + rise, supplied=supplied, stored=stored, given_off=given_off)


def in_balance(network: HeatNetwork, links: Links, start: Array, flow: Array) -> Array:
    """Temperatures [K] with those of nodes without capacity in balance with the others."""
    zero = network.fixed[0]
    held = network.capacity > 0.0
    slow, fast = np.flatnonzero(held), np.flatnonzero(~held)
    down, B = links.between[np.ix_(fast, slow)], links.to_fixed[fast]
    inner = grounded_inverse(links.between[np.ix_(fast, fast)], down.sum(axis=1) + B.sum(axis=1))
    found = start.copy()
    found[fast] = zero + inner @ (
        flow[fast] + down @ (start[slow] - zero) + B @ (network.fixed - zero)
    )
    return found


def steady_temperature(
    network: HeatNetwork, links: Links, start: Array, flow: Array
) -> Array | None:
    """Temperatures [K] at which all heat is given off; None where some of it has no way out.

    An island without path and heat comes to its mean temperature.
    """
    zero = network.fixed[0]
    found = np.full(network.count, np.nan)
    floating = {node for nodes in network.floating for node in nodes}
    for nodes in network.floating:
        here = list(nodes)
        if flow[here].any():
            return None
        weight = network.capacity[here]
        found[here] = float(weight @ start[here] / weight.sum())
    rest = [i for i in range(network.count) if i not in floating]
    B = links.to_fixed[rest]
    inverse = grounded_inverse(links.between[np.ix_(rest, rest)], B.sum(axis=1))
    found[rest] = zero + inverse @ (flow[rest] + B @ (network.fixed - zero))
    return found


def _phi(k: int, z: Array) -> Array:
    r"""Function :math:`\varphi_k(-z)` of exponential integrators.

    phi_0 is ``exp(-z)``, phi_k is ``(1/(k - 1)! - phi_{k-1})/z``.

    >>> [round(float(_phi(k, np.array([2.0]))[0]), 6) for k in (1, 2, 3)]
    [0.432332, 0.283834, 0.108083]
    """
    small = z < _SERIES
    low = np.where(small, z, 0.0)
    series = sum((-low) ** j * _inverse_factorial(j + k) for j in range(_TERMS))
    high = np.where(small, 1.0, z)
    found = np.exp(-high)
    for j in range(1, k + 1):
        found = (_inverse_factorial(j - 1) - found) / high
    return np.where(small, series, found)


@lru_cache
def _inverse_factorial(k: int) -> float:
    return 1.0 / factorial(k)


def grounded_inverse(links: Array, ground: Array) -> Array:
    r"""Temperatures of all nodes over 1 W into each of them (n, n) [K/W], the ground at zero.

    .. math:: (\mathrm{diag}(g + \sum_j W_{ij}) - W)^{-1}

    Nodes are removed by the star-mesh transform.  Only sums, products and quotients of positive
    numbers occur, so that every entry is exact to some units in the last place however far the
    conductances are apart; a factorisation of the matrix would lose a ground of 1 mW/K beside a
    link of 1 GW/K.

    Parameters
    ----------
    links (n, n) [W/K]
        Symmetric, not below 0, its diagonal 0.
    ground (n,) [W/K]
        Not below 0; above 0 somewhere in every island.

    Returns
    -------
    array, shape (n, n) [K/W]

    Sources: Grassmann, Taksar and Heyman, Oper. Res. 33 (1985) 1107; Alfa, Xue and Ye, Math. Comp.
    71 (2002) 217.

    Examples
    --------
    >>> links = np.array([[0.0, 1e9], [1e9, 0.0]])
    >>> grounded_inverse(links, np.array([1e-3, 0.0])).round(9).tolist()
    [[1000.0, 1000.0], [1000.0, 1000.000000001]]
    """
    count = len(ground)
    W, g, X = links.copy(), ground.copy(), np.eye(count)
    pivot = np.empty(count)
    for k in range(count):
        rest = slice(k + 1, count)
        pivot[k] = g[k] + W[k, rest].sum()
        share = W[rest, k] / pivot[k]
        W[rest, rest] += np.outer(share, W[k, rest])
        g[rest] += share * g[k]
        X[rest] += np.outer(share, X[k])
    for k in reversed(range(count)):
        X[k] = (X[k] + W[k, k + 1 :] @ X[k + 1 :]) / pivot[k]
    return X
