"""Files of included parts, below the folder of the case and kept with its text."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Literal

from pydantic import Field, WithJsonSchema
from ruamel.yaml import YAML

from klack.case.case_text import LARGEST_CASE, Lines, parse, text_of
from klack.case.parameters import PARAMETERS, Written
from klack.errors import InputError, refuse_if
from klack.input.problem import Key, key_text
from klack.input.section import Count, Name, PlainName, Section, Text

__all__ = [
    "DEEPEST",
    "INCLUDE",
    "PARTS",
    "CaseHead",
    "CaseInclude",
    "PartFile",
    "included_files",
    "part_name",
    "self_contained",
    "with_parts",
]


DEEPEST = 8
"""Levels of parts inside parts."""
_MOST_FILES = 100


@dataclass(slots=True)
class _Found:
    """Texts of parts by name, as found."""

    root: Path
    texts: dict[str, str]
    size: int
    seen: set[str] = field(default_factory=set)


def self_contained(text: str, path: Path, data: Any, lines: Lines) -> tuple[str, Any, Lines]:
    """Text of a case with its included files, as plain data and lines.

    Kept by a result, so that later changes of a file change nothing. Texts that the case holds
    replace the files. Rejects includes outside the folder of the case, of themselves, or nested
    too deeply.

    Parameters
    ----------
    data
        Parsed text, perhaps with exchanged values.
    """
    kept = data.get("parts")
    kept = (
        dict(kept)
        if isinstance(kept, Mapping) and all(isinstance(text, str) for text in kept.values())
        else {}
    )
    found = _Found(path.parent, dict(kept), len(text.encode()))
    _collect(found, data, (str(path),), "", lambda key: _where(path, lines, key))
    new = {name: part for name, part in found.texts.items() if name not in kept}
    if not new:
        return text, data, lines
    return with_parts(text, path, found.texts), {**data, "parts": found.texts}, lines


def included_files(data: Any) -> list[tuple[Key, str]]:
    """Included files with their keys; other forms are ignored."""
    entries = data.get("include") if isinstance(data, Mapping) else None
    return [
        (("include", i, "file"), entry["file"])
        for i, entry in enumerate(entries if isinstance(entries, list) else [])
        if isinstance(entry, Mapping) and isinstance(entry.get("file"), str)
    ]


def part_name(folder: str, file: str, where: str) -> str:
    """Included file relative to the folder of the case, with slashes; rejects one outside.

    ``folder`` is that of the including file, relative to that of the case.
    """
    parts: list[str] = []
    bad = not file.strip() or "\\" in file or ":" in file or file.startswith(("/", "~"))
    for part in PurePosixPath(folder, file).parts if not bad else ():
        if part == "..":
            bad = bad or not parts
            parts = parts[:-1]
        else:
            parts.append(part)
    refuse_if(
        bad or not parts or len(file) > 300,
        where,
        got=f"'{file[:100]}'",
        expected="a file in the folder of the case or below, by its relative name with slashes",
        hint="copy the part there: parts/injector.yaml.",
    )
    return "/".join(parts)


def with_parts(text: str, path: Path, texts: Mapping[str, str]) -> str:
    """Text of a case with a section ``parts`` of included files.

    Rejects layouts that take no section at their end.
    """
    data, _ = parse(text, path)
    if "parts" in data:
        body = _without_parts(text, path)
    else:
        body = text if text.endswith("\n") or not text else text + "\n"
    section = "parts:  # the included files as of reading this case\n"
    section += "".join(f"  {json.dumps(name)}: {_scalar(part)}" for name, part in texts.items())
    whole = _in_braces(text, texts) if text.lstrip().startswith("{") else body + section
    expected = {**data, "parts": dict(texts)}
    try:
        same = parse(whole, path)[0] == expected
    except InputError:
        same = False
    refuse_if(
        not same,
        str(path),
        got="a layout in which the included files cannot be kept with the case",
        expected="a mapping in block style: key: value, line by line",
        hint="write the case without a line '...' at its end.",
    )
    return whole


def _in_braces(text: str, texts: Mapping[str, str]) -> str:
    """Case in braces, with included files as last key."""
    root = YAML().compose(StringIO(text))
    end = root.end_mark.index - 1
    body, comma = text[:end].rstrip(), ", " if root.value else ""
    comma = "" if body.endswith(",") else comma
    return f'{body}{comma}"parts": {json.dumps(dict(texts), ensure_ascii=False)}{text[end:]}'


def _without_parts(text: str, path: Path) -> str:
    """Text up to ``parts``, which klack writes last."""
    _, lines = parse(text, path)
    line = lines.keys[("parts",)]
    return "".join(text.splitlines(keepends=True)[: line - 1])


def _scalar(text: str) -> str:
    """Text as a YAML block where possible, else quoted."""
    lines = text.split("\n")
    plain = text.endswith("\n") and not text.endswith("\n\n") and all(map(_is_plain, lines))
    if not plain:
        return json.dumps(text, ensure_ascii=False) + "\n"
    return "|2\n" + "".join(f"    {line}\n" if line else "\n" for line in lines[:-1])


def _is_plain(line: str) -> bool:
    return line.isprintable() and (not line or line.strip() != "")


def _where(path: Path, lines: Lines, key: Key) -> str:
    return f"{path}:{lines.find(key, on_key=False)}: {key_text(key)}"


def _collect(found: _Found, data: Any, above: tuple[str, ...], folder: str, where: Any) -> None:
    """Read all files that plain data and their includes include."""
    for key, file in included_files(data):
        name = part_name(folder, file, where(key))
        if name in above or len(above) > DEEPEST:
            circle = " includes ".join((*above[above.index(name) :], name)) if name in above else ""
            raise InputError(
                where(key),
                got=circle or f"parts inside parts in more than {DEEPEST} levels",
                expected="parts that do not contain themselves"
                if circle
                else f"at most {DEEPEST} levels",
                hint="remove this include.",
            )
        if name not in found.texts:
            found.texts[name] = _read(found, name, where(key))
        if name in found.seen:
            continue
        found.seen.add(name)
        place = found.root / name
        inner, lines = parse(found.texts[name], place)
        below = str(PurePosixPath(name).parent)
        _collect(
            found,
            inner,
            (*above, name),
            "" if below == "." else below,
            lambda at, place=place, lines=lines: _where(place, lines, at),
        )


def _read(found: _Found, name: str, where: str) -> str:
    path = found.root / name
    root = found.root.resolve()
    try:
        inside = path.resolve().is_relative_to(root)
    except (OSError, RuntimeError, ValueError):  # links in a circle, a null character
        inside = True  # reading it says so
    refuse_if(
        not inside,
        where,
        got=f"'{name}', a link that leaves the folder of the case",
        expected="a file in the folder of the case or below",
        hint="copy the part there.",
    )
    try:
        text = text_of(path)
    except InputError as error:
        raise InputError(
            where,
            got=f"'{name}': {error.got}",
            expected="the file of a part (YAML), relative to the file that includes it",
            hint="check the spelling and the folder.",
        ) from None
    found.size += len(text.encode())
    refuse_if(
        found.size > LARGEST_CASE or len(found.texts) >= _MOST_FILES,
        where,
        got="included files of more than "
        f"{LARGEST_CASE / 1e6:g} MB, or more than {_MOST_FILES} of them",
        expected="a case that is small with all its parts",
        hint="use one part several times, with 'count' and 'with'.",
    )
    return text


INCLUDE = "Parts of the network in separate files."
PARTS = "Texts of the included files in a result or another stored case; they replace the files."
"""Descriptions of keys of two sections."""

_Values = Annotated[
    Any,
    WithJsonSchema(
        {
            "type": ["string", "number", "array"],
            "examples": ["80 um", ["80 um", "82 um"]],
        }
    ),
]
_Plain = Annotated[Any, WithJsonSchema({"type": "object"})]


class CaseInclude(Section):
    """A part of a network from a file of its own."""

    file: Text = Field(
        min_length=1,
        description="File of the part, in the folder of the including file or below.",
    )
    name: Name = Field(
        alias="as",
        description="Name of the part, with which the names of its components begin: "
        "injector_needle.",
    )
    count: Count | None = Field(
        default=None, le=1000, description="Number of copies: injector1, injector2, ..."
    )
    arguments: Mapping[PlainName, _Values] = Field(
        default_factory=dict,
        alias="with",
        description="Parameters of the part: a value or an expression of the parameters of this "
        "file and of 'number', which counts the copies from 1; or a list with a value per copy.",
    )


class CaseHead(Section):
    """Sections of a case that are read before all others."""

    parameters: Mapping[PlainName, Written] = Field(default_factory=dict, description=PARAMETERS)
    include: tuple[CaseInclude, ...] = Field(default=(), description=INCLUDE)
    parts: Mapping[Text, Text] = Field(default_factory=dict, description=PARTS)


class PartFile(Section):
    """A part of a network in a file of its own."""

    klack: Literal[1] = Field(description="Format version of the file: 1.")
    part: Text = Field(min_length=1, description="Title, one line.")
    description: Text = Field(
        default="", description="Limits of the part, and the source of its numbers."
    )
    parameters: Mapping[PlainName, Written | None] = Field(
        default_factory=dict,
        description="name: default; without a default (nothing after the colon) 'with' has to "
        "give the "
        "value.",
    )
    ports: Mapping[Name, Text] = Field(
        default_factory=dict,
        description="Names for connections from outside: component.port of this part.",
    )
    include: tuple[CaseInclude, ...] = Field(default=(), description="Parts inside this part.")
    materials: Mapping[Name, _Plain] = Field(default_factory=dict, description="As in a case.")
    bodies: Mapping[Name, _Plain] = Field(default_factory=dict, description="As in a case.")
    stops: Mapping[Name, _Plain] = Field(default_factory=dict, description="As in a case.")
    components: Mapping[Name, _Plain] = Field(
        default_factory=dict, description="name: {type: ..., and the keys of that type}."
    )
    connections: tuple[tuple[Text, ...], ...] = Field(
        default=(),
        description="Connections between ports of this part; ground and ambient are allowed.",
    )
