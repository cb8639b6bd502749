"""A valve whose needle is a rod: the smallest one with a mesh, for studies of geometries."""

ROD = """
klack: 1
title: A rod between two stops
materials: {steel: {young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}}
bodies:
  needle:
    geometry:
      model: axisymmetric
      profile:
        unit: mm
        parts:
          needle:
            start: [0, 0]
            edges:
              - {line: [1.5, 0], name: tip}
              - {line: [1.5, 20], name: shaft}
              - {line: [0, 20], name: top}
              - {close: true, name: axis}
    material: steel
    mesh: {size: 1 mm}
    damping: {modal: 1 %}
reduction: {modes: {needle: {count: 5}}, correction: none}
network:
  components:
    needle: {type: flexible-body, body: needle, points: [tip, top]}
    seat: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e8 N/m}}
    opening: {type: end-stop, gap: 50 um, law: {kind: linear, stiffness: 1e8 N/m}}
    spring: {type: spring, stiffness: 10 N/mm, preload: 5 N}
    magnet: {type: force-over-time, time: [10 us, 11 us, 300 us, 301 us],
             force: [0 N, 20 N, 20 N, 0 N]}
  connections:
    - [needle.tip, seat.upper]
    - [seat.lower, ground]
    - [opening.upper, ground]
    - [needle.top, opening.lower, spring.end, magnet.end]
run: {duration: 0.6 ms, step: 50 ns, variants: [dry]}
"""
