"""Which bodies and surfaces of a case sound, how they are stored, and what is refused."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import zarr

from klack.acoustics.force_response import modal_response, port_forces
from klack.acoustics.injected import injected_density
from klack.acoustics.mobility import transfer_mobility
from klack.acoustics.mount import Mount, mounted
from klack.acoustics.surface_bands import face_band_velocity
from klack.analyses.impact.analysis import IMPACT
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.impact.run import run_impact
from klack.analyses.store import RESULT_NAME
from klack.assembling.structures import radiating_surfaces
from klack.assembling.valve import build_valve
from klack.bodies.reduction.damping import ModalDamping
from klack.bodies.reduction.structure import Structure, build_structure
from klack.case.any_case import read_any_case
from klack.case.bodies import SurfaceName
from klack.case.noise import CaseNoise
from klack.case.reader import find_case
from klack.case.valve import ValveCase
from klack.errors import InputError
from klack.signals.sampled import TimeSeries
from klack.verification.one_dimension import half_sines
from klack.verification.reduction import rod
from klack.verification.vibration import oscillator, rod_structure


@pytest.fixture(scope="module")
def damped() -> Structure:
    return rod_structure(damping=0.01)


@pytest.fixture(scope="module")
def stroke_case() -> ValveCase:
    path = find_case("demo-stroke")
    case = read_any_case(path.read_text(encoding="utf-8"), path)
    assert isinstance(case, ValveCase)
    return case.model_copy(update={"noise": None})


@pytest.fixture(scope="module")
def structures(stroke_case: ValveCase) -> tuple[Structure, ...]:
    return build_valve(stroke_case).structures


def test_held_bodies_of_a_valve_sound(structures: tuple[Structure, ...]) -> None:
    housing, pole = structures

    assert (housing.name, pole.name) == ("housing", "pole")
    assert housing.port_names == ("seat",)
    assert housing.port_stops == ("seat",)
    assert list(housing.port_signs) == [-1.0]  # the lower body of its stop
    assert pole.port_names == ("stop", "pole_face")
    assert pole.port_stops == ("opening", "")
    assert list(pole.port_signs) == [1.0, 1.0]
    # neither contact, nor support, nor the bore on the axis side is left out but the named ones
    assert housing.group_names == ("bottom", "outside", "top", "inside", "floor", "bore")
    assert "stop" not in pole.group_names
    assert "rim" not in pole.group_names
    assert len(housing.omega) == 40
    assert np.all(housing.damping == 0.01)
    assert housing.area == pytest.approx(float(housing.face_area.sum()), rel=1e-12)


def test_faces_are_those_of_the_drawing(structures: tuple[Structure, ...]) -> None:
    housing = structures[0]
    outside = housing.face_group == housing.group_names.index("outside")

    corners = housing.points[housing.faces[outside]]

    assert corners[:, :, 0] == pytest.approx(np.full(corners.shape[:2], 5e-3), rel=1e-9)
    length = np.abs(corners[:, 1, 1] - corners[:, 0, 1])
    assert housing.face_area[outside] == pytest.approx(2 * np.pi * 5e-3 * length, rel=1e-9)
    assert housing.axial_normals[outside] == pytest.approx(np.zeros(outside.sum()), abs=1e-12)
    bottom = housing.face_group == housing.group_names.index("bottom")
    assert housing.axial_normals[bottom] == pytest.approx(np.full(bottom.sum(), -1.0), rel=1e-12)


@pytest.mark.slow
@pytest.mark.usefixtures("computes")  # a stage that is served from the cache has another name
def test_an_impact_stores_its_held_body(tmp_path: Path) -> None:
    path = find_case("sphere-on-rod")
    case = read_any_case(path.read_text(encoding="utf-8"), path)
    assert not isinstance(case, ValveCase)

    study = run_impact(case, levels=["reduced"], certify=False)
    IMPACT.save(study, tmp_path)
    (structure,) = IMPACT.load(tmp_path).structures

    assert structure.name == "rod"
    assert structure.port_stops == ("contact",)
    assert list(structure.port_signs) == [-1.0]
    np.testing.assert_array_equal(structure.group_gram, study.structures[0].group_gram)
    assert structure.face_shapes.dtype == np.float32
    assert study.stage_times["radiating surfaces"] < 0.05 * study.wall_time


def test_a_result_without_structures_is_read(lonely_study: ImpactStudy, tmp_path: Path) -> None:
    """Results of earlier versions have no such field."""
    IMPACT.save(lonely_study, tmp_path)
    group = zarr.open_group(tmp_path / RESULT_NAME / "study", mode="r+")
    values = {key: x for key, x in group.attrs["values"].items() if key != "structures"}
    order = [key for key in group.attrs["order"] if key != "structures"]
    group.attrs.put({"values": values, "order": order})  # nor a checksum of its words

    assert IMPACT.load(tmp_path).structures == ()


def test_structures_are_stored_with_units_and_small(
    lonely_study: ImpactStudy, structures: tuple[Structure, ...], tmp_path: Path
) -> None:
    IMPACT.save(replace(lonely_study, structures=structures), tmp_path)
    folder = tmp_path / RESULT_NAME / "study" / "structures"

    for ours, theirs in zip(structures, IMPACT.load(tmp_path).structures, strict=True):
        assert ours.group_names == theirs.group_names
        np.testing.assert_array_equal(ours.port_shapes, theirs.port_shapes)
    assert zarr.open_array(folder / "0" / "omega", mode="r").attrs["unit"] == "rad/s"
    assert sum(file.stat().st_size for file in folder.rglob("*") if file.is_file()) < 2e6


def test_only_the_surfaces_that_the_case_names(stroke_case: ValveCase) -> None:
    body, _, _ = rod(elements=4, clamped=True)
    noise = CaseNoise(surfaces=(SurfaceName("rod", "outer"), SurfaceName("pole", "top")))

    assert radiating_surfaces(noise, body, ("rod", "pole"), ["top"]) == (("outer",), ())
    names, left_out = radiating_surfaces(None, body, ("rod",), ["top", "bottom"])
    assert (names, left_out) == (("inner", "outer"), ("top", "bottom"))
    with pytest.raises(InputError, match=r"noise.surfaces: got 'pole.top'.*held bodies \(rod\)"):
        radiating_surfaces(noise, body, ("rod",), [])


def test_a_free_body_is_refused() -> None:
    body, *_ = rod(elements=4, clamped=False)

    with pytest.raises(InputError, match=r"structure of body 'rod': got an unsupported body"):
        build_structure(
            body,
            modes=None,  # type: ignore[arg-type]
            damping=ModalDamping(ratio=0.0),
            ports=[],
            deflections=np.zeros((body.dof_count, 1)),
            surfaces=("outer",),
        )


def unlike(series: TimeSeries) -> TimeSeries:
    return replace(series, step=2 * series.step)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s, f: modal_response(s, {}), r"forces on 'rod': got none.*tip, skin"),
        (lambda s, f: modal_response(s, {"top": f}), r"port 'top': got a name.*one of: tip, skin"),
        (lambda s, f: modal_response(s, {"tip": f, "skin": unlike(f)}), r"'skin': got .* 4e-08 s"),
        (lambda s, f: modal_response(s, {"tip": f}, sample=3e-8), r"sample: got 3e-08 s"),
        (lambda s, f: transfer_mobility(s, "tip", "tip", np.array([-1.0])), r"lowest -1 Hz"),
        (lambda s, f: injected_density(rod_structure(), {"tip": f}), r"12 modes without damping"),
        (
            lambda s, f: mounted(s, Mount(stiffness=1e6, mass=1e-6)),
            r"mass: got 1e-06 kg.*more than",
        ),
        (lambda s, f: face_band_velocity(s, {"tip": f}, np.array([[2.0, 1.0]])), r"bands: got"),
        (
            lambda s, f: face_band_velocity(s, {"tip": f}, np.array([[1.0, 1e9]])),
            r"up to 1e\+09 Hz",
        ),
    ],
)
def test_messages(damped: Structure, call: Callable[..., object], message: str) -> None:
    force = half_sines(step=20e-9, count=1000, times=(1e-6,), length=1e-5)

    with pytest.raises(InputError, match=message):
        call(damped, force)


def test_words_of_a_structure(damped: Structure) -> None:
    assert damped.port_index("skin") == 1
    assert damped.highest_frequency == pytest.approx(damped.omega[-1] / (2 * np.pi), rel=1e-12)
    assert port_forces(damped, {}) == {}
    assert oscillator(mass=1.0, stiffness=1.0, base=1.0).area == pytest.approx(1e-4, rel=1e-12)
