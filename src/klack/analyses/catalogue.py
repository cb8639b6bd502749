"""All analyses with a record, by the name of its format; loaded on first use."""

from importlib import import_module
from pathlib import Path
from typing import Any

from klack.analyses.analysis import Analysis
from klack.analyses.store import stored_format
from klack.errors import InputError

__all__ = ["analysis_in", "load_result"]

_ANALYSES = {
    "klack impact study": "impact.analysis:IMPACT",
    "klack stroke study": "stroke.analysis:STROKE",
    "klack shots study": "shots.analysis:SHOTS",
    "klack noise study": "noise.analysis:NOISE",
    "klack calibration": "calibration.analysis:CALIBRATION",
    "klack measured strokes": "comparison.analysis:MEASURED_STROKES",
    "klack measured shots": "comparison.analysis:MEASURED_SHOTS",
}


def analysis_in(folder: Path) -> Analysis[Any]:
    """Which analysis a stored result is of.

    Raises
    ------
    InputError
        If there is no result, or it is of another kind.
    """
    name = stored_format(folder)
    if name not in _ANALYSES:
        raise InputError(
            f"result {folder}",
            got=f"a Zarr store with format {name!r}",
            expected="a result of klack",
            hint="give the result folder of a klack command; a later version of "
            "klack may have other kinds.",
        )
    module, _, attribute = _ANALYSES[name].partition(":")
    found: Analysis[Any] = getattr(import_module(f"klack.analyses.{module}"), attribute)
    return found


def load_result(folder: Path) -> Any:
    """Read a stored result of whichever kind.

    Raises
    ------
    InputError
        If there is no result, or a part of it is missing.
    """
    return analysis_in(folder).load(folder)
