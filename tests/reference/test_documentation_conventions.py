"""Pages of signs, keys, components and words fit the code.

The page of signs and definitions says what the code does.

Truth: closed results of the simplest cases, each with the sign or reference that the page states.

The pages of keys are those of the schema, and the API page's five lines run.

Truth: the pydantic classes that read a case, through ``klack schema``.

The tables of components name every component type, and no other; truth: the catalogue.

The Python example of the README runs, and its number is the one written beside it.

The commands of "Start in ten minutes" run, and the numbers quoted there are theirs.

Truth: the page; its numbers are our own stored output, so this detects a change and no more.

The comparison of pages with what is printed notices what is wrong.

Every example in a docstring of klack prints what it says.

Truth: the output that stands below the example.  Only files with examples are imported, and only
when their turn comes: klack has ten times as many.
"""

import doctest
import importlib
import importlib.util
import json
import os
import re
import subprocess
import sys
from importlib import import_module
from math import pi, sqrt
from pathlib import Path

import numpy as np
import pytest
from pages import blocks, numbers, printed
from quoted_output import compare

from klack.acoustics.signal_statistics import peak_level, sound_exposure_level
from klack.acoustics.spectrum import (
    energy_spectral_density,
    impulse_level,
    impulse_spectrum,
)
from klack.acoustics.third_octave import band_energies
from klack.analyses.impact.analysis import IMPACT
from klack.analyses.magnet.case import MagnetCase
from klack.case.any_case import read_valve_case
from klack.case.reader import schema_of
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.contact.laws import LinearLaw
from klack.contact.restitution import measure_impact
from klack.network.catalogue import component_class, type_words
from klack.signals.sampled import TimeSeries
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.simulation.impact import simulate_impact
from klack.simulation.system import ContactPair, ReducedSystem

DOCS = Path(__file__).parents[2] / "docs"
MASS, STIFFNESS, SPEED, GAP = 2e-3, 1e9, 0.4, 1e-6  # [kg], [N/m], [m/s], [m]


def test_the_needle_comes_down_is_pushed_up_and_rebounds():
    seat = ContactPair(
        body_a="needle",
        port_a="contact",
        body_b="seat",
        port_b="contact",
        law=LinearLaw(STIFFNESS),
        gap=GAP,
    )
    bodies = (rigid_mass_body("needle", MASS), fixed_body("seat"))
    history = simulate_impact(
        ReducedSystem(bodies=bodies, contacts=(seat,)), speed=SPEED, step=2e-9, duration=15e-6
    )
    measures = measure_impact(history)

    assert history.velocity_a[0] == pytest.approx(-SPEED)
    assert history.velocity_a[-1] == pytest.approx(SPEED, rel=1e-9)  # no loss
    assert history.force.min() >= 0.0
    assert history.gap[0] > 0.0 > history.gap.min()
    assert measures.restitution == pytest.approx(1.0, abs=1e-9)
    # the sum of the means is the change of momentum
    assert history.force.sum() * history.step == pytest.approx(2 * MASS * SPEED, rel=1e-9)
    assert measures.impulse == pytest.approx(2 * MASS * SPEED, rel=1e-4)
    assert measures.contact_time == pytest.approx(pi * sqrt(MASS / STIFFNESS), rel=1e-5)
    assert measures.restitution == pytest.approx(measures.impulse / (MASS * SPEED) - 1, abs=1e-4)


def test_zero_decibels_are_where_the_page_says():
    step, width = 1e-7, 10e-6
    time = (np.arange(2000) + 0.5) * step
    shape = np.where((time > width) & (time < 2 * width), np.sin(pi * (time - width) / width), 0.0)
    pulse = TimeSeries(step=step, values=1e-6 * shape / (shape.sum() * step), unit="N")  # 1 uN s
    spectrum = impulse_spectrum(pulse, resolution=100.0)
    density = energy_spectral_density(spectrum)
    low = spectrum.frequency < 1000.0  # flat there to (f T)^2 = 1e-4

    assert np.allclose(impulse_level(spectrum)[low], 0.0, atol=0.01)
    assert np.allclose(10 * np.log10(density.values[low] / 1e-12), 10 * np.log10(2.0), atol=0.01)
    whole = np.sum(pulse.values**2) * step
    bands = band_energies(density, low=20.0, high=4e5)
    assert bands.energy.sum() < whole
    assert np.trapezoid(np.real(density.values), density.frequency) == pytest.approx(
        whole, rel=1e-3
    )
    level = bands.level_re(1e-12)  # (1 uN)^2 s
    assert np.allclose(level, 10 * np.log10(bands.energy / 1e-12))

    second = TimeSeries(step=1e-4, values=np.full(10_000, 20e-6), unit="Pa")
    assert peak_level(second) == pytest.approx(0.0, abs=1e-9)
    assert sound_exposure_level(second) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
def test_a_positive_force_opens_and_the_spring_closes():
    from klack.analyses.stroke.run import run_stroke

    page = (DOCS / "reference" / "valve-case.md").read_text(encoding="utf-8")
    example = re.search(r"```yaml\n(.*?)```", page, re.DOTALL)
    assert example is not None
    study = run_stroke(read_valve_case(example[1], Path("example.yaml")))
    lift = study.variants["dry"].channel(study.channels.lift)

    # 30 N along +z against 12 N of preload and 0.8 N of rate: up to the stop at 80 um, then back
    assert lift.values.max() == pytest.approx(80e-6, rel=0.05)
    assert abs(lift.values[-1]) < 2e-6
    assert lift.values.min() > -2e-6


def load(name: str):
    spec = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


CASE_KEYS = load("case_keys")


@pytest.mark.slow
@pytest.mark.parametrize("name", list(CASE_KEYS.PAGES))
def test_the_page_is_fresh(name):
    title, about, kind = CASE_KEYS.PAGES[name]
    stored = (DOCS / "reference" / f"{name}.md").read_text(encoding="utf-8")

    assert CASE_KEYS.page(title, about, schema_of(kind)) == stored, "run: python docs/case_keys.py"


@pytest.mark.parametrize(
    ("name", "kind"),
    [("case-keys", Case), ("valve-keys", ValveCase), ("magnet-keys", MagnetCase)],
)
def test_every_key_of_every_section_has_its_row(name, kind):
    text = (DOCS / "reference" / f"{name}.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([^`]+)` \|", text, re.MULTILINE)
    schema = schema_of(kind)
    sections = [schema, *schema["$defs"].values()]

    assert len(rows) >= sum(len(section["properties"]) for section in sections)
    for section in sections:
        assert set(section["properties"]) <= set(rows)


def test_defaults_limits_and_units_are_told():
    text = (DOCS / "reference" / "case-keys.md").read_text(encoding="utf-8")

    assert "| `reduced_step` | time [s], as `40 us` | 20 ns | above 0 |" in text
    assert "| `poisson` | number without a unit, as `0.3` | *required* |" in text
    assert re.search(r"\| `count` \| whole number \| .* \| at least 1 \|", text)


def test_links_inside_a_page_lead_to_its_headings():
    for name in CASE_KEYS.PAGES:
        text = (DOCS / "reference" / f"{name}.md").read_text(encoding="utf-8")
        anchors = re.findall(r"\]\(#([^)]+)\)", text)
        heads = {CASE_KEYS.anchor(head) for head in re.findall(r"^## (.*)$", text, re.MULTILINE)}

        assert len(anchors) > 10
        assert set(anchors) <= heads


@pytest.mark.slow
def test_five_lines_of_python():
    page = (DOCS / "reference" / "api.md").read_text(encoding="utf-8")
    code = blocks(page, "python")[0]
    written = numbers(code, r"# ([\d.]+) N, ([\d.]+) us")
    peak, time = re.findall(r"[\d.]+", printed(code, "api.md"))

    # the last digit may differ with the version of the mesher
    assert float(peak) == pytest.approx(written[0], rel=2e-3)
    assert float(time) == pytest.approx(written[1], rel=5e-3)


def test_the_page_of_measures_is_fresh():
    stored = (DOCS / "reference" / "measures.md").read_text(encoding="utf-8")

    assert load("measures_page").page() == stored, "run: python docs/measures_page.py"


def test_the_page_of_results_is_fresh():
    stored = (DOCS / "reference" / "json.md").read_text(encoding="utf-8")

    assert load("json_page").page() == stored, "run: python docs/json_page.py"


REFERENCE = Path(__file__).parents[2] / "docs" / "reference"
PAGES = sorted(REFERENCE.glob("*components.md"))
_HEAD = re.compile(r"^\| klack \|.*\| tested against \|$")
_CODE = re.compile(r"`([^`]+)`")


def rows() -> list[tuple[str, list[str]]]:
    """Page and cells of every row of the tables that begin with klack."""
    found = []
    for page in PAGES:
        inside = False
        for line in page.read_text(encoding="utf-8").splitlines():
            if not line.startswith("|"):
                inside = False
            elif _HEAD.match(line):
                inside = True
            elif inside and not line.startswith("|--"):
                found.append((page.name, [cell.strip() for cell in line[1:-1].split("|")]))
    return found


def named(cell: str) -> tuple[list[str], list[str]]:
    """Types that a cell of the first column names, and the keys after 'with'."""
    before, _, after = cell.partition(" with ")
    return _CODE.findall(before), _CODE.findall(after)


def test_every_component_stands_in_a_table():
    listed = {word for _, cells in rows() for word in named(cells[0])[0]}

    assert sorted(set(type_words()) - listed) == []


def test_the_tables_name_what_exists():
    words = set(type_words())
    for page, cells in rows():
        types, keys = named(cells[0])
        assert types, (page, cells[0])
        assert set(types) <= words, (page, cells[0])
        for key in keys:
            assert keys_of(types[0], key), (page, cells[0], key)


def keys_of(word: str, key: str) -> bool:
    """Whether a component has a key, itself or in one of its parts."""
    fields = component_class(word).model_fields
    inner = [
        part
        for field in fields.values()
        for part in re.findall(r"klack[\w.]*\.\w+", str(field.annotation))
    ]
    return key in fields or any(key in getattr(resolve(name), "model_fields", ()) for name in inner)


def resolve(path: str) -> object:
    """Class of a dotted path."""
    module, name = path.rsplit(".", 1)
    try:
        return getattr(import_module(module), name, None)
    except ImportError:
        return None


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_each_row_names_others_and_a_number_or_a_truth(page):
    found = [cells for name, cells in rows() if name == page.name]

    assert len(found) > 5
    for cells in found:
        assert len(cells) == 5, cells[0]
        assert cells[-1], cells[0]


README = Path(__file__).parents[2] / "README.md"


@pytest.mark.slow
def test_python_example_of_the_readme():
    code = blocks(README.read_text(), "python")[0]
    found = float(printed(code, str(README)).split()[0])
    # the last digit may differ with the version of the mesher
    assert found == pytest.approx(numbers(code, r"# ([\d.]+) N")[0], rel=2e-3)


def test_readme_has_exactly_two_commands_for_setting_up():
    section = README.read_text().split("## Two commands")[1].split("\n## ")[0]
    blocks = re.findall(r"```\n(.*?)\n```", section, re.DOTALL)
    assert blocks == ["pip install uv && uv run klack demo", "uv run --group dev pytest"]


ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "start.md").read_text(encoding="utf-8")


def blocks_start(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


def run(commands: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the lines of a block in a shell whose ``klack`` is the one under test."""
    program = f'klack() {{ "{sys.executable}" -m klack "$@"; }}\n'
    return subprocess.run(
        ["bash", "-c", f"set -e\n{program}{commands}"],
        cwd=folder,
        env={**os.environ, "NO_COLOR": "1", "COLUMNS": "200"},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
def test_the_commands_run_and_give_the_quoted_numbers(tmp_path):
    (tmp_path / "cases").symlink_to(ROOT / "cases")
    first, own, _ = blocks_start("sh")

    done = run(first, tmp_path)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "klack-results" / "demo-valve-axisymmetric"
    assert {"report.html", "report.pdf", "result.zarr"} <= {file.name for file in folder.iterdir()}
    which = r"(?: \(contact \d of \d\))?"
    row = rf"^([a-z-]+) +([\d.]+){which} +([\d.]+){which} +([\d.]+) +([\d.]+) "
    rows = re.findall(row, PAGE.split("\n## ")[2], re.MULTILINE)
    study = IMPACT.load(folder)
    assert {row[0] for row in rows} == set(study.levels)
    for level, peak, time, impulse, restitution in rows:
        measures = study.levels[level].measures
        # the last digits may differ with the version of the mesher
        assert measures.peak_force == pytest.approx(float(peak), rel=2e-3)
        assert measures.impulse * 1e3 == pytest.approx(float(impulse), rel=1e-3)
        assert measures.restitution == pytest.approx(float(restitution), abs=1e-3)
        if level != "reduced-attachment":  # it chatters
            assert measures.contact_time * 1e6 == pytest.approx(float(time), rel=5e-3)

    done = run(own, tmp_path)
    assert done.returncode == 0, done.stderr
    quoted = re.search(r"At 0\.5 m/s the peak is ([\d.]+) N", PAGE)
    assert quoted is not None
    numbers = json.loads((tmp_path / "numbers.json").read_text())["levels"]["reduced"]
    assert numbers["peak_force_N"] == pytest.approx(float(quoted[1]), rel=2e-3)

    done = run(blocks_start("sh-fails")[0], tmp_path)
    assert done.returncode == 2
    message = re.search(r"```\n(klack impact: my-valve.*?)```", PAGE, re.DOTALL)
    assert message is not None
    assert message[1].split() == done.stderr.split()


@pytest.mark.slow
def test_the_drawn_valve_of_the_page_gives_what_stands_below_it(tmp_path):
    (tmp_path / "drawn-valve.yaml").write_text(blocks_start("yaml")[0], encoding="utf-8")

    done = run(blocks_start("sh")[2], tmp_path)

    assert done.returncode == 0, done.stderr
    assert "Note" not in done.stdout + done.stderr
    assert "cannot be relied on" not in done.stdout
    compare(blocks_start("text")[0], done.stdout, "start.md: drawn-valve.yaml")


def test_every_command_of_the_page_exists():
    from klack.cli.commands import parser

    for name in set(re.findall(r"`klack (\w+)", PAGE)):
        parser[name]


def test_the_comparison_sees_a_wrong_number_a_wrong_word_and_a_missing_line() -> None:
    printed = "  level     force [N]   wall time [s]\n ─────\n  reduced   123.4    0.1\nall done\n"
    compare("level   force [N]   wall time [s]\nreduced   123.9   9.9\nall done\n", printed, "")
    for wrong in ("reduced  125.6  0.1", "full  123.4  0.1", "all done\nreduced  123.4  0.1"):
        with pytest.raises(AssertionError, match="not printed"):
            compare(wrong, printed, "")


SOURCE = Path(__file__).parents[2] / "src"
MODULES = [
    ".".join(path.relative_to(SOURCE).with_suffix("").parts)
    for path in sorted((SOURCE / "klack").rglob("*.py"))
    if re.search(r"^ *>>> ", path.read_text("utf-8"), re.MULTILINE)
]


@pytest.mark.parametrize("module", MODULES)
def test_examples_print_what_they_say(module, as_for_a_user):
    said: list[str] = []
    runner = doctest.DocTestRunner(verbose=False, optionflags=doctest.ELLIPSIS)
    for example in doctest.DocTestFinder(exclude_empty=True).find(importlib.import_module(module)):
        runner.run(example, out=said.append)

    assert not said, "".join(said)
    assert runner.tries > 0, f"{module} has >>>, and no example in a docstring"
