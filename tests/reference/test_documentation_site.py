"""The documentation as a site: it builds without a warning, needs no network, and has no dead end.

Truth: the pages themselves; what they link to has to be there.
"""

import importlib.util
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import quote, unquote, urldefrag

import pytest

pytest.importorskip("sphinx")
from browser_pages import chromium, launched

pytest.importorskip("myst_parser")
pytest.importorskip("furo")

DOCS = Path(__file__).parents[2] / "docs"
# attributes that make a browser fetch something, and the links that mean another page only
FETCHED = {
    "script": "src", "img": "src", "iframe": "src", "source": "src", "audio": "src",
    "video": "src", "link": "href", "embed": "src", "object": "data", "use": "href",
}  # fmt: skip
STATIC_LINKS = {"canonical", "next", "prev", "index", "search", "author", "copyright", "help"}


class Page(HTMLParser):
    """What a page fetches, where it leads, and which anchors it has."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.links: list[str] = []
        self.anchors: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        if given.get("id"):
            self.anchors.add(given["id"])
        if tag == "a" and given.get("href"):
            self.links.append(given["href"])
        where = given.get(FETCHED.get(tag, "")) if tag in FETCHED else None
        if where and not (tag == "link" and given.get("rel") in STATIC_LINKS):
            self.fetched.append(where)


def is_external(address: str) -> bool:
    return bool(re.match(r"(?:[a-z][a-z0-9+.-]*:)?//", address, re.IGNORECASE))


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", str(DOCS), str(folder)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def pages(site) -> dict[Path, Page]:
    return {file.resolve(): Page(file.read_text(encoding="utf-8")) for file in site.rglob("*.html")}


@pytest.mark.slow
def test_nothing_is_fetched_from_a_network(site, pages):
    assert len(pages) > 60
    for file, page in pages.items():
        assert [where for where in page.fetched if is_external(where)] == [], file.name
    for style in site.rglob("*.css"):
        text = style.read_text(encoding="utf-8")
        assert not re.search(r"(?:@import|url\()\s*['\"]?(?:https?:)?//", text), style.name


@pytest.mark.slow
def test_every_equation_is_a_picture_of_itself(site):
    """No LaTeX is left for a script to convert."""
    page = (site / "theory" / "contact.html").read_text(encoding="utf-8")
    assert page.count("<math ") > 15
    assert not re.search(r"<script[^>]*mathjax", page, re.IGNORECASE)
    assert "\\frac" not in re.sub(r"<pre.*?</pre>", "", page, flags=re.DOTALL)


@pytest.mark.slow
def test_every_link_inside_the_site_leads_somewhere(pages):
    broken = []
    for file, page in pages.items():
        for link in [*page.links, *page.fetched]:
            if is_external(link) or link.startswith(("mailto:", "data:", "javascript:")):
                continue
            address, anchor = urldefrag(unquote(link))
            target = (file.parent / address.split("?")[0]).resolve() if address else file
            if not target.is_file():
                broken.append((file.name, link))
            elif anchor and target in pages and anchor not in pages[target].anchors:
                broken.append((file.name, link))
    assert broken == []


@pytest.mark.slow
@pytest.mark.parametrize("words", ["yield", "FMU", "cancel run"])
def test_a_search_finds_pages_before_names_of_the_interface(site, words):
    """The kinds of results are those of Sphinx, which marks each with its own."""
    driver = pytest.importorskip("playwright.sync_api").sync_playwright
    if chromium() is None:
        pytest.skip("no chromium here")
    with driver() as library:
        browser = launched(library)
        page = browser.new_page()
        page.goto(f"{(site / 'search.html').as_uri()}?q={quote(words)}")
        page.wait_for_function(
            "document.querySelector('#search-results p')?.innerText.match(/[0-9]/)"
        )
        page.wait_for_selector("#search-results li")
        page.wait_for_timeout(1000)
        kinds = page.evaluate(
            "[...document.querySelectorAll('#search-results li')].map(item => item.className)"
        )
        browser.close()
    objects = ["object" in kind for kind in kinds]

    assert not objects[0]
    assert objects == sorted(objects)


@pytest.mark.slow
def test_every_page_is_reached_from_the_start_page(site, pages):
    reached: set[Path] = set()
    waiting = [(site / "index.html").resolve()]
    while waiting:
        file = waiting.pop()
        if file in reached or file not in pages:
            continue
        reached.add(file)
        waiting += [
            (file.parent / urldefrag(unquote(link))[0]).resolve()
            for link in pages[file].links
            if not is_external(link) and urldefrag(link)[0]
        ]
    sources = {
        (site / file.relative_to(DOCS)).with_suffix(".html").resolve()
        for file in DOCS.rglob("*.md")
        if "_build" not in file.parts
    }
    assert sources <= pages.keys()
    assert sources - reached == set()


@pytest.mark.parametrize(
    ("tex", "shape"),
    [
        (r"\ddot q_i", "<msub><mover><mi>q</mi><mo>¨</mo></mover><mi>i</mi></msub>"),
        (r"\tfrac12", "<mfrac><mn>1</mn><mn>2</mn></mfrac>"),
        (r"\sum_i^n", "<munderover><mo>∑</mo><mi>i</mi><mi>n</mi></munderover>"),
        ("20\\,°C", "<msup><mrow></mrow><mo>∘</mo></msup><mi>C</mi>"),
    ],
    ids=["index beside an accent", "fraction without braces", "limits of a sum", "degrees"],
)
def test_equations_that_the_converter_alone_gets_wrong(tex, shape):
    """Truth: what LaTeX sets for them."""
    spec = importlib.util.spec_from_file_location("mathml", DOCS / "extensions" / "mathml.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    bare = re.sub(r"\s*\n\s*|(?<=<)(\w+)(?: [^>]*)(?=>)", r"\1", module.mathml(tex, block=False))

    assert shape in bare


def test_links_of_the_pages_work_in_the_repository_too():
    """As plain Markdown, relative links lead to files, without the site."""
    root = DOCS.parent
    files = [
        *DOCS.rglob("*.md"),
        *(root / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")),
    ]
    files += [root / "cases" / "README.md", root / "benchmarks" / "README.md"]
    broken = []
    for file in files:
        text = re.sub(r"```.*?```|`[^`\n]*`", "", file.read_text(encoding="utf-8"), flags=re.DOTALL)
        for target in re.findall(r"\]\(([^)\s#]+)[^)]*\)", text):
            if not is_external(target) and not (file.parent / target).exists():
                broken.append((file.name, target))
    assert broken == []


def test_a_page_that_people_write_has_one_purpose():
    """Measured by its length, 5000 words; generated pages are looked up, not read."""
    long = {
        file.relative_to(DOCS).as_posix(): len(text.split())
        for file in DOCS.rglob("*.md")
        if "_build" not in file.parts
        and not re.search(
            r"<!-- written by docs/|^Made by `docs/", text := file.read_text("utf-8"), re.MULTILINE
        )
        and len(text.split()) > 5000
    }
    assert long == {}
