"""Case files changed at random, as bytes, as YAML, and in what they mean; from one seed.

Bytes and lines are what a bad disk or a bad merge does.  Most changes keep the YAML whole and get
further: numbers of any size, other units, keys that go, come twice or stand elsewhere, references
to something else, components of another type, aliases and merges.
"""

import copy
import json
import random
import re
from collections.abc import Iterator
from typing import Any

from ruamel.yaml import YAML

__all__ = ["NASTY", "ODD", "changed", "leaves", "mutated"]

NASTY = [
    ".nan", ".inf", "-.inf", "1e400", "-1", "0", "1e-320", "'0 mm'", "'-5 um'", "'1e400 mm'",
    "'nan m'", "'inf bar'", "'1e308 km'", "1e308", "99999999999999999999999999", "null", "~",
    "true", "''", "' '", "[]", "{}", "[[[[1]]]]", "{kind: {kind: x}}", "{type: spring}",
    "[1, two, .nan]", "4.5e28 mm", "[0, 1e308]", "9" * 400, "'" + "9" * 400 + " m/s'",
    "2024-01-01", "0x1F", "0o17", "1_000", "'\u0663 mm'", "'1 mm\\0'", "\"1 mm\\0\"", "\"\\ud800\"",
    "'../../../../../../etc/passwd'", "/dev/zero", "'~nobody/x'", "'a\\nb'", "'{0.__class__}'",
    "'%s%n'", "'" + "9" * 5000 + "'", "'" + "((" * 500 + "'", "!!python/object/apply:os.abort []",
    "!!python/name:os.system", "!!binary aGFsbG8=", "!!set {a, b}", "!!omap [a: 1]", "!<x> y",
    "*nothing", "&a [*a]", "&a {<<: *a}", "{<<: [{a: 1}, {b: 2}]}", "'[a.b, c.d]'", "needle",
    "ground", "'needle.tip'", "-0.0", "1e-400",
]  # fmt: skip

ODD = ["\t", "\r\n", "\ufeff", "\x00", "\x85", "\u2028", "- ", ": ", "{", "}", "[", "]", "'", '"',
       "|", ">", "&a ", "*a", "!!x ", "#", "%YAML 3.0\n", "---\n", "...\n", "<<: *a", "? ", "@",
       "`", "\U0001f600", "e9", ".nan", "-", "1e999", "é"]  # fmt: skip

_UNITS = ["m", "mm", "um", "inch", "km", "s", "ms", "us", "ns", "min", "N", "kN", "Pa", "bar",
          "GPa", "kg", "g", "m/s", "N/mm", "N/m", "deg", "rad", "Hz", "kHz", "%", "K", "degC",
          "mm^2", "mm^3", "l/min", "V", "A", "ohm", "T", "m m m", "1/0", "m^0", "foo",
          ""]  # fmt: skip
_QUANTITY = re.compile(r"([+-]?[\d.]+(?:e[+-]?\d+)?)( ?\S.*)?")
_CASE_HEAD = ("klack", "title")


def leaves(tree: Any, path: tuple = ()) -> Iterator[tuple]:
    """Paths of everything in a tree: sections, lists and single values."""
    items = tree.items() if isinstance(tree, dict) else enumerate(tree)
    for key, value in items:
        yield (*path, key)
        if isinstance(value, dict | list):
            yield from leaves(value, (*path, key))


def changed(tree: Any, path: tuple, text: str) -> str:
    """Give the case as YAML, with other text in the place of one value."""
    whole = copy.deepcopy(tree)
    _parent(whole, path)[path[-1]] = "@@"
    return json.dumps(whole).replace('"@@"', text)


def mutated(source: bytes, draw: random.Random) -> bytes:
    """Change a case once to three times."""
    how = draw.choices(("bytes", "text", "nasty", "meaning"), weights=(1, 1, 2, 6))[0]
    if how == "bytes":
        return _bytes(source, draw)
    if how == "text":
        return _text(source.decode(), draw).encode("utf-8", "surrogatepass")
    tree = json.loads(json.dumps(YAML(typ="safe", pure=True).load(source.decode())))
    places = [path for path in leaves(tree) if path[0] not in _CASE_HEAD]
    if how == "nasty":
        return changed(tree, draw.choice(places), draw.choice(NASTY)).encode()
    for _ in range(draw.randint(1, 3)):
        places = [path for path in leaves(tree) if path[0] not in _CASE_HEAD]
        if places:
            draw.choice(_MEANINGS)(tree, draw.choice(places), places, draw)
    return json.dumps(tree, indent=1).encode()


def _bytes(source: bytes, draw: random.Random) -> bytes:
    data = bytearray(source)
    for _ in range(draw.randint(1, 5)):
        data[draw.randrange(len(data))] = draw.randrange(256)
    return bytes(data[: draw.randrange(len(data))] if draw.random() < 0.2 else data)


def _text(source: str, draw: random.Random) -> str:
    lines = source.splitlines(keepends=True)
    for _ in range(draw.randint(1, 4)):
        i, j = draw.randrange(len(lines)), draw.randrange(len(lines))
        how = draw.choice(("drop", "double", "move", "indent", "outdent", "put", "cut"))
        if how == "drop" and len(lines) > 2:
            del lines[i]
        elif how == "double":
            lines.insert(j, lines[i])
        elif how == "move":
            lines.insert(j, lines.pop(i))
        elif how == "indent":
            lines[i] = draw.choice([" ", "  ", "\t", " " * 60]) + lines[i]
        elif how == "outdent":
            lines[i] = lines[i].lstrip()
        else:
            at = draw.randint(0, len(lines[i]))
            put = draw.choice([*ODD, *NASTY]) if how == "put" else ""
            lines[i] = lines[i][:at] + put + lines[i][at + draw.randint(0, 9) :]
    return "".join(lines)


def _parent(tree: Any, path: tuple) -> Any:
    for key in path[:-1]:
        tree = tree[key]
    return tree


def _number(tree: Any, path: tuple, places: list, draw: random.Random) -> None:
    """Another size, sign or number of digits; numbers are looked for, since most values are not."""
    numbers = [at for at in places if _as_number(_parent(tree, at)[at[-1]])]
    if not numbers:
        return
    path = draw.choice(numbers)
    section, key = _parent(tree, path), path[-1]
    match = _QUANTITY.fullmatch(str(section[key]))
    factor = draw.choice([0.0, -1.0, 0.5, 2.0, 10.0, 0.1, 1e3, 1e-3, 1e6, 1e-6, 1e12, 1e-12, 1e30,
                          1e-30, 1e200, draw.uniform(0.0, 3.0),
                          10.0 ** draw.uniform(-9, 9)])  # fmt: skip
    value = float(match[1]) * factor
    if isinstance(section[key], str):
        section[key] = f"{value!r}{match[2] or ''}"
    else:
        section[key] = int(value) if isinstance(section[key], int) else value


def _as_number(value: Any) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number or (isinstance(value, str) and bool(_QUANTITY.fullmatch(value)))


def _unit(tree: Any, path: tuple, places: list, draw: random.Random) -> None:
    """The same number in another unit."""
    section, key = _parent(tree, path), path[-1]
    match = _QUANTITY.fullmatch(str(section[key]))
    if match:
        section[key] = f"{match[1]} {draw.choice(_UNITS)}".strip()


def _key(tree: Any, path: tuple, places: list, draw: random.Random) -> None:
    """A key goes, gets another name, or moves with its value to another section."""
    section, key = _parent(tree, path), path[-1]
    value = section.pop(key)
    how = draw.choice(["drop", "rename", "move"])
    if isinstance(section, list):
        return
    if how == "rename":
        section[draw.choice([f"{key}x", key.upper(), key[:-1], "kind", "type", "file"])] = value
    elif how == "move":
        others = [at for at in leaves(tree) if isinstance(_parent(tree, at)[at[-1]], dict)]
        if others:
            at = draw.choice(others)
            _parent(tree, at)[at[-1]][key] = value


def _reference(tree: Any, path: tuple, places: list, draw: random.Random) -> None:
    """A word becomes another word of the same case."""
    words = [
        at
        for at in places
        if isinstance(word := _parent(tree, at)[at[-1]], str) and not word[:1].isdigit()
    ]
    if len(words) > 1:
        a, b = draw.sample(words, 2)
        other = _parent(tree, b)[b[-1]]
        if draw.random() < 0.3 and "." in other:
            other = other.partition(".")[draw.choice([0, 2])]
        _parent(tree, a)[a[-1]] = other


def _kind(tree: Any, path: tuple, places: list, draw: random.Random) -> None:
    """A value of another kind: a list of it, a section of it, another value of the case."""
    section, key = _parent(tree, path), path[-1]
    value = section[key]
    other = draw.choice(places)
    section[key] = draw.choice(
        [[value], [value] * 3, {"kind": value}, str(value), None, True, 0, copy.deepcopy(
            _parent(tree, other)[other[-1]])]
    )  # fmt: skip


def _double(tree: Any, path: tuple, places: list, draw: random.Random) -> None:
    """An entry of a list twice, turned round or left out; an entry of a section under two names."""
    section, key = _parent(tree, path), path[-1]
    if isinstance(section, list):
        draw.choice([section.reverse, section.clear, lambda: section.append(section[key])])()
    else:
        section[f"{key}2"] = copy.deepcopy(section[key])


_MEANINGS = (_number, _number, _number, _unit, _key, _reference, _kind, _double)
