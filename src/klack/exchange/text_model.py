"""Models as plain text: CSV and ASCII columns, for one-dimensional system tools.

17 digits give the same model to the last bit.
"""

import csv
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.exchange.modal_model import ModalModel, ModelContact
from klack.exchange.model_folder import model_folder, named_apart
from klack.exchange.state_space import FirstOrder, contact_kind, law_table, state_space

__all__ = ["write_text"]

_DIGITS = "%.17g"
_POINTS = 200  # of a law that is a formula
_DEEPEST = 20e-6  # [m] indentation of its table


def write_text(models: Sequence[ModalModel], folder: Path) -> tuple[Path, ...]:
    """Write each model as text files.

    ``NAME_A.csv``, ``_B``, ``_C``, ``_D`` hold bare numbers, one row per line, ``NAME_A.txt`` and
    so on the same with blanks. ``NAME_state_space.csv`` has all four with their names
    (:func:`klack.bodies.model_files.reduced_models.read_state_space`). ``NAME_modes.csv`` has
    frequency, damping and shapes [1/sqrt(kg)]; ``NAME_law.csv`` (``NAME_CONTACT_law.csv`` of
    several) indentation and force; ``NAME_info.txt`` says what is what. A body also has
    ``NAME_D_with_residual_compliance``.

    Parameters and errors as :func:`klack.exchange.matlab_model.write_matlab`.
    """
    names: list[str] = []
    with model_folder(models, folder) as stage:
        for model in models:
            names += _write_model(named_apart(model), stage)
    return tuple(folder / name for name in names)


def _write_model(model: ModalModel, stage: Path) -> Iterable[str]:
    form, name = state_space(model), model.name
    matrices = {"A": form.A, "B": form.B, "C": form.C, "D": form.D}
    further = (
        {"D_with_residual_compliance": form.residual_feedthrough} if model.kind == "body" else {}
    )
    for key, matrix in (matrices | further).items():
        for suffix, separator in (("csv", ","), ("txt", " ")):
            np.savetxt(stage / f"{name}_{key}.{suffix}", matrix, _DIGITS, separator)
            yield f"{name}_{key}.{suffix}"
    with (stage / f"{name}_state_space.csv").open("w", encoding="utf-8", newline="\n") as file:
        for key, matrix in matrices.items():
            file.write(f"{key}, {matrix.shape[0]}, {matrix.shape[1]}\n")
            np.savetxt(file, matrix, _DIGITS, ", ")
        file.write(f"inputs, {', '.join(form.input_names)}\n")
        file.write(f"outputs, {', '.join(form.output_names)}\n")
    yield f"{name}_state_space.csv"
    _write_table(stage / f"{name}_modes.csv", *_modes(model))
    yield f"{name}_modes.csv"
    for contact in model.contacts:
        if contact.law is not None:
            end = "" if len(model.contacts) == 1 else f"_{contact.name}"
            path = stage / f"{name}{end}_law.csv"
            _write_table(path, ["indentation_m", "force_N"], _law_points(contact))
            yield path.name
    path = stage / f"{name}_info.txt"
    path.write_text("\n".join(_info(model, form)) + "\n", encoding="utf-8", newline="\n")
    yield path.name


def _write_table(path: Path, heads: Sequence[str], rows: NDArray[np.float64]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerow(heads)
        np.savetxt(file, rows, _DIGITS, ",")


def _modes(model: ModalModel) -> tuple[list[str], NDArray[np.float64]]:
    """One row per mode; a body has a column for each port, as klack reads it."""
    heads, columns = ["frequency [Hz]", "damping"], [model.frequencies, model.damping]
    if model.kind == "body":
        for output in model.outputs:
            if output.quantity == "displacement":
                heads.append(output.name.removeprefix("displacement_"))
                columns.append(np.asarray(output.shape))
    else:
        for item in model.inputs:
            heads.append(item.name)
            columns.append(np.asarray(item.shape))
    for contact in model.contacts:
        heads.append(f"gap_{contact.name}")
        columns.append(np.asarray(contact.shape))
    return heads, np.column_stack(columns)


def _law_points(contact: ModelContact) -> NDArray[np.float64]:
    """Indentation [m] and force [N] of a table, or of a formula at many points.

    Tools draw their own curves between table points, so each interval has ten further points.
    """
    assert contact.law is not None
    if contact_kind(contact) == "table":
        knots = law_table(contact)[:, 0]
        depth = np.unique(np.concatenate([np.linspace(a, b, 11) for a, b in pairwise(knots)]))
        depth = np.append(depth, 2.0 * knots[-1])  # the linear continuation
    else:
        depth = np.linspace(0.0, _DEEPEST, _POINTS + 1)
    return np.column_stack([depth, contact.law.force(depth)])


def _info(model: ModalModel, form: FirstOrder) -> Iterable[str]:
    origin = model.provenance
    what = "linear body" if model.kind == "body" else "bodies and their contacts"
    yield from (
        f"{model.name}: {what}",
        f"case: {origin.case} ({origin.title})",
        f"made by klack {origin.version}, {origin.created}",
    )
    yield from (f"mesh of {name}: {words}" for name, words in origin.meshes.items())
    yield from (
        "",
        "x' = A x + B u + xc, y = C x + D u + y0; SI units; + is along +z (opening)",
        f"{len(form.start)} states: modal displacements [m.kg^(1/2)], then modal velocities",
        f"{model.name}_modes.csv: frequency, damping ratio, mass-normalised shapes [1/sqrt(kg)]",
        f"modes up to {model.frequencies.max():.6g} Hz; step of klack {model.step:.6g} s",
        "",
    )
    yield from _listed("input", form.input_names, form.input_units)
    yield from _listed("output", form.output_names, form.output_units, form.output_offset, "y0")
    yield from _listed("state", form.state_names, form.state_units, form.start, "start")
    rates = [(k + 1, float(x)) for k, x in enumerate(form.constant_rate) if x]
    yield from (
        "",
        "xc (constant forces): "
        + (", ".join(f"state {k}: {x!r}" for k, x in rates) if rates else "zero"),
    )
    if model.kind == "body":
        yield from (
            "",
            "residual compliance between the inputs [m/N]; not in D:",
        )
        yield from (
            "  " + " ".join(_DIGITS % value for value in row) for row in model.residual_compliance
        )
    for contact in model.contacts:
        yield ""
        yield from _contact(contact)


def _listed(
    word: str,
    names: Sequence[str],
    units: Sequence[str],
    values: NDArray[np.float64] | None = None,
    meaning: str = "",
) -> Iterable[str]:
    for k, (name, unit) in enumerate(zip(names, units, strict=True)):
        value = f", {meaning} = {float(values[k])!r}" if values is not None else ""
        yield f"{word} {k + 1}: {name} [{unit}]{value}"


def _contact(contact: ModelContact) -> Iterable[str]:
    yield f"contact {contact.name}: force over indentation, indentation = -(gap + series * force)"
    kind = contact_kind(contact)
    if kind == "linear":
        yield f"  F = k d, k = {float(contact.law.flat().parameters[0])!r} N/m"  # type: ignore[union-attr]
    elif kind == "power":
        K, n = (float(x) for x in contact.law.flat().parameters)  # type: ignore[union-attr]
        yield f"  F = K d^n, K = {K!r} N/m^n, n = {n!r}"
    elif kind == "table":
        yield "  law: a table, beyond its last but one point a straight line"
    yield f"  series compliance: {contact.series_compliance!r} m/N"
    if contact.film is not None:
        film = contact.film
        yield from (
            "  film: F = (cubic/h^3 + linear/h) V, h = max(gap, 0) + cut_off, F >= -suction",
            f"  cubic = {film.cubic!r} N.s.m^2, linear = {film.linear!r} N.s",
            f"  cut_off = {film.cut_off!r} m, suction = {film.suction!r} N",
        )
