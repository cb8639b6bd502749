"""Page on parameters and parts: its files are those that it shows, its numbers those of a run.

Truth: the page, from the same version; equality with networks written out is checked elsewhere.
"""

import re
from pathlib import Path

import pytest

import klack
from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import load_valve_case, read_valve_case
from klack.errors import InputError

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
PAGE = (HOW_TO / "parameters-and-parts.md").read_text(encoding="utf-8")
FOUR = HOW_TO / "four_injectors.yaml"

SHORT = """klack: 1
title: Short
{head}network:
  fluid: n-heptane
  ambient: {{temperature: 20 degC}}
  components:
    needle: {{type: rigid-mass, mass: 3 g, points: [a]}}
    seat: {{type: end-stop, gap: 0 um, law: {{kind: linear, stiffness: 1e9 N/m}}}}
    room: {{type: chamber, volume: 1 cm^3}}
{part}  connections:
    - [needle.a, seat.upper, spring.end, face.body, magnet.end]
    - [seat.lower, ground]
    - [room.fluid, face.fluid, bores.a]
    - [bores.b, ambient]
run: {{duration: 1 ms}}
"""


def blocks(word: str) -> list[str]:
    return re.findall(rf"```{word}\n(.*?)```", PAGE, re.DOTALL)


def test_the_first_example_is_a_case():
    head, part = blocks("yaml")[0], blocks("yaml-part")[0]
    parts = read_valve_case(SHORT.format(head=head, part=part), FOUR).network.components

    force = 1.2 * 50e5 * 3.141592653589793 / 4 * 1.3e-3**2
    assert parts["spring"].preload == pytest.approx(force, rel=1e-14)
    assert parts["bores"].diameter == pytest.approx(0.4e-3, rel=1e-14)
    assert parts["bores"].count == 4
    assert parts["magnet"].time[1] == pytest.approx(50e-6, rel=1e-14)


def test_the_message_is_the_one_shown():
    head, part = blocks("yaml")[0], blocks("yaml-part")[0].replace("d_seat^2}", "d_seat}")
    with pytest.raises(InputError) as caught:
        read_valve_case(SHORT.format(head=head, part=part), Path("case.yaml"))

    shown = next(block for block in re.findall(r"```\n(case.*?)```", PAGE, re.DOTALL))
    line = re.compile(r"^case\.yaml:\d+:")
    assert line.sub("", str(caught.value)) == line.sub("", shown.strip())


def test_the_files_are_those_of_the_page():
    part, case = blocks("yaml-part")[1:3]
    text = (HOW_TO / "parts" / "injector.yaml").read_text(encoding="utf-8")

    assert all(line in text for line in part.splitlines())
    assert case in FOUR.read_text(encoding="utf-8")


def test_the_table_is_that_of_the_run():
    result = run_stroke(load_valve_case(FOUR), variants=("wet",)).variants["wet"].result
    rows = re.findall(r"^\| (\d) \| ([\d.]+) ms \| ([\d.]+) m/s \| (\d+) N \|$", PAGE, re.M)

    assert len(rows) == 4
    for number, time, speed, force in rows:
        stop = f"injector{number}_opening"
        first = next(event for event in result.events if event.stop == stop)
        assert f"{1e3 * first.time:.4f}" == time
        assert f"{first.approach_speed:.3f}" == speed
        assert f"{first.peak_force:.0f}" == force
    rail = result.channels["rail pressure"].values
    assert rail.min() < 0.8 * rail[0]  # why the later ones open faster


@pytest.mark.slow
def test_the_points_of_the_page():
    table = klack.run_many(
        FOUR,
        {"parameters.lift": ["60 um", "80 um", "100 um"]},
        ["injector1_opening.peak_force", "injector4_opening.peak_force"],
    )
    first, fourth = re.search(
        r"gives ([\d, and]+) N at the first injector and ([\d, and]+) N at the fourth", PAGE
    ).groups()

    for name, said in (("injector1", first), ("injector4", fourth)):
        numbers = [int(x) for x in re.findall(r"\d+", said)]
        assert numbers == [round(x) for x in table[f"{name}_opening.peak_force"]]
