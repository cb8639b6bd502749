"""Contact problems with closed solutions, as finite-element models.

Two bodies of revolution so large that they act as half-spaces; the gap between them is a profile
over the radius.  Used by the checks and the tests of the contact.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.contact.mortar import ContactSpace, contact_space
from klack.contact.statics import StaticContact, contact_compliance, static_contact
from klack.elasticity.body import ElasticBody, elastic_body
from klack.elasticity.statics import Flexibility
from klack.materials import Material
from klack.mesh.mesh import Mesh
from klack.verification.lattice import lattice_mesh

__all__ = [
    "STEEL",
    "IndentationProblem",
    "graded_line",
    "half_spaces",
    "parabola",
    "sphere_on_cone",
    "uniform_compression",
]

Array = NDArray[np.float64]

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class IndentationProblem:
    """Two bodies and the contact points between them."""

    body_a: ElasticBody
    body_b: ElasticBody
    space: ContactSpace

    def compliance(self) -> Array:
        """Condensed static compliance of the contact points [m/N]."""
        with Flexibility(self.body_a) as a, Flexibility(self.body_b) as b:
            return contact_compliance(self.space, a, b)

    def solve(self, max_force: float, count: int = 24) -> StaticContact:
        """Solve the static contact up to an axial force [N]."""
        return static_contact(self.space, self.compliance(), max_force, count)


def graded_line(size: float, fine: float, far: float, growth: float = 1.3) -> Array:
    """Cell borders from 0: cells of ``size`` up to ``fine``, then growing up to ``far`` [m]."""
    x = list(size * np.arange(round(fine / size) + 1))
    step = size
    while x[-1] < far:
        step *= growth
        x.append(x[-1] + step)
    return np.array(x)


def parabola(radius: float, limit: float) -> Callable[[Array], Array]:
    """Gap x^2/(2 radius), continued straight beyond a distance ``limit`` [m]."""

    def profile(x: Array) -> Array:
        near = np.minimum(np.abs(x), limit)
        return near**2 / (2.0 * radius) + (np.abs(x) - near) * limit / radius

    return profile


def half_spaces(
    profile: Callable[[Array], Array],
    *,
    contact: float,
    cells: tuple[int, int],
    ring: float = 0.0,
    family: str = "quad8",
    far: float = 1000.0,
    reach: float,
) -> IndentationProblem:
    """Two steel half-spaces of revolution with a gap ``profile(r - ring)`` between them.

    Parameters
    ----------
    profile : function of distances [m] to gaps [m]
    contact : float [m]
        Expected half width of the contact.
    cells : pair of int
        Cells of a and of b per ``contact``.
    ring : float [m]
        Radius of the contact ring, 0 for a contact on the axis.
    family : str
        Axisymmetric element family.
    far : float
        Size of the bodies over ``contact`` (at least; on a ring twenty times ``ring``).
    reach : float [m]
    """
    size = max(far * contact, 20.0 * ring)
    bodies = []
    for sign, name, number in ((1.0, "upper", cells[0]), (-1.0, "lower", cells[1])):
        h = contact / number
        r = _radii(h, contact, ring, size)
        z = graded_line(h, contact, size)
        z = z if sign > 0 else -z[::-1]

        def shape(x: Array, sign: float = sign, end: float = float(np.abs(z).max())) -> Array:
            lift = profile(x[:, 0] - ring) * (1.0 - x[:, 1] / end) if sign > 0 else 0.0
            return np.column_stack([x[:, 0], x[:, 1] + lift])

        mesh = lattice_mesh(family, [r, z], shape)
        held = mesh.surface("top" if sign > 0 else "bottom").nodes
        bodies.append(elastic_body(name, mesh, {"solid": STEEL}, fixed_nodes=held))
    a, b = bodies
    surfaces = a.mesh.surface("bottom"), b.mesh.surface("top")
    space = contact_space(a.mesh, surfaces[0], b.mesh, surfaces[1], reach=reach)
    return IndentationProblem(body_a=a, body_b=b, space=space)


def _radii(h: float, contact: float, ring: float, size: float) -> Array:
    if ring == 0.0:
        return graded_line(h, 1.5 * contact, size)
    out = graded_line(h, 1.5 * contact, size)
    inward = ring - graded_line(h, 1.5 * contact, ring)
    inward = np.append(inward[inward > 3.0 * h], 0.0)
    return np.concatenate([inward[::-1], ring + out[1:]])


def uniform_compression(
    family_a: str, family_b: str, cells: tuple[int, int], *, skew: float = 0.0
) -> IndentationProblem:
    """Two unit cubes of steel on each other that can only be compressed uniformly.

    Rollers on both ends and on two sides.  An approach d gives the pressure E d/2 everywhere.

    Parameters
    ----------
    family_a, family_b : str
        Solid element families.
    cells : pair of int
        Cells per edge of a and of b; unequal ones do not match.
    skew : float [m]
        Amplitude by which inner nodes of a are displaced sideways.
    """

    def shape(x: Array) -> Array:
        wave = skew * np.sin(np.pi * x[:, 0]) * np.sin(np.pi * x[:, 1])
        return x + wave[:, None] * np.array([1.0, 0.7, 0.0])

    bodies = []
    for family, number, low in ((family_a, cells[0], 1.0), (family_b, cells[1], 0.0)):
        side = np.linspace(0.0, 1.0, number + 1)
        mesh = lattice_mesh(family, [side, side, low + side], shape if low else lambda x: x)
        body = elastic_body("cube", mesh, {"solid": STEEL})
        end = mesh.surface("top" if low else "bottom").nodes
        rollers = (3 * end + 2, 3 * mesh.surface("left").nodes, 3 * mesh.surface("front").nodes + 1)
        fixed = np.unique(np.concatenate(rollers))
        bodies.append(ElasticBody(body.name, mesh, body.K, body.M, fixed))
    a, b = bodies
    surfaces = a.mesh.surface("bottom"), b.mesh.surface("top")
    space = contact_space(a.mesh, surfaces[0], b.mesh, surfaces[1], reach=0.1)
    return IndentationProblem(body_a=a, body_b=b, space=space)


def sphere_on_cone(
    family: str, layers: tuple[int, int], *, h: float = 0.06e-3, radius: float = 1e-3
) -> tuple[Mesh, Mesh, Callable[[Array], Array]]:
    """Spherical shell that touches a conical one of 45 deg along a ring; a third of the circle.

    Parameters
    ----------
    family : str
        Solid element family.
    layers : pair of int
        Element borders around the third of the circle, for the sphere and the cone.
    h : float [m]
        Element size along the meridian.
    radius : float [m]

    Returns
    -------
    sphere, cone : Mesh
        Touching with the surfaces bottom and top.
    exact : function of points (n, 3) on the sphere [m] to gaps [m] along its radius
    """
    ring = radius / np.sqrt(2.0)

    def revolved(r: Array, x: Array, z: Array) -> Array:
        return np.column_stack([r * np.cos(x[:, 1]), r * np.sin(x[:, 1]), z + x[:, 2]])

    def on_sphere(x: Array) -> Array:
        angle = np.pi / 4.0 + (x[:, 0] - ring) * np.sqrt(2.0) / radius
        return revolved(radius * np.sin(angle), x, -radius * np.cos(angle))

    def on_cone(x: Array) -> Array:
        return revolved(x[:, 0], x, x[:, 0] - np.sqrt(2.0) * radius)

    def exact(x: Array) -> Array:
        n = x / np.linalg.norm(x, axis=1, keepdims=True)
        sine, cosine = np.hypot(n[:, 0], n[:, 1]), -n[:, 2]
        return np.sqrt(2.0) * radius / (sine + cosine) - radius

    r = ring + h / np.sqrt(2.0) * np.arange(-2, 3)
    skin = np.array([0.0, h])
    around = [np.linspace(0.0, 2.0 * np.pi / 3.0, n) for n in layers]
    sphere = lattice_mesh(family, [r, around[0], skin], on_sphere)
    cone = lattice_mesh(family, [r + 0.2 * h, around[1], skin - h], on_cone)
    return sphere, cone, exact
