"""Derivatives of the start of a run, which its derivatives in time begin with.

Truth: steady flow, enclosed fluid and closed volumes in closed form; for whole valves, starts that
are found from nothing with the number changed.
"""

from pathlib import Path

import numpy as np
import pytest

from klack.analyses.sensitivities.parameters import slope_space
from klack.analyses.sensitivities.slopes import SlopeRunner
from klack.case.any_case import read_case_tree
from klack.case.key_path import _below, quantity_at
from klack.errors import KlackError
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.line import Line
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.input.problem import CaseProblem
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.network.rows import Ambient
from klack.simulation.network_compile import compile_network
from klack.simulation.static_start import begin_at_rest
from klack.simulation.step_sizes import step_sizes
from klack.simulation.tangent_numbers import Direction, slopes_at_rest

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
SMALL = 3e-5  # of a number: what its derivative is taken over
CASES = (
    *("common_rail", "hydraulic_supply", "relief_on_pipe"),
    *("remanent_magnet", "mechanical_parts", "pneumatic_valve"),
)


def slopes(rows, given, name):
    """Base and derivatives of all numbers at rest with one argument of ``rows``."""
    shift = SMALL * given[name]
    ends = [rows(**given | {name: given[name] + way * shift}) for way in (1, -1)]
    way = Direction(name=name, plus=ends[0], minus=ends[1], distance=2 * shift)
    sizes = step_sizes(rows(**given), "normal")
    network = compile_network(rows(**given), sizes)
    return network, slopes_at_rest(network, begin_at_rest(network, sizes.step)[1], way, sizes)


# --------------------------------------------------------------------------- closed forms

FLOWING = {"pressure": 100e5, "bore": 0.3e-3, "ambient": 1e5}


def flowing(pressure, bore, ambient):
    """A source, a line without friction, a chamber, and a wide orifice into the surroundings."""
    parts = {
        "source": PressureSource(pressure=pressure),
        "pipe": Line(length=0.4, diameter=4e-3, friction="none", pressure=100e5),
        "room": Chamber(volume=1e-6),
        "jet": Orifice(diameter=bore, critical_flow_number=1e-3, cavitation=None),
        "mass": RigidMass(mass=1e-3),
        "spring": Spring(stiffness=1e4, preload=0.0),
    }
    joints = [
        ["source.fluid", "pipe.a"],
        ["pipe.b", "room.fluid", "jet.a"],
        ["jet.b", "ambient"],
        ["mass.body", "spring.end"],
    ]
    fluid = library_fluid("water").at(293.15)
    return Network(parts, joints, fluid=fluid, ambient=Ambient(pressure=ambient)).rows()


@pytest.mark.parametrize(("name", "exponent"), [("pressure", 0.5 * 100 / 99), ("bore", 2.0)])
def test_steady_flow_through_a_line_follows_the_law_of_its_orifice(name, exponent):
    """``Q ~ d^2 sqrt(p - p_0)``; the compressibility of water adds 0.3 % to ``rho``."""
    network, found = slopes(flowing, FLOWING, name)
    lines, state = network.lines, network.line_state
    impedance = float(lines.impedance[0])
    to_b, to_a = (
        slice(int(lines.start[0, w]), int(lines.start[0, w] + lines.depth[0])) for w in (0, 1)
    )

    flow = (state.samples[to_b] - state.samples[to_a]) / (2 * impedance)
    change = (found.line_state.samples[to_b] - found.line_state.samples[to_a]) / (2 * impedance)

    size = FLOWING[name]
    # the pressure drop of a jet in water of 100 bar: its density is 0.2 % above that of 1 bar
    np.testing.assert_allclose(change * size / flow, exponent, rtol=5e-3)
    assert np.ptp(change) <= 1e-6 * np.max(np.abs(change))  # one flow all along the line


def test_a_stated_pressure_is_its_own_derivative():
    """Of the source, and without losses of the chamber behind the line."""
    network, found = slopes(flowing, FLOWING, "pressure")

    names = [network.rows.nodes[handle].component for handle in network.node_order]
    assert found.node_state.p[names.index("source")] == pytest.approx(1.0, rel=1e-9)
    assert found.node_state.p[names.index("room")] == pytest.approx(1.0, rel=1e-6)


DROP = {"front": 60e5, "back": 40e5}


def between(front, back):
    """A line at rest between two prescribed pressures: it starts with a straight drop."""
    parts = {
        "front": PressureSource(pressure=front),
        "pipe": Line(length=0.4, diameter=4e-3, friction="none", pressure=50e5),
        "back": PressureSource(pressure=back),
        "mass": RigidMass(mass=1e-3),
        "spring": Spring(stiffness=1e4, preload=0.0),
    }
    joints = [["front.fluid", "pipe.a"], ["pipe.b", "back.fluid"], ["mass.body", "spring.end"]]
    return Network(parts, joints, fluid=library_fluid("water").at(293.15)).rows()


def test_waves_in_a_line_change_along_it_with_the_pressure_at_one_end():
    """The pressure ``p_a + (p_b - p_a) x``: its derivative with ``p_a`` is ``1 - x``."""
    network, found = slopes(between, DROP, "front")
    lines = network.lines
    first, depth = int(lines.start[0, 0]), int(lines.depth[0])
    delay = depth - 1 + float(lines.fraction[0])

    change = found.line_state.samples[first : first + depth]

    place = np.clip(depth - 0.5 - np.arange(depth), 0.0, delay) / delay
    # d(rho_ref g)/dp = rho_ref / rho: water at 60 bar is 0.3 % denser than at 1 bar
    np.testing.assert_allclose(change, 1.0 - place, atol=4e-3)


CLOSED = {"pressure": 20e5, "volume": 2e-6, "ambient": 1e5}


def closed(pressure, volume, ambient):
    """A piston on enclosed oil of a stated pressure, and a room that nothing leads to."""
    parts = {
        "piston": RigidMass(mass=1e-2),
        "face": PressureFace(direction="opening", area=1e-4),
        "oil": Chamber(volume=volume, pressure=pressure),
        "room": Chamber(volume=1e-6),
        "lid": PressureFace(direction="opening", area=1e-6),
        "held": RigidMass(mass=1e-2),
        "spring": Spring(stiffness=1e4, preload=0.0),
    }
    joints = [
        ["piston.body", "face.body"],
        ["face.fluid", "oil.fluid"],
        ["room.fluid", "lid.fluid"],
        ["held.body", "lid.body", "spring.end"],
    ]
    fluid = library_fluid("ISO VG 46").at(313.15)
    return Network(parts, joints, fluid=fluid, ambient=Ambient(pressure=ambient)).rows()


def test_enclosed_fluid_keeps_the_mass_that_it_was_given():
    """Nothing holds the piston but oil, which ends at ambient pressure: ``rho(p) V = rho_0 V'``."""
    network, found = slopes(closed, CLOSED, "pressure")
    at = [network.rows.nodes[handle].component for handle in network.node_order].index("oil")
    mass = network.node_state.mass[at]

    sizes = step_sizes(network.rows, "normal")
    ends = [
        compile_network(closed(**CLOSED | {"pressure": 20e5 + way * 1e3}), sizes) for way in (1, -1)
    ]
    by_pressure = (ends[0].node_state.mass[at] - ends[1].node_state.mass[at]) / 2e3

    assert network.node_state.p[at] == pytest.approx(1e5, rel=1e-9)
    assert found.node_state.mass[at] == pytest.approx(by_pressure, rel=1e-5)
    assert found.node_state.p[at] == pytest.approx(0.0, abs=1e-6)
    by_volume = slopes(closed, CLOSED, "volume")[1].node_state.mass[at]
    assert by_volume == pytest.approx(mass / CLOSED["volume"], rel=1e-7)


def test_what_nothing_fills_follows_the_surroundings():
    network, found = slopes(closed, CLOSED, "ambient")
    names = [network.rows.nodes[handle].component for handle in network.node_order]

    assert found.node_state.p[names.index("room")] == pytest.approx(1.0, rel=1e-9)
    assert found.node_state.p[names.index("oil")] == pytest.approx(1.0, rel=1e-6)


# --------------------------------------------------------------------------- all numbers of a case


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_starts_of_valves_are_those_found_from_nothing(name):
    """For each number of the network; both are differences over the same change of it."""
    tree = read_case_tree(HOW_TO / f"{name}.yaml", [])
    case = tree.any_case()
    compared = 0
    runner = None
    for key in _keys(case.network, ("network",)):
        try:
            if quantity_at(case, key).value == 0.0:
                continue
            space = slope_space(case, None, [".".join(map(str, key))])
            runner = SlopeRunner(case, tree, space, case.one_variant(None), lambda *_: None, None)
            way = runner._direction(space.varied[0])
            rows, size = runner.rows({}), space.varied[0].size
            sizes = step_sizes(rows, "normal", step=case.run.step)
            network = compile_network(rows, sizes)
            found = slopes_at_rest(network, begin_at_rest(network, sizes.step)[1], way, sizes)
        except (CaseProblem, KlackError):
            continue  # refused with its reason
        ends = [compile_network(end, sizes) for end in (way.plus, way.minus)]
        for end in ends:
            begin_at_rest(end, sizes.step)
        if any(np.any(end.lines.depth != network.lines.depth) for end in ends):
            continue  # another number of samples
        of_ends = map(_states, (network.arrays, found, *(end.arrays for end in ends)))
        for base, slope, plus, minus in zip(*of_ends, strict=True):
            expected = (plus - minus) / way.distance * size
            scale = np.max(np.abs(base), initial=1e-6)
            np.testing.assert_allclose(
                slope * size, expected, rtol=1e-5, atol=1e-7 * scale, err_msg=str(key)
            )
        compared += 1
    assert compared > 5


def _states(numbers):
    """What a run begins with."""
    nodes, lines, contacts = numbers.node_state, numbers.line_state, numbers.interface_state
    return (
        *(numbers.bodies.at, numbers.bodies.laid_out),
        *(numbers.elements.state, numbers.branches.state),
        *(nodes.p, nodes.mass, nodes.g, lines.samples, lines.memory),
        *(contacts.gap, contacts.force, contacts.e, contacts.chi),
    )


def _keys(node, key):
    below = _below(node)[1]
    if not below:
        yield key
    for part, value in below.items():
        yield from _keys(value, (*key, part))
