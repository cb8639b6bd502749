"""Layer of asperities between rough faces.

Truth: integrals of Greenwood & Williamson in closed form (exact), one point in series with a spring
(exact), rods and a needle at the full order (conservation, reference).  The contact points of the
interface level alone: ``test_rough_points.py``.
"""

from math import gamma, pi, sqrt

import numpy as np
import pytest

from klack.analyses.impact.run import run_impact
from klack.assembling.problem import build_problem
from klack.case import find_case, load_case
from klack.contact.asperity_layer import AsperityLayer, press, summit_integral
from klack.errors import InputError
from klack.machine.progress import silent

SUMMITS = "roughness: {rms: 0.2 um, asperity_radius: 50 um}"
SOFT = "roughness: {curve: [[0.3 um, 1 MPa], [0.6 um, 4 MPa], [1.2 um, 16 MPa]]}"


def layer(**changed):
    given = {"rms": 0.2e-6, "radius": 50e-6, "density": 0.05, "modulus": 115e9}
    return AsperityLayer.of_summits(**{**given, **changed})


def rods(tmp_path, *keys, speed="1 m/s", levels="[reduced, full]"):
    """The two rods that are shipped, 4 mm thick, with keys of their contact."""
    text = find_case("two-rods").read_text()
    lines = "".join(f"  {key}\n" for key in keys)
    text = text.replace("  gap: 0 um\n", f"  gap: 0 um\n{lines}")
    text = text.replace("speed: 1 m/s", f"speed: {speed}").replace("[reduced, full]", levels)
    path = tmp_path / f"case{len(list(tmp_path.iterdir()))}.yaml"
    path.write_text(text)
    return load_case(path)


def test_summits_on_a_normal_law():
    """At h = 0: 2^(1/4) Gamma(5/4) / sqrt(2 pi); far below the mean all carry: (-h)^(3/2)."""
    at_mean, deep = summit_integral(np.array([0.0, -8.0]))

    assert at_mean == pytest.approx(2.0**0.25 * gamma(1.25) / sqrt(2.0 * pi), rel=1e-10)
    # second order: E[(s - h)^1.5] = (-h)^1.5 (1 + 3/8 / h^2 + ...)
    assert deep == pytest.approx(8.0**1.5 * (1.0 + 3.0 / 8.0 / 64.0), rel=2e-4)


def test_pressure_at_the_mean_plane_is_that_of_greenwood_and_williamson():
    one = layer()
    expected = 4.0 / 3.0 * 0.05 * 115e9 * sqrt(0.2 / 50.0) * 0.4300

    assert one.closure_at(expected) == pytest.approx(4.0 * 0.2e-6, rel=1e-3)


def test_pressure_is_the_slope_of_the_energy():
    one = layer()
    closure = 0.5 * (one.closure[1:] + one.closure[:-1])[20:]
    h = 1e-11

    pressure, slope, _ = one.state(closure)
    change = [one.state(closure + sign * h) for sign in (-1.0, 1.0)]

    assert pressure == pytest.approx((change[1][2] - change[0][2]) / (2.0 * h), rel=1e-5)
    assert slope == pytest.approx((change[1][0] - change[0][0]) / (2.0 * h), rel=1e-5)


def test_the_mean_pressure_does_the_work_of_a_step():
    """From an open point into the layer and back: p (c1 - c0) = U(c1) - U(c0)."""
    one = layer()
    ends = np.array([-0.5e-6, 0.3e-6, 0.9e-6, 0.90000001e-6, 1.7e-6, 0.1e-6, -1e-6])

    mean, _ = one.mean_pressure(ends[1:], ends[:-1])

    energy = one.state(ends)[2]
    worst = np.abs(mean * np.diff(ends) - np.diff(energy)).max()
    assert worst < 1e-12 * energy.max()


def test_a_point_on_a_spring_takes_the_series_of_both():
    """The approach is C P + h(P / A), whatever the force."""
    one, area, C = layer(), 1e-6, 2e-9
    for force in (0.01, 1.0, 30.0):
        approach = C * force + one.closure_at(force / area)
        found, gap = press(one, np.array([area]), np.array([[C]]), np.array([-approach]))
        assert found == pytest.approx([force], rel=1e-9)
        assert -gap == pytest.approx([one.closure_at(force / area)], rel=1e-9)


@pytest.mark.slow
def test_the_ladder_of_two_rods_is_bodies_and_layer_in_series(tmp_path):
    """Poisson's ratio 0 and matched faces: the pressure is even, its compliances add."""
    smooth = build_problem(rods(tmp_path), silent).static
    problem = build_problem(rods(tmp_path, SUMMITS), silent)
    rough = problem.static
    area = pi * 2e-3**2

    forces = np.array([2.0, 20.0, 100.0, 300.0])
    # the ladder itself is solved again at these forces: its own states are far apart
    for force in forces:
        closure = problem.pair.layer.closure_at(force / area)
        approach = np.interp(force, smooth.force, smooth.approach) + closure
        q = rough.space.gap - approach * rough.space.axial
        found, _ = press(problem.pair.layer, rough.space.area, rough.compliance, q)
        assert rough.space.axial @ found == pytest.approx(force, rel=1e-3)


LEVELS = ("reduced", "interface", "full")


@pytest.fixture(scope="module", params=[(SOFT,), (SUMMITS, "crown: 1 um")], ids=["flat", "crowned"])
def study(request, tmp_path_factory):
    """One impact of rough rods at all levels: both kinds of layer, flat and crowned faces."""
    case = rods(tmp_path_factory.mktemp("rods"), *request.param, speed="0.2 m/s")
    return run_impact(case, levels=LEVELS, certify=False)


@pytest.mark.slow
def test_energy_of_the_layer_comes_back(study):
    for level in study.levels.values():
        assert abs(level.energy_residual) < 1e-10
    full = study.levels["full"]
    assert full.energies["contact"] == 0.0
    assert abs(full.energies["contact dissipation"]) < 1e-6 * full.energies["initial kinetic"]


@pytest.mark.slow
def test_the_ledger_closes_while_the_layer_is_pressed(tmp_path):
    case = rods(tmp_path, SOFT, speed="0.2 m/s")
    short = case.model_copy(update={"run": case.run.model_copy(update={"duration": 10e-6})})
    levels = run_impact(short, levels=("interface", "full"), certify=False).levels
    held = []
    for level in levels.values():
        held.append(level.energies["contact"] / level.energies["initial kinetic"])
        assert held[-1] > 0.01
        assert abs(level.energy_residual) < 1e-10
    # the static remainder of the modes is part of the contact at the interface level only
    assert held[0] == pytest.approx(held[1], rel=0.2)


@pytest.mark.slow
def test_rough_rods_are_the_same_at_all_levels(study):
    """Within 2 % of the full order in plateau, length and rise; the interface level in 0.3 %."""
    reduced, interface, full = (pulse(study.levels[name].history) for name in LEVELS)

    assert reduced == pytest.approx(full, rel=0.02)
    assert interface[:2] == pytest.approx(full[:2], rel=3e-3)
    assert interface[2] == pytest.approx(full[2], rel=0.02)  # two of its steps are 1.5 %


def pulse(history):
    """Plateau [N], length at half of it [s] and rise from 0.1 to 0.9 of it [s]."""
    time, force = history.time, history.force
    plateau = force[(time > 6e-6) & (time < 14e-6)].mean()
    low, half, high = (time[np.argmax(force > share * plateau)] for share in (0.1, 0.5, 0.9))
    end = time[(force > 0.5 * plateau) & (time < 25e-6)][-1]
    return plateau, end - half, high - low


@pytest.mark.slow
def test_a_rough_needle_is_the_same_at_all_levels(tmp_path):
    """Ring on a cone: the layer takes 7 % of the peak; all levels within 0.2 % of each other."""
    names = ("reduced", "interface", "full")
    levels = run_impact(needle(tmp_path, SUMMITS), levels=names, certify=False).levels

    full = levels["full"].measures
    for name in names[:2]:
        ours = levels[name].measures
        assert ours.peak_force == pytest.approx(full.peak_force, rel=2e-3)
        assert ours.contact_time == pytest.approx(full.contact_time, rel=2e-3)
        assert ours.restitution == pytest.approx(full.restitution, abs=1e-3)
    assert full.peak_force == pytest.approx(115.2, rel=0.01)  # smooth: 123.4 N


def needle(tmp_path, *keys, more=("", "")):
    """The demo valve in its meridian plane, with keys of its contact."""
    text = find_case("demo-valve-axisymmetric").read_text()
    lines = "".join(f"  {key}\n" for key in keys)
    path = tmp_path / "needle.yaml"
    path.write_text(text.replace("  gap: 0 um\n", f"  gap: 0 um\n{lines}").replace(*more))
    return load_case(path)


@pytest.mark.slow
def test_rough_faces_out_of_square_are_as_at_the_full_order(tmp_path):
    """Swept rods, tilt of 0.01 deg: first touch at one side; peak within 0.5 %."""
    text = find_case("two-rods").read_text().replace("size: 0.5 mm", "size: 1 mm")
    text = text.replace("model: axisymmetric", "model: swept\n      layers: 8")
    for word, count in (("30", 40), ("60", 80)):
        text = text.replace(f"participation: {word}, pool: 120", f"count: {count}")
    text = text.replace("  gap: 0 um\n", f"  gap: 0 um\n  {SUMMITS}\n  tilt: 0.01 deg\n")
    text = text.replace("speed: 1 m/s", "speed: 0.2 m/s").replace("full_step: 20", "full_step: 80")
    path = tmp_path / "tilted.yaml"
    path.write_text(text)

    levels = run_impact(load_case(path), levels=("interface", "full"), certify=False).levels

    ours, full = (levels[name].measures for name in ("interface", "full"))
    assert ours.peak_force == pytest.approx(full.peak_force, rel=5e-3)
    assert ours.contact_time == pytest.approx(full.contact_time, rel=1e-3)
    assert ours.restitution == pytest.approx(full.restitution, abs=1e-3)
    assert abs(levels["interface"].energy_residual) < 1e-12


def test_drawn_friction_beside_roughness_is_one_clear_error(tmp_path):
    """Shots and guides have the layer; friction between the faces that is drawn has not."""
    text = find_case("demo-shots").read_text()
    rough = text.replace("  gap: 2 um\n", f"  gap: 2 um\n  {SUMMITS}\n")
    path = tmp_path / "shots.yaml"
    path.write_text(rough)
    assert load_case(path).contact.roughness is not None

    drawn = "  contact_friction: {uniform: [0.1, 0.2]}\n"
    path.write_text(rough.replace("shots:\n", f"shots:\n{drawn}"))
    with pytest.raises(InputError, match=r"contact\.roughness") as caught:
        load_case(path)
    assert "shots.contact_friction" in str(caught.value)


@pytest.mark.slow
def test_an_estimate_of_errors_has_the_roughness(tmp_path):
    """It takes the interface level: of the reduced one, the full order says less than 0.2 %."""
    study = run_impact(needle(tmp_path, SUMMITS), levels=("reduced",))

    assert not study.estimate_doubt
    assert abs(study.estimates["reduced"].peak_force) < 2e-3


@pytest.mark.slow
def test_yield_beside_roughness_is_left_out_and_said(tmp_path):
    steel = ("density: 7850 kg/m^3}", "density: 7850 kg/m^3, yield: 400 MPa}")
    study = run_impact(needle(tmp_path, SUMMITS, more=steel), levels=("interface",), certify=False)

    told = [note for note in study.warnings if "contact.roughness" in note]
    assert len(told) == 1
    assert "yield" in told[0]
    assert study.levels["interface"].energies.get("plastic", 0.0) == 0.0


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("roughness: {rms: 0 um, asperity_radius: 50 um}", "rms"),
        ("roughness: {rms: -1 um, asperity_radius: 50 um}", "rms"),
        ("roughness: {rms: 50 um, asperity_radius: 0.2 um}", "tenth of the radius"),
        ("roughness: {rms: 0.2 um}", "without 'asperity_radius'"),
        ("roughness: {}", "without 'rms'"),
        ("roughness: {rms: 0.2 um, curve: [[1 um, 1 MPa]]}", "together with a measured 'curve'"),
        ("roughness: {curve: []}", "rise"),
        ("roughness: {curve: [[1 um, 2 MPa], [2 um, 1 MPa]]}", "rise"),
        ("roughness: {curve: [[1 um, 0 MPa]]}", "rise"),
        (f"{SUMMITS}\n  friction: 0.1", "contact.friction"),
    ],
)
def test_a_roughness_that_cannot_be_is_one_clear_error(tmp_path, key, said):
    with pytest.raises(InputError, match=r"contact\.roughness") as caught:
        rods(tmp_path, key)
    assert said in str(caught.value)
