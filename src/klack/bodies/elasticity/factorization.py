"""Factorisation of a symmetric positive definite matrix, by whichever solver is installed.

===========  =====================================  ==================================
backend      what it is                             installed by
===========  =====================================  ==================================
pardiso      Cholesky of Intel MKL (fastest)        klack itself on x86-64
ngsolve      sparse Cholesky of NGSolve             the extra ``ngsolve``
superlu      LU of SuperLU in scipy (slow, large)   klack itself
===========  =====================================  ==================================
"""

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from types import TracebackType
from typing import Any, Literal, Protocol, Self

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.bodies.elasticity.budget import WITHOUT, Budget
from klack.errors import InputError, refuse_if

__all__ = [
    "Backend",
    "Factorization",
    "Precision",
    "available_backends",
    "chosen_backend",
    "factorize",
]

Backend = Literal["auto", "pardiso", "ngsolve", "superlu"]
Precision = Literal["double", "single"]

_LARGEST_CONDITION = 1e14
_LARGEST_RESIDUAL = {"double": 1e-10, "single": 1e-4}
_DEFINITE_STEPS = 16
_ROWS = 2**16  # at once
_ROUNDING = 1e-11


class Factorization(Protocol):
    """A factorised matrix A, ready to solve A X = B many times.

    Holds memory outside Python until :meth:`close`; also a context manager. Two threads must not
    use one object at once.
    """

    @property
    def backend(self) -> str:
        """Name of the solver."""

    @property
    def size(self) -> int:
        """Number of rows."""

    @property
    def nonzeros(self) -> int | None:
        """Entries of the factor; None where the solver does not report them."""

    @property
    def memory(self) -> int | None:
        """Peak memory [byte]; None where the solver does not report it."""

    def solve(self, B: NDArray[np.float64]) -> NDArray[np.float64]:
        """Solve A X = B, B of shape (n,) or (n, m); 2-D results are column-major."""

    def close(self) -> None:
        """Give the memory back; a second call does nothing."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None: ...


def available_backends() -> tuple[str, ...]:
    """Solvers that can be loaded here, the fastest first."""
    return tuple(name for name in _BACKENDS if _loadable(name))


def factorize(
    A: Any,
    *,
    backend: Backend = "auto",
    threads: int | None = None,
    precision: Precision = "double",
    loads: csr_array | None = None,
    budget: Budget = WITHOUT,
) -> Factorization:
    """Factorise a sparse symmetric positive definite matrix.

    Rejects a matrix that is not positive definite, or singular to working precision.

    Parameters
    ----------
    A (n, n)
        Full symmetric storage.
    backend
        ``"auto"`` takes the first that is installed.
    threads
        Of the factorisation and of each solve (pardiso only); default: that of MKL. One is best
        for many single solves, two for the factorisation.
    precision
        ``"single"`` (pardiso only, the others stay double) takes half the memory and 0.6 of the
        time, with relative residuals of some 1e-6.
    loads (m, n)
        Known beforehand; pardiso in double precision gives a
        :class:`klack.bodies.elasticity.pardiso.LoadedFactorization`, the others leave them out.

    Examples
    --------
    >>> from scipy.sparse import csr_array
    >>> with factorize(csr_array([[2.0, -1.0], [-1.0, 2.0]])) as factor:
    ...     x = factor.solve(np.array([1.0, 0.0]))
    >>> bool(np.allclose(x, [2 / 3, 1 / 3]))
    True
    """
    refuse_if(
        A.shape[0] != A.shape[1] or A.shape[0] == 0,
        "factorize: A",
        got=f"a matrix of shape {A.shape}",
        expected="a square matrix with at least one row",
        hint="at least one degree of freedom must stay free.",
    )
    A = A.tocsr()
    if not (A.diagonal() > 0).all():
        raise not_positive_definite(
            f"diagonal entry {int(np.argmin(A.diagonal()))} is not positive"
        )
    name = chosen_backend(backend)
    single = precision == "single" and name == "pardiso"
    given = (A, threads, "single") if single else (A, threads)
    factor: Factorization
    if loads is not None and name == "pardiso" and precision == "double":
        factor = _load(name, "LoadedFactorization")(A, loads, threads, budget=budget)
    else:
        factor = _load(name)(*given, budget=budget)
    try:
        _check_condition(A, factor, _LARGEST_RESIDUAL["single" if single else "double"])
        if name != "pardiso":  # which notices a negative pivot itself
            _check_definite(factor)
    except BaseException:
        factor.close()
        raise
    return factor


def not_positive_definite(symptom: str) -> InputError:
    """The error of every solver that meets a singular or indefinite matrix."""
    return InputError(
        "factorize: A",
        got=f"a matrix that is not positive definite ({symptom})",
        expected="the stiffness of a supported body, or a positive combination of K and M",
        hint="fix the body so that it can neither move nor rotate, and check that the "
        "mesh is in one piece.",
    )


_BACKENDS: dict[str, tuple[str, str, str]] = {
    "pardiso": ("pypardiso", "klack.bodies.elasticity.pardiso", "PardisoFactorization"),
    "ngsolve": ("ngsolve", "klack.bodies.elasticity.ngsolve_cholesky", "NgsolveFactorization"),
    "superlu": ("scipy", "klack.bodies.elasticity.superlu", "SuperluFactorization"),
}


def _loadable(name: str) -> bool:
    try:
        return find_spec(_BACKENDS[name][0]) is not None
    except ValueError:  # sys.modules[name] is None: a blocked import
        return False


def _load(name: str, other: str = "") -> Callable[..., Factorization]:
    """Class of a solver, or another one beside it."""
    _, module, class_name = _BACKENDS[name]
    return getattr(import_module(module), other or class_name)


def chosen_backend(backend: str) -> str:
    """Solver that a choice means here; rejects one that is not installed."""
    names = available_backends()
    if backend == "auto":
        return names[0]
    refuse_if(
        backend not in names,
        "factorize: backend",
        got=f"'{backend}'",
        expected=f"'auto' or one that is installed here: {', '.join(names)}",
        hint="use 'auto', or install the package of that solver.",
    )
    return backend


def _check_condition(A: Any, factor: Factorization, largest_residual: float) -> None:
    """Two inverse iterations: a lower bound of the condition number, and the residual."""
    x = np.random.default_rng(1).standard_normal(A.shape[0])
    scale = _largest_row(A)
    for _ in range(2):
        b = x / np.linalg.norm(x)
        x = factor.solve(b)
        # not (a < b) also catches nan
        if not scale * np.linalg.norm(x) < _LARGEST_CONDITION:
            raise not_positive_definite("it is singular to working precision")
        if not b @ x > 0:
            raise not_positive_definite("it has a negative eigenvalue")
    residual = np.linalg.norm(A @ x - b) / (scale * np.linalg.norm(x))
    if not residual < largest_residual:
        raise not_positive_definite(f"solutions leave a residual of {residual:.1e}")


def _largest_row(A: Any) -> float:
    """Largest sum of magnitudes in a row, some rows at a time: A may be a gigabyte."""
    rows = range(0, A.shape[0], _ROWS)
    return max(float(abs(A[at : at + _ROWS]).sum(axis=1).max()) for at in rows)


def _check_definite(factor: Factorization) -> None:
    """Lanczos steps with the inverse, since a factor of any sign solves an indefinite matrix too.

    Eigenvalues of the tridiagonal matrix lie within those of the inverse (Parlett 1998, chapter
    10), so a negative one is proof; one far from zero among many may stay unseen. Not ARPACK: of a
    sound matrix it would look for the end of the cluster at zero.
    """
    rng = np.random.default_rng(2)
    size = min(_DEFINITE_STEPS, factor.size)
    basis = np.zeros((size, factor.size))
    diagonal, beside = np.zeros(size), np.zeros(max(size - 1, 0))
    v = rng.standard_normal(factor.size)
    for k in range(size):
        basis[k] = v / np.linalg.norm(v)
        v = factor.solve(basis[k])
        diagonal[k] = basis[k] @ v
        for _ in range(2):  # twice is enough (Kahan and Parlett)
            v = v - basis[: k + 1].T @ (basis[: k + 1] @ v)
        if k < size - 1:
            beside[k] = np.linalg.norm(v)
            if not beside[k] > _ROUNDING * abs(diagonal[: k + 1]).max():
                diagonal, beside = diagonal[: k + 1], beside[:k]
                break
    values = scipy.linalg.eigvalsh_tridiagonal(diagonal, beside)
    if values[0] < -_ROUNDING * abs(values).max():
        raise not_positive_definite("it has a negative eigenvalue")
