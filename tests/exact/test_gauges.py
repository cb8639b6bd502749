"""Gauges on bodies: a uniform strain on any mesh, and a rod struck by a rod (St Venant).

Truth: exact.  A linear displacement field has one strain; a rod that is struck by an equal one
carries the strain v / (2 c) from the time x / c on (Johnson 1985, section 11.1); a held force F
strains it by F / (E A).
"""

import warnings
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.impact.run import run_impact
from klack.assembling.bodies import build_bodies
from klack.bodies.elasticity.loads import traction_load
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.gauges.located_point import locate
from klack.bodies.gauges.rows import Line, displacement_row, strain_row, stress_row
from klack.case import read_case
from klack.errors import InputError
from klack.machine.progress import silent
from klack.materials.material import Material
from klack.mesh.mesh import ElementBlock, Mesh
from klack.mesh.rigid import Pose
from klack.signals.low_pass import LowPass

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)

CORNERS = {
    "quad4": [(0, 0), (1, 0), (1, 1), (0, 1)],
    "tri3": [(0, 0), (1, 0), (0, 1)],
    "tet4": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)],
    "hex8": [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))],
    "wedge6": [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (0, 1))],
}


def distorted(family: str) -> Mesh:
    """One element with a corner pulled aside, 1 mm long and 2 mm from the axis."""
    points = np.array(CORNERS[family], dtype=float)
    points[-1] += 0.2
    points = 1e-3 * (points + ([2.0, 0.0] if points.shape[1] == 2 else [0.0, 0.0, 0.0]))
    block = ElementBlock(family, np.arange(len(points))[None], "body")
    return Mesh(points=points, blocks=(block,))


@pytest.mark.parametrize("length", [0.0, 0.1e-3])
@pytest.mark.parametrize("family", list(CORNERS))
def test_a_uniform_strain_is_read_exactly_on_every_mesh(family, length):
    mesh = distorted(family)
    d = mesh.dimension
    gradient = 1e-3 * np.arange(1.0, 1.0 + d * d).reshape(d, d)
    u = (mesh.points @ gradient.T).ravel()
    direction = np.ones(d) / np.sqrt(d)
    middle = mesh.points.mean(axis=0)
    line = Line(at=middle, direction=direction, length=length, where="gauge")

    strain = strain_row(mesh, line) @ u

    assert strain == pytest.approx(direction @ gradient @ direction, rel=1e-10)
    moved = displacement_row(mesh, line) @ u
    assert moved == pytest.approx(direction @ gradient @ middle, rel=1e-10)


def test_the_stress_is_that_of_hooke():
    mesh = distorted("hex8")
    u = (mesh.points * [1e-3, 0.0, 0.0]).ravel()
    along, across = np.eye(3)[:2]
    place = mesh.points.mean(axis=0)
    lame, mu = STEEL.lame_lambda, STEEL.shear_modulus

    for direction, factor in ((along, lame + 2.0 * mu), (across, lame)):
        line = Line(at=place, direction=direction, length=0.0, where="gauge")
        stress = stress_row(mesh, line, {"body": STEEL}) @ u
        assert stress == pytest.approx(1e-3 * factor, rel=1e-10)


def test_the_strain_around_the_axis_is_that_of_the_radius():
    mesh = distorted("quad4")
    u = (mesh.points * [1e-3, 0.0]).ravel()
    line = Line(at=mesh.points.mean(axis=0), direction="around", length=0.0, where="gauge")

    assert strain_row(mesh, line) @ u == pytest.approx(1e-3, rel=1e-10)
    axial = stress_row(mesh, Line(at=line.at, direction=np.array([0.0, 1.0]), length=0.0, where=""),
                       {"body": STEEL}) @ u  # fmt: skip
    assert axial == pytest.approx(2e-3 * STEEL.lame_lambda, rel=1e-10)


def test_errors_are_told_in_coordinates_of_the_drawing():
    """Truth: a body that was moved by 7 mm has the coordinates of its drawing 7 mm lower."""
    moved = distorted("quad4").moved(np.array([0.0, 7e-3]))
    line = Line(
        at=np.array([3e-3, 7e-3]),
        direction=np.array([1.0, 0.0]),
        length=1e-3,
        where="gauge",
        pose=Pose.along_z(7e-3),
    )

    with pytest.raises(InputError, match=r"gauge, end of .* at \(3.5, 0\) mm.* is \(3, 0\) mm"):
        strain_row(moved, line)
    with pytest.raises(InputError, match=r"gauge, within the gauge length: .* is \(3, 0\) mm"):
        displacement_row(moved, line)


def test_a_gauge_outside_of_the_body_tells_how_far_and_where_the_body_is():
    mesh = distorted("quad4")

    with pytest.raises(InputError, match=r"500 um outside.* nearest one is \(2.5, 0\) mm"):
        locate(mesh, np.array([2.5e-3, -0.5e-3]), "outputs.front")


@pytest.mark.parametrize("kind", ["bessel", "butterworth"])
@pytest.mark.parametrize("order", [1, 2, 4])
def test_a_low_pass_loses_3_dB_at_its_cut_off(kind, order):
    time = np.arange(0.0, 40.0, 0.002)
    shown = LowPass(cut_off=1.0, order=order, kind=kind)(np.sin(2 * np.pi * time), 0.002)

    # straight lines between the samples lose 1.3e-5, samples beside the peak 2e-5
    assert np.abs(shown[-1000:]).max() == pytest.approx(np.sqrt(0.5), rel=5e-5)


ROD = """
klack: 1
title: A rod strikes a rod
materials:
  steel: {young: 210 GPa, poisson: 0.0, density: 7850 kg/m^3}
bodies:
  striker:
    geometry:
      model: axisymmetric
      profile:
        unit: mm
        parts:
          striker:
            start: [0, 0]
            edges:
              - {line: [2, 0], name: end}
              - {line: [2, 40], name: side}
              - {line: [0, 40], name: far}
              - {close: true, name: axis}
    material: steel
    mesh: {size: 1 mm}
  bar:
    geometry:
      model: axisymmetric
      profile:
        unit: mm
        parts:
          bar:
            start: [0, -60]
            edges:
              - {line: [2, -60], name: far}
              - {line: [2, 0], name: side}
              - {line: [0, 0], name: end}
              - {close: true, name: axis}
    material: steel
    mesh: {size: 1 mm}
contact: {between: [striker.end, bar.end], gap: 0 um}
motion: {speed: 1 m/s}
reduction: {modes: {striker: {count: 20}, bar: {count: 30}}}
run: {levels: [full], duration: 16 us, full_step: 50 ns, interface_step: 50 ns}
outputs:
  - {name: strain, body: bar, kind: strain, at: [2 mm, -30 mm], length: 2 mm}
  - {name: stress, body: bar, kind: stress, at: [1 mm, -30 mm], length: 2 mm}
  - {name: speed, body: bar, kind: velocity, at: [1 mm, -30 mm], length: 2 mm}
  - {name: way, body: striker, kind: displacement, at: [0 mm, 40 mm]}
"""

C = np.sqrt(210e9 / 7850.0)


def gauges(text: str, *levels: str):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        study = run_impact(read_case(text, Path("case.yaml")), levels=levels, certify=False)
    return {name: {g.name: g for g in level.gauges} for name, level in study.levels.items()}


@pytest.mark.slow
def test_a_struck_rod_carries_the_wave_of_st_venant():
    found = gauges(ROD, "full")["full"]
    strain = found["strain"]

    arrival = np.interp(-0.25 / C, -np.maximum.accumulate(-strain.exact)[::-1], strain.time[::-1])
    assert arrival == pytest.approx(30e-3 / C, rel=1e-2)  # a quarter of an element
    held = (strain.time > 8e-6) & (strain.time < 15e-6)
    for name, expected in (("strain", -0.5 / C), ("stress", -0.5 * 210e9 / C), ("speed", -0.5)):
        assert found[name].exact[held].mean() == pytest.approx(expected, rel=3e-3), name
    way = found["way"]
    assert way.exact[-1] == pytest.approx(-40e-3 / C, rel=3e-3)  # stops when the wave is there


ON_A_ROD = (
    ROD.replace("- {line: [2, 0], name: end}\n              - {line: [2, 40], name: side}",
                "- {arc: [2, 2], centre: [0, 2], name: end}\n"
                "              - {line: [2, 2.5], name: side}", 1)
    .replace("[0, 40], name: far", "[0, 2.5], name: far")
    .replace("mesh: {size: 1 mm}", "mesh: {size: 1 mm, contact: {size: 0.02 mm, extent: 0.3 mm}}")
    .replace("at: [0 mm, 40 mm]", "at: [0 mm, 2.5 mm]")
    .replace("duration: 16 us", "duration: 40 us")
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("faces", ["gap: 0 um}", "gap: 0 um, friction: 0.3}"])
def test_all_levels_read_the_same_where_their_contact_is_the_same(faces):
    """Ball on a rod: the force is smooth, so the three levels agree in the force and the strain."""
    ball = ROD.replace("- {line: [2, 0], name: end}\n              - {line: [2, 40], name: side}",
                       "- {arc: [2, 2], centre: [0, 2], name: end}\n"
                       "              - {line: [2, 8], name: side}", 1)  # fmt: skip
    ball = ball.replace("[0, 40], name: far", "[0, 8], name: far").replace(
        "mesh: {size: 1 mm}", "mesh: {size: 1 mm, contact: {size: 0.02 mm, extent: 0.3 mm}}"
    )
    ball = ball.replace("at: [0 mm, 40 mm]", "at: [0 mm, 8 mm]")
    found = gauges(ball.replace("gap: 0 um}", faces), "reduced", "interface", "full")

    for name in ("strain", "stress", "speed", "way"):
        full = found["full"][name]
        for level in ("reduced", "interface"):
            other = found[level][name]
            apart = np.interp(full.time, other.time, other.exact) - full.exact
            assert np.abs(apart).max() < 0.01 * np.abs(full.exact).max(), (level, name)


@pytest.mark.slow
@pytest.mark.parametrize("level", ["reduced", "interface"])
@pytest.mark.parametrize(
    ("count", "doubted"),
    [(1, {"strain", "speed"}), (2, {"strain", "speed"}), (3, {"strain"}), (5, set()), (8, set())],
)
def test_a_sensor_is_doubted_where_its_modes_do_not_carry_the_wave(count, doubted, level):
    """A short ball on a rod without Poisson's ratio: F / (rho c A), from end to end and back.

    Truth: exact, under the force of the run.  A tenth of the peak is what the doubt promises; the
    speed with two and three modes, in whose middle every other one has a node, is off by 7 %.
    """
    text = ON_A_ROD.replace("bar: {count: 30}", f"bar: {{count: {count}}}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        study = run_impact(read_case(text, Path("case.yaml")), levels=[level], certify=False)

    found, force = study.levels[level], study.levels[level].history
    t = found.gauges[0].time
    middles = force.start + force.step * (np.arange(force.force.size) + 0.5)
    there, back = (
        sum(np.interp(t - way / C, middles, force.force, left=0.0) for way in ways)
        for ways in ((30e-3, 150e-3, 270e-3), (90e-3, 210e-3))
    )
    area = np.pi * 2e-3**2
    exact = {
        "speed": -(there + back) / (7850.0 * C * area),
        "strain": (back - there) / (210e9 * area),
    }
    notes = [text for text in study.warnings if "may move before the wave arrives" in text]
    for gauge in found.gauges:
        if gauge.name not in exact:
            continue
        off = np.abs(gauge.exact - exact[gauge.name]).max() / np.abs(exact[gauge.name]).max()
        is_doubted = any(f"'{gauge.name}'" in text for text in notes)
        assert is_doubted == (gauge.name in doubted), (gauge.name, off)
        assert off < 0.1 or is_doubted, gauge.name
        assert off > 0.5 or count > 1 or gauge.name == "strain"
    assert all("'bar'" in text and text.startswith(f"level '{level}'") for text in notes)
    assert all(gauge.kept_up_to < np.inf for gauge in found.gauges)


def test_a_held_force_strains_a_rod_by_its_stress():
    """Statics: under an even pressure p on its end a held rod has the strain p / E everywhere."""
    text = ROD.replace("name: far}", "name: foot}", 2).replace("    mesh: {size: 1 mm}\ncontact",
                       "    mesh: {size: 1 mm}\n    fixed: [{surface: foot}]\ncontact")  # fmt: skip
    pair = build_bodies(read_case(text, Path("case.yaml")), silent)
    bar = pair.lower
    load = traction_load(bar.mesh, bar.mesh.surface("end"), lambda x, n: -1e6 * n)
    with Flexibility(bar) as flexibility:
        u = flexibility.deflections(load[:, None])[:, 0]

    read = {gauge.name: float(gauge.row @ u) for gauge in pair.gauges if gauge.body == "bar"}
    assert read["strain"] == pytest.approx(-1e6 / 210e9, rel=1e-9)
    assert read["stress"] == pytest.approx(-1e6, rel=1e-9)
    assert read["speed"] == pytest.approx(-30e-3 * 1e6 / 210e9, rel=1e-9)


def test_a_gauge_outside_stops_the_case():
    with pytest.raises(InputError, match=r"(?s)outputs.strain.*1 mm outside.*\(2, -30\) mm"):
        gauges(ROD.replace("at: [2 mm, -30 mm], length: 2 mm", "at: [3 mm, -30 mm]"), "full")


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("body: striker", "body: hammer", "unknown body 'hammer'"),
        ("name: way", "name: strain", "twice"),
        ("at: [0 mm, 40 mm]", "at: [0 mm, 40 mm, 0 mm]", "3 coordinates"),
        ("at: [0 mm, 40 mm]", "at: [0 mm, 40 mm], direction: x", "one of: r, z, around"),
        ("at: [0 mm, 40 mm]", "at: [0 mm, 40 mm], direction: around", "does not move around"),
        ("kind: displacement", "kind: acceleration", "acceleration"),
    ],
)
def test_outputs_that_cannot_be(old, new, text):
    with pytest.raises(InputError, match=text):
        read_case(ROD.replace(old, new), Path("case.yaml"))
