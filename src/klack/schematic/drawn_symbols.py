"""Symbols of the component types, as strokes; after ISO 1219-1 where it has one.

Symbols with two ends lie along x from the origin to :data:`LENGTH`; others are drawn round their
middle, as large as :data:`FRAME`.  Types without an entry get a plain box.
"""

from collections.abc import Mapping

from klack.network.component import Component
from klack.schematic.shapes import Stroke

__all__ = ["FRAME", "FRAMELESS", "LENGTH", "MARKS", "framed_strokes", "two_ended_strokes"]

LENGTH, HALF = 36.0, 12.0
FRAME = (52.0, 48.0)
"""Width and height of a framed symbol."""


def _circle(x: float, y: float, r: float) -> str:
    return f"M{x - r:g},{y:g} a{r:g},{r:g} 0 1 0 {2 * r:g},0 a{r:g},{r:g} 0 1 0 {-2 * r:g},0 Z"


_SPRING = Stroke("M0,0 H5 l2,-9 l4,18 l4,-18 l4,18 l4,-18 l4,18 l4,-18 l1,9 H36")
_FRICTION = (
    Stroke("M9,-6 H25 V6 H9 Z", "metal"),
    Stroke("M0,0 H9 M6,-8 H31 V8 H6 M31,0 H36"),
    Stroke("M8,-8 l4,-4 M15,-8 l4,-4 M22,-8 l4,-4", "thin"),
    Stroke("M8,12 l4,-4 M15,12 l4,-4 M22,12 l4,-4", "thin"),
)
_CIRCLE = (Stroke("M0,0 H6 M30,0 H36"), Stroke(_circle(18, 0, 12), "paper"))
_PUMP = (*_CIRCLE, Stroke("M30,0 L20,-7 V7 Z", "solid"))
_PIPE = (Stroke("M0,0 H3 M33,0 H36"), Stroke("M3,-6 H33 V6 H3 Z", "fluid"))
_BOX = (Stroke("M0,0 H6 M30,0 H36"), Stroke("M6,-12 H30 V12 H6 Z", "paper"))

_TWO_ENDED: Mapping[str, tuple[Stroke, ...]] = {
    "spring": (_SPRING,),
    "nonlinear-spring": (_SPRING, Stroke("M8,12 L27,-12 M22,-11 L27,-12 L26,-7", "thin")),
    "surging-spring": (
        _SPRING,
        Stroke(_circle(11, 0, 2) + _circle(18, 0, 2) + _circle(25, 0, 2), "solid"),
    ),
    "guide-friction": _FRICTION,
    "lugre-friction": (*_FRICTION, Stroke("M11,-6 v-2 M15,-6 v-2 M19,-6 v-2 M23,-6 v-2")),
    "unsteady-drag": (
        Stroke("M0,0 H9 M31,0 H36"),
        Stroke(_circle(20, 0, 6), "metal"),
        Stroke("M9,-9 q3,-4 6,0 t6,0 t6,0 t4,0 M9,11 q3,-4 6,0 t6,0 t6,0 t4,0", "thin"),
    ),
    "check-valve": (
        Stroke("M0,0 H9 M26,0 H36 M18,-9 L9,0 L18,9"),
        Stroke(_circle(19.5, 0, 6.5), "paper"),
    ),
    "relief-valve": (*_BOX, Stroke("M9,-4 H27 M23,-7 L27,-4 L23,-1 M18,12 l3,-2 l-6,-2 l6,-2")),
    "pressure-loss": (*_BOX, Stroke("M10,8 H16 Q22,8 22,1 V-8")),
    "pipe-friction": (*_PIPE, Stroke("M8,-6 l-3,4 M16,-6 l-3,4 M24,-6 l-3,4 M32,-6 l-3,4", "thin")),
    "pump": _PUMP,
    "pulsating-flow": (*_PUMP, Stroke("M9,0 q2.5,-8 5,0 t5,0", "thin")),
    "force-over-stroke": (*_BOX, Stroke("M9,9 C16,8 16,-6 27,-8")),
    "fmu": (*_BOX, Stroke("M12,-5 H24 V5 H12 Z M15,-5 V-8 M21,-5 V-8 M15,5 V8 M21,5 V8")),
    "orifice": (Stroke("M0,0 H36 M11,-11 Q18,-1 25,-11 M11,11 Q18,1 25,11"),),
    "gas-orifice": (Stroke("M0,0 H36 M11,-11 Q18,-1 25,-11 M11,11 Q18,1 25,11"),),
    "gas-gap": (
        Stroke("M0,0 H9 M27,0 H36 M9,-4 H27 M9,4 H27"),
        Stroke("M9,-9 H27 M9,9 H27", "heavy"),
    ),
    "line": (*_PIPE, Stroke("M6,0 q3,-5 6,0 t6,0 t6,0 t6,0", "thin")),
    "inertance": (
        Stroke("M0,0 H3 M33,0 H36"),
        Stroke("M3,-6 H33 V6 H3 Z", "paper"),
        Stroke("M10,-4 H26 V4 H10 Z", "fluid"),
    ),
    "flow-source": _PUMP,
    "thermal-conductance": (*_BOX, Stroke("M10,-8 V8 M14,-8 V8 M18,-8 V8 M22,-8 V8 M26,-8 V8")),
    "convection": (
        *_BOX,
        Stroke("M11,8 q4,-4 0,-8 t0,-8 M18,8 q4,-4 0,-8 t0,-8 M25,8 q4,-4 0,-8 t0,-8"),
    ),
    "heat-radiation": (*_BOX, Stroke("M9,4 q3,-8 6,0 t6,0 t6,0 M24,0 L27,4 L23,6")),
}

_ARROW_UP = "M0,14 V-14 M-5,-6 L0,-14 L5,-6"
_ARROW_DOWN = "M0,-14 V14 M-5,6 L0,14 L5,6"
_AXES = Stroke("M-18,-14 V14 H18", "thin")

_FRAMED: Mapping[str, tuple[Stroke, ...]] = {
    "heat-capacity": (
        Stroke("M-16,-12 H16 V12 H-16 Z", "metal"),
        Stroke("M-8,8 q4,-4 0,-8 t0,-6 M0,8 q4,-4 0,-8 t0,-6 M8,8 q4,-4 0,-8 t0,-6", "thin"),
    ),
    "fixed-temperature": (
        Stroke("M-3,-14 a3,3 0 0 1 6,0 V4 a6,6 0 1 1 -6,0 Z", "paper"),
        Stroke("M0,-8 V6", "heavy"),
    ),
    "heat-source": (
        Stroke(_circle(0, 0, 12), "paper"),
        Stroke("M-6,6 q4,-4 0,-8 t0,-4 M2,6 q4,-4 0,-8 t0,-4", "thin"),
    ),
    "annulus": (
        Stroke("M-20,-12 H20 M-20,12 H20", "heavy"),
        Stroke("M-14,-7 H12 V7 H-14 Z", "metal"),
        Stroke("M12,0 H22 M-20,-9.5 H20 M-20,9.5 H20", "thin"),
    ),
    "accumulator": (
        Stroke("M-14,-12 H14 a12,12 0 0 1 0,24 H-14 a12,12 0 0 1 0,-24 Z", "paper"),
        Stroke("M-26,0 H26 M-5,-8 H5 L0,-2 Z"),
    ),
    "variable-orifice": (
        Stroke("M-20,0 H20 M-8,-12 Q0,-1 8,-12 M-8,12 Q0,1 8,12"),
        Stroke("M-13,13 L13,-13 M7,-12 L13,-13 L12,-7", "thin"),
    ),
    "spool-edge": (
        Stroke("M-20,-6 H-2 M8,-6 H20 M-20,10 H20", "heavy"),
        Stroke("M-16,-4 H2 V8 H-16 Z", "metal"),
        Stroke("M2,2 H20 M3,-16 V-8 l-3,-4 m3,4 l3,-4", "thin"),
    ),
    "controlled-force": (
        Stroke("M-14,14 V-14 M-19,-7 L-14,-14 L-9,-7"),
        Stroke("M-2,-9 H16 V9 H-2 Z M2,4 q3,-10 6,-4 t6,-4", "thin"),
    ),
    "controlled-voltage": (_AXES, Stroke("M-16,4 q6,-18 12,-4 t12,-4"), Stroke("M4,8 H16", "thin")),
    "gravity": (Stroke(_circle(0, -11, 4), "metal"), Stroke("M0,-7 V14 M-5,6 L0,14 L5,6")),
    "chamber": (Stroke("M-14,-12 H14 a12,12 0 0 1 0,24 H-14 a12,12 0 0 1 0,-24 Z", "fluid"),),
    "junction": (Stroke(_circle(0, 0, 4), "solid"),),
    "pressure-source": (Stroke("M12,0 L-9,-12 V12 Z", "solid"),),
    "gas-chamber": (Stroke("M-14,-12 H14 a12,12 0 0 1 0,24 H-14 a12,12 0 0 1 0,-24 Z", "paper"),),
    "gas-source": (Stroke("M12,0 L-9,-12 V12 Z", "paper"),),
    "voltage-step": (_AXES, Stroke("M-18,10 H-10 V-9 H8 V10 H16")),
    "voltage-table": (_AXES, Stroke("M-18,8 L-9,-6 L-1,2 L7,-11 L16,-4")),
    "drive-profile": (_AXES, Stroke("M-18,10 L-9,-10 H-2 L3,2 H11 L16,10")),
    "two-point": (_AXES, Stroke("M-18,12 L-11,-9 l4,7 l3,-7 l4,7 l3,-7 l4,7 l3,-7 L16,12")),
    "peak-hold": (_AXES, Stroke("M-18,12 L-11,-11 l3,3 l3,-3 L0,2 l3,-3 l3,3 l3,-3 l3,3 L16,12")),
    "boost-driver": (_AXES, Stroke("M-18,12 L-11,-11 L-5,3 l3,-4 l3,4 l3,-4 l3,4 l3,-4 L16,12")),
    "boost-capacitor": (
        Stroke("M-18,0 H-4 M4,0 H18"),
        Stroke("M-4,-12 V12 M4,-12 V12", "heavy"),
    ),
    "pwm": (_AXES, Stroke("M-18,10 V-8 h5 V10 h5 V-8 h5 V10 h5 V-8 h5 V10 h5")),
}

_SEATS: Mapping[str, tuple[Stroke, ...]] = {
    "ball": (
        Stroke("M-18,1 L-5,14 M18,1 L5,14", "heavy"),
        Stroke(_circle(0, 1, 8), "metal"),
        Stroke("M0,-7 V-18"),
    ),
    "cone": (
        Stroke("M-16,0 L-4,14 M16,0 L4,14", "heavy"),
        Stroke("M-9,-6 H9 L0,9 Z", "metal"),
        Stroke("M0,-6 V-18"),
    ),
    "flat": (
        Stroke("M-18,10 H-6 V15 M18,10 H6 V15", "heavy"),
        Stroke("M-12,-2 H12 V5 H-12 Z", "metal"),
        Stroke("M0,-2 V-18"),
    ),
}

FRAMELESS: Mapping[str, tuple[float, float]] = {
    "accumulator": (52.0, 24.0),
    "chamber": (52.0, 24.0),
    "gas-chamber": (52.0, 24.0),
    "gas-source": (24.0, 24.0),
    "junction": (24.0, 24.0),
    "pressure-source": (24.0, 24.0),
}
"""Sizes of frameless symbols."""

MARKS: Mapping[str, tuple[Stroke, ...]] = {
    "ground": (
        Stroke("M0,-8 V8", "heavy"),
        Stroke("M0,-8 l-5,4 M0,-3 l-5,4 M0,2 l-5,4 M0,7 l-3,2.5", "thin"),
    ),
    "ambient": (Stroke("M-10,-5 V5 H0 V-5"), Stroke("M-5,0 H0", "thin")),
    "open": (Stroke(_circle(-4, 0, 4), "unknown"),),
    "unknown": (Stroke("M-12,-6 h12 v12 h-12 Z", "unknown"),),
}
"""Ends of ports at the ground, the surroundings, or nothing, pointing left; and a type without a
symbol, for the legend.
"""


def two_ended_strokes(part: Component) -> tuple[Stroke, ...] | None:
    """Symbol from end to end, if the type has one."""
    if part.type == "end-stop":
        film = (Stroke("M13,-11 H23 V11 H13 Z", "fluid"),) if getattr(part, "film", None) else ()
        bars = Stroke("M13,-12 V12 M23,-12 V12", "heavy")
        return (*film, Stroke("M0,0 H13 M23,0 H36"), bars)
    if part.type == "rubber-stop":
        block = Stroke("M23,-9 H17 Q13,0 17,9 H23 Z", "metal")
        return (block, Stroke("M0,0 H10 M23,0 H36"), Stroke("M10,-12 V12 M23,-12 V12", "heavy"))
    return _TWO_ENDED.get(part.type)


def framed_strokes(part: Component) -> tuple[Stroke, ...] | None:
    """Symbol round its middle, if the type has one."""
    if part.type == "seat":
        return _SEATS.get(str(getattr(part, "shape", "")))
    if part.type == "conical-seat":
        return _SEATS["cone"]
    if part.type == "gas-valve":
        cone = (getattr(part, "half_angle", None) or 1.6) < 1.57
        return _SEATS["cone" if cone else "flat"]
    if part.type in ("pressure-face", "gas-face", "land-face"):
        inner = 0.4 if part.type == "land-face" else 1.0
        return _face(getattr(part, "direction", "") == "closing", inner)
    if part.type in ("solenoid", "magnetic-network", "force-map-solenoid"):
        return _magnet(part)
    if part.type == "constant-force":
        upward = float(getattr(part, "force", 0.0)) >= 0.0
        return (Stroke(_ARROW_UP if upward else _ARROW_DOWN, "heavy"),)
    if part.type == "force-over-time":
        return (Stroke("M-14,14 V-14 M-19,-7 L-14,-14 L-9,-7"), Stroke("M-4,9 L2,-7 H9 L16,9"))
    return _FRAMED.get(part.type)


def _face(closing: bool, outer: float) -> tuple[Stroke, ...]:
    """Plate under pressure; ``outer`` is its share at the edges."""
    way = 1 if closing else -1
    arrows = "".join(
        f"M{x},{way * (4 - 18 * share):g} V{way * 4} m-3,{-4 * way} l3,{4 * way} l3,{-4 * way} "
        for x, share in ((-14, outer), (0, 1.0), (14, outer))
    )
    plate = f"M-20,{way * 6} H20 V{way * 12} H-20 Z"
    return (Stroke(plate, "metal"), Stroke(arrows, "thin"))


def _magnet(part: Component) -> tuple[Stroke, ...]:
    """Coil above its armature, or below if the gap closes downward."""
    way = -1 if getattr(part, "closes", "upward") == "downward" else 1
    inside = f"M-17,{way * -1} L17,{way * -16}"
    if part.type == "force-map-solenoid":
        inside = f"M-13,{way * -4} C-3,{way * -5} 0,{way * -13} 13,{way * -14}"
    return (
        Stroke(f"M-17,{way * -16} H17 V{way * -1} H-17 Z", "paper"),
        Stroke(inside),
        Stroke(f"M-20,{way * 7} H20 V{way * 13} H-20 Z", "metal"),
    )
