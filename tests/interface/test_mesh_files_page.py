"""The page about meshes names all endings, and its example is a valid part of a case."""

import re
from pathlib import Path

from ruamel.yaml import YAML

from klack.case.geometry import Geometry
from klack.mesh.files.catalogue import MESH_FORMATS

PAGE = (Path(__file__).parents[2] / "docs/how-to/bring-a-mesh.md").read_text()


def test_every_ending_is_in_the_table() -> None:
    assert set(re.findall(r"^\| (`\..*?) \|", PAGE, re.MULTILINE)) >= {"`.inp`", "`.msh`"}
    for ending in MESH_FORMATS:
        assert f"`{ending}`" in PAGE


def test_the_example_is_valid(tmp_path: Path) -> None:
    (text,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    bodies = YAML(typ="safe").load(text)["bodies"]
    assert len(bodies) == 2
    for body in bodies.values():
        name = body["geometry"]["mesh"]["file"]
        (tmp_path / name).write_text("x")
        geometry = Geometry.model_validate(body["geometry"], context={"folder": tmp_path})
        assert geometry.mesh is not None
        assert geometry.mesh.unit == 1e-3
