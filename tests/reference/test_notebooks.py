"""The notebooks show what they compute: every cell is run again, every printed number compared.

Truth: the outputs that the notebook carries, as a change detector of klack and of the notebook;
the physics behind the numbers has tests of its own.
"""

import re
from pathlib import Path
from typing import Any

import pytest
from quoted_output import compare

DOCS = Path(__file__).parents[2] / "docs"
NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))

LATE = re.compile(r", (?:opening|seat) (?:[4-9]|\d\d):|impacts \d+")

nbformat = pytest.importorskip("nbformat")
pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")


def printed(cell: Any) -> str:
    """Text of the outputs of a cell: what it prints, and what its last line is.

    Without late bounces: after some impacts the motion is chaotic, in the model as in the valve.
    """
    parts = []
    for output in cell.get("outputs", ()):
        if output.output_type == "stream" and output.name == "stdout":
            parts.append(output.text)
        elif output.output_type == "execute_result":
            parts.append(output.data["text/plain"] + "\n")
    return "".join(line for line in "".join(parts).splitlines(True) if not LATE.search(line))


def code_cells(notebook: Any) -> list[Any]:
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
class TestNotebook:
    @pytest.mark.slow
    def test_every_cell_shows_the_same_again(
        self, path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.syspath_prepend(str(DOCS))
        from run_notebooks import executed

        (tmp_path / "run").mkdir()
        again = executed(path, tmp_path / "run")
        kept = nbformat.read(path, as_version=4)
        for old, new in zip(code_cells(kept), code_cells(again), strict=True):
            place = f"{path.name}: {old.source[:60]}"
            compare(printed(old), printed(new), place)
            kinds = [sorted(o.get("data", ())) for o in old.outputs if o.output_type != "stream"]
            assert kinds == [
                sorted(o.get("data", ())) for o in new.outputs if o.output_type != "stream"
            ], place

    def test_it_is_kept_as_it_ran(self, path: Path) -> None:
        """In one go from the top, without an error, a warning or a name of a machine's folder."""
        notebook = nbformat.read(path, as_version=4)
        nbformat.validate(notebook)
        cells = code_cells(notebook)
        assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
        outputs = [output for cell in cells for output in cell.outputs]
        assert {output.output_type for output in outputs} <= {
            "stream", "execute_result", "display_data"
        }  # fmt: skip
        assert not [o for o in outputs if o.output_type == "stream" and o.name == "stderr"]
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"/(?:home|root|tmp|work|usr)/", text)
        assert len(text) < 800_000


def test_the_list_of_notebooks_is_not_empty() -> None:
    assert {path.stem for path in NOTEBOOKS} >= {
        "first-hour", "first-impact", "stroke-and-spectrum", "own-valve"
    }  # fmt: skip
