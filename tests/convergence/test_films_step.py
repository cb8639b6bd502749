"""Truth: order two of film, asperities and compliance together, on two rods of 60 modes."""

import numpy as np
import pytest

from klack.contact.laws import LinearLaw
from klack.network.rows import FilmRow
from klack.verification.interface_motion import interface_motion
from klack.verification.one_dimension import steel_rod


@pytest.mark.parametrize("suction", [1e9, 0.6], ids=["pulling", "cavitating"])
def test_rods_with_asperities_in_a_film(suction):
    a, b = steel_rod("a", 0.04, 20), steel_rod("b", 0.08, 40)
    film = FilmRow(cubic=5e-17, linear=0.0, cut_off=0.2e-6, suction=suction)
    omega = np.concatenate([a.omega, b.omega])
    weight = np.concatenate([omega, np.ones(omega.size)])

    def run(n):
        return interface_motion(
            a,
            b,
            LinearLaw(1e10),
            film=film,
            series=1e-9,
            gap=5e-6,
            speed=0.5,
            step=60e-6 / n,
            steps=n,
        )

    fine = run(48_000)
    counts = np.array([750, 1500, 3000, 6000])
    runs = [run(int(n)) for n in counts]
    errors = [
        np.linalg.norm(weight * (m.state - fine.state)) / np.linalg.norm(weight * fine.state)
        for m in runs
    ]

    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    # the film ends and the contact begins somewhere inside one step: order 1, and scatter
    assert order > 0.7
    assert errors[2] < 1e-3  # 20 ns
    assert runs[2].peak_force == pytest.approx(fine.peak_force, rel=5e-4)
    assert runs[2].film_loss.sum() == pytest.approx(fine.film_loss.sum(), rel=1e-4)
