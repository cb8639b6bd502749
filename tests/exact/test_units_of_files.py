"""Truth: units are words. A mesh, a drawing or a valve in another unit is the same valve.

Tolerances: round-off of one conversion, multiplied by what a stiffness or a bounce makes of it.
"""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from property_profiles import examples

from klack.analyses.impact.run import run_impact
from klack.analyses.stroke.run import run_stroke
from klack.case import read_case
from klack.case.any_case import read_any_case
from klack.elasticity.body import elastic_body
from klack.elasticity.eigen import eigenmodes
from klack.materials import Material
from klack.mesh.files.mesh_file import read_mesh_file
from klack.mesh.profile import Arc, Line, Profile
from klack.mesh.sizing import MeshSizing
from klack.mesh.solid import mesh_step, write_step_revolved

ROOT = Path(__file__).parents[2]
BLOCK = ROOT / "tests" / "data" / "block.inp"
PLUNGER = ROOT / "docs" / "tutorials" / "files" / "plunger.inp"
VALVE = ROOT / "docs" / "how-to" / "small_valve.yaml"
STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
METRES = {"m": 1.0, "cm": 1e-2, "um": 1e-6, "inch": 0.0254}

PLUNGER_CASE = """
klack: 1
title: Plunger on its stop ring
materials:
  steel: {{young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}}
bodies:
  plunger:
    geometry: {{model: axisymmetric, mesh: {{file: {file}, unit: {unit}}}}}
    material: {{PLUNGER: steel}}
  ring:
    geometry: {{model: axisymmetric, mesh: {{file: {file}, unit: {unit}}}}}
    material: {{RING: steel}}
    fixed: [{{surface: FOOT}}]
contact: {{between: [plunger.LAND, ring.STOP], gap: 0 um}}
motion: {{speed: 0.4 m/s}}
reduction: {{modes: {{plunger: {{count: 10}}, ring: {{count: 10}}}}}}
run: {{duration: 20 us, levels: [reduced]}}
"""


def in_unit(mesh: Path, unit: str, folder: Path) -> Path:
    """Write an Abaqus file in millimetres again in another unit of length."""
    lines, nodes = [], False
    for line in mesh.read_text(encoding="utf-8").splitlines():
        if line.startswith("*") and not line.startswith("**"):
            nodes = line.upper().replace(" ", "").startswith("*NODE,") or line.upper() == "*NODE"
        elif nodes and not line.startswith("**"):
            number, *x = line.upper().replace("D", "E").split(",")
            line = ", ".join([number, *(repr(float(v) * 1e-3 / METRES[unit]) for v in x)])
        lines.append(line)
    path = folder / f"{mesh.stem}-{unit}.inp"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


@pytest.mark.parametrize("unit", METRES)
@pytest.mark.parametrize("mesh", [BLOCK, PLUNGER], ids=["block", "plunger"])
def test_a_mesh_in_another_unit_has_the_same_nodes(mesh, unit, tmp_path):
    """Blanks before numbers, exponents with D and unused nodes are of no account."""
    same = read_mesh_file(mesh, 1e-3)
    other = read_mesh_file(in_unit(mesh, unit, tmp_path), METRES[unit])

    assert np.array_equal(other.node_numbers, same.node_numbers)
    # three roundings: of the division, of the text, of the product
    np.testing.assert_allclose(other.mesh.points, same.mesh.points, rtol=1e-15, atol=0.0)
    for a, b in zip(other.mesh.blocks, same.mesh.blocks, strict=True):
        assert np.array_equal(a.connectivity, b.connectivity)


@pytest.mark.slow
@pytest.mark.parametrize("unit", ["m", "inch"])
def test_a_mesh_in_another_unit_hits_the_same(unit, tmp_path):
    """Mass, frequencies and the force of the impact, at round-off of the condensed stiffness."""
    studies = []
    for path, name in ((PLUNGER, "mm"), (in_unit(PLUNGER, unit, tmp_path), unit)):
        text = PLUNGER_CASE.format(file=path, unit=name)
        studies.append(run_impact(read_case(text, tmp_path / "case.yaml"), levels=("reduced",)))

    same, other = studies
    for a, b in zip(same.bodies, other.bodies, strict=True):
        assert b.mass == pytest.approx(a.mass, rel=1e-13)
        np.testing.assert_allclose(b.frequencies, a.frequencies, rtol=1e-9)
    force = same.levels["reduced"].history.force
    assert force.max() > 100.0
    np.testing.assert_allclose(
        other.levels["reduced"].history.force, force, rtol=0.0, atol=1e-9 * force.max()
    )


def pin() -> Profile:
    return Profile(
        (0, 0),
        (
            Arc((2e-3, 2e-3), (0, 2e-3), "tip"),
            Line((2e-3, 6e-3), "shank"),
            Line((0, 6e-3), "joint"),
            Line((0, 0), "axis"),
        ),
    )


INCH = """( CONVERSION_BASED_UNIT('INCH',#90001) LENGTH_UNIT() NAMED_UNIT(#90002) );
#90001 = LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(0.0254),#90003);
#90002 = DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.);
#90003 = ( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT($,.METRE.) )"""


def step_in_unit(text: str, unit: str) -> str:
    """Write a drawing in millimetres again in another unit: points, lengths, radii, the header."""
    factor = 1e-3 / METRES[unit]
    number = r"-?\d+\.\d*(?:E[+-]?\d+)?"

    def scaled(match: re.Match) -> str:
        values = re.sub(number, lambda v: f"{float(v[0]) * factor:.17E}", match[2])
        return match[1] + values + match[3]

    # curves in the parameters of a surface are left out: they mix angles and lengths
    for curve in re.finditer(r"(#\d+) = (?:SURFACE|SEAM)_CURVE\('',(#\d+),", text):
        text = re.sub(rf"(EDGE_CURVE\([^;]*){curve[1]},", rf"\g<1>{curve[2]},", text)
    point = rf"(CARTESIAN_POINT\('[^']*',\()({number},{number},{number})(\))"
    size = rf"((?:CIRCLE|VECTOR|CYLINDRICAL_SURFACE|SPHERICAL_SURFACE)\('',#\d+,)({number})(\))"
    text = re.sub(point, scaled, text)
    text = re.sub(size, scaled, text)
    text = re.sub(rf"(UNCERTAINTY_MEASURE_WITH_UNIT\(LENGTH_MEASURE\()({number})(\))", scaled, text)
    milli = r"\( LENGTH_UNIT\(\) NAMED_UNIT\(\*\) SI_UNIT\(\.MILLI\.,\.METRE\.\) \)"
    metre = "( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT($,.METRE.) )"
    text, count = re.subn(milli, lambda _: INCH if unit == "inch" else metre, text)
    assert count > 0
    return text


@pytest.mark.slow
@pytest.mark.parametrize("unit", ["m", "inch"])
def test_a_drawing_in_another_unit_is_the_same_body(unit, tmp_path):
    """The same mesh, node by node: points to 1e-15 leave netgen its decisions.

    Both drawings are given to 18 digits; a CAD program that writes 7 would give another mesh.
    """
    plain, other = tmp_path / "mm.step", tmp_path / "other.step"
    write_step_revolved({"pin": pin()}, plain)
    other.write_text(step_in_unit(plain.read_text(), unit))

    a, b = (
        elastic_body("pin", mesh_step(path, MeshSizing(size=1.5e-3)), {"pin": STEEL})
        for path in (plain, other)
    )
    (same,), (block,) = a.mesh.blocks, b.mesh.blocks
    assert set(b.mesh.surfaces) == set(a.mesh.surfaces)
    assert np.array_equal(block.connectivity, same.connectivity)
    np.testing.assert_allclose(b.mesh.points, a.mesh.points, rtol=0.0, atol=1e-12 * 6e-3)
    assert b.mass == pytest.approx(a.mass, rel=1e-12)
    frequency = eigenmodes(a, count=4).frequency
    np.testing.assert_allclose(eigenmodes(b, count=4).frequency, frequency, rtol=1e-9)
    assert frequency[0] > 1e5


SAME = {
    "mm": (1e-3, METRES),
    "um": (1e-6, {**METRES, "mm": 1e-3}),
    "g": (1e-3, {"kg": 1.0, "mg": 1e-6}),
    "us": (1e-6, {"s": 1.0, "ms": 1e-3, "ns": 1e-9}),
    "ms": (1e-3, {"s": 1.0, "us": 1e-6}),
    "ns": (1e-9, {"s": 1.0, "us": 1e-6}),
    "N": (1.0, {"kN": 1e3, "mN": 1e-3, "kg m/s^2": 1.0}),
    "N/m": (1.0, {"N/mm": 1e3, "N/um": 1e6, "kN/mm": 1e6}),
    "N/mm": (1e3, {"N/m": 1.0, "N/um": 1e6, "kg/s^2": 1.0}),
    "bar": (1e5, {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6}),
    "mm^3": (1e-9, {"m^3": 1.0, "cm^3": 1e-6}),
}


def valve_lift(text: str) -> np.ndarray:
    study = run_stroke(read_any_case(text, VALVE))
    channel = study.variants["wet"].channel(study.channels.lift)
    assert channel is not None
    return channel.values


@pytest.fixture(scope="module")
def shortened() -> tuple[str, np.ndarray]:
    """The valve opens and bounces on its stop."""
    text = VALVE.read_text(encoding="utf-8")
    text = re.sub(r"run: .*", "run: {duration: 0.4 ms, step: 20 ns, variants: [wet]}", text)
    text = text.replace("temperature: 20 degC", "pressure: 1.5 bar, temperature: 293.15 K")
    lift = valve_lift(text)
    assert lift.max() > 95e-6
    return text, lift


@examples(4)
@given(st.randoms(use_true_random=False))
def test_a_valve_in_any_units_makes_the_same_stroke(shortened, draw):
    """Every quantity of the case in a unit of its own; bounces multiply round-off."""
    text, lift = shortened

    def other(match: re.Match) -> str:
        unit, others = SAME[match[2]]
        name = draw.choice(list(others))
        return f"{float(match[1]) * unit / others[name]!r} {name}"

    names = "|".join(sorted(map(re.escape, SAME), key=len, reverse=True))
    text = text.replace("293.15 K", draw.choice(["293.15 K", "20 degC"]))
    drawn, count = re.subn(
        rf"(?<![\w.])(\d+(?:\.\d+)?(?:e\d+)?) ({names})(?=[,}}\]\n])", other, text
    )
    assert count > 20
    np.testing.assert_allclose(valve_lift(drawn), lift, rtol=0.0, atol=1e-9 * lift.max())
