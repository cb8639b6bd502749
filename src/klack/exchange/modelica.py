"""Models as flat Modelica text that needs no library.

It keeps to what every tool takes: arrays of parameters, one loop of equations, functions with
plain algorithms. Forces are ``input Real``, displacements, gaps and contact forces ``output
Real``.
"""

import html
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.contact.step_constants import MODELICA_POWER_TURNS, MODELICA_TABLE_TURNS
from klack.exchange.modal_model import ModalModel, ModelContact
from klack.exchange.model_folder import model_folder, named_apart
from klack.exchange.state_space import (
    ContactKind,
    contact_kind,
    law_table,
    relaxation_time,
    start_speed,
)

__all__ = ["ContactText", "modelica_text", "write_modelica"]


_WIDTH = 96
_TAKEN = frozenset(
    """algorithm and annotation assert block break class connect connector constant constrainedby
    der discrete each else elseif elsewhen encapsulated end enumeration equation expandable extends
    external false final flow for function if import impure in initial inner input loop model not
    operator or outer output package parameter partial protected public pure record redeclare
    replaceable return stream then true type when while within
    Real Integer Boolean String time q v i omega damping rest rise drift""".split()
)


def number(value: float) -> str:
    """Shortest text that reads back equal."""
    return repr(float(value))


def text(words: str) -> str:
    """Quoted string on one line."""
    plain = " ".join(words.split()).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{plain}"'


def class_name(name: str) -> str:
    """Class name that is no keyword or variable."""
    return f"{name}_model" if name in _TAKEN else name


def array(declaration: str, values: ArrayLike, words: str) -> str:
    """Declaration of a vector, broken into lines."""
    return _declared(declaration, [number(x) for x in np.ravel(values)], words)


def table(declaration: str, rows: NDArray[np.float64], words: str) -> str:
    """Declaration of a matrix, row by row."""
    return _declared(declaration, ["{" + ", ".join(map(number, r)) + "}" for r in rows], words)


def _declared(declaration: str, items: list[str], words: str) -> str:
    lines, line = [f"  {declaration} = {{"], "   "
    for k, item in enumerate(items):
        end = "," if k + 1 < len(items) else ""
        if len(line) + len(item) + 2 > _WIDTH and line.strip():
            lines.append(line)
            line = "   "
        line += f" {item}{end}"
    return "\n".join([*lines, f"{line}}} {text(words)};"])


@dataclass(frozen=True, kw_only=True)
class ContactText:
    """Lines of one contact; ``suffix`` ends the names of its variables.

    Without a film the force is a function of the gap, in series with ``D`` the solution of ``F =
    f(-gap - D F)``. A film in series has a state ``e``, see :func:`contact_text`.
    """

    suffix: str
    declarations: list[str]
    equations: list[str]


def contact_text(model: ModalModel, index: int) -> ContactText:
    r"""Variables and equations of a contact.

    A film in series with ``D`` has the compression ``e`` as state. With the gap ``z = gap + e``
    between the surfaces and ``e_c = max(e, -D F_s)``, where the film cavitates,

    .. math:: \dot e = -\frac{e_c + D c(z)\,\dot g}{\max(D\,c(z), \tau)} + \frac{e_c - e}{\tau},
              \qquad F = e_c / D .

    This is ``F = -c \dot z`` where ``D c`` is above the relaxation time ``tau``; far apart, where
    the force is small, it is late by ``tau`` and not stiff. Closed while neither ``z`` nor the gap
    is above zero: the film rests and ``e`` decays.
    """
    contact = model.contacts[index]
    name = contact.name
    declared = _parameters(model, contact)
    closed = _force(contact)
    equations = [f"  gap_{name} = {number(contact.gap)} + gap_shape_{name}*q;"]
    film = contact.film
    if film is None:
        equations += [
            f"  contact_force_{name} = if gap_{name} < 0 then {closed} else 0;",
            f"  total_{name} = contact_force_{name};",
        ]
        return ContactText(suffix=name, declarations=declared, equations=equations)
    declared += [
        f'  output Real film_force_{name}(unit="N") "Force of the squeeze film, + apart";',
        f'  Real opening_{name}(unit="m") "Gap between the surfaces";',
        f'  Real clear_{name}(unit="m") "Above 0: no contact";',
        f'  Real damping_{name}(unit="N.s/m") "Of the film";',
    ]
    rate = f"(gap_shape_{name}*v)"
    if contact.series_compliance == 0.0:
        film_force = f"noEvent(max(-damping_{name}*{rate}, -suction_{name}))"
        equations += [
            f"  opening_{name} = gap_{name};",
            f"  clear_{name} = gap_{name};",
        ]
    else:
        film_force = f"held_{name}/series_{name}"
        declared += [
            f'  Real compression_{name}(unit="m", start=0, fixed=true) "Of the series compliance";',
            f'  Real held_{name}(unit="m") "Compression, where the film does not cavitate";',
        ]
        equations += [
            f"  held_{name} = noEvent(max(compression_{name}, -series_{name}*suction_{name}));",
            f"  opening_{name} = gap_{name} + held_{name};",
            f"  clear_{name} = noEvent(max(opening_{name}, gap_{name}));",
            f"  der(compression_{name}) = if clear_{name} > 0 then",
            f"    -(held_{name} + series_{name}*damping_{name}*{rate})",
            f"    /noEvent(max(series_{name}*damping_{name}, relaxation))",
            f"    + (held_{name} - compression_{name})/relaxation",
            f"    else -compression_{name}/relaxation;",
        ]
    equations.append(f"  film_force_{name} = if clear_{name} > 0 then {film_force} else 0;")
    equations += [
        f"  damping_{name} = squeeze_damping(opening_{name}, film_{name}[1], film_{name}[2], "
        f"film_{name}[3]);",
        f"  contact_force_{name} = if clear_{name} > 0 then 0 else {closed};",
        f"  total_{name} = contact_force_{name} + film_force_{name};",
    ]
    return ContactText(suffix=name, declarations=declared, equations=equations)


def _parameters(model: ModalModel, contact: ModelContact) -> list[str]:
    name = contact.name
    lines = [
        f'  output Real gap_{name}(unit="m") "Gap between the bodies at {name}";',
        f'  output Real contact_force_{name}(unit="N") "Contact force at {name}";',
        f'  Real total_{name}(unit="N") "Contact and film, + apart";',
        array(
            f"parameter Real gap_shape_{name}[{model.mode_count}]",
            contact.shape,
            f"Change of gap_{name} by unit modes [1/sqrt(kg)]",
        ),
    ]
    kind = contact_kind(contact)
    if contact.series_compliance or kind in ("linear", "power", "table"):
        lines.append(
            f'  parameter Real series_{name}(unit="m/N") = {number(contact.series_compliance)} '
            '"Massless compliance in series";'
        )
    if kind == "table":
        lines.append(
            table(
                f"parameter Real law_{name}[{len(law_table(contact))}, 5]",
                law_table(contact),
                "Indentation [m], force [N], factors of s, s^2, s^3 up to the next row",
            )
        )
    elif kind in ("linear", "power"):
        words = "Stiffness [N/m]" if kind == "linear" else "Coefficient [N/m^n], exponent n"
        flat = contact.law.flat().parameters  # type: ignore[union-attr]
        lines.append(array(f"parameter Real law_{name}[{len(flat)}]", flat, words))
    film = contact.film
    if film is not None:
        lines.append(
            array(
                f"parameter Real film_{name}[3]",
                [film.cubic, film.linear, film.cut_off],
                "F = (cubic/h^3 + linear/h)*V over h = gap + cut-off [N.s.m2], [N.s], [m]",
            )
        )
        lines.append(
            f'  parameter Real suction_{name}(unit="N") = {number(film.suction)} '
            '"Largest pull of the film";'
        )
    return lines


def _force(contact: ModelContact) -> str:
    name = contact.name
    if contact_kind(contact) == "none":
        return "0"
    return f"law_force_{name}(-gap_{name}, series_{name}, law_{name})"


def law_functions(contacts: Sequence[ModelContact]) -> Iterable[str]:
    """Functions of the laws of these contacts, and of films.

    Sizes and loop bounds are plain numbers: not every tool takes others.
    """
    for contact in contacts:
        kind = contact_kind(contact)
        if kind != "none":
            rows = len(law_table(contact)) if kind == "table" else 0
            soft = contact.series_compliance > 0.0
            yield from _law_function(f"law_force_{contact.name}", kind, rows, soft)
    if any(contact.film is not None for contact in contacts):
        yield _FILM.strip("\n")


def _law_function(name: str, kind: ContactKind, rows: int, soft: bool) -> Iterable[str]:
    size = {"linear": "1", "power": "2"}.get(kind, f"{rows}, 5")
    yield from (
        f'  function {name} "Contact force over the overlap of the bodies"',
        '    input Real closing(unit="m") "Overlap: indentation + series*force";',
        '    input Real series(unit="m/N");',
        f"    input Real law[{size}];",
        '    output Real force(unit="N");',
    )
    if kind == "linear":
        yield from (
            "  algorithm",
            "    force := max(closing, 0.0)*law[1]/(1 + series*law[1]);",
        )
    elif kind == "power":
        yield _POWER.strip("\n").replace("SEARCH", "    Real f;\n" if soft else "")
        if soft:
            yield _SOFT_POWER.strip("\n").replace("TURNS", str(MODELICA_POWER_TURNS))
        yield "    force := law[1]*d^law[2];"
    else:
        search = "    Real low;\n    Real high;\n    Real excess;\n" if soft else ""
        yield from (
            _TABLE.strip("\n").replace("ROWS", str(rows)).replace("SEARCH", search),
            _SOFT_TABLE.strip("\n").replace("TURNS", str(MODELICA_TABLE_TURNS))
            if soft
            else "    s := rest;",
            "    force := law[row, 2] + s*(law[row, 3] + s*(law[row, 4] + s*law[row, 5]));",
        )
    yield f"  end {name};"


_POWER = """
  protected
    Real d "Indentation";
SEARCH  algorithm
    d := max(closing, 0.0);
"""

_SOFT_POWER = """
    for step in 1:TURNS loop
      f := law[1]*d^(law[2] - 1);
      d := max(d - (d + series*f*d - max(closing, 0.0))/(1 + series*law[2]*f), 0.0);
    end for;
"""

_TABLE = """
  protected
    Integer row;
    Real rest "Remaining overlap of the interval";
    Real s "Indentation from the start of the interval";
SEARCH  algorithm
    row := 1;
    for k in 2:ROWS loop
      row := if closing >= law[k, 1] + series*law[k, 2] then k else row;
    end for;
    rest := max(closing, 0.0) - law[row, 1] - series*law[row, 2];
"""

_SOFT_TABLE = """
    low := 0.0;
    high := rest;
    s := rest/(1 + series*law[row, 3]);
    for step in 1:TURNS loop
      excess := s + series*s*(law[row, 3] + s*(law[row, 4] + s*law[row, 5])) - rest;
      low := if excess < 0 then s else low;
      high := if excess < 0 then high else s;
      s := s - excess/(1 + series*(law[row, 3] + s*(2*law[row, 4] + s*3*law[row, 5])));
      s := if s < low or s > high then 0.5*(low + high) else s;
    end for;
"""

_FILM = """
  function squeeze_damping "Force per closing speed of a squeeze film"
    input Real gap(unit="m");
    input Real cubic;
    input Real linear;
    input Real cut_off(unit="m");
    output Real damping(unit="N.s/m");
  protected
    Real h(unit="m");
  algorithm
    h := max(gap, 0.0) + cut_off;
    damping := cubic/h^3 + linear/h;
  end squeeze_damping;
"""


def write_modelica(models: Sequence[ModalModel], folder: Path) -> tuple[Path, ...]:
    """Write one file ``NAME.mo`` for each model.

    As :func:`klack.exchange.model_folder.model_folder` and :func:`modelica_text`.
    """
    names = [f"{class_name(model.name)}.mo" for model in models]
    with model_folder(models, folder) as stage:
        for name, model in zip(names, models, strict=True):
            (stage / name).write_text(modelica_text(named_apart(model)), encoding="utf-8")
    return tuple(folder / name for name in names)


def modelica_text(model: ModalModel) -> str:
    """Class of Modelica 3.4 for a body or a pair.

    States ``q`` and ``v`` are modal displacements and velocities; ``start_velocity`` and
    ``start_rise`` move the needle of a pair at the start, as in the FMU. Rejects a contact law
    with dissipation, which holds for rigid bodies only.
    """
    name = class_name(model.name)
    lines = [f"model {name} {text(_headline(model))}"]
    lines += _interface(model)
    lines += _modes(model)
    contacts = [contact_text(model, index) for index in range(len(model.contacts))]
    for contact in contacts:
        lines += contact.declarations
    if contacts:
        lines += law_functions(model.contacts)
    lines += ["equation", f"  for i in 1:{model.mode_count} loop", "    der(q[i]) = v[i];"]
    shapes = _shapes(model)
    forces = [f" + {shapes[item.name]}[i]*{item.name}" for item in model.inputs]
    forces += [f" + gap_shape_{contact.suffix}[i]*total_{contact.suffix}" for contact in contacts]
    constant = " + constant_force[i]" if np.any(model.constant) else ""
    lines.append("    der(v[i]) = -omega[i]^2*q[i] - 2*damping[i]*omega[i]*v[i]" + constant)
    lines += [f"     {force}" for force in forces[:-1]]
    lines += [f"     {forces[-1]};" if forces else "      ;", "  end for;"]
    for output in model.outputs:
        state = "q" if output.quantity == "displacement" else "v"
        offset = f" + {number(output.offset)}" if output.offset else ""
        lines.append(f"  {output.name} = {shapes[output.name]}*{state}{offset};")
    for contact in contacts:
        lines += contact.equations
    lines += [*_annotation(model), f"end {name};"]
    return "\n".join(lines) + "\n"


def _headline(model: ModalModel) -> str:
    what = "linear body" if model.kind == "body" else "bodies and their contacts"
    return f"{model.name}: {what} of {model.provenance.case}, by klack {model.provenance.version}"


def _interface(model: ModalModel) -> Iterable[str]:
    for item in model.inputs:
        yield f'  input Real {item.name}(unit="N", start=0) {text(item.description)};'
    for output in model.outputs:
        unit = "m" if output.quantity == "displacement" else "m/s"
        yield f'  output Real {output.name}(unit="{unit}") {text(output.description)};'
    if model.kind == "pair":
        yield from (
            f'  parameter Real start_velocity(unit="m/s") = {number(start_speed(model))} '
            '"Velocity of the moving body at the start, + opening";',
            '  parameter Real start_rise(unit="m") = 0 '
            '"Displacement of the moving body along +z before the start";',
        )
    if any(contact.film and contact.series_compliance for contact in model.contacts):
        yield (
            f'  parameter Real relaxation(unit="s") = {number(relaxation_time(model))} '
            '"Of the compression of a series compliance where its film is weak";'
        )


def _modes(model: ModalModel) -> Iterable[str]:
    m = model.mode_count
    yield from (
        array(
            f'parameter Real omega[{m}](each unit="rad/s")', model.omega, "Angular eigenfrequencies"
        ),
        array(f'parameter Real damping[{m}](each unit="1")', model.damping, "Damping ratios"),
    )
    if np.any(model.constant):
        words = "Modal forces that always act [N/sqrt(kg)]"
        yield array(f"parameter Real constant_force[{m}]", model.constant, words)
    shapes = _shapes(model)
    for name, shape in _named_shapes(model):
        if shapes[name] == f"shape_{name}":
            users = ", ".join(other for other, own in shapes.items() if own == shapes[name])
            words = f"Modal shape of {users} [1/sqrt(kg)]"
            yield array(f"parameter Real shape_{name}[{m}]", shape, words)
    if model.kind == "body":
        start = {"q": "each start=0", "v": "each start=0"}
    else:
        still = model.start_velocity - model.rise * start_speed(model)
        yield from (
            array(
                f"parameter Real rise[{m}]",
                model.rise,
                "Modal displacements of 1 m of rise [sqrt(kg)]",
            ),
            array(f"parameter Real rest[{m}]", model.start, "q at the start [m.sqrt(kg)]"),
        )
        start = {"q": "start=rest + start_rise*rise", "v": "start=start_velocity*rise"}
        if np.any(np.abs(still) > 1e-14 * np.linalg.norm(model.start_velocity)):
            yield array(f"parameter Real drift[{m}]", still, "Further v at the start")
            start["v"] += " + drift"
    yield from (
        f'  Real q[{m}]({start["q"]}, each fixed=true) "Modal displacements [m.sqrt(kg)]";',
        f'  Real v[{m}]({start["v"]}, each fixed=true) "Modal velocities [m/s.sqrt(kg)]";',
    )


def _shapes(model: ModalModel) -> dict[str, str]:
    """Array of the modal shape of each input and output; equal ones share it."""
    first: dict[bytes, str] = {}
    return {
        name: first.setdefault(shape.tobytes(), f"shape_{name}")
        for name, shape in _named_shapes(model)
    }


def _named_shapes(model: ModalModel) -> list[tuple[str, NDArray[np.float64]]]:
    forces = [(item.name, np.asarray(item.shape)) for item in model.inputs]
    return forces + [(output.name, np.asarray(output.shape)) for output in model.outputs]


def _annotation(model: ModalModel) -> Iterable[str]:
    origin = model.provenance
    facts = [
        f"Case: {origin.case} ({origin.title})" if origin.title else f"Case: {origin.case}",
        f"Made by klack {origin.version}, {origin.created}",
        *(f"Mesh of {name}: {words}" for name, words in origin.meshes.items()),
        f"{model.mode_count} modes up to {model.frequencies.max():.6g} Hz",
        "Forces, displacements and velocities are positive along +z (opening)",
    ]
    if model.kind == "body":
        facts.append(
            "Residual compliance (not part of the equations) [m/N]: "
            + "; ".join(" ".join(f"{c:.6g}" for c in row) for row in model.residual_compliance)
        )
    rows = "".join(f"<li>{html.escape(fact, quote=False)}</li>" for fact in facts)
    info = text(f"<html><p>Modes of elastic bodies in SI units.</p><ul>{rows}</ul></html>")
    yield from (
        f"  annotation(Documentation(info={info}),",
        f"    experiment(StartTime=0, StopTime={number(model.duration)}, Tolerance=1e-7, "
        f"Interval={number(model.step)}));",
    )
