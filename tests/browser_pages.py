"""Every page that klack shows in a browser, and how to get there; a new one joins with one line."""

import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

__all__ = ["PAGES", "Place", "made_folder", "watched"]

CASE = "valve/case.yaml"
_COMPUTED = (
    ("impact", "demo-valve-axisymmetric", "--level", "reduced"),
    ("stroke", "demo-stroke", "--variant", "dry"),
    ("heat", "warm-valve"),
    ("linearise", "demo-stroke"),
    ("noise", "RESULTS/impact"),
    ("study", "STUDY"),
)
_SHOWN = (("impact", "RESULTS/impact"), ("stroke", "demo-stroke"))


@dataclass(frozen=True)
class Place:
    """A page.

    Parameters
    ----------
    name : str
    address : str
        From the server; ``file:NAME`` is a page of its own in the folder.
    ready : str
        Selector of what is there once the page is.
    then : callable
        What is done before it is looked at, for what opens on a page: a dialog.
    """

    name: str
    address: str
    ready: str
    then: Callable[[Any], None] = lambda page: None

    def open(self, page: Any, base: str, folder: Path) -> None:
        """Show it."""
        kind, _, rest = self.address.partition("file:")
        page.goto((folder / rest).as_uri() if rest else base + kind)
        page.wait_for_selector(self.ready)
        self.then(page)


def _press(name: str) -> Callable[[Any], None]:
    def press(page: Any) -> None:
        page.get_by_role("button", name=name, exact=True).first.click()
        page.wait_for_selector(".q-dialog h2")

    return press


def _open_all(page: Any) -> None:
    page.evaluate("document.querySelectorAll('details').forEach(part => { part.open = true; })")


def _refused(page: Any) -> None:
    page.get_by_label("case file, YAML").fill("klack: 1\nmotion: {speed: 3 kg}\n")
    page.wait_for_selector("text=not valid, not saved")
    page.get_by_role("button", name="Discard changes").click()
    page.wait_for_selector("text=valid impact, saved")
    page.get_by_label("speed", exact=True).fill("fast")
    page.get_by_label("speed", exact=True).press("Enter")
    page.wait_for_selector("text=not valid, not saved")


_STEPS = (
    ("Parts", ".k-read"),
    ("Faces", ".ks-view canvas"),
    ("Materials", "text=Young's modulus"),
    ("Motion", "text=Closing force"),
    ("Check", "text=static hold"),
    ("Case", "text=klack: 1"),
)


_AT_THE_START = """() => document.querySelector(".k-choice select")?.value == "step"
  && !document.querySelector(".k-read")"""


def _guided(number: int) -> Callable[[Any], None]:
    """The guide for a new valve, from drawings to one of its steps."""

    def lead(page: Any) -> None:
        page.wait_for_function("window.socket?.connected")  # what is pressed before is lost
        if not page.evaluate(_AT_THE_START):
            page.get_by_role("button", name="Start over").click()
            page.wait_for_function(_AT_THE_START)
        page.get_by_label("The two bodies come from").select_option("table")
        for body in ("needle", "housing"):
            page.get_by_role("button", name=f"Fill in the example of the {body}").click()
        page.wait_for_function("document.querySelectorAll('.k-read').length == 2")
        if number > 1:
            page.locator("#k-next").click()
            for name, role in (
                ("needle.tip", "contact"),
                ("housing.seat", "contact"),
                ("housing.rim", "held"),
            ):
                page.get_by_label(name, exact=True).select_option(role)
            page.wait_for_function("!document.getElementById('k-next').disabled")
        for _ in range(number - 2):
            page.locator("#k-next").click()
            page.wait_for_timeout(300)
        page.wait_for_selector(_STEPS[number - 1][1])

    return lead


_REPORT = "/report?path=klack-results/{}/report.html"
_BOTH = "a=klack-results/impact&b=klack-results/impact"

PAGES = (
    Place("overview", "/", "text=2 notes on this result", _open_all),
    Place("dialog, new case", "/", "text=2 notes on this result", _press("New case")),
    Place("dialog, duplicate", "/", "text=2 notes on this result", _press(f"Duplicate {CASE}")),
    Place("dialog, note", "/", "text=2 notes on this result", _press(f"Note {CASE}")),
    Place("case, impact", f"/case?path={CASE}", "text=valid impact", _open_all),
    Place("case, stroke", "/case?path=stroke/case.yaml", "text=valid stroke"),
    Place("case, not valid", f"/case?path={CASE}", "text=valid impact", _refused),
    Place("case, none", "/case?path=none.yaml", ".k-error"),
    Place("sliders", f"/sliders?path={CASE}", ".k-badge.good", _open_all),
    Place("compare", f"/compare?{_BOTH}", "text=sound exposure level"),
    Place("new study", f"/new-study?path={CASE}", "text=Write the study"),
    Place("points", "/points?path=klack-results/study", "#kp-root[data-points]"),
    Place("bodies of a case", f"/show?path={CASE}", ".ks-view canvas"),
    Place("bodies of a result", "/show?path=klack-results/impact", ".ks-view canvas"),
    *(
        Place(f"new valve, {name}", "/new", ".k-steps button", _guided(number))
        for number, (name, _) in enumerate(_STEPS, 1)
    ),
    *(Place(f"report, {name}", _REPORT.format(name), ".main-svg") for name, *_ in _COMPUTED),
    *(Place(f"show, {name}", f"file:show-{name}.html", ".ks-panel h3") for name, _ in _SHOWN),
)


def made_folder(folder: Path) -> Path:
    """Cases, and a result of every kind with its report, computed in this process."""
    from klack.case.shipped import find_case
    from klack.cli.main import main

    for name, shipped in (("valve", "demo-valve-axisymmetric"), ("stroke", "demo-stroke")):
        (folder / name).mkdir()
        shutil.copy(find_case(shipped), folder / name / "case.yaml")
    study = folder / "study.yaml"
    text = find_case("demo-stroke").read_text("utf-8")
    study.write_text(
        text.replace("points: 64", "points: 8").replace("    - noise.sound", "    # - noise.sound")
    )
    results = folder / "klack-results"
    known = {"STUDY": str(study), "RESULTS/impact": str(results / "impact")}
    for command, source, *more in _COMPUTED:
        out = ["--out", str(results / command), "--quiet"]
        _run(main, [command, known.get(source, source), *more, *out])
    for name, source in _SHOWN:
        out = ["--out", str(folder / f"show-{name}.html"), "--quiet"]
        _run(main, ["show", known.get(source, source), *out])
    study.unlink()
    return folder


def _run(main: Callable[[list[str]], int | None], words: list[str]) -> None:
    assert os.environ.get("OMP_NUM_THREADS") == "1"
    code = main(words)
    assert not code, f"klack {' '.join(words)} ended with {code}"


def watched(page: Any, own: str) -> list[str]:
    """What a page complains of or asks of other hosts from now on; empty on a good one."""
    said: list[str] = []
    page.on(
        "console",
        lambda told: said.append(told.text) if told.type in ("error", "warning") else None,
    )
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("dialog", lambda dialog: said.append(f"dialog: {dialog.message}"))
    allowed = (own, own.replace("http", "ws", 1), "data:", "blob:", "file:")
    page.on(
        "request",
        lambda asked: said.append(f"asked {asked.url}") if not asked.url.startswith(allowed) else 0,
    )
    return said
