"""The network of a case is edited on its schematic, in a browser.

Truth: the text of the case.  What is done on the schematic is in it, what is written in it is
drawn, and as many steps back as were made give the first text, byte for byte.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("nicegui")
from app_browser import page, require_within, server, slow
from browser_pages import TEXT, put, text_of
from served_app import Served

__all__ = ["page", "server"]  # fixtures

pytestmark = pytest.mark.slow

CASE = "case.yaml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("network")
    (place / CASE).write_text(Path("docs/how-to/small_valve.yaml").read_text("utf-8"), "utf-8")
    return place


@pytest.fixture
def editor(page: Any, server: Served) -> Iterator[Any]:
    """The page of the case as it is saved, with its schematic."""
    page.set_default_timeout(60_000)
    page.goto(f"{server.base}/case?path={CASE}")
    page.wait_for_selector("text=valid stroke, saved")
    page.wait_for_selector(".k-net svg")
    yield page
    page.get_by_role("button", name="Discard changes").click()
    page.wait_for_selector("text=valid stroke, saved")


def require_text(page: Any, text: str) -> None:
    page.wait_for_function("text => document.getElementById('k-yaml').value === text", arg=text)


def require_line(page: Any, words: str) -> None:
    page.wait_for_function(
        "words => document.getElementById('k-yaml').value.includes(words)", arg=words
    )


def test_a_bleed_is_added_connected_renamed_removed_and_all_is_undone(editor):
    """With the mouse, as an engineer would."""
    texts = [text_of(editor)]

    editor.get_by_role("button", name="Add a component").click()
    dialog = editor.get_by_role("dialog")
    dialog.get_by_label("Group").select_option("hydraulics")
    dialog.get_by_label("Type").select_option("orifice")
    dialog.get_by_text("Short restriction of constant area").wait_for()
    dialog.get_by_label("Name").fill("bleed")
    dialog.get_by_role("button", name="Add", exact=True).click()
    dialog.get_by_text("exactly one of diameter, area").wait_for()
    dialog.get_by_label("diameter", exact=True).fill("0.3 mm")
    dialog.get_by_role("button", name="Add", exact=True).click()
    require_line(editor, "    bleed: {type: orifice, diameter: 0.3 mm}\n")
    dialog.wait_for(state="detached")
    texts.append(text_of(editor))

    editor.wait_for_selector("text=the port bleed.a in no connection")
    editor.locator(".target.k-fault[data-name=bleed]").wait_for()
    editor.locator(".target[data-port='bleed.a']").click()
    editor.wait_for_selector("text=bleed.a: click the port")
    editor.locator(".target[data-port='chamber.fluid']").first.click()
    require_line(editor, "face.fluid, bleed.a]")
    texts.append(text_of(editor))
    editor.wait_for_selector("text=with chamber.fluid, bores.a, face.fluid")  # drawn before
    editor.locator(".target[data-port='bleed.b']").click()
    editor.wait_for_selector("text=bleed.b: click the port")
    editor.get_by_label("connect bleed.b to").select_option("ambient")
    require_line(editor, "[bleed.b, ambient]")
    editor.wait_for_selector("text=valid stroke, not saved")
    editor.wait_for_selector("text=with ambient")
    texts.append(text_of(editor))

    box = editor.locator("[id='n-network.components.bleed.diameter']")
    box.fill("0.4 mm")
    box.press("Enter")
    require_line(editor, "diameter: 0.4 mm}")
    texts.append(text_of(editor))
    editor.get_by_role("button", name="Rename bleed").click()
    dialog.get_by_label("Name").fill("leak")
    dialog.get_by_role("button", name="Rename", exact=True).click()
    require_line(editor, "[leak.b, ambient]")
    dialog.wait_for(state="detached")
    editor.wait_for_selector("text=leak: orifice")
    texts.append(text_of(editor))
    editor.get_by_role("button", name="Remove leak").click()
    require_text(editor, texts[0])
    editor.wait_for_selector("text=valid stroke, saved")

    for text in reversed(texts):
        editor.get_by_role("button", name="Undo").click()
        require_text(editor, text)
    for text in (*texts[1:], texts[0]):
        editor.get_by_role("button", name="Redo").click()
        require_text(editor, text)
    require_within(editor)


def test_the_keyboard_alone_edits_and_the_text_is_drawn(editor):
    """Typed letters of one word are one step; the schematic follows the text, both ways."""
    first = text_of(editor)
    area = editor.get_by_label("case file, YAML")
    area.focus()
    editor.keyboard.press("Control+End")
    editor.keyboard.type("oops")
    editor.wait_for_selector("text=not valid, not saved")
    editor.locator(".k-net .k-old").wait_for()
    editor.keyboard.press("Control+z")
    require_text(editor, first)
    editor.locator(".k-net .k-old").wait_for(state="detached")
    editor.keyboard.press("Control+Shift+z")
    require_text(editor, first + "oops")
    editor.keyboard.press("Control+z")
    require_text(editor, first)

    editor.wait_for_selector("text=valid stroke, saved")
    choose = editor.get_by_label("Component", exact=True)
    choose.focus()
    for _ in range(choose.locator("option").count()):  # letters typed slowly begin again
        if choose.input_value() != "spring":
            editor.keyboard.press("ArrowDown")
    assert choose.input_value() == "spring"
    editor.locator(".target.k-chosen[data-name=spring]").wait_for()
    box = editor.locator("[id='n-network.components.spring.preload']")
    box.focus()
    editor.keyboard.press("Control+a")
    editor.keyboard.type("5 kg")
    editor.keyboard.press("Enter")
    editor.wait_for_selector("#k-told:has-text('network.components.spring.preload: got')")
    editor.locator(".k-net .k-old").wait_for()
    editor.get_by_role("button", name="Undo").press("Enter")
    require_text(editor, first)
    editor.wait_for_selector("text=valid stroke, saved")

    put(editor, first.replace("spring:", "coil_spring:").replace("spring.end", "coil_spring.end"))
    editor.locator(".target[data-name=coil_spring]").wait_for(state="attached")


# ----------------------------------------------------------------------- at the same moment


def ask_for_a_bleed(page: Any) -> Any:
    """Ask for an orifice; the button that adds it."""
    page.get_by_role("button", name="Add a component").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_label("Group").select_option("hydraulics")
    dialog.get_by_label("Type").select_option("orifice")
    dialog.get_by_text("Short restriction of constant area").wait_for()  # its boxes are there
    dialog.get_by_label("Name").fill("bleed")
    dialog.get_by_label("diameter", exact=True).fill("0.3 mm")
    return dialog.get_by_role("button", name="Add", exact=True)


BLEED = "    bleed: {type: orifice, diameter: 0.3 mm}\n"


def with_bleed(text: str) -> str:
    """The text with the component behind the last one."""
    at = text.index("  connections:")
    return f"{text[:at].rstrip()}\n{BLEED}{text[len(text[:at].rstrip()) + 1 :]}"


def type_at_the_end(page: Any, words: str) -> None:
    page.evaluate(f"words => {{ {TEXT}.value += words; }}", words)


def test_text_typed_while_a_component_is_added_stays_and_so_does_the_component(editor, server):
    """In both orders: the text on its way before the change is made, and after it was made."""
    first = text_of(editor)
    changed = with_bleed(first)
    dialog = editor.get_by_role("dialog")
    add = ask_for_a_bleed(editor)
    with slow(server, "reader:Reader"):
        add.click()
        type_at_the_end(editor, "# mine\n")
    require_text(editor, changed + "# mine\n")
    dialog.wait_for(state="detached")
    editor.wait_for_selector("text=the port bleed.a in no connection")

    # typed as the changed text comes: the page still had the one before
    editor.evaluate(
        "() => { const put = window.klackText; window.klackText = (...all) => {"
        "window.klackText = put; const e = document.getElementById('k-yaml');"
        "e.value += '# also\\n'; put(...all); }; }"
    )
    editor.get_by_role("button", name="Remove bleed").click()
    require_text(editor, first + "# mine\n# also\n")
    editor.wait_for_selector("text=valid stroke, not saved")
    assert text_of(editor) == first + "# mine\n# also\n"


def test_a_value_is_written_before_what_is_clicked_next(editor, server):
    """Half typed, then another component, a step back, Ctrl+S: nothing is lost."""
    first = text_of(editor)
    box = editor.locator("[id='n-network.components.spring.preload']")
    choose = editor.get_by_label("Component", exact=True)
    choose.select_option("spring")
    was = box.input_value()
    changed = first.replace(f"preload: {was}", "preload: 61 N")
    assert changed != first

    box.fill("61 N")
    editor.locator(".target[data-name=chamber]").first.click()
    editor.wait_for_selector("text=chamber: chamber")
    require_text(editor, changed)

    with slow(server, "reader:Reader"):
        choose.select_option("spring")
        box.fill("62 N")
        editor.get_by_role("button", name="Undo").click()  # of what is half typed
    require_text(editor, changed)
    editor.wait_for_selector("text=valid stroke, not saved")
    editor.get_by_role("button", name="Undo").click()
    require_text(editor, first)
    editor.wait_for_selector("text=valid stroke, saved")


def test_control_s_saves_what_is_half_typed(editor, folder):
    before = (folder / CASE).read_text("utf-8")
    editor.get_by_label("Component", exact=True).select_option("spring")
    box = editor.locator("[id='n-network.components.spring.preload']")
    was = box.input_value()
    box.fill("61 N")
    editor.keyboard.press("Control+s")
    require_text(editor, before.replace(f"preload: {was}", "preload: 61 N"))
    editor.wait_for_selector("text=valid stroke, saved")
    saved = (folder / CASE).read_text("utf-8")
    (folder / CASE).write_text(before, "utf-8")

    assert saved == before.replace(f"preload: {was}", "preload: 61 N")


def test_a_value_typed_while_the_text_is_no_yaml_waits_until_it_is(editor):
    first = text_of(editor)
    editor.get_by_label("Component", exact=True).select_option("spring")
    box = editor.locator("[id='n-network.components.spring.preload']")
    was = box.input_value()
    type_at_the_end(editor, "oops")
    editor.wait_for_selector("text=not valid, not saved")
    box.fill("61 N")
    box.press("Enter")
    editor.wait_for_selector("text=The value is written as soon as the text can be read")
    assert box.input_value() == "61 N"
    put(editor, first)
    require_text(editor, first.replace(f"preload: {was}", "preload: 61 N"))
    editor.wait_for_selector("text=valid stroke, not saved")


def test_a_case_with_line_ends_of_windows_keeps_them(page, server, folder):
    """Truth: the bytes of the file with what was typed and changed."""
    first = (folder / CASE).read_bytes().decode().replace("\n", "\r\n")
    (folder / "windows.yaml").write_bytes(first.encode())
    page.set_default_timeout(60_000)
    page.goto(f"{server.base}/case?path=windows.yaml")
    page.wait_for_selector("text=valid stroke, saved")
    type_at_the_end(page, "# mine\n")
    page.wait_for_selector("text=valid stroke, not saved")
    page.get_by_label("Component", exact=True).select_option("spring")
    box = page.locator("[id='n-network.components.spring.preload']")
    was = box.input_value()
    box.fill("61 N")
    box.press("Enter")
    require_line(page, "preload: 61 N")
    page.get_by_role("button", name="Save", exact=True).click()
    page.wait_for_selector("text=valid stroke, saved")

    changed = first.replace(f"preload: {was}", "preload: 61 N") + "# mine\r\n"
    assert (folder / "windows.yaml").read_bytes().decode() == changed
