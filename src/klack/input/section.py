"""Sections of a case, strict about their keys, and what a key may hold: expressions, files."""

import re
import stat
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Protocol, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    Strict,
    StringConstraints,
    ValidationInfo,
    WithJsonSchema,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from klack.errors import InputError
from klack.input.problem import CaseProblem, nearest, one_of

__all__ = [
    "Computed",
    "Count",
    "InputPath",
    "Name",
    "NamedSection",
    "Number",
    "PlainName",
    "Section",
    "Text",
    "instead_of_file",
    "refuse_lfs_pointer",
]


class _Dimension(Protocol):
    def fits(self, unit: str) -> bool: ...


@dataclass(frozen=True, slots=True)
class Computed:
    """Result of an expression in a case.

    Parameters
    ----------
    value [SI]
    dimension
        Says by ``fits`` whether the value is a quantity with an SI unit, and in words what it is.
    """

    value: float
    dimension: _Dimension
    text: str

    def __str__(self) -> str:
        return f"'{self.text}', which is {self.value:.6g}, {self.dimension}"


def plain_number(value: object) -> object:
    """Number that an expression without unit gave; anything else as it is."""
    if isinstance(value, Computed) and value.dimension.fits("-"):
        return value.value
    return value


Number = Annotated[float, Strict(), BeforeValidator(plain_number)]
Count = Annotated[int, Strict(), Field(ge=1)]
Text = Annotated[str, Strict()]
PlainName = Annotated[str, Strict(), StringConstraints(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")]
"""A name without the sign of a difference, for names in expressions."""
Name = Annotated[str, Strict(), StringConstraints(pattern=r"^[A-Za-z_][A-Za-z0-9_-]*$")]


class Section(BaseModel):
    """A mapping of known keys; nothing else is accepted, nothing can be changed later."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, value: Any, info: ValidationInfo) -> Any:
        if isinstance(value, cls):
            return value
        known = {field.alias or name: field for name, field in cls.model_fields.items()}
        if not isinstance(value, Mapping):
            got, hint = _no_mapping(value, known)
            raise CaseProblem(
                (),
                got=got,
                expected=f"a mapping with the keys: {one_of(known)}",
                hint=hint,
            )
        for key in value:
            if key not in known:
                name, colon, rest = str(key).partition(":")
                if str(key).endswith(")"):
                    otherwise = "lists stand in square brackets: [1, 2]."
                elif str(key)[:1].isdigit():
                    otherwise = "a comma separates keys: use a decimal point."
                else:
                    otherwise = "remove it, or check its indentation."
                hint = nearest(str(key), known, otherwise)
                if colon and name.strip() in known:
                    hint = f"put a space after the colon: {name.strip()}: {rest.strip()}"
                raise CaseProblem(
                    (key,),
                    got=f"the unknown key '{key}'",
                    expected=f"one of: {one_of(known)}",
                    hint=hint,
                    on_key=True,
                )
            own = known[key]  # a key whose default is another value says with null that it is off
            if value[key] is None and own.get_default() is None and info.context is not None:
                raise CaseProblem(
                    (key,),
                    got="nothing",
                    expected=f"{key}: {(own.description or '').rstrip('.')}",
                    hint=f"write its value, or remove '{key}'.",
                )
        for key, field in known.items():
            if field.is_required() and key not in value:
                raise CaseProblem(
                    (),
                    got=f"no key '{key}'",
                    expected=f"{key}: {(field.description or '').rstrip('.')}",
                    hint=f"add '{key}' here; klack schema describes every key.",
                )
        return value

    def _exactly_one(self, names: tuple[str, ...], what: str) -> str:
        """The only key among ``names`` that is given; raise if none or several are."""
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) != 1:
            raise CaseProblem(
                (),
                got=f"{' and '.join(given)} together" if given else "none of them",
                expected=f"exactly one of {one_of(names)} ({what})",
                hint=f"keep one of {one_of(given)}." if given else f"add one, e.g. {names[0]}.",
            )
        return given[0]

    def _refuse_with(self, names: tuple[str, ...], chosen: str, why: str) -> Self:
        """Raise if one of ``names`` is given, for which ``chosen`` has no use."""
        for name in names:
            if getattr(self, name) is not None:
                raise CaseProblem(
                    (name,),
                    got=f"{name} together with {chosen}",
                    expected=f"no {name}: {why}",
                    hint=f"remove {name}.",
                    on_key=True,
                )
        return self


def _no_mapping(value: Any, known: Mapping[str, FieldInfo]) -> tuple[str, str]:
    """What stands in place of a section, and what to write."""
    if isinstance(value, list):
        return "a list", "remove the dashes or brackets around its keys."
    if isinstance(value, str):
        first, _, rest = re.sub(r"\s*[:=]\s*|\s+", " ", value[:80]).partition(" ")
        required = [key for key, info in known.items() if info.is_required()]
        if first in known:
            return f"'{value}'"[:80], f"write '{first}: {rest}', with a colon and a space."
        if len(required) == 1:
            return f"'{value}'"[:80], f"write {{{required[0]}: {value[:80]}}}."
    got = "nothing" if value is None else f"'{value}'"[:80]
    return got, "indent the keys below this one, or write {key: value, ...}."


class NamedSection(Section):
    """Section with a ``name``, which alone is short for it: ``fluid: n-heptane``."""

    @model_validator(mode="before")
    @classmethod
    def _name_alone(cls, value: Any) -> Any:
        return {"name": value} if isinstance(value, str) else value

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler, /
    ) -> JsonSchemaValue:
        """Schema of the mapping or a text; the name replaces required keys."""
        schema = handler.resolve_ref_schema(handler(core_schema))
        required = schema.get("required", ["name"])
        if "name" not in required:
            del schema["required"]
            schema["anyOf"] = [{"required": required}, {"required": ["name"]}]
        schema["type"] = ["string", "object"]
        return schema


_LONGEST = 300  # characters of a name that a message repeats
_LFS_POINTER = b"version https://git-lfs.github.com/spec/"


def refuse_lfs_pointer(path: Path) -> None:
    """Raise for git's placeholder of a large file."""
    try:
        with path.open("rb") as stream:
            start = stream.read(len(_LFS_POINTER))
    except OSError:
        return
    if start == _LFS_POINTER:
        raise InputError(
            str(path),
            got="a git-LFS pointer: a placeholder for a file that was not downloaded",
            expected="the file itself",
            hint="run 'git lfs pull' in its repository, or download the file by hand.",
        )


def instead_of_file(path: Path) -> str:
    """Description of what is in place of a file; empty for a file.

    A name may also be too long, or lie in a folder that is closed to this user.
    """
    try:
        if stat.S_ISREG(path.stat().st_mode):
            return ""
        return "a folder" if path.is_dir() else "no plain file"
    except (FileNotFoundError, NotADirectoryError):
        return "a file that does not exist"
    except (OSError, ValueError) as error:  # a null character in the name
        reason = error.strerror if isinstance(error, OSError) else str(error)
        return f"a file that cannot be reached ({reason})"


def _existing_file(value: Any, info: ValidationInfo) -> Path:
    """Resolve a path from the folder of the case; it must be a file."""
    if isinstance(value, Path):
        value = str(value)
    if not isinstance(value, str) or not value.strip():
        got, hint = f"'{value}'", "write the name of a file, relative to the case file."
        raise CaseProblem((), got=got, expected="a file name", hint=hint)
    folder = info.context.get("folder", Path()) if info.context else Path()
    name = value if len(value) <= _LONGEST else f"{value[:_LONGEST]}..."
    try:
        path = (folder / Path(value).expanduser()).resolve()
    except (OSError, RuntimeError) as error:  # the present folder is gone; links in a circle
        hint = "write the full path of the file."
        got = f"'{name}', which has no target ({error})"
        raise CaseProblem((), got=got, expected="an existing file", hint=hint) from None
    if kind := instead_of_file(path):
        raise CaseProblem(
            (),
            got=f"'{name}', {kind}" + (f" ({path})" if name == value else ""),
            expected="an existing file, relative to the folder of the case",
            hint="check the spelling and the folder.",
        )
    try:
        refuse_lfs_pointer(path)
    except InputError as error:
        raise CaseProblem((), got=error.got, expected=error.expected, hint=error.hint) from error
    return path


InputPath = Annotated[
    Path, BeforeValidator(_existing_file), WithJsonSchema({"type": "string", "format": "path"})
]
"""Field of a section that names an existing file."""
