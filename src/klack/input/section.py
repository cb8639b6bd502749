"""Base class of all sections of a case: frozen, documented, and strict about their keys."""

import re
from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    Strict,
    StringConstraints,
    ValidationInfo,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from klack.input.computed import plain_number
from klack.input.problem import CaseProblem, nearest, one_of

__all__ = ["Count", "Name", "NamedSection", "Number", "PlainName", "Section", "Text"]

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
                    otherwise = "a comma separates keys: use a point as decimal sign."
                else:
                    otherwise = "remove it, or check its indentation."
                hint = nearest(str(key), known, otherwise)
                if colon and name.strip() in known:
                    hint = f"write a blank behind the colon: {name.strip()}: {rest.strip()}"
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
        """Name of the only one of these keys that is given; raise if none or several are."""
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
        """Raise if one of the keys ``names`` is given although ``chosen`` has no use for it."""
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
    """What stands there in place of a section, and what to write."""
    if isinstance(value, list):
        return "a list", "remove the dashes or brackets around its keys."
    if isinstance(value, str):
        first, _, rest = re.sub(r"\s*[:=]\s*|\s+", " ", value[:80]).partition(" ")
        required = [key for key, info in known.items() if info.is_required()]
        if first in known:
            return f"'{value}'"[:80], f"write '{first}: {rest}', with a colon and a blank."
        if len(required) == 1:
            return f"'{value}'"[:80], f"write {{{required[0]}: {value[:80]}}}."
    got = "nothing" if value is None else f"'{value}'"[:80]
    return got, "indent the keys below this one, or write {key: value, ...}."


class NamedSection(Section):
    """A section with a key ``name``, for which that name alone is short: ``fluid: n-heptane``."""

    @model_validator(mode="before")
    @classmethod
    def _name_alone(cls, value: Any) -> Any:
        return {"name": value} if isinstance(value, str) else value

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler, /
    ) -> JsonSchemaValue:
        """Schema of the mapping or a text; the name can stand for the required keys."""
        schema = handler.resolve_ref_schema(handler(core_schema))
        required = schema.get("required", ["name"])
        if "name" not in required:
            del schema["required"]
            schema["anyOf"] = [{"required": required}, {"required": ["name"]}]
        schema["type"] = ["string", "object"]
        return schema
