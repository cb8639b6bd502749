"""Magnets in a case: circuits, networks, what they refuse.

The component solenoid: its circuit, its rows, its errors.

Magnetic networks of one's own: the same as the solenoid, clear errors, energy of random ones.

What magnets and boost capacitors refuse or doubt: truth = where, what, expected, what to try.
"""

from math import pi

import numpy as np
import pytest
from doubts import doubts

from klack.errors import AccuracyWarning, InputError
from klack.magnetics.boost_capacitor import BoostCapacitor
from klack.magnetics.boost_driver import BoostDriver, Shot
from klack.magnetics.circuit import MagneticBranch, MagneticCircuit
from klack.magnetics.driver import DriveProgram, Driver, DriveState
from klack.magnetics.force_map_solenoid import ForceMapSolenoid
from klack.magnetics.iron import VACUUM_PERMEABILITY as MU0
from klack.magnetics.iron_choice import IronChoice
from klack.magnetics.iron_library import iron_curve
from klack.magnetics.magnetic_network import MagneticNetwork
from klack.magnetics.reluctance import IronReluctance, LinearReluctance
from klack.magnetics.remanent_start import magnetised_otherwise
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.static import static_state
from klack.magnetics.two_point import TwoPoint
from klack.magnetics.voltage_step import VoltageStep
from klack.magnetics.winding import warm_resistance
from klack.mechanics.prescribed_motion import PrescribedMotion
from klack.network.network import Network
from klack.network.rows import GROUND, Ambient, Rows
from klack.network.step_function import evaluate
from klack.verification.coils_in_networks import two_coils
from klack.verification.drivers import run_coil

INJECTOR = {
    "turns": 60,
    "resistance": 0.5,
    "gap": 100e-6,
    "residual_gap": 40e-6,
    "poles": [
        {"outer_radius": 5e-3, "inner_radius": 4e-3, "fringing": "equal", "shoulder": 2e-3},
        {"outer_radius": 2e-3, "fringing": "plane", "shoulder": 2e-3},
    ],
    "parasitic": [{"radius": 2e-3, "clearance": 50e-6, "length": 4e-3}],
    "iron": [{"material": "X6Cr17", "length": 40e-3, "area": 12e-6}],
}


class Steady(Driver):
    """A constant voltage of 4 V."""

    type = "steady"

    def program(self):
        return DriveProgram(states=(DriveState(name="on", voltage=4.0),))


def test_plain_solenoid_is_the_textbook_one():
    solenoid = Solenoid(
        turns=100,
        resistance=1.0,
        gap=80e-6,
        residual_gap=20e-6,
        poles=[{"outer_radius": 3e-3, "fringing": "none"}] * 2,
        leakage=2e-9,
    )
    area = pi * 9e-6

    state = static_state(solenoid.circuit(), current=2.0, gap=80e-6)

    flux = 200.0 * MU0 * area / (2 * 100e-6)
    # the gap table is exact to 1e-8
    assert state.branch_fluxes[0] == pytest.approx(flux, rel=1e-7)
    assert state.force == pytest.approx(-(flux**2) / (MU0 * area), rel=1e-6)
    assert state.linkage == pytest.approx(100 * flux + 100 * 200 * 2e-9, rel=1e-7)


def test_default_leakage_is_a_share_of_the_main_permeance():
    bare = {**INJECTOR, "iron": []}
    solenoid = Solenoid(**bare, leakage_share=0.08)

    state = static_state(solenoid.circuit(), current=1.0, gap=solenoid.gap)

    assert state.branch_fluxes[-1] / state.branch_fluxes[0] == pytest.approx(0.08, rel=1e-9)


def test_fringing_adds_flux_and_takes_force_per_flux():
    plain = [{**pole, "fringing": "none", "shoulder": None} for pole in INJECTOR["poles"]]
    with_edges, without = Solenoid(**INJECTOR), Solenoid(**{**INJECTOR, "poles": plain})

    a, b = (static_state(s.circuit(), current=1.0, gap=100e-6) for s in (with_edges, without))

    assert a.branch_fluxes[0] > b.branch_fluxes[0]
    assert abs(a.force) / a.branch_fluxes[0] ** 2 < abs(b.force) / b.branch_fluxes[0] ** 2


def test_residual_flux_passes_the_closed_gap():
    state = static_state(Solenoid(**INJECTOR, residual_flux=2e-6).circuit(), current=0.0, gap=0.0)

    assert state.branch_fluxes[0] == pytest.approx(2e-6, rel=1e-9)
    assert state.force < 0.0


def test_copper_gets_warm():
    assert warm_resistance(0.5, 293.15) == 0.5
    assert warm_resistance(0.5, 393.15) == pytest.approx(0.5 * (1 + 0.00393 * 100), rel=1e-12)


def settle(solenoid):
    """Let 4 V act on the coil for 8 ms; its element and the last output."""
    rows = Rows(Ambient())
    rows.component = "coil"
    rows.handles = {"armature": 0, "base": GROUND, "terminals": 0}
    rows.partners = {"terminals": (Steady(),)}
    solenoid.add_rows(rows)
    element = rows.elements[0]
    state = element.state
    for k in range(400):
        inputs = [k * 20e-6, 20e-6, *np.zeros(4)]
        size = 2 + state.size + len(element.books)
        status, out = evaluate(element.step, element.parameters, state, inputs, size)
        assert status == 0
        state = out[2 : 2 + state.size]
    return element, out


@pytest.mark.parametrize(("closes", "sign"), [("upward", 1.0), ("downward", -1.0)])
def test_voltage_runs_to_the_static_fluxes(closes, sign):
    core = {"conductivity": 1.6e6, "length": 2e-2, "radius": 2e-3, "permeability": 400, "terms": 2}
    solenoid = Solenoid(**INJECTOR, closes=closes, eddy=[core])

    element, out = settle(solenoid)

    static = static_state(solenoid.circuit(), current=8.0, gap=100e-6)
    assert element.ports == (0, GROUND)
    assert out[0] == pytest.approx(sign * abs(static.force), rel=1e-4)  # 8 ms of 0.7 ms
    assert out[1] == -out[0]


def map_of(solenoid, force_factor=1.0):
    """The same solenoid as a table of 25 currents and 11 gaps."""
    circuit = solenoid.circuit()
    current, gap = np.linspace(0.0, 12.0, 25), np.linspace(0.0, 120e-6, 11)
    states = [[static_state(circuit, current=i, gap=x) for x in gap] for i in current]
    return ForceMapSolenoid(
        resistance=0.5,
        gap=100e-6,
        current=current.tolist(),
        gaps=gap.tolist(),
        linkage=[[state.linkage for state in row] for row in states],
        force=[[force_factor * state.force for state in row] for row in states],
    )


@pytest.mark.slow
def test_map_of_a_solenoid_pulls_like_the_solenoid():
    solenoid = Solenoid(**INJECTOR)

    _, from_circuit = settle(solenoid)
    _, from_map = settle(map_of(solenoid))

    assert from_map[0] == pytest.approx(from_circuit[0], rel=5e-3)  # 11 gaps


@pytest.mark.slow
def test_map_with_a_wrong_force_warns():
    with pytest.warns(AccuracyWarning, match="the linkage gives"):
        map_of(Solenoid(**INJECTOR), force_factor=1.5)


@pytest.mark.parametrize(
    ("linkage", "words"),
    [
        ([[0.0, 0.0, 0.0]], "a linkage for each of 2 currents"),
        ([[0.0, 0.0], [1.0, 1.0]], "a linkage for each of 2 currents"),
        ([[0.0, 0.0, 0.0], [1.0, -1.0, 1.0]], "not increasing"),
    ],
    ids=["rows", "columns", "falling"],
)
def test_map_says_what_is_wrong_with_its_table(linkage, words):
    with pytest.raises(InputError, match=words):
        ForceMapSolenoid(
            resistance=0.5, gap=1e-4, current=[0, 1], gaps=[0, 1e-4, 2e-4], linkage=linkage
        )


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"residual_gap": 0.0}, "greater than 0"),
        ({"poles": []}, "at least 1 item"),
        ({"poles": [{"outer_radius": 1e-3, "fringing": "plane"}]}, "without shoulder"),
        (
            {"poles": [{"outer_radius": 1e-3, "fringing": "none", "wall": 1e-3}]},
            "wall together with fringing: none",
        ),
        (
            {"poles": [{"outer_radius": 1e-3, "inner_radius": 2e-3, "fringing": "none"}]},
            "below the outer radius",
        ),
        ({"parasitic": [{"radius": 1e-3, "length": 1e-3}]}, "an incomplete gap"),
        ({"iron": [{"material": "X6Cr71", "length": 1e-2, "area": 1e-5}]}, "X6Cr17"),
        ({"iron": [{"material": {}, "length": 1e-2, "area": 1e-5}]}, "none of them"),
        (
            {"eddy": [{"conductivity": 1e6, "length": 1e-2, "radius": 1e-3, "terms": 3}]},
            "permeability",
        ),
        (
            {"eddy": [{"shape": "sheet", "conductivity": 1e6, "length": 1e-2, "radius": 1e-3}]},
            "radius together with shape: sheet",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_errors_say_what_to_do(change, words):
    with pytest.raises(InputError, match=words):
        Solenoid(**{**INJECTOR, **change})


def test_iron_by_name_by_formula_and_by_table():
    named = IronChoice.model_validate("X6Cr17").curve()
    points = IronChoice(table={"flux_density": (0.5, 1.2), "field_strength": (100.0, 900.0)})

    assert float(named.field(1.0)) == float(iron_curve("X6Cr17").field(1.0))
    assert float(points.curve().field(1.2)) == pytest.approx(900.0)
    with pytest.raises(InputError):
        iron_curve("unobtainium")


@pytest.mark.parametrize(
    ("loops", "main", "words"),
    [
        (np.array([[1]]), "a", "one row per branch"),
        (np.array([[1, 1], [1, 1]]), "a", "independent columns"),
        (np.array([[1, 0], [0, 2]]), "a", "independent columns"),
        (np.array([[1, 0], [0, 1]]), "c", "different names"),
        (np.array([[0, 0], [1, -1]]), "a", "independent columns"),
    ],
)
def test_circuit_refuses_what_is_no_circuit(loops, main, words):
    branches = (
        MagneticBranch(name="a", law=LinearReluctance(1.0), turns=1.0),
        MagneticBranch(name="b", law=LinearReluctance(1.0)),
    )

    with pytest.raises(InputError, match=words):
        MagneticCircuit(branches=branches, loops=loops, main=main)


def test_circuit_without_coil():
    with pytest.raises(InputError, match="no loop around turns"):
        MagneticCircuit(
            branches=(MagneticBranch(name="a", law=LinearReluctance(1.0)),),
            loops=np.array([[1]]),
            main="a",
        )


def test_falling_magnetisation_curve_is_refused():
    with pytest.raises(InputError, match="is not increasing"):
        IronReluctance([0.0, 1.0, 2.0], [0.0, 2.0, 1.0], [1.0, 1.0, 1.0])


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
        ({"core": {**IRON, "between": ["a", "B"]}}, "no path leads back|not joined"),
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
def test_errors_say_what_to_do_network(elements, words):
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


STILL = PrescribedMotion(time=(0.0, 1.0), displacement=(0.0, 0.0))
BANK = BoostCapacitor(capacitance=20e-6, voltage=65.0, recharge_power=10.0)
SHARING = BoostDriver(
    battery=14.0,
    peak_current=10.0,
    hold_current=3.0,
    hold_band=1.0,
    shots=(Shot(start=0.0, end=0.5e-3),),
)
CHOPPED = TwoPoint(voltage=24.0, upper=3.1, lower=2.8, start=0.1e-3, end=1.5e-3)
POLE = {"outer_radius": 3e-3, "fringing": "none"}
PLAIN_REFUSALS = {"turns": 50.0, "resistance": 0.5, "gap": 8e-5, "residual_gap": 4e-5}
HYSTERESIS = {"coercivity": 400.0, "initial_permeability": 150.0}


def told(error):
    """Where, and whether all four parts of the message are there."""
    text = str(error)
    assert "\nTry: " in text
    assert error.got
    assert error.expected
    return error.where, text


def at_bank(magnet, *others):
    parts = {"body": STILL, "magnet": magnet, "one": SHARING, "bank": BANK, **dict(others)}
    lines = [
        ["body.body", "magnet.armature"],
        ["magnet.terminals", "one.terminals"],
        ["bank.outlet", "one.supply"],
    ]
    return parts, lines


def test_a_tilting_pole_at_a_shared_capacitor_is_refused():
    magnet = Solenoid.model_validate({**PLAIN_REFUSALS, "poles": [{**POLE, "tilts": True}]})

    with pytest.raises(InputError) as caught:
        Network(*at_bank(magnet)).rows()

    where, text = told(caught.value)
    assert where == "components.magnet"
    assert "off_axis or tilts with a driver that shares its boost capacitor" in text
    assert "a capacitance of its own" in text


def test_a_ring_aside_is_no_element_of_a_network():
    data = two_coils().model_dump(exclude_none=True, exclude_unset=True)
    gap = data["elements"]["gap"]
    data["elements"]["gap"] = {**gap, "between": ["c", "e"]}
    data["elements"]["ring"] = {
        "kind": "ring",
        "between": ["e", "a"],
        "radius": 5e-3,
        "clearance": 2e-4,
        "length": 3e-3,
        "off_axis": {"height": 1e-2},
    }

    with pytest.raises(ValueError, match=r"(?s)kind: ring.*only in the component 'solenoid'"):
        MagneticNetwork.model_validate(data)
    del data["elements"]["ring"]["off_axis"]
    MagneticNetwork.model_validate(data)


def test_a_coil_at_the_outlet_of_a_capacitor_is_refused():
    parts, lines = at_bank(Solenoid.model_validate({**PLAIN_REFUSALS, "poles": [POLE]}))
    lines = [["bank.outlet", "one.supply", "magnet.terminals", "one.terminals"], lines[0]]

    with pytest.raises(InputError) as caught:
        Network(parts, lines)

    _, text = told(caught.value)
    assert "one boost-capacitor, and the port 'supply' of each boost-driver" in text


def test_nine_windings_at_one_capacitor_name_the_capacitor_and_the_magnets():
    magnet = Solenoid.model_validate({**PLAIN_REFUSALS, "poles": [POLE]})
    parts, lines = {"body": STILL, "bank": BANK}, [["body.body"], ["bank.outlet"]]
    for k in range(9):
        parts |= {f"coil{k}": magnet, f"driver{k}": SHARING}
        lines[0].append(f"coil{k}.armature")
        lines[1].append(f"driver{k}.supply")
        lines.append([f"coil{k}.terminals", f"driver{k}.terminals"])

    with pytest.raises(InputError) as caught:
        Network(parts, lines).rows()

    where, text = told(caught.value)
    assert where == "components.bank"
    assert "got 9 windings" in text
    assert "coil8" in text


def remanent(turns):
    """A magnet with hysteresis whose second coil has a number of turns."""
    data = two_coils(iron=True).model_dump(exclude_none=True, exclude_unset=True)
    data["elements"]["core"] |= {"material": "X6Cr17", "hysteresis": HYSTERESIS}
    data["elements"]["second"]["turns"] = turns
    return MagneticNetwork.model_validate(data | {"start": "remanent"})


@pytest.mark.parametrize(("turns", "parts"), [(40.0, {}), (-40.0, {"other": ("core",)})])
def test_a_remanent_start_that_another_circuit_would_turn_round_is_doubted(turns, parts):
    """By symmetry: a coil wound the other way leaves the flux the other way."""
    magnet = remanent(turns)
    assert magnetised_otherwise(magnet.circuit(), ["other"], gap=magnet.gap) == parts
    network = Network(
        {"body": STILL, "magnet": magnet, "one": CHOPPED, "two": CHOPPED},
        [
            ["body.body", "magnet.armature"],
            ["magnet.terminals", "one.terminals"],
            ["magnet.other", "two.terminals"],
        ],
    )

    with doubts() as texts:
        network.rows()

    assert len(texts) == len(parts)
    for text in texts:
        assert "components.magnet.start" in text
        assert "'other' would leave core" in text
