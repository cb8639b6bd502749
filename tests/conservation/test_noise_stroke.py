"""Noise of the shipped stroke, dry: impulse and energy from the force of the stops to the modes.

Truth: the impulse of each impact as the run itself booked it; work of the forces over time against
their spectrum times the real part of the mobility; mass times acceleration of the needle.
"""

from itertools import pairwise

import numpy as np
import pytest
import scipy

import klack
from klack.acoustics.force_bands import force_bands
from klack.acoustics.mount import Mount, support_mobility
from klack.acoustics.plate import Air, Plate
from klack.acoustics.receivers.uff import read_uff_responses
from klack.acoustics.source_files import read_source, write_netcdf, write_uff
from klack.acoustics.spectrum import force_spectrum
from klack.analyses.noise.measures import DESIGN_MEASURES
from klack.analyses.noise.record import NoiseDesign
from klack.analyses.noise.run import run_noise
from klack.analyses.noise.source import NoiseSource, stroke_sources
from klack.analyses.stroke.record import StrokeStudy
from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import load_valve_case
from klack.case.bodies import SurfaceName
from klack.case.noise import NoiseInterface, NoisePassage
from klack.case.reader import find_case
from klack.case.valve import ValveCase
from klack.errors import InputError
from klack.materials.material import Material
from klack.signals.sampled import TimeSeries

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def case() -> ValveCase:
    """The shipped stroke, with housing and pole on one flange."""
    case: ValveCase = load_valve_case(find_case("demo-stroke"))
    assert case.noise is not None
    surfaces = tuple(SurfaceName(body, "rim") for body in ("housing", "pole"))
    reactions = {"spring": SurfaceName("pole", "top"), "guide": SurfaceName("housing", "inside")}
    update = {"mounts": {"flange": NoiseInterface(surface=surfaces)}, "reactions": reactions}
    run = case.run.model_copy(update={"duration": 1e-3})
    noise = case.noise.model_copy(update=update)
    return case.model_copy(update={"run": run, "noise": noise})


@pytest.fixture(scope="module")
def study(case: ValveCase) -> StrokeStudy:
    """The dry stroke until it has bounced on the opening stop for a while."""
    return run_stroke(case, variants=("dry",))


@pytest.fixture(scope="module")
def source(study: StrokeStudy, case: ValveCase) -> NoiseSource:
    (found,) = stroke_sources(study, case=case)
    return found


@pytest.fixture(scope="module")
def design(source: NoiseSource) -> NoiseDesign:
    return run_noise([source]).reference


def test_the_force_of_a_pivot_which_has_no_place_is_noted(case, design, tmp_path):
    """A lever between two springs: only the sum of all forces tells what its pivot carries."""
    rocker = (
        "    rocker: {type: lever, effective_mass: 1 g, arms: {a: 10 mm, b: -8 mm}}\n"
        "    link: {type: spring, stiffness: 100 N/mm, preload: 0 N}\n"
        "    back: {type: spring, stiffness: 5 N/mm, preload: 1 N}\n"
    )
    text = find_case("demo-stroke").read_text("utf-8")
    for old, new in (
        ("    guide: {type", f"{rocker}    guide: {{type"),
        (
            ", guide.body]",
            ", guide.body, link.end]\n    - [rocker.a, link.base]\n    - [rocker.b, back.end]",
        ),
        ("\nrun:\n", "\nrun:\n  lift: needle.tip\n"),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    (tmp_path / "case.yaml").write_text(text, "utf-8")
    levered = load_valve_case(tmp_path / "case.yaml")
    reactions = {**case.noise.reactions, "back": SurfaceName("housing", "inside")}
    noise = case.noise.model_copy(update={"reactions": reactions})
    levered = levered.model_copy(
        update={"run": levered.run.model_copy(update={"duration": 5e-4}), "noise": noise}
    )
    (source,) = stroke_sources(run_stroke(levered, variants=("dry",)), case=levered)
    assert source.held.unbalanced > 1e-4 * source.held.largest
    words = "a reaction is missing"
    assert [words in note for note in run_noise([source]).reference.notes].count(True) == 1
    assert not any(words in note for note in design.notes)


def test_every_impact_keeps_its_impulse(study, source):
    (force,) = [stop.force for stop in source.stops if stop.name == "opening"]
    events = study.reference.impacts("opening")
    assert len(events) > 3
    edge = force.start - 0.5 * force.step
    for event, after in pairwise(events):
        # dry: nothing acts between the contacts
        first = round((event.time - edge) / force.step) - 2
        last = round((after.time - edge) / force.step) - 2
        impulse = force.values[first:last].sum() * force.step
        assert impulse == pytest.approx(event.impulse, rel=1e-9)


def test_energy_injected_is_energy_found(design):
    assert {body.name for body in design.bodies} == {"housing", "pole"}
    for body in design.bodies:
        assert abs(body.residual) < 1e-9
        # the housing that the needle leaves gives back what its seat had stored
        assert (body.injected.sum() > 0.0) == (body.name == "pole")
        assert body.vibration_energy > 0.0
        found = body.vibration_energy + body.static_energy
        assert body.injected.sum() == pytest.approx(found, rel=1e-9)
        # trapezia over resonances that are resolved three times per half width
        assert body.vibration_spectral == pytest.approx(body.vibration_energy, rel=1e-6)


def test_at_high_frequencies_nothing_but_the_contacts_pushes_the_needle(design, source):
    """Newton: contact forces of both stops, with their signs, are mass times acceleration."""
    signs = {"seat": 1.0, "opening": -1.0}
    values = np.sum([signs[stop.name] * stop.force.values for stop in source.stops], axis=0)
    force = source.stops[0].force
    contact = TimeSeries(step=force.step, values=np.pad(values, 1, mode="edge"), unit="N")
    net = source.net
    assert net is not None
    moved = TimeSeries(step=net.step, values=np.pad(net.values, 1), unit="N")

    one, other = force_bands(contact), force_bands(moved)

    shown = (one.middle[: other.middle.size] > 6e3) & (other.middle < 50e3)
    difference = (one.level[: other.level.size] - other.level)[shown]
    assert shown.sum() > 8
    # magnet and spring change slowly: half a decibel at 6 kHz
    assert np.abs(difference).max() < 0.5
    # and at 500 Hz they have taken back nearly all of it
    slow = int(np.flatnonzero(np.isclose(one.middle, 501.19, rtol=1e-3))[0])
    assert design.net_share[slow] < 0.03
    assert 1e3 < design.balanced_below < 6e3


def test_forces_on_the_held_bodies_are_the_momentum_of_the_needle(source, design):
    """Contacts, magnet, spring and friction with their reactions; round-off of the run.

    What is left without the force that takes back energy of macro steps is that force.
    """
    held, net = source.held, source.net
    assert held is not None
    assert net is not None
    assert held.unbalanced < 1e-12 * held.largest
    assert design.at_mounts.balance == held.unbalanced / held.largest
    total = sum(values.sum(axis=1) for values in held.forces.values())
    left = np.abs(total + net.values[: total.size]).max()
    assert left == pytest.approx(held.repaid, rel=1e-4)
    assert 0.0 < left < 1e-7 * held.largest


@pytest.fixture(scope="module")
def wet(case) -> StrokeStudy:
    """The same stroke in fuel, with a line to the supply and a nozzle to the surroundings."""
    return run_stroke(case, variants=("wet",))


def _wet_case(case: ValveCase, **passages: NoisePassage) -> ValveCase:
    reactions = {**case.noise.reactions, "fluid": SurfaceName("housing", "inside")}
    update = {"reactions": reactions, "passages": passages}
    return case.model_copy(update={"noise": case.noise.model_copy(update=update)})


def test_pressures_and_flows_are_the_rest_of_the_momentum(case, wet):
    """Recorded impulses of the fluid at all ports, and what enters by line and nozzle.

    Truth: m a of the needle; pressure times bore of the line; momentum flux of the jet.
    """
    aside, along = NoisePassage(direction="across"), NoisePassage(direction="closing")
    jet = NoisePassage(direction="closing", area=0.1e-6)
    (across,) = stroke_sources(wet, case=_wet_case(case, feed=aside, nozzle=aside))
    (source,) = stroke_sources(wet, case=_wet_case(case, feed=along, nozzle=jet))
    for held in (across.held, source.held):
        assert held.unbalanced < 1e-11 * held.largest
        assert held.repaid < 1e-7 * held.largest
    result = wet.reference.result
    sums = [
        sum(values.sum(axis=1) for values in found.held.forces.values())
        for found in (across, source)
    ]
    pressure = result.channels["inlet pressure"].values - 1.01325e5
    by_line = -0.25 * np.pi * 2.5e-3**2 * 0.5 * (pressure[1:] + pressure[:-1])
    # flow downwards, out of the valve: it pushes up
    (passage,) = [item for item in wet.reference.passages if item.component == "nozzle"]
    flow = result.channels["nozzle mass flow"].values[1:]
    by_jet = flow**2 / (passage.density * 0.1e-6)
    assert passage.density == pytest.approx(684.0, rel=5e-3)  # n-heptane at 20 degC
    entered = by_line + by_jet
    kept = int(0.89 * sums[0].size)  # the end, which is cut off, is faded out
    found = (sums[1] - sums[0])[:kept]
    assert found == pytest.approx(entered[:kept], abs=1e-12 * source.held.largest)
    assert source.held.entering == pytest.approx(np.abs(entered - entered[0]).max(), rel=2e-2)
    assert across.held.entering == 0.0


def test_fluid_without_a_direction_is_an_error(case, wet):
    with pytest.raises(InputError, match=r"noise\.passages: got no direction of .*feed.*nozzle"):
        stroke_sources(wet, case=_wet_case(case))
    bare = {k: NoisePassage(direction="closing") for k in ("feed", "nozzle")}
    with pytest.raises(InputError, match=r"noise\.passages\.nozzle: got no area of its mouth"):
        stroke_sources(wet, case=_wet_case(case, **bare))


def test_the_free_valve_moves_as_a_mass_at_low_frequencies(design, study):
    """Along the axis; across it nothing pushes, and the mobility is that of mass and inertia."""
    found = design.at_mounts
    source = found.source()
    names = [str(freedom) for freedom in source.freedoms]
    assert names == [f"flange.{name}" for name in ("x", "y", "z", "rx", "ry", "rz")]
    mass = sum(body.mass for body in study.bodies if body.support != "free")
    assert found.mass == pytest.approx(mass, rel=1e-9)
    z, low = names.index("flange.z"), slice(0, 20)  # to 200 Hz
    moved = source.blocked_force[low, z] / (2j * np.pi * source.frequency[low] * mass)
    assert source.free_velocity[low, z] == pytest.approx(moved, rel=1e-3)
    assert not source.blocked_force[:, [0, 1, 3, 4, 5]].any()
    across = source.mobility[low, 0, 0] * 2j * np.pi * source.frequency[low]
    # about its own reference point, where the centre of mass is not
    assert np.all(across.real * mass > 1.0)
    assert np.array_equal(source.mobility, source.mobility.transpose(0, 2, 1))


def test_a_force_without_a_place_is_an_error(study, case):
    """It names all of them and the key."""
    noise = case.noise.model_copy(update={"reactions": None})
    with pytest.raises(InputError, match=r"noise\.reactions: got no surface .*spring.*guide"):
        stroke_sources(study, case=case.model_copy(update={"noise": noise}))


def test_files_of_a_source_hold_its_numbers(design, tmp_path):
    """The universal file as a receiver would read it; netCDF by its variables."""
    source = design.at_mounts.source()
    write_uff(tmp_path / "source.uff", source, "dry")
    write_netcdf(tmp_path / "source.nc", source, "dry")
    read = read_uff_responses(tmp_path / "source.uff")
    assert read.frequency == pytest.approx(source.frequency, rel=1e-5)  # six digits of a step
    directions = [freedom.direction for freedom in source.freedoms]
    assert [channel.direction for channel in read.outputs] == directions
    assert [channel.direction for channel in read.sources] == directions
    size = np.abs(source.mobility).max(axis=0)
    assert np.all(np.abs(read.values - source.mobility) <= 1e-10 * size)
    with scipy.io.netcdf_file(tmp_path / "source.nc", mmap=False) as file:
        force = (
            file.variables["blocked_force_real"][:] + 1j * file.variables["blocked_force_imag"][:]
        )
        assert np.array_equal(force, source.blocked_force)
    assert read_source(tmp_path / "source.nc").freedoms == source.freedoms


def test_the_support_gets_all_forces_with_their_signs(source, design):
    """Below its modes a valve on a mount is a mass that m a of the needle pushes.

    Truth: ``|m a| / |1 + i w M Y|`` on the bending power of the plate, by third octave.
    """
    own, held = source.noise, source.held
    assert held is not None
    total = sum(values.sum(axis=1) for values in held.forces.values())
    moved = TimeSeries(step=held.step, values=np.pad(total, 1), unit="N")
    spectrum = force_spectrum(moved, high=1000.0, resolution=0.2)
    f, force = spectrum.frequency[1:], spectrum.values[1:]
    mount = Mount(
        stiffness=own.mount.stiffness, loss_factor=own.mount.loss_factor, mass=own.mount.mass
    )
    steel = source.materials["steel"]
    material = Material(
        name="steel", young=steel.young, poisson=steel.poisson, density=steel.density
    )
    plate = Plate(
        thickness=own.plate.thickness,
        area=own.plate.area,
        material=material,
        loss_factor=own.plate.loss_factor,
    )
    below = support_mobility(f, mount, plate)
    carried = force / (1.0 + 2j * np.pi * f * mount.mass * below)
    density = plate.mobility * 2.0 * np.abs(carried) ** 2 * plate.radiated_share(f, Air())
    bands = design.stops[0].bands
    shown = (bands.low > 220.0) & (bands.high < 1000.0)
    truth = [
        float(density[(f >= low) & (f < high)].sum() * spectrum.resolution)
        for low, high in zip(bands.low[shown], bands.high[shown], strict=True)
    ]
    (radiated,) = [
        body.radiated[body.groups.index("plate")]
        for body in design.bodies
        if "plate" in body.groups
    ]
    # the bodies give way below their modes, by (f/f_1)^2
    assert radiated[shown] == pytest.approx(truth, rel=0.02)


def test_an_impact_leaves_its_impulse_at_the_mount(tmp_path):
    """Held at low frequencies the mount feels the impulse; free, the valve moves by it over m."""
    text = find_case("demo-valve-axisymmetric").read_text(encoding="utf-8")
    mounts = "\nnoise:\n  mounts: {flange: {surface: housing.rim}}\n  #"
    path = tmp_path / "case.yaml"
    path.write_text(text.replace("\nnoise:  #", mounts), encoding="utf-8")
    found = klack.noise_of(klack.run_impact(path, levels=["reduced"])).record.reference
    source = found.at_mounts.source()
    z = [str(freedom) for freedom in source.freedoms].index("flange.z")
    low = slice(0, 20)  # to 200 Hz
    assert np.abs(source.blocked_force[low, z]) == pytest.approx(found.stops[0].impulse, rel=1e-4)
    moved = source.free_velocity[low, z] * found.at_mounts.mass * 2.0 * np.pi
    moved *= source.frequency[low]
    assert np.abs(moved) == pytest.approx(found.stops[0].impulse, rel=1e-4)
    assert np.isnan(found.at_mounts.balance)  # nothing but the contact acts


NUMBERS = (
    "mount_velocity_level",
    "mount_force_level",
    "equivalent_force_level",
    "equivalent_velocity_level",
    "fast_level",
    "equivalent_radiated_energy",
)


def test_points_of_a_study_have_the_numbers_of_single_runs(tmp_path):
    """Single numbers of the source by their names, and one by its former name."""
    text = find_case("demo-stroke").read_text(encoding="utf-8")
    keys = (
        "noise:\n  mounts: {flange: {surface: [housing.rim, pole.rim]}}\n"
        "  reactions: {spring: pole.top, guide: housing.inside}\n  #"
    )
    path = tmp_path / "case.yaml"
    path.write_text(text.replace("noise:  #", keys).replace("duration: 5 ms", "duration: 0.8 ms"))
    case, key = klack.load_case(path), "network.components.spring.preload"
    former = "noise.radiated_energy_upper_bound"
    names = [*(f"noise.{name}" for name in NUMBERS), former]
    points = [{key: "11 N"}, {key: "13 N"}]
    table = klack.run_many(case, points, names, variant="dry")
    measures = {measure.key: measure for measure in DESIGN_MEASURES}
    for k, point in enumerate(points):
        run = klack.run_stroke(case.with_value(key, point[key]), variants=["dry"])
        design = klack.noise_of(run).record.reference
        for name in NUMBERS:
            value = measures[name].read(design)
            assert value is not None
            assert table[f"noise.{name}"][k] == pytest.approx(value, rel=1e-9), name
        assert table[former][k] == table["noise.equivalent_radiated_energy"][k]
