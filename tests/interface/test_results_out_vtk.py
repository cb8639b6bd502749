"""Fields as VTK, and sound files.

Grids and series of VTK: truth = what was written, read by meshio and by VTK itself.

Fields on the way of a full-order run: truth = the run that nobody looked at.

Sound files: content read back by soundfile, stated level, and errors.
"""

from io import BytesIO
from pathlib import Path

import meshio
import numpy as np
import pytest
import soundfile

from klack.acoustics.wav import full_scale_of, level_statement, wav_bytes, write_wav
from klack.errors import InputError
from klack.exchange.results.vtu import SeriesFile, VtuGrid, write_pvd
from klack.files.whole import whole_files
from klack.mesh.mesh import ElementBlock, Mesh
from klack.signals.sampled import TimeSeries
from klack.transient.full_order import simulate_full_order
from klack.transient.result import FullOrderResult, MotionOfBody, Snapshots
from klack.verification.lattice import lattice_mesh
from klack.verification.transient import STEEL, rod_body, rod_contact

SOLIDS = ("tet4", "tet10", "hex8", "hex20", "wedge6", "wedge15")
PLANES = ("tri3", "tri6", "quad4", "quad8")


def box(family: str) -> Mesh:
    """1 x 2 x 3 (or 1 x 2) with uneven cells."""
    d = 3 if family in SOLIDS else 2
    return lattice_mesh(family, [np.array([0.0, 0.4, 1.0]) * (i + 1) for i in range(d)])


# meshio reads no quadratic wedge
@pytest.mark.parametrize("family", [*SOLIDS[:-1], *PLANES])
def test_meshio_reads_grid_and_fields(family: str, tmp_path: Path):
    mesh = box(family)
    rng = np.random.default_rng(3)
    moved = rng.standard_normal((mesh.node_count, mesh.dimension))
    tensor = rng.standard_normal((mesh.node_count, 6))
    fields = {"displacement": moved, "von_mises": tensor[:, 0], "stress": tensor}
    path = tmp_path / "grid.vtu"

    VtuGrid(mesh).write(path, fields, 1e-6)

    read = meshio.read(path)
    shown = [0, 1, 2] if mesh.dimension == 3 else [0, 2]
    np.testing.assert_array_equal(read.points[:, shown], mesh.points)
    if mesh.dimension == 2:
        np.testing.assert_array_equal(read.points[:, 1], 0.0)
    (cells,) = read.cells
    np.testing.assert_array_equal(np.sort(cells.data), np.sort(mesh.blocks[0].connectivity))
    single = {name: values.astype(np.float32) for name, values in fields.items()}
    np.testing.assert_array_equal(read.point_data["displacement"][:, shown], single["displacement"])
    np.testing.assert_array_equal(read.point_data["von_mises"].ravel(), single["von_mises"])
    np.testing.assert_array_equal(read.point_data["stress"], single["stress"])


@pytest.mark.parametrize("family", [*SOLIDS, *PLANES])
def test_vtk_finds_the_volume_of_every_element(family: str, tmp_path: Path):
    """A wrong node order would turn an element inside out."""
    pyvista = pytest.importorskip("pyvista")
    mesh = box(family)
    path = tmp_path / "grid.vtu"
    VtuGrid(mesh).write(path, {"stress": np.zeros((mesh.node_count, 6))}, 2.5e-6)

    grid = pyvista.read(path)

    solid = mesh.dimension == 3
    sizes = grid.compute_cell_sizes()["Volume" if solid else "Area"]
    assert np.all(sizes > 0.0)
    assert sizes.sum() == pytest.approx(6.0 if solid else 2.0, rel=1e-12)
    assert grid.field_data["TimeValue"][0] == 2.5e-6
    data = grid.GetPointData().GetArray("stress")
    assert [data.GetComponentName(i) for i in range(6)] == ["XX", "YY", "ZZ", "XY", "YZ", "XZ"]


@pytest.mark.parametrize("family", ["tet10", "hex20", "wedge15", "tri6", "quad8"])
def test_vtk_finds_the_middle_of_every_edge(family: str, tmp_path: Path):
    pyvista = pytest.importorskip("pyvista")
    mesh = box(family)
    (block,) = mesh.blocks
    VtuGrid(mesh).write(tmp_path / "grid.vtu", {}, 0.0)

    cell = pyvista.read(tmp_path / "grid.vtu").get_cell(0)

    # of an edge VTK names the ends, then the middle
    edges = {(*sorted(edge.point_ids[:2]), edge.point_ids[2]) for edge in cell.edges}
    nodes, corners = block.connectivity[0], block.topology.corners
    expected = {
        (*sorted(nodes[list(ends)].tolist()), int(nodes[corners + i]))
        for i, ends in enumerate(block.topology.edges)
    }
    assert edges == expected


def test_solids_and_mixed_elements_share_a_grid(tmp_path: Path):
    points = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [2, 0]], float)
    mesh = Mesh(
        points=points,
        blocks=(
            ElementBlock("quad4", np.array([[0, 1, 2, 3]]), "ring"),
            ElementBlock("tri3", np.array([[1, 4, 2]]), "cone"),
        ),
    )
    VtuGrid(mesh).write(tmp_path / "grid.vtu", {}, 0.0)

    read = meshio.read(tmp_path / "grid.vtu")

    assert [block.type for block in read.cells] == ["quad", "triangle"]
    assert [values.ravel().tolist() for values in read.cell_data["solid"]] == [[0], [1]]


@pytest.mark.slow
def test_large_arrays_go_out_in_several_pieces(tmp_path: Path):
    """More than 1 MiB of points; also one that ends exactly at the end of a piece."""
    for count in (2**17 // 2 + 1, 2**18):
        points = np.random.default_rng(1).standard_normal((count, 3))
        mesh = Mesh(points=points, blocks=(ElementBlock("tet4", np.array([[0, 1, 2, 3]]), "a"),))
        VtuGrid(mesh).write(tmp_path / "grid.vtu", {"x": points[:, 0]}, 0.0)

        read = meshio.read(tmp_path / "grid.vtu")

        np.testing.assert_array_equal(read.points, points)
        np.testing.assert_array_equal(read.point_data["x"].ravel(), points[:, 0].astype("f4"))


def test_paraview_finds_times_and_parts(tmp_path: Path):
    pyvista = pytest.importorskip("pyvista")
    mesh = box("tri6")
    files = []
    for k in range(3):
        for part, name in enumerate(("needle", "seat & <ring>")):
            file = f"grid_{part}_{k}.vtu"
            VtuGrid(mesh).write(tmp_path / file, {"x": np.full(mesh.node_count, k + part)}, k)
            files.append(SeriesFile(time=k * 1e-7, part=part, name=name, file=file))
    write_pvd(tmp_path / "film.pvd", files)

    reader = pyvista.PVDReader(tmp_path / "film.pvd")

    assert reader.time_values == [0.0, 1e-7, 2e-7]
    reader.set_active_time_value(2e-7)
    assert [block["x"][0] for block in reader.read()] == [2.0, 3.0]


def break_off(folder: Path) -> None:
    with whole_files(folder) as stage:
        (stage / "film").mkdir()
        raise ZeroDivisionError


def test_a_folder_of_grids_is_replaced_whole_or_stays(tmp_path: Path):
    for content in ("first", "second"):
        with whole_files(tmp_path) as stage:
            (stage / "film").mkdir()
            (stage / "film" / "a.vtu").write_text(content)
    (tmp_path / "film" / "mine.txt").write_text("")

    with pytest.raises(ZeroDivisionError):
        break_off(tmp_path)

    assert sorted(path.name for path in tmp_path.iterdir()) == ["film"]
    assert (tmp_path / "film" / "a.vtu").read_text() == "second"


AREA, STEP, SPEED, GAP = 1e-4, 0.1e-6, 0.5, 1e-6


def impact(snapshots: Snapshots | None) -> FullOrderResult:
    rod = rod_body("rod", STEEL, area=AREA, length=0.02, elements=20)
    space = rod_contact(rod, None, area=AREA, gap=GAP)
    return simulate_full_order(
        rod, None, space, speed=SPEED, duration=4e-6, step=STEP, snapshots=snapshots
    )


def test_looking_changes_nothing_and_shows_the_run():
    seen: list[tuple[float, tuple[MotionOfBody, ...]]] = []

    plain = impact(None)
    watched = impact(
        Snapshots(steps=range(0, 41, 8), receive=lambda time, motion: seen.append((time, motion)))
    )

    np.testing.assert_array_equal(watched.history.force, plain.history.force)
    time = [item[0] for item in seen]
    np.testing.assert_allclose(time, plain.history.start + 8 * STEP * np.arange(6), rtol=1e-12)
    (first,), (last,) = seen[0][1], seen[-1][1]
    assert first.name == "rod"
    # the flight to just before the first touch at 2 us is skipped, but counted
    assert plain.history.start == pytest.approx(GAP / SPEED, abs=2 * STEP)
    np.testing.assert_allclose(first.displacement, -SPEED * plain.history.start, rtol=1e-12)
    np.testing.assert_array_equal(first.velocity, -SPEED)
    np.testing.assert_array_equal(last.displacement, plain.fields[0].end_displacement)
    # every step is seen, so that mean velocities add up to the way
    every: list[MotionOfBody] = []
    impact(Snapshots(steps=range(41), receive=lambda _, motion: every.append(motion[0])))
    way = STEP * np.sum([body.velocity for body in every[1:]], axis=0)
    np.testing.assert_allclose(way, last.displacement - first.displacement, rtol=0, atol=1e-18)


RATE = 48_000


def sound(amplitude, *, rate=RATE):
    t = np.arange(rate // 10) / rate
    values = amplitude * np.sin(2e3 * np.pi * t)
    return TimeSeries(step=1.0 / rate, values=values, unit="Pa", name="tone")


def test_what_is_written_is_read_back(tmp_path):
    pressure = sound(0.02)
    write_wav(tmp_path / "tone.wav", pressure, full_scale=0.05)
    values, rate = soundfile.read(tmp_path / "tone.wav")

    assert rate == RATE
    np.testing.assert_allclose(values * 0.05, pressure.values, atol=0.05 * 2.0**-23)


def test_the_file_says_how_loud_it_is(tmp_path):
    write_wav(tmp_path / "tone.wav", sound(0.02), full_scale=0.05)
    with soundfile.SoundFile(tmp_path / "tone.wav") as file:
        assert (file.subtype, file.channels, file.title) == ("PCM_24", 1, "tone")
        assert file.comment == level_statement(0.05)
    # 20 lg(0.05 / 20e-6) = 67.96, a sine 3.01 less
    assert "0.05 Pa peak (68.0 dB peak re 20 uPa" in level_statement(0.05)
    assert "64.9 dB SPL" in level_statement(0.05)


def test_sounds_share_a_full_scale():
    loud, quiet = sound(0.02), sound(0.001)
    full_scale = full_scale_of(loud, quiet)
    peak = np.abs(loud.values).max()

    assert 20.0 * np.log10(peak / full_scale) == pytest.approx(-6.0, abs=1e-9)
    assert full_scale_of(sound(0.0)) == 20e-6
    played = [
        np.abs(soundfile.read(BytesIO(wav_bytes(p, full_scale=full_scale)))[0]).max()
        for p in (loud, quiet)
    ]
    assert played[0] / played[1] == pytest.approx(20.0, rel=1e-3)


def test_clipping_and_other_rates_are_refused():
    for given, scale, words in (
        (sound(0.1), 0.05, "full_scale_of"),
        (sound(0.01, rate=44_100), 0.05, "48000 Hz"),
        (sound(0.01), 0.0, "full_scale"),
    ):
        with pytest.raises(InputError, match=words):
            wav_bytes(given, full_scale=scale)
