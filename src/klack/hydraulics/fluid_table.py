r"""A fluid as flat numbers for the time loop: density, its slope and pressure energy.

The table holds the specific volume ``v(p)`` in pieces of degree five that join with equal value
and slope.  From it follow, without a further approximation,

.. math:: \rho = \frac1v, \qquad \frac{d\rho}{dp} = -\frac{v'}{v^2}, \qquad
          g(p) = \int_{p_a}^p v\,dp ,

the last exactly.  So ``dg = dp/rho`` holds to round-off, and the energy ``m g - (p - p_a) V`` of a
chamber is a true potential; with separate tables of ``rho`` and ``g`` every closed cycle would make
or lose energy by their errors.

Layout: number of pieces, seven zeros, then eight numbers per piece (one cache line): lower end
``p``, ``v`` there, factors of ``s .. s^5`` with ``s`` counted from the lower end, and ``g`` there.
A last row of the same form starts at the highest pressure.
"""

from functools import lru_cache
from math import log1p

import numpy as np

from klack.arrays import Vector
from klack.errors import ConvergenceError, require_positive
from klack.hydraulics.fluid import Fluid
from klack.hydraulics.liquid import HIGHEST_PRESSURE, Murnaghan, Tait
from klack.hydraulics.mixture import LOWEST_PRESSURE
from klack.machine.compiling.jit import inner, njit
from klack.network.protocols import NetworkFluid

__all__ = ["fluid_at", "fluid_table", "pressure_at"]

_ROW = 8
_TRACE = 1e-9  # [kg/m^3]
_MOST_NEWTON = 60
_SETTLED = 1e-15  # last step of an inversion over the pressure
_THIRD, _SIXTH = 1.0 / 3.0, 1.0 / 6.0
_ACCURACY = 1e-10  # of the specific volume, relative
_MOST_PIECES = 20_000
_INNER = np.array([1.0 / 3.0, 2.0 / 3.0])  # places of a piece that fix its highest factors
_TESTED = np.array([0.04, 0.15, 0.5, 0.85, 0.96])


def fluid_table(fluid: NetworkFluid, ambient_pressure: float) -> Vector:
    """Tabulate a fluid for :func:`fluid_at`.

    Pieces, a few hundred, are halved until the specific volume is right to 1e-10 between 1 Pa and
    4000 bar; kinks of the fluid and the ambient pressure are ends of pieces.

    Parameters
    ----------
    ambient_pressure [Pa]
        Absolute, where the pressure energy ``g`` is zero.
    """
    require_positive("fluid_table: ambient_pressure", ambient_pressure, "Pa")
    if isinstance(fluid, Fluid) and isinstance(fluid.liquid, Murnaghan | Tait):
        return _table_of(fluid, ambient_pressure).copy()
    return _table(fluid, ambient_pressure)


@lru_cache(maxsize=20)
def _table_of(fluid: Fluid, ambient_pressure: float) -> Vector:
    """Cached table of a fluid that cannot change; strokes of one valve share it."""
    return _table(fluid, ambient_pressure)


def _table(fluid: NetworkFluid, ambient_pressure: float) -> Vector:
    p, factors = _pieces(fluid, ambient_pressure)
    h = np.diff(p)
    powers = h[:, None] ** np.arange(1, 7)
    energy = np.sum(factors * powers / np.arange(1, 7), axis=1)
    at_ambient = int(np.searchsorted(p, ambient_pressure))
    above = np.concatenate(([0.0], np.cumsum(energy[at_ambient:])))
    below = -np.cumsum(energy[:at_ambient][::-1])[::-1]
    g = np.concatenate((below, above))  # summed from the ambient pressure: exact digits near it
    v, slope = fluid.specific_volume(p[-1:])
    last = np.array([[p[-1], v[0], slope[0], 0.0, 0.0, 0.0, 0.0, g[-1]]])
    rows = np.column_stack((p[:-1], factors, g[:-1]))
    head = np.zeros(_ROW)
    head[0] = p.size - 1
    return np.concatenate((head, rows.ravel(), last.ravel()))


def _pieces(fluid: NetworkFluid, ambient_pressure: float) -> tuple[Vector, Vector]:
    """Ends of all pieces and their six factors."""
    ends = np.geomspace(LOWEST_PRESSURE, HIGHEST_PRESSURE, 40)
    special = [p for p in (*fluid.kinks, ambient_pressure) if ends[0] < p < ends[-1]]
    ends = np.unique(np.concatenate((ends, special)))
    left, right = ends[:-1], ends[1:]
    done: list[tuple[Vector, Vector]] = []
    count = 0
    while left.size:
        factors = _quintic(fluid, left, right)
        good = _error(fluid, left, right, factors) <= _ACCURACY
        done.append((left[good], factors[good]))
        count += int(np.count_nonzero(good))
        if count + left.size > _MOST_PIECES:
            raise ConvergenceError(
                f"fluid_table: '{fluid.name}' has not converged after {_MOST_PIECES} pieces, the "
                f"last at {left[~good][0]:g} Pa.\nTry: a smoother density, or fluid.kinks there."
            )
        middle = np.sqrt(left[~good] * right[~good])
        left, right = (
            np.concatenate((left[~good], middle)),
            np.concatenate((middle, right[~good])),
        )
    starts = np.concatenate([start for start, _ in done])
    order = np.argsort(starts)
    all_factors = np.concatenate([factors for _, factors in done])[order]
    return np.append(starts[order], ends[-1]), all_factors


def _quintic(fluid: NetworkFluid, left: Vector, right: Vector) -> Vector:
    """Factors (n, 6) from value and slope at both ends and two values inside."""
    h = right - left
    va, da = fluid.specific_volume(left)
    vb, db = fluid.specific_volume(right)
    da, db = da * h, db * h
    secant = vb - va
    # v = va + da t + c t^2 + d t^3 + t^2 (1 - t)^2 (e + f t) with the Hermite cubic first
    c = 3.0 * secant - 2.0 * da - db
    d = da + db - 2.0 * secant
    rest = []
    for t in _INNER:
        v, _ = fluid.specific_volume(left + t * h)
        rest.append((v - (va + t * (da + t * (c + t * d)))) / (t * (1.0 - t)) ** 2)
    f = (rest[1] - rest[0]) / (_INNER[1] - _INNER[0])
    e = rest[0] - f * _INNER[0]
    # t^2 (1 - 2t + t^2) (e + f t)
    unit = np.column_stack((va, da, c + e, d - 2.0 * e + f, e - 2.0 * f, f))
    return np.asarray(unit / h[:, None] ** np.arange(6))


def _error(fluid: NetworkFluid, left: Vector, right: Vector, factors: Vector) -> Vector:
    """Largest relative error of each piece, and whether it falls with pressure."""
    s = _TESTED[:, None] * (right - left)
    v, slope = fluid.specific_volume(left + s)
    c = factors.T
    ours = c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * c[5]))))
    tangent = c[1] + s * (2 * c[2] + s * (3 * c[3] + s * (4 * c[4] + s * 5 * c[5])))
    error = np.max(np.abs(ours / v - 1.0), axis=0)
    rough = np.max(np.abs(tangent / slope - 1.0), axis=0) > 1e-6
    return np.where(rough & (right - left > 1e-6 * right), np.inf, error)


@njit(error_model="numpy", _nrt=False, forceinline=True)
def fluid_at(table: Vector, p: float, hint: int) -> tuple[float, float, float, int]:
    """Density [kg/m^3], its slope [kg/(m^3 Pa)], pressure energy [J/kg] and the place in the table.

    Never fails: below 1 Pa the specific volume, above 4000 bar the density continues linearly, so
    that the density is above zero and rises with pressure everywhere.  ``hint`` is the last place,
    0 for the first call.
    """
    i = max(hint, _ROW)
    while i > _ROW and p < table[i]:
        i -= _ROW
    last = _ROW * (int(table[0]) + 1)
    while i < last and p >= table[i + _ROW]:
        i += _ROW
    s = p - table[i]
    v0, c1 = table[i + 1], table[i + 2]
    if i == last or s < 0.0:
        return _beyond(v0, c1, table[i + 7], s, i)
    c2, c3, c4, c5 = table[i + 3], table[i + 4], table[i + 5], table[i + 6]
    # in pairs: their products run side by side, a nested form would wait for each
    s2 = s * s
    s4 = s2 * s2
    v = (v0 + s * c1) + s2 * (c2 + s * c3) + s4 * (c4 + s * c5)
    slope = (c1 + s * (2.0 * c2)) + s2 * (3.0 * c3 + s * (4.0 * c4)) + s4 * (5.0 * c5)
    area = (v0 + s * (0.5 * c1)) + s2 * (_THIRD * c2 + s * (0.25 * c3))
    g = table[i + 7] + s * (area + s4 * (0.2 * c4 + s * (_SIXTH * c5)))
    rho = 1.0 / v
    return rho, -slope * rho * rho, g, i


@inner(error_model="numpy")
def _beyond(
    v0: float, slope: float, g0: float, s: float, place: int
) -> tuple[float, float, float, int]:
    if s < 0.0:
        v = v0 + slope * s
        return 1.0 / v, -slope / (v * v), g0 + s * (v0 + 0.5 * slope * s), place
    rise = -slope / (v0 * v0)
    rho = 1.0 / v0 + rise * s
    return rho, rise, g0 + log1p(rise * v0 * s) / rise, place


@njit(error_model="numpy", _nrt=False, forceinline=True)
def pressure_at(table: Vector, rho: float, hint: int) -> tuple[float, int]:
    """Absolute pressure [Pa] at the density ``rho`` [kg/m^3], and its place.

    Inverse of :func:`fluid_at`, by Newton's method inside one piece.  A solver that looks for the
    pressure of a volume should take its steps in the density where the fluid starts to boil: there
    the density falls by a factor of a thousand within some kilopascals, and a step in pressure from
    one side lands far beyond the other.  ``rho`` of 0 and less is taken as a trace of vapour.
    """
    v = 1.0 / max(rho, _TRACE)
    last = _ROW * (int(table[0]) + 1)
    i = max(hint, _ROW)
    while i > _ROW and v > table[i + 1]:
        i -= _ROW
    while i < last and v <= table[i + _ROW + 1]:
        i += _ROW
    p0, v0, slope = table[i], table[i + 1], table[i + 2]
    if v > v0:  # below the first piece
        return p0 + (v - v0) / slope, i
    if i == last:
        return p0 + (rho - 1.0 / v0) / (-slope / (v0 * v0)), i
    low, high = 0.0, table[i + _ROW] - p0
    s = high * (v - v0) / (table[i + _ROW + 1] - v0)
    for _ in range(_MOST_NEWTON):
        found, tangent = _volume(table, i, s)
        if found > v:
            low = s
        else:
            high = s
        step = (v - found) / tangent
        if abs(step) <= _SETTLED * (p0 + s):
            return p0 + min(max(s + step, low), high), i
        s += step
        if not low < s < high:
            s = 0.5 * (low + high)
    return p0 + s, i


@inner(error_model="numpy", forceinline=True)
def _volume(table: Vector, i: int, s: float) -> tuple[float, float]:
    c1, c2, c3, c4, c5 = table[i + 2], table[i + 3], table[i + 4], table[i + 5], table[i + 6]
    v = table[i + 1] + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5))))
    slope = c1 + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))
    return v, slope
