"""Sizes that a case asks for and no mesher can do: the message names the key, and a size that does.

Truth: the mesher itself, asked with the size of the hint.
"""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest

from klack import memory
from klack.assembling.bodies import mesh_body, place_meshes
from klack.assembling.generated_mesh import coarsest_sound, meshed_for_case
from klack.assembling.valve import mesh_valve_bodies
from klack.case import find_case, load_case
from klack.case.any_case import load_any_case
from klack.case.reader import read_case
from klack.errors import InputError
from klack.mesh.meridian import mesh_meridian
from klack.mesh.mesh import Mesh
from klack.mesh.profile import Line, Profile
from klack.mesh.quality import PoorElementError
from klack.mesh.sizing import MeshSizing, Refinement
from klack.mesh.solid import mesh_step, write_step_revolved
from klack.progress import silent
from klack.units import LENGTH, parse_quantity

RODS = (Path(__file__).parents[1] / "data" / "tiny_rods.yaml").read_text(encoding="utf-8")
PIN = Profile((0, 0), (Line((1e-3, 0)), Line((1e-3, 4e-3)), Line((0, 4e-3)), Line((0, 0))))


def needs(limit: float):
    """Mesher that fails, as netgen does at a round face, above a size."""

    def mesher(sizing: MeshSizing) -> Mesh:
        if sizing.size > limit:
            error = PoorElementError(
                "mesh_step: pin.step: element 7 (tet10)", got="-0.1", expected="above 0", hint="-"
            )
            error.elements = 200
            raise error
        return mesh_meridian({"pin": PIN}, sizing)

    return mesher


def test_a_size_that_is_too_coarse_is_named_with_one_that_does():
    """Of 2 mm the shares 0.7 and 0.5 are tried; 1.2 mm is the limit."""
    mesher = needs(1.2e-3)
    with pytest.raises(InputError) as caught:
        meshed_for_case("pin", MeshSizing(size=2e-3), mesher)

    text = str(caught.value)
    assert text.startswith("bodies.pin.mesh.size: mesh_step: pin.step: element 7 (tet10): got 2 mm")
    found = re.search(r"bodies\.pin\.mesh\.size: (\S+ \S+) \(tried", caught.value.hint)
    assert found is not None
    size = parse_quantity(found[1], LENGTH, "size")
    assert size == pytest.approx(1e-3, rel=1e-12)
    mesher(MeshSizing(size=size))


@pytest.mark.slow
def test_a_thin_walled_tube_of_a_step_file(tmp_path: Path):
    """Wall of 0.2 mm, radius 3 mm: curved elements of 1 mm turn inside out."""
    tube = Profile(
        (2.8e-3, 0), (Line((3e-3, 0)), Line((3e-3, 5e-3)), Line((2.8e-3, 5e-3)), Line((2.8e-3, 0)))
    )
    write_step_revolved({"tube": tube}, tmp_path / "tube.step")

    def mesher(sizing: MeshSizing) -> Mesh:
        return mesh_step(tmp_path / "tube.step", sizing)

    with pytest.raises(InputError) as caught:
        meshed_for_case("tube", MeshSizing(size=2e-3), mesher)

    assert caught.value.where.startswith("bodies.tube.mesh.size: mesh_step: ")
    found = re.search(r"bodies\.tube\.mesh\.size: (\S+ \S+) \(tried", caught.value.hint)
    assert found is not None, caught.value.hint
    assert parse_quantity(found[1], LENGTH, "size") < 1.5e-3


def test_what_is_called_tried_had_the_refinements_of_the_run():
    """A size that changes where the bodies touch: the refinement there needs still smaller ones.

    Without its refinement the first finer size, 1.4 mm, does.
    """
    tried: list[MeshSizing] = []

    def at_size(size: float) -> MeshSizing:
        return MeshSizing(size=size, refinements=(Refinement(position=(1e-3, size), size=1e-4),))

    def mesher(sizing: MeshSizing) -> Mesh:
        tried.append(sizing)
        return needs(0.8e-3 if sizing.refinements else 1.5e-3)(replace(sizing, refinements=()))

    with pytest.raises(InputError) as caught:
        meshed_for_case("pin", at_size(2e-3), mesher, at_size)

    assert "bodies.pin.mesh.size: 700 um (tried, it does)" in caught.value.hint
    assert tried[-1] == at_size(0.7e-3)


def test_a_valve_has_the_places_of_its_stops_at_every_size(monkeypatch):
    """Drawn bodies touch where their drawing says, whatever the size of their elements."""
    seen = {}

    def no_mesh(body, name, places=None, places_at=None):
        seen[name] = places, places_at(2.0 * body.mesh.size)

    monkeypatch.setattr("klack.assembling.valve.mesh_body", no_mesh)
    mesh_valve_bodies(load_any_case(find_case("demo-stroke")), silent)

    assert seen
    for places, again in seen.values():
        assert len(places) > 0
        assert again == places


def test_a_first_mesh_is_as_coarse_as_its_elements_allow():
    """Of 2 mm the shares 0.7 and 0.5 are tried; 1.2 mm is the limit."""
    mesh = coarsest_sound(MeshSizing(size=2e-3), needs(1.2e-3))
    same = mesh_meridian({"pin": PIN}, MeshSizing(size=1e-3))
    assert (mesh.points == same.points).all()
    with pytest.raises(PoorElementError):
        coarsest_sound(MeshSizing(size=2e-3), needs(0.01e-3))


def test_faces_that_do_not_meet_are_told_with_place_and_bodies():
    """A face of radius 0 to 2 mm, and one that begins at 3 mm."""
    text = RODS.replace(
        "mesh: {size: 1 mm}", "mesh: {size: 1 mm, contact: {size: 50 um, extent: 50 um}}"
    )
    text = text.replace("start: [0, -40]", "start: [3, -40]")
    text = text.replace("line: [2, -40]", "line: [5, -40]").replace(
        "line: [2, 0], name: side", "line: [5, 0], name: side"
    )
    text = text.replace("line: [0, 0], name: end", "line: [3, 0], name: end").replace(
        "name: axis", "name: bore"
    )
    with pytest.raises(InputError) as caught:
        place_meshes(read_case(text, Path("rods.yaml")), silent)

    assert str(caught.value).startswith(
        "rods.yaml:37: contact.between: short.end on long.end: got radii 0 to 2 mm over 3 to 5 mm"
    )


def test_without_a_size_that_does_the_hint_says_what_to_look_at():
    with pytest.raises(InputError) as caught:
        meshed_for_case("pin", MeshSizing(size=2e-3), needs(0.05e-3))
    assert "below the radius of the smallest round face" in caught.value.hint
    assert "bodies.pin.mesh.grading below 0.3" in caught.value.hint


@pytest.mark.parametrize("setting", ["size", "contact.size"])
def test_too_many_elements_are_refused_by_the_key_of_the_case(setting, monkeypatch):
    monkeypatch.setattr(memory, "_WORTH_A_LOOK", 0.0)
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=50e3))
    monkeypatch.setenv("KLACK_CACHE", "off")
    body = load_case(find_case("demo-valve-axisymmetric")).bodies["needle"]
    places = ((0.4e-3, -0.4e-3),) if setting == "contact.size" else ()

    with pytest.raises(InputError) as caught:
        mesh_body(body, "needle", places)

    # the finest of the two makes the most elements
    assert caught.value.where == f"bodies.needle.mesh.{setting}"
    assert f"a bodies.needle.mesh.{setting} of" in caught.value.hint
