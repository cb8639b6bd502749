"""Magnetic networks of one's own: the same as the solenoid, clear errors, energy of random ones."""

import numpy as np
import pytest

from klack.magnetics.magnetic_network import MagneticNetwork
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.static import static_state
from klack.magnetics.two_point import TwoPoint
from klack.magnetics.voltage_step import VoltageStep
from klack.verification.drivers import run_coil

IRON = {"kind": "iron", "material": "X6Cr17", "length": 3e-2, "area": 2e-5}
RING = {"kind": "shorted-coil", "resistance": 1e-3}
PLAIN = {
    "core": {**IRON, "between": ["a", "b"]},
    "coil": {"kind": "coil", "between": ["b", "c"], "turns": 60},
    "gap": {"kind": "face", "between": ["c", "a"], "area": 2e-5, "residual_gap": 3e-5},
    "leakage": {"kind": "leakage", "between": ["c", "b"], "permeance": 2e-8},
}


def run(magnet, drive, step, lift):
    """From the fluxes of its magnets; the resistance is that of all magnets here."""
    circuit = magnet.circuit()
    start = static_state(circuit, current=0.0, gap=1e-4).loop_fluxes
    return run_coil(circuit, drive, resistance=0.8, gap=1e-4, step=step, lift=lift, fluxes=start)


def network(**elements):
    given = {name: part for name, part in {**PLAIN, **elements}.items() if part is not None}
    return MagneticNetwork.model_validate({"resistance": 0.8, "gap": 1e-4, "elements": given})


def test_it_is_the_solenoid_where_that_can_be_described():
    eddy = {"conductivity": 1.6e6, "length": 2e-2, "radius": 2e-3, "permeability": 400, "terms": 3}
    pole = {"inner_radius": 2e-3, "outer_radius": 3.5e-3, "fringing": "plane", "shoulder": 2e-3}
    ring = {"radius": 5e-3, "clearance": 5e-5, "length": 4e-3}
    iron = {**IRON, "hysteresis": {"coercivity": 150.0, "initial_permeability": 200}}
    magnet = {"remanence": 0.1, "recoil_permeability": 1.1, "length": 1e-4, "area": 2e-5}
    solenoid = Solenoid(
        turns=60,
        resistance=0.8,
        gap=1e-4,
        residual_gap=3e-5,
        poles=[pole],
        parasitic=[ring],
        iron=[{k: v for k, v in iron.items() if k != "kind"}],
        magnets=[{**magnet, "polarity": "with-coil"}],
        eddy=[eddy],
        leakage=2e-8,
    )
    own = network(
        core={**iron, "between": ["a", "b"]},
        gap={"kind": "pole", "between": ["c", "d"], "residual_gap": 3e-5, **pole},
        ring={"kind": "ring", "between": ["d", "e"], **ring},
        magnet={"kind": "magnet", "between": ["e", "f"], **magnet},
        eddy={"kind": "eddy", "between": ["f", "a"], **eddy},
    )
    drive = TwoPoint(voltage=24.0, upper=6.0, lower=5.0, end=3e-4, decay=24.0).program()
    lift = 9e-5 * np.sin(np.linspace(0.0, 3.0, 1001)) ** 2

    runs = [run(c, drive, step=5e-7, lift=lift) for c in (solenoid, own)]

    for name in ("current", "force"):
        a, b = (getattr(run, name) for run in runs)
        # other loops, so steps are cut at other instants: what a run owes to its step
        np.testing.assert_allclose(a, b, rtol=0.0, atol=2e-5 * np.max(np.abs(a)))
    assert runs[1].hysteresis == pytest.approx(runs[0].hysteresis, rel=1e-5)
    assert runs[1].eddy == pytest.approx(runs[0].eddy, rel=1e-5)


def test_two_coils_in_series_add_and_against_each_other_cancel():
    half = {"kind": "coil", "between": ["b", "m"], "turns": 30}
    both = network(coil=half, second={**half, "between": ["m", "c"]})
    against = network(coil=half, second={**half, "between": ["c", "m"], "turns": 10})

    whole = static_state(network().circuit(), current=2.0, gap=1e-4)
    series = static_state(both.circuit(), current=2.0, gap=1e-4)

    assert series.linkage == pytest.approx(whole.linkage, rel=1e-12)
    assert series.force == pytest.approx(whole.force, rel=1e-12)
    twenty = network(coil={**half, "between": ["b", "c"], "turns": 20})
    assert static_state(against.circuit(), current=2.0, gap=1e-4).force == pytest.approx(
        static_state(twenty.circuit(), current=2.0, gap=1e-4).force, rel=1e-12
    )


def test_a_bias_coil_is_a_current_that_stays():
    bias = {"kind": "bias-coil", "between": ["n", "c"], "turns": 60, "current": 1.5}
    biased = network(coil={**PLAIN["coil"], "between": ["b", "n"]}, bias=bias,
                     leakage={**PLAIN["leakage"], "between": ["c", "b"]})  # fmt: skip

    with_bias = static_state(biased.circuit(), current=0.5, gap=1e-4).force

    assert with_bias == pytest.approx(
        static_state(network().circuit(), current=2.0, gap=1e-4).force, rel=1e-12
    )


@pytest.mark.parametrize(
    ("elements", "words"),
    [
        ({"coil": None}, "expected a coil"),
        ({"gap": {"kind": "air", "between": ["c", "a"], "length": 1e-4, "area": 1e-5}}, "moves"),
        ({"core": {**IRON, "between": ["a", "B"]}}, "nothing leads back|not joined"),
        ({"core": {**IRON, "between": ["a", "a"]}}, "'a' twice"),
        ({"more": {**IRON, "between": ["x", "y"]}}, "2 parts that are not joined"),
        ({"more": {**IRON, "between": ["c", "y"]}}, "no flux through more"),
        ({"leakage": {**RING, "between": ["b", "c"]}}, "a loop without reluctance, through coil"),
        ({"leakage": None, "ring": {**RING, "between": ["c", "d"]},
          "gap": {**PLAIN["gap"], "between": ["d", "a"]}}, "a leakage path around the coil"),
        ({"coil": {**PLAIN["coil"], "turns": 0}}, "expected turns"),
        ({f"l{k}": {**PLAIN["leakage"], "between": ["c", "a"]} for k in range(6)}, "8 independent"),
        ({"gap": {"kind": "pole", "between": ["c", "a"], "outer_radius": 3e-3, "fringing": "none",
                  "residual_gap": 3e-5, "tilts": True}}, "tilts: false"),
        ({"gap": {**PLAIN["gap"], "kind": "hole"}}, "hole"),
    ],
)  # fmt: skip
def test_errors_say_what_to_do(elements, words):
    with pytest.raises(ValueError, match=words):
        network(**elements)


def random_network(rng):
    """Pole and yoke with a few more elements at random."""
    parts = {
        "core": {**IRON, "between": ["a", "b"], "length": rng.uniform(1e-2, 6e-2),
                 "area": rng.uniform(1e-5, 4e-5),
                 "material": rng.choice(["X6Cr17", "VACOFLUX 50", "9SMnPb28"])},
        "coil": {"kind": "coil", "between": ["b", "c"], "turns": int(rng.integers(20, 200))},
        "gap": {"kind": "face", "between": ["c", "d"], "area": rng.uniform(5e-6, 4e-5),
                "fringing_factor": rng.uniform(1.0, 1.3), "residual_gap": rng.uniform(1e-5, 1e-4)},
        "disc": {**IRON, "between": ["d", "e"], "length": 5e-3},
        "ring": {"kind": "ring", "between": ["e", "a"], "radius": 5e-3, "length": 3e-3,
                 "clearance": rng.uniform(2e-5, 2e-4)},
        "leakage": {"kind": "leakage", "between": ["b", "c"],
                    "permeance": 10 ** rng.uniform(-9, -7)},
    }  # fmt: skip
    if rng.random() < 0.5:
        parts["bridge"] = {**IRON, "between": ["c", "a"], "length": 1e-3, "area": 1e-6}
    if rng.random() < 0.5:
        parts["magnet"] = {"kind": "magnet", "between": ["a", "g"], "remanence": 1.0,
                           "recoil_permeability": 1.05, "length": 1e-3, "area": 1e-5}  # fmt: skip
        parts["far"] = {"kind": "air", "between": ["g", "d"], "length": 1e-3, "area": 1e-5}
    if rng.random() < 0.5:
        parts["counter"] = {**parts["gap"], "between": ["d", "e"], "opens_from": 1e-4}
    if rng.random() < 0.4:
        parts["core"]["eddy"] = {"conductivity": 2e6, "terms": int(rng.integers(1, 3))}
    if rng.random() < 0.5:
        parts["core"]["hysteresis"] = {"coercivity": 300.0, "initial_permeability": 150}
    if rng.random() < 0.6:
        parts["ring"]["between"] = ["f", "a"]
        parts["short"] = {"kind": "shorted-coil", "between": ["e", "f"], "resistance": 1e-4}
    return MagneticNetwork.model_validate({"resistance": 1.0, "gap": 1e-4, "elements": parts})


@pytest.mark.slow
def test_a_hundred_random_networks_keep_their_energy():
    rng = np.random.default_rng(11)
    for _ in range(100):
        volts, step = rng.uniform(5.0, 60.0), 10 ** rng.uniform(-7, -5.3)
        lift = 1e-4 * np.cumsum(rng.normal(size=301)) / 40.0
        lift = np.clip(np.abs(lift), 0.0, 1e-4)

        drive = VoltageStep(voltage=volts, end=step * 200).program()
        found = run(random_network(rng), drive, step=step, lift=lift)

        assert np.all(np.isfinite(found.current))
        assert found.residual < 1e-11
        assert found.eddy >= 0.0
        assert found.hysteresis >= 0.0
