"""Read the case of a whole valve, or a case of either kind.

Apart from :mod:`klack.case.reader`, because the components of a network take a while to import.

A case file runs no code.  Components of the user's own are classes that the caller hands over; the
file names them ``package.module:Class``.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from klack.case.any_case import AnyCase, case_kind
from klack.case.reader import parse, schema_of, text_of, validated
from klack.case.valve import ValveCase, require_valve
from klack.network.component import Component
from klack.network.own_component import component_word

__all__ = [
    "OwnComponents",
    "load_any_case",
    "load_valve_case",
    "read_any_case",
    "read_valve_case",
    "valve_case_schema",
]

OwnComponents = Iterable[type[Component]]
"""User components that a case may name."""


def load_valve_case(path: str | Path, components: OwnComponents = ()) -> ValveCase:
    """Read and check the case file of a whole valve; see :func:`klack.case.reader.load_case`.

    Parameters
    ----------
    path : str or Path
    components : iterable of type
        Components of the user's own that the case may name, as ``package.module:Class``.
    """
    path = Path(path)
    return read_valve_case(text_of(path), path, components)


def load_any_case(path: str | Path, components: OwnComponents = ()) -> AnyCase:
    """Read and check a case file of either kind: with a section ``network`` it is a valve."""
    path = Path(path)
    return read_any_case(text_of(path), path, components)


def read_valve_case(text: str, path: Path, components: OwnComponents = ()) -> ValveCase:
    """Check the text of a case of a whole valve that lies (or will lie) at ``path``."""
    data, lines = parse(text, path)
    require_valve(data, path, lines)
    own = {component_word(kind): kind for kind in components}
    return validated(ValveCase, text, path, data, lines, own)


def read_any_case(text: str, path: Path, components: OwnComponents = ()) -> AnyCase:
    """Check the text of a case of either kind."""
    data, lines = parse(text, path)
    own = {component_word(kind): kind for kind in components}
    return validated(case_kind(data), text, path, data, lines, own)


def valve_case_schema() -> dict[str, Any]:
    """JSON schema of a case of a whole valve, with all components."""
    return schema_of(ValveCase)
