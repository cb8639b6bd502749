"""The rules for pages find the faults that are planted here, and nothing on a sound page."""

import pytest
from page_rules import HAS_AXE, axe_findings, focus_findings, layout_findings

pytestmark = pytest.mark.slow

SOUND = """<!doctype html><html lang="en"><head><title>sound</title>
<meta name="viewport" content="width=device-width"><style>
body { font: 16px/1.5 sans-serif; color: #222; background: #fff; margin: 16px }
a, button { display: inline-block; padding: 6px 10px; color: #0b62a8 }
:focus-visible { outline: 2px solid #0b62a8 }
</style></head><body><main><h1>Sound</h1><p>Text in its place.</p>
<button>Press</button> <a href="#x">Go</a> PLANTED</main></body></html>"""

FAULTS = {
    "sideways": '<div style="width:3000px;height:4px"></div>',
    "outside": '<div style="width:60px;background:#eee;white-space:nowrap">too long a text</div>',
    "overlapping": '<div style="height:24px">below</div><div style="margin-top:-24px">above</div>',
    "contrast": '<p style="color:#999">pale</p>',
    "touch": '<button style="padding:0;border:0;font-size:9px;line-height:1">tiny</button>',
}
SCROLLED = '<div style="overflow:auto;width:90px"><p style="width:300px">too wide</p></div>'
MORE_CONTRAST = (
    '<div style="background:#223"><p style="background:rgba(255,255,255,.1)">on dark</p></div>',
    '<div style="opacity:.4"><p>faint by opacity</p></div>',
    '<svg width="90" height="30"><text x="2" y="20" fill="#aaa">axis</text></svg>',
    '<label>Name<input style="color:#aaa" value="typed" size="30"></label>',
)


def shown(browser, planted: str = ""):
    page = browser.new_page(viewport={"width": 1000, "height": 700})
    page.set_content(SOUND.replace("PLANTED", planted))
    return page


def test_a_sound_page_has_no_findings(browser):
    page = shown(browser)

    assert layout_findings(page) == []
    assert focus_findings(page) == (2, [])
    if HAS_AXE:
        assert axe_findings(page) == []
    page.close()


@pytest.mark.parametrize("rule", FAULTS)
def test_each_fault_is_found_by_its_rule(browser, rule):
    page = shown(browser, FAULTS[rule])

    found = layout_findings(page)

    assert [said for said in found if said.startswith(f"{rule}:")], found
    page.close()


def test_a_part_that_is_scrolled_sideways_unreached_is_found(browser):
    page = shown(browser, SCROLLED)

    assert [said for said in layout_findings(page) if said.startswith("sideways:")]
    page.close()


@pytest.mark.parametrize("planted", MORE_CONTRAST)
def test_contrast_is_that_of_what_is_painted_behind(browser, planted):
    page = shown(browser, planted)

    assert [said for said in layout_findings(page) if said.startswith("contrast:")]
    page.close()


def test_a_focus_that_is_not_shown_or_covered_is_found(browser):
    hidden = '<button style="outline:none">unmarked</button>'
    covered = (
        '<div style="position:relative"><button>under</button>'
        '<div style="position:absolute;inset:-4px;background:#fff"></div></div>'
    )
    page = shown(browser, hidden + covered)

    count, said = focus_findings(page)

    assert count == 4
    assert len(said) == 2
    assert "does not show it" in said[0]
    assert "lies behind" in said[1]
    page.close()


@pytest.mark.skipif(not HAS_AXE, reason="no axe-core here: axe-playwright-python is not installed")
def test_axe_core_runs_and_finds_a_field_without_a_name(browser):
    page = shown(browser, "<input>")

    assert [said for said in axe_findings(page) if said.startswith("label (critical)")]
    page.close()
