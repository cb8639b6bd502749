"""Included parts as components, connections and bodies of the case."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any, Protocol

from klack.case.case_text import parse
from klack.case.expressions.dimension import NUMBER
from klack.case.origin import Filled, Origin
from klack.case.parameters import (
    ParameterValue,
    Scope,
    evaluated,
    is_expression,
    parameter_value,
    parameters_of_text,
)
from klack.case.parts import DEEPEST, CaseInclude, PartFile, part_name
from klack.errors import InputError, refuse_if
from klack.input.problem import Key, nearest, one_of
from klack.input.section import Section

__all__ = ["COUNTER", "Checked", "Merging", "filled", "has_expression", "shown_include"]


_LITERAL = ("title", "description", "parameters", "include", "parts")
_LINKED = ("study", "linked")


def has_expression(data: Any, key: Key = ()) -> bool:
    """Whether a value begins with ``=``."""
    if isinstance(data, dict):
        return any(
            has_expression(value, (*key, name))
            for name, value in data.items()
            if not _is_literal((*key, name))
        )
    if isinstance(data, list):
        return any(has_expression(value, (*key, i)) for i, value in enumerate(data))
    return is_expression(data)


def filled(data: Any, key: Key, scope: Scope, origin: Origin, found: dict[Key, Filled]) -> Any:
    """Copy of plain data with values in place of expressions.

    Parameters
    ----------
    key
        In the expanded case.
    scope
        Names for expressions.
    origin
        Of the data.
    found
        Takes the expressions by key.
    """
    if isinstance(data, Mapping):
        return {
            name: value
            if _is_literal((*key, name))
            else filled(value, (*key, name), scope, origin.below(name), found)
            for name, value in data.items()
        }
    if isinstance(data, list):
        return [
            filled(value, (*key, i), scope, origin.below(i), found) for i, value in enumerate(data)
        ]
    if not is_expression(data):
        return data
    value, sources = evaluated(data, scope, origin.where())
    found[key] = Filled(data.strip(), sources)
    return value


def _is_literal(key: Key) -> bool:
    """Whether texts stay: words, and expressions of a study's parameters."""
    return (len(key) == 1 and key[0] in _LITERAL) or key == _LINKED


COUNTER = "number"
"""Name of the copy number in arguments, from 1."""


def copy_names(item: CaseInclude) -> tuple[str, ...]:
    """Names of the copies of an included part."""
    if item.count is None:
        return (item.name,)
    return tuple(f"{item.name}{number}" for number in range(1, item.count + 1))


def argument_values(item: CaseInclude, number: int, scope: Scope, origin: Origin) -> Scope:
    """Values for the parameters of copy ``number``, from 1.

    ``scope`` is that of the including file, ``origin`` that of the include.
    """
    if item.count is not None:
        refuse_if(
            COUNTER in scope,
            origin.where(("count",), on_key=True),
            got=f"a count together with a parameter '{COUNTER}'",
            expected=f"no such parameter: '{COUNTER}' counts the copies",
            hint="rename the parameter.",
        )
        scope = {**scope, COUNTER: ParameterValue(float(number), NUMBER, str(number))}
    found = {}
    for name, text in item.arguments.items():
        key: Key = ("with", name)
        if isinstance(text, list):
            _require_count(item, text, origin.where(key))
            key, text = (*key, number - 1), text[number - 1]
        # an argument inside a part is no key of the case
        own = () if origin.copy else (*origin.key, *key)
        found[name] = parameter_value(text, scope, origin.where(key), own)
    return found


def shown_include(item: CaseInclude, scope: Scope, origin: Origin) -> dict[str, Any]:
    """Include with the arguments of the first copy, and lists of all."""
    copies = [argument_values(item, n + 1, scope, origin) for n in range(len(copy_names(item)))]
    values = {
        name: tuple(copy[name] for copy in copies) if isinstance(text, list) else copies[0][name]
        for name, text in item.arguments.items()
    }
    count = {} if item.count is None else {"count": item.count}
    return {"file": item.file, "as": item.name, **count, "with": values}


def _require_count(item: CaseInclude, values: list[Any], where: str) -> None:
    refuse_if(
        item.count is None or len(values) != item.count,
        where,
        got=f"a list of {len(values)}",
        expected="one value, or a count together with the list"
        if item.count is None
        else f"one value for each of the {item.count} copies",
        hint="count and list belong together: {count: 2, with: {lift: [80 um, 82 um]}}.",
    )


_MOST_COPIES = 1000
_WORDS = ("ground", "ambient")
_SECTIONS = ("materials", "bodies", "stops")


class Checked(Protocol):
    """Checks plain data against a section, errors at their place."""

    def __call__(self, kind: type[Section], data: Any, origin: Origin, /) -> Any:
        """Return the section."""


@dataclass(slots=True, eq=False)
class _Node:
    """Connection of a part, to be joined by an outer one to one of its ports."""

    ports: list[str]
    origin: Origin
    is_joined: bool = False


_Ports = Mapping[str, Mapping[str, _Node]]
"""Nodes of parts by copy and port."""


@dataclass(slots=True, eq=False)
class Merging:
    """A case into which parts are put.

    Parameters
    ----------
    data
        Without expressions; takes the sections of the parts.
    texts
        Files of the parts by name.
    folder
        Of the case.
    origins, expressions
        By key of the expanded case; take those of the parts.
    """

    data: dict[str, Any]
    texts: Mapping[str, str]
    folder: Path
    checked: Checked
    origins: dict[Key, Origin]
    expressions: dict[Key, Filled]
    _nodes: list[_Node] = field(default_factory=list)
    _copies: int = 0

    def merge(self, includes: Sequence[CaseInclude], scope: Scope, origin: Origin) -> None:
        """Put all parts into the case."""
        network = dict(self.data["network"])
        network["components"] = dict(network.get("components") or {})
        own = list(network.get("connections") or [])
        self.data["network"] = network
        for section in _SECTIONS:
            if section in self.data:
                self.data[section] = dict(self.data[section])
        ports = self._include(includes, scope, origin, "", "", ())
        for copy in ports:
            if copy in network["components"]:
                raise _taken(origin, copy)
        connections = [
            self._resolved(texts, ports, origin.below("network", "connections", i))
            for i, texts in enumerate(own)
        ]
        for node in self._nodes:
            if not node.is_joined:
                self.origins["network", "connections", len(connections)] = node.origin
                connections.append(node.ports)
        network["connections"] = connections

    def _include(
        self,
        includes: Sequence[CaseInclude],
        scope: Scope,
        origin: Origin,
        prefix: str,
        folder: str,
        above: tuple[str, ...],
    ) -> dict[str, dict[str, _Node]]:
        """Put parts in; return their ports."""
        found: dict[str, dict[str, _Node]] = {}
        for i, item in enumerate(includes):
            here = origin.below("include", i)
            name = part_name(folder, item.file, here.where(("file",)))
            refuse_if(
                name in above or len(above) >= DEEPEST,
                here.where(("file",)),
                got=f"'{name}' inside {' inside '.join(above[::-1])}",
                expected=f"parts in at most {DEEPEST} levels that do not contain themselves",
                hint="remove this include.",
            )
            path = self.folder / name
            data, lines = parse(self.texts[name], path)
            part = self.checked(PartFile, data, Origin(path, lines))
            for number, copy in enumerate(copy_names(item), 1):
                if copy in found:
                    raise _taken(here, copy)
                self._copies += 1
                refuse_if(
                    self._copies > _MOST_COPIES,
                    here.where(),
                    got=f"more than {_MOST_COPIES} parts",
                    expected=f"at most {_MOST_COPIES}, parts inside parts counted",
                    hint="check 'count' here and in the included files.",
                )
                given = argument_values(item, number, scope, here)
                for argument in given:
                    _require_parameter(argument, part, here, name)
                _require_given(given, part, here, name)
                there = Origin(path, lines, (), f"{prefix}{copy}")
                values = parameters_of_text(
                    part.parameters,
                    there.below("parameters").where,
                    given,
                    where_given=partial(_where_given, here),
                )
                found[copy] = self._put(part, values, there, name, (*above, name))
        return found

    def _put(
        self, part: PartFile, scope: Scope, origin: Origin, name: str, above: tuple[str, ...]
    ) -> dict[str, _Node]:
        """Put one copy in; return its ports."""
        prefix = f"{origin.copy}_"
        folder = str(PurePosixPath(name).parent).removeprefix(".")
        for section in _SECTIONS:
            for own, written in getattr(part, section).items():
                self._add((section,), own, written, part, scope, origin, folder)
        for own, written in part.components.items():
            self._add(("network", "components"), own, written, part, scope, origin, folder)
        inner = self._include(part.include, scope, origin, prefix, folder, above)
        for copy in inner:
            if copy in part.components:
                raise _taken(origin, copy)
        known: dict[str, Mapping[str, _Node] | None] = {**dict.fromkeys(part.components), **inner}
        nodes = []
        for i, texts in enumerate(part.connections):
            at = origin.below("connections", i)
            nodes.append(_Node(self._within(texts, known, prefix, at), at))
        self._nodes += nodes
        return {
            port: self._exposed(text, known, prefix, nodes, origin.below("ports", port))
            for port, text in part.ports.items()
        }

    def _add(
        self,
        section: Key,
        own: str,
        written: Any,
        part: PartFile,
        scope: Scope,
        origin: Origin,
        folder: str,
    ) -> None:
        """Put in one component, body, material or stop."""
        target = self.data
        for word in section[:-1]:
            target = target[str(word)]
        target = target.setdefault(str(section[-1]), {})
        name = f"{origin.copy}_{own}"
        key: Key = (*section, name)
        at = origin.below(str(section[-1]), own)
        if name in target:
            raise _taken(at, name)
        self.origins[key] = at
        value = filled(written, key, scope, at, self.expressions)
        target[name] = _renamed(section, value, part, f"{origin.copy}_", folder)

    def _within(
        self,
        texts: Sequence[str],
        known: Mapping[str, Mapping[str, _Node] | None],
        prefix: str,
        origin: Origin,
    ) -> list[str]:
        """Ports of an inner connection, by names of the case."""
        found: list[str] = []
        for place, text in enumerate(texts):
            head, _, port = text.partition(".")
            if text in _WORDS:
                found.append(text)
                continue
            _require_known(head, known, origin.where((place,)))
            ports = known[head]
            if ports is None:
                found.append(f"{prefix}{text}")
            else:
                found += _joined(ports, head, port, origin.where((place,)))
        return found

    def _exposed(
        self,
        text: str,
        known: Mapping[str, Mapping[str, _Node] | None],
        prefix: str,
        nodes: Sequence[_Node],
        origin: Origin,
    ) -> _Node:
        """Node behind a port of a part: its connection, or the port alone."""
        head, _, port = text.partition(".")
        _require_known(head, known, origin.where())
        ports = known[head]
        if ports is not None:
            if port not in ports:
                raise _no_port(head, port, ports, origin.where())
            return ports[port]
        whole = f"{prefix}{text}"
        return next((node for node in nodes if whole in node.ports), _Node([whole], origin))

    def _resolved(self, texts: Any, ports: _Ports, origin: Origin) -> Any:
        """Connection with the ports of parts for their short names."""
        if not isinstance(texts, list) or not all(isinstance(text, str) for text in texts):
            return texts  # refused where the case is checked
        found: list[str] = []
        for place, text in enumerate(texts):
            head, dot, port = text.partition(".")
            copies = _copies_of(head, ports)
            if not dot or not copies:
                found.append(text)
            for copy in copies if dot else ():
                found += _joined(ports[copy], copy, port, origin.where((place,)))
        return found


def _copies_of(head: str, ports: _Ports) -> list[str]:
    """Copies that a name means: one, or with a star all."""
    if not head.endswith("*"):
        return [head] if head in ports else []
    stem = head[:-1]
    return [copy for copy in ports if copy.startswith(stem) and copy[len(stem) :].isdigit()]


def _joined(ports: Mapping[str, _Node], copy: str, port: str, where: str) -> list[str]:
    """Ports of the node behind a port of a part, joined to another."""
    if port not in ports:
        raise _no_port(copy, port, ports, where)
    node = ports[port]
    if node.is_joined:
        return node.ports[:1]  # a second time: refused where the network is joined
    node.is_joined = True
    return node.ports


def _renamed(section: Key, value: Any, part: PartFile, prefix: str, folder: str) -> Any:
    """Section of a part with its names in the case."""
    if not isinstance(value, dict):
        return value
    value = _moved(value, folder) if folder else value
    bodies, materials = part.bodies, part.materials

    def inner(name: Any, known: Mapping[str, Any]) -> Any:
        return f"{prefix}{name}" if isinstance(name, str) and name in known else name

    if section[-1] == "components" and value.get("type") == "flexible-body" and "body" in value:
        return {**value, "body": inner(value["body"], bodies)}
    if section[-1] == "bodies" and "material" in value:
        given = value["material"]
        if isinstance(given, dict):
            return {**value, "material": {k: inner(v, materials) for k, v in given.items()}}
        return {**value, "material": inner(given, materials)}
    if section[-1] == "stops" and isinstance(value.get("between"), list):
        return {**value, "between": [_surface(text, bodies, prefix) for text in value["between"]]}
    return value


def _surface(text: Any, bodies: Mapping[str, Any], prefix: str) -> Any:
    known = isinstance(text, str) and text.partition(".")[0] in bodies
    return f"{prefix}{text}" if known else text


def _moved(value: Any, folder: str) -> Any:
    """File names from the folder of the case."""
    if isinstance(value, dict):
        return {
            key: _from(folder, item)
            if key in _FILES and isinstance(item, str)
            else _moved(item, folder)
            for key, item in value.items()
        }
    return [_moved(item, folder) for item in value] if isinstance(value, list) else value


_FILES = ("file",)


def _from(folder: str, name: str) -> str:
    path = Path(name).expanduser()
    return name if path.is_absolute() else f"{folder}/{name}"


def _taken(origin: Origin, name: str) -> InputError:
    return InputError(
        origin.where(),
        got=f"the name '{name}' for the second time",
        expected="a different name for every component and every included part",
        hint="change 'as' of one include: its parts are called NAME_part.",
    )


def _require_parameter(name: str, part: PartFile, origin: Origin, file: str) -> None:
    if name not in part.parameters:
        raise InputError(
            origin.where(("with", name), on_key=True),
            got=f"'{name}', which is not a parameter of '{file}'",
            expected=f"one of: {one_of(part.parameters)}",
            hint=nearest(name, part.parameters, "add it to 'parameters' of the part."),
        )


def _where_given(origin: Origin, name: str) -> str:
    return origin.where(("with", name))


def _require_given(given: Scope, part: PartFile, origin: Origin, file: str) -> None:
    missing = [name for name, text in part.parameters.items() if text is None and name not in given]
    if missing:
        raise InputError(
            origin.where(("with",), on_key=True),
            got=f"no '{missing[0]}', a parameter of '{file}' without a default",
            expected=f"with: {{{missing[0]}: its value}}",
            hint="give it here, or a default in the part.",
        )


def _require_known(head: str, known: Mapping[str, Any], where: str) -> None:
    if head not in known:
        raise InputError(
            where,
            got=f"'{head}', which is not in this part",
            expected=f"component.port of one of: {one_of(known)}",
            hint=nearest(head, known, "a part connects its own components; others join its ports."),
        )


def _no_port(copy: str, port: str, ports: Mapping[str, _Node], where: str) -> InputError:
    return InputError(
        where,
        got=f"'{copy}.{port}', but the part '{copy}' has no port '{port}'",
        expected=f"one of: {one_of(ports)}",
        hint=nearest(port, ports, f"add it to 'ports' of the part, or name {copy}_COMPONENT.port."),
    )
