"""Eddy ladders against the exact diffusion of flux into a cylinder and a sheet."""

from itertools import pairwise
from math import pi

import numpy as np
import pytest
from scipy.special import iv

from klack.errors import InputError
from klack.magnetics.eddy import cylinder_ladder, sheet_ladder
from klack.magnetics.iron import VACUUM_PERMEABILITY as MU0
from klack.magnetics.reluctance import LinearReluctance
from klack.magnetics.solenoid import Solenoid

SIGMA, LENGTH, A, MU_R, WIDTH = 1.6e6, 20e-3, 2e-3, 600.0, 9e-3
TAU = MU0 * MU_R * SIGMA * A**2


def cylinder(terms):
    R = LENGTH / (MU0 * MU_R * pi * A**2)
    ladder = cylinder_ladder(
        conductivity=SIGMA, length=LENGTH, radius=A, permeability=MU_R, terms=terms
    )
    return R, ladder, lambda z: z * iv(0, z) / (2 * iv(1, z))


def sheet(terms):
    R = LENGTH / (MU0 * MU_R * A * WIDTH)
    ladder = sheet_ladder(
        conductivity=SIGMA, length=LENGTH, thickness=A, width=WIDTH, permeability=MU_R, terms=terms
    )
    return R, ladder, lambda z: 0.5 * z / np.tanh(0.5 * z)


@pytest.mark.parametrize("body", [cylinder, sheet])
def test_more_terms_are_better_and_four_reach_omega_tau_30(body):
    frequency = 30.0
    exact = body(1)[2](np.sqrt(1j * frequency))

    errors = []
    for terms in (1, 2, 3, 4):
        R, ladder, _ = body(terms)
        errors.append(abs(1 + ladder.mmf_per_flux(1j * frequency / TAU) / R - exact) / abs(exact))

    assert all(later < 0.4 * earlier for earlier, later in pairwise(errors))
    assert errors[-1] < 2e-3


@pytest.mark.parametrize("body", [cylinder, sheet])
def test_first_terms_of_the_power_series(body):
    # a ladder of n terms is exact to order 2n - 1 in s tau
    for terms in (1, 2, 3):
        R, ladder, exact = body(terms)
        errors = [
            abs(1 + ladder.mmf_per_flux(1j * w / TAU) / R - exact(np.sqrt(1j * w)))
            for w in (0.5, 1.0)
        ]

        assert np.log2(errors[1] / errors[0]) == pytest.approx(2 * terms, abs=0.1)


@pytest.mark.parametrize("body", [cylinder, sheet])
@pytest.mark.parametrize("frequency", [0.1, 10.0, 1e4])
def test_ladder_is_passive(body, frequency):
    _, ladder, _ = body(4)

    impedance = ladder.mmf_per_flux(1j * frequency / TAU)

    assert impedance.imag > 0  # loses power
    assert impedance.real >= 0  # stores energy


def test_static_flux_passes():
    assert cylinder(3)[1].mmf_per_flux(0.0) == 0.0


@pytest.mark.parametrize("terms", [1, 2, 4])
def test_loops_of_a_solenoid_are_the_ladder(terms):
    solenoid = Solenoid(
        turns=1,
        resistance=1.0,
        gap=1e-4,
        residual_gap=5e-5,
        poles=[{"outer_radius": 3e-3, "fringing": "none"}],
        leakage=1e-9,
        eddy=[
            {
                "conductivity": SIGMA,
                "length": LENGTH,
                "radius": A,
                "terms": terms,
                "permeability": MU_R,
            }
        ],
    )
    circuit, s = solenoid.circuit(), 2j * pi * 3e3
    slope = np.array(
        [
            b.law.reluctance if isinstance(b.law, LinearReluctance) else float(b.law.slope(0, 1e-4))
            for b in circuit.branches
        ]
    )
    C = circuit.loops

    impedance = C.T @ ((slope + s * circuit.eddy)[:, None] * C)
    fluxes = np.linalg.solve(impedance, circuit.loop_turns)

    gap = 1.5e-4 / (MU0 * pi * 9e-6)
    ladder = cylinder_ladder(
        conductivity=SIGMA, length=LENGTH, radius=A, permeability=MU_R, terms=terms
    )
    assert 1.0 / fluxes[0] == pytest.approx(gap + ladder.mmf_per_flux(s), rel=1e-9)
    assert fluxes[1] == pytest.approx(1e-9, rel=1e-12)
    assert C.shape[1] == 1 + terms


def test_too_many_terms():
    with pytest.raises(InputError, match="expected 1 to 4"):
        cylinder(5)
