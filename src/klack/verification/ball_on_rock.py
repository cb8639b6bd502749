"""A steel ball that falls on rock: surface velocity beside the impact, measured and computed.

Far from the impact a P wave carries the rate of the force, whose two extremes are 0.608 contact
times apart after Hertz.  At 86 mm, two wave lengths away, near field and free faces change the
pulse, so the waves up to the sensor are computed with the impact (case ``ball-on-rock``).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.analyses.impact.run import run_impact
from klack.case.reader import find_case, read_case
from klack.verification.check import Check, ComparedCurve, check

__all__ = ["Pulse", "ball_on_rock", "computed_pulse", "measured_pulses", "steep_pulses"]

_STEEP = 45.0  # [deg] from the normal of the struck face, up to which the check goes
_PLACE, _P_WAVE = (50e-3, 70e-3), 6200.0  # beside and below the impact [m], [m/s]
_SOURCE = (
    "drops of a steel ball of 2 mm from 0.5 m, kura-okubo/4mNonSelfSim_Paper (MIT), shipped with "
    "the case ball-on-rock: 23 places within 45 degrees"
)
_REASON = "80 % of the measured distances lie within 0.2 us of their middle; steps of 0.1 us"


@dataclass(frozen=True, slots=True)
class Pulse:
    """Velocity [m/s] over time [s] since the onset of the P wave, at one place.

    Parameters
    ----------
    angle [deg]
        Of the ray to the normal of the struck face.
    """

    angle: float
    time: NDArray[np.float64]
    velocity: NDArray[np.float64]

    @property
    def extremes(self) -> tuple[int, int]:
        """Where the highest velocity of the first 4 us is, and the lowest of the 6 us after it."""
        first = int(np.argmax(np.where((self.time > 0.0) & (self.time < 4e-6), self.velocity, 0.0)))
        after = (self.time > self.time[first]) & (self.time < self.time[first] + 6e-6)
        return first, int(np.argmin(np.where(after, self.velocity, np.inf)))

    @property
    def distance(self) -> float:
        """Time between both extremes [s]."""
        first, second = self.extremes
        return float(self.time[second] - self.time[first])

    @property
    def shape(self) -> NDArray[np.float64]:
        """Velocity over its first extreme [-]."""
        return self.velocity / self.velocity[self.extremes[0]]

    @property
    def ratio(self) -> float:
        """Second extreme over the first [-]."""
        return float(self.shape[self.extremes[1]])


def measured_pulses() -> list[Pulse]:
    """One of each place, the steepest first; velocities have a gain that the source fitted."""
    with find_case("ball-on-rock").with_name("velocity.csv").open(encoding="utf-8") as file:
        lines = [line for line in file if not line.startswith("#")]
    angles = [float(name.split(":")[1]) for name in lines[0].split(",")[1:]]
    time, *traces = np.array([line.split(",") for line in lines[1:]], dtype=float).T
    return [Pulse(*one) for one in zip(angles, [time] * len(angles), traces, strict=True)]


def steep_pulses() -> list[Pulse]:
    """Those that the check compares: rays within 45 degrees of the normal."""
    return [one for one in measured_pulses() if one.angle < _STEEP]


def computed_pulse() -> Pulse:
    """Of the shipped case, as its sensor reads it."""
    path = find_case("ball-on-rock")
    found = run_impact(
        read_case(path.read_text(encoding="utf-8"), path), levels=["full"], certify=False
    )
    (gauge,) = found.levels["full"].gauges
    onset = float(np.hypot(*_PLACE)) / _P_WAVE
    angle = float(np.degrees(np.arctan2(*_PLACE)))
    return Pulse(angle, gauge.time - onset, gauge.values)


def ball_on_rock() -> Check:
    """Time between the extremes, against the middle of the measured ones."""
    pulse = computed_pulse()
    steep = steep_pulses()
    mean = np.mean([one.shape for one in steep], axis=0)
    seen = slice(None, None, 5)
    return check(
        "steel ball on rock, velocity 86 mm away: first to second extreme [us]",
        expected=1e6 * float(np.median([one.distance for one in steep])),
        computed=1e6 * pulse.distance,
        tolerance=0.06,
        source=_SOURCE,
        reason=_REASON,
        curve=ComparedCurve(
            x_label="time since the P wave [us]",
            y_label="velocity over its first extreme [-]",
            expected=(1e6 * steep[0].time, mean),
            computed=(1e6 * pulse.time[seen], pulse.shape[seen]),
        ),
    )
