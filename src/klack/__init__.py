"""klack predicts how a valve needle hits its end stops.

Contact force, contact time, restitution, bounces, and the structure-borne sound that follows.

In a notebook::

    import klack

    case = klack.load_case("demo-valve-axisymmetric")
    impact = klack.run_impact(case, levels=["reduced"])
    impact.measures["reduced"]["peak_force"]  # 123.5 N

These names are loaded from :mod:`klack.api` when they are first asked for.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from klack.api import (
        CaseOnHand,
        Number,
        PointTable,
        Result,
        RunsInterrupted,
        calibrate,
        compare,
        load_case,
        load_result,
        noise_of,
        optimise,
        run_heat,
        run_impact,
        run_magnet,
        run_many,
        run_shots,
        run_stroke,
        run_study,
        sensitivities,
    )

__all__ = [
    "CaseOnHand",
    "Number",
    "PointTable",
    "Result",
    "RunsInterrupted",
    "__version__",
    "calibrate",
    "compare",
    "load_case",
    "load_result",
    "noise_of",
    "optimise",
    "run_heat",
    "run_impact",
    "run_magnet",
    "run_many",
    "run_shots",
    "run_stroke",
    "run_study",
    "sensitivities",
]

__version__ = "0.2.0"


def __getattr__(name: str) -> Any:
    """Load the names for notebooks, with their libraries, on first use."""
    if name not in __all__:
        raise AttributeError(f"module 'klack' has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module("klack.api"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
