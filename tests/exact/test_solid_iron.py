"""Shells of solid iron: the ladder written from the other end, and what a case may say of them."""

import numpy as np
import pytest

from klack.magnetics.eddy import cylinder_ladder, sheet_ladder
from klack.magnetics.iron import VACUUM_PERMEABILITY
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.solenoid_parts import IronPart
from klack.magnetics.solid_iron import shells
from klack.magnetics.static import static_state
from klack.magnetics.voltage_step import VoltageStep
from klack.verification.drivers import run_coil

MAGNET = {
    "turns": 60,
    "resistance": 0.8,
    "gap": 1e-4,
    "residual_gap": 3e-5,
    "poles": [{"outer_radius": 3e-3, "fringing": "none"}],
    "leakage": 2e-8,
}
IRON = {"material": "X6Cr17", "length": 2e-2, "area": 3e-5}


@pytest.mark.parametrize("terms", [1, 2, 3, 4])
@pytest.mark.parametrize("shape", ["cylinder", "sheet"])
def test_they_are_the_ladder_and_its_core(shape, terms):
    core = {"conductivity": 2e6, "length": 1e-2, "permeability": 700.0, "terms": terms}
    if shape == "cylinder":
        ladder = cylinder_ladder(**core, radius=2e-3)
        R, size = 1e-2 / (VACUUM_PERMEABILITY * 700.0 * np.pi * 4e-6), 2e6 * 1e-2 / np.pi
    else:
        ladder = sheet_ladder(**core, thickness=2e-3, width=5e-3)
        R, size = 1e-2 / (VACUUM_PERMEABILITY * 700.0 * 1e-5), 2e6 * 1e-2 * 2e-3 / 5e-3
    parts = shells(shape, terms)

    for s in (1e2, 1e4j, 1e6 * (1 + 1j)):
        value = 0.0
        for w, q in zip(parts.shares[::-1], parts.turns[::-1], strict=True):
            admittance = w / R + (1.0 / value if value else 0.0)
            value = s * q * size + 1.0 / admittance
        assert value == pytest.approx(R + ladder.mmf_per_flux(s), rel=1e-12)
    assert sum(parts.shares) == pytest.approx(1.0, rel=1e-14)
    assert min(*parts.shares, *parts.turns) > 0.0


def test_at_rest_they_are_the_iron():
    plain = Solenoid(**MAGNET, iron=[IRON])
    solid = Solenoid(**MAGNET, iron=[{**IRON, "eddy": {"conductivity": 2e6, "terms": 4}}])

    for current in (0.5, 5.0, 20.0):
        states = [static_state(s.circuit(), current=current, gap=5e-5) for s in (plain, solid)]
        assert states[1].force == pytest.approx(states[0].force, rel=1e-7)
        assert states[1].linkage == pytest.approx(states[0].linkage, rel=1e-7)


@pytest.mark.parametrize("hysteresis", [None, {"coercivity": 300.0, "initial_permeability": 150}])
def test_a_stroke_keeps_its_energy(hysteresis):
    solid = Solenoid(
        **MAGNET,
        iron=[{**IRON, "hysteresis": hysteresis, "eddy": {"conductivity": 2e6, "terms": 3}}],
    )

    run = run_coil(
        solid.circuit(),
        VoltageStep(voltage=24.0, end=3e-4, decay=48.0).program(),
        resistance=0.8,
        gap=1e-4,
        step=1e-6,
        lift=9e-5 * np.sin(np.linspace(0.0, np.pi, 801)) ** 2,
    )

    assert run.residual < 1e-13
    assert run.eddy > 0.0
    assert (run.hysteresis > 0.0) == (hysteresis is not None)


def test_one_shell_is_one_turn():
    ladder = Solenoid(**MAGNET, iron=[IRON], eddy=[
        {"conductivity": 2e6, "length": 2e-2, "radius": float(np.sqrt(3e-5 / np.pi))}])  # fmt: skip
    shell = Solenoid(**MAGNET, iron=[{**IRON, "eddy": {"conductivity": 2e6, "terms": 1}}])

    drive, lift = VoltageStep(voltage=24.0).program(), np.zeros(301)
    runs = [
        run_coil(s.circuit(), drive, resistance=0.8, gap=1e-4, step=1e-6, lift=lift)
        for s in (ladder, shell)
    ]

    np.testing.assert_allclose(runs[1].current, runs[0].current, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    ("eddy", "words"),
    [
        ({"conductivity": 2e6, "thickness": 1e-3}, "thickness together with shape: cylinder"),
        ({"conductivity": 2e6, "shape": "sheet"}, "no key 'thickness'"),
        ({"conductivity": 2e6, "terms": 5}, "less than or equal to 4"),
        ({"conductivity": 0.0}, "greater than 0"),
    ],
)
def test_errors_say_what_to_do(eddy, words):
    with pytest.raises(ValueError, match=words):
        IronPart(**IRON, eddy=eddy)


def test_too_many_terms_are_one_clear_error():
    solid = {**IRON, "eddy": {"conductivity": 2e6, "terms": 4}}
    with pytest.raises(ValueError, match=r"4 \+ 4 terms"):
        Solenoid(**MAGNET, iron=[solid, solid])
