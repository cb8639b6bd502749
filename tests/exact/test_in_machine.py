"""A valve in its machine, from keys to forces, energies and sound.

Truth: a rigid mass on a plate in closed form, the Rayleigh integral summed over a plate, rigid
bodies, the same machine as a model and as a file, and the power of all parts.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy

from klack.acoustics.coupling import joined, junction, power_balance
from klack.acoustics.interface import (
    InterfacePoint,
    SourceAtMounts,
    freedoms_of,
    laplace,
)
from klack.acoustics.isolator import DynamicStiffness, MeasuredIsolator, Spring
from klack.acoustics.plate import Plate
from klack.acoustics.receivers.modal import rigid_receiver
from klack.acoustics.receivers.opening import read_responses
from klack.acoustics.receivers.plates import InfinitePlate, PlateSound, finite_plate
from klack.acoustics.source_files import read_source, write_netcdf
from klack.analyses.noise.in_machine import Installed, in_machine
from klack.analyses.noise.machine import check_machine, machine_of
from klack.case.any_case import load_any_case
from klack.case.bodies import CaseMaterial
from klack.case.noise import CaseNoise
from klack.case.reader import find_case
from klack.errors import InputError
from klack.materials.material import Material

STEEL = CaseMaterial(young=210e9, poisson=0.3, density=7850.0)
LOSS = 0.3  # so that 250 ms hold the ringing
SHEET = Plate(
    thickness=2e-3,
    area=0.2,
    material=Material(name="steel", young=210e9, poisson=0.3, density=7850.0),
    loss_factor=LOSS,
)
MASS, PUSH, FALL = 0.06, 40.0, 0.4e-3  # [kg], [N], [s]: a push that falls off
POINT = InterfacePoint(name="foot")
CUT = {f"foot.{name}": "free" for name in ("x", "y", "rx", "ry", "rz")}


def block(frequency: np.ndarray, shift: float = 0.0) -> SourceAtMounts:
    """A free mass that moves along z, and is rigid and light in all else."""
    s = laplace(frequency, shift)
    f = PUSH * FALL / (1.0 + s * FALL)
    n = 6
    Y = np.zeros((s.size, n, n), dtype=complex)
    Y[:, range(n), range(n)] = 1.0 / (s[:, None] * np.array([MASS] * 3 + [2e-5] * 3))
    force = np.zeros((s.size, n), dtype=complex)
    force[:, 2] = f
    return SourceAtMounts(
        frequency=frequency,
        points=(POINT,),
        freedoms=freedoms_of("foot"),
        free_velocity=(Y @ force[..., None])[..., 0],
        blocked_force=force,
        mobility=Y,
        shift=shift,
    )


def on(**keys: object) -> Installed:
    """The block on the machine of a section."""
    receiver = {"missing": CUT} | dict(keys.pop("receiver"))  # type: ignore[call-overload]
    data = {"mounts": {"foot": {"surface": "a.b"}}, "receiver": receiver, **keys}
    noise = CaseNoise.model_validate(data, context={})
    machine = machine_of(noise, {"steel": STEEL}, (POINT,))
    return Installed(at=block, machine=machine, span=5e-3, top=20e3)


INFINITE = {"infinite_plate": {"thickness": "2 mm", "material": "steel"}}
EAR = {"listener": ["0 m", "0 m", "1.5 m"]}


def test_a_mass_on_an_infinite_plate_over_time_and_in_energy() -> None:
    """A real mobility: m v' + v/Y = F; on the normal a sheet radiates as a mass, rho g/(2 pi R m).

    Lines from 10 Hz to 20 kHz leave out what is outside, so energies compare with the closed form
    of the spectrum there.
    """
    found = on(receiver=INFINITE, ears=EAR)
    record, (pressure,) = in_machine(found, 1.0)
    a, b, Y = 1.0 / (MASS * SHEET.mobility), 1.0 / FALL, SHEET.mobility
    t = pressure.time - 1.5 / 343.2
    v = np.where(t > 0.0, PUSH / MASS * (np.exp(-a * t) - np.exp(-b * t)) / (b - a), 0.0)
    expected = 1.204 / (2.0 * np.pi * 1.5 * SHEET.mass_per_area) * v / Y
    apart = np.abs(pressure.values - expected) / expected.max()
    assert apart.max() < 0.015  # where the slope begins: (a + b) / omega is above 20 kHz
    assert apart[np.abs(t) > 0.5e-3].max() < 1e-3
    (freedom,) = record.freedoms
    s = laplace(record.frequency)
    velocity = PUSH * FALL / (1.0 + s * FALL) / (MASS * s + 1.0 / Y)
    energy = np.trapezoid(2.0 * np.abs(velocity) ** 2 / Y, record.frequency)
    assert freedom.energy == pytest.approx(energy, rel=1e-12)
    whole = (PUSH / MASS / (b - a)) ** 2 * (0.5 / a + 0.5 / b - 2.0 / (a + b)) / Y
    assert freedom.energy == pytest.approx(whole, rel=0.05)  # 2 df a / (a^2 + ..) below 10 Hz
    assert record.balance < 1e-12
    assert record.motion == pytest.approx(v.max(), rel=5e-3)
    (ear,) = record.ears
    H = 1.204 / (2.0 * np.pi * 1.5 * SHEET.mass_per_area)
    band = int(np.flatnonzero(ear.bands.number == 0)[0])  # 1 kHz
    f = np.linspace(ear.bands.low[band], ear.bands.high[band], 999)
    g = PUSH * FALL / (1.0 + laplace(f) * FALL) / (1.0 + MASS * Y * laplace(f))
    exposed = np.trapezoid(2.0 * np.abs(H * g) ** 2, f)
    assert ear.bands.energy[band] == pytest.approx(exposed, rel=1e-3)
    assert [path.share for path in ear.paths] == pytest.approx([1.0], rel=1e-12)


def test_a_sound_that_is_cut_off_says_so() -> None:
    """A mass on a spring without loss rings for ever; on a plate only forces can last as long."""
    plate = on(receiver=INFINITE, ears=EAR)
    spring = {"foot": {"stiffness": {"z": "1 N/um"}}}
    thick = {"infinite_plate": {"thickness": "1 m", "material": "steel"}}
    for found, is_cut in (
        (plate, False),
        (replace(plate, span=1.0), True),
        (replace(on(receiver=INFINITE), span=1.0), False),  # no ears
        (on(receiver=thick, ears=EAR, elements=spring), True),
    ):
        signal, _ = found.signal()
        assert signal is not None
        assert any("ends 0.8 s after" in note for note in signal.notes) == is_cut


def test_a_machine_without_loss_takes_no_energy() -> None:
    """Truth: springs to the ground and a free body take none; all powers sum to round-off."""
    for receiver in ({"springs": {"z": "1 N/um"}}, {"body": {"mass": "2 kg"}}):
        record, _ = in_machine(on(receiver=receiver), 1.0)
        assert record.energy == 0.0
        assert record.balance < 1e-6


def test_a_spring_with_a_loss_factor_has_no_time_beside_the_axis() -> None:
    """On lines of the axis the signal is that of the viscous spring, but for its causality."""
    soft = {"stiffness": {"z": "2 N/um"}}
    viscous = on(
        receiver=INFINITE, ears=EAR, elements={"foot": soft | {"damping": {"z": "20 N*s/m"}}}
    )
    lossy = on(receiver=INFINITE, ears=EAR, elements={"foot": soft | {"loss_factor": "1 %"}})
    assert viscous.machine.causal
    assert not lossy.machine.causal
    (one,), _ = viscous.pressures()
    (other,), why = lossy.pressures()
    assert not why
    count = 1500
    plain = on(receiver=INFINITE, ears=EAR, elements={"foot": soft})
    (exact,), _ = plain.pressures()
    first = round((exact.start - other.start) / other.step)
    assert abs(first - (exact.start - other.start) / other.step) < 1e-6
    late = other.values[first : first + count] - exact.values[:count]
    assert np.abs(late).max() < 0.05 * np.abs(exact.values).max()
    assert (
        np.abs(one.values[:count] - exact.values[:count]).max() < 0.1 * np.abs(exact.values).max()
    )


def test_elements_lose_what_is_missing() -> None:
    """Energy from the mass = into the plate + lost in the spring, at every line."""
    element = {"stiffness": {"z": "2 N/um"}, "loss_factor": "30 %"}
    record, _ = in_machine(on(receiver=INFINITE, elements={"foot": element}), 1.0)
    assert record.balance < 1e-12
    s = laplace(record.frequency)
    k = 2e6 * (1.0 + 0.3j)
    free = PUSH * FALL / (1.0 + s * FALL) / (MASS * s)
    g = free / (1.0 / (MASS * s) + s / k + SHEET.mobility)
    lost = np.trapezoid(2.0 * np.real(s / k) * np.abs(g) ** 2, record.frequency)
    assert record.element_loss == pytest.approx(lost, rel=1e-12)
    assert record.energy == pytest.approx(
        np.trapezoid(2.0 * SHEET.mobility * np.abs(g) ** 2, record.frequency), rel=1e-12
    )


def test_balance_with_elements_of_any_kind() -> None:
    """Random bodies, springs and elements with inertia: each power by its own matrix, 1e-9."""
    draw = np.random.default_rng(7)
    f = np.sort(10.0 ** draw.uniform(1.5, 4.2, 6))
    s = laplace(f)
    for trial in range(60):
        n = int(draw.integers(1, 7))

        def body(n: int = n) -> np.ndarray:
            shapes = draw.normal(size=(2 * n, n))
            omega = 10.0 ** draw.uniform(2, 5, 2 * n)
            H = 1.0 / (omega**2 + 0.05 * omega * s[:, None] + s[:, None] ** 2)
            return s[:, None, None] * np.einsum("mp,km,mq->kpq", shapes, H, shapes)

        own, other = body(), body()
        velocity = draw.normal(size=(6, n)) + 1j * draw.normal(size=(6, n))
        source = SourceAtMounts(
            frequency=f,
            points=(InterfacePoint(name="a"),),
            freedoms=freedoms_of("a")[:n],
            free_velocity=velocity,
            blocked_force=velocity,
            mobility=own,
        )
        k = 10.0 ** draw.uniform(3, 7)
        heavy = DynamicStiffness(
            transfer=np.full(6, k * (1 + 0.1j)),
            driving=k * (1 + 0.1j) - (2 * np.pi * f) ** 2 * 1e-3,
            receiving=k * (1 + 0.1j) - (2 * np.pi * f) ** 2 * 2e-3,
        )
        element = (
            Spring(values={1: k}, loss_factor=0.2)
            if trial % 2
            else MeasuredIsolator(name="e", frequency=f, values={1: heavy})
        )
        known = Known(other, source)
        joint = junction(source, known, isolators={"a": element})
        lost, rest = power_balance(joint, joined(joint, source, ()))
        assert rest.max() <= 1e-9
        assert np.all(lost >= -1e-12 * np.abs(lost).max())


class Known:
    """A receiver of one matrix."""

    def __init__(self, mobility: np.ndarray, source: SourceAtMounts) -> None:
        self.mobility, self.points = mobility, source.points
        self.freedoms, self.ears = source.freedoms, ()

    def at(self, s: np.ndarray):
        from klack.acoustics.interface import ReceiverResponse

        n = len(self.freedoms)
        return ReceiverResponse(
            mobility=self.mobility, transfers=np.zeros((s.size, 0, n), dtype=complex)
        )


# --------------------------------------------------------------------------- plates that are heard


def test_a_finite_plate_is_heard_as_the_rayleigh_integral() -> None:
    """Summed over 200 x 160 elements at 600 m, force and moments.

    Far field: (side)^2 / (2 R) of path, times k below 0.005.
    """
    foot = InterfacePoint(name="a", position=np.array([0.18, 0.15, 0.0]))
    ear = np.array([250.0, -140.0, 520.0])
    sides = (0.5, 0.37)
    plate = finite_plate(
        SHEET, sides, [foot], highest=3e3, radius=5e-3, sound=PlateSound(places={"e": ear})
    )
    s = laplace(np.array([311.0, 1234.0]), 2.0)
    found = plate.at(s).transfers[:, 0]
    x, y = (
        side * (np.arange(count) + 0.5) / count
        for side, count in zip(sides, (200, 160), strict=True)
    )
    X, Y = np.meshgrid(x, y, indexing="ij")
    area = sides[0] * sides[1] / X.size
    way = np.sqrt((ear[0] + 0.18 - X) ** 2 + (ear[1] + 0.15 - Y) ** 2 + ear[2] ** 2)
    for i, at in enumerate(s):
        green = np.exp(-at * way / 343.2) / way * area * 1.204 * at / (2.0 * np.pi)
        total = np.zeros(3, dtype=complex)
        for m in range(1, 60):
            for n in range(1, 50):
                w = np.sqrt(SHEET.bending_stiffness / SHEET.mass_per_area) * (
                    (m * np.pi / 0.5) ** 2 + (n * np.pi / 0.37) ** 2
                )
                place = np.flatnonzero(np.isclose(plate.omega, w, rtol=1e-9))
                if not place.size:
                    continue
                shape = 2.0 / np.sqrt(SHEET.mass_per_area * 0.185)
                shape = shape * np.sin(m * np.pi * X / 0.5) * np.sin(n * np.pi * Y / 0.37)
                heard = np.sum(shape * green)
                H = at / (w**2 + LOSS * w * at + at**2)
                total += heard * H * plate.shapes[place[0]]
        assert found[i] == pytest.approx(total, rel=1e-2, abs=0.0)


def test_an_infinite_plate_off_the_normal_and_its_moments() -> None:
    """A moment is two forces apart: difference quotient of two feet."""
    ear, s = np.array([0.2, -0.1, 1.0]), laplace(np.array([800.0, 4000.0]))
    apart = 1e-4
    feet = (
        InterfacePoint(name="a", position=np.array([0.0, 0.0, 0.0])),
        InterfacePoint(name="b", position=np.array([apart, 0.0, 0.0])),
    )
    sound = PlateSound(places={"e": ear})
    H = InfinitePlate(plate=SHEET, points=feet, sound=sound).at(s).transfers[:, 0]
    turned = InfinitePlate(plate=SHEET, points=feet[:1], radius=1e-6, sound=sound).at(s)
    # a moment about y is a force down at +x: -dF/dx
    pair = -(H[:, 1] - H[:, 0]) / apart
    assert turned.transfers[:, 0, 2] == pytest.approx(pair, rel=1e-3)
    steep = PlateSound(places={"e": np.array([1.0, 0.0, 0.2])})
    plate = InfinitePlate(plate=SHEET, points=feet, sound=steep)
    with pytest.raises(InputError, match="as fast as sound along it"):
        plate.at(laplace(np.array([20e3])))
    with pytest.raises(InputError, match="above the plate"):
        PlateSound(places={"e": np.array([0.0, 0.0, -1.0])})


# --------------------------------------------------------------------------- rigid bodies, springs


def test_a_rigid_body_below_two_points() -> None:
    """Newton: forces move the centre, moments about it turn the body; both ways the same."""
    draw = np.random.default_rng(3)
    centre, inertia = draw.normal(size=3), (0.2, 0.3, 0.4)
    points = tuple(InterfacePoint(name=n, position=draw.normal(size=3)) for n in "ab")
    found = rigid_receiver(2.0, inertia, centre, points).at(laplace(np.array([30.0])))
    F = draw.normal(size=6)  # at b: force and moment
    arm = [point.position - centre for point in points]
    a = F[:3] / 2.0
    w = (F[3:] + np.cross(arm[1], F[:3])) / np.array(inertia)
    s = 2j * np.pi * 30.0
    at_a = np.concatenate([a + np.cross(w, arm[0]), w]) / s
    assert found.mobility[0, :6, 6:] @ F == pytest.approx(at_a, rel=1e-12)
    assert found.mobility[0] == pytest.approx(found.mobility[0].T, rel=1e-12)


def test_two_masses_and_a_mass_on_a_spring() -> None:
    """A free body of 2 kg, and 3 N/um to the ground, both by keys."""
    record, _ = in_machine(on(receiver={"body": {"mass": "2 kg"}}), 1.0)
    push = PUSH * FALL / (1.0 + laplace(record.frequency) * FALL)
    assert record.freedoms[-1].force == pytest.approx(push * 2.0 / (2.0 + MASS), rel=1e-9)
    record, _ = in_machine(on(receiver={"springs": {"z": "3 N/um"}}), 1.0)
    s = laplace(record.frequency)
    push = PUSH * FALL / (1.0 + s * FALL)
    assert record.freedoms[0].force == pytest.approx(push * 3e6 / (3e6 + MASS * s**2), rel=1e-9)


# --------------------------------------------------------------------------- files


@pytest.fixture
def measured(tmp_path: Path) -> Callable[..., Path]:
    """The finite plate as a table of accelerances and pressures, as a bench would export it."""

    def write(low: float = 4.0, high: float = 8e3, ears: str = "ear", indicator: str = "") -> Path:
        points = [InterfacePoint(name="a", position=np.array([0.18, 0.15, 0.0]))]
        if indicator:
            points.append(InterfacePoint(name=indicator, position=np.array([0.3, 0.2, 0.0])))
        sound = PlateSound(places={ears: np.array([0.0, 0.0, 2.0])})
        plate = finite_plate(SHEET, (0.5, 0.4), points, highest=24e3, sound=sound)
        f = np.arange(low, high + 1.0, 4.0)
        answer = plate.at(laplace(f))
        columns = {"frequency [Hz]": f}
        outputs = {"7.z": answer.mobility[:, 0, 0] * laplace(f), ears: answer.transfers[:, 0, 0]}
        if indicator:
            outputs[f"{indicator}.z"] = answer.mobility[:, 1, 0] * laplace(f)
        for name, values in outputs.items():
            unit = "Pa/N" if name == ears else "m/s^2/N"
            columns[f"{name}/7.z re [{unit}]"] = values.real
            columns[f"{name}/7.z im [{unit}]"] = values.imag
        path = tmp_path / "machine.csv"
        np.savetxt(
            path, np.column_stack(list(columns.values())), delimiter=",", header=",".join(columns),
            comments="", fmt="%.12e",
        )  # fmt: skip
        return path

    return write


def test_a_file_is_the_plate_that_it_was_made_of(measured: Callable[..., Path]) -> None:
    """Accelerances with an ear, against the keys of the same plate: forces, energy and sound."""
    file = measured(high=24e3, indicator="b")
    drawn = {"thickness": "2 mm", "material": "steel", "sides": ["0.5 m", "0.4 m"]}
    drawn |= {"at": ["0.18 m", "0.15 m"], "loss_factor": "30 %"}
    model = on(receiver={"plate": drawn}, ears={"e": ["0 m", "0 m", "2 m"]})
    read = on(
        receiver={"file": str(file), "points": {"foot": 7}},
        ears={"e": "ear"},
        indicators={"b": "b"},
    )
    one, (exact,) = in_machine(model, 1.0)
    other, (pressure,) = in_machine(read, 1.0, in_situ=True)
    common = np.isin(np.round(other.frequency, 6), np.round(one.frequency, 6))
    there = np.isin(np.round(one.frequency, 6), np.round(other.frequency, 6))
    assert common.sum() > 900
    assert other.freedoms[0].force[common] == pytest.approx(one.freedoms[0].force[there], rel=1e-7)
    assert other.energy == pytest.approx(one.energy, rel=0.02)
    assert other.ears[0].exposure_A == pytest.approx(one.ears[0].exposure_A, rel=0.03)
    first = round((exact.start - pressure.start) / pressure.step)
    size = np.abs(exact.values).max()
    assert np.abs(pressure.values[first : first + 3000] - exact.values[:3000]).max() < 0.02 * size
    assert other.in_situ is not None
    assert other.in_situ.indicators == ("b.z",)
    assert other.in_situ.deviation < 1e-9


def test_what_lies_outside_of_the_band_is_told(measured: Callable[..., Path]) -> None:
    """Measured up to 1 kHz: the share of the push above, which has a closed form."""
    found = on(receiver={"file": str(measured(high=1e3)), "points": {"foot": 7}})
    record, _ = in_machine(found, 1e6)
    (note,) = [note for note in record.notes if "lies outside" in note]
    density = lambda f: np.arctan(2.0 * np.pi * f * FALL)  # noqa: E731 - of 1/(1 + (w T)^2)
    share = 1.0 - density(1e3) / density(20e3)
    assert f"{100 * share:.2g} % of" in note or f"{100 * share + 1:.2g} % of" in note
    assert record.frequency[-1] == pytest.approx(1e3)


def test_the_motion_of_the_mounts_is_doubted() -> None:
    """From 1 % of the speed of the needle on."""
    found = on(receiver=INFINITE)
    record, _ = in_machine(found, 1.0)
    assert record.motion > 0.01
    assert any("wrong by about as much" in note for note in record.notes)
    slow, _ = in_machine(found, 200.0 * record.motion)
    assert slow.motion == pytest.approx(0.005)
    assert not slow.notes or all("as much" not in note for note in slow.notes)


def test_a_source_is_the_same_after_its_file(tmp_path: Path) -> None:
    """NetCDF 3: read as a source, as responses of a receiver, and by xarray."""
    f = 10.0 * np.arange(1, 30)
    source = block(f)
    write_netcdf(tmp_path / "source.nc", source, "block")
    again = read_source(tmp_path / "source.nc")
    assert again.freedoms == source.freedoms
    for name in ("frequency", "free_velocity", "blocked_force", "mobility"):
        assert np.array_equal(getattr(again, name), getattr(source, name))
    assert [p.name for p in again.points] == ["foot"]
    assert np.array_equal(again.points[0].position, POINT.position)
    responses = read_responses(tmp_path / "source.nc")
    assert np.array_equal(responses.values, source.mobility)
    xarray = pytest.importorskip("xarray")
    with xarray.open_dataset(tmp_path / "source.nc", engine="scipy") as data:
        assert [name.decode() for name in data["outputs"].values] == [*map(str, source.freedoms)]
        assert np.array_equal(data["mobility_imag"].values, source.mobility.imag)
        assert data.attrs["title"] == "block"
    (tmp_path / "bad.nc").write_bytes((tmp_path / "source.nc").read_bytes()[:400])
    with pytest.raises(InputError, match="bad"):
        read_source(tmp_path / "bad.nc")
    with scipy.io.netcdf_file(tmp_path / "other.nc", "w") as file:
        file.createDimension("x", 2)
    with pytest.raises(InputError, match="a source written by klack noise"):
        read_source(tmp_path / "other.nc")


# --------------------------------------------------------------------------- mistakes


PLATE = "infinite_plate: {thickness: 1 mm, material: steel}"
MISSING = "missing: {flange.x: blocked, flange.y: blocked, flange.rz: blocked, flange: free}"
MOUNTS = "mounts: {flange: {surface: [housing.rim, pole.rim]}}"
MISTAKES = {
    "receiver: {file: nowhere.csv}": "does not exist",
    "receiver: {}": "exactly one of file, infinite_plate",
    f"receiver: {{{PLATE}, body: {{mass: 2 kg}}}}": "exactly one of",
    "receiver: {infinite_plate: {thickness: 1 mm, material: copper}}": "unknown material 'copper'",
    "receiver: {infinite_plate: {thickness: -1 mm, material: steel}}": "thickness",
    "receiver: {infinite_plate: {thickness: 1, material: steel}}": "thickness",
    "receiver: {infinite_plate: {thickness: 1 kg, material: steel}}": "a length",
    "receiver: {infinite_plate: {material: steel}}": "no key 'thickness'",
    "receiver: {plate: {thickness: 1 mm, material: steel, sides: [1 m], at: [1 m, 1 m]}}": "sides",
    "receiver: {body: {mass: 2 kg, inertia: [1 kg*m^2, 1 kg*m^2, 9 kg*m^2]}}": "none larger",
    "receiver: {body: {mass: 2 kg, inertia: [1, 1, 1]}}": "inertia",
    "receiver: {body: {mass: .nan}}": "mass",
    "receiver: {springs: {z: 0 N/m}}": "springs",
    "receiver: {springs: {up: 1 N/um}}": "springs",
    f"receiver: {{{PLATE}, points: {{flange: 7}}}}": "it belongs to a file",
    f"receiver: {{{PLATE}, missing: {{flange.q: free}}}}": "missing",
    f"receiver: {{{PLATE}, missing: {{flange: held}}}}": "blocked",
    f"receiver: {{{PLATE}, missing: {{clip: free}}}}": "unknown mount 'clip'",
    f"receiver: {{{PLATE}, axes: {{flange: [[1, 0, 0], [0, 1, 0]]}}}}": "one pair",
    f"receiver: {{{PLATE}}}": "flange.x, flange.y, flange.rx, flange.ry, flange.rz",
    f"receiver: {{{PLATE}, axes: [[1, 0, 0], [1, 0, 0]], {MISSING}}}": "right angles",
    f"receiver: {{{PLATE}, {MISSING}}}\n  ears: {{a: 7}}": "the position",
    f"receiver: {{{PLATE}, {MISSING}}}\n  ears: {{a: [1 m, 2 m]}}": "ears",
    f"receiver: {{{PLATE}, {MISSING}}}\n  ears: {{a: [0 m, 0 m, -1 m]}}": "above the plate",
    f"receiver: {{{PLATE}, {MISSING}}}\n  elements: {{clip: {{stiffness: {{z: 1 N/um}}}}}}": "clip",
    f"receiver: {{{PLATE}, {MISSING}}}\n  elements: {{flange: {{}}}}": "(the stiffness)",
    f"receiver: {{{PLATE}, {MISSING}}}\n  elements: {{flange: {{stiffness: 1 N/um}}}}": "stiffness",
    f"receiver: {{{PLATE}, {MISSING}}}\n"
    "  elements: {flange: {stiffness: {z: 1 N/um}, damping: {x: 1 N*s/m}}}": "is rigid",
    f"receiver: {{{PLATE}, {MISSING}}}\n"
    "  elements: {flange: {stiffness: {z: 1 N/um}, loss_factor: -1 %}}": "loss_factor",
    f"receiver: {{{PLATE}, {MISSING}}}\n  indicators: {{flange: [1 mm, 0 mm, 0 mm]}}": "other than",
    f"receiver: {{{PLATE}, {MISSING}}}\n  plate: {{thickness: 1 mm}}": "area",
    f"receiver: {{{PLATE}, {MISSING}}}\n  mount: {{stiffness: 1 N/um}}": "one machine",
    "ears: {a: 7}": "ears without receiver",
}
FILES = {
    "flange.z/flange.z re [m/s/N],flange.z/flange.z im [m/s/N]\n": "freq",
    "frequency [Hz],flange.z/flange.z re [m/s/N],flange.z/flange.z im [m/s/N]\n"
    "-10,1e-3,0\n20,1e-3,0\n-30,1e-3,0\n": "lines",
    "frequency [Hz],flange.z/flange.z re [m/s/N],flange.z/flange.z im [m/s/N]\n"
    "10,nan,0\n20,1e-3,0\n30,1e-3,0\n": "not finite",
    "frequency [Hz],flange.z/flange.z re,flange.z/flange.z im\n10,1e-3,0\n20,1e-3,0\n": "no unit",
    "frequency [Hz],clip.z/clip.z re [m/s/N],clip.z/clip.z im [m/s/N]\n"
    "10,1e-3,0\n20,1e-3,0\n": "the node 'flange'",
    "frequency [Hz],flange.z/flange.z re [m/s/N],flange.z/flange.z im [m/s/N]\n"
    "10,-1e-3,0\n20,-1e-3,0\n30,-1e-3,0\n": "a real part below 0",
    "frequency [Hz],flange.z/flange.z re [m/s/N],flange.z/flange.z im [m/s/N]\n"
    "10,1e-3,0\n20,1e-3,0\n": "flange.x, flange.y",
}


def _checked(path: Path) -> None:
    case = load_any_case(path)
    check_machine(case.noise, case.materials)


def _refused(keys: str, folder: Path, says: str) -> None:
    text = find_case("demo-mounted").read_text(encoding="utf-8")
    begin = text.index("  receiver:")
    end = text.index("  drive:")
    path = folder / "case.yaml"
    path.write_text(f"{text[:begin]}  {keys}\n{text[end:]}", encoding="utf-8")
    with pytest.raises(InputError) as caught:
        _checked(path)
    message = str(caught.value)
    assert says in message, message
    assert "Try" in message or caught.value.hint


def test_keys_of_a_machine(tmp_path: Path) -> None:
    """33 strange sections: one clear error each, before anything is computed."""
    for keys, says in MISTAKES.items():
        _refused(keys, tmp_path, says)


def test_files_of_a_machine(tmp_path: Path) -> None:
    """Negative and missing frequencies, not a number, no unit, another node, a reversed sensor."""
    for text, says in FILES.items():
        (tmp_path / "machine.csv").write_text(text, encoding="utf-8")
        _refused("receiver: {file: machine.csv}", tmp_path, says)
