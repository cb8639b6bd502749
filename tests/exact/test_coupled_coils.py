"""Several coils on one magnet, and the start at remanence.

Coils of one magnet on several drivers; truth: energy balance, one coil, limits by hand.

Transformers, reciprocity and saturated coils against SciPy are checks of ``klack verify --group
drivers``, shared capacitors of ``--group output-stage``.

A stroke that starts at remanence is the second stroke of a magnet that was demagnetised.
"""

from pathlib import Path

import numpy as np
import pytest
import yaml
from draws import each

from klack.analyses.stroke.figures import loop_chart
from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import load_valve_case
from klack.control.pid import PidController, Setpoint
from klack.control.sensor import Sensor
from klack.errors import InputError
from klack.magnetics.boost_capacitor import BoostCapacitor
from klack.magnetics.boost_driver import BoostDriver, Shot
from klack.magnetics.constant_drive import driven, hysteretic_coils
from klack.magnetics.controlled_voltage import ControlledVoltage
from klack.magnetics.coupled_step import coupled_step
from klack.magnetics.flux_step import magnet_step
from klack.magnetics.magnetic_network import MagneticNetwork
from klack.magnetics.peak_hold import PeakHold
from klack.magnetics.remanent_start import remanent_state
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.static import static_state
from klack.magnetics.two_point import TwoPoint
from klack.magnetics.voltage_step import VoltageStep
from klack.magnetics.voltage_table import VoltageTable
from klack.mechanics.end_stop import EndStop
from klack.mechanics.prescribed_motion import PrescribedMotion
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.simulation.network_run import simulate_network
from klack.verification.coils_in_networks import two_coils

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
STILL = PrescribedMotion(time=(0.0, 1.0), displacement=(0.0, 0.0))
MOVING = PrescribedMotion(time=(0.0, 0.3e-3, 0.8e-3, 2e-3), displacement=(0.0, 0.0, 80e-6, 20e-6))
BOOST = BoostDriver(
    battery=14.0,
    capacitance=20e-6,
    boost_voltage=65.0,
    recharge_power=10.0,
    efficiency=0.85,
    peak_current=10.0,
    hold_current=3.0,
    hold_band=1.0,
    diode_resistance=0.02,
    switch_resistance=0.03,
    shots=(Shot(start=0.0, end=0.5e-3), Shot(start=0.7e-3, end=1.2e-3)),
)
SHARING = BOOST.model_copy(
    update={"capacitance": None, "boost_voltage": None, "recharge_power": None}
)
PEAK = PeakHold(
    boost_voltage=48.0,
    peak_current=8.0,
    supply_voltage=12.0,
    hold_current=2.0,
    hold_band=0.4,
    start=0.2e-3,
    end=1.1e-3,
    decay=48.0,
)
CHOPPED = TwoPoint(voltage=24.0, upper=3.1, lower=2.8, start=0.1e-3, end=1.5e-3)
HYSTERESIS = {"coercivity": 400.0, "initial_permeability": 150.0}


def changed(magnet=None, **elements):
    """A magnet with two coils, some of its elements changed."""
    magnet = magnet or two_coils(iron=True)
    data = magnet.model_dump(exclude_none=True, exclude_unset=True)
    for name, change in elements.items():
        data["elements"][name] = {**data["elements"].get(name, {}), **change}
    return data


def joined(magnet, first, second, body=STILL):
    return Network(
        {"body": body, "magnet": magnet, "one": first, "two": second},
        [
            ["body.body", "magnet.armature"],
            ["magnet.terminals", "one.terminals"],
            ["magnet.other", "two.terminals"],
        ],
    )


@pytest.mark.slow
@each(("first", "second"), [(BOOST, PEAK), (PEAK, BOOST), (BOOST, BOOST), (CHOPPED, PEAK)])
@each(
    "change",
    [
        {},
        {"second": {"turns": -40.0}},
        {"core": {"eddy": {"conductivity": 1.6e6, "terms": 2}}},
        {"core": {"material": "X6Cr17", "hysteresis": HYSTERESIS}},
        {
            "bias": {
                "kind": "magnet",
                "between": ["a", "c"],
                "remanence": 0.4,
                "recoil_permeability": 1.05,
                "length": 1e-3,
                "area": 8e-6,
            }
        },
    ],
)
def test_two_drivers_balance_at_any_step(first, second, change):
    magnet = MagneticNetwork.model_validate(changed(**change))
    for step in (1e-6, 1e-5):
        run = simulate_network(
            joined(magnet, first, second, MOVING).rows(), duration=2e-3, step=step, record=1e-5
        )

        assert run.books.relative_residual < 1e-11
        assert run.books.least_loss >= 0.0
        assert np.all(run.channels["magnet current"].values >= 0.0)
        assert np.all(run.channels["magnet other current"].values >= 0.0)


def test_one_coil_keeps_the_step_of_one_coil():
    magnet = MagneticNetwork.model_validate(
        changed(second={"circuit": None}) | {"circuits": {}, "resistance": 2.8}
    )
    parts = {"body": STILL, "magnet": magnet, "one": CHOPPED}
    alone = Network(
        parts, [["body.body", "magnet.armature"], ["magnet.terminals", "one.terminals"]]
    )

    assert [row.step for row in alone.rows().elements] == [magnet_step]
    two = joined(two_coils(), CHOPPED, CHOPPED).rows()
    assert [row.step for row in two.elements] == [coupled_step]


@pytest.mark.slow
def test_a_run_continues_bit_for_bit():
    rows = joined(two_coils(iron=True), BOOST, PEAK, MOVING).rows()
    whole = simulate_network(rows, duration=1.2e-3, step=1e-6, record=1e-5)
    half = simulate_network(rows, duration=0.6e-3, step=1e-6, record=1e-5)

    rest = simulate_network(rows, duration=0.6e-3, step=1e-6, record=1e-5, state=half.state)

    for name, channel in rest.channels.items():
        assert channel.values[-1] == whole.channels[name].values[-1], name


@pytest.mark.slow
def test_a_controller_sets_the_voltage_of_its_own_coil():
    pid = PidController(
        kind="pid",
        sensor="i",
        setpoint=Setpoint(time=(0.0,), value=(2.0,)),
        gain=20.0,
        integral_time=0.1e-3,
        lower=-30.0,
        upper=30.0,
    )
    sensor = Sensor(channel="magnet other current", unit="A")
    control = ControlledVoltage(sample_time=5e-6, sensors={"i": sensor}, controller=pid)
    still = VoltageTable(time=(0.0,), voltage=(4.0,))

    run = simulate_network(
        joined(two_coils(), still, control).rows(),
        duration=20e-3,  # six time constants of the first coil
        step=5e-6,
        coarse=1,
        record=5e-6,
    )

    assert run.channels["magnet other current"].values[-1] == pytest.approx(2.0, rel=1e-3)
    assert run.channels["magnet current"].values[-1] == pytest.approx(5.0, rel=5e-3)
    assert run.channels["magnet voltage"].values[-1] == pytest.approx(4.0, rel=1e-12)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (changed(second={"circuit": "othr"}), "'othr'.*other"),
        (changed() | {"circuits": {"other": {"resistance": 2.0}, "more": {"resistance": 1.0}}},
         "no coil in it"),
        (changed(second={"circuit": "base"}) | {"circuits": {"base": {"resistance": 2.0}}},
         "another port"),
        (changed(first={"circuit": "other"}), "no coil at the terminals"),
        (changed(second_leakage={"between": ["a", "c"]}, first_leakage={"between": ["a", "c"]}),
         "without enough leakage paths of their own"),
    ],
    ids=["unknown", "empty", "port", "main", "leakage"],
)  # fmt: skip
def test_circuits_that_cannot_be_are_refused(data, words):
    with pytest.raises((InputError, ValueError), match=rf"(?s){words}"):
        MagneticNetwork.model_validate(data)


def test_every_circuit_needs_a_driver_of_its_own():
    parts = {"body": STILL, "magnet": two_coils(), "one": CHOPPED}
    body = ["body.body", "magnet.armature"]
    with pytest.raises(InputError, match=r"the coil magnet\.other without a driver"):
        Network(parts, [body, ["magnet.terminals", "one.terminals"]])
    with pytest.raises(InputError, match="in series"):
        Network(parts, [body, ["magnet.terminals", "magnet.other", "one.terminals"]])


BANK = BoostCapacitor(capacitance=20e-6, voltage=65.0, recharge_power=10.0)


def at_bank(driver, bank, *supply, magnet=None):
    parts = {
        "body": STILL,
        "magnet": magnet or two_coils(),
        "one": driver,
        "two": CHOPPED,
        "bank": bank,
    }
    lines = [["body.body", "magnet.armature"], ["magnet.terminals", "one.terminals"], *supply]
    if "other" in parts["magnet"].port_kinds():
        lines.append(["magnet.other", "two.terminals"])
    else:
        del parts["two"]
    return Network(parts, lines)


FEED = ["bank.outlet", "one.supply"]


@pytest.mark.parametrize(
    ("driver", "bank", "supply", "words"),
    [
        (BOOST, BANK, (), "without a driver"),
        (BOOST, BANK, (FEED,), r"(?s)has no port .supply.*a capacitance of its own"),
        (SHARING, BANK.model_copy(update={"voltage": 12.0}), (FEED,), "more than the battery"),
    ],
    ids=["nobody", "both", "low"],
)
def test_shared_capacitors_that_cannot_be_are_refused(driver, bank, supply, words):
    with pytest.raises(InputError, match=words):
        at_bank(driver, bank, *supply).rows()


def test_a_boost_driver_needs_one_capacitor():
    with pytest.raises(InputError, match="without a capacitor"):
        joined(two_coils(), SHARING, CHOPPED).rows()
    parts = {"body": STILL, "magnet": two_coils(), "one": SHARING, "two": SHARING}
    lines = [list(line) for line in joined(two_coils(), BOOST, BOOST).connections]
    with pytest.raises(InputError, match="one boost-capacitor"):
        Network(parts, [*lines, ["one.supply", "two.supply"]])
    with pytest.raises(InputError, match="boost_voltage"):
        BoostDriver(**{**SHARING.model_dump(exclude_none=True), "capacitance": 20e-6})


@pytest.mark.slow
def test_coils_of_one_magnet_may_share_a_capacitor():
    parts = {"body": MOVING, "magnet": two_coils(iron=True), "one": SHARING, "two": SHARING}
    network = Network(
        {**parts, "bank": BANK},
        [
            ["body.body", "magnet.armature"],
            ["magnet.terminals", "one.terminals"],
            ["magnet.other", "two.terminals"],
            ["bank.outlet", "one.supply", "two.supply"],
        ],
    )

    run = simulate_network(network.rows(), duration=2e-3, step=1e-6, record=1e-5)

    assert run.books.relative_residual < 1e-11
    assert set(run.books.supplies) >= {"magnet battery", "magnet other battery", "bank recharge"}
    assert np.min(run.channels["bank capacitor voltage"].values) > 0.0


@pytest.mark.slow
def test_constant_currents_need_no_capacitor():
    network = at_bank(SHARING, BANK, FEED)

    still = driven(network, {"magnet": 2.0, "magnet.other": 0.0})

    assert "bank" not in still.components
    run = simulate_network(still.rows(), duration=20e-6, step=1e-6, record=1e-5)
    assert run.channels["magnet current"].values[-1] == pytest.approx(2.0, rel=1e-12)


@pytest.fixture(scope="module")
def page():
    return " ".join((HOW_TO / "magnetic-network.md").read_text(encoding="utf-8").split())


def case_of(tmp_path, change=lambda parts: None):
    case = yaml.safe_load((HOW_TO / "two_coils.yaml").read_text(encoding="utf-8"))
    change(case["network"]["components"])
    (tmp_path / "case.yaml").write_text(yaml.safe_dump(case), encoding="utf-8")
    return load_valve_case(tmp_path / "case.yaml")


@pytest.mark.slow
def test_the_numbers_of_the_page_hold(tmp_path, page):
    stroke = run_stroke(case_of(tmp_path)).variants["dry"]
    opens = 1e6 * (stroke.opening_time - 0.1e-3)
    voltage = stroke.result.channels["magnet holding voltage"]

    assert f"after {opens:.0f} us" in page
    # 37.4 V in fine steps alone; the voltage of the last piece of a step shows its length
    assert "induces 37 V" in page
    assert np.interp(0.15e-3, stroke.result.time, voltage.values) == pytest.approx(37.4, abs=0.3)
    assert abs(stroke.result.books.relative_residual) < 1e-12


DOCS = Path(__file__).parents[2] / "docs"
IRON = {
    "material": "X6Cr17",
    "length": 3e-2,
    "area": 6e-5,
    "hysteresis": {"coercivity": 300.0, "initial_permeability": 150},
}
LAW = {"kind": "linear", "stiffness": 1e9}
MAGNET = {
    "turns": 60,
    "resistance": 0.8,
    "gap": 110e-6,
    "residual_gap": 20e-6,
    "poles": [{"outer_radius": 6e-3, "fringing": "none"}],
    "leakage": 5e-8,
}


def stroke(driver, duration, **keys):
    parts = {
        "needle": RigidMass(mass=3e-3, points=("tip",)),
        "spring": Spring(stiffness=1e4, preload=40.0),
        "seat": EndStop(gap=0.0, law=LAW, restitution=0.5),
        "stop": EndStop(gap=1e-4, law=LAW, restitution=0.5),
        "coil": Solenoid(**MAGNET, iron=[IRON], **keys),
        "driver": driver,
    }
    nodes = [
        ["needle.tip", "spring.end", "seat.upper", "stop.lower", "coil.armature"],
        ["ground", "seat.lower"],
        ["ground", "stop.upper"],
        ["driver.terminals", "coil.terminals"],
    ]
    return simulate_network(Network(parts, nodes).rows(), duration=duration)


def test_it_is_the_second_stroke():
    pulse = {"voltage": 24.0, "decay": 48.0}
    twice = stroke(VoltageStep(**pulse, end=2e-3, repeat_every=8e-3), 10e-3)
    once = stroke(VoltageStep(**pulse, end=2e-3), 2e-3, start="remanent")
    new = stroke(VoltageStep(**pulse, end=2e-3), 2e-3)

    def opens(run, after):
        return next(e.time for e in run.events if e.stop == "stop" and e.time > after) - after

    assert opens(once, 0.0) == pytest.approx(opens(twice, 8e-3), rel=2e-3)
    assert opens(new, 0.0) > 1.005 * opens(once, 0.0)  # the remanence helps
    known = remanent_state(Solenoid(**MAGNET, iron=[IRON]).circuit(), current=0.0, gap=110e-6)[0][0]
    flux = once.channels["coil flux"].values[0]
    assert flux == pytest.approx(float(known), rel=1e-3)  # the needle rests some nm deeper
    assert abs(once.books.relative_residual) < 1e-12
    assert np.all(new.channels["coil flux"].values[:1] == 0.0)


def test_without_hysteresis_there_is_no_remanence():
    plain = {key: value for key, value in IRON.items() if key != "hysteresis"}
    with pytest.raises(ValueError, match="start: remanent without hysteresis"):
        Solenoid(**MAGNET, iron=[plain], start="remanent")
    with pytest.raises(ValueError, match="start: remanent without hysteresis"):
        MagneticNetwork(
            resistance=1.0,
            gap=1e-4,
            start="remanent",
            elements={
                "iron": {**plain, "kind": "iron", "between": ["a", "b"]},
                "coil": {"kind": "coil", "between": ["b", "c"], "turns": 60},
                "gap": {"kind": "face", "between": ["c", "a"], "area": 3e-5, "residual_gap": 2e-5},
            },
        )


@pytest.mark.parametrize(("start", "opens"), [("remanent", 1.283), ("demagnetised", 1.354)])
def test_the_example_of_the_theory_page(tmp_path, start, opens):
    text = (DOCS / "how-to" / "remanent_magnet.yaml").read_text(encoding="utf-8")
    (tmp_path / "case.yaml").write_text(text.replace("start: remanent", f"start: {start}"))

    study = run_stroke(load_valve_case(tmp_path / "case.yaml"))

    assert 1e3 * study.variants["dry"].opening_time == pytest.approx(opens, abs=5e-4)
    chart = loop_chart(study)
    assert chart is not None
    loop, point = chart.panels[0].curves
    assert float(point.y[0]) == pytest.approx(6.828 if start == "remanent" else 0.0, rel=1e-3)
    assert float(np.max(loop.y)) > 90.0


def test_a_network_has_operating_points_too():
    """On the falling branch after saturation, on the mean curve otherwise."""
    elements = {
        "iron": {**IRON, "kind": "iron", "between": ["a", "b"]},
        "coil": {"kind": "coil", "between": ["b", "c"], "turns": 60},
        "gap": {"kind": "face", "between": ["c", "a"], "area": 3e-5, "residual_gap": 2e-5},
        "leakage": {"kind": "leakage", "between": ["b", "c"], "permeance": 2e-8},
    }
    found = []
    for start in ("demagnetised", "remanent"):
        magnet = MagneticNetwork(resistance=1.0, gap=1e-4, start=start, elements=elements)
        parts = {
            "needle": RigidMass(mass=3e-3),
            "spring": Spring(stiffness=1e6, preload=0.0),
            "coil": magnet,
            "driver": VoltageStep(voltage=12.0),
        }
        nodes = [
            ["needle.body", "spring.end", "coil.armature"],
            ["driver.terminals", "coil.terminals"],
        ]
        network = Network(parts, nodes)
        assert hysteretic_coils(network) == ["coil"]
        held = driven(network, {"coil": 1.0})
        run = simulate_network(held.rows(), duration=2e-4)
        flux = run.channels["coil flux"].values
        assert flux == pytest.approx(flux[0], rel=1e-6)  # it stays there
        found.append(float(flux[0]))
        if start == "demagnetised":
            place = 1e-4 - float(run.channels["needle.body displacement"].values[0])
            state = static_state(magnet.circuit(), current=1.0, gap=place)
            assert flux[0] == pytest.approx(state.branch_fluxes[2], rel=1e-9)
    assert found[1] > 1.05 * found[0]
