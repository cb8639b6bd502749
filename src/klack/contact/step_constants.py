"""Constants of the laws and of the time step that C, Modelica and MATLAB exports share.

Python imports them by name, exports take them from :func:`shared_constants`; they are written
nowhere else.
"""

import sys
from typing import Annotated, NamedTuple, get_args, get_origin, get_type_hints

__all__ = [
    "FILM_NEWTON_LIMIT",
    "FORCE_LEFT",
    "HERTZ_EQUAL",
    "HERTZ_SERIES_BELOW",
    "LANES",
    "LAW_HERTZ",
    "LAW_LINEAR",
    "LAW_RUBBING",
    "LAW_TABLE",
    "LAW_YIELDING",
    "LEAST_WAY",
    "LEFT_BY_FILM",
    "LOG_SERIES_BELOW",
    "MATLAB_LEFT",
    "MATLAB_TURNS",
    "MODELICA_POWER_TURNS",
    "MODELICA_TABLE_TURNS",
    "NEWTON_LIMIT",
    "NO_LAW",
    "RELAXATION",
    "ROUND_OFF",
    "RUBBED_LEFT",
    "SEPARATED",
    "SETTLED",
    "SLOWEST",
    "STEP_LEFT",
    "SWEEPS",
    "TAYLOR_BELOW",
    "TAYLOR_TERMS",
    "TOUCH",
    "SharedConstant",
    "shared_constants",
]

# kinds of a law as flat numbers
NO_LAW: Annotated[int, "C", "only a film, no contact"] = -1
LAW_LINEAR: Annotated[int, "C", "numbers: k"] = 0
LAW_HERTZ: Annotated[int, "C", "numbers: K, n"] = 1
LAW_TABLE: Annotated[int, "C", "numbers: intervals, then six for each"] = 2
LAW_RUBBING: Annotated[int, "", "springs, ratio, then five numbers of each"] = 3
LAW_YIELDING: Annotated[int, "", "states, places, largest indentation, then tables"] = 4

# contact equation of a step
FORCE_LEFT: Annotated[float, "C", "accepted error of a force over the force"] = 1e-11
STEP_LEFT: Annotated[
    float, "C", "last Newton step over the indentation; what is left of the force is its square"
] = 3e-7
RUBBED_LEFT: Annotated[
    float, "", "the same of a law with friction, whose kinks leave no smaller error"
] = 1e-13
TOUCH: Annotated[
    float, "C", "[m] that a contact is closed by at least; the squares of less are no numbers"
] = 1e-150
NEWTON_LIMIT: Annotated[int, "C", "of a contact without a film"] = 60
HERTZ_SERIES_BELOW: Annotated[
    float, "C", "half change over the mean indentation: the mean of d^n is a short series"
] = 5e-3
HERTZ_EQUAL: Annotated[float, "C", "change over the indentation: the slope is the tangent's"] = 1e-8

# squeeze films
FILM_NEWTON_LIMIT: Annotated[int, "C", "of a film, with or without contact"] = 100
ROUND_OFF: Annotated[float, "C", "of the equation of a film, over its gaps"] = 1e-15
LEFT_BY_FILM: Annotated[
    float, "C", "share of the compression that a film must have made to end at first touch"
] = 0.01
LOG_SERIES_BELOW: Annotated[
    float, "C", "change over the sum of two gaps: the logarithm is a short series"
] = 0.05

# steps
SEPARATED: Annotated[
    float, "C", "gap over the deepest indentation at which a contact forgets its approach speed"
] = 0.1
SLOWEST: Annotated[float, "C", "[m/s] least approach speed of a damped law"] = 1e-3
LEAST_WAY: Annotated[float, "C", "[m] least way of the gap over the step of onset"] = 1e-30
SWEEPS: Annotated[int, "C", "over several contacts in a step"] = 500
SETTLED: Annotated[
    float, "C", "change of a gap over the largest change that a contact force makes"
] = 1e-11
TAYLOR_BELOW: Annotated[
    float, "C", "of max(1, zeta) omega h; the closed form of B1 has 1e-14 left there"
] = 0.05
TAYLOR_TERMS: Annotated[int, "C", "(0.1)^14 is below round-off"] = 14
LANES: Annotated[
    int, "C", "modes of a pass at once, on every processor; they are filled up to a multiple"
] = 8

# continuous equations
RELAXATION: Annotated[
    float, "Modelica MATLAB", "time constant of a series compliance under a weak film, in steps"
] = 0.2
MATLAB_TURNS: Annotated[int, "MATLAB", "Newton steps of a law in series at most"] = 60
MATLAB_LEFT: Annotated[float, "MATLAB", "last of them over the overlap"] = 1e-15
MODELICA_POWER_TURNS: Annotated[int, "Modelica", "Newton steps, all taken: a power law"] = 40
MODELICA_TABLE_TURNS: Annotated[int, "Modelica", "Newton steps, all taken: a table"] = 20


class SharedConstant(NamedTuple):
    """A constant as an export writes it."""

    name: str
    value: float
    meaning: str


def shared_constants(language: str) -> tuple[SharedConstant, ...]:
    """Constants of "C", "Modelica" or "MATLAB" text, in their order here."""
    return tuple(
        SharedConstant(name, globals()[name], meaning)
        for name, hint in get_type_hints(sys.modules[__name__], include_extras=True).items()
        if get_origin(hint) is Annotated
        for _, languages, meaning in [get_args(hint)]
        if language in languages.split()
    )
