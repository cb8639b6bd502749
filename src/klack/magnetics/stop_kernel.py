r"""Stops of hysteretic iron over one piece of time, compiled.

While the flux of a tube goes from ``b0`` to ``b1`` a stop of :mod:`klack.magnetics.hysteresis` is
elastic up to its yield and then follows the yield, straight between both fluxes.  The mean mmf is
that of this path, so that

.. math:: \bar s\,(b_1 - b_0) = \frac{s_1^2 - s_0^2}{2c} + \text{heat}, \qquad \text{heat} \ge 0

to round-off, whatever the length of the piece.  The table of a tube is ``[parts]``, then for each
part ``[stops n, width table]`` and ``n`` pairs of stiffness and share.
"""

from typing import Any

from klack.machine.compiling.jit import inner

__all__ = ["stops_end", "stops_energy", "stops_mean", "stops_move"]


@inner(error_model="numpy", forceinline=True)
def _width(par: Any, table: int, flux: float) -> float:
    n, place = int(par[table]), abs(flux) * par[table + 1]
    if not place < n:
        return par[table + 2 + 4 * n]
    i = int(place)
    u, row = place - i, table + 2 + 4 * i
    return par[row] + u * (par[row + 1] + u * (par[row + 2] + u * par[row + 3]))


@inner(error_model="numpy", forceinline=True)
def _end(c: float, most: float, s: float, change: float) -> float:
    return min(max(s + c * change, -most), most)


@inner(error_model="numpy", forceinline=True)
def _yields(c: float, r0: float, r1: float, s: float, d: float) -> tuple[float, float]:
    """Share of a rising path that is elastic, and the yield at its end; ``s + c d > r1``."""
    f = min(max((r0 - s) / (c * d - (r1 - r0)), 0.0), 1.0)
    return f, s + f * c * d


@inner(error_model="numpy", forceinline=True)
def _mean(c: float, r0: float, r1: float, s: float, change: float) -> tuple[float, float]:
    """Mean of a stop over a path, and its derivative by the end of the path."""
    sign = 1.0 if change >= 0.0 else -1.0
    s, d = sign * s, sign * change
    if s + c * d <= r1:
        return sign * (s + 0.5 * c * d), 0.5 * c
    f, y = _yields(c, r0, r1, s, d)
    mean = 0.5 * (f * (s + y) + (1.0 - f) * (y + r1))
    ahead = f * (r1 - 0.5 * (s + y)) + 0.5 * (1.0 - f) * (r1 - y)
    return sign * mean, ahead / d if d > 0.0 else 0.5 * c


@inner(error_model="numpy")
def stops_mean(
    par: Any, at: int, table: int, kept: Any, first: int, b0: float, db: float
) -> tuple[float, float]:
    """Mean mmf [A] of the stops of a tube over a change of its flux, and its derivative."""
    total = slope = 0.0
    q = table + 1
    for _ in range(int(par[table])):
        n, width = int(par[q]), at + int(par[q + 1])
        w0, w1 = _width(par, width, b0), _width(par, width, b0 + db)
        q += 2
        for _ in range(n):
            c, share = par[q], par[q + 1]
            mean, more = _mean(c, share * w0, share * w1, kept[first], db)
            total += mean
            slope += more
            q += 2
            first += 1
    return total, slope


@inner(error_model="numpy")
def stops_end(
    par: Any, at: int, table: int, kept: Any, first: int, b0: float, db: float
) -> tuple[float, float]:
    """Sum of the stops of a tube [A] after a change of its flux; elastic stiffness [A/Wb]."""
    total = stiffness = 0.0
    q = table + 1
    for _ in range(int(par[table])):
        n, w1 = int(par[q]), _width(par, at + int(par[q + 1]), b0 + db)
        q += 2
        for _ in range(n):
            total += _end(par[q], par[q + 1] * w1, kept[first], db)
            if abs(kept[first] + par[q] * db) < par[q + 1] * w1:
                stiffness += par[q]
            q += 2
            first += 1
    return total, stiffness


@inner(error_model="numpy")
def stops_move(par: Any, at: int, table: int, kept: Any, first: int, b0: float, db: float) -> float:
    """Move the stops of a tube with its flux; return the heat [J]."""
    heat = 0.0
    q = table + 1
    for _ in range(int(par[table])):
        n, width = int(par[q]), at + int(par[q + 1])
        w0, w1 = _width(par, width, b0), _width(par, width, b0 + db)
        q += 2
        for _ in range(n):
            c, r0, r1 = par[q], par[q + 1] * w0, par[q + 1] * w1
            sign = 1.0 if db >= 0.0 else -1.0
            s, d = sign * kept[first], sign * db
            if s + c * d > r1:
                f, y = _yields(c, r0, r1, s, d)
                heat += 0.5 * (y + r1) * ((1.0 - f) * d - (r1 - y) / c)
            kept[first] = _end(c, r1, kept[first], db)
            q += 2
            first += 1
    return heat


@inner(error_model="numpy")
def stops_energy(par: Any, table: int, kept: Any, first: int) -> float:
    """Stored energy of the stops of a tube [J]."""
    energy = 0.0
    q = table + 1
    for _ in range(int(par[table])):
        n = int(par[q])
        q += 2
        for _ in range(n):
            energy += 0.5 * kept[first] * kept[first] / par[q]
            q += 2
            first += 1
    return energy
