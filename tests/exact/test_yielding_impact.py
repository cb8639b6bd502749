"""``klack impact`` of bodies that yield."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from klack.acoustics.comparison import compare_histories
from klack.analyses.impact.run import run_impact
from klack.assembling.reduced_pair import impact_system
from klack.case.reader import read_case
from klack.contact.yielding_law import YieldingLaw
from klack.errors import InputError
from klack.exchange.modal_model import _without_memory
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.simulation.compile import propose_step

SPHERES = Path(__file__).parents[1] / "data" / "case" / "yielding_spheres.yaml"
YIELD = ", yield: 280 MPa, hardening: {isotropic: 1 GPa}"


def _case(given=YIELD, *changes):
    text = SPHERES.read_text("utf-8")
    assert YIELD in text
    text = text.replace(YIELD, given)
    for old, new in (
        ("reduced_step: 10 ns", "reduced_step: 10 ns, interface_step: 5 ns"),
        *changes,
    ):
        assert old in text
        text = text.replace(old, new)
    return read_case(text, SPHERES)


@cache
def _study(given=YIELD, levels=("reduced", "interface"), *changes):
    return run_impact(_case(given, *changes), levels=levels)


@pytest.mark.parametrize("level", ["reduced", "interface"])
@pytest.mark.slow
def test_levels_with_yield_keep_the_energy(level):
    """Conservation: what yields is what is missing."""
    study = _study()
    result = study.levels[level]

    assert study.reference == "reduced"  # the law has the loops themselves
    assert "yield" in result.label
    assert not result.doubts
    assert abs(result.energy_residual) < 1e-12
    E = result.energies["initial kinetic"]
    left = sum(v for k, v in result.energies.items() if k not in ("initial kinetic", "plastic"))
    assert result.energies["plastic"] == pytest.approx(E - left, abs=1e-12 * E)
    assert 0.01 < result.energies["plastic"] / E < 0.6


@pytest.mark.slow
def test_elastic_levels_are_doubted_and_the_law_is_measured_with_yield():
    """Truth: the interface level, whose points yield too, as far as its modes leave it open."""
    lumped = ("contact:\n", "lumped: {stiffness: 1e8 N/m}\ncontact:\n")
    study, elastic = _study(YIELD, ("lumped", "reduced", "interface"), lumped), _study("")

    assert any("Try: level reduced, which has it" in d for d in study.levels["lumped"].doubts)
    for level in ("reduced", "interface"):
        assert study.levels[level].measures.restitution < 0.99 * (
            elastic.levels[level].measures.restitution
        )
    found, margin = study.estimates["reduced"], study.estimate_margins["reduced"]
    points, law = (study.levels[name].history for name in ("interface", "reduced"))
    apart = compare_histories(points, law)
    assert found.peak_force == pytest.approx(apart.peak_force, abs=2.0 * margin.peak_force)
    assert found.history_l2 > 2.0 * elastic.estimates["reduced"].history_l2
    assert study.estimate_basis.endswith("yield by a pressure limit")
    assert sum("first impact on new faces: yield takes" in text for text in study.warnings) == 1


@pytest.mark.slow
def test_a_high_yield_stress_changes_no_bit():
    """Exact."""
    hard, elastic = _study(", yield: 4 GPa"), _study("")

    for level in elastic.levels:
        np.testing.assert_array_equal(
            hard.levels[level].history.force, elastic.levels[level].history.force
        )
        assert not hard.levels[level].doubts
    assert hard.reference == elastic.reference


@pytest.mark.slow
def test_yield_beside_friction_is_left_out_aloud():
    study = _study(YIELD, ("reduced",), ("  gap: 0 um", "  gap: 0 um\n  friction: 0.1"))

    assert "plastic" not in study.levels["reduced"].energies or (
        study.levels["reduced"].energies["plastic"] == 0.0
    )
    assert any("faces have either yield or contact.friction" in text for text in study.warnings)


def test_a_law_without_a_step_of_its_own_and_an_export():
    """Bad input: exported models have no memory."""
    law = YieldingLaw(
        largest=np.array([1e-6, 2e-6]),
        set=np.array([0.0, 5e-7]),
        closing=np.array([100.0, 150.0]),
        shape=np.tile(np.linspace(0.0, 1.0, 5) ** 2, (2, 1)),
    )
    # the steepest line: 150 N over 1.5 um between two places of (i/4)^2 is 1 of the secant
    assert law.stiffest == pytest.approx(1e8, rel=1e-12)
    system = impact_system(
        _case(), rigid_mass_body("a", 1e-3, port="contact"), fixed_body("b", port="contact"), law
    )

    # a hundredth of the half period of that mass on that spring, in steps of 1, 2 and 5
    assert 5e-8 <= propose_step(system, speed=0.1) <= 0.01 * np.pi * np.sqrt(1e-3 / 1e8)
    with pytest.raises(InputError, match="without a yield stress"):
        _without_memory(system.contacts[0])
