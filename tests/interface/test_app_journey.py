"""A day of work in the application, step by step; each step checks what a person would see.

One folder, one server that is killed in the middle, two browsers.  The numbers that are compared
come from the results on the disk.
"""

import json
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from app_browser import LONG
from browser_pages import put, text_of, watched
from served_app import Served

sync_api = pytest.importorskip("playwright.sync_api")
pytest.importorskip("nicegui")
pytestmark = pytest.mark.slow

_LEAST = 100  # steps
VALVE, COPY = "valve/case.yaml", "valve/case-2.yaml"


class Walk:
    """One browser, its page, and how many steps it has gone."""

    def __init__(self, browser: Any, server: Served, **more: Any) -> None:
        self.steps = 0
        self.context = browser.new_context(viewport={"width": 1000, "height": 900}, **more)
        self.page = self.context.new_page()
        self.page.set_default_timeout(LONG)
        self.server = server
        self.said = watched(self.page, server.base)
        self.page.goto(server.address)

    def moved_to(self, server: Served) -> None:
        """Another server on the same folder."""
        self.server = server
        self.page.goto(server.address)
        self.page.wait_for_selector("#k-body")
        self.said = watched(self.page, server.base)  # the first list keeps what the end cost

    def sees(self, *texts: str) -> None:
        """Every text is visible, soon."""
        for text in texts:
            self.page.get_by_text(text).first.wait_for(state="visible")
        self.steps += 1

    def no_longer_sees(self, text: str) -> None:
        """A text goes away."""
        sync_api.expect(self.page.get_by_text(text)).to_have_count(0, timeout=LONG)
        self.steps += 1

    def finds(self, is_so: bool, words: str) -> None:
        """Something that is seen is as it should be."""
        assert is_so, words
        self.steps += 1

    def waits(self, script: str, argument: Any = None) -> None:
        """A condition of the page comes true."""
        self.page.wait_for_function(script, arg=argument)
        self.steps += 1

    def goes(self, address: str, *texts: str) -> None:
        """Open a page."""
        self.page.goto(self.server.base + address)
        self.sees(*texts)

    def presses(self, name: str, *texts: str, kind: str = "button") -> None:
        """Click on what has a name; see what follows."""
        self.page.get_by_role(kind, name=name, exact=True).first.click()
        self.sees(*texts)

    def types(self, label: str, text: str, *texts: str, key: str = "Enter") -> None:
        """Fill in a field and leave it with a key; see what follows."""
        field = self.page.get_by_label(label, exact=True)
        field.fill(text)
        field.press(key)
        self.sees(*texts)

    def keys(self, *names: str) -> None:
        """Press keys one after the other."""
        for name in names:
            self.page.keyboard.press(name)

    def focused(self) -> str:
        """What the focus is on, as a screen reader calls it."""
        return str(
            self.page.evaluate(
                "() => { const e = document.activeElement; return e.ariaLabel ||"
                " (e.labels?.length ? e.labels[0] : e).textContent || e.id; }"
            )
        ).strip()

    def row(self, text: str) -> Any:
        """Row of a list."""
        return self.page.locator(".k-row", has_text=text).last


@pytest.fixture
def serve() -> Iterator[Callable[[Path], Served]]:
    """Servers on folders; none outlives the test."""
    started: list[Served] = []

    def start(folder: Path) -> Served:
        started.append(Served(folder))
        return started[-1]

    yield start
    for server in started:
        server.__exit__()


def begin_with_an_empty_folder(walk: Walk, folder: Path) -> None:
    walk.sees("No case file (YAML) below this folder yet.", "None yet: run a case.")
    walk.finds("token" not in walk.page.url, "the token leaves the address")
    walk.presses("New case", "Copies a case that comes with klack")
    dialog = walk.page.get_by_role("dialog", name="New case")
    walk.waits("() => document.activeElement.closest('[role=dialog]') !== null")
    walk.keys("Escape")
    walk.no_longer_sees("Copies a case that comes with klack")
    walk.waits("() => document.activeElement.textContent === 'New case'")  # the focus returns
    walk.keys("Enter")
    walk.sees("Copies a case that comes with klack")
    for _ in range(9):
        walk.keys("Tab")
        walk.finds(dialog.evaluate("e => e.contains(document.activeElement)"), "focus is kept in")
    copied = walk.page.get_by_label("Copy of")
    copied.select_option("free-travel")
    told = copied.evaluate("e => e.selectedOptions[0].text")
    walk.finds("armature travels freely" in told, "cases are listed with their titles")
    copied.select_option("demo-valve-axisymmetric")
    walk.types("Name", "no/slash", "Copies a case", key="Tab")
    walk.presses("Make", "letters, digits, - and _")
    walk.types("Name", "valve", "Copies a case", key="Tab")
    walk.presses("Make", "Demo valve, axisymmetric", f"impact, {VALVE}")
    walk.finds((folder / VALVE).is_file(), "the case lies in the folder")
    walk.presses("New case", "Copies a case that comes with klack")
    walk.types("Name", "valve", "Copies a case", key="Tab")
    walk.presses("Make", "a file that already exists")
    walk.presses("Cancel", f"impact, {VALVE}")


def duplicate_and_note(walk: Walk, folder: Path) -> None:
    walk.presses(f"Duplicate {VALVE}", "The copy is placed in the same folder")
    walk.presses("Make", f"impact, {COPY}")
    walk.finds((folder / COPY).read_text() == (folder / VALVE).read_text(), "a copy is the same")
    walk.presses(f"Note {COPY}", f"Note on {COPY}")
    walk.page.get_by_role("textbox", name=f"note on {COPY}").fill("softer <b>seat</b> & 'more'")
    walk.presses("Keep", "softer <b>seat</b> & 'more'")
    walk.waits(
        "() => document.activeElement.getAttribute('aria-label') === 'Note valve/case-2.yaml'"
    )
    walk.page.reload()
    walk.sees("softer <b>seat</b> & 'more'")
    walk.presses(f"Note {COPY}", f"Note on {COPY}")
    walk.page.get_by_role("textbox", name=f"note on {COPY}").fill("")
    walk.presses("Keep", f"impact, {COPY}")
    walk.no_longer_sees("softer <b>seat</b>")


def edit_by_form_and_by_text(walk: Walk, folder: Path) -> None:
    walk.presses(f"Edit {COPY}", "valid impact, saved", kind="link")
    before = text_of(walk.page)
    walk.finds(before == (folder / COPY).read_text(), "the text is that of the file")
    walk.types("speed", "0.4 m/s", "valid impact, not saved")
    walk.finds("0.4 m/s" in text_of(walk.page), "the text has what was typed in the form")
    walk.waits("() => document.activeElement.id === 'f-motion.speed'")  # it keeps the focus
    changed = [
        (old, new)
        for old, new in zip(before.splitlines(), text_of(walk.page).splitlines(), strict=True)
        if old != new
    ]
    walk.finds(len(changed) == 1, f"one line of the text changed, not {changed}")
    walk.types("speed", "0.4 kg", "motion.speed")
    walk.sees("not valid, not saved")
    walk.types("speed", "0.4 m/s", "valid impact, not saved")
    walk.no_longer_sees("motion.speed")
    put(walk.page, text_of(walk.page).replace("0.4 m/s", "0.5 m/s"))
    walk.waits("() => document.getElementById('f-motion.speed').value === '0.5 m/s'")
    put(walk.page, text_of(walk.page) + "\nunknown: 3\n")
    walk.sees("not valid, not saved", "unknown")
    put(walk.page, "a: [1, 2\nb: ")
    walk.sees("not valid, not saved")
    put(walk.page, "")
    walk.sees("not valid, not saved")
    put(walk.page, "klack: 1\nx: &a [1]\ny: *a\n")
    walk.sees("not valid, not saved")
    walk.finds((folder / COPY).read_text() == before, "nothing was written")
    walk.presses("Discard changes", "valid impact, saved")
    is_back = "text => document.getElementById('k-yaml').value === text"
    walk.page.wait_for_function(is_back, arg=before, timeout=LONG)  # comes after the words
    levels = "[lumped, reduced-none, reduced-attachment, reduced, full]"
    put(walk.page, before.replace(levels, "[reduced]"))
    walk.sees("valid impact, not saved")
    walk.keys("Control+s")
    walk.sees("valid impact, saved")
    walk.finds((folder / COPY).read_text() == before.replace(levels, "[reduced]"), "it is saved")


def a_conflict_on_saving(walk: Walk, folder: Path) -> None:
    file = folder / COPY
    saved = file.read_text()
    put(walk.page, saved + "# mine\n")
    walk.sees("valid impact, not saved")
    file.write_text(saved + "# theirs\n")
    walk.presses("Save", "Another program has changed the file")
    walk.finds(file.read_text() == saved + "# theirs\n", "what others wrote stays")
    walk.finds("# mine" in text_of(walk.page), "and mine is still there to be copied")
    walk.presses("Discard changes", "valid impact, saved")
    walk.finds("# theirs" in text_of(walk.page), "now theirs is shown")
    file.unlink()
    put(walk.page, saved)
    walk.sees("valid impact, not saved")
    walk.presses("Save", "No such file")
    file.write_text(saved)
    walk.presses("Discard changes", "valid impact, saved")


def run_cancel_and_read(walk: Walk, folder: Path) -> None:
    # a full order of 55 000 steps takes minutes, long enough to be cancelled on any machine
    text = (folder / VALVE).read_text()
    walk.finds(text.count("full_step: 80 ns") == 1, "the step of the full order is in the case")
    (folder / VALVE).write_text(text.replace("full_step: 80 ns", "full_step: 1 ns"))
    walk.goes("/", f"impact, {COPY}")
    walk.presses(f"Run {VALVE}", f"klack impact {VALVE}", "since")
    walk.presses(f"Run {VALVE}", "one at a time")
    walk.page.get_by_role("button", name="Close").first.click()
    walk.page.get_by_role("button", name="Cancel klack-results/valve").focus()
    told = walk.page.get_by_text("since").first
    sync_api.expect(told).not_to_have_text(told.inner_text(), timeout=LONG)
    walk.finds("Cancel" in walk.focused(), f"progress leaves the focus, not on {walk.focused()}")
    walk.keys("Enter")
    walk.sees("cancelled, ")
    walk.finds(not (folder / "klack-results/valve/result.zarr").exists(), "nothing half written")
    walk.presses("Dismiss klack-results/valve", f"impact, {COPY}")
    walk.no_longer_sees("cancelled, ")
    walk.presses(f"Run {COPY}", f"klack impact {COPY}", "done in ")
    walk.sees("klack impact · klack-results/case-2", "peak force")
    shown = walk.row("klack-results/case-2").locator("b").first.inner_text()
    peak = peak_of(folder / "klack-results/case-2")
    walk.finds(shown == f"{peak:.4g} N", f"{shown} is the peak of the result, {peak}")
    with walk.context.expect_page() as opened:
        walk.page.get_by_role("link", name="Report klack-results/case-2").first.click()
    report = opened.value
    report.set_default_timeout(LONG)
    report.wait_for_selector(".main-svg")
    walk.finds(
        f"{peak:.4g}" in report.locator("main").inner_text(), "the report has the same number"
    )
    walk.finds(report.evaluate("window.origin") == "null", "it runs apart from the application")
    report.close()


def peak_of(result: Path) -> float:
    """Peak force in a stored result, read without the application."""
    from klack.analyses.catalogue import analysis_in

    study = analysis_in(result).load(result)
    return float(study.levels[study.reference].measures.peak_force)


def speed_in(text: str) -> float:
    """Speed in the text of a case [m/s]."""
    found = re.search(r"\bspeed: *[\"']?([\d.eE+-]+) (m?m)/s", text)
    assert found, text[-600:]
    return float(found[1]) * {"m": 1.0, "mm": 1e-3}[found[2]]


def move_pin_hear(walk: Walk, folder: Path) -> None:
    walk.goes(f"/sliders?path={COPY}", "peak force")
    page = walk.page
    page.wait_for_selector(".k-badge.good")
    figure = page.locator(".k-figure").first
    walk.finds("as pinned" in figure.inner_text(), "the case is pinned at first")
    start = peak_of(folder / "klack-results/case-2")
    shown = float(re.findall(r"[\d.]+", figure.inner_text())[0])
    walk.finds(abs(shown / start - 1) < 1e-3, f"{shown} N is what the run has, {start} N")
    speed = page.get_by_label("speed")
    speed.focus()
    was = figure.inner_text()
    for _ in range(5):
        walk.keys("ArrowRight")
    changed = "was => document.querySelector('.k-figure').innerText !== was"
    walk.waits(changed, was)
    page.wait_for_selector(".k-badge.good")
    moved = float(speed.input_value()) / 0.3
    ratio = float(re.findall(r"[\d.]+", figure.inner_text())[0]) / start
    # a stiff, nearly linear contact: the peak goes with the speed, a bit faster where it hardens
    walk.finds(moved > 1.01 and 0.9 * moved < ratio < 1.2 * moved, f"{ratio} at {moved}")
    before = speed.input_value()
    box = speed.bounding_box()
    page.mouse.click(box["x"] + 0.8 * box["width"], box["y"] + 0.5 * box["height"])
    walk.finds(float(speed.input_value()) > float(before), "the mouse moves a slider")
    page.wait_for_selector("text=estimate follows", state="attached")
    page.wait_for_selector(".k-badge:has-text('estimate:'), .k-badge.out")
    walk.finds("%" in figure.inner_text(), "the difference from what is pinned is told")
    page.get_by_role("button", name="Pin this").click()
    walk.waits("() => document.querySelector('.k-figure').innerText.includes('as pinned')")
    page.get_by_role("button", name="Back to the case").click()
    walk.waits("() => document.querySelector('.k-figure').innerText.includes('−')")
    moved = float(speed.input_value()) / 0.3  # to the next of 200 steps of the range
    walk.finds(moved == pytest.approx(1.0, abs=0.01), "the slider is back as well")
    page.wait_for_function("() => document.querySelectorAll('audio')[1].src.includes('/sound/')")
    page.evaluate(
        "() => { const a = document.querySelectorAll('audio')[1]; a.muted = true; a.play(); }"
    )
    walk.waits("() => document.querySelectorAll('audio')[1].currentTime > 0")
    with page.expect_download() as loaded:
        page.get_by_text("Save WAV").nth(1).click()
    wav = Path(loaded.value.path()).read_bytes()
    walk.finds(wav[:4] == b"RIFF" and len(wav) > 10_000, "a WAV file is saved")
    speed.focus()
    walk.keys("ArrowRight", "ArrowRight")
    page.wait_for_selector(".k-badge.good")
    value = float(speed.input_value())
    walk.presses("Edit the case with these values", "valid impact, not saved")
    written = speed_in(text_of(page))
    walk.finds(written == pytest.approx(value, rel=1e-6), f"{written} is that of the slider")
    walk.goes(f"/sliders?path={COPY}", "peak force")
    page.wait_for_selector(".k-badge.good")
    walk.presses("Edit the case with these values", "Replace unsaved changes?")
    walk.presses("Cancel", "peak force")
    walk.goes(f"/case?path={COPY}", "valid impact, not saved")
    kept = speed_in(text_of(page))
    walk.finds(kept == written, "the text that was not saved stays")
    walk.presses("Save", "valid impact, saved")


def kill_in_the_middle(walk: Walk, folder: Path, serve: Callable[[Path], Served]) -> None:
    """A run and a text that is not saved outlive a server that is killed."""
    walk.goes("/", f"impact, {COPY}")
    walk.presses(f"Duplicate {COPY}", "The copy is placed in the same folder")
    walk.types("Name", "case-3", "The copy is placed in the same folder", key="Tab")
    walk.presses("Make", "impact, valve/case-3.yaml")
    walk.presses(f"Run {COPY}", f"klack impact {COPY}")
    walk.goes("/case?path=valve/case-3.yaml", "valid impact, saved")
    mine = text_of(walk.page) + "# not saved yet\n"
    put(walk.page, mine)
    walk.sees("valid impact, not saved")
    walk.page.goto("about:blank")
    walk.server.kill()
    walk.moved_to(serve(folder))
    walk.sees(f"klack impact {COPY}", "edited, not saved")
    walk.goes("/case?path=valve/case-3.yaml", "valid impact, not saved")
    walk.finds(text_of(walk.page) == mine, "the text that was not saved is there")
    walk.goes("/", "done in ")
    walk.no_longer_sees("since ")  # the last run, not that of the morning
    walk.finds(peak_of(folder / "klack-results/case-2") > 0, "the run has written its result")


def compare_two(walk: Walk, folder: Path) -> None:
    shutil.copytree(folder / "klack-results/case-2", folder / "klack-results/same")
    walk.presses("Run valve/case-3.yaml", "klack impact valve/case-3.yaml")
    walk.sees("klack impact · klack-results/case-3", "klack impact · klack-results/same")
    for name in ("case-2", "case-3"):
        box = walk.page.get_by_role("checkbox", name=f"compare klack-results/{name}")
        box.focus()
        walk.keys("Space")
        walk.finds(box.is_checked(), "chosen with the keyboard")
    walk.presses("Compare", "sound exposure level", kind="link")
    then, now = (peak_of(folder / f"klack-results/{name}") for name in ("case-2", "case-3"))
    cells = walk.page.locator("tbody tr").first.locator("td").all_inner_texts()
    walk.finds(cells[1:3] == [f"{then:.4g}", f"{now:.4g}"], f"{cells} are {then}, {now}")
    difference = f"{100 * (now / then - 1):+.2f} %".replace("-", "−")
    walk.finds(cells[3] == difference, f"{cells[3]} is {difference}")
    walk.finds(walk.page.locator("audio").count() == 2, "both can be heard")
    walk.goes("/compare?a=klack-results/case-2&b=klack-results/same", "sound exposure level")
    first = walk.page.locator("tbody tr").first.locator("td").last
    walk.finds(first.inner_text() == "+0.00 %", "the same result has no difference")
    walk.goes("/compare?a=klack-results/case-2&b=nothing", "nothing there")
    walk.goes("/compare", "a path that is not below the folder")


def two_browsers(walk: Walk, browser: Any, folder: Path) -> None:
    """Both see a run; a second page on one case loses nothing and is told."""
    other = Walk(browser, walk.server)
    try:
        walk.goes("/", "impact, valve/case-3.yaml")
        other.sees("impact, valve/case-3.yaml")
        walk.presses(f"Run {VALVE}", f"klack impact {VALVE}")
        other.sees(f"klack impact {VALVE}")
        other.presses("Cancel klack-results/valve", f"klack impact {VALVE}")
        walk.sees("cancelled, ")
        address = f"/case?path={COPY}"
        walk.goes(address, "valid impact, saved")
        other.goes(address, "valid impact, saved")
        text = text_of(walk.page)
        put(walk.page, text + "# one\n")
        walk.sees("valid impact, not saved")
        put(other.page, text + "# two\n")
        other.sees("Another page holds unsaved text of this case.")
        other.presses("Save", "valid impact, saved")
        walk.finds((folder / COPY).read_text() == text + "# two\n", "the second saved first")
        walk.presses("Save", "Another program has changed the file")
        walk.goes("/", f"impact, {COPY} · edited, not saved")
        walk.goes(address, "valid impact, not saved")
        walk.finds("# one" in text_of(walk.page), "the text of the first is not lost")
        walk.presses("Discard changes", "valid impact, saved")
        assert other.said == []
        walk.steps += other.steps
    finally:
        other.context.close()


def look_around(walk: Walk) -> None:
    """Theme, links at the top, pages that are not there."""
    walk.goes("/", "Cases and results")
    theme = walk.page.locator("#k-theme")
    for word, dark in (("Light", False), ("Dark", True), ("Auto", False)):
        theme.click()
        walk.finds(theme.inner_text() == word, f"the button says {word}")
        is_dark = walk.page.evaluate("document.body.classList.contains('body--dark')")
        walk.finds(is_dark is dark, f"{word}: the page follows")
    walk.page.keyboard.press("Tab")
    walk.goes("/case?path=../secret.yaml", "a path that is not below the folder")
    walk.goes("/case?path=none.yaml", "No such file")
    walk.goes("/sliders?path=none.yaml", "No such file")
    walk.page.get_by_role("link", name="klack", exact=True).click()
    walk.sees("Everything below the folder opened by klack app.")
    walk.page.evaluate("document.activeElement.blur()")
    walk.keys("Tab")
    walk.finds(walk.focused() == "Skip to the content", f"first is the jump, {walk.focused()}")
    walk.keys("Enter")
    walk.finds(walk.page.evaluate("location.hash") == "#k-body", "it goes to the content")


@pytest.mark.timeout(1500)  # [s]: two runs and two slider pages, on a loaded machine
def test_a_day_of_work_loses_nothing(browser, serve, tmp_path):
    folder = tmp_path / "day"
    folder.mkdir()
    walk = Walk(browser, serve(folder))

    begin_with_an_empty_folder(walk, folder)
    duplicate_and_note(walk, folder)
    edit_by_form_and_by_text(walk, folder)
    a_conflict_on_saving(walk, folder)
    run_cancel_and_read(walk, folder)
    move_pin_hear(walk, folder)
    assert walk.said == []
    kill_in_the_middle(walk, folder, serve)
    compare_two(walk, folder)
    two_browsers(walk, browser, folder)
    look_around(walk)

    assert walk.said == []
    assert walk.steps >= _LEAST, walk.steps
    print(f"{walk.steps} steps")
    left = [json.loads(path.read_text()) for path in folder.glob(".klack-app/draft-*.json")]
    assert left == [] or all("case-3" in str(list(item)) for item in left)
    walk.context.close()
