"""``klack export --to mat|csv|fmu|modelica``: bodies and pairs for other simulators."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from klack.terminal.output import Written, staged_folder
from klack.terminal.progress import show_progress

if TYPE_CHECKING:
    from klack.case.schema import Case
    from klack.case.valve import ValveCase
    from klack.exchange.case_models import CaseModels
    from klack.exchange.modal_model import ModalModel

__all__ = ["ModelChoice", "export_models"]


@dataclass(frozen=True, slots=True)
class ModelChoice:
    """Selection of the exported models.

    Parameters
    ----------
    to : "mat", "csv", "fmu" or "modelica"
    part : "body", "pair" or None
        None: both.
    body : str or None
        Only this body.
    fmi : 2 or 3
    platforms : tuple of str or None
    """

    to: str
    part: Literal["body", "pair"] | None
    body: str | None
    fmi: Literal[2, 3]
    platforms: tuple[str, ...] | None


def export_models(
    case: "Case | ValveCase",
    folder: Path,
    choice: ModelChoice,
    *,
    threads: int | None,
    quiet: bool,
) -> Written:
    """Reduce the bodies of a case and write them."""
    from klack.exchange.case_models import case_models

    if choice.to == "fmu":
        from klack.exchange.fmu.compiler import require_compilers

        require_compilers(choice.platforms)
    with show_progress(quiet) as progress:
        every = case_models(case, progress, threads=threads)
        models = chosen(every, choice)
        progress(choice.to, 0.0)
        with staged_folder(folder) as stage:
            write_models(models, stage, choice)
            made = Written.of(folder, stage)
        progress(choice.to, 1.0)
    outside = _outside(every.outside) if every.pair in models else ()
    return replace(made, lines=(*map(described, models), *outside, *made.lines))


def _outside(names: Sequence[str]) -> tuple[str, ...]:
    """What of a valve its pair does not have."""
    if not names:
        return ()
    return (f"Not in the models, yours to add: {', '.join(names)}",)


def chosen(models: "CaseModels", choice: ModelChoice) -> tuple["ModalModel", ...]:
    """Requested models: bodies first, then the pair."""
    bodies: tuple[ModalModel, ...] = ()
    if choice.part != "pair" or choice.body is not None:
        bodies = models.body_models(choice.body)
    pair = choice.part != "body" and choice.body is None
    return (*bodies, models.pair) if pair else bodies


def write_models(models: Sequence["ModalModel"], folder: Path, choice: ModelChoice) -> None:
    """Write models into a folder."""
    if choice.to == "mat":
        from klack.exchange.matlab_model import write_matlab

        write_matlab(models, folder)
    elif choice.to == "csv":
        from klack.exchange.text_model import write_text

        write_text(models, folder)
    elif choice.to == "modelica":
        from klack.exchange.modelica import write_modelica

        write_modelica(models, folder)
    else:
        from klack.exchange.fmu.build import build_fmu

        for model in models:
            path = folder / f"{model.name}.fmu"
            build_fmu(model, path, fmi=choice.fmi, platforms=choice.platforms)


def described(model: "ModalModel") -> str:
    """One line on what a model is."""
    inputs = ", ".join(item.name for item in model.inputs)
    highest = model.frequencies.max() / 1e3 if model.mode_count else 0.0
    words = f"{model.name}: {model.mode_count} modes up to {highest:.4g} kHz, inputs {inputs}"
    if model.contacts:
        words += f", contacts {', '.join(contact.name for contact in model.contacts)}"
    return f"{words}; step {model.step * 1e9:.4g} ns"
