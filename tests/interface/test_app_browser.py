"""The pages in a browser: they answer, stay within the window, and load nothing from elsewhere."""

import json
import re
import shutil
from pathlib import Path

import pytest

from klack.analyses.catalogue import analysis_in
from klack.app.folder import OpenFolder
from klack.app.jobs import Jobs
from klack.case.reader import find_case

pytest.importorskip("nicegui")
from app_browser import LONG, page, require_within, server
from browser_pages import put, text_of
from served_app import Served

__all__ = ["page", "server"]  # fixtures

pytestmark = pytest.mark.slow

CASE = "valve/case.yaml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("app")
    (place / "valve").mkdir()
    (place / CASE).write_text(find_case("demo-valve-axisymmetric").read_text("utf-8"), "utf-8")
    return place


def test_cases_are_listed_and_copied(page, folder):
    page.wait_for_selector("text=Demo valve, axisymmetric")
    assert "token" not in page.url
    page.get_by_role("button", name="Duplicate").first.click()
    page.get_by_role("button", name="Make").click()
    page.wait_for_selector("text=valve/case-2.yaml")
    assert (folder / "valve" / "case-2.yaml").read_text() == (folder / CASE).read_text()

    page.get_by_role("button", name="Duplicate").first.click()
    page.get_by_label("Name").fill("../outside")
    page.get_by_role("button", name="Make").click()
    page.wait_for_selector("text=letters, digits")
    page.get_by_role("button", name="Cancel").click()
    (folder / "valve" / "case-2.yaml").unlink()
    page.wait_for_selector(".q-dialog", state="detached")
    require_within(page)


MOVING = """document.addEventListener("click", () => {
  const more = document.createElement("div");
  more.style.height = document.querySelector(".k-row").getBoundingClientRect().height + "px";
  document.getElementById("k-body").prepend(more);
}, { once: true })"""


def test_a_double_click_starts_what_was_under_the_pointer_and_only_once(page, server, folder):
    """The list moves by a row at the first click, as it does once the run is shown above it."""
    text = (folder / CASE).read_text("utf-8")
    for name in ("a", "b"):
        (folder / "valve" / f"{name}.yaml").write_text(text, "utf-8")
    jobs = Jobs(OpenFolder(folder))
    for move in (True, False):
        page.goto(f"{server.base}/")
        run = page.get_by_role("button", name="Run valve/b.yaml")
        run.scroll_into_view_if_needed()
        page.get_by_role("button", name=f"Note {CASE}").wait_for()
        box = run.bounding_box()
        if move:
            page.evaluate(MOVING)
        page.mouse.dblclick(box["x"] + 5, box["y"] + 5, delay=20)
        page.wait_for_selector("text=klack impact valve/b.yaml")
        page.wait_for_timeout(700)
        (job,) = jobs.all()
        jobs.cancel(job.name)
        dismiss = page.get_by_role("button", name="Dismiss")
        dismiss.wait_for()
        row = page.locator(".k-row", has=dismiss)
        assert "cancelled" in row.inner_text()
        assert row.locator(".k-error").count() == 0  # it was asked for
        dismiss.click()
        assert job.case == "valve/b.yaml"
        assert page.locator(".q-notification").count() == 0
        page.wait_for_selector("text=klack impact valve/b.yaml", state="detached")
    for name in ("a", "b"):
        (folder / "valve" / f"{name}.yaml").unlink()


def test_a_run_that_is_done_leads_to_its_result(page, server, folder):
    asked = {"command": "impact", "case": CASE, "out": "klack-results/done", "started": 100.0}
    run = folder / ".klack-app" / "jobs" / "20260101-000000-0123abcd"
    run.mkdir(parents=True)
    (run / "job.json").write_text(json.dumps(asked))
    (run / "ending.json").write_text('{"code": 0, "ended": 121.0}')
    (folder / "klack-results" / "done").mkdir(parents=True)
    (folder / "klack-results" / "done" / "report.html").write_text("<p>report</p>")
    page.goto(f"{server.base}/")
    row = page.locator(".k-row", has=page.get_by_role("button", name="Dismiss"))
    row.get_by_role("link", name="Hear").wait_for()  # the case is read first
    ways = {link.inner_text(): link.get_attribute("href") for link in row.locator("a").all()}

    assert "done in 21 s" in row.inner_text()
    assert [*ways] == ["Report", "Show", "Sliders", "Hear"]
    assert ways["Hear"].endswith("case.yaml#k-hear")
    shutil.rmtree(run)
    shutil.rmtree(folder / "klack-results" / "done")


def test_a_magnet_is_run_and_an_oblique_impact_offers_no_sliders(page, server, folder):
    text = Path("docs/how-to/lifting_magnet.yaml").read_text("utf-8")
    for key, few in (("current", "[0.6 A, 1.2 A]"), ("gap", "[1 mm, 2 mm, 5 mm]")):
        text, count = re.subn(rf"(\n  {key}: )\[.*\]", rf"\1{few}", text)
        assert count == 1
    (folder / "magnet.yaml").write_text(text, "utf-8")
    shutil.copy("docs/how-to/oblique_impact.yaml", folder / "oblique.yaml")
    page.goto(f"{server.base}/")
    page.get_by_role("button", name=f"Note {CASE}").wait_for()  # the last of the list
    page.get_by_role("button", name="Run magnet.yaml").click()
    run = page.locator(".k-row", has_text="klack magnet magnet.yaml")
    run.get_by_role("link", name="Report").wait_for()
    ways = {
        name: page.locator(".k-row", has=page.get_by_role("button", name=f"Note {name}"))
        .locator("a")
        .all_inner_texts()
        for name in ("magnet.yaml", "oblique.yaml", CASE)
    }

    assert run.locator("a").all_inner_texts() == ["Report"]
    assert ways == {
        "magnet.yaml": ["Edit"],
        "oblique.yaml": ["Show", "New study", "Edit"],
        CASE: ["Show", "Sliders", "New study", "Edit"],
    }
    run.get_by_role("button", name="Dismiss").click()
    run.wait_for(state="detached")
    shutil.rmtree(folder / "klack-results" / "magnet")
    for name in ("magnet.yaml", "oblique.yaml"):
        (folder / name).unlink()


def test_all_of_a_long_list_is_found_by_a_part_of_its_name(page, server, folder):
    (folder / "many").mkdir()
    for number in range(130):
        (folder / "many" / f"c{number:03}.yaml").write_text(f"klack: 1\ntitle: {number}\n")
    page.goto(f"{server.base}/")
    rows = page.locator(".k-row")
    page.wait_for_selector("text=The first 100 of 131")
    page.get_by_label("Find").focus()
    page.keyboard.type("C12", delay=30)
    page.wait_for_function("document.querySelectorAll('.k-row').length === 10")
    assert "c129.yaml" in rows.last.inner_text()
    page.get_by_label("Find").fill("none of them")
    page.wait_for_selector("text=No case name contains this text.")
    page.get_by_label("Find").fill("")
    page.wait_for_selector("text=The first 100 of 131")
    page.get_by_role("button", name="Show 31 more").press("Enter")
    page.wait_for_function("document.querySelectorAll('.k-row').length === 131")
    require_within(page)
    shutil.rmtree(folder / "many")


def test_form_and_text_follow_each_other_and_survive(page, server, folder):
    page.goto(f"{server.base}/case?path={CASE}")
    page.wait_for_selector("text=valid impact, saved")
    page.get_by_label("speed", exact=True).fill("0.4 m/s")
    page.get_by_label("speed", exact=True).press("Enter")
    page.wait_for_function("document.getElementById('k-yaml').value.includes('0.4 m/s')")
    page.wait_for_selector("text=valid impact, not saved")
    page.goto(f"{server.base}/")  # closed without saving
    page.goto(f"{server.base}/case?path={CASE}")
    page.wait_for_selector("text=valid impact, not saved")
    assert "0.4 m/s" in text_of(page)
    assert "0.4 m/s" not in (folder / CASE).read_text()

    put(page, text_of(page).replace("0.4 m/s", "0.4 mm"))
    page.wait_for_selector("text=not valid, not saved")
    assert "0.4 mm" in text_of(page)  # drawing does not put the former text back
    page.wait_for_selector("text=motion.speed")
    put(page, text_of(page).replace("0.4 mm", "0.35 m/s"))
    page.wait_for_function("document.getElementById('f-motion.speed').value == '0.35 m/s'")
    page.keyboard.press("Control+s")
    page.wait_for_selector("text=valid impact, saved")
    assert "0.35 m/s" in (folder / CASE).read_text()
    require_within(page)


def test_a_run_from_the_editor_is_that_of_the_text_on_the_page(page, server, folder):
    file = folder / "valve" / "edited.yaml"
    text = find_case("demo-valve-axisymmetric").read_text("utf-8")
    text = re.sub(r"(levels: )\[.*\]", r"\1[reduced]", text)
    assert "0.3 m/s" in text
    file.write_text(text, "utf-8")
    jobs = Jobs(OpenFolder(folder))
    page.goto(f"{server.base}/case?path=valve/edited.yaml")
    page.wait_for_selector("text=valid impact, saved")
    run = page.get_by_role("button", name="Run")

    put(page, text.replace("0.3 m/s", "0.3 kg"))
    page.wait_for_selector("text=not valid, not saved")  # its words move the buttons
    run.click()
    page.get_by_role("button", name="Save and run").click()
    page.wait_for_selector("text=Not run.")
    put(page, text.replace("0.3 m/s", "0.4 m/s"))
    page.wait_for_selector("text=valid impact, not saved")
    run.click()
    page.wait_for_selector("text=which does not contain this text yet")
    page.get_by_role("button", name="Cancel").click()
    page.wait_for_selector(".q-dialog", state="detached")
    file.write_text(text + "# theirs\n", "utf-8")
    run.click()
    page.get_by_role("button", name="Save and run").click()
    page.wait_for_selector("text=Another program has changed the file")
    assert jobs.all() == []  # nothing that is not seen was run
    page.get_by_role("button", name="Discard changes").click()
    page.wait_for_selector("text=valid impact, saved")
    put(page, text.replace("0.3 m/s", "0.4 m/s"))
    page.wait_for_selector("text=valid impact, not saved")
    run.click()
    page.get_by_role("button", name="Save and run").click()

    page.wait_for_selector("text=klack impact valve/edited.yaml")
    assert page.url == f"{server.base}/"
    page.wait_for_selector("text=done in ")
    out = folder / "klack-results" / jobs.all()[0].out.rpartition("/")[2]
    assert analysis_in(out).load(out).speed == 0.4
    require_within(page)
    shutil.rmtree(out)
    file.unlink()


def test_a_text_too_long_for_the_page_is_neither_saved_nor_run(page, server, folder):
    before = (folder / CASE).read_text("utf-8")
    page.goto(f"{server.base}/case?path={CASE}")
    page.wait_for_selector("text=valid")
    put(page, before + "#" * 960_000)
    page.wait_for_selector("text=too long, not kept")
    for name in ("Save", "Run"):
        page.get_by_role("button", name=name, exact=True).click()
        page.wait_for_selector(f"text=Not {'saved' if name == 'Save' else 'run'}. The text has")

    assert (folder / CASE).read_text("utf-8") == before
    assert page.locator(".k-badge").inner_text() == "too long, not kept"
    page.get_by_role("button", name="Discard changes").click()
    page.wait_for_selector("text=valid impact, saved")


def test_a_long_note_is_folded_and_one_that_is_too_long_stays_in_its_dialog(page, server, folder):
    mine = page.get_by_role("button", name=f"Note {CASE}", exact=True)
    area = page.get_by_role("textbox", name=f"note on {CASE}")
    words = "<img src=x onerror=alert(1)> softer seat\n" + "word " * 2000

    mine.click()
    area.fill("\N{BELL}" * 20_001)
    page.get_by_role("button", name="Keep").click()
    page.get_by_role("alert").get_by_text("more than 20000 characters").wait_for()
    assert len(area.input_value()) == 20_001  # nothing is lost
    area.fill(words)
    page.get_by_role("button", name="Keep").click()
    page.wait_for_selector(".q-dialog", state="detached")
    summary = page.locator("summary", has_text="<img src=x onerror=alert(1)> softer seat ...")
    summary.wait_for()
    height = summary.locator("xpath=../..").evaluate("e => e.getBoundingClientRect().height")
    assert height < 200  # [px]
    assert page.locator("#k-body img").count() == 0
    require_within(page)
    summary.click()
    assert page.locator("p.k-note").first.inner_text().strip() == words.strip()
    require_within(page)
    mine.click()
    area.fill("")
    page.get_by_role("button", name="Keep").click()
    summary.wait_for(state="detached")


def test_text_typed_while_the_server_is_away_comes_back(folder, browser):
    (folder / "valve" / "away.yaml").write_text((folder / CASE).read_text("utf-8"), "utf-8")
    query = "/case?path=valve/away.yaml"
    context = browser.new_context()
    page = context.new_page()
    page.set_default_timeout(LONG)
    with Served(folder) as first:
        port = first.base.rpartition(":")[2]
        page.goto(first.address)
        page.goto(f"{first.base}{query}")
        page.wait_for_selector("text=valid impact, saved")
        speed = page.get_by_label("speed", exact=True).input_value()
        page.get_by_label("speed", exact=True).fill("")
        page.get_by_label("speed", exact=True).press("Enter")
        page.wait_for_selector("text=speed stays as it was")
        assert page.get_by_label("speed", exact=True).input_value() == speed
        first.kill()
    page.wait_for_function("!window.socket.connected")
    put(page, text_of(page).replace(speed, "0.36 m/s"))
    page.goto("about:blank")  # it would load itself anew while the next address is opened
    with Served(folder, "--port", port) as again:
        context.new_page().goto(again.address)  # the token of the new server
        page.goto(f"{again.base}{query}")
        page.wait_for_selector("text=valid impact, not saved")
        assert "0.36 m/s" in text_of(page)
    context.close()
    (folder / "valve" / "away.yaml").unlink()


def _ranges(page, number: int) -> list[float]:
    """Ends of both axes of a chart, once Plotly has drawn it."""
    page.wait_for_function(
        "n => document.querySelectorAll('.k-plot')[n]?._fullLayout?.yaxis", arg=number
    )
    return page.evaluate(
        "n => (({xaxis, yaxis}) => [...xaxis.range, ...yaxis.range])"
        "(document.querySelectorAll('.k-plot')[n]._fullLayout)",
        number,
    )


def _zoom(page, number: int) -> list[float]:
    """Drag a rectangle in a chart; return the ranges of its axes then."""
    before = _ranges(page, number)
    area = page.locator(".k-plot .nsewdrag").nth(number)
    area.scroll_into_view_if_needed()
    box = area.bounding_box()
    corners = [
        (box["x"] + share * box["width"], box["y"] + share * box["height"]) for share in (0.3, 0.7)
    ]
    page.mouse.move(*corners[0])
    page.mouse.down()
    page.mouse.move(*corners[1], steps=3)
    page.mouse.up()
    page.wait_for_function(
        "([n, was]) => document.querySelectorAll('.k-plot')[n]._fullLayout.yaxis.range[0] != was",
        arg=[number, before[2]],
    )
    return _ranges(page, number)


def test_sliders_answer_by_keyboard(page, server):
    """A zoom stays while sliders move, also that of the bands, whose range follows their top."""
    page.goto(f"{server.base}/sliders?path={CASE}")
    speed = page.get_by_label("speed")
    speed.wait_for()
    page.wait_for_selector(".k-badge.good")
    force = page.locator(".k-figure").first
    before = force.inner_text()
    zoomed = [_zoom(page, number) for number in range(3)]

    speed.focus()
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    page.wait_for_function(
        "was => document.querySelector('.k-figure').innerText != was", arg=before
    )
    assert float(speed.input_value()) > 0.3 * 1.01  # drawing does not put it back
    assert "+" in force.inner_text()
    assert "%" in force.inner_text()
    assert [_ranges(page, number) for number in range(3)] == zoomed
    page.wait_for_selector(".k-badge.good")
    wav = page.evaluate(
        "fetch(document.querySelectorAll('audio')[1].src).then(r => r.arrayBuffer())"
        ".then(b => b.byteLength)"
    )
    assert wav > 10_000
    page.get_by_role("button", name="Pin this").click()
    page.locator(".k-figure", has_text="loudness").get_by_text("as pinned").wait_for()
    page.get_by_role("button", name="Back to the case").click()
    page.wait_for_function("document.querySelector('.k-figure').innerText.includes('−')")
    require_within(page)


def test_nothing_of_an_earlier_position_stays_beside_an_error(page, server, folder):
    """The magnet would fall before it rises, which the checker of cases refuses."""
    shutil.copy("docs/how-to/small_valve.yaml", folder / "refused.yaml")
    page.goto(f"{server.base}/sliders?path=refused.yaml")
    page.locator(".k-side summary").first.click()
    page.get_by_label("magnet time 1").focus()
    plots = "[...document.querySelectorAll('.js-plotly-plot')]"
    names = f"{plots}.flatMap(plot => (plot.data || []).map(line => line.name))"
    page.keyboard.press("ArrowRight")
    page.wait_for_function(f"{names}.some(name => name.includes('now'))")
    page.keyboard.press("Home")
    page.wait_for_selector("text=not possible")
    page.wait_for_selector("text=got times that do not increase")

    page.wait_for_function(f"!{names}.some(name => name.includes('now'))")
    assert page.locator(".k-figure").count() == 0
    assert page.evaluate(f"{names}.some(name => name.includes('pinned'))")
    page.keyboard.press("ArrowRight")  # one step is 1 us: still refused
    page.get_by_role("button", name="Back to the case").click()
    page.wait_for_function(f"{names}.some(name => name.includes('now'))")
    assert "+0.00 us" in page.locator(".k-figure").first.inner_text()
    (folder / "refused.yaml").unlink()


def test_a_run_goes_on_without_the_server_and_its_results_compare(page, server, folder, browser):
    page.goto(f"{server.base}/")
    text = (folder / CASE).read_text("utf-8")
    (folder / "valve" / "one.yaml").write_text(
        text.replace("[lumped, reduced-none, reduced-attachment, reduced, full]", "[reduced]"),
        "utf-8",
    )
    with Served(folder) as other:
        context = browser.new_context()
        first = context.new_page()
        first.set_default_timeout(LONG)
        first.goto(other.address)
        row = first.locator(".k-row", has_text="valve/one.yaml").last
        row.get_by_role("button", name="Run").click()
        first.wait_for_selector("text=klack impact valve/one.yaml")
        context.close()
        other.kill()

    page.goto(f"{server.base}/")
    page.locator(".k-row", has_text="klack impact valve/one.yaml").get_by_text(
        "done in "
    ).wait_for()
    shutil.copytree(folder / "klack-results" / "one", folder / "klack-results" / "two")
    page.reload()
    page.locator(".k-row", has_text="klack-results/one").get_by_role("checkbox").wait_for()
    for name in ("one", "two"):
        page.locator(".k-row", has_text=f"klack-results/{name}").get_by_role("checkbox").check()
    page.get_by_role("link", name="Compare", exact=True).click()
    page.wait_for_selector("text=sound exposure level")
    assert page.locator("tbody tr").first.locator("td").last.inner_text() == "+0.00 %"
    require_within(page)
    assert (folder / "klack-results" / "one" / "report.html").is_file()


LATE = """
const every = window.setInterval;  // its clocks stand still while it is paused
window.setInterval = (tick, rest) => every(() => window.paused || tick(), rest);
window.WebSocket = class extends WebSocket {  // hears nothing until it is released
  set onmessage(hear) {
    super.onmessage = (message) =>
      window.heard ? window.heard.push(() => hear(message)) : hear(message);
  }
};
window.heard = [];
window.release = () => { const all = window.heard; window.heard = null; all.forEach(f => f()); };
"""


def _typed_early(page, server):
    """Open a case, and type into its text before the server listens."""
    page.add_init_script(LATE)
    page.goto(f"{server.base}/case?path={CASE}")
    put(page, "klack: 1\ntitle: early\n")
    page.wait_for_selector("#k-link >> text=connecting")


def test_what_is_pressed_before_the_server_listens_is_done_once_it_does(page, server, folder):
    _typed_early(page, server)
    assert not page.evaluate("window.did_handshake")
    page.evaluate("window.release()")

    page.wait_for_selector("text=not valid, not saved")
    page.wait_for_function("document.getElementById('k-link').textContent === ''")
    page.get_by_role("button", name="Discard changes").click()
    page.wait_for_selector("text=valid impact, saved")
    text = (folder / CASE).read_text("utf-8")  # comes after the words
    page.wait_for_function("text => document.getElementById('k-yaml').value === text", arg=text)


def test_text_discarded_at_once_stays_discarded(page, server, folder):
    """It was typed while the server did not listen; the page looks at the clock only later."""
    _typed_early(page, server)
    page.evaluate("window.paused = true; window.release()")
    page.wait_for_selector("text=not valid, not saved")
    page.get_by_role("button", name="Discard changes").click()
    page.wait_for_selector("text=valid impact, saved")

    page.evaluate("window.paused = false")
    page.wait_for_function("!Object.keys(sessionStorage).some(key => key.startsWith('klack-text'))")
    page.wait_for_timeout(200)
    assert text_of(page) == (folder / CASE).read_text("utf-8")
    assert page.locator(".k-badge").inner_text() == "valid impact, saved"
