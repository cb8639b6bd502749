"""What a notebook imports: cases with other values, runs, results, datasets."""

import copy
import json
import pickle
import statistics
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import klack
from klack.errors import InputError


@pytest.fixture(scope="module")
def rods() -> klack.Result:
    return klack.run_impact("two-rods", levels=["reduced"], certify=False)


def test_import_of_klack_loads_nothing_else():
    """Truth = the modules that Python has loaded, counted."""
    code = "import sys, klack; print([m for m in sys.modules if m in ('numpy', 'pydantic')])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_every_name_of_the_door_is_there():
    assert {name for name in klack.__all__ if getattr(klack, name) is None} == set()
    assert set(klack.__all__) <= set(dir(klack))
    with pytest.raises(AttributeError, match="no attribute 'run_imapct'"):
        _ = klack.run_imapct


class TestValues:
    def test_a_value_is_exchanged_in_text_and_case(self):
        case = klack.load_case("demo-stroke")
        key = "network.components.spring.preload"
        other = case.with_value(key, "14 N")
        assert other.value(key) == 14.0 != case.value(key)
        assert other.text != case.text
        same = [line for line in case.text.splitlines() if line in other.text.splitlines()]
        assert len(same) == len(case.text.splitlines()) - 1

    def test_an_entry_of_a_list_that_is_not_written_is_refused(self):
        """By a value on its own, and by the points of a study."""
        case, told = klack.load_case("demo-valve-axisymmetric"), "'motion.spin', a list that"
        with pytest.raises(InputError, match=told) as error:
            case.with_value("motion.spin.2", "10 rad/s")
        assert "write 'motion.spin: [...]' there" in str(error.value)
        with pytest.raises(InputError, match=told):
            klack.run_many(case, [{"motion.spin.2": "10 rad/s"}], ["peak_force"])

    def test_a_case_prints_as_one_line(self):
        case = klack.load_case("two-rods")
        assert repr(case) == f"two-rods: {case.title} (case.yaml)"

    def test_a_default_is_written_where_it_was_not(self):
        case = klack.load_case("two-rods")
        assert "interface_step" not in case.text
        assert case.with_value("run.interface_step", "3 ns").value("run.interface_step") == 3e-9

    def test_an_entry_of_a_list_is_exchanged(self):
        case = klack.load_case(Path(__file__).parents[2] / "docs" / "how-to" / "small_valve.yaml")
        other = case.with_value("network.components.magnet.force.1", "40 N")
        assert other.value("network.components.magnet.force") == (0.0, 40.0, 35.0, 0.0)
        with pytest.raises(InputError, match="a length"):
            case.with_value("network.components.magnet.force.1", "40 mm")

    def test_a_key_below_a_name_is_one_error(self):
        case = klack.load_case(Path(__file__).parents[2] / "docs" / "how-to" / "small_valve.yaml")
        with pytest.raises(InputError, match=r"network\.fluid: n-heptane"):
            case.with_value("network.fluid.gas_fraction", "1 %")

    @pytest.mark.parametrize(
        ("key", "value", "words"),
        [
            ("motion.sped", "1 m/s", "did you mean 'speed'"),
            ("motion.speed", "1 N", "a force"),
            ("motion.speed", "5", "without unit"),
            ("motion.speed", -1, "without unit"),
            ("motion.speed", None, "one value"),
            ("motion.speed", ["1 m/s"], "one value"),
            ("motion", "1 m/s", "motion"),
            ("", "1 m/s", "keys joined"),
        ],
    )
    def test_what_a_case_does_not_allow_is_one_error(self, key: str, value: object, words: str):
        case = klack.load_case("two-rods")
        with pytest.raises(InputError, match=words):
            case.with_value(key, value)

    def test_a_case_of_another_kind_is_refused(self):
        with pytest.raises(InputError, match="run_stroke"):
            klack.run_impact("demo-stroke")
        with pytest.raises(InputError, match="run_impact"):
            klack.run_stroke("two-rods")


class TestNumbers:
    """Truth = the float that a measure is."""

    @pytest.fixture
    def peak(self, rods: klack.Result) -> klack.Number:
        return rods.measures["reduced"]["peak_force"]

    def test_it_computes_as_the_float_that_it_is(self, peak: klack.Number):
        plain = float(peak)
        assert type(plain) is float
        assert f"{peak:.1f}" == f"{plain:.1f}"
        assert (peak + 1, 2 * peak, -peak, peak**2) == (plain + 1, 2 * plain, -plain, plain**2)
        assert {type(item) for item in (peak + 1, peak / peak, -peak, abs(peak))} == {float}
        assert peak == plain != peak + 1 > peak
        assert {peak: 1}[plain] == 1
        assert round(peak, 1) == round(plain, 1)
        assert np.array([peak, peak]).dtype == np.float64
        assert np.sqrt(peak) == np.sqrt(plain)
        assert json.loads(json.dumps({"peak": peak})) == {"peak": plain}

    def test_its_mean_and_median_are_plain_floats(self, peak: klack.Number):
        plain = float(peak)
        for found in (statistics.mean([peak, peak]), statistics.median([peak, peak])):
            assert (type(found), found) == (float, plain)

    def test_only_its_text_has_the_unit(self, peak: klack.Number):
        assert repr(peak) == str(peak) == f"{peak}" == f"{float(peak)!r} N"

    def test_a_copy_and_a_pickle_keep_what_it_means(self, peak: klack.Number):
        for again in (pickle.loads(pickle.dumps(peak)), copy.deepcopy(peak)):
            assert again == peak
            assert repr(again) == repr(peak)
            assert again.measure.definition == peak.measure.definition
            assert again.measure.printed(again) == peak.measure.printed(peak)

    def test_whole_numbers_truths_and_none_stay_what_they_are(self, peak: klack.Number):
        count, truth, none = (klack.Number(item, "1", peak.measure) for item in (3, True, None))
        assert (repr(count), count.value, count + 0.5) == ("3", 3, 3.5)
        assert (repr(truth), truth.value) == ("True", True)
        assert (repr(none), none.value) == ("none", None)
        assert np.isnan(none)


class TestCurves:
    """Truth = arrays of the record."""

    def test_a_curve_has_short_full_and_plain_names(self, rods: klack.Result):
        pytest.importorskip("xarray")
        history = rods.record.levels["reduced"].history
        for name in ("force", "contact force", "contact_force", ("reduced", "force")):
            np.testing.assert_array_equal(rods[name], history.force)
        force = rods["force"]
        np.testing.assert_array_equal(force.time, history.time)
        assert force.attrs["units"] == "N"
        np.testing.assert_array_equal(rods["velocity short"], history.velocity_a)
        assert float(rods["peak_force"]) == rods.measures["reduced"]["peak_force"]
        # the impulse is the integral of the force, which is a mean over each interval
        impulse = float(force.integrate("time"))
        assert impulse == pytest.approx(rods.measures["reduced"]["impulse"], rel=1e-3)

    def test_an_unknown_or_ambiguous_name_lists_those_it_could_be(self, rods: klack.Result):
        pytest.importorskip("xarray")
        with pytest.raises(KeyError, match="short_velocity, long_velocity"):
            _ = rods["velocity"]
        with pytest.raises(InputError, match="does not contain, expected one of: contact_force"):
            _ = rods["conact_force"]
        assert {"contact_force", "short_velocity", "peak_force"} <= set(rods)
        assert "force" in rods
        assert "velocity" not in rods
        assert ("full", "force") not in rods

    def test_every_axis_has_a_table(self, rods: klack.Result):
        pytest.importorskip("xarray")
        history = rods.record.levels["reduced"].history
        frame = rods.to_dataframe()
        assert frame.index.name == "time"
        np.testing.assert_array_equal(frame["contact_force"], history.force)
        assert frame.attrs["units"]["gap"] == "m"
        edges = rods.to_dataframe("reduced", axis="time_edge")
        np.testing.assert_array_equal(edges.index, history.edges)
        assert {"short_velocity", "long_velocity"} < set(edges)
        with pytest.raises(InputError, match=r"one of: time, time_edge"):
            rods.to_dataframe(axis="seat_time")

    def test_all_axes_in_one_table_are_one_error(self, rods: klack.Result):
        pytest.importorskip("xarray")
        data = rods.to_xarray()
        with pytest.raises(InputError, match=r'to_dataframe\(axis="time"\)'):
            data.to_dataframe()
        np.testing.assert_array_equal(
            data[["contact_force", "gap"]].to_dataframe(),
            rods.to_dataframe()[["contact_force", "gap"]],
        )

    def test_the_first_figure_and_others_by_name(self, rods: klack.Result):
        from matplotlib import pyplot

        axes = rods.plot()
        assert axes.get_xlabel().startswith("time")
        assert axes.figure.number in pyplot.get_fignums()
        assert rods.charts[0] == "force"
        assert len(rods.plot("approach")) == 2
        pyplot.close("all")
        with pytest.raises(InputError, match="one of: force"):
            rods.plot("forse")


class TestResults:
    def test_measures_are_those_of_the_record(self, rods: klack.Result):
        numbers = rods.measures["reduced"]
        measures = rods.record.levels["reduced"].measures
        assert numbers["peak_force"].value == measures.peak_force
        assert numbers["peak_force"].unit == "N"
        assert float(numbers["contact_time"]) == measures.contact_time
        assert repr(numbers["restitution"]) == repr(measures.restitution)
        assert "peak force" in repr(rods)

    def test_json_has_the_keys_of_the_measures(self, rods: klack.Result):
        level = rods.json["levels"]["reduced"]
        for number in rods.measures["reduced"].values():
            assert level[number.measure.json_key] == number.value

    @pytest.mark.slow
    def test_curves_carry_units(self, rods: klack.Result):
        data = rods.to_xarray()
        history = rods.record.levels["reduced"].history
        assert data.contact_force.attrs["units"] == "N"
        assert data.time.attrs["units"] == "s"
        np.testing.assert_array_equal(data.contact_force.values, history.force)
        assert float(data.peak_force) == rods.record.levels["reduced"].measures.peak_force
        with pytest.raises(InputError, match="one of: reduced"):
            rods.to_xarray("full")

    @pytest.mark.slow
    def test_noise_as_a_dataset(self):
        """Truth = the record, and Parseval: the bands hold the energy of the sound."""
        case = klack.load_case(Path(__file__).parents[2] / "docs" / "how-to" / "guided_needle.yaml")
        heard = klack.noise_of(klack.run_impact(case, ["reduced"], certify=False))
        design = heard.record.reference
        data = heard.to_xarray()
        sound = design.sound
        assert sound is not None
        np.testing.assert_array_equal(data.sound_pressure, sound.pressure.values)
        assert data.sound_pressure.attrs["units"] == "Pa"
        # between 20 Hz and 20 kHz lies nearly all of it
        exposure = float((data.sound_pressure**2).integrate("sound_pressure_time"))
        audible = data.band < 20.5e3
        assert float(data.sound_exposure.sum()) <= exposure
        assert bool(data.sound_exposure[audible].notnull().all())
        assert bool(data.sound_exposure[~audible].isnull().all())
        middle = sound.bands.middle
        np.testing.assert_allclose(data.sound_exposure.sel(band=middle), sound.bands.energy, rtol=0)
        force = design.stops[0]
        np.testing.assert_array_equal(data.contact_force_energy, force.bands.energy)
        np.testing.assert_array_equal(data.contact_force_level, force.level)
        frame = heard.to_dataframe()
        assert frame.index.name == "band"
        np.testing.assert_array_equal(frame["sound_exposure"], data.sound_exposure)
        np.testing.assert_array_equal(heard["sound pressure"], sound.pressure.values)
        with pytest.raises(InputError, match=f"one of: {design.name}"):
            heard.to_xarray("loud")

    def test_designs_of_one_name_are_all_there(self, rods: klack.Result):
        twice = klack.noise_of(rods, rods)
        first, second = (design.name for design in twice.record.designs)
        assert second == f"{first} 2"
        assert {first, second} <= set(twice.measures)
        with pytest.raises(InputError, match="2 different names"):
            klack.noise_of(rods, rods, names=["a", "a"])
        with pytest.raises(InputError, match="2 different names"):
            klack.noise_of(rods, rods, names=["a"])

    def test_a_case_is_no_result(self, rods: klack.Result):
        with pytest.raises(InputError, match="the result of an impact or a stroke"):
            klack.noise_of(rods, klack.load_case("two-rods"))  # type: ignore[arg-type]

    def test_nothing_to_compute_is_one_error(self):
        with pytest.raises(InputError, match="at least one impact or stroke"):
            klack.noise_of()
        case = klack.load_case(Path(__file__).parents[2] / "docs" / "how-to" / "guided_needle.yaml")
        with pytest.raises(InputError, match="shots: count"):
            klack.run_shots(case, count=0)

    def test_a_notebook_shows_numbers_warnings_and_a_figure(self, rods: klack.Result):
        page = rods._repr_html_()
        assert "<table>" in page
        assert "data:image/png" in page
        assert len(page) < 200_000
        assert "peak force" in page

    def test_a_stored_result_is_the_same(self, rods: klack.Result, tmp_path: Path):
        again = klack.load_result(rods.save(tmp_path))
        assert again.json == rods.json
        assert again.analysis is rods.analysis
