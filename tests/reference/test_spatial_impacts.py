"""Impacts of a stroke in three dimensions: records, and grids of VTK.

What a stroke in three dimensions records of its impacts.

Truths: the contact force and the impacts that the run itself records, the film force that it was
driven by, the slope of the needle, the same run in one part.

An impact of a stroke in three dimensions as grids of VTK.

Truths: the path that the run recorded, bodies that touch while they press on each other, no stress
in a rigid motion, the recorded forces of the ring.
"""

import json
import xml.etree.ElementTree as ET
from dataclasses import replace

import meshio
import numpy as np
import pytest
from shots_valve import FILE, valve_text

from klack.analyses.stroke.analysis import STROKE
from klack.analyses.stroke.film_frames import recorded_impacts
from klack.analyses.stroke.run import run_stroke, variant_network
from klack.assembling.valve import build_valve
from klack.bodies.elasticity.stress import StressField
from klack.case.any_case import read_valve_case
from klack.cli.main import main
from klack.errors import InputError
from klack.exchange.results.spatial_series import valve_shapes, write_spatial_series
from klack.simulation.film_sectors import sector_pressure
from klack.simulation.network_compile import compile_network
from klack.simulation.step_sizes import step_sizes
from klack.transient.placed_bodies import rigid_coordinates
from klack.transient.tilting_films import film_state

pytestmark = pytest.mark.slow  # one build of a valve, and half a minute where kernels are compiled


SINGLE = 2e-7  # round-off of the forces of single points, which are single precision
FILM = (
    ", film: {shape: ring, inner_radius: 1.35 mm, outer_radius: 1.95 mm, cut_off: 1 um, "
    "pressure: 6 bar}}"
)
SOLVED = 1e-7  # forces of a step follow slopes where little is left
CORNER = 1e-3  # the same where sectors take turns in opening: heights fit to 1e-4


def case(duration="0.25 ms", variants="[dry, wet]", land="0.2 mm"):
    run = f"run: {{duration: {duration}, variants: {variants}}}"
    text = valve_text("placement: {seed: 3}", run)
    ambient = "  ambient: {temperature: 20 degC}\n"
    stop = "gap: 100 um, law: {kind: consistent}}"
    text = text.replace("{land: 0.2 mm}", f"{{land: {land}}}")
    assert ambient in text
    assert stop in text
    text = text.replace(ambient, ambient + "  fluid: {name: n-heptane, gas_fraction: 0.01 %}\n")
    return read_valve_case(text.replace(stop, stop[:-1] + FILM), FILE)


@pytest.fixture(scope="module")
def study():
    return run_stroke(case("0.78 ms"))


@pytest.fixture(scope="module", params=["dry", "wet"])
def variant(request, study):
    return study.variants[request.param]


def recorded_impulse(variant, stop, begin, end):
    steps = variant.result.interfaces[stop]
    middle = steps.time + 0.5 * steps.step
    within = (middle > begin) & (middle < end)
    return float(np.sum((steps.contact_force * steps.step)[within]))


def test_the_sum_round_the_ring_is_the_recorded_contact_force(variant):
    impacts = recorded_impacts(variant)
    assert len(impacts) == len(variant.result.events)
    assert {event.stop for _, event, _ in impacts} == {"opening", "seat"}  # a cone, too
    for _, event, record in impacts:
        assert record.stop == event.stop
        assert record.begin == pytest.approx(event.time, abs=1e-12)
        assert len(record.durations) <= 400
        force = record.sector_force.sum(axis=1)
        truth = [
            recorded_impulse(variant, event.stop, *ends) / (ends[1] - ends[0])
            for ends in zip(record.edges[:-1], record.edges[1:], strict=True)
        ]
        np.testing.assert_allclose(force, truth, rtol=SINGLE, atol=SINGLE * max(truth))
        assert np.all(record.sector_force >= 0.0)


def test_without_a_film_the_impulse_is_that_of_the_impact(study):
    for _, event, record in recorded_impacts(study.variants["dry"]):
        assert record.impulse == pytest.approx(event.impulse, rel=SINGLE)
        peak = float(record.sector_force.sum(axis=1).max())
        assert peak == pytest.approx(event.peak_force, rel=5e-3)  # means over some 40 ns
        assert peak <= event.peak_force * (1.0 + SINGLE)


def test_the_ring_lies_where_the_faces_touch(study):
    record = recorded_impacts(study.variants["dry"])[0][2]
    assert record.stop == "opening"
    assert record.is_ring
    assert record.radius == pytest.approx(1.625e-3, rel=0.03)  # crown of the pole
    assert record.height == pytest.approx(18.5e-3, rel=1e-3)  # land of the needle
    length = 2.0 * np.pi * record.radius
    np.testing.assert_allclose(
        record.line_load.mean(axis=1) * length, record.sector_force.sum(axis=1), rtol=1e-12
    )


def test_the_needle_hits_first_on_the_side_that_it_leans_to(study):
    variant = study.variants["dry"]
    _, event, record = recorded_impacts(variant)[0]
    slope = [
        np.interp(event.time, variant.result.time, variant.channel(f"needle tilt {a}").values)
        for a in "xy"
    ]
    angle = 2.0 * np.pi * (np.arange(36) + 0.5) / 36
    early = record.durations[:10] @ record.sector_force[:10]  # 0.2 us
    side = np.array([early @ np.cos(angle), early @ np.sin(angle)]) / early.sum()
    assert np.hypot(*side) > 0.2
    # a slope of the axis along +x lowers the land at +x: the opposite side meets the stop above
    assert float(side @ slope) / (np.hypot(*side) * np.hypot(*slope)) < -0.9


def test_film_sectors_press_as_the_film_did(study):
    found = [item for item in recorded_impacts(study.variants["wet"]) if item[1].stop == "opening"]
    assert found
    partly = 0  # sectors that are closed across a part of their width
    for _, _, record in found:
        film = record.film
        pressure = sector_pressure(film)
        scale = float(np.abs(film.film_force).max())
        assert scale > 1.0
        difference = np.abs(pressure.axial_force - film.film_force) / scale
        assert np.quantile(difference, 0.98) < SOLVED
        assert difference.max() < CORNER
        rows = np.array(
            [
                [[1.0, r * np.cos(a), r * np.sin(a)] for a in pressure.angles]
                for r in (film.land.inner_radius, film.land.outer_radius)
            ]
        )
        inner, outer = (film.after @ row.T > 0.0 for row in rows)
        partly += np.count_nonzero(inner != outer)
        assert pressure.pressure.min() >= -film.land.tension * (1.0 + 1e-8)
        assert np.any(pressure.cavitates)
        assert film.time[0] < record.begin < film.time[-1]
    assert partly


def test_a_film_tilts_as_the_needle_does_also_over_the_edge_of_a_face():
    # points of the needle at the inner edge of the stop slide off it, and have no gap then
    finer = case(land="0.07 mm")
    valve = build_valve(finer)
    rows = variant_network(valve, "wet").rows()
    sizes = step_sizes(rows, "normal")
    moving = valve.spatial.of(compile_network(rows, sizes), sizes)
    faces = valve.spatial.model
    first, last = next(contact[1:] for contact in faces.contacts if contact[0] == "opening")
    needle = faces.moving[0]
    own = faces.rigid_of(needle.number)
    slid = 0
    for turn in np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False):
        placement = np.zeros(6)
        placement[:2] = 5e-6 * np.cos(turn), 5e-6 * np.sin(turn)
        placement[3:5] = -8e-4 * np.sin(turn), 8e-4 * np.cos(turn)
        moving.q[own] = rigid_coordinates(needle.rigid[:, own], placement)
        moving.take_gaps()
        slid += np.count_nonzero(moving.gap0[first:last] > 1e-3)
        lift, *tilts = film_state(moving.films, 0, moving.q)
        assert lift == pytest.approx(100e-6, abs=2e-7)
        np.testing.assert_allclose(tilts, [placement[4], -placement[3]], atol=2e-5)
    assert slid > 0


def test_modes_are_recorded_about_the_impact(variant):
    record = recorded_impacts(variant)[0][2]
    modes = record.modes
    assert modes.bodies[0] == "needle"
    assert sum(modes.counts) == modes.coordinates.shape[1]
    assert 20 < len(modes.time) <= 200
    assert np.all(np.diff(modes.time) > 0.0)
    assert modes.time[0] <= record.begin + 1e-12
    assert modes.time[-1] >= record.edges[-1] - 1e-7


def test_a_stored_record_is_the_same(study, tmp_path):
    STROKE.save(study, tmp_path)
    loaded = STROKE.load(tmp_path)
    for name, variant in study.variants.items():
        for ours, theirs in zip(
            variant.result.spatial_impacts,
            loaded.variants[name].result.spatial_impacts,
            strict=True,
        ):
            assert (ours.number, ours.stop, ours.radius) == (
                theirs.number,
                theirs.stop,
                theirs.radius,
            )
            np.testing.assert_array_equal(ours.sector_force, theirs.sector_force)
            np.testing.assert_array_equal(ours.modes.coordinates, theirs.modes.coordinates)
            assert (ours.film is None) == (theirs.film is None)
            if ours.film is not None:
                assert ours.film.land == theirs.film.land
                np.testing.assert_array_equal(ours.film.before, theirs.film.before)
    assert not (
        tmp_path / "result.zarr" / "study" / "variants" / "dry" / "result" / "path"
    ).exists()


def test_an_impact_that_a_run_is_stopped_in_is_whole_in_the_next_one(study):
    whole = recorded_impacts(study.variants["dry"])[0][2]
    middle = 0.5 * (whole.begin + whole.edges[-1])
    records = int(middle / 0.5e-6) * 0.5  # [us]
    first = run_stroke(case(f"{records} us", "[dry]"))
    cut = recorded_impacts(first.reference)[0][2]
    after = run_stroke(case("0.06 ms", "[dry]"), after=first)

    assert cut.edges[-1] < whole.edges[-1]
    # intervals of the whole one are longer: it had to join them
    passed = np.append(0.0, np.cumsum(whole.durations * whole.sector_force.sum(axis=1)))
    assert cut.impulse == pytest.approx(np.interp(cut.edges[-1], whole.edges, passed), rel=1e-3)
    again = recorded_impacts(after.reference)[0][2]
    assert again.number == 1
    assert again.begin == pytest.approx(whole.begin, abs=1e-12)
    assert again.impulse == pytest.approx(whole.impulse, rel=1e-6)
    np.testing.assert_allclose(again.edges, whole.edges, rtol=1e-12)
    scale = float(whole.sector_force.max())
    np.testing.assert_allclose(again.sector_force, whole.sector_force, atol=1e-5 * scale)


def test_a_state_of_an_earlier_version_goes_on():
    first = run_stroke(case("0.02 ms", "[dry]"))
    result = first.reference.result
    state = {key: v for key, v in result.state.items() if not key.startswith("moving.impact_")}
    old = replace(result, state=state, spatial_impacts=None)
    before = replace(first, variants={"dry": replace(first.reference, result=old)})

    after = run_stroke(case("0.16 ms", "[dry]"), after=before)

    assert len(recorded_impacts(after.reference)) == len(after.reference.result.events) == 1


RUN = "run: {duration: 0.2 ms, variants: [dry]}"
FRAMES = 8


@pytest.fixture(scope="module")
def case_series():
    text = valve_text("placement: {seed: 3}", RUN)
    assert "gap: 100 um" in text
    # the pole is drawn 100 um above the needle: it has to come down by 10 um
    return read_valve_case(text.replace("gap: 100 um", "gap: 90 um"), FILE)


@pytest.fixture(scope="module")
def study_series(case_series):
    return run_stroke(case_series)


@pytest.fixture(scope="module")
def folder(study_series, case_series, tmp_path_factory):
    out = tmp_path_factory.mktemp("vtk")
    write_spatial_series(study_series, case_series, out, impact=1, frames=FRAMES)
    return out


def stem(study):
    return f"{study.case}_dry_impact_1"


def grids(study, folder, body):
    return [meshio.read(path) for path in sorted((folder / stem(study)).glob(f"{body}_[0-9]*.vtu"))]


def moments(study, folder):
    root = ET.parse(folder / f"{stem(study)}.pvd").getroot()
    found = list(root.iter("DataSet"))
    for item in found:
        assert (folder / item.get("file")).is_file()
    assert {item.get("name") for item in found} == {"needle", "pole", "ring"}
    return sorted({float(item.get("timestep")) for item in found})


def test_the_series_lists_every_body_at_every_moment(study_series, folder):
    times = moments(study_series, folder)
    record = recorded_impacts(study_series.reference)[0][2]
    assert len(times) == FRAMES
    assert times[0] <= record.begin * (1 + 1e-12)
    assert times[-1] >= record.edges[-1] - 1e-7
    assert [len(grids(study_series, folder, name)) for name in ("needle", "pole")] == [FRAMES] * 2


def test_the_rigid_motion_is_the_recorded_path(study_series, folder):
    """Of the axis at the height of the seat, and its slope."""
    variant, times = study_series.reference, moments(study_series, folder)
    tip = 0.0  # z of the tip's ball centre: any height would do
    for time, grid in zip(times, grids(study_series, folder, "needle"), strict=True):
        rigid = grid.point_data["displacement"] - grid.point_data["deformation"]
        z = grid.points[:, 2] - tip
        # u_x = x_0 + slope z on the axis, and no term of x and y but a turn
        shapes = np.column_stack([np.ones(len(z)), z, grid.points[:, 0], grid.points[:, 1]])
        found, left, *_ = np.linalg.lstsq(shapes, rigid[:, 0].astype(float), rcond=None)
        assert np.sqrt(left[0] / len(z)) < 1e-10  # a rigid field is linear; single precision
        assert abs(found[2]) < 1e-7  # it does not stretch
        slope = np.interp(time, variant.result.time, variant.channel("needle tilt x").values)
        assert found[1] == pytest.approx(slope, rel=0.02, abs=2e-7)
        for name in ("needle x",):
            truth = np.interp(time, variant.result.time, variant.channel(name).values)
            seat = -1.25e-3 * np.cos(np.pi / 4)  # touch of ball and cone of 45 degrees
            assert found[0] + seat * found[1] == pytest.approx(truth, abs=5e-9)


def test_bodies_touch_while_they_press(study_series, folder):
    record = recorded_impacts(study_series.reference)[0][2]
    pressed = 0
    for needle, pole, ring in zip(
        *(grids(study_series, folder, name) for name in ("needle", "pole", "contact_ring")),
        strict=True,
    ):
        force = float(ring.cell_data["sector_force"][0].sum())
        land = needle.points[:, 2] + needle.point_data["displacement"][:, 2]
        flat = np.abs(needle.points[:, 2] - 18.5e-3) < 1e-6
        radius = np.hypot(pole.points[:, 0], pole.points[:, 1])
        low = np.abs(radius - record.radius) < 0.07e-3
        stop = pole.points[:, 2] + pole.point_data["displacement"][:, 2]
        gap = stop[low].min() - land[flat].max()
        if force > 100.0:
            pressed += 1
            assert -8e-6 < gap < 1e-6  # the needle leans, and modes have no local indentation
        assert np.allclose(ring.points[:, 2], 18.5e-3, atol=1e-6)
    assert pressed >= 3


def test_the_ring_has_the_recorded_load(study_series, folder):
    record = recorded_impacts(study_series.reference)[0][2]
    for time, ring in zip(
        moments(study_series, folder), grids(study_series, folder, "contact_ring"), strict=True
    ):
        at = int(np.searchsorted(record.edges, time * (1 - 1e-12))) - 1
        expected = record.line_load[at] if 0 <= at < len(record.line_load) else np.zeros(36)
        np.testing.assert_allclose(ring.cell_data["line_load"][0].ravel(), expected, rtol=1e-6)
        length = 2.0 * np.pi * record.radius / 36
        np.testing.assert_allclose(
            ring.cell_data["sector_force"][0].ravel(), expected * length, rtol=1e-6
        )


def test_a_rigid_motion_has_no_stress(case_series):
    shapes = valve_shapes(case_series)["needle"]
    field = StressField(
        shapes.body.mesh, case_series.materials_of("needle", shapes.body.mesh.solids)
    )
    elastic = shapes.omega > 0.0
    scale = float(np.abs(field(shapes.shapes[:, elastic][:, 0])).max())
    for rigid in shapes.shapes[:, ~elastic].T:
        assert float(np.abs(field(rigid)).max()) < 1e-8 * scale
    assert np.count_nonzero(~elastic) == 6


def test_coordinates_of_other_shapes_are_refused(study_series, case_series, tmp_path):
    variant = study_series.reference
    record = variant.result.spatial_impacts[0]
    marks = record.modes.shape_marks.copy()
    marks[7] *= -1.0  # an elastic mode came out with the other sign
    changed = replace(record, modes=replace(record.modes, shape_marks=marks))
    result = replace(variant.result, spatial_impacts=(changed,))
    other = replace(study_series, variants={"dry": replace(variant, result=result)})
    with pytest.raises(InputError, match="shapes differ"):
        write_spatial_series(other, case_series, tmp_path, impact=1)
    assert not list(tmp_path.iterdir())


def test_the_command_writes_it_from_a_stored_result(study_series, folder, tmp_path, capsys):
    STROKE.save(study_series, tmp_path / "result")
    command = [
        "export",
        str(tmp_path / "result"),
        "--to",
        "vtk",
        "--frames",
        f"{FRAMES}",
        "--quiet",
    ]
    out = ["--out", str(tmp_path / "out"), "--json", str(tmp_path / "told.json")]

    assert main([*command, "--impact", "1", "--variant", "dry", *out]) == 0

    assert json.loads((tmp_path / "told.json").read_text())["to"] == "vtk"
    ours = (tmp_path / "out" / stem(study_series) / "needle_0003.vtu").read_bytes()
    assert ours == (folder / stem(study_series) / "needle_0003.vtu").read_bytes()
    for wrong, expected in (
        (["--impact", "2"], "expected one of: 1"),
        (["--impact", "1", "--variant", "wet"], "expected one of: dry"),
        (["--impact", "1", "--level", "full"], "no level"),
        (["--impact", "1", "--frames", "1"], "at least 2"),
        ([], "takes --impact"),
    ):
        capsys.readouterr()
        assert main([*command[:4], *wrong, "--quiet", "--out", str(tmp_path / "no")]) == 2
        assert expected in capsys.readouterr().err
    assert not (tmp_path / "no").exists()
