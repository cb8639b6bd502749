"""Distance to the limit: bytes that each loop has to move, against the bandwidth of the machine.

The bandwidth is that of a triad, ``a = b + s c``, compiled and on one thread, over working sets
from a fraction of the first cache to memory; each loop is held against the bandwidth at the size
of its own working set.  A share of one means that nothing but moving the numbers is left.
"""

from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np
from kernel import kernel_ns_per_step
from numba import njit
from number import Number, Size
from numpy.typing import NDArray
from solid_valve import solid_valve

from klack.assembling.bodies import build_bodies
from klack.bodies.elasticity.assembly import assemble
from klack.bodies.elasticity.factorization import factorize
from klack.bodies.elasticity.statics import Flexibility
from klack.case import load_case, shipped_cases
from klack.machine.progress import silent
from klack.simulation.kernel import FAST

__all__ = ["bandwidth", "numbers"]

_DOUBLE, _INDEX = 8, 4  # bytes
_PER_MODE = 9 * _DOUBLE  # q, v, four step numbers and the port shape in; q, v out
_KERNEL_MODES = 60
_STREAM = 32_000_000  # doubles in three arrays: far beyond the caches


def numbers(size: Size) -> list[Number]:
    """Bandwidths, and the share of them that kernel, assembly and back-substitution reach."""
    sets = {"smallest": (1e4, 1e6), "quick": (4e3, 1e5, 1e6, 2.56e8)}.get(
        size, (4e3, 1.6e4, 1e5, 5e5, 2e6, 8e6, 3.2e7, 2.56e8)
    )
    curve = {bytes_: bandwidth(bytes_) for bytes_ in sets}
    found = [
        Number(
            name=f"bandwidth of a triad over {_binary(bytes_)}",
            value=1e-9 * value,
            unit="GB/s",
            series="bandwidth",
            at=bytes_,
        )
        for bytes_, value in curve.items()
    ]
    found += _kernel(2 if size == "smallest" else 30)
    found += _matrices(size, repeats=2 if size == "smallest" else 8)
    return found


def bandwidth(working_set: float) -> float:
    """Bytes per second of the triad over three arrays that fill ``working_set`` bytes together.

    Two of the arrays are read and one is written; what the processor reads of the third before it
    writes is not counted.
    """
    count = max(int(working_set) // (3 * _DOUBLE), 8)
    a, b, c = np.zeros(count), np.ones(count), np.ones(count)
    sweeps = max(1, int(2e7 // count))
    _triad(a, b, c, 1.5, 1)
    best = np.inf
    for _ in range(7):
        begin = perf_counter()
        _triad(a, b, c, 1.5, sweeps)
        best = min(best, perf_counter() - begin)
    return 3 * _DOUBLE * count * sweeps / best


@njit(cache=True, fastmath=FAST)
def _once(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64], s: float) -> None:
    for i in range(a.size):
        a[i] = b[i] + s * c[i]


@njit(cache=True)
def _triad(
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    c: NDArray[np.float64],
    s: float,
    sweeps: int,
) -> None:
    for sweep in range(sweeps):
        # what changes from sweep to sweep keeps the compiler from dropping all but the last
        _once(a, b, c, s + sweep)


def _kernel(repeats: int) -> list[Number]:
    moved = float(_PER_MODE * _KERNEL_MODES)
    found = []
    for closed in (False, True):
        seconds = 1e-9 * kernel_ns_per_step(closed=closed, repeats=repeats)
        words = "contact" if closed else "flight"
        found += _share(f"kernel, 60 modes, {words}", "step", moved, seconds, moved)
    return found


def _matrices(size: Size, repeats: int) -> list[Number]:
    """Assembly and back-substitution of the housing of the demo valve."""
    case = load_case(shipped_cases()["demo-valve-axisymmetric"])
    if size != "smallest":
        case = solid_valve(2.0, 10) if size == "quick" else solid_valve(1.0, 18)
    body = build_bodies(case, silent).lower
    materials = case.materials_of(body.name, body.mesh.solids)
    spent = min(_seconds(lambda: assemble(body.mesh, materials)) for _ in range(repeats))
    # values and columns of both matrices out, nodes and elements in
    moved = float((_DOUBLE + _INDEX) * (body.K.nnz + body.M.nnz))
    moved += sum(_INDEX * block.connectivity.size for block in body.mesh.blocks)
    moved += _DOUBLE * body.mesh.points.size
    found = _share(f"assembly, {body.dof_count} dof", "assembly", moved, spent, moved)
    with Flexibility(body, threads=1) as flexibility:
        factor = flexibility.factorization
        found += _substitutions(factor, "back-substitution", _DOUBLE, repeats)
    K = body.K[body.free][:, body.free]
    with factorize(K, threads=1, precision="single") as factor:
        found += _substitutions(
            factor, "back-substitution, single precision", _DOUBLE // 2, repeats
        )
    return found


def _substitutions(factor: Any, name: str, bytes_: int, repeats: int) -> list[Number]:
    """One right-hand side, for which the factor is read twice; and the gain of 64 at once."""
    if not factor.nonzeros:
        return []
    moved = 2.0 * bytes_ * factor.nonzeros
    seconds = []
    for columns in (1, 64):
        B = np.ones((factor.size, columns), order="F")
        seconds.append(min(_seconds(lambda B=B: factor.solve(B)) for _ in range(repeats)))
    gain = Number(
        name=f"{name}: time of one column alone over that of one of 64",
        value=64.0 * seconds[0] / seconds[1],
        unit="-",
    )
    return [*_share(name, "solve", moved, seconds[0], moved / 2.0), gain]


def _share(name: str, what: str, moved: float, seconds: float, working_set: float) -> list[Number]:
    """Bytes, their rate, and its share of the bandwidth at that working set."""
    rate = moved / seconds
    share = rate / bandwidth(working_set)
    return [
        Number(name=f"{name}: moved per {what}", value=1e-3 * moved, unit="kB"),
        Number(
            name=f"{name}: rate of moved bytes",
            value=1e-9 * rate,
            unit="GB/s",
            series="rate",
            at=working_set,
        ),
        Number(name=f"{name}: share of the bandwidth", value=share, unit="-"),
    ]


def _seconds(run: Callable[[], object]) -> float:
    begin = perf_counter()
    run()
    return perf_counter() - begin


def _binary(bytes_: float) -> str:
    for unit, scale in (("MB", 1e6), ("kB", 1e3)):
        if bytes_ >= scale:
            return f"{bytes_ / scale:g} {unit}"
    return f"{bytes_:g} B"
