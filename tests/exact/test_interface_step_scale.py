"""Truth: one step of contact and film has no length of its own (exact, bit for bit).

Everything ``s`` times as large, at the same speeds, takes ``s^2`` times the forces.  With ``s`` a
power of four every factor is a power of two, so that not even the last digit may differ.
"""

from dataclasses import dataclass

import numpy as np
import pytest

from klack.contact.laws import ContactLaw, HertzLaw, LinearLaw, TableLaw
from klack.contact.step_constants import NO_LAW
from klack.simulation.interface_step import solve_interface

pytestmark = pytest.mark.slow

DEPTHS = np.array([0.2, 0.5, 1.0, 2.0])


@dataclass(frozen=True, kw_only=True)
class Step:
    """One step in front of a stop: lengths in um, forces in N where ``s`` is 1."""

    gap: float
    reach: float  # gap at its end without a force
    compression: float
    chi: float
    cubic: float
    linear: float
    suction: float
    series: float
    guess: float

    def forces(self, law: str, s: float) -> np.ndarray:
        """Contact force, film force, gap and compression, counted in their scales."""
        kind, numbers = flat(law, s)
        found = solve_interface(
            kind,
            numbers,
            0,
            self.chi * 1e6 / s,
            self.cubic * 1e-16 * s**5,
            self.linear * 1e-11 * s**3,
            0.3e-6 * s,
            self.suction * s**2,
            20e-9 * s,
            1e-9 / s,
            self.series * 1e-9 / s,
            self.gap * 1e-6 * s,
            self.reach * 1e-6 * s,
            self.compression * 1e-6 * s,
            self.guess * s**2,
            0,
            0.0,
        )
        return np.array(found[:4]) / [s**2, s**2, s, s]


def flat(name: str, s: float) -> tuple[int, np.ndarray]:
    laws: dict[str, ContactLaw] = {
        "linear": LinearLaw(1e8 * s),
        "hertz": HertzLaw(1e11 * s**0.5),
        "table": TableLaw(DEPTHS * 1e-6 * s, np.array([20.0, 70.0, 190.0, 520.0]) * s**2),
    }
    if name == "none":
        return NO_LAW, np.zeros(1)
    law = laws[name].flat()
    return law.kind, np.asarray(law.parameters)


def steps(count: int, film: bool) -> list[Step]:
    rng = np.random.default_rng(3)
    found = []
    for _ in range(count):
        gap = rng.uniform(-0.5, 0.5)
        series = float(rng.choice([0.0, 1.0]))
        found.append(
            Step(
                gap=gap,
                reach=gap - rng.uniform(-0.1, 0.1),
                compression=series * rng.uniform(0.0, 0.02),
                chi=float(rng.choice([0.0, 20.0])),
                cubic=film * rng.uniform(0.1, 3.0),
                linear=film * rng.uniform(0.0, 3.0),
                suction=rng.uniform(0.1, 20.0),
                series=series,
                guess=rng.uniform(-1.0, 30.0),
            )
        )
    return found


@pytest.mark.parametrize("film", [False, True], ids=["dry", "film"])
@pytest.mark.parametrize("law", ["linear", "hertz", "table", "none"])
def test_a_step_knows_no_length(law, film):
    """A valve of 10 um and a slide of 10 m."""
    for step in steps(300, film):
        whole = step.forces(law, 1.0)
        assert np.all(np.isfinite(whole))
        for s in (4.0**-5, 4.0**-9, 4.0**5):
            np.testing.assert_array_equal(step.forces(law, s), whole)
