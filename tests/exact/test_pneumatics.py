"""Gas in a network: laws, errors with their texts, and networks without gas."""

from math import sqrt

import numpy as np
import pytest
from draws import each

from klack.errors import InputError
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_library import library_fluid
from klack.mechanics.end_stop import EndStop
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.declaration import NetworkSection
from klack.network.network import Network
from klack.pneumatics.conductance import factor_of_area, factor_of_conductance
from klack.pneumatics.flow_law import LAMINAR, restriction_flow
from klack.pneumatics.gas_chamber import GasChamber
from klack.pneumatics.gas_face import GasFace
from klack.pneumatics.gas_library import AIR, HYDROGEN, library_gas
from klack.pneumatics.gas_orifice import GasOrifice
from klack.pneumatics.gas_source import GasSource
from klack.pneumatics.gas_valve import GasValve
from klack.simulation.limits import limits_of

BODY = {"needle": RigidMass(mass=3e-3), "spring": Spring(stiffness=1e4, preload=5.0)}
JOINED = ["needle.body", "spring.end"]


def _network(parts, connections, **more):
    return Network({**BODY, **parts}, [JOINED, *connections], gas=AIR, **more)


@pytest.mark.slow
@each("b", [0.0, 0.2, 0.528, 1.0 - LAMINAR, 1.0])
@each("crack", [0.0, 3e4, 6e5, 7e5])
def test_the_flow_falls_with_the_pressure_behind_and_joins_everywhere(b, crack):
    behind = np.linspace(0.0, 6e5, 40001)
    flow = np.array([restriction_flow(6e5, p, 300.0, 1.0, b, 0.5, crack)[0] for p in behind])
    assert flow[-1] == 0.0
    assert np.all(np.diff(flow) <= 1e-12 * 6e5)
    assert flow[0] == (0.0 if crack >= 6e5 else pytest.approx(6e5 / sqrt(300.0), rel=1e-14))
    assert np.abs(np.diff(flow)).max() <= 0.06 * max(flow[0], 1.0)  # no jump


def test_the_same_hole_by_its_conductance_and_by_its_area_passes_the_same_hydrogen():
    """A sonic conductance measured with air stands for an area, whatever gas flows later."""
    area = 1e-6
    conductance = factor_of_area(AIR) * area / factor_of_conductance(AIR)
    assert factor_of_conductance(HYDROGEN) * conductance == pytest.approx(
        factor_of_area(HYDROGEN) * area, rel=1e-14, abs=0.0
    )
    assert library_gas("CNG") is library_gas("methane")


def test_gas_and_liquid_at_one_node_are_refused():
    with pytest.raises(InputError, match=r"wet.fluid \(liquid\) with air.gas \(gas\)") as caught:
        _network(
            {"wet": Chamber(volume=1e-7), "air": GasChamber(volume=1e-7)},
            [["wet.fluid", "air.gas"]],
            fluid=library_fluid("n-heptane").at(293.15),
        )
    assert "pressure-face" in caught.value.hint
    assert "accumulator" in caught.value.hint


def test_a_network_without_a_gas_is_refused():
    parts = {"air": GasChamber(volume=1e-7), "hole": GasOrifice(diameter=1e-3)}
    with pytest.raises(InputError, match="no gas, but the pneumatic component 'air'"):
        Network({**BODY, **parts}, [JOINED, ["air.gas", "hole.a"], ["hole.b", "ambient"]])


@pytest.mark.parametrize(
    ("parts", "connections", "text"),
    [
        ({"a": GasChamber(volume=1e-7)}, [["a.gas", "ambient"]], "prescribes the pressure"),
        (
            {"a": GasOrifice(diameter=1e-3), "b": GasOrifice(diameter=1e-3)},
            [["a.a", "ambient"], ["a.b", "b.a"], ["b.b", "ambient"]],
            "nothing there stores gas",
        ),
        (
            {"a": GasSource(pressure=1e5), "b": GasSource(pressure=1e5)},
            [["a.gas", "b.gas"]],
            "2 pressures",
        ),
        (
            {"a": GasChamber(volume=1e-7), "b": GasChamber(volume=1e-7)},
            [["a.gas", "b.gas"]],
            "a second gas chamber",
        ),
    ],
    ids=["chamber at ambient", "node without volume", "two sources", "two chambers"],
)
def test_nodes_that_cannot_be_computed(parts, connections, text):
    with pytest.raises(InputError, match=text):
        _network(parts, connections).rows()


@pytest.mark.parametrize(
    ("build", "text"),
    [
        (lambda: GasOrifice(conductance=1e-8), "critical_ratio"),
        (lambda: GasOrifice(), "none of them"),
        (lambda: GasOrifice(conductance=1e-8, critical_ratio=0.3, discharge=0.9), "discharge"),
        (lambda: GasValve(lift=(0.0, 1e-4), conductance=(0.0,), critical_ratio=0.3), "conductance"),
        (
            lambda: GasValve(lift=(1e-4, 0.0), conductance=(0.0, 1e-8), critical_ratio=0.3),
            "lifts that rise",
        ),
        (lambda: GasValve(diameter=1e-3, conductance=(0.0, 1.0)), "conductance"),
        (lambda: GasChamber(volume=1e-7, pressure=1e5, isothermal=True, temperature=300.0), "wall"),
        (lambda: GasChamber(volume=1e-7, temperature=300.0), "temperature"),
        (lambda: library_gas("hydrogn"), "hydrogen"),
    ],
)
def test_keys_that_contradict_each_other(build, text):
    with pytest.raises(InputError, match=text):
        build()


def test_a_gas_of_ones_own_needs_all_its_numbers():
    section = {
        "gas": {"name": "argon", "gas_constant": 208.1, "kappa": 1.667},
        "components": {"needle": {"type": "rigid-mass", "mass": 3e-3}},
        "connections": [],
    }
    with pytest.raises(ValueError, match="viscosity"):
        NetworkSection(**section)
    section["gas"]["viscosity"] = 22.3e-6
    assert NetworkSection(**section).gas.gas().cp == pytest.approx(208.1 * 1.667 / 0.667, rel=1e-14)


def test_a_stroke_that_uses_up_a_chamber_is_refused():
    """A face of 4 mm sweeps 2.5 mm^3 over 200 um; the chamber has 1 mm^3."""
    stop = EndStop(gap=200e-6, law={"kind": "linear", "stiffness": 1e9})
    parts = {
        "stop": stop,
        "air": GasChamber(volume=1e-9),
        "face": GasFace(direction="closing", outer_diameter=4e-3),
    }
    network = Network(
        {**BODY, **parts},
        [[*JOINED, "stop.lower", "face.body"], ["stop.upper", "ground"], ["air.gas", "face.gas"]],
        gas=AIR,
    )
    with pytest.raises(InputError, match="air"):
        network.rows()


def test_the_doubt_of_hydrogen_at_350_bar_names_its_compressibility():
    network = Network(
        {
            **BODY,
            "tank": GasChamber(volume=1e-6, pressure=350e5),
            "hole": GasOrifice(diameter=1e-4),
        },
        [JOINED, ["tank.gas", "hole.a"], ["hole.b", "ambient"]],
        gas=HYDROGEN,
    )
    limit = next(row for row in limits_of(network.rows()) if row.channel == "tank pressure")
    assert limit.valid[1] == pytest.approx(82e5)
    assert "1.22" in limit.effect(350e5)


def test_a_dry_valve_has_no_gas_and_a_network_without_gas_no_element_of_it():
    network = _network(
        {"tank": GasChamber(volume=1e-6, pressure=2e5), "hole": GasOrifice(diameter=1e-4)},
        [["tank.gas", "hole.a"], ["hole.b", "ambient"]],
    )
    assert [row.component for row in network.rows().elements] == ["spring", "gas"]
    dry = network.dry()
    assert dry.gas is None
    assert [row.component for row in dry.rows().elements] == ["spring"]
