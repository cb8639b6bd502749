"""Valves that are made after a design, and designs that are compared by them.

Truth: strokes of the changed cases, bit for bit; means and deviations by numpy.
"""

from pathlib import Path

import numpy as np
import pytest

import klack
from klack.cli.main import main
from klack.errors import InputError
from klack.studies.samples import RobustValue

SMALL = Path(__file__).parents[2] / "docs" / "how-to" / "small_valve.yaml"
PRELOAD = "network.components.spring.preload"
GAP = "network.components.opening.gap"
MASS = "network.components.needle.mass"
ROBUST = f"""
  robust:
    scatter:
      {PRELOAD}: 0.3 N
      lift: 2 um
      {MASS}: 0.05 g
    valves: 8
"""
STUDY = f"""klack: 1
study:
  parameters:
    {PRELOAD}: {{from: 10 N, to: 14 N}}
    lift: {{from: 90 um, to: 110 um}}
  linked:
    {GAP}: lift
  measures: [opening_time]
  objectives: {{opening.peak_force: minimise}}
  constraints: {{opening_time: {{most: 165 us}}}}
  search: {{population: 12, generations: 4, refinements: 12}}
  variant: dry
"""


def write(folder, text, name="study.yaml"):
    file = folder / name
    file.write_text(text)
    return file


def columns(record):
    return {item.name: item.values for item in record.columns}


class TestMade:
    @pytest.mark.slow
    def test_valves_scatter_about_the_case(self, tmp_path):
        """Truth: the distribution that was asked for; strokes of changed cases."""
        record = klack.run_study(SMALL, write(tmp_path, STUDY + ROBUST), made=256, threads=2).record
        own = columns(record)

        for name, mean, deviation in (
            (PRELOAD, 12.0, 0.3),
            ("lift", 100e-6, 2e-6),
            (MASS, 3e-3, 5e-5),
        ):
            # Sobol points: mean and deviation to about 1 / points
            assert own[name].mean() == pytest.approx(mean, abs=0.02 * deviation)
            assert own[name].std() == pytest.approx(deviation, rel=0.03)
        np.testing.assert_array_equal(own[GAP], own["lift"])
        changes = {
            PRELOAD: f"{float(own[PRELOAD][7])!r} N",
            GAP: f"{float(own[GAP][7])!r} m",
            MASS: f"{float(own[MASS][7])!r} kg",
        }
        alone = klack.run_many(SMALL, [changes], ["opening_time"], variant="dry")
        assert alone.measures[0].values[0] == own["opening_time"][7]
        assert record.missed[0].points == 256

    def test_a_key_that_is_zero_in_the_case_scatters_too(self, tmp_path):
        """Truth: half of a normal distribution about zero is below it, which a stop refuses."""
        seat = "network.components.seat.gap"
        text = STUDY + ROBUST.replace("lift: 2 um", f"{seat}: 1 um")
        record = klack.run_study(SMALL, write(tmp_path, text), made=8).record
        gaps = columns(record)[seat]
        assert abs(gaps).max() > 0.5e-6
        np.testing.assert_array_equal(record.failed, gaps < 0.0)

    def test_a_bound_by_today_is_told(self, tmp_path):
        text = STUDY.replace("most: 165 us", "most: today + 2 %") + ROBUST
        record = klack.run_study(SMALL, write(tmp_path, text), made=4).record
        assert any("'Today' of a bound" in note for note in record.warnings)

    @pytest.mark.slow
    def test_seed_and_number_of_points_are_those_of_the_design(self, tmp_path):
        text = STUDY + ROBUST
        one = write(tmp_path, text.replace("variant: dry", "design: {seed: 5}"), "a.yaml")
        two = write(
            tmp_path,
            text.replace("variant: dry", "design: {kind: made, points: 8, seed: 5}"),
            "b.yaml",
        )
        asked = klack.run_study(SMALL, one, made=8).record
        written = klack.run_study(SMALL, two).record
        np.testing.assert_array_equal(columns(asked)[PRELOAD], columns(written)[PRELOAD])

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            (STUDY, "no scatter of manufactured valves"),
            (STUDY + ROBUST.replace("lift: 2", "lft: 2"), "'lift'"),
            (STUDY + ROBUST.replace("lift: 2 um", f"{GAP}: 2 um"), "depends on parameters"),
            (STUDY + ROBUST.replace("0.3 N", "0.3 mm"), "0.3 mm"),
            (STUDY + ROBUST.replace("0.3 N", "0 N"), "more than 0"),
            (STUDY + ROBUST.replace(MASS, "network.components.needle.masse"), "masse"),
            (
                STUDY.replace("    lift: {from: 90 um, to: 110 um}", "    lift: {values: [90 um]}")
                + ROBUST.replace("lift: 2 um", "run.duration: 0.1"),
                "0.1",
            ),
            (STUDY.replace(f"{GAP}: lift", f"{GAP}: 1 * lift") + ROBUST, "not known"),
        ],
    )
    def test_what_cannot_be_is_one_error_with_its_line(self, tmp_path, capsys, text, words):
        file = write(tmp_path, text)
        code = main(["study", str(SMALL), "--study", str(file), "--made", "8", "-q"])
        told = capsys.readouterr().err
        assert code == 2
        assert words in told
        assert "study.yaml:" in told
        assert "Traceback" not in told

    @pytest.mark.parametrize("count", ["0", "-3", "2000000"])
    def test_numbers_of_valves_that_cannot_be(self, tmp_path, capsys, count):
        file = write(tmp_path, STUDY + ROBUST)
        assert main(["study", str(SMALL), "--study", str(file), f"--made={count}", "-q"]) == 2
        assert "1 to 1000000" in capsys.readouterr().err


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    file = write(tmp_path_factory.mktemp("robust"), STUDY + ROBUST)
    return file, klack.optimise(SMALL, file, threads=2)


class TestRobustSearch:
    @pytest.mark.slow
    def test_values_are_those_of_the_valves_of_each_design(self, found):
        """Truth: mean and deviation by numpy of strokes computed apart."""
        file, result = found
        own = columns(result.record)
        point = 11
        case = klack.load_case(SMALL)
        for name, unit in ((PRELOAD, "N"), (GAP, "m")):
            case = case.with_value(name, f"{float(own[name][point])!r} {unit}")
        made = columns(klack.run_study(case, file, made=8).record)
        for name in ("opening_time", "opening.peak_force"):
            expected = made[name].mean() + 2.0 * made[name].std(ddof=1)
            assert own[f"{name} (mean + 2 sd)"][point] == pytest.approx(expected, rel=1e-12)

    @pytest.mark.slow
    def test_today_has_its_made_valves_too(self, found):
        file, result = found
        made = columns(klack.run_study(SMALL, file, made=8).record)["opening_time"]
        today = {item.name: item.today for item in result.record.measures}
        expected = made.mean() + 2.0 * made.std(ddof=1)
        assert today["opening_time (mean + 2 sd)"] == pytest.approx(expected, rel=1e-12)

    @pytest.mark.slow
    def test_what_is_shown_names_the_robust_values(self, found):
        told = found[1].record.optimum
        assert told.objectives == ("opening.peak_force (mean + 2 sd)",)
        assert told.bounds == ("opening_time (mean + 2 sd) at most 165 us",)
        assert "8 manufactured valves per design" in told.algorithm

    @pytest.mark.slow
    def test_a_design_with_a_valve_that_fails_has_no_value(self, tmp_path):
        wide = ROBUST.replace("lift: 2 um", "lift: 80 um")
        record = klack.optimise(SMALL, write(tmp_path, STUDY + wide)).record
        failed = ~np.isfinite(columns(record)["opening_time (mean + 2 sd)"])
        assert failed.any()
        notes = [record.notes[i] for i in np.flatnonzero(failed)]
        assert all("manufactured valves have no measures" in note for note in notes)
        assert not record.optimum.kept[failed].any()


def test_the_variant_is_the_first_one_of_the_case(tmp_path):
    """The list of the case says [dry, wet]."""
    text = STUDY.replace("  variant: dry\n", "  design: {points: 2}\n")
    assert klack.run_study(SMALL, write(tmp_path, text)).record.variant == "dry"
    assert klack.run_many(SMALL, [{PRELOAD: "12 N"}], ["opening_time"]).variant == "dry"


class TestRobustValue:
    VALUES = np.array([3.0, 1.0, 4.0, 1.5, 9.0])

    @pytest.mark.parametrize("high", [True, False])
    def test_mean_and_margin(self, high):
        sign = 1.0 if high else -1.0
        found = RobustValue.parse("mean + 1.5 sd", "here").of(self.VALUES, high=high)
        expected = self.VALUES.mean() + sign * 1.5 * self.VALUES.std(ddof=1)
        assert found == pytest.approx(expected, rel=1e-14)

    def test_quantile_of_each_side(self):
        value = RobustValue.parse("quantile 90 %", "here")
        for high, share in ((True, 0.9), (False, 0.1)):
            expected = np.quantile(self.VALUES, share, method="median_unbiased")
            assert value.of(self.VALUES, high=high) == expected

    def test_none_where_one_has_none(self):
        assert np.isnan(RobustValue.parse("mean + 2 sd", "here").of([1.0, np.nan], high=True))

    @pytest.mark.parametrize(
        "text", ["mean", "mean - 2 sd", "mean + 11 sd", "quantile 40 %", "quantile 100 %", "95 %"]
    )
    def test_other_texts_are_refused(self, text):
        with pytest.raises(InputError, match="mean \\+ K sd"):
            RobustValue.parse(text, "robust")
