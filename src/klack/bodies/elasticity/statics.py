r"""Static flexibility of a fixed or of a free body.

A fixed body answers a load with :math:`u = K^{-1} f`.  A free body under a constant load
accelerates; seen from its moving centre it takes the shape (inertia relief, Craig & Kurdila 2006,
ch. 17)

.. math:: u = P^T K^+ P f, \qquad P = 1 - M R R^T,

where P balances the load by the inertia forces of the rigid motion, and P^T takes the rigid motion
from the answer. K^+ may be any generalised inverse: here six degrees of freedom of three distant
nodes (one of a body of revolution, two in Fourier order 1) are held, without reaction since the
load is in balance.

A factorisation cannot be stored, but its answers can: with a cache, a body is factorised again
only for what the cache does not have.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise, product
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.bodies.elasticity.body import VibratingBody
from klack.bodies.elasticity.budget import WITHOUT, Budget
from klack.bodies.elasticity.condensation import condensed_inverse
from klack.bodies.elasticity.factor_memory import FactorMemoryError
from klack.bodies.elasticity.factorization import Backend, Factorization, chosen_backend, factorize
from klack.errors import ConvergenceError, InputError, refuse_if
from klack.files.closing import Closing
from klack.machine.cache.content import content_key
from klack.machine.cache.entry import Entry
from klack.machine.cache.remember import remembered
from klack.machine.cache.result_cache import ResultCache
from klack.machine.memory import require_memory

__all__ = ["Flexibility", "RefinedFactorization"]


_ENERGY = 1e-11  # error of a solution in the energy norm, relative
_ROUNDS = 40
_COLUMNS = 16  # at once: five blocks of them are held


class RefinedFactorization(Closing):
    r"""A :class:`~klack.bodies.elasticity.factorization.Factorization` that corrects a rough one.

    A factor :math:`\tilde L \tilde L^T \approx A` in single precision takes half the memory. For
    statics it is too rough: the smallest eigenvalues of a fine mesh are of the size of round-off.
    As a preconditioner of conjugate gradients it gives all digits, in the time of two to three
    solves in double precision: it pays only where memory decides.

    The iteration stops by the error in the energy,
    :math:`r^T A^{-1} r \approx r^T \tilde A^{-1} r` over :math:`x^T A x`.

    Parameters
    ----------
    rough
        In single precision; closed with this one.
    """

    def __init__(self, A: Any, rough: Factorization) -> None:
        self._A, self._rough = A, rough
        self.backend = f"{rough.backend}, single precision, refined"
        self.size = rough.size
        self.nonzeros = rough.nonzeros
        self.memory = rough.memory

    def solve(self, B: NDArray[np.float64]) -> NDArray[np.float64]:
        """Solve A X = B for one or several columns.

        Raises :class:`~klack.errors.ConvergenceError` if the factor is too rough.
        """
        B = np.asarray(B, dtype=np.float64)
        columns = B[:, None] if B.ndim == 1 else B
        X = np.empty(columns.shape, order="F")
        for at in range(0, columns.shape[1], _COLUMNS):
            X[:, at : at + _COLUMNS] = self._solve_block(columns[:, at : at + _COLUMNS])
        return X[:, 0] if B.ndim == 1 else X

    def _solve_block(self, B: NDArray[np.float64]) -> NDArray[np.float64]:
        """Preconditioned conjugate gradients, one recurrence for each column."""
        X = self._rough.solve(B)
        R = B - self._A @ X
        Z = self._rough.solve(R)
        whole = np.abs(_products(X, B))
        former, error = whole, _products(R, Z)
        P = Z
        for _ in range(_ROUNDS):
            # one more correction is there already, and gains what the last one has gained
            if np.all(error**2 <= _ENERGY**2 * whole * former):
                return X + Z
            image = self._A @ P
            step = _ratio(error, _products(P, image))
            X += P * step
            before, R = R, R - image * step
            Z = self._rough.solve(R)
            # the form of Polak and Ribiere allows for a preconditioner that rounds
            turn = _ratio(_products(Z, R - before), error)
            former, error = error, _products(R, Z)
            P = Z + P * np.maximum(turn, 0.0)
        raise ConvergenceError(
            f"solutions with a factor in single precision: {self.size} degrees of freedom did "
            f"not converge in {_ROUNDS} rounds.\n"
            "Try: a machine with twice the memory, or larger elements away from the contact."
        )

    def close(self) -> None:
        """Give the memory back to the system."""
        self._rough.close()


def _products(X: NDArray[np.float64], Y: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.einsum("ij,ij->j", X, Y)


def _ratio(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Quotients, 0 where a column is solved already."""
    return np.divide(a, b, out=np.zeros_like(a), where=b != 0.0)


def _rows(G: csr_array) -> list[bytes]:
    """Entries of each row, as a key."""
    rows = csr_array(G, copy=True)
    rows.sum_duplicates()
    columns, at = rows.indices.astype(np.int64), rows.indptr.tolist()
    return [columns[a:b].tobytes() + rows.data[a:b].tobytes() for a, b in pairwise(at)]


_CHUNK = 64
_COPIES = 2 * 12.0  # bytes for each entry of K: a copy, and what it passes through
_POSITIVE = Entry(arrays={}, text="positive definite")

Result = TypeVar("Result")


class Flexibility(Closing):
    """Elastic static response of a body to loads; one factorisation, many right-hand sides.

    Parameters
    ----------
    cache
        Keeps what :meth:`deflections` and :meth:`remembered` compute.
    budget
        What has to fit beside the factor. Where double precision does not, pardiso factors in
        single precision and solutions are refined (:class:`RefinedFactorization`).
    at_once
        Other bodies may be solved at the same time: ``threads`` leaves them their cores.
    loads (m, n_dof)
        One per row, known beforehand: their compliance comes with the factor, for a tenth of what
        solving for them takes. Only some solvers can; the others solve as for any load.
    """

    def __init__(
        self,
        body: VibratingBody,
        *,
        backend: Backend = "auto",
        threads: int | None = None,
        cache: ResultCache | None = None,
        budget: Budget = WITHOUT,
        at_once: bool = False,
        loads: csr_array | None = None,
    ) -> None:
        self.body, self.cache, self.at_once = body, cache, at_once
        self._budget = replace(budget, name=budget.name or body.name)
        self._backend, self._threads = backend, threads
        self._factor: Factorization | None = None
        self._closed = False
        self._loads = loads
        self._R = body.rigid_modes
        self._MR = body.M @ self._R
        self._kept = body.free
        if self._R.shape[1]:
            self._kept = np.setdiff1d(body.free, body.isostatic_support, assume_unique=True)
        # known to be positive definite, and most of what it is needed for is in the cache
        self.remembered("factorisation", (), self._check, lambda _: _POSITIVE, lambda _: None)

    @property
    def factorization(self) -> Factorization:
        """Made when first needed."""
        if self._closed:
            raise RuntimeError("this factorisation has been closed")
        if self._factor is None:
            require_memory(
                f"factorisation of body '{self.body.name}'",
                _COPIES * self.body.K.nnz,
                what=f"the stiffness of {len(self._kept)} degrees of freedom in the solver",
                hint="larger elements away from the contact, or a machine with more memory.",
            )
            K = self.body.K[self._kept][:, self._kept]
            loads = None if self._loads is None else csr_array(self._loads)[:, self._kept]
            self._factor = self.factorised(K, loads)
        return self._factor

    def factorised(self, K: csr_array, loads: csr_array | None = None) -> Factorization:
        """Factor of a positive definite matrix, as precise as fits; with known loads."""
        backend, threads, budget = self._backend, self._threads, self._budget
        try:
            return factorize(K, backend=backend, threads=threads, loads=loads, budget=budget)
        except FactorMemoryError as error:
            if chosen_backend(backend) != "pardiso":
                raise
            refused = error
        budget.tell(
            f"memory of '{budget.name}': got {refused.got}, expected {refused.expected}: the "
            "factor is computed in single precision, and solutions are refined"
        )
        try:
            rough = factorize(
                K, backend=backend, threads=threads, precision="single", budget=budget
            )
        except FactorMemoryError:
            raise
        except InputError as error:  # rounding has made it indefinite
            raise refused from error
        return RefinedFactorization(K, rough)

    @cached_property
    def key(self) -> str:
        """Key of everything that an answer depends on."""
        body = self.body
        return content_key(
            (body.K, body.M, body.fixed, body.mesh.points, body.dimension),
            (chosen_backend(self._backend), self._threads),
            *(() if self._loads is None else (self._loads,)),
        )

    def solve(self, F: NDArray[np.float64]) -> NDArray[np.float64]:
        """Displacements [m] under loads, column-major; of a free body without rigid motion.

        Parameters
        ----------
        F (n_dof,) or (n_dof, m) [N]
            Entries at fixed degrees of freedom are taken by the support.
        """
        F = np.asarray(F, dtype=np.float64)
        refuse_if(
            F.ndim not in (1, 2) or len(F) != self.body.dof_count,
            f"Flexibility of body '{self.body.name}': F",
            got=f"shape {F.shape}",
            expected=f"({self.body.dof_count},) or ({self.body.dof_count}, m)",
            hint="give one force per degree of freedom of the mesh, fixed ones included.",
        )
        U = np.zeros(F.shape, order="F")
        if F.ndim == 1:
            U[:] = self._solve_block(F[:, None])[:, 0]
        else:
            for at in range(0, F.shape[1], _CHUNK):
                U[:, at : at + _CHUNK] = self._solve_block(F[:, at : at + _CHUNK])
        return U

    def condensed(
        self, G: csr_array, groups: Sequence[NDArray[np.int64]] = ()
    ) -> NDArray[np.float64]:
        """Static compliance seen by given loads, G F G^T (m, m) [m/N]: half the work of solving.

        Of a free body, with :math:`A = G R` and :math:`Z = K^+ M R` (six columns),

        .. math:: G P^T K^+ P G^T = G K^+ G^T - A (G Z)^T - (G Z) A^T + A (R^T M Z) A^T .

        Parameters
        ----------
        G (m, n_dof)
            One load per row.
        groups
            Of rows, see :func:`klack.bodies.elasticity.condensation.condensed_inverse`.
        """
        groups = groups or (np.arange(G.shape[0]),)
        at = self._among_known(G)
        if np.any(at >= 0):
            return self._extended(csr_array(G), at, groups)
        C = condensed_inverse(self.factorization, csr_array(G)[:, self._kept], groups=groups)
        return self._balanced(C, csr_array(G), groups)

    def _balanced(
        self, C: NDArray[np.float64], G: csr_array, groups: Sequence[NDArray[np.int64]]
    ) -> NDArray[np.float64]:
        """Compliance (m, m) of the body in inertia relief, from that of the held one."""
        if self._R.shape[1]:
            MR = self._MR[self._kept]
            Z = self.factorization.solve(MR)
            A, GZ, W = G @ self._R, G[:, self._kept] @ Z, MR.T @ Z
            for i, j in product(groups, repeat=2):
                C[np.ix_(i, j)] += A[i] @ W @ A[j].T - A[i] @ GZ[j].T - GZ[i] @ A[j].T
            C = (C + C.T) / 2.0
        return C

    @cached_property
    def _known(self) -> tuple[Mapping[bytes, int], NDArray[np.float64]]:
        """Places of the known loads by their entries, and their compliance; none by default."""

        def compliance() -> NDArray[np.float64]:
            C = getattr(self.factorization, "condensed", None)
            if C is None or self._loads is None:
                return np.zeros((0, 0))
            return self._balanced(C, self._loads, (np.arange(len(C)),))

        if self._loads is None:
            return {}, np.zeros((0, 0))
        C = self.remembered(
            "compliance of known loads",
            (),
            compliance,
            lambda C: Entry(arrays={"C": C}),
            lambda entry: entry.arrays["C"],
        )
        return {row: at for at, row in enumerate(_rows(self._loads)) if at < len(C)}, C

    @property
    def has_loads(self) -> bool:
        """Whether the compliance of some loads comes with the factor."""
        return bool(len(self._known[1]))

    def _among_known(self, G: csr_array) -> NDArray[np.int64]:
        """Place of each row among the known loads, -1 without."""
        places, _ = self._known
        if not places:
            return np.full(G.shape[0], -1)
        return np.array([places.get(row, -1) for row in _rows(G)], dtype=np.int64)

    def _extended(
        self, G: csr_array, at: NDArray[np.int64], groups: Sequence[NDArray[np.int64]]
    ) -> NDArray[np.float64]:
        """Compliance of loads of which some are known, at these places: the others are solved."""
        C = self._known[1].take(at, 0).take(at, 1)
        for group in groups:
            fresh = group[at[group] < 0]
            for rows in (fresh[i : i + _CHUNK] for i in range(0, len(fresh), _CHUNK)):
                C[:, rows] = G @ self.solve(G[rows].toarray().T)
        known, fresh = np.flatnonzero(at >= 0), np.flatnonzero(at < 0)
        C[np.ix_(fresh, known)] = C[np.ix_(known, fresh)].T
        return (C + C.T) / 2.0

    def compliance_at(
        self, G: csr_array, groups: Sequence[NDArray[np.int64]] = ()
    ) -> NDArray[np.float64]:
        """As :meth:`condensed`, kept in the cache: for the points of a contact."""
        if np.all(self._among_known(G) >= 0):
            return self.condensed(G)
        return self.remembered(
            "compliance of the contact",
            (G, *groups),
            lambda: self.condensed(G, groups),
            lambda C: Entry(arrays={"C": C}),
            lambda entry: entry.arrays["C"],
        )

    def coupling(self, G: csr_array, H: csr_array) -> NDArray[np.float64]:
        """Opening of each row of G [m] per force [N] on each row of H, G F H^T; kept in the cache.

        Solved for the fewer rows, by reciprocity.
        """
        if G.shape[0] < H.shape[0]:
            return self.coupling(H, G).T
        at, beside = self._among_known(G), self._among_known(H)
        if np.all(at >= 0) and np.all(beside >= 0):
            return self._known[1].take(at, 0).take(beside, 1)
        return self.remembered(
            "coupling of two contacts",
            (G, H),
            lambda: np.asarray(G @ self.solve(H.T.toarray())),
            lambda C: Entry(arrays={"C": C}),
            lambda entry: entry.arrays["C"],
        )

    def deflections(self, F: NDArray[np.float64]) -> NDArray[np.float64]:
        """As :meth:`solve`, kept in the cache: for ports."""
        return self.remembered(
            "deflections",
            (F,),
            lambda: self.solve(F),
            lambda U: Entry(arrays={"U": U}),
            lambda entry: entry.arrays["U"],
        )

    def remembered(
        self,
        kind: str,
        parts: tuple[object, ...],
        compute: Callable[[], Result],
        pack: Callable[[Result], Entry],
        unpack: Callable[[Entry], Result],
    ) -> Result:
        """Take a result of this body from its cache.

        As :func:`klack.machine.cache.remember.remembered`; ``parts`` is what it depends on besides
        the body and its solver.
        """
        if self.cache is None:
            return compute()
        return remembered(self.cache, kind, (self.key, *parts), compute, pack=pack, unpack=unpack)

    def close(self) -> None:
        """Release the memory of the factorisation."""
        self._closed = True
        if self._factor is not None:
            self._factor.close()

    def _check(self) -> None:
        """Factorise, so that an error of the matrix is raised here."""
        _ = self.factorization

    def _solve_block(self, F: NDArray[np.float64]) -> NDArray[np.float64]:
        R, MR = self._R, self._MR
        if R.shape[1]:
            F = F - MR @ (R.T @ F)
        U = np.zeros(F.shape, order="F")
        U[self._kept] = self.factorization.solve(F[self._kept])
        if R.shape[1]:
            U -= R @ (MR.T @ U)
        return U
