"""Friction between the faces in a case: keys, levels, record and page.

Truth: the full order on the same meshes (reference); the interface level without friction (exact).
"""

import numpy as np
import pytest

from klack.analyses.impact.content import report_content
from klack.analyses.impact.pressure_view import friction_views
from klack.analyses.impact.run import run_impact
from klack.case import find_case, load_case
from klack.errors import InputError

pytestmark = pytest.mark.slow

LEVELS = "levels: [lumped, reduced-none, reduced-attachment, reduced, full]"


def case(tmp_path, levels="[interface]", **contact):
    """The axisymmetric demo valve with keys of its contact."""
    keys = "".join(f"  {key}: {value}\n" for key, value in contact.items())
    text = find_case("demo-valve-axisymmetric").read_text()
    text = text.replace("  gap: 0 um\n", f"  gap: 0 um\n{keys}")
    path = tmp_path / "case.yaml"
    path.write_text(text.replace(LEVELS, f"levels: {levels}"))
    return load_case(path)


def impact(case, **options):
    return run_impact(case, levels=case.run.levels, **options)


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    return impact(case(tmp_path_factory.mktemp("case"), "[interface, full]", friction=0.1))


def test_interface_level_and_full_order_rub_alike(both):
    ours, full = both.levels["interface"], both.levels["full"]
    assert ours.measures.peak_force == pytest.approx(full.measures.peak_force, rel=0.005)
    assert ours.measures.contact_time == pytest.approx(full.measures.contact_time, rel=0.01)
    assert ours.measures.restitution == pytest.approx(full.measures.restitution, abs=0.002)
    assert both.deviations["interface"].history_l2 < 0.01
    lost = [level.energies["friction"] for level in (ours, full)]
    assert lost[0] == pytest.approx(lost[1], rel=0.01)
    assert abs(ours.energy_residual) < 1e-12


@pytest.mark.parametrize("friction", [0.05, 0.3])
def test_so_they_do_with_less_and_more_of_it(tmp_path, friction):
    found = impact(case(tmp_path, "[interface, full]", friction=friction), certify=False).levels
    ours, full = found["interface"].measures, found["full"].measures
    assert ours.peak_force == pytest.approx(full.peak_force, rel=0.005)
    assert ours.contact_time == pytest.approx(full.contact_time, rel=0.01)
    assert ours.restitution == pytest.approx(full.restitution, abs=0.002)


@pytest.mark.parametrize(("static", "doubted"), [(0.11, False), (0.5, True)])
def test_jumps_that_depend_on_the_step_are_told(tmp_path, static, doubted):
    """A step shorter by the square root of 2 gives another restitution, or the same."""
    mine = case(tmp_path, friction=0.1, static_friction=static, stribeck_speed="0.02 m/s")
    level = impact(mine, certify=False).levels["interface"]
    step = mine.run.interface_step / np.sqrt(2)
    other = impact(
        mine.model_copy(update={"run": mine.run.model_copy(update={"interface_step": step})}),
        certify=False,
    ).levels["interface"]
    assert (abs(other.measures.restitution - level.measures.restitution) > 0.002) == doubted
    assert any("depend on the step" in doubt for doubt in level.doubts) == doubted


def test_the_record_tells_what_the_impact_would_be_without(both, tmp_path):
    smooth = impact(case(tmp_path)).levels["interface"]
    told = both.levels["interface"].frictionless
    assert told.peak_force == smooth.measures.peak_force
    assert told.restitution == smooth.measures.restitution
    assert smooth.frictionless is None
    assert "friction" not in smooth.energies


def test_points_hold_no_more_than_their_share(both):
    for level in ("interface", "full"):
        record = both.levels[level].pressure
        rubbed = np.abs(record.friction.force[:, 0])
        # means over a step, of which the first and the last repay energy by pressure alone
        assert np.all(rubbed <= 0.1 * record.point_force * (1 + 1e-4) + 1e-3 * rubbed.max())
        assert set(np.unique(record.friction.doing)) == {0, 1, 2}


def test_page_shows_where_faces_stick_and_what_friction_costs(both, tmp_path):
    titles = [section.title for section in report_content(both).sections if section.tables]
    assert "Friction between the faces" in titles
    assert len(friction_views(both)) == 2
    smooth = impact(case(tmp_path))
    titles = [section.title for section in report_content(smooth).sections]
    assert "Friction between the faces" not in titles


def test_static_friction_holds_more_than_kinetic(tmp_path):
    plain = impact(case(tmp_path, friction=0.1)).levels["interface"]
    held = impact(case(tmp_path, friction=0.1, static_friction=0.3)).levels["interface"]
    # an inert speed of Stribeck's curve, 1 km/s, holds the static value at any speed of slip
    slow = impact(
        case(tmp_path, friction=0.1, static_friction=0.3, stribeck_speed="1000 m/s")
    ).levels["interface"]
    static = impact(case(tmp_path, friction=0.3)).levels["interface"]
    assert held.measures.restitution != plain.measures.restitution
    assert slow.measures.restitution == pytest.approx(static.measures.restitution, abs=1e-4)
    assert slow.measures.peak_force == pytest.approx(static.measures.peak_force, rel=1e-3)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"friction": -0.1}, ["contact.friction", "-0.1"]),
        ({"friction": 20}, ["contact.friction", "20"]),
        ({"friction": "abc"}, ["contact.friction", "abc"]),
        ({"friction": 0.3, "static_friction": 0.1}, ["static_friction", "0.1", "0.3"]),
        ({"friction": 0.1, "stribeck_speed": "-1 m/s"}, ["stribeck_speed"]),
        ({"friction": 0.1, "stribeck_speed": "1 mm"}, ["stribeck_speed", "mm"]),
    ],
)
def test_bad_coefficients_are_one_error(tmp_path, keys, words):
    with pytest.raises(InputError) as error:
        case(tmp_path, **keys)
    assert all(word in str(error.value) for word in words)


def test_a_seat_that_holds_the_needle_ends_with_an_answer(tmp_path):
    # more than the tangent of the half angle: self-locking
    level = impact(case(tmp_path, friction=2.0)).levels["interface"]
    assert abs(level.energy_residual) < 1e-9
    assert level.energies["friction"] < 1e-3 * level.energies["initial kinetic"]
    assert np.isfinite(level.measures.peak_force)


def test_flat_faces_round_the_axis_rub_too(tmp_path):
    """A hat at the axis cannot slip; Poisson's ratio 0 and flat faces: there is nothing to lose."""
    text = find_case("two-rods").read_text().replace("contact:\n", "contact:\n  friction: 0.2\n", 1)
    path = tmp_path / "case.yaml"
    path.write_text(text)
    level = run_impact(load_case(path), levels=("interface",), certify=False).levels["interface"]
    smooth = level.frictionless
    assert level.energies.get("friction", 0.0) < 1e-6 * level.energies["initial kinetic"]
    assert level.measures.impulse == pytest.approx(smooth.impulse, rel=1e-4)
