"""The catalogue of mesh formats: every folder is in it, and shared endings are told apart."""

import inspect
from pathlib import Path

import pytest

import klack.mesh.files
from klack.mesh.files.catalogue import FORMATS, MESH_FORMATS, MeshFormat, MeshReader, format_of

FOLDER = Path(klack.mesh.files.__file__).parent


def test_every_folder_is_one_line() -> None:
    folders = sorted(reader.parent.name for reader in FOLDER.glob("*/reader.py"))
    assert sorted(one.path.split(".")[0] for one in FORMATS) == folders


@pytest.mark.parametrize("one", FORMATS, ids=lambda one: one.path.split(".")[0])
def test_reader_is_found_and_takes_what_all_take(one: MeshFormat) -> None:
    taken = inspect.signature(one.reader).parameters
    asked = list(inspect.signature(MeshReader.__call__).parameters)[1:]
    assert list(taken) == asked
    assert all(taken[name].kind is inspect.Parameter.KEYWORD_ONLY for name in asked[2:])


def test_endings_are_in_small_letters_and_name_their_programs() -> None:
    assert all(ending == ending.lower() and ending[0] == "." for ending in MESH_FORMATS)
    assert MESH_FORMATS[".dat"] == "ANSYS archive or Nastran bulk data"


@pytest.mark.parametrize(
    ("text", "program"),
    [
        ("/COM\n  nblock , 3\n", "ANSYS archive"),
        ("$ NBLOCK,3 in a comment\nGRID,1\n", "Nastran bulk data"),
        (None, "Nastran bulk data"),
    ],
    ids=["its mark", "elsewhere", "no file"],
)
def test_content_decides_where_an_ending_is_shared(
    text: str | None, program: str, tmp_path: Path
) -> None:
    """Only a mark at the start of a line counts."""
    path = tmp_path / "a.DAT"
    if text is not None:
        path.write_text(text)
    assert format_of(path).program == program
