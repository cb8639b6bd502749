"""Curves of a result as xarray and pandas have them: all axes, one axis, one table, one curve."""

from collections.abc import Mapping
from difflib import get_close_matches
from math import prod
from typing import Any

from pandas import DataFrame
from xarray import DataArray, Dataset

from klack.errors import InputError

__all__ = ["Curves", "UnknownCurve", "curve_of", "frame_of", "over_axis"]


_SHOWN = 12  # names in a message


class UnknownCurve(InputError, KeyError):
    """No curve of that name, or several."""

    __str__ = InputError.__str__  # a KeyError would show its text in quotes


class Curves(Dataset):
    """A dataset whose curves need not share their axis, so not all of it fits in one table."""

    __slots__ = ()

    def to_dataframe(self, *given: Any, **named: Any) -> DataFrame:
        """As of xarray, where one variable has all dimensions.

        Raises
        ------
        InputError
            For several axes: a table would have a row for each of their combinations.
        """
        sizes = dict(self.sizes)
        if not sizes or any(item.dims and set(item.dims) == set(sizes) for item in self.values()):
            return super().to_dataframe(*given, **named)
        axes = ", ".join(f"{name} ({size})" for name, size in sizes.items())
        raise InputError(
            "to_dataframe",
            got=f"different axes: {axes}; {prod(sizes.values()):.2g} rows in one table",
            expected="curves over one axis",
            hint=f'result.to_dataframe(axis="{next(iter(sizes))}"), or some of the curves: '
            'data[["NAME", "NAME"]].to_dataframe().',
        )


def over_axis(data: Dataset, axis: str) -> Dataset:
    """Curves whose last dimension is one axis, without single numbers.

    Raises
    ------
    InputError
        If there is no such axis.
    """
    names = [name for name, item in data.items() if item.dims[-1:] == (axis,)]
    if not names:
        axes = dict.fromkeys(item.dims[-1] for item in data.values() if item.dims)
        raise InputError(
            "axis",
            got=f"'{axis}'",
            expected=f"one of: {', '.join(map(str, axes))}",
            hint="name an axis of this result.",
        )
    return data[names]


def frame_of(data: Dataset, axis: str | None) -> DataFrame:
    """Curves over one axis as columns, by default over the first; ``attrs["units"]`` by column."""
    part = over_axis(data, str(next(iter(data.dims))) if axis is None else axis)
    frame = part.to_dataframe()
    units = {name: item.attrs["units"] for name, item in part.items() if "units" in item.attrs}
    frame.attrs["units"] = units
    return frame


def curve_of(data: Dataset, name: str, short: Mapping[str, str]) -> DataArray:
    """Curve, or number, of a name: in full, with underscores, short, or by some of its words.

    Parameters
    ----------
    short
        Names that records have for some channels: ``"lift"``.

    Raises
    ------
    UnknownCurve
        Also a :class:`KeyError`; with names that it could be.
    """
    full = {str(item.attrs.get("long_name", "")): key for key, item in data.items()}
    wanted = short.get(name, name)
    if wanted in data:
        return data[wanted]
    if wanted in full:
        return data[full[wanted]]
    words = set(str(name).lower().replace("_", " ").replace(".", " ").split())
    curves = [str(key) for key, item in data.items() if item.dims]
    found = [key for key in curves if words and words <= set(key.lower().split("_"))]
    main = [key for key in found if data[key].dims[-1] == next(iter(data.dims))]
    found = main or found
    if len(found) == 1:
        return data[found[0]]
    near = found or get_close_matches(str(name), curves, _SHOWN, 0.5) or curves
    more = f" and {len(near) - _SHOWN} more" if len(near) > _SHOWN else ""
    raise UnknownCurve(
        f"result[{name!r}]",
        got="a name of several curves" if found else "a name that the result does not contain",
        expected=f"one of: {', '.join(near[:_SHOWN])}{more}",
        hint="list(result) gives all names.",
    )
