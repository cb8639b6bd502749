"""Signed sums of forces with their reactions, their spectra, and the keys of mounts."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from klack.acoustics.at_mounts import spectra_of_means
from klack.acoustics.mount import axial_freedom
from klack.analyses.noise.mount_source import source_of
from klack.analyses.noise.reactions import HeldForces, forces_of_stroke
from klack.analyses.stroke.acting import ActingForce, MovingBody
from klack.bodies.reduction.craig_bampton import CraigBampton
from klack.bodies.reduction.structure import Structure
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
    with pytest.raises(InputError, match=r"no surface for the reaction of coil, weight"):
        run()
    with pytest.raises(InputError, match=r"no surface for the reaction of weight, expected"):
        run(coil=SurfaceName("oscillator", "mass"))


RATE, ROD_MASS, ROD_LENGTH = 2e6, 60e-3, 0.05
NEEDLE, STIFFNESS, LOSS, LIFT = 5e-3, 5e6, 15.0, 0.3e-3


def needle_on_stops() -> dict[str, np.ndarray]:
    """A needle between two stops under a magnet and a spring, half-implicit Euler, 20 ms."""
    t = np.arange(40_000) / RATE
    magnet = 60.0 * np.clip((t - 1e-3) / 1e-3, 0.0, 1.0) * np.clip((7e-3 - t) / 1e-3, 0.0, 1.0)
    x, v = -20.0 / STIFFNESS, 0.0
    seat, stop, spring, speed = np.zeros((4, t.size))
    for i in range(t.size):
        seat[i] = max(0.0, -STIFFNESS * x - LOSS * v) if x < 0.0 else 0.0
        stop[i] = max(0.0, STIFFNESS * (x - LIFT) + LOSS * v) if x > LIFT else 0.0
        spring[i] = 20.0 + 2000.0 * x
        v += (magnet[i] - spring[i] + seat[i] - stop[i]) / NEEDLE / RATE
        x += v / RATE
        speed[i] = v
    return {"seat": seat, "stop": stop, "spring": spring, "magnet": magnet, "speed": speed}


def rod_on_its_flange(modes: int = 30) -> Structure:
    """A steel rod by closed forms: held at one end, ports at the other and at 0.03 m."""
    k = (2.0 * np.arange(1, modes + 1) - 1.0) * np.pi / 2.0
    shapes = np.sqrt(2.0 / ROD_MASS) * np.cos(k[:, None] * np.array([0.0, 0.03]) / ROD_LENGTH)
    body = CraigBampton(
        omega=k * np.sqrt(210e9 / 7800.0) / ROD_LENGTH,
        damping=np.full(modes, 0.005),  # half of the loss factor
        mounts=("flange",),
        directions=(3,),
        references=np.zeros((1, 3)),
        participation=(np.sqrt(2.0 * ROD_MASS) * np.sin(k) / k)[:, None],
        mass=np.full((1, 1), ROD_MASS),
        stiffness=np.zeros((1, 1)),
        loss=np.zeros((1, 1)),
        port_names=("seat", "pole"),
        port_shapes=shapes,
        port_motion=np.ones((1, 2)),
    )
    plain = oscillator(mass=ROD_MASS, stiffness=1e6, base=ROD_MASS)
    return replace(plain, name="rod", at_mounts=(body,))


def test_reactions_that_are_left_out() -> None:
    """Third octaves of the free velocity against a table computed with exact mobilities."""
    path = Path(__file__).parents[1] / "data" / "structure_borne" / "reactions.csv"
    table = np.loadtxt(path, delimiter=",")
    found, structure = needle_on_stops(), rod_on_its_flange()
    push = {"seat": 1.0, "stop": -1.0, "spring": -1.0, "magnet": 1.0}
    channels = {
        name: ChannelData(unit="N", values=sign * found[name]) for name, sign in push.items()
    }
    channels["speed"] = ChannelData(unit="m/s", values=found["speed"])
    result = SimpleNamespace(time=np.arange(found["speed"].size) / RATE, channels=channels)

    def acting(name: str, body: str, port: str, sign: float) -> ActingForce:
        return ActingForce(component=name, channel=name, body=body, port=port, sign=sign)

    forces = (
        *(acting(name, "needle", "", 1.0) for name in push),
        acting("seat", "rod", "seat", -1.0),
        acting("stop", "rod", "pole", -1.0),
    )
    needle = MovingBody(body="needle", velocity="speed", mass=NEEDLE, in_fluid=False, driven=False)
    variant = SimpleNamespace(result=result, acting=forces, moving=(needle,), passages=())
    lines = 12.5 * np.arange(1, 1801)

    def bands(**reactions: SurfaceName | str) -> np.ndarray:
        held = forces_of_stroke([structure], variant, CaseNoise(reactions=reactions))
        assert held.unbalanced < 1e-11 * held.largest
        v = source_of([structure], held)(lines, 0.0).free_velocity[:, 0]
        energy = 2.0 * np.abs(v) ** 2 * 12.5
        edges = [(c * 10.0**-0.05, c * 10.0**0.05) for c in 1e3 * 10.0 ** (np.arange(-13, 14) / 10)]
        return 10.0 * np.log10([energy[(lines >= a) & (lines < b)].sum() for a, b in edges])

    pole, seat = SurfaceName("rod", "pole"), SurfaceName("rod", "seat")
    whole = bands(magnet=pole, spring=pole)
    apart = [
        bands(magnet="outside", spring=pole),
        bands(magnet=pole, spring="outside"),
        bands(magnet="outside", spring="outside"),
        bands(magnet=seat, spring=seat),
    ]
    # the table ends with the last value, klack with a mean at rest: of one line of 12.5 Hz in the
    # lowest bands that is up to 0.5 dB (without the spring, 37 dB below all forces at 100 Hz)
    assert table.shape == (27, 7)
    near = np.where(table[:, 0] < 110.0, 0.55, 0.1)
    assert np.all(np.abs(whole + 180.0 - table[:, 1]) < near)
    for values, column in zip(apart, (2, 3, 4, 6), strict=True):
        assert np.all(np.abs(values - whole - table[:, column]) < near), column


BROKEN = {
    "mounts: {flange: {surface: housing.top}}": "which is not held",
    "mounts: {flange: {surface: housing.rim}, clip: {surface: housing.rim}}": "belongs to mount",
    "mounts: {flange: {surface: housing.rim}}\n  reactions: {magnet: pole.top}": "magnet",
    "mounts: {flange: {surface: housing.rim}}\n  reactions: {spring: needle.tip}": "is not held",
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
