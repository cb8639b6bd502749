"""A junction of lines in a case: its errors, its start, and the shipped example."""

from pathlib import Path

import pytest

from klack.case.any_case import load_valve_case
from klack.errors import InputError
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.junction import Junction
from klack.hydraulics.line import Line
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.simulation.network_run import simulate_network

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

    with pytest.raises(InputError, match=r"(?s)a junction where .* one node.*remove the junction"):
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
