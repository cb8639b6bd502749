"""A noise section that names what the case does not have is refused before anything runs."""

from pathlib import Path

import pytest

from klack.case.any_case import read_any_case
from klack.case.reader import find_case
from klack.errors import InputError

SHIPPED = ("demo-stroke", "demo-valve-axisymmetric")


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize(
    ("section", "message"),
    [
        ("surfaces: [needle.tip]", r"noise.surfaces.*got 'needle.tip', but nothing holds 'needle'"),
        ("surfaces: [housing.outsid]", r"surface of housing 'outsid'"),
        ("surfaces: [housng.outside]", r"unknown body 'housng'"),
        ("plate: {thickness: 1 mm, area: 0.5 m^2, material: tin}", r"unknown material 'tin'"),
    ],
)
def test_what_the_case_does_not_have(name: str, section: str, message: str) -> None:
    lines = find_case(name).read_text(encoding="utf-8").splitlines()
    own = [i for i, line in enumerate(lines) if line.startswith("noise:")]
    for first in own:  # up to the next section
        later = range(first + 1, len(lines))
        last = next((i for i in later if lines[i][:1].isalpha()), len(lines))
        del lines[first:last]
    text = "\n".join([*lines, "noise:", f"  {section}", ""])

    with pytest.raises(InputError, match=message):
        read_any_case(text, Path("case.yaml"))


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_cases_are_read(name: str) -> None:
    path = find_case(name)

    assert read_any_case(path.read_text(encoding="utf-8"), path).name == name


def test_a_forgotten_support_is_asked_for() -> None:
    """Without 'fixed' the sound of the housing is no question about its surfaces."""
    held = "    fixed:\n      - surface: rim\n"
    impact = find_case("demo-valve-axisymmetric").read_text(encoding="utf-8")
    assert held in impact
    with pytest.raises(InputError, match=r"bodies.housing: got no key 'fixed'.*"):
        read_any_case(impact.replace(held, ""), Path("case.yaml"))


def test_a_forgotten_support_of_a_valve_is_asked_for() -> None:
    stroke = find_case("demo-stroke").read_text(encoding="utf-8")
    start = stroke.index("    fixed:")
    end = stroke.index("\n    ", stroke.index("surface:", start))
    loose = stroke[:start] + stroke[end + 1 :]
    with pytest.raises(InputError, match=r"hold the others \(fixed: "):
        read_any_case(loose, Path("case.yaml"))
    named = loose.replace("\nrun:\n", "\nrun:\n  lift: needle.tip\n")
    assert named != loose
    with pytest.raises(InputError, match=r"bodies.housing: got no key 'fixed'.*"):
        read_any_case(named, Path("case.yaml"))
