r"""One body of a full-order impact (:mod:`klack.transient.full_order`).

Whether bodies that have parted meet again follows from their linear motion.

Without forces a step of the trapezoidal rule turns each mode by :math:`\theta = 2 \arctan(\omega h
/ 2)`, and rigid motion is straight.  So the gaps of all later steps are known, but for what the
known modes leave.  That rest keeps its energy *E* and changes the gap of a row *g* (Cauchy-Schwarz)
by no more than

.. math:: |g u| \le \sqrt{2 E c}, \qquad c = g K^+ g^T - \sum_i \frac{(g \varphi_i)^2}{\omega_i^2},

0.1 um for a needle and its seat of 87 000 unknowns, which part at 0.01 um a step and are let go
after 30 steps.

The mass matrix of a displacement element is the same for every direction, :math:`M = m \otimes I`,
so solves with it need only the scalar matrix *m* of one direction (d times fewer unknowns).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array, eye_array, kron, vstack

from klack.arrays import Floats
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.condensation import condensed_inverse
from klack.bodies.elasticity.cyclic import (
    CyclicFactorization,
    CyclicProducts,
    cyclic_factorization,
)
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.elasticity.factorization import (
    Backend,
    Factorization,
    Precision,
    chosen_backend,
    factorize,
)
from klack.errors import InputError, refuse_if
from klack.transient.body_damping import BodyDamping, DampingMatrix, LowRankSolve, sparse_damping
from klack.transient.interface_solve import InterfaceSolve, interface_solve

__all__ = [
    "FullBody",
    "InverseMass",
    "KnownBody",
    "Scheme",
    "massless_nodes",
    "open_gaps",
    "scalar_mass",
]


_BLOCK = 64


def scalar_mass(M: csr_array, dimension: int) -> csr_array:
    """Mass matrix of one direction, shape (n_nodes, n_nodes) [kg].

    Raises
    ------
    InputError
        If directions differ or are coupled, which they do in no displacement element.
    """
    m = csr_array(M[::dimension, ::dimension])
    difference = abs(M - kron(m, eye_array(dimension), format="csr"))
    refuse_if(
        difference.nnz and difference.max() > 1e-9 * abs(m).max(),
        "mass matrix",
        got="a mass that differs between directions or couples them",
        expected="the same mass matrix in every direction, as of displacement elements",
        hint="leave point masses and rotary inertias out of a full-order impact.",
    )
    return m


class InverseMass:
    """Solves with the mass matrix M (n_dof, n_dof) [kg] at sorted ``free`` degrees of freedom."""

    def __init__(
        self,
        M: csr_array,
        free: NDArray[np.int64],
        dimension: int,
        *,
        backend: Backend,
        threads: int | None,
    ) -> None:
        m = scalar_mass(M, dimension)
        self._parts: list[tuple[NDArray[np.int64], Factorization]] = []
        factors: dict[bytes, Factorization] = {}
        for direction in range(dimension):
            places = np.flatnonzero(free % dimension == direction)
            if not len(places):
                continue
            nodes = free[places] // dimension
            key = nodes.tobytes()
            if key not in factors:
                factors[key] = factorize(m[nodes][:, nodes], backend=backend, threads=threads)
            self._parts.append((places, factors[key]))

    def solve(self, B: NDArray[np.float64]) -> NDArray[np.float64]:
        """M^-1 B, shape (n_free,) or (n_free, k)."""
        X = np.zeros(B.shape)
        for places, factor in self._parts:
            X[places] = factor.solve(B[places])
        return X

    def mobility(self, G: csr_array, points: NDArray[np.int64]) -> NDArray[np.float64]:
        """Columns ``points`` of G M^-1 G^T, shape (nc, k) [1/kg], for G of shape (nc, n_free)."""
        columns = np.zeros((G.shape[0], len(points)))
        for places, factor in self._parts:
            part = csr_array(G[:, places])
            for start in range(0, len(points), _BLOCK):
                block = slice(start, start + _BLOCK)
                columns[:, block] += part @ factor.solve(part[points[block]].toarray().T)
        return columns

    def whole_mobility(self, G: csr_array) -> NDArray[np.float64]:
        """G M^-1 G^T, shape (nc, nc) [1/kg]: half the work of all its columns."""
        whole = np.zeros((G.shape[0],) * 2)
        for places, factor in self._parts:
            whole += condensed_inverse(factor, csr_array(G[:, places]))
        return whole

    def close(self) -> None:
        """Give the memory back."""
        for _, factor in self._parts:
            factor.close()


def massless_nodes(M: csr_array, nodes: NDArray[np.int64], dimension: int) -> csr_array:
    r"""Mass matrix [kg] without inertia at ``nodes``; theirs goes to their neighbours.

    The velocity of a node without mass is taken as a weighted mean W of its neighbours with mass:

    .. math:: \tilde m = T^T m \, T, \qquad T = [I; \, W], \qquad W_{ci} \propto |m_{ci}|

    (Khenous, Laborde & Renard 2008 on why; this redistribution is the simplest that keeps the
    matrix positive).  The total mass is kept exactly, its moments to the order of an element.
    """
    m = scalar_mass(M, dimension)
    light = np.zeros(m.shape[0], dtype=bool)
    light[nodes] = True
    weights = abs(m)[light][:, ~light]
    total = weights.sum(axis=1)
    refuse_if(
        np.any(total == 0.0),
        "massless contact nodes",
        got=f"{int(np.count_nonzero(total == 0.0))} contact nodes whose neighbours are all "
        "contact nodes",
        expected="elements below the contact surface",
        hint="use the scheme 'contact-stabilised-newmark', or a smaller reach.",
    )
    W = diags_array(1.0 / total) @ weights
    heavy = np.flatnonzero(~light)
    order = np.concatenate([heavy, np.flatnonzero(light)])
    T = vstack([eye_array(len(heavy)), W], format="csr")
    mean = T.T @ m[order][:, order] @ T
    place = csr_array(
        (np.ones(len(heavy)), (heavy, np.arange(len(heavy)))), shape=(len(light), len(heavy))
    )
    return csr_array(kron(place @ mean @ place.T, eye_array(dimension), format="csr"))


Scheme = Literal["contact-stabilised-newmark", "massless"]


class FullBody:
    """State of one body on its free degrees of freedom."""

    def __init__(
        self,
        body: ElasticBody,
        G: csr_array,
        role: str,
        damping: BodyDamping | None,
        spring: float = 0.0,
        T: csr_array | None = None,
    ) -> None:
        self.name = body.name
        self.role = role
        self.dimension = body.dimension
        self.free = np.asarray(body.free)
        self.dof_count = body.K.shape[0]
        if G is None or G.shape[1] != self.dof_count:
            raise InputError(
                f"simulate_full_order: contact space of body {role} ('{body.name}')",
                got="no contact rows" if G is None else f"rows for {G.shape[1]} degrees of freedom",
                expected=f"rows for its {self.dof_count} degrees of freedom",
                hint="build the contact space from the meshes of these two bodies, a first.",
            )
        ways = max(1, self.dimension - 1)
        if T is not None and T.shape != (ways * G.shape[0], self.dof_count):
            raise InputError(
                f"simulate_full_order: friction of body {role} ('{body.name}')",
                got=f"{T.shape[0]} rows for {T.shape[1]} degrees of freedom",
                expected=f"{ways * G.shape[0]} rows, {ways} for each contact point, for "
                f"{self.dof_count} degrees of freedom",
                hint="build the friction from the same contact points and meshes.",
            )
        axis = np.zeros(self.dof_count)
        axis[self.dimension - 1 :: self.dimension] = 1.0
        fixed = np.ones(self.dof_count, dtype=bool)
        fixed[self.free] = False
        self.supported = bool(np.any(fixed & (axis > 0)))
        # a body that continues beyond its mesh does not move as a whole
        self.endless = damping is not None and damping.ends is not None
        self.whole_mass = csr_array(body.M)
        self.body, self.damping, self.spring = body, damping, spring
        self.C: DampingMatrix | None = None
        self.K = csr_array(body.K)[self.free][:, self.free]
        self.G = csr_array(G)[:, self.free]
        # what the contact forces act on: the gaps, then the slips where there is friction
        self.rows = self.G if T is None else vstack([self.G, T[:, self.free]], format="csr")
        self.contact_nodes = np.unique(csr_array(G).indices // self.dimension).astype(np.int64)
        self.axis = axis[self.free]
        self.mass = float(axis @ (self.whole_mass @ axis))
        self.full_axis = axis
        self.force = np.zeros(len(self.free))
        self.u = np.zeros(len(self.free))
        self.v = np.zeros(len(self.free))
        self.elastic = np.zeros(len(self.free))  # K u
        self.elastic_rate = np.zeros(len(self.free))  # K v
        self.defect = np.zeros(len(self.free))  # that all steps so far have left [N]
        self.factor: Factorization | None = None
        self._sectors: CyclicProducts | None = None
        self.inverse_mass: InverseMass | None = None
        self.light = np.empty(0, dtype=np.int64)

    def set_up(
        self, step: float, scheme: Scheme, backend: Backend, precision: Precision, threads: int
    ) -> None:
        """Factorise."""
        self.step = step
        M = self.whole_mass
        if scheme == "massless":
            M = massless_nodes(M, self.contact_nodes, self.dimension)
            self.light = np.flatnonzero(np.isin(self.free // self.dimension, self.contact_nodes))
        else:
            self.inverse_mass = InverseMass(
                M, self.free, self.dimension, backend=backend, threads=threads
            )
        self.M = csr_array(M)[self.free][:, self.free]
        self.axial_mass = (csr_array(M) @ self.full_axis)[self.free]
        self.G_transposed = csr_array(self.G.T)
        self.rows_transposed = csr_array(self.rows.T)
        self.G_axis = self.G @ self.axis
        self.mobility = np.zeros((self.G.shape[0],) * 2)
        self.mobility_known = False
        S = csr_array(M * (4.0 / step**2) + self.body.K)
        if self.damping is not None:
            self.C = DampingMatrix.of(self.damping, self.body, csr_array(M))
            S = csr_array(S + sparse_damping(self.damping, self.body, csr_array(M)) * (2.0 / step))
        self.factor = self._factorise(S, backend, precision, threads)
        if isinstance(self.factor, CyclicFactorization):
            self._sectors = self.factor.products([csr_array(self.body.K), csr_array(M)])
        self.solve: InterfaceSolve = interface_solve(self.factor, self.rows)
        columns, weight = [np.zeros((len(self.free), 0))], [np.zeros(0)]
        if self.C is not None:
            columns.append(self.C.columns)
            weight.append(2.0 / step * self.C.rate)
        if self.spring > 0.0:
            columns.append((self.axial_mass / self.mass)[:, None])
            weight.append(np.array([self.spring]))
        if sum(len(part) for part in weight):
            Z, D = np.hstack(columns), np.concatenate(weight)
            self.solve = LowRankSolve(self.solve, self.factor, self.rows, Z, D)

    def _factorise(
        self, S: csr_array, backend: Backend, precision: Precision, threads: int
    ) -> Factorization:
        """Factorise S in equal sectors where it has them, else its free part as a whole."""
        if self.dimension == 3 and chosen_backend(backend) == "pardiso":
            factor = cyclic_factorization(S, self.body.mesh.points, self.body.fixed, precision)
            if factor is not None:
                return factor
        S = csr_array(S[self.free][:, self.free])
        return factorize(S, backend=backend, threads=threads, precision=precision)

    def learn(self, points: NDArray[np.int64], rows: NDArray[np.int64]) -> None:
        """Compute the response to contact points, with these rows, that come near first."""
        self.solve.learn(rows)
        if self.inverse_mass is None or self.mobility_known:
            return
        self.mobility_known = 2 * len(points) >= len(self.mobility)
        if self.mobility_known:  # half the work for each point
            self.mobility = self.inverse_mass.whole_mobility(self.G)
            return
        columns = self.inverse_mass.mobility(self.G, points)
        self.mobility[:, points] = columns
        self.mobility[points] = columns.T

    def close(self) -> None:
        """Give the memory of the factors back."""
        if self.factor is not None:
            self.factor.close()
        if self.inverse_mass is not None:
            self.inverse_mass.close()

    def fly(self) -> NDArray[np.float64]:
        """Free flight w of this step; returns the change of gaps and offsets [m]."""
        self.w = self.u + self.step * self.v
        self.resistance = 2.0 * self.elastic + self.step * self.elastic_rate
        if self.C is not None:
            self.drag = self.C.force(self.v)
            self.resistance += 2.0 * self.drag
        if self.spring > 0.0:
            both = float(self.axial_mass @ (self.u + self.w)) / self.mass
            self.resistance += self.axial_mass * (self.spring / self.mass * both)
        return self.rows @ self.w

    def predict(self, push: NDArray[np.float64]) -> NDArray[np.float64]:
        """First half of the solve; returns the change of the watched gaps and offsets."""
        self.right = 2.0 * self.force - self.resistance + self.rows_transposed @ push
        self.solve.predict(self.right - self.defect)
        return self.solve.response()

    def complete(self, lam: NDArray[np.float64]) -> NDArray[np.float64]:
        """Second half; returns the change of all gaps and offsets since the start of the run."""
        self.change = self.solve.complete(lam)
        self.next = self.w + self.change
        return self.rows @ self.next

    def commit(self, lam: NDArray[np.float64]) -> tuple[float, float, float]:
        """Make the end of the step the new state; ``lam`` [N] as given to :meth:`complete`.

        Returns
        -------
        damped : float [J]
            Energy that the damping took.
        radiated : float [J]
            Energy that left through non-reflecting ends.
        rounded : float [J]
            Energy that the defect of the solve gave.
        """
        moved, change = self.next - self.u, self.change
        elastic, inertia = self._sectors(change) if self._sectors else self._products(change)
        defect = (4.0 / self.step**2) * inertia + elastic
        defect -= self.right + self.rows_transposed @ lam
        damped = radiated = 0.0
        if self.C is not None:
            drag = self.C.force(moved)
            if self.C.ends is not None:
                radiated = float(moved @ (self.C.ends @ moved)) / self.step
            damped = float(moved @ drag) / self.step - radiated
            defect += (2.0 / self.step) * (drag - self.step * self.drag)
        if self.spring > 0.0:
            along = float(self.axial_mass @ change) / self.mass
            defect += self.axial_mass * (self.spring / self.mass * along)
        # the solve had the former defect on its right-hand side: that is paid back
        rounded = 0.5 * float(defect @ moved)
        self.defect += defect
        self.v = self.v + (2.0 / self.step) * change
        self.u = self.next
        self.elastic += self.step * self.elastic_rate + elastic
        self.elastic_rate += (2.0 / self.step) * elastic
        if len(self.light):
            self.v[self.light] = moved[self.light] / self.step
            self.refresh()
        return damped, radiated, rounded

    def _products(self, x: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        return [self.K @ x, self.M @ x]

    def across(self, velocity: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rigid motion (6,) [m/s], [rad/s] about the centre of mass.

        Raises
        ------
        InputError
            For an axisymmetric body, or one held sideways.
        """
        if not np.any(velocity):
            return np.zeros(len(self.free))
        direction = self.free % self.dimension
        refuse_if(
            self.dimension < 3 or np.count_nonzero(direction < 2) < 2 * (self.dof_count // 3),
            f"simulate_full_order: sideways motion of body '{self.name}'",
            got=f"({velocity[0]:g}, {velocity[1]:g}) m/s, spin "
            f"{np.linalg.norm(velocity[3:]):g} rad/s",
            expected="none for an axisymmetric body, or for one held sideways",
            hint="model a solid that is free to move across the axis.",
        )
        arm = self.body.mesh.points - self.body.centre_of_mass
        field = velocity[:3] + np.cross(velocity[3:], arm)
        return np.asarray(field.ravel()[self.free])

    def rigid_velocity(self, field: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rigid motion (6,) [m/s], [rad/s] with the momenta of a whole field."""
        body, d = self.body, self.dimension
        momentum = (self.whole_mass @ field).reshape(-1, d)
        out = np.zeros(6)
        if d < 3:
            out[2] = momentum[:, -1].sum() / body.mass
        else:
            out[:3] = momentum.sum(axis=0) / body.mass
            turning = np.cross(body.mesh.points - body.centre_of_mass, momentum).sum(axis=0)
            out[3:] = np.linalg.lstsq(body.inertia, turning, rcond=None)[0]  # of a point: none
        return out

    def refresh(self) -> None:
        """Recompute K u and K v, which every step only adds to."""
        self.elastic = self.K @ self.u
        self.elastic_rate = self.K @ self.v

    def kinetic(self, y: NDArray[np.float64]) -> float:
        """Kinetic energy [J]; the true velocity is v - M^-1 G^T y."""
        return float(
            0.5 * self.v @ (self.M @ self.v) - y @ (self.G @ self.v) + 0.5 * y @ (self.mobility @ y)
        )

    def strain(self) -> float:
        """Strain energy [J]."""
        return 0.5 * float(self.u @ self.elastic)

    def centre_velocity(self, y: NDArray[np.float64]) -> float:
        """Velocity of the centre of mass along z [m/s], from the momentum."""
        return float(self.axial_mass @ self.v - self.G_axis @ y) / self.mass

    def centre(self) -> float:
        """Displacement of the centre of mass along z [m]."""
        return float(self.axial_mass @ self.u) / self.mass

    def velocity(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """True velocity of the free degrees of freedom [m/s]."""
        if self.inverse_mass is None:
            return self.v
        return self.v - self.inverse_mass.solve(self.G_transposed @ y)

    def whole(self, field: NDArray[np.float64]) -> NDArray[np.float64]:
        """Insert the fixed degrees of freedom into a field."""
        out = np.zeros(self.dof_count)
        out[self.free] = field
        return out


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownBody:
    """Known properties of a body.

    Parameters
    ----------
    modes
        Converged elastic modes: the more, the sooner a run can end.
    compliance (nc,) [m/N]
        Static one at each contact point.
    """

    modes: Modes
    compliance: Floats


def open_gaps(
    bodies: Sequence[FullBody],
    known: Sequence[KnownBody],
    at_rest: Floats,
    y: Floats,
    *,
    steps: int,
    slack: float,
) -> Floats | None:
    """Gaps of bodies without forces, now and after each further step; None if one may close.

    The gaps (nc, steps + 1) [m] lack the share of the rest, which the bound limits.

    Parameters
    ----------
    bodies, known
        One or two, in the same order; without damping and springs.
    at_rest (nc,) [m]
        Gaps without displacement.
    y (nc,)
        Contact-sized part of the velocity, as of :meth:`FullBody.velocity`.
    slack [m]
        What gaps have to stay wider than, besides the bound of the rest.
    """
    gaps, most = at_rest[:, None], np.zeros(len(at_rest))
    for body, one in zip(bodies, known, strict=True):
        course, bound = _course(body, one, y, steps)
        gaps, most = gaps + course, most + bound
    return gaps if np.all(gaps > (most + slack)[:, None]) else None


def _course(body: FullBody, known: KnownBody, y: Floats, steps: int) -> tuple[Floats, Floats]:
    """Share of one body in the gaps (nc, steps + 1), and bound of its rest (nc,) [m]."""
    rigid, shapes = body.body.rigid_modes[body.free], known.modes.shapes[body.free]
    omega, since = known.modes.omega, body.step * np.arange(steps + 1)
    u, v = body.u, body.velocity(y)
    Mu, Mv = body.M @ u, body.M @ v
    drifts = (rigid.T @ Mu)[:, None] + (rigid.T @ Mv)[:, None] * since
    q, p = shapes.T @ Mu, shapes.T @ Mv
    angle = 2.0 * np.arctan(0.5 * body.step * omega)[:, None] * np.arange(steps + 1)
    turns = q[:, None] * np.cos(angle) + (p / omega)[:, None] * np.sin(angle)
    rows = body.G @ shapes
    u = u - rigid @ drifts[:, 0] - shapes @ q
    v = v - rigid @ (rigid.T @ Mv) - shapes @ p
    twice = float(u @ (body.K @ u) + v @ (body.M @ v))
    left = np.maximum(known.compliance - np.sum((rows / omega) ** 2, axis=1), 0.0)
    return (body.G @ rigid) @ drifts + rows @ turns, np.sqrt(twice * left)
