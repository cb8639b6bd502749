"""Signed sums of forces with their reactions, their spectra, and the keys of mounts."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from klack.acoustics.at_mounts import spectra_of_means
from klack.acoustics.mount import axial_freedom
from klack.analyses.noise.reactions import HeldForces, forces_of_stroke
from klack.analyses.stroke.acting import ActingForce, MovingBody
from klack.case.any_case import load_valve_case
from klack.case.bodies import SurfaceName
from klack.case.noise import CaseNoise
from klack.case.reader import find_case
from klack.errors import InputError
from klack.simulation.network_result import ChannelData
from klack.verification.vibration import oscillator

MASS, STEP, COUNT = 3e-3, 1e-6, 400


@pytest.mark.parametrize("shift", [0.0, 700.0])
def test_spectrum_of_means(shift: float) -> None:
    """A force that rises with one over a rate and stays: ``a / (s (s + a))``."""
    rate, f = 3e3, np.linspace(20.0, 20e3, 500)
    t = STEP * np.arange(20_000)
    means = 1.0 + (np.exp(-rate * (t + STEP)) - np.exp(-rate * t)) / (rate * STEP)
    ends = (np.array([5.0]), np.array([6.0]))
    found = spectra_of_means(STEP, means[:, None] + 5.0, ends, f, shift)[:, 0]
    s = shift + 2j * np.pi * f
    # aliases of a kink at the start, of the order of (f h)^2
    assert np.abs(found * s * (s + rate) / rate - 1.0).max() < 4e-4


def run(**reactions: SurfaceName | str) -> HeldForces:
    """A needle between a contact with the housing, a magnet to the ground, weight, and a fluid."""
    draw = np.random.default_rng(1)
    contact, magnet, weight = draw.normal(size=(3, COUNT))
    total = contact - magnet - weight
    speed = np.concatenate([[0.0], np.cumsum(total[1:]) * STEP / MASS])
    values = {
        "seat contact force": contact,
        "coil.armature force": -magnet,
        "coil.base force": magnet,
        "weight.body force": -weight,
        "needle velocity": speed,
    }
    result = SimpleNamespace(
        time=STEP * np.arange(COUNT),
        channels={name: ChannelData(unit="N", values=x) for name, x in values.items()},
    )

    def acting(channel: str, body: str, port: str, sign: float = 1.0) -> ActingForce:
        component = channel.split()[0].split(".")[0]
        return ActingForce(component=component, channel=channel, body=body, port=port, sign=sign)

    forces = (
        acting("seat contact force", "needle", "tip"),
        acting("seat contact force", "oscillator", "mass", -1.0),
        acting("coil.armature force", "needle", "top"),
        acting("coil.base force", "", ""),
        acting("weight.body force", "needle", "top"),
    )
    needle = MovingBody(
        body="needle", velocity="needle velocity", mass=MASS, in_fluid=False, driven=False
    )
    plain = oscillator(mass=0.1, stiffness=1e6, base=0.2)
    structure = replace(plain, at_mounts=(axial_freedom(plain, plain.mass),))
    variant = SimpleNamespace(result=result, acting=forces, moving=(needle,), passages=())
    return forces_of_stroke([structure], variant, CaseNoise(reactions=reactions or None))


def test_forces_and_reactions_are_minus_the_momentum() -> None:
    """The magnet pulls the housing where it is said to; weight comes from outside."""
    place = SurfaceName("oscillator", "mass")
    held = run(coil=place, weight="outside")
    assert held.unbalanced < 1e-12 * held.largest
    draw = np.random.default_rng(1)
    contact, magnet, weight = draw.normal(size=(3, COUNT))
    assert held.forces["oscillator"][:, 0] == pytest.approx((magnet - contact)[1:], abs=1e-12)
    before, after = held.ends["oscillator"]
    # at rest they carry what acts from outside
    assert before.sum() == pytest.approx(-weight[0], abs=1e-12)
    assert after.sum() == pytest.approx(-weight[-4:].mean(), abs=1e-12)


def test_reactions_without_a_place_are_named() -> None:
    """All of them at once."""
    with pytest.raises(InputError, match=r"no place for the reaction of coil, weight"):
        run()
    with pytest.raises(InputError, match=r"no place for the reaction of weight, expected"):
        run(coil=SurfaceName("oscillator", "mass"))


BROKEN = {
    "mounts: {flange: {surface: housing.top}}": "which nothing holds",
    "mounts: {flange: {surface: housing.rim}, clip: {surface: housing.rim}}": "has already",
    "mounts: {flange: {surface: housing.rim}}\n  reactions: {magnet: pole.top}": "magnet",
    "mounts: {flange: {surface: housing.rim}}\n  reactions: {spring: needle.tip}": "nothing holds",
    "reactions: {spring: pole.top}": "reactions without mounts",
    "passages: {feed: {direction: across}}": "passages without mounts",
    "mounts: {flange: {surface: housing.rim}}\n  passages: {pipe: {direction: across}}": "pipe",
}


@pytest.mark.parametrize("keys", BROKEN)
def test_keys_of_mounts(keys: str, tmp_path) -> None:
    """One clear error each."""
    text = find_case("demo-stroke").read_text(encoding="utf-8")
    path = tmp_path / "case.yaml"
    path.write_text(text.replace("noise:  #", f"noise:\n  {keys}\n  #"), encoding="utf-8")
    with pytest.raises(InputError, match=BROKEN[keys]):
        load_valve_case(path)
