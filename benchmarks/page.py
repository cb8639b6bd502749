"""Page of the viewer: its size, and how fast a browser that draws by software moves its bodies.

``uv run --group dev python benchmarks/page.py RESULT`` takes the folder of a result of ``klack
impact`` with mode shapes, writes its page, and opens it in Chromium without a display, 1000 x 700
pixels.  Pictures per second depend on what else runs; processor time per picture, of all processes
of the browser, less so.
"""

import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time, sleep, time
from typing import Any

import psutil

from klack.viewer.source import view_of_source
from klack.viewer.view import page_of

_SECONDS = 4.0
_SOFTWARE = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
_MOVES = {
    "first mode": "klackScene.showMode(0)",
    "first mode, mesh lines": "[...document.querySelectorAll('.ks-panel label')]"
    ".find(l => l.textContent === 'Mesh lines').querySelector('input').click()",
    "impact": "[...document.querySelectorAll('.ks-panel button')]"
    ".find(b => b.textContent === 'Impact').click()",
}


def main(result: Path) -> None:
    """Print size of the page, and pictures per second of three motions."""
    begin = process_time()
    page = page_of(view_of_source(result))
    made = process_time() - begin
    print(f"page {len(page) / 1e6:.2f} MB, made in {made:.1f} s of processor time")
    from playwright.sync_api import sync_playwright

    with TemporaryDirectory() as folder, sync_playwright() as library:
        file = Path(folder) / "page.html"
        file.write_text(page, encoding="utf-8")
        browser = library.chromium.launch(
            executable_path=shutil.which("chromium"), args=[*_SOFTWARE, "--no-sandbox"]
        )
        opened = browser.new_page(viewport={"width": 1000, "height": 700})
        opened.goto(file.as_uri())
        for name, start in _MOVES.items():
            opened.evaluate(start)
            sleep(0.5)
            pictures, seconds, processor = _measured(opened)
            print(
                f"{name}: {pictures / seconds:.1f} pictures a second, "
                f"{1e3 * processor / pictures:.1f} ms of processor time each"
            )
        browser.close()


def _measured(page: Any) -> tuple[int, float, float]:
    """Pictures, wall time and processor time of some seconds."""
    first, spent, begin = page.evaluate("klackScene.state().frames"), _processor(), time()
    page.wait_for_timeout(1e3 * _SECONDS)
    last = page.evaluate("klackScene.state().frames")
    return last - first, time() - begin, _processor() - spent


def _processor() -> float:
    """Of all processes of the browser [s]."""
    total = 0.0
    for process in psutil.Process().children(recursive=True):
        try:
            used = process.cpu_times()
        except psutil.Error:  # gone meanwhile
            continue
        total += used.user + used.system
    return total


if __name__ == "__main__":
    main(Path(sys.argv[1]))
