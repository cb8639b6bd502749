"""Which numbers of a case can be moved while its bodies stay, and how far."""

from collections.abc import Iterable, Iterator
from math import isfinite
from typing import Any

from klack.analyses.study.kinds import kind_of
from klack.app.answers import Slider
from klack.case.any_case import AnyCase, CaseTree
from klack.case.key_path import quantity_at, written_at
from klack.case.schema import Case
from klack.errors import InputError
from klack.input.problem import CaseProblem, Key
from klack.units import Kind, format_si

__all__ = ["sliders_of", "written"]

_MOST = 60
_REACH = 2.5  # times the value of the case, up; to a fifth of it, down
_FIRST: tuple[tuple[str, ...], ...] = (
    ("speed",),
    ("preload",),
    ("gap", "lift"),
    ("force",),
    ("damping", "modal"),
    ("cut_off", "roughness"),
    ("voltage", "current"),
    ("stiffness",),
    ("pressure",),
)
"""Last words of keys that most people move, in this order."""
_NEVER = ("study", "calibration", "measurement", "run", "reduction", "include", "lumped", "parts")
_STEPS = 200


def sliders_of(case: AnyCase, tree: CaseTree) -> tuple[Slider, ...]:
    """Quantities that the case has written, those that move first."""
    kind: Any = kind_of(case)
    found = []
    for place in _leaves(tree.data):
        if place[0] in _NEVER:
            continue
        try:
            quantity = quantity_at(case, place)
        except CaseProblem:
            continue
        needs_mesh = any(kind.makes_bodies(case, key) for key in case.behind(place))
        if quantity.value == 0 or not isfinite(quantity.value):
            continue
        found.append(_slider(place, quantity.kind, quantity.value, needs_mesh))
    if isinstance(case, Case):
        found += _offered(case, tree)
    moving = _in_turns(s for s in found if not s.needs_mesh)
    fixed = [s for s in found if s.needs_mesh and "profile" not in s.place]
    return tuple(moving[:_MOST] + fixed[:_MOST])


def _offered(case: Case, tree: CaseTree) -> Iterator[Slider]:
    """What an impact has though its file does not name it: a closing force, damping of bodies."""
    if written_at(tree.data, ("motion", "force")) is None:
        yield _from_zero(("motion", "force"), "closing force", "N", 100.0)
    for body in case.bodies:
        if not written_at(tree.data, ("bodies", body, "damping")):
            place = ("bodies", body, "damping", "modal")
            yield _from_zero(place, f"{body} damping modal", "", 0.05)


def _from_zero(place: Key, label: str, unit: str, high: float) -> Slider:
    return Slider(
        key=".".join(map(str, place)),
        place=place,
        label=label,
        unit=unit,
        low=0.0,
        high=high,
        start=0.0,
        step=high / _STEPS,
        needs_mesh=False,
        written="not given",
    )


def written(slider: Slider, value: float) -> str | float:
    """A value as the page shows it and the case file gets it: what is computed is what is read."""
    if not isfinite(value):
        raise InputError(slider.key, got=str(value), expected="a number", hint="move the slider.")
    text = slider.text(value)
    return text if slider.unit else float(text)


def _slider(place: Key, kind: Kind, value: float, needs_mesh: bool) -> Slider:
    unit = "" if kind.bare else kind.unit
    low, high = sorted((0.2 * value, _REACH * value))
    if kind.bare and 0 < value < 1:
        high = min(high, 0.99)
    return Slider(
        key=".".join(map(str, place)),
        place=place,
        label=_label(place),
        unit=unit,
        low=low,
        high=high,
        start=value,
        step=(high - low) / _STEPS,
        needs_mesh=needs_mesh,
        written=format_si(value, unit),
    )


def _label(place: Key) -> str:
    """``network.components.spring.preload`` is ``spring preload``."""
    parts = [str(part) for part in place]
    for start in (["network", "components"], ["bodies"], ["parameters"]):
        if parts[: len(start)] == start:
            parts = parts[len(start) :]
    return " ".join(part.replace("_", " ") for part in parts if part != "motion")


def _rank(slider: Slider) -> tuple[int, str]:
    if slider.place[0] == "parameters":  # named by who wrote the case
        return -1, slider.key
    if slider.place[0] == "noise":
        return len(_FIRST) + 1, slider.key
    last = str(slider.place[-1])
    for rank, words in enumerate(_FIRST):
        if any(word in last for word in words):
            return rank, slider.key
    return len(_FIRST), slider.key


def _in_turns(sliders: Iterable[Slider]) -> list[Slider]:
    """Two of each kind of number, then the next two of each, in the order of :data:`_FIRST`."""
    counted: dict[int, int] = {}
    keyed = []
    for slider in sorted(sliders, key=_rank):
        rank = _rank(slider)[0]
        turn = counted[rank] = counted.get(rank, -1) + 1
        keyed.append(((turn // 2 if rank >= 0 else 0, rank, turn), slider))
    return [slider for _, slider in sorted(keyed, key=lambda item: item[0])]


def _leaves(data: Any, above: Key = ()) -> Iterator[Key]:
    items: Iterable[tuple[Any, Any]] = ()
    if isinstance(data, dict):
        items = data.items()
    elif isinstance(data, list):
        items = enumerate(data)
    else:
        yield above
    for key, value in items:
        yield from _leaves(value, (*above, key))
