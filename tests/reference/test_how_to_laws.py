"""Pages on local laws, restitution and two materials: what they tell to change is run.

Truth: the numbers written on the pages, from the same version: a change detector; the laws
themselves are checked against the full order and exact impacts elsewhere.
"""

import re
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from klack.analyses.impact.run import run_impact
from klack.case import find_case, load_case
from klack.contact.restitution import ImpactMeasures

pytestmark = pytest.mark.slow

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
SHOWN = re.compile(r"```yaml\n(.*?)```", re.DOTALL)


def block(page: str) -> dict:
    (text,) = SHOWN.findall((HOW_TO / page).read_text(encoding="utf-8"))
    return YAML(typ="safe").load(text)


def row(page: str, start: str) -> list[str]:
    (line,) = re.findall(
        rf"^\| ({re.escape(start)}.*) \|$", (HOW_TO / page).read_text(encoding="utf-8"), re.M
    )
    return line.split(" | ")


def measures_of(path: Path, level: str = "reduced") -> ImpactMeasures:
    return run_impact(load_case(path), levels=(level,), certify=False).levels[level].measures


def changed_demo(folder: Path, changes: dict) -> Path:
    """Write the axisymmetric demo with the keys of a page laid over its own."""
    yaml = YAML(typ="safe")
    case = yaml.load(find_case("demo-valve-axisymmetric"))
    for part, keys in changes.items():
        if part == "bodies":
            for body, more in keys.items():
                case["bodies"][body] |= more
        else:
            case[part] |= keys
    path = folder / "case.yaml"
    with path.open("w", encoding="utf-8") as stream:
        yaml.dump(case, stream)
    return path


def test_law_of_a_submodel_is_as_soft_as_the_page_says(tmp_path):
    page = "which-local-law.md"
    found = measures_of(changed_demo(tmp_path, block(page)))

    written = float(row(page, "submodel of 0.3 mm")[1].split()[0])
    assert found.peak_force == pytest.approx(written, rel=5e-3)  # versions of the mesher


def test_needle_of_two_materials_hits_as_the_page_says():
    page = "two-materials.md"
    case = YAML(typ="safe").load(HOW_TO / "needle_of_two_materials.yaml")
    shown = block(page)["bodies"]["needle"]
    found = measures_of(HOW_TO / "needle_of_two_materials.yaml")

    assert shown.items() <= case["bodies"]["needle"].items()
    written = float(row(page, "soft iron")[1].split()[0])
    assert found.peak_force == pytest.approx(written, rel=2e-3)  # versions of the mesher


def test_damping_lowers_the_restitution_as_the_page_says(tmp_path):
    page = "restitution-too-high.md"
    found = measures_of(changed_demo(tmp_path, block(page)))

    written = float(re.search(r" 1 %: ([\d.]+)", row(page, "losses in material")[2])[1])
    assert found.restitution == pytest.approx(written, abs=2e-4)  # versions of the mesher


def test_rough_rods_give_the_forces_that_the_page_says(tmp_path):
    page = "flat-faces.md"
    yaml = YAML(typ="safe")
    case = yaml.load(find_case("two-rods"))
    rough = block(page)
    forces = {}
    for faces, level, changes in (
        ("flat", "reduced", rough | {"contact": {}}),
        ("asperities of 0.2 um", "reduced", rough),
        ("asperities of 0.2 um", "interface", rough),
    ):
        changed = case | {part: case[part] | keys for part, keys in changes.items()}
        path = tmp_path / "case.yaml"
        with path.open("w", encoding="utf-8") as stream:
            yaml.dump(changed, stream)
        forces[faces, level] = measures_of(path, level)

    for (faces, level), found in forces.items():
        _, _, force, time = row(page, f"{faces} | {level}")
        assert found.peak_force == pytest.approx(float(force.split()[0]), rel=2e-3)
        assert 1e6 * found.contact_time == pytest.approx(float(time.split()[0]), rel=2e-3)
    # rho c A v / 2 of wave theory
    plateau = 7850.0 * (210e9 / 7850.0) ** 0.5 * 3.141593 * 2e-3**2 * 0.1
    for level in ("reduced", "interface"):
        found = forces["asperities of 0.2 um", level]
        assert found.peak_force == pytest.approx(plateau, rel=2e-3)
