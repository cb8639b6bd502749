"""Form of faces, and faces that meet all at once.

Crown, waviness and tilt of faces that are drawn plane.

Truth: the same form drawn as geometry, or as a rigid placement (exact to the square of the slope);
Hertz (1882) on the sphere that a crown is (exact for a contact small against its face).

Faces that meet all at once.

Truth: the pressure of plane waves, rho c v / 2 (exact), at the full order (reference), and that no
level of modes answers for them without a word.
"""

from math import pi
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.impact.interface_level import exact_gaps
from klack.analyses.impact.run import run_impact
from klack.assembling.problem import build_problem, place_bodies
from klack.case import find_case, load_case
from klack.contact.face_form import FaceForm, Waves
from klack.contact.hertz import point_radius
from klack.contact.touch_shape import area_at_once, front_pressure
from klack.errors import InputError
from klack.exchange.calculix_case import calculix_impact
from klack.machine.progress import silent
from klack.materials.material import Material

CASE = """
klack: 1
title: Two bars
materials:
  steel: {young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}
bodies:
  striker:
    geometry:
      MODEL
      profile:
        unit: mm
        parts:
          striker:
            start: [0, 0]
            edges:
              - END
              - {line: [10, 40], name: side}
              - {line: [0, 40], name: far}
              - {close: true, name: axis}
    material: steel
    mesh: {size: 2 mm, surfaces: {end: FINE}}
  bar:
    geometry:
      MODEL
      profile:
        unit: mm
        parts:
          bar:
            start: [0, -60]
            edges:
              - {line: [10, -60], name: far}
              - {line: [10, 0], name: side}
              - {line: [0, 0], name: end}
              - {close: true, name: axis}
    material: steel
    mesh: {size: 2 mm, surfaces: {end: FINE}}
contact:
  between: [striker.end, bar.end]
  gap: GAP
motion: {speed: 0.2 m/s}
reduction: {modes: {striker: {count: 20}, bar: {count: 30}}}
run: {duration: 40 us, interface_step: 20 ns, full_step: 20 ns, levels: [interface, full]}
"""
FLAT = "{line: [10, 0], name: end}"


def case(tmp_path, contact="", *, end=FLAT, fine="1 mm", gap="0 um", solid=False, more=""):
    """Two bars of 20 mm, as bodies of revolution or as solids."""
    text = CASE.replace("END", end).replace("FINE", fine).replace("GAP", gap)
    text = text.replace(
        "MODEL", "model: swept\n      layers: 12" if solid else "model: axisymmetric"
    )
    keys = "".join(f"  {line}\n" for line in contact.splitlines())
    text = text.replace("motion:", f"{keys}motion:").replace("0.2 m/s", f"0.2 m/s{more}")
    path = tmp_path / f"case{len(list(tmp_path.iterdir()))}.yaml"
    path.write_text(text)
    return load_case(path)


def test_heights_add_up():
    form = FaceForm(
        centre=(1e-3, 0.0),
        radius=10e-3,
        crown=1e-6,
        waves=Waves(amplitude=0.2e-6, length=4e-3, direction=0.0, phase=pi),
        tilt=1e-4,
        tilt_direction=pi / 2.0,
    )

    heights = form.heights(np.array([[1e-3, 0.0, 0.0], [5e-3, 3e-3, 0.0]]))

    at_centre = 0.4e-6 + 10e-3 * np.tan(1e-4)
    beside = 0.25e-6 + 0.4e-6 + 13e-3 * np.tan(1e-4)
    assert heights == pytest.approx([at_centre, beside], rel=1e-12)


@pytest.mark.parametrize("crown", [2.0, 20.0], ids=["2 um", "20 um"])
def test_a_crown_is_an_arc_drawn_on_the_face(tmp_path, crown):
    """The arc differs from the parabola by h/R squared, the meshes in the nodes of the end."""
    h, R = 1e-3 * crown, 10.0
    bulge = (R**2 + h**2) / (2.0 * h)
    arc = f"{{arc: [10, {h}], centre: [0, {bulge!r}], name: end}}"

    given = build_problem(case(tmp_path, f"crown: {crown} um"), silent).static
    drawn = build_problem(case(tmp_path, end=arc), silent).static

    load = 0.9 * min(given.max_force, drawn.max_force)
    loads = load * np.array([0.05, 0.2, 0.5, 1.0])
    approach = [np.interp(loads, s.force, s.approach) for s in (given, drawn)]
    assert approach[0] == pytest.approx(approach[1], rel=2e-3)


@pytest.mark.slow
def test_a_crown_presses_like_the_sphere_of_hertz(tmp_path):
    """Radius R^2 / (2 h) = 2.5 m; the contact takes 6 to 9 % of the radius of the face."""
    static = build_problem(case(tmp_path, "crown: 20 um", fine="0.1 mm"), silent).static
    modulus = 210e9 / (1.0 - 0.3**2) / 2.0

    loads = np.array([15.0, 50.0])
    widths = [static.half_width_at(load) for load in loads]

    assert widths == pytest.approx([point_radius(load, 0.4, modulus) for load in loads], rel=0.015)


@pytest.mark.parametrize("key", ["", "gap"], ids=["placed", "as drawn"])
def test_the_gap_counts_to_the_first_touch_of_the_form(tmp_path, key):
    """A ring of waves touches first on its crest, wherever the drawing has the faces."""
    form = "waviness: {amplitude: 2 um, wavelength: 20 mm, phase: 180 deg}"
    one = case(tmp_path, form, gap="3 um")
    if key:
        text = one.path.read_text().replace("  gap: 3 um\n", "").replace("[0, 40]", "[0, 40]")
        one.path.write_text(text)
        one = load_case(one.path)

    placed = place_bodies(one, silent)

    # as drawn the crest at the edge, 10 mm from the valley of the centre, touches already
    expected = 0.0 if key else 3e-6
    assert placed.case.contact.gap == pytest.approx(expected, abs=5e-9)


@pytest.mark.slow
def test_a_tilted_face_is_a_tilted_body(tmp_path):
    """Gaps of all points after first touch, against the body turned by motion.placement."""
    form = "reach: 5 um\ntilt: 0.001 deg\ntilt_direction: 90 deg"
    turned = ", placement: {tilt: 0.001 deg, tilt_direction: 270 deg}"
    given, placed = (
        build_problem(case(tmp_path, text, fine="2 mm", solid=True, more=more), silent).space
        for text, more in ((form, ""), ("reach: 5 um", turned))
    )

    assert np.ptp(given.gap) == pytest.approx(20e-3 * np.radians(0.001), rel=0.05)
    assert given.gap == pytest.approx(placed.gap, abs=1e-3 * np.ptp(given.gap))


@pytest.mark.slow
def test_gaps_of_a_placed_body_have_the_form(tmp_path):
    """At rest the exact gaps of off-axis runs are those of the contact points."""
    form = "crown: 1 um\nwaviness: {amplitude: 0.1 um, wavelength: 20 mm, direction: 30 deg}"
    problem = build_problem(case(tmp_path, form, fine="2 mm", solid=True), silent)

    gaps = exact_gaps(problem)(np.zeros(6))

    assert np.ptp(problem.space.gap) > 0.5e-6
    assert gaps == pytest.approx(problem.space.gap, abs=1e-12)


@pytest.mark.slow
def test_interface_level_and_full_order_have_the_same_crown(tmp_path):
    """Flat faces return at once; a crown of 10 um takes its time, at both levels alike."""
    levels = run_impact(
        case(tmp_path, "crown: 10 um"), levels=("interface", "full"), certify=False
    ).levels
    ours, full = (levels[name].measures for name in ("interface", "full"))
    assert ours.peak_force == pytest.approx(full.peak_force, rel=0.02)
    assert ours.contact_time == pytest.approx(full.contact_time, rel=0.01)
    assert abs(levels["full"].energy_residual) < 1e-10
    assert abs(levels["interface"].energy_residual) < 1e-10


@pytest.mark.parametrize(
    ("contact", "solid", "where", "hint"),
    [
        ("crown: 12 mm", False, "contact.crown", "face of radius 10"),
        ("crown: -1 um", False, "contact.crown", "0"),
        ("waviness: {amplitude: 1 um, wavelength: 0 mm}", False, "wavelength", "0"),
        ("waviness: {amplitude: -1 um, wavelength: 5 mm}", False, "amplitude", "0"),
        ("waviness: {amplitude: 1 mm, wavelength: 5 mm}", False, "amplitude", "slopes"),
        ("waviness: {amplitude: 1 nm, wavelength: 0.5 mm}", False, "wavelength", "per wave"),
        ("tilt: 0.01 deg", False, "contact.tilt", "swept"),
        ("tilt: 10 deg", True, "contact.tilt", "10 deg"),
        ("waviness: {amplitude: 1 um, wavelength: 9 mm, direction: 0 deg}", False, "direction", ""),
    ],
)
def test_a_form_that_does_not_fit_is_one_clear_error(tmp_path, contact, solid, where, hint):
    with pytest.raises(InputError) as caught:
        place_bodies(case(tmp_path, contact, solid=solid), silent)
    assert where in str(caught.value)
    assert hint in str(caught.value)


@pytest.mark.parametrize("key", ["crown: 1 um", "roughness: {curve: [[1 um, 1 MPa]]}"])
def test_a_deck_of_calculix_has_no_form(tmp_path, key):
    """It holds the meshes alone, which stay plane."""
    with pytest.raises(InputError, match="which the meshes do not contain"):
        calculix_impact(case(tmp_path, key, solid=True), silent)


STEEL = Material(name="steel", young=210e9, poisson=0.0, density=7850.0)
SAID = "of the faces meet all at once"


def rods(tmp_path: Path, *keys: str, speed: str = "1 m/s", levels: str = "[reduced, full]"):
    """The two rods that are shipped, 4 mm thick, with keys of their contact."""
    text = find_case("two-rods").read_text()
    lines = "".join(f"  {key}\n" for key in keys)
    text = text.replace("  gap: 0 um\n", f"  gap: 0 um\n{lines}")
    text = text.replace("speed: 1 m/s", f"speed: {speed}").replace("[reduced, full]", levels)
    path = tmp_path / "case.yaml"
    path.write_text(text)
    return load_case(path)


def said(study):
    return [note for note in study.warnings if SAID in note]


@pytest.fixture(scope="module")
def flat(tmp_path_factory):
    """The case of flat rods and its impact at levels with modes and without."""
    case = rods(tmp_path_factory.mktemp("flat"))
    return case, run_impact(case, levels=("reduced", "interface", "full"), certify=False)


def test_unequal_bodies_share_the_speed():
    """Aluminium on steel: p = v z_a z_b / (z_a + z_b)."""
    soft = Material(name="aluminium", young=70e9, poisson=0.0, density=2700.0)
    z = [np.sqrt(one.young * one.density) for one in (STEEL, soft)]

    assert front_pressure(3.0, STEEL, soft) == pytest.approx(3.0 * z[0] * z[1] / sum(z), rel=1e-12)


@pytest.mark.slow
def test_the_front_is_the_force_of_the_full_order(flat):
    """Poisson's ratio 0: the plateau of the rods is the front, rho c A v / 2 = 255 N."""
    case, study = flat
    area = area_at_once(build_problem(case, silent).space, 1e-9)
    history = study.levels["full"].history

    plateau = history.force[(history.time > 4e-6) & (history.time < 12e-6)].mean()

    assert area == pytest.approx(np.pi * 2e-3**2, rel=1e-6)
    assert area * front_pressure(1.0, STEEL, STEEL) == pytest.approx(plateau, rel=0.005)


@pytest.mark.slow
def test_flat_faces_are_told_of_at_levels_of_modes(flat):
    """One note, with the keys of a real face; the full order is not meant."""
    _, study = flat

    (note,) = said(study)
    assert "'reduced', 'interface'" in note
    assert "contact.crown" in note
    assert not any(SAID in doubt for doubt in study.levels["full"].doubts)


@pytest.mark.slow
def test_the_error_estimate_does_not_hide_them(tmp_path):
    study = run_impact(rods(tmp_path), levels=("reduced",))
    assert study.estimate_doubt
    assert study.reference == "reduced"  # not the run behind the estimate
    assert said(study)


@pytest.mark.slow
def test_a_form_that_the_modes_follow_is_not_told_of(tmp_path):
    """6 um close in 30 us at 0.2 m/s, forty shortest periods; 0.05 um in 0.25 us, a third."""
    deep = run_impact(
        rods(tmp_path, "crown: 6 um", speed="0.2 m/s"), levels=("interface",), certify=False
    )
    shallow = run_impact(
        rods(tmp_path, "crown: 0.05 um", speed="0.2 m/s"), levels=("interface",), certify=False
    )
    assert not said(deep)
    assert said(shallow)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["demo-valve-axisymmetric", "sphere-on-rod"])
def test_curved_faces_are_not_flat(name):
    assert not said(run_impact(load_case(find_case(name)), levels=("reduced",), certify=False))
