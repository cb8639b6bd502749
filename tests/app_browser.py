"""A server of ``klack app`` and a browser before it; the folder is that of each test."""

import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright import sync_api

__all__ = ["CHROMIUM", "LONG", "Server", "browser", "page", "require_within", "server"]

CHROMIUM = shutil.which("chromium")
LONG = 60_000  # [ms]: a loaded machine meshes, imports and compiles
WIDTHS = (400, 1000, 1600)


class Server:
    """``klack app`` on a folder."""

    def __init__(self, folder: Path) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "klack", "app", str(folder), "--no-open"],
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self.process.stdout is not None
        self.process.stdout.readline()
        self.address = self.process.stdout.readline().strip()

    @property
    def base(self) -> str:
        return self.address.partition("/?")[0]


@pytest.fixture(scope="module")
def server(folder: Path) -> Iterator[Server]:
    found = Server(folder)
    yield found
    found.process.send_signal(signal.SIGINT)
    found.process.wait(20)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with sync_api.sync_playwright() as started:
        found = started.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield found
        found.close()


@pytest.fixture
def page(browser: Any, server: Server) -> Iterator[Any]:
    """A page with the cookie; at its end nothing was complained of or asked of other hosts."""
    context = browser.new_context(viewport={"width": 1000, "height": 900})
    found = context.new_page()
    found.set_default_timeout(LONG)
    complaints: list[str] = []
    found.on(
        "console",
        lambda said: complaints.append(said.text) if said.type in ("error", "warning") else None,
    )
    found.on("pageerror", lambda error: complaints.append(str(error)))
    found.on("dialog", lambda dialog: complaints.append(f"dialog: {dialog.message}"))
    found.on(
        "request",
        lambda request: (
            complaints.append(f"asked {request.url}")
            if not request.url.startswith((server.base, "data:", "blob:", "ws://127.0.0.1"))
            else None
        ),
    )
    found.goto(server.address)
    found.wait_for_selector("#k-body")
    yield found
    context.close()
    assert complaints == []


def require_within(page: Any) -> None:
    """No page is wider than its window, on a telephone or a large screen."""
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        page.wait_for_timeout(300)
        over = page.evaluate(
            "document.documentElement.scrollWidth - document.documentElement.clientWidth"
        )
        assert over <= 0, f"{over} px wider than {width} px"
