"""The section calibration: paths, bounds, and what is said about mistakes in them."""

from pathlib import Path

import pytest

from klack.case.any_case import CaseTree, read_valve_case
from klack.case.free_parameters import free_parameters
from klack.case.reader import parse
from klack.case.rewriting import moved_files, rewritten, written_quantity
from klack.errors import InputError

CASE = """\
# a comment at the top
klack: 1
title: Rigid valve
network:
  ambient: {temperature: 20 degC}
  components:
    needle: {type: rigid-mass, mass: 3 g, points: [tip, top]}
    seat: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.5}
    stop: {type: end-stop, gap: 80 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.5}
    spring: {type: spring, stiffness: 10 N/mm, preload: 11 N}  # closes
    guide: {type: guide-friction, coulomb: 0.8 N}
    magnet: {type: force-over-time, time: [0 us, 50 us, 1 ms], force: [0 N, 30 N, 0 N]}
  connections:
    - [needle.tip, seat.upper]
    - [seat.lower, ground]
    - [needle.top, stop.lower, spring.end, magnet.end, guide.body]
    - [stop.upper, ground]
run: {duration: 1 ms, variants: [dry]}
measurement: {sensor: {sensitivity: 98 %, offset: 0 um}}
calibration:
  variant: dry
  parameters:
    preload: {key: network.components.spring.preload, lower: 8 N, upper: 16 N}
    friction: {key: network.components.guide.coulomb, lower: 0 N, upper: 1.5 N}
    gaps: {key: [network.components.stop.gap], lower: 70 um, upper: 0.09 mm}
    loss: {key: network.components.stop.restitution, lower: 20 %, upper: 0.8}
    warmth: {key: network.ambient.temperature, lower: 10 degC, upper: 310 K}
    gain: {key: measurement.sensor.sensitivity, lower: 0.9, upper: 1.1}
    offset: {key: measurement.sensor.offset, lower: -10 um, upper: 10 um}
  profile: [preload]
"""
PATH = Path("rigid.yaml")


def tree():
    data, lines = parse(CASE, PATH)
    return CaseTree(path=PATH, text=CASE, data=data, lines=lines)


def test_parameters_are_resolved_in_si():
    found = {p.name: p for p in free_parameters(tree().case())}
    numbers = {name: (p.lower, p.start, p.upper, p.unit) for name, p in found.items()}
    assert numbers == {
        "preload": (8.0, 11.0, 16.0, "N"),
        "friction": (0.0, 0.8, 1.5, "N"),
        "gaps": (70e-6, 80e-6, 90e-6, "m"),
        "loss": (0.2, 0.5, 0.8, ""),
        "warmth": (283.15, 293.15, 310.0, "K"),
        "gain": (0.9, 0.98, 1.1, ""),
        "offset": (-10e-6, 0.0, 10e-6, "m"),
    }
    assert [name for name, p in found.items() if p.of_sensor] == ["gain", "offset"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "spring.preload",
            "spring.prelod",
            r"rigid.yaml:23: .*did you mean 'preload'",
        ),
        ("spring.preload", "sprung.preload", r"no 'sprung' in 'network.components'"),
        ("lower: 8 N", "lower: 8 mm", r"preload.lower: got '8 mm' \(a length\), expected a force"),
        ("lower: 0 N", "lower: -1 N", r"friction.lower: got '-1 N', expected .* greater than"),
        (
            "upper: 16 N",
            "upper: 7 N",
            r"upper: got 7 N, expected more than the lower bound",
        ),
        ("upper: 1.5 N", "upper: 0.5 N", r"expected bounds around 800 mN, the value in the case"),
        ("key: network.components.guide.coulomb", "key: run.step", r"expected a key of network"),
        ("key: network.components.guide.coulomb", "key: needle..mass", r"keys joined with points"),
        (
            "key: network.components.guide.coulomb",
            "key: bodies.needle.mesh.size",
            r"which needs new meshes, modes and contact laws",
        ),
        (
            "key: network.components.guide.coulomb",
            "key: network.components.guide.stribeck",
            r"one of: ",
        ),
        (
            "guide.coulomb, lower: 0 N, upper: 1.5 N",
            "spring.preload, lower: 0 N, upper: 15 N",
            r"which 'preload' also fits",
        ),
        (
            "[network.components.stop.gap]",
            "[network.components.stop.gap, network.components.seat.gap]",
            r"gaps.key\[1\]: got network.components.seat.gap = 0 um, expected the same as",
        ),
        ("profile: [preload]", "profile: [prelod]", r"profile\[0\]: .*did you mean 'preload'"),
        ("network.ambient.temperature, lower: 10 degC", "title, lower: 1", r"expected a key of"),
    ],
)
def test_mistakes_are_named_with_their_line(old, new, words):
    assert old in CASE
    with pytest.raises(InputError, match=f"(?s){words}"):
        read_valve_case(CASE.replace(old, new), PATH)


def test_only_the_values_change_and_keep_their_unit():
    cases = tree()
    places = {p.name: p.places[0] for p in free_parameters(cases.case())}
    new = {"preload": 12.25, "gaps": 81.5e-6, "gain": 0.9876, "offset": -1.5e-6, "warmth": 300.0}
    values = {places[n].key: written_quantity(cases, places[n], v) for n, v in new.items()}

    text = rewritten(cases, values, "made here")

    assert text.startswith("# made here\n# a comment at the top\n")
    before, after = CASE.splitlines(), text.splitlines()[1:]
    assert sum(a != b for a, b in zip(before, after, strict=True)) == 4
    for words in (
        "preload: 12.25 N}  # closes",
        "gap: 81.5 um",
        "sensitivity: 98.76 %, offset: -1.5 um",
        "temperature: 26.85 degC",
    ):
        assert words in text
    found = {p.name: p.start for p in free_parameters(read_valve_case(text, PATH))}
    assert {name: found[name] for name in new} == pytest.approx(new, rel=1e-12)


def test_values_shared_by_an_anchor_are_refused():
    text = CASE.replace("preload: 11 N", "preload: &f 11 N").replace(
        "coulomb: 0.8 N", "coulomb: *f"
    )
    data, lines = parse(text, PATH)
    shared = CaseTree(path=PATH, text=text, data=data, lines=lines)
    key = ("network", "components", "spring", "preload")
    with pytest.raises(InputError, match="values that YAML anchors share"):
        rewritten(shared, {key: "1 N"})


def test_files_are_named_from_the_new_folder(tmp_path):
    text = "bodies:\n  needle: {geometry: {mesh: {file: parts/needle.inp}}}\n"
    path = tmp_path / "cases" / "case.yaml"
    data, lines = parse(text, path)
    cases = CaseTree(path=path, text=text, data=data, lines=lines)
    moved = moved_files(cases, tmp_path / "results" / "one")
    assert moved == {
        ("bodies", "needle", "geometry", "mesh", "file"): '"../../cases/parts/needle.inp"'
    }
    assert 'file: "../../cases/parts/needle.inp"}' in rewritten(cases, moved)
