"""Derivatives of a stroke: what the command tells, and what it refuses.

Truth: two further strokes with all parameters changed; a stroke itself for the values.
"""

import json
from pathlib import Path
from types import SimpleNamespace

import pytest

import klack
from klack.analyses.sensitivities.record import MeasureSlopes
from klack.analyses.sensitivities.run import _doubts, _impacts, _unbounded
from klack.cli.main import main
from klack.errors import InputError

pytestmark = pytest.mark.slow  # the loop with derivatives compiles for a minute

SMALL = Path(__file__).parents[2] / "docs" / "how-to" / "small_valve.yaml"
STUDY = SMALL.with_name("small_study.yaml")
PRELOAD = "network.components.spring.preload"
MASS = "network.components.needle.mass"
GAP = "network.components.opening.gap"


@pytest.fixture(scope="module")
def dry():
    return klack.sensitivities(SMALL, STUDY)


COIL = """coil:
      type: solenoid
      turns: 60
      resistance: 0.6 ohm
      gap: 100 um
      residual_gap: 50 um
      poles:
        - {inner_radius: 1.95 mm, outer_radius: 3.8 mm, fringing: plane, shoulder: 1 mm}
        - {inner_radius: 4.8 mm, outer_radius: 6 mm, fringing: plane, shoulder: 1 mm}
      iron:
        - {material: X6Cr17, length: 20 mm, area: 33 mm^2}
      leakage_share: 10 %
    driver:
      type: peak-hold
      boost_voltage: 65 V
      peak_current: 10 A
      supply_voltage: 14 V
      hold_current: 3.5 A
      hold_band: 0.8 A
      peak_until: 0.5 ms
      decay: 65 V
      end: 1 ms"""


def with_coil(folder):
    """The small valve with a coil in place of its force."""
    text = SMALL.read_text().replace("magnet.end", "coil.armature")
    force = next(line for line in text.splitlines() if "magnet: {type" in line)
    text = text.replace(force.strip(), COIL)
    text = text.replace("[bores.b, ambient]", "[bores.b, ambient]\n    - [coil.base, ground]")
    text = text.replace("[coil.base", "[driver.terminals, coil.terminals]\n    - [coil.base")
    file = folder / "coil.yaml"
    file.write_text(text)
    return file


class TestNumbers:
    @pytest.mark.parametrize(("variant", "by_mass"), [("dry", 0.5), ("wet", 0.74)])
    def test_coils_and_their_controllers_do_not_let_derivatives_grow(
        self, variant, by_mass, tmp_path
    ):
        """Truth: strokes with changed parameters; dry, a mass that is given its work: sqrt(M)."""
        keys = [PRELOAD, "network.components.coil.resistance", MASS]
        record = klack.sensitivities(
            with_coil(tmp_path),
            parameters=keys,
            measures=["opening_time", "opening.impulse", "seat.peak_force"],
            variant=variant,
        )
        time, impulse, force = record.measures
        assert abs(time.predicted - time.secant) < 1.5 * 20e-9  # steps of the two strokes
        assert impulse.deviation < 0.02
        assert force.deviation < 0.15
        assert max(impact.growth for impact in record.impacts) < 1e-3
        assert record.elasticity("opening.impulse", MASS) == pytest.approx(by_mass, abs=0.02)

    @pytest.mark.parametrize("coarse", [4, 16, 64])
    def test_derivatives_stay_at_rest(self, coarse):
        """A needle on its stop for half a millisecond, with forces that round-off changes."""
        case = klack.load_case(SMALL).with_value("run.coarse", coarse)
        record = klack.sensitivities(
            case, parameters=[PRELOAD], measures=["closing_time"], variant="wet"
        )
        assert record.measures[0].deviation < 0.03

    def test_measures_are_those_of_the_stroke(self, dry):
        stroke = klack.run_stroke(SMALL, variants=["dry"]).record.variants["dry"]
        values = {item.name: item.value for item in dry.measures}

        assert dry.variant == "dry"
        assert values["opening_time"] == pytest.approx(stroke.opening_time, rel=1e-9)
        assert values["opening.peak_force"] == pytest.approx(
            stroke.impacts("opening")[0].peak_force, rel=1e-4
        )

    @pytest.mark.parametrize("variants", ["dry, wet", "wet, dry"])
    def test_the_first_variant_of_the_case_is_the_default(self, variants, tmp_path):
        file = tmp_path / "case.yaml"
        file.write_text(SMALL.read_text().replace("[dry, wet]", f"[{variants}]"))
        found = klack.sensitivities(
            file, parameters=[PRELOAD], measures=["opening_time"], check=False
        )
        assert found.variant == variants[:3]

    def test_derivatives_predict_other_strokes(self, dry):
        assert [item.name for item in dry.parameters] == [PRELOAD, MASS, "lift"]
        for item in dry.measures:
            assert item.deviation < 0.01, item.name
        assert len(dry.impacts) == 10
        for impact in dry.impacts:
            assert impact.deviation < 0.01, impact

    @pytest.mark.parametrize(("variant", "deviation"), [("dry", 0.01), ("wet", 0.03)])
    def test_closing_is_predicted_behind_all_bounces(self, variant, deviation):
        record = klack.sensitivities(
            SMALL, parameters=[PRELOAD, GAP], measures=["closing_time"], variant=variant
        )
        assert record.measures[0].deviation < deviation

    def test_a_rigid_needle_arrives_with_the_work_that_it_was_given(self):
        """M v^2 / 2 = W, a force that reaches as deep as the square root of it."""
        found = klack.sensitivities(
            SMALL,
            parameters=[MASS],
            measures=["opening.approach_speed", "opening.peak_force"],
            variant="dry",
            check=False,
        )
        assert found.elasticity("opening.approach_speed", MASS) == pytest.approx(-0.5, abs=1e-3)
        assert found.elasticity("opening.peak_force", MASS) == pytest.approx(0.0, abs=1e-3)
        assert found.share == 0.0
        assert found.measures[0].secant is None

    def test_linked_keys_follow_their_parameter(self, dry):
        alone = klack.sensitivities(
            SMALL, parameters=[GAP], measures=["opening_time"], variant="dry", check=False
        )
        assert dry.elasticity("opening_time", "lift") == pytest.approx(
            alone.elasticity("opening_time", GAP), rel=1e-6
        )

    def test_more_parameters_than_one_run_carries(self, dry):
        names = [
            PRELOAD,
            MASS,
            GAP,
            "network.components.spring.stiffness",
            "network.components.magnet.force.1",
            "network.components.magnet.force.2",
            "network.components.opening.restitution",
            "network.components.magnet.time.0",
        ]
        record = klack.sensitivities(
            SMALL, parameters=names, measures=["opening_time"], variant="dry", check=False
        )
        slopes = record.measures[0].slopes
        assert len(slopes) == len(names)
        assert slopes[0] == pytest.approx(dry.derivative("opening_time", PRELOAD), rel=1e-9)
        assert slopes[names.index("network.components.opening.restitution")] == pytest.approx(
            0.0, abs=1e-9
        )
        assert slopes[-1] > 0.0  # the force begins later

    def test_notebook_asks_for_names_that_are_there(self, dry):
        with pytest.raises(InputError, match="opening_time"):
            dry.derivative("opening_tim", PRELOAD)
        with pytest.raises(InputError, match="preload"):
            dry.elasticity("opening_time", "preload")


class TestCommand:
    def test_writes_tables_and_numbers(self, tmp_path, capsys):
        file, out = tmp_path / "numbers.json", tmp_path / "out"
        command = ["sensitivities", str(SMALL), "--study", str(STUDY), "--json", str(file)]
        assert main([*command, "--out", str(out)]) == 0
        told = capsys.readouterr().out
        assert "elasticity" in told
        assert "Impacts, and the sensitivity of their times" in told
        numbers = json.loads(file.read_text())
        assert numbers["schema"] == "klack-sensitivities/1"
        slope = numbers["measures"]["opening_time"]["slopes"][PRELOAD]
        assert slope["elasticity"] == pytest.approx(
            slope["derivative"] * 12.0 / numbers["measures"]["opening_time"]["value"]
        )
        assert numbers["derivatives_cpu_time_s"] > 0.0
        assert klack.load_result(out).json == numbers
        assert main(["report", str(out)]) == 0

    @pytest.mark.parametrize(
        ("parameter", "words"),
        [
            ("network.components.spring.preloat", "'preload'"),
            ("network.fluid", "no number with a unit"),
            ("network.components.bores.count", "no number with a unit"),
            ("network.components.seat.gap", "a value of zero"),
            ("network.components.opening.law.stiffness", "klack study with a few values"),
            ("network.ambient.temperature", "table points change"),
            ("run.step", "a setting of the run"),
        ],
    )
    def test_refuses_what_has_no_derivative(self, parameter, words, capsys):
        code = main(
            ["sensitivities", str(SMALL), "--parameter", parameter, "--variant", "wet", "-q"]
        )
        assert code == 2
        assert words in capsys.readouterr().err

    @pytest.mark.parametrize(
        ("measure", "words"),
        [
            ("impacts", "no derivative here"),
            ("noise.loudness", "noise"),
            ("seat.peak_forc", "seat.peak_force"),
        ],
    )
    def test_refuses_measures_without_a_derivative(self, measure, words, capsys):
        code = main(
            ["sensitivities", str(SMALL), "--parameter", PRELOAD, "--measure", measure, "-q"]
        )
        assert code == 2
        assert words in capsys.readouterr().err

    def test_refuses_a_controller_before_any_stroke(self, capsys, monkeypatch):
        monkeypatch.setattr("klack.analyses.sensitivities.slopes.one_variant", None)
        case = SMALL.with_name("controlled_valve.yaml")
        assert main(["sensitivities", str(case), "--parameter", PRELOAD, "-q"]) == 2
        assert "a run with a controller" in capsys.readouterr().err

    def test_refuses_a_case_without_parameters(self, capsys):
        assert main(["sensitivities", str(SMALL), "-q"]) == 2
        assert "--parameter" in capsys.readouterr().err

    def test_study_is_taken_as_far_as_it_can_be(self, tmp_path, capsys):
        study = tmp_path / "study.yaml"
        study.write_text(
            "klack: 1\nstudy:\n  parameters:\n"
            f"    {PRELOAD}: {{from: 10 N, to: 14 N}}\n"
            "    network.components.opening.law.stiffness: {from: 0.9 N/nm, to: 1.1 N/nm}\n"
            "  measures: [opening_time, impacts]\n"
        )
        command = ["sensitivities", str(SMALL), "--study", str(study), "--no-check", "--no-report"]
        code = main([*command, "--out", str(tmp_path / "out")])

        told = capsys.readouterr().out
        assert code == 0
        assert "No derivatives with network.components.opening.law.stiffness" in told
        assert "No derivatives of impacts" in told


def test_growth_of_derivatives_tells_of_chaos_without_a_check():
    """Impacts of which each answers ten times as strongly as the one before."""
    touches = [
        SimpleNamespace(stop="stop", time=(1 + k) * 1e-4, slopes=[1e-5 * 10.0**k]) for k in range(4)
    ]
    space = SimpleNamespace(varied=[SimpleNamespace(size=1.0)])

    found = _impacts([SimpleNamespace(touches=touches)], space, None)

    assert [item.growth for item in found] == pytest.approx([1e-5, 1e-4, 1e-3, 1e-2])
    assert [item.is_doubtful for item in found] == [False, False, True, True]


def test_a_measure_that_no_derivative_moves_is_doubtful_where_runs_move_it():
    """Predicted 0, and two runs tell something else: there is no scale to divide by."""
    told = {"name": "opening_time", "title": "", "unit": "s", "value": 1e-3, "slopes": (0.0,)}
    found = MeasureSlopes(**told, predicted=0.0, secant=4e-7, scale=0.0, resolution=2e-8)

    assert found.deviation is None
    assert found.is_doubtful
    assert not MeasureSlopes(
        **told, predicted=0.0, secant=1e-9, scale=0.0, resolution=2e-8
    ).is_doubtful


def test_shares_of_the_lift_move_with_the_stop_that_ends_it():
    """Truth: two strokes with another lift; at a constant force s ~ t^2, half the exponent."""
    names = [f"opening_time_at_{share}_percent" for share in (50, 90)]
    record = klack.sensitivities(SMALL, parameters=[GAP], measures=names, variant="dry")

    for item in record.measures:
        assert item.deviation < 2e-3
        assert record.elasticity(item.name, GAP) == pytest.approx(0.46, abs=0.03)


def test_a_mass_loses_the_work_that_it_was_given_whatever_it_is():
    """``(1 - e^2) W`` with a restitution of the law: no part of it is the mass."""
    record = klack.sensitivities(
        SMALL, parameters=[MASS], measures=["opening.energy_loss"], variant="dry", check=False
    )
    assert record.elasticity("opening.energy_loss", MASS) == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(
    ("predicted", "secant", "told"),
    [
        (-1.4478e-3, -2.2145e-3, "is_unconfirmed"),  # 53 %, within a thousandth of the value
        (-1.4478e-3, -1.46e-3, None),
        (-1.4e-2, -1.6e-2, "is_rough"),
        (-1.4e-2, -2.2e-2, "is_doubtful"),
    ],
)
def test_what_two_strokes_do_not_confirm_is_told(predicted, secant, told):
    """Truth: deviations of 53, 1, 14 and 57 % of a speed that a run resolves to a thousandth."""
    found = MeasureSlopes(
        name="stop.approach_speed",
        title="",
        unit="m/s",
        value=0.9887,
        slopes=(1.0,),
        predicted=predicted,
        secant=secant,
        scale=abs(predicted),
        resolution=0.9887e-3,
    )
    for kind in ("is_unconfirmed", "is_rough", "is_doubtful"):
        assert getattr(found, kind) == (kind == told), kind
    texts = " ".join(_doubts([found], []))
    assert ("stop.approach_speed" in texts) == (told is not None)


def test_derivatives_of_needles_at_rest_stay_bounded():
    """Four needles on their seats, whose stops are damped: the sub-steps follow them."""
    case = klack.load_case(SMALL.with_name("four_injectors.yaml"))
    found = klack.sensitivities(
        case.with_value("run.duration", "1.4 ms"),
        parameters=["parameters.p_rail"],
        measures=["opening_time"],
        check=False,
    )
    assert not [text for text in found.warnings if "without bound" in text]


def test_derivatives_that_leave_the_motion_are_told():
    class Left:
        """A run whose second direction has left."""

        def without_bound(self, direction: int, size: float) -> float | None:
            return 1.2e-3 if direction == 1 else None

    space = SimpleNamespace(varied=[SimpleNamespace(name=name, size=1.0) for name in "ab"])
    (told,) = _unbounded([Left()], space)
    assert "After 1.2 ms derivatives with respect to b grow without bound" in told
    assert "run.coarse: 16" in told


INJECTOR = SMALL.with_name("injected_mass.yaml")


@pytest.mark.parametrize("start", ["0.1 ms", "0.128 ms"])
def test_a_driver_that_switches_on_the_edge_of_a_step_delays_all_that_follows(start):
    """Before it everything rests, so the opening comes as much later; 0.128 ms are 100 steps."""
    case = klack.load_case(INJECTOR).with_value("network.components.driver.start", start)
    case = case.with_value("run.duration", "0.5 ms")

    found = klack.sensitivities(
        case,
        parameters=["network.components.driver.start"],
        measures=["opening_time"],
        check=False,
    )
    assert found.measures[0].slopes[0] == pytest.approx(1.0, abs=3e-3)  # error of the steps


def test_the_edge_of_a_step_is_no_place_of_its_own_for_coupled_coils():
    """A derivative there is that beside it, but for the error of the steps."""
    found = []
    for start in ("0.128 ms", "0.1281 ms"):
        case = klack.load_case(SMALL.with_name("two_coils.yaml"))
        case = case.with_value("network.components.boost.start", start)
        record = klack.sensitivities(
            case.with_value("run.duration", "0.6 ms"),
            parameters=["network.components.boost.start"],
            measures=["opening_time"],
            check=False,
        )
        found.append(record.measures[0].slopes[0])
    assert 0.9 < found[1] < 1.0  # the other coil pulls before
    assert found[0] == pytest.approx(found[1], abs=1e-3)


@pytest.mark.parametrize("start", ["0.1 ms", "0.128 ms"])
def test_coils_that_switch_at_one_instant_have_a_derivative_each(start):
    """Truth: one of them 0.1 ns later, where they switch one after the other."""
    names = [f"network.components.{name}.start" for name in ("boost", "battery")]
    found = []
    for late in ("", "0001"):
        case = klack.load_case(SMALL.with_name("two_coils.yaml"))
        for name, more in zip(names, ("", late), strict=True):
            case = case.with_value(name, start.replace(" ms", f"{more} ms"))
        record = klack.sensitivities(
            case.with_value("run.duration", "0.6 ms"),
            parameters=names,
            measures=["opening_time"],
            check=False,
        )
        found.append(record.measures[0].slopes)
    # the opening coil counts; 1e-3 is the error of the steps, as above
    assert found[0] == pytest.approx(found[1], abs=1e-3)
    assert found[0][0] > 0.9 > 0.1 > found[0][1] > 5e-4


@pytest.mark.parametrize("jump", ["0.1 ms", "0.128 ms"])
def test_a_table_that_jumps_on_the_edge_of_a_step_delays_all_that_follows(tmp_path, jump):
    """Before it everything rests, so the opening comes as much later; 0.128 ms are 100 steps."""
    text = INJECTOR.read_text()
    driver = text[text.index("    driver:") : text.index("    supply:")]
    table = 'driver: {type: voltage-table, time: ["= t0", "= t0"], voltage: [0 V, 40 V]}'
    text = text.replace(driver, f"    {table}\n").replace("duration: 5 ms", "duration: 0.5 ms")
    given = text[text.index("  pulse:") : text.index("network:")]
    (tmp_path / "table.yaml").write_text(text.replace(given, f"  t0: {jump}\n"))

    found = klack.sensitivities(
        tmp_path / "table.yaml",
        parameters=["parameters.t0"],
        measures=["opening_time"],
        check=False,
    )
    assert found.measures[0].slopes[0] == pytest.approx(1.0, abs=1e-4)  # error of the steps


def test_a_blank_restitution_has_no_derivative():
    """The seat of a clamped insert: while the needle is in contact, the ledge acts as well."""
    found = klack.sensitivities(
        klack.load_case(SMALL.with_name("seat_insert.yaml")).with_value("run.duration", "0.25 ms"),
        parameters=["network.components.sleeve.preload"],
        measures=["seat.restitution", "seat.energy_loss", "seat.peak_force"],
        check=False,
    )
    values = [(item.value, item.slopes[0]) for item in found.measures]
    assert values[:2] == [(None, None)] * 2
    assert None not in values[2]
