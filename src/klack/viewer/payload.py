"""A view as plain data: words, numbers, and arrays in base64, little-endian.

Lengths are in millimetres; the type of an array stands beside it.
"""

from base64 import b64encode
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.mesh.skin import Skin
from klack.viewer.view import BodyView, ContactView, Curve, MotionView, View

__all__ = ["payload_of"]

_MM = 1e3
_TYPES = {"f4": "<f4", "i2": "<i2", "i1": "<i1", "u1": "<u1", "u2": "<u2", "u4": "<u4"}


def payload_of(view: View) -> dict[str, Any]:
    """Plain data of a view, which JSON can carry; ``scene.js`` draws it."""
    return {
        "schema": "klack-scene/1",
        "title": view.title,
        "source": view.source,
        "description": view.description,
        "version": view.version,
        "notes": list(view.notes),
        "bodies": [_body(body) for body in view.bodies],
        "contacts": [_contact(contact) for contact in view.contacts],
        "time": _array(view.time * 1e6, "f4"),
        "transfer": [_curve(curve) for curve in view.transfer],
        "histories": [_curve(curve) for curve in view.histories],
        "schematic": view.schematic,
    }


def _array(values: NDArray[Any], kind: str) -> dict[str, Any]:
    data = np.ascontiguousarray(values, dtype=_TYPES[kind])
    return {"type": kind, "shape": list(data.shape), "data": b64encode(data.tobytes()).decode()}


def _body(body: BodyView) -> dict[str, Any]:
    return {
        "name": body.name,
        "about": body.about,
        "finest": body.finest * _MM,
        "held": _array(body.held, "u1"),
        "section": _array(body.section * _MM, "f4"),
        "travel": _array(body.travel * _MM, "f4"),
        **_skin(body.skin),
        "motion": None if body.motion is None else _motion(body.motion, body.skin),
    }


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
