"""FMUs in place of controllers, by component."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from klack.case.valve import ValveCase
from klack.control.controlled import Controlled
from klack.errors import InputError, refuse_if
from klack.input.problem import nearest, one_of
from klack.mechanics.fmu_controller import FmuController, controlled_by_fmu

__all__ = ["controller_files", "controller_notes", "with_controllers"]


def controller_files(given: Sequence[str]) -> dict[str, Path]:
    """Files by component, of texts NAME=FILE.fmu."""
    files: dict[str, Path] = {}
    for text in given:
        name, sign, file = text.partition("=")
        refuse_if(
            not (name and sign and file) or name in files,
            "--controller",
            got=f"'{text}'"
            + (", the second controller of that component" if name in files else ""),
            expected="NAME=FILE.fmu, once for each controlled component of the case",
            hint="for example: --controller driver=controller.fmu",
        )
        files[name] = Path(file)
    return files


def with_controllers(case: ValveCase, files: Mapping[str, Path]) -> ValveCase:
    """Case with FMUs in place of some controllers."""
    components = dict(case.network.components)
    controlled = [name for name, part in components.items() if isinstance(part, Controlled)]
    for name, file in files.items():
        part = components.get(name)
        if not isinstance(part, Controlled):
            raise InputError(
                "controller",
                got=f"'{name}'" + (f", a {part.type}" if part is not None else ""),
                expected=f"one of: {one_of(controlled)}"
                if controlled
                else "a case with a controlled-voltage, controlled-force or controlled-pressure",
                hint=nearest(name, controlled, "name the controlled component of the case."),
            )
        components[name] = controlled_by_fmu(part, file)
    network = case.network.model_copy(update={"components": components})
    return case.model_copy(update={"network": network})


def controller_notes(case: ValveCase) -> tuple[str, ...]:
    """FMUs of a run, which its record does not hold."""
    notes = []
    for name, part in case.network.components.items():
        law = part.own_law if isinstance(part, Controlled) else None
        if isinstance(law, FmuController):
            notes.append(f"the controller of '{name}' is {law.told}.")
    return tuple(notes)
