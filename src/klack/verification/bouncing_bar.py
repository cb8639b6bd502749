"""A bar that bounces on a wall under a weight, by full order, interface and reduced level.

The benchmark of Doyen, Ern & Piperno 2011 (SIAM J. Sci. Comput. 33, 223-249): a weight of
``2/3 m v / T``, with the speed v of the first touch and the return time ``T = 2 L / c``.  By
d'Alembert's solution the first contact takes T, and its force rises linearly from ``Z v`` to
``5/3 Z v``, since the weight adds ``Z g`` per time to what a wave in free fall brings.  The bar
leaves with the speed it came with, vibrates, and flies for 3 T, which are three of its longest
periods; so the second contact is the first one backwards in time, and all begins anew after 8 T.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from klack.contact.history import ImpactHistory
from klack.contact.laws import LinearLaw
from klack.simulation.bodies import fixed_body
from klack.simulation.impact import simulate_impact
from klack.transient.interface_run import simulate_interface
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.interface_bodies import free_rod
from klack.verification.one_dimension import BAR_SPEED, one_contact, steel_rod
from klack.verification.transient import STEEL, drop_rod, since_touch

__all__ = ["RETURN_TIME", "bounce", "bouncing_bar_checks", "exact_force", "lines_of_force"]

_LENGTH, _SPEED = 0.03, 0.5  # [m], [m/s]
RETURN_TIME = {
    "full": 2.0 * _LENGTH / STEEL.bar_wave_speed,
    "interface": 2.0 * _LENGTH / STEEL.bar_wave_speed,
    "reduced": 2.0 * _LENGTH / BAR_SPEED,
}
"""``2 L / c`` [s] of the bar at each level."""


def exact_force(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Force [Z v] at times [T] since the first touch.

    >>> exact_force(np.array([0.0, 0.75, 2.0, 4.0, 4.75])).round(3).tolist()
    [1.0, 1.5, 0.0, 1.667, 1.167]
    """
    contact, along = np.divmod(time, 4.0)
    rising = 1.0 + 2.0 / 3.0 * np.where(contact % 2 == 0, along, 1.0 - along)
    return np.where((time >= 0.0) & (along < 1.0), rising, 0.0)


def bounce(level: str, size: int, *, duration: float) -> ImpactHistory:
    """Bar of steel, 30 mm long, at 0.5 m/s.

    Parameters
    ----------
    level
        One of :data:`RETURN_TIME`.
    size
        Elements of the full order, modes of the others.
    duration [T]
    """
    back = RETURN_TIME[level]
    if level == "full":
        area = 1e-4
        return drop_rod(
            _LENGTH,
            elements=size,
            area=area,
            speed=_SPEED,
            weight=_weight(STEEL.density * area * _LENGTH, back),
            returns=duration,
        ).history
    step, end = back / 4000, duration * back
    if level == "interface":
        model = free_rod(size, stiffness=1e30)
        return simulate_interface(
            model,
            speed=_SPEED,
            duration=end,
            step=step,
            force=_weight(model.mass, back),
            points=False,
        ).history
    bar = steel_rod("bar", _LENGTH, size)
    rest = LinearLaw(1.0 / float(bar.residual_compliance[0, 0]))
    wall = fixed_body("wall", port="top")
    system = one_contact(bar, wall, rest, gap=1e-9, press=_weight(bar.mass, back))
    return simulate_impact(system, speed=_SPEED, step=step, duration=end)


def lines_of_force(level: str, history: ImpactHistory) -> Iterator[tuple[float, float, float]]:
    """First touch [T], and force [Z v] at the start and the end of a line through each contact."""
    time, force = _scaled(level, history)
    for begin in np.arange(0.0, time[-1] - 1.0, 4.0):
        near = (time > begin - 1.0) & (time < begin + 2.0)
        inside = (time > begin + 0.1) & (time < begin + 0.9)
        slope, start = np.polyfit(time[inside] - begin, force[inside], 1)
        yield float(time[near][np.argmax(force[near] > 0.5)]), start, start + slope


def bouncing_bar_checks(level: str, size: int, tolerance: float, late: float) -> Iterator[Check]:
    """Two contacts and the flight between them.

    Parameters
    ----------
    size
        As of :func:`bounce`.
    tolerance
        Of the forces, relative.
    late
        Of the second touch, relative.
    """
    history = bounce(level, size, duration=5.6)
    name = f"bar that bounces under its weight, {size} {'elements' if level == 'full' else 'modes'}"
    source = (
        "Doyen, Ern & Piperno 2011; d'Alembert: F = Z v (1 + 2/3 t/T), T = 2 L/c, and backwards"
    )
    time, force = _scaled(level, history)
    fine = np.linspace(0.0, 5.6, 2000)
    curve = ComparedCurve(
        x_label="time since first touch [2 L/c]",
        y_label="force [Z v]",
        expected=(fine, exact_force(fine)),
        computed=(time, force),
    )
    (_, *first), (touch, *second) = lines_of_force(level, history)
    ends = (1.0, 5.0 / 3.0, 5.0 / 3.0, 1.0)
    words = ("at the first touch", "at the release", "at the second touch", "at its release")
    for known, found, when in zip(ends, first + second, words, strict=True):
        yield check(
            f"{name}: force {when} [Z v]",
            known,
            found,
            tolerance,
            source,
            curve,
            reason="one tolerance for both contacts; the second has the errors of the first",
        )
    yield check(f"{name}: second touch [2 L/c]", 4.0, touch, late, source, curve)


def _weight(mass: float, back: float) -> float:
    return 2.0 / 3.0 * mass * _SPEED / back


def _scaled(level: str, history: ImpactHistory) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    back = RETURN_TIME[level]
    impulse = 2.0 * history.mass_a * _SPEED  # Z v T
    return since_touch(history) / back, history.force * back / impulse
