r"""PARDISO of Intel MKL, called directly in the library of the installed mkl package.

pypardiso's own ``solve`` compares (or hashes) the matrix and copies its indices at every call, of
which a transient run makes thousands.  Cholesky (matrix type 2) is as fast as the symmetric
indefinite type -2, takes the same memory, and notices a matrix that is not positive definite.  A
factor in single precision is for time steps that solve for a small increment, never for statics.

Loads that are known beforehand border the matrix,

.. math:: \begin{pmatrix} A & G^T \\ G & 0 \end{pmatrix},

and come last in the elimination: what it leaves of the zero is :math:`-G A^{-1} G^T`, the
compliance seen by these loads, for a fraction of a forward substitution of each.
"""

import ctypes
import weakref
from functools import cache
from importlib.metadata import PackageNotFoundError, PackagePath, files
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_array, csr_array, triu, vstack

from klack.bodies.elasticity.budget import WITHOUT, Budget
from klack.bodies.elasticity.factor_memory import out_of_memory
from klack.bodies.elasticity.factorization import Precision, not_positive_definite
from klack.errors import ConvergenceError
from klack.files.closing import Closing

__all__ = ["LoadedFactorization", "PardisoFactorization"]

_SPD, _INDEFINITE, _HERMITIAN = 2, -2, 4
_ANALYSE, _FACTOR, _SOLVE, _FORWARD, _BACKWARD, _RELEASE = 11, 22, 33, 331, 333, -1
_ERRORS = {-3: "reordering failed", -8: "more than 2^31 entries"}
_NO_MEMORY = (-2, -9)
_NEGATIVE = (-4, -7)
_ROWS = 2**16
_UNTOUCHED = 40  # pivots below 1e-40 of the largest entry are perturbed: none


class PardisoFactorization(Closing):
    """Cholesky factor held by MKL.

    See :class:`klack.bodies.elasticity.factorization.Factorization`.

    Parameters
    ----------
    A
        Real and symmetric, or complex, Hermitian and positive definite.
    definite
        Whether A is positive definite.
    border
        The last unknowns, so many, are eliminated last and not by :meth:`forward`; what is left of
        their rows is :attr:`rest` (border, border). The others are positive definite.
    """

    backend = "pardiso"

    def __init__(
        self,
        A: Any,
        threads: int | None = None,
        precision: Precision = "double",
        *,
        definite: bool = True,
        border: int = 0,
        budget: Budget = WITHOUT,
    ) -> None:
        self._mkl = _library()
        wave = np.iscomplexobj(A)
        self._kind = _INDEFINITE if not definite or border else _HERMITIAN if wave else _SPD
        # a factor of two levels is laid out for its threads: a solve with another number of them is
        # wrong, without an error
        self._threads = int(self._mkl.MKL_Get_Max_Threads()) if threads is None else threads
        single, double = (np.complex64, np.complex128) if wave else (np.float32, np.float64)
        self._type = single if precision == "single" else double
        self._handle = np.zeros(64, dtype=np.int64)
        self._settings = _settings(precision, definite, bordered=border > 0)
        self.size, self._border = A.shape[0], border
        # some rows at a time: the whole would pass through coordinates, twice its size
        blocks = [triu(A[at : at + _ROWS], k=at) for at in range(0, A.shape[0], _ROWS)]
        upper = vstack(blocks, format="csr")
        del blocks
        upper.sort_indices()
        self._values = np.ascontiguousarray(upper.data, dtype=self._type)
        self._indices = upper.indices.astype(np.int32, copy=False)
        self._start = upper.indptr.astype(np.int32, copy=False)
        self._release = weakref.finalize(
            self, _free, self._mkl, self._handle, self._settings, self._kind, self.size
        )
        self.rest = np.zeros((border, border))
        try:
            self._factorise(A.nnz, precision, budget)
        except BaseException:
            self.close()
            raise
        self.nonzeros: int | None = int(self._settings[17])
        self.memory: int | None = self._told_memory()

    def _factorise(self, entries: int, precision: Precision, budget: Budget) -> None:
        """Order the matrix and count the entries of its factor; if they fit, compute them."""
        empty = np.zeros(self.size, dtype=self._type)
        rest = self.rest if self._border else empty
        for phase in (_ANALYSE, _FACTOR):
            error = self._call(phase, empty, rest, 1)
            if error in _NO_MEMORY:
                raise out_of_memory(self.backend, self.size, entries, self._told_memory())
            if error:
                raise _failure(error)
            if phase == _ANALYSE:
                needed = self._told_memory()
                budget.require(self.backend, self.size, entries, needed, precision)
        if self._border and not (self._pivots()[: -self._border] > 0.0).all():
            raise _failure(_NEGATIVE[0])

    def _pivots(self) -> NDArray[np.float64]:
        """Diagonal of D in A = L D L^T."""
        given, found = np.zeros((2, self.size))
        first, error = ctypes.c_int32(1), ctypes.c_int32(0)
        arrays = (ctypes.c_void_p(array.ctypes.data) for array in (self._handle, found, given))
        self._mkl["pardiso_getdiag"](*arrays, ctypes.byref(first), ctypes.byref(error))
        if error.value:
            raise _failure(error.value)
        return found

    def _told_memory(self) -> int:
        """Peak memory [byte] as MKL reports it after its analysis: iparm(15) to iparm(17)."""
        analysis, permanent, factor = (int(v) for v in self._settings[14:17])
        return 1024 * max(analysis, permanent + factor)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Of the numbers of the factor."""
        return np.dtype(self._type)

    def solve(self, B: NDArray[np.float64]) -> NDArray[np.float64]:
        """Solve A X = B for one or several columns."""
        return self._substitute(_SOLVE, B)

    def forward(self, B: NDArray[np.float64]) -> NDArray[np.float64]:
        """First half of a solve, L Y = B with A = L L^T (Y in an order of its own)."""
        return self._substitute(_FORWARD, B)

    def backward(self, Y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Second half of a solve, L^T X = Y."""
        return self._substitute(_BACKWARD, Y)

    def _substitute(self, phase: int, B: NDArray[np.float64]) -> NDArray[np.float64]:
        if not self._release.alive:
            raise RuntimeError("this factorisation has been closed")
        right = np.asarray(B, dtype=self._type, order="F")
        X = np.empty_like(right)
        if right.size:
            error = self._call(phase, right, X, 1 if right.ndim == 1 else right.shape[1])
            if error:
                raise _failure(error)
        return X if np.iscomplexobj(X) else X.astype(np.float64, copy=False)

    def close(self) -> None:
        """Give the memory back to the system."""
        self._release()
        self._values = self._indices = self._start = np.empty(0)

    def _call(self, phase: int, B: NDArray[Any], X: NDArray[Any], columns: int) -> int:
        before = self._mkl.MKL_Set_Num_Threads_Local(self._threads)
        try:
            return _pardiso(
                self._mkl,
                self._handle,
                self._kind,
                phase,
                (self.size - self._border, self._border),
                (self._values, self._start, self._indices),
                self._settings,
                (B, X, columns),
            )
        finally:
            self._mkl.MKL_Set_Num_Threads_Local(before)


@cache  # the search of pypardiso takes half a second
def _library() -> ctypes.CDLL:
    for file in _files_of_mkl():
        if "mkl_rt" in file.name:
            return ctypes.CDLL(str(file.locate()))
    from pypardiso import PyPardisoSolver

    return PyPardisoSolver().libmkl


def _files_of_mkl() -> list[PackagePath]:
    """Files of the mkl package on the path; none if installed otherwise."""
    try:
        return files("mkl") or []
    except PackageNotFoundError:
        return []


class LoadedFactorization(Closing):
    """Factor of a positive definite matrix A, with the compliance seen by loads G.

    See :class:`klack.bodies.elasticity.factorization.Factorization`.

    Parameters
    ----------
    loads (m, n)
        G, one load per row; ``condensed`` is ``G A^-1 G^T``.
    """

    def __init__(
        self, A: Any, loads: csr_array, threads: int | None = None, *, budget: Budget = WITHOUT
    ) -> None:
        m = loads.shape[0]
        # zeros that are stored
        zeros = csr_array((np.zeros(m), np.arange(m), np.arange(m + 1)), shape=(m, m))
        whole = csr_array(block_array([[A, loads.T], [loads, zeros]], format="csr"))
        self._factor = PardisoFactorization(whole, threads, border=m, budget=budget)
        self.backend = f"{self._factor.backend}, bordered"
        self.size: int = A.shape[0]
        self.nonzeros, self.memory = self._factor.nonzeros, self._factor.memory
        self.condensed = -self._factor.rest

    def solve(self, B: NDArray[np.float64]) -> NDArray[np.float64]:
        """Solve A X = B for one or several columns."""
        whole = np.zeros((self._factor.size, *B.shape[1:]), order="F")
        whole[: self.size] = B
        Y = self._factor.forward(whole)
        Y[self.size :] = 0.0
        return np.asfortranarray(self._factor.backward(Y)[: self.size])

    def close(self) -> None:
        """Give the memory back to the system."""
        self._factor.close()


def _settings(precision: Precision, definite: bool, *, bordered: bool) -> NDArray[np.int32]:
    """Parameters iparm of PARDISO; the comments count from 1 as its manual does."""
    iparm = np.zeros(64, dtype=np.int32)
    iparm[0] = 1  # iparm(1): take the values below instead of the defaults
    iparm[1] = 3  # iparm(2): nested dissection, parallel version
    if not definite:
        iparm[9] = 8  # iparm(10): perturb pivots below 1e-8
        iparm[10] = iparm[12] = 1  # iparm(11), iparm(13): scaling and matching
    iparm[17] = -1  # iparm(18): report the entries of the factor
    iparm[23] = 1  # iparm(24): two-level factorisation, 10 % less memory here
    if bordered:
        iparm[9], iparm[23] = _UNTOUCHED, 0
        iparm[35] = 2  # iparm(36): hand over what is left of the border, and keep the factor
        iparm[55] = 1  # iparm(56): keep the pivots
    iparm[27] = int(precision == "single")  # iparm(28): single-precision input and factor
    iparm[34] = 1  # iparm(35): indices count from zero, no copies needed
    return iparm


def _pardiso(
    mkl: ctypes.CDLL,
    handle: NDArray[np.int64],
    kind: int,
    phase: int,
    size: tuple[int, int],
    matrix: tuple[NDArray[Any], NDArray[Any], NDArray[Any]],
    settings: NDArray[np.int32],
    sides: tuple[NDArray[Any], NDArray[Any], int],
) -> int:
    def integer(value: int) -> Any:
        return ctypes.byref(ctypes.c_int32(value))

    def address(array: NDArray[Any]) -> ctypes.c_void_p:
        return ctypes.c_void_p(array.ctypes.data)

    B, X, columns = sides
    error = ctypes.c_int32(0)
    permutation = np.repeat(np.array([0, 1], dtype=np.int32), size)  # ones: the border, last
    mkl["pardiso"](  # a fresh function object, without the argument types of pypardiso
        *(
            address(handle),
            integer(1),
            integer(1),
            integer(kind),
            integer(phase),
            integer(sum(size)),
        ),
        *(address(array) for array in matrix),
        *(address(permutation), integer(columns), address(settings), integer(0)),
        *(address(B), address(X), ctypes.byref(error)),
    )
    return error.value


def _free(
    mkl: ctypes.CDLL,
    handle: NDArray[np.int64],
    settings: NDArray[np.int32],
    kind: int,
    size: int,
) -> None:
    none, zero = np.zeros(1), np.zeros(1, dtype=np.int32)
    _pardiso(mkl, handle, kind, _RELEASE, (size, 0), (none, zero, zero), settings, (none, none, 1))


def _failure(error: int) -> Exception:
    if error in _NEGATIVE:
        return not_positive_definite("a pivot is zero or negative")
    reason = _ERRORS.get(error, "see the manual of PARDISO")
    return ConvergenceError(
        f"PARDISO stopped with error {error}: {reason}.\n"
        "Try: a coarser mesh away from the contact, or backend='ngsolve' or 'superlu'."
    )
