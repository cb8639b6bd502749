"""``modelDescription.xml`` of an FMU: what an importing program reads before it loads anything.

FMI 2.0 counts variables from 1 in its model structure, FMI 3.0 names them by value reference
(:mod:`klack.exchange.fmu.variables`). Version 2 leaves the time out, over which some importers
stumble; version 3 needs it. The event indicator of a contact is its gap.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from klack.contact.laws import HuntCrossley
from klack.exchange.fmu.variables import UNITS, FmuVariable, fmu_variables
from klack.exchange.modal_model import ModalModel, ModelContact

__all__ = [
    "SOURCE_FILES",
    "build_description",
    "communication_step",
    "model_description",
    "supports_model_exchange",
]


def supports_model_exchange(model: ModalModel) -> bool:
    """Whether the forces of a model follow from its states.

    Not where forces depend on the rate of a surface behind a series compliance: a squeeze film
    (its time constant falls with the third power of the gap, far below any step) or a damped law.
    Such a model has co-simulation alone.
    """
    return not any(
        contact.series_compliance > 0.0 and feels_speed(contact) for contact in model.contacts
    )


def feels_speed(contact: ModelContact) -> bool:
    """Whether a contact force depends on the rate of its gap."""
    return contact.film is not None or isinstance(contact.law, HuntCrossley)


@dataclass(frozen=True, slots=True, kw_only=True)
class Dependencies:
    """Value references of unknowns and what they depend on, increasing.

    For algebraic loops and the pattern of the Jacobian. No output depends directly on an input:
    forces act on velocities, those on displacements.

    Parameters
    ----------
    running : mapping of output or derivative to states and inputs
    at_start : mapping of output, calculated state or derivative to parameters, inputs and states
        that are given before the start.
    indicators
        Event indicators: the gap of each contact.
    """

    outputs: tuple[int, ...]
    derivatives: tuple[int, ...]
    running: Mapping[int, tuple[int, ...]]
    at_start: Mapping[int, tuple[int, ...]]
    indicators: tuple[int, ...]


def dependencies_of(model: ModalModel) -> Dependencies:
    """Dependencies of all outputs and derivatives of a model."""
    variables = fmu_variables(model)
    references = {variable.name: r for r, variable in enumerate(variables)}
    derivatives = tuple(r for r, v in enumerate(variables) if v.derivative_of is not None)
    outputs = tuple(r for r, v in enumerate(variables) if v.causality == "output")
    m = model.mode_count
    first = len(variables) - 2 * len(derivatives)
    moved, moving = first + np.arange(m), first + m + np.arange(m)

    contact_states = tuple(_picked(moved, contact.shape) for contact in model.contacts)
    force_states = tuple(
        states + (_picked(moving, contact.shape) if feels_speed(contact) else ())
        for states, contact in zip(contact_states, model.contacts, strict=True)
    )
    running: dict[int, tuple[int, ...]] = {}
    rows = iter(outputs)
    for output in model.outputs:
        rates = output.quantity == "velocity"
        running[next(rows)] = _picked(moving if rates else moved, output.shape)
    indicators = []
    for c, contact in enumerate(model.contacts):
        indicators.append(next(rows))
        running[indicators[c]] = contact_states[c]
        for _ in range(3 if contact.film is None else 4):
            running[next(rows)] = force_states[c]
    for i in range(m):
        running[derivatives[i]] = (int(moving[i]),)
        known = {int(moved[i])} if model.omega[i] else set()
        known |= {int(moving[i])} if model.omega[i] and model.damping[i] else set()
        known |= {r for r, item in enumerate(model.inputs) if item.shape[i]}
        for contact, states in zip(model.contacts, force_states, strict=True):
            known |= set(states) if contact.shape[i] else set()
        running[derivatives[m + i]] = tuple(sorted(known))

    given: dict[int, tuple[int, ...]] = {}
    if model.kind == "pair":
        for own, name in ((moved, "start_rise"), (moving, "start_velocity")):
            for i, state in enumerate(own):
                given[int(state)] = (references[name],) if model.rise[i] else ()
    at_start = dict(given)
    for unknown, known_now in running.items():
        roots = {root for known in known_now for root in given.get(known, (known,))}
        at_start[unknown] = tuple(sorted(roots))
    return Dependencies(
        outputs=outputs,
        derivatives=derivatives,
        running=running,
        at_start=at_start,
        indicators=tuple(indicators),
    )


def _picked(references: NDArray[np.int64], shape: NDArray[np.float64]) -> tuple[int, ...]:
    return tuple(int(r) for r in references[np.asarray(shape) != 0.0])


SOURCE_FILES = {2: ("klack_model.c", "klack_fmi2.c"), 3: ("klack_model.c", "klack_fmi3.c")}
"""C sources of both versions."""

_DISPLAY_UNITS = {"m": ("um", 1e6), "s": ("us", 1e6)}
_TOLERANCE = 1e-8
_LONGEST, _FEWEST = 50, 500
_LICENSE = "BSD-3-Clause for the C sources; the numbers belong to the author of the model"
_COPYRIGHT = "C sources: (c) 2026, the klack founders"


def model_description(model: ModalModel, *, fmi: Literal[2, 3], guid: str) -> str:
    """XML text of the model description.

    Parameters
    ----------
    fmi
        Version of the standard.
    guid
        Compared by the binary at instantiation.
    """
    variables = fmu_variables(model)
    exchange = supports_model_exchange(model)
    root = ET.Element("fmiModelDescription", _head(model, fmi, guid))
    _interfaces(root, model, fmi, exchange)
    _units(root, variables)
    categories = ET.SubElement(root, "LogCategories")
    ET.SubElement(
        categories, "Category", name="logStatusError", description="Why a function failed"
    )
    ET.SubElement(
        root,
        "DefaultExperiment",
        startTime="0",
        stopTime=_number(model.duration),
        tolerance=_number(_TOLERANCE),
        stepSize=_number(communication_step(model)),
    )
    found = dependencies_of(model)
    if fmi == 2 and exchange:
        root.set("numberOfEventIndicators", str(len(model.contacts)))
    _variables(root, model, variables, fmi, exchange)
    _structure(root, variables, found, fmi, exchange)
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, "unicode") + "\n"


def communication_step(model: ModalModel) -> float:
    """Recommended communication step [s]: 50 internal ones, but 500 or more in a first simulation.

    Rounded down to 1, 2 or 5 times a power of ten. Inputs are held over a step: the error of a
    coupled simulation is of first order. Contacts are integrated with the internal step.
    """
    longest = min(_LONGEST * model.step, model.duration / _FEWEST)
    mantissa, exponent = f"{longest * (1 + 1e-9):.15e}".split("e")
    return float(f"{max(d for d in (1, 2, 5) if d <= float(mantissa))}e{exponent}")


def _head(model: ModalModel, fmi: int, guid: str) -> dict[str, str]:
    made = model.provenance
    words = {"body": "linear body", "pair": "bodies and their contacts"}[model.kind]
    return {
        "fmiVersion": {2: "2.0", 3: "3.0"}[fmi],
        "modelName": model.name,
        {2: "guid", 3: "instantiationToken"}[fmi]: guid,
        "description": _text(f"{made.title or made.case}: {words}, {model.mode_count} modes"),
        "author": f"klack {made.version}",
        "version": _text(made.version),
        "copyright": _COPYRIGHT,
        "license": _LICENSE,
        "generationTool": _text(f"klack {made.version}"),
        "generationDateAndTime": _text(made.created),
        "variableNamingConvention": "structured",
    }


def _interfaces(root: ET.Element, model: ModalModel, fmi: int, exchange: bool) -> None:
    common = {"modelIdentifier": model.name}
    if fmi == 2:
        common |= {
            "canNotUseMemoryManagementFunctions": "true",
            "canGetAndSetFMUstate": "true",
            "canSerializeFMUstate": "true",
        }
        derivative = "providesDirectionalDerivative"
    else:
        common |= {"canGetAndSetFMUState": "true", "canSerializeFMUState": "true"}
        derivative = "providesDirectionalDerivatives"
    elements = []
    if exchange:
        # in co-simulation no output depends directly on an input
        elements.append(ET.SubElement(root, "ModelExchange", common | {derivative: "true"}))
    stepping = {"canHandleVariableCommunicationStepSize": "true"}
    elements.append(ET.SubElement(root, "CoSimulation", common | stepping))
    if fmi == 2:
        for element in elements:
            files = ET.SubElement(element, "SourceFiles")
            for name in SOURCE_FILES[2]:
                ET.SubElement(files, "File", name=name)


def _units(root: ET.Element, variables: Sequence[FmuVariable]) -> None:
    definitions = ET.SubElement(root, "UnitDefinitions")
    used = {variable.unit for variable in variables} | {"s"}
    for name, exponents in UNITS.items():
        if name not in used:
            continue
        unit = ET.SubElement(definitions, "Unit", name=name)
        if exponents:
            ET.SubElement(unit, "BaseUnit", {base: str(n) for base, n in exponents.items()})
        if name in _DISPLAY_UNITS:
            shown, factor = _DISPLAY_UNITS[name]
            ET.SubElement(unit, "DisplayUnit", name=shown, factor=_number(factor))


# --------------------------------------------------------------------------- variables


def _initial(model: ModalModel, variable: FmuVariable) -> str | None:
    """How the start value comes about; None where the standard allows no word."""
    if variable.causality == "input":
        return None
    known = variable.start is not None and (
        variable.causality == "parameter" or model.kind == "body"
    )
    return "exact" if known else "calculated"


def _attributes(model: ModalModel, variable: FmuVariable) -> dict[str, str]:
    """Attributes of the number, the same in both versions."""
    found = {"unit": variable.unit}
    for word, value in (
        ("min", variable.minimum),
        ("max", variable.maximum),
        ("nominal", variable.nominal),
    ):
        if value is not None:
            found[word] = _number(value)
    if variable.start is not None and _initial(model, variable) != "calculated":
        found["start"] = _number(variable.start)
    return found


def _words(model: ModalModel, variable: FmuVariable, reference: int) -> dict[str, str]:
    found = {
        "name": variable.name,
        "valueReference": str(reference),
        "description": _text(variable.description),
        "causality": variable.causality,
        "variability": variable.variability,
    }
    initial = _initial(model, variable)
    return found if initial is None else found | {"initial": initial}


def _variables(
    root: ET.Element, model: ModalModel, variables: Sequence[FmuVariable], fmi: int, exchange: bool
) -> None:
    """Variables; in version 2 each with an element for its number; derivatives from 1."""
    listed = ET.SubElement(root, "ModelVariables")
    for reference, variable in enumerate(variables):
        words, number = _words(model, variable, reference), _attributes(model, variable)
        if variable.derivative_of is not None and exchange:
            number["derivative"] = str(variable.derivative_of + (fmi == 2))
        if fmi == 2:
            ET.SubElement(ET.SubElement(listed, "ScalarVariable", words), "Real", number)
        else:
            ET.SubElement(listed, "Float64", words | number)
    if fmi == 3:
        ET.SubElement(
            listed,
            "Float64",
            name="time",
            valueReference=str(len(variables)),
            description="Time",
            causality="independent",
            variability="continuous",
            unit="s",
        )


# --------------------------------------------------------------------------- structure


def _structure(
    root: ET.Element,
    variables: Sequence[FmuVariable],
    found: Dependencies,
    fmi: int,
    exchange: bool,
) -> None:
    """Dependencies: by counts from 1 in version 2, by references in version 3.

    Initialization computes outputs, and in model exchange states and derivatives.
    """
    structure = ET.SubElement(root, "ModelStructure")
    initial = [r for r in sorted(found.at_start) if variables[r].causality == "output" or exchange]
    for title, word, references, known, wanted in (
        ("Outputs", "Output", found.outputs, found.running, True),
        ("Derivatives", "ContinuousStateDerivative", found.derivatives, found.running, exchange),
        ("InitialUnknowns", "InitialUnknown", initial, found.at_start, True),
        ("", "EventIndicator", found.indicators, found.running, exchange and fmi == 3),
    ):
        rows = references if wanted else ()
        group = ET.SubElement(structure, title) if fmi == 2 and rows else structure
        for r in rows:
            depends = " ".join(str(k + (fmi == 2)) for k in known[r])
            if fmi == 2:
                ET.SubElement(group, "Unknown", index=str(r + 1), dependencies=depends)
            else:
                ET.SubElement(structure, word, valueReference=str(r), dependencies=depends)


# --------------------------------------------------------------------------- text


def _number(value: float) -> str:
    """Shortest text that reads back equal."""
    return repr(float(value))


def _text(text: str) -> str:
    """One line that XML can hold."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def build_description(model: ModalModel) -> str:
    """XML text: one configuration for every C99 compiler and platform."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=model.name)
    files = ET.SubElement(configuration, "SourceFileSet", language="C99")
    for name in SOURCE_FILES[3]:
        ET.SubElement(files, "SourceFile", name=name)
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, "unicode") + "\n"
