"""``klack show``: truth = the network of the case, and the exit codes and files it promises."""

import json
import re
from base64 import b64decode
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from json_schema_check import require_documented

from klack.case.any_case import load_any_case, load_valve_case
from klack.case.reader import find_case
from klack.cli.main import main
from klack.mesh.solid import write_step_revolved
from klack.network.catalogue import type_words
from klack.report.wording import spelled
from klack.viewer.source import view_of_source

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
VALVE = HOW_TO / "small_valve.yaml"


def components_in(file: Path) -> list[str]:
    root = ElementTree.parse(file).getroot()
    return sorted(item.get("data-name") for item in root.iter() if item.get("data-name"))


def test_it_draws_the_schematic_of_a_case(tmp_path, capsys):
    assert main(["show", str(VALVE), "--out", "small_valve.svg"]) == 0

    said = capsys.readouterr()
    network = load_valve_case(VALVE).network.network()
    assert [path.name for path in tmp_path.iterdir()] == ["small_valve.svg"]
    assert components_in(tmp_path / "small_valve.svg") == sorted(network.components)
    assert said.out.split() == "8 components, 6 connections. Picture: small_valve.svg".split()
    assert said.err == ""


def test_a_shipped_case_and_a_file_of_any_name(tmp_path, capsys):
    assert main(["show", "stairs", "--out", "Valve.SVG", "-q"]) == 0

    assert [path.name for path in tmp_path.iterdir()] == ["Valve.SVG"]
    assert capsys.readouterr().out == ""


RODS = Path(__file__).parents[1] / "data" / "tiny_rods.yaml"
NEEDLE = Path(__file__).parents[2] / "cases" / "needle-from-inp" / "needle.inp"


def payload_of(file: Path) -> dict:
    page = file.read_text(encoding="utf-8")
    found = re.search(r'<script type="application/json" id="payload">(.*?)</script>', page, re.S)
    assert found is not None
    return json.loads(found[1])


def test_a_page_of_a_case_goes_into_the_current_folder(tmp_path, capsys):
    assert main(["show", str(RODS)]) == 0

    assert [path.name for path in tmp_path.iterdir()] == ["tiny_rods.html"]
    payload = payload_of(tmp_path / "tiny_rods.html")
    assert [body["name"] for body in payload["bodies"]] == ["short", "long"]
    assert payload["contacts"][0]["upper"] == "short.end"
    said = capsys.readouterr()
    assert "2 bodies, 1 contact." in said.out
    assert "Page: tiny_rods.html" in said.out


def test_its_page_says_what_inspect_says(tmp_path, capsys):
    assert main(["show", str(RODS), "-q"]) == 0
    assert main(["inspect", str(RODS), "-q", "--json", "told.json"]) == 0

    payload = payload_of(tmp_path / "tiny_rods.html")
    told = json.loads((tmp_path / "told.json").read_text())["parts"]
    for title, rows in [(body["name"], body["rows"]) for body in payload["bodies"]] + [
        (f"case: {part['title']}", part["rows"]) for part in payload["facts"]
    ]:
        assert rows == [
            [row["what"], row["name"], spelled(row["content"])] for row in told.pop(title)
        ]
    assert told == {}
    for body in payload["bodies"]:  # a rod of one density: halfway
        heights = unpacked(body["points"])[:, 2]
        assert body["centre"][2] == pytest.approx(0.5 * (heights.min() + heights.max()), abs=1e-6)


def unpacked(packed: dict) -> np.ndarray:
    return np.frombuffer(b64decode(packed["data"]), "<f4").reshape(packed["shape"])


def test_a_valve_without_shapes_is_its_network(tmp_path, capsys):
    assert main(["show", str(VALVE), "--out", "valve.html", "--json", "numbers.json", "-q"]) == 0

    payload = payload_of(tmp_path / "valve.html")
    assert payload["bodies"] == []
    assert payload["schematic"].startswith("<svg")
    assert any("only its network" in note for note in payload["notes"])
    numbers = json.loads((tmp_path / "numbers.json").read_text())
    require_documented(numbers)
    assert numbers["bodies"] == {}
    assert numbers["components"]["spring"] == "spring"


def test_a_mesh_is_drawn_with_its_names(tmp_path, capsys):
    assert main(["show", str(NEEDLE), "--unit", "mm", "--json", "-"]) == 0

    numbers = json.loads(capsys.readouterr().out)
    require_documented(numbers)
    assert "tip" in numbers["bodies"]["needle"]
    assert numbers["components"] == {}
    assert (tmp_path / "needle.html").is_file()


@pytest.mark.slow
def test_a_result_has_modes_and_motion(tmp_path, capsys):
    assert main(["impact", str(RODS), "--no-report", "--no-certify", "-q", "--out", "result"]) == 0

    assert main(["show", "result"]) == 0

    payload = payload_of(tmp_path / "result.html")
    assert [len([f for f in b["motion"]["frequency"] if f]) for b in payload["bodies"]] == [5, 8]
    frames = payload["time"]["shape"][0]
    assert frames > 50
    assert payload["bodies"][0]["motion"]["amplitude"]["shape"][0] == frames
    assert payload["histories"][0]["name"] == "contact force"
    assert "13 modes" in capsys.readouterr().out


def test_a_result_whose_case_names_a_file_elsewhere_is_shown_with_a_note(tmp_path, capsys):
    case = tmp_path / "elsewhere" / "magnet.yaml"
    case.parent.mkdir()
    for name in ("magnet_from_a_map.yaml", "magnet_map.csv"):
        text = (HOW_TO / name).read_text(encoding="utf-8")
        (case if name.endswith("yaml") else case.parent / name).write_text(text, encoding="utf-8")
    words = ["--duration", "50 us", "--no-report", "-q", "--out", "result"]
    assert main(["stroke", str(case), *words]) == 0

    assert main(["show", "result"]) == 0
    assert main(["show", "result", "--out", "network.svg"]) == 0

    payload = payload_of(tmp_path / "result.html")
    assert "magnet_map.csv" in " ".join(payload["notes"])
    assert payload["histories"][0]["name"] == "lift"
    assert (tmp_path / "network.svg").read_text() == payload["schematic"]
    assert "coil" in payload["schematic"]


def test_its_json_has_every_connection(capsys):
    assert main(["show", str(VALVE), "--out", "valve.svg", "--json", "-"]) == 0

    found = json.loads(capsys.readouterr().out)
    require_documented(found)
    assert found["components"]["spring"] == "spring"
    assert {"domain": "hydraulic", "ports": ["bores.b"], "fixed": "ambient"} in found["nodes"]
    assert len(found["nodes"]) == 6


def test_a_picture_is_replaced_by_the_new_one(tmp_path):
    file = tmp_path / "valve.svg"
    file.write_text("an older one")

    assert main(["show", str(VALVE), "--out", str(file)]) == 0

    assert components_in(file)


def test_a_file_that_cannot_be_written_is_one_error_and_no_file(tmp_path, capsys, monkeypatch):
    def full(*_: object, **__: object) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)

    assert main(["show", str(VALVE), "--out", "valve.svg"]) == 2

    assert "No space left" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["demo-valve", "--out", "a.svg"], "a case of an impact, expected a case of a whole valve"),
        (["from-other-tools"], "reduced models, or nodes without elements, expected bodies with"),
        ([str(RODS), "--unit", "mm"], "a unit for"),
        ([str(NEEDLE)], "no unit"),
        (["missing.yaml"], "neither a file nor a shipped case"),
        ([str(VALVE), "--out", "valve.png"], "the extension '.png', expected .html or .svg"),
        ([str(VALVE), "--out", "valve"], "a name without an extension, expected .html or .svg"),
        ([str(VALVE), "--out", "nowhere/valve.svg"], "a folder that does not exist"),
        ([str(VALVE), "--out", "folder.svg"], "a folder, expected the name of a file"),
        ([], "SOURCE: got nothing, expected a case, a mesh or the folder of a result, or"),
        ([str(VALVE), "--components"], "it beside --components"),
        (["--components", "--out", "valve.svg"], "it beside --components"),
    ],
)
def test_bad_input_is_one_error_and_no_file(words, said, tmp_path, capsys):
    (tmp_path / "folder.svg").mkdir()

    assert main(["show", *words]) == 2

    shown = capsys.readouterr()
    assert said in shown.err
    assert shown.err.startswith("klack show: ")
    assert shown.err.count("Try: ") == 1
    assert shown.out == ""
    assert [path.name for path in tmp_path.iterdir()] == ["folder.svg"]


def test_a_wrong_connection_is_the_error_of_the_reader(tmp_path, capsys):
    case = tmp_path / "case.yaml"
    case.write_text(VALVE.read_text().replace("[seat.lower, ground]", "[seat.lowest, ground]"))

    assert main(["show", str(case)]) == 2

    assert "'seat' has no port 'lowest'" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["case.yaml"]


def test_an_own_component_is_drawn_where_it_is_let_in(tmp_path, capsys, monkeypatch):
    monkeypatch.syspath_prepend(HOW_TO)
    case = tmp_path / "case.yaml"
    brake = '    brake: {type: "eddy_brake:EddyBrake", damping: 2 N*s/m, critical_speed: 0.5 m/s}\n'
    text = VALVE.read_text().replace("  connections:\n", f"{brake}  connections:\n")
    case.write_text(text.replace("[needle.top, ", "[needle.top, brake.disc, "))

    assert main(["show", str(case)]) == 2
    assert "--component eddy_brake:EddyBrake" in capsys.readouterr().err
    assert main(["show", str(case), "--out", "a.svg", "--component", "eddy_brake:EddyBrake"]) == 0

    picture = (tmp_path / f"{load_name(tmp_path)}.svg").read_text(encoding="utf-8")
    assert "own: eddy-brake" in picture
    assert "damping 2 N·s/m" in picture


def load_name(folder: Path) -> str:
    (picture,) = folder.glob("*.svg")
    return picture.stem


def test_it_lists_every_component_type(tmp_path, capsys):
    assert main(["show", "--components", "--json", "types.json"]) == 0

    said = capsys.readouterr().out
    found = json.loads((tmp_path / "types.json").read_text(encoding="utf-8"))
    require_documented(found)
    assert list(found["types"]) == list(type_words())
    assert all(f" {word} " in said for word in type_words())
    spring = found["types"]["spring"]
    assert spring["ports"]["base"] == {"domain": "mechanical", "optional": True}
    assert spring["keys"]["stiffness"]["unit"] == "N/m"
    assert spring["keys"]["stiffness"]["required"]
    assert not spring["keys"]["damping"]["required"]
    assert found["types"]["chamber"]["source"] == "Merritt 1967, sec. 3-8"
    assert found["types"]["orifice"]["source"] == "Nurick 1976; Sampson 1891; Wuest 1954"
    assert found["types"]["gravity"]["equation"] == r"F = -m g \cos\vartheta"
    assert "F = -m g cos θ" in said
    assert not [path for path in tmp_path.iterdir() if path.suffix == ".svg"]


def test_an_own_type_is_listed_last(capsys, monkeypatch):
    monkeypatch.syspath_prepend(HOW_TO)
    words = ["--components", "--component", "eddy_brake:EddyBrake", "--json", "-"]

    assert main(["show", *words]) == 0

    *_, (word, last) = json.loads(capsys.readouterr().out)["types"].items()
    assert word == "eddy_brake:EddyBrake"
    assert set(last["keys"]) == {"damping", "critical_speed"}


@pytest.mark.slow
def test_a_turned_step_file_is_drawn_from_its_half_section(tmp_path):
    """The solid of this needle has 7000 nodes in a mesh as coarse; a box has no half section."""
    occ = pytest.importorskip("netgen.occ")
    bodies = load_any_case(find_case("demo-valve-axisymmetric")).bodies
    profile = next(iter(bodies["needle"].geometry.profile.profiles().values()))
    write_step_revolved({"needle": profile}, tmp_path / "needle.step")
    occ.Box(occ.Pnt(0, 0, 0), occ.Pnt(4, 3, 6)).WriteStep(str(tmp_path / "box.step"))
    turned, box = (view_of_source(tmp_path / f"{name}.step") for name in ("needle", "box"))

    assert int(turned.bodies[0].about.split()[0]) < 1000
    assert turned.notes[0].startswith("A turned part")
    assert not box.notes[0].startswith("A turned part")
