"""Crown, waviness and tilt of faces that are drawn plane.

Truth: the same form drawn as geometry, or as a rigid placement (exact to the square of the slope);
Hertz (1882) on the sphere that a crown is (exact for a contact small against its face).
"""

from math import pi

import numpy as np
import pytest

from klack.analyses.impact.interface_level import exact_gaps
from klack.analyses.impact.run import run_impact
from klack.assembling.problem import build_problem, place_bodies
from klack.case import load_case
from klack.contact.face_form import FaceForm, Waves
from klack.contact.hertz import point_radius
from klack.errors import InputError
from klack.exchange.calculix_case import calculix_impact
from klack.progress import silent

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
    with pytest.raises(InputError, match="which the meshes do not have"):
        calculix_impact(case(tmp_path, key, solid=True), silent)
