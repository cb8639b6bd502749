"""What a line refuses, with the text, and what it chooses when it is not told."""

import numpy as np
import pytest

from klack.errors import InputError
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.line import Line
from klack.network.rows import Ambient, Rows
from klack.simulation.delay_line import compile_lines
from klack.verification.single_line import plain_line

BORE = {"length": 0.06, "diameter": 2.5e-3, "pressure": 6e5}


def test_segment_shorter_than_a_step_says_how_many_fit():
    row = plain_line(delay=1e-6, segments=4)

    with pytest.raises(InputError, match=r"line 'line'.*250 ns.*320 ns") as caught:
        compile_lines([row], step=20e-9, coarse=16, ambient_pressure=0.0)

    assert "use 3 segments" in caught.value.hint
    compile_lines([plain_line(delay=1e-6, segments=3)], step=20e-9, coarse=16, ambient_pressure=0)


def test_line_shorter_than_a_step_names_the_longest_step():
    row = plain_line(delay=0.1e-6)

    with pytest.raises(InputError) as caught:
        compile_lines([row], step=20e-9, coarse=16, ambient_pressure=0.0)

    assert "segments" not in caught.value.hint
    assert "6.25 ns" in caught.value.hint


@pytest.mark.parametrize(("segments", "total"), [(1, 16.0), (5, 83.3), (8, 128.0), (7, 1000.1)])
def test_every_segment_holds_a_coarse_step_and_all_add_up(segments, total):
    row = plain_line(delay=total, segments=segments)

    lines, state = compile_lines([row], step=1.0, coarse=16, ambient_pressure=0.0)

    assert np.all(lines.depth - 1 >= 16)
    assert np.all((lines.depth[:-1] - 1) % 16 == 0)
    assert np.sum(lines.depth - 1 + lines.fraction) == pytest.approx(total, rel=1e-12)
    assert state.samples.size >= 2 * lines.depth.sum()


def test_network_without_lines_has_empty_arrays():
    lines, state = compile_lines([], step=20e-9, coarse=16, ambient_pressure=1e5)

    assert lines.impedance.size == lines.node.size == state.samples.size == 0


@pytest.mark.parametrize(
    ("given", "parts", "terms"),
    [
        ({}, 2, 10),
        ({"friction": "steady"}, 2, 0),
        ({"friction": "none"}, 1, 0),
        ({"friction": "none", "segments": 3}, 3, 0),
    ],
)
def test_friction_chooses_segments_and_terms(given, parts, terms):
    fluid = library_fluid("n-heptane").at(293.15)
    rows = Rows(ambient=Ambient(), fluid=fluid, component="line", handles={"a": 0, "b": 1})

    Line(**BORE, **given).add_rows(rows)
    row = rows.lines[0]

    assert (row.segments, len(row.unsteady_gain)) == (parts, terms)
    assert (row.resistance > 0.0) == (given.get("friction") != "none")
    assert row.vapour_pressure == fluid.vapour_pressure


@pytest.mark.parametrize(
    ("ends", "expected"),
    [
        ((3e4, None), 3e4),  # not at the ambient pressure from which the other is found
        ((None, 2e5), 2e5),
        ((3e4, 2e5), 2e5),
        ((None, None), Ambient().pressure),
    ],
)
def test_a_line_takes_the_pressure_that_the_case_states_at_an_end(ends, expected):
    fluid = library_fluid("n-heptane").at(293.15, gas_fraction=0.01)
    rows = Rows(ambient=Ambient(), fluid=fluid, component="line", handles={"a": 1, "b": 2})
    for node, pressure in enumerate(ends, start=1):
        rows.chamber(node, volume=1e-7, pressure=pressure)
    line = Line(length=0.06, diameter=2.5e-3)

    line.add_rows(rows)

    assert rows.lines[0].delay == line.length / line.wave_speed(fluid, expected)


def test_a_line_takes_the_pressure_of_a_source_at_time_zero():
    fluid = library_fluid("n-heptane").at(293.15)
    rows = Rows(ambient=Ambient(), fluid=fluid, component="line", handles={"a": 0, "b": 1})
    rows.pressure(1, time=(-1e-3, 1e-3), pressure=(1e5, 5e5))

    assert Line(length=0.06, diameter=2.5e-3).working_pressure(rows) == pytest.approx(3e5)


def test_wall_needs_both_numbers():
    with pytest.raises(InputError, match="wall_modulus"):
        Line(**BORE, wall_thickness=1e-3)


def test_line_needs_a_fluid():
    rows = Rows(ambient=Ambient(), component="line", handles={"a": 0, "b": 1})

    with pytest.raises(InputError, match="no fluid"):
        Line(**BORE).add_rows(rows)
