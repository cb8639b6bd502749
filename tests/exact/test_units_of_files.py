"""Units of values and of files.

Truth: definitions. What is written with a unit is read as the same value, over all sizes.

Truth: units are words. A mesh, a drawing or a valve in another unit is the same valve.

Tolerances: round-off of one conversion, multiplied by what a stiffness or a bounce makes of it.
"""

import re
from math import exp, log
from pathlib import Path

import numpy as np
import pytest
from draws import each
from hypothesis import assume, given
from hypothesis import strategies as st
from property_profiles import examples

from klack import units
from klack.analyses.impact.run import run_impact
from klack.analyses.stroke.run import run_stroke
from klack.bodies.elasticity.body import elastic_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.case import read_case
from klack.case.any_case import read_any_case
from klack.errors import InputError
from klack.materials.material import Material
from klack.mesh.files.mesh_file import read_mesh_file
from klack.mesh.profile import Arc, Line, Profile
from klack.mesh.sizing import MeshSizing
from klack.mesh.solid import mesh_step, write_step_revolved
from klack.units import format_si, parse_quantity

KINDS = list(units.KINDS)


def sizes(kind: units.Kind) -> st.SearchStrategy[float]:
    """Values that a case may hold, every decade alike, of both signs."""
    low, high = log(kind.smallest), log(kind.largest)
    inside = st.floats(low + 1e-9, high - 1e-9)  # a unit and its digits round at the ends
    return st.builds(lambda sign, power: sign * exp(power), st.sampled_from([1.0, -1.0]), inside)


QUANTITIES = st.sampled_from(KINDS).flatmap(lambda kind: st.tuples(sizes(kind), st.just(kind)))


@examples(100)
@given(QUANTITIES)
def test_plain_numbers_are_read_as_written(quantity):
    value, kind = quantity
    text = repr(value) if kind.bare else f"{value!r} {kind.unit}"
    assert parse_quantity(text, kind) == pytest.approx(value, rel=1e-14)


@pytest.mark.slow
@examples(100)
@given(QUANTITIES, st.integers(2, 9))
def test_what_people_read_can_be_read_back(quantity, digits):
    """Half a unit of the last digit, whatever the prefix, for every kind that klack knows."""
    value, kind = quantity
    assume(2.0 * kind.smallest < abs(value) < 0.5 * kind.largest)  # rounding leads out of it
    text = format_si(value, kind.unit, digits)
    assert parse_quantity(text, kind) == pytest.approx(value, rel=0.501 * 10.0 ** (1 - digits))


@examples(60)
@given(
    sizes(units.LENGTH),
    st.sampled_from([("m", 1.0), ("mm", 1e-3), ("um", 1e-6), ("inch", 0.0254)]),
)
def test_a_length_is_the_same_in_every_unit(value, unit):
    name, metres = unit
    read = parse_quantity(f"{value / metres!r} {name}", units.LENGTH)
    assert read == pytest.approx(value, rel=1e-14)


@examples(60)
@given(st.data(), st.sampled_from(["uHz", "nHz", "urad", "mrad"]))
def test_a_prefix_is_a_power_of_ten_in_tables_of_units_as_well(data, unit):
    kind = units.FREQUENCY if unit.endswith("Hz") else units.ANGLE
    factor = {"u": 1e-6, "n": 1e-9, "m": 1e-3}[unit[0]]
    value = data.draw(sizes(kind)) / factor
    assert parse_quantity(f"{value!r} {unit}", kind) == pytest.approx(value * factor, rel=1e-14)


@each("kind", KINDS)
def test_beyond_the_sizes_that_there_are_it_is_asked(kind):
    for value in (0.5 * kind.smallest, -0.5 * kind.smallest, 2.0 * kind.largest):
        with pytest.raises(InputError, match="of a magnitude between"):
            parse_quantity(repr(value) if kind.bare else f"{value!r} {kind.unit}", kind)


@examples(60)
@given(st.floats(allow_nan=False), st.sampled_from(KINDS), st.integers(1, 17))
def test_any_number_can_be_written_for_people(value, kind, digits):
    text = format_si(value, kind.unit, digits)
    assert len(text) < 40
    if value == 0.0 or 2.0 * kind.smallest < abs(value) < 0.5 * kind.largest:
        read = parse_quantity(text, kind)
        assert read == pytest.approx(value, rel=0.501 * 10.0 ** (1 - min(digits, 14)))


@pytest.mark.slow
@examples(60)
@given(st.text(max_size=12), st.sampled_from(KINDS))
def test_any_text_is_a_finite_number_or_an_input_error(text, kind):
    try:
        value = parse_quantity(text, kind)
    except InputError:
        return
    assert np.isfinite(value)


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
