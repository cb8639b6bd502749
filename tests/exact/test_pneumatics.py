"""Gas in networks, alone and in a liquid.

Gas in a network: laws, errors with their texts, and networks without gas.

Truth: the volumes of liquid and gas, mass, and free gas that chambers only exchange.
"""

from math import sqrt

import numpy as np
import pytest
from draws import each

from klack.errors import InputError
from klack.hydraulics.accumulator import Accumulator
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.fluid_table import fluid_table
from klack.hydraulics.gas.flow_law import LAMINAR, restriction_flow
from klack.hydraulics.gas.gas_chamber import GasChamber
from klack.hydraulics.gas.gas_face import GasFace
from klack.hydraulics.gas.gas_library import AIR, HYDROGEN, library_gas
from klack.hydraulics.gas.gas_orifice import GasOrifice
from klack.hydraulics.gas.gas_source import GasSource
from klack.hydraulics.gas.gas_valve import GasValve
from klack.hydraulics.gas.restriction import factor_of_area, factor_of_conductance
from klack.hydraulics.gas_release import (
    free_gas,
    mixture_at,
    mixture_pressure,
    release_numbers,
    settled_share,
)
from klack.hydraulics.line import Line
from klack.hydraulics.mixture import EntrainedGas
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pump import Pump
from klack.mechanics.end_stop import EndStop
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.declaration import NetworkSection
from klack.network.network import Network
from klack.simulation.limits import limits_of
from klack.simulation.linear_network import linear_network
from klack.simulation.network_run import simulate_network
from klack.simulation.operating_point import compiled_at, operating_point

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


BAR, AMBIENT = 1e5, 101325.0
NEEDLE = {"needle": RigidMass(mass=3e-3, speed=0.5), "spring": Spring(stiffness=2e4, preload=0.0)}


def oil(release: float | None, absorption: float | None, exponent: float = 1.2):
    return library_fluid("ISO VG 46").at(
        313.15,
        gas_fraction=1e-2,
        gas_exponent=exponent,
        release_pressure=2 * BAR,
        saturation_pressure=8 * BAR,
        release_time=release,
        absorption_time=absorption,
    )


@pytest.mark.slow
@pytest.mark.parametrize("exponent", [1.0, 1.2, 1.4])
def test_a_mixture_that_has_settled_is_the_fluid_in_equilibrium(exponent):
    fluid = oil(1e-3, 5e-3, exponent)
    table, law = fluid_table(fluid.all_free(), AMBIENT), release_numbers(fluid, AMBIENT)
    p = np.geomspace(2.0, 3e8, 60)

    found = np.array([mixture_at(table, law, x, 0.3, 1.0, 1.0, 0)[:2] for x in p]).T

    volume, slope = fluid.specific_volume(p)
    np.testing.assert_allclose(1.0 / found[0], volume, rtol=1e-9)  # 1e-10: accuracy of the table
    np.testing.assert_allclose(-found[1] / found[0] ** 2, slope, rtol=1e-5)
    # the energy of the gas is the integral of its volume
    for a, b in ((5e4, 1.2e5), (1e5, 9e5), (0.2, 3.0)):
        x = np.linspace(a, b, 20001)
        v = np.array([free_gas(law, y)[0] for y in x])
        area = float(np.sum(v[1:] + v[:-1]) * (x[1] - x[0]) / 2.0)
        rise = free_gas(law, b)[2] - free_gas(law, a)[2]
        assert rise == pytest.approx(area, rel=1e-6)


@pytest.mark.parametrize(("freed", "taken"), [(0.0, 0.0), (1.0, 1e-3), (0.3, 1.0)])
def test_the_pressure_of_a_mixture_is_the_inverse_of_its_density(freed, taken):
    fluid = oil(1e-3, 5e-3)
    table, law = fluid_table(fluid.all_free(), AMBIENT), release_numbers(fluid, AMBIENT)

    for before in (0.0, 0.4, 1.0):
        for p in np.geomspace(5.0, 2e8, 80):
            rho, slope, _, _ = mixture_at(table, law, p, before, freed, taken, 0)
            assert slope > 0.0
            found, _ = mixture_pressure(table, law, rho, before, freed, taken, 0)
            # 1e-14 of the density
            assert found == pytest.approx(p, rel=1e-9, abs=3e-14 * rho / slope)


def rooms(fluid, **more):
    """Three chambers about a needle; nothing leaves."""
    parts = NEEDLE | {
        "low": Chamber(volume=60e-9, pressure=1.5 * BAR),
        "up": Chamber(volume=90e-9, pressure=5 * BAR),
        "side": Chamber(volume=20e-9, pressure=12 * BAR),
        "lower": PressureFace(direction="opening", area=1e-5),
        "upper": PressureFace(direction="closing", area=1e-5),
        "small": Orifice(diameter=0.3e-3),
        "wide": Orifice(diameter=0.5e-3),
        "pump": Pump(displacement=2e-9, speed=25.0),
    }
    joints = [
        ["needle.body", "spring.end", "lower.body", "upper.body"],
        ["low.fluid", "lower.fluid", "small.a", "pump.a"],
        ["up.fluid", "upper.fluid", "small.b", "wide.a"],
        ["side.fluid", "wide.b", "pump.b"],
    ]
    return simulate_network(
        Network(parts, joints, fluid=fluid).rows(),
        step=100e-9,
        record=4e-6,
        start="free",
        **more,
    )


@pytest.mark.parametrize("coarse", [1, 16])
def test_flows_carry_free_gas_and_lose_none(coarse):
    result = rooms(oil(1e15, 1e15), duration=2e-3, coarse=coarse)

    mass, share = result.state["nodes.mass"], result.state["nodes.free"]
    start = np.array([60e-9, 90e-9, 20e-9]) * oil(None, None).density(
        [1.5 * BAR, 5 * BAR, 12 * BAR]
    )
    settled = np.array([1.0, 0.5, 0.0])  # the smooth step at 1.5, 5 and 12 bar
    assert share[2] > 1e-3  # some came to the chamber that had none
    assert mass.sum() == pytest.approx(start.sum(), rel=1e-9)
    assert mass @ share == pytest.approx(start @ settled, rel=1e-9)


def test_gas_that_is_released_closes_the_energy_balance():
    result = rooms(oil(1e-4, 1e-3), duration=2e-3, coarse=16)

    books = result.books
    assert books.relative_residual < 1e-9
    assert all(loss >= 0.0 for loss in books.losses.values())
    released = [books.supplies[f"{name} gas release"] for name in ("low", "up", "side")]
    assert min(map(abs, released)) > 1e-3 * books.scale
    shares = [result.channels[f"{name} free gas"].values for name in ("low", "up", "side")]
    assert np.min(shares) >= 0.0
    assert np.max(shares) <= 1.0


def test_a_run_goes_on_where_it_ended():
    fluid = oil(1e-3, 5e-3)
    whole, half = (rooms(fluid, duration=d, coarse=16) for d in (1.6e-3, 0.8e-3))

    rest = rooms(fluid, duration=0.8e-3, coarse=16, state=half.state)

    for name in ("nodes.free", "nodes.dissolved", "nodes.p"):
        np.testing.assert_array_equal(rest.state[name], whole.state[name])


@pytest.mark.parametrize(
    "part",
    [
        (Line(length=0.1, diameter=2e-3), "part.a"),
        (Accumulator(volume=1e-6, precharge=5 * BAR), "part.fluid"),
    ],
    ids=["line", "accumulator"],
)
def test_parts_that_hold_fluid_without_a_share_are_refused(part):
    parts = NEEDLE | {"room": Chamber(volume=50e-9), "part": part[0]}
    joints = [["needle.body", "spring.end"], ["room.fluid", part[1]]]
    if part[1].endswith(".a"):
        joints.append(["part.b", "ambient"])
    rows = Network(parts, joints, fluid=oil(1e-3, 5.0)).rows()
    with pytest.raises(InputError, match=r"part: fluid with release_time"):
        simulate_network(rows, duration=1e-6)


def test_times_that_mean_nothing_are_refused():
    band = {"release_pressure": 2 * BAR, "saturation_pressure": 8 * BAR}
    for given in ({"release_time": 1e-3}, {"release_time": 0.0, "absorption_time": 1.0}):
        with pytest.raises(InputError, match="both times above 0"):
            EntrainedGas(**band, **given)
    with pytest.raises(InputError, match="with release_pressure"):
        EntrainedGas(release_time=1e-3, absorption_time=1.0)


def test_stiffness_is_that_of_gas_that_has_no_time_to_dissolve():
    slow, at_once = oil(1e-3, 5.0), oil(None, None)
    p, h = 5 * BAR, 1.0
    law, table = release_numbers(slow, AMBIENT), fluid_table(slow.all_free(), AMBIENT)

    rho = [mixture_at(table, law, p + s * h, 0.5, 0.0, 0.0, 0)[0] for s in (-1, 0, 1)]

    stiffness = rho[1] * 2 * h / (rho[2] - rho[0])
    assert slow.bulk_modulus(p) == pytest.approx(stiffness, rel=1e-6)
    assert slow.bulk_modulus(p) > 2.0 * at_once.bulk_modulus(p)
    assert slow.sound_speed(p) == pytest.approx(np.sqrt(stiffness / rho[1]), rel=1e-6)


def test_linearisation_says_that_it_needs_a_barotropic_fluid():
    parts = NEEDLE | {"room": Chamber(volume=50e-9), "hole": Orifice(diameter=1e-3)}
    joints = [["needle.body", "spring.end"], ["room.fluid", "hole.a"], ["hole.b", "ambient"]]
    rows = Network(parts, joints, fluid=oil(1e-3, 5.0)).at_start().rows()
    network, _ = compiled_at(rows, operating_point(rows))
    with pytest.raises(InputError, match="linearisation: fluid with release_time"):
        linear_network(network, 20e-9)


def test_the_share_in_equilibrium_is_the_smooth_step():
    law = release_numbers(oil(1e-3, 5.0), AMBIENT)
    t = np.linspace(-0.2, 1.2, 15)
    found = [settled_share(law, (2.0 + 6.0 * x) * BAR)[0] for x in t]
    inside = np.clip(t, 0.0, 1.0)
    np.testing.assert_allclose(found, 1.0 - 3.0 * inside**2 + 2.0 * inside**3, atol=1e-14)
