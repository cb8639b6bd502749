"""An impact of a stroke in three dimensions as grids of VTK.

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
from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import read_valve_case
from klack.cli.main import main
from klack.elasticity.stress import StressField
from klack.errors import InputError
from klack.exchange.results.spatial_series import valve_shapes, write_spatial_series

pytestmark = pytest.mark.slow  # one build of a valve

RUN = "run: {duration: 0.2 ms, variants: [dry]}"
FRAMES = 8


@pytest.fixture(scope="module")
def case():
    text = valve_text("placement: {seed: 3}", RUN)
    assert "gap: 100 um" in text
    # the pole is drawn 100 um above the needle: it has to come down by 10 um
    return read_valve_case(text.replace("gap: 100 um", "gap: 90 um"), FILE)


@pytest.fixture(scope="module")
def study(case):
    return run_stroke(case)


@pytest.fixture(scope="module")
def folder(study, case, tmp_path_factory):
    out = tmp_path_factory.mktemp("vtk")
    write_spatial_series(study, case, out, impact=1, frames=FRAMES)
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


def test_the_series_lists_every_body_at_every_moment(study, folder):
    times = moments(study, folder)
    record = recorded_impacts(study.reference)[0][2]
    assert len(times) == FRAMES
    assert times[0] <= record.begin * (1 + 1e-12)
    assert times[-1] >= record.edges[-1] - 1e-7
    assert [len(grids(study, folder, name)) for name in ("needle", "pole")] == [FRAMES] * 2


def test_the_rigid_motion_is_the_recorded_path(study, folder):
    """Of the axis at the height of the seat, and its slope."""
    variant, times = study.reference, moments(study, folder)
    tip = 0.0  # z of the tip's ball centre: any height would do
    for time, grid in zip(times, grids(study, folder, "needle"), strict=True):
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


def test_bodies_touch_while_they_press(study, folder):
    record = recorded_impacts(study.reference)[0][2]
    pressed = 0
    for needle, pole, ring in zip(
        *(grids(study, folder, name) for name in ("needle", "pole", "contact_ring")), strict=True
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


def test_the_ring_has_the_recorded_load(study, folder):
    record = recorded_impacts(study.reference)[0][2]
    for time, ring in zip(
        moments(study, folder), grids(study, folder, "contact_ring"), strict=True
    ):
        at = int(np.searchsorted(record.edges, time * (1 - 1e-12))) - 1
        expected = record.line_load[at] if 0 <= at < len(record.line_load) else np.zeros(36)
        np.testing.assert_allclose(ring.cell_data["line_load"][0].ravel(), expected, rtol=1e-6)
        length = 2.0 * np.pi * record.radius / 36
        np.testing.assert_allclose(
            ring.cell_data["sector_force"][0].ravel(), expected * length, rtol=1e-6
        )


def test_a_rigid_motion_has_no_stress(case):
    shapes = valve_shapes(case)["needle"]
    field = StressField(shapes.body.mesh, case.materials_of("needle", shapes.body.mesh.solids))
    elastic = shapes.omega > 0.0
    scale = float(np.abs(field(shapes.shapes[:, elastic][:, 0])).max())
    for rigid in shapes.shapes[:, ~elastic].T:
        assert float(np.abs(field(rigid)).max()) < 1e-8 * scale
    assert np.count_nonzero(~elastic) == 6


def test_coordinates_of_other_shapes_are_refused(study, case, tmp_path):
    variant = study.reference
    record = variant.result.spatial_impacts[0]
    marks = record.modes.shape_marks.copy()
    marks[7] *= -1.0  # an elastic mode came out with the other sign
    changed = replace(record, modes=replace(record.modes, shape_marks=marks))
    result = replace(variant.result, spatial_impacts=(changed,))
    other = replace(study, variants={"dry": replace(variant, result=result)})
    with pytest.raises(InputError, match="other shapes"):
        write_spatial_series(other, case, tmp_path, impact=1)
    assert not list(tmp_path.iterdir())


def test_the_command_writes_it_from_a_stored_result(study, folder, tmp_path, capsys):
    STROKE.save(study, tmp_path / "result")
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
    ours = (tmp_path / "out" / stem(study) / "needle_0003.vtu").read_bytes()
    assert ours == (folder / stem(study) / "needle_0003.vtu").read_bytes()
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
