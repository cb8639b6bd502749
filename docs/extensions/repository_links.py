"""Pages whose links work in the repository and in the site.

The pages are read in both places, so their links are those of the repository.  What lies inside
``docs`` sphinx finds by itself.  Here the others are put right while a page is read: the README
and its like have a page of their own in the site (``SHOWN``), any other file comes along as a
download.
"""

import os.path
import re
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.util.typing import ExtensionMetadata

__all__ = ["ROOT", "SHOWN", "links_of_the_site", "setup"]

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"

# page of the site -> file of the repository that it shows
SHOWN = {
    "project/readme": "README.md",
    "project/cases": "cases/README.md",
    "project/benchmarks": "benchmarks/README.md",
    "project/changelog": "CHANGELOG.md",
    "project/contributing": "CONTRIBUTING.md",
}
_PAGE_OF = {file: f"docs/{page}.md" for page, file in SHOWN.items()}
_LINK = re.compile(r"(?P<open>\]\()(?P<target>[^)\s#:]+)(?P<anchor>#[^)\s]*)?\)")
_CODE = re.compile(r"(^ *```.*?^ *```|^ {4}.*?$)", re.DOTALL | re.MULTILINE)


def links_of_the_site(text: str, source: str, page: str) -> str:
    """Rewrite the links of a page.

    Parameters
    ----------
    text : str
        Markdown as it stands in the repository.
    source : str
        File that it comes from, from the root of the repository; its links start there.
    page : str
        Page that shows it, as a path from the root of the repository.

    Examples
    --------
    >>> links_of_the_site("[a](../README.md)", "docs/index.md", "docs/index.md")
    '[a](project/readme.md)'
    """

    def rewritten(link: re.Match[str]) -> str:
        target, anchor = link["target"], link["anchor"] or ""
        file = os.path.normpath(os.path.join(os.path.dirname(source), target))
        return f"{link['open']}{_target(file, page)}{anchor})"

    parts = _CODE.split(text)
    # every second part is code, which has no links
    return "".join(
        part if index % 2 else _LINK.sub(rewritten, part) for index, part in enumerate(parts)
    )


def _target(file: str, page: str) -> str:
    """Where a link to a file of the repository leads, as seen from a page."""
    here = os.path.dirname(page)
    if file in _PAGE_OF:
        return os.path.relpath(_PAGE_OF[file], here)
    inside = file.startswith("docs/") and file.endswith((".md", ".ipynb", ".svg", ".png"))
    if inside or not (ROOT / file).is_file():
        return os.path.relpath(file, here)  # an unknown file: sphinx says so
    return f"<path:{os.path.relpath(file, here)}>"


def setup(app: Sphinx) -> ExtensionMetadata:
    """Rewrite each page when it is read."""
    app.connect("source-read", _read)
    return {"parallel_read_safe": True}


def _read(app: Sphinx, page: str, content: list[str]) -> None:
    source = f"docs/{page}.md"
    text = content[0]
    if page in SHOWN:
        source = SHOWN[page]
        app.env.note_dependency(str(ROOT / source))
        text = (ROOT / source).read_text(encoding="utf-8")
    content[0] = links_of_the_site(text, source, f"docs/{page}.md")
