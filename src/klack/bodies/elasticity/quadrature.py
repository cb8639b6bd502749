"""Integration points of every element family, for stiffness and for mass.

Exact for mass and stiffness of straight-sided elements, except where 1/r enters (axisymmetric hoop
strain) and for distorted hexes, wedges and quads; those converge. All weights are positive: the
mass matrix is positive definite on any valid element.

Triangle rules: Dunavant 1985.  Tetrahedron, 14 points, degree 5: Walkington 2000.
"""

from collections.abc import Callable
from functools import cache
from itertools import permutations
from math import sqrt
from typing import Literal

import numpy as np
from numpy.typing import NDArray

__all__ = ["Purpose", "quadrature"]

Purpose = Literal["stiffness", "mass"]
Rule = tuple[NDArray[np.float64], NDArray[np.float64]]
Choice = tuple[Callable[[], Rule], Callable[[], Rule]]


def quadrature(family: str, purpose: Purpose) -> Rule:
    """Points (q, d) and weights (q,) on the reference element, whose measure they add up to.

    Parameters
    ----------
    family
        Key of :data:`klack.mesh.families.FAMILIES`.
    purpose
        ``"mass"`` also serves for surface integrals of products of shape functions.

    Examples
    --------
    >>> xi, w = quadrature("tet10", "stiffness")
    >>> xi.shape, round(float(w.sum()) * 6, 12)
    ((4, 3), 1.0)
    """
    xi, w = _rule(family, purpose == "mass")
    return xi.copy(), w.copy()


@cache
def _rule(family: str, mass: bool) -> Rule:
    stiffness_rule, mass_rule = _CHOICE[family]
    return mass_rule() if mass else stiffness_rule()


def _line(points: int) -> Rule:
    xi, w = np.polynomial.legendre.leggauss(points)
    return xi[:, None], w


def _tensor(*rules: Rule) -> Rule:
    """Product rule; the coordinates of the first rule come first."""
    xi, w = rules[0]
    for more_xi, more_w in rules[1:]:
        xi = np.hstack([np.repeat(xi, len(more_w), axis=0), np.tile(more_xi, (len(w), 1))])
        w = np.outer(w, more_w).ravel()
    return xi, w


def _symmetric(measure: float, *orbits: tuple[float, tuple[float, ...]]) -> Rule:
    """Simplex rule from weights (adding up to 1) and one barycentric point per orbit."""
    xi, w = [], []
    for weight, point in orbits:
        images = sorted(set(permutations(point)))
        xi += [image[1:] for image in images]
        w += [weight * measure] * len(images)
    return np.array(xi), np.array(w)


def _triangle(degree: int) -> Rule:
    if degree == 2:
        return _symmetric(0.5, (1 / 3, (1 / 6, 1 / 6, 2 / 3)))
    if degree == 4:
        a, b = 0.44594849091596488632, 0.091576213509770743460
        return _symmetric(
            0.5,
            (0.22338158967801146570, (a, a, 1 - 2 * a)),
            (0.10995174365532186764, (b, b, 1 - 2 * b)),
        )
    a, b = 0.24928674517091042129, 0.063089014491502008340  # degree 6
    c, d = 0.053145049844816947353, 0.31035245103378440542
    return _symmetric(
        0.5,
        (0.11678627572637936603, (a, a, 1 - 2 * a)),
        (0.050844906370206816921, (b, b, 1 - 2 * b)),
        (0.082851075618373575194, (c, d, 1 - c - d)),
    )


def _tetrahedron(degree: int) -> Rule:
    if degree == 1:
        return np.full((1, 3), 0.25), np.array([1 / 6])
    if degree == 2:
        a = (5 - sqrt(5)) / 20
        return _symmetric(1 / 6, (0.25, (a, a, a, 1 - 3 * a)))
    a, b = 0.31088591926330060980, 0.092735250310891226402  # degree 5
    c = 0.045503704125649649492
    return _symmetric(
        1 / 6,
        (0.11268792571801585080, (a, a, a, 1 - 3 * a)),
        (0.073493043116361949544, (b, b, b, 1 - 3 * b)),
        (0.042546020777081466438, (c, c, 0.5 - c, 0.5 - c)),
    )


def _same(rule: Callable[[], Rule]) -> Choice:
    return rule, rule


_CHOICE: dict[str, Choice] = {
    "line2": _same(lambda: _line(2)),
    "line3": _same(lambda: _line(3)),
    # the radius raises the degree by one, the hoop strain brings 1/r
    "tri3": _same(lambda: _triangle(4)),
    "tri6": _same(lambda: _triangle(6)),
    "quad4": (lambda: _tensor(_line(2), _line(2)), lambda: _tensor(_line(3), _line(3))),
    "quad8": _same(lambda: _tensor(_line(3), _line(3))),
    "tet4": (lambda: _tetrahedron(1), lambda: _tetrahedron(2)),
    "tet10": (lambda: _tetrahedron(2), lambda: _tetrahedron(5)),
    "hex8": (
        lambda: _tensor(_line(2), _line(2), _line(2)),
        lambda: _tensor(_line(3), _line(3), _line(3)),
    ),
    "hex20": _same(lambda: _tensor(_line(3), _line(3), _line(3))),
    "wedge6": (lambda: _tensor(_triangle(2), _line(2)), lambda: _tensor(_triangle(4), _line(3))),
    "wedge15": _same(lambda: _tensor(_triangle(4), _line(3))),
}
