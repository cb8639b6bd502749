"""klack noise through main(argv), on the axisymmetric demo valve and the rigid valve of the how-to.

Truth: the energy that the impact itself found in the modes of the housing, a dense Fourier sum of
the stored force, the sound files read back, and the numbers printed on the how-to page.
"""

import json
import re
from dataclasses import replace
from pathlib import Path
from shutil import copytree
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import simpson

from klack.acoustics.boundary import outline
from klack.acoustics.mount import Mount
from klack.analyses.impact.analysis import IMPACT
from klack.analyses.noise.analysis import NOISE
from klack.analyses.noise.content import noise_content
from klack.analyses.noise.figures import own_sound_charts
from klack.analyses.noise.own_sound import own_sound
from klack.analyses.noise.record import NoiseDesign
from klack.analyses.noise.run import noise_design
from klack.analyses.noise.sounds import study_sounds
from klack.analyses.noise.source import load_sources
from klack.cli.main import main
from klack.errors import AccuracyWarning

ROOT = Path(__file__).parents[2]
HOW_TO = ROOT / "docs" / "how-to"
RIGID = HOW_TO / "small_valve.yaml"
NUMBERS = {
    "third_octave",
    "injected_energy_J",
    "radiated_energy_J",
    "loudness_max_sone",
    "sharpness_acum",
    "kurtosis",
    "crest_factor",
    "sound_exposure_level_dB",
    "peak_level_dB",
    "valid_up_to_Hz",
    "designs",
}


@pytest.fixture(scope="module")
def impact(tmp_path_factory) -> Path:
    """Stored result of the shipped impact, reduced level."""
    folder = tmp_path_factory.mktemp("impact") / "out"
    words = ["--level", "reduced", "--level", "lumped", "--no-certify", "--no-report", "-q"]
    assert main(["impact", "demo-valve-axisymmetric", *words, "--out", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def heard(impact: Path, tmp_path_factory) -> Path:
    """Noise of it, with report."""
    folder = tmp_path_factory.mktemp("noise")
    words = ["--out", str(folder), "--json", str(folder / "numbers.json"), "-q"]
    assert main(["noise", str(impact), *words]) == 0
    return folder


@pytest.fixture(scope="module")
def numbers(heard: Path) -> dict:
    return json.loads((heard / "numbers.json").read_text())


def test_numbers_have_the_promised_keys(numbers):
    assert set(numbers) >= NUMBERS
    (name,) = numbers["designs"]
    assert name == "demo-valve-axisymmetric"
    assert all(numbers["designs"][name][key] == numbers[key] for key in NUMBERS - {"designs"})
    assert all(isinstance(numbers[key], float) for key in NUMBERS - {"designs", "third_octave"})
    bands = numbers["third_octave"]
    # IEC 61260-1, base ten: 20 Hz to 200 kHz
    exact = 1000.0 * 10.0 ** (np.arange(-17, 24) / 10.0)
    np.testing.assert_allclose([band["center_Hz"] for band in bands], exact, rtol=1e-12)
    assert [bands[i]["nominal"] for i in (0, 17, 40)] == ["20 Hz", "1 kHz", "200 kHz"]


def test_third_octaves_are_those_of_the_stored_force(impact, numbers):
    history = IMPACT.load(impact).levels["reduced"].history
    levels = {round(b["center_Hz"]): b["level_dB"] for b in numbers["third_octave"]}
    time, step = history.time, history.step
    for k in (-10, 0, 10, 15, 20):
        middle = 1000.0 * 10.0 ** (k / 10.0)
        f = np.linspace(middle * 10**-0.05, middle * 10**0.05, 401)
        spectrum = np.array([(history.force * np.exp(-2j * np.pi * x * time)).sum() for x in f])
        energy = np.trapezoid(2.0 * np.abs(spectrum * step) ** 2, f)
        # straight lines between lines of the spectrum, half a decibel in the notch at 40 kHz
        expected = 10.0 * np.log10(energy / 1e-12)
        assert levels[round(middle)] == pytest.approx(expected, abs=0.05)


def test_injected_energy_is_what_the_impact_left_in_the_modes(impact, numbers):
    result = IMPACT.load(impact).levels["reduced"]
    (modal,) = [item for item in result.modal_energy if item.body == "housing"]

    # no damping: all that went in is still there; the impact knows it from its own propagation
    assert numbers["injected_energy_J"] == pytest.approx(modal.energy.sum(), rel=1e-6)
    assert result.energies["housing vibration"] == pytest.approx(modal.energy.sum(), rel=1e-9)


def test_the_stop_has_the_impulse_of_the_impact(impact, numbers):
    history = IMPACT.load(impact).levels["reduced"].history

    (stop,) = numbers["stops"].values()
    assert stop["impulse_Ns"] == pytest.approx(history.impulse, rel=1e-12)


def test_sounds_have_the_stated_level(heard, numbers):
    soundfile = pytest.importorskip("soundfile")
    for name in ("click.wav", "pattern.wav"):
        with soundfile.SoundFile(heard / name) as file:
            assert (file.samplerate, file.channels, file.subtype) == (48_000, 1, "PCM_24")
            values = float(re.search(r"full scale = ([\d.e+-]+) Pa", file.comment)[1]) * file.read()
        peak = 20.0 * np.log10(np.abs(values).max() / 20e-6)
        # 24 bit, the scale written with six digits; the pattern has every peak between samples
        assert peak == pytest.approx(numbers["peak_level_dB"], abs=0.3)
        if name == "click.wav":
            exposure = 10.0 * np.log10((values**2).sum() / 48_000 / 4e-10)
            assert exposure == pytest.approx(numbers["sound_exposure_level_dB"], abs=1e-3)


def test_the_table_says_how_levels_are_weighted(heard):
    """A-weighting takes from what is radiated below 1 kHz and adds a decibel at 2 to 4 kHz."""
    study = NOISE.load(heard)
    (table,) = NOISE.told(study)
    (row,) = table.rows
    shown = dict(zip(table.columns, row, strict=True))
    levels = study.designs[0].sound.statistics

    assert float(shown["SEL [dBA]"]) == pytest.approx(levels.exposure_level_A, abs=0.05)
    assert float(shown["SEL [dBZ]"]) == pytest.approx(levels.exposure_level, abs=0.05)
    assert float(shown["peak [dBZ]"]) == pytest.approx(levels.peak_level, abs=0.05)


def test_the_click_carries_the_radiated_energy(heard):
    """Monopole: the exposure on a sphere about it, over the impedance of air, is the energy."""
    (design,) = NOISE.load(heard).designs
    audible = design.radiated_bands[design.band_middle < 20e3].sum()
    settings = design.settings
    impedance = settings.air_density * settings.sound_speed
    exposure = impedance * audible / (4.0 * np.pi * settings.distance**2)

    found = design.sound.statistics.exposure_level
    # bands are sums over the spectrum, the click is a filtered signal that fades from 20 kHz on
    assert found == pytest.approx(10.0 * np.log10(exposure / 4e-10), abs=0.1)


def test_the_report_holds_players_and_says_what_it_is(heard):
    page = (heard / "report.html").read_text(encoding="utf-8")

    assert page.count("<audio controls") == 2
    for words in ("media-src data:", "is not a bound", "estimate"):
        assert words in page
    assert (heard / "report.pdf").read_bytes().startswith(b"%PDF")


def test_a_stored_study_comes_back(heard):
    (design,) = NOISE.load(heard).designs

    assert design.bodies[0].mobility.dtype == np.complex128
    assert design.sound.pressure.unit == "Pa"
    assert design.bodies[0].groups == ("outside", "bottom", "plate")


@pytest.mark.slow
def test_a_stored_study_is_reported_again(heard, tmp_path):
    assert main(["report", str(heard), "--out", str(tmp_path / "again"), "-q"]) == 0
    again = (tmp_path / "again" / "report.html").read_text(encoding="utf-8")
    assert again == (heard / "report.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_two_designs_stand_side_by_side(impact, tmp_path, capsys):
    other = copytree(impact, tmp_path / "other")
    words = ["--out", "ab", "--json", "ab.json", "--no-report"]
    assert main(["noise", str(impact), str(other), *words]) == 0

    found = json.loads(Path("ab.json").read_text())["designs"]
    assert list(found) == ["out", "other"]
    # the same valve twice: no difference at all
    assert found["out"] == found["other"]
    assert {path.name for path in Path("ab").glob("*.wav")} == {
        f"{what}-{name}.wav" for what in ("click", "pattern") for name in ("out", "other")
    }
    out = capsys.readouterr().out
    assert "0.5 % of critical damping is assumed" in out
    assert re.search(r"other - out( +\+0\.0 dB){8}( +x 1){2}", out)


def test_differences_of_two_designs_are_levels(heard):
    """Truth: 3.01 dB of twice the energy."""
    study = NOISE.load(heard)
    (design,) = study.designs
    bodies = tuple(replace(body, injected=2.0 * body.injected) for body in design.bodies)
    loud = replace(design, name="loud", net_share=4.0 * design.net_share, bodies=bodies)

    (table,) = NOISE.told(replace(study, designs=(design, loud)))

    shown = dict(zip(table.columns, table.rows[-1], strict=True))
    assert shown["design"] == f"loud - {design.name}"
    assert shown["force [dB]"] == "+6.0 dB"
    assert shown["injected [uJ]"] == "+3.0 dB"
    assert shown["SEL [dBA]"] == "+0.0 dB"


@pytest.mark.slow
def test_levels_of_one_result_are_compared(impact):
    words = ["--level", "reduced,lumped", "--json", "levels.json", "--no-report", "-q"]
    assert main(["noise", str(impact), *words]) == 0

    reduced, lumped = json.loads(Path("levels.json").read_text())["designs"].values()
    # rigid masses on a stiff spring: a shorter and higher blow, known up to no frequency
    assert lumped["third_octave"][-5]["level_dB"] > 10 + reduced["third_octave"][-5]["level_dB"]
    assert lumped["valid_up_to_Hz"] is None
    assert reduced["valid_up_to_Hz"] > 1e5


def test_a_rigid_valve_has_spectra_alone():
    words = ["--variant", "dry", "--json", "rigid.json", "--out", "rigid", "-q", "--no-report"]
    assert main(["noise", str(RIGID), *words]) == 0

    found = json.loads(Path("rigid.json").read_text())
    assert set(found["stops"]) == {"seat", "opening"}
    assert len(found["third_octave"]) == 41
    assert found["injected_energy_J"] is None
    assert found["loudness_max_sone"] is None
    assert not list(Path("rigid").glob("*.wav"))
    content = noise_content(NOISE.load(Path("rigid")))
    assert any("only the spectra of the force are known" in text for text in content.warnings)
    assert [section.title for section in content.sections] == [
        "Force of the stops",
        "Spectrum of the force",
        "What was assumed",
        "Computing time",
    ]


def _no_result(impact: Path, heard: Path, folder: Path) -> list[str]:
    return ["nowhere"]


def _its_own(impact: Path, heard: Path, folder: Path) -> list[str]:
    return [str(heard)]


def _no_level(impact: Path, heard: Path, folder: Path) -> list[str]:
    return [str(impact), "--level", "ful"]


def _variant(impact: Path, heard: Path, folder: Path) -> list[str]:
    return [str(impact), "--variant", "wet"]


def _older(impact: Path, heard: Path, folder: Path) -> list[str]:
    IMPACT.save(replace(IMPACT.load(impact), structures=()), folder / "old")
    return [str(folder / "old")]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (_no_result, ["neither a file nor a shipped case"]),
        (_its_own, ["klack noise study", "the result of an impact or a stroke"]),
        (_no_level, ["'ful'", "reduced", "lumped"]),
        (_variant, ["level: got 'wet'", "impacts have levels, strokes have variants: --level"]),
        (_older, ["an earlier version of klack", "run the case again"]),
    ],
)
def test_what_cannot_be_used_is_said(impact, heard, tmp_path, capsys, words, told):
    assert main(["noise", *words(impact, heard, tmp_path), "--no-report"]) == 2

    err = capsys.readouterr().err
    assert all(text in err for text in told)
    assert not Path("klack-results").exists()


def sounding(impact: Path, **noise: object) -> NoiseDesign:
    """Of the stored impact, with other keys of its section."""
    (source,) = load_sources(impact)
    return noise_design(replace(source, noise=source.noise.model_copy(update=noise)))


def own_bands(design: NoiseDesign) -> np.ndarray:
    """Radiated by the body itself, without the plate."""
    (body,) = design.bodies
    return body.radiated[[name != "plate" for name in body.groups]].sum(axis=0)


def test_boundary_elements_take_off_what_a_small_valve_cannot_radiate(impact):
    """Shaking as a whole: f^4 against the f^2 of the piston; plane waves at the top."""
    piston, found = (sounding(impact, radiation=word) for word in ("piston", "elements"))
    apart = 10.0 * np.log10(own_bands(piston) / own_bands(found))
    middle = found.band_middle
    assert found.settings.radiation == "elements"
    assert "over openings" in found.settings.outside
    low = (middle > 90.0) & (middle < 900.0)
    slope = np.polyfit(np.log2(middle[low]), apart[low], 1)[0]
    assert slope == pytest.approx(-20.0 * np.log10(2.0), abs=0.3)  # dB per octave
    assert apart[np.isclose(middle, 1e3)] > 20.0
    assert np.abs(apart[(middle > 35e3) & (middle < 60e3)]).max() < 1.0
    (body,) = found.bodies
    assert body.groups == ("outside", "bottom", "rest of the outside", "plate")
    assert np.all(own_bands(found) > 0.0)
    plate = [b.radiated[-1] for d in (piston, found) for b in d.bodies]
    assert plate[0] == pytest.approx(plate[1], rel=1e-12)
    # around the valve arrives what leaves its surface, over angle and over time
    own = found.own_sound
    assert own is not None
    assert piston.own_sound is None
    density = own.exposure * np.sin(own.angle)
    settings = found.settings
    around = 2.0 * np.pi * settings.distance**2 * simpson(density, x=own.angle, axis=1)
    around /= settings.air_density * settings.sound_speed
    heard = (own.middle > 500.0) & (own.middle < 18e3)
    left = 10.0 * np.log10(around / own_bands(found)[: own.middle.size])
    assert np.abs(left[heard]).max() < 0.3
    for series, angle in ((own.axis, 0), (own.side, 18)):
        energy = float((series.values**2).sum() * series.step)
        assert own.exposure[:-1, angle].sum() < energy < 1.02 * own.exposure[:, angle].sum()
        assert np.abs(series.values[-100:]).max() < 1e-4 * np.abs(series.values).max()
    study = SimpleNamespace(designs=[found])
    assert [chart.name for chart in own_sound_charts(study)] == ["directivity", "own-click"]
    files = {name: pressure for name, _, pressure in study_sounds(study)}
    assert list(files)[:2] == ["click.wav", "pattern.wav"]
    assert files["own-surface-on-the-axis.wav"] is own.axis
    assert files["own-surface-beside.wav"] is own.side


def test_a_record_without_room_for_its_sound_is_named(impact, monkeypatch):
    """Truth: 1 s of force does not fit into half of a period of 1.67 s."""

    def longer(source, acting, around, distance):
        slow = {
            body: {key: replace(x, step=1.0 / x.values.size) for key, x in forces.items()}
            for body, forces in acting.items()
        }
        return own_sound(source, slow, around, distance)

    monkeypatch.setattr("klack.analyses.noise.run.own_sound", longer)
    with pytest.warns(AccuracyWarning, match="last 1 s, more than 800 ms"):
        assert sounding(impact, radiation="elements").own_sound is None


def test_a_valve_that_rings_on_is_heard_longer(impact, monkeypatch):
    """On a mount of 8 kHz the energy falls as exp(-2 pi f eta t); 1e-4 of it is cut off."""

    def kept(loss_factor):
        def on(source, acting, around, distance):
            mass = sum(own.mass for own in source.structures)
            mount = Mount(stiffness=(16e3 * np.pi) ** 2 * mass, loss_factor=loss_factor, mass=mass)
            return own_sound(source, acting, replace(around, plate=None, mount=mount), distance)

        monkeypatch.setattr("klack.analyses.noise.run.own_sound", on)
        side = sounding(impact, radiation="elements").own_sound.side
        return side.start + side.values.size * side.step

    assert kept(3e-3) == pytest.approx(np.log(1e4) / (2.0 * np.pi * 8e3 * 3e-3), rel=0.01)
    with pytest.warns(AccuracyWarning, match="rings for longer than 110 ms"):
        kept(1e-4)


def test_directivity_ends_where_elements_hold(impact, monkeypatch):
    """Above, the far pressure is not known: no bands, no curves, no sound over time."""
    coarse = 5e3

    def coarser(source, acting, around, distance):
        ways = {k: replace(way, holds_up_to=coarse) for k, way in around.elements.items()}
        return own_sound(source, acting, replace(around, elements=ways), distance)

    monkeypatch.setattr("klack.analyses.noise.run.own_sound", coarser)
    found = sounding(impact, radiation="elements")
    own = found.own_sound
    assert own.middle[-1] < 1.01 * coarse
    power = np.abs(np.fft.rfft(own.side.values)) ** 2
    f = np.fft.rfftfreq(own.side.values.size, own.side.step)
    assert power[f > 1.2 * coarse].sum() < 1e-3 * power.sum()
    directivity, click = own_sound_charts(SimpleNamespace(designs=[found]))
    labels = [curve.label for curve in directivity.panels[0].curves]
    assert len(labels) == 3
    assert "to 5.0 kHz" in click.note.replace("\xa0", " ")


def test_surfaces_that_enclose_nothing_radiate_as_pistons_and_say_so(impact):
    (source,) = load_sources(impact)
    (own,) = source.structures
    flat = np.abs(own.axial_normals) > 0.9  # the bottom alone
    bottom = replace(
        own,
        faces=own.faces[flat],
        face_group=own.face_group[flat],
        face_area=own.face_area[flat],
        face_shapes=own.face_shapes[flat],
        face_residual=own.face_residual[flat],
        axial_normals=own.axial_normals[flat],
    )
    noise = source.noise.model_copy(update={"radiation": "elements"})
    design = noise_design(replace(source, noise=noise, structures=(bottom,)))
    (note,) = [note for note in design.notes if "pistons" in note]
    assert "enclose nothing" in note
    assert design.settings.radiation == "piston"


def test_large_elements_say_up_to_where_they_hold(impact, monkeypatch):
    """17 mm of outline in elements of 0.7 mm or up to half as much more, in slow air."""
    monkeypatch.setattr(outline, "_MOST", 24)
    design = sounding(impact, radiation="elements", sound_speed=60.0)
    (note,) = [note for note in design.notes if "boundary elements are valid" in note]
    found = float(re.search(r"up to ([\d.]+) kHz", note)[1])
    assert 60.0 / 6.0 / (1.5 * 0.72) < found < 60.0 / 6.0 / 0.7
    assert design.settings.radiation == "elements"


def test_the_page_of_the_how_to_prints_the_right_numbers(numbers):
    text = (HOW_TO / "noise.md").read_text(encoding="utf-8")
    energy, exposure, weighted, loudness = (
        float(re.search(rf"\| {name}[^|]*\| ([\d.]+) {unit} \|", text)[1])
        for name, unit in (
            ("structure-borne energy injected", "uJ"),
            ("sound exposure level", "dB"),
            ("the same, A-weighted", "dBA"),
            ("loudness, loudest moment", "sone"),
        )
    )

    assert 1e6 * numbers["injected_energy_J"] == pytest.approx(energy, abs=6e-4)
    assert numbers["sound_exposure_level_dB"] == pytest.approx(exposure, abs=0.06)
    assert numbers["sound_exposure_level_dBA"] == pytest.approx(weighted, abs=0.06)
    assert numbers["loudness_max_sone"] == pytest.approx(loudness, abs=0.06)
    # the excerpt is that of the case, less its comments
    case = (ROOT / "cases" / "demo-valve-axisymmetric" / "case.yaml").read_text(encoding="utf-8")
    bare = [line.split("  #")[0].rstrip() for line in case.splitlines()]
    (block,) = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)
    assert all(line in bare for line in block.splitlines())
