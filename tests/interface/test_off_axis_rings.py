"""Axisymmetric bodies off their axis: cases, and forces by sectors.

Cases of axisymmetric bodies off-axis: what runs, what is refused, and with which words.

Forces of contact points in sectors round a ring; truths: the whole force, a uniform pressure.
"""

from pathlib import Path

import numpy as np
import pytest
import yaml

from klack.analyses.impact.content import report_content
from klack.analyses.impact.run import run_impact
from klack.analyses.reduction.run import run_reduce
from klack.assembling.off_axis import off_axis_model, ring_contacts, turning_body
from klack.assembling.problem import build_problem
from klack.bodies.elasticity.eigen import eigenmodes
from klack.case import load_case
from klack.contact.mortar import contact_space
from klack.contact.rings import RingSpace
from klack.errors import InputError
from klack.machine.progress import silent
from klack.transient.impact_recorder import sector_shares
from klack.verification.ring_bodies import NeedleOnRing

CASE = Path(__file__).parents[2] / "docs/how-to/guided_needle.yaml"


def case_of(folder, change=lambda case: None, **placement):
    case = yaml.safe_load(CASE.read_text("utf-8"))
    del case["guide"], case["shots"]
    for body in case["bodies"].values():
        body["geometry"] = {**body["geometry"], "model": "axisymmetric"}
        del body["geometry"]["layers"]
    case["run"] = {"duration": "40 us", "levels": ["interface"]}
    case["motion"] = {"speed": "0.3 m/s", "placement": placement or {"eccentricity": "0.5 um"}}
    change(case)
    path = folder / "case.yaml"
    path.write_text(yaml.safe_dump(case), encoding="utf-8")
    return load_case(path)


def interface(case):
    return run_impact(case, levels=["interface"], certify=False)


@pytest.mark.slow
def test_an_impact_off_axis_has_points_all_round(tmp_path):
    study = interface(case_of(tmp_path))
    level = study.levels["interface"]
    record = level.pressure
    angle = np.degrees(np.arctan2(record.points[:, 1], record.points[:, 0])) % 360.0
    assert len(np.unique(np.round(angle, 6))) == 48
    assert not level.doubts
    assert abs(level.energy_residual) < 1e-10
    # it closes first on the side to which it is shifted
    force = record.point_force
    first = force[np.argmax(force.any(axis=1))] > 0
    assert np.all(np.cos(np.radians(angle[first])) > 0.9)
    titles = {section.title: section for section in report_content(study).sections}
    assert titles["Pressure in the contact"].picture is not None
    assert "centred bodies" in titles["Local contact law"].paragraphs[0]


@pytest.mark.slow
def test_direction_does_not_matter(tmp_path):
    """90 degrees are a whole number of 24 steps, 50 degrees are not."""

    def coarse(case):
        case["contact"]["angles"] = 24

    peaks = [
        float(
            interface(case_of(tmp_path, coarse, eccentricity="0.5 um", direction=f"{angle} deg"))
            .levels["interface"]
            .measures.peak_force
        )
        for angle in (0, 90, 50)
    ]
    assert peaks[1] == pytest.approx(peaks[0], rel=1e-7)
    assert peaks[2] == pytest.approx(peaks[0], rel=2e-3)


@pytest.mark.slow
def test_few_angles_that_carry_are_doubted(tmp_path):
    def coarse(case):
        case["contact"]["angles"] = 8

    level = interface(case_of(tmp_path, coarse, eccentricity="4 um")).levels["interface"]
    assert any("angles of the ring carry" in doubt for doubt in level.doubts)
    assert any("contact.angles:" in doubt for doubt in level.doubts)


@pytest.mark.parametrize("level", ["reduced", "full", "reduced-none"])
def test_other_levels_are_refused(tmp_path, level):
    with pytest.raises(InputError, match=f"level '{level}' of axisymmetric bodies off-axis"):
        run_impact(case_of(tmp_path), levels=[level])


def test_a_reduction_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"motion\.placement: got a reduction"):
        run_reduce(case_of(tmp_path))


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("outputs", [{"name": "a", "body": "needle", "at": ["1 mm", "8 mm"], "direction": "z",
                      "kind": "displacement"}], "sensors"),
        ("guide", {"surface": "shaft", "heights": ["3 mm", "7 mm"], "clearance": "3 um"}, "guide"),
    ],
)  # fmt: skip
def test_what_has_no_angle_is_refused(tmp_path, key, value, words):
    with pytest.raises(InputError, match=words):
        case_of(tmp_path, lambda case: case.update({key: value}))


def test_rough_faces_are_refused(tmp_path):
    def rough(case):
        case["contact"]["roughness"] = {"height": "0.4 um"}
        case["run"]["levels"] = ["full"]

    with pytest.raises(InputError, match="roughness"):
        case_of(tmp_path, rough)


def test_angles_of_solids_are_refused(tmp_path):
    def solid(case):
        case["contact"]["angles"] = 48
        for body in case["bodies"].values():
            body["geometry"].update(model="swept", layers=8)

    with pytest.raises(InputError, match="three dimensions"):
        case_of(tmp_path, solid)


def test_bodies_from_matrices_are_refused(tmp_path):
    case = case_of(tmp_path)
    given = case.bodies["needle"].model_copy(update={"matrices": object()})
    other = case.model_copy(update={"bodies": {**case.bodies, "needle": given}})
    with pytest.raises(InputError, match="axial motion"):
        turning_body(other, "needle", NeedleOnRing().bodies[0].mesh)


def test_a_contact_around_the_axis_has_no_ring():
    pair = NeedleOnRing()
    section = contact_space(*pair.sides, reach=pair.reach)
    central = section.points * [0.0, 1.0] + [1e-6, 0.0]
    object.__setattr__(section, "points", central)
    gap = np.repeat(section.gap[:, None], 8, axis=1)
    with pytest.raises(InputError, match="no ring for contact points"):
        RingSpace.within(section, gap, 1.0)


def test_points_at_the_border_are_marked():
    """Beside a point that was left out, on its ring and on the next one."""
    pair = NeedleOnRing()
    gap = np.repeat(pair.section.gap[:, None], 8, axis=1)
    gap[5, 3] = 1.0
    space = RingSpace.within(pair.section, gap, 1.0 - 1e-9)
    pairs = list(zip(space.ring.tolist(), space.turn.tolist(), strict=True))
    at = {pair for pair, rim in zip(pairs, space.rim, strict=True) if rim}
    assert {(5, 2), (5, 4)} <= at
    assert (5, 3) not in pairs
    assert sum(j == 3 for _, j in at) >= 2
    assert space.beyond <= 1.0
    assert space.area.sum() == pytest.approx(pair.section.area.sum() - pair.section.area[5] / 8)


@pytest.mark.slow
def test_a_touch_away_from_the_finest_mesh_is_told(tmp_path):
    study = interface(case_of(tmp_path, eccentricity="25 um"))
    assert any("away from its finest mesh" in text for text in study.warnings)


@pytest.mark.slow
def test_both_stops_stand_at_their_gap_from_the_tilted_body(tmp_path):
    """The gap of the upper stop counts from the body where it starts, as for solids."""

    def between_stops(case):
        edges = [
            {"arc": [1.2, 8.1], "centre": [1.0, 8.7], "name": "ridge"},
            {"line": [1.4, 8.1], "name": "under"},
            {"line": [1.4, 9.0], "name": "side"},
            {"line": [0.8, 9.0], "name": "top"},
            {"close": True, "name": "hole"},
        ]
        profile = {"unit": "mm", "parts": {"plate": {"start": [0.8, 8.1], "edges": edges}}}
        case["bodies"]["plate"] = {
            "geometry": {"model": "axisymmetric", "profile": profile},
            "material": "steel",
            "mesh": {"size": "0.5 mm", "contact": {"size": "0.03 mm", "extent": "0.1 mm"}},
            "fixed": [{"surface": "top"}],
        }
        case["opposite"] = {"between": ["plate.ridge", "needle.top"], "gap": "3 um"}

    case = case_of(tmp_path, between_stops, eccentricity="0.5 um", tilt="0.05 deg")
    with build_problem(case, silent) as problem:
        seat, stop = ring_contacts(problem, case.motion.placement, 16, problem.space.reach)
        kept = {body.name: eigenmodes(body, count=4) for body in problem.bodies}
        model = off_axis_model(problem, kept, [seat, stop])
    for contact, gap in ((seat, 1e-6), (stop, 3e-6)):
        assert np.min(contact.space.gap / contact.space.axial) == pytest.approx(gap, abs=2e-12)
        assert np.ptp(contact.space.gap[contact.space.ring == contact.space.ring[0]]) > 0.1e-6
    assert [name for name, _, _ in model.contacts] == ["contact", "opposite"]
    assert model.checks.static_limit < 1e-11
    # a push at one end moves the gap at the other: both act on the needle
    (_, a, b), (_, c, d) = model.contacts
    assert np.abs(model.compliance[a:b, c:d]).max() > 0.0


RADIUS = 1.6e-3  # [m]


def ring(angles):
    return np.column_stack([RADIUS * np.cos(angles), RADIUS * np.sin(angles), 0.0 * angles])


@pytest.mark.parametrize("columns", [7, 24, 36, 200])
def test_every_force_is_shared_out_whole(columns):
    rng = np.random.default_rng(1)
    points = ring(rng.uniform(0.0, 2.0 * np.pi, columns))
    force = rng.uniform(0.0, 5.0, columns)

    shares = sector_shares(points, rng.uniform(1.0, 2.0, columns))

    assert shares.shape == (36, columns)
    assert shares.min() >= 0.0
    assert float((shares @ force).sum()) == pytest.approx(force.sum(), rel=1e-13)


def test_uniform_pressure_on_alternating_areas_is_a_uniform_line_load():
    # corners and middles of sides of 12 quadratic elements: weights 1 to 2
    angles = np.repeat(2.0 * np.pi / 24 * np.arange(24), 3)  # three points across the ring
    area = np.repeat(np.where(np.arange(24) % 2 == 0, 1.0, 2.0), 3)

    load = sector_shares(ring(angles), area) @ (5.0 * area)

    np.testing.assert_allclose(load, 5.0 * area.sum() / 36, rtol=1e-12)


def test_a_force_lies_in_the_sector_of_its_angle():
    angles = 2.0 * np.pi / 72 * np.arange(72) + 1e-3
    force = np.zeros(72)
    force[20] = 3.0  # at 100 degrees, columns 5 degrees wide

    load = sector_shares(ring(angles), np.ones(72)) @ force

    assert load[9] + load[10] == pytest.approx(3.0, rel=1e-12)  # 90 to 110 degrees
    assert np.degrees(np.angle(load @ np.exp(1j * np.radians(5 + 10 * np.arange(36))))) == (
        pytest.approx(100.0, abs=3.0)
    )


def test_columns_on_both_sides_of_the_x_axis_are_one():
    points = ring(np.array([0.0, np.pi / 2, np.pi, 3 * np.pi / 2, 0.0]))
    points[4, 1] = -1e-20  # round-off: an angle just below a whole turn

    shares = sector_shares(points, np.array([0.5, 1.0, 1.0, 1.0, 0.5])).toarray()

    np.testing.assert_allclose(shares[:, 0], shares[:, 4])
    assert shares[0, 0] == pytest.approx(1 / 9) == shares[35, 0]
