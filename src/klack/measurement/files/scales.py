"""Scales that a file states beside its numbers: applied if they are known, else told.

Known are those of netCDF: ``value = stored * scale_factor + add_offset``; stored numbers equal to
``_FillValue`` or ``missing_value``, or outside ``valid_min`` to ``valid_max``, are missing.  Any
other key that sounds like a scale makes the numbers doubtful: what it means is not guessed.
"""

import re
from collections.abc import Callable, Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from klack.measurement.files.clock import instant

__all__ = ["PACKED", "unknown_scales", "unpacked"]

Vector = NDArray[np.float64]
About = Mapping[str, str | float]

_FACTOR, _OFFSET = PACKED = "scale_factor", "add_offset"
_MISSING = ("_fillvalue", "missing_value")
_SCALE = re.compile(
    r"(scal(e|ing)|gain|factor|slope|offset|intercept|sensitivity|calib|multipl|coeff|polynom|"
    r"(per|_per_)(bit|count|lsb|volt|digit)|\blsb\b|^_unsigned$)",
    re.IGNORECASE,
)
_NUMBER = re.compile(r"\s*[-+]?[.\d]")
_OF_THE_FILE = re.compile(r"(wf_|ni_|dimension|class$|name$|_netcdf|crest)", re.IGNORECASE)


def unpacked(about: About) -> Callable[[Vector], Vector] | None:
    """Function from stored numbers to values; None if they are the values."""
    factor, offset = _number(about, _FACTOR, 1.0), _number(about, _OFFSET, 0.0)
    missing = [value for key in _MISSING if isinstance(value := about.get(key), float)]
    low, high = _number(about, "valid_min", -np.inf), _number(about, "valid_max", np.inf)
    if (factor, offset, low, high) == (1.0, 0.0, -np.inf, np.inf) and not missing:
        return None

    def values(stored: Vector) -> Vector:
        absent = np.isin(stored, missing) | (stored < low) | (stored > high)
        return np.where(absent, np.nan, stored * factor + offset)

    return values


def _number(about: About, key: str, otherwise: float) -> float:
    value = about.get(key)
    return value if isinstance(value, float) else otherwise


def unknown_scales(about: Mapping[str, object], known: Collection[str] = ()) -> str:
    """Keys that sound like a scale, with their values; those that change nothing are left out.

    Those that are ``known`` are applied, if they are numbers.
    """
    found = []
    for key, value in about.items():
        if _OF_THE_FILE.match(key) or not _SCALE.search(key):
            continue
        if key in known and isinstance(value, float):
            continue
        text = str(value).strip()
        if isinstance(value, str) and (not _NUMBER.match(text) or instant(text) is not None):
            continue
        neutral = 0.0 if re.search("offset|intercept", key, re.IGNORECASE) else 1.0
        if not (isinstance(value, int | float) and float(value) == neutral):
            found.append(f"{key} = {text[:40]}")
    return ", ".join(found)
