"""A three-dimensional stroke of half sections, without a mesh of three dimensions.

Truth: the axial stroke of the same half sections where the needle is centred; the first impact of
the interface level from the same placement; the same bodies as solids of many layers; the run in
one part.
"""

import warnings
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.impact.run import run_impact
from klack.analyses.stroke.analysis import STROKE
from klack.analyses.stroke.run import run_stroke, variant_network
from klack.analyses.stroke_shots.run import run_stroke_shots
from klack.assembling.valve import build_valve
from klack.case.any_case import read_valve_case
from klack.case.reader import read_case
from klack.errors import AccuracyWarning
from klack.simulation.network_run import simulate_network
from klack.transient.ring_arcs import ArcWatch, RingArcs

CASE = Path(__file__).parents[2] / "docs" / "how-to" / "half_section_stroke.yaml"
HALF = CASE.read_text(encoding="utf-8")
GUIDE = next(line + "\n" for line in HALF.splitlines() if line.startswith("guide:"))
PLACED = (
    "placement: {eccentricity: 1 um, direction: 20 deg, tilt: 0.02 deg, tilt_direction: 100 deg}"
)


def stroke(text, **more):
    return run_stroke(read_valve_case(text, CASE), **more)


def with_path(text):
    """The run itself, with the path of the needle at its records."""
    valve = build_valve(read_valve_case(text, CASE))
    run = valve.case.run
    return simulate_network(
        variant_network(valve, "dry").rows(),
        duration=run.duration,
        record=1e-6,
        spatial=valve.spatial,
    )


def events(text):
    return stroke(text).reference.result.events


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
def test_a_centred_needle_makes_the_axial_stroke():
    centred = HALF.replace("placement: {seed: 3}\n", "").replace("400 us,", "190 us,")
    centred = centred.replace("angles: 24", "angles: 8")
    axial = centred.replace("motion: three-dimensional\nangles: 8\n", "").replace(GUIDE, "")

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
            f"{network}motion: three-dimensional\nangles: 16\n{PLACED}\n"
            "run: {duration: 60 us, variants: [dry]}\n",
        )
    )[0]
    placed = PLACED.removeprefix("placement: ")
    impact = drop(
        HALF,
        "needle",
        "housing",
        f"contact: {{{faces}, gap: 2 um, angles: 16}}\n",
        f"motion: {{speed: 0.3 m/s, placement: {placed}}}\n"
        "run: {duration: 60 us, interface_step: 20 ns}\n",
    )
    level = run_impact(read_case(impact, CASE), levels=["interface"], certify=False)
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
        f"{GUIDE}run: {{duration: 150 us, variants: [dry]}}\n",
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
    whole = stroke(coarse)
    first = stroke(coarse.replace("400 us, v", "99.84 us, v"))
    STROKE.save(first, tmp_path)
    loaded = STROKE.load(tmp_path)
    after = stroke(coarse.replace("400 us, v", "300.8 us, v"), after=loaded)

    assert STROKE.to_json(loaded) == STROKE.to_json(first)
    result, begin = after.reference.result, len(first.reference.result.time) - 1
    for name, channel in whole.reference.result.channels.items():
        scale = float(np.abs(channel.values).max())
        expected = channel.values[begin : begin + 40]  # up to the stop
        np.testing.assert_allclose(
            result.channels[name].values[:40], expected, rtol=1e-9, atol=1e-12 * scale
        )
    shots = run_stroke_shots(
        read_valve_case(f"{coarse}shots: {{count: 1, carry: true}}\n", CASE),
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
    with pytest.warns(AccuracyWarning, match=r"'opening' is so short that 5 of 24 angles .* 39"):
        watch.see(1, 0.0, 0.0 * few)
