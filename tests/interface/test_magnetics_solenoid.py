"""The component solenoid: its circuit, its rows, its errors."""

from math import pi

import numpy as np
import pytest

from klack.errors import AccuracyWarning, InputError
from klack.magnetics.circuit import MagneticBranch, MagneticCircuit
from klack.magnetics.driver import DriveProgram, Driver, DriveState
from klack.magnetics.force_map_solenoid import ForceMapSolenoid
from klack.magnetics.iron import VACUUM_PERMEABILITY as MU0
from klack.magnetics.iron_choice import IronChoice
from klack.magnetics.iron_library import iron_curve
from klack.magnetics.reluctance import IronReluctance, LinearReluctance
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.static import static_state
from klack.magnetics.winding import warm_resistance
from klack.network.rows import GROUND, Ambient, Rows
from klack.network.step_function import evaluate

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
