"""The page of the viewer in a browser; truth: the geometry that went in, and what a user sees.

Chromium draws by software: it takes seconds, so all of these are slow tests.
"""

from dataclasses import replace
from typing import Any

import pytest
from viewer_case import brick_view

from klack.viewer.view import page_of

pytestmark = pytest.mark.slow

DRAWN = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
BUTTON = "[...document.querySelectorAll('.ks-panel button')].find(b => b.textContent === '{}')"


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> str:
    path = tmp_path_factory.mktemp("page") / "brick.html"
    path.write_text(page_of(brick_view()), encoding="utf-8")
    return path.as_uri()


class Opened:
    """A page from a file, with what it said and asked for."""

    def __init__(self, browser: Any, file: str, width: int = 1000, **more: Any) -> None:
        self.said: list[str] = []
        self.asked: list[str] = []
        self.context = browser.new_context(viewport={"width": width, "height": 700}, **more)
        self.page = self.context.new_page()
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(file)
        self.page.evaluate(DRAWN)

    def __enter__(self) -> "Opened":
        return self

    def __exit__(self, *_: object) -> None:
        self.context.close()

    def click(self, button: str) -> None:
        self.page.evaluate(BUTTON.format(button) + ".click()")

    def probe(self, body: int, vertex: int) -> list[float]:
        return self.page.evaluate(f"klackScene.probe({body}, {vertex})")

    def state(self) -> dict[str, Any]:
        return self.page.evaluate("klackScene.state()")


@pytest.mark.parametrize("bodies", [0, 1])
def test_a_wide_schematic_is_scrolled_and_not_shrunk_beyond_reading(browser, tmp_path, bodies):
    """Its letters of 10 px keep 8: at 400 px a picture of 2000 px is 1600 px wide."""
    picture = '<svg xmlns="http://www.w3.org/2000/svg" width="2000" height="500"/>'
    view = brick_view()
    path = tmp_path / "wide.html"
    view = replace(view, bodies=view.bodies[:bodies], schematic=picture)
    path.write_text(page_of(view), encoding="utf-8")
    for width, wanted in ((400, 1600), (3000, 2000)):
        with Opened(browser, path.as_uri(), width) as opened:
            if bodies:
                opened.click("Schematic")
            page = opened.page
            shown = page.evaluate("document.querySelector('.ks-schematic').clientWidth")
            assert shown == pytest.approx(wanted, abs=3)  # pixels of its edge
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            assert opened.said == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [400, 1000, 1600])
def test_it_opens_from_a_file_at_every_width(browser, file, width, scheme):
    with Opened(browser, file, width, color_scheme=scheme) as opened:
        page = opened.page
        assert opened.said == []
        assert [url for url in opened.asked if not url.startswith(("file:", "data:"))] == []
        assert opened.state()["hasScene"]
        assert page.evaluate("document.querySelectorAll('canvas').length") == 2  # and the legend
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        shown = page.evaluate("document.querySelector('.ks-view').getBoundingClientRect().width")
        assert shown > 0.6 * width or width > 400


def test_the_bodies_are_there_to_be_seen(browser, file):
    from io import BytesIO

    import numpy as np
    from PIL import Image

    with Opened(browser, file) as opened:
        picture = opened.page.locator(".ks-view").screenshot()
        colours = np.asarray(Image.open(BytesIO(picture)).convert("RGB"), dtype=int)
        height, width, _ = colours.shape
        middle = colours[height // 3 : 2 * height // 3, 2 * width // 5 : 3 * width // 5]
        background = colours[5, 5]
        covered = np.mean(np.abs(middle - background).sum(axis=2) > 60)
        assert covered > 0.9


def test_hovering_names_a_face_and_a_click_copies_it(browser, file):
    permissions = ["clipboard-read", "clipboard-write"]
    with Opened(browser, file, permissions=permissions) as opened:
        page = opened.page
        page.evaluate("klackScene.on('pick', name => { window.picked = name; })")
        box = page.locator(".ks-view canvas").first.bounding_box()
        # seen from above at an angle: the top of the brick is the upper part of the picture
        found = None
        for share in (0.06, 0.08, 0.1, 0.12, 0.14):
            page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + share * box["height"])
            page.evaluate(DRAWN)
            text = page.locator(".ks-tip").text_content()
            if text and "top" in text:
                found = share
                break
        assert found is not None
        assert page.locator(".ks-tip").text_content() == "brick.top (contact)"
        page.mouse.down()
        page.mouse.up()
        # functions, not words: the page forbids to read words as a script a second time
        page.wait_for_function("() => window.picked !== undefined")
        assert page.evaluate("window.picked") == "brick.top"
        page.wait_for_function(
            "() => document.querySelector('.ks-said').textContent.startsWith('Copied')"
        )


def test_a_button_of_the_list_names_the_same(browser, file):
    with Opened(browser, file) as opened:
        opened.page.evaluate("klackScene.on('pick', name => { window.picked = name; })")
        opened.click("block.bottom")
        assert opened.page.evaluate("window.picked") == "block.bottom"


def test_a_mode_moves_its_body_only_as_far_as_it_says(browser, file):
    with Opened(browser, file, reduced_motion="reduce") as opened:
        page = opened.page
        before = [opened.probe(body, 0) for body in (0, 1)]
        tops = [v for v in range(24) if opened.probe(0, v)[2] > 4.9]
        still = {v: opened.probe(0, v) for v in tops}
        page.evaluate("klackScene.showMode(0, 0.1)")
        page.evaluate(DRAWN)

        size = (2**2 + 3**2 + 10**2) ** 0.5  # both bodies together
        for vertex in tops:
            moved = [a - b for a, b in zip(opened.probe(0, vertex), still[vertex], strict=True)]
            assert moved == pytest.approx([0.1 * size, 0.0, 0.0], abs=1e-4)
        assert opened.probe(1, 0) == before[1]
        assert opened.state()["mode"] == 0


def test_a_mode_is_animated_and_stops(browser, file):
    with Opened(browser, file) as opened:
        opened.page.evaluate("klackScene.showMode(1)")
        top = next(v for v in range(24) if opened.probe(0, v)[2] > 4.9)
        seen = set()
        for _ in range(6):
            opened.page.wait_for_timeout(60)
            seen.add(round(opened.probe(0, top)[1], 6))
        assert len(seen) > 3
        opened.click("Pause")
        opened.page.evaluate(DRAWN)
        assert opened.probe(0, top) == opened.probe(0, top)
        assert not opened.state()["playing"]


def test_the_cursor_runs_through_the_impact_and_the_body_follows(browser, file):
    with Opened(browser, file, reduced_motion="reduce") as opened:
        page = opened.page
        opened.click("Impact")
        start = opened.probe(0, 0)
        cursor = "document.querySelector('.ks-cursor').getBoundingClientRect().x"
        first = page.evaluate(cursor)
        page.evaluate("klackScene.setTime(1)")
        page.evaluate(DRAWN)
        middle = page.evaluate(cursor)
        page.evaluate("klackScene.setTime(2)")
        page.evaluate(DRAWN)
        last = page.evaluate(cursor)
        assert middle - first == pytest.approx(last - middle, abs=1.0)
        assert last > first + 50
        # amplitude 1e-6 of the rigid motion, which is unit displacement along z
        rise = opened.probe(0, 0)[2] - start[2]
        factor = page.evaluate("klackScene.state().factor")
        assert rise == pytest.approx(1e-6 * 1e3 * factor, rel=1e-3)


def test_a_click_on_a_peak_shows_its_mode(browser, file):
    with Opened(browser, file, reduced_motion="reduce") as opened:
        opened.page.locator(".ks-mark").nth(1).click()
        assert opened.state()["mode"] == 1
        assert "2.5 kHz" in opened.page.locator(".ks-panel select[aria-label=Mode]").evaluate(
            "box => box.selectedOptions[0].textContent"
        )


def test_centres_of_gravity_stand_in_the_middle_of_their_bodies(browser, file):
    """Two equal bricks, one on the other: halfway between both centres is the middle of the view.

    The camera is orthographic, so that halves stay halves; one pixel for the frame.
    """
    places = """() => { const box = document.querySelector('.ks-view').getBoundingClientRect();
        return [...document.querySelectorAll('.ks-over .ks-centre:not([hidden])')].map(sign => {
            const own = sign.getBoundingClientRect();
            return [own.x + own.width / 2 - box.x - box.width / 2,
                    own.y + own.height / 2 - box.y - box.height / 2]; }); }"""
    with Opened(browser, file) as opened:
        page = opened.page
        upper, lower = page.evaluate(places)
        assert [a + b for a, b in zip(upper, lower, strict=True)] == pytest.approx([0, 0], abs=2.0)
        assert upper[1] < lower[1] - 50  # above it on the page
        page.get_by_label("brick", exact=True).uncheck()
        page.evaluate(DRAWN)
        assert page.evaluate(places) == [lower]
        page.get_by_label("Centres of gravity").uncheck()
        page.evaluate(DRAWN)
        assert page.evaluate(places) == []


def test_a_stop_names_its_faces_and_a_name_lightens_both_of_its_buttons(browser, file):
    with Opened(browser, file) as opened:
        page = opened.page
        line = page.locator(".ks-said-of")
        assert line.inner_text().startswith("seat: block.bottom on brick.top: gap 2")
        line.locator("button").nth(1).focus()
        hot = "[...document.querySelectorAll('.ks-hot')].map(e => e.textContent)"
        assert page.evaluate(hot) == ["brick.top", "brick.top"]
        row = page.locator(".ks-faces div", has_text="brick.top")
        assert "30 mm²" in row.inner_text().replace("\xa0", " ")


def test_arrow_keys_turn_the_bodies(browser, file):
    with Opened(browser, file) as opened:
        page = opened.page
        axes = "document.querySelector('.ks-axes').innerHTML"
        page.locator(".ks-view canvas").first.focus()
        before = page.evaluate(axes)
        page.keyboard.press("ArrowLeft")
        page.evaluate(DRAWN)
        assert page.evaluate(axes) != before


def test_all_controls_are_reached_by_tab_and_have_names(browser, file):
    with Opened(browser, file) as opened:
        nameless = opened.page.evaluate(
            "[...document.querySelectorAll("
            "'button, select, input, canvas[tabindex], svg[tabindex]')]"
            ".filter(e => !(e.textContent.trim() || e.getAttribute('aria-label') "
            "|| e.labels?.[0]?.textContent.trim())).map(e => e.outerHTML)"
        )
        assert nameless == []


def contrast(a: list[int], b: list[int]) -> float:
    """Of WCAG 2.1, 1.4.3."""

    def luminance(rgb: list[int]) -> float:
        linear = [
            x / 12.92 if x <= 0.03928 else ((x + 0.055) / 1.055) ** 2.4
            for x in (value / 255 for value in rgb)
        ]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    high, low = sorted((luminance(a), luminance(b)), reverse=True)
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_words_have_contrast(browser, file, scheme):
    read = """name => { const probe = document.createElement('i');
        probe.style.color = `var(--${name})`; document.querySelector('.ks').append(probe);
        const text = getComputedStyle(probe).color; probe.remove();
        return text.match(/\\d+/g).slice(0, 3).map(Number); }"""
    with Opened(browser, file, color_scheme=scheme) as opened:
        colours = {
            name: opened.page.evaluate(read, name)
            for name in ("ink", "soft", "panel", "back", "accent", "on")
        }
    for text, behind in (("ink", "panel"), ("soft", "panel"), ("ink", "back"), ("on", "accent")):
        assert contrast(colours[text], colours[behind]) >= 4.5, (text, behind)


def test_leaving_frees_the_scene(browser, file):
    with Opened(browser, file) as opened:
        left = opened.page.evaluate(
            """() => { const box = document.getElementById('scene');
            const gl = box.querySelector('.ks-view canvas').getContext('webgl2');
            klackScene.dispose(); klackScene.dispose();
            return [box.children.length, gl.isContextLost()]; }"""
        )
        assert left == [0, True]


def test_many_scenes_one_after_another_do_not_run_out_of_contexts(browser, file):
    with Opened(browser, file) as opened:
        opened.page.evaluate(
            """() => { const box = document.getElementById('scene');
            const data = JSON.parse(document.getElementById('payload').textContent);
            klackScene.dispose();
            for (let i = 0; i < 24; i++) mount(box, data).dispose();
            window.klackScene = mount(box, data); }"""
        )
        opened.page.evaluate(DRAWN)
        assert opened.state()["hasScene"]
        assert opened.said == []
