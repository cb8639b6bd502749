"""What ``klack show --components`` says: every component type, in two tables and as JSON."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from klack.network.described import DescribedKey, DescribedType
from klack.terminal.plain_math import plain_math
from klack.terminal.tables import TextTable

if TYPE_CHECKING:
    from klack.analyses.json_results import ComponentsJson

__all__ = ["component_tables", "components_json"]

_NONE = "-"


def component_tables(types: Sequence[DescribedType]) -> Iterator[TextTable]:
    """Ports and keys of every type, then equations and sources; what is optional in brackets."""
    yield TextTable(
        title="Component types: what may be left out is in brackets",
        columns=("type", "what it is", "ports", "keys"),
        rows=[(item.word, _summary(item), _ports(item), _keys(item.keys)) for item in types],
        left=4,
    )
    yield TextTable(
        title="Equations and sources",
        columns=("type", "equation", "source"),
        rows=[
            (item.word, plain_math(item.equation) or _NONE, item.source or _NONE)
            for item in types
            if item.equation or item.source
        ],
        left=3,
    )


def _summary(item: DescribedType) -> str:
    return plain_math(item.summary) if "\\" in item.summary else item.summary


def _ports(item: DescribedType) -> str:
    """``a, b: hydraulic; needle, (body): mechanical``."""
    if not item.ports:
        return "its points: mechanical" if "points" in item.keys else _NONE
    domains = dict.fromkeys(port.domain for port in item.ports.values())
    return "; ".join(
        ", ".join(
            f"({name})" if port.optional else name
            for name, port in item.ports.items()
            if port.domain == domain
        )
        + f": {domain}"
        for domain in domains
    )


def _keys(keys: Mapping[str, DescribedKey]) -> str:
    """Those that must be given first, with their units."""
    order = sorted(keys, key=lambda name: not keys[name].required)
    return ", ".join(
        _key(name, keys[name]) if keys[name].required else f"({_key(name, keys[name])})"
        for name in order
    )


def _key(name: str, key: DescribedKey) -> str:
    return f"{name} [{key.unit}]" if key.unit not in ("", "-") else name


def components_json(types: Sequence[DescribedType]) -> "ComponentsJson":
    """The same for programs, equations as LaTeX."""
    return {
        "schema": "klack-show-components/1",
        "types": {
            item.word: {
                "summary": item.summary,
                "ports": {
                    name: {"domain": port.domain, "optional": port.optional}
                    for name, port in item.ports.items()
                },
                "keys": {
                    name: {"unit": key.unit, "required": key.required, "meaning": key.meaning}
                    for name, key in item.keys.items()
                },
                "equation": item.equation,
                "source": item.source,
            }
            for item in types
        },
    }
