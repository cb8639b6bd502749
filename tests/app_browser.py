"""A server of ``klack app`` and pages of a browser before it; the folder is that of each test."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil
import pytest
from browser_pages import watched
from page_rules import WIDTHS
from served_app import Served

__all__ = ["LONG", "client", "page", "require_within", "server", "settle", "slow"]

LONG = 300_000  # [ms]: a loaded machine meshes, imports and compiles


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[Served]:
    with Served(folder) as found:
        yield found


@pytest.fixture(scope="module")
def client(server: Served) -> Iterator[Any]:
    """A client without a browser that has the cookie."""
    with pytest.importorskip("httpx").Client(base_url=server.base, timeout=60.0) as found:
        found.get(server.address)
        yield found


@pytest.fixture
def page(browser: Any, server: Served) -> Iterator[Any]:
    """A page with the cookie; at its end nothing was complained of or asked of other hosts."""
    context = browser.new_context(viewport={"width": 1000, "height": 900})
    found = context.new_page()
    found.set_default_timeout(LONG)
    said = watched(found, server.base)
    found.goto(server.address)
    found.wait_for_selector("#k-body")
    yield found
    context.close()
    assert said == []


@contextmanager
def slow(server: Served, kind: str) -> Iterator[None]:
    """A process that computes for the pages answers nothing meanwhile; ``"reader:Reader"``."""
    found = [
        child
        for child in psutil.Process(server.process.pid).children(recursive=True)
        if f"klack.app.{kind}" in child.cmdline()
    ]
    assert found
    for process in found:
        process.suspend()
    try:
        yield
    finally:
        for process in found:
            process.resume()


_SETTLED = """() => {
  const seen = window.klackSeen ??= { before: "", same: 0 };
  const now = [...document.querySelectorAll("body, section, canvas, .main-svg, .ks-tip")].map(e => {
    const box = e.getBoundingClientRect();
    return [box.x, box.y, box.width, box.height].map(Math.round).join();
  }).join(" ");
  seen.same = now === seen.before ? seen.same + 1 : 0;
  seen.before = now;
  if (seen.same < 6) return false;
  delete window.klackSeen;
  return true;
}"""


def settle(page: Any) -> None:
    """Wait until no part of the page has moved in six looks, 50 ms or more apart."""
    page.wait_for_function(_SETTLED, polling=50, timeout=LONG)


def require_within(page: Any) -> None:
    """No page is wider than its window, on a telephone or a large screen."""
    before = page.viewport_size
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        settle(page)
        page.wait_for_function(
            "document.documentElement.scrollWidth <= document.documentElement.clientWidth",
            timeout=LONG,
        )
    page.set_viewport_size(before)
