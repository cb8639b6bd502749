"""Keys of placement, guide and shots: truth = the numbers in the text, the line of a mistake."""

from math import pi
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import klack
from klack.case import load_case, read_case
from klack.case.distribution import Distribution
from klack.case.key_path import quantity_at, split_path
from klack.errors import InputError
from klack.input.problem import CaseProblem

DATA = Path(__file__).parents[1] / "data" / "case" / "drawn.yaml"
TEXT = DATA.read_text(encoding="utf-8")
HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
GUIDE = "guide: {surface: shaft, heights: [6 mm, 13 mm], clearance: 4 um}\n"
SHOTS = "shots: {count: 20, seed: 7}\n"


def case(more: str = "", old: str = "", new: str = ""):
    text = TEXT + more
    assert text.count(old) >= 1
    return read_case(text.replace(old, new, 1) if old else text, Path("valve.yaml"))


def complaint(more: str = "", old: str = "", new: str = "") -> InputError:
    with pytest.raises(InputError) as caught:
        case(more, old, new)
    return caught.value


def flat() -> tuple[str, str]:
    """Both bodies of the case as half sections."""
    return "model: swept\n      layers: 18", "model: axisymmetric"


def test_placement_arrives_in_si():
    motion = case(
        "",
        "motion: {",
        "motion: {placement: {eccentricity: 1.5 um, direction: 90 deg, tilt: 0.05 deg}, ",
    ).motion

    assert motion.placement.eccentricity == 1.5e-6
    assert motion.placement.direction == pytest.approx(pi / 2)
    assert motion.placement.tilt == pytest.approx(0.05 * pi / 180)
    assert motion.placement.tilt_direction == 0.0
    assert not motion.placement.is_centred
    assert load_case(DATA).motion.placement.is_centred
    assert motion.closing_force == 10.0


def test_guide_arrives_in_si():
    guide = case(GUIDE).guide

    assert guide.heights == (6e-3, 13e-3)
    assert guide.clearance == 4e-6
    assert guide.law.kind == "consistent"
    assert guide.law.bore is None
    assert (guide.friction, guide.viscous) == (0.0, 0.0)
    stiff = GUIDE.replace("}", ", law: {kind: linear, stiffness: 100 N/um}, friction: 0.1}")
    assert case(stiff).guide.law.stiffness == 1e8


def test_shots_arrive_in_si():
    text = """
shots:
  eccentricity: {uniform: [0 um, 3 um]}
  tilt: {rayleigh: 0.01 deg}
  force: {normal: [10 N, 500 mN]}
  waviness: {rms: 0.1 um, harmonics: [2, 6]}
"""
    shots = case(text).shots

    assert (shots.count, shots.seed, shots.impacts, shots.step) == (50, 1, 4, 40e-9)
    assert shots.eccentricity == Distribution("uniform", 0.0, 3e-6)
    assert shots.tilt.first == pytest.approx(0.01 * pi / 180)
    assert shots.force == Distribution("normal", 10.0, 0.5)
    assert shots.waviness.rms == Distribution("fixed", 1e-7)
    assert shots.waviness.harmonics == (2, 6)
    assert shots.friction is None


def test_interface_level_has_its_own_step():
    run = case("", "run: {", "run: {levels: [interface], interface_step: 50 ns, ").run

    assert run.levels == ("interface",)
    assert run.interface_step == 50e-9
    assert load_case(DATA).run.interface_step == 40e-9
    error = complaint("", "run: {", "run: {levels: [interface], interface_step: 50 us, ")
    assert "interface_step" in error.got
    # a step that no level uses is nobody's business
    case("", "run: {", "run: {levels: [reduced], interface_step: 50 us, ")


@pytest.mark.parametrize(
    ("distribution", "truth"),
    [
        (Distribution("uniform", 1.0, 3.0), stats.uniform(1.0, 2.0)),
        (Distribution("rayleigh", 2.0), stats.rayleigh(scale=2.0)),
        (Distribution("normal", 5.0, 0.5), stats.norm(5.0, 0.5)),
        (Distribution("normal", 1.0, 2.0), stats.truncnorm(-0.5, np.inf, loc=1.0, scale=2.0)),
    ],
)
def test_quantiles_are_those_of_the_distribution(distribution, truth):
    shares = np.array([0.0, 1e-9, 0.01, 0.3, 0.5, 0.9, 0.999])
    values = [distribution.quantile(share) for share in shares]

    # the truth reaches down to minus infinity where nothing is cut off
    assert values == pytest.approx(np.maximum(truth.ppf(shares), 0.0), rel=1e-9, abs=1e-12)
    assert min(values) >= 0.0


def test_fixed_values_do_not_vary():
    assert Distribution("fixed", 3.0).quantile(0.7) == 3.0
    assert Distribution("normal", 3.0, 0.0).quantile(0.7) == 3.0
    assert Distribution("fixed", 2e-6).text("m") == "2 um"
    assert Distribution("uniform", 1e-6, 3e-6).text("m") == "uniform between 1 um and 3 um"


MISTAKES = [
    # more text, replaced text, its replacement, key, words in what was expected or tried
    ("", "motion: {", "motion: {placement: {eccentricity: 1}, ", "eccentricity", "um"),
    ("", "motion: {", "motion: {placement: {eccentricity: -1 um}, ", "eccentricity", "0 or more"),
    ("", "motion: {", "motion: {placement: {tilt: 6 deg}, ", "tilt", "or less"),
    ("", "motion: {", "motion: {placement: {tilt_angle: 6 deg}, ", "tilt_angle", "tilt"),
    (GUIDE, "shaft, h", "shift, h", "guide.surface", "did you mean 'shaft'"),
    (GUIDE, "[6 mm, 13 mm]", "[6 mm]", "guide.heights", "at least 2"),
    (GUIDE, "[6 mm, 13 mm]", "[13 mm, 6 mm]", "guide.heights[1]", "rise"),
    (GUIDE, "[6 mm, 13 mm]", "[6 mm, 21 mm]", "guide.heights[1]", "2.4 mm to 20 mm"),
    (GUIDE, "4 um", "0 um", "guide.clearance", "above 0"),
    (GUIDE, "4 um}", "4 um, friction: -0.1}", "guide.friction", "0 or more"),
    (GUIDE, "4 um}", "4 um, law: {kind: lineer}}", "guide.law.kind", "did you mean 'linear'"),
    (GUIDE, "4 um}", "4 um, law: {kind: linear}}", "guide.law", "stiffness"),
    (SHOTS, "", "", "shots", "guide"),
    (GUIDE + SHOTS, "seed: 7", "seed: -7", "shots.seed", "0 or more"),
    (GUIDE + SHOTS, "seed: 7", "tilt: 0.01 deg", "shots.tilt", "eccentricity"),
    (GUIDE + SHOTS, "seed: 7", "force: {normal: [1 N]}", "shots.force.normal", "mean"),
    (GUIDE + SHOTS, "seed: 7", "force: {normal: [1 N, 2]}", "shots.force.normal[1]", "unit"),
    (GUIDE + SHOTS, "seed: 7", "force: {uniform: [2 N, 1 N]}", "shots.force.uniform", "swap"),
    (GUIDE + SHOTS, "seed: 7", "force: {unifrom: [2 N, 1 N]}", "shots.force.unifrom", "uniform"),
    (GUIDE + SHOTS, "seed: 7", "force: {rayleigh: [2 N, 1 N]}", "shots.force.rayleigh", "scale"),
    (GUIDE + SHOTS, "seed: 7", "force: -1 N", "shots.force", "0 or more"),
    (GUIDE + SHOTS, "seed: 7", "impacts: 1", "shots.impacts", "2 or more"),
    (GUIDE + SHOTS, "seed: 7", "duration: 1 us", "shots.duration", "100 to"),
    (
        GUIDE + SHOTS,
        "seed: 7",
        "waviness: {rms: 0, harmonics: [1, 4]}",
        "shots.waviness.harmonics",
        "eccentricity",
    ),
    ("shots: {friction: 0.1}\n", "", "", "shots.friction", "guide"),
]


@pytest.mark.parametrize(("more", "old", "new", "key", "words"), MISTAKES)
def test_mistakes_are_named_with_key_and_way_out(more, old, new, key, words):
    error = complaint(more, old, new)

    assert error.where.startswith("valve.yaml:")
    assert error.where.endswith(key)
    assert words in f"{error.expected} {error.hint}"


@pytest.mark.parametrize(
    ("more", "key"),
    [
        (GUIDE, "guide"),
        ("shots: {force: {normal: [10 N, 1 N]}}\n", "shots"),
    ],
)
def test_half_sections_have_no_guide_and_no_shots(more, key):
    text = (TEXT + more).replace(*flat()).replace(", sectors: {count: 3, width: 40 deg}", "")
    with pytest.raises(InputError) as caught:
        read_case(text, Path("valve.yaml"))

    assert caught.value.where.endswith(key)
    assert "model: swept" in caught.value.hint


def test_numbers_of_distributions_have_paths():
    """As the file has them: one number, or the entries of its distribution."""
    case = klack.load_case(HOW_TO / "guided_needle.yaml")
    assert case.value("shots.force") == {"uniform": (0.8, 1.2)}
    assert case.with_value("shots.force.uniform.1", "1.4 N").value("shots.force.uniform.1") == 1.4
    assert quantity_at(case.checked, split_path("shots.waviness.rms")).parse("0.3 um") == 3e-7
    with pytest.raises(InputError, match="expected 0 or more"):
        quantity_at(case.checked, split_path("shots.waviness.rms")).parse("-1 um")
    with pytest.raises(CaseProblem) as problem:
        quantity_at(case.checked, split_path("shots.force"))
    assert problem.value.hint.endswith("such as shots.force.uniform.0.")
