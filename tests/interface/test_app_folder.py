"""Files of the browser application: only below the folder, whole, bounded."""

import asyncio
import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from klack.analyses import store
from klack.app import folder as app_folder
from klack.app.folder import LARGEST_CASE, OpenFolder, result_names
from klack.app.state import Notes, Sounds, State
from klack.case import case_text
from klack.errors import InputError

TEXT = "klack: 1\ntitle: <script>alert(1)</script>\n"


@pytest.fixture
def folder(tmp_path: Path) -> OpenFolder:
    """A folder with a case, beside a secret."""
    (tmp_path / "secret.yaml").write_text("klack: secret\n")
    place = tmp_path / "cases"
    (place / "valve").mkdir(parents=True)
    (place / "valve" / "case.yaml").write_text(TEXT)
    return OpenFolder(place)


@pytest.mark.parametrize(
    "path",
    [
        "../secret.yaml",
        "valve/../../secret.yaml",
        "/etc/passwd",
        "valve//case.yaml",
        "./valve/case.yaml",
        "valve\\..\\secret.yaml",
        "valve/case.yaml\0",
        "",
        "..",
        "valve/",
    ],
)
def test_no_path_leads_out(folder, path):
    for use in (folder.read, folder.case_text, folder.absolute):
        with pytest.raises(InputError):
            use(path)
    with pytest.raises(InputError):
        folder.write(path, TEXT)
    assert not folder.exists(path)
    assert (folder.path.parent / "secret.yaml").read_text() == "klack: secret\n"


@pytest.mark.skipif(not hasattr(os, "symlink"), reason="no links here")
def test_no_link_is_followed(folder):
    (folder.path / "link.yaml").symlink_to(folder.path.parent / "secret.yaml")
    (folder.path / "up").symlink_to(folder.path.parent)

    for path in ("link.yaml", "up/secret.yaml"):
        with pytest.raises(InputError):
            folder.read(path)
        with pytest.raises(InputError):
            folder.write(path, TEXT)
        with pytest.raises(InputError):
            folder.make_file(path, TEXT)
    found = folder.look()
    assert found.cases == ("valve/case.yaml",)
    assert found.odd == ("link.yaml (a symbolic link)", "up (a symbolic link)")
    assert (folder.path.parent / "secret.yaml").read_text() == "klack: secret\n"


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_case_of_any_editor_is_listed(folder, encoding):
    (folder.path / "a.yaml").write_bytes(TEXT.encode(encoding))
    assert folder.look().cases == ("a.yaml", "valve/case.yaml")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_a_pipe_does_not_block(folder):
    os.mkfifo(folder.path / "pipe.yaml")

    with pytest.raises(InputError, match="no plain file"):
        folder.read("pipe.yaml")


def test_files_are_bounded(folder):
    (folder.path / "large.yaml").write_bytes(b"#" * (LARGEST_CASE + 1))

    assert LARGEST_CASE == case_text.LARGEST_CASE
    with pytest.raises(InputError, match="bytes, expected no more than 1000000"):
        folder.case_text("large.yaml")
    with pytest.raises(InputError, match="bytes, expected no more than 1000000"):
        folder.write("new.yaml", "#" * (LARGEST_CASE + 1))
    assert not (folder.path / "new.yaml").exists()


def test_only_yaml_is_a_case_and_only_text(folder):
    (folder.path / "notes.txt").write_text("x")
    (folder.path / "bytes.yaml").write_bytes(b"\xff\xfe")

    with pytest.raises(InputError, match=r"no \.yaml"):
        folder.case_text("notes.txt")
    with pytest.raises(InputError, match="no text"):
        folder.case_text("bytes.yaml")


def test_a_file_is_replaced_as_a_whole_and_keeps_its_rights(folder):
    file = folder.path / "valve" / "case.yaml"
    file.chmod(0o640)
    before = file.stat().st_ino

    folder.write("valve/case.yaml", "klack: 1\n")

    assert file.read_text() == "klack: 1\n"
    assert file.stat().st_mode & 0o777 == 0o640
    assert file.stat().st_ino != before  # another file took the name: never half of one
    assert [item.name for item in file.parent.iterdir()] == ["case.yaml"]


def test_new_files_replace_nothing(folder):
    folder.make_file("other/case.yaml", TEXT)

    with pytest.raises(InputError, match="there already"):
        folder.make_file("valve/case.yaml", "klack: 1\n")
    assert folder.case_text("valve/case.yaml") == TEXT
    assert folder.look().cases == ("other/case.yaml", "valve/case.yaml")


def test_results_are_found_by_their_store(folder):
    assert app_folder.RESULT_NAME == store.RESULT_NAME
    (folder.path / "klack-results" / "a" / store.RESULT_NAME).mkdir(parents=True)

    found = folder.look()

    assert found.results == ("klack-results/a",)
    assert found.is_whole


def test_a_folder_has_to_be_one(tmp_path):
    with pytest.raises(InputError, match="no folder"):
        OpenFolder(tmp_path / "none")


def test_notes_and_drafts_outlive_the_server(folder):
    Notes(folder).set_note("valve/case.yaml", "hold it <b>tight</b>")
    Notes(folder).set_draft("valve/case.yaml", "klack: 1\ntitle: half")
    Notes(folder).set_draft("other.yaml", "x")

    again = Notes(folder)

    assert again.note("valve/case.yaml") == "hold it <b>tight</b>"
    assert again.draft("valve/case.yaml") == "klack: 1\ntitle: half"
    again.set_draft("valve/case.yaml", None)
    assert again.draft("valve/case.yaml") is None
    assert again.draft("other.yaml") == "x"
    with pytest.raises(InputError, match="at most"):
        again.set_note("valve/case.yaml", "x" * 20_001)


def test_other_commands_load_no_browser_application():
    code = (
        "import sys, klack, klack.cli.commands; "
        "sys.exit(any(n.startswith(('nicegui', 'fastapi', 'klack.app')) for n in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_sounds_are_bounded_and_have_names_that_cannot_be_guessed():
    sounds = Sounds(most=2)
    first, *others = [sounds.add(bytes([k])) for k in range(3)]

    def name(address: str) -> str:
        return address.removeprefix("/sound/").removesuffix(".wav")

    assert sounds.get(name(first)) is None
    assert [sounds.get(name(address)) for address in others] == [b"\1", b"\2"]
    assert len(name(first)) >= 20


def test_a_text_of_another_page_is_not_overwritten(folder):
    notes, other = Notes(folder), Notes(folder)

    assert notes.exchange_draft("a.yaml", None, "one")
    assert not other.exchange_draft("a.yaml", None, "two")  # it has seen no draft
    assert not other.exchange_draft("a.yaml", None, None)  # what it saved is not what waits
    assert notes.draft("a.yaml") == "one"
    assert notes.exchange_draft("a.yaml", "one", "one more")
    assert other.exchange_draft("a.yaml", "one more", None)
    assert notes.draft("a.yaml") is None


def test_no_two_cases_write_their_results_to_one_place():
    cases = ["x.yaml", "a/x.yaml", "a-x.yaml", "valve.yaml", "valve/case.yaml", "case.yaml"]

    names = result_names(cases)

    assert len(set(names.values())) == len(cases)
    assert names["case.yaml"] == "case"
    assert result_names(["valve/case.yaml"]) == {"valve/case.yaml": "valve"}


def test_a_page_that_was_left_makes_room_for_another(folder):
    state = State(folder)
    open_pages = [state.explorer() for _ in range(3)]

    with pytest.raises(InputError, match="3 open slider pages"):
        state.explorer()
    state.mark_left(open_pages[0], is_left=True)
    state.mark_left(open_pages[1], is_left=True)
    state.mark_left(open_pages[0], is_left=False)  # it has come back
    assert state.explorer() not in open_pages
    with pytest.raises(InputError, match="reload the page"):
        asyncio.run(open_pages[1].call("move", {}))
    with pytest.raises(InputError, match="3 open slider pages"):
        state.explorer()
    state.close()


def test_a_folder_that_was_renamed_is_named_and_not_made_again(folder):
    notes = Notes(folder)
    folder.path.rename(folder.path.with_name("moved"))

    for act in (
        lambda: notes.set_draft("case.yaml", "typed"),
        lambda: folder.case_text("case.yaml"),
        lambda: folder.write("case.yaml", "typed"),
    ):
        with pytest.raises(InputError, match="former name"):
            act()
    assert not folder.path.exists()


def test_a_full_disk_is_named_as_such(folder, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(app_folder, "synchronise", full)

    with pytest.raises(InputError, match="No space left on device, expected room") as refused:
        folder.write("case.yaml", "typed")
    assert "reload" not in str(refused.value)  # the text is in the page alone
