"""Slider moves and page changes of ``klack app`` for hours: time of a move, and memory.

``uv run --group dev --extra app python benchmarks/app_soak.py CASE --hours 8`` copies a case (a
file or the name of a shipped one) into a folder of its own, serves it, and moves the speed slider,
or the first one there is, in Chromium without a display; every 500 moves it changes pages ten
times.  ``--moves`` and ``--pages`` bound both instead of the hours.  It prints the time from a move
to the new force, spectrum and sound in the page, the processor time per move of computation, server
and browser, and the memory of all three: of the page after its garbage has been collected.
"""

import argparse
import shutil
import signal
import statistics
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import psutil

from klack.case.reader import find_case

_MOVES_AT_ONCE = 500
_PAGES_AT_ONCE = 10
_PATIENCE = 300_000  # [ms]
_MOVED = """([bar, share]) => {
  const took = document.getElementById('k-took');
  bar.value = +bar.min + share * (+bar.max - +bar.min);
  const begin = performance.now();
  return new Promise((done, fail) => {
    setTimeout(() => fail(new Error('no answer to a move')), 300000);
    new MutationObserver((_, seen) => {
      seen.disconnect();
      requestAnimationFrame(() => setTimeout(() => done(performance.now() - begin)));
    }).observe(took, {childList: true, characterData: true, subtree: true, attributes: true});
    bar.dispatchEvent(new Event('input'));
  });
}"""
"""A move, and the wait for the picture after the number of its answer."""


@dataclass(frozen=True)
class Memory:
    """Of all processes [MB], and what the page holds after a collection.

    Parameters
    ----------
    server, worker, browser : float [MB]
        Resident.
    heap : float [MB]
        Of scripts of the page.
    nodes, documents, listeners : int
    """

    server: float
    worker: float
    browser: float
    heap: float
    nodes: int
    documents: int
    listeners: int

    def __str__(self) -> str:
        return (
            f"server {self.server:.0f} MB, computation {self.worker:.0f} MB, browser "
            f"{self.browser:.0f} MB; page: heap {self.heap:.1f} MB, {self.nodes} nodes, "
            f"{self.documents} documents, {self.listeners} listeners"
        )


class Soak:
    """A served folder, and a page of it.

    Parameters
    ----------
    server : psutil.Process
    address : str
    page : playwright page
    case : str
        Path in the folder.
    """

    def __init__(self, server: psutil.Process, address: str, page: Any, case: str) -> None:
        self.server, self.page, self.case = server, page, case
        self.base = address.partition("/?")[0]
        self._devtools = page.context.new_cdp_session(page)
        self._devtools.send("Performance.enable")
        page.set_default_timeout(_PATIENCE)
        page.goto(address)
        page.wait_for_selector("#k-body")

    def open_sliders(self) -> None:
        """Open the slider page and wait for its estimate."""
        self.page.goto(f"{self.base}/sliders?path={self.case}")
        self.page.wait_for_selector(".k-slider input")
        self.page.wait_for_selector(".k-figure >> nth=3")

    def move(self, share: float) -> float:
        """Move the speed slider, or the first one; return the time until it is drawn [ms]."""
        bar = self.page.query_selector("input[id='s-motion.speed']")
        bar = bar or self.page.query_selector(".k-slider input")
        return float(self.page.evaluate(_MOVED, [bar, share]))

    def change_pages(self, count: int) -> None:
        """Go from page to page; every third is the overview."""
        pages = (f"/sliders?path={self.case}", f"/case?path={self.case}", "/")
        for number in range(count):
            self.page.goto(self.base + pages[number % len(pages)])
            ready = (".k-slider input", "#k-yaml", ".k-row")[number % len(pages)]
            self.page.wait_for_selector(ready)

    def memory(self) -> Memory:
        """Memory now."""
        for _ in range(2):  # finalisers of the first free more
            self._devtools.send("HeapProfiler.collectGarbage")
        told = {
            item["name"]: item["value"]
            for item in self._devtools.send("Performance.getMetrics")["metrics"]
        }
        return Memory(
            server=_resident([self.server]),
            worker=_resident(self.workers()),
            browser=_resident(_browser()),
            heap=told["JSHeapUsedSize"] / 1e6,
            nodes=int(told["Nodes"]),
            documents=int(told["Documents"]),
            listeners=int(told["JSEventListeners"]),
        )

    def workers(self) -> list[psutil.Process]:
        """Processes of slider pages."""
        found = self.server.children(recursive=True)
        return [one for one in found if "klack.app.explorer:Explorer" in _words(one)]

    def processor(self) -> tuple[float, float, float]:
        """Processor time so far [s]: computation, server, browser."""
        return _spent(self.workers()), _spent([self.server]), _spent(_browser())


@contextmanager
def soaking(case: str) -> Iterator[Soak]:
    """Serve a copy of a case and open its page."""
    from playwright.sync_api import sync_playwright

    with TemporaryDirectory() as place, sync_playwright() as library:
        file = Path(place) / "case.yaml"
        source = Path(case) if Path(case).is_file() else find_case(case)
        shutil.copy(source, file)
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "klack", "app", place, "--no-open"],
            stdout=subprocess.PIPE,
            text=True,
        )
        assert process.stdout is not None
        process.stdout.readline()
        address = process.stdout.readline().strip()
        browser = library.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        page = browser.new_context(viewport={"width": 1400, "height": 900}).new_page()
        try:
            yield Soak(psutil.Process(process.pid), address, page, "case.yaml")
        finally:
            browser.close()
            process.send_signal(signal.SIGINT)
            process.wait(30)


def soak(found: Soak, *, moves: int, pages: int, until: float) -> None:
    """Move and change pages until both are done, or the time has come."""
    found.open_sliders()
    for share in (0.1, 0.5, 0.9):
        found.move(share)
    print(f"at first: {found.memory()}")
    times: list[float] = []
    changed = 0
    while perf_counter() < until and (len(times) < moves or changed < pages):
        before, count = found.processor(), min(_MOVES_AT_ONCE, moves - len(times))
        now = [found.move((0.618 * (len(times) + k)) % 1.0) for k in range(count)]
        if now:
            times += now
            spent = [
                1e3 * (b - a) / len(now) for a, b in zip(before, found.processor(), strict=True)
            ]
            print(
                f"{len(times)} moves: median {statistics.median(now):.0f} ms, 95 % within "
                f"{statistics.quantiles(now, n=20)[-1]:.0f} ms; processor time per move: "
                f"computation {spent[0]:.0f} ms, server {spent[1]:.0f} ms, "
                f"browser {spent[2]:.0f} ms"
            )
            print(f"  {found.memory()}")
        if changed < pages:
            found.change_pages(min(_PAGES_AT_ONCE, pages - changed))
            changed += _PAGES_AT_ONCE
            found.open_sliders()
            print(f"{changed} page changes: {found.memory()}", flush=True)


def _browser() -> list[psutil.Process]:
    """Processes of the browser that this one started."""
    found = psutil.Process().children(recursive=True)
    return [one for one in found if "chrom" in _words(one)]


def _words(process: psutil.Process) -> str:
    try:
        return " ".join(process.cmdline())
    except psutil.Error:
        return ""


def _resident(processes: list[psutil.Process]) -> float:
    return sum(_read(one, lambda p: p.memory_info().rss) for one in processes) / 1e6


def _spent(processes: list[psutil.Process]) -> float:
    return sum(_read(one, lambda p: sum(p.cpu_times()[:2])) for one in processes)


def _read(process: psutil.Process, what: Any) -> float:
    try:
        return float(what(process))
    except psutil.Error:  # it has ended
        return 0.0


def main(argv: list[str] | None = None) -> None:
    """Read the command line and soak."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("case", nargs="?", default="demo-valve-axisymmetric")
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--moves", type=int, default=10**9)
    parser.add_argument("--pages", type=int, default=10**9)
    asked = parser.parse_args(argv)
    until = perf_counter() + 3600.0 * asked.hours
    with soaking(asked.case) as found:
        soak(found, moves=asked.moves, pages=asked.pages, until=until)


if __name__ == "__main__":
    main()
