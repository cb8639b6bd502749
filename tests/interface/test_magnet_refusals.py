"""What magnets and boost capacitors refuse or doubt: truth = where, what, expected, what to try."""

import pytest
from doubts import doubts

from klack.errors import InputError
from klack.magnetics.boost_capacitor import BoostCapacitor
from klack.magnetics.boost_driver import BoostDriver, Shot
from klack.magnetics.magnetic_network import MagneticNetwork
from klack.magnetics.remanent_start import magnetised_otherwise
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.two_point import TwoPoint
from klack.mechanics.prescribed_motion import PrescribedMotion
from klack.network.network import Network
from klack.verification.coils_in_networks import two_coils

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
PLAIN = {"turns": 50.0, "resistance": 0.5, "gap": 8e-5, "residual_gap": 4e-5}
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
    magnet = Solenoid.model_validate({**PLAIN, "poles": [{**POLE, "tilts": True}]})

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

    with pytest.raises(ValueError, match=r"(?s)kind: ring.*a matter of 'solenoid'"):
        MagneticNetwork.model_validate(data)
    del data["elements"]["ring"]["off_axis"]
    MagneticNetwork.model_validate(data)


def test_a_coil_at_the_outlet_of_a_capacitor_is_refused():
    parts, lines = at_bank(Solenoid.model_validate({**PLAIN, "poles": [POLE]}))
    lines = [["bank.outlet", "one.supply", "magnet.terminals", "one.terminals"], lines[0]]

    with pytest.raises(InputError) as caught:
        Network(parts, lines)

    _, text = told(caught.value)
    assert "one boost-capacitor, and the port 'supply' of each boost-driver" in text


def test_nine_windings_at_one_capacitor_name_the_capacitor_and_the_magnets():
    magnet = Solenoid.model_validate({**PLAIN, "poles": [POLE]})
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
