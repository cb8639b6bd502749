"""The published lifting magnet, point by point, from its drawing and without fitting."""

import numpy as np
import pytest
from draws import each

from klack.magnetics.lifting_magnet import lifting_magnet
from klack.magnetics.static import static_state
from klack.verification import published_magnets as published


@pytest.fixture(scope="module")
def states():
    circuit = lifting_magnet()
    return [
        (circuit, static_state(circuit, current=published.CURRENT, gap=float(x)))
        for x in published.GAP
    ]


def test_table_is_whole():
    assert published.GAP.size == 20
    assert published.GAP[0] == pytest.approx(0.25e-3)
    assert published.FORCE[0] == pytest.approx(-85.8619)


@each("point", range(20))
def test_force_and_inductance(states, point):
    _, state = states[point]

    # flux tubes against finite elements: 10 % was asked for, -8 % and -5.3 % is what they reach
    assert state.force == pytest.approx(published.FORCE[point], rel=0.09)
    assert state.inductance == pytest.approx(published.INDUCTANCE[point], rel=0.06)


@each("point", range(20))
def test_armature_flux(states, point):
    circuit, state = states[point]
    names = [branch.name for branch in circuit.branches]
    armature = [names.index(f"core {k}") for k in (4, 5)]

    flux = np.max(state.branch_fluxes[armature])

    assert flux == pytest.approx(published.ARMATURE_FLUX[point], rel=0.05)
