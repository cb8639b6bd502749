"""Strokes of finite-element bodies in three dimensions.

A stroke of finite-element bodies in three dimensions.

Truth: the axial stroke of the same bodies where the needle is centred; the interface level for one
drop; the same numbers after storing; the run in one part.

A stroke of finite-element bodies whose magnet and seat act across the axis.

Truth: the closed permeance of the ring and area of the seat at the placement of every record; the
same stroke without these keys where the needle is centred; the energy balance.

A three-dimensional stroke of half sections, without a mesh of three dimensions.

Truth: the axial stroke of the same half sections where the needle is centred; the first impact of
the interface level from the same placement; the same bodies as solids of many layers; the run in
one part.
"""

import warnings
from dataclasses import replace
from math import hypot
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.impact.run import run_impact
from klack.analyses.stroke.analysis import STROKE
from klack.analyses.stroke.axis import axis_over_time_chart, axis_path_chart
from klack.analyses.stroke.content import stroke_content
from klack.analyses.stroke.run import run_stroke, stop_summaries, variant_network
from klack.analyses.stroke_shots.run import run_stroke_shots
from klack.assembling.valve import build_valve
from klack.case import read_case
from klack.case.any_case import read_valve_case
from klack.errors import AccuracyWarning, InputError
from klack.hydraulics.off_axis_seat import SeatFace, flow_area
from klack.magnetics.off_axis_gap import guide_ring
from klack.mechanics.force import ConstantForce
from klack.mechanics.spring import Spring
from klack.simulation.network_run import simulate_network
from klack.transient.interface_run import simulate_interface
from klack.transient.ring_arcs import ArcWatch, RingArcs

CASE = Path(__file__).parents[2] / "docs" / "how-to" / "stroke_off_axis.yaml"
SPACE = CASE.read_text(encoding="utf-8")
GUIDE = next(line + "\n" for line in SPACE.splitlines() if line.startswith("guide:"))


def stroke(text, **more):
    return run_stroke(read_valve_case(text, CASE), **more)


@pytest.mark.slow
def test_a_centred_needle_makes_the_axial_stroke():
    centred = SPACE.replace("placement: {seed: 3}\n", "").replace("400 us,", "200 us,")
    axial = centred.replace("motion: three-dimensional\n", "").replace(GUIDE, "")

    ours, theirs = (stroke(text).reference.result.events[0] for text in (centred, axial))

    assert ours.stop == theirs.stop == "opening"
    # the law of the stop has the pattern of 40 N only: 5e-5 on a finer mesh
    assert ours.peak_force == pytest.approx(theirs.peak_force, rel=2e-3)
    assert ours.restitution == pytest.approx(theirs.restitution, abs=5e-3)
    assert ours.time == pytest.approx(theirs.time, rel=2e-3)  # it starts 40 nm less deep


@pytest.mark.slow
def test_a_centred_needle_rubs_as_the_law_along_the_axis_does():
    """Static loops with friction give that law; a contact of few elements, so only nearly."""
    rubs = SPACE.replace("placement: {seed: 3}\n", "").replace("400 us, v", "760 us, v")
    for force in ("20 N", "40 N"):
        assert rubs.count(f"force: {force}}}") == 1
        rubs = rubs.replace(f"force: {force}}}", f"force: {force}, friction: 0.1}}")
    axial = rubs.replace("motion: three-dimensional\n", "").replace(GUIDE, "")

    ours, theirs = (stroke(text).reference.result for text in (rubs, axial))

    for one, other in zip(ours.events[:2], theirs.events[:2], strict=True):
        assert one.stop == other.stop
        assert one.restitution == pytest.approx(other.restitution, abs=8e-3)
        assert one.peak_force == pytest.approx(other.peak_force, rel=3e-2)
    lost, expected = ours.books.losses["seat friction"], theirs.books.losses["seat contact"]
    assert lost == pytest.approx(expected, rel=0.2)
    assert lost > 3e-2 * ours.books.scale
    assert abs(ours.books.residual) < 1e-11 * ours.books.scale


@pytest.mark.slow
def test_a_drop_of_bodies_that_rub_is_that_of_the_interface_level():
    """Off-axis and tilted, on the same contact points and gaps, without drive and guide."""
    text = SPACE.replace("force: 20 N}", "force: 20 N, friction: 0.15}")
    valve = build_valve(read_valve_case(text, CASE), threads=1)
    placed = np.array([1e-6, -0.5e-6, 12e-6, 1e-4, 2e-4, 0.0])
    spatial = replace(valve.spatial, placement=placed, guide=None, gaps=None)
    parts = dict(valve.network.components)
    parts["needle"] = parts["needle"].model_copy(update={"speed": -0.5})
    parts |= {
        "spring": Spring(stiffness=1e-3, preload=0.0),
        "magnet": ConstantForce(force=0.0),
    }
    alone = simulate_interface(
        spatial.model, speed=0.5, offset=placed, duration=70.4e-6, step=20e-9
    )

    run = simulate_network(
        valve.network.with_components(parts).rows(),
        duration=70.4e-6,
        step=20e-9,
        record=1.28e-6,
        start="free",
        coarse=1,
        spatial=spatial,
    )

    (hit,) = run.events
    assert hit.peak_force == pytest.approx(float(alone.history.force.max()), rel=1e-8)
    assert run.books.losses["seat friction"] == pytest.approx(alone.energy.friction, rel=1e-8)
    scale = np.array([1.0, 1.0, 1.0, 1e2, 1e2, 1e2])
    after = alone.motion.velocity[-1]
    np.testing.assert_allclose(run.path.velocity[-1] / scale, after / scale, atol=1e-9)


@pytest.mark.slow
def test_a_stored_stroke_is_the_same_and_goes_on(tmp_path):
    whole = stroke(SPACE)
    first = stroke(SPACE.replace("400 us, v", "99.84 us, v"))
    STROKE.save(first, tmp_path)
    loaded = STROKE.load(tmp_path)
    after = stroke(SPACE.replace("400 us, v", "300.8 us, v"), after=loaded)

    assert STROKE.to_json(loaded) == STROKE.to_json(first)
    result = after.reference.result
    begin = len(first.reference.result.time) - 1
    for name, channel in whole.reference.result.channels.items():
        scale = float(np.abs(channel.values).max())
        expected = channel.values[begin : begin + 40]  # up to the stop
        np.testing.assert_allclose(
            result.channels[name].values[:40], expected, rtol=1e-9, atol=1e-12 * scale
        )
    told = STROKE.to_json(whole)
    assert told["motion"] == "three-dimensional"
    for event in told["events"]:
        assert abs(event["axis"]["tilt_x_rad"]) < 8e-6 / 9e-3 * 1.3  # bore, and what it gives
    assert [panel.y.label for panel in axis_path_chart(whole).panels] == ["y at 13 mm", "y at 4 mm"]
    assert len(axis_over_time_chart(whole).panels) == 3


@pytest.mark.slow
def test_a_needle_has_to_fit_into_its_guide():
    off = SPACE.replace("{seed: 3}", "{eccentricity: 5 um}").replace("400 us,", "20 us,")
    with pytest.raises(InputError, match="off-axis in its guide"):
        stroke(off)
    beside = SPACE.replace("[4 mm, 13 mm]", "[4 mm, 25 mm]").replace("400 us,", "20 us,")
    with pytest.raises(InputError, match="height"):
        stroke(beside)


CASE_SIDE = Path(__file__).parents[2] / "docs" / "how-to" / "guided_magnet.yaml"
TEXT = CASE_SIDE.read_text(encoding="utf-8")
SHOTS = "shots: {count: 50, seed: 1}\n"
PLACED = "placement: {seed: 3}\n"


def stroke_side(*changes):
    text = TEXT.replace("duration: 1 ms", "duration: 300 us").replace("[wet, dry]", "[wet]")
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return run_stroke(read_valve_case(text, CASE_SIDE))


@pytest.mark.slow
def test_a_magnet_pulls_the_needle_of_a_stroke_aside():
    study = stroke_side((SHOTS, PLACED))
    result = study.reference.result

    told = {name: channel.values for name, channel in result.channels.items()}
    low, high = (np.column_stack([told[f"guide {k} {a}"] for a in "xy"]) for k in (1, 2))
    slope = (high - low) / 9e-3
    # the records of guides are those of the same moments; the flux of the first is of a step before
    for k in range(20, len(result.time), 40):
        middle = low[k] + slope[k] * (16.75e-3 - 4e-3) - (20e-6, 0.0)
        P, slopes = guide_ring(5e-3, 5.2e-3, 3.5e-3, [*middle, *-slope[k]])
        pull = 0.5 * told["coil flux"][k] ** 2 / P**2 * slopes[:2]
        side = [told[f"coil side force {a}"][k] for a in "xy"]
        np.testing.assert_allclose(side, pull, rtol=1e-4, atol=1e-5 * hypot(*pull))
    assert max(-told["coil side force x"]) > 1.0  # [N], away from the axis of the bore
    aside = np.mean(told["guide 2 x"][-100:])
    assert aside < -2e-6  # so it is held at that side of its guide
    face = SeatFace(shape="ball", radius=0.884e-3, angle=float(np.arccos(0.884 / 1.25)))
    k = len(result.time) - 60
    lift = told["restriction lift"][k]
    offset = low[k] + slope[k] * (-0.884e-3 - 4e-3)
    assert told["restriction area"][k] == pytest.approx(
        min(flow_area(face, [lift, *offset, *-slope[k]]), 0.25 * np.pi * 0.9e-3**2), rel=1e-6
    )
    assert abs(result.books.relative_residual) < 1e-8
    assert result.books.supplies["coil side force"] != 0.0
    assert [panel.y.label for panel in axis_over_time_chart(study).panels][-1] == "side force"
    limits = dict(stroke_content(study).limits)
    assert "only 'coil' and 'restriction' also act across the axis" in limits["Contact"]


@pytest.mark.slow
def test_a_centred_stroke_is_that_without_side_forces():
    ring, seat = "          off_axis: {height: 16.75 mm", "      off_axis: {height: -0.884 mm}\n"
    ours = stroke_side((", eccentricity: 20 um", ""))
    plain = stroke_side((ring + ", eccentricity: 20 um}\n", ""), (", tilts: true", ""), (seat, ""))

    first, same = (study.reference.result.events[0] for study in (ours, plain))
    assert "restriction side force x" not in plain.reference.result.channels
    assert first.time == pytest.approx(same.time, rel=1e-10)
    # 1e-12 N more preload changes the peak by 5e-7 without them, 1e-10 N by 1.4e-5
    assert first.peak_force == pytest.approx(same.peak_force, rel=1e-4)
    assert first.restitution == pytest.approx(same.restitution, rel=1e-4)
    assert "off_axis and tilts" in dict(stroke_content(plain).limits)["Contact"]


@pytest.mark.slow
def test_a_height_beside_the_needle_is_refused():
    with pytest.raises(InputError, match=r"z = 40 mm.*-1.25 mm to 18.5 mm"):
        stroke_side(("height: -0.884 mm", "height: 40 mm"))


CASE_HALF = Path(__file__).parents[2] / "docs" / "how-to" / "half_section_stroke.yaml"
HALF = CASE_HALF.read_text(encoding="utf-8")
GUIDE_HALF = next(line + "\n" for line in HALF.splitlines() if line.startswith("guide:"))
PLACED_HALF = (
    "placement: {eccentricity: 1 um, direction: 20 deg, tilt: 0.02 deg, tilt_direction: 100 deg}"
)


def stroke_half(text, **more):
    return run_stroke(read_valve_case(text, CASE_HALF), **more)


def with_path(text):
    """The run itself, with the path of the needle at its records."""
    valve = build_valve(read_valve_case(text, CASE_HALF))
    run = valve.case.run
    return simulate_network(
        variant_network(valve, "dry").rows(),
        duration=run.duration,
        record=1e-6,
        spatial=valve.spatial,
    )


def events(text):
    return stroke_half(text).reference.result.events


def body(name):
    """Section of one body of the case."""
    start = HALF.index(f"  {name}:\n    geometry")
    return (
        HALF[start:]
        .split("\n  pole:" if name == "housing" else "\n  housing:")[0]
        .split("\nstops:")[0]
        + "\n"
    )


def drop(case, moving, other, contact, end):
    """Needle with one other body, as a case with this end."""
    head = HALF[: HALF.index("bodies:")]
    modes = f"reduction: {{modes: {{{moving}: {{count: 12}}, {other}: {{count: 8}}}}}}\n"
    return head + "bodies:\n" + body(moving) + body(other) + contact + modes + end


@pytest.mark.slow
def test_a_centred_needle_makes_the_axial_stroke_half():
    centred = HALF.replace("placement: {seed: 3}\n", "").replace("400 us,", "190 us,")
    centred = centred.replace("angles: 24", "angles: 8")
    axial = centred.replace("motion: three-dimensional\nangles: 8\n", "").replace(GUIDE_HALF, "")

    ours, theirs = (events(text)[0] for text in (centred, axial))

    assert ours.stop == theirs.stop == "opening"
    assert ours.peak_force == pytest.approx(theirs.peak_force, rel=1e-3)  # steps of 20 ns
    # in space forces are constant over a macro step about a touch, along the axis they rise
    assert ours.time == pytest.approx(theirs.time, abs=0.08e-6)
    assert ours.contact_time == pytest.approx(theirs.contact_time, abs=0.05e-6)
    assert ours.restitution == pytest.approx(theirs.restitution, abs=1e-3)


@pytest.mark.slow
def test_a_first_impact_is_that_of_the_interface_level():
    network = """network:
  components:
    needle: {type: flexible-body, body: needle, points: [tip], speed: -0.3 m/s}
    housing: {type: flexible-body, body: housing, points: [seat]}
    seat: {type: end-stop, gap: 2 um, law: {kind: consistent}}
  connections: [[needle.tip, seat.upper], [housing.seat, seat.lower]]
"""
    faces = "between: [needle.tip, housing.seat]"
    ours = events(
        drop(
            HALF,
            "needle",
            "housing",
            f"stops:\n  seat: {{{faces}, speed: 0.4 m/s}}\n",
            f"{network}motion: three-dimensional\nangles: 16\n{PLACED_HALF}\n"
            "run: {duration: 60 us, variants: [dry]}\n",
        )
    )[0]
    placed = PLACED_HALF.removeprefix("placement: ")
    impact = drop(
        HALF,
        "needle",
        "housing",
        f"contact: {{{faces}, gap: 2 um, angles: 16}}\n",
        f"motion: {{speed: 0.3 m/s, placement: {placed}}}\n"
        "run: {duration: 60 us, interface_step: 20 ns}\n",
    )
    level = run_impact(read_case(impact, CASE_HALF), levels=["interface"], certify=False)
    theirs = level.levels["interface"].measures

    # rows of the contact are those of bodies 2 um apart there, and of bodies in touch here
    assert ours.peak_force == pytest.approx(theirs.peak_force, rel=1e-3)
    assert ours.contact_time == pytest.approx(theirs.contact_time, abs=0.1e-6)
    assert ours.impulse == pytest.approx(theirs.impulse, rel=2e-4)
    assert ours.restitution == pytest.approx(theirs.restitution, abs=5e-4)


@pytest.mark.slow
def test_solids_of_many_layers_hit_in_the_same_way():
    network = """network:
  components:
    needle: {type: flexible-body, body: needle, points: [land], speed: 1.2 m/s}
    pole: {type: flexible-body, body: pole, points: [stop]}
    opening: {type: end-stop, gap: 2 um, law: {kind: consistent}}
  connections: [[pole.stop, opening.upper], [needle.land, opening.lower]]
"""
    text = drop(
        HALF,
        "needle",
        "pole",
        "stops:\n  opening: {between: [pole.stop, needle.land], speed: 1.2 m/s}\n",
        f"{network}motion: three-dimensional\n"
        "placement: {tilt: 250 urad, tilt_direction: 100 deg, eccentricity: 1 um}\n"
        f"{GUIDE_HALF}run: {{duration: 150 us, variants: [dry]}}\n",
    )
    text = text.replace("count: 12", "frequency: 200 kHz").replace("count: 8", "frequency: 100 kHz")
    for old, new in (
        ("0.02 mm, e", "0.06 mm, e"),
        ("0.05 mm}", "0.15 mm}"),
        ("0.03 mm", "0.06 mm"),
    ):
        text = text.replace(old, new)
    solid = text.replace("model: axisymmetric", "model: swept\n      layers: 12")

    ours, theirs = (with_path(case) for case in (text, solid))

    one, other = ours.events[0], theirs.events[0]
    assert one.peak_force == pytest.approx(other.peak_force, rel=1e-3)
    assert one.contact_time == pytest.approx(other.contact_time, abs=0.03e-6)
    assert one.restitution == pytest.approx(other.restitution, abs=1e-3)
    at = np.searchsorted(ours.path.time, 60e-6)  # after the impact, before a touch in the guide
    rates, others = (run.path.velocity[at, 3:5] for run in (ours, theirs))
    np.testing.assert_allclose(rates, others, atol=0.01 * np.linalg.norm(others))
    touches = [
        run.path.time[np.flatnonzero(run.path.guide_force[:, 0])[0]] for run in (ours, theirs)
    ]
    assert touches[0] == pytest.approx(touches[1], abs=1.5e-6)  # records of 1.28 us


@pytest.mark.slow
def test_a_stored_stroke_goes_on_and_one_of_many_is_the_same(tmp_path):
    coarse = HALF.replace("0.02 mm, e", "0.06 mm, e").replace("angles: 24", "angles: 12")
    whole = stroke_half(coarse)
    first = stroke_half(coarse.replace("400 us, v", "99.84 us, v"))
    STROKE.save(first, tmp_path)
    loaded = STROKE.load(tmp_path)
    after = stroke_half(coarse.replace("400 us, v", "300.8 us, v"), after=loaded)

    assert STROKE.to_json(loaded) == STROKE.to_json(first)
    result, begin = after.reference.result, len(first.reference.result.time) - 1
    for name, channel in whole.reference.result.channels.items():
        scale = float(np.abs(channel.values).max())
        expected = channel.values[begin : begin + 40]  # up to the stop
        np.testing.assert_allclose(
            result.channels[name].values[:40], expected, rtol=1e-9, atol=1e-12 * scale
        )
    shots = run_stroke_shots(
        read_valve_case(f"{coarse}shots: {{count: 1, carry: true}}\n", CASE_HALF),
        workers=1,
        folder=tmp_path,
    )
    alone = shots.variants["dry"].stops["opening"]
    assert alone.peak_force[0] == pytest.approx(
        whole.reference.result.events[0].peak_force, rel=1e-9
    )
    assert shots.points["seat"] % 12 == 0  # whole rings


def test_a_contact_on_a_few_angles_is_doubted_once():
    turns = np.repeat(np.arange(24), 2)
    watch = ArcWatch(
        RingArcs(count=24, stops=("seat", "opening"), turn=(turns, turns), weakest=(10.0, 10.0))
    )
    few, many = np.where(turns < 5, 1.0, 0.0), np.ones(48)

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for force, carried in ((9.0, few), (0.0, 0.0 * few), (30.0, few), (90.0, many)):
            watch.see(0, force, carried)
        watch.see(0, 0.0, 0.0 * few)
    watch.see(1, 50.0, few)
    watch.see(1, 20.0, many)  # past the peak
    with pytest.warns(
        AccuracyWarning, match=r"'opening' is so short that only 5 of 24 angles .* 39"
    ):
        watch.see(1, 0.0, 0.0 * few)


@pytest.mark.slow
def test_centred_half_sections_rub_as_the_law_along_the_axis_does():
    """Static loops with friction give that law, of one pressure pattern: so only nearly."""
    rubs = HALF.replace("placement: {seed: 3}\n", "").replace("400 us,", "185 us,")
    rubs = rubs.replace("angles: 24", "angles: 8")
    for force in ("20 N", "40 N"):
        assert rubs.count(f"force: {force}}}") == 1
        rubs = rubs.replace(f"force: {force}}}", f"force: {force}, friction: 0.1}}")
    axial = rubs.replace("motion: three-dimensional\nangles: 8\n", "").replace(GUIDE_HALF, "")

    ours, theirs = (stroke_half(text).reference.result for text in (rubs, axial))

    one, other = ours.events[0], theirs.events[0]
    assert one.stop == other.stop == "opening"
    assert one.peak_force == pytest.approx(other.peak_force, rel=1e-2)
    assert one.restitution == pytest.approx(other.restitution, abs=2e-3)
    assert ours.books.losses["opening friction"] > 1e-7
    assert abs(ours.books.relative_residual) < 1e-11


CASE_TWO = CASE_HALF.with_name("armature_off_axis.yaml")
TWO = CASE_TWO.read_text(encoding="utf-8")
PLACED_TWO = "placement: {seed: 3}\n"


def stroke_two(text):
    return run_stroke(read_valve_case(text, CASE_TWO))


@pytest.mark.slow
def test_two_centred_bodies_make_the_axial_stroke():
    """The armature strikes the collar, both the stop, off the collar again."""
    centred = TWO.replace(PLACED_TWO, "").replace("400 us,", "120 us,")
    guides = centred[centred.index("guide: ") : centred.index("run: ")]
    axial = centred.replace("motion: three-dimensional\nangles: 16\n", "").replace(guides, "")

    ours, theirs = (stroke_two(text).reference.result for text in (centred, axial))

    assert [e.stop for e in ours.events[:2]] == [e.stop for e in theirs.events[:2]]
    assert {event.stop for event in theirs.events} == {"driver", "opening"}
    for one, other in zip(ours.events[:2], theirs.events[:2], strict=True):
        assert one.time == pytest.approx(other.time, abs=0.05e-6)
        # laws along the axis have one pressure pattern, and steps are 20 ns here
        assert one.peak_force == pytest.approx(other.peak_force, rel=4e-3)
        assert one.besides == other.besides  # then neither has a restitution
        assert one.restitution == pytest.approx(other.restitution, abs=2e-3, nan_ok=True)
    assert abs(ours.books.relative_residual) < 1e-11


@pytest.mark.slow
def test_faces_that_yield_are_told_where_points_are_elastic():
    """A force three times as high as the faces bear: no word of a set, one of what is left out."""
    soft = TWO.replace("density: 7850 kg/m^3", "density: 7850 kg/m^3, yield: 60 MPa")
    valve = build_valve(read_valve_case(soft, CASE_TWO))

    assert not any(contact.loops for contact in valve.contacts.values())
    with pytest.warns(
        AccuracyWarning, match="yields before .* klack stroke along the axis"
    ) as told:
        stop_summaries(valve)
    assert sum("yields before" in str(item.message) for item in told) == 3  # stops of steel


@pytest.mark.slow
def test_an_armature_slides_on_its_needle():
    """Seen from the needle it stays within its clearance; the energy balance closes."""
    sleeve = "armature: {on: needle.shaft, surface: bore, heights"
    result = stroke_two(TWO.replace("armature: {surface: rim, heights", sleeve)).reference.result
    aside = [
        np.hypot(*(result.channels[f"armature guide {k} {way}"].values for way in "xy"))
        for k in (1, 2)
    ]
    assert 5e-6 < np.max(aside) < 13e-6  # 12 um, and what shaft and bore give
    assert np.hypot(*(result.channels[f"armature {way}"].values for way in "xy")).max() > 5e-6
    assert {event.stop for event in result.events[:3]} == {"driver", "opening"}
    assert abs(result.books.relative_residual) < 1e-11


@pytest.mark.slow
def test_strokes_of_two_bodies_scatter_at_both_stops(tmp_path):
    """Positions of both are drawn within their guides; one stroke of many is that stroke alone."""
    text = TWO.replace(PLACED_TWO, "shots: {count: 3, seed: 2}\n").replace("400 us,", "120 us,")
    case = read_valve_case(text, CASE_TWO)

    shots = run_stroke_shots(case, workers=1, folder=tmp_path)

    stops = shots.variants["dry"].stops
    for stop in ("driver", "opening"):
        assert np.all(np.isfinite(stops[stop].peak_force))
        assert np.ptp(stops[stop].peak_force) > 1.0
        assert np.all(stops[stop].eccentricity <= 1.2 * shots.largest_eccentricity[stop])
    # the armature has 12 um of clearance, the needle 4
    assert shots.largest_eccentricity["opening"] > 1.5 * shots.largest_eccentricity["driver"]
    assert np.ptp(stops["opening"].eccentricity) > 1e-6
