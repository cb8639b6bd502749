"""Words of faces by shape and place; truth: shapes named as they are drawn, and a full turn."""

from itertools import pairwise
from math import cos, pi, sin

import numpy as np
import pytest
from draws import each

from klack.app.face_places import profile_places, solid_places
from klack.mesh.occ import glue, revolved_solids
from klack.mesh.profile import Arc, Line, Profile


def turned(seed: int) -> Profile:
    """Outline with a ball below, a bore above that ends in a hollow cone or ball [m].

    Each edge is called by what it is, and a number.
    """
    draw = np.random.default_rng(seed).uniform
    scale = 1e-3 * 10.0 ** draw(-1, 1)
    edges: list[Line | Arc] = []

    def add(edge: type[Line] | type[Arc], r: float, z: float, word: str, *rest: tuple) -> None:
        end = r * scale, z * scale
        edges.append(edge(end, *rest, f"{word} {len(edges)}"))

    # a cap of radius 1 round (0, 0), then steps outwards, the widest one, and back
    angle = draw(0.3, 1.2)
    r, z = sin(angle), -cos(angle)
    add(Arc, r, z, "ball", (0.0, 0.0))
    for _ in range(int(draw(1, 3.99))):
        z += draw(0.3, 2)
        add(Line, r, z, "shaft")
        wider = r + draw(0.2, 1)
        if draw() < 0.5:
            add(Line, wider, z, "shoulder")
        else:
            z += draw(0.05, 1)
            add(Line, wider, z, "cone")
        r = wider
    z += draw(0.3, 2)
    add(Line, r, z, "outside")
    edge = draw(0.1, 0.2)  # rounded
    add(Arc, r - edge, z + edge, "curved", ((r - edge) * scale, z * scale))
    z += edge
    inner = draw(0.2, 0.5) * r
    add(Line, inner, z, "top")
    depth = draw(0.1, 0.5)
    add(Line, inner, z - depth, "bore")
    if draw() < 0.5:
        add(Line, 0.0, z - depth - draw(0.05, 0.5) * inner, "hollow cone")
    else:
        add(Arc, 0.0, z - depth - inner, "hollow ball", (0.0, (z - depth) * scale))
    return Profile((0.0, -scale), (*edges, Line((0.0, -scale), "axis")))


def named(word: str) -> str:
    return word.rstrip("0123456789 ")


@pytest.mark.slow
@each("seed", range(40))
def test_a_turned_part_is_called_alike_as_half_section_and_as_solid(seed):
    profile = turned(seed)
    (solid,) = revolved_solids({"part": profile})
    expected = {name: named(name) for name in profile.names}

    assert profile_places({"part": profile}) == expected
    assert solid_places(solid) == expected


def directions(draw) -> np.ndarray:
    """A direction at least 20 degrees off the z axis and off its plane."""
    angle, height = draw(0, 2 * pi), draw(0.35, 1.2)
    return np.array([cos(angle) * cos(height), sin(angle) * cos(height), sin(height)])


def block(seed: int) -> object:
    """Hexagon with bores beside one another, along z and oblique, one of them with a drilled tip.

    It is turned round z by any angle, and moved.
    """
    from netgen.occ import Axes, Axis, Box, Cone, Cylinder, Dir, Pnt, Vec, WorkPlane, X, Z, gp_Ax2

    draw = np.random.default_rng(seed).uniform
    corners = [(20 * cos(k * pi / 3), 20 * sin(k * pi / 3)) for k in range(6)]
    plane = WorkPlane(Axes((0, 0, 0), n=Z, h=X)).MoveTo(*corners[0])
    for corner in corners[1:]:
        plane = plane.LineTo(*corner)
    part = plane.Close().Face().Extrude(12 * Z)
    part.faces.name = "outside"
    part.faces.Min(Z).name, part.faces.Max(Z).name = "bottom", "top"
    first = draw(0, 2 * pi)
    for number, angle in enumerate(first + np.arange(3) * 2 * pi / 3):
        place = 10 * cos(angle), 10 * sin(angle)
        radius, depth = draw(0.3, 2), draw(2, 7)
        drill = Cylinder(Pnt(*place, depth), Z, r=radius, h=20)
        drill.faces.name = f"bore {number}"
        if number:
            drill.faces.Min(Z).name = f"shoulder {number}"
        else:
            axes = gp_Ax2(Pnt(*place, depth), Dir(0, 0, -1))
            tip = Cone(axes, radius, 0, draw(0.2, 1.5), 2 * pi)
            tip.faces.name = "hollow cone"
            drill = drill + tip
        part = part - drill
    along = directions(draw)
    drill = Cylinder(Pnt(*(np.array([0, 0, 6]) - 40 * along)), Dir(*along), r=draw(0.3, 1), h=80)
    drill.faces.name = "cross bore"
    part = part - drill
    slot = Box(Pnt(-3, -3, 11), Pnt(3, 3, 13))
    slot.faces.name = "flat"
    slot.faces.Min(Z).name = "shoulder 9"
    slot = slot.MakeFillet([e for e in slot.edges if abs(e.start.z - e.end.z) > 1], draw(0.2, 1))
    for face in slot.faces:
        if face.name not in ("flat", "shoulder 9"):
            face.name = "hollow round"
    return (part - slot).Rotate(Axis((0, 0, 0), Z), draw(0, 360)).Move(Vec(*draw(-50, 50, 3)))


@pytest.mark.slow
@each("seed", range(12))
def test_each_bore_of_a_block_is_one_wherever_it_points(seed):
    found = solid_places(block(seed))

    assert len(found) > 8
    assert found == {name: named(name) for name in found}


def test_a_part_turned_about_another_axis_keeps_its_shapes():
    """A cone, a ball and a bore across the axis; no cylinder along it."""
    from netgen.occ import Axis, X

    (solid,) = revolved_solids({"part": turned(3)})
    found = solid_places(solid.Rotate(Axis((0, 0, 0), X), 90))

    kinds = {(named(name), word) for name, word in found.items()}
    same = {"cone", "ball", "hollow cone", "hollow ball", "curved"}
    other = {"bore": "cross bore", "shaft": "round", "outside": "round", "top": "outside"}
    other |= {"shoulder": "flat"}
    assert kinds == {(kind, kind if kind in same else other[kind]) for kind, _ in kinds}


def test_a_face_between_two_solids_is_called_from_both():
    sleeve = Profile(
        (1e-3, 0.0),
        (
            Line((2e-3, 0.0), "foot"),
            Line((2e-3, 1e-3), "rim"),
            Line((1e-3, 1e-3), "head"),
            Line((1e-3, 0.0), "fit"),
        ),
    )
    pin = Profile(
        (0.0, -1e-3),
        (
            Line((1e-3, -1e-3), "low"),
            Line((1e-3, 2e-3), "fit"),
            Line((0.0, 2e-3), "top"),
            Line((0.0, -1e-3)),
        ),
    )
    profiles = {"pin": pin, "sleeve": sleeve}
    expected = {"low": "bottom", "top": "top", "foot": "shoulder", "head": "shoulder"}
    expected |= {"rim": "outside", "fit": "bore and shaft"}

    assert profile_places(profiles) == expected
    assert solid_places(glue(revolved_solids(profiles))) == expected


@pytest.mark.parametrize("degrees", [90, 60])
def test_a_rounded_edge_is_no_shaft_and_the_wall_beside_it_is_outside(degrees):
    """A prism with rounded edges: nothing lies beyond its sides and edges."""
    from netgen.occ import Axes, WorkPlane, X, Z

    plane = WorkPlane(Axes((0, 0, 0), n=Z, h=X))
    for _ in range(360 // degrees):
        plane = plane.Line(4).Rotate(degrees)
    prism = plane.Face().Extrude(5 * Z)
    found = solid_places(prism.MakeFillet([e for e in prism.edges if e.start.z != e.end.z], 1))
    assert sorted(found.values()).count("outside") >= 360 // degrees
    assert set(found.values()) == {"bottom", "top", "outside"}
    bottom = [e for e in prism.edges if e.start.z == e.end.z == 0.0]
    assert "round" in solid_places(prism.MakeFillet(bottom, 0.5)).values()
    assert all(a != b for a, b in pairwise(sorted(found)))


def test_a_wall_with_a_nose_stays_outside_and_rounded_edges_of_a_boss_are_no_shafts():
    from netgen.occ import Box, Cylinder, Pnt, Z

    wall = Cylinder(Pnt(0, 0, 0), Z, r=5, h=4) + Box(Pnt(0, -1, 1), Pnt(8, 1, 3))
    assert sorted(solid_places(wall).values()) == sorted(
        ["bottom", "top", "outside", "outside", "shoulder", "shoulder", "flat", "flat"]
    )
    boss = Box(Pnt(-2, -2, 4), Pnt(2, 2, 6))
    boss.faces.name = "flat"
    boss = boss.MakeFillet([e for e in boss.edges if abs(e.start.z - e.end.z) > 1], 0.5)
    for face in boss.faces:
        face.name = face.name if face.name == "flat" else "round"
    found = solid_places(wall + boss)
    assert (found["round"], found["flat"]) == ("round", "flat and top")
