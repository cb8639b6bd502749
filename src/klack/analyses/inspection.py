"""Content of a file of another program."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from klack.analyses.valve_inspection import valve_rows
from klack.assembling.assembled_bodies import assembled_body
from klack.assembling.bodies import assemble_body, mesh_body
from klack.assembling.bolts import BoltedJoint, bolted_joints
from klack.assembling.fits import PressFit, press_fits
from klack.assembling.given_bodies import reduced_from_file
from klack.assembling.layers import LayerState, layer_states
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.model_files.matrices import MATRIX_FORMATS, read_matrix
from klack.bodies.model_files.system_matrix import SystemMatrix, WhichMatrixError
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.case.bodies import CaseFile
from klack.case.geometry import ProfileGeometry
from klack.case.key_path import kind_at, node_at, written_at
from klack.case.origin import ExpandedCase
from klack.case.parameters import ParameterValue
from klack.case.placed_errors import tells_place
from klack.case.schema import Case
from klack.case.surface_names import require_surface_names
from klack.case.valve import ValveCase
from klack.errors import InputError
from klack.input.problem import CaseProblem, Key, key_text
from klack.input.section import Computed, refuse_lfs_pointer
from klack.mechanics.fmu_file import FmuDescription, inspect_fmu
from klack.mesh.files.catalogue import MESH_FORMATS, STEP_ENDINGS, format_of
from klack.mesh.files.mesh_file import read_mesh_file
from klack.mesh.files.mesh_model import MeshModel
from klack.mesh.mesh import Mesh
from klack.mesh.moments import Moments
from klack.mesh.profile import Profile
from klack.mesh.quality import corner_moments, corner_volume, mesh_summary
from klack.mesh.step_content import StepContent, StepPart, step_content
from klack.units import format_in, format_si, parse_quantity, takes_prefix, unit_in

__all__ = [
    "INSPECTED",
    "Inspected",
    "Row",
    "expanded_rows",
    "inspect_bodies",
    "inspect_case",
    "inspect_file",
    "meeting_rows",
]


Row = tuple[str, str, str]
"""What, its name, its numbers in words."""


def expanded_rows(case: CaseFile) -> Iterator[tuple[str, tuple[Row, ...]]]:
    """Parameters of a case, values that follow from expressions, components with included parts.

    Yields a title and its rows.
    """
    found = case.expanded
    if found is None:
        return
    if case.parameters:
        yield "case: parameters", tuple(_parameters(case.parameters))
    if found.expressions:
        rows = (("value", key_text(key), _value(case, found, key)) for key in found.expressions)
        yield "case: values of expressions", tuple(rows)
    if isinstance(case, ValveCase) and case.include:
        yield "case: components", tuple(_components(case, found))
        nodes = (
            ("connection", str(i), ", ".join(ports))
            for i, ports in enumerate(case.network.connections)
        )
        yield "case: connections", tuple(nodes)


def _parameters(parameters: object) -> Iterator[Row]:
    assert isinstance(parameters, dict)
    for name, item in parameters.items():
        assert isinstance(item, ParameterValue)
        kind = "" if item.kind.bare else f", {item.kind.name}"
        yield "parameter", name, f"{item}{kind}{_source(item)}"


def _source(item: ParameterValue) -> str:
    try:
        parse_quantity(item.text, item.kind)
    except InputError:
        return f", from '{item.text}'"
    return ""


def _value(case: CaseFile, found: ExpandedCase, key: Key) -> str:
    try:
        node, field = node_at(case, key)
    except CaseProblem:  # a short form that the case spells out
        node, field = written_at(found.data, key), None
    kind = kind_at(node, field)
    if isinstance(node, float | int) and kind is not None:
        unit, size = unit_in(kind.example, kind)
        if takes_prefix(kind.unit) or not unit:
            node = format_si(float(node), kind.unit, 7)
        else:  # as the field writes it: mm^2, g, degC
            node = format_in(float(node), unit, size, 7)
    elif isinstance(node, Computed):
        return str(node)
    return f"{node}, from '{found.expressions[key].text}'"


def _components(case: ValveCase, found: ExpandedCase) -> Iterator[Row]:
    for name, part in case.network.components.items():
        origin = found.origin(("network", "components", name))
        of = f", {'.'.join(map(str, origin.key))} of {origin.path.name}" if origin.copy else ""
        yield "component", name, f"{part.type}{of}"


INSPECTED = (*STEP_ENDINGS, *MESH_FORMATS, *MATRIX_FORMATS, ".fmu")
"""Endings of the files that :func:`inspect_file` knows."""


def inspect_file(
    path: Path, unit_length: float | None = None, matrix: str | None = None
) -> tuple[Row, ...]:
    """Content of a STEP file, a mesh, a matrix or an FMU, by the endings :data:`INSPECTED`.

    ``unit_length`` [m] is for a mesh whose file does not name it; ``matrix`` one of several.
    """
    ending = path.suffix.lower()
    if not path.is_file():
        hint = "check the spelling and the folder."
        raise InputError(str(path), got="no such file", expected="a file", hint=hint)
    refuse_lfs_pointer(path)
    if ending in STEP_ENDINGS:
        return tuple(_step_rows(step_content(path)))
    if ending in MESH_FORMATS:
        return tuple(_mesh_rows(path, read_mesh_file(path, unit_length, solids_only=True)))
    if ending in MATRIX_FORMATS:
        return tuple(_rows_of_matrices(path, matrix))
    if ending == ".fmu":
        return tuple(_fmu_rows(inspect_fmu(path)))
    raise InputError(
        str(path),
        got=f"a file that ends in '{path.suffix}'",
        expected=f"one of: {', '.join(dict.fromkeys(INSPECTED))}",
        hint="klack inspect reads CAD, meshes, matrices and FMUs.",
    )


def inspect_case(case: CaseFile) -> Iterator[tuple[str, tuple[Row, ...]]]:
    """Parameters, parts and bodies of a case, their files checked as in a run.

    Yields the rows of :func:`expanded_rows`, then the name of each body and its rows, then what
    moves and what meets.
    """
    yield from expanded_rows(case)
    bodies = {}
    for name, body in inspect_bodies(case):
        yield name, body.rows
        bodies[name] = body
    yield from meeting_rows(case, bodies)


def meeting_rows(
    case: CaseFile, bodies: "Mapping[str, Inspected]"
) -> Iterator[tuple[str, tuple[Row, ...]]]:
    """What moves and what meets in a case: pairs, travels, and speeds before a run."""
    if isinstance(case, ValveCase):
        masses = {name: body.mass for name, body in bodies.items() if body.mass is not None}
        yield from valve_rows(case, masses)
    elif isinstance(case, Case):
        yield "case: impact", tuple(_impact_rows(case))


def _impact_rows(case: Case) -> Iterator[Row]:
    contact, above, below = case.contact, case.opposite, case.backing
    gap = "gap as drawn" if contact.gap is None else f"gap {format_si(contact.gap, 'm', 4)}"
    speed = format_si(case.motion.speed, "m/s", 4)
    yield "contact", "", f"{contact.moving} on {contact.stop}: {gap}, starts with {speed}"
    if above is not None:
        travel = format_si(above.gap, "m", 4)
        yield "upper stop", "", f"{above.stop} on {above.moving}: {travel} above the start"
    if below is not None:
        upper, lower = below.between
        gap = f"gap {format_si(below.gap, 'm', 4)}"
        state = f"clamped with {format_si(below.preload, 'N', 4)}" if below.preload else gap
        yield "contact below", "", f"{upper} on {lower}: {state}"


@dataclass(frozen=True, kw_only=True, eq=False)
class Inspected:
    """A body in words.

    Parameters
    ----------
    mass [kg], centre (3,) [m]
        Of gravity, in the drawing; None where they are not known.
    """

    rows: tuple[Row, ...]
    mass: float | None = None
    centre: np.ndarray | None = None


def inspect_bodies(case: CaseFile) -> Iterator[tuple[str, Inspected]]:
    """Each body of a case; at the end, a surface that is named but not there is an error."""
    known: dict[str, tuple[str, ...]] = {}
    for name, body in case.bodies.items():
        if body.reduced is not None:
            reduced = reduced_from_file(case, name)
            mass = reduced.mass if reduced.rigid_count else None
            yield name, Inspected(rows=tuple(_reduced_rows(reduced)), mass=mass)
        elif body.matrices is not None:
            yield name, Inspected(rows=assembled_body(case, name).rows())
        elif body.geometry.mesh is not None:
            mesh = body.geometry.mesh
            solids = tuple(body.material) if isinstance(body.material, dict) else None
            model = read_mesh_file(
                mesh.file, mesh.unit, solids=solids, solids_only=mesh.solids_only
            )
            known[name] = tuple(model.mesh.surfaces)
            found = _weighed(case, name, _mesh_rows(Path(mesh.file), model), _moments(model))
            yield name, _with_joints(case, name, found)
        elif body.geometry.step is not None:
            content = step_content(body.geometry.step.file)
            known[name] = tuple(face.name for face in content.faces)
            moments = {solid.name: solid.moments for solid in content.solids}
            found = _weighed(case, name, _step_rows(content), moments)
            yield name, _with_joints(case, name, found)
        elif body.geometry.profile is not None:
            profiles = body.geometry.profile.profiles()
            rows = _drawn_rows(body.geometry.profile, profiles)
            drawn = {solid: profile.moments for solid, profile in profiles.items()}
            found = _weighed(case, name, rows, drawn)
            yield name, _with_joints(case, name, found)
    require_surface_names(case, known)


def _drawn_rows(drawn: ProfileGeometry, profiles: Mapping[str, Profile]) -> Iterator[Row]:
    """Solids and edges of a drawing."""
    yield "geometry", "", "drawn; meshed by klack when the case runs"
    for solid, profile in profiles.items():
        yield "solid", solid, f"{profile.volume * 1e9:.6g} mm^3"
    for edge in drawn.surfaces:
        curves = [c for p in profiles.values() for c in p.curves if c.name == edge]
        points = np.concatenate([c.at(np.linspace(0.0, 1.0, 65)) for c in curves])
        yield "surface", edge, f"z {_range(points[:, 1])}, r {_range(points[:, 0])}"


def _with_joints(case: CaseFile, name: str, found: Inspected) -> Inspected:
    return replace(found, rows=(*found.rows, *_joint_rows(case, name)))


def _joint_rows(case: CaseFile, name: str) -> Iterator[Row]:
    """Press fits, bolts and layers between the parts of a body, and their doubts."""
    joints: list[tuple[str, str, PressFit | BoltedJoint | LayerState]] = [
        *(("press fit", fit.joint, fit) for fit in press_fits(case, name)),
        *(("bolts", bolted.joint, bolted) for bolted in bolted_joints(case, name)),
        *(("layer", state.name, state) for state in _layers(case, name)),
    ]
    for kind, joint, found in joints:
        yield from ((kind, joint, f"{what}: {text}") for what, text in found.rows())
        yield from (("doubt", joint, doubt) for doubt in found.doubts)


@tells_place
def _layers(case: CaseFile, name: str) -> tuple[LayerState, ...]:
    if not case.bodies[name].layers:
        return ()
    body = assemble_body(case, name, mesh_body(case.bodies[name], name, ()))
    return layer_states(body, eigenmodes(body, count=_MODES))


def _weighed(
    case: CaseFile, name: str, rows: Iterable[Row], shapes: Mapping[str, Moments]
) -> Inspected:
    """Rows, then mass, centre of gravity and inertia from the moments of each solid."""
    rows = tuple(rows)
    try:
        materials = case.materials_of(name, {solid: one.volume for solid, one in shapes.items()})
    except InputError as error:  # what there is shall be shown all the same
        return Inspected(rows=(*rows, ("mass", "", error.got)))
    whole = Moments.together((materials[solid].density, one) for solid, one in shapes.items())
    kinds = ", ".join(dict.fromkeys(materials[solid].name for solid in shapes))
    weighed = (
        ("mass", "", f"{1e3 * whole.volume:.6g} g of {kinds}"),
        ("centre of gravity", "", _place_words(whole.centre)),
        ("inertia", "", _inertia_words(whole.inertia)),
    )
    return Inspected(rows=(*rows, *weighed), mass=whole.volume, centre=whole.centre)


_ROUND = 1e-4  # of the largest; meshes of turned bodies are round to this


def _place_words(place: np.ndarray) -> str:
    x, y, z = (round(1e3 * float(v), 4) for v in place)
    side = f"x {x:.5g}, y {y:.5g}, " if x or y else ""
    return f"{side}z {z:.5g} mm"


def _inertia_words(inertia: np.ndarray) -> str:
    """About the centre of gravity."""
    tensor = 1e9 * inertia
    xx, yy, zz = tensor.diagonal()
    small = _ROUND * tensor.max()
    sides = {"xy": tensor[0, 1], "xz": tensor[0, 2], "yz": tensor[1, 2]}
    sides = {axes: value for axes, value in sides.items() if abs(value) > small}
    if not sides and abs(xx - yy) <= small:
        return f"{zz:.5g} g mm^2 about the axis, {0.5 * (xx + yy):.5g} g mm^2 across"
    more = "".join(f", {axes} {value:.4g}" for axes, value in sides.items())
    return f"xx {xx:.5g}, yy {yy:.5g}, zz {zz:.5g}{more} g mm^2"


def _moments(model: MeshModel) -> dict[str, Moments]:
    blocks = model.mesh.blocks
    return {
        solid: corner_moments(
            replace(model.mesh, blocks=tuple(block for block in blocks if block.solid == solid))
        )
        for solid in model.mesh.solids
    }


def _reduced_rows(body: ReducedBody) -> Iterator[Row]:
    elastic = body.frequencies[body.rigid_count :]
    kind = "free" if body.rigid_count else "held"
    yield "reduced model", kind, f"{len(elastic)} elastic modes, {body.rigid_count} rigid ones"
    if body.rigid_count:
        yield "mass", "", f"{body.mass * 1e3:.6g} g"
    if len(elastic):
        low, high = elastic.min() / 1e3, elastic.max() / 1e3
        yield "frequencies", "", f"{low:.5g} to {high:.5g} kHz"
    ratios = body.damping[body.rigid_count :]
    if len(ratios):
        low, high = (round(100 * float(z), 9) for z in (ratios.min(), ratios.max()))
        yield "damping", "", f"{low:.3g} %" if low == high else f"{low:.3g} to {high:.3g} %"
    static = np.diag(body.static_compliance)
    for port, compliance, share in zip(body.port_names, static, body.compliance_share, strict=True):
        yield (
            "port",
            port,
            f"elastic compliance {compliance * 1e9:.4g} nm/N, {100 * share:.3g} % of it in the "
            "modes",
        )


def _step_rows(content: StepContent) -> Iterator[Row]:
    for solid in content.solids:
        yield "solid", solid.name, f"{solid.size * 1e9:.6g} mm^3, {_box(solid)}"
    for face in content.faces:
        count = "" if face.count == 1 else f"{face.count} faces, "
        yield "surface", face.name, f"{count}{face.size * 1e6:.5g} mm^2, {_box(face)}"
    nameless = sum(not face.named for face in content.faces)
    if nameless:
        faces = "1 face" if nameless == 1 else f"{nameless} faces"
        yield "note", "", f"{faces} without a name in the file: numbered by klack"


def _box(part: StepPart) -> str:
    spans = zip("xyz", part.low, part.high, strict=True)
    return ", ".join(f"{axis} {_range(np.array([low, high]))}" for axis, low, high in spans)


def _mesh_rows(path: Path, model: MeshModel) -> Iterator[Row]:
    mesh = model.mesh
    summary = mesh_summary(mesh)
    kind = {2: "axisymmetric (r, z)", 3: "three-dimensional"}[mesh.dimension]
    yield "mesh", kind, f"{summary.nodes} nodes, {summary.elements} elements"
    for family, count in summary.families.items():
        yield "elements", family, str(count)
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    for axis, a, b in zip("rz" if mesh.dimension == 2 else "xyz", low, high, strict=True):
        yield "extent", axis, _range(np.array([a, b]))
    yield "edges", "", f"{summary.smallest_edge * 1e3:.3g} to {summary.largest_edge * 1e3:.3g} mm"
    yield "worst element", f"quality {summary.worst_quality:.2f}", summary.worst_element
    yield "volume", "", f"{corner_volume(mesh) * 1e9:.6g} mm^3"
    for solid in mesh.solids:
        count = sum(len(block.connectivity) for block in mesh.blocks if block.solid == solid)
        material = model.sections.get(solid, "")
        yield "solid", solid, f"{count} elements" + (f", material {material}" if material else "")
    for name, surface in mesh.surfaces.items():
        yield "surface", name, f"{surface.face_count} faces, {_around(mesh, surface.nodes)}"
    for name, nodes in mesh.node_sets.items():
        yield "node set", name, f"{len(nodes)} nodes, {_around(mesh, nodes)}"
    for name, given in model.materials.items():
        density = "none" if given.density is None else f"{given.density:.6g}"
        yield (
            "material",
            name,
            f"E {given.young:.6g}, nu {given.poisson:.4g}, density {density} (units of the file)",
        )
    for name, kind in model.foreign_materials.items():
        yield "material", name, f"{kind}; klack computes isotropic materials only"
    for kind, count in model.left_out.items():
        yield "left out", kind, f"{count} elements; a case needs 'elements: solids-only' for them"
    if format_of(path).open_end:
        words = (
            "files of this format have no end mark: compare the counts in the program that wrote it"
        )
        yield "note", "", words


def _rows_of_matrices(path: Path, name: str | None) -> Iterator[Row]:
    try:
        yield from _matrix_rows(read_matrix(path, name=name))
        return
    except WhichMatrixError as error:
        if name is not None or len(error.names) < 2:
            raise
        names = error.names
    for each in names:
        try:
            rows = tuple(_matrix_rows(read_matrix(path, name=each)))
        except InputError as error:
            rows = (("matrix", each, f"not usable: {error.got}"),)
        yield from rows


def _matrix_rows(found: SystemMatrix) -> Iterator[Row]:
    A = found.matrix
    yield "matrix", found.name, f"{A.shape[0]} rows, {A.nnz} entries, both triangles"
    diagonal = A.diagonal()
    yield "diagonal", "", f"{diagonal.min():.6g} to {diagonal.max():.6g} (units of the file)"
    if found.rows is None:
        yield (
            "rows",
            "",
            "not stated in the file: give 'dofs', or the order is x, y, z node by node",
        )
    else:
        nodes = found.rows.node
        numbers = f"{len(np.unique(nodes))} nodes, {nodes.min()} to {nodes.max()}"
        ways = ", ".join(_WAYS.get(int(d), str(d)) for d in np.unique(found.rows.direction))
        yield "rows", numbers, f"directions {ways}"
    if found.held is not None and found.held.node.size:
        yield "held", "", f"{found.held.node.size} constrained rows are left out of the file"
    for note in found.notes:
        yield "note", "", note


_MODES = 10  # that show a layer
_WAYS = {1: "x", 2: "y", 3: "z", 4: "rx", 5: "ry", 6: "rz"}


def _fmu_rows(fmu: FmuDescription) -> Iterator[Row]:
    kind = "model exchange only: klack cannot run it" if fmu.model_exchange else "co-simulation"
    yield "FMU", fmu.identifier, f"{kind}, FMI {fmu.version}.0"
    for causality in ("input", "output", "parameter"):
        for name, variable in fmu.variables.items():
            if variable.causality == causality:
                yield causality, name, variable.unit or "no unit"


def _around(mesh: Mesh, nodes: np.ndarray) -> str:
    points = mesh.points[nodes]
    radius = points[:, 0] if mesh.dimension == 2 else np.hypot(points[:, 0], points[:, 1])
    return f"z {_range(points[:, -1])}, r {_range(radius)}"


def _range(values: np.ndarray) -> str:
    low, high = (round(float(v) * 1e3, 7) + 0.0 for v in (values.min(), values.max()))
    return f"{low:.5g} mm" if high - low < 1e-6 else f"{low:.5g} to {high:.5g} mm"
