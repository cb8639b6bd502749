"""A noise section that names what the case does not have is refused before anything runs."""

from pathlib import Path

import pytest

from klack.case.shipped import find_case
from klack.case.valve_reader import read_any_case
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
    path = find_case(name)
    lines = path.read_text(encoding="utf-8").splitlines()
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

    case = read_any_case(path.read_text(encoding="utf-8"), path)

    assert case.name == name
