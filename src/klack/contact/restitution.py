r"""Measures of one impact: peak force, contact time, impulse, restitution, vibration left.

Restitution belongs to the centres of mass, never to a point of the surface:

.. math:: e = -\frac{(v_a - v_b)_\text{after}}{(v_a - v_b)_\text{before}}

(``v_b = 0`` for a supported body).  Contacts closer than two longest periods of body a, or than
twice the longest contact before, form one cluster = one impact; ``after`` is after the last of
them.

Times are found inside the records: the impulse since first touch grows like a power ``1 + n`` of
the time (``n = 1`` for a linear law, 1.5 for Hertz), so three sums of the force give the exponent
and the instant of touch; backwards, the end. A force that fades out (as of rods, in theory without
end) ends where it crosses the threshold; it fades out if the way from there to zero takes more
than half the time of the fall from ten times the threshold.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.contact.history import ImpactHistory
from klack.errors import refuse_if

__all__ = ["ContactPhase", "Deviation", "ImpactMeasures", "find_contacts", "measure_impact"]

_CLUSTER = 2.0  # longest periods, or longest contacts, without one
_SETTLING = (0.2, 0.8)  # window after the last contact for the speed of rebound, of that distance
_EXPONENTS = (1.0, 2.0)  # of the force at touch, clamps what noise could suggest


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactPhase:
    """One uninterrupted contact.

    Parameters
    ----------
    start, end [s]
        Located inside the records.
    peak_force [N]
    peak_time [s]
        Middle of its record.
    first, last
        Records ``first <= i < last``.
    """

    start: float
    end: float
    peak_force: float
    peak_time: float
    first: int
    last: int

    @property
    def duration(self) -> float:
        """Time from first touch to separation [s]."""
        return self.end - self.start


@dataclass(frozen=True, kw_only=True)
class ImpactMeasures:
    """Measures of the first impact (cluster of contacts) of a history.

    Parameters
    ----------
    peak_force [N]
        Of any integration step.
    peak_time [s]
        From first touch.
    strongest
        Contact of the cluster with the peak force, from 1.
    first_touch [s]
    contact_time [s]
        First touch to the end of the first contact.
    total_contact_time [s]
        The same of the last contact of the cluster.
    sub_contacts
        Contacts in the cluster.
    impulse [N s]
        Of the cluster.
    approach_speed, rebound_speed [m/s]
        Relative, of the centres of mass, both above zero for an ordinary rebound.
    restitution [-]
        nan where the record ends before separation.
    restitution_from_impulse [-]
        ``J (1/m_a + 1/m_b)/v - 1`` (with the impulse of outside forces): must agree.
    impulse_residual [-]
        ``(J - m_a dv_a + outside) / J`` over the cluster: momentum balance of body a.
    dissipated_share [-]
        Contact dissipation, modal damping and friction of the whole record over the energy of
        approach.
    vibration_share [-]
        ``1 - e^2 - dissipated_share``.
    impacts
        Clusters in the record.
    """

    peak_force: float
    peak_time: float
    first_touch: float
    contact_time: float
    total_contact_time: float
    sub_contacts: int
    impulse: float
    approach_speed: float
    rebound_speed: float
    restitution: float
    restitution_from_impulse: float
    impulse_residual: float
    dissipated_share: float
    vibration_share: float
    impacts: int
    strongest: int = 1

    @property
    def cut_off(self) -> bool:
        """Whether the record ends before separation.

        Peak force, contact time and impulse are then those of the recorded part.
        """
        return self.restitution != self.restitution


@dataclass(frozen=True, kw_only=True)
class Deviation:
    """Deviation of one history from another.

    Parameters
    ----------
    peak_force, contact_time, impulse [-]
        Relative.
    restitution [-]
        Absolute.
    history_l2 [-]
        RMS force difference over the contact, first touch aligned, over the peak force of the
        reference.
    third_octave_max_dB [dB]
        Largest, over the bands of the reference within 40 dB of its highest.
    third_octave_up_to_Hz [Hz]
        Middle frequency of the highest band compared.
    """

    peak_force: float
    contact_time: float
    impulse: float
    restitution: float
    history_l2: float
    third_octave_max_dB: float
    third_octave_up_to_Hz: float


def find_contacts(history: ImpactHistory, *, threshold: float = 5e-3) -> tuple[ContactPhase, ...]:
    """Every contact of a record, in order.

    A contact is a run of records with force above ``threshold`` times the peak force; chatter
    below it neither makes nor prolongs one. Its records extend outwards while the force falls, so
    that the impulse is complete.
    """
    force = history.force
    peak = float(force.max(initial=0.0))
    if peak <= 0.0:
        return ()
    closed = np.concatenate(([False], force > threshold * peak, [False])).astype(np.int8)
    starts = np.flatnonzero(np.diff(closed) == 1)
    ends = np.flatnonzero(np.diff(closed) == -1)
    phases: list[ContactPhase] = []
    for k, (first, last) in enumerate(zip(starts.tolist(), ends.tolist(), strict=True)):
        floor = phases[-1].last if phases else 0
        ceiling = int(starts[k + 1]) if k + 1 < starts.size else force.size
        while first > floor and 0.0 < force[first - 1] < force[first]:
            first -= 1
        while last < ceiling and 0.0 < force[last] < force[last - 1]:
            last += 1
        phases.append(_phase(history, first, last, threshold * peak))
    return tuple(phases)


def measure_impact(history: ImpactHistory, *, threshold: float = 5e-3) -> ImpactMeasures:
    """Measures of the first impact in a history; ``threshold`` as of :func:`find_contacts`."""
    phases = find_contacts(history, threshold=threshold)
    refuse_if(
        not phases,
        "measure_impact: history",
        got=f"no contact force in {history.force.size} records",
        expected="at least one contact",
        hint="simulate longer: the gap takes gap / speed seconds to close.",
    )
    clusters = _clusters(phases, history.longest_period)
    cluster = clusters[0]
    first, last = cluster[0].first, cluster[-1].last
    touch, release = cluster[0].start, cluster[-1].end
    until = clusters[1][0].first if len(clusters) > 1 else history.force.size

    inverse_a, inverse_b = 1.0 / history.mass_a, 1.0 / history.mass_b
    before = _velocity_before(history, first, touch)
    distance = _distance(cluster, history.longest_period)
    after = _velocity_after(history, last, release, until, distance)
    e = -after / before

    strongest = max(cluster, key=lambda phase: phase.peak_force)
    J = float(np.sum(history.force[first:last]) * history.step)
    outside = _outside_speed(history)
    gained = history.velocity_a[last] - history.velocity_a[first] - outside[last] + outside[first]
    drift = np.interp(release, history.edges, outside) - np.interp(touch, history.edges, outside)
    dv = J * (inverse_a + inverse_b) + float(drift)
    approach_energy = 0.5 * before**2 / (inverse_a + inverse_b)
    lost = history.ledger.lost
    return ImpactMeasures(
        peak_force=strongest.peak_force,
        peak_time=strongest.peak_time - touch,
        first_touch=touch,
        contact_time=cluster[0].duration,
        total_contact_time=release - touch,
        sub_contacts=len(cluster),
        impulse=J,
        approach_speed=-before,
        rebound_speed=after,
        restitution=e,
        restitution_from_impulse=dv / -before - 1.0,
        impulse_residual=float(1.0 - history.mass_a * gained / J),
        dissipated_share=lost / approach_energy,
        vibration_share=1.0 - e**2 - lost / approach_energy,
        impacts=len(clusters),
        strongest=cluster.index(strongest) + 1,
    )


def _phase(history: ImpactHistory, first: int, last: int, threshold: float) -> ContactPhase:
    force, h = history.force, history.step
    top = first + int(np.argmax(history.peak_force[first:last]))
    start, end = _onset(force, first, last, threshold, h), force.size * h
    if last < force.size:  # else it never ended
        end -= _onset(force[::-1], force.size - last, force.size - first, threshold, h)
    return ContactPhase(
        start=history.start + start,
        end=history.start + end,
        peak_force=float(history.peak_force[top]),
        peak_time=history.start + (top + 0.5) * h,
        first=first,
        last=last,
    )


def _onset(force: NDArray, first: int, last: int, threshold: float, h: float) -> float:
    """Time of touch in these records, from the beginning of ``force``."""
    touch = (first + 1) * h - _time_since_touch(force[first : min(first + 3, last)], h)
    low = _crossing(force, first, last, threshold, h)
    high = _crossing(force, first, last, 10.0 * threshold, h)
    ends_at_zero = first == 0 or force[first - 1] == 0.0
    if ends_at_zero and low - touch <= max(0.5 * (high - low), h):
        return touch
    return low


def _crossing(force: NDArray, first: int, last: int, level: float, h: float) -> float:
    """Time at which the mean force first exceeds a level, by straight lines."""
    k = first + int(np.argmax(force[first:last] > level))
    below, above = float(force[k - 1]) if k > 0 else 0.0, float(force[k])
    part = (level - below) / (above - below) if above > level > below else 0.0
    return (k - 0.5 + part) * h


def _time_since_touch(force: NDArray[np.float64], h: float) -> float:
    """Closed part of the first record [s], from the first three mean forces."""
    if force.size < 2 or not 0.0 < force[0] < force[1]:
        return h
    J = np.cumsum(force)  # J^(1/(1+n)) is a straight line in time that starts at touch

    def bend(n: float) -> float:
        x = J ** (1.0 / (1.0 + n))
        return float((x[2] - x[1]) - (x[1] - x[0]))

    low, high = _EXPONENTS
    if force.size < 3 or bend(low) <= 0.0:
        n = low
    elif bend(high) >= 0.0:
        n = high
    else:
        n = float(scipy.optimize.brentq(bend, low, high, xtol=1e-12))
    x = J ** (1.0 / (1.0 + n))
    return float(min(h, h * x[0] / (x[1] - x[0])))


def _distance(cluster: list[ContactPhase], longest_period: float) -> float:
    """Time without contact that ends a cluster [s]."""
    return _CLUSTER * max(longest_period, *(phase.duration for phase in cluster))


def _clusters(phases: tuple[ContactPhase, ...], longest_period: float) -> list[list[ContactPhase]]:
    clusters = [[phases[0]]]
    for phase in phases[1:]:
        if phase.start - clusters[-1][-1].end < _distance(clusters[-1], longest_period):
            clusters[-1].append(phase)
        else:
            clusters.append([phase])
    return clusters


def _outside_speed(history: ImpactHistory) -> NDArray[np.float64]:
    """Speed that outside forces have given body a so far, at the record ends [m/s]."""
    gained = np.cumsum(history.external_force) * history.step / history.mass_a
    return np.concatenate(([0.0], gained))


def _velocity_before(history: ImpactHistory, first: int, touch: float) -> float:
    """Relative velocity of the centres of mass at first touch [m/s], negative."""
    relative = history.velocity_a[first] - history.velocity_b[first]
    since = touch - (history.start + first * history.step)
    return float(relative + history.external_force[first] / history.mass_a * since)


def _velocity_after(
    history: ImpactHistory, last: int, release: float, until: int, distance: float
) -> float:
    """Relative velocity at separation: mean over the window, less drift by outside forces."""
    edges = history.edges[last : until + 1]
    if edges.size < 2:
        return float("nan")
    outside = _outside_speed(history)
    drift = outside[last : until + 1] - np.interp(release, history.edges, outside)
    relative = history.velocity_a[last : until + 1] - history.velocity_b[last : until + 1] - drift
    first, final = (release + share * distance for share in _SETTLING)
    settled = (edges >= first) & (edges <= final)
    chosen = settled if np.any(settled) else np.ones(edges.size, dtype=bool)
    return float(np.mean(relative[chosen]))
