"""Models as flat Modelica text that needs no library: a linear body, or a pair with its contacts.

The text keeps to what every tool takes: arrays of parameters, one loop of equations, functions with
plain algorithms.  Forces come in as ``input Real``, displacements, gaps and contact forces are
``output Real``.
"""

import html
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.exchange.modal_model import ModalModel
from klack.exchange.model_folder import model_folder, named_apart
from klack.exchange.modelica_contact import contact_text, law_functions
from klack.exchange.modelica_words import array, class_name, number, text
from klack.exchange.state_space import relaxation_time, start_speed

__all__ = ["modelica_text", "write_modelica"]


def write_modelica(models: Sequence[ModalModel], folder: Path) -> tuple[Path, ...]:
    """Write one file ``NAME.mo`` for each model.

    Parameters and errors are those of :func:`klack.exchange.model_folder.model_folder`;
    a contact law with dissipation is an error as well.
    """
    names = [f"{class_name(model.name)}.mo" for model in models]
    with model_folder(models, folder) as stage:
        for name, model in zip(names, models, strict=True):
            (stage / name).write_text(modelica_text(named_apart(model)), encoding="utf-8")
    return tuple(folder / name for name in names)


def modelica_text(model: ModalModel) -> str:
    """Return one class of Modelica 3.4 for a body or a pair.

    The states ``q`` and ``v`` are the modal displacements and velocities; parameters
    ``start_velocity`` and ``start_rise`` move the needle of a pair at the start, as in the FMU.

    Raises
    ------
    InputError
        For a contact law with dissipation, which holds for rigid bodies only.
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
    """Array that holds the modal shape of each input and output; equal ones share it."""
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
