"""Studies in a browser: made, started, watched, stopped, resumed, brushed, heard, written."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from made_study import made_study

from klack.app.folder import OpenFolder
from klack.app.jobs import Jobs
from klack.case.any_case import read_case_tree
from klack.case.study_source import study_of

pytest.importorskip("playwright.sync_api")
pytest.importorskip("nicegui")

from app_browser import LONG, page, require_within, server, settle
from served_app import Served

from klack.analyses.study.analysis import STUDY
from klack.analyses.study.run import run_study
from klack.case.reader import find_case

__all__ = ["page", "server"]  # fixtures

pytestmark = pytest.mark.slow

ATTACK = "</script><img src=x onerror=alert(1)>${alert(2)}"
LISTENED = """klack: 1
case: case.yaml
study:
  parameters:
    motion.speed: {from: 0.2 m/s, to: 0.5 m/s}
  measures: [contact_time, noise.sound_exposure_level_weighted]
  objectives: {noise.sound_exposure_level_weighted: minimise, contact_time: minimise}
  design: {kind: sobol, points: 4}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    place = tmp_path_factory.mktemp("app")
    small = Path("docs/how-to/small_valve.yaml").read_text("utf-8")
    (place / "small.yaml").write_text(small, "utf-8")
    (place / "valve").mkdir()
    (place / "valve" / "case.yaml").write_text(
        find_case("demo-valve-axisymmetric").read_text("utf-8"), "utf-8"
    )
    (place / "valve" / "study.yaml").write_text(LISTENED, "utf-8")
    tree = read_case_tree(place / "valve" / "case.yaml")
    case = tree.any_case()
    record = run_study(case, tree, study_of(case, tree, place / "valve" / "study.yaml"))
    STUDY.save(record, place / "klack-results" / "valve-study")
    STUDY.save(
        made_study(5000, failed=20, doubtful=30, word=ATTACK), place / "klack-results" / "made"
    )
    (place / "outside.yaml").write_text(
        LISTENED.replace("case: case.yaml", "case: ../../secret.yaml"), "utf-8"
    )
    yield place
    jobs = Jobs(OpenFolder(place))  # a run outlives its server
    for job in jobs.all():
        jobs.cancel(job.name)


def told(page) -> dict:
    """What the page is told of its study."""
    return page.evaluate(
        "fetch('/points-data?path=' + encodeURIComponent(window.klackPoints.path))"
        ".then(answer => answer.json())"
    )


def test_a_study_is_made_started_stopped_and_resumed_without_its_server(
    page, server, folder, browser
):
    page.goto(f"{server.base}/new-study?path=small.yaml")
    page.get_by_label("spring preload", exact=True).check()
    page.get_by_label("spring preload, to").fill("14 kg")
    page.get_by_label("Points", exact=True).fill("8000")
    page.get_by_label("objective of opening_time", exact=True).select_option("minimise")
    page.get_by_role("button", name="Write the study").click()
    page.wait_for_selector("text=14 kg")  # refused, in the words of klack
    page.get_by_label("spring preload, to").fill("14 N")
    page.get_by_role("button", name="Write the study").click()
    page.wait_for_selector("text=8000 points, Sobol points, seed 1, of small")
    written = (folder / "small_study.yaml").read_text("utf-8")
    assert "network.components.spring.preload: {from: 10.8 N, to: 14 N}  # today 12 N" in written

    with Served(folder) as other:
        context = browser.new_context()
        first = context.new_page()
        first.set_default_timeout(LONG)
        first.goto(other.address)
        first.wait_for_selector("#k-body")
        first.goto(f"{other.base}/case?path=small_study.yaml")
        first.get_by_role("button", name="Start the study").click()
        first.get_by_role("link", name="Points").click()
        first.wait_for_selector("#kp-root[data-points='8000']")
        context.close()
        other.kill()

    page.goto(f"{server.base}/points?path=klack-results/study/small_study")
    page.wait_for_selector("text=study runs, ")
    page.get_by_text(re.compile("about .* left")).wait_for()
    page.get_by_role("button", name="Stop").click()
    page.wait_for_selector("text=stopped; the points so far are kept")
    stopped = told(page)
    page.wait_for_function("mark => window.klackPoints.mark === mark", arg=stopped["mark"])
    before = stopped["study"]
    assert 0 < before["waiting"] < 8000
    page.get_by_role("button", name="Resume").click()
    page.wait_for_selector("text=study runs, ")
    page.wait_for_function("left => window.klackPoints.study.waiting < left", arg=before["waiting"])
    assert told(page)["job"]["done"] > 8000 - before["waiting"]  # nothing computed was lost
    page.get_by_role("button", name="Stop").click()
    page.wait_for_selector("text=stopped; the points so far are kept")
    for column, now in zip(before["columns"], told(page)["study"]["columns"], strict=True):
        for one, other_one in zip(column["values"], now["values"], strict=True):
            assert one is None or other_one == pytest.approx(one, rel=1e-6)
    require_within(page)


def test_a_brush_selects_in_all_views_and_thousands_are_paged(page, server):
    page.goto(f"{server.base}/points?path=klack-results/made")
    page.wait_for_selector("#kp-root[data-points='5000']")
    page.wait_for_selector(f"text=Made up{ATTACK}")
    page.wait_for_selector(".kp-table")
    assert page.locator(".kp-table tbody tr").count() == 20
    page.wait_for_selector("text=20 points without measures")

    told_of = "document.querySelector('#kp-told').textContent.includes('of 5000')"
    for _ in range(5):  # a chart that is still being laid out moves away from the mouse
        page.locator("#kp-lines").evaluate("chart => chart.scrollIntoView({block: 'center'})")
        settle(page)
        axis = page.evaluate("({x: klackPoints.axes.x(6), y: klackPoints.axes.height - 27})")
        box = page.locator("#kp-lines").bounding_box()
        page.mouse.move(box["x"] + axis["x"], box["y"] + axis["y"])
        page.mouse.down()
        page.mouse.move(box["x"] + axis["x"], box["y"] + axis["y"] - 100, steps=8)
        page.mouse.up()
        page.wait_for_timeout(1000)
        if page.evaluate(told_of):
            break
    page.wait_for_function(told_of)
    chosen = int(page.locator("#kp-told").inner_text().partition(" ")[0])
    low, high = page.evaluate("[...klackPoints.brushes.values()][0]")
    values = told(page)["study"]["columns"][6]["values"]
    inside = [value for value in values if value is not None and low <= value <= high]
    assert chosen == len(inside)
    assert 0 < chosen < 4980
    page.wait_for_selector(f"text=of {-(-chosen // 20)}, {chosen} points")

    page.get_by_text("Ranges as numbers").click()
    page.get_by_label(re.compile("^opening time.*at most")).fill(str(low))
    page.keyboard.press("Enter")
    page.wait_for_function("document.querySelector('#kp-told').textContent.startsWith('0 of')")
    page.get_by_role("button", name="Clear the selection").click()
    page.locator("#kp-chart").focus()
    page.keyboard.press("ArrowRight")
    page.wait_for_selector("#kp-chosen >> text=on the front")
    require_within(page)


def test_a_point_is_heard_and_its_case_written(page, server, folder):
    page.goto(f"{server.base}/points?path=klack-results/valve-study")
    page.wait_for_selector(".kp-point")
    page.get_by_role("button", name="point 2", exact=True).click()
    page.get_by_role("button", name="Hear it").click()
    words = page.locator("text=Both at the same scale")
    words.wait_for()
    columns = told(page)["study"]["columns"]
    level = next(column for column in columns if column["name"].startswith("noise"))
    assert f"level {level['values'][2]:.1f} dB(A)" in words.inner_text()
    assert f"against {level['today']:.1f} dB(A)" in words.inner_text()
    sizes = page.evaluate(
        "Promise.all(['kp-base', 'kp-own'].map(id => fetch(document.getElementById(id).src)"
        ".then(answer => answer.arrayBuffer()).then(wav => wav.byteLength)))"
    )
    assert min(sizes) > 10_000

    page.get_by_role("button", name="Write its case").click()
    page.get_by_role("link", name="Its sliders").wait_for()
    text = (folder / "valve" / "valve_point_2.yaml").read_text("utf-8")
    speed = columns[0]["values"][2]
    assert text.startswith("# Point 2 of the study in klack-results/valve-study by klack ")
    assert columns[0]["unit"] == "mm/s"
    written = float(re.search(r"speed: \"?([\d.e-]+) m/s", text)[1])
    assert 1e3 * written == pytest.approx(speed, rel=1e-6)
    page.get_by_role("link", name="Edit it").click()
    page.wait_for_selector("text=valid impact, saved")


def test_a_study_of_a_case_outside_is_refused(page, server, folder):
    page.goto(f"{server.base}/case?path=outside.yaml")
    page.wait_for_selector("text=a case file below the folder of the application")
    assert page.get_by_role("button", name="Start the study").is_disabled()
    for path in ("../x", "klack-results", ".klack-app", "/etc"):
        page.goto(f"{server.base}/points?path={path}")
        page.wait_for_selector(".k-error")
        answer = page.evaluate(
            "path => fetch('/points-data?path=' + path).then(answer => answer.text())", path
        )
        assert "error" in json.loads(answer)


def test_dark_colours_and_a_telephone(browser, server, page):
    context = browser.new_context(viewport={"width": 400, "height": 800}, color_scheme="dark")
    small = context.new_page()
    small.set_default_timeout(LONG)
    small.goto(server.address)
    small.wait_for_selector("#k-body")
    small.goto(f"{server.base}/points?path=klack-results/made")
    small.wait_for_selector(".kp-table")
    small.get_by_role("button", name="Next on the front").click()
    small.wait_for_selector("#kp-chosen table")
    assert small.evaluate("document.body.classList.contains('body--dark')")
    assert small.evaluate("document.documentElement.scrollWidth") <= 400
    context.close()
