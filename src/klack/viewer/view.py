"""Content of a page: bodies, contacts and motion."""

import json
import re
from base64 import b64encode
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from math import isfinite
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from numpy.typing import NDArray

from klack.analyses.inspection import Row
from klack.mesh.skin import Skin
from klack.report.wording import spelled

__all__ = [
    "BodyView",
    "ContactView",
    "Curve",
    "Facts",
    "MotionView",
    "View",
    "page_of",
    "payload_of",
]


Floats = NDArray[np.float64]

Facts = tuple[tuple[str, tuple[Row, ...]], ...]
"""Titles with their rows, as of ``klack inspect``."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactView:
    """Two surfaces that meet.

    Parameters
    ----------
    name
        Of the stop; ``"contact"`` for that of an impact.
    upper, lower
        Surfaces, written ``needle.tip``.
    ring (n, 3) [m]
        Points of first touch round their centre; one for a point, none for flat faces.
    closed
        The points are a ring; else drawn one by one.
    gap [m]
        As shown; nan if unknown.
    """

    name: str
    upper: str
    lower: str
    ring: Floats
    closed: bool
    gap: float


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionView:
    """Shapes of a body and what they do over time.

    Parameters
    ----------
    shapes (m, n, dimension)
        Modes of surface nodes, of full range each: rigid ones, elastic ones, then static rests.
    scale (m,)
        Displacement at 32767, per unit of amplitude.
    frequency (m,) [Hz]
        0 for a rigid motion; nan for a static rest.
    amplitude (frames, m)
        Over ``time`` of the page; empty without an impact of these shapes.
    stress (n,) [Pa]
        Von Mises at the highest force, if known.
    node (n,)
        Nodes of the mesh, rising.
    """

    shapes: NDArray[np.int16]
    scale: Floats
    frequency: Floats
    amplitude: NDArray[np.floating]
    stress: NDArray[np.floating]
    node: NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyView:
    """A body.

    Parameters
    ----------
    about
        Where it comes from, its mesh.
    held (v,)
        Held vertices of the skin.
    section (s, 2, 3) [m]
        Sides of elements in the plane y = 0.
    finest [m]
        Shortest side of an element.
    travel (frames,) [m]
        Of the body as a whole along z, over ``time`` of the page, or empty.
    rows
        As of ``klack inspect``: what, its name, its numbers.
    centre (3,) [m]
        Of gravity, as it stands; None where it is not known.
    """

    name: str
    about: str
    skin: Skin
    held: NDArray[np.bool_]
    section: Floats
    finest: float
    travel: Floats = field(default_factory=lambda: np.empty(0))
    motion: MotionView | None = None
    rows: tuple[Row, ...] = ()
    centre: Floats | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Curve:
    """A curve with its axes.

    Parameters
    ----------
    x, y (n,)
    body
        Whose modes its peaks are; empty for a history.
    """

    name: str
    x: Floats
    y: Floats
    x_unit: str
    y_unit: str
    body: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """A page.

    Parameters
    ----------
    name
        Short, for a file.
    source
        Which case, mesh or result this is.
    time (frames,) [s]
        Of the motion, or empty.
    notes
        What is not shown, and why.
    facts
        What moves and what meets.
    """

    name: str
    title: str
    source: str
    description: str
    version: str
    bodies: tuple[BodyView, ...]
    contacts: tuple[ContactView, ...] = ()
    time: Floats = field(default_factory=lambda: np.empty(0))
    transfer: tuple[Curve, ...] = ()
    histories: tuple[Curve, ...] = ()
    schematic: str = ""
    notes: tuple[str, ...] = ()
    facts: Facts = ()


_MM = 1e3
_TYPES = {"f4": "<f4", "i2": "<i2", "i1": "<i1", "u1": "<u1", "u2": "<u2", "u4": "<u4"}


def payload_of(view: View, words: Callable[[str], str] = spelled) -> dict[str, Any]:
    """Plain data of a view, which JSON can carry; ``scene.js`` draws it.

    Lengths are in millimetres; the type of an array stands beside it.  ``words`` spells numbers of
    rows, ``z 5 mm^2``, as the page does.
    """
    return {
        "schema": "klack-scene/1",
        "title": view.title,
        "source": view.source,
        "description": view.description,
        "version": view.version,
        "notes": list(view.notes),
        "bodies": [_body(body, words) for body in view.bodies],
        "contacts": [_contact(contact) for contact in view.contacts],
        "time": _array(view.time * 1e6, "f4"),
        "transfer": [_curve(curve) for curve in view.transfer],
        "histories": [_curve(curve) for curve in view.histories],
        "schematic": view.schematic,
        "facts": [{"title": title, "rows": _rows(rows, words)} for title, rows in view.facts],
    }


def _array(values: NDArray[Any], kind: str) -> dict[str, Any]:
    data = np.ascontiguousarray(values, dtype=_TYPES[kind])
    return {"type": kind, "shape": list(data.shape), "data": b64encode(data.tobytes()).decode()}


def _body(body: BodyView, words: Callable[[str], str]) -> dict[str, Any]:
    return {
        "name": body.name,
        "about": body.about,
        "finest": body.finest * _MM,
        "held": _array(body.held, "u1"),
        "section": _array(body.section * _MM, "f4"),
        "travel": _array(body.travel * _MM, "f4"),
        "rows": _rows(body.rows, words),
        "centre": None if body.centre is None else [float(_MM * x) for x in body.centre],
        **_skin(body.skin),
        "motion": None if body.motion is None else _motion(body.motion, body.skin),
    }


def _rows(rows: tuple[Row, ...], words: Callable[[str], str]) -> list[list[str]]:
    return [[what, name, words(content)] for what, name, content in rows]


def _skin(skin: Skin) -> dict[str, Any]:
    return {
        "points": _array(skin.points * _MM, "f4"),
        "normals": _array(np.round(skin.normals * 127.0), "i1"),
        "face": _array(np.where(skin.face < 0, 65535, skin.face), "u2"),
        "faces": list(skin.faces),
        "triangles": _array(skin.triangles, "u4"),
        "elementEdges": _array(skin.element_edges, "u4"),
        "creases": _array(skin.creases, "u4"),
    }


def _motion(motion: MotionView, skin: Skin) -> dict[str, Any]:
    order = np.searchsorted(motion.node, skin.node)
    known = np.isnan(motion.frequency)
    return {
        "node": _array(order, "u4"),
        "angle": _array(skin.angle, "f4"),
        "shapes": _array(motion.shapes, "i2"),
        "scale": _array(motion.scale * _MM, "f4"),
        "frequency": [
            None if rest else float(f) for f, rest in zip(motion.frequency, known, strict=True)
        ],
        "amplitude": _array(motion.amplitude, "f4"),
        "stress": _array(motion.stress * 1e-6, "f4"),
    }


def _contact(contact: ContactView) -> dict[str, Any]:
    return {
        "name": contact.name,
        "upper": contact.upper,
        "lower": contact.lower,
        "ring": _array(contact.ring * _MM, "f4"),
        "closed": contact.closed,
        "gap": contact.gap * _MM if isfinite(contact.gap) else None,
    }


def _curve(curve: Curve) -> dict[str, Any]:
    return {
        "name": curve.name,
        "x": _array(curve.x, "f4"),
        "y": _array(curve.y, "f4"),
        "xUnit": curve.x_unit,
        "yUnit": curve.y_unit,
        "body": curve.body,
    }


_IMPORT = "import * as THREE from './three.min.js';\n"


def page_of(view: View) -> str:
    """HTML of a view: no server, no request, nothing but the file.

    A page that is opened from a file may load no modules, so the component and three.js become one
    classic script here.
    """
    environment = Environment(
        loader=PackageLoader("klack.viewer", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html").render(
        title=view.title,
        source=view.source,
        version=view.version,
        payload=Markup(_json(payload_of(view))),
        script=Markup(_script()),
    )


def _json(payload: dict[str, object]) -> str:
    """JSON that ends no element and starts no comment of HTML."""
    text = json.dumps(payload, ensure_ascii=True, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


@cache
def _script() -> str:
    """The component and three.js as one classic script."""
    room = files("klack.viewer")
    library = room.joinpath("three.min.js").read_text(encoding="utf-8")
    scene = room.joinpath("scene.js").read_text(encoding="utf-8")
    body, found, names = library.rpartition("export{")
    assert found, "three.min.js as it is shipped"
    assert _IMPORT in scene, "scene.js as it is shipped"
    listed = re.sub(r"([\w$]+) as ([\w$]+)", r"\2:\1", names.strip().removesuffix("};"))
    scene = re.sub(r"^export ", "", scene.replace(_IMPORT, ""), flags=re.MULTILINE)
    licence = room.joinpath("three.LICENSE.txt").read_text(encoding="utf-8").strip()
    text = f"/*\n{licence}\n*/\nconst THREE=(()=>{{{body}return{{{listed}}};}})();\n{scene}"
    assert "</script" not in text
    assert "<!--" not in text
    return text
