"""Every page in a browser: axe-core, rules of layout, the Tab key, nothing from elsewhere."""

import json
import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from app_browser import LONG, server, settle
from browser_pages import PAGES, PICTURED, Place, controls, made_folder, watched
from page_rules import (
    HAS_AXE,
    SCHEMES,
    WIDTHS,
    axe_findings,
    focus_findings,
    layout_findings,
)
from served_app import Served

__all__ = ["server"]  # fixture

pytest.importorskip("nicegui")
pytest.importorskip("playwright.sync_api")
pytestmark = pytest.mark.slow


PICTURES = Path(__file__).parents[2] / "docs" / "images" / "app-pictures.json"
KNOWN = json.loads(PICTURES.read_text("utf-8"))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_folder(tmp_path_factory.mktemp("pages"))


@pytest.fixture(scope="module")
def context(browser: Any, server: Served) -> Iterator[Any]:
    found = browser.new_context(viewport={"width": 1000, "height": 900})
    page = found.new_page()
    page.goto(server.address)  # gives the cookie
    page.close()
    yield found
    found.close()


@pytest.fixture
def page(context: Any, server: Served) -> Iterator[Any]:
    """A page; at its end nothing was complained of or asked of other hosts."""
    found = context.new_page()
    found.set_default_timeout(LONG)
    said = watched(found, server.base)
    yield found
    found.close()
    assert said == []


AXE_AT = ((WIDTHS[0], "light"), (WIDTHS[-1], "dark"))
"""Where axe-core looks: contrast, all that depends on both, is a rule of layout as well."""


def lasting_findings(page: Any, with_axe: bool) -> list[str]:
    """What still breaks a rule after ten seconds: charts and scenes follow the window later."""
    until = time.monotonic() + 10.0
    while found := layout_findings(page) + (axe_findings(page) if with_axe else []):
        if time.monotonic() > until:
            break
        settle(page)
    return found


def findings_everywhere(page: Any) -> tuple[dict[str, list[str]], list[str], int]:
    """What breaks a rule, with where; what does not show the focus; how many places have it."""
    said: dict[str, list[str]] = {}
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        page.evaluate("window.scrollTo(0, 0)")  # the bar at the top stays: it hides parts
        for scheme in SCHEMES:
            page.emulate_media(color_scheme=scheme)
            settle(page)
            for sentence in lasting_findings(page, HAS_AXE and (width, scheme) in AXE_AT):
                said.setdefault(sentence, []).append(f"{width} px {scheme}")

    page.set_viewport_size({"width": 1000, "height": 900})
    settle(page)
    count, unseen = focus_findings(page)
    return said, unseen, count


@pytest.mark.parametrize("place", PAGES, ids=lambda place: place.name)
def test_a_page_is_sound_at_every_width_in_light_and_dark(place: Place, page, server, folder):
    """And its picture in the documentation has the headings, buttons and boxes that are seen."""
    place.open(page, server.base, folder)
    settle(page)
    if place.picture:
        assert controls(page) == KNOWN[place.picture]  # else: python docs/app_pictures.py
    said, unseen, count = findings_everywhere(page)

    assert said == {}
    if not place.name.startswith(("report", "show")):  # documents, which print them drawn
        drawn = page.locator(".k-net").all_inner_texts()  # and so does a schematic
        words = page.inner_text("body")
        for text in drawn:
            words = words.replace(text, "")
        assert re.findall(r".{0,30}(?:µ|μ|[²³]|°C).{0,9}", words) == []
    assert unseen == []
    assert count >= 3


def test_the_page_that_asks_for_the_password_is_sound_and_says_what_was_wrong(browser, tmp_path):
    (tmp_path / "password.txt").write_text("several words of it")
    options = ("--host", "127.0.0.2", "--password-file", str(tmp_path / "password.txt"))
    with Served(tmp_path, *options) as server:
        page = browser.new_page()
        page.set_default_timeout(LONG)
        page.goto(f"{server.base}/case?path=x.yaml")
        page.get_by_label("Password").fill("something else")
        page.get_by_role("button", name="Open").click()
        page.get_by_role("alert").wait_for()
        assert findings_everywhere(page) == ({}, [], 2)
        page.wait_for_timeout(1100)  # the server takes none in the second after a wrong one
        page.get_by_label("Password").fill("several words of it")
        page.get_by_role("button", name="Open").click()
        page.wait_for_selector("text=Cases and results")
        page.close()


@pytest.mark.skipif(HAS_AXE, reason="axe-core is here")
def test_axe_core_is_here():
    pytest.skip("pages not tested with axe-core: axe-playwright-python is not installed")


def test_the_pictures_of_the_documentation_have_what_the_pages_have(page, server, folder):
    """Headings, buttons and boxes of each further picture, as they were when it was made."""
    assert {place.picture for place in PICTURED} == KNOWN.keys()
    for place in PICTURED:
        if place not in PAGES:
            place.open(page, server.base, folder)
            settle(page)
            assert controls(page) == KNOWN[place.picture], place.picture


def test_motion_is_reduced_for_those_who_ask_for_it(page, server, folder):
    page.emulate_media(reduced_motion="reduce")
    for place in PAGES:
        if place.name in ("overview", "report, impact", "dialog, note"):
            place.open(page, server.base, folder)
            moving = page.evaluate(
                "[...document.querySelectorAll('*')].filter(e => { const s = getComputedStyle(e);"
                "return Math.max(...[s.transitionDuration, s.animationDuration].join().split(',')"
                ".map(parseFloat)) > 0.01; }).map(e => e.className || e.tagName)"
            )
            assert moving == [], place.name


def test_charts_are_told_with_their_main_numbers(page, server, folder):
    next(place for place in PAGES if place.name == "compare").open(page, server.base, folder)
    peak = page.locator("tbody tr").first.locator("td").nth(1).inner_text()
    shown = page.get_by_role("img", name="Contact force")

    shown.wait_for()
    told = page.evaluate(
        "e => e.getAttribute('aria-labelledby').split(' ')"
        ".map(id => document.getElementById(id).textContent).join(': ')",
        shown.element_handle(),
    )
    assert told.startswith("Contact force: force [N] over time [us].")
    assert f"highest {peak}" in told


@pytest.mark.parametrize(
    ("address", "words"),
    [
        ("/case?path=gone.yaml", "file 'gone.yaml': got No such file"),
        ("/case", "file '': got no .yaml file"),
        ("/sliders?path=gone.yaml", "file 'gone.yaml': got No such file"),
        ("/new-study?path=gone.yaml", "file 'gone.yaml': got No such file"),
        ("/show?path=klack-results/gone", "file 'klack-results/gone': got nothing there"),
        ("/compare?a=klack-results/impact&b=klack-results/gone", "got nothing there"),
        (
            "/compare?a=klack-results/impact&b=klack-results/stroke",
            "cannot be compared: got one of",
        ),
        ("/points?path=klack-results/gone", "result 'klack-results/gone': got no study"),
        ("/points?path=klack-results/impact", "got a result of klack impact, expected one of"),
    ],
)
def test_what_is_gone_is_told_once_with_the_way_back(page, server, address, words):
    page.goto(server.base + address)
    page.get_by_role("alert").get_by_text(words).wait_for()

    body = page.locator("#k-body")
    assert body.locator("button, input, select, textarea, audio").count() == 0
    assert page.get_by_text(words).count() == 1
    body.get_by_role("link", name="Back to cases and results").click()
    page.wait_for_selector("text=Everything below the folder opened by klack app.")


def test_sliders_that_cannot_open_tell_why_with_the_way_back(page, server, folder):
    broken = folder / "broken.yaml"
    broken.write_text("klack: 1\n")
    page.goto(f"{server.base}/sliders?path=broken.yaml")
    page.get_by_role("alert").get_by_text("got no key 'title'").wait_for()

    assert page.locator("#k-body [role=status]").count() == 0
    page.locator("#k-body").get_by_role("link", name="Back to cases and results").click()
    page.wait_for_selector("text=Everything below the folder opened by klack app.")
    broken.unlink()


def test_words_of_a_row_keep_room_beside_its_buttons(page, server):
    """A page of 1280 px at a zoom of 200 %."""
    page.set_viewport_size({"width": 640, "height": 450})
    page.goto(f"{server.base}/")
    page.get_by_text("2 notes on this result").first.wait_for()
    page.get_by_role("button", name="Run", exact=False).first.wait_for()
    settle(page)

    widths = page.evaluate(
        "[...document.querySelectorAll('.k-row > :first-child')]"
        ".map(e => e.getBoundingClientRect().width)"
    )
    assert len(widths) >= 4
    assert min(widths) >= 249.0  # [px]; one letter a line before
    assert layout_findings(page) == []


def test_results_of_two_kinds_are_not_offered_for_comparison(page, server):
    page.goto(f"{server.base}/")
    for name in ("impact", "stroke"):
        page.get_by_role("checkbox", name=f"compare klack-results/{name}").check()
    told = page.get_by_role("link", name="Compare: two of one kind")
    told.wait_for()

    assert told.get_attribute("href") == "#"
    page.goto(f"{server.base}/compare?a=klack-results/stroke&b=klack-results/impact")
    page.wait_for_selector("text=got one of klack stroke and one of klack impact, expected two of")


def test_a_slider_page_that_is_reloaded_again_and_again_answers(page, server, folder):
    next(place for place in PAGES if place.name == "sliders").open(page, server.base, folder)

    for _ in range(6):  # each left page may come back for some seconds, and holds its bodies
        page.goto(page.url, wait_until="domcontentloaded")

    page.wait_for_selector(".k-slider input")
