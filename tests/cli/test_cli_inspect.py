"""klack inspect through main(argv); truth: the drawing of the shipped needle."""

import json
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
import scipy.io
from c_compiler import needs_compiler
from scipy.sparse import coo_array

from klack.case import find_case
from klack.cli.main import main
from klack.exchange.fmu.build import build_fmu
from klack.exchange.modal_model import Provenance, body_model
from klack.mesh.profile import Line, Profile
from klack.mesh.solid import write_step_revolved
from klack.simulation.bodies import rod_body

NEEDLE = find_case("needle-from-inp").parent / "needle.inp"


def test_a_mesh_shows_its_sets_and_where_they_lie(capsys):
    assert main(["inspect", str(NEEDLE), "--unit", "mm"]) == 0

    shown = " ".join(capsys.readouterr().out.split())
    assert "7670 nodes, 4741 elements" in shown
    assert "extent z 0 to 24 mm" in shown  # length of the drawn needle
    assert "surface top 82 faces, z 24 mm, r" in shown
    assert "note files of this format have no end mark: compare the counts" in shown


CASE = """\
klack: 1
title: Pin on a block
materials: {steel: {young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}}
bodies:
  pin:
    geometry: {step: {file: pin.step}}
    material: steel
    mesh: {size: 1 mm}
  block:
    geometry: {step: {file: pin.step}}
    material: steel
    mesh: {size: 1 mm}
    fixed: [{surface: foot}]
contact: {between: [pin.foot, block.head], gap: 0 um}
motion: {speed: 1 m/s}
run: {duration: 10 us}
"""


@pytest.mark.slow
def test_a_step_file_shows_its_faces_alone_and_in_a_case(tmp_path: Path, capsys):
    """Truth: areas and volume of the drawn cylinder."""
    pin = Profile(
        (0.0, 0.0),
        (
            Line((1e-3, 0.0), "foot"),
            Line((1e-3, 5e-3), "side"),
            Line((0.0, 5e-3), "head"),
            Line((0.0, 0.0)),
        ),
    )
    write_step_revolved({"pin": pin}, tmp_path / "pin.step")
    (tmp_path / "nameless.step").write_text(
        (tmp_path / "pin.step").read_text().replace("ADVANCED_FACE('head'", "ADVANCED_FACE(''")
    )
    (tmp_path / "case.yaml").write_text(CASE)

    assert main(["inspect", str(tmp_path / "pin.step")]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "solid pin 15.708 mm^3" in shown  # pi 1^2 5
    assert "surface head 3.1416 mm^2, x -1 to 1 mm, y -1 to 1 mm, z 5 mm" in shown
    assert "note" not in shown

    assert main(["inspect", str(tmp_path / "nameless.step")]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "3.1416 mm^2, x -1 to 1 mm, y -1 to 1 mm, z 5 mm" in shown
    assert "1 face without a name" in shown

    assert main(["inspect", str(tmp_path / "case.yaml")]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert shown.count("surface side 31.416 mm^2") == 2


def pin_case(folder: Path, text: str) -> Path:
    pin = Profile(
        (0.0, 0.0),
        (
            Line((1e-3, 0.0), "foot"),
            Line((1e-3, 5e-3), "side"),
            Line((0.0, 5e-3), "head"),
            Line((0.0, 0.0)),
        ),
    )
    write_step_revolved({"pin": pin}, folder / "pin.step")
    (folder / "case.yaml").write_text(text)
    return folder / "case.yaml"


@pytest.mark.parametrize(
    ("right", "wrong", "where", "got", "hint"),
    [
        ("block.head]", "block.haed]", "14: contact.between[1]", "'haed' of block", "'head'"),
        ("surface: foot", "surface: foof", "13: bodies.block.fixed[0].surface", "'foof'", "'foot'"),
        (
            "    fixed:",
            "    mesh: {size: 1 mm, surfaces: {sides: 1 mm}}\n    fixed:",
            "12: bodies.block.mesh.surfaces.sides",
            "'sides'",
            "'side'",
        ),
    ],
    ids=["contact", "support", "size"],
)
def test_a_wrong_name_of_a_face_is_told_with_its_key(
    right, wrong, where, got, hint, tmp_path: Path, capsys, monkeypatch
):
    """By klack inspect, and by klack impact before it meshes anything."""
    monkeypatch.setenv("KLACK_CACHE", "off")
    text = CASE
    if "mesh" in wrong:  # the second body has its sizes there
        text = text[: text.rindex("    mesh: {size: 1 mm}\n")] + text[text.rindex("    fixed:") :]
        where = where.replace("14", "13")
    path = pin_case(tmp_path, text.replace(right, wrong))

    def never(*args: object) -> None:
        raise AssertionError("meshed")

    monkeypatch.setattr("klack.assembling.generated_mesh.mesh_step", never)
    for command in (["inspect", str(path)], ["impact", str(path), "--out", str(tmp_path / "o")]):
        assert main(command) == 2
        told = capsys.readouterr().err
        for words in (
            f"case.yaml:{where}: got the unknown surface {got}",
            "expected one of: ",
            f"did you mean {hint}?",
        ):
            assert words in told


def test_a_wrong_name_in_a_mesh_is_told_by_inspect(tmp_path: Path, capsys):
    text = find_case("needle-from-inp").read_text()
    assert "needle.tip" in text
    for file in find_case("needle-from-inp").parent.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    (tmp_path / "case.yaml").write_text(text.replace("needle.tip", "needle.top_"))

    assert main(["inspect", str(tmp_path / "case.yaml")]) == 2
    told = capsys.readouterr().err
    assert "contact.between[0]: got the unknown surface 'top_' of needle" in told
    assert "did you mean 'top'?" in told


def test_a_unit_beside_a_step_file_is_refused(tmp_path: Path, capsys):
    """The file says its unit; another one on the command line would be passed over."""
    pin = tmp_path / "pin.step"
    pin.write_text("ISO-10303-21;")

    assert main(["inspect", str(pin), "--unit", "inch"]) == 2
    assert "--unit: got 'inch' for a STEP file, which has its own unit" in capsys.readouterr().err


def test_a_mesh_without_unit_is_refused(capsys):
    assert main(["inspect", str(NEEDLE)]) == 2
    assert "unit" in capsys.readouterr().err


def test_other_files_are_refused_with_what_is_read(tmp_path: Path, capsys):
    (tmp_path / "notes.txt").write_text("hello")

    assert main(["inspect", str(tmp_path / "notes.txt")]) == 2
    assert ".inp" in capsys.readouterr().err


def test_a_matrix_shows_its_size_and_what_its_rows_are(tmp_path: Path, capsys):
    scipy.io.mmwrite(tmp_path / "k.mtx", coo_array(np.diag([1.0, 2.0, 3.0])))

    assert main(["inspect", str(tmp_path / "k.mtx")]) == 0

    shown = capsys.readouterr().out
    assert "3 rows, 3 entries" in shown
    assert "dofs" in shown


def test_one_of_several_matrices(tmp_path: Path, capsys):
    scipy.io.savemat(tmp_path / "two.mat", {"A": np.eye(3), "B": 2 * np.eye(3)})

    assert main(["inspect", str(tmp_path / "two.mat")]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "matrix A 3 rows" in shown
    assert "matrix B 3 rows" in shown
    assert main(["inspect", str(tmp_path / "two.mat"), "--matrix", "C"]) == 2
    assert "'A', 'B'" in capsys.readouterr().err
    assert main(["inspect", str(tmp_path / "two.mat"), "--matrix", "B"]) == 0
    assert "2 to 2" in capsys.readouterr().out


@pytest.mark.slow
def test_both_matrices_of_ansys(capsys):
    """Truth: the example of a package that reads such files, of solids in three directions."""
    package = pytest.importorskip("ansys.mapdl.reader")
    assert main(["inspect", str(Path(package.__file__).parent / "examples" / "file.full")]) == 0

    shown = " ".join(capsys.readouterr().out.split())
    assert "matrix K" in shown
    assert "matrix M" in shown
    assert shown.count("directions x, y, z") == 2


def test_a_matrix_that_cannot_be_used_is_shown_beside_the_others(tmp_path: Path, capsys):
    skew = np.array([[1.0, 2.0], [1.0, 1.0]])
    scipy.io.savemat(tmp_path / "two.mat", {"A": np.eye(2), "B": skew})

    assert main(["inspect", str(tmp_path / "two.mat")]) == 0

    shown = " ".join(capsys.readouterr().out.split())
    assert "matrix A 2 rows" in shown
    assert "matrix B not usable" in shown


def test_an_fmu_for_model_exchange_shows_what_it_is(spring_damper_fmu, tmp_path: Path, capsys):
    path = tmp_path / "model.fmu"
    with ZipFile(spring_damper_fmu()) as old, ZipFile(path, "w") as new:
        for name in old.namelist():
            new.writestr(name, old.read(name).replace(b"<CoSimulation", b"<ModelExchange"))

    assert main(["inspect", str(path)]) == 0

    shown = " ".join(capsys.readouterr().out.split())
    for words in (
        "FMU spring_damper model exchange only: klack cannot run it, FMI 2.0",
        "input x m",
        "output F N",
    ):
        assert words in shown


@pytest.mark.slow
@needs_compiler
def test_an_fmu_shows_its_inputs_and_outputs(tmp_path: Path, capsys):
    pytest.importorskip("fmpy")
    rod = rod_body("rod", length=0.03, area=1e-5, young=2.1e11, density=7850.0, elastic_modes=3)
    made = Provenance(case="rod", title="Rod", version="1", created="2026-01-01T00:00:00")
    build_fmu(body_model(rod, provenance=made, step=1e-8), tmp_path / "rod.fmu", fmi=2)

    assert main(["inspect", str(tmp_path / "rod.fmu")]) == 0

    shown = " ".join(capsys.readouterr().out.split())
    assert "input force_top N" in shown
    assert "output displacement_bottom m" in shown


def test_a_case_shows_the_bodies_of_other_programs(capsys):
    assert main(["inspect", "from-other-tools"]) == 0

    shown = " ".join(capsys.readouterr().out.split())
    assert "mass 3.94584 g" in shown  # as that case says, and as the drawn rod weighs
    assert "port tip elastic compliance" in shown


def bricks_case(folder: Path) -> Path:
    """Two unit bricks, written by hand."""
    brick = "*NODE\n" + "".join(
        f"{8 * k + i + 1}, {x}, {y}, {3 * k + z}\n"
        for k in range(2)
        for i, (x, y, z) in enumerate(
            (x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))
        )
    )
    for k, name in enumerate(("LOWER", "UPPER")):
        numbers = ", ".join(str(8 * k + i + 1) for i in range(8))
        brick += f"*ELEMENT, TYPE=C3D8, ELSET={name}\n{k + 1}, {numbers}\n"
        brick += f"*SURFACE, NAME=END_{name}, TYPE=ELEMENT\n{k + 1}, S{2 - k}\n"
    brick += "*NSET, NSET=FEET\n1, 2, 3, 4\n"
    (folder / "bricks.inp").write_text(brick)
    body = "geometry: {{mesh: {{file: bricks.inp, unit: mm}}}}\n    material: {{{}: steel}}\n"
    case = CASE[: CASE.index("bodies:")] + "bodies:\n"
    case += "  pin:\n    " + body.format("UPPER")
    case += "  block:\n    " + body.format("LOWER") + "    fixed: [{surface: END_LOWER}]\n"
    case += CASE[CASE.index("contact:") :].replace("pin.foot", "pin.END_UPPER")
    path = folder / "case.yaml"
    path.write_text(case.replace("block.head", "block.END_LOWER"))
    return path


def test_a_case_shows_of_a_file_only_the_solids_that_a_body_takes(tmp_path: Path, capsys):
    assert main(["inspect", str(bricks_case(tmp_path))]) == 0
    told, impact = " ".join(capsys.readouterr().out.split()).split("case: impact")
    assert "contact pin.END_UPPER on block.END_LOWER: gap 0 um, starts with 1 m/s" in impact
    pin, block = told.split("block what")
    # a cube of 1 mm: its inertia is m a^2 / 6 about each axis
    inertia = f"inertia {0.00785 / 6:.5g} g mm^2 about the axis, {0.00785 / 6:.5g} g mm^2 across"
    for words in ("volume 1 mm^3", "mass 0.00785 g of steel", inertia, "UPPER"):
        assert words in pin
    assert "LOWER" not in pin
    assert "UPPER" not in block


def test_a_support_on_a_node_set_is_refused_as_by_a_run(tmp_path: Path, capsys):
    """A mesh with elements is held on surfaces; its node sets know no faces."""
    path = bricks_case(tmp_path)
    path.write_text(path.read_text().replace("{surface: END_LOWER}", "{surface: FEET}"))

    assert main(["inspect", str(path)]) == 2
    told = capsys.readouterr().err
    assert "bodies.block.fixed[0].surface: got the unknown surface 'FEET' of block" in told
    assert "END_LOWER" in told
    assert main(["impact", str(path), "--out", str(tmp_path / "out")]) == 2
    assert "'FEET'" in capsys.readouterr().err


def test_a_drawn_body_shows_its_edges_volume_and_mass(capsys):
    """Truth: cylinders of radius 2 mm, 20 and 40 mm long: pi r^2 h, times 7850 kg/m^3."""
    assert main(["inspect", str(Path(__file__).parents[1] / "data" / "tiny_rods.yaml")]) == 0

    shown = " ".join(capsys.readouterr().out.split())
    for words in (
        "solid short 251.327 mm^3",
        "mass 1.97292 g of steel",
        "solid long 502.655 mm^3",
        "mass 3.94584 g of steel",
        "surface far z -40 mm, r 0 to 2 mm",
        "surface side z 0 to 20 mm, r 2 mm",
    ):
        assert words in shown


def test_a_computed_number_without_unit_is_followed_by_its_expression(capsys, tmp_path):
    text = find_case("two-rods").read_text("utf-8")
    assert text.count("poisson: 0.0") == 1
    file = tmp_path / "case.yaml"
    file.write_text(text.replace("poisson: 0.0", "poisson: '= 0.6 / 2'"), "utf-8")

    assert main(["inspect", str(file)]) == 0
    assert " 0.3, from '= 0.6 / 2'" in capsys.readouterr().out


def test_parameters_and_parts_of_a_case_are_shown(capsys, tmp_path):
    """Truth: the files of the page on parameters and parts."""
    case = Path(__file__).parents[2] / "docs" / "how-to" / "four_injectors.yaml"
    out = tmp_path / "parts.json"

    assert main(["inspect", str(case), "--json", str(out)]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    for words in (
        "parameter lift 80 um, a length",
        "injector3_magnet.time[2] 900 us, from '= 500 us + delay'",
        "injector1_face.area 1.130973 mm^2, from '= pi/4 * d_seat^2'",
        "component injector4_nozzle seat, components.nozzle of injector.yaml",
        "connection 1 supply.b, rail.fluid, injector1_bore.a, injector2_bore.a",
    ):
        assert words in shown
    assert list(json.loads(out.read_text(encoding="utf-8"))["parts"])[:4] == [
        "case: parameters",
        "case: values of expressions",
        "case: components",
        "case: connections",
    ]


FREE_TRAVEL = """\
klack: 1
title: An armature that travels freely on its needle
network:
  components:
    needle: {type: rigid-mass, mass: 1.25 g, points: [tip, collar, ring]}
    armature: {type: rigid-mass, mass: 1.6 g, points: [top, bottom]}
    seat: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 2e8 N/m}}
    carry: {type: end-stop, gap: 40 um, law: {kind: linear, stiffness: 2e8 N/m}}
    rest: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 2e8 N/m}}
    pole: {type: end-stop, gap: 100 um, law: {kind: linear, stiffness: 2e8 N/m}}
    spring: {type: spring, stiffness: 20 N/mm, preload: 25 N}
    coupling: {type: spring, stiffness: 3 N/mm, preload: 4 N}
  connections:
    - [needle.tip, seat.upper]
    - [seat.lower, ground]
    - [needle.collar, carry.upper, spring.end, coupling.base]
    - [needle.ring, rest.lower]
    - [armature.top, carry.lower, pole.lower, coupling.end]
    - [armature.bottom, rest.upper]
    - [pole.upper, ground]
run: {duration: 1 ms, variants: [dry], lift: needle.tip}
"""


def test_a_valve_shows_travels_pairs_and_a_first_speed(tmp_path: Path, capsys):
    """By hand: 25 N and 20 N/mm over 60 um, on the needle and the armature below its collar.

    The coupling pushes both apart, and no other.  (1.5 + 0.036) mJ on 2.85 g are 1.038 m/s.
    """
    (tmp_path / "free.yaml").write_text(FREE_TRAVEL, encoding="utf-8")

    assert main(["inspect", str(tmp_path / "free.yaml")]) == 0

    shown = " ".join(capsys.readouterr().out.split())
    assert "needle 1.25 g, travels from 0 um (seat) to 60 um (pole)" in shown
    assert "armature 1.6 g, travels from 0 um (seat and rest) to 100 um (pole)" in shown
    assert (
        "gap 0 um, opens to 60 um, at most 100 um if it continues in flight" in shown
    )  # the needle to the pole
    assert "carry needle.collar on armature.top: gap 40 um, opens to 40 um" in shown
    assert "rest armature.bottom on needle.ring: gap 0 um, opens to 40 um" in shown
    both = "springs 1.54 mJ, pressures 0 J on 2.85 g with armature over 60 um"
    assert f"needle 1.04 m/s: {both}" in shown
    assert "on 1.6 g over 100 um; faster, because needle pushes it at first" in shown


def test_a_body_pushes_all_that_lie_below_it(tmp_path: Path, capsys):
    """By hand: 60 N and 1 N/mm over 50 um are 3 mJ, on 6 g 1 m/s, also in another order."""
    masses = ["c: 3", "a: 1", "b: 2"]
    law = "law: {kind: linear, stiffness: 1e8 N/m}}"
    lines = [
        "klack: 1",
        "title: Three bodies in a row",
        "network:",
        "  components:",
        *(f"    {m[0]}: {{type: rigid-mass, mass: {m[3]} g, points: [low, top]}}" for m in masses),
        *(f"    {name}: {{type: end-stop, gap: 0 um, {law}" for name in ("ab", "bc", "seat")),
        f"    stop: {{type: end-stop, gap: 50 um, {law}",
        "    spring: {type: spring, stiffness: 1 N/mm, preload: 60 N}",
        "  connections:",
        "    - [a.low, ab.upper]",
        "    - [b.top, ab.lower]",
        "    - [b.low, bc.upper]",
        "    - [c.top, bc.lower]",
        "    - [c.low, seat.upper]",
        "    - [seat.lower, stop.upper, ground]",
        "    - [a.top, spring.end, stop.lower]",
        "run: {duration: 1 ms, variants: [dry], lift: c.low}",
    ]
    (tmp_path / "row.yaml").write_text("\n".join(lines), encoding="utf-8")

    assert main(["inspect", str(tmp_path / "row.yaml")]) == 0

    shown = " ".join(capsys.readouterr().out.split())
    assert "a 1 m/s: springs 3 mJ, pressures 0 J on 6 g with b and c over 50 um" in shown
    assert "on 3 g over 50 um; faster, because a pushes it at first" in shown


def test_a_body_that_falls_faster_than_what_is_above_it_is_not_pushed(tmp_path: Path, capsys):
    """By hand: the coupling of 60 N on the armature of 0.2 g; the needle closes with 25 N less it.

    (1.5 + 0.036 - 0.24 * 15 - 0.0036) mJ are below zero.
    """
    text = FREE_TRAVEL.replace("preload: 4 N", "preload: 60 N")
    (tmp_path / "free.yaml").write_text(text, encoding="utf-8")

    assert main(["inspect", str(tmp_path / "free.yaml")]) == 0

    shown = " ".join(capsys.readouterr().out.split())
    assert "needle does not close by itself: springs -2.07 mJ, pressures 0 J on 1.25 g" in shown
    assert "at first" not in shown
