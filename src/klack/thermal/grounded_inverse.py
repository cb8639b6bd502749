"""Inverse of a network of conductances, found without a subtraction."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["grounded_inverse"]

Array = NDArray[np.float64]


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
