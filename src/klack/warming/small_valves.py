"""Smallest valves with one of everything."""

from pathlib import Path
from typing import Literal

from klack.case.any_case import CaseTree
from klack.case.reader import parse
from klack.case.valve import ValveCase

__all__ = ["small_valve", "spatial_valve"]


_SMALL = """
klack: 1
title: One of everything
network:
  fluid: {name: n-heptane}
  components:
    tank: {type: pressure-source, pressure: 5 bar}
    pipe: {type: line, length: 60 mm, diameter: 2 mm, pressure: 5 bar}
    inlet: {type: chamber, volume: 100 mm^3, pressure: 5 bar}
    nozzle: {type: orifice, diameter: 0.4 mm}
    face: {type: pressure-face, direction: opening, outer_diameter: 2 mm}
    needle: {type: rigid-mass, mass: 3 g, points: [tip]}
    spring: {type: spring, stiffness: 10 N/mm, preload: 12 N}
    seat:
      type: end-stop
      gap: 0 um
      law: {kind: linear, stiffness: 1e8 N/m}
      restitution: 0.5
      film: {shape: ring, inner_radius: 1 mm, outer_radius: 1.5 mm, cut_off: 1 um, pressure: 5 bar}
  connections:
    - [tank.fluid, pipe.a]
    - [pipe.b, inlet.fluid, nozzle.a, face.fluid]
    - [nozzle.b, ambient]
    - [needle.tip, seat.upper, spring.end, face.body]
    - [seat.lower, ground]
run: {duration: 20 us, step: 20 ns, coarse: 16, record: 1 us, variants: [wet]}
"""


def small_valve() -> ValveCase:
    """Case of rigid bodies, a fluid, a pipe, a stop with a film."""
    return _valve(_SMALL, Path("small-valve.yaml"))


_SPATIAL = """
klack: 1
title: Needle, seat, guide and films in three dimensions
materials:
  steel: {young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}
bodies:
  needle:
    geometry:
      MODEL
      profile:
        unit: mm
        parts:
          needle:
            start: [0, -1.25]
            edges:
              - {arc: [1.25, 0], centre: [0, 0], name: tip}
              - {line: [1.25, 8], name: shaft}
              - {line: [1, 8], name: edge}
              - {line: [0.6, 8], name: land}
              - {line: [0, 8], name: top}
              - {close: true, name: axis}
    material: steel
    mesh: {size: 3 mm, surfaces: {land: 0.2 mm}, contact: {size: 0.06 mm, extent: 0.12 mm}}
    damping: {modal: 1 %}
  housing:
    geometry:
      MODEL
      profile:
        unit: mm
        parts:
          housing:
            start: [0.45, -2.6]
            edges:
              - {line: [3, -2.6], name: bottom}
              - {line: [3, -0.268], name: rim}
              - {line: [1.5, -0.268], name: floor}
              - {line: [0.45, -1.318], name: seat}
              - {close: true, name: bore}
    material: steel
    mesh: {size: 3 mm, contact: {size: 0.06 mm, extent: 0.12 mm}}
    fixed: [{surface: rim}]
    damping: {modal: 1 %}
  pole:
    geometry:
      MODEL
      profile:
        unit: mm
        parts:
          pole:
            start: [0.65, 8.1]
            edges:
              - {arc: [0.95, 8.1], centre: [0.8, 28.1], name: stop}
              - {line: [2, 8.2], name: face}
              - {line: [2, 12], name: rim}
              - {line: [0.5, 12], name: back}
              - {line: [0.5, 8.2], name: bore}
              - {close: true, name: inside}
    material: steel
    mesh: {size: 3 mm, contact: {size: 0.06 mm, extent: 0.16 mm}}
    fixed: [{surface: rim}]
    damping: {modal: 1 %}
stops:
  seat: {between: [needle.tip, housing.seat], speed: 1 m/s, force: 20 NFRICTION}
  opening: {between: [pole.stop, needle.land], speed: 1 m/s, force: 40 NFRICTION}
reduction: {modes: {needle: {count: 6}, housing: {count: 4}, pole: {count: 4}}}
network:
  fluid: {name: n-heptane}
  components:
    needle: {type: flexible-body, body: needle, points: [tip, top, land]}
    housing: {type: flexible-body, body: housing, points: [seat]}
    pole: {type: flexible-body, body: pole, points: [stop]}
    seat:
      type: end-stop
      gap: 0 um
      law: {kind: consistent}
      film: {shape: cone, mean_radius: 0.884 mm, width: 0.1 mm, half_angle: 45 deg, cut_off: 1 um}
    opening:
      type: end-stop
      gap: 100 um
      law: {kind: consistent}
      film: {shape: ring, inner_radius: 0.65 mm, outer_radius: 0.95 mm, cut_off: 1 um}
    spring: {type: spring, stiffness: 10 N/mm, preload: 12 N}
    magnet: {type: force-over-time, time: [0 us, 1 us], force: [0 N, 35 N]}
  connections:
    - [needle.tip, seat.upper]
    - [housing.seat, seat.lower]
    - [pole.stop, opening.upper]
    - [needle.land, opening.lower]
    - [needle.top, spring.end, magnet.end]
motion: three-dimensional
guide: {surface: shaft, heights: [2 mm, 6 mm], clearance: 4 um, friction: 0.1, film: {length: 1 mm}}
placement: {seed: 3}
run: {duration: 20 us, variants: [wet, dry], check_steps: false}
"""


def spatial_valve(model: Literal["axisymmetric", "swept"]) -> ValveCase:
    """Case of bodies of revolution, or of solids whose faces rub."""
    solid = model == "swept"
    words = "model: swept\n      layers: 8" if solid else "model: axisymmetric"
    text = _SPATIAL.replace("MODEL", words).replace("FRICTION", ", friction: 0.1" if solid else "")
    return _valve(text, Path("spatial-valve.yaml"))


def _valve(text: str, path: Path) -> ValveCase:
    data, lines = parse(text, path)
    case = CaseTree(path=path, text=text, data=data, lines=lines).case({})
    assert isinstance(case, ValveCase)
    return case
