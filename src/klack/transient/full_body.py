"""One body of a full-order impact: its state, and what one step does to it.

The equations are those of :mod:`klack.transient.full_order`.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from klack.elasticity.body import ElasticBody
from klack.elasticity.factorization import Backend, Factorization, Precision, factorize
from klack.errors import InputError
from klack.transient.body_damping import BodyDamping, DampingMatrix, LowRankSolve
from klack.transient.inertia import InverseMass, massless_nodes
from klack.transient.interface_solve import InterfaceSolve, interface_solve

__all__ = ["FullBody", "Scheme"]

Scheme = Literal["contact-stabilised-newmark", "massless"]


class FullBody:
    """State of one body on its free degrees of freedom, and what one step does to it."""

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
        S = self.M * (4.0 / step**2) + self.K
        if self.damping is not None:
            self.C = DampingMatrix.of(self.damping, self.body, csr_array(M))
            S = S + self.C.sparse * (2.0 / step)
        self.factor = factorize(csr_array(S), backend=backend, threads=threads, precision=precision)
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
        """Free flight w of this step; gaps and offsets change by its return value [m]."""
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
        """Make the end of the step the new state.

        Parameters
        ----------
        lam : array, shape (nc,) or with those across the normals [N]
            Forces that :meth:`complete` was given.

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
        elastic = self.K @ change
        defect = (4.0 / self.step**2) * (self.M @ change) + elastic
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

    def across(self, velocity: tuple[float, float]) -> NDArray[np.float64]:
        """Rigid motion along x and y [m/s].

        Raises
        ------
        InputError
            For an axisymmetric body, or one that something holds sideways.
        """
        if not any(velocity):
            return np.zeros(len(self.free))
        direction = self.free % self.dimension
        if self.dimension < 3 or np.count_nonzero(direction < 2) < 2 * (self.dof_count // 3):
            raise InputError(
                f"simulate_full_order: sideways motion of body '{self.name}'",
                got=f"({velocity[0]:g}, {velocity[1]:g}) m/s",
                expected="(0, 0) m/s for an axisymmetric body, or one that is held sideways",
                hint="model a solid that is free to move across the axis.",
            )
        return np.array([*velocity, 0.0])[direction]

    def refresh(self) -> None:
        """Take K u and K v, which every step only adds to, from K itself."""
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
        """Return the true velocity of the free degrees of freedom [m/s]."""
        if self.inverse_mass is None:
            return self.v
        return self.v - self.inverse_mass.solve(self.G_transposed @ y)

    def whole(self, field: NDArray[np.float64]) -> NDArray[np.float64]:
        """Insert the fixed degrees of freedom into a field."""
        out = np.zeros(self.dof_count)
        out[self.free] = field
        return out
