r"""Contact laws with memory in a time step, compiled.

**Rubbing** (:mod:`klack.contact.rubbing_law`).  The force of a step is the mean of the law along
the straight way from d0 to d1 with all that happens on it (sliders that let go, springs that
touch), in closed form:

.. math:: F = \frac{1}{d_1 - d_0} \int_{d_0}^{d_1} F(d)\, \mathrm dd ,

so that the work is what the springs store and the sliders lose, for steps of any size.  No loss
is negative, spring by spring.  The places of the sliders [m] lie behind the numbers of the law,
then a copy of them for steps that are taken back; :func:`slide` takes them along once a step is
accepted.

**Yielding** (:mod:`klack.contact.yielding_law`).  With the work W along the way from an indentation
to another, elastic up to the largest one so far and along the loading curve beyond,

.. math:: F = \frac{W(d_1) - W(d_0)}{d_1 - d_0} ,

so that again the work is stored or lost.  :func:`press` takes the largest indentation along once a
step is accepted, and takes the loss as the difference, which is right for any tables.
Indentations count from first touch of the faces as they were when the run began, or, with
:func:`settle`, as they are now: a film lies on those.  Behind the two sizes of its tables, the
numbers of the law are the largest indentation [m], the set [m] that indentations count from, and a
copy of both for steps that are taken back.
"""

from math import sqrt

from klack.arrays import Vector
from klack.machine.compiling.jit import inner, njit

__all__ = [
    "begin_faces",
    "begin_sliders",
    "closing_force",
    "keep_faces",
    "keep_sliders",
    "press",
    "pressed_state",
    "rubbing_mean",
    "rubbing_store",
    "settle",
    "settled_since",
    "slide",
    "slider_places",
    "take_back_faces",
    "take_back_sliders",
    "yielding_mean",
    "yielding_store",
]


_STRAIGHT = 1e-4  # way over the indentation below which the slope is half that of the law
_STILL = 1e-15  # way over the indentation that is none


def slider_places(p: Vector, start: int) -> Vector:
    """Places [m] of the sliders of the law from ``p[start]`` on, as a view."""
    count = int(p[start])
    first = start + 2 + 3 * count
    return p[first : first + count]


@inner
def _lets_go(ratio: float, x0: float, x1: float, slip: float) -> float:
    """Where between x0 and x1 a slider lets go, x1 where it holds."""
    if x1 >= x0:
        if ratio <= 1.0:
            return x1
        return min(max(slip * ratio / (ratio - 1.0), x0), x1)
    return max(min(slip * ratio / (ratio + 1.0), x0), x1)


@njit
def rubbing_mean(p: Vector, start: int, d0: float, d1: float) -> tuple[float, float]:
    """Mean force between two indentations, and its slope over ``d1``."""
    count, ratio = int(p[start]), p[start + 1]
    g, n, h = start + 2, start + 2 + count, start + 2 + 2 * count
    s = h + count
    way, deep = d1 - d0, max(d0, d1)
    still = abs(way) <= _STILL * deep
    work, end, slope = 0.0, 0.0, 0.0
    for j in range(count):
        if p[g + j] >= deep:
            break
        x0, x1 = max(d0 - p[g + j], 0.0), max(d1 - p[g + j], 0.0)
        # the way itself where there is no end of the spring on it: a short one keeps its digits
        moved = way if x0 > 0.0 and x1 > 0.0 else x1 - x0
        k, slip = ratio * p[h + j], p[s + j]
        go = _lets_go(ratio, x0, x1, slip)
        holds = moved if go == x1 else go - x0
        held = 0.5 * k * holds * (x0 + go - 2.0 * slip)
        sign = 1.0 if x1 > x0 else -1.0
        rubbed = 0.5 * sign * p[h + j] * (moved - holds) * (x1 + go)
        work += 0.5 * p[n + j] * moved * (x1 + x0) + held + rubbed
        force = k * (x1 - slip) if go == x1 else sign * p[h + j] * x1
        end += p[n + j] * x1 + force
        if x1 > 0.0:
            slope += p[n + j] + (k if go == x1 else sign * p[h + j])
    if still:
        return end, 0.5 * slope
    mean = work / way
    if abs(way) <= _STRAIGHT * deep:
        return mean, 0.5 * slope
    return mean, (end - mean) / way


@njit
def rubbing_store(p: Vector, start: int, d: float) -> float:
    """Energy [J] of springs and held sliders at an indentation."""
    count, ratio = int(p[start]), p[start + 1]
    g, n, h = start + 2, start + 2 + count, start + 2 + 2 * count
    s = h + count
    stored = 0.0
    for j in range(count):
        x = max(d - p[g + j], 0.0)
        held = x - p[s + j]
        stored += 0.5 * p[n + j] * x * x + 0.5 * ratio * p[h + j] * held * held
    return stored


@njit
def closing_force(p: Vector, start: int, d: float) -> tuple[float, float]:
    """Force [N] while the contact closes from first touch, and its slope [N/m]."""
    count, share = int(p[start]), min(p[start + 1], 1.0)
    g, n, h = start + 2, start + 2 + count, start + 2 + 2 * count
    force, slope = 0.0, 0.0
    for j in range(count):
        if p[g + j] >= d:
            break
        stiffness = p[n + j] + share * p[h + j]
        force += stiffness * (d - p[g + j])
        slope += stiffness
    return force, slope


@njit
def slide(p: Vector, start: int, d0: float, d1: float) -> float:
    """Take the sliders along from d0 to d1, in place; returns what they lose [J]."""
    count, ratio = int(p[start]), p[start + 1]
    g, h = start + 2, start + 2 + 2 * count
    s = h + count
    lost = 0.0
    for j in range(count):
        x0, x1 = max(d0 - p[g + j], 0.0), max(d1 - p[g + j], 0.0)
        go = _lets_go(ratio, x0, x1, p[s + j])
        back = 1.0 - 1.0 / ratio if x1 > x0 else 1.0 + 1.0 / ratio
        if go != x1:
            lost += 0.5 * back * p[h + j] * abs(x1 - go) * (x1 + go)
            p[s + j] = back * x1
        if x1 == 0.0:
            p[s + j] = 0.0
    return lost


@njit
def begin_sliders(p: Vector, start: int, d: float) -> None:
    """Let the sliders lie as after closing from first touch to an indentation."""
    count = int(p[start])
    s = start + 2 + 3 * count
    for j in range(count):
        p[s + j] = 0.0
    slide(p, start, 0.0, d)


@njit
def keep_sliders(p: Vector, start: int) -> None:
    """Remember where the sliders are."""
    count = int(p[start])
    s = start + 2 + 3 * count
    for j in range(count):
        p[s + count + j] = p[s + j]


@njit
def take_back_sliders(p: Vector, start: int) -> None:
    """Put the sliders back to their remembered places."""
    count = int(p[start])
    s = start + 2 + 3 * count
    for j in range(count):
        p[s + j] = p[s + count + j]


_SMALL = 1e-6  # way over the indentation below which the force is that of its middle


_DEEP, _FROM, _KEPT, _TABLES = 2, 3, 4, 6  # places of the numbers


def pressed_state(p: Vector, start: int) -> Vector:
    """Largest indentation so far, and the set that indentations count from [m], as a view."""
    return p[start + _DEEP : start + _KEPT]


@inner
def _state(p: Vector, start: int, deep: float) -> tuple[int, float]:
    """State below a largest indentation, and the share to the next one."""
    count, first = int(p[start]), start + _TABLES
    low, high = 0, count - 1
    while high - low > 1:
        middle = (low + high) // 2
        if p[first + middle] <= deep:
            low = middle
        else:
            high = middle
    share = (deep - p[first + low]) / (p[first + low + 1] - p[first + low])
    return low, max(share, 0.0)


@inner
def _between(p: Vector, start: int, table: int, i: int, share: float) -> float:
    """One of the tables over the states: set 1, force 2, work 3."""
    at = start + _TABLES + table * int(p[start]) + i
    return p[at] + share * (p[at + 1] - p[at])


@inner
def _parted(p: Vector, start: int, deep: float, i: int, share: float) -> float:
    """Set; the way of opening is that of the last state beyond it."""
    last = p[start + _TABLES + int(p[start]) - 1]
    return _between(p, start, 1, i, min(share, 1.0)) + max(deep - last, 0.0)


@inner
def _elastic(p: Vector, start: int, deep: float, d: float) -> tuple[float, float, float]:
    """Force [N], stiffness [N/m] and energy [J] of the elastic curve up to ``deep``."""
    count, places = int(p[start]), int(p[start + 1])
    i, share = _state(p, start, deep)
    parted, size = _parted(p, start, deep, i, share), _between(p, start, 2, i, share)
    share = min(share, 1.0)
    if d <= parted:
        return 0.0, 0.0, 0.0
    way = deep - parted
    s = min((d - parted) / way, 1.0)
    k = min(int(sqrt(s) * (places - 1)), places - 2)
    n = float(places - 1)
    s0 = (k / n) * (k / n)
    s1 = ((k + 1) / n) * ((k + 1) / n)
    if s < s0:
        k -= 1
        s0, s1 = (k / n) * (k / n), s0
    a = start + _TABLES + 4 * count + i * places + k
    b = a + places
    low = p[a] + share * (p[b] - p[a])
    high = p[a + 1] + share * (p[b + 1] - p[a + 1])
    whole = count * places
    below = p[a + whole] + share * (p[b + whole] - p[a + whole])
    slope = (high - low) / (s1 - s0)
    x = s - s0
    return (
        size * (low + slope * x),
        size * slope / way,
        size * way * (below + x * (low + 0.5 * slope * x)),
    )


@inner
def _closing(p: Vector, start: int, d: float) -> tuple[float, float, float]:
    """Force [N], stiffness [N/m] and work [J] of the loading curve."""
    first, count = start + _TABLES, int(p[start])
    i, share = _state(p, start, d)
    width = p[first + i + 1] - p[first + i]
    f0, f1 = p[first + 2 * count + i], p[first + 2 * count + i + 1]
    slope, x = (f1 - f0) / width, share * width
    return f0 + slope * x, slope, p[first + 3 * count + i] + x * (f0 + 0.5 * slope * x)


@inner
def _along(p: Vector, start: int, d: float) -> tuple[float, float, float]:
    deep = p[start + _DEEP]
    if d <= deep:
        return _elastic(p, start, deep, d)
    force, slope, work = _closing(p, start, d)
    _, _, stored = _elastic(p, start, deep, deep)
    _, _, before = _closing(p, start, deep)
    return force, slope, stored + work - before


@njit
def yielding_mean(p: Vector, start: int, d0: float, d1: float) -> tuple[float, float]:
    """Mean force between two indentations, and its slope over ``d1``."""
    way, a, b = d1 - d0, d0 + p[start + _FROM], d1 + p[start + _FROM]
    if abs(way) <= _SMALL * max(a, b):
        force, slope, _ = _along(p, start, 0.5 * (a + b))
        return force, 0.5 * slope
    force, _, work = _along(p, start, b)
    _, _, before = _along(p, start, a)
    mean = (work - before) / way
    return mean, (force - mean) / way


@njit
def yielding_store(p: Vector, start: int, d: float) -> float:
    """Elastic energy [J] at an indentation."""
    _, _, energy = _elastic(p, start, p[start + _DEEP], d + p[start + _FROM])
    return energy


@njit
def press(p: Vector, start: int, d0: float, d1: float, force: float) -> float:
    """Take the largest indentation along from d0 to d1, in place; returns the loss [J]."""
    if d1 + p[start + _FROM] <= p[start + _DEEP]:
        return 0.0
    before = yielding_store(p, start, d0)
    p[start + _DEEP] = d1 + p[start + _FROM]
    return before + force * (d1 - d0) - yielding_store(p, start, d1)


@njit
def settle(p: Vector, start: int) -> float:
    """Count indentations from the faces as they are now, in place; the growth of gaps [m]."""
    i, share = _state(p, start, p[start + _DEEP])
    before = p[start + _FROM]
    p[start + _FROM] = _parted(p, start, p[start + _DEEP], i, share)
    return p[start + _FROM] - before


@njit
def begin_faces(p: Vector, start: int, d: float) -> float:
    """Let the faces be as after pressing to an indentation; returns as :func:`settle`."""
    p[start + _DEEP] = max(p[start + _DEEP], d + p[start + _FROM])
    return settle(p, start)


@njit
def keep_faces(p: Vector, start: int) -> None:
    """Remember how far the faces were pressed."""
    p[start + _KEPT] = p[start + _DEEP]
    p[start + _KEPT + 1] = p[start + _FROM]


@njit
def settled_since(p: Vector, start: int) -> float:
    """Growth of gaps [m] since the faces were remembered."""
    return p[start + _FROM] - p[start + _KEPT + 1]


@njit
def take_back_faces(p: Vector, start: int) -> None:
    """Put the faces back to how they were remembered."""
    p[start + _DEEP] = p[start + _KEPT]
    p[start + _FROM] = p[start + _KEPT + 1]
