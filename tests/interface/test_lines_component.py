"""Lines and junctions in a case.

What a line refuses, with the text, and what it chooses when it is not told.

A junction of lines in a case: its errors, its start, and the shipped example.

Lines of local properties: what they refuse and doubt, how they begin, stop and continue.
"""

import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from doubts import doubts

from klack.case.any_case import load_valve_case
from klack.errors import AccuracyWarning, InputError
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.junction import Junction
from klack.hydraulics.line import Line
from klack.hydraulics.mixture import EntrainedGas
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource, PressureStep
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.network.rows import Ambient, Rows
from klack.simulation.delay_line import compile_lines
from klack.simulation.linear_network import linear_network
from klack.simulation.network_compile import compile_network
from klack.simulation.network_run import simulate_network
from klack.simulation.step_sizes import step_sizes
from klack.simulation.tangent_run import run_tangents
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


HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
HEPTANE = library_fluid("n-heptane").at(293.15)
LINE = {"length": 0.05, "diameter": 2e-3}


def network(parts, connections):
    held = {"needle": RigidMass(mass=1e-3), "spring": Spring(stiffness=1e4, preload=0.0)}
    source = {"source": PressureSource(pressure=5e5)}
    joined = [*connections, ["needle.body", "spring.end"]]
    return Network({**held, **source, **parts}, joined, fluid=HEPTANE)


def test_a_junction_needs_the_end_of_a_line():
    parts = {"tee": Junction(), "in": Orifice(diameter=1e-3), "out": Orifice(diameter=1e-3)}
    joined = [["source.fluid", "in.a"], ["in.b", "tee.fluid", "out.a"], ["out.b", "ambient"]]

    with pytest.raises(InputError, match=r"(?s)tee.*without the end of a line.*chamber"):
        network(parts, joined).rows()


def test_no_face_moves_at_a_junction():
    face = PressureFace(direction="opening", outer_diameter=2e-3)
    parts = {"tee": Junction(), "l": Line(**LINE), "face": face}
    parts["moved"] = RigidMass(mass=1e-3)
    joined = [["source.fluid", "l.a"], ["l.b", "tee.fluid", "face.fluid"]]
    moving = network(parts, [*joined, ["moved.body", "face.body"]])

    with pytest.raises(InputError, match=r"(?s)face.*moves at the junction 'tee'.*chamber"):
        moving.rows()


@pytest.mark.parametrize("order", [("tee", "room"), ("room", "tee")])
def test_a_junction_and_a_chamber_at_one_node_are_refused(order):
    kinds = {"tee": Junction(), "room": Chamber(volume=1e-9)}
    parts = {"l": Line(**LINE), **{name: kinds[name] for name in order}}
    joined = [["source.fluid", "l.a"], ["l.b", "tee.fluid", "room.fluid"]]

    with pytest.raises(
        InputError, match=r"(?s)a junction at the same node as .* one node.*remove the junction"
    ):
        network(parts, joined).rows()


def test_a_branched_line_starts_in_its_steady_flow_and_stays_there():
    parts = {
        "tee": Junction(),
        "end": Junction(),
        "feed": Line(**LINE),
        "branch": Line(**LINE),
        "hole": Orifice(diameter=0.5e-3),
    }
    joined = [
        ["source.fluid", "feed.a"],
        ["feed.b", "tee.fluid", "branch.a", "hole.a"],
        ["branch.b", "end.fluid"],
        ["hole.b", "ambient"],
    ]
    result = simulate_network(
        network(parts, joined).rows(), duration=3e-4, step=50e-9, coarse=4, record=1e-6
    )

    assert result.start.flow["feed"] == pytest.approx(result.start.flow["hole"], rel=1e-12)
    assert result.start.flow["branch"] == pytest.approx(0.0, abs=1e-12)
    for name in ("tee", "end"):
        pressure = result.channels[f"{name} pressure"].values
        assert pressure == pytest.approx(result.start.pressure["tee"], rel=1e-9)


def test_the_example_rises_by_twice_the_jump_where_its_needle_closes():
    case = load_valve_case(HOW_TO / "line_tee.yaml")
    result = simulate_network(
        case.network.network().rows(),
        duration=case.run.duration,
        step=case.run.step,
        record=case.run.record,
    )
    mouth = result.channels["mouth pressure"].values

    assert result.books.relative_residual < 1e-12
    assert mouth[0] == pytest.approx(50e5, rel=1e-9)
    assert mouth.min() > 5e5
    assert mouth.max() > 60e5  # water hammer of the needle that closes


def test_a_roughness_belongs_to_turbulent_friction():
    with pytest.raises(InputError, match=r"(?s)roughness.*friction: kagawa.*turbulent"):
        Line(**LINE, roughness=1e-6)


def test_a_rough_line_takes_more_pressure_and_keeps_its_energy_in_one_account():
    drops = []
    for roughness in (0.0, 20e-6):
        line = Line(**LINE, friction="turbulent", segments=2, roughness=roughness)
        parts = {"l": line, "end": Junction(), "hole": Orifice(diameter=1.5e-3)}
        joined = [["source.fluid", "l.a"], ["l.b", "end.fluid", "hole.a"], ["hole.b", "ambient"]]
        rows = network(parts, joined).rows()
        result = simulate_network(rows, duration=1e-4, step=50e-9, coarse=4, record=1e-6)
        drops.append(5e5 - result.start.pressure["end"])
        assert len(rows.lines) == 3
        assert sum("waves" in name for name in result.books.stores_after) == 1
        assert result.books.relative_residual < 1e-12
        assert result.channels["l friction 1 Reynolds number"].values[0] > 4000.0

    assert drops[1] > 1.3 * drops[0]


BORE_LOCAL = {"length": 0.1, "diameter": 2e-3}
LOCAL = {"properties": "local", "cells": 20}
TOLD = "ignore::klack.errors.AccuracyWarning"


def network_local(line, *, to=310e5, rise=2e-5, hole=0.3e-3, fluid=HEPTANE):
    parts = {
        "needle": RigidMass(mass=1e-3),
        "spring": Spring(stiffness=1e4, preload=0.0),
        "source": PressureSource(pressure=300e5, step=PressureStep(to=to, at=2e-5, rise=rise)),
        "pipe": Line.model_validate(BORE_LOCAL | line),
        "room": Chamber(volume=50e-9),
        "hole": Orifice(diameter=hole),
    }
    joints = [
        ["needle.body", "spring.end"],
        ["source.fluid", "pipe.a"],
        ["pipe.b", "room.fluid", "hole.a"],
        ["hole.b", "ambient"],
    ]
    return Network(parts, joints, Ambient(), fluid).rows()


def run(rows, duration=200e-6, **more):
    return simulate_network(rows, duration=duration, step=40e-9, record=0.64e-6, **more)


def told(rows, **more):
    """Warnings of a run that speak of the line."""
    with doubts() as texts:
        run(rows, **more)
    return [text for text in texts if "'pipe'" in text]


@pytest.mark.parametrize(
    ("given", "key"),
    [
        ({"properties": "local", "segments": 3}, "segments"),
        ({"cells": 30}, "cells"),
        ({"properties": "local", "cells": 3}, "cells"),
    ],
)
def test_keys_of_the_other_kind_are_refused(given, key):
    with pytest.raises(ValueError, match=key):
        Line.model_validate(BORE_LOCAL | given)


@pytest.mark.slow
@pytest.mark.filterwarnings(TOLD)
def test_cells_shorter_than_a_step_say_how_many_fit():
    rows = network_local(LOCAL | {"cells": 400})

    with pytest.raises(InputError, match=r"components.pipe.cells: got 400 cells") as caught:
        simulate_network(rows, duration=1e-5, step=400e-9, coarse=1)

    fits = int(caught.value.hint.split()[1])
    few = network_local(LOCAL | {"cells": fits})
    simulate_network(few, duration=1e-5, step=400e-9, coarse=1)


def test_gas_that_takes_time_is_refused():
    slow = EntrainedGas(
        fraction=0.01,
        release_pressure=1e5,
        saturation_pressure=5e5,
        release_time=1e-3,
        absorption_time=1e-2,
    )

    with pytest.raises(InputError, match="pipe: fluid with release_time"):
        run(network_local(LOCAL, fluid=replace(HEPTANE, gas=slow)))


def test_derivatives_are_refused():
    with pytest.raises(InputError, match=r"components.pipe.properties"):
        run_tangents(network_local(LOCAL), (), duration=1e-5)


@pytest.mark.slow
def test_a_linear_state_space_is_refused():
    rows = network_local(LOCAL)
    compiled = compile_network(rows, step_sizes(rows, "normal", step=40e-9))

    with pytest.raises(InputError, match=r"components.pipe.properties.*properties: fixed"):
        linear_network(compiled, 1e-9)


@pytest.mark.slow
def test_a_steady_flow_that_boils_in_the_line_is_refused():
    narrow = network_local(
        LOCAL | {"diameter": 0.5e-3, "friction": "none", "length": 0.02}, hole=2e-3
    )

    with pytest.raises(InputError, match=r"pipe.*start"):
        run(narrow)


@pytest.mark.slow
@pytest.mark.filterwarnings(TOLD)
@pytest.mark.parametrize("friction", ["none", "steady", "kagawa", "turbulent"])
def test_a_line_begins_in_its_steady_flow_and_stays_there(friction):
    p = (
        run(network_local(LOCAL | {"friction": friction}, to=300e5))
        .channels["room pressure"]
        .values
    )

    assert np.max(np.abs(p / p[0] - 1.0)) < 1e-4  # the cells resolve the profile to this


@pytest.mark.slow
@pytest.mark.filterwarnings(TOLD)
def test_mass_and_energy_balance_and_a_run_continues_to_the_same_bits():
    rows = network_local(LOCAL | {"friction": "turbulent"}, to=500e5)
    whole = run(rows)

    half = run(rows, duration=102.4e-6)
    rest = run(rows, duration=102.4e-6, state=half.state)

    assert whole.books.relative_residual < 1e-12
    assert whole.books.least_loss >= 0.0
    after = rest.channels["room pressure"].values[1:]
    count = half.time.size
    same = whole.channels["room pressure"].values[count : count + after.size]
    assert np.array_equal(after[: same.size], same)


@pytest.mark.slow
def test_the_warning_of_fixed_properties_names_local_ones():
    (text,) = [x for x in told(network_local({"friction": "none"}, to=700e5)) if "range" in x]

    assert "properties: local" in text
    assert not [
        x for x in told(network_local(LOCAL | {"friction": "none"}, to=700e5)) if "range" in x
    ]


@pytest.mark.slow
@pytest.mark.parametrize("kind", [{}, LOCAL])
def test_laminar_flow_beyond_its_range_is_told_with_line_number_time_and_option(kind):
    steady = network_local(kind, to=300e5)
    (text,) = [x for x in told(steady) if "Reynolds" in x]

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AccuracyWarning)
        flow = float(run(steady).channels["hole mass flow"].values[0])
    reynolds = 4.0 * flow / (np.pi * 2e-3 * float(HEPTANE.viscosity(300e5)))
    found = float(text.split("number of ")[1].split()[0])
    assert found == pytest.approx(reynolds, rel=1e-2)  # three digits; the flow starts to 1e-4
    assert re.search(r"at [\d.]+ us; steady laminar", text)
    assert "friction: turbulent" in text
    more = float(text.split("about ")[1].split()[0])
    assert more == pytest.approx(0.3164 / 64.0 * reynolds**0.75, rel=0.05)  # two digits
    if kind:
        return  # viscosity differs along the line: no number
    told_drop = 1e5 * float(text.split("pressure drop, ")[1].split()[0])
    flow_law = 128.0 * float(HEPTANE.viscosity(300e5)) * BORE_LOCAL["length"] / (np.pi * 2e-3**4)
    poiseuille = flow_law * flow / float(HEPTANE.density(300e5))
    assert told_drop == pytest.approx(
        poiseuille, rel=0.1
    )  # two digits, properties at a stated pressure


@pytest.mark.slow
@pytest.mark.parametrize("kind", [{}, LOCAL])
def test_turbulent_and_slow_flow_say_nothing_of_it(kind):
    fast = told(network_local(kind | {"friction": "turbulent"}))
    slow = told(network_local(kind, hole=0.02e-3, to=300e5))

    assert not [x for x in fast + slow if "Reynolds" in x]


@pytest.mark.slow
def test_steep_fronts_are_told_and_smooth_waves_are_not():
    jump = told(network_local(LOCAL | {"friction": "none"}, to=700e5, rise=1e-7, hole=0.02e-3))
    smooth = told(network_local(LOCAL | {"friction": "none"}, to=310e5, rise=1e-4))

    (text,) = [x for x in jump if "steep fronts" in x]
    assert "components.pipe.cells: 40" in text
    assert not [x for x in smooth if "steep fronts" in x]


@pytest.mark.slow
def test_a_macro_step_lasts_no_longer_than_a_wave_needs_for_a_cell():
    rows = network_local(LOCAL)
    sizes = step_sizes(rows, "normal", step=40e-9)

    assert sizes.coarse * sizes.step <= rows.waves[0].crossing
    assert rows.waves[0].crossing <= 0.1 / 20 / float(HEPTANE.sound_speed(780e5))
    assert compile_network(rows, sizes).waves.rows == 1
