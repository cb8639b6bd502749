"""Lines of local properties: what they refuse and doubt, how they begin, stop and continue."""

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest
from doubts import doubts

from klack.errors import AccuracyWarning, InputError
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.line import Line
from klack.hydraulics.mixture import EntrainedGas
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_source import PressureSource, PressureStep
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.network.rows import Ambient
from klack.simulation.linear_network import linear_network
from klack.simulation.network_compile import compile_network
from klack.simulation.network_run import simulate_network
from klack.simulation.step_sizes import step_sizes
from klack.simulation.tangent_run import run_tangents

HEPTANE = library_fluid("n-heptane").at(293.15)
BORE = {"length": 0.1, "diameter": 2e-3}
LOCAL = {"properties": "local", "cells": 20}
TOLD = "ignore::klack.errors.AccuracyWarning"


def network(line, *, to=310e5, rise=2e-5, hole=0.3e-3, fluid=HEPTANE):
    parts = {
        "needle": RigidMass(mass=1e-3),
        "spring": Spring(stiffness=1e4, preload=0.0),
        "source": PressureSource(pressure=300e5, step=PressureStep(to=to, at=2e-5, rise=rise)),
        "pipe": Line.model_validate(BORE | line),
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
        Line.model_validate(BORE | given)


@pytest.mark.slow
@pytest.mark.filterwarnings(TOLD)
def test_cells_shorter_than_a_step_say_how_many_fit():
    rows = network(LOCAL | {"cells": 400})

    with pytest.raises(InputError, match=r"components.pipe.cells: got 400 cells") as caught:
        simulate_network(rows, duration=1e-5, step=400e-9, coarse=1)

    fits = int(caught.value.hint.split()[1])
    few = network(LOCAL | {"cells": fits})
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
        run(network(LOCAL, fluid=replace(HEPTANE, gas=slow)))


def test_derivatives_are_refused():
    with pytest.raises(InputError, match=r"components.pipe.properties"):
        run_tangents(network(LOCAL), (), duration=1e-5)


@pytest.mark.slow
def test_a_linear_state_space_is_refused():
    rows = network(LOCAL)
    compiled = compile_network(rows, step_sizes(rows, "normal", step=40e-9))

    with pytest.raises(InputError, match=r"components.pipe.properties.*properties: fixed"):
        linear_network(compiled, 1e-9)


@pytest.mark.slow
def test_a_steady_flow_that_boils_in_the_line_is_refused():
    narrow = network(LOCAL | {"diameter": 0.5e-3, "friction": "none", "length": 0.02}, hole=2e-3)

    with pytest.raises(InputError, match=r"pipe.*start"):
        run(narrow)


@pytest.mark.slow
@pytest.mark.filterwarnings(TOLD)
@pytest.mark.parametrize("friction", ["none", "steady", "kagawa", "turbulent"])
def test_a_line_begins_in_its_steady_flow_and_stays_there(friction):
    p = run(network(LOCAL | {"friction": friction}, to=300e5)).channels["room pressure"].values

    assert np.max(np.abs(p / p[0] - 1.0)) < 1e-4  # the cells resolve the profile to this


@pytest.mark.slow
@pytest.mark.filterwarnings(TOLD)
def test_mass_and_energy_balance_and_a_run_continues_to_the_same_bits():
    rows = network(LOCAL | {"friction": "turbulent"}, to=500e5)
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
    (text,) = [x for x in told(network({"friction": "none"}, to=700e5)) if "range" in x]

    assert "properties: local" in text
    assert not [x for x in told(network(LOCAL | {"friction": "none"}, to=700e5)) if "range" in x]


@pytest.mark.slow
@pytest.mark.parametrize("kind", [{}, LOCAL])
def test_laminar_flow_beyond_its_range_is_told_with_line_number_time_and_option(kind):
    steady = network(kind, to=300e5)
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
    flow_law = 128.0 * float(HEPTANE.viscosity(300e5)) * BORE["length"] / (np.pi * 2e-3**4)
    poiseuille = flow_law * flow / float(HEPTANE.density(300e5))
    assert told_drop == pytest.approx(
        poiseuille, rel=0.1
    )  # two digits, properties at a stated pressure


@pytest.mark.slow
@pytest.mark.parametrize("kind", [{}, LOCAL])
def test_turbulent_and_slow_flow_say_nothing_of_it(kind):
    fast = told(network(kind | {"friction": "turbulent"}))
    slow = told(network(kind, hole=0.02e-3, to=300e5))

    assert not [x for x in fast + slow if "Reynolds" in x]


@pytest.mark.slow
def test_steep_fronts_are_told_and_smooth_waves_are_not():
    jump = told(network(LOCAL | {"friction": "none"}, to=700e5, rise=1e-7, hole=0.02e-3))
    smooth = told(network(LOCAL | {"friction": "none"}, to=310e5, rise=1e-4))

    (text,) = [x for x in jump if "steep fronts" in x]
    assert "components.pipe.cells: 40" in text
    assert not [x for x in smooth if "steep fronts" in x]


@pytest.mark.slow
def test_a_macro_step_lasts_no_longer_than_a_wave_needs_for_a_cell():
    rows = network(LOCAL)
    sizes = step_sizes(rows, "normal", step=40e-9)

    assert sizes.coarse * sizes.step <= rows.waves[0].crossing
    assert rows.waves[0].crossing <= 0.1 / 20 / float(HEPTANE.sound_speed(780e5))
    assert compile_network(rows, sizes).waves.rows == 1
