"""Every page that klack shows in a browser, and how to get there; a new one joins with one line."""

import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

__all__ = [
    "PAGES",
    "PICTURED",
    "TEXT",
    "Place",
    "chromium",
    "controls",
    "launched",
    "made_folder",
    "planned",
    "put",
    "text_of",
    "watched",
]

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
    before : callable
        What is made in the folder before it is opened.
    picture : str
        Name of its picture in ``docs/images``, made by ``docs/app_pictures.py``.
    """

    name: str
    address: str
    ready: str
    then: Callable[[Any], None] = lambda page: None
    before: Callable[[Path], None] = lambda folder: None
    picture: str = ""

    def open(self, page: Any, base: str, folder: Path) -> None:
        """Show it."""
        self.before(folder)
        kind, _, rest = self.address.partition("file:")
        page.goto((folder / rest).as_uri() if rest else base + kind)
        page.wait_for_selector(self.ready)
        self.then(page)


TEXT = "document.getElementById('k-yaml')"


def text_of(page: Any) -> str:
    """The text of the editor of a case."""
    return str(page.evaluate(f"{TEXT}.value"))


def put(page: Any, text: str) -> None:
    """Replace the text of the editor, as one that is pasted over it does."""
    page.evaluate(f"text => {{ {TEXT}.value = text; {TEXT}.focus(); }}", text)


def _press(name: str) -> Callable[[Any], None]:
    def press(page: Any) -> None:
        page.get_by_role("button", name=name, exact=True).first.click()
        page.wait_for_selector(".q-dialog h2")

    return press


def _open_all(page: Any) -> None:
    page.evaluate("document.querySelectorAll('details').forEach(part => { part.open = true; })")


def _refused(page: Any) -> None:
    put(page, "klack: 1\nmotion: {speed: 3 kg}\n")
    page.wait_for_selector("text=not valid, not saved")
    page.get_by_role("button", name="Discard changes").click()
    page.wait_for_selector("text=valid impact, saved")
    page.get_by_label("speed", exact=True).fill("fast")
    page.get_by_label("speed", exact=True).press("Enter")
    page.wait_for_selector("text=not valid, not saved")


def _form(page: Any) -> None:
    page.get_by_role("button", name="Form", exact=True).click()
    page.wait_for_selector(".k-form summary")


def _component(page: Any) -> None:
    page.wait_for_selector(".k-net svg")
    page.get_by_label("Component", exact=True).select_option("armature_gap")
    page.wait_for_selector("text=armature_gap: annulus")
    page.evaluate("window.scrollTo(0, document.querySelector('.k-editor').offsetTop - 58)")


def planned(step: int, **other: str) -> Callable[[Path], None]:
    """The guide at a step, with the drawings of the example and their faces chosen."""

    def keep(folder: Path) -> None:
        from klack.app.folder import OpenFolder
        from klack.app.valve_plan import EXAMPLES, Plans, ValvePlan

        given = {f"{body}_table": rows for body, rows in EXAMPLES.items()}
        given |= {"needle_contact": "tip", "housing_contact": "seat"} | other
        plan = ValvePlan(step=step, source="table", held=("rim",), **given)
        Plans(OpenFolder(folder)).keep(plan)

    return keep


def _unplanned(folder: Path) -> None:
    (folder / ".klack-app" / "new-valve.json").unlink(missing_ok=True)


def _to_contact(page: Any) -> None:
    page.get_by_role("button", name="To the contact", exact=True).click()
    page.get_by_label("Mesh lines").check()


def _in_mode(page: Any) -> None:
    page.emulate_media(reduced_motion="reduce")  # at its largest, and still
    page.locator(".ks-mark").first.click()


def _at_peak(page: Any) -> None:
    page.emulate_media(reduced_motion="reduce")
    page.get_by_role("button", name="Impact", exact=True).click()
    page.get_by_role("checkbox", name="Cut open").check()
    page.get_by_label("Colour", exact=True).select_option("stress")
    page.get_by_label("Time", exact=True).fill("330")  # of 1000, near the highest force


def _without_needle(page: Any) -> None:
    page.get_by_role("checkbox", name="Cut open").check()
    page.get_by_role("checkbox", name="needle", exact=True).uncheck()


_REPORT = "/report?path=klack-results/{}/report.html"
_STROKE = "/case?path=stroke/case.yaml"
_BOTH = "a=klack-results/impact&b=klack-results/impact"

PAGES = (
    Place("overview", "/", "text=2 notes on this result", _open_all),
    Place("cases", "/", "text=2 notes on this result", picture="app-cases"),
    Place("dialog, new case", "/", "text=2 notes on this result", _press("New case")),
    Place("dialog, duplicate", "/", "text=2 notes on this result", _press(f"Duplicate {CASE}")),
    Place("dialog, note", "/", "text=2 notes on this result", _press(f"Note {CASE}")),
    Place("case, impact", f"/case?path={CASE}", "text=valid impact", _open_all),
    Place("case, stroke", _STROKE, "text=valid stroke", _form, picture="app-case"),
    Place("case, schematic", _STROKE, "text=valid stroke", _component, picture="app-schematic"),
    Place("dialog, component", _STROKE, ".k-net svg", _press("Add a component")),
    Place("case, not valid", f"/case?path={CASE}", "text=valid impact", _refused),
    Place("case, none", "/case?path=none.yaml", ".k-error"),
    Place("sliders", f"/sliders?path={CASE}", ".k-badge.good", _open_all),
    Place("sliders, closed", f"/sliders?path={CASE}", ".k-badge.good", picture="app-sliders"),
    Place("compare", f"/compare?{_BOTH}", "text=sound exposure level"),
    Place("new study", f"/new-study?path={CASE}", "text=Write the study"),
    Place(
        "points",
        "/points?path=klack-results/study",
        "#kp-root[data-points]",
        picture="app-studies",
    ),
    Place("bodies of a case", "/show?path=stroke/case.yaml", ".ks-view canvas"),
    Place("bodies of a result", "/show?path=klack-results/impact", ".ks-view canvas"),
    Place("new valve", "/new", ".k-steps button", before=_unplanned),
    *(
        Place(f"new valve, {name}", "/new", ready, before=planned(step, **other), picture=picture)
        for step, name, ready, other, picture in (
            (0, "drawings", "textarea", {}, "new-valve-parts"),
            (1, "faces", ".ks-view canvas", {}, "new-valve-faces"),
            (2, "materials", "text=Young's modulus", {}, ""),
            (3, "motion", "text=Speed at the impact", {}, ""),
            (4, "check", ".k-finding", {}, "new-valve-checks"),
            (4, "check, with errors", ".k-badge.out", {"speed": "fast"}, ""),
            (5, "case", "text=klack: 1", {}, ""),
        )
    ),
    *(Place(f"report, {name}", _REPORT.format(name), ".main-svg") for name, *_ in _COMPUTED),
    *(Place(f"show, {name}", f"file:show-{name}.html", ".ks-panel h3") for name, _ in _SHOWN),
)


PICTURED = (
    *(place for place in PAGES if place.picture),
    *(
        Place(
            f"new valve, {picture}", "/new", ".ks-view canvas", then, planned(1, **other), picture
        )
        for picture, then, other in (
            ("new-valve-seat", _without_needle, {"housing_contact": "", "needle_contact": ""}),
        )
    ),
    Place(
        "result, moving",
        "/show?path=klack-results/impact",
        ".ks-view canvas",
        _at_peak,
        picture="new-valve-show",
    ),
    *(
        Place(picture, f"file:show-{name}.html", ".ks-panel h3", then, picture=picture)
        for picture, name, then in (
            ("show-case", "stroke", lambda page: None),
            ("show-contact", "impact", _to_contact),
            ("show-mode", "impact", _in_mode),
            ("show-impact", "impact", _at_peak),
        )
    ),
)
"""Places of pictures; those of :data:`PAGES` and more, which show a page in another state."""


# charts of thousands of points, drawn in two dimensions, would take that renderer 15 s
SOFTWARE_GL = (
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-accelerated-2d-canvas",
)


def chromium() -> str | None:
    """The browser of this machine."""
    return shutil.which("chromium") or shutil.which("chromium-browser")


def launched(library: Any) -> Any:
    """Chromium without a display, which draws three dimensions by software."""
    return library.chromium.launch(executable_path=chromium(), args=[*SOFTWARE_GL, "--no-sandbox"])


_CONTROLS = """() => [
  ...document.querySelectorAll(":is(#k-body, #scene) :is(h1, h2, h3, button, a.k-btn, .k-tick)")
].filter(e => e.checkVisibility()).map(e => e.innerText.trim()).filter(word => word)"""


def controls(page: Any) -> list[str]:
    """Headings, buttons, links and boxes that are seen, in their order."""
    found: list[str] = page.evaluate(_CONTROLS)
    return found


def made_folder(folder: Path) -> Path:
    """Cases, and a result of every kind with its report, computed in this process."""
    from klack.case.reader import find_case
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
    assert os.environ.get("OMP_NUM_THREADS") == "1", (
        "without workers: OMP_NUM_THREADS=1 pytest -n 0"
    )
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
