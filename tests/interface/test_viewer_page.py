"""Page and payload of the viewer; truth: the arrays that went in, and what HTML may not hold."""

import json
import re
from base64 import b64decode
from dataclasses import replace
from html.parser import HTMLParser
from importlib.resources import files

import numpy as np
import pytest
from viewer_case import brick_view

from klack.report.wording import spelled
from klack.viewer.view import page_of, payload_of

KINDS = {"f4": "<f4", "i2": "<i2", "i1": "<i1", "u1": "<u1", "u2": "<u2", "u4": "<u4"}


def unpacked(packed: dict) -> np.ndarray:
    return np.frombuffer(b64decode(packed["data"]), KINDS[packed["type"]]).reshape(packed["shape"])


class Elements(HTMLParser):
    """Elements of a page with their attributes, and the text of each script."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: list[str] = []
        self.text = ""
        self._inside = ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        self._inside = tag
        if tag == "script":
            self.scripts.append("")

    def handle_endtag(self, tag):
        self._inside = ""

    def handle_data(self, data):
        if self._inside == "script":
            self.scripts[-1] += data
        else:
            self.text += data


def test_arrays_come_back_from_the_payload_in_millimetres():
    view = brick_view()
    payload = json.loads(json.dumps(payload_of(view)))

    (body, given) = payload["bodies"][0], view.bodies[0]
    np.testing.assert_allclose(unpacked(body["points"]), given.skin.points * 1e3, rtol=1e-6)
    np.testing.assert_array_equal(unpacked(body["triangles"]), given.skin.triangles)
    np.testing.assert_allclose(unpacked(body["normals"]) / 127, given.skin.normals, atol=1 / 127)
    assert body["faces"] == list(given.skin.faces)
    motion = body["motion"]
    np.testing.assert_array_equal(unpacked(motion["shapes"]), given.motion.shapes)
    # nodes of the mesh become places among those that the shapes have
    order = unpacked(motion["node"])
    np.testing.assert_array_equal(given.motion.node[order], given.skin.node)
    assert motion["frequency"] == [0.0, 1000.0, 2500.0]
    assert payload["time"]["shape"] == [3]


def test_what_is_told_of_bodies_and_stops_is_in_the_payload_with_signs_of_a_page():
    payload = payload_of(brick_view())

    assert payload["bodies"][0]["rows"][1] == ["surface", "top", spelled("30 mm^2, z 5 mm")]
    assert payload["bodies"][0]["centre"] == pytest.approx([1.0, 1.5, 2.5])
    (section,) = payload["facts"]
    assert section["title"] == "end stops"
    assert section["rows"][0][2] == spelled("block.bottom on brick.top: gap 2 um")


EVIL = "</script><script>alert(1)</script><!--"


def test_words_of_a_case_stay_words():
    view = brick_view(face=EVIL)
    facts = ((EVIL, ((EVIL, EVIL, EVIL),)),)
    view = replace(view, title=EVIL, source=f"case {EVIL}", notes=(EVIL,), facts=facts)
    elements = Elements(page_of(view))
    assert [tag for tag, _ in elements.tags].count("script") == 2
    assert "alert(1)" not in elements.scripts[1]
    assert EVIL in elements.text
    payload = json.loads(elements.scripts[0])
    assert payload["title"] == EVIL
    assert EVIL in payload["bodies"][0]["faces"]


def test_the_page_asks_for_nothing():
    page = page_of(brick_view())

    elements = Elements(page)
    policy = next(a for tag, a in elements.tags if a.get("http-equiv") == "Content-Security-Policy")
    assert policy["content"].startswith("default-src 'none';")
    assert "http" not in policy["content"]
    for tag, attributes in elements.tags:
        assert tag not in ("link", "img", "iframe") or attributes.get("href") == "data:,"
        assert "src" not in attributes
    assert "import " not in re.sub(r"//.*", "", elements.scripts[1].split("const STYLE")[1])
    # a namespace of SVG is a name, no address
    assert set(re.findall(r"https?://[^\"'`\s)]+", page)) <= {
        "http://www.w3.org/2000/svg",
        "http://www.w3.org/1999/xhtml",
    }


def test_the_page_says_what_it_shows():
    text = Elements(page_of(brick_view())).text

    assert "A brick" in text
    assert "case brick, drawn by klack 1.2.3" in text


def test_the_licence_of_the_library_is_in_the_page():
    licence = files("klack.viewer").joinpath("three.LICENSE.txt").read_text(encoding="utf-8")

    assert "Permission is hereby granted, free of charge" in licence
    assert licence.strip() in page_of(brick_view())


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_a_number_that_json_lacks_is_an_error_and_no_broken_page(bad):
    view = brick_view()
    contact = replace(view.contacts[0], gap=bad)

    assert payload_of(replace(view, contacts=(contact,)))["contacts"][0]["gap"] is None
    with pytest.raises(ValueError, match="JSON compliant"):
        page_of(replace(view, bodies=(replace(view.bodies[0], finest=bad),)))
