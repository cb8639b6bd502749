"""User components: classes outside klack, which only the user may allow.

A case file names such a class as ``package.module:Class``, but never has it imported: the class is
handed to the reader of the case, from Python or by the option ``--component`` of a command.
"""

import sys
from collections.abc import Iterable, Mapping
from hashlib import sha256
from importlib import import_module
from pathlib import Path

from klack.errors import InputError, KlackError
from klack.network.catalogue import COMPONENTS
from klack.network.component import Component

__all__ = ["component_word", "import_component", "source_digests"]

_OPTION = "--component"
_REGISTERED = frozenset(path for _, path in COMPONENTS)


def component_word(kind: type[Component]) -> str:
    """Type of a class in a case file, ``package.module:Class``."""
    return f"{kind.__module__}:{kind.__qualname__}"


def import_component(word: str) -> type[Component]:
    """Import the class that the user named; **runs the code of its module**.

    Parameters
    ----------
    word : str
        ``package.module:Class``, of the user, never of a file.

    Raises
    ------
    InputError
        For a word of another form, or a class that cannot be imported or is no component.
    """
    module, colon, name = word.partition(":")
    if not (module and colon and name):
        raise InputError(
            _OPTION,
            got=f"'{word}'",
            expected="package.module:Class",
            hint="write e.g. --component eddy_brake:EddyBrake.",
        )
    try:
        found = getattr(import_module(module), name)
    except KlackError:
        raise
    except Exception as error:  # the user's module may fail in any way while it is imported
        raise InputError(
            f"{_OPTION} {word}",
            got=f"a class that cannot be imported ({error})",
            expected="a class of an installed module, or of one in a folder of PYTHONPATH",
            hint=f"try: python -P -c 'import {module}'.",
        ) from None
    if not (isinstance(found, type) and issubclass(found, Component)):
        raise InputError(
            f"{_OPTION} {word}",
            got="something that is not a component",
            expected="a class derived from klack.network.component.Component",
            hint="see docs/how-to/add-a-component.md.",
        )
    return found


def source_digests(components: Iterable[Component]) -> Mapping[str, str]:
    """User components among these, with the digest of their code.

    Returns
    -------
    mapping of str to str
        By word, in their order: the first 12 digits of the SHA-256 of the file of the class,
        or ``"no file"`` for a class that was typed in.
    """
    kinds = dict.fromkeys(type(component) for component in components)
    return {
        component_word(kind): _digest(kind)
        for kind in kinds
        if f"{kind.__module__}.{kind.__qualname__}" not in _REGISTERED
    }


def _digest(kind: type[Component]) -> str:
    file = getattr(sys.modules.get(kind.__module__), "__file__", None)
    try:
        return sha256(Path(file).read_bytes()).hexdigest()[:12] if file else "no file"
    except OSError:
        return "no file"
