"""Parameters of ``klack calibrate``, found in their case and checked."""

from dataclasses import dataclass

from klack.case.key_path import Quantity, quantity_at, split_path
from klack.case.measurement import CalibrationParameter
from klack.case.valve_sections import ValveSections
from klack.errors import InputError
from klack.input.problem import CaseProblem, Key, nearest, one_of, refuse_key_if
from klack.units import Kind, format_si

__all__ = ["FreeParameter", "free_parameters"]


@dataclass(frozen=True, slots=True)
class FreeParameter:
    """Fitted parameter in SI, with the keys that get its value."""

    name: str
    places: tuple[Quantity, ...]
    lower: float
    upper: float
    start: float

    @property
    def kind(self) -> Kind:
        """Kind of quantity."""
        return self.places[0].kind

    @property
    def unit(self) -> str:
        """SI unit; empty for a plain number."""
        return "" if self.kind.bare else self.kind.unit

    @property
    def keys(self) -> tuple[Key, ...]:
        """Paths of its keys."""
        return tuple(place.key for place in self.places)

    @property
    def of_sensor(self) -> bool:
        """True if only the sensor shows it, not the motion."""
        return all(key[0] == "measurement" for key in self.keys)


def free_parameters(case: ValveSections) -> tuple[FreeParameter, ...]:
    """Parameters of the section ``calibration``, found in the case.

    Rejects paths that lead nowhere or need new meshes, and unusable bounds (:class:`CaseProblem`).
    """
    section = case.calibration
    if section is None:
        return ()
    found = tuple(_resolved(case, name, item) for name, item in section.parameters.items())
    used: dict[Key, str] = {}
    for parameter in found:
        for i, key in enumerate(parameter.keys):
            if key in used:
                raise CaseProblem(
                    ("calibration", "parameters", parameter.name, "key", i),
                    got=f"'{parameter.places[i]}', which '{used[key]}' also fits",
                    expected="each key in one parameter",
                    hint="remove it from one of them.",
                )
            used[key] = parameter.name
    for i, name in enumerate(section.profile):
        if name not in section.parameters:
            raise CaseProblem(
                ("calibration", "profile", i),
                got=f"'{name}'",
                expected=f"one of: {one_of(section.parameters)}",
                hint=nearest(name, section.parameters, "name a parameter of this section."),
            )
    return found


def _resolved(case: ValveSections, name: str, item: CalibrationParameter) -> FreeParameter:
    where: Key = ("calibration", "parameters", name)
    places = []
    for i, text in enumerate(item.key):
        at: Key = (*where, "key", i) if len(item.key) > 1 else (*where, "key")
        try:
            key = split_path(text)
            for behind in case.behind(key):
                _require_cheap(behind, text, direct=behind == key)
            places.append(quantity_at(case, key))
        except CaseProblem as problem:
            raise CaseProblem(
                at, got=problem.got, expected=problem.expected, hint=problem.hint
            ) from None
    first = places[0]
    for i, place in enumerate(places[1:], 1):
        refuse_key_if(
            place.kind != first.kind or place.value != first.value,
            (*where, "key", i),
            got=f"{place} = {format_si(place.value, place.kind.unit)}",
            expected=f"the same as {first} = {format_si(first.value, first.kind.unit)}",
            hint="keys of one parameter share one value; make them two parameters.",
        )
    bounds = {side: _bound(places, where, side, getattr(item, side)) for side in ("lower", "upper")}
    lower, upper = bounds["lower"], bounds["upper"]
    unit = first.kind.unit
    refuse_key_if(
        not lower < upper,
        (*where, "upper"),
        got=format_si(upper, unit),
        expected=f"more than the lower bound, {format_si(lower, unit)}",
        hint="swap them, or check the units.",
    )
    refuse_key_if(
        not lower <= first.value <= upper,
        where,
        got=f"bounds from {format_si(lower, unit)} to {format_si(upper, unit)}",
        expected=f"bounds around {format_si(first.value, unit)}, the value in the case",
        hint="the search begins at the value of the case: change the value or the bounds.",
    )
    return FreeParameter(name, tuple(places), lower, upper, first.value)


def _require_cheap(key: Key, text: str, *, direct: bool) -> None:
    """Only what leaves meshes, modes and contact laws can be fitted.

    Sensor parameters are fitted apart from the motion, by their own keys (``direct``).
    """
    allowed = (
        key[:1] == ("network",)
        or (key[:2] == ("measurement", "sensor") and direct)
        or (key[:1] == ("bodies",) and key[2:3] == ("damping",))
    )
    if allowed:
        return
    meshed = key[0] in ("bodies", "materials", "stops", "reduction")
    raise CaseProblem(
        (),
        got=f"'{text}'" + (", which needs new meshes, modes and contact laws" if meshed else ""),
        expected="a key of network, of measurement.sensor, or bodies.NAME.damping",
        hint="change it in the case, and compare two calibrations."
        if meshed
        else "fit properties of the valve or its sensor.",
    )


def _bound(places: list[Quantity], where: Key, side: str, text: str | float) -> float:
    try:
        return next(place.parse(text) for place in places)
    except InputError as problem:
        raise CaseProblem(
            (*where, side), got=problem.got, expected=problem.expected, hint=problem.hint
        ) from None
