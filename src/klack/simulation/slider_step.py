r"""Friction of two bodies that slide along each other, over one step: Coulomb's law, set-valued.

With a constant force *f* over a step of length *h* the modes move exactly, so that way and speed of
slip at its end are

.. math:: \Delta = \Delta_f + G f, \qquad v_1 = v_f + D f .

Friction is a viscous part and a dry one,

.. math:: f = -\frac{b}{h}\,\Delta - C\,\mathrm{sign}\,\Delta, \qquad
    0 \le C \le L(|\Delta|/h), \qquad L(v) = F_c + (F_s - F_c)\, e^{-(v/v_s)^2} ,

and of all *C* the largest with which neither :math:`\Delta` nor :math:`v_1` turns round.  So it
holds a body at rest against any force up to :math:`F_s`, without creep; slides against it with
*L*; and in the step in which a body comes to rest it stops the body there.  (A force that makes
:math:`\Delta` vanish would leave :math:`v_1 = -v_0`, and a body at rest would tremble.)  The loss
:math:`-f \Delta` is never negative.

Where *L* falls with the speed, a body may stick or slip in the same step.  Which of both is decided
once in a step, before the contacts answer: else these and the friction would take turns endlessly.

Where *v* turns round within the step by other forces, *C* is 0 for this step: an error of the
impulse below :math:`F_s h`.
"""

from math import exp

from klack.compiling.jit import njit

__all__ = ["largest_friction", "slider_force"]

_TURNS = 60
_LEFT = 1e-14  # of the way without friction


@njit(error_model="numpy", _nrt=False)
def largest_friction(
    coulomb: float,
    excess: float,
    stribeck: float,
    viscous: float,
    h: float,
    G: float,
    way: float,
) -> float:
    """Dry friction [N] of a step at most: ``Fs`` where it holds, else ``L`` at its speed of slip.

    Parameters
    ----------
    coulomb, excess : float [N]
        ``Fc`` and ``Fs - Fc``, not negative.
    stribeck : float [m/s]
    viscous : float [N s/m]
    h : float [s]
    G : float [m/N]
        Way per force, above 0.
    way : float [m]
        Without the force.
    """
    yielding = 1.0 / (1.0 + G * viscous / h)
    g, a = G * yielding, abs(way) * yielding
    if excess == 0.0 or a <= g * (coulomb + excess):
        return coulomb + excess
    # h u + g L(u) = a
    low, high = (a - g * (coulomb + excess)) / h, (a - g * coulomb) / h
    u, level = high, coulomb
    for _ in range(_TURNS):
        x = u / stribeck
        part = excess * exp(-x * x) if x * x < 40.0 else 0.0
        level = coulomb + part
        left = h * u + g * level - a
        if abs(left) <= _LEFT * a:
            break
        if left > 0.0:
            high = u
        else:
            low = u
        slope = h - 2.0 * g * part * x / stribeck
        u = u - left / slope if slope > 0.0 else low
        if not low < u < high:
            u = 0.5 * (low + high)
    return level


@njit(error_model="numpy", _nrt=False)
def slider_force(
    most: float, viscous: float, h: float, G: float, D: float, way: float, speed: float
) -> tuple[float, float]:
    """Friction of one slider over a step, and the way that it slips.

    Parameters
    ----------
    most : float [N]
        Dry friction at most, see :func:`largest_friction`.
    viscous : float [N s/m]
    h : float [s]
    G : float [m/N]
        Way per force, above 0.
    D : float [m/(N s)]
        Speed at the end of the step per force, above 0.
    way, speed : float [m], [m/s]
        Without the force.

    Returns
    -------
    force : float [N]
        Mean over the step, on the body whose way counts.
    way : float [m]
        With the force.
    """
    drag = viscous / h
    yielding = 1.0 / (1.0 + G * drag)
    way *= yielding
    g = G * yielding
    speed -= D * drag * way
    sign = 1.0 if way > 0.0 else -1.0
    dry = min(most, abs(way) / g, max(sign * speed / (D * (1.0 - drag * g)), 0.0))
    slip = way - sign * g * dry
    if sign * slip < 0.0:
        slip = 0.0  # round-off
    return -drag * slip - sign * dry, slip
