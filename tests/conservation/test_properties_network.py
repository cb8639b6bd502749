"""Truth: the energy balance. Small valves put together at random keep them and never leave numbers.

A mass between two stops, with springs, friction, films, forces, a coil and a hydraulic side: each
of them there or not, soft or stiff, at steps from 20 ns to 0.5 us.

The residual of the books is judged in every run, see ``energy_ledger``; for valves at random with
the limit at which a user is warned.
"""

from math import pi, sqrt

import numpy as np
import pytest
from energy_ledger import allowed
from hypothesis import assume, given
from hypothesis import strategies as st
from property_profiles import examples, log_range

from klack.errors import ConvergenceError, InputError
from klack.mechanics.force_over_stroke import ForceOverStroke, stroke_force_step
from klack.mechanics.friction import GuideFriction
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.catalogue import component_classes
from klack.network.component import Component
from klack.network.declaration import NetworkSection
from klack.network.network import Network
from klack.network.step_function import evaluate
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.simulation.network_sliders import largest_friction, slider_force
from klack.units import RATIO

pytestmark = pytest.mark.filterwarnings("ignore::klack.network.checks.LooseBodyWarning")

STEPS = st.sampled_from([20e-9, 100e-9, 500e-9])
MAYBE = st.booleans()
PLACES = st.floats(-1e-4, 2e-4).map(lambda y: round(y, 18))  # [m]; a way of 5e-324 has no digits
PARTS: dict[str, tuple[st.SearchStrategy[dict], tuple[str, ...]]] = {
    "spring": (
        st.fixed_dictionaries(
            {
                "stiffness": log_range(1.0, 1e6),
                "preload": st.floats(-30.0, 30.0),
                "damping": st.sampled_from([0.0, 0.0, 0.1, 5.0]),
            }
        ),
        ("end",),
    ),
    "guide-friction": (
        st.fixed_dictionaries(
            {
                "coulomb": st.floats(0.0, 2.0),
                "viscous": st.floats(0.0, 2.0),
            }
        ),
        ("body",),
    ),
    "force-over-time": (
        st.builds(
            lambda times, forces: {
                "time": tuple(np.cumsum(times) * 1e-5),
                "force": tuple(forces[: len(times)]),
            },
            st.lists(st.floats(0.01, 3.0), min_size=2, max_size=6),
            st.lists(st.floats(-60.0, 60.0), min_size=6, max_size=6),
        ),
        ("end",),
    ),
    "force-over-stroke": (
        st.builds(
            lambda places, forces: {
                "stroke": tuple((np.cumsum(places) - 2.0) * 2e-5),
                "force": tuple(forces[: len(places)]),
            },
            st.lists(st.floats(0.01, 3.0), min_size=2, max_size=6),
            st.lists(st.floats(-20.0, 20.0), min_size=6, max_size=6),
        ),
        ("end",),
    ),
    "gravity": (st.just({}), ("body",)),
}
LAWS = st.one_of(
    st.builds(lambda k: {"kind": "linear", "stiffness": k}, log_range(1e5, 1e10)),
    st.builds(lambda r: {"kind": "hertz", "radius": r, "modulus": 1e11}, log_range(1e-5, 0.1)),
    st.builds(
        lambda f, s: {"kind": "asperity", "force": f, "height": s},
        log_range(0.1, 10.0),
        log_range(1e-8, 1e-6),
    ),
)
FILMS = st.one_of(
    st.builds(lambda r: {"shape": "disc", "radius": r}, log_range(1e-4, 2e-3)),
    st.builds(
        lambda r, w: {"shape": "ring", "inner_radius": r, "outer_radius": r * (1.0 + w)},
        log_range(1e-4, 2e-3),
        st.floats(0.05, 1.0),
    ),
)


@st.composite
def networks(draw) -> Network:
    """A needle between seat and stop, and what else may be around it."""
    lift = draw(log_range(5e-6, 200e-6))
    components: dict[str, dict] = {
        "needle": {
            "type": "rigid-mass",
            "mass": draw(log_range(1e-4, 1e-2)),
            "speed": draw(st.floats(-1.0, 1.0)),
        }
    }
    at_needle = ["needle.body"]
    connections = []
    for word, (strategy, ports) in PARTS.items():
        if draw(MAYBE):
            components[word] = {"type": word, **draw(strategy)}
            at_needle += [f"{word}.{port}" for port in ports]
    wet = draw(MAYBE)
    for name, gap, port, other in (
        ("seat", draw(st.sampled_from([0.0, 1e-6])), "upper", "lower"),
        ("stop", lift, "lower", "upper"),
    ):
        components[name] = {
            "type": "end-stop",
            "gap": gap,
            "law": draw(LAWS),
            "restitution": draw(st.none() | st.floats(0.1, 1.0)),
            "series_compliance": draw(st.sampled_from([0.0, 1e-9])),
        }
        if wet and draw(MAYBE):
            components[name]["film"] = draw(FILMS)
        at_needle.append(f"{name}.{port}")
        connections.append([f"{name}.{other}", "ground"])
    if wet:
        components |= {
            "sac": {"type": "chamber", "volume": draw(log_range(5e-9, 1e-6))},
            "face": {
                "type": "pressure-face",
                "direction": draw(st.sampled_from(["opening", "closing"])),
                "area": draw(log_range(1e-8, 5e-6)),
            },
            "supply": {"type": "pressure-source", "pressure": draw(log_range(2e4, 1e7))},
            "inlet": {"type": "orifice", "diameter": draw(log_range(2e-5, 1e-3))},
            "outlet": {"type": "orifice", "diameter": draw(log_range(2e-5, 1e-3))},
        }
        at_needle.append("face.body")
        connections += [
            ["supply.fluid", "inlet.a"],
            ["inlet.b", "sac.fluid", "face.fluid", "outlet.a"],
            ["outlet.b", "ambient"],
        ]
    if draw(MAYBE):
        components |= {
            "coil": {
                "type": "solenoid",
                "turns": float(draw(st.integers(10, 200))),
                "resistance": draw(log_range(0.1, 10.0)),
                "gap": lift,
                "residual_gap": 50e-6,
                "poles": [{"inner_radius": 1e-3, "outer_radius": 3e-3, "fringing": "none"}],
                "eddy": [{"conductivity": 2e6, "length": 1e-2, "radius": 3e-3}]
                if draw(MAYBE)
                else [],
            },
            "driver": {"type": "voltage-step", "voltage": draw(st.floats(1.0, 65.0))},
        }
        at_needle.append("coil.armature")
        connections.append(["driver.terminals", "coil.terminals"])
    fluid = {"name": "n-heptane", "gas_fraction": draw(st.sampled_from([0.0, 1e-3]))}
    section = NetworkSection.model_validate(
        {
            "fluid": fluid if wet else None,
            "components": components,
            "connections": [at_needle, *connections],
        }
    )
    return section.network()


def run(network: Network, step: float) -> NetworkResult:
    try:
        with allowed("simulate_network", 1e-6):
            return simulate_network(
                network.rows(), duration=60e-6, step=step, coarse=4, record=4 * step, start="free"
            )
    except ConvergenceError as error:
        told = ("a smaller step", "far outside the range")  # and what to do
        assume(not any(words in str(error) for words in told))
        raise


@examples(12)
@given(networks(), STEPS)
def test_a_valve_keeps_its_books_and_its_numbers(network, step):
    result = run(network, step)

    for name, channel in result.channels.items():
        assert np.all(np.isfinite(channel.values)), name
    books = result.books
    for name, loss in books.losses.items():
        assert loss >= -1e-9 * books.throughput, name
    for name, values in result.channels.items():
        if name.endswith("contact force"):
            assert np.all(values.values >= 0.0), name
    for event in result.events:
        assert event.peak_force >= 0.0
        assert event.contact_time >= 0.0


@examples(8)
@given(networks())
def test_a_mirrored_declaration_is_the_same_valve(network):
    """Components and connections in another order: the same until a first touch, to 1e-10 m."""
    turned = Network(
        dict(reversed(network.components.items())),
        [tuple(reversed(nodes)) for nodes in reversed(network.connections)],
        network.ambient,
        network.fluid,
    )
    one, two = (run(x, 100e-9) for x in (network, turned))
    lift = "needle.body displacement"
    first = min((e.time for e in one.events), default=one.time[-1])
    before = one.time < first  # afterwards round-off grows from touch to touch
    a, b = (x.channels[lift].values[before] for x in (one, two))
    np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-10)


@examples(100)
@given(
    PARTS["force-over-stroke"][0],
    PLACES,
    PLACES,
    st.integers(0, 6),
)
def test_a_force_over_stroke_gives_back_what_it_took(table, start, end, place):
    """The work of any way is the difference of one potential, and the way back returns it."""
    part = ForceOverStroke(**table)
    par = (len(part.stroke), *part.stroke, *part.force, *part.work())
    out = []
    for a, b in ((start, end), (end, start), (start, start), (end, end)):
        status, found = evaluate(
            stroke_force_step, par, [min(place, len(part.stroke))], [0.0, 1e-6, a, b, 0.0, 0.0], 4
        )
        assert status == 0
        out.append(found)
    there, back, at_start, at_end = out
    scale = max(map(abs, part.force))
    assert there[0] == -there[1]
    assert there[0] == pytest.approx(back[0], rel=1e-9, abs=1e-12 * scale)
    assert min(part.force) - 1e-9 * scale <= there[0] <= max(part.force) + 1e-9 * scale
    work = there[0] * (end - start)
    size = scale * (abs(start) + abs(end) + 1e-4)
    assert work == pytest.approx(at_start[3] - at_end[3], abs=1e-13 * size)


WRONG = st.sampled_from([np.nan, np.inf, -np.inf, "1", True, None, [], {}])


@examples(100)
@given(st.sampled_from(list(component_classes())), st.data())
def test_a_component_refuses_what_is_no_number(found: type[Component], data):
    """Any field of any component, given nan, infinity or something else, says what it expects."""
    required = [name for name, info in found.model_fields.items() if info.is_required()]
    if not required:
        return
    wrong = data.draw(st.sampled_from(required))
    given_numbers = dict.fromkeys(required, 1.0)
    given_numbers[wrong] = data.draw(WRONG)
    if given_numbers[wrong] == "1":  # right for what has no unit
        assume(found.model_json_schema()["properties"][wrong].get("$comment") != RATIO.name)
    with pytest.raises(InputError) as caught:
        found(**given_numbers)
    assert caught.value.got
    assert caught.value.expected
    assert caught.value.hint


@examples(60)
@given(
    PARTS["guide-friction"][0],
    log_range(1e-9, 1e-5),
    st.floats(-1.0, 1.0),
    log_range(1.0, 1e3),
)
def test_friction_opposes_and_is_odd(given_friction, h, speed, more):
    part = GuideFriction(**given_friction, breakaway=given_friction["coulomb"] * more)
    network = Network(
        {"needle": RigidMass(mass=1e-3), "guide": part}, [["needle.body", "guide.body"]]
    )
    row = network.rows().sliders[0]
    numbers = (row.coulomb, row.breakaway - row.coulomb, row.stribeck_speed, row.viscous)
    G = h**2 / 2e-3
    forces = []
    for v in (speed, -speed):
        largest = largest_friction(*numbers, h, G, h * v)
        force, slip = slider_force(largest, row.viscous, h, G, h / 1e-3, h * v, v)
        assert force * v <= 0.0
        assert force * slip <= 0.0
        forces.append(force)
    assert forces[0] == -forces[1]
    most = row.breakaway + row.viscous * abs(speed)
    assert abs(forces[0]) <= most * (1.0 + 1e-12)


@examples(15)
@given(log_range(1.0, 1e6), log_range(1e-5, 1e-1), log_range(1e-3, 0.1), log_range(1e-12, 1.0))
def test_an_oscillator_keeps_its_amplitude_at_any_step(stiffness, mass, share, rest):
    """Mass on a spring, at any share of its period as a step: implicit midpoint never drifts.

    Forces settle to 1e-10 of the work of a step, so that this holds for any amplitude.  The scale
    of the books nearly vanishes where a run ends as it began, at rest: they are judged here.
    """
    period = 2.0 * pi * sqrt(mass / stiffness)
    step = share * period
    spring = Spring(stiffness=stiffness, preload=-rest * stiffness)
    network = Network(
        {"needle": RigidMass(mass=mass), "spring": spring}, [["needle.body", "spring.end"]]
    )
    with allowed("simulate_network", 1.0):
        result = simulate_network(
            network.rows(), duration=40 * step, step=step, coarse=1, record=step, start="free"
        )
    assert abs(result.books.residual) <= 1e-9 * stiffness * rest**2
    y = result.channels["needle.body displacement"].values
    assert np.abs(y - rest).max() <= rest * (1.0 + 1e-9)
    if share < 0.01:  # its period is 1 + (omega h)^2/12 times as long
        exact = rest * (1.0 - np.cos(2.0 * pi * result.time / period))
        np.testing.assert_allclose(y, exact, atol=rest * 1e-3)
