"""The guide for a new valve and the bodies in a browser: by mouse, by keyboard, with bad files."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from klack.case.any_case import load_any_case
from klack.case.reader import find_case, read_case
from klack.mesh.solid import write_step_revolved

pytest.importorskip("nicegui")
from app_browser import LONG, require_within, server, settle, slow
from browser_pages import planned, watched
from served_app import Served

__all__ = ["server"]  # fixture

pytestmark = pytest.mark.slow

WINDOW = {"width": 1200, "height": 950}
ATTACK = "<img src=x onerror=alert(1)>.step"
_NOISE = ("GPU stall", "WebGL", "413", "415", "Failed to load resource")
"""What browsers that draw by software say of it, and of answers that refuse a file."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("guide")
    (place / "cad").mkdir()
    for name, body in load_any_case(find_case("demo-valve-axisymmetric")).bodies.items():
        write_step_revolved(body.geometry.profile.profiles(), place / "cad" / f"{name}.step")
    shutil.copy(place / "cad" / "needle.step", place / "cad" / ATTACK)
    (place / "cad" / "empty.step").write_bytes(b"")
    (place / "cad" / "words.step").write_text("this is no STEP file")
    (place / "cad" / "lost.step").write_text("ISO-10303-21;\nHEADER;\nENDSEC;\n")
    (place / "demo.yaml").write_text(find_case("demo-valve-axisymmetric").read_text("utf-8"))
    return place


@pytest.fixture
def page(browser: Any, server: Served) -> Iterator[Any]:
    """A dark page with the cookie; at its end nothing was complained of."""
    context = browser.new_context(viewport=WINDOW, color_scheme="dark")
    found = context.new_page()
    found.set_default_timeout(LONG)
    said = watched(found, server.base)
    found.goto(server.address)
    found.wait_for_selector("#k-body")
    yield found
    context.close()
    assert [words for words in said if not any(noise in words for noise in _NOISE)] == []


def open_guide(page: Any, server: Served) -> None:
    """The guide, from its beginning."""
    page.goto(f"{server.base}/new")
    page.wait_for_selector(".k-steps button:enabled")
    page.get_by_role("button", name="Start over").click()
    page.wait_for_function("!document.querySelector('[inert]')")  # the fields of the new start
    page.get_by_label("The two bodies come from").wait_for()


def choose_step(page: Any, body: str, file: str) -> None:
    page.get_by_label(f"STEP file of the {body} in the folder").select_option(file)


def read(page: Any, count: int = 2) -> None:
    """Wait until parts were read."""
    page.wait_for_function(f"document.querySelectorAll('.k-read').length == {count}")


def onward(page: Any, sign: str) -> None:
    page.locator("#k-next").click()
    page.wait_for_selector(sign)


def name_under(page: Any, x: float, y: float) -> str:
    """Move the pointer to a share of the picture; what its label names there."""
    box = page.locator(".ks-view canvas").first.bounding_box()
    page.mouse.move(box["x"] + x * box["width"] - 2, box["y"] + y * box["height"])
    page.mouse.move(box["x"] + x * box["width"], box["y"] + y * box["height"])
    page.evaluate(  # the label is drawn with the next picture, in seconds on a loaded machine
        "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
    )
    tip = page.locator(".ks-tip")
    return tip.inner_text() if tip.is_visible() else ""


def test_from_two_step_files_by_clicking_to_a_case(page, server, folder):
    open_guide(page, server)
    choose_step(page, "needle", "cad/needle.step")
    read(page, 1)
    page.get_by_label("STEP file of the housing, from here").set_input_files(
        {
            "name": ATTACK,
            "mimeType": "model/step",
            "buffer": (folder / "cad" / "housing.step").read_bytes(),
        }
    )
    read(page)
    page.wait_for_selector("text=Both parts are turned")
    require_within(page)
    onward(page, ".ks-view canvas")
    settle(page)
    page.locator(".ks-view").first.scroll_into_view_if_needed()
    page.wait_for_selector("text=Proposed from the geometry: needle.tip hits housing.seat")
    for name, role in (
        ("needle.tip", "contact"),
        ("housing.seat", "contact"),
        ("housing.rim", "held"),
    ):
        box = page.get_by_label(name, exact=True)
        assert box.input_value() == role
        box.select_option("")
    page.wait_for_function("document.getElementById('k-next').disabled")
    assert page.locator(".ks").get_attribute("class").split().count("ks-dark") == 1

    page.get_by_role("checkbox", name="needle", exact=True).uncheck()
    page.get_by_role("checkbox", name="Cut open").check()
    for role, wanted in (("contact face", "housing.seat"), ("held face", "housing.rim")):
        page.get_by_role("button", name=role).click()
        found = None
        for y in range(30, 100, 1 if wanted.endswith("seat") else 4):
            name = name_under(page, 0.5, y / 100)
            if name.partition(" ")[0] == wanted:
                found = y / 100
                break
        if found is None:  # small on this screen: by its list, which has the same names
            page.get_by_label(wanted, exact=True).select_option(role.partition(" ")[0])
        else:
            assert page.locator(".k-face.k-hot").count() == 1  # the list shows what is pointed at
            box = page.locator(".ks-view canvas").first.bounding_box()
            page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + found * box["height"])
        page.wait_for_function(
            "name => [...document.querySelectorAll('.k-face select')]"
            ".find(e => e.ariaLabel == name).value != ''",
            arg=wanted,
        )
    page.get_by_label("needle.tip", exact=True).select_option("contact")
    page.wait_for_function("!document.getElementById('k-next').disabled")
    require_within(page)

    onward(page, "text=Young's modulus")
    require_within(page)
    onward(page, "text=Closing force")
    page.get_by_label("Speed at the impact").fill("0.25 m/s")
    page.get_by_label("Speed at the impact").press("Tab")
    onward(page, "text=static hold")
    assert "0 errors" in page.inner_text("#k-body")
    require_within(page)
    onward(page, "text=klack: 1")
    page.get_by_label("Name of the valve").fill("../out")
    page.get_by_label("Name of the valve").press("Tab")
    page.get_by_role("button", name="Write, open editor").click()
    page.wait_for_selector("text=letters, digits")
    page.get_by_label("Name of the valve").fill("first")
    page.get_by_label("Name of the valve").press("Tab")
    require_within(page)
    page.get_by_role("button", name="Write, open editor").click()
    page.wait_for_selector("text=valid impact, saved")

    text = (folder / "first" / "case.yaml").read_text("utf-8")
    case = read_case(text, folder / "first" / "case.yaml")
    assert (str(case.contact.moving), str(case.contact.stop)) == ("needle.tip", "housing.seat")
    assert case.bodies["housing"].fixed[0].surface == "rim"
    assert case.motion.speed == 0.25
    assert sorted(p.name for p in (folder / "first").iterdir()) == ["case.yaml"]


def tab_to(page: Any, wanted: Any) -> None:
    """Press Tab until the focus is there."""
    for _ in range(150):
        page.keyboard.press("Tab")
        if wanted.evaluate("e => e === document.activeElement"):
            return
    raise AssertionError(f"no Tab leads to {wanted}")


def press_next(page: Any, sign: str) -> None:
    page.wait_for_selector("#k-next:enabled")
    tab_to(page, page.locator("#k-next"))
    page.keyboard.press("Enter")
    page.wait_for_selector(sign)


def test_from_drawings_by_keyboard_and_it_survives(page, server, folder, browser):
    """Tab, arrows, letters and Enter lead through all steps; nothing is focused by a script."""
    open_guide(page, server)
    tab_to(page, page.get_by_label("The two bodies come from"))
    page.keyboard.press("ArrowDown")
    for body in ("needle", "housing"):
        fill_in = page.get_by_role("button", name=f"Fill in the example of the {body}")
        fill_in.wait_for()
        tab_to(page, fill_in)
        page.keyboard.press("Enter")
        page.wait_for_function(
            "body => [...document.querySelectorAll('textarea')]"
            ".find(e => e.ariaLabel.includes(body)).value.includes('z, surface')",
            arg=body,
        )
    read(page)
    press_next(page, ".ks-view canvas")
    page.wait_for_selector("text=Proposed from the geometry: needle.tip hits housing.seat")
    for name, key, role in (("rim", "Home", ""), ("outside", "h", "held")):
        tab_to(page, page.get_by_label(f"housing.{name}", exact=True))
        page.keyboard.press(key)
        page.wait_for_function("role => document.activeElement.value === role", arg=role)
    press_next(page, "text=Young's modulus")
    tab_to(page, page.get_by_label("Material of the housing"))
    page.keyboard.press("ArrowDown")
    press_next(page, "text=Closing force")
    tab_to(page, page.get_by_label("Speed at the impact"))
    page.keyboard.press("Control+a")
    page.keyboard.type("0.25 m/s")
    press_next(page, "text=static hold")
    page.reload()  # and another server: the step and all choices are there
    page.wait_for_selector("text=static hold")
    with Served(folder) as other:
        context = browser.new_context()
        second = context.new_page()
        second.set_default_timeout(LONG)
        second.goto(other.address)
        second.wait_for_selector("#k-body")
        second.goto(f"{other.base}/new")
        second.wait_for_selector("text=static hold")
        second.get_by_role("button", name="2 Faces").press("Enter")
        second.wait_for_selector(".k-face select")
        assert second.get_by_label("housing.outside", exact=True).input_value() == "held"
        context.close()
    page.goto(f"{server.base}/new")
    page.wait_for_selector("button:enabled >> text=6 Case")
    tab_to(page, page.get_by_role("button", name="6 Case"))
    page.keyboard.press("Enter")
    page.wait_for_selector("text=klack: 1")
    tab_to(page, page.get_by_label("Name of the valve"))
    page.keyboard.press("Control+a")
    page.keyboard.type("drawn")
    tab_to(page, page.get_by_role("button", name="Write, open editor"))
    page.keyboard.press("Enter")
    page.wait_for_selector("text=valid impact, saved")
    case = load_any_case(folder / "drawn" / "case.yaml")
    assert case.bodies["housing"].fixed[0].surface == "outside"
    assert case.motion.speed == 0.25
    assert case.bodies["housing"].material != case.bodies["needle"].material


@pytest.mark.parametrize("kind", ["turned", "square", "overlapping"])
def test_faces_are_proposed_with_the_reason_of_files_chosen_at_once(page, server, folder, kind):
    """Truth: as drawn; a square rod, no turned part, ends 0.1 mm above its block, or in it."""
    from netgen.occ import Box, Pnt, Z

    faces, how = ("tip", "seat", "rim"), "nearest along the axis"
    if kind != "turned":
        faces, how = ("foot", "up", "base"), "nearest along the axis, 100 um apart as drawn"
        low = 0.1 if kind == "square" else -1.0
        rod, block = Box(Pnt(-1, -1, low), Pnt(1, 1, 9)), Box(Pnt(-3, -2, -6), Pnt(3, 2, 0))
        ends = rod.faces.Min(Z), block.faces.Max(Z), block.faces.Min(Z)
        for face, name in zip(ends, faces, strict=True):
            face.name = name
        rod.WriteStep(str(folder / "cad" / f"{kind}-needle.step"))
        block.WriteStep(str(folder / "cad" / f"{kind}-housing.step"))
    file = "cad/{}.step" if kind == "turned" else f"cad/{kind}-{{}}.step"
    open_guide(page, server)
    choose_step(page, "needle", "cad/words.step")
    page.wait_for_selector("text=which starts with")  # so the process that reads is there
    with slow(server, "shapes:Shapes"):
        for body in ("needle", "housing"):
            choose_step(page, body, file.format(body))
        page.wait_for_function("document.body.innerText.split('Reading ...').length == 3")
        page.wait_for_selector(".k-wait[data-for$=' s']")  # the seconds of a wait
    read(page)
    # a part that is not turned is no success
    assert page.locator(".k-read.k-good").count() == (2 if kind == "turned" else 0)
    page.wait_for_selector("#k-next:enabled")
    onward(page, ".ks-view canvas")
    assert page.locator(".k-wait").count() == 0  # each has ended
    words = page.locator("#k-step .k-read").inner_text()
    is_good = page.locator("#k-step .k-read.k-good").count() == 1
    assert is_good == (kind != "overlapping")
    if kind == "overlapping":
        assert words.startswith("No contact faces are proposed: the bodies overlap")
        return
    assert f"needle.{faces[0]} hits housing.{faces[1]}, which are {how}" in words
    roles = (("needle", "contact"), ("housing", "contact"), ("housing", "held"))
    for (body, role), face in zip(roles, faces, strict=True):
        assert page.get_by_label(f"{body}.{face}", exact=True).input_value() == role


def test_what_rests_on_the_checks_cannot_be_pressed_before_they_are_done(page, server, folder):
    planned(3, model="solid")(folder)  # chosen of STEP files, before there were drawings
    page.goto(f"{server.base}/new")
    page.wait_for_selector("text=Closing force")
    with slow(server, "shapes:Shapes"):
        onward(page, "text=Checking ...")
        assert page.locator("#k-next").is_disabled()
        assert page.get_by_role("button", name="6 Case").is_disabled()
    page.wait_for_selector("text=static hold")
    assert page.get_by_role("button", name="6 Case").is_enabled()
    with slow(server, "shapes:Shapes"):
        onward(page, "text=writing ...")
        writing = page.get_by_role("button", name="Write")
        assert [writing.nth(k).is_disabled() for k in range(writing.count())] == [True] * 3
    page.wait_for_selector("text=klack: 1")
    assert writing.first.is_enabled()


def test_what_is_done_while_parts_are_read_is_kept(page, server):
    open_guide(page, server)
    choose_step(page, "needle", "cad/needle.step")
    read(page, 1)  # so the process that reads is there
    with slow(server, "shapes:Shapes"):
        choose_step(page, "needle", "cad/housing.step")
        choose_step(page, "housing", "cad/housing.step")  # at once, the needle is being read
        page.wait_for_selector("text=Reading ...")
        page.wait_for_function("document.getElementById('k-next').disabled")
    read(page)
    page.wait_for_selector("text=Both parts are turned")

    page.get_by_label("The two bodies come from").select_option("table")
    areas = {body: page.locator(f"textarea[aria-label*={body}]") for body in ("needle", "housing")}
    areas["needle"].wait_for()
    page.get_by_role("button", name="Fill in the example of the needle").click()
    areas["housing"].press_sequentially("0, 0", delay=60)  # half a row, while the needle is read
    read(page, 1)
    assert areas["housing"].input_value() == "0, 0"
    assert areas["housing"].evaluate("e => e === document.activeElement")
    assert areas["needle"].input_value().strip() != ""

    for leave in ("Start over", "1 Parts"):  # no field of a step that is being left takes a change
        is_closed = page.get_by_role("button", name=leave).evaluate(
            "e => { e.click(); return document.querySelector('#k-step > *').inert; }"
        )
        assert is_closed
        page.wait_for_function("!document.querySelector('[inert]')")


def test_files_that_cannot_be_used_are_told_in_words(page, server, folder):
    open_guide(page, server)
    words = {
        "cad/empty.step": "which starts with 'ISO-10303-21;'",
        "cad/words.step": "which starts with 'ISO-10303-21;'",
        "cad/lost.step": "Try:",
        f"cad/{ATTACK}": "a body of revolution",
    }
    for file, expected in words.items():
        choose_step(page, "needle", file)
        page.wait_for_selector(f"text={expected}")
        assert str(folder) not in page.inner_text("#k-body")  # places of the server stay there
    upload = page.get_by_label("STEP file of the housing, from here")
    upload.set_input_files(
        {"name": "no.step", "mimeType": "model/step", "buffer": b"PK" + b"x" * 5_000_000}
    )
    page.wait_for_selector("text=no.step: uploaded file: got a file that begins with")
    answer = page.evaluate(
        "async () => (await fetch('/upload', {method: 'POST', body: 'x'.repeat(2 ** 26 + 1)}))"
        ".status"
    )
    assert answer == 413
    told = page.evaluate("klackUpload({name: 'a.step', size: 2 ** 27}, 2 ** 26)")
    assert "128 MiB, more than 64 MiB" in told["error"]
    assert list((folder / ".klack-app" / "uploads").glob("*.part")) == []


def test_bodies_of_a_case_are_shown_and_a_hundred_pages_leave_no_context(page, server):
    page.goto(f"{server.base}/show?path=demo.yaml")
    page.wait_for_selector(".ks-view canvas")
    page.wait_for_selector("text=faces in contact")
    assert page.evaluate("window.klackScenes") == 1
    require_within(page)
    page.get_by_role("button", name="Colours").click()  # auto, light
    page.wait_for_function("!document.querySelector('.ks').classList.contains('ks-dark')")

    # an element that comes and goes on one page, as in the guide
    leak = page.evaluate(
        """async () => {
          const { mount } = await import('/static/scene.js');
          const address = performance.getEntriesByType('resource')
            .map(e => e.name).find(n => n.includes('/scene/'));
          const payload = await (await fetch(address)).json();
          const place = document.createElement('div');
          document.body.append(place);
          let lost = 0;
          for (let i = 0; i < 100; i++) {
            const scene = mount(place, payload, { autoplay: false });
            const canvas = place.querySelector('.ks-view canvas');
            const context = canvas.getContext('webgl2');
            scene.dispose();
            lost += context.isContextLost() ? 1 : 0;
          }
          const empty = place.childElementCount === 0;
          place.remove();
          return [lost, empty, document.querySelectorAll('.ks').length];
        }"""
    )
    assert leak == [100, True, 1]
    page.get_by_role("link", name="Edit").click()
    page.wait_for_selector("#k-yaml")
    page.goto(f"{server.base}/show?path=../x")
    page.wait_for_selector("text=below the folder")
    page.goto(f"{server.base}/show?path=cad/words.step")
    page.wait_for_selector("text=no .yaml file")
