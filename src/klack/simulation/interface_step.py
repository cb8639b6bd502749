r"""One time step of an interface: contact and squeeze film, parallel, in series with a compliance.

With a constant force ``F`` over a step the modes move exactly, so the gap between the bodies ends
at ``g1 = g_free + G F`` and the work taken from them is exactly ``-F (g1 - g0)``.  Laws act on the
gap ``z = g + e`` between the surfaces, with the compression ``e`` of a massless series compliance
``D``.  Contact force, film force and compression are discrete gradients (Gonzalez 1996):

.. math::
    F_c = \frac{V(-z_1) - V(-z_0)}{z_0 - z_1}\,\Bigl(1 + \chi\frac{z_0 - z_1}{h}\Bigr), \qquad
    F_f = \max\Bigl(\frac{\Pi(z_1) - \Pi(z_0)}{h},\, -F_s\Bigr), \qquad
    \theta e_1 + (1 - \theta) e_0 = D F,

with the film impulse ``Pi(z) = cubic/(2 x^2) + linear ln(1/x)``, ``x = max(z, 0) + cut_off``.  Then

.. math:: -F (g_1 - g_0) = \Delta V + \Delta\frac{e^2}{2D} + \text{contact loss} + \text{film loss}

for every step size, without negative losses.  This is one equation for ``z1``, whose left side
rises with a slope of 1 or more.

``theta`` is 1/2 (second order, no loss) while the contact is closed.  While it is open, the
compliance relaxes through the film with the time constant ``D c``; where that is below half a step,
``theta = 1 - D c / h`` is the smallest value with which ``e`` does not change its sign in every
step.  Without a film it is 1, and a compression left at release becomes a loss.

At first touch what only the film had compressed is lost: ``theta`` is 1 in the step after it, which
is of order 1.  With 1/2 this share of ``e`` would change its sign in every step of the contact, and
end in the rebound with one sign or the other.
"""

from math import log

import numpy as np

from klack.arrays import Vector
from klack.contact.step_constants import (
    FILM_NEWTON_LIMIT,
    FORCE_LEFT,
    LAW_LINEAR,
    LAW_RUBBING,
    LEFT_BY_FILM,
    LOG_SERIES_BELOW,
    NO_LAW,
    ROUND_OFF,
    RUBBED_LEFT,
    STEP_LEFT,
)
from klack.machine.compiling.jit import inner, njit
from klack.simulation.contact_step import law_potential, mean_force, solve_linear, solve_step

__all__ = ["film_force", "interface_store", "open_film", "solve_interface"]

Step = tuple[float, float, float, float, int, float, float]


@njit(error_model="numpy")
def film_force(
    cubic: float, linear: float, cut_off: float, h: float, z0: float, z1: float
) -> float:
    """Mean force [N] of a squeeze film whose gap goes from ``z0`` to ``z1`` [m] in ``h`` [s].

    ``[Pi(z1) - Pi(z0)]/h``, without the subtraction; not yet limited by cavitation.
    """
    x0, x1 = max(z0, 0.0) + cut_off, max(z1, 0.0) + cut_off
    closed = max(z0, 0.0) - max(z1, 0.0)
    return _film_mean(cubic, linear, x0, x1, 1.0 / x0, 1.0 / x1, closed) / h


@njit(inline="always", error_model="numpy")
def _film_mean(
    cubic: float,
    linear: float,
    x0: float,
    x1: float,
    inverse0: float,
    inverse1: float,
    closed: float,
) -> float:
    total, inverses = x0 + x1, inverse0 * inverse1
    damping = 0.5 * cubic * total * inverses * inverses
    if linear != 0.0:
        r = closed / total
        if abs(r) > LOG_SERIES_BELOW:
            return closed * damping + linear * log(x0 * inverse1)
        r2 = r * r
        log_mean = 2.0 + r2 * (2 / 3 + r2 * (2 / 5 + r2 * (2 / 7 + r2 * (2 / 9 + r2 * 2 / 11))))
        return closed * damping + linear * r * log_mean
    return closed * damping


@njit(error_model="numpy")
def interface_store(
    kind: int, law_data: Vector, law_start: int, series: float, g: float, e: float
) -> float:
    """Energy [J] held by the contact law and the series compliance; as :func:`solve_interface`."""
    stored = 0.0
    if kind != NO_LAW:
        stored = law_potential(kind, law_data, law_start, -(g + e))
    if series > 0.0:
        stored += 0.5 * e * e / series
    return stored


@njit(error_model="numpy", _nrt=False, forceinline=True)
def solve_interface(
    kind: int,
    law_data: Vector,
    law_start: int,
    chi_over_h: float,
    cubic: float,
    linear: float,
    cut_off: float,
    suction: float,
    h: float,
    G: float,
    series: float,
    g0: float,
    g_free: float,
    e0: float,
    guess: float,
    hint: int,
    film_before: float,
) -> Step:
    """Forces of an interface over one step, and where it ends.

    Parameters
    ----------
    kind, law_data, law_start
        :class:`klack.contact.laws.FlatLaw` from ``law_data[law_start]`` on; :data:`NO_LAW` for
        none.
    chi_over_h [1/m]
        Dissipation factor of Hunt and Crossley, ``alpha / (v0 h)``; 0 for an elastic law.
    cubic, linear, cut_off, suction
        Film, see :class:`klack.network.rows.FilmRow`; ``cubic = linear = 0`` for none.
    h [s]
        Above 0.
    G [m/N]
        Gap at the end of the step per force during it, above 0.
    g0, g_free [m]
        Gap of the bodies at the start, and at the end without this interface's force.
    e0 [m]
        Compression of the ``series`` compliance [m/N] at the start.
    guess [N]
        Total force, from the last step or sweep.
    film_before [N]
        Film force of the last step, if the contact closed in it; else 0.

    Returns
    -------
    contact_force, film_force : float [N]
        Means over the step, above zero when they press the bodies apart.
    g1, e1 : float [m]
        Gap and compression at the end.
    hint : int
    contact_loss, film_loss : float [J]
        The loss of a compression that relaxes in the open contact belongs to the film, or, without
        one, to the contact.
    """
    z0 = g0 + e0
    if cubic == 0.0 and linear == 0.0:
        if kind == NO_LAW or (z0 >= 0.0 and g_free >= 0.0 and g_free >= e0):
            relaxed = 0.5 * e0 * e0 / series if e0 != 0.0 else 0.0
            return 0.0, 0.0, g_free, 0.0, hint, relaxed, 0.0
        return _bare(kind, law_data, law_start, chi_over_h, G, series, z0, g_free, e0, guess, hint)
    left = abs(film_before) * series > LEFT_BY_FILM * abs(e0)
    theta = 0.5
    if series > 0.0 and z0 > 0.0:
        theta = _relaxing(cubic, linear, cut_off, h, series, z0, g_free - e0)
    elif left and z0 < 0.0:
        theta = 1.0
    if z0 >= 0.0:
        S, base = _line(G, series, theta, g_free, e0)
        film, found = _film_alone(cubic, linear, cut_off, suction, h, S, z0, base, guess)
        if found:
            g1 = g_free + G * film
            e1, relaxed = _compressed(series, theta, film, e0)
            return 0.0, film, g1, e1, hint, 0.0, film * (z0 - (g1 + e1)) + relaxed
    return _both(
        kind,
        law_data,
        law_start,
        chi_over_h,
        cubic,
        linear,
        cut_off,
        suction,
        h,
        G,
        series,
        theta,
        z0,
        g_free,
        e0,
        guess,
        hint,
    )


@inner(error_model="numpy", _nrt=False, forceinline=True)
def open_film(
    cubic: float,
    linear: float,
    cut_off: float,
    suction: float,
    h: float,
    series: float,
    g0: float,
    g1: float,
    e0: float,
    guess: float,
) -> tuple[float, float, float]:
    """Mean force [N], compression [m] and loss [J] of a film that stays open over a known motion.

    Arguments as of :func:`solve_interface`; the gap with the compression stays above 0.
    """
    z0, theta = g0 + e0, 0.5
    if series > 0.0:
        theta = _relaxing(cubic, linear, cut_off, h, series, z0, g1 - e0)
    S, base = _line(0.0, series, theta, g1, e0)
    film, _ = _film_alone(cubic, linear, cut_off, suction, h, S, z0, base, guess)
    e1, relaxed = _compressed(series, theta, film, e0)
    return film, e1, film * (z0 - (g1 + e1)) + relaxed


@njit(inline="always", error_model="numpy")
def _line(G: float, series: float, theta: float, g_free: float, e0: float) -> tuple[float, float]:
    """``S`` and ``base`` of the gap between the faces, ``z1 = base + S F``."""
    if theta == 0.5:
        return G + 2.0 * series, g_free - e0
    inverse = 1.0 / theta
    return G + series * inverse, g_free - (inverse - 1.0) * e0


@njit(inline="always", error_model="numpy")
def _compressed(series: float, theta: float, force: float, e0: float) -> tuple[float, float]:
    """Compression at the end of the step, and its loss by relaxing."""
    if series == 0.0:
        return 0.0, 0.0
    if theta == 0.5:
        return 2.0 * series * force - e0, 0.0
    e1 = (series * force - (1.0 - theta) * e0) / theta
    return e1, (theta - 0.5) * (e1 - e0) * (e1 - e0) / series


@njit(inline="always", error_model="numpy")
def _relaxing(
    cubic: float,
    linear: float,
    cut_off: float,
    h: float,
    series: float,
    z0: float,
    reach: float,
) -> float:
    """``theta`` of a step that starts open in a film; 1/2 where it closes the gap."""
    inverse = 1.0 / (z0 + cut_off)
    damping = (cubic * inverse * inverse + linear) * inverse
    most = 0.5 - series * damping / h
    if most <= 0.0:
        return 0.5
    if reach >= 0.5 * z0:
        return 0.5 + most
    return 0.5 + most * max(2.0 * reach / z0, 0.0)


@inner(error_model="numpy", _nrt=False, forceinline=True)
def _bare(
    kind: int,
    p: Vector,
    start: int,
    chi_over_h: float,
    G: float,
    series: float,
    z0: float,
    g_free: float,
    e0: float,
    guess: float,
    hint: int,
) -> Step:
    """:func:`solve_interface` without a film."""
    theta, S, base = 0.5, G + 2.0 * series, g_free - e0
    contact, hint = _contact_alone(kind, p, start, chi_over_h, S, z0, base, guess, hint)
    if contact == 0.0 and e0 != 0.0:  # released
        theta, S, base = 1.0, G + series, g_free
        contact, hint = _contact_alone(kind, p, start, chi_over_h, S, z0, base, 0.0, hint)
    lost = 0.0
    if chi_over_h != 0.0:
        lost = _damping_loss(kind, p, start, contact, z0, base + S * contact, hint)
    e1, relaxed = _compressed(series, theta, contact, e0)
    return contact, 0.0, g_free + G * contact, e1, hint, lost + relaxed, 0.0


@inner(error_model="numpy", _nrt=False, forceinline=True)
def _contact_alone(
    kind: int,
    p: Vector,
    start: int,
    chi_over_h: float,
    S: float,
    z0: float,
    base: float,
    guess: float,
    hint: int,
) -> tuple[float, int]:
    if z0 >= 0.0 and base >= 0.0:
        return 0.0, hint
    if kind == LAW_LINEAR and chi_over_h == 0.0:
        return solve_linear(p[start], S, -z0, -base), hint
    force, hint, _ = solve_step(kind, p, start, chi_over_h, S, -z0, -base, guess, hint)
    return force, hint


@inner(error_model="numpy", _nrt=False, forceinline=True)
def _film_alone(
    cubic: float,
    linear: float,
    cut_off: float,
    suction: float,
    h: float,
    S: float,
    z0: float,
    base: float,
    guess: float,
) -> tuple[float, bool]:
    """Film force of a step that starts open, and whether it also ends open.

    ``excess`` is concave over ``z > 0``: Newton's method overshoots at most once, to smaller ``z``.
    """
    rate = 1.0 / h
    x0 = z0 + cut_off
    inverse0 = 1.0 / x0
    z = max(base + S * guess, 0.0)
    film = 0.0
    for _ in range(FILM_NEWTON_LIMIT):
        x = z + cut_off
        inverse = 1.0 / x
        film = rate * _film_mean(cubic, linear, x0, x, inverse0, inverse, z0 - z)
        pulled = film <= -suction
        if pulled:
            film = -suction
        excess = z - base - S * film
        slope, curvature = 0.0, 0.0
        if not pulled:
            damper = cubic * inverse * inverse
            slope = (damper + linear) * inverse * rate
            curvature = (3.0 * damper + linear) * inverse * inverse * rate
        step = excess / (1.0 + S * slope)
        if abs(excess) <= ROUND_OFF * (z + abs(base)) or (
            curvature * step * step <= FORCE_LEFT * abs(film)
            and step < z
            and not (pulled and step > 0.0)
        ):
            film += slope * step
            if pulled or film >= -suction:
                return film, True
        if z == 0.0 and excess > 0.0:
            return 0.0, False
        z = max(z - step, 0.0)
    return film, False


@inner(error_model="numpy", _nrt=False, forceinline=True)
def _both(
    kind: int,
    p: Vector,
    start: int,
    chi_over_h: float,
    cubic: float,
    linear: float,
    cut_off: float,
    suction: float,
    h: float,
    G: float,
    series: float,
    theta: float,
    z0: float,
    g_free: float,
    e0: float,
    guess: float,
    hint: int,
) -> Step:
    """:func:`solve_interface` with film and contact.

    ``excess = z - base - S (F_c + F_f)`` rises with a slope of 1 or more, so its root lies within
    ``|excess|`` of any ``z``.  A Newton step that would cross ``z = 0``, where the film ends with a
    kink, stops there: beyond it ``excess`` is concave, and Newton's method cannot fail.
    """
    S, base = _line(G, series, theta, g_free, e0)
    open0, rate = max(z0, 0.0), 1.0 / h
    x0 = open0 + cut_off
    inverse0 = 1.0 / x0
    z = base + S * guess
    low, high, before = -np.inf, np.inf, np.inf
    contact, film = 0.0, 0.0
    for _ in range(FILM_NEWTON_LIMIT):
        contact, stiffness, curvature, longest = 0.0, 0.0, 0.0, np.inf
        if (z0 < 0.0 or z < 0.0) and kind != NO_LAW:
            contact, stiffness, longest, hint = _contact(kind, p, start, chi_over_h, z0, z, hint)
        open1 = max(z, 0.0)
        x = open1 + cut_off
        inverse = 1.0 / x
        film = rate * _film_mean(cubic, linear, x0, x, inverse0, inverse, open0 - open1)
        pulled = film <= -suction
        if pulled:
            film = -suction
        excess = z - base - S * (contact + film)
        film_slope = 0.0
        if not pulled and (z > 0.0 or (z == 0.0 and excess < 0.0)):
            damper = cubic * inverse * inverse
            film_slope = (damper + linear) * inverse * rate
            curvature = (3.0 * damper + linear) * inverse * inverse * rate
        step = excess / (1.0 + S * (stiffness + film_slope))
        after = z - step
        kinked = z == 0.0 or (z > 0.0) != (after > 0.0) or (pulled and step > 0.0)
        # taken without a look back, and before the bracket test: both its ends are round-off then
        if abs(excess) <= ROUND_OFF * (abs(z) + abs(base)) or (
            not kinked
            and abs(step) <= longest
            and curvature * step * step <= FORCE_LEFT * (contact + abs(film))
        ):
            contact = max(contact + stiffness * step, 0.0)
            if pulled or film + film_slope * step >= -suction:
                film += film_slope * step
                break
        if excess > 0.0:
            low, high = max(low, z - excess), z
        else:
            low, high = z, min(high, z - excess)
        if z != 0.0 and (z > 0.0) != (after > 0.0) and low < 0.0 < high:
            after = 0.0
        # about the kinks of laws with memory Newton's method can turn in a circle
        elif kind >= LAW_RUBBING and 2.0 * abs(step) > before:
            after = 0.5 * (low + high)
        before = abs(step)
        if not low <= after <= high:
            after = 0.5 * (low + high)
        z = after
    lost = 0.0
    if chi_over_h != 0.0:
        lost = _damping_loss(kind, p, start, contact, z0, base + S * (contact + film), hint)
    g1 = g_free + G * (contact + film)
    e1, relaxed = _compressed(series, theta, contact + film, e0)
    return contact, film, g1, e1, hint, lost, film * (z0 - (g1 + e1)) + relaxed


@inner(error_model="numpy", _nrt=False, forceinline=True)
def _contact(
    kind: int, p: Vector, start: int, chi_over_h: float, z0: float, z: float, hint: int
) -> tuple[float, float, float, int]:
    """Contact force, its slope, longest last Newton step, table interval."""
    deep = -min(z0, z)
    if chi_over_h * deep > 1.0:
        deep = 1.0 / chi_over_h
    longest = (RUBBED_LEFT if kind >= LAW_RUBBING else STEP_LEFT) * deep
    if kind == LAW_LINEAR and z0 <= 0.0 and z <= 0.0:
        mean, slope = -0.5 * p[start] * (z0 + z), 0.5 * p[start]
        if chi_over_h == 0.0:
            longest = np.inf
    else:
        mean, slope, hint = mean_force(kind, p, start, -z0, -z, hint)
    if chi_over_h == 0.0:
        return mean, slope, longest, hint
    factor = 1.0 + chi_over_h * (z0 - z)
    if factor <= 0.0:
        return 0.0, 0.0, longest, hint  # the law would pull
    return mean * factor, slope * factor + mean * chi_over_h, longest, hint


@inner(error_model="numpy", _nrt=False, forceinline=True)
def _damping_loss(
    kind: int, p: Vector, start: int, contact: float, z0: float, z1: float, hint: int
) -> float:
    """Work of the contact force that the elastic law does not store."""
    if kind == NO_LAW or (z0 >= 0.0 and z1 >= 0.0):
        return 0.0
    mean, _, _ = mean_force(kind, p, start, -z0, -z1, hint)
    return (contact - mean) * (z0 - z1)
