"""What a notebook imports: cases with other values, runs, results, datasets."""

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
