"""Pages of the how-to: their examples give what they print.

Page on parameters and parts: its files are those that it shows, its numbers those of a run.

Truth: the page, from the same version; equality with networks written out is checked elsewhere.

The page on warm-up says what the shipped case does; truth: its run and energy balance.

The page on maps of a magnet: its example against the magnetic circuit that made the table.

The page on magnetic networks: the numbers of its example.

Pages on what is off-axis; truth: what their examples print.

Page on strokes off the axis; truth: what its example prints.
"""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from pages import HOW_TO, blocks, printed

import klack
from klack.analyses.heat.run import run_heat
from klack.analyses.stroke.run import run_stroke
from klack.case import shipped_cases
from klack.case.any_case import load_valve_case, read_valve_case
from klack.errors import InputError

HOW_TO_PARAMETERS = Path(__file__).parents[2] / "docs" / "how-to"
PAGE = (HOW_TO_PARAMETERS / "parameters-and-parts.md").read_text(encoding="utf-8")
FOUR = HOW_TO_PARAMETERS / "four_injectors.yaml"

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


def blocks_parameters(word: str) -> list[str]:
    return re.findall(rf"```{word}\n(.*?)```", PAGE, re.DOTALL)


def test_the_first_example_is_a_case():
    head, part = blocks_parameters("yaml")[0], blocks_parameters("yaml-part")[0]
    parts = read_valve_case(SHORT.format(head=head, part=part), FOUR).network.components

    force = 1.2 * 50e5 * 3.141592653589793 / 4 * 1.3e-3**2
    assert parts["spring"].preload == pytest.approx(force, rel=1e-14)
    assert parts["bores"].diameter == pytest.approx(0.4e-3, rel=1e-14)
    assert parts["bores"].count == 4
    assert parts["magnet"].time[1] == pytest.approx(50e-6, rel=1e-14)


def test_the_message_is_the_one_shown():
    head, part = (
        blocks_parameters("yaml")[0],
        blocks_parameters("yaml-part")[0].replace("d_seat^2}", "d_seat}"),
    )
    with pytest.raises(InputError) as caught:
        read_valve_case(SHORT.format(head=head, part=part), Path("case.yaml"))

    shown = next(block for block in re.findall(r"```\n(case.*?)```", PAGE, re.DOTALL))
    line = re.compile(r"^case\.yaml:\d+:")
    assert line.sub("", str(caught.value)) == line.sub("", shown.strip())


def test_the_files_are_those_of_the_page():
    part, case = blocks_parameters("yaml-part")[1:3]
    text = (HOW_TO_PARAMETERS / "parts" / "injector.yaml").read_text(encoding="utf-8")

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


PAGE_HEAT = (Path(__file__).parents[2] / "docs" / "how-to" / "warm-up.md").read_text(
    encoding="utf-8"
)


@pytest.fixture(scope="module")
def case():
    return load_valve_case(shipped_cases()["warm-valve"])


def rows(first: str) -> list[list[str]]:
    """Rows of the table whose head begins with a word."""
    table = re.search(rf"^\| {first} \|.*\n\|[-| ]+\|\n((?:\|.*\n)+)", PAGE_HEAT, re.MULTILINE)
    assert table is not None
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table[1].splitlines()]


def number(cell: str) -> float:
    return float(cell.replace("−", "-").split()[0])


@pytest.mark.slow
def test_the_warm_up_of_the_page(case):
    study = run_heat(case)

    stated = rows("time")
    copper, body = (x.values - 273.15 for x in study.temperature[:2])
    numbers = {x.name: x.values for x in (*study.numbers, *study.values)}
    for row, i in ((stated[0], 0), (stated[-1], -1)):
        assert copper[i] == pytest.approx(number(row[1]), abs=0.1)
        assert body[i] == pytest.approx(number(row[2]), abs=0.1)
        assert 1e3 * numbers["closing delay"][i] == pytest.approx(number(row[3]), abs=2e-3)
        assert numbers["first peak at the seat"][i] == pytest.approx(number(row[4]), rel=5e-3)
        assert 1e6 * numbers["rebound"][i] == pytest.approx(number(row[5]), rel=1e-2)
        assert numbers["coil resistance"][i] == pytest.approx(number(row[6]), abs=6e-3)
        assert 1e6 * numbers["stop.gap"][i] == pytest.approx(number(row[7]), abs=0.1)
    assert study.end == "steady"
    heat, off = sum(study.supplied.values()), sum(study.given_off.values())
    assert heat == pytest.approx(off + sum(study.stored.values()), rel=1e-9)
    assert sum(study.unsent.values()) == pytest.approx(22.4, abs=0.1)


@pytest.mark.slow
def test_the_causes_of_the_page(case):
    temperatures = (243.15, 273.15, 333.15, 373.15, 393.15)

    study = run_heat(case, soak=temperatures)

    base = study.causes[0].numbers["closing delay"]
    assert 1e3 * base == pytest.approx(1.479, abs=1e-3)
    found = {
        (row.cause, row.state): 1e6 * (row.numbers["closing delay"] - base)
        for row in study.causes[1:]
    }
    names = ("copper", "viscosity", "density", "gaps", "all")
    states = [f"{T - 273.15:.6g} °C" for T in temperatures]
    for name, row in zip(names, rows("cause"), strict=False):
        for state, cell in zip(states, row[1:], strict=True):
            # half of the last digit, and rounding of other machines
            assert found[name, state] == pytest.approx(number(cell), abs=0.6)
    assert not any("is known from" in text for text in study.warnings)


CASE = Path(__file__).parents[2] / "docs" / "how-to" / "magnet_from_a_map.yaml"
CIRCUIT = """
type: solenoid
turns: 60
resistance: 0.8 ohm
gap: 120 um
residual_gap: 30 um
poles:
  - {inner_radius: 2 mm, outer_radius: 3.5 mm, fringing: none}
  - {inner_radius: 5 mm, outer_radius: 6 mm, fringing: none}
iron: [{material: X6Cr17, length: 30 mm, area: 20 mm^2}]
"""


def stroke(path):
    return run_stroke(load_valve_case(path)).variants["dry"]


def test_the_map_opens_and_closes_like_the_circuit(tmp_path):
    case = yaml.safe_load(CASE.read_text(encoding="utf-8"))
    case["network"]["components"]["coil"] = yaml.safe_load(CIRCUIT)
    (tmp_path / "case.yaml").write_text(yaml.safe_dump(case), encoding="utf-8")

    from_map, from_circuit = stroke(CASE), stroke(tmp_path / "case.yaml")

    # 12 gaps: the splines are within 0.3 % of the force
    assert from_map.opening_time == pytest.approx(from_circuit.opening_time, rel=1e-3, abs=0.0)
    assert from_map.closing_time == pytest.approx(from_circuit.closing_time, rel=2e-3, abs=0.0)
    found = [(run.opening_time, run.closing_time) for run in (from_map, from_circuit)]
    assert np.round(1e3 * np.array(found), 3).tolist() == [[0.885, 1.739], [0.885, 1.740]]
    assert abs(from_map.result.books.relative_residual) < 1e-12


CASE_NETWORK = Path(__file__).parents[2] / "docs" / "how-to" / "own_magnet.yaml"


@pytest.mark.parametrize(("bridge", "opens"), [(True, 0.358), (False, 0.302)])
def test_the_bridge_takes_flux(tmp_path, bridge, opens):
    case = yaml.safe_load(CASE_NETWORK.read_text(encoding="utf-8"))
    if not bridge:
        del case["network"]["components"]["magnet"]["elements"]["bridge"]
    (tmp_path / "case.yaml").write_text(yaml.safe_dump(case), encoding="utf-8")

    stroke = run_stroke(load_valve_case(tmp_path / "case.yaml")).variants["dry"]

    assert 1e3 * stroke.opening_time == pytest.approx(opens, abs=5e-4)
    assert abs(stroke.result.books.relative_residual) < 1e-12
    assert {"magnet flux", "magnet flux of leakage"} <= set(stroke.result.channels)


@pytest.mark.parametrize(
    "name",
    ["off-axis-magnet-and-seat", pytest.param("off-axis-impact", marks=pytest.mark.slow)],
)
def test_the_example_prints_what_the_page_shows(name):
    text = (HOW_TO / f"{name}.md").read_text(encoding="utf-8")
    (code,), (shown,) = blocks(text, "python"), blocks(text, "text")

    assert printed(code, name) == shown


PAGE_AXIS = HOW_TO / "stroke-off-axis.md"


@pytest.mark.slow
def test_the_example_prints_what_the_page_shows_axis(monkeypatch):
    monkeypatch.chdir(PAGE_AXIS.parent)
    text = PAGE_AXIS.read_text(encoding="utf-8")
    (code,), (shown,) = blocks(text, "python"), blocks(text, "text")

    assert printed(code, str(PAGE_AXIS)) == shown


def test_the_sections_of_the_page_are_those_of_its_case():
    text, case = (
        PAGE_AXIS.read_text(encoding="utf-8"),
        PAGE_AXIS.with_name("half_section_stroke.yaml"),
    )
    (shown,) = blocks(text, "yaml")

    assert shown in case.read_text(encoding="utf-8")
