"""A valve between two stops, from its case: momentum, energy, and the same impact elsewhere.

Truth: the change of momentum, the energy balance, the impact workflow with its own time loop for
the seat, and the mirror image for the opening stop.
"""

from pathlib import Path

import numpy as np
import pytest

from klack.analyses.impact.contact_check import check_contact
from klack.analyses.impact.run import run_impact
from klack.analyses.stroke.analysis import STROKE
from klack.analyses.stroke.content import stroke_content
from klack.analyses.stroke.figures import stop_law_chart
from klack.analyses.stroke.record import StrokeStudy
from klack.analyses.stroke.run import run_stroke
from klack.assembling import rubbing as rubbing_module
from klack.assembling.valve import Valve, build_valve
from klack.case import read_case
from klack.case.any_case import load_valve_case, read_valve_case
from klack.case.valve import ValveCase
from klack.contact.laws import TableLaw
from klack.contact.rubbing_law import RubbingLaw
from klack.errors import AccuracyWarning
from klack.exchange.case_models import case_models
from klack.mechanics.end_stop import EndStop
from klack.mechanics.flexible_body import FlexibleBody
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.transient.rubbing_ladder import LockedError, RubbingContact

FILE = Path(__file__).parents[1] / "data" / "case" / "stroke.yaml"
SPEED = 0.8  # [m/s]
STEP = 20e-9  # [s], of both time loops


@pytest.fixture(scope="module")
def case() -> ValveCase:
    return load_valve_case(FILE)


@pytest.fixture(scope="module")
def valve(case: ValveCase) -> Valve:
    return build_valve(case)


@pytest.fixture(scope="module")
def study(case: ValveCase) -> StrokeStudy:
    return run_stroke(case)


def fly(valve: Valve, speed: float, gaps: dict[str, float], duration: float) -> NetworkResult:
    """Let the needle fly freely, without spring and magnet."""
    parts = valve.network.components
    needle = parts["needle"]
    assert isinstance(needle, FlexibleBody)
    moving = needle.model_copy(update={"speed": speed})
    moving._reduced = needle._reduced
    kept = {"needle": moving, "housing": parts["housing"], "pole": parts["pole"]}
    for name, gap in gaps.items():
        stop = parts[name]
        assert isinstance(stop, EndStop)
        copy = stop.model_copy(update={"gap": gap})
        copy._computed = stop._computed
        kept[name] = copy
    connections = [
        [port for port in connection if port.partition(".")[0] in kept]
        for connection in valve.network.connections
    ]
    network = type(valve.network)(kept, [c for c in connections if len(c) > 1])
    return simulate_network(
        network.rows(), duration=duration, step=STEP, coarse=1, record=STEP, start="free"
    )


def test_energy_books_close(study: StrokeStudy):
    for variant in study.variants.values():
        assert variant.result.books.throughput > 1e-3
        assert variant.result.books.relative_residual < 1e-9


def test_the_stroke_opens_and_closes(study: StrokeStudy):
    for variant in study.variants.values():
        # 35 N - 12 N on 2.96 g over 100 um, at most 1 N more of the spring
        assert variant.opening_time == pytest.approx(np.sqrt(2e-4 * 2.96e-3 / 22.5), rel=0.03)
        assert 0.4e-3 < variant.closing_time < 0.9e-3
        lift = variant.channel(study.channels.lift)
        assert lift is not None
        # the tip runs on for the time of a wave through 18 mm of steel, and the stop yields
        assert 99e-6 < lift.values.max() < 107e-6
    assert study.lift == 1e-4
    assert [stop.kind for stop in study.stops] == ["consistent", "consistent"]


def test_stops_keep_what_was_found_about_their_contact(study: StrokeStudy, valve: Valve):
    said = STROKE.to_json(study)["stops"]
    for stop in study.stops:
        contact = valve.contacts[stop.name]
        found = check_contact(valve.case, contact.pair, contact.static, contact.pattern_force, "")
        assert stop.doubts == found.doubts
        assert said[stop.name]["doubts"] == list(found.doubts)
        assert said[stop.name]["points_across"] == stop.points_across == found.points_across > 0


def test_a_rigid_needle_rebounds_as_the_case_says(study: StrokeStudy):
    """Gonthier's dashpot: exact for the contact force alone; 23 N against 1 kN are left."""
    first = study.variants["dry-lumped"].impacts("opening")[0]

    assert first.restitution == pytest.approx(0.5, rel=0.03)


def test_ports_of_a_body_move_with_it(valve: Valve):
    for body in valve.reduced.values():
        for i in range(len(body.port_names)):
            rigid = body.port_shapes[: body.rigid_count, i] @ body.rigid_axial
            assert rigid == pytest.approx(1.0, rel=1e-9) if body.rigid_count else rigid == 0.0


def test_law_and_modes_add_up_to_the_static_contact(valve: Valve):
    """The compliance that the modes miss at the pattern force is in the law, none twice."""
    for name, contact in valve.contacts.items():
        force = contact.static.force
        local = valve.laws[name].local
        compliance = 0.0
        for body, port in zip((contact.pair.upper, contact.pair.lower), contact.ports, strict=True):
            reduced = valve.reduced[body.name]
            i = reduced.port_index(port.name)
            compliance += reduced.modal_compliance[i, i]
        at = np.interp(force, local.force, local.force_indentation) + force * compliance
        resolved = force > 1.05 * local.resolved_force
        assert resolved.sum() > 10
        assert at[resolved] == pytest.approx(contact.static.approach[resolved], rel=1e-9)


def test_faces_and_bulk_are_the_same_law_in_two_parts(valve: Valve):
    for law in valve.laws.values():
        local, faces, compliance = law.local, law.faces, law.bulk

        force = np.linspace(0.1, 0.9, 9) * local.max_force
        whole = [np.interp(F, local.force, local.force_indentation) for F in force]
        depth = np.linspace(0.0, local.force_indentation[-1], 20001)
        apart = np.interp(force, faces.force(depth), depth) + compliance * force
        assert compliance > 0
        assert np.all(np.diff(faces.force(depth)) >= 0)
        # both tables are smooth curves through the same points: equal there, 1 % between
        assert apart == pytest.approx(whole, rel=0.01)


def test_momentum_of_an_impact_on_either_stop(valve: Valve):
    for speed, stop in ((-SPEED, "seat"), (SPEED, "opening")):
        result = fly(valve, speed, {"seat": 1e-3, "opening": 1e-3} | {stop: 0.5e-6}, 40e-6)
        (event,) = [e for e in result.events if e.stop == stop]
        after = result.channels["needle velocity"].values[-1]

        mass = valve.reduced["needle"].mass
        assert event.approach_speed == pytest.approx(SPEED, rel=1e-9)
        assert event.impulse == pytest.approx(mass * abs(after - speed), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.0, 0.1, 0.3])
def test_seat_impact_is_that_of_the_impact_workflow(valve: Valve, friction: float):
    """Same bodies and speed through `klack impact`: another port pattern, another time loop."""
    text = FILE.read_text(encoding="utf-8")
    if friction:
        valve = build_valve(rubbing(friction))
    impact = read_case(
        "klack: 1\ntitle: t\n"
        + text[text.index("materials:") : text.index("  pole:")]
        + "contact: {between: [needle.tip, housing.seat], gap: 0.5 um, "
        + f"friction: {friction}}}\n"
        + f"motion: {{speed: {SPEED} m/s}}\n"
        + "reduction: {modes: {needle: {count: 20}, housing: {count: 40}}}\n"
        + "run: {duration: 60 us, reduced_step: 20 ns, levels: [reduced]}\n",
        Path("impact.yaml"),
    )
    expected = run_impact(impact, levels=("reduced",), certify=False).levels["reduced"].measures

    result = fly(valve, -SPEED, {"seat": 0.5e-6, "opening": 1e-3}, 60e-6)
    event = next(e for e in result.events if e.stop == "seat")

    assert result.books.relative_residual < 1e-10
    assert (result.books.losses["seat contact"] > 0.0) == (friction > 0.0)
    # the pattern was taken at another force (1.2 m/s): some tenths of a per cent
    assert event.peak_force == pytest.approx(expected.peak_force, rel=5e-3)
    assert event.contact_time == pytest.approx(expected.contact_time, rel=5e-3)
    assert event.restitution == pytest.approx(expected.restitution, abs=3e-3)


def rubbing(friction: float) -> ValveCase:
    text = FILE.read_text(encoding="utf-8")
    return read_valve_case(
        text.replace("force: 20 N}", f"force: 20 N, friction: {friction}}}"), FILE
    )


@pytest.mark.slow
def test_friction_of_a_stop_raises_its_pressure_pattern_and_its_law(valve: Valve):
    """Truth: the same faces without friction, softer; the smooth stop keeps its bits."""
    rough = build_valve(rubbing(0.1))

    before, after = valve.contacts["seat"], rough.contacts["seat"]
    assert 1.01 < after.pattern_force / before.pattern_force < 1.05
    assert after.closing.force[-1] > before.closing.force[-1]
    assert isinstance(rough.laws["seat"].law, RubbingLaw)
    assert isinstance(rough.laws["seat"].faces, RubbingLaw)
    assert 0.0 < rough.laws["seat"].bulk <= valve.laws["seat"].bulk
    for of in (valve, rough):
        assert isinstance(of.laws["opening"].law, TableLaw)
    assert rough.contacts["opening"].pattern_force == valve.contacts["opening"].pattern_force


@pytest.mark.slow
def test_a_report_names_the_friction_of_its_stops(study: StrokeStudy):
    rough = run_stroke(rubbing(0.1), variants=("dry",))

    seat, opening = rough.stops
    assert (seat.friction, opening.friction) == (0.1, 0.0)
    assert np.all(seat.returning[1:] < seat.force[1:])
    chart = stop_law_chart(seat)
    assert chart is not None
    assert "with friction 0.1" in chart.note
    assert [curve.label for curve in chart.panels[0].curves][-1] == "the same, slipping back"
    physics = [dict(stroke_content(of).limits)["Physics"] for of in (rough, study)]
    assert "frictionless but at 'seat'" in physics[0]
    assert "frictionless contact" in physics[1]


def test_an_exported_valve_says_that_it_leaves_friction_out():
    with pytest.warns(AccuracyWarning, match=r"leaves out stops\.seat\.friction 0\.1"):
        models = case_models(rubbing(0.1))

    laws = [contact.law for contact in models.pair.contacts]
    assert not any(isinstance(law, RubbingLaw) for law in laws)


def test_faces_that_lock_leave_the_law_smooth(monkeypatch: pytest.MonkeyPatch, valve: Valve):
    def locks(*_given: object, key: str) -> RubbingContact:
        raise LockedError(key, got="0.1: the faces lock", expected="less", hint="less.")

    monkeypatch.setattr(rubbing_module, "rubbing_contact", locks)
    with pytest.warns(AccuracyWarning, match=r"seat.*leaves out stops\.seat\.friction 0\.1"):
        locked = build_valve(rubbing(0.1))

    law = locked.laws["seat"].law
    assert isinstance(law, TableLaw)
    assert np.array_equal(law.force_points, valve.laws["seat"].local.law.force_points)


MIRRORED = """
klack: 1
title: A rod between two equal plates
materials: {steel: {young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}}
bodies:
  rod:
    geometry:
      model: axisymmetric
      profile:
        unit: mm
        parts:
          rod:
            start: [0, -5]
            edges:
              - {arc: [2, -4.5], centre: [0, -0.75], name: low}
              - {line: [2, 4.5], name: side}
              - {arc: [0, 5], centre: [0, 0.75], name: high}
              - {close: true, name: axis}
    material: steel
    mesh: {size: 0.5 mm, surfaces: {low: 0.05 mm, high: 0.05 mm}}
  floor:
    geometry: &plate
      model: axisymmetric
      profile:
        unit: mm
        parts:
          plate:
            start: [0, -8]
            edges:
              - {line: [4, -8], name: held}
              - {line: [4, -5.5], name: outside}
              - {line: [0, -5.5], name: face}
              - {close: true, name: axis}
    material: steel
    mesh: {size: 0.5 mm, surfaces: {face: 0.05 mm}}
    fixed: [{surface: held}]
  ceiling:
    geometry:
      model: axisymmetric
      profile:
        unit: mm
        parts:
          plate:
            start: [0, 8]
            edges:
              - {line: [4, 8], name: held}
              - {line: [4, 5.5], name: outside}
              - {line: [0, 5.5], name: face}
              - {close: true, name: axis}
    material: steel
    mesh: {size: 0.5 mm, surfaces: {face: 0.05 mm}}
    fixed: [{surface: held}]
stops:
  bottom: {between: [rod.low, floor.face], speed: 1 m/s}
  top: {between: [ceiling.face, rod.high], speed: 1 m/s}
reduction: {modes: {rod: {count: 8}, floor: {count: 10}, ceiling: {count: 10}}}
network:
  components:
    rod: {type: flexible-body, body: rod, points: [low, high]}
    floor: {type: flexible-body, body: floor, points: [face]}
    ceiling: {type: flexible-body, body: ceiling, points: [face]}
    bottom: {type: end-stop, gap: 10 um, law: {kind: consistent}}
    top: {type: end-stop, gap: 10 um, law: {kind: consistent}}
  connections:
    - [rod.low, bottom.upper]
    - [floor.face, bottom.lower]
    - [ceiling.face, top.upper]
    - [rod.high, top.lower]
run: {duration: 60 us}
"""


@pytest.mark.slow
def test_a_stop_above_is_a_stop_below_upside_down():
    """Two meshes of the same bodies, one drawn upside down: equal within the mesh error."""
    valve = build_valve(read_valve_case(MIRRORED, Path("mirrored.yaml")))

    below, above = valve.contacts["bottom"], valve.contacts["top"]
    assert above.pattern_force == pytest.approx(below.pattern_force, rel=5e-3)
    force = np.linspace(20.0, 0.9 * below.static.max_force, 10)
    approach = [
        np.interp(force, side.static.force, side.static.approach) for side in (below, above)
    ]
    assert approach[1] == pytest.approx(approach[0], rel=3e-3)
    shares = [np.interp(force, law.local.force, law.local.share) for law in valve.laws.values()]
    assert shares[1] == pytest.approx(shares[0], rel=1e-2)
