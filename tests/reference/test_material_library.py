"""Materials by name; truth: bands of handbooks and standards, and what a case then computes with.

Bands: Kaye and Laby, Tables of Physical and Chemical Constants, 16th ed. (1995), for moduli and
densities of the class; EN 10088-3, EN 10277, EN 12164, EN 573 for the least yield stress.
"""

import re
from pathlib import Path

import pytest
from doubts import doubts

from klack.analyses.impact.contact_check import check_yield
from klack.assembling.problem import build_problem
from klack.case.reader import read_case, schema_of
from klack.case.schema import Case
from klack.errors import InputError
from klack.materials.library import MATERIALS, library_material

ROOT = Path(__file__).parents[2]
SPHERES = ROOT / "tests" / "data" / "case" / "yielding_spheres.yaml"
ELASTIC = "{young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3"
GIVEN = ELASTIC + ", yield: 280 MPa, hardening: {isotropic: 1 GPa}}"
BANDS = {  # GPa, kg/m^3, MPa
    "steel": ((190, 222), (7600, 8000), (185, 2600)),
    "6061-T6": ((66, 72), (2650, 2760), (240, 310)),
    "CuZn39Pb3": ((92, 110), (8300, 8600), (110, 350)),
    "alumina": ((300, 420), (3700, 4000), None),
    "soda-lime glass": ((65, 75), (2400, 2600), None),
}


def _material(written: str):
    text = SPHERES.read_text("utf-8")
    assert GIVEN in text
    return read_case(text.replace(GIVEN, written), SPHERES).materials["steel"]


@pytest.mark.parametrize("name", MATERIALS)
def test_numbers_lie_in_the_bands_of_their_class(name):
    entry = library_material(name)
    young, density, yields = BANDS.get(name, BANDS["steel"])

    assert young[0] <= entry.material.young / 1e9 <= young[1]
    assert density[0] <= entry.material.density <= density[1]
    assert entry.material.question is None
    if yields is None:
        assert entry.material.hardening is None
    else:
        assert yields[0] <= entry.material.hardening.yield_stress / 1e6 <= yields[1]
    assert all(len(one.source) > 10 and one.label and one.unit for one in entry.constants)


def test_estimates_are_told_from_what_was_read():
    assert {name for name, entry in MATERIALS.items() if entry.verified} == {
        "430F", "X6Cr17", "440C hardened", "6061-T6", "soda-lime glass",
    }  # fmt: skip


@pytest.mark.parametrize("name", MATERIALS)
def test_a_case_can_name_it(name):
    """Reference: the numbers of the library, in SI, whatever unit they are written in."""
    by_text, by_key = _material(name).named("steel"), _material(f"{{name: {name}}}").named("steel")

    expected = library_material(name).material
    assert by_text == by_key
    assert by_text.young == expected.young
    assert by_text.density == expected.density
    if expected.hardening is not None:
        assert by_text.hardening.yield_stress == pytest.approx(
            expected.hardening.yield_stress, rel=1e-12, abs=0.0
        )


def test_keys_beside_the_name_replace_its_numbers():
    changed = _material("{name: 430f, density: 7700 kg/m^3, yield: 300 MPa}").named("steel")
    by_hardness = _material("{name: 430F, hardness: {HV: 180}}").named("steel")

    assert (changed.young, changed.density) == (200e9, 7700.0)
    assert changed.hardening.yield_stress == 300e6
    assert by_hardness.hardening.yield_stress == pytest.approx(588.4e6, rel=1e-3)


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ("430 F hard", r"materials.steel: got '430 F hard', expected a material of the library"),
        ("{name: 440C hardend}", "did you mean '440C hardened'"),
        ("{name: alumina, hardening: {isotropic: 1 GPa}}", "no yield stress"),
        ("{name: 430F, young: 10 GPa}", "at most a fiftieth"),
        ("{poisson: 0.3}", "no key 'young'"),
    ],
)
def test_names_and_mixtures_that_cannot_be_are_refused(written, message):
    with pytest.raises(InputError, match=message):
        _material(written)


def test_editors_accept_a_name_alone_and_beside_own_numbers():
    node = schema_of(Case)["$defs"]["CaseMaterial"]
    assert node["type"] == ["string", "object"]
    assert node["anyOf"] == [
        {"required": ["young", "poisson", "density"]},
        {"required": ["name"]},
    ]


@pytest.mark.parametrize(
    ("written", "words"),
    [
        ("{name: 430F}", r"379 MPa, is that of the library \(data sheet of 430F"),
        (
            f"{ELASTIC}, hardness: {{HV: 180}}}}",
            "588 MPa, is estimated from its hardness, 290 MPa to 680 MPa",
        ),
    ],
)
def test_an_estimate_that_decides_whether_faces_yield_is_told(written, words):
    text = SPHERES.read_text("utf-8").replace(GIVEN, written)
    problem = build_problem(read_case(text, SPHERES), lambda *_: None)

    with doubts() as told:
        check_yield(
            problem.case, problem.pair, problem.static, 0.9 * problem.static.max_force, "a on b"
        )

    said = [text for text in told if "yield stress of 'steel'" in text]
    assert len(said) == 1
    assert re.search(words, said[0])


def test_the_page_of_the_case_lists_the_library():
    page = (ROOT / "docs" / "reference" / "case.md").read_text("utf-8")
    rows = [line for line in page.splitlines() if line.startswith("| `")]

    for name, entry in MATERIALS.items():
        row = next(line for line in rows if line.startswith(f"| `{name}` |"))
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        assert cells[1] == entry.condition
        shown = "-"
        if entry.material.hardening is not None:
            shown = f"{entry.material.hardening.yield_stress / 1e6:.0f}"
        estimated = entry.yield_stress is not None and not entry.yield_stress.verified
        assert cells[2:] == [
            f"{entry.material.young / 1e9:g}",
            f"{entry.material.poisson:g}",
            f"{entry.material.density:g}",
            f"{shown} (estimate)" if estimated else shown,
        ]
