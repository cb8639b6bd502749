"""Mistakes that show when a case is computed: where they are told.

Truth: the line of the case in which the key stands.
"""

import re
from pathlib import Path

import pytest
import yaml

from klack.analyses.linearisation.run import run_linearisation
from klack.analyses.operating_point.run import run_operating_points
from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import load_valve_case, read_valve_case, tree_of
from klack.case.valve import ValveCase
from klack.errors import InputError
from klack.exchange.case_models import case_models

CASE = """\
klack: 1
title: two rooms at one node
network:
  fluid: n-heptane
  components:
    m: {type: rigid-mass, mass: 1 kg, points: [p]}
    s: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.1}
    k: {type: spring, stiffness: 1 N/mm, preload: 100 N}
    supply: {type: pressure-source, pressure: 5 bar}
    o: {type: orifice, diameter: 0.1 mm}
    c: {type: chamber, volume: 10 mm^3, pressure: 5 bar}
    d: {type: chamber, volume: 10 mm^3, pressure: 6 bar}
  connections:
    - [supply.fluid, o.a]
    - [o.b, c.fluid, d.fluid]
    - [m.p, s.upper, k.end]
    - [s.lower, ground]
run: {duration: 0.1 ms, step: 20 ns, record: 1 us, variants: [wet], lift: m.p}
"""
LINE = CASE.replace("o: {type: orifice, diameter: 0.1 mm}", "o: {type: line, length: 1 mm,\n"
    "        diameter: 1 mm, pressure: 0.01 bar}").replace("6 bar", "5 bar")  # fmt: skip


def line_of(text, words):
    return next(n for n, line in enumerate(text.splitlines(), 1) if words in line)


@pytest.mark.parametrize(
    "compute",
    [
        run_stroke,
        run_linearisation,
        case_models,
        lambda case: run_operating_points(case, tree_of(case.source, case.path)),
    ],
    ids=["stroke", "linearise", "export", "steady"],
)
@pytest.mark.parametrize(
    ("text", "words", "key"),
    [
        (CASE, "6 bar", "network.components.d: got 6 bar at the start where 'c' has 5 bar"),
        (LINE, "0.01 bar", "network.components.o.pressure: got 0.01 bar"),
    ],
    ids=["section", "key"],
)
def test_errors_of_a_network_name_file_and_line(compute, text, words, key):
    case = read_valve_case(text, Path("valve.yaml"))
    with pytest.raises(InputError) as caught:
        compute(case)

    assert str(caught.value).startswith(f"valve.yaml:{line_of(text, words)}: {key}")


def test_errors_in_a_part_name_the_file_of_the_part(tmp_path):
    part = (
        "klack: 1\npart: room\nports: {a: c.fluid}\ncomponents:\n"
        "  c: {type: chamber, volume: 1 mm^3,\n      pressure: 7 bar}\nconnections: []\n"
    )
    (tmp_path / "room.yaml").write_text(part)
    text = CASE.replace("network:", "include: [{file: room.yaml, as: room}]\nnetwork:")
    text = text.replace("d.fluid", "room.a").replace(
        "    d: {type: chamber, volume: 10 mm^3, pressure: 6 bar}\n", ""
    )
    (tmp_path / "valve.yaml").write_text(text)
    with pytest.raises(InputError) as caught:
        run_stroke(load_valve_case(tmp_path / "valve.yaml"))

    found = re.match(r"(.*): components\.c \(of 'room'\): got 7 bar", str(caught.value))
    assert found, str(caught.value)
    assert found[1] == f"{tmp_path / 'room.yaml'}:{line_of(part, 'type: chamber')}"


def test_a_case_made_in_python_has_no_line():
    made = ValveCase.model_validate(yaml.safe_load(CASE))
    with pytest.raises(InputError, match=r"^components\.d: got"):
        run_stroke(made)
