"""What sliders show is the run of the case with these values; forms write what is typed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from klack.acoustics.signal_statistics import sound_statistics
from klack.analyses.contact_doubts import contact_doubt
from klack.analyses.impact.analysis import IMPACT
from klack.analyses.impact.content import report_content
from klack.analyses.impact.run import run_impact
from klack.analyses.noise.body import Transfers
from klack.analyses.noise.run import click_sound
from klack.analyses.noise.source import impact_sources, sources_of
from klack.analyses.stroke.content import stroke_content
from klack.analyses.stroke.run import run_stroke
from klack.app.answers import Answer, Curve, Slider, StudyChoice
from klack.app.explorer import Explorer, drawn, sliders_of, stroke_numbers, written
from klack.app.pages.charts import answer_figures
from klack.app.reader import Reader
from klack.app.texts import (
    checked_text,
    differing_inputs,
    exchanged_text,
    study_offer,
    study_source,
    study_text,
)
from klack.case.any_case import read_case_tree, tree_of
from klack.case.key_path import quantity_at
from klack.case.reader import find_case, read_case
from klack.errors import InputError
from klack.machine.stages import collected_warnings

PATH = find_case("demo-valve-axisymmetric")
TEXT = PATH.read_text("utf-8")


@pytest.fixture(scope="module")
def explorer() -> Explorer:
    found = Explorer()
    found.open(TEXT, str(PATH))
    return found


@pytest.mark.slow
def test_a_move_is_the_impact_of_the_case_with_these_values(explorer):
    values = {"motion.speed": 0.45, "motion.force": 20.0, "bodies.needle.damping.modal": 0.01}
    answer = explorer.move(values)
    text = explorer.text_at(values)
    assert "speed: 0.45 m/s" in text
    assert "# meet the air" in text  # comments stay

    with threadpool_limits(1):  # as the moves: sums of several threads have another order
        study = run_impact(read_case(text, PATH), levels=("reduced",))
    measures = study.levels["reduced"].measures
    numbers = {number.key: number.value for number in answer.numbers}

    # bit for bit: the compliance of this reach is part of that for the upper ends of the sliders
    assert numbers["peak_force"] == measures.peak_force
    assert numbers["contact_time"] == 1e6 * measures.contact_time
    assert numbers["restitution"] == measures.restitution


def test_what_is_computed_is_what_is_read(explorer):
    """A position between two numbers that the page shows is that of the number it shows."""
    shown = explorer.move({"motion.speed": 0.45})

    assert explorer.move({"motion.speed": 0.450049}).numbers == shown.numbers
    assert explorer.text_at({"motion.speed": 0.450049}) == explorer.text_at({"motion.speed": 0.45})


@pytest.mark.slow
def test_an_impact_that_is_cut_off_has_no_numbers_but_a_doubt():
    """As in the JSON of the command: no peak force, no contact time, no restitution."""
    found = Explorer()
    short = TEXT.replace("duration: 55 us", "duration: 20 us")
    assert short != TEXT
    first = found.open(short, str(PATH)).first

    assert [number.value for number in first.numbers[:3]] == [None, None, None]
    assert "cut off" in first.numbers[0].name
    assert any("ends before separation" in doubt for doubt in first.doubts)


@pytest.mark.slow
def test_what_speaks_against_a_level_goes_with_its_sound_and_into_comparisons(tmp_path):
    """A force that ends at its highest value has the spectrum of a step, 28 dB(A) too loud here."""
    case = read_case(TEXT.replace("duration: 55 us", "duration: 20 us"), PATH)
    study = run_impact(case, levels=("reduced", "lumped"), certify=False)
    assert study.reference == "reduced"
    for name, record in (("cut", study), ("whole", replace(study, reference="lumped"))):
        IMPACT.save(record, tmp_path / name)
    (source,) = sources_of(study)
    steps = [step.command for step in report_content(study).next_steps]
    assert "klack advise CASE" not in steps  # which refuses an impact that is cut off
    ghost, now = Reader().compare(str(tmp_path / "whole"), str(tmp_path / "cut"))

    assert any("spectrum and sound are incomplete" in note for note in source.notes)
    assert any("spectrum and sound are incomplete" in doubt for doubt in now.doubts)
    assert (ghost.run, now.run) == ("level lumped", "level reduced")


@pytest.mark.slow
def test_a_contact_in_doubt_is_in_doubt_on_every_page(tmp_path):
    """As in the text of the command."""
    case = read_case(TEXT.replace("duration: 55 us", "duration: 20 us"), PATH)
    study = run_impact(case, levels=("lumped",), certify=False)
    doubtful = replace(study, contact=replace(study.contact, doubts=("its mesh is too coarse",)))
    IMPACT.save(doubtful, tmp_path)
    words = contact_doubt(doubtful.contact)

    assert words in Reader().card(str(tmp_path)).doubts
    assert words in Reader().compare(str(tmp_path), str(tmp_path))[0].doubts


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        ("small_valve", {"magnet.force.1": 5.0, "magnet.force.2": 5.0}, "never left its seat"),
        ("magnet_from_a_map", {"coil.map.force_factor": 0.5}, "force map"),
    ],
)
def test_a_stroke_tells_what_the_command_tells(name, values, words):
    """Notes of rest, of the start and of reading the case: those of klack stroke, all of them."""
    values = {f"network.components.{key}": value for key, value in values.items()}
    path = Path(f"docs/how-to/{name}.yaml")
    found = Explorer()
    found.open(path.read_text("utf-8"), str(path))
    answer = found.move(values)
    with collected_warnings() as read:
        case = tree_of(found.text_at(values), path).any_case()
    study = run_stroke(case, variants=case.run.variants[:1])  # halves its steps equally often

    assert any(words in doubt for doubt in answer.doubts)
    assert set(answer.doubts) == {*read, *study.warnings}
    assert {number.key: number.value for number in answer.numbers} == {
        number.key: number.value for number in stroke_numbers(study.reference, study.channels)
    }


def test_a_report_proposes_the_sound_only_where_something_hits_a_stop():
    """Klack noise refuses a network without stops."""
    offered = {
        name: [step.command for step in stroke_content(run_stroke(case)).next_steps]
        for name in ("line_tee", "small_valve")
        if (case := read_case_tree(Path(f"docs/how-to/{name}.yaml")).case())
    }

    assert "klack noise RESULT" in offered["small_valve"]
    assert "klack noise RESULT" not in offered["line_tee"]


def test_a_text_without_moves_is_that_of_the_file():
    """Parts that it includes stay in their files."""
    path = Path("docs/how-to/four_injectors.yaml")
    found = Explorer()
    found.open(path.read_text("utf-8"), str(path))

    assert found.text_at({}) == path.read_text("utf-8")


@pytest.mark.slow
def test_the_sound_hardly_depends_on_earlier_moves(explorer):
    """Far from the contact, static solutions of earlier moves are combined."""
    for speed in (0.4, 0.44, 0.48, 0.52):
        explorer.move({"motion.speed": speed})
    values = {"motion.speed": 0.46}
    moved = explorer.move(values)
    with threadpool_limits(1):
        case = read_case(explorer.text_at(values), PATH)
        study = run_impact(case, levels=("reduced",), certify=False)
        pressure = click_sound(impact_sources(study, ("reduced",), case)[0], Transfers())

    assert pressure is not None
    numbers = {number.key: number.value for number in moved.numbers}
    level = sound_statistics(pressure).exposure_level_A
    # the error in the norm of the energy is up to 1e-3 at the contact, far less at a distance
    assert numbers["level"] == pytest.approx(level, abs=1e-5)


def test_the_click_is_louder_by_the_square_of_the_speed(explorer):
    """An impact that is nearly linear: twice the speed, twice the force, 6.02 dB."""
    slow, fast = (
        {number.key: number.value for number in explorer.move({"motion.speed": speed}).numbers}
        for speed in (0.2, 0.4)
    )

    # the ring of contact grows with the force, which makes the impact a little shorter
    assert fast["level"] - slow["level"] == pytest.approx(20.0 * np.log10(2.0), abs=0.1)


def test_motion_and_bands_belong_to_the_force(explorer):
    answer = explorer.move({})
    (lift,), (force,) = answer.lift, answer.force

    assert lift.y[0] == 0.0
    slope = (lift.y[1] - lift.y[0]) / (lift.x[1] - lift.x[0])  # [um/us] is [m/s]
    assert slope == pytest.approx(-0.3, rel=1e-2)
    turning = lift.x[np.argmin(lift.y)]
    assert turning == pytest.approx(force.x[np.argmax(force.y)], abs=2.0)
    assert answer.levels.shape == answer.bands.shape


def test_a_drawn_curve_keeps_its_ends_and_extremes():
    """Definition: only points of the curve are drawn, those told in words among them."""
    x = np.linspace(0.0, 5.0, 5003)
    y = np.cos(3.0 * x)
    y[1234], y[4321] = 2.0, -2.0  # between two steps
    shown_x, shown_y = drawn(x, y)

    assert x.size / 8 < shown_x.size < x.size / 7
    assert np.all(np.diff(shown_x) > 0)
    assert set(zip(shown_x, shown_y, strict=True)) <= set(zip(x, y, strict=True))
    assert (shown_x[0], shown_x[-1], shown_y.max(), shown_y.min()) == (0.0, 5.0, 2.0, -2.0)
    assert drawn(x[:50], y[:50])[1].size == 50


def test_both_clicks_have_one_scale(explorer):
    from io import BytesIO

    import soundfile

    answer = explorer.move({"motion.speed": 0.6})
    now, pinned = (soundfile.read(BytesIO(wav))[0] for wav in (answer.wav, answer.ghost_wav))

    ratio = np.abs(now).max() / np.abs(pinned).max()
    assert ratio == pytest.approx(2.0, rel=0.02)  # 0.6 m/s against 0.3 m/s
    assert np.abs(now).max() < 1.0


def test_values_that_cannot_be_are_refused_and_the_page_goes_on(explorer):
    for key, value, words in (
        ("bodies.needle.damping.modal", 1.5, ""),
        ("bodies.needle.mesh.size", 1e-3, "a key without a slider"),
        ("run.duration", 1e-3, "a key without a slider"),
        ("motion.speed", float("nan"), ""),
    ):
        with pytest.raises(InputError, match=words):
            explorer.move({key: value})
    assert explorer.move({}).numbers


def test_the_estimate_is_that_of_the_impact(explorer):
    found = explorer.judge({})

    assert found.grade == "good"
    assert "peak force" in found.words


@pytest.mark.slow
def test_hearing_follows(explorer):
    heard = explorer.listen({})
    louder = explorer.listen({"motion.speed": 0.6})

    assert heard is not None
    assert louder is not None
    assert heard.pinned == heard.number == louder.pinned
    assert louder.number.value > 1.2 * heard.number.value
    assert heard.number.value > 1.0  # sone: it can be heard
    time, frequency, level = heard.spectrogram
    assert level.shape == (frequency.size, time.size)
    assert frequency[-1] == pytest.approx(24.0)


def test_sliders_mark_what_needs_new_bodies():
    tree = tree_of(TEXT, PATH)
    found = {slider.key: slider for slider in sliders_of(tree.any_case(), tree)}

    assert not found["motion.speed"].needs_mesh
    assert not found["bodies.housing.damping.modal"].needs_mesh
    assert found["materials.steel.young"].needs_mesh
    assert found["bodies.needle.mesh.size"].needs_mesh
    assert "lumped.stiffness" not in found  # of another level
    speed = found["motion.speed"]
    assert speed.low < speed.start == 0.3 < speed.high


def test_the_form_has_units_limits_and_words_of_the_schema():
    checked = checked_text(TEXT, str(PATH))
    fields = {item.key: item for item in checked.fields}

    assert (checked.kind, checked.error) == ("impact", "")
    speed = fields["motion.speed"]
    assert (speed.written, speed.kind, speed.limits) == ("0.3 m/s", "a speed", "> 0")
    assert "consistent" in fields["reduction.correction"].choices
    assert fields["motion.force"].written == ""  # could be there
    assert not [key for key in fields if "edges" in key]


def test_a_magnet_is_a_case_of_its_own_and_an_oblique_impact_has_no_sliders():
    """Truth: what ``klack magnet`` takes, and what an explorer refuses."""
    path = Path("docs/how-to/lifting_magnet.yaml")
    magnet = checked_text(path.read_text("utf-8"), str(path))
    wrong = checked_text(path.read_text("utf-8").replace("turns: 957", "turns: -3"), str(path))
    turned = exchanged_text(path.read_text("utf-8"), str(path), ("magnet", "coil", "turns"), "900")
    path = Path("docs/how-to/oblique_impact.yaml")
    oblique = path.read_text("utf-8")

    assert (magnet.kind, magnet.error, magnet.ways) == ("magnet", "", {})
    assert "magnet.coil.turns" in {item.key for item in magnet.fields}
    assert "magnet.coil.turns" in wrong.error
    assert "turns: 900" in turned
    assert [*checked_text(TEXT, str(PATH)).ways] == ["Show", "Sliders", "New study"]
    assert [*checked_text(oblique, str(path)).ways] == ["Show", "New study"]
    with pytest.raises(InputError, match=r"motion\.sideways_speed"):
        Explorer().open(oblique, str(path))


def test_a_form_changes_one_value_and_nothing_else():
    text = exchanged_text(TEXT, str(PATH), ("motion", "speed"), "0.5 m/s")

    changed = [
        (old, new)
        for old, new in zip(TEXT.splitlines(), text.splitlines(), strict=True)
        if old != new
    ]
    assert changed == [("motion: {speed: 0.3 m/s}", "motion: {speed: 0.5 m/s}")]
    assert read_case(text, PATH).motion.speed == 0.5


@pytest.mark.parametrize(
    "typed", ['"; x: 1', "{a: 1}", "!!python/object:os.system x", "&a b", "x\ny: 1"]
)
def test_what_is_typed_is_one_value_whatever_it_looks_like(typed):
    text = exchanged_text(TEXT, str(PATH), ("title",), typed)

    assert tree_of(text, PATH).data["title"] == typed.strip()
    assert set(tree_of(text, PATH).data) == set(tree_of(TEXT, PATH).data)


def test_the_checker_names_the_line():
    broken = TEXT.replace("speed: 0.3 m/s", "speed: 0.3 mm")
    found = checked_text(broken, str(PATH))
    line = broken[: broken.index("speed: 0.3 mm")].count("\n") + 1

    assert "motion.speed" in found.error
    assert f"{PATH}:{line}: " in found.error
    assert (found.line, found.column) == (line, 0)
    assert found.fields == ()
    assert Path(str(PATH)).read_text("utf-8") == TEXT


def test_the_checker_names_the_column_of_bad_yaml_and_no_line_of_another_file(tmp_path):
    path = tmp_path / "case.yaml"
    bad = checked_text("klack: 1\nmotion: {speed: 1 m/s}}\n", str(path))
    (tmp_path / "part.yaml").write_text("klack: 1\nfixed: 3\n")
    of_part = checked_text(
        "klack: 1\nnetwork: {}\ninclude: [{file: part.yaml, as: a}]\n", str(path)
    )

    assert (bad.line, bad.column) == (2, 23)
    assert f"{tmp_path / 'part.yaml'}:" in of_part.error
    assert (of_part.line, of_part.column) == (0, 0)


@pytest.mark.slow
def test_a_valve_in_its_machine_is_heard_at_every_ear(tmp_path):
    """Twice as far on the normal: half the pressure, later; moves answer as a fresh page does."""
    text = find_case("demo-mounted").read_text(encoding="utf-8").replace("12 ms", "1 ms")
    text = text.replace("[0 m, 0 m, 1 m]}", "[0 m, 0 m, 1 m], far: [0 m, 0 m, 2 m]}")
    explorer, path = Explorer(), str(tmp_path / "case.yaml")
    first = explorer.open(text, path).first
    assert first.ears == ("listener", "far")
    moved = {"network.components.spring.preload": 12.6}
    near, far = (explorer.move(moved, ear=ear) for ear in first.ears)
    level = [answer.numbers[-1].value for answer in (near, far)]
    assert level[0] - level[1] == pytest.approx(20.0 * np.log10(2.0), abs=0.02)
    then = [answer.ghost_level[0].value for answer in (near, far)]
    assert then[0] == first.numbers[-1].value
    assert then[0] - then[1] == pytest.approx(20.0 * np.log10(2.0), abs=0.02)
    assert near.wav != far.wav
    assert explorer.listen(moved, "far").number.value < explorer.listen(moved).number.value
    fresh = Explorer().open(explorer.text_at(moved), path).first  # with a machine of its own
    assert fresh.numbers[-1].value == pytest.approx(near.numbers[-1].value, rel=1e-12)


def offered(name: str, text: str = "") -> dict[str, Slider]:
    path = find_case(name)
    tree = tree_of(text or path.read_text("utf-8"), path)
    return {slider.key: slider for slider in sliders_of(tree.any_case(), tree)}


def test_sliders_have_the_units_of_the_case():
    """Not 601.3 kPa, 10 kN/m and 2e-07 m^3; a temperature moves by degrees, not from 59 K on."""
    sliders = offered("demo-stroke")
    of = {key.removeprefix("network."): slider for key, slider in sliders.items()}
    pressure = of["components.feed.pressure"]
    warmth = of["ambient.temperature"]

    assert of["components.spring.stiffness"].text(9e3) == "9 N/mm"
    assert pressure.text(5.5e5) == "5.5 bar"
    assert sliders["noise.mount.mass"].text(0.05) == "50 g"
    assert sliders["noise.plate.loss_factor"].text(0.03) == "3 %"
    assert (warmth.text(warmth.low), warmth.written) == ("-60 degC", "20 degC")
    assert [round(end, 2) for end in warmth.about(0.1)] == [283.15, 303.15]
    assert pressure.about(0.1) == pytest.approx((5.4117e5, 6.6143e5), rel=1e-12)  # 10 % of it


def test_every_slider_is_read_back_as_it_is_written():
    """In its own unit to the four digits that are shown: 0.05 %, of temperatures 0.05 K."""
    for name in ("demo-stroke", "warm-valve", "demo-valve-axisymmetric"):
        path = find_case(name)
        tree = tree_of(path.read_text("utf-8"), path)
        case = tree.any_case()
        for slider in sliders_of(case, tree):
            if slider.needs_mesh or slider.written == "not given":
                continue
            value = 0.37 * slider.low + 0.63 * slider.high
            read = quantity_at(case, slider.place).parse(written(slider, value))
            assert read == pytest.approx(value, rel=5e-4, abs=0.05 if slider.unit == "K" else 0.0)


def test_the_lift_is_one_slider():
    """The case links the gaps of stop and coil: both move, in the file as well."""
    keys = ("network.components.opening.gap", "network.components.coil.gap")
    path = find_case("demo-stroke")
    text = path.read_text("utf-8")
    sliders = offered("demo-stroke")
    found = Explorer()
    found._tree, found._case = tree_of(text, path), tree_of(text, path).any_case()
    found._sliders = sliders
    moved = found._case_at({keys[0]: 93e-6}).network.components
    text_then = found.text_at({keys[0]: 93e-6})
    unlinked = offered("demo-stroke", text.replace("opening.gap: lift", "opening.gap: 1 * lift"))

    assert keys[1] not in sliders
    assert sliders[keys[0]].label == "lift"
    assert (moved["opening"].gap, moved["coil"].gap) == (93e-6, 93e-6)
    assert text_then.count("gap: 93 um") == 2
    assert {*keys} <= {*unlinked}  # an expression may be another value


def test_a_study_of_the_lift_varies_both_gaps():
    path = find_case("demo-stroke")
    choice = StudyChoice(
        ranges={"network.components.opening.gap": ("90 um", "110 um")},
        measures=("opening_time",),
        objectives={},
        design="sobol",
        points=4,
    )
    study = study_source(study_text(choice, path.read_text("utf-8"), str(path)), path)[1].study

    assert [*study.parameters] == ["lift"]
    assert {*study.linked} == {"network.components.opening.gap", "network.components.coil.gap"}


def test_a_study_is_offered_only_measures_that_its_case_can_have():
    """Rigid bodies radiate nothing, and a valve without noise.mounts has no levels there."""
    rigid = Path("docs/how-to/small_valve.yaml")
    drop = find_case("sphere-on-rod")
    noise = {
        path: {
            item.name.removeprefix("noise.")
            for item in study_offer(path.read_text("utf-8"), str(path)).measures
            if item.name.startswith("noise.")
        }
        for path in (rigid, drop)
    }

    assert noise[rigid] == {"peak_force", "force_level", "valid_from", "balanced_below"}
    assert {"radiated_energy", "sound_exposure_level_weighted"} <= noise[drop]
    assert not {"mount_force_level", "mount_velocity_level"} & noise[drop]


def test_stops_of_the_pinned_design_are_told_apart():
    x = np.linspace(0.0, 1.0, 3)
    stops = tuple(Curve(name=name, x=x, y=x) for name in ("seat", "opening"))
    answer = Answer(
        force=stops, lift=(), time_unit="ms", bands=np.zeros(0), levels=np.zeros(0), numbers=()
    )
    lines = answer_figures(answer, answer, ("now", "pinned"))[0]["data"]
    looks = {(line["line"]["color"], line["line"]["dash"]) for line in lines}

    assert len(looks) == 4
    assert lines[0]["line"]["color"] == lines[2]["line"]["color"]  # the seat, pinned and now


def test_a_comparison_lists_the_inputs_that_differ():
    """Speed and mesh; not the title, nor what both have."""
    other = TEXT.replace("speed: 0.3 m/s", "speed: 0.4 m/s").replace("title: ", "title: other ")
    assert other != TEXT

    assert differing_inputs(TEXT, TEXT) == ()
    assert differing_inputs(TEXT, other) == (("motion.speed", "0.3 m/s", "0.4 m/s"),)
    assert differing_inputs("klack: [", TEXT) == ()
    assert differing_inputs("a: 1", "b: 2") == (("a", "1", "–"), ("b", "–", "2"))
