"""A housing with ribs and a bolted flange (STEP), and the case in which a needle hits it."""

from math import hypot
from pathlib import Path

from klack.case import load_case
from klack.case.schema import Case

__all__ = ["ribbed_housing"]

_CASE = """\
klack: 1
title: Needle on a housing with ribs
materials:
  steel: {young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}
bodies:
  needle:
    geometry:
      model: swept
      layers: 12
      profile:
        unit: mm
        parts:
          needle:
            start: [0, -0.6]
            edges:
              - {arc: [0.6, 0], centre: [0, 0], name: tip}
              - {line: [2.5, 1.9], name: taper}
              - {line: [2.5, 15], name: shaft}
              - {line: [5, 15], name: disc_bottom}
              - {line: [5, 19.4], name: disc_rim}
              - {line: [0, 19.4], name: top}
              - {close: true, name: axis}
    material: steel
    mesh: {size: 2 mm, grading: 0.4, contact: {size: 0.04 mm, extent: 0.1 mm}}
  housing:
    geometry: {step: {file: housing.step}}
    material: steel
    mesh: {size: SIZE mm, grading: 0.4, contact: {size: 0.04 mm, extent: 0.1 mm}}
    fixed: [{surface: bolt}]
contact: {between: [needle.tip, housing.seat], gap: 0 um}
motion: {speed: 0.3 m/s}
reduction: {correction: consistent, modes: {needle: {count: 50}, housing: {count: 50}}}
run: {levels: [reduced], duration: 55 us, reduced_step: 20 ns}
"""

# (r, z) [mm] of the turned part, and the name of the face from each corner to the next
_PROFILE = (
    ((0.24, -1.8), "bottom"),
    ((6.5, -1.8), "outside"),
    ((6.5, 8.0), "top"),
    ((5.0, 8.0), "inside"),
    ((5.0, -0.1485), "floor"),
    ((0.7, -0.1485), "seat"),
    ((0.24, -0.6085), "bore"),
)
_RIBS, _BOLTS = 6, 4


def ribbed_housing(folder: Path, size: float, contact: float = 0.04) -> Case:
    """Needle of the demo valve over a cup with six ribs and a flange held at four bolt holes.

    Elements of 0.75 mm give 250 000 degrees of freedom.

    Parameters
    ----------
    folder : path
        Gets the STEP file and the case.
    size : float [mm]
        Of the elements of the housing, away from the contact.
    contact : float [mm]
        Of the elements at the contact.
    """
    _write_housing(folder / "housing.step")
    file = folder / "case.yaml"
    file.write_text(
        _CASE.replace("SIZE", f"{size:g}").replace("0.04 mm", f"{contact:g} mm"), encoding="utf-8"
    )
    return load_case(file)


def _write_housing(path: Path) -> None:
    from netgen.occ import Axis, Box, Cylinder, Face, Pnt, Segment, Wire, X, Y, Z, gp_Pnt

    corners = [corner for corner, _ in _PROFILE]
    edges = []
    for start, end in zip(corners, (*corners[1:], corners[0]), strict=True):
        edges.append(Segment(gp_Pnt(*start, 0.0), gp_Pnt(*end, 0.0)))
    face = Face(Wire(edges))
    middles = {
        name: ((a[0] + b[0]) / 2, (a[1] + b[1]) / 2)
        for (a, name), (b, _) in zip(_PROFILE, (*_PROFILE[1:], _PROFILE[0]), strict=True)
    }
    for edge in face.edges:
        at = edge.Value(sum(edge.parameter_interval) / 2)
        off = {name: hypot(r - at.x, z - at.y) for name, (r, z) in middles.items()}
        edge.name = min(off, key=off.__getitem__)
    body = face.Revolve(Axis((0, 0, 0), Y), 360).Rotate(Axis((0, 0, 0), X), 90)
    axis = Axis((0, 0, 0), Z)
    for k in range(_RIBS):
        body = body + Box(Pnt(6.0, -0.6, -1.8), Pnt(9.5, 0.6, 6.0)).Rotate(axis, k * 360 / _RIBS)
    flange = Cylinder(Pnt(0, 0, -1.8), Z, 12.0, 1.5) - Cylinder(Pnt(0, 0, -1.8), Z, 6.0, 1.5)
    for k in range(_BOLTS):
        hole = Cylinder(Pnt(10.7, 0, -1.8), Z, 0.9, 1.5)
        hole.faces.name = "bolt"
        flange = flange - hole.Rotate(axis, 45 + k * 360 / _BOLTS)
    body = body + flange
    body.solids.name = "housing"
    body.WriteStep(str(path))
