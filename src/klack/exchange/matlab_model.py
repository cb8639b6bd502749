"""Models as MATLAB files (version 5) with scripts, for MATLAB and Octave."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from klack.contact.step_constants import shared_constants
from klack.errors import refuse_if
from klack.exchange.modal_model import ModalModel, ModelContact
from klack.exchange.model_folder import model_folder, named_apart
from klack.exchange.results.table import octave_text
from klack.exchange.state_space import (
    contact_kind,
    law_table,
    relaxation_time,
    second_order,
    start_speed,
    state_space,
)

__all__ = ["matlab_structure", "write_matlab"]

_SCRIPTS = Path(__file__).with_name("matlab_scripts")
_ALL, _PAIR = ("ss", "mechss", "block"), ("rhs", "impact")
_LARGEST = 2**31 - 2**20  # bytes of one variable of a version 5 file


def write_matlab(models: Sequence[ModalModel], folder: Path) -> tuple[Path, ...]:
    """Write ``NAME.mat`` with one structure ``klack`` for each model, and scripts that use it.

    ``NAME_ss.m`` makes an ``ss`` object, ``NAME_mechss.m`` a sparse second-order one,
    ``NAME_block.m`` a block of Simulink; of a pair ``NAME_rhs.m`` is the right-hand side with the
    contacts and ``NAME_impact.m`` runs it. Returns the ``.mat`` files, each followed by its
    scripts.

    Parameters and errors are those of :func:`klack.exchange.model_folder.model_folder` and
    :func:`matlab_structure`.
    """
    names: list[str] = []
    with model_folder(models, folder) as stage:
        for model in models:
            content = matlab_structure(named_apart(model))
            _require_size(model, content)
            names.append(f"{model.name}.mat")
            scipy.io.savemat(
                stage / names[-1],
                {"klack": content},
                long_field_names=True,
                oned_as="column",
                do_compression=True,
            )
            for script in _ALL + (_PAIR if model.kind == "pair" else ()):
                names.append(f"{model.name}_{script}.m")
                source = (_SCRIPTS / f"{script}.m").read_text(encoding="ascii")
                text = source.replace("@NAME@_" + script.upper(), names[-1][:-2].upper())
                text = text.replace("@NAME@", model.name)
                for constant in shared_constants("MATLAB"):
                    text = text.replace(f"@{constant.name}@", str(constant.value))
                (stage / names[-1]).write_text(text, encoding="ascii", newline="\n")
    return tuple(folder / name for name in names)


def matlab_structure(model: ModalModel) -> dict[str, Any]:
    """Fields of the structure ``klack``; names end with their unit where they have one.

    Matrices of :func:`klack.exchange.state_space.state_space` (``A``, ``B``, ``C``, ``D``, ``x0``,
    ``constant_rate``, ``output_offset``) and :func:`klack.exchange.state_space.second_order`
    (``M``, ``Dm``, ``K``, ``Bm``, ``Cm``, ``Gm``); names and units as cells of text; modes;
    contacts as a cell of structures; what made it.

    Rejects models of more than 2 GB, and contact laws with dissipation.
    """
    first, second, origin = state_space(model), second_order(model), model.provenance
    content: dict[str, Any] = {
        "name": model.name,
        "kind": model.kind,
        "about": _cells(_about(model)),
        "A": first.A,
        "B": first.B,
        "C": first.C,
        "D": first.D,
        "D_with_residual_compliance": first.residual_feedthrough,
        "residual_compliance_m_per_N": model.residual_compliance,
        "constant_rate": first.constant_rate,
        "output_offset": first.output_offset,
        "x0": first.start,
        "M": second.M,
        "Dm": second.D,
        "K": second.K,
        "Bm": second.B,
        "Cm": second.C,
        "Gm": second.G,
        "state_names": _cells(first.state_names),
        "state_units": _cells(first.state_units),
        "input_names": _cells(first.input_names),
        "input_units": _cells(first.input_units),
        "output_names": _cells(first.output_names),
        "output_units": _cells(first.output_units),
        "mode_names": _cells(model.mode_names),
        "frequencies_Hz": model.frequencies,
        "omega": model.omega,
        "damping": model.damping,
        "step_s": model.step,
        "duration_s": model.duration,
        "provenance": {
            "case": octave_text(origin.case),
            "title": octave_text(origin.title),
            "klack_version": origin.version,
            "created": origin.created,
            "meshes": _cells([f"{name}: {words}" for name, words in origin.meshes.items()]),
        },
    }
    if model.kind == "pair":
        content |= _of_pair(model)
    return content


def _of_pair(model: ModalModel) -> dict[str, Any]:
    contacts = np.empty((len(model.contacts), 1), dtype=object)
    for i, contact in enumerate(model.contacts):
        contacts[i, 0] = _contact(contact)
    shapes = [np.asarray(contact.shape) for contact in model.contacts]
    first = state_space(model).start
    return {
        "start_velocity_m_per_s": start_speed(model),
        "rise": model.rise,
        "force_count": len(model.inputs),
        "force_shapes": model.input_matrix(),
        "constant": model.constant,
        "gap_shapes": np.column_stack([np.empty((model.mode_count, 0)), *shapes]),
        "gap0_m": np.array([contact.gap for contact in model.contacts]),
        "contacts": contacts,
        "x_start": np.concatenate([first, np.zeros(len(contacts))]),
        "relaxation_s": relaxation_time(model),
    }


def _contact(contact: ModelContact) -> dict[str, Any]:
    kind, law, film = contact_kind(contact), contact.law, contact.film
    table = law_table(contact) if kind == "table" else np.zeros((0, 5))
    return {
        "name": contact.name,
        "gamma": contact.shape,
        "gap0_m": contact.gap,
        "law_kind": kind,
        "law_parameters": law.flat().parameters if law and kind != "table" else np.zeros((0, 1)),
        "law_table": table,
        "law_indentation_m": table[:, 0],
        "law_force_N": table[:, 1],
        "series_compliance_m_per_N": contact.series_compliance,
        "film_cubic": film.cubic if film else 0.0,
        "film_linear": film.linear if film else 0.0,
        "film_cut_off_m": film.cut_off if film else 0.0,
        "film_suction_N": film.suction if film else 0.0,
    }


def _about(model: ModalModel) -> list[str]:
    origin = model.provenance
    return [
        f"{model.name}: {'linear body' if model.kind == 'body' else 'bodies and their contacts'} "
        f"of case {origin.case}",
        f"klack {origin.version}, {origin.created}",
        "SI units; forces, displacements and velocities are positive along +z",
        "states: modal displacements [m sqrt(kg)], then modal velocities",
    ]


def _cells(words: Sequence[str]) -> np.ndarray[Any, Any]:
    cells = np.empty((len(words), 1), dtype=object)
    cells[:, 0] = [octave_text(word) for word in words]
    return cells


def _require_size(model: ModalModel, content: dict[str, Any]) -> None:
    size = sum(getattr(value, "nbytes", 0) for value in content.values())
    refuse_if(
        size > _LARGEST,
        f"model '{model.name}'",
        got=f"{size / 2**30:.1f} GiB",
        expected="less than 2 GiB, the limit of MATLAB files of version 5",
        hint="keep fewer modes.",
    )
