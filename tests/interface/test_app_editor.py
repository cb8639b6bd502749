"""What is typed into the editor is in its text and its boxes, however slow the server is.

Truth: the text is that of the file with each value that was typed last at its key; nothing else.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from klack.case.reader import find_case

pytest.importorskip("nicegui")
from app_browser import page, server, slow
from browser_pages import put, text_of
from served_app import Served

__all__ = ["page", "server"]  # fixtures

pytestmark = pytest.mark.slow

CASE = "case.yaml"
SPEED, DURATION, FORCE = "motion.speed", "run.duration", "motion.force"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("editor")
    (place / CASE).write_text(find_case("demo-valve-axisymmetric").read_text("utf-8"), "utf-8")
    return place


@pytest.fixture
def editor(page: Any, server: Served, folder: Path) -> Iterator[Any]:
    """The page of the case as it is saved, all of its form open."""
    page.set_default_timeout(30_000)
    page.goto(f"{server.base}/case?path={CASE}")
    page.wait_for_selector("text=valid impact, saved")
    page.evaluate("document.querySelectorAll('details').forEach(part => { part.open = true; })")
    yield page
    page.get_by_role("button", name="Discard changes").click()
    page.wait_for_selector("text=valid impact, saved")


def enter(page: Any, key: str, value: str, delay: float = 0.0, end: str = "Enter") -> None:
    """Type into a box as a hand does; a pause after each key [ms]."""
    page.locator(f"[id='f-{key}']").focus()
    page.keyboard.press("Control+a")
    page.keyboard.type(value, delay=delay)
    if end:
        page.keyboard.press(end)


def require(page: Any, text: str, **values: str) -> None:
    """The page comes to rest with this text, and its boxes have these values."""
    page.wait_for_function("text => document.getElementById('k-yaml').value === text", arg=text)
    page.wait_for_selector("text=valid impact, not saved")
    for key, value in values.items():
        page.wait_for_function(
            "([id, value]) => document.getElementById(id).value === value",
            arg=[f"f-{key.replace('__', '.')}", value],
        )
    page.wait_for_timeout(700)  # nothing is put back later
    assert text_of(page) == text
    for key, value in values.items():
        assert page.locator(f"[id='f-{key.replace('__', '.')}']").input_value() == value


@pytest.mark.parametrize(
    ("gap", "delay"), [(0, 0), (0, 120), (50, 0), (300, 120), (500, 0), (1000, 60)]
)
def test_two_boxes_one_after_the_other(editor, gap, delay):
    text = text_of(editor)
    enter(editor, SPEED, "0.4 m/s", end="Tab")
    editor.wait_for_timeout(gap)
    enter(editor, DURATION, "12345 ns", delay, end="Tab")

    changed = text.replace("0.3 m/s", "0.4 m/s").replace("55 us", "12345 ns")
    require(editor, changed, motion__speed="0.4 m/s", run__duration="12345 ns")


@pytest.mark.parametrize("gap", [0, 400])
def test_one_box_twice(editor, gap):
    text = text_of(editor)
    enter(editor, SPEED, "0.4 m/s")
    editor.wait_for_timeout(gap)
    enter(editor, SPEED, "0.5 m/s")

    require(editor, text.replace("0.3 m/s", "0.5 m/s"), motion__speed="0.5 m/s")


def test_a_slow_server_gets_all_of_three_boxes_and_the_text(editor, server):
    """Each kind of change while the one before is on its way, and the text in the middle."""
    text = text_of(editor)
    with slow(server, "reader:Reader"):
        enter(editor, SPEED, "0.4 m/s", end="Tab")
        enter(editor, DURATION, "60 us", end="Tab")
        enter(editor, SPEED, "0.45 m/s", end="Tab")
        editor.get_by_label("case file, YAML").focus()
        editor.keyboard.press("Control+End")
        editor.keyboard.type("# mine\n")
        editor.wait_for_timeout(600)  # a check of that text waits, too
        enter(editor, "run.full_step", "70 ns", 30, end="Tab")
        assert "checking" in editor.locator(".k-badge").first.inner_text()

    changed = text.replace("0.3 m/s", "0.45 m/s").replace("55 us", "60 us")
    changed = changed.replace("80 ns", "70 ns") + "# mine\n"
    require(
        editor,
        changed,
        motion__speed="0.45 m/s",
        run__duration="60 us",
        run__full_step="70 ns",
    )


def test_save_waits_for_what_was_typed_before_it(editor, server, folder):
    before = (folder / CASE).read_text("utf-8")
    with slow(server, "reader:Reader"):
        enter(editor, SPEED, "0.4 m/s", end="")
        editor.get_by_role("button", name="Save", exact=True).click()
        editor.wait_for_timeout(300)
    editor.wait_for_selector("text=valid impact, saved")
    saved = (folder / CASE).read_text("utf-8")
    (folder / CASE).write_text(before, "utf-8")

    assert saved == before.replace("0.3 m/s", "0.4 m/s")


def test_a_form_made_again_keeps_what_is_half_typed(editor):
    """A shorter list takes a box away; the box with the focus, its letters and its cursor stay."""
    text = text_of(editor)
    put(editor, text.replace(", full]", "]"))
    enter(editor, DURATION, "1245 ns", end="")
    for _ in range(5):
        editor.keyboard.press("ArrowLeft")
    editor.locator("[id='f-run.levels.4']").wait_for(state="detached")
    editor.keyboard.type("3", delay=50)
    editor.keyboard.press("Tab")

    changed = text.replace(", full]", "]").replace("55 us", "12345 ns")
    require(editor, changed, run__duration="12345 ns")


def test_a_box_without_letters_of_its_own_follows_the_text_once_it_is_left(editor, server):
    with slow(server, "reader:Reader"):
        put(editor, text_of(editor).replace("0.3 m/s", "0.4 m/s"))
        editor.locator(f"[id='f-{SPEED}']").focus()
        editor.wait_for_timeout(600)
    editor.wait_for_selector("text=valid impact, not saved")
    editor.wait_for_timeout(300)
    editor.locator(f"[id='f-{DURATION}']").focus()
    editor.wait_for_function("document.getElementById('f-motion.speed').value === '0.4 m/s'")
    assert "0.4 m/s" in text_of(editor)


def test_a_key_that_was_not_there_is_written_and_its_neighbour_typed(editor):
    """Further keys stay where they are, open, while one of them is written."""
    enter(editor, "contact.crown", "1 um", end="Tab")
    enter(editor, "contact.tilt", "0.1 deg", 150, end="Tab")
    editor.wait_for_function(
        "['crown: 1 um', 'tilt: 0.1 deg'].every("
        "line => document.getElementById('k-yaml').value.includes(line))"
    )
    for key, value in (("crown", "1 um"), ("tilt", "0.1 deg")):
        box = editor.locator(f"[id='f-contact.{key}']")
        assert (box.input_value(), box.is_visible()) == (value, True)


def test_a_text_of_several_lines_stays_until_it_is_changed_and_then_it_alone_changes(editor):
    text = text_of(editor)
    editor.locator("[id='f-title']").focus()
    for _ in range(3):  # through its box
        editor.keyboard.press("Tab")
    enter(editor, "description", "Short.", end="Tab")

    begin, end = text.index("description: "), text.index("materials:")
    require(editor, f'{text[:begin]}description: "Short."\n{text[end:]}', description="Short.")


def test_what_was_typed_at_the_moment_of_a_reload_is_there_again(editor):
    enter(editor, SPEED, "0.4 m/s", end="")
    editor.reload()
    editor.wait_for_selector("text=valid impact, not saved")
    assert "speed: 0.4 m/s" in text_of(editor)
    editor.get_by_label("case file, YAML").focus()
    editor.keyboard.press("Control+End")
    editor.keyboard.type("# mine")
    editor.reload()
    editor.wait_for_selector("text=valid impact, not saved")
    assert text_of(editor).endswith("# mine")


def test_what_the_server_did_not_hear_before_a_reload_is_there_again(editor):
    """Messages of a page that goes may be lost: none is sent here."""
    text = text_of(editor)
    editor.evaluate("window.socket.emit = () => {}")
    enter(editor, SPEED, "0.4 m/s", end="")
    editor.reload()
    editor.wait_for_selector("text=valid impact, not saved")
    require(editor, text.replace("0.3 m/s", "0.4 m/s"), motion__speed="0.4 m/s")
    editor.evaluate("window.socket.emit = () => {}")
    editor.get_by_label("case file, YAML").focus()
    editor.keyboard.press("Control+End")
    editor.keyboard.type("# mine")
    editor.reload()
    require(editor, text.replace("0.3 m/s", "0.4 m/s") + "# mine")


# ----------------------------------------------------------------------- lines, folds, errors

MARKED = (
    "kind => [...document.querySelectorAll(`.cm-lineNumbers .${kind}`)]"
    ".map(e => e.textContent).join()"
)


def require_marks(page: Any, kind: str, *lines: int) -> None:
    page.wait_for_function(
        f"([kind, lines]) => ({MARKED})(kind) === lines", arg=[kind, ",".join(map(str, lines))]
    )


def line_of(text: str, words: str) -> int:
    return text[: text.index(words)].count("\n") + 1


def cursor(page: Any) -> tuple[int, str]:
    """Line of the cursor, from 1, and what stands before it there."""
    number, before = page.evaluate(
        "() => { const { focusNode, focusOffset } = getSelection();"
        "const line = (focusNode.closest ? focusNode : focusNode.parentNode).closest('.cm-line');"
        "const before = new Range(); before.setStart(line, 0);"
        "before.setEnd(focusNode, focusOffset);"
        "return [document.querySelector('.cm-lineNumbers .cm-activeLineGutter').textContent,"
        " before.toString()]; }"
    )
    return int(number), str(before)


def test_the_line_of_an_error_is_marked_where_it_moves_and_the_cursor_goes_there(editor, server):
    text = text_of(editor)
    wrong = text.replace("0.3 m/s", "0.3 kg")
    line = line_of(wrong, "0.3 kg")
    go = editor.get_by_role("button", name="Go to")
    put(editor, wrong)
    editor.wait_for_selector("#k-yaml[aria-invalid=true]")
    assert go.inner_text() == f"Go to line {line}"
    go.press("Enter")
    require_marks(editor, "k-wrong", line)
    assert cursor(editor) == (line, "")
    with slow(server, "reader:Reader"):
        editor.keyboard.press("Control+Home")
        editor.keyboard.type("# one more\n")
        go.click()
        require_marks(editor, "k-wrong", line + 1)
        assert cursor(editor) == (line + 1, "")
    editor.get_by_role("button", name=f"Go to line {line + 1}").press("Enter")
    require_marks(editor, "k-wrong", line + 1)
    put(editor, text)
    editor.wait_for_selector("#k-yaml[aria-invalid=false]")
    require_marks(editor, "k-wrong")
    editor.wait_for_selector("text=valid impact, saved")
    assert not go.is_visible()


def test_doubts_of_a_valid_text_are_shown_and_marked_at_the_lines_of_their_keys(editor):
    """An unusual speed, and a parameter without use; truth: the lines of their names."""
    text = text_of(editor)
    odd = text.replace("0.3 m/s", "30 m/s").replace(
        "materials:", "parameters: {idle: 1 N}\nmaterials:"
    )
    lines = [line_of(odd, words) for words in ("idle: 1 N", "30 m/s")]
    put(editor, odd)
    editor.wait_for_selector("text=valid impact, not saved")
    words = editor.locator("#k-doubts").inner_text()
    editor.get_by_role("button", name=f"Go to line {lines[0]}").press("Enter")
    editor.locator(".cm-lineNumbers .k-odd").get_by_text(str(lines[0]), exact=True).wait_for()
    editor.keyboard.press("Control+End")
    editor.locator(".cm-lineNumbers .k-odd").get_by_text(str(lines[1]), exact=True).wait_for()
    assert "parameters.idle: nothing in this case" in words
    assert "motion.speed: 30 m/s is unusual" in words
    assert editor.locator("#k-yaml").get_attribute("aria-invalid") == "false"
    put(editor, text)
    editor.wait_for_function("document.getElementById('k-doubts').textContent === ''")


def test_a_click_on_the_way_to_an_error_goes_to_its_column_in_a_folded_part(editor):
    """Folded by keys; truth: the brackets of the error, and the text without its folds."""
    text = text_of(editor).replace("speed: 0.3 m/s}", "speed: 0.3 m/s}}")
    assert "}}" in text
    put(editor, text)
    editor.wait_for_selector("#k-yaml[aria-invalid=true]")
    editor.keyboard.press("Control+Alt+[")  # all parts
    editor.locator(".cm-foldPlaceholder").first.wait_for()
    go = editor.get_by_role("button", name="Go to")
    go.click()
    line, before = cursor(editor)
    assert line == line_of(text, "0.3 m/s}}")
    assert text.splitlines()[line - 1][len(before) - 1 : len(before) + 1] == "}}"
    assert text_of(editor) == text


def test_a_long_text_is_drawn_where_it_is_seen(editor):
    """Nodes do not grow with the text, so neither does the time of a key."""
    text = text_of(editor)
    put(editor, text + "a: {b: 1}\n" * 60_000 + "# " + "x" * 6000)
    editor.keyboard.press("Control+End")
    last = text.count("\n") + 60_001
    editor.locator(".cm-lineNumbers").get_by_text(str(last), exact=True).wait_for()
    assert editor.evaluate("document.querySelectorAll('.cm-editor *').length") < 3000
