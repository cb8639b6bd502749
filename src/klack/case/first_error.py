"""First mistake in a case: where, what came, what was expected, what to try."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from klack.case.origin import ExpandedCase
from klack.errors import InputError
from klack.input.problem import CaseProblem, Key, key_text, nearest
from klack.input.section import Computed, Section
from klack.units import QuantityError

__all__ = ["first_error"]


def first_error(case: type[Section], error: ValidationError, found: ExpandedCase) -> InputError:
    """Convert the first error of pydantic, count the others and give the places of some."""
    first, *others = error.errors(include_url=False)
    problem = _problem(first, found.data, case)
    key = _existing(found.data, first["loc"]) + problem.key
    hint = problem.hint
    if problem.on_key and problem.got.startswith("the unknown key") and problem.key:
        hint = _with_its_place(case, key, hint)
    if problem.got.startswith("no key '"):
        name = problem.got.split("'")[1]
        if (path := _elsewhere(found.data, name, ())) and path[:-1] != key:
            line = found.origin(path).where(on_key=True).removesuffix(f": {key_text(path)}")
            hint = f"'{name}' is in '{key_text(path[:-1])}' ({line}): check its indentation."
    if more := _further([_existing(found.data, one["loc"]) for one in (first, *others)], found):
        hint += f"\n({more})"
    got, written = problem.got, found.expressions.get(key)
    if written and written.text not in got:
        got += f", from '{written.text}'"
    where = found.origin(key).where(on_key=problem.on_key)
    return InputError(where, got=got, expected=problem.expected, hint=hint)


def _further(keys: Sequence[Key], found: ExpandedCase) -> str:
    """Number and places of problems after the first, without sections that fail for a part."""
    whole = [
        key for key in keys[1:] if all(key == other or key != other[: len(key)] for other in keys)
    ]
    if not whole:
        return ""
    places = [found.origin(key).where() for key in dict.fromkeys(whole)]
    end = ", ..." if len(places) > _MOST_PLACES else ""
    problems = "problem" if len(whole) == 1 else "problems"
    return f"{len(whole)} more {problems}: {', '.join(places[:_MOST_PLACES])}{end}"


def _elsewhere(data: Any, name: str, path: Key) -> Key:
    """Path of the first key of this name, or empty."""
    if not isinstance(data, dict):
        return ()
    if name in data:
        return (*path, name)
    return next((at for k, v in data.items() if (at := _elsewhere(v, name, (*path, k)))), ())


def _with_its_place(case: type[BaseModel], key: Key, hint: str) -> str:
    """Advice for an unknown key that is known elsewhere."""
    if "did you mean" in hint or key[:2] == ("network", "components"):
        return hint
    homes = _homes(case, str(key[-1]))
    if 0 < len(homes) <= _MOST_PLACES:
        return f"it belongs in {' or '.join(homes)}; check its indentation."
    return hint if len(key) > 1 else nearest(str(key[-1]), ("network",), hint)


_MOST_PLACES = 3  # that a message names


def _homes(section: type[BaseModel], name: str, path: str = "") -> list[str]:
    """Places of a key in all sections, ``bodies.NAME.mesh.size``; shortest first."""
    found, below = [], []
    for field, info in section.model_fields.items():
        key = f"{path}{info.alias or field}"
        if path and (info.alias or field) == name:
            found.append(key)
        for kind, many in _sections(info.annotation):
            if path.count(".") < _DEEPEST:
                below += _homes(kind, name, f"{key}.NAME." if many else f"{key}.")
    return sorted(dict.fromkeys(found + below), key=lambda place: place.count("."))


_DEEPEST = 5  # levels in which a misplaced key is looked for


def _sections(kind: Any, many: bool = False) -> Iterator[tuple[type[BaseModel], bool]]:
    """Sections in a type, and whether their names are the user's."""
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        yield kind, many
    mapping = isinstance(get_origin(kind), type) and issubclass(get_origin(kind), Mapping)
    for part in get_args(kind):
        yield from _sections(part, many or mapping)


def _existing(data: Any, location: Sequence[str | int]) -> Key:
    """Location of pydantic without parts that are not in the file (tags of unions)."""
    key: list[str | int] = []
    for part in location:
        if isinstance(data, dict) and part in data:
            data = data[part]
        elif isinstance(data, list) and isinstance(part, int) and part < len(data):
            data = data[part]
        else:
            continue
        key.append(part)
    return tuple(key)


def _problem(details: ErrorDetails, data: Any, case: type[Section]) -> CaseProblem:
    """Message of klack for one error of pydantic."""
    own = details.get("ctx", {}).get("error")
    if isinstance(own, CaseProblem):
        return own
    if isinstance(own, InputError):
        hint = own.hint
        if isinstance(own, QuantityError):
            from klack.case.field_example import fitting_example  # loads what a network is

            example = fitting_example(case, data, _existing(data, details["loc"]), own.kind)
            hint = hint.replace(own.kind.example, example)
        return CaseProblem((), got=own.got, expected=own.expected, hint=hint)
    value = _value_at(data, _existing(data, details["loc"]))
    kind, context = details["type"], details.get("ctx", {})
    key: Key = ()
    if kind == "union_tag_invalid" and isinstance(value, dict):
        name = _discriminator(context)
        key, value = (name,), value.get(name)
    expected, hint = _words(kind, context, value)
    if not expected:
        expected, hint = details["msg"], "klack schema describes every key."
    return CaseProblem(key, got=_shown(value), expected=expected, hint=hint)


def _discriminator(context: dict[str, Any]) -> str:
    """Key that decides between forms of a section."""
    return str(context["discriminator"]).strip("'")


_BOUNDS = {
    "greater_than": ("gt", "above {}"),
    "greater_than_equal": ("ge", "{} or more"),
    "less_than": ("lt", "below {}"),
    "less_than_equal": ("le", "{} or less"),
}
_TYPES = {
    "int_type": ("a whole number", "write it without quotes and without a point."),
    "int_from_float": ("a whole number", "write it without a point."),
    "float_type": ("a number without a unit", "write it without quotes."),
    "finite_number": ("a finite number", "write plain digits."),
    "string_type": ("text", 'put it into quotes: "...".'),
    "bool_type": ("true or false", "write it without quotes."),
    "tuple_type": ("a list", "write it in brackets: [value, value]."),
    "model_attributes_type": ("a mapping", "write {kind: ...}."),
    "mapping_type": ("a mapping", "write {name: value, ...}."),
    "dict_type": ("a mapping", "write {name: value, ...}."),
    "string_pattern_mismatch": (
        "a name of letters, digits, _ and -, not starting with a digit",
        "rename it here and where it is used.",
    ),
}


_PLAIN_NAME = (
    "a name of letters, digits and _, not starting with a digit",
    "rename it here and where it is used: '-' means a difference.",
)


_MEANT = {
    **dict.fromkeys(("3d", "3-d", "three-dimensional", "volume"), ("solid", "swept")),
    **dict.fromkeys(("2d", "2-d", "plane", "rotational"), ("axisymmetric",)),
}
"""Words of other programs, and klack's."""
_WITHOUT_UNIT = "write only the number; the unit of coordinates is the 'unit' in the same section."


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _words(kind: str, context: dict[str, Any], value: Any) -> tuple[str, str]:
    """Expected value and advice for built-in errors of pydantic."""
    if kind == "string_pattern_mismatch" and "_-]" not in context["pattern"]:
        return _PLAIN_NAME
    if kind == "float_type" and isinstance(value, str) and not _is_number(value):
        minus = value.startswith("\N{MINUS SIGN}")
        return "a number without a unit", "write the minus sign as '-'." if minus else _WITHOUT_UNIT
    if kind == "int_type" and isinstance(value, str) and not _is_number(value):
        return "a whole number", "write digits, such as 5."
    if kind == "tuple_type" and isinstance(value, dict):
        return "a list", f"write '- ' in front of each item, or [{next(iter(value), '')}, ...]."
    if kind == "tuple_type" and isinstance(value, str) and not set(value) & set("[]{}"):
        return "a list", f"write it in brackets: [{value[:80]}]."
    if kind in _TYPES:
        return _TYPES[kind]
    if kind in _BOUNDS:
        name, form = _BOUNDS[kind]
        return (
            f"a value {form.format(f'{context[name]:g}')}",
            "check the sign, the unit and the magnitude.",
        )
    if kind in ("literal_error", "union_tag_invalid"):
        allowed = str(context.get("expected") or context.get("expected_tags"))
        names = [
            {"True": "true", "False": "false"}.get(part, part)
            for part in allowed.replace(" or ", ", ").replace("'", "").split(", ")
            if part
        ]
        meant = [name for name in _MEANT.get(str(value).lower(), ()) if name in names]
        hint = f"write {' or '.join(meant)}." if meant else "write one of these words."
        return f"one of: {', '.join(names)}", nearest(str(value), names, hint)
    if kind == "union_tag_not_found":
        name = _discriminator(context)
        example = "consistent" if name == "kind" else "..."
        return f"a mapping with the key '{name}'", f"write {{{name}: {example}}}."
    if kind == "too_short":
        return f"at least {context['min_length']} of them", "add what is missing."
    if kind == "too_long":
        most = context["max_length"]
        commas = most == 2 and len(value) in (3, 4) and any(isinstance(x, int) for x in value)
        hint = "remove the surplus value." + " Use a decimal point: [2.5, 1.9]." * commas
        return f"at most {most} of them", hint
    if kind == "missing":
        return (
            "a list with one more value",
            "separate values with commas: a point is [r, z], a pair is [first, second].",
        )
    if kind == "string_too_short":
        return "some text", "write one line."
    return "", ""


def _value_at(data: Any, key: Key) -> Any:
    for part in key:
        data = data[part]
    return data


def _shown(value: Any) -> str:
    """Short form of the value found."""
    if isinstance(value, dict):
        return f"a mapping with the keys: {', '.join(map(str, value)) or 'none'}"[:100]
    if isinstance(value, list):
        return f"the list {value}"[:80]
    if value is None:
        return "nothing"
    if isinstance(value, Computed):
        return str(value)
    return f"'{value}'"[:80] if isinstance(value, str) else str(value).lower()
