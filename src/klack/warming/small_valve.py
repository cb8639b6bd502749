"""The smallest valve that has one of everything that the time loop knows."""

from pathlib import Path

from klack.case.case_tree import CaseTree
from klack.case.reader import parse
from klack.case.valve import ValveCase

__all__ = ["small_valve"]

_TEXT = """
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
    """Read the case: rigid bodies, a fluid, a pipe, a stop with a film."""
    path = Path("small-valve.yaml")
    data, lines = parse(_TEXT, path)
    case = CaseTree(path=path, text=_TEXT, data=data, lines=lines).case({})
    assert isinstance(case, ValveCase)
    return case
