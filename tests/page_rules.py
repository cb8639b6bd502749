"""What every page that klack shows in a browser keeps: axe-core, and rules of layout.

One module for the pages of the application, for reports and for the pages of ``klack show``.
axe-core (Deque Systems, MPL 2.0) comes with the Python package axe-playwright-python, which
developers install; nothing of it is copied here.
"""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

__all__ = ["HAS_AXE", "SCHEMES", "WIDTHS", "axe_findings", "focus_findings", "layout_findings"]

WIDTHS = (400, 1000, 1600)  # [px]: a telephone, half a screen, a large one
SCHEMES = ("light", "dark")
HAS_AXE = find_spec("axe_playwright_python") is not None

_RULES = Path(__file__).with_name("page_rules.js").read_text("utf-8")
_LAYOUT = ("sideways", "outside", "overlapping", "contrast", "touch")
_GRAVE = ("serious", "critical")
_AXE = {
    "runOnly": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"],
    "resultTypes": ["violations"],
    "elementRef": False,
}


def axe_findings(page: Any, rules: tuple[str, ...] = ()) -> list[str]:
    """Serious and critical findings of axe-core on what is shown now.

    Parameters
    ----------
    page : playwright Page
    rules : tuple of str
        Only these; empty for all of WCAG 2.2 AA and best practice.
    """
    from axe_playwright_python.base import AXE_SCRIPT

    if not page.evaluate("() => 'axe' in window"):
        page.evaluate(AXE_SCRIPT)
    options = _AXE | ({"runOnly": {"type": "rule", "values": list(rules)}} if rules else {})
    return [
        f"{item['id']} ({item['impact']}): {node['html'][:140]} {node['target']}"
        for item in page.evaluate("options => axe.run(document, options)", options)["violations"]
        if item["impact"] in _GRAVE
        for node in item["nodes"][:6]
    ]


def layout_findings(page: Any) -> list[str]:
    """What breaks the rules of layout on what is shown now, in words."""
    _bring(page)
    return [
        f"{rule}: {said}" for rule in _LAYOUT for said in page.evaluate(f"klackRules.{rule}()")[:12]
    ]


_FROM_THE_TOP = """() => {
  document.activeElement?.blur();
  if (!document.querySelector(".q-dialog")) {  // what was pressed last would be the start
    document.body.tabIndex = -1;
    document.body.focus();
    document.body.removeAttribute("tabindex");
  }
  window.scrollTo(0, 0);
  window.klackKeys = null;
}"""


def focus_findings(page: Any, most: int = 200) -> tuple[int, list[str]]:
    """Go through a page with the Tab key.

    Returns
    -------
    tuple of (int, list of str)
        Places that had the focus; those that did not show it, or were hidden.
    """
    _bring(page)
    page.evaluate(_FROM_THE_TOP)
    seen: set[int] = set()
    said: list[str] = []
    for _ in range(most):
        page.keyboard.press("Tab")
        found = page.evaluate("klackRules.focus()")
        if found is None or found["key"] in seen:
            break
        seen.add(found["key"])
        said += found["said"]
    return len(seen), said


def _bring(page: Any) -> None:
    if not page.evaluate("() => 'klackRules' in window"):
        page.evaluate(_RULES)
