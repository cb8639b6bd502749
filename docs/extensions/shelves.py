"""The shelves of the site: the table of the start page, as the tree beside every page.

Each row of the table in ``index.md`` is a shelf, with the pages that it links to, in their order.
A page that no row names goes to the shelf of its folder, so a new page is in the tree at once.
"""

import os.path
import re
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.util.typing import ExtensionMetadata

__all__ = ["setup", "shelves"]

# folder of pages -> shelf of those that no row names
_SHELF_OF_FOLDER = {
    "tutorials": "tutorials",
    "notebooks": "notebooks",
    "how-to": "how-to: run",
    "theory": "theory",
    "reference": "reference",
    "project": "reference",
}
_ORDER = ("start", "tutorials", "notebooks")  # first, whether or not the table has them
_ROW = re.compile(r"^\| *(?P<shelf>[^|]+?) *\| *(?P<pages>.*?) *\|$", re.MULTILINE)
_PAGE = re.compile(r"\[(?P<name>[^\]]+)\]\((?P<page>[^)#:]+)\.(?:md|ipynb)\)")


def shelves(index: str, pages: list[str]) -> dict[str, dict[str, str]]:
    """Pages of each shelf with their names, in the order in which they are shown.

    Parameters
    ----------
    index : str
        The start page, whose links lead to pages of the site.
    pages : list of str
        All pages of the site, without ending.

    Returns
    -------
    dict of shelf to dict of page to name
        The name is that of the link; empty (the title of the page) where no row names it.
    """
    tree: dict[str, dict[str, str]] = {}
    placed = {"index"}
    for row in _ROW.finditer(index):
        for link in _PAGE.finditer(row["pages"]):
            page = os.path.normpath(link["page"])
            if page in pages and page not in placed:
                tree.setdefault(row["shelf"], {})[page] = link["name"].replace("`", "")
                placed.add(page)
    for page in sorted(set(pages) - placed):
        shelf = _SHELF_OF_FOLDER.get(page.split("/")[0], "reference")
        if Path(page).parts[:2] != ("reference", "api"):  # in the tree below reference/api
            tree.setdefault(shelf, {})[page] = ""
    order = [shelf for shelf in _ORDER if shelf in tree]
    return {shelf: tree[shelf] for shelf in dict.fromkeys([*order, *tree])}


def setup(app: Sphinx) -> ExtensionMetadata:
    """Put the tree below the text of the start page; after the links are those of the site."""
    app.connect("source-read", _read, priority=600)
    return {"parallel_read_safe": True}


def _read(app: Sphinx, page: str, content: list[str]) -> None:
    if page == "reference/api":
        content[0] += "\n```{toctree}\n:hidden:\n:glob:\n\napi/*\napi/*/*\n```\n"
    if page != "index":
        return
    blocks = []
    for shelf, pages in shelves(content[0], sorted(app.env.found_docs)).items():
        lines = "\n".join(f"{name} <{page}>" if name else page for page, name in pages.items())
        blocks.append(f"```{{toctree}}\n:hidden:\n:caption: {shelf.capitalize()}\n\n{lines}\n```\n")
    content[0] += "\n" + "\n".join(blocks)
