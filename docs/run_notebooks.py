"""Run the notebooks and keep what they show: ``python docs/run_notebooks.py [NAME ...]``.

A notebook runs in a folder of its own, with the files beside it, so nothing is left behind but its
outputs.
"""

import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import nbformat
from nbclient import NotebookClient

NOTEBOOKS = Path(__file__).parent / "notebooks"


def executed(path: Path, folder: Path) -> Any:
    """Run all cells of a notebook in a folder, and return it with its outputs.

    Raises
    ------
    nbclient.exceptions.CellExecutionError
        For the first cell that fails.
    """
    shutil.copytree(path.parent / "files", folder / "files", dirs_exist_ok=True)
    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(folder)}})
    client.execute()
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)  # times of this machine
    notebook.metadata = {"kernelspec": notebook.metadata["kernelspec"]}
    return notebook


def main(names: list[str]) -> None:
    """Run those of these names, or all."""
    for path in sorted(NOTEBOOKS.glob("*.ipynb")):
        if not names or path.stem in names:
            with TemporaryDirectory() as folder:
                done = executed(path, Path(folder))
            nbformat.validate(done)
            nbformat.write(done, path)
            print(path.name)


if __name__ == "__main__":
    main(sys.argv[1:])
